//! State feedbacks with entries that must be zero: PI and PID controllers, low order, decentralised control.

use crate::check::as_number;
use crate::lyapunov::{discrete_lyapunov, lyapunov};
use crate::robustness::uniform;
use crate::stability::instability;
use crate::svd::Svd;
use crate::{Domain, Error, check};
use nalgebra::DMatrix;

/// The largest number of steps of the search, and of successive steps without success.
const STEPS: usize = 4000;
const IDLE: usize = 400;
/// Factor of the step length after a success; with [`SHORTER`] after each failure, one success in five steps keeps it.
const LONGER: f64 = 1.5;
const SHORTER: f64 = 0.903_602;
/// Singular values of the signals' correlation below this fraction of the largest count as rounding errors.
const ROUNDING: f64 = 1e-10;
/// Multiples of the start that are tried first: a stable plant stays stable with small gains of the right signs.
const SCALES: [f64; 4] = [0.3, 0.1, 0.03, 0.01];
const SEED: u64 = 1;

/// A plant with the entries of its state feedback that may differ from zero.
#[derive(Debug, Clone, Copy)]
pub struct Structure<'a> {
    /// A, n x n.
    pub a: &'a DMatrix<f64>,
    /// B, n x m.
    pub b: &'a DMatrix<f64>,
    /// Row and column, from zero, of each entry of K, m x n, that may differ from zero.
    pub free: &'a [(usize, usize)],
    /// The time domain of A and B.
    pub domain: Domain,
}

impl Structure<'_> {
    /// The feedback with the free entries of this structure whose commands are nearest to those of u = K x, with white
    /// noise added to the commands:
    ///
    /// ```text
    /// k_s = k X S' (S X S')^+,   (A + B K) X + X (A + B K)' + B B' = 0
    /// ```
    ///
    /// for each row k of K, where S selects the states of its free entries; in sampled time X is the covariance of the
    /// samples. The feedback minimises the mean square of the difference of the commands. States that no command
    /// reaches have zero gains. The loop may be unstable.
    ///
    /// `k`: m x n, such that A + B K is stable. Source: W. S. Levine, T. L. Johnson, M. Athans, Optimal limited state
    /// variable feedback controllers for linear systems, IEEE Trans. Autom. Control 16 (1971), for the covariance.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`] for matrices that do not fit; [`Error::OutOfRange`] for a free entry that K does not have; same
    /// as [`lyapunov`] and [`discrete_lyapunov`].
    pub fn projected(&self, k: &DMatrix<f64>) -> Result<DMatrix<f64>, Error> {
        let Self { a, b, free, domain } = *self;
        self.check(k)?;
        let mut projected = DMatrix::zeros(k.nrows(), k.ncols());
        let closed = a + b * k;
        let reached = reached(&closed, b);
        if reached.is_empty() {
            return Ok(projected);
        }
        let (input, feedback) = (b.select_rows(&reached), k.select_columns(&reached));
        let closed = closed.select_rows(&reached).select_columns(&reached).transpose();
        let noise = &input * input.transpose();
        let covariance = match domain {
            Domain::Continuous => lyapunov(&closed, &noise)?.p,
            Domain::Sampled { .. } => discrete_lyapunov(&closed, &noise)?.p,
        };
        for row in 0..k.nrows() {
            let place = |entry: &(usize, usize)| reached.iter().position(|&at| at == entry.1);
            let columns = free.iter().filter(|entry| entry.0 == row).filter_map(place);
            let variance = |at: usize| covariance[(at, at)];
            let columns: Vec<_> = columns.filter(|&at| variance(at) > f64::MIN_POSITIVE).collect();
            if columns.is_empty() {
                continue;
            }
            let sizes: Vec<_> = columns.iter().map(|&at| variance(at).sqrt()).collect();
            let count = columns.len();
            let correlation = DMatrix::from_fn(count, count, |i, j| {
                covariance[(columns[i], columns[j])] / (sizes[i] * sizes[j])
            });
            let cross = feedback.row(row) * covariance.select_columns(&columns);
            let target = DMatrix::from_fn(count, 1, |i, _| cross[i] / sizes[i]);
            let svd = Svd::new(&correlation)?;
            let gains = svd.least_squares(&target, svd.rank(ROUNDING));
            for (i, column) in columns.iter().enumerate() {
                projected[(row, reached[*column])] = gains[i] / sizes[i];
            }
        }
        Ok(projected)
    }

    /// Searches a feedback of this structure whose loop has at most the instability `decay`, see [`instability`];
    /// returns the best feedback and its instability, `start` if that is sufficient.
    ///
    /// `decay`: negative; `is_over`: asked before each step, true ends the search. The result may be unstable, which
    /// does not prove that no stable feedback exists.
    ///
    /// Method: an evolution strategy with one parent and one child, whose steps are relative to the entries of the
    /// parent; the first parent is the best multiple of `start`. The same start gives the same result. The search needs
    /// no derivative: the largest real part of eigenvalues has none where two of them meet, as they often do at minima.
    ///
    /// Source: H.-G. Beyer, H.-P. Schwefel, Evolution strategies, Natural Computing 1 (2002).
    ///
    /// # Errors
    ///
    /// [`Error::Shape`] for matrices that do not fit; [`Error::OutOfRange`] for a free entry that K does not have; same
    /// as [`instability`].
    pub fn stabilised(
        &self,
        start: &DMatrix<f64>,
        decay: f64,
        is_over: &dyn Fn() -> bool,
    ) -> Result<(DMatrix<f64>, f64), Error> {
        let Self { a, b, free, domain } = *self;
        self.check(start)?;
        let value_of = |k: &DMatrix<f64>| instability(&(a + b * k), domain);
        let largest = free.iter().map(|at| start[*at].abs()).fold(0.0, f64::max);
        let least = if largest > 0.0 { 1e-3 * largest } else { 1.0 };
        let (mut best, mut value) = (start.clone(), value_of(start)?);
        for scale in SCALES {
            let scaled = start * scale;
            let scaled_value = value_of(&scaled)?;
            if value > decay && scaled_value < value {
                (best, value) = (scaled, scaled_value);
            }
        }
        let (mut random, mut length, mut idle) = (SEED, 0.3, 0);
        for _ in 0..STEPS {
            if value <= decay || idle > IDLE || is_over() {
                break;
            }
            let mut next = best.clone();
            for at in free {
                let size = best[*at].abs().max(least);
                // A sum of twelve uniform numbers is nearly normally distributed.
                let normal = (0..12).map(|_| uniform(&mut random)).sum::<f64>() - 6.0;
                next[*at] += length * size * normal;
            }
            // A step that overflows is no success.
            let next_value = value_of(&next).unwrap_or(f64::INFINITY);
            if next_value < value {
                (best, value, idle) = (next, next_value, 0);
                length = (length * LONGER).min(3.0);
            } else {
                idle += 1;
                length = (length * SHORTER).max(1e-6);
            }
        }
        Ok((best, value))
    }

    /// Checks A, B, K and the positions of the free entries.
    fn check(&self, k: &DMatrix<f64>) -> Result<(), Error> {
        let (n, m) = (check::with_inputs(self.a, self.b)?, self.b.ncols());
        check::shape("K", k, (m, n))?;
        for &(row, column) in self.free {
            let rule = "an index of K, from zero";
            check::that(row < m, "the row of a free entry", as_number(row), rule)?;
            check::that(column < n, "the column of a free entry", as_number(column), rule)?;
        }
        Ok(())
    }
}

/// The states, ascending, on which inputs with the columns of B act, directly or through other states.
fn reached(a: &DMatrix<f64>, b: &DMatrix<f64>) -> Vec<usize> {
    let n = a.nrows();
    let mut is_reached: Vec<_> = b.row_iter().map(|row| row.amax() > 0.0).collect();
    for _ in 0..n {
        for i in 0..n {
            if (0..n).any(|j| is_reached[j] && a[(i, j)] != 0.0) {
                is_reached[i] = true;
            }
        }
    }
    (0..n).filter(|&at| is_reached[at]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn double_integrator() -> (DMatrix<f64>, DMatrix<f64>) {
        let a = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, 0.0]);
        (a, DMatrix::from_column_slice(2, 1, &[0.0, 1.0]))
    }

    #[test]
    fn the_projection_of_a_feedback_of_the_structure_is_itself() -> Result<(), Error> {
        let (a, b) = double_integrator();
        let free = [(0, 0), (0, 1)];
        let k = DMatrix::from_row_slice(1, 2, &[-2.0, -3.0]);
        for (a, domain) in [
            (a.clone(), Domain::Continuous),
            (&a * 0.1 + DMatrix::identity(2, 2), Domain::Sampled { period: 0.1 }),
        ] {
            let b = if domain == Domain::Continuous { b.clone() } else { &b * 0.1 };
            let structure = Structure { a: &a, b: &b, free: &free, domain };
            let difference = (structure.projected(&k)? - &k).amax();
            assert!(difference < 1e-9, "{difference}");
        }
        Ok(())
    }

    /// x'' = u with u = -2 x - 3 x': with white noise in u, position and speed are uncorrelated, so that the best gain
    /// of the position alone is its gain in K.
    #[test]
    fn states_that_are_not_correlated_keep_their_gains() -> Result<(), Error> {
        let (a, b) = double_integrator();
        let structure = Structure { a: &a, b: &b, free: &[(0, 0)], domain: Domain::Continuous };
        let k = structure.projected(&DMatrix::from_row_slice(1, 2, &[-2.0, -3.0]))?;
        assert!((k[0] + 2.0).abs() < 1e-9 && k[1].abs() <= 0.0, "{k}");
        Ok(())
    }

    /// x = G w with w' = -w / 2 + v: the covariance G G' has rank 3, and feedbacks with the same K G have the same
    /// commands.
    #[test]
    fn dependent_states_give_the_commands_of_the_whole_feedback() -> Result<(), Error> {
        let g = [0., -1., 2., -1., 2., -2., 0., -2., -2., -2., 1., 1., 2., 2., 0.];
        let b = DMatrix::from_row_slice(5, 3, &g);
        let row = DMatrix::from_row_slice(1, 5, &[-3.0, 0.0, 1.0, 1.0, -1.0]);
        let k = row.resize_vertically(3, 0.0);
        let a = DMatrix::from_diagonal_element(5, 5, -0.5) - &b * &k;
        let free: Vec<_> = (0..5).map(|column| (0, column)).collect();
        let structure = Structure { a: &a, b: &b, free: &free, domain: Domain::Continuous };
        let difference = (structure.projected(&k)? - &k) * &b;
        assert!(difference.amax() < 1e-12, "{difference}");
        Ok(())
    }

    /// The third state acts on the others, but neither these nor the command act on it. With all entries free the other
    /// gains stay, also if the third state is constant, which no feedback makes stable.
    #[test]
    fn states_that_no_command_reaches_have_zero_gains() -> Result<(), Error> {
        for rate in [0.0, -1.0] {
            let a = [0.0, 0.0, 1.0, 1.0, -3.0, 0.0, 0.0, 0.0, rate];
            let a = DMatrix::from_row_slice(3, 3, &a);
            let b = DMatrix::from_column_slice(3, 1, &[1.0, 0.0, 0.0]);
            let free = [(0, 2), (0, 0), (0, 1)];
            let structure = Structure { a: &a, b: &b, free: &free, domain: Domain::Continuous };
            let k = structure.projected(&DMatrix::from_row_slice(1, 3, &[-2.0, -2.0, -5.0]))?;
            let expected = DMatrix::from_row_slice(1, 3, &[-2.0, -2.0, 0.0]);
            assert!((&k - expected).amax() < 1e-9, "{k}");
        }
        Ok(())
    }

    #[test]
    fn entries_outside_of_the_feedback_are_refused() {
        let (a, b) = double_integrator();
        let k = DMatrix::from_row_slice(1, 2, &[-2.0, -3.0]);
        for free in [[(0, 2)], [(1, 0)]] {
            let structure = Structure { a: &a, b: &b, free: &free, domain: Domain::Continuous };
            let refused = structure.projected(&k);
            assert!(matches!(refused, Err(Error::OutOfRange { .. })), "{refused:?}");
            let refused = structure.stabilised(&k, -0.1, &|| false);
            assert!(matches!(refused, Err(Error::OutOfRange { .. })), "{refused:?}");
        }
    }

    /// 1 / (s^2 (s + 2)) needs the rate; with it and K = (1, 1), s^3 + 2 s^2 + s + 1 is stable.
    #[test]
    fn a_stable_feedback_is_found_from_an_unstable_start() -> Result<(), Error> {
        let a = DMatrix::from_row_slice(3, 3, &[0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -2.0]);
        let b = DMatrix::from_column_slice(3, 1, &[0.0, 0.0, 1.0]);
        let domain = Domain::Continuous;
        let structure = Structure { a: &a, b: &b, free: &[(0, 0), (0, 1)], domain };
        let start = DMatrix::from_row_slice(1, 3, &[-8.0, -2.0, 0.0]);
        assert!(instability(&(&a + &b * &start), domain)? > 0.0);
        let (k, value) = structure.stabilised(&start, -0.05, &|| false)?;
        assert!(value <= -0.05 && k[2].abs() <= 0.0, "{k} {value}");
        Ok(())
    }
}
