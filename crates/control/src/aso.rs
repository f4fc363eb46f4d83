//! The augmented state observer: estimates faults and lets the controller compensate them.
//!
//! R. J. Patton and S. Klinkhieo, An adaptive approach to active fault-tolerant control (2009); (n)
//! are its equations. With the measurement y = C x the controller is
//!
//! ```text
//! x_hat' = A x_hat + B u + F_a f_hat + L_x (y - C x_hat)      general form of (4)
//! f_hat' = A_f f_hat + L_f (y - C x_hat)                      (5); the dot is missing in print
//! u      = K_x x_hat + K_f f_hat                              (2)
//! ```
//!
//! The paper treats constant faults, `A_f` = 0; [`crate::faults`] builds other fault models f' = `A_f` f. The general
//! form holds for every command u that the actuator applies. If u is (2) without saturation and B `K_f` = -`F_a`, the
//! two terms with `f_hat` cancel and (4) is obtained as printed. The estimation error e = x - `x_hat` follows (9) to
//! (11) in both cases, with `F_a` in place of -B `K_f`:
//!
//! ```text
//! [e; f_hat]' = (A_0 - L C_0) [e; f_hat] - F_0 f_a
//! A_0 = [A, -F_a; 0, A_f],  C_0 = [C, 0],  L = [L_x; -L_f],  F_0 = [-F_a; 0]
//! ```
//!
//! With eps = `f_hat` - f in place of `f_hat` the same matrix is driven by the part of f' that the
//! fault model does not predict:
//!
//! ```text
//! [e; eps]' = (A_0 - L C_0) [e; eps] - [0; f' - A_f f]
//! ```
//!
//! In sampled time the same equations hold with x[k+1], f[k+1] for x', f'; constant faults have `A_f` = I.

pub use crate::faulty_plant::FaultyPlant;
pub use crate::gains::{Estimator, Gains};

use crate::controller::controller;
use crate::faults::ExtendedPlant;
use crate::placement::{Alternatives, Placement, Quality, alternatives, alternatives_balanced};
use crate::robustness::{Loop, least_sensitive};
use crate::{Domain, Error, check};
use nalgebra::{Complex, DMatrix};

/// A designed controller and the quality of the design.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct AsoDesign {
    /// The gains.
    pub gains: Gains,
    /// Frobenius norm of B `K_f` + `F_a` divided by the norm of `F_a`: the fraction of the effect of the faults that is
    /// not compensated. Zero up to rounding for the default `K_f` if the columns of `F_a` are in the range of B. Rows
    /// of a measurement filter are left out; if `F_a` is zero in the other rows, this is the norm of B `K_f`.
    pub cancellation_residual: f64,
    /// Quality of the pole assignment for A + B `K_x`.
    pub controller: Quality,
    /// Quality of the pole assignment for the transpose of `A_0` - L `C_0`.
    pub observer: Quality,
}

/// A function of [`crate::placement`] that assigns eigenvalues.
pub(crate) type Place =
    fn(&DMatrix<f64>, &DMatrix<f64>, &[Complex<f64>]) -> Result<Alternatives, Error>;

/// Computes `K_x` from the first `states` states, on which the later states do not act; the columns of `K_x` for the
/// later states are zero.
pub(crate) fn place_controller(
    plant: &FaultyPlant,
    states: usize,
    poles: &[Complex<f64>],
    place: Place,
) -> Result<Alternatives, Error> {
    let a = plant.a.view((0, 0), (states, states)).into();
    let placed = place(&a, &plant.b.rows(0, states).into(), poles)?;
    Ok(placed.map(|gain| gain.clone().resize_horizontally(plant.a.ncols(), 0.0)))
}

/// Candidates for the feedback and the observer of a plant; one pair becomes the controller.
pub(crate) struct GainCandidates<'a> {
    pub(crate) plant: &'a FaultyPlant,
    /// Candidates for `K_x`.
    pub(crate) feedbacks: &'a Alternatives,
    /// Candidates for L.
    pub(crate) observers: &'a Alternatives,
    pub(crate) estimator: Estimator,
    pub(crate) k_f: &'a DMatrix<f64>,
    pub(crate) domain: Domain,
}

impl GainCandidates<'_> {
    /// Returns the gains of the feedback and observer whose loop [`least_sensitive`] prefers, with the quality of each
    /// of these two assignments.
    pub(crate) fn best(&self) -> Result<(Gains, [Quality; 2]), Error> {
        let Self { feedbacks, observers, .. } = self;
        let [mut pairs, second] = pairs(&feedbacks.candidates(), &observers.candidates());
        let standard: Vec<_> = feedbacks.standard_pairs(observers).collect();
        let loops = |pairs: &[(&Placement, &Placement)]| {
            let each = pairs.iter().map(|(k, l)| self.closed(k, l));
            each.collect::<Result<Vec<_>, Error>>()
        };
        let best = if pairs.len() + second.len() > 1 {
            least_sensitive([&loops(&pairs)?, &loops(&second)?], &loops(&standard)?)
        } else {
            0
        };
        pairs.extend(second);
        let (k, l) = pairs.swap_remove(best);
        Ok((self.gains(k, l), [k.quality, l.quality]))
    }

    fn gains(&self, feedback: &Placement, observer: &Placement) -> Gains {
        let (n, q) = self.plant.f_a.shape();
        Gains {
            estimator: self.estimator,
            k_x: feedback.gain.clone(),
            k_f: self.k_f.clone(),
            l_x: observer.gain.rows(0, n).into(),
            l_f: -observer.gain.rows(n, q),
            p_f: None,
            integral: None,
        }
    }

    /// The loop of the plant and the controller with the gains of `feedback` and `observer`.
    fn closed(&self, feedback: &Placement, observer: &Placement) -> Result<Loop, Error> {
        let Self { plant, domain, .. } = *self;
        let gains = self.gains(feedback, observer);
        Loop::new(plant.commanded(domain), controller(plant, &gains, domain)?)
    }
}

/// Returns all pairs of an item of `one` and an item of `other`: first the pairs of items from both first lists, then
/// the pairs with at least one item from a second list.
#[must_use]
pub fn pairs<T: Copy>(one: &[Vec<T>; 2], other: &[Vec<T>; 2]) -> [Vec<(T, T)>; 2] {
    let product = |i: usize, j: usize| {
        let all = one[i].iter().flat_map(move |x| other[j].iter().map(move |y| (*x, *y)));
        all.collect::<Vec<_>>()
    };
    [product(0, 0), [product(0, 1), product(1, 0), product(1, 1)].concat()]
}

/// Designs the controller: assigns the eigenvalues of A + B `K_x` and of `A_0` - L `C_0`.
///
/// `controller_poles`: n, `observer_poles`: n + q, in the unit of A, with negative real parts for a stable loop; `k_f`:
/// m x q, or None for [`FaultyPlant::compensation_gain`]. The design exists when (A, B) is controllable and
/// [`FaultyPlant::check_observer_exists`] succeeds. Method, cost and tolerance: [`alternatives`] for (A, B),
/// [`alternatives_balanced`] for (`A_0`', `C_0`'). The design is the pair of a feedback and an observer whose loop with
/// `plant` has the lowest peaks of S, see [`least_sensitive`]; at most 22 x 22 loops are compared, 3 x 3 above 24
/// states.
///
/// # Example
///
/// A mass with a commanded force and an unknown constant force against it; the position is measured:
///
/// ```
/// use control::aso::{FaultyPlant, design};
/// use control::placement::real_poles;
/// use nalgebra::{Complex, DMatrix};
/// let plant = FaultyPlant::with_constant_faults(
///     DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, 0.0]),
///     DMatrix::from_row_slice(2, 1, &[0.0, 1.0]),
///     DMatrix::from_row_slice(1, 2, &[1.0, 0.0]),
///     DMatrix::from_row_slice(2, 1, &[0.0, -1.0]),
/// );
/// let gains = design(&plant, &real_poles(&[-1.0, -2.0]), &real_poles(&[-10.0, -11.0, -12.0]), None)?.gains;
/// // (s + 10) (s + 11) (s + 12) = s^3 + 33 s^2 + 362 s + 1320
/// assert!((gains.l_x - DMatrix::from_row_slice(2, 1, &[33.0, 362.0])).amax() < 1e-9);
/// assert!((gains.l_f[(0, 0)] + 1320.0).abs() < 1e-8);
/// assert!((gains.k_f[(0, 0)] - 1.0).abs() < 1e-15);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// Same as [`alternatives`], [`FaultyPlant::check_observer_exists`] and
/// [`FaultyPlant::compensation_gain`]; [`Error::Shape`], [`Error::NotFinite`] for a bad `k_f`.
pub fn design(
    plant: &FaultyPlant,
    controller_poles: &[Complex<f64>],
    observer_poles: &[Complex<f64>],
    k_f: Option<&DMatrix<f64>>,
) -> Result<AsoDesign, Error> {
    let extended = ExtendedPlant::without_filter(plant.clone());
    extended.design(controller_poles, observer_poles, k_f)
}

impl ExtendedPlant {
    /// Designs the controller as [`design`] does.
    ///
    /// The loops are compared with the measurement filter as a part of the plant.
    ///
    /// `controller_poles`: one per state of the plant without the filter, whose states are not fed back;
    /// `observer_poles`: one per state of the extended plant and per entry of `f_hat`; `k_f`: m x q, or None for
    /// [`FaultyPlant::compensation_gain`], which is zero in the columns of sensor faults and of rates of faults, and -1
    /// for a loss of effectiveness.
    ///
    /// # Errors
    ///
    /// Same as [`design`].
    pub fn design(
        &self,
        controller_poles: &[Complex<f64>],
        observer_poles: &[Complex<f64>],
        k_f: Option<&DMatrix<f64>>,
    ) -> Result<AsoDesign, Error> {
        let Self { plant, states, .. } = self;
        plant.check_observer_exists()?;
        let k_f = k_f.cloned().map_or_else(|| plant.compensation_gain(), Ok)?;
        check::shape("K_f", &k_f, (plant.b.ncols(), plant.f_a.ncols()))?;
        let feedbacks = place_controller(plant, *states, controller_poles, alternatives)?;
        let (a_0, c_0) = (plant.augmented_dynamics(), plant.augmented_output());
        let observers = alternatives_balanced(&a_0.transpose(), &c_0.transpose(), observer_poles)?;
        let observers = observers.map(|gain| -gain.transpose());
        let candidates = GainCandidates {
            plant,
            feedbacks: &feedbacks,
            observers: &observers,
            estimator: Estimator::Prediction,
            k_f: &k_f,
            domain: Domain::Continuous,
        };
        let (gains, [controller, observer]) = candidates.best()?;
        let cancellation_residual = self.cancellation_residual(&k_f);
        Ok(AsoDesign { gains, cancellation_residual, controller, observer })
    }

    /// The part of the effect of the faults that `k_f`, m x q, does not compensate, see
    /// [`AsoDesign::cancellation_residual`].
    #[must_use]
    pub fn cancellation_residual(&self, k_f: &DMatrix<f64>) -> f64 {
        let Self { plant, states, .. } = self;
        let size = plant.f_a.rows(0, *states).norm();
        let residual = (&plant.b * k_f + &plant.f_a).rows(0, *states).norm();
        if size > 0.0 { residual / size } else { residual }
    }
}
