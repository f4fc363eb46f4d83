//! Linear-quadratic regulators and Kalman filters, designed for a bandwidth.
//!
//! One scalar weight is free; a larger weight gives a slower loop. The weight is chosen so that the loop gain crosses
//! one at the bandwidth. All other weights are relative to the units of inputs and outputs, see [`NaturalUnits`].

use crate::balance::{Balance, divided, multiply_columns};
use crate::blocks::to_complex;
use crate::lyapunov::{CONTINUOUS, DISCRETE};
use crate::response::{FrequencyPoint, frequency_response};
use crate::riccati::{KalmanFilter, Regulator, Weights, kalman, lqr};
use crate::stability::instability;
use crate::svd::ComplexSvd;
use crate::{Domain, Error, StateSpace, check};
use nalgebra::{DMatrix, DVector};

/// Factor between successive trial weights until two of them enclose the required bandwidth.
const STRIDE: f64 = 100.0;
/// Number of strides after which a loop gain of one counts as out of reach.
const STRIDES: usize = 6;
/// Largest distance of the loop gain from one.
const ACCURACY: f64 = 1e-6;
/// If a change of the weight by [`STRIDE`] leaves more than this fraction of a loop gain above one, unstable modes keep
/// the loop gain above one.
const SATURATED: f64 = 0.7;
/// Largest number of steps of the regula falsi.
const STEPS: usize = 40;
/// Least entry of the energies h of [`NaturalUnits`], relative to the largest or to the energy of the states, so that
/// no unit is infinite.
const FLOOR: f64 = 1e-12;
/// Factor on a bandwidth that is the frequency of an undamped mode, where the response is infinite.
const DETUNING: f64 = 1.01;

/// Units of inputs and outputs: each output is measured by the strongest effect of an input on it, then each input by
/// its strongest effect on an output.
///
/// ```text
/// h[j, i] = integral of e^(-2 s t) g[j, i](t)^2 over t,    s = rate + max(0, largest real part)       continuous
/// h[j, i] = sum of a^(2 k) g[j, i][k]^2 over k from 0 on,  a = e^(-rate T) / max(1, spectral radius)  sampled
/// outputs[j]^2 = 1 / max over i of h[j, i],    inputs[i]^2 = 1 / max over j of outputs[j]^2 h[j, i]
/// ```
///
/// g is the impulse response without D: C e^(A t) B or C A^k B; T is the sample time. An entry of h is raised to 1e-12
/// of the largest one or, if that is less, of the energy of the states times the squared row of C, both with states in
/// units that balance A. If all entries are zero, all units are 1. The physical sizes of the units do not depend on
/// the units of states and outputs. Other units of inputs change them by a common factor if one input dominates every
/// output.
#[derive(Debug, Clone, PartialEq)]
pub struct NaturalUnits {
    /// Size of a unit of each input.
    pub inputs: DVector<f64>,
    /// Inverse size of a unit of each output.
    pub outputs: DVector<f64>,
}

impl NaturalUnits {
    /// The units for a system that is used at the speed `rate`, 1/s. Method: a Lyapunov equation for each input.
    ///
    /// # Errors
    ///
    /// Same as [`StateSpace::check`]; [`Error::OutOfRange`] for `rate`; [`Error::NotConverged`],
    /// [`Error::Overflow`] when rounding prevents a solution.
    pub fn new(system: &StateSpace, rate: f64) -> Result<Self, Error> {
        system.check()?;
        check::positive("the rate", rate)?;
        let mut h = energies(system, rate)?;
        let inverse = |size: f64, least: f64| 1.0 / if size > 0.0 { size } else { least };
        let least = FLOOR * h.amax();
        let outputs = DVector::from_fn(h.nrows(), |row, _| inverse(h.row(row).max(), least));
        h = DMatrix::from_diagonal(&outputs) * h;
        let inputs = DVector::from_fn(h.ncols(), |at, _| inverse(h.column(at).max(), FLOOR));
        Ok(Self { inputs: inputs.map(f64::sqrt), outputs: outputs.map(f64::sqrt) })
    }
}

/// Computes h of [`NaturalUnits`], p x m, from a Lyapunov equation for each input.
fn energies(system: &StateSpace, rate: f64) -> Result<DMatrix<f64>, Error> {
    let StateSpace { a, b, c, domain, .. } = system;
    let excess = instability(a, *domain)?.max(0.0);
    let (equation, damped) = match domain {
        Domain::Continuous => {
            let shift = DMatrix::from_diagonal_element(a.nrows(), a.nrows(), rate + excess);
            (&CONTINUOUS, a - shift)
        }
        Domain::Sampled { period } => (&DISCRETE, a * ((-rate * period).exp() / (1.0 + excess))),
    };
    let mut h = DMatrix::zeros(c.nrows(), b.ncols());
    // What an output could show of the energy of the states by an input, with balanced states.
    let mut sizes = h.clone();
    let scale = Balance::new(a).scale;
    let rows = multiply_columns(c, &scale);
    for (at, input) in b.column_iter().enumerate() {
        let gramian = equation.solve(&damped.transpose(), &(input * input.transpose()))?;
        let size = divided(&gramian, &scale).amax();
        for (row, output) in c.row_iter().enumerate() {
            h[(row, at)] = (output * &gramian * output.transpose())[(0, 0)].max(0.0);
            sizes[(row, at)] = rows.row(row).norm_squared() * size;
        }
    }
    let largest = h.amax();
    let h = check::in_range("the energy of the outputs", h)?;
    let least = |entry: f64, size: f64| entry.max(FLOOR * largest.min(size));
    Ok(if largest > 0.0 { h.zip_map(&sizes, least) } else { h.map(|_| 1.0) })
}

/// A regulator or a filter with its loop gain at the bandwidth.
#[derive(Debug, Clone, PartialEq)]
pub struct ByBandwidth<T> {
    /// The regulator or filter: its gain, the solution of its Riccati equation and its eigenvalues.
    pub result: T,
    /// The largest singular value of the loop at the bandwidth: one to within 1e-6; larger, if unstable modes need a
    /// larger bandwidth; smaller, if no weight of the search gives one.
    pub loop_gain: f64,
    /// The weight with this loop gain: r of [`regulator`], v of [`filter`].
    pub weight: f64,
}

/// Computes the regulator u = K x with the cost x' Q x + r u' diag(`units`)^-2 u. r is such that the largest singular
/// value of K (s I - A)^-1 B, in units of the inputs, is one at s = j `bandwidth`, or at z = e^(j `bandwidth` h) with
/// the sample time h.
///
/// `a`: n x n; `b`: n x m; `q`: n x n; `units`: size of a unit of each input. The loop at the input has a gain margin
/// of 1/2 to infinity and a phase margin of 60 degrees in continuous time, for all weights (M. G. Safonov, M. Athans,
/// IEEE Trans. Autom. Control 22 (1977)). Method: r is enclosed on the logarithmic scale by about 10 solutions
/// of [`lqr`].
///
/// # Errors
///
/// Same as [`lqr`] and [`frequency_response`]; [`Error::Shape`] and [`Error::NotFinite`] for `units`;
/// [`Error::OutOfRange`] for a bandwidth that is not positive, or in sampled time not below pi / h.
pub fn regulator(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    q: &DMatrix<f64>,
    units: &DVector<f64>,
    bandwidth: f64,
    domain: Domain,
) -> Result<ByBandwidth<Regulator>, Error> {
    let n = check::with_inputs(a, b)?;
    check::shape("Q", q, (n, n))?;
    check::column("units", units.as_slice(), b.ncols())?;
    let scaled = b * DMatrix::from_diagonal(units);
    let (weight, loop_gain) = weight(a, &scaled, q, bandwidth, domain)?;
    let r = DMatrix::from_diagonal(&units.map(|unit| weight / (unit * unit)));
    let result = lqr(a, b, &Weights { q: q.clone(), r, n: None }, domain)?;
    Ok(ByBandwidth { result, loop_gain, weight })
}

/// Computes the Kalman filter for the process noise W and the measurement noise v diag(`units`)^-2, where v is such
/// that the largest singular value of C (s I - A)^-1 L, in units of the outputs, is one at s = j `bandwidth`.
///
/// The dual of [`regulator`]. `a`: n x n; `c`: p x n; `w`: n x n; `units`: inverse size of a unit of each output.
/// With W = N N', the loop of regulator and filter tends to the loop of the regulator alone when the bandwidth grows,
/// if N is the input matrix and the plant has no zero in the right half plane (J. C. Doyle, G. Stein, IEEE Trans.
/// Autom. Control 26 (1981)).
///
/// # Errors
///
/// Same as [`regulator`] and [`kalman`].
pub fn filter(
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    w: &DMatrix<f64>,
    units: &DVector<f64>,
    bandwidth: f64,
    domain: Domain,
) -> Result<ByBandwidth<KalmanFilter>, Error> {
    let n = check::with_outputs(a, c)?;
    check::shape("W", w, (n, n))?;
    check::column("units", units.as_slice(), c.nrows())?;
    let scaled = c.transpose() * DMatrix::from_diagonal(units);
    let (weight, loop_gain) = weight(&a.transpose(), &scaled, w, bandwidth, domain)?;
    let v = DMatrix::from_diagonal(&units.map(|unit| weight / (unit * unit)));
    Ok(ByBandwidth { result: kalman(a, c, w, &v, domain)?, loop_gain, weight })
}

/// Returns the r of R = r I for which the loop gain at the bandwidth is one, and the loop gain reached.
fn weight(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    q: &DMatrix<f64>,
    bandwidth: f64,
    domain: Domain,
) -> Result<(f64, f64), Error> {
    check::positive("the bandwidth", bandwidth)?;
    if let Domain::Sampled { period } = domain
        && bandwidth * period >= std::f64::consts::PI
    {
        let (name, value) = ("the bandwidth in rad per sample", bandwidth * period);
        return Err(Error::OutOfRange { name, value, rule: "a number below pi" });
    }
    let m = b.ncols();
    let point = |c: &DMatrix<f64>| -> Result<FrequencyPoint, Error> {
        let system = StateSpace::strictly_proper(a.clone(), b.clone(), c.clone(), domain);
        frequency_response(&system, &[bandwidth])
            .or_else(|_| frequency_response(&system, &[DETUNING * bandwidth]))
            .map(|mut points| points.remove(0))
    };
    let loop_gain = |logarithm: f64| -> Result<f64, Error> {
        let r = DMatrix::from_diagonal_element(m, m, logarithm.exp());
        let gain = lqr(a, b, &Weights { q: q.clone(), r, n: None }, domain)?.gain;
        Ok(point(&gain)?.singular_values.first().copied().unwrap_or(0.0))
    };
    // The search starts at the weight of an integrator: |Q^(1/2) G|^2 at the bandwidth, G = (s I - A)^-1 B.
    let response = point(&DMatrix::identity(a.nrows(), a.nrows()))?.gain;
    let size = ComplexSvd::new(&(response.adjoint() * to_complex(q) * response))?.values()[0];
    let start = if size.is_finite() && size > 0.0 { size.ln() } else { 0.0 };
    enclosed(start, loop_gain)
}

/// Searches from `start` for the x at which the decreasing function f is 1; returns e^x and f(x). If the strides do not
/// pass this x, returns the values at the last stride.
fn enclosed(start: f64, f: impl Fn(f64) -> Result<f64, Error>) -> Result<(f64, f64), Error> {
    let (mut x, mut value) = (start, f(start)?);
    let direction = if value > 1.0 { 1.0 } else { -1.0 };
    let mut other = None;
    for _ in 0..STRIDES {
        if (value - 1.0).abs() <= ACCURACY {
            return Ok((x.exp(), value));
        }
        let next = x + direction * STRIDE.ln();
        // A weight that is too extreme for the Riccati equation ends the search.
        let Ok(gain) = f(next) else { break };
        if (gain > 1.0) != (value > 1.0) {
            other = Some(next);
            break;
        }
        // Unstable modes keep the loop gain above one: a larger weight would only slow the other modes down.
        if value > 1.0 && gain > SATURATED * value {
            break;
        }
        (x, value) = (next, gain);
    }
    let Some(mut other) = other else { return Ok((x.exp(), value)) };
    // Regula falsi on ln f(x), nearly a straight line; the Illinois variant halves the value at an end that stays.
    let (mut low, mut high) = (value.ln(), f(other)?.ln());
    for _ in 0..STEPS {
        let middle = (x * high - other * low) / (high - low);
        let gain = f(middle)?;
        if (gain - 1.0).abs() <= ACCURACY {
            return Ok((middle.exp(), gain));
        }
        if (gain > 1.0) == (low > 0.0) {
            (x, low, value, high) = (middle, gain.ln(), gain, high / 2.0);
        } else {
            (other, high, low) = (middle, gain.ln(), low / 2.0);
        }
    }
    Ok((x.exp(), value))
}
