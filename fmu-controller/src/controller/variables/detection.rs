//! The variables of the detection: residuals, statistics, thresholds, the decision.

use super::Variable;
use aso_controller::Design;
use aso_controller::channel;
use aso_controller::design::detection::{DetectionDesign, TestDesign};

/// The variables of the detection; none in a design without one.
pub(super) fn of(design: &Design) -> Vec<Variable> {
    let Some(detection) = &design.detection else { return Vec::new() };
    let mut all = vec![
        Variable::boolean(
            "detection_reset",
            "Clears sums, windows and decision at each sample while it is true",
            |model| &mut model.detector_mut().reset,
        )
        .input(),
    ];
    all.extend(decision(detection));
    all.extend(residuals(detection));
    all.extend(statistics(detection));
    let text = "Time after the start from which the residuals are tested";
    let from = Variable::real("detect_from", text, |model| &mut model.detection_mut().from);
    all.push(from.unit("s").parameter().min(0.0));
    all.extend(detection.sample_time.map(|_| {
        let text = "Time between two samples of the residuals";
        Variable::real("detection_sample_time", text, |model| {
            model.detection_mut().sample_time.get_or_insert_default()
        })
        .unit("s")
        .constant()
    }));
    all.extend(thresholds(detection));
    all
}

/// An output that changes at samples only and starts with a value that depends on nothing.
fn output(variable: Variable) -> Variable {
    variable.output(&[]).discrete().initially(Vec::<String>::new())
}

fn decision(detection: &DetectionDesign) -> Vec<Variable> {
    let names = detection.faults.iter().enumerate().map(|(at, name)| format!("{} {name}", at + 1));
    let names = names.collect::<Vec<_>>().join(", ");
    let text = format!(
        "The fault that the alarms fit: {names}; 0 without an alarm, -1 if they fit none or several"
    );
    vec![
        output(Variable::boolean(
            "fault_detected",
            "Whether a test has given an alarm since the last reset",
            |model| &mut model.detector_mut().decision.detected,
        )),
        output(Variable::integer("fault_isolated", text, |model| {
            &mut model.detector_mut().decision.isolated
        })),
        output(
            Variable::real("t_detected", "Time of the first alarm; -1 before", |model| {
                &mut model.detector_mut().decision.time
            })
            .unit("s"),
        ),
        output(
            Variable::real(
                "t_onset",
                "Estimated time at which the fault started; -1 before an alarm",
                |model| &mut model.detector_mut().decision.onset,
            )
            .unit("s"),
        ),
    ]
}

fn residuals(detection: &DetectionDesign) -> Vec<Variable> {
    let count = detection.c.rows;
    let tests = detection.tests.iter().flat_map(|test| std::iter::repeat_n(test, test.residuals));
    let residual = |(k, test): (usize, &TestDesign)| {
        let text = format!("Residual of test {}, in standard deviations", test.name);
        let variable = Variable::real(channel("residual", k, count), text, move |model| {
            &mut model.detector_mut().residuals[k]
        });
        output(variable.unit("1"))
    };
    tests.enumerate().map(residual).collect()
}

fn statistics(detection: &DetectionDesign) -> Vec<Variable> {
    let count = detection.tests.len();
    let statistic = |(k, test): (usize, &TestDesign)| {
        let text = match test.drift {
            Some(_) => format!("Larger cumulative sum of test {}", test.name),
            None => format!("Squared mean of the last window of test {}", test.name),
        };
        let variable = Variable::real(channel("statistic", k, count), text, move |model| {
            &mut model.detector_mut().statistics[k]
        });
        output(variable.unit("1"))
    };
    detection.tests.iter().enumerate().map(statistic).collect()
}

fn thresholds(detection: &DetectionDesign) -> Vec<Variable> {
    let count = detection.tests.len();
    let threshold = |(k, test): (usize, &TestDesign)| {
        let text = format!("Threshold of the statistic of test {}", test.name);
        Variable::real(channel("threshold", k, count), text, move |model| {
            &mut model.detection_mut().tests[k].threshold
        })
        .unit("1")
        .tunable()
    };
    detection.tests.iter().enumerate().map(threshold).collect()
}
