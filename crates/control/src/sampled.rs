//! The design of the controller for a given sample time.
//!
//! The plant is discretised exactly, with u held between samples and the fault developing by its
//! model. All gains are designed for the sampled plant, so that the loop is stable at every sample
//! time at which the sampled plant is controllable and observable.

use crate::aso::{GainCandidates, place_controller};
use crate::balance::power_of_two_or_one;
use crate::blocks::{block_2x2, stacked};
use crate::controller::{closed_loop, controller};
use crate::faults::{ExtendedPlant, coefficients};
use crate::faulty_plant::FaultyPlant;
use crate::gains::{Estimator, Gains};
use crate::hold::FirstOrderHold;
use crate::placement::{
    Alternatives, Coordinates, Extent, PlacementProblem, Quality, alternatives_discrete,
};
use crate::stability::instability;
use crate::{Domain, Error, check};
use nalgebra::{Complex, DMatrix, DVector};

/// The largest decay exponent per sample that [`sampled_poles`] returns.
const FASTEST: f64 = 4.0;

/// A controller designed for its sample time.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct SampledDesign {
    /// The sample time in s.
    pub period: f64,
    /// The sampled plant.
    pub plant: FaultyPlant,
    /// The gain 1 - e^(-w period) of each measurement filter, `y_f` := `y_f` + gain (y - `y_f`), if any.
    pub filter: Option<Vec<f64>>,
    /// The gains. `L_x`, `L_f` correct the next estimate (prediction estimator) or the present one (current).
    pub gains: Gains,
    /// Quality of the pole assignment for A + B `K_x`.
    pub controller: Quality,
    /// Quality of the pole assignment for the error dynamics, in the coordinates of [`place_estimator`].
    pub observer: Quality,
    /// Largest modulus of the eigenvalues of the closed loop, which is stable if this is below one.
    pub radius: f64,
}

/// Maps continuous poles p to sampled ones, e^(p T), with the fastest poles slowed down.
///
/// ```text
/// |z| = e^(-q),  q = -Re(p) T                      when no q is above 4
/// |z| = e^(-q^g) for q > 1, g = ln 4 / ln max q    otherwise
/// ```
///
/// `continuous`: in 1/s; `period`: T in s, above zero. The angle of z is Im(p) T. A pole with q = 4 reduces an error to
/// 1.8 % in one sample. Faster poles would crowd at zero, where the eigenvectors of an observer with fewer measurements
/// than states become parallel: for the pendulum of [`crate::aso`]'s source at 10 ms the condition number would be
/// 1e14, and the residual motion only 8 % smaller. The rule preserves the order of the poles, does not change poles
/// with q <= 1, and maps the fastest to q = 4.
///
/// # Example
///
/// ```
/// use control::sampled::sampled_poles;
/// use nalgebra::Complex;
/// let continuous = [-10.0, -3000.0].map(|p| Complex::new(p, 0.0));
/// let fine = sampled_poles(&continuous, 1e-3)?;
/// assert!((fine[1].re - (-3.0_f64).exp()).abs() < 1e-15);
/// let coarse = sampled_poles(&continuous, 1e-2)?;
/// assert!((coarse[0].re - (-0.1_f64).exp()).abs() < 1e-15);
/// assert!((coarse[1].re - (-4.0_f64).exp()).abs() < 1e-15);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::OutOfRange`] for a bad `period` and for a pole that is not finite or whose angle is
/// above pi per sample; [`Error::Overflow`] when e^(p T) is out of range.
pub fn sampled_poles(continuous: &[Complex<f64>], period: f64) -> Result<Vec<Complex<f64>>, Error> {
    check::positive("the sample time", period)?;
    for pole in continuous {
        let (decay, angle) = (pole.re * period, pole.im * period);
        check::that(decay.is_finite(), "Re(p) T", decay, "finite")?;
        let rule = "at most pi in modulus: half a turn per sample";
        check::that(angle.abs() <= std::f64::consts::PI, "Im(p) T", angle, rule)?;
    }
    let fastest = continuous.iter().map(|pole| -pole.re * period).fold(0.0, f64::max);
    let exponent = if fastest > FASTEST { FASTEST.ln() / fastest.ln() } else { 1.0 };
    let sampled = |pole: &Complex<f64>| {
        let decay = -pole.re * period;
        let decay = if decay > 1.0 { decay.powf(exponent) } else { decay };
        let z = Complex::from_polar((-decay).exp(), pole.im * period);
        if z.is_finite() { Ok(z) } else { Err(Error::Overflow { what: "e^(p T)" }) }
    };
    continuous.iter().map(sampled).collect()
}

/// Discretises the plant.
///
/// ```text
/// [x; f](T) = e^([A, F_a; 0, A_f] T) [x; f] + integral of e^([A, F_a; 0, A_f] s) ds [B; 0] u
/// y_f[k+1]  = y_f[k] + (I - e^(-W T)) (y[k] - y_f[k])
/// ```
///
/// `extended`: in continuous time; a plant that is sampled with `period` is returned unchanged; `period`: T in s, above
/// zero. Exact for a held u and faults that follow their model, also for a ramp within the interval; the measurement
/// filter operates on samples. Method and precision: see [`FirstOrderHold`].
///
/// # Errors
///
/// Same as [`FaultyPlant::check`] and [`FirstOrderHold::new`]; [`Error::Shape`] when the filter
/// does not fit the plant; [`Error::OutOfRange`] for a plant that is sampled with another period.
pub fn sample(extended: &ExtendedPlant, period: f64) -> Result<FaultyPlant, Error> {
    let ExtendedPlant { plant, filter, states, domain, .. } = extended;
    plant.check()?;
    check::positive("the sample time", period)?;
    if *domain != Domain::Continuous {
        let is_same = *domain == Domain::Sampled { period };
        check::that(is_same, "the sample time", period, "that of the sampled plant")?;
        return Ok(plant.clone());
    }
    let (all, q) = plant.f_a.shape();
    let filters = filter.as_ref().map_or(0, Vec::len);
    check::shape("A", &plant.a, (states + filters, states + filters))?;
    let n = *states;
    let both = block_2x2(
        [&plant.a.view((0, 0), (n, n)).into(), &plant.f_a.rows(0, n).into()],
        [&DMatrix::zeros(q, n), &plant.a_f],
    );
    let input = plant.b.rows(0, n).into_owned().resize_vertically(n + q, 0.0);
    let hold = FirstOrderHold::new(&both, &input, period)?;
    let a: DMatrix<f64> = hold.phi.view((0, 0), (n, n)).into();
    let f_a: DMatrix<f64> = hold.phi.view((0, n), (n, q)).into();
    let b = hold.gamma_0.rows(0, n).into_owned().resize_vertically(all, 0.0);
    let a_f = hold.phi.view((n, n), (q, q)).into();
    let Some(rates) = filter else {
        return Ok(FaultyPlant { a, b, c: plant.c.clone(), f_a, a_f });
    };
    let gains = coefficients(rates, Domain::Sampled { period });
    let gain = gains.iter().zip(rates).map(|(gain, rate)| gain / rate);
    let gain = DMatrix::from_diagonal(&DVector::from_vec(gain.collect()));
    let decay = DVector::from_vec(rates.iter().map(|rate| (-rate * period).exp()).collect());
    Ok(FaultyPlant {
        a: block_2x2(
            [&a, &DMatrix::zeros(n, filters)],
            [&(&gain * plant.a.view((n, 0), (filters, n))), &DMatrix::from_diagonal(&decay)],
        ),
        b,
        c: plant.c.clone(),
        f_a: stacked(&f_a, &(&gain * plant.f_a.rows(n, filters))),
        a_f,
    })
}

/// Designs the controller for its sample time.
///
/// ```text
/// prediction:  e[k+1] = (A_0 - L C_0) e[k]
/// current:     e[k+1] = (A_0 - M C_0 A_0) e[k],   e after the correction by y[k]
/// ```
///
/// `extended`: the plant as for [`sample`]; `period`: T in s, above zero; `controller_poles`: one per state of the
/// plant itself; `observer_poles`: one per state of the extended plant and entry of `f_hat`, both in the z plane, of
/// modulus below one for a stable loop, see [`sampled_poles`]; `k_f`: m x q, or None for [`compensation_gain`], with
/// which the held u cancels a ramp of a continuous plant on average. The design exists when the sampled plant is
/// controllable and its augmented pair observable, for the current estimator with the output `C_0` `A_0`: `A_0` must
/// not be singular, as it is with very fast filters. Method, cost and tolerance: see [`crate::placement::place`]. The
/// pair of feedback and observer is chosen from the [`crate::placement::alternatives`] as in [`crate::aso::design`].
///
/// The estimator is placed in the coordinates of [`place_estimator`], so that the condition number depends neither on
/// the sample time nor on units.
///
/// Two choices matter more than the poles. The current estimator acts one sample earlier. With a ramp as the fault
/// model, the error of the command after a step of the fault, `K_f` eps - `K_x` e, changes its sign and has almost the
/// sum zero, so that the plant is hardly displaced. For the friction pendulum of [`crate::aso`]'s source (poles of the
/// source, -2500 added for the ramp), half of peak to peak of the cart is then, in mm:
///
/// | sample time in ms | 0.1 | 0.5 | 1 | 2 | 5 | 10 |
/// |---|---|---|---|---|---|---|
/// | constant, prediction | 1.02 | 1.35 | 1.87 | 3.30 | 8.51 | 18.3 |
/// | constant, current | 0.94 | 1.08 | 1.27 | 2.08 | 5.06 | 10.5 |
/// | ramp, current | 0.010 | 0.013 | 0.020 | 0.057 | 0.34 | 1.39 |
///
/// Source: G. F. Franklin, J. D. Powell and M. Workman, Digital control of dynamic systems, 3rd
/// edition (1998), section 8.2.
///
/// # Errors
///
/// Same as [`sample`], [`FaultyPlant::check_observer_exists`] for the sampled plant and
/// [`crate::placement::place`]; [`Error::Shape`], [`Error::NotFinite`] for a bad `k_f`;
/// [`Error::PolesMissed`] when the closed loop is unstable although all requested poles are stable.
pub fn design(
    extended: &ExtendedPlant,
    period: f64,
    estimator: Estimator,
    controller_poles: &[Complex<f64>],
    observer_poles: &[Complex<f64>],
    k_f: Option<&DMatrix<f64>>,
) -> Result<SampledDesign, Error> {
    let plant = sample(extended, period)?;
    plant.check_observer_exists()?;
    let domain = Domain::Sampled { period };
    let k_f = k_f.cloned().map_or_else(|| compensation_gain(extended, domain), Ok)?;
    check::shape("K_f", &k_f, (plant.b.ncols(), plant.f_a.ncols()))?;
    let feedbacks =
        place_controller(&plant, extended.states, controller_poles, alternatives_discrete)?;
    let (a_0, c_0) = (plant.augmented_dynamics(), plant.augmented_output());
    let output = estimator.output_matrix(&a_0, &c_0);
    let observers = estimator_alternatives(&a_0, &output, observer_poles)?;
    let candidates = GainCandidates {
        plant: &plant,
        feedbacks: &feedbacks,
        observers: &observers,
        estimator,
        k_f: &k_f,
        domain,
    };
    let (gains, [feedback, observer]) = candidates.best()?;
    let controller_system = controller(&plant, &gains, domain)?;
    let dynamics = closed_loop(&plant, &controller_system, &vec![1.0; plant.b.ncols()])?;
    let radius = 1.0 + instability(&dynamics, domain)?;
    let poles = controller_poles.iter().chain(observer_poles);
    let largest = poles.fold(0.0, |largest: f64, pole| largest.max(pole.norm()));
    if largest < 1.0 && radius >= 1.0 {
        return Err(Error::PolesMissed { relative: radius - largest, allowed: 1.0 - largest });
    }
    Ok(SampledDesign {
        period,
        plant,
        filter: filter(extended, domain),
        gains,
        controller: feedback,
        observer,
        radius,
    })
}

/// Computes the gain L of a sampled observer: `a_0` - L `output` has the eigenvalues `poles`.
///
/// `a_0`: n x n; `output`: p x n, [`Estimator::output_matrix`]; `poles`: n, in the z plane. The
/// states are first scaled such that each of them alone, over n samples, gives an output with a sum
/// of squares of about one. Existence, method, cost and tolerance: see [`crate::placement::place_discrete`].
///
/// # Errors
///
/// Same as [`crate::placement::place_discrete`].
pub fn place_estimator(
    a_0: &DMatrix<f64>,
    output: &DMatrix<f64>,
    poles: &[Complex<f64>],
) -> Result<(DMatrix<f64>, Quality), Error> {
    let placed = place_dual(a_0, output, poles, Extent::Chosen)?.chosen;
    Ok((placed.gain, placed.quality))
}

/// Computes the gain L of [`place_estimator`] and its [`crate::placement::alternatives`].
///
/// # Errors
///
/// Same as [`place_estimator`].
pub fn estimator_alternatives(
    a_0: &DMatrix<f64>,
    output: &DMatrix<f64>,
    poles: &[Complex<f64>],
) -> Result<Alternatives, Error> {
    place_dual(a_0, output, poles, Extent::Alternatives)
}

/// Computes the gain of [`place_estimator`], or the gains of [`estimator_alternatives`].
fn place_dual(
    a_0: &DMatrix<f64>,
    output: &DMatrix<f64>,
    poles: &[Complex<f64>],
    extent: Extent,
) -> Result<Alternatives, Error> {
    let n = check::square("A_0", a_0)?;
    check::shape("C_0", output, (output.nrows(), n))?;
    let mut response = output.clone();
    let mut energy = DVector::zeros(a_0.nrows());
    for _ in 0..a_0.nrows() {
        energy += DVector::from_fn(a_0.nrows(), |state, _| response.column(state).norm_squared());
        response *= a_0;
    }
    let units = energy.map(|energy: f64| 1.0 / power_of_two_or_one(1.0 / energy.sqrt()));
    let (a, b) = (a_0.transpose(), output.transpose());
    let problem = PlacementProblem { a: &a, b: &b, poles, sampled: true };
    let placed = problem.alternatives(&Coordinates::Scaled(&units), extent)?;
    Ok(placed.map(|gain| -gain.transpose()))
}

/// The coefficients of the measurement filter in `domain`: the rates w, in sampled time the gains
/// 1 - e^(-w T). None without a filter.
#[must_use]
pub fn filter(extended: &ExtendedPlant, domain: Domain) -> Option<Vec<f64>> {
    extended.filter.as_ref().map(|rates| coefficients(rates, domain))
}

/// Computes `K_f` for a controller in `domain`: [`FaultyPlant::compensation_gain`]; for a continuous plant with a
/// sampled controller, this gain times the mean of the modelled fault over the interval.
///
/// # Errors
///
/// Same as [`FaultyPlant::compensation_gain`] and [`FirstOrderHold::new`].
pub fn compensation_gain(extended: &ExtendedPlant, domain: Domain) -> Result<DMatrix<f64>, Error> {
    let gain = extended.plant.compensation_gain()?;
    let (Domain::Continuous, Domain::Sampled { period }) = (extended.domain, domain) else {
        return Ok(gain);
    };
    let q = extended.plant.a_f.nrows();
    let hold = FirstOrderHold::new(&extended.plant.a_f, &DMatrix::identity(q, q), period)?;
    Ok(gain * hold.gamma_0 / period)
}
