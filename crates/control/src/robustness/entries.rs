//! The effect of single entries of the plant's matrices on a peak of S.

use super::scaling::scaled_norm;
use super::{Loop, Point, held_plant, with_previous_command};
use crate::blocks::{ComplexMatrix, beside, block_2x2, to_complex};
use crate::exponential::exponential;
use crate::svd::ComplexSvd;
use crate::{Domain, Error, StateSpace};
use nalgebra::{Complex, DMatrix, DVector, RowDVector};

/// The largest singular value of S at a frequency, and its derivatives with respect to the entries of the plant.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct PeakDerivatives {
    /// The largest singular value.
    pub value: f64,
    /// Derivatives with respect to A, n x n.
    pub a: DMatrix<f64>,
    /// Derivatives with respect to B, n x m.
    pub b: DMatrix<f64>,
    /// Derivatives with respect to C, p x n.
    pub c: DMatrix<f64>,
    /// Derivatives with respect to D, p x m.
    pub d: DMatrix<f64>,
}

/// A peak of S whose derivatives are computed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensitivityPeak {
    /// The point at which the loop is opened.
    pub point: Point,
    /// The frequency of the peak, in rad/s.
    pub frequency: f64,
    /// Whether D S D^-1 takes the place of S, with the diagonal D of the lowest peak, see [`super::scaled_peak`].
    pub scaled: bool,
}

/// Computes the derivatives of the peak of S with respect to each entry of the plant; the controller does not change.
///
/// ```text
/// d sigma / d theta = Re(u* dS/d theta v),   S v = sigma u
/// ```
///
/// `plant`: in continuous time, or sampled at the period of the controller; `controller`: in continuous or sampled
/// time. For a sampled controller a continuous plant is discretised with a zero-order hold. A move of the peak
/// frequency has an effect of second order only, because the derivative of sigma with respect to it is zero. The
/// derivative exists if the largest singular value is simple. The derivatives with respect to A and B of a discretised
/// plant use the adjoint L(M', G) of the derivative of exp M, M = [A, B; 0, 0] times the period, for the gradient G.
/// Cost: about that of three solutions of a complex system of the order of the loop. At an infinite frequency S = I:
/// the value is 1, and only D has an effect, through the direct term of the controller; of several channels, all with
/// the singular value 1, the first one is used.
///
/// Source: derivative of a simple singular value, G. W. Stewart and J. Sun, Matrix perturbation
/// theory (1990), section IV.2; Fréchet derivative of the exponential by a block matrix, N. J.
/// Higham, Functions of matrices (2008), (3.16).
///
/// # Errors
///
/// Same as [`Loop::new`] and [`held_plant`]; [`Error::Overflow`] if the loop has a pole at the frequency, or S is
/// zero there; [`Error::NotConverged`].
pub fn peak_derivatives(
    plant: &StateSpace,
    controller: &StateSpace,
    peak: &SensitivityPeak,
) -> Result<PeakDerivatives, Error> {
    plant.check()?;
    let (n, m) = plant.b.shape();
    let model = match controller.domain {
        Domain::Continuous => plant.clone(),
        Domain::Sampled { period } => {
            let held = held_plant(plant, period)?;
            // Derivatives with respect to D need the previous command as a state, even for D = 0.
            if held.a.nrows() > n { held } else { with_previous_command(held) }
        }
    };
    let closed = Loop::new(model, controller.clone())?;
    let mut derivatives = closed.derivatives(peak)?;
    derivatives.a = derivatives.a.view((0, 0), (n, n)).into();
    derivatives.b = derivatives.b.rows(0, n).into();
    if derivatives.c.ncols() > n {
        // The previous command is a state of the held plant, and D is a part of its C.
        derivatives.d = derivatives.c.columns(n, m).into();
        derivatives.c = derivatives.c.columns(0, n).into();
    }
    if let (Domain::Continuous, Domain::Sampled { period }) = (plant.domain, controller.domain) {
        (derivatives.a, derivatives.b) = through_hold(plant, period, &derivatives)?;
    }
    Ok(derivatives)
}

impl Loop {
    /// The derivatives with respect to the matrices of the plant of this loop.
    fn derivatives(&self, peak: &SensitivityPeak) -> Result<PeakDerivatives, Error> {
        let SensitivityPeak { point, frequency, scaled } = *peak;
        let (plant, controller) = (self.plant(), self.controller());
        let (n, k) = (plant.a.nrows(), controller.a.nrows());
        let StateSpace { a: dynamics, b: inputs, c: outputs, .. } = self.system();
        let (m, p) = controller.d.shape();
        let (x, y) = if frequency.is_finite() {
            let s = plant.domain.point(frequency);
            let pencil = ComplexMatrix::identity(n + k, n + k) * s - to_complex(&dynamics);
            let singular = Error::Overflow { what: "S at its peak" };
            let x = pencil.clone().lu().solve(&to_complex(&inputs)).ok_or(singular.clone())?;
            let y = pencil.transpose().lu().solve(&to_complex(&outputs.transpose()));
            (x, y.ok_or(singular)?.transpose())
        } else {
            (ComplexMatrix::zeros(n + k, m + p), ComplexMatrix::zeros(m + p, n + k))
        };
        let mut response = to_complex(&outputs) * &x;
        // The direct terms of controller and plant, and the added signals themselves.
        for (row, column) in (0..m).flat_map(|i| (0..p).map(move |j| (i, j))) {
            response[(row, m + column)] += controller.d[(row, column)];
            response[(m + column, row)] += plant.d[(column, row)];
        }
        for at in 0..m + p {
            response[(at, at)] += 1.0;
        }
        let (from, count) = match point {
            Point::Input => (0, m),
            Point::Output => (m, p),
        };
        let sensitivity = response.view((from, from), (count, count)).into_owned();
        let units = if scaled {
            scaled_norm(&sensitivity)?.1.map(f64::exp)
        } else {
            DVector::from_element(count, 1.0)
        };
        let unit = |i: usize, j: usize| units[i] / units[j];
        let weighted = DMatrix::from_fn(count, count, |i, j| sensitivity[(i, j)] * unit(i, j));
        let (value, right) = ComplexSvd::new(&weighted)?.nth_smallest(count - 1);
        if value <= 0.0 {
            return Err(Error::Overflow { what: "1 / S at its peak" });
        }
        let left = (&weighted * &right) / Complex::from(value);
        let right = right.zip_map(&units, |entry, unit| entry / unit);
        let left = left.zip_map(&units, |entry, unit| entry * unit);
        // u* times the effect on S of additions to x' and to y; states and commands for the input v.
        let on_states = left.adjoint() * y.view((from, 0), (count, n));
        let on_outputs = left.adjoint() * response.view((from, m), (count, p));
        let of_states = x.view((0, from), (n, count)) * &right;
        let of_commands = response.view((0, from), (m, count)) * &right;
        let outer = |row: &RowDVector<Complex<f64>>, column: &DVector<Complex<f64>>| {
            DMatrix::from_fn(row.len(), column.len(), |i, j| (row[i] * column[j]).re)
        };
        Ok(PeakDerivatives {
            value,
            a: outer(&on_states, &of_states),
            b: outer(&on_states, &of_commands),
            c: outer(&on_outputs, &of_states),
            d: outer(&on_outputs, &of_commands),
        })
    }
}

/// Converts gradients with respect to the sampled plant to gradients with respect to A and B of the continuous plant.
fn through_hold(
    plant: &StateSpace,
    period: f64,
    sampled: &PeakDerivatives,
) -> Result<(DMatrix<f64>, DMatrix<f64>), Error> {
    let (n, m) = plant.b.shape();
    let order = n + m;
    let square = |a: &DMatrix<f64>, b: &DMatrix<f64>| beside(a, b).resize_vertically(order, 0.0);
    let (both, gradient) = (square(&plant.a, &plant.b), square(&sampled.a, &sampled.b));
    let adjoint = both.transpose() * period;
    // The derivative is linear in the gradient. A gradient scaled to the size of the matrix needs no further squarings
    // of the exponential.
    let size = gradient.amax();
    let unit = if size > 0.0 { adjoint.amax().max(f64::MIN_POSITIVE) / size } else { 1.0 };
    let zero = DMatrix::zeros(order, order);
    let block = block_2x2([&adjoint, &(gradient * unit)], [&zero, &adjoint]);
    let gradient = exponential(&block)?.view((0, order), (order, order)) * (period / unit);
    Ok((gradient.view((0, 0), (n, n)).into(), gradient.view((0, n), (n, m)).into()))
}
