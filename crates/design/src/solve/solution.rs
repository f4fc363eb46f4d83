//! Computes the gains for the plant of a plant file.

use control::aso::{FaultyPlant, Gains};
use control::controller::{CompleteController, closed_loop};
use control::detectability::{Detectability, detectability};
use control::distance::Distance;
use control::faults::ExtendedPlant;
use control::lmi::RegionCertificate;
use control::rank::Rank;
use control::robustness::{Loop, held_plant};
use control::sampled;
use control::stability::instability;
use control::{Domain, Error, StateSpace};
use files::PlaceError;
use nalgebra::DMatrix;
use plant_file::estimation::Law;
use plant_file::requirements::Requirement;
use plant_file::{FAULTS, PlantFile};

use crate::plant::linear::LinearPlant;
use crate::plant::plausibility::{check_faults, check_limits, inaccurate};
use crate::plant::{attainable, delays, feedthrough, filters};
use crate::solve::existence::{check_controllable, check_detectable};
use crate::solve::family::{self, Family, Member, common_feedback};
use crate::solve::gain::{GainResult, unique};
use crate::solve::gain_problem::GainProblem;
use crate::solve::law::{DesignedLaw, LawProblem};
use crate::solve::refusal::feedback_refused;
use crate::solve::tracking::{
    DesignLoop, LoopModel, Tracking, TrackingProblem, check_references, decay, feedback_pair,
    integral_action,
};

/// The controller of one plant, with the intermediate results.
pub(crate) struct Solution {
    pub(crate) linear: LinearPlant,
    /// The plant with fault models and measurement filter, in the time domain of `linear`.
    pub(crate) extended: ExtendedPlant,
    pub(crate) domain: Domain,
    /// The model in the observer: the extended plant, sampled for a sampled design.
    pub(crate) plant: FaultyPlant,
    /// The measurement filter in the controller.
    pub(crate) filter: Option<Vec<f64>>,
    pub(crate) gains: Gains,
    /// The law that estimates the faults.
    pub(crate) law: DesignedLaw,
    /// The error dynamics of the augmented observer that meets the requirement.
    pub(crate) required_error_dynamics: DMatrix<f64>,
    pub(crate) feedback: GainResult,
    pub(crate) observer: GainResult,
    pub(crate) controllability: Rank,
    pub(crate) distance: Distance,
    pub(crate) detectability: Detectability,
    /// The part of the faults' effect on the states of the plant that the compensation cannot cancel, relative to this
    /// effect.
    pub(crate) cancellation_residual: f64,
    /// The set points of measurements, if there are any.
    pub(crate) tracking: Option<Tracking>,
    /// A and B of the plant for the state feedback; with integral action the integrals follow the states of the plant.
    pub(crate) feedback_pair: (DMatrix<f64>, DMatrix<f64>),
    /// The plant and the linear controller from its measurements to its commands.
    pub(crate) whole: DesignLoop,
    /// Largest real part of the closed-loop eigenvalues, or largest modulus minus one; negative if
    /// stable.
    pub(crate) instability: f64,
    /// Whether the faults are also estimated before their compensation starts.
    pub(crate) monitor: bool,
    /// The instability of the observer error before `t_on`; None if the faults are estimated from the start.
    pub(crate) instability_before: Option<f64>,
}

/// The controller of the plant of a file, with the family that it serves and the warnings.
pub(crate) struct SolveResult {
    pub(crate) solution: Solution,
    /// The plants that the controller serves besides the one of the file.
    pub(crate) family: Option<Family>,
    /// Warnings about the plant file, with their places.
    pub(crate) warnings: Vec<PlaceError>,
}

/// Solves for the controller of the plant of `file` with `law` for the estimates of the faults.
pub(crate) fn solve(file: &PlantFile<'_>, law: &Law) -> Result<SolveResult, crate::Error> {
    crate::threads::start()?;
    let linear = LinearPlant::of(file)?;
    feedthrough::check(file, &linear)?;
    delays::check(file, &linear.delays, &linear.undelayed)?;
    let mut warnings = check_limits(file, &linear)?;
    warnings.extend(file.model.only_samples().map(|reason| file.error(&["matrices", "A"], reason)));
    warnings.extend(inaccurate(file, &linear));
    warnings.extend(attainable::warnings(file, &linear)?);
    let filter = file.filter.as_deref().unwrap_or_default();
    let LinearPlant { a, b, c, models, .. } = &linear;
    let extended = ExtendedPlant::in_domain([a, b, c], models, filter, linear.domain)
        .map_err(|error| file.error(&["A"], error.to_string()))?;
    let (controllable, detectability) = rayon::join(
        || check_controllable(file, &linear, &mut warnings),
        || detectability(&extended.plant, extended.domain),
    );
    let (controllability, distance) = controllable?;
    check_faults(file, &linear, &extended)?;
    check_references(file, &linear)?;
    let detectability = detectability.map_err(|error| file.error(&FAULTS, error.to_string()))?;
    check_detectable(file, &linear, &extended, &detectability, &mut warnings)?;
    let (domain, mut plant) = in_domain(file, &linear, &extended)?;
    let references = file.references.as_ref();
    let states = extended.states;
    let a_x = plant.a.view((0, 0), (states, states)).into_owned();
    let b_x = plant.b.rows(0, states).into_owned();
    let pair = feedback_pair(references, [&a_x, &b_x, c], domain)?;
    let members = family::members(file, &linear, &mut warnings)?;
    let (common, certificate) = feedback_of_family(file, &linear, &members, domain)?.unzip();
    let problem = GainProblem {
        file,
        linear: &linear,
        extended: &extended,
        plant: &plant,
        pair: &pair,
        domain,
    };
    let n = plant.a.nrows();
    let k_f = sampled::compensation_gain(&extended, domain)?;
    let controller_gains = |feedback: &DMatrix<f64>, observer: &DMatrix<f64>| Gains {
        estimator: file.estimator(),
        k_x: feedback.columns(0, states).into_owned().resize_horizontally(n, 0.0),
        k_f: k_f.clone(),
        l_x: observer.rows(0, n).into(),
        l_f: -observer.rows(n, plant.f_a.ncols()),
        p_f: None,
        integral: integral_action(references, &linear, &extended, feedback),
    };
    let filter = sampled::filter(&extended, domain);
    let (feedback, observer, warning) =
        problem.chosen(common, filter.as_deref(), controller_gains)?;
    warnings.extend(warning);
    let gains = controller_gains(&feedback.gain, &observer.gain);
    let problem =
        LawProblem { linear: &linear, extended: &extended, plant: &plant, gains: &gains, domain };
    let designed =
        problem.design(law).map_err(|reason| not_existing(file, law, &reason, &problem))?;
    let observer = if designed.keeps_error_dynamics() { observer } else { by_law(&designed) };
    let required_error_dynamics = gains.error_dynamics(&plant);
    let (gains, own_model) = (designed.gains.clone(), designed.a_f.clone());
    plant.a_f = own_model.unwrap_or(plant.a_f);
    let model = LoopModel { linear: &linear, plant: &plant, filter: filter.as_deref(), domain };
    let whole = model.design_loop(&gains)?;
    let instability = instability_of(model, &gains, &whole)?;
    let controlled = &pair.0 + &pair.1 * &feedback.gain;
    let problem = TrackingProblem {
        file,
        linear: &linear,
        a: &a_x,
        b: &b_x,
        gains: &gains,
        feedback: &controlled,
        domain,
    };
    let tracking = problem.solve()?;
    let solution = Solution {
        cancellation_residual: extended.cancellation_residual(&extended.plant.compensation_gain()?),
        instability_before: instability_before(file, &gains, &plant, domain)?,
        instability,
        monitor: file.monitor,
        filter,
        linear,
        extended,
        domain,
        plant,
        gains,
        law: designed,
        required_error_dynamics,
        feedback,
        observer,
        controllability,
        distance,
        detectability,
        tracking,
        feedback_pair: pair,
        whole,
    };
    let family = (!members.is_empty()).then_some(Family { members, feedback: certificate });
    Ok(SolveResult { solution, family, warnings })
}

/// Computes one feedback for the plant and the members of its family; None without members, or if no region is
/// required.
fn feedback_of_family(
    file: &PlantFile<'_>,
    linear: &LinearPlant,
    members: &[Member],
    domain: Domain,
) -> Result<Option<(GainResult, RegionCertificate)>, PlaceError> {
    match &file.feedback.requirement {
        Requirement::Region(region) if !members.is_empty() => {
            let references = file.references.as_ref();
            let gain = common_feedback(linear, members, references, *region, domain);
            gain.map(Some).map_err(|refusal| feedback_refused(file, linear, domain, refusal))
        }
        _ => Ok(None),
    }
}

/// Returns the instability of plant and controller; with delays the larger one for two plants: the plant of the design,
/// and the plant of the verdict, which approximates delays better.
fn instability_of(model: LoopModel<'_>, gains: &Gains, whole: &DesignLoop) -> Result<f64, Error> {
    let LoopModel { linear, plant, domain, .. } = model;
    let dynamics = closed_loop(&whole.plant, &whole.controller, &vec![1.0; plant.b.ncols()])?;
    let of_design = instability(&dynamics, domain)?;
    if !linear.delays.any() {
        return Ok(of_design);
    }
    let closed = looped(&linear.judged()?, &model.complete(gains)?.commands)?;
    Ok(of_design.max(instability(&closed.dynamics(), domain)?))
}

/// Returns the instability of the observer error before `t_on`; None if the faults are estimated from the start.
fn instability_before(
    file: &PlantFile<'_>,
    gains: &Gains,
    plant: &FaultyPlant,
    domain: Domain,
) -> Result<Option<f64>, Error> {
    if file.t_on <= 0.0 || file.monitor {
        return Ok(None);
    }
    instability(&gains.state_error_dynamics(plant), domain).map(Some)
}

/// Returns an error at the law of the file, which names the laws that exist.
fn not_existing(
    file: &PlantFile<'_>,
    law: &Law,
    reason: &str,
    problem: &LawProblem<'_>,
) -> PlaceError {
    let message = format!(
        "the law {} does not exist for this plant: {reason}; possible are {}",
        law.name(),
        problem.existing().join(", ")
    );
    file.error_at(&file.estimation.place, message)
}

/// Returns the observer of a law with error dynamics of its own.
fn by_law(law: &DesignedLaw) -> GainResult {
    let method = format!("By the law {}, as fast as the requirement on average.", law.law.name());
    unique(law.gains.observer_gain(), method)
}

/// Returns the time domain of the design and the model in the observer, sampled for a sampled design.
fn in_domain(
    file: &PlantFile<'_>,
    linear: &LinearPlant,
    extended: &ExtendedPlant,
) -> Result<(Domain, FaultyPlant), PlaceError> {
    let Some(sampling) = file.sampling else {
        return Ok((Domain::Continuous, extended.plant.clone()));
    };
    let period = sampling.period;
    let refuse =
        |error: Error| file.error(&["sample_time"], format!("sampled every {period} s: {error}"));
    let mut plant = sampled::sample(extended, period).map_err(refuse)?;
    let domain = Domain::Sampled { period };
    if let Some(pid) = file.pid() {
        filters::sample(pid, &mut plant, &linear.c, domain).map_err(refuse)?;
    }
    plant.check_detectable(domain).map_err(refuse)?;
    Ok((domain, plant))
}

/// Returns the loop of a plant and a controller, in the time domain of the controller.
pub(crate) fn looped(plant: &StateSpace, controller: &StateSpace) -> Result<Loop, Error> {
    let plant = match controller.domain {
        Domain::Continuous => plant.clone(),
        Domain::Sampled { period } => held_plant(plant, period)?,
    };
    Loop::new(plant, controller.clone())
}

impl Solution {
    /// Returns the controller with other gains, its filter and its integrals.
    pub(crate) fn complete(&self, gains: &Gains) -> Result<CompleteController, Error> {
        self.model().complete(gains)
    }

    /// Returns plant, filter and time domain for which the loop is computed.
    pub(crate) fn model(&self) -> LoopModel<'_> {
        let Self { linear, plant, filter, domain, .. } = self;
        LoopModel { linear, plant, filter: filter.as_deref(), domain: *domain }
    }

    /// Returns A + B K_x, n x n, the dynamics under exact state feedback; with integral action the dynamics of the
    /// plant extended by the integrals, with [K_x, K_i].
    pub(crate) fn feedback_dynamics(&self) -> DMatrix<f64> {
        &self.feedback_pair.0 + &self.feedback_pair.1 * &self.feedback.gain
    }

    /// Returns the decay rate of the slowest eigenvalue under exact state feedback, 1/s.
    pub(crate) fn slowest_rate(&self) -> Result<f64, Error> {
        decay(&self.feedback_dynamics(), self.domain)
    }
}
