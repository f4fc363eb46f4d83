//! Computes the gains for the plant of a plant file.

use std::ops::Range;

use crate::plant::fixed_mode::{described, described_in};
use crate::plant::linear::LinearPlant;
use crate::plant::plausibility::{check_faults, check_limits};
use crate::plant::{attainable, feedthrough};
use crate::solve::family::{self, Family, Member, common_feedback};
use crate::solve::gain::{FeedbackProblem, GainResult, Refusal, unique};
use crate::solve::gains::{feedback, observer};
use crate::solve::law::{DesignedLaw, LawProblem};
use crate::solve::loop_shape::{LoopProblem, Shaped};
use crate::solve::norm_gains::ObserverProblem;
use crate::solve::pairing::PairProblem;
use crate::solve::tracking::{
    DesignLoop, Tracking, TrackingProblem, check_references, decay, feedback_pair, integral_action,
};
use control::aso::{Estimator, FaultyPlant, Gains};
use control::controller::{CompleteController, closed_loop, complete_controller, with_feedthrough};
use control::detectability::{Detectability, detectability};
use control::distance::{Distance, from_uncontrollable};
use control::faults::ExtendedPlant;
use control::lmi::{self, RegionCertificate};
use control::rank::{Mode, Rank, controllability, uncontrollable_modes};
use control::robustness::{Loop, held_plant};
use control::sampled;
use control::stability::{instability, is_clearly_stable};
use control::{Domain, Error, StateSpace};
use files::PlaceError;
use nalgebra::DMatrix;
use plant_file::estimation::Law;
use plant_file::requirements::{Request, Requirement};
use plant_file::{FAULTS, PlantFile};

/// The controller of one plant, with the intermediate results.
pub(crate) struct Solution {
    pub(crate) linear: LinearPlant,
    /// The plant with fault models and measurement filter, in continuous time.
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
    /// The part of the faults' effect on the states that the compensation cannot cancel, relative.
    pub(crate) cancellation_residual: f64,
    /// The set points of measurements, if there are any.
    pub(crate) tracking: Option<Tracking>,
    /// A and B of the feedback: those of the plant, with integral action followed by the integrals.
    pub(crate) feedback_pair: (DMatrix<f64>, DMatrix<f64>),
    /// The plant and the linear controller from its measurements to its commands.
    pub(crate) whole: DesignLoop,
    /// Largest real part of the closed-loop eigenvalues, or largest modulus minus one; negative if
    /// stable.
    pub(crate) instability: f64,
    /// Whether the faults are estimated while they are not compensated.
    pub(crate) monitor: bool,
    /// The same for the observer error before `t_on`, if the faults are not estimated then.
    pub(crate) instability_before: Option<f64>,
}

/// The controller of the plant of a file, and what it was solved with.
pub(crate) struct Solved {
    pub(crate) solution: Solution,
    /// The plants that the controller serves besides the one of the file.
    pub(crate) family: Option<Family>,
    /// What is unusual in the plant file, with its place.
    pub(crate) warnings: Vec<PlaceError>,
}

/// Solves for the controller of the plant of `file` with `law` for the estimates of the faults.
pub(crate) fn solve(file: &PlantFile<'_>, law: &Law) -> Result<Solved, crate::Error> {
    crate::threads::start()?;
    let linear = LinearPlant::of(file)?;
    feedthrough::check(file, &linear)?;
    let mut warnings = check_limits(file, &linear)?;
    warnings.extend(attainable::warnings(file, &linear)?);
    let filter = file.filter.as_deref().unwrap_or_default();
    let LinearPlant { a, b, c, models, .. } = &linear;
    let extended = ExtendedPlant::new(a, b, c, models, filter)
        .map_err(|error| file.error(&["A"], error.to_string()))?;
    let (controllable, detectability) = rayon::join(
        || check_controllable(file, &linear, &mut warnings),
        || detectability(&extended.plant, Domain::Continuous),
    );
    let (controllability, distance) = controllable?;
    check_faults(file, &linear, &extended)?;
    check_references(file, &linear)?;
    let detectability = detectability.map_err(|error| file.error(&FAULTS, error.to_string()))?;
    check_detectable(file, &linear, &extended, &detectability, &mut warnings)?;
    let (domain, mut plant) = in_domain(file, &extended)?;
    let references = file.references.as_ref();
    let states = extended.states;
    let part =
        (plant.a.view((0, 0), (states, states)).into_owned(), plant.b.rows(0, states).into());
    let pair = feedback_pair(references, [&part.0, &part.1, c], domain)?;
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
    let with = |feedback: &DMatrix<f64>, observer: &DMatrix<f64>| Gains {
        estimator: estimator(file),
        k_x: feedback.columns(0, states).into_owned().resize_horizontally(n, 0.0),
        k_f: k_f.clone(),
        l_x: observer.rows(0, n).into(),
        l_f: -observer.rows(n, plant.f_a.ncols()),
        p_f: None,
        integral: integral_action(references, &linear, &extended, feedback),
    };
    let filter = sampled::filter(&extended, domain);
    let (feedback, observer, warning) = problem.chosen(common, filter.as_deref(), with)?;
    warnings.extend(warning);
    let gains = with(&feedback.gain, &observer.gain);
    let problem =
        LawProblem { linear: &linear, extended: &extended, plant: &plant, gains: &gains, domain };
    let designed =
        problem.design(law).map_err(|reason| not_existing(file, law, &reason, &problem))?;
    let observer = if designed.keeps_error_dynamics() { observer } else { by_law(&designed) };
    let required_error_dynamics = gains.error_dynamics(&plant);
    let (gains, own_model) = (designed.gains.clone(), designed.a_f.clone());
    plant.a_f = own_model.unwrap_or(plant.a_f);
    let whole = DesignLoop::of(&linear, &plant, &gains, filter.as_deref(), domain)?;
    let instability = instability_of(&linear, &plant, &gains, filter.as_deref(), &whole)?;
    let controlled = &pair.0 + &pair.1 * &feedback.gain;
    let problem = TrackingProblem {
        file,
        linear: &linear,
        a: &part.0,
        b: &part.1,
        gains: &gains,
        feedback: &controlled,
        domain,
    };
    let tracking = problem.solve()?;
    let solution = Solution {
        cancellation_residual: cancellation_residual(&extended)?,
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
    Ok(Solved { solution, family, warnings })
}

/// Computes one feedback for the plant and the members of its family, if a region is required of them.
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

/// Returns the instability of plant and controller: the larger one of the design and of the judgement, whose delays are
/// approximated better.
fn instability_of(
    linear: &LinearPlant,
    plant: &FaultyPlant,
    gains: &Gains,
    filter: Option<&[f64]>,
    whole: &DesignLoop,
) -> Result<f64, Error> {
    let domain = whole.controller.domain;
    let dynamics = closed_loop(&whole.plant, &whole.controller, &vec![1.0; plant.b.ncols()])?;
    let of_design = instability(&dynamics, domain)?;
    if !linear.delays.any() {
        return Ok(of_design);
    }
    let controller = complete(linear, plant, gains, filter, domain)?.commands;
    let closed = looped(&linear.judged()?, &controller)?;
    Ok(of_design.max(instability(&closed.dynamics(), domain)?))
}

/// Returns the instability of the observer error before `t_on`, if the faults are not estimated then.
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

/// An error at the law of the file, with the laws that exist.
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

/// The observer of a law with error dynamics of its own.
fn by_law(law: &DesignedLaw) -> GainResult {
    let method = format!("By the law {}, as fast as the requirement on average.", law.law.name());
    unique(law.gains.observer_gain(), method)
}

fn estimator(file: &PlantFile<'_>) -> Estimator {
    match file.sampling {
        Some(sampling) if sampling.current => Estimator::Current,
        _ => Estimator::Prediction,
    }
}

/// Returns the model in the observer: sampled for a sampled design.
fn in_domain(
    file: &PlantFile<'_>,
    extended: &ExtendedPlant,
) -> Result<(Domain, FaultyPlant), PlaceError> {
    let Some(sampling) = file.sampling else {
        return Ok((Domain::Continuous, extended.plant.clone()));
    };
    let period = sampling.period;
    let refuse =
        |error: Error| file.error(&["sample_time"], format!("sampled every {period} s: {error}"));
    let plant = sampled::sample(extended, period).map_err(refuse)?;
    let domain = Domain::Sampled { period };
    plant.check_detectable(domain).map_err(refuse)?;
    Ok((domain, plant))
}

/// What the gains of feedback and observer are computed for.
struct GainProblem<'a> {
    file: &'a PlantFile<'a>,
    linear: &'a LinearPlant,
    extended: &'a ExtendedPlant,
    /// The model in the observer.
    plant: &'a FaultyPlant,
    /// A and B of the feedback.
    pair: &'a (DMatrix<f64>, DMatrix<f64>),
    domain: Domain,
}

impl GainProblem<'_> {
    /// Computes the gains of feedback and observer. `common`: the feedback of a family.
    fn solve(&self, common: Option<GainResult>) -> Result<(GainResult, GainResult), PlaceError> {
        let Self { file, linear, extended, plant, pair: (a, b), domain } = *self;
        let n = extended.states;
        let order = a.nrows();
        let problem = FeedbackProblem {
            a,
            b,
            c: &linear.c.clone().resize_horizontally(order, 0.0),
            states: n,
            f_a: &plant.f_a.rows(0, n).into_owned().resize_vertically(order, 0.0),
        };
        let of_feedback = linear.with_delays(&file.feedback.requirement, order);
        let feedback = || match common {
            Some(common) => Ok(common),
            None => feedback(&of_feedback, &problem, domain),
        };
        let (a_0, c_0) = (plant.augmented_dynamics(), plant.augmented_output());
        let of_observer = linear.with_delays(&file.observer.requirement, a_0.nrows());
        let filter = sampled::filter(extended, domain);
        let observer_problem = ObserverProblem {
            a_0: &a_0,
            c_0: &c_0,
            b: &plant.b,
            channels: &extended.channels,
            faults: plant.f_a.ncols(),
            filter: filter.as_deref(),
            estimator: estimator(file),
        };
        // Both run in other threads, which have the same time.
        let ending = lmi::ending();
        let feedback = || lmi::until(ending.clone(), feedback);
        let observer = || observer(&of_observer, &observer_problem, domain);
        let observer = || lmi::until(ending.clone(), observer);
        let (feedback, observer) = rayon::join(feedback, observer);
        let feedback =
            feedback.map_err(|refusal| feedback_refused(file, linear, domain, refusal))?;
        let observer = observer.map_err(|refusal| {
            let names = observer_states(linear, extended);
            let meaning = "states, filters, faults and rates of ramps";
            let states = States { names, meaning, of_delays: linear.delay_states() };
            refused(file, domain, &file.observer, refusal, &states)
        })?;
        Ok((feedback, observer))
    }

    /// Returns the gains of feedback and observer together, with a warning if they do not give the loop its shape.
    /// `gains`: those of the controller.
    fn chosen(
        &self,
        common: Option<GainResult>,
        filter: Option<&[f64]>,
        gains: impl Fn(&DMatrix<f64>, &DMatrix<f64>) -> Gains + Sync,
    ) -> Result<(GainResult, GainResult, Option<PlaceError>), crate::Error> {
        let Self { file, linear, plant, domain, .. } = *self;
        if let Some(shape) = &file.loop_shape {
            let problem = LoopProblem { shape, linear, plant, filter, domain, gains };
            let Shaped { feedback, observer, warning } = problem.tuned(&self.starts()?)?;
            return Ok((feedback, observer, warning.map(|text| file.error_at(&shape.place, text))));
        }
        let (feedback, observer) = self.solve(common)?;
        // The gains of a schedule are interpolated, so that each point takes the first of its pairs.
        if file.is_scheduled() {
            return Ok((feedback, observer, None));
        }
        let problem = PairProblem { linear, plant, filter, domain };
        let (feedback, observer) = problem.chosen(feedback, observer, gains)?;
        Ok((feedback, observer, None))
    }

    /// The gains with which the search for the shape of the loop starts, if the file states one.
    fn starts(&self) -> Result<Vec<[DMatrix<f64>; 2]>, PlaceError> {
        let Some(shape) = &self.file.loop_shape else { return Ok(Vec::new()) };
        let gains = |[feedback, observer]: [Request; 2]| {
            let mut file = self.file.clone();
            (file.feedback, file.observer) = (feedback, observer);
            let (feedback, observer) = GainProblem { file: &file, ..*self }.solve(None)?;
            Ok([feedback.gain, observer.gain])
        };
        shape.starts(self.domain).into_iter().map(gains).collect()
    }
}

fn feedback_refused(
    file: &PlantFile<'_>,
    linear: &LinearPlant,
    domain: Domain,
    refusal: Refusal,
) -> PlaceError {
    let names = feedback_states(file, linear);
    let more = names.len() > linear.states.len();
    let meaning = if more { "states and integrals of references" } else { "states" };
    let states = States { names, meaning, of_delays: linear.delay_states() };
    refused(file, domain, &file.feedback, refusal, &states)
}

/// Returns the part of the faults' effect on the plant's states that the compensation leaves,
/// relative.
fn cancellation_residual(extended: &ExtendedPlant) -> Result<f64, Error> {
    let ExtendedPlant { plant, states, .. } = extended;
    let left = &plant.b * plant.compensation_gain()? + &plant.f_a;
    let whole = plant.f_a.rows(0, *states).norm();
    Ok(if whole > 0.0 { left.rows(0, *states).norm() / whole } else { 0.0 })
}

/// Checks that the commands reach every mode that is not stable; the error names the mode.
fn check_controllable(
    file: &PlantFile<'_>,
    linear: &LinearPlant,
    warnings: &mut Vec<PlaceError>,
) -> Result<(Rank, Distance), crate::Error> {
    let refuse = |error: Error| file.error(&["B", "actuators"], error.to_string());
    let rank = controllability(&linear.a, &linear.b).map_err(refuse)?;
    let state = |at: usize| linear.states[at].name.clone();
    let modes = uncontrollable_modes(&linear.a, &linear.b).map_err(refuse)?;
    for mode in modes.into_iter().filter(above_or_on_the_real_axis) {
        let stable = is_clearly_stable(mode.eigenvalue, &linear.a, Domain::Continuous);
        let stable = stable.map_err(refuse)? && rank.rank > 0;
        if stable && linear.is_of_delays(&mode) {
            continue;
        }
        let message = format!(
            "the commands {} reach {} of {} states only: no feedback moves {}{}",
            names(linear.actuators.iter().map(|signal| signal.name.as_str())),
            rank.rank,
            rank.n,
            described(&mode, state),
            consequence(stable, &mode),
        );
        let error = file.error(&["B", "actuators"], message);
        if !stable {
            return Err(error.into());
        }
        warnings.push(error);
    }
    Ok((rank, from_uncontrollable(&linear.a, &linear.b).map_err(refuse)?))
}

/// Selects one mode of each complex pair.
fn above_or_on_the_real_axis(mode: &Mode) -> bool {
    mode.eigenvalue.im >= 0.0
}

/// What follows from a mode that no gain moves.
fn consequence(stable: bool, mode: &Mode) -> &'static str {
    match stable {
        true => "; it is stable and keeps its eigenvalue",
        false if mode.eigenvalue.re < 0.0 => "",
        false => "; expected that only stable modes are out of reach",
    }
}

/// Checks that the augmented observer exists; the error names the faults and the measurements.
fn check_detectable(
    file: &PlantFile<'_>,
    linear: &LinearPlant,
    extended: &ExtendedPlant,
    detectability: &Detectability,
    warnings: &mut Vec<PlaceError>,
) -> Result<(), crate::Error> {
    let measurements = names(linear.measurements.iter().map(|signal| signal.name.as_str()));
    let modes = detectability.unobservable.iter();
    let shown = |(mode, stable): &&(Mode, bool)| {
        above_or_on_the_real_axis(mode) && !(*stable && linear.is_of_delays(mode))
    };
    for (mode, stable) in modes.filter(shown) {
        let message = format!(
            "the measurements {measurements} show {} of {} states only: no observer moves {}{}",
            detectability.observability.rank,
            detectability.observability.n,
            described(mode, |at| state_name(linear, at).to_owned()),
            consequence(*stable, mode),
        );
        let error = file.error(&["C", "measurements"], message);
        if !stable {
            return Err(error.into());
        }
        warnings.push(error);
    }
    let fault_names = fault_names(linear, extended);
    if let Some(&unseen) = detectability.invisible_faults().first() {
        let message = format!(
            "fault `{}` cannot be seen from the measurements {measurements}",
            fault_names[unseen]
        );
        return Err(at_fault(file, linear, unseen, message).into());
    }
    if let Some(hidden) = detectability.hidden.first() {
        let faults = hidden.faults();
        let states: Vec<_> = hidden.states().iter().map(|&at| state_name(linear, at)).collect();
        let mut hiding = faults.iter().map(|&fault| fault_names[fault].as_str());
        // If no state is involved, the fault is hidden by the other faults.
        let (distinguished, from): (Vec<_>, String) = match states.as_slice() {
            [] => (hiding.by_ref().take(1).collect(), hiding.collect::<Vec<_>>().join(", ")),
            states => (hiding.collect(), format!("a movement of {}", states.join(", "))),
        };
        let message = format!(
            "{} of {} independent courses of faults and states are seen: the measurements \
             {measurements} cannot tell a {} of {} from {}",
            hidden.rank,
            hidden.expected,
            if hidden.at.norm() > 0.0 { "change" } else { "constant value" },
            distinguished.join(", "),
            from,
        );
        return Err(at_fault(file, linear, faults[0], message).into());
    }
    extended
        .plant
        .check_detectable(Domain::Continuous)
        .map_err(|error| file.error(&FAULTS, error.to_string()))?;
    Ok(())
}

/// Returns an error at the entry of the fault in column `column` of F_a.
fn at_fault(
    file: &PlantFile<'_>,
    linear: &LinearPlant,
    column: usize,
    message: String,
) -> PlaceError {
    match linear.faults.get(column) {
        Some(fault) => file.error_at(&fault.place, message),
        None => file.error(&FAULTS, message),
    }
}

/// Returns the names of the faults, then of the rates of ramps.
pub(crate) fn fault_names(linear: &LinearPlant, extended: &ExtendedPlant) -> Vec<String> {
    let mut all: Vec<_> = linear.faults.iter().map(|fault| fault.name.clone()).collect();
    all.resize(extended.plant.f_a.ncols(), String::new());
    for (fault, channel) in linear.faults.iter().zip(&extended.channels) {
        if let Some(rate) = channel.rate {
            all[rate] = format!("{}_rate", fault.name);
        }
    }
    all
}

/// Returns the name of a state, or of the measurement that a filter state belongs to.
fn state_name(linear: &LinearPlant, state: usize) -> &str {
    let n = linear.states.len();
    let signal = linear.states.get(state).or_else(|| linear.measurements.get(state - n));
    signal.map_or("", |signal| signal.name.as_str())
}

fn names<'a>(list: impl Iterator<Item = &'a str>) -> String {
    list.collect::<Vec<_>>().join(", ")
}

/// Returns the names of the states of the feedback: states, with integral action the integrals.
pub(crate) fn feedback_states(file: &PlantFile<'_>, linear: &LinearPlant) -> Vec<String> {
    let integrals = file.references.iter().filter(|references| references.integral);
    let integrals = integrals.flat_map(|references| &references.signals);
    let integrals = integrals.map(|signal| format!("integral of {}", signal.name));
    linear.states.iter().map(|signal| signal.name.clone()).chain(integrals).collect()
}

/// Returns the names of the states of the observer: states, filters, faults.
fn observer_states(linear: &LinearPlant, extended: &ExtendedPlant) -> Vec<String> {
    let plain = (0..extended.plant.a.nrows()).map(|at| state_name(linear, at).to_owned());
    plain.chain(fault_names(linear, extended)).collect()
}

/// The states that a gain is for.
struct States {
    names: Vec<String>,
    /// What they are, in words.
    meaning: &'static str,
    /// Those of delays, for which a plant file states no weights.
    of_delays: Range<usize>,
}

impl States {
    /// The name of the state of a row of weights.
    fn weighted(&self, row: usize) -> &str {
        let later = if row < self.of_delays.start { 0 } else { self.of_delays.len() };
        self.names.get(row + later).map_or("", String::as_str)
    }
}

/// Converts the failure of a gain to an error at the requirement in the file.
fn refused(
    file: &PlantFile<'_>,
    domain: Domain,
    request: &Request,
    refusal: Refusal,
    states: &States,
) -> PlaceError {
    let (order, meaning) = (states.names.len(), states.meaning);
    let name = |at: usize| states.names[at].clone();
    let message = match refusal {
        Refusal::Conflict(message) => message,
        Refusal::Fixed(mode) => fixed(&request.requirement, &mode, domain, name),
        Refusal::Control(Error::PoleCount { .. }) => {
            let count = request.requirement.eigenvalues().len();
            let of_delays = match states.of_delays.len() {
                0 => String::new(),
                count => format!(" ({count} of them those of delays)"),
            };
            format!(
                "expected {order} eigenvalues, one for each of the {meaning}{of_delays}, found {count}"
            )
        }
        Refusal::Control(ref error @ Error::Unweighted { weight: "W", .. }) => {
            match request.requirement.without_noise() {
                Some(at) => format!(
                    "W states no noise for `{}` (its row {} is zero), so that the observer would not \
                     correct it; expected a number above 0 there",
                    states.weighted(at),
                    at + 1
                ),
                None => error.to_string(),
            }
        }
        Refusal::Control(error @ Error::Shape { matrix: "Q", .. }) => {
            format!("{error}, one row for each of the {meaning}")
        }
        Refusal::Control(error) => error.to_string(),
    };
    match &request.other {
        Some((name, place)) if message.starts_with(&format!("{name} ")) => {
            file.error_at(place, message)
        }
        _ => file.error_at(&request.place, message),
    }
}

/// Says that a requirement excludes the eigenvalue of a mode that no gain moves.
fn fixed(
    requirement: &Requirement,
    mode: &Mode,
    domain: Domain,
    name: impl Fn(usize) -> String,
) -> String {
    let sampled = matches!(requirement, Requirement::SampledEigenvalues(_));
    let described = described_in(mode, domain, sampled, name);
    match requirement {
        Requirement::Eigenvalues(_) | Requirement::SampledEigenvalues(_) => format!(
            "no gain moves {described}; expected it among the requested eigenvalues, or `region` or \
             weights in place of eigenvalues"
        ),
        _ => format!("no gain moves {described}, into the region; expected a region around it"),
    }
}

/// The controller with `gains`, its filter and its integrals, from the measurements as the plant of the design
/// gives them.
fn complete(
    linear: &LinearPlant,
    plant: &FaultyPlant,
    gains: &Gains,
    filter: Option<&[f64]>,
    domain: Domain,
) -> Result<CompleteController, Error> {
    let controller = complete_controller(plant, gains, filter, domain)?;
    if !linear.has_feedthrough() {
        return Ok(controller);
    }
    let complete = |system| with_feedthrough(system, &controller.commands.c, &linear.d);
    Ok(CompleteController {
        commands: complete(&controller.commands)?,
        estimates: complete(&controller.estimates)?,
    })
}

/// The loop of a continuous plant and a controller, in the time domain of the controller.
pub(crate) fn looped(plant: &StateSpace, controller: &StateSpace) -> Result<Loop, Error> {
    let plant = match controller.domain {
        Domain::Continuous => plant.clone(),
        Domain::Sampled { period } => held_plant(plant, period)?,
    };
    Loop::new(plant, controller.clone())
}

impl Solution {
    /// The controller with other gains, its filter and its integrals.
    pub(crate) fn complete(&self, gains: &Gains) -> Result<CompleteController, Error> {
        complete(&self.linear, &self.plant, gains, self.filter.as_deref(), self.domain)
    }

    /// Returns A + B K_x, n x n, the dynamics under exact state feedback; with integral action the same of
    /// the plant extended by the integrals, with [K_x, K_i].
    pub(crate) fn feedback_dynamics(&self) -> DMatrix<f64> {
        &self.feedback_pair.0 + &self.feedback_pair.1 * &self.feedback.gain
    }

    /// Returns the decay rate of the slowest eigenvalue under exact state feedback, 1/s.
    pub(crate) fn slowest_rate(&self) -> Result<f64, Error> {
        decay(&self.feedback_dynamics(), self.domain)
    }
}
