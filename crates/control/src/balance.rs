//! Diagonal scaling of states by powers of two, which does not round.

use nalgebra::{DMatrix, DVector};

/// Largest number of sweeps over the states.
const SWEEPS: usize = 100;
/// A scaling is applied only if it reduces the sum of the norms by 5 %.
const WORTHWHILE: f64 = 0.95;
/// [`Balance::of_exponential`] also scales a state whose row or column is zero if the norm of its column or row exceeds
/// this multiple of the largest diagonal entry.
const LARGE: f64 = 1024.0;

/// Part of A below which an effect is a rounding error.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// S^-1 A S, S diagonal and positive such that row i and column i have about the same norm.
///
/// Osborne (1960), Parlett and Reinsch (1969), in the 1-norm without the diagonal. The scale of a
/// state whose row or column has no other entries is not changed.
pub(crate) struct Balance {
    pub(crate) matrix: DMatrix<f64>,
    /// The scales: the diagonal of S, powers of two.
    pub(crate) scale: DVector<f64>,
}

impl Balance {
    pub(crate) fn new(a: &DMatrix<f64>) -> Self {
        let zeros = || DVector::zeros(a.nrows());
        Self::with_signals(a, zeros(), zeros())
    }

    /// No balancing: S = I.
    pub(crate) fn none(a: &DMatrix<f64>) -> Self {
        Self { matrix: a.clone(), scale: DVector::from_element(a.nrows(), 1.0) }
    }

    /// Balances A as a part of [A, B; C, 0]. Without B and C, states that do not all act on each other would be scaled
    /// until the limit of sweeps is reached.
    ///
    /// Source: D. S. Watkins, A case where balancing is harmful, Electronic Trans. Numerical Analysis 23 (2006).
    pub(crate) fn of_system(a: &DMatrix<f64>, b: &DMatrix<f64>, c: &DMatrix<f64>) -> Self {
        let entering = DVector::from_fn(a.nrows(), |state, _| b.row(state).lp_norm(1));
        let leaving = DVector::from_fn(a.nrows(), |state, _| c.column(state).lp_norm(1));
        Self::with_signals(a, entering, leaving)
    }

    /// Balances A for its exponential: also scales a state that acts on no other state, or on which no other state
    /// acts, if its entries are large. The squarings of the exponential would mix large entries with the rates on the
    /// diagonal, which would lose a digit in every third squaring.
    pub(crate) fn of_exponential(a: &DMatrix<f64>) -> Self {
        let mut balance = Self::new(a);
        let size = a.diagonal().amax();
        for _ in 0..SWEEPS {
            let mut changed = false;
            for state in 0..a.nrows() {
                let diagonal = balance.matrix[(state, state)].abs();
                let column = balance.matrix.column(state).lp_norm(1) - diagonal;
                let row = balance.matrix.row(state).lp_norm(1) - diagonal;
                let ratio = match (column > 0.0, row > 0.0) {
                    (false, true) if row > LARGE * size => row / size,
                    (true, false) if column > LARGE * size => size / column,
                    _ => continue,
                };
                let factor = power_of_two(ratio);
                if factor.is_normal() {
                    balance.matrix.column_mut(state).scale_mut(factor);
                    balance.matrix.row_mut(state).unscale_mut(factor);
                    balance.scale[state] *= factor;
                    changed = true;
                }
            }
            if !changed {
                break;
            }
            let Self { matrix, scale } = Self::new(&balance.matrix);
            balance = Self { matrix, scale: balance.scale.component_mul(&scale) };
        }
        balance
    }

    /// Balances A, then scales the states that act on no others, or only on such states: a weak effect on one of them
    /// becomes as strong as A, unless it is a rounding error of A. Their units are free, and balancing leaves them as
    /// they are.
    pub(crate) fn with_ends(a: &DMatrix<f64>) -> Self {
        let n = a.nrows();
        let (mut ends, mut is_end) = (Vec::new(), vec![false; n]);
        let others = |state: usize| (0..n).filter(move |&other| other != state);
        let acts_on_ends = |state: usize, is_end: &[bool]| {
            others(state).all(|other| is_end[other] || a[(other, state)] == 0.0)
        };
        while let Some(end) = (0..n).find(|&state| !is_end[state] && acts_on_ends(state, &is_end)) {
            ends.push(end);
            is_end[end] = true;
        }
        let mut balance = Self::new(a);
        let size = balance.matrix.norm();
        // A state that acts on others comes before them, as its scale changes its effect.
        for &state in ends.iter().rev() {
            let row = others(state).map(|other| balance.matrix[(state, other)].abs());
            let factor = power_of_two(row.fold(0.0, f64::max) / size);
            let scale = balance.scale[state] * factor;
            if (ROUNDING..1.0).contains(&factor) && scale.is_normal() {
                balance.matrix.column_mut(state).scale_mut(factor);
                balance.matrix.row_mut(state).unscale_mut(factor);
                balance.scale[state] = scale;
            }
        }
        balance
    }

    /// Balances A. `entering`: the 1-norm of each row of B; `leaving`: the 1-norm of each column of C.
    fn with_signals(
        a: &DMatrix<f64>,
        mut entering: DVector<f64>,
        mut leaving: DVector<f64>,
    ) -> Self {
        let mut balance = Self::none(a);
        // The columns of the transpose are the rows of A, contiguous in memory.
        let mut transposed = a.transpose();
        for _ in 0..SWEEPS {
            let mut changed = false;
            for state in 0..a.nrows() {
                let signals = [leaving[state], entering[state]];
                if let Some(factor) = balance.level(&mut transposed, state, signals) {
                    leaving[state] *= factor;
                    entering[state] /= factor;
                    changed = true;
                }
            }
            if !changed {
                break;
            }
        }
        balance
    }

    /// Scales a state and returns the factor; None if the scaling would reduce the sum of the norms by less than 5 %.
    /// `signals`: the 1-norms of the state's column of C and of its row of B.
    fn level(
        &mut self,
        transposed: &mut DMatrix<f64>,
        state: usize,
        signals: [f64; 2],
    ) -> Option<f64> {
        let diagonal = self.matrix[(state, state)].abs();
        let sum =
            |m: &DMatrix<f64>| m.column(state).iter().map(|x| x.abs()).sum::<f64>() - diagonal;
        let [column, row] = [sum(&self.matrix) + signals[0], sum(transposed) + signals[1]];
        let factor = power_of_two((row / column).sqrt());
        if !factor.is_normal() || column * factor + row / factor >= WORTHWHILE * (column + row) {
            return None;
        }
        self.matrix.column_mut(state).scale_mut(factor);
        self.matrix.row_mut(state).unscale_mut(factor);
        transposed.row_mut(state).scale_mut(factor);
        transposed.column_mut(state).unscale_mut(factor);
        self.scale[state] *= factor;
        Some(factor)
    }

    /// Transforms a function M of the balanced matrix back to the coordinates of A: S M S^-1.
    pub(crate) fn restore(&self, m: &DMatrix<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] * (self.scale[i] / self.scale[j]))
    }
}

/// The power of two nearest to x > 0 on the logarithmic scale; x itself if x is zero, subnormal, infinite or NaN.
pub(crate) fn power_of_two(x: f64) -> f64 {
    if !x.is_normal() {
        return x;
    }
    let (fraction, exponent) = libm::frexp(x);
    let nearest = if fraction < std::f64::consts::FRAC_1_SQRT_2 { exponent - 1 } else { exponent };
    libm::ldexp(1.0, nearest)
}

/// [`power_of_two`] as a unit, by which a number of size x may be divided: 1 if x is zero, subnormal, infinite or NaN.
pub(crate) fn power_of_two_or_one(x: f64) -> f64 {
    let unit = power_of_two(x);
    if unit.is_normal() { unit } else { 1.0 }
}

/// Divides the rows of M by the entries of d.
pub(crate) fn divide_rows(m: &DMatrix<f64>, d: &DVector<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] / d[i])
}

/// Multiplies the rows of M by the entries of d.
pub(crate) fn multiply_rows(m: &DMatrix<f64>, d: &DVector<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] * d[i])
}

/// Multiplies the columns of M by the entries of d.
pub(crate) fn multiply_columns(m: &DMatrix<f64>, d: &DVector<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] * d[j])
}

/// Divides the columns of M by the entries of d.
pub(crate) fn divide_columns(m: &DMatrix<f64>, d: &DVector<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] / d[j])
}

/// S^-1 M S, with the diagonal S of `scale`.
pub(crate) fn similar(m: &DMatrix<f64>, scale: &DVector<f64>) -> DMatrix<f64> {
    divide_rows(&multiply_columns(m, scale), scale)
}

/// S M S, with the diagonal S of `scale`.
pub(crate) fn multiplied(m: &DMatrix<f64>, scale: &DVector<f64>) -> DMatrix<f64> {
    multiply_rows(&multiply_columns(m, scale), scale)
}

/// S^-1 M S^-1, with the diagonal S of `scale`.
pub(crate) fn divided(m: &DMatrix<f64>, scale: &DVector<f64>) -> DMatrix<f64> {
    divide_rows(&divide_columns(m, scale), scale)
}

/// The norms of the columns; 1 for a zero column.
pub(crate) fn column_lengths(m: &DMatrix<f64>) -> DVector<f64> {
    let norms = DVector::from_iterator(m.ncols(), m.column_iter().map(|column| column.norm()));
    norms.map(|norm| if norm > 0.0 { norm } else { 1.0 })
}

/// Divides each column by its norm; a zero column is not changed.
pub(crate) fn unit_columns(m: &DMatrix<f64>) -> DMatrix<f64> {
    divide_columns(m, &column_lengths(m))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn balancing_is_undone_without_rounding_and_levels_a_badly_scaled_matrix() {
        let a = DMatrix::from_row_slice(3, 3, &[1., 1e-8, 3e-9, 2e8, 2., 0.7, 5e9, 0.3, -3.]);
        let balance = Balance::new(&a);
        assert_eq!(balance.restore(&balance.matrix), a);
        assert!(balance.matrix.norm() < 10.0, "{}", balance.matrix);
    }

    #[test]
    fn the_nearest_power_of_two_is_that_of_the_rounded_logarithm() {
        let (mut x, mut count) = (3.1e-308, 0);
        while x < 1e308 {
            assert_eq!(power_of_two(x).to_bits(), x.log2().round().exp2().to_bits(), "{x:e}");
            (x, count) = (x * 1.37, count + 1);
        }
        assert!(count > 4000);
        assert!(power_of_two(f64::NAN).is_nan() && !power_of_two(f64::MAX).is_normal());
        assert_eq!(power_of_two(0.0).to_bits(), 0);
        assert_eq!(power_of_two(f64::INFINITY).to_bits(), f64::INFINITY.to_bits());
    }

    #[test]
    fn a_state_without_partners_keeps_its_scale() {
        let balance = Balance::new(&DMatrix::from_row_slice(2, 2, &[0., 1e6, 0., 0.]));
        assert_eq!(balance.scale, DVector::from_element(2, 1.0));
    }

    #[test]
    fn entries_near_the_ends_of_the_range_do_not_break_the_scaling() {
        let a = DMatrix::from_row_slice(2, 2, &[0., 1e300, 1e-300, 0.]);
        let balance = Balance::new(&a);
        assert!(balance.matrix.iter().chain(balance.scale.iter()).all(|x| x.is_finite()));
    }
}
