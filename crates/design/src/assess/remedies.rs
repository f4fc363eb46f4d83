//! Remedies for the verdict: requirements on slower or faster loops, designed and examined.

use nalgebra::{Complex, DMatrix};
use rayon::prelude::*;

use crate::assess::checks::STABLE;
use crate::assess::judged::{Judged, have_no_units};
use crate::assess::verdict::{failed, instability, peak_reason};
use crate::budget::Budget;
use crate::report::number::rounded;
use crate::report::robustness::{LoopPoint, Remedy, Robustness, ToleranceResult};
use crate::solve::designed::design;
use crate::solve::solution::Solution;
use plant_file::PlantFile;
use plant_file::estimation::Law;
use plant_file::faults::{EntryPoint, Fault, FaultDynamics};
use plant_file::loop_shape::LoopShape;
use plant_file::requirements::{Bandwidth, Requirement};
use plant_file::robustness::RobustnessLimits;
use plant_file::signals::Signal;

/// Factors on the speed of a loop, between the slowest and the fastest one.
const FACTORS: [f64; 8] = [SLOWEST, 0.4, 0.6, 0.8, 1.25, 1.7, 2.5, FASTEST];
const SLOWEST: f64 = 0.25;
const FASTEST: f64 = 4.0;
/// Factors on the bandwidth of the shape of a loop: few, as each of these designs takes long.
const OF_SHAPE: [f64; 4] = [SLOWEST, 0.5, 2.0, FASTEST];
/// Exponent with which a weight of commands or measurements changes with the factor on the speed, as for a double
/// integrator.
const WEIGHT_POWER: i32 = -4;
/// Largest number of states for which changed requirements are tried.
const LARGEST_ORDER: usize = 24;
/// Largest number of states for which gains by the shape of the loop are tried: for 8 they take some 20 s.
const LARGEST_SHAPED: usize = 8;
/// Part of the present peak of S below which a change must bring this peak to be proposed.
const LOWER: f64 = 0.8;

/// Returns a remedy for a loop that is not stable, or for each peak of S above its limit and for instability within the
/// tolerances.
///
/// These are the units of signals that have none; slower or faster loops; and the shape of the loop, where no speed
/// makes the verdict green. Other loops are not tried for gains by linear matrix inequalities, for controllers of low
/// order, for requirements that are not scaled, for several plants or a large one, and without time.
pub(crate) fn remedies(
    file: &PlantFile<'_>,
    nominal: &Solution,
    robustness: Option<&Robustness>,
    budget: &Budget,
) -> Vec<Remedy> {
    let limits = &file.robustness;
    let mut remedies =
        robustness.map_or_else(Vec::new, |robustness| of_units(nominal, robustness, limits));
    let points = robustness.map_or(&[][..], |robustness| robustness.points.as_slice());
    let of_peaks = points.iter().enumerate();
    let mut reasons: Vec<_> = of_peaks
        .filter_map(|(at, point)| {
            let (_, text) = peak_reason(point, limits)?;
            Some(Reason { text, aim: Aim::Peak(at) })
        })
        .collect();
    // For parameters of an FMU there is no remedy.
    let tolerance = robustness.map(|robustness| &robustness.tolerance);
    if let Some(test) = tolerance.filter(|test| test.is_unstable() && limits.parameters.is_empty())
    {
        reasons.push(Reason { text: instability(test), aim: Aim::Stable });
    }
    if robustness.is_none() {
        reasons.push(Reason { text: failed(STABLE), aim: Aim::Nominal });
    }
    reasons.retain(|reason| remedies.iter().all(|remedy| remedy.reason != reason.text));
    // Such gains take long to compute.
    let searched = [&file.feedback, &file.observer].iter().any(|request| {
        matches!(request.requirement, Requirement::Region(_) | Requirement::HInfinity { .. })
    });
    let single = !searched && file.family.is_empty() && file.schedule.is_none();
    let worst = tolerance.and_then(|test| test.worst.first());
    let order = worst.map_or(nominal.linear.undelayed.a.nrows(), |a| a.values.len());
    let variants = if single { variants(file) } else { Vec::new() };
    let largest = if file.loop_shape.is_some() { LARGEST_SHAPED } else { LARGEST_ORDER };
    if reasons.is_empty() || variants.is_empty() || order > largest || budget.is_over() {
        return remedies;
    }
    let present = Present {
        peaks: points.iter().map(|point| point.judged).collect(),
        is_unstable: tolerance.is_none_or(ToleranceResult::is_unstable),
    };
    // A change that lowers a peak must keep the stability within the tolerances.
    let varies = limits.parameters.is_empty();
    let tried = variants
        .into_par_iter()
        .map(|variant| {
            let tried = || budget.run(|| variant.trial(file, varies));
            let trial = (!budget.is_over()).then(tried)?;
            // A search for the shape of the loop that was abandoned gives other gains than its lines.
            (file.loop_shape.is_none() || !budget.is_over()).then_some(trial)
        })
        .collect::<Vec<_>>();
    let is_complete = tried.iter().all(Option::is_some);
    let mut trials: Vec<_> = tried.into_iter().flatten().flatten().collect();
    trials.sort_by(|one, other| one.distance.total_cmp(&other.distance));
    let has_other_gains = file.loop_shape.is_none() && order <= LARGEST_SHAPED;
    if has_other_gains && !trials.iter().any(|trial| trial.judged.is_green(limits)) {
        let shaped = budget.run(|| shaped(file, varies));
        trials.extend(shaped.filter(|_| !budget.is_over()));
    }
    let is_of_tolerances = |reason: &Reason| matches!(reason.aim, Aim::Stable);
    if reasons.iter().any(is_of_tolerances) && trials.iter().all(|trial| trial.judged.is_unstable) {
        trials.extend(with_fewer_faults(file, varies, budget));
    }
    let remedy = |reason: Reason| reason.remedy(&trials, is_complete, &present, limits);
    remedies.extend(reasons.into_iter().filter_map(remedy));
    remedies
}

/// Returns a remedy for each peak of S that is above its limit only because signals without units count as equal: to
/// state the units. A red peak may also become an amber one of less than half the height.
fn of_units(nominal: &Solution, robustness: &Robustness, limits: &RobustnessLimits) -> Vec<Remedy> {
    let linear = &nominal.linear;
    let signals = [
        (linear.actuators.as_slice(), "actuator"),
        (linear.measurements.as_slice(), "measurement"),
    ];
    let remedy = |(point, (signals, kind)): (&LoopPoint, (&[Signal], &str))| {
        let is_unknown = have_no_units(signals);
        let amber = limits.red.min(0.5 * point.judged);
        let is_within = point.s_peak_scaled <= limits.amber.max(amber);
        let (_, reason) = peak_reason(point, limits).filter(|_| is_unknown && is_within)?;
        let change = format!(
            "state the unit of each {kind}: if they differ, the peak of S at the {} is judged in the units that make \
             it least, {}",
            point.point,
            rounded(point.s_peak_scaled)
        );
        Some(Remedy { reason, change, lines: Vec::new() })
    };
    robustness.points.iter().zip(signals).filter_map(remedy).collect()
}

/// Designs gains by the shape of a loop with the bandwidth of the present feedback; None for other requirements and
/// laws, if the loop is not stable, and where the plant file cannot have `[loop]`.
fn shaped(file: &PlantFile<'_>, varies: bool) -> Option<Trial> {
    let Requirement::Bandwidth(Bandwidth { rate: Some(rate), .. }) = file.feedback.requirement
    else {
        return None;
    };
    if file.estimation.law != Law::Augmented {
        return None;
    }
    let line = format!("loop.bandwidth = {}", rounded(rate));
    let mut other = file.clone();
    let shape = LoopShape::with_bandwidth(as_shown(rate), file.feedback.place.clone());
    if file.sampling.is_some_and(|sampling| !shape.suits(sampling.period)) {
        return None;
    }
    other.loop_shape = Some(shape);
    Some(Trial {
        words: format!("{line} in place of feedback and observer"),
        lines: vec![line],
        judged: judged(&other, varies)?,
        distance: f64::INFINITY,
    })
}

/// Designs the file without each of its faults, if there are several, all of actuators and with no entry that refers to
/// them; without a trial where there is no design. As the estimates of faults act as integrals, no loop with as many of them as
/// measurements is stable beyond a plant whose stationary gains are singular.
fn with_fewer_faults(file: &PlantFile<'_>, varies: bool, budget: &Budget) -> Vec<Trial> {
    let actuator = |fault: &Fault| match fault.entry_point {
        EntryPoint::Actuator(at) => Some(file.actuators[at].name.clone()),
        _ => None,
    };
    let names = file.faults.iter().map(actuator).collect::<Option<Vec<_>>>();
    let is_alone = file.detection.is_none() && file.estimation.law == Law::Augmented;
    let Some(names) = names.filter(|names| is_alone && names.len() > 1) else { return Vec::new() };
    // A line of the file states faults without further entries.
    let is_plain = |(fault, name): (&Fault, &String)| {
        let entries = [fault.bound, fault.rate_bound, fault.step, fault.up_to];
        let is_constant = fault.dynamics == FaultDynamics::Constant;
        fault.name == format!("f_{name}") && is_constant && entries.iter().all(Option::is_none)
    };
    let has_line = file.faults.iter().zip(&names).all(is_plain);
    let trial = |at: usize| {
        let mut other = file.clone();
        let fault = other.faults.remove(at);
        if budget.is_over() {
            return None;
        }
        let judged = budget.run(|| judged(&other, varies)).filter(|_| !budget.is_over())?;
        let remaining: Vec<_> = other.faults.iter().map(|fault| fault.name.as_str()).collect();
        let words =
            format!("{} alone, so that {} is not compensated", remaining.join(" and "), fault.name);
        let names = names.iter().enumerate().filter(|(one, _)| *one != at);
        let names: Vec<_> = names.map(|(_, name)| format!("\"{name}\"")).collect();
        let line = has_line.then(|| format!("actuator_faults = [{}]", names.join(", ")));
        let unchanged = [
            chosen("observer", &file.observer.requirement),
            chosen("feedback", &file.feedback.requirement),
        ];
        let lines = line.map_or_else(Vec::new, |line| {
            std::iter::once(line).chain(unchanged.into_iter().flatten()).collect()
        });
        Some(Trial { lines, words, judged, distance: f64::INFINITY })
    };
    (0..names.len()).into_par_iter().filter_map(trial).collect()
}

/// Designs the controller of `file` and examines its loop, within the tolerances if `varies`; None if there is no
/// design, or its loop is not stable.
fn judged(file: &PlantFile<'_>, varies: bool) -> Option<Judged> {
    let nominal = design(file).ok()?.nominal;
    Judged::of(&nominal, varies.then_some(&file.robustness)).ok().flatten()
}

/// The value with the digits in which a remedy states it.
fn as_shown(value: f64) -> f64 {
    rounded(value).parse().unwrap_or(value)
}

/// A reason of the verdict, and the aim of a change of the requirements.
struct Reason {
    text: String,
    aim: Aim,
}

enum Aim {
    /// The peak of S at the point of the loop with this position is at most its limit.
    Peak(usize),
    /// Stability within the tolerances.
    Stable,
    /// Stability of the loop, which is not stable.
    Nominal,
}

/// The loop with the present requirements.
struct Present {
    peaks: Vec<f64>,
    is_unstable: bool,
}

/// Changed requirements in the plant file.
struct Variant {
    observer: Option<Scaled>,
    feedback: Option<Scaled>,
    shape: Option<LoopShape>,
    factor: f64,
}

/// A requirement for a faster or slower loop, as a line of the plant file and in words.
#[derive(Clone)]
struct Scaled {
    requirement: Requirement,
    line: String,
    words: String,
}

/// A variant that was designed.
struct Trial {
    lines: Vec<String>,
    words: String,
    judged: Judged,
    /// The size of the change: the logarithm of the factor, summed over the loops that change.
    distance: f64,
}

/// The variants of `file` with one loop, or both, slower or faster by each of [`FACTORS`], or with another bandwidth of
/// the shape of the loop; none for controllers of low order.
fn variants(file: &PlantFile<'_>) -> Vec<Variant> {
    if let Some(shape) = &file.loop_shape {
        let with_factor = |factor: f64| {
            let shape = shape.at_bandwidth(as_shown(factor * shape.bandwidth));
            let suits = file.sampling.is_none_or(|sampling| shape.suits(sampling.period));
            let shape = Some(shape).filter(|shape| suits && shape.pid.is_none())?;
            Some(Variant { observer: None, feedback: None, shape: Some(shape), factor })
        };
        return OF_SHAPE.into_iter().filter_map(with_factor).collect();
    }
    let with_factor = |factor: f64| {
        let observer = scaled("observer", "V", &file.observer.requirement, factor);
        let feedback = scaled("feedback", "R", &file.feedback.requirement, factor);
        let both = observer.is_some() && feedback.is_some();
        let mut all = vec![
            Variant { observer: observer.clone(), feedback: None, shape: None, factor },
            Variant { observer: None, feedback: feedback.clone(), shape: None, factor },
        ];
        all.extend(both.then_some(Variant { observer, feedback, shape: None, factor }));
        all.retain(|variant| variant.observer.is_some() || variant.feedback.is_some());
        all
    };
    FACTORS.into_iter().flat_map(with_factor).collect()
}

/// Returns the requirement of the loop `name` with eigenvalues or bandwidth times `factor`, or with a scaled weight,
/// named `weight`; None for other requirements.
fn scaled(name: &str, weight: &str, requirement: &Requirement, factor: f64) -> Option<Scaled> {
    let (requirement, line, words) = match requirement {
        Requirement::Eigenvalues(all) => {
            let all: Vec<_> = all
                .iter()
                .map(|value| Complex::new(as_shown(factor * value.re), as_shown(factor * value.im)))
                .collect();
            let shown = all.iter().filter(|value| value.im >= 0.0).map(|value| {
                let (re, im) = (rounded(value.re), rounded(value.im));
                if value.im == 0.0 { re } else { format!("{{ re = {re}, im = {im} }}") }
            });
            let line = format!(".eigenvalues = [{}]", shown.collect::<Vec<_>>().join(", "));
            let words = format!(" eigenvalues {factor} times as fast");
            (Requirement::Eigenvalues(all), line, words)
        }
        Requirement::Weights { states, channels } => {
            let size = as_shown(factor.powi(WEIGHT_POWER));
            let channels: DMatrix<f64> = channels.map(|entry| as_shown(size * entry));
            let rows = channels.row_iter().map(|row| {
                let entries: Vec<_> = row.iter().map(|entry| rounded(*entry)).collect();
                format!("[{}]", entries.join(", "))
            });
            let line = format!(".{weight} = [{}]", rows.collect::<Vec<_>>().join(", "));
            let words = format!(".{weight} {} times as large", rounded(size));
            (Requirement::Weights { states: states.clone(), channels }, line, words)
        }
        Requirement::Bandwidth(Bandwidth { rate: Some(rate), .. }) => {
            let rate = as_shown(factor * rate);
            let bandwidth = Bandwidth { rate: Some(rate), is_stated: true };
            let line = format!(".bandwidth = {}", rounded(rate));
            let words = format!(".bandwidth {factor} times as large");
            (Requirement::Bandwidth(bandwidth), line, words)
        }
        _ => return None,
    };
    let [line, words] = [line, words].map(|text| format!("{name}{text}"));
    Some(Scaled { requirement, line, words })
}

/// The line of the plant file for a bandwidth of the loop `name` that the command has chosen; None if it is stated.
fn chosen(name: &str, requirement: &Requirement) -> Option<String> {
    match requirement {
        Requirement::Bandwidth(Bandwidth { rate: Some(rate), is_stated: false }) => {
            Some(format!("{name}.bandwidth = {}", rounded(*rate)))
        }
        _ => None,
    }
}

impl Variant {
    /// Designs the variant and examines its loop; None if there is no design, or its loop is not stable.
    fn trial(self, file: &PlantFile<'_>, varies: bool) -> Option<Trial> {
        let Self { observer, feedback, shape, factor } = self;
        let mut other = file.clone();
        if let Some(shape) = shape {
            let line = format!("loop.bandwidth = {}", rounded(shape.bandwidth));
            other.loop_shape = Some(shape);
            return Some(Trial {
                words: format!("loop.bandwidth {factor} times as large"),
                lines: vec![line],
                judged: judged(&other, varies)?,
                distance: factor.ln().abs(),
            });
        }
        if let Some(observer) = &observer {
            other.observer.requirement = observer.requirement.clone();
        }
        if let Some(feedback) = &feedback {
            other.feedback.requirement = feedback.requirement.clone();
        }
        let judged = judged(&other, varies)?;
        let parts: Vec<_> = observer.iter().chain(&feedback).collect();
        #[expect(clippy::cast_precision_loss, reason = "one or two loops")]
        let distance = factor.ln().abs() * parts.len() as f64;
        let words: Vec<_> = parts.iter().map(|part| part.words.as_str()).collect();
        // Beside a stated bandwidth the command would choose the other one anew.
        let unchanged = [
            observer.is_none().then(|| chosen("observer", &file.observer.requirement)),
            feedback.is_none().then(|| chosen("feedback", &file.feedback.requirement)),
        ];
        let unchanged = unchanged.into_iter().flatten().flatten();
        Some(Trial {
            lines: parts.iter().map(|part| part.line.clone()).chain(unchanged).collect(),
            words: words.join(" and "),
            judged,
            distance,
        })
    }
}

impl Trial {
    /// Whether no peak rises above its limit, or above its present value if that is larger, and the loop does not
    /// become unstable within the tolerances.
    fn is_harmless(&self, present: &Present, limits: &RobustnessLimits) -> bool {
        let mut peaks = self.judged.points.iter().zip(&present.peaks);
        peaks.all(|(point, peak)| point.judged <= peak.max(limits.amber))
            && (present.is_unstable || !self.judged.is_unstable)
    }

    fn peaks(&self) -> String {
        let one = |point: &LoopPoint| format!("{} at the {}", rounded(point.judged), point.point);
        self.judged.points.iter().map(one).collect::<Vec<_>>().join(" and ")
    }
}

impl Reason {
    /// Returns the smallest change that removes all reasons, else the smallest one that removes this reason, if
    /// possible with all peaks, else for a peak the change with the lowest peak, else a sentence that there is none.
    /// Changes that make something else worse are left out. None if no change removes this reason and the time was
    /// over before all were tried.
    fn remedy(
        self,
        trials: &[Trial],
        is_complete: bool,
        present: &Present,
        limits: &RobustnessLimits,
    ) -> Option<Remedy> {
        let harmless = || trials.iter().filter(|trial| trial.is_harmless(present, limits));
        let reached = |trial: &&Trial| match self.aim {
            Aim::Peak(at) => trial.judged.points[at].judged <= limits.amber,
            Aim::Stable => !trial.judged.is_unstable,
            Aim::Nominal => true,
        };
        let green = trials.iter().find(|trial| trial.judged.is_green(limits));
        let least = match self.aim {
            Aim::Stable | Aim::Nominal => None,
            Aim::Peak(at) => {
                let peak = |trial: &Trial| trial.judged.points[at].judged;
                let least = harmless().min_by(|x, y| peak(x).total_cmp(&peak(y)));
                least.filter(|trial| peak(trial) < LOWER * present.peaks[at])
            }
        };
        let has_low_peaks = |trial: &&Trial| trial.judged.largest_peak() <= limits.amber;
        let chosen = green
            .or_else(|| harmless().filter(reached).find(has_low_peaks))
            .or_else(|| harmless().find(reached));
        let untried = if limits.parameters.is_empty() {
            ""
        } else {
            "; parameters of the FMU within their tolerances were not tried"
        };
        let (trial, change) = match (chosen, least) {
            (Some(trial), _) => {
                let peaks = trial.peaks();
                let stable = if trial.judged.is_unstable {
                    ", still unstable within the tolerances"
                } else {
                    ""
                };
                (trial, format!("with {}, the peak of S is {peaks}{stable}{untried}", trial.words))
            }
            (None, _) if !is_complete => return None,
            (None, Some(trial)) => {
                let change = format!(
                    "none of {} other stable designs, from {SLOWEST} to {FASTEST} times as fast, has a peak of \
                     at most {} without being worse elsewhere; with {}, the peak of S is {}{untried}",
                    trials.len(),
                    rounded(limits.amber),
                    trial.words,
                    trial.peaks()
                );
                (trial, change)
            }
            (None, None) => {
                let trials = match trials.len() {
                    0 => format!(
                        "no other design from {SLOWEST} to {FASTEST} times as fast is stable"
                    ),
                    count => format!(
                        "none of {count} other stable designs, from {SLOWEST} to {FASTEST} times as fast, is better \
                         without being worse elsewhere"
                    ),
                };
                let change =
                    format!("{trials}: other measurements, actuators or requirements are needed");
                return Some(Remedy { reason: self.text, change, lines: Vec::new() });
            }
        };
        Some(Remedy { reason: self.text, change, lines: trial.lines.clone() })
    }
}

#[cfg(test)]
mod tests {
    use plant_file::parameters::{ParameterTolerance, Tolerance};

    use super::*;
    use crate::tests::read;

    fn limits(parameters: Vec<ParameterTolerance>) -> RobustnessLimits {
        let text = "A = [[-1]]\nB = [[1]]\nC = [[1]]\nactuator_faults = \"all\"\n";
        read(text, |file| RobustnessLimits { parameters, ..file.robustness.clone() }).unwrap()
    }

    #[test]
    fn a_remedy_says_that_parameters_of_the_fmu_were_not_tried() {
        let (name, tolerance) = ("mass".to_owned(), Tolerance::Relative(0.1));
        let mass = ParameterTolerance { name, tolerance, place: 0..0 };
        for (parameters, is_said) in [(Vec::new(), false), (vec![mass], true)] {
            let trial = Trial {
                lines: Vec::new(),
                words: "another observer".to_owned(),
                judged: Judged {
                    points: Vec::new(),
                    comparable_peak: 0.0,
                    is_unstable: false,
                    unstable_from: f64::INFINITY,
                },
                distance: 1.0,
            };
            let reason = Reason { text: "unstable".to_owned(), aim: Aim::Stable };
            let present = Present { peaks: Vec::new(), is_unstable: true };
            let remedy = reason.remedy(&[trial], true, &present, &limits(parameters)).unwrap();
            assert_eq!(remedy.change.contains("were not tried"), is_said, "{}", remedy.change);
        }
    }

    #[test]
    fn without_any_trial_a_remedy_says_that_none_is_stable_if_all_were_tried() {
        let limits = limits(Vec::new());
        let change = |is_complete| {
            let reason = Reason { text: "unstable".to_owned(), aim: Aim::Stable };
            let present = Present { peaks: Vec::new(), is_unstable: true };
            reason.remedy(&[], is_complete, &present, &limits).map(|remedy| remedy.change)
        };
        let expected = "no other design from 0.25 to 4 times as fast is stable: \
                        other measurements, actuators or requirements are needed";
        assert_eq!((change(true).as_deref(), change(false)), (Some(expected), None));
    }
}
