//! Fills the report with the numbers of a design.

use std::time::Duration;

use control::eigen::eigenvalues;
use control::faults::FaultEntry;
use control::losses::loss_tolerance;
use control::placement::Quality;
use control::{Domain, Error};
use fmu_description::documentation::texts;
use fmu_description::{ModelDescription, ScalarVariable};
use nalgebra::DMatrix;

use crate::assess::analysis::Loops;
use crate::assess::certificate::certificate;
use crate::assess::checks::checks;
use crate::assess::detection::Detection;
use crate::assess::estimation;
use crate::assess::fallback;
use crate::assess::family::{self as family_report, judge_family};
use crate::assess::losses::{self, losses};
use crate::assess::matrices::Names;
use crate::assess::pid;
use crate::assess::reconfiguration::reasons as reconfiguration_reasons;
use crate::assess::references::{beyond_limits, reached, reference_steps};
use crate::assess::remedies::remedies;
use crate::assess::responses::responses;
use crate::assess::robustness::{delay_reasons, hold_reason, robustness};
use crate::assess::schedule::{self as schedule_report, judge_schedule};
use crate::assess::slow_estimates;
use crate::assess::verdict::verdict;
use crate::budget::TimeLimits;
use crate::matrix::pairs;
use crate::plant::delays::JUDGED;
use crate::plant::fixed_mode::shown;
use crate::plant::parameters::ParameterFamily;
use crate::plant::plausibility::line;
use crate::progress::{Step, Steps};
use crate::report::number::rounded;
use crate::report::reconfiguration::ReconfigurationReport;
use crate::report::robustness::Level;
use crate::report::{Effectiveness, Loop, Plant, Region, Report, Sampled, Signal};
use crate::solve::designed::Designed;
use crate::solve::fallback::Fallback;
use crate::solve::gain::GainResult;
use crate::solve::solution::Solution;
use crate::solve::tracking::{DesignLoop, TrackingAction};
use plant_file::faults::{EntryPoint, Fault, FaultDynamics};
use plant_file::requirements::{self, Requirement};
use plant_file::signals;
use plant_file::{PlantFile, estimator};

/// A design with all that its report is about.
pub(crate) struct Assessment<'a> {
    pub(crate) file: &'a PlantFile<'a>,
    /// The FMU whose parameters vary; None if the entries of the matrices vary.
    pub(crate) parameters: Option<&'a ParameterFamily<'a>>,
    pub(crate) designed: &'a Designed,
    /// A description of the controller, in a sentence.
    pub(crate) description: String,
    pub(crate) detection: Option<Detection>,
    pub(crate) reconfiguration: Option<ReconfigurationReport>,
    pub(crate) fallback: Option<&'a Fallback>,
    pub(crate) limits: TimeLimits,
    pub(crate) steps: &'a Steps<'a>,
}

impl<'a> Assessment<'a> {
    /// A design without description, detection, reconfiguration and fall-back, and with no time for certificates and
    /// bounds.
    pub(crate) fn new(
        file: &'a PlantFile<'a>,
        parameters: Option<&'a ParameterFamily<'a>>,
        designed: &'a Designed,
        steps: &'a Steps<'a>,
    ) -> Self {
        Self {
            file,
            parameters,
            designed,
            description: String::new(),
            detection: None,
            reconfiguration: None,
            fallback: None,
            limits: TimeLimits { certificates: Duration::ZERO, ..TimeLimits::default() },
            steps,
        }
    }
}

/// Returns the report on a design.
pub(crate) fn report(assessment: Assessment<'_>) -> Result<Report, crate::Error> {
    let Assessment { file, parameters, designed, limits, steps, .. } = assessment;
    let Assessment { description, detection, reconfiguration, fallback, .. } = assessment;
    let nominal = &designed.nominal;
    let loops = Loops::of(nominal)?;
    let Solution { plant, gains, .. } = nominal;
    let names = Names::of(nominal);
    let references = reference_steps(nominal)?;
    let mut checks = checks(nominal);
    checks.extend(reached(&references));
    let (robustness, budget) = robustness(nominal, &file.robustness, parameters, &limits, steps)?;
    let (errors, norms) = rayon::join(
        || estimation::errors(nominal, robustness.as_ref(), &file.robustness),
        || loops.norms(),
    );
    let mut missing = Vec::new();
    let errors = unless_numerical("the errors of the estimates", errors, &mut missing)?;
    let norms = unless_numerical("the norms of the estimation errors", norms, &mut missing)?;
    let certificate = steps.run(Step::Certificates, || certificate(nominal, norms, &budget));
    let (bounds, without_bounds) = steps.run(Step::Bounds, || loops.bounds(&budget))?;
    let losses = losses(nominal, &budget)?;
    let of_losses = losses.iter().flat_map(losses::reasons);
    let further = of_losses.chain(reconfiguration.iter().flat_map(reconfiguration_reasons));
    let mut further: Vec<_> = further.chain(robustness.iter().flat_map(delay_reasons)).collect();
    further.extend(robustness.as_ref().and_then(|figures| hold_reason(nominal, figures)));
    let (responses, frequency) =
        rayon::join(|| steps.run(Step::Responses, || responses(nominal)), || loops.frequency());
    let responses = unless_numerical("the responses to faults", responses, &mut missing)?;
    let frequency =
        unless_numerical("the gains from faults over frequency", frequency, &mut missing)?;
    further.extend(missing.into_iter().map(|reason| (Level::Amber, reason)));
    let of_fallback = |design| fallback::report(file, nominal, design, &budget);
    let fallback = fallback.map(of_fallback).transpose()?.flatten();
    further
        .extend(fallback.iter().flat_map(|report| fallback::reasons(report, file.robustness.red)));
    let family_report = family_report::family(designed, &file.robustness, &budget)?;
    let schedule = schedule_report::schedule(designed, &file.robustness, &budget)?;
    let remedies =
        steps.run(Step::Remedies, || remedies(file, nominal, robustness.as_ref(), &budget));
    let mut verdict = verdict(&checks, robustness.as_ref(), &file.robustness, further, remedies);
    if let Some(family) = &family_report {
        judge_family(&mut verdict, family, &file.robustness);
    }
    if let Some(report) = &schedule {
        judge_schedule(&mut verdict, designed, report, &file.robustness);
    }
    let mut warnings: Vec<_> =
        designed.warnings.iter().map(|warning| line(file, warning)).collect();
    warnings.extend(slow_estimates::warning(file, nominal)?);
    warnings.extend(references.iter().filter_map(beyond_limits).chain(without_bounds));
    let (detection, of_detection) =
        detection.map(|section| (section.report, section.warnings)).unzip();
    warnings.extend(of_detection.into_iter().flatten());
    Ok(Report {
        description,
        plant_file: file.name(),
        plant: self::plant(nominal, &names)?,
        verdict,
        warnings,
        checks,
        robustness,
        gains: names.gains(nominal),
        pid: pid::controllers(file, nominal),
        feedback: closed(
            if gains.integral.is_some() { "A_e + B_e [K_x, K_i]" } else { "A + B K_x" },
            &nominal.feedback_dynamics(),
            &nominal.feedback,
            Some(&file.feedback.requirement),
        )?,
        observer: closed(
            "A_0 - L C_0",
            &gains.error_dynamics(plant),
            &nominal.observer,
            Some(&file.observer.requirement).filter(|_| nominal.law.keeps_error_dynamics()),
        )?,
        estimation: estimation::estimation(nominal, errors),
        sampling: file.sampling.map(|sampling| Sampled {
            sample_time: sampling.period,
            estimator: estimator(gains.estimator).to_owned(),
        }),
        family: family_report,
        schedule,
        detection,
        certificate,
        bounds,
        steps: responses,
        references,
        frequency,
        effectiveness: effectiveness(nominal)?,
        losses,
        reconfiguration,
        fallback,
        assumptions: assumptions(file, designed),
        interface: Vec::new(),
    })
}

/// Returns a part of the report; an empty one, with a reason in `missing`, if a numerical method failed.
fn unless_numerical<T>(
    part: &str,
    results: Result<Vec<T>, Error>,
    missing: &mut Vec<String>,
) -> Result<Vec<T>, Error> {
    match results {
        Err(error) if error.is_numerical() => {
            missing.push(format!("{part} cannot be computed: {error}"));
            Ok(Vec::new())
        }
        results => results,
    }
}

fn plant(designed: &Solution, names: &Names) -> Result<Plant, Error> {
    let linear = &designed.linear;
    let signal = |signal: &signals::Signal| Signal {
        name: signal.name.clone(),
        unit: signal.unit.clone(),
        description: signal.description.clone(),
        operating: signal.operating.unwrap_or(0.0),
        notes: String::new(),
    };
    let delay = |signal: &signals::Signal| {
        (signal.delay > 0.0).then(|| format!("delayed by {} s", signal.delay))
    };
    let actuator = |command: &signals::Signal| {
        let limits = command.limits.map(|[low, high]| format!("from {low} to {high}"));
        let notes: Vec<_> = limits.into_iter().chain(delay(command)).collect();
        Signal { notes: notes.join(", "), ..signal(command) }
    };
    let measurement = |measured: &signals::Signal| {
        let range = measured.limits.map(|[low, high]| format!("used from {low} to {high}"));
        let hold = measured.longest_hold.map(|time| format!("held for {time} s at most"));
        let notes: Vec<_> = range.into_iter().chain(hold).chain(delay(measured)).collect();
        Signal { notes: notes.join(", "), ..signal(measured) }
    };
    let fault = |fault: &Fault| Signal {
        name: fault.name.clone(),
        unit: fault.unit.clone(),
        description: fault.description.clone(),
        operating: 0.0,
        notes: notes(fault, designed),
    };
    Ok(Plant {
        origin: linear.origin.clone(),
        states: linear.states.iter().map(signal).collect(),
        actuators: linear.actuators.iter().map(actuator).collect(),
        measurements: linear.measurements.iter().map(measurement).collect(),
        faults: linear.faults.iter().map(fault).collect(),
        matrices: names.plant_matrices(designed),
        eigenvalues: pairs(&eigenvalues(&linear.undelayed.a)?),
        sample_time: (linear.domain != Domain::Continuous).then(|| linear.domain.step()),
    })
}

/// Describes where a fault enters, and its stated bounds and dynamics.
fn notes(fault: &Fault, designed: &Solution) -> String {
    let linear = &designed.linear;
    let mut parts = vec![match &fault.entry_point {
        EntryPoint::Column(at) => format!("column {} of F_a", at + 1),
        EntryPoint::Actuator(at) => format!("adds to {}", linear.actuators[*at].name),
        EntryPoint::Sensor(at) => {
            format!("adds to the measurement {}", linear.measurements[*at].name)
        }
        EntryPoint::Loss { actuator, .. } => {
            format!("{} loses a part of its effect", linear.actuators[*actuator].name)
        }
        EntryPoint::Input(name) => format!("input {name} of the FMU"),
    }];
    parts.push(match fault.dynamics {
        FaultDynamics::Constant => "modelled as constant".to_owned(),
        FaultDynamics::Ramp => "modelled as a ramp".to_owned(),
    });
    let numbers = [
        ("at most", fault.bound, ""),
        ("rate at most", fault.rate_bound, " per s"),
        ("jumps by", fault.step, ""),
    ];
    for (text, value, unit) in numbers {
        parts.extend(value.map(|value| format!("{text} {value}{unit}")));
    }
    parts.join(", ")
}

fn closed(
    name: &str,
    dynamics: &DMatrix<f64>,
    result: &GainResult,
    requirement: Option<&Requirement>,
) -> Result<Loop, Error> {
    let quality = result.quality;
    let region = match requirement {
        Some(Requirement::Region(region) | Requirement::HInfinity { region, .. }) => Some(*region),
        _ => None,
    };
    let number = |number: fn(&Quality) -> f64| quality.as_ref().map(number);
    let mut required = pairs(&result.required);
    required.sort_by(|[x, u], [y, v]| x.total_cmp(y).then(u.total_cmp(v)));
    Ok(Loop {
        matrix: name.to_owned(),
        method: result.method.clone(),
        wanted: required.clone(),
        required,
        eigenvalues: pairs(&eigenvalues(dynamics)?),
        condition: number(|quality| quality.condition),
        balanced_condition: number(|quality| quality.balanced_condition),
        pole_error: number(|quality| quality.pole_error),
        region: region.filter(|region| *region != requirements::Region::default()).map(|region| {
            Region {
                decay: region.decay,
                disc_center: region.disc.map(|disc| disc.0),
                disc_radius: region.disc.map(|disc| disc.1),
                sector: region.sector,
            }
        }),
        norm: result.norm.clone(),
    })
}

/// Returns the largest stable loss of effectiveness of each actuator that has such a fault.
pub(crate) fn effectiveness(designed: &Solution) -> Result<Vec<Effectiveness>, Error> {
    let lossy = |model: &control::faults::Fault| match model.entry {
        FaultEntry::LossOfEffectiveness(input) => Some(input),
        _ => None,
    };
    let DesignLoop { plant, controller } = &designed.whole;
    // One input at a time: all together may be too many combinations.
    let one = |input: usize| {
        Ok(Effectiveness {
            actuator: designed.linear.actuators[input].name.clone(),
            largest_stable_loss: loss_tolerance(plant, controller, &[input], 1.0)?.single[0],
        })
    };
    designed.linear.models.iter().filter_map(lossy).map(one).collect()
}

fn assumptions(file: &PlantFile<'_>, designed: &Designed) -> Vec<String> {
    let Designed { nominal, family, schedule, .. } = designed;
    let mut all = vec![
        "The plant is linear, as stated under Plant; the neglected nonlinear terms act as a fault."
            .to_owned(),
        "Commands are within the limits of the actuators; the observer receives the applied \
         command."
            .to_owned(),
        "Bounds and responses start from rest, with the compensation on.".to_owned(),
    ];
    all.extend(file.transfer_time.map(|time| {
        format!(
            "The law of the commands has been in force for long: with a transfer time of {} s the compensation, a \
             reconfiguration and the fall-back take effect with this time constant, which no figure contains.",
            rounded(time)
        )
    }));
    if nominal.linear.delays.any() {
        all.push(format!(
            "Each delay is approximated: by {} states in the observer, the residuals, the responses, and the bounds and norms of errors; \
             by {JUDGED} states in margins, peaks and tolerances. The margins are followed by what the delays \
             themselves change.",
            nominal.linear.delay_order
        ));
    }
    all.extend(tracking_assumption(nominal));
    let is_constant = |fault: &Fault| fault.dynamics == FaultDynamics::Constant;
    let lagging = "The estimate of a fault modelled as constant lags behind it; the rate of the fault \
                   causes the errors.";
    all.extend(nominal.linear.faults.iter().any(is_constant).then(|| lagging.to_owned()));
    let linearised = "The sliding-mode law is nonlinear: eigenvalues, margins, noise, bounds and responses are \
                      those of its linearisation within the boundary layer, for faults and noise small against \
                      rho; larger faults leave rho / (rho - |f|) times the lasting error.";
    all.extend(nominal.law.injection.is_some().then(|| linearised.to_owned()));
    if let Domain::Sampled { period } = nominal.domain {
        all.push(if file.model.only_samples().is_some() {
            format!(
                "The plant is known at its samples, every {period} s, and faults change there: bounds and responses are those \
                 of the samples, which the curves join by lines, and the delay margin is in whole samples. A is exact unless `robustness.tolerance` \
                 states how far it may be off."
            )
        } else {
            format!(
                "Commands are constant over a sample time of {period} s; in the responses a \
                 fault changes at samples; states and commands are shown between them, too."
            )
        });
    }
    let of_nominal = "Responses, bounds and certificates of the estimation errors are those of the nominal \
                      plant; the estimation error of another member also depends on its states.";
    all.extend(family.is_some().then(|| of_nominal.to_owned()));
    let of_file = "Gains, responses and bounds are those of the plant of the file; between the points of the \
                   schedule, plant and controller are interpolated linearly. A change of the operating point \
                   acts like a disturbance.";
    all.extend(schedule.is_some().then(|| of_file.to_owned()));
    let loses =
        |model: &control::faults::Fault| matches!(model.entry, FaultEntry::LossOfEffectiveness(_));
    let lost = "The loss of effectiveness is constant; it is estimated only while the command is well \
                above its threshold.";
    all.extend(nominal.linear.models.iter().any(loses).then(|| lost.to_owned()));
    all
}

/// Returns the assumption that the set points rely on; None without references.
fn tracking_assumption(designed: &Solution) -> Option<String> {
    Some(match &designed.tracking.as_ref()?.action {
        TrackingAction::Feedforward(_) => {
            "The references are reached without error only if A, B and C are those of the plant: there is \
             no integral action."
                .to_owned()
        }
        TrackingAction::Integral { windup_time, feedforward, .. } => format!(
            "A constant reference is reached without error for every plant for which the loop is stable. \
             While a command is at a limit, the integrals follow it with a time constant of {} s; the \
             responses are those within the limits.{}",
            rounded(*windup_time),
            feedforward.as_ref().map_or(String::new(), |action| format!(
                " In the plant of the model, references do not excite the slowest eigenvalues of the \
                 feedback ({}): these answer disturbances and errors of the model.",
                action.silent
                    .iter()
                    .filter(|value| value.im >= 0.0)
                    .map(|value| shown(*value))
                    .collect::<Vec<_>>()
                    .join(", ")
            ))
        ),
    })
}

/// Returns the variables of the controller FMU.
pub(crate) fn interface(description: &ModelDescription) -> Vec<crate::report::Variable> {
    let stated = |text: String| Some(text).filter(|text| !text.is_empty());
    let variable = |variable: &ScalarVariable| {
        let (unit, [start, ..]) = texts(&variable.kind, &description.types);
        crate::report::Variable {
            name: variable.name.clone(),
            causality: variable.causality.as_str().to_owned(),
            variability: variable.variability.as_str().to_owned(),
            unit: stated(unit),
            start: stated(start),
            description: variable.description.clone().unwrap_or_default(),
        }
    };
    description.variables.iter().map(variable).collect()
}
