//! Delays of the commands and of the measurements of a plant.
//!
//! The design of a gain needs a plant with finitely many states; a frequency response does not. The loop is therefore
//! designed with an approximation of each delay, then compared with the exact delays, see [`Delays::exact`].

use crate::blocks::{ComplexMatrix, to_complex};
use crate::check::as_number;
use crate::eigen::complex_eigenvalues;
use crate::hold::zero_order_hold;
use crate::response::frequency_response;
use crate::robustness::{Loop, PlantEntry};
use crate::svd::ComplexSvd;
use crate::{Domain, Error, StateSpace, check};
use nalgebra::{Complex, DMatrix, DVector};

/// A delay that is below a whole number of samples by at most this fraction of a sample counts as this number.
const WHOLE: f64 = 1e-9;

/// Returns A and b of the Pade approximant of e^(-s) with numerator degree q - 1 and denominator degree q.
///
/// ```text
/// z' = A z + b u,  y = z_1,   A: q x q
/// ```
///
/// `order`: q. The delay is one unit of time; for a delay d divide A and b by d. The approximant is strictly proper, so
/// that it smooths a jump of the command, and has the delay's moments up to the order 2 q - 1. In terms of the Legendre
/// coefficients m of u over the last unit of time,
///
/// ```text
/// m_i' = (2 i + 1) ((-1)^i u - sum over j of g_ij m_j),  g_ij = 1 for i < j, (-1)^(i - j) otherwise,  y = sum of m_i
/// ```
///
/// With `z_1` = y in place of `m_0`, A and b have small integer entries. A constant u leads to z = [u, 0, ..., 0].
///
/// Sources: M. Vajta, Some remarks on Pade approximations (2000), for the degree of the numerator; A. R. Voelker, I.
/// Kajic, C. Eliasmith, Legendre memory units, Advances in Neural Information Processing Systems 32 (2019), (1), for
/// the Legendre form.
///
/// # Example
///
/// ```
/// // (1 - s/3) / (1 + 2 s/3 + s^2/6) = (6 - 2 s) / (6 + 4 s + s^2)
/// let (a, b) = control::delay::pade(2);
/// assert_eq!((a.trace(), a.determinant()), (-4.0, 6.0));
/// assert_eq!(b[0], -2.0);
/// ```
#[must_use]
pub fn pade(order: usize) -> (DMatrix<f64>, DVector<f64>) {
    let sign = |exponent: usize| if exponent.is_multiple_of(2) { 1.0 } else { -1.0 };
    let scale = |i: usize| as_number(2 * i + 1);
    let g = |i: usize, j: usize| if i < j { 1.0 } else { sign(i - j) };
    let legendre = DMatrix::from_fn(order, order, |i, j| -scale(i) * g(i, j));
    let input = DVector::from_fn(order, |i, _| scale(i) * sign(i));
    // z = T m: z_1 is the sum of all m.
    let to_z = DMatrix::from_fn(order, order, |i, j| f64::from(u8::from(i == 0 || i == j)));
    let from_z = DMatrix::from_fn(order, order, |i, j| match (i, j) {
        (0, j) if j > 0 => -1.0,
        (i, j) => f64::from(u8::from(i == j)),
    });
    (&to_z * legendre * from_z, to_z * input)
}

/// The delays of a plant: of each command before it acts, of each measurement before it arrives.
#[derive(Debug, Clone, PartialEq)]
pub struct Delays {
    /// Delay of each command, s; not negative.
    pub inputs: Vec<f64>,
    /// Delay of each measurement, s; not negative.
    pub outputs: Vec<f64>,
}

/// The result of [`Delays::exact`]: a loop with exact delays, compared with the same loop with approximated delays.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ExactLoop {
    /// The largest spectral radius of K (G - `G_a`) S over the frequencies: the plant G with exact delays, its
    /// approximation `G_a`, the controller K, the sensitivity S with `G_a`. Below 1 the loop with G is stable, because
    /// the loop with `G_a` is stable and no loop between the two has a pole on the stability limit.
    pub radius: f64,
    /// The frequency of `radius` in rad/s.
    pub frequency: f64,
    /// The peaks over frequency of the largest singular value of S with exact delays: at the commands, then at the
    /// measurements.
    pub peaks: [f64; 2],
}

impl Delays {
    /// Whether any delay is above zero.
    #[must_use]
    pub fn any(&self) -> bool {
        self.inputs.iter().chain(&self.outputs).any(|delay| *delay > 0.0)
    }

    /// The longest delay from a command to a measurement, s.
    #[must_use]
    pub fn longest(&self) -> f64 {
        let most = |all: &[f64]| all.iter().copied().fold(0.0, f64::max);
        most(&self.inputs) + most(&self.outputs)
    }

    /// Number of states that the approximants of `order` add, one approximant for each delay above zero.
    #[must_use]
    pub fn states(&self, order: usize) -> usize {
        let delayed = self.inputs.iter().chain(&self.outputs).filter(|delay| **delay > 0.0);
        order * delayed.count()
    }

    /// For each command, and for each measurement, the first state of its delay, counted from the first state of all
    /// delays; None without a delay.
    fn first_states(&self, order: usize) -> [Vec<Option<usize>>; 2] {
        let mut next = 0;
        let mut first = |delay: &f64| {
            (*delay > 0.0).then(|| {
                next += order;
                next - order
            })
        };
        let inputs = self.inputs.iter().map(&mut first).collect();
        [inputs, self.outputs.iter().map(&mut first).collect()]
    }

    /// Checks the plant, and that each command and each measurement has a delay, finite and not below zero.
    fn check(&self, plant: &StateSpace) -> Result<(), Error> {
        plant.check()?;
        check::length("the delays of the commands", &self.inputs, plant.b.ncols())?;
        check::length("the delays of the measurements", &self.outputs, plant.c.nrows())?;
        for &delay in self.inputs.iter().chain(&self.outputs) {
            let holds = delay.is_finite() && delay >= 0.0;
            check::that(holds, "a delay", delay, "finite and not below zero")?;
        }
        Ok(())
    }

    /// Builds the plant with its delays, each approximated by [`pade`] of `order`.
    ///
    /// ```text
    /// command:      z' = A_q / d z + b_q / d u,             z_1 takes the place of u
    /// measurement:  z' = A_q' / d z + e_1 (C x + D u),      y = b_q' / d z
    /// ```
    ///
    /// `plant`: in continuous time, n states, m commands, p measurements; `order`: one or more. The states of the
    /// delays, in the order of the commands and then of the measurements, follow the states of the plant. Each entry of
    /// B, C and D of `plant` is one entry of the result, see [`Delays::entry`].
    ///
    /// # Errors
    ///
    /// Same as [`StateSpace::check`]; [`Error::Shape`] unless each command and each measurement has a delay;
    /// [`Error::OutOfRange`] for a delay that is negative or not finite, or for a bad `order`.
    pub fn approximated(&self, plant: &StateSpace, order: usize) -> Result<StateSpace, Error> {
        self.check(plant)?;
        let holds = order > 0 || !self.any();
        check::that(holds, "the order of the approximation", as_number(order), "one or more")?;
        let (n, (p, m)) = (plant.a.nrows(), plant.d.shape());
        let all = n + self.states(order);
        let mut extended = StateSpace {
            a: plant.a.clone().resize(all, all, 0.0),
            b: DMatrix::zeros(all, m),
            c: DMatrix::zeros(p, all),
            d: DMatrix::zeros(p, m),
            domain: plant.domain,
        };
        let (dynamics, response) = pade(order);
        let [inputs, outputs] = self.first_states(order);
        for (command, (first, delay)) in inputs.iter().zip(&self.inputs).enumerate() {
            let Some(at) = first.map(|first| n + first) else { continue };
            extended.a.view_mut((at, at), (order, order)).copy_from(&(&dynamics / *delay));
            extended.b.view_mut((at, command), (order, 1)).copy_from(&(&response / *delay));
        }
        for (measurement, (first, delay)) in outputs.iter().zip(&self.outputs).enumerate() {
            let Some(at) = first.map(|first| n + first) else { continue };
            let transposed = dynamics.transpose() / *delay;
            extended.a.view_mut((at, at), (order, order)).copy_from(&transposed);
            let row = response.transpose() / *delay;
            extended.c.view_mut((measurement, at), (1, order)).copy_from(&row);
        }
        for (matrix, values) in [(1, &plant.b), (2, &plant.c), (3, &plant.d)] {
            for row in 0..values.nrows() {
                for column in 0..values.ncols() {
                    let at = self.entry(n, order, PlantEntry { matrix, row, column });
                    let StateSpace { a, b, c, d, .. } = &mut extended;
                    [a, b, c, d][at.matrix][(at.row, at.column)] = values[(row, column)];
                }
            }
        }
        Ok(extended)
    }

    /// The position of an entry of the plant, which has n states, in the result of [`Delays::approximated`].
    #[must_use]
    pub fn entry(&self, n: usize, order: usize, entry: PlantEntry) -> PlantEntry {
        let PlantEntry { matrix, row, column } = entry;
        if matrix == 0 {
            return entry;
        }
        let [inputs, outputs] = self.first_states(order);
        let (of_measurement, of_command) = (matrix >= 2, matrix % 2 == 1);
        let first = |all: &[Option<usize>], at: usize, is_signal: bool| {
            all.get(at).copied().flatten().filter(|_| is_signal).map(|first| n + first)
        };
        let chain_row = first(&outputs, row, of_measurement);
        let chain_column = first(&inputs, column, of_command);
        let is_output = of_measurement && chain_row.is_none();
        let is_input = of_command && chain_column.is_none();
        PlantEntry {
            matrix: 2 * usize::from(is_output) + usize::from(is_input),
            row: chain_row.unwrap_or(row),
            column: chain_column.unwrap_or(column),
        }
    }

    /// Extracts the matrices of the plant without delays, with n states, from the matrices of [`Delays::approximated`].
    #[must_use]
    pub fn of_plant(&self, n: usize, order: usize, all: &[DMatrix<f64>; 4]) -> [DMatrix<f64>; 4] {
        let (p, m) = (self.outputs.len(), self.inputs.len());
        let part = |matrix: usize, rows: usize, columns: usize| {
            DMatrix::from_fn(rows, columns, |row, column| {
                let PlantEntry { matrix, row, column } =
                    self.entry(n, order, PlantEntry { matrix, row, column });
                all[matrix][(row, column)]
            })
        };
        [part(0, n, n), part(1, n, m), part(2, p, n), part(3, p, m)]
    }

    /// Compares a loop with approximated delays with the same loop with exact delays.
    ///
    /// ```text
    /// continuous:            G_ij(j w) = (c_i (j w I - A)^-1 b_j + d_ij) e^(-j w d),   d = d_i + d_j
    /// sampled every T,       G_ij(z) = z^-(k + 1) (c_i e^(A g) (z I - Phi(T))^-1 Gamma_j(T) + c_i Gamma_j(g) + d_ij)
    /// d = k T + T - g:       Phi(g) = e^(A g), Gamma(g) = integral of e^(A s) b from 0 to g
    /// ```
    ///
    /// d is the delay of measurement i plus the delay of command j, k is a whole number, 0 < g <= T. `plant`: in
    /// continuous time, without its delays; `closed`: the loop with an approximation, stable; `frequencies`: in rad/s,
    /// in sampled time up to pi / T. A sample is taken before the command changes.
    ///
    /// Sources: J. C. Doyle, G. Stein, IEEE Trans. Autom. Control 26 (1981), for the stability between two loops; E. I.
    /// Jury, Theory and application of the z-transform method (1964), for the samples (modified z-transform).
    ///
    /// # Errors
    ///
    /// Same as [`Delays::approximated`], [`frequency_response`] and [`zero_order_hold`]; [`Error::Shape`] for a loop
    /// with other signals than `plant`; [`Error::Overflow`] for a loop with a pole at a frequency.
    pub fn exact(
        &self,
        plant: &StateSpace,
        closed: &Loop,
        frequencies: &[f64],
    ) -> Result<ExactLoop, Error> {
        self.check(plant)?;
        check::shape("D", &plant.d, closed.plant().d.shape())?;
        let exact = self.responses(plant, closed.plant().domain, frequencies)?;
        let approximate = frequency_response(closed.plant(), frequencies)?;
        let controller = frequency_response(closed.controller(), frequencies)?;
        let mut result = ExactLoop { radius: 0.0, frequency: 0.0, peaks: [0.0; 2] };
        for ((exact, approximate), controller) in exact.iter().zip(&approximate).zip(&controller) {
            let (k, frequency) = (&controller.gain, controller.frequency);
            let deviation = k * (exact - &approximate.gain) * sensitivity(k, &approximate.gain)?;
            let values = complex_eigenvalues(&deviation)?;
            let radius = values.iter().map(|value| value.norm()).fold(0.0, f64::max);
            if radius > result.radius {
                (result.radius, result.frequency) = (radius, frequency);
            }
            for (peak, s) in
                result.peaks.iter_mut().zip([sensitivity(k, exact)?, sensitivity(exact, k)?])
            {
                let values = ComplexSvd::new(&s)?.values();
                *peak = values.into_iter().fold(*peak, f64::max);
            }
        }
        Ok(result)
    }

    /// The response G, p x m, with exact delays at each of `frequencies`.
    pub(crate) fn responses(
        &self,
        plant: &StateSpace,
        domain: Domain,
        frequencies: &[f64],
    ) -> Result<Vec<ComplexMatrix>, Error> {
        let (p, m) = plant.d.shape();
        let mut all = vec![DMatrix::zeros(p, m); frequencies.len()];
        for (row, column) in (0..p).flat_map(|row| (0..m).map(move |column| (row, column))) {
            let delay = self.outputs[row] + self.inputs[column];
            let path = plant.path(row, column);
            let (path, lag) = match domain {
                Domain::Continuous => (path, delay),
                Domain::Sampled { period } => sampled_path(&path, delay, period)?,
            };
            let points = frequency_response(&path, frequencies)?;
            for (response, point) in all.iter_mut().zip(points) {
                let phase = Complex::from_polar(1.0, -point.frequency * lag);
                response[(row, column)] = point.gain[(0, 0)] * phase;
            }
        }
        Ok(all)
    }
}

/// Discretises a path with a delay; returns the sampled path without the whole samples of its lag, and these samples in
/// s.
fn sampled_path(path: &StateSpace, delay: f64, period: f64) -> Result<(StateSpace, f64), Error> {
    check::positive("the sample time", period)?;
    let samples = (delay / period + WHOLE).floor();
    // g of `Delays::exact`: sample n measures the state at the time g after sample n - k - 1, k = `samples`.
    let g = period - (delay - samples * period).max(0.0);
    let (phi, gamma) = zero_order_hold(&path.a, &path.b, period)?;
    let (phi_g, gamma_g) = zero_order_hold(&path.a, &path.b, g)?;
    let system = StateSpace {
        a: phi,
        b: gamma,
        c: &path.c * phi_g,
        d: &path.c * gamma_g + &path.d,
        domain: Domain::Sampled { period },
    };
    Ok((system, (samples + 1.0) * period))
}

/// (I - X Y)^-1; [`Error::Overflow`] if it does not exist.
fn sensitivity(x: &ComplexMatrix, y: &ComplexMatrix) -> Result<ComplexMatrix, Error> {
    let size = x.nrows();
    let difference = to_complex(&DMatrix::identity(size, size)) - x * y;
    difference.try_inverse().ok_or(Error::Overflow { what: "S" })
}

#[cfg(test)]
mod tests;
