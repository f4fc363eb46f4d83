//! The detection filter: a Kalman filter behind an unknown-input observer.

use crate::balance::{divide_columns, unit_columns};
use crate::blocks::symmetric_part;
use crate::residual::ResidualGenerator;
use crate::riccati::kalman;
use crate::svd::Svd;
use crate::{Domain, Error, StateSpace, check};
use nalgebra::{DMatrix, DVector};

/// In a matrix with columns of length one, singular values below this fraction of the largest count as zero.
const TOLERANCE: f64 = 1e-9;
/// An effect of an input on a measurement below this fraction of the sum of the moduli of its terms counts as zero.
const ROUNDING: f64 = 1e-13;

/// A plant with noise and unknown inputs d: x' = A x + B u + w + sum of e d, y = C x + v + sum of `e_s` d;
/// `x[k+1]` for x' in sampled time.
#[derive(Debug, Clone, PartialEq)]
pub struct NoisyPlant {
    /// A, n x n.
    pub a: DMatrix<f64>,
    /// B, n x m.
    pub b: DMatrix<f64>,
    /// C, p x n.
    pub c: DMatrix<f64>,
    /// W, n x n: intensity (in sampled time the covariance) of the process noise w.
    pub w: DMatrix<f64>,
    /// V, p x p, positive definite: intensity (in sampled time the covariance) of the measurement noise v.
    pub v: DMatrix<f64>,
    /// Continuous or sampled time.
    pub domain: Domain,
}

/// An unmeasured input: a disturbance, or a fault.
#[derive(Debug, Clone, PartialEq)]
pub struct UnknownInput {
    /// e, n entries: the effect on the states.
    pub on_states: DVector<f64>,
    /// `e_s`, p entries: the effect on the measurements.
    pub on_measurements: DVector<f64>,
}

/// A filter with white residuals r. Without unknown inputs other than the decoupled ones, r has mean 0 and the
/// intensity (in sampled time the covariance) I.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct DetectionFilter {
    /// The filter, from commands u and measurements y to r.
    pub generator: ResidualGenerator,
    /// Maps the initial state of the plant to the initial state of the filter, k x n for a filter of order k: T of the
    /// unknown-input observer in the coordinates of the filter.
    pub start: DMatrix<f64>,
}

impl NoisyPlant {
    fn check(&self) -> Result<(), Error> {
        let (n, p) = (check::with_inputs(&self.a, &self.b)?, self.c.nrows());
        check::shape("C", &self.c, (p, n))?;
        check::shape("W", &self.w, (n, n))?;
        check::shape("V", &self.v, (p, p))?;
        self.domain.check()
    }

    fn check_input(&self, input: &UnknownInput) -> Result<(), Error> {
        check::column("a column e", input.on_states.as_slice(), self.a.nrows())?;
        check::column("a column e_s", input.on_measurements.as_slice(), self.c.nrows())
    }

    /// The plant with `input` as a further state, a random walk: d' = noise of intensity `intensity` (in sampled time
    /// `d[k+1] = d[k]` + noise of this covariance).
    ///
    /// A filter of this plant estimates the input, so that a constant input has no effect on the residuals in steady
    /// state. A larger intensity makes the effect decay sooner. Other unknown inputs need a zero for the new state
    /// ([`UnknownInput::extended`]).
    ///
    /// # Errors
    ///
    /// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for bad matrices; [`Error::OutOfRange`] for a
    /// bad period, or an intensity that is not above 0.
    pub fn with_random_walk(&self, input: &UnknownInput, intensity: f64) -> Result<Self, Error> {
        self.check()?;
        self.check_input(input)?;
        check::positive("the intensity of a random walk", intensity)?;
        let n = self.a.nrows();
        let grown = |m: &DMatrix<f64>| m.clone().resize(n + 1, n + 1, 0.0);
        let (mut a, mut w) = (grown(&self.a), grown(&self.w));
        a.view_mut((0, n), (n, 1)).copy_from(&input.on_states);
        a[(n, n)] = self.domain.constant();
        w[(n, n)] = intensity;
        let mut c = self.c.clone().resize_horizontally(n + 1, 0.0);
        c.set_column(n, &input.on_measurements);
        let b = self.b.clone().resize_vertically(n + 1, 0.0);
        Ok(Self { a, b, c, w, v: self.v.clone(), domain: self.domain })
    }
}

impl UnknownInput {
    /// The input with zeros appended for further states, up to the number `states`.
    #[must_use]
    pub fn extended(&self, states: usize) -> Self {
        Self { on_states: self.on_states.clone().resize_vertically(states, 0.0), ..self.clone() }
    }
}

/// Designs the filter whose residuals do not depend on the inputs `unknown`, the columns e of E and `e_s` of `E_s`.
///
/// Measurements in which an input appears directly are left out: `N_s` y with `N_s` `E_s` = 0 replaces y. An
/// unknown-input observer (Chen and Patton 1999, section 3.2) removes the inputs on the states. With C for `N_s` C,
///
/// ```text
/// H = E (C E)^+,  T = I - H C,  s = T x                               rank C E = rank E
/// s' = T A s + T B u + T A H y + (T w - T A H v)                      (T E = 0)
/// N y = N C s + N v                                                   N C E = 0, N N' = I
/// ```
///
/// is a plant without unknown inputs, whose process noise and measurement noise are correlated. A Kalman
/// filter estimates s in an orthonormal basis of the range of T; the residual is its innovation,
///
/// ```text
/// r = R (N y - N C s_hat),   R (N V N') R' = I,   in sampled time R (N V N' + N C P C' N') R' = I
/// ```
///
/// The residual is white; P, the covariance of the state error, is the least of all decoupled filters.
///
/// Existence: rank C E = rank E < n, at least one row N is left, and (T A, N C) is detectable: (A, E, C) has no
/// unstable invariant zeros. The result is None if one of these conditions does not hold.
///
/// Source: J. Chen and R. J. Patton, Robust Model-Based Fault Diagnosis for Dynamic Systems (1999), chapter
/// 3; the correlation: B. D. O. Anderson and J. B. Moore, Optimal Filtering (1979), section 5.4; whiteness:
/// T. Kailath, IEEE Trans. Autom. Control 13 (1968).
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for bad matrices; [`Error::OutOfRange`] for a bad
/// period; [`Error::NotPositiveDefinite`] for V; [`Error::NotPositiveSemidefinite`] for W;
/// [`Error::Unweighted`] if a mode on the stability limit gets no process noise; [`Error::NotDetectable`] if
/// (A, C) is not detectable and `unknown` is empty; the numerical errors of [`kalman`].
pub fn detection_filter(
    plant: &NoisyPlant,
    unknown: &[UnknownInput],
) -> Result<Option<DetectionFilter>, Error> {
    plant.check()?;
    unknown.iter().try_for_each(|input| plant.check_input(input))?;
    let Some(observer) = UnknownInputObserver::new(plant, unknown)? else {
        return Ok(None);
    };
    match observer.filter(plant) {
        Err(Error::NotDetectable { .. }) if !unknown.is_empty() => Ok(None),
        other => other.map(Some),
    }
}

/// T, H and N of the observer of [`detection_filter`], for inputs scaled to columns of length one.
struct UnknownInputObserver {
    /// Q, n x k: an orthonormal basis of the range of T.
    basis: DMatrix<f64>,
    /// Q' T, k x n: T in the coordinates of Q.
    projection: DMatrix<f64>,
    /// H, n x p, with T = I - H C.
    h: DMatrix<f64>,
    /// N, rows x p: selects combinations of measurements that the inputs do not reach.
    selection: DMatrix<f64>,
}

impl UnknownInputObserver {
    /// Computes the observer; None if the rank condition fails, no measurement is left, or T is zero.
    fn new(plant: &NoisyPlant, unknown: &[UnknownInput]) -> Result<Option<Self>, Error> {
        let (n, p) = (plant.a.nrows(), plant.c.nrows());
        let columns = |of: fn(&UnknownInput) -> &DVector<f64>, rows: usize| {
            let columns = unknown.iter().map(of).filter(|column| column.amax() > 0.0);
            let units: Vec<_> = columns.map(|column| column / column.norm()).collect();
            let mut matrix = DMatrix::zeros(rows, units.len());
            units.iter().enumerate().for_each(|(at, unit)| matrix.set_column(at, unit));
            matrix
        };
        let on_measurements = columns(|input| &input.on_measurements, p);
        let Some(unaffected) = left_null_space(&on_measurements)? else { return Ok(None) };
        let e = columns(|input| &input.on_states, n);
        let sizes = unaffected.abs() * plant.c.abs() * e.abs();
        let effect = |sum: f64, size: f64| if sum.abs() > ROUNDING * size { sum } else { 0.0 };
        let visible = (&unaffected * &plant.c * &e).zip_map(&sizes, effect);
        let mut h = DMatrix::zeros(n, p);
        if e.ncols() > 0 {
            let svd = Svd::new(&unit_columns(&visible))?;
            let rank = svd.rank(TOLERANCE);
            if rank < Svd::new(&e)?.rank(TOLERANCE) {
                return Ok(None);
            }
            // Scales the inputs so that each effect on the measurements has length one.
            let lengths = visible.column_iter().map(|column| column.norm());
            let e = divide_columns(&e, &DVector::from_iterator(e.ncols(), lengths));
            let unit = DMatrix::identity(unaffected.nrows(), unaffected.nrows());
            h = e * svd.least_squares(&unit, rank) * &unaffected;
        }
        let Some(left) = left_null_space(&visible)? else { return Ok(None) };
        let t = DMatrix::identity(n, n) - &h * &plant.c;
        let range = Svd::new(&t)?;
        let basis = range.left.columns(0, range.rank(TOLERANCE)).into_owned();
        if basis.ncols() == 0 {
            return Ok(None);
        }
        let projection = basis.transpose() * &t;
        Ok(Some(Self { basis, projection, h, selection: left * unaffected }))
    }

    /// The Kalman filter of the plant without the unknown inputs, with whitened innovation.
    fn filter(&self, plant: &NoisyPlant) -> Result<DetectionFilter, Error> {
        let Self { basis, projection, h, selection } = self;
        let NoisyPlant { a, b, c, w, v, domain } = plant;
        let dynamics = projection * a * basis;
        let through = projection * a * h;
        let output = selection * c * basis;
        let process = symmetric_part(
            &(projection * w * projection.transpose() + &through * v * through.transpose()),
        );
        let measurement = symmetric_part(&(selection * v * selection.transpose()));
        let cross = -(&through * v * selection.transpose());
        let noise = [&process, &measurement, &cross];
        let (gain, covariance) = correlated_filter(&dynamics, &output, noise, *domain)?;
        let factor = symmetric_part(&covariance)
            .cholesky()
            .ok_or(Error::NotPositiveDefinite { matrix: "V" })?
            .l();
        let whitening = factor
            .solve_lower_triangular(&DMatrix::identity(covariance.nrows(), covariance.nrows()))
            .ok_or(Error::Overflow { what: "the inverse of V" })?;
        let rows = selection.nrows();
        Ok(DetectionFilter {
            generator: ResidualGenerator {
                a: dynamics - &gain * &output,
                b_u: projection * b,
                b_y: through + gain * selection,
                c: -(&whitening * output),
                d_u: DMatrix::zeros(rows, b.ncols()),
                d_y: whitening * selection,
                domain: *domain,
            },
            start: projection.clone(),
        })
    }
}

impl DetectionFilter {
    /// The system from an unknown input of the plant to r: for e = T x - `s_hat`,
    ///
    /// ```text
    /// e' = A e + (T e_d - B_y e_s) d,  r = -C e + D_y e_s d
    /// ```
    ///
    /// with T = `start`, A, `B_y`, C, `D_y` of the generator, and the columns `e_d` = `input.on_states` and
    /// `e_s` = `input.on_measurements`. Commands have no effect on e and r.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`] for columns of the wrong length; same as [`ResidualGenerator::check`] for a bad generator.
    pub fn effect(&self, input: &UnknownInput) -> Result<StateSpace, Error> {
        self.generator.check()?;
        check::length("e", input.on_states.as_slice(), self.start.ncols())?;
        let generator = &self.generator;
        check::length("e_s", input.on_measurements.as_slice(), generator.d_y.ncols())?;
        let b = &self.start * &input.on_states - &generator.b_y * &input.on_measurements;
        let d = &generator.d_y * &input.on_measurements;
        Ok(StateSpace {
            a: generator.a.clone(),
            b: DMatrix::from_column_slice(b.len(), 1, b.as_slice()),
            c: -&generator.c,
            d: DMatrix::from_column_slice(d.len(), 1, d.as_slice()),
            domain: generator.domain,
        })
    }
}

/// Gain of the Kalman filter for correlated noise, and covariance (continuous: intensity V) of its innovation.
///
/// W = E w w', V = E v v', S = E w v' of the process noise w and the measurement noise v (intensities in continuous
/// time). Method: the plant with A - S V^-1 C and W - S V^-1 S' has uncorrelated noise; S V^-1 is added to the gain of
/// its filter.
fn correlated_filter(
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    [w, v, s]: [&DMatrix<f64>; 3],
    domain: Domain,
) -> Result<(DMatrix<f64>, DMatrix<f64>), Error> {
    let factor = v.clone().cholesky().ok_or(Error::NotPositiveDefinite { matrix: "V" })?;
    // S V^-1.
    let correlated = factor.solve(&s.transpose()).transpose();
    let process = symmetric_part(&(w - &correlated * s.transpose()));
    let filter = kalman(&(a - &correlated * c), c, &process, v, domain)?;
    let innovation = match domain {
        Domain::Continuous => v.clone(),
        Domain::Sampled { .. } => v + c * filter.covariance * c.transpose(),
    };
    Ok((filter.gain + correlated, innovation))
}

/// The rows N with N M = 0 and N N' = I; None if there are none.
fn left_null_space(m: &DMatrix<f64>) -> Result<Option<DMatrix<f64>>, Error> {
    let (rows, columns) = m.shape();
    if columns == 0 || m.amax() <= 0.0 {
        return Ok(Some(DMatrix::identity(rows, rows)));
    }
    let dual = Svd::new(&unit_columns(m).transpose())?;
    let rank = dual.rank(TOLERANCE);
    if rank == rows {
        return Ok(None);
    }
    Ok(Some(dual.right.columns(rank, rows - rank).transpose()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The effect 0.1 * 3 - 0.3 is zero, but not after (3, -1) is divided by its length with rounding.
    #[test]
    fn an_input_without_effect_on_the_measurements_is_not_decoupled() {
        let plant = NoisyPlant {
            a: DMatrix::from_row_slice(3, 3, &[-1.0, 0.2, 0.0, 0.1, -2.0, 0.3, 0.0, 0.4, -1.5]),
            b: DMatrix::identity(3, 1),
            c: DMatrix::from_row_slice(2, 3, &[0.1, 0.3, 0.0, 0.0, 0.0, 1.0]),
            w: DMatrix::identity(3, 3),
            v: DMatrix::identity(2, 2),
            domain: Domain::Continuous,
        };
        let filter = |on_states: [f64; 3]| {
            let on_states = DVector::from_row_slice(&on_states);
            let input = UnknownInput { on_states, on_measurements: DVector::zeros(2) };
            detection_filter(&plant, &[input]).unwrap()
        };
        assert_eq!(filter([3.0, -1.0, 0.0]), None);
        assert!(filter([0.0, 0.0, 1.0]).is_some());
    }

    /// The second state is measured in units of 1e10; both inputs are removed all the same.
    #[test]
    fn inputs_with_effects_of_very_different_sizes_are_decoupled() {
        let sizes = DVector::from_vec(vec![1.0, 1e-10, 1.0]);
        let plant = NoisyPlant {
            a: DMatrix::from_row_slice(3, 3, &[-1.0, 0.2, 0.1, 0.1, -2.0, 0.3, 0.5, 0.4, -1.5]),
            b: DMatrix::identity(3, 1),
            c: DMatrix::from_diagonal(&sizes),
            w: DMatrix::identity(3, 3),
            v: DMatrix::from_diagonal(&sizes.map(|size| size * size)),
            domain: Domain::Continuous,
        };
        let input = |at: usize| UnknownInput {
            on_states: DVector::from_fn(3, |i, _| f64::from(u8::from(i == at))),
            on_measurements: DVector::zeros(3),
        };
        let filter = detection_filter(&plant, &[input(0), input(1)]).unwrap().unwrap();
        for at in [0, 1] {
            let effect = filter.effect(&input(at)).unwrap();
            assert!(effect.b.amax() < 1e-12 && effect.d.amax() < 1e-12, "{at}: {effect:?}");
        }
        assert!(filter.effect(&input(2)).unwrap().b.amax() > 0.1);
    }
}
