//! Sections on parts that only some controllers have: other gains, a detection, a schedule.

use super::Vocabulary;
use crate::Precision;
use crate::controller::Controller;
use crate::detection::Method;
use crate::fields::Fields;
use crate::reconfiguration::Decision;
use crate::text::one_line;

/// The gains without some actuators, and the meaning of the inputs about actuators; empty without a reconfiguration.
pub(super) fn reconfiguration(controller: &Controller, fields: &Fields) -> Vec<String> {
    let Some(reconfiguration) = &controller.reconfiguration else { return Vec::new() };
    let names: Vec<_> = fields.switches(controller);
    let mut all = Vec::new();
    for (case, field) in reconfiguration.cases.iter().zip(&names) {
        let actuator = one_line(&controller.actuators[case.actuator].name);
        let by_loss = case.decision.map_or_else(String::new, |decision| {
            let Decision { loss, fraction, samples } = decision;
            let fault = &fields.faults[controller.losses[loss].fault];
            format!(
                ", or since Estimates.E_hat_{fault} has been above {fraction:?} for {samples} samples, \
                 until the next start"
            )
        });
        all.push(format!(
            "Actuators.{field}: {actuator} is gone{by_loss}. Its command is then {:?}.",
            case.stuck_at
        ));
    }
    if reconfiguration.fallback.is_some() {
        let text = "Actuators.fall_back: an unknown actuator has failed; the gains are those of the \
                    fall-back, which are also in force where there are no gains without exactly the \
                    actuators that are gone.";
        all.push(text.to_owned());
    } else {
        let text = "Where there are no gains without exactly the actuators that are gone, those without the first \
                    of them are in force.";
        all.push(text.to_owned());
    }
    let fall_back = if reconfiguration.fallback.is_some() { ", -1 in the fall-back" } else { "" };
    all.push(format!(
        "The decision is made in each sample but the first one. The output `reconfiguration` is the number from 1 \
         of the first actuator that is gone, 0 if there is none{fall_back}."
    ));
    all
}

/// The tests, and the meaning of the outputs of a detection; empty without one.
pub(super) fn detection(controller: &Controller, precision: Precision) -> Vec<String> {
    let Some(detection) = &controller.detection else { return Vec::new() };
    let faults: Vec<_> = detection
        .faults
        .iter()
        .enumerate()
        .map(|(k, name)| format!("{} {}", k + 1, one_line(name)))
        .collect();
    let method = match detection.method {
        Method::Cusum => {
            "cumulative sums of a residual, S+ = max(0, S+ + r - drift) and S- = max(0, S- - r - drift); the \
             statistic is the larger one"
        }
        Method::Window => {
            "the mean of residuals over a window of N samples; the statistic is s = |sum of r|^2 / N of the last \
             whole window"
        }
    };
    let mut all = vec![
        format!(
            "Residuals r, white with variance 1 without faults, are computed in each sample but the first one, \
             whether faults are compensated or not, and tested from sample {} on by {method}. A statistic above \
             its threshold is an alarm.",
            detection.first_tested
        ),
        format!(
            "Detection.detected: there was an alarm since the last sample with `detection_reset`, which clears \
             statistics and decision. Detection.isolated: the fault that the alarms fit ({}); 0 without an alarm, \
             -1 if they fit none or several. Detection.t_detected and Detection.t_onset: times of the first alarm \
             and of the estimated start of the fault, in s after the start; -1 before. After 2^32 samples these \
             times no longer increase.",
            faults.join(", ")
        ),
    ];
    let mut first = 0;
    for (k, test) in detection.tests.iter().enumerate() {
        let last = first + test.residuals;
        let residuals = if test.residuals == 1 { "" } else { "s" };
        let range: Vec<_> = (first..last).map(|row| row.to_string()).collect();
        let window = match detection.method {
            Method::Cusum => format!(", drift {:?}", test.drift.unwrap_or_default()),
            Method::Window => format!(", N = {}", test.window.unwrap_or_default()),
        };
        all.push(format!(
            "Test {k}, {}: residual{residuals} {}{window}, threshold {:?}",
            one_line(&test.name),
            range.join(", "),
            test.threshold
        ));
        first = last;
    }
    if precision == Precision::Single {
        all.push(
            "In `float` the residuals have the bound below, in a run from the operating point; the statistics add \
             up their errors and have none, so that an alarm may be given one or more samples earlier or later \
             than in `double`."
                .to_owned(),
        );
    }
    all
}

/// How matrices and operating point depend on the scheduling variable; empty without a schedule.
pub(super) fn schedule(controller: &Controller, vocabulary: &Vocabulary) -> Vec<String> {
    let Some(schedule) = &controller.schedule else { return Vec::new() };
    let ([first, last], count) = (schedule.range(), schedule.points.len());
    let name = one_line(&schedule.variable.name);
    let owner = match schedule.measurement {
        Some(_) => "a measurement",
        None => "an input of its own",
    };
    vec![format!(
        "The matrices and the operating point follow `{name}`, {owner}: they have the values of the design at \
         its {count} points from {first:?} to {last:?}, and change linearly between them. Beyond, those of the \
         nearest point are used, and {} says so.",
        vocabulary.outside
    )]
}
