//! The detection against its equations: residuals, tests, decision, for communication steps of any size.

use super::*;

/// The filter of the tests: two states, one residual, a feedthrough of command and measurement.
const FILTER: &str = "A = [[-2.0, 0.3], [0.1, -1.0]]\nB_u = [[0.5], [0.0]]\nB_y = [[1.0], [-0.4]]\n\
    C = [[1.0, 2.0]]\nD_u = [[0.2]]\nD_y = [[0.7]]\nstart = [[1.0, 0.0], [0.5, 2.0]]\nfaults = [\"f\"]\n";
/// Drift and threshold of the cumulative sum: the residuals of a continuous controller are smaller.
const CONTINUOUS: [f64; 2] = [0.005, 0.05];
const SAMPLED: [f64; 2] = [0.1, 0.8];
const T: f64 = 0.05;

fn cusum([drift, threshold]: [f64; 2]) -> String {
    format!(
        "[[detection.tests]]\nname = \"f\"\nresiduals = 1\ndrift = {drift}\nthreshold = {threshold}\n\
         reacts = [true]\n"
    )
}

fn continuous(limits: &str) -> String {
    let tests = cusum(CONTINUOUS);
    format!("{}[detection]\nsample_time = {T}\nfrom = 0.2\n{FILTER}{tests}", small(limits))
}

fn sampled() -> String {
    let text = small("").replace("step_size = 0.01", "step_size = 0.05");
    let text = format!("sample_time = {T}\nestimator = \"current\"\n{text}");
    let filter = FILTER.replace("[[-2.0, 0.3], [0.1, -1.0]]", "[[0.8, 0.1], [0.0, 0.9]]");
    format!("{text}[detection]\nfrom = 0.2\n{filter}{}", cusum(SAMPLED))
}

/// Residual at each sample, statistic at the end, time and onset of the first alarm.
#[derive(Debug, Default)]
struct Followed {
    residuals: Vec<f64>,
    statistic: f64,
    alarm: Option<[f64; 2]>,
}

impl Followed {
    /// Tests the residuals from position `first` on by cumulative sums; residual k is of the time (k + 1) T.
    fn test(mut self, first: usize, [drift, threshold]: [f64; 2]) -> Self {
        let (mut up, mut down, mut since) = (0.0_f64, 0.0_f64, [0.0; 2]);
        for (k, r) in self.residuals.iter().enumerate().skip(first) {
            #[expect(clippy::cast_precision_loss, reason = "few samples")]
            let time = (k + 1) as f64 * T;
            since[0] = if up > 0.0 { since[0] } else { time };
            since[1] = if down > 0.0 { since[1] } else { time };
            (up, down) = ((up + r - drift).max(0.0), (down - r - drift).max(0.0));
            self.statistic = up.max(down);
            if self.statistic > threshold && self.alarm.is_none() {
                self.alarm = Some([time, if down > up { since[1] } else { since[0] }]);
            }
        }
        self
    }
}

/// The continuous detection until 1 s by Runge-Kutta steps of 10 us, y(t) = 0.4 + 0.5 t from zero.
fn reference(limits: [f64; 2]) -> Followed {
    let rates = |s: [f64; 6], t: f64| {
        let y = 0.4 + 0.5 * t;
        let z = [s[0], s[1], s[2]];
        let on = t >= 0.35;
        let free = -3.0 * z[0] - 2.0 * z[1] + if on { z[2] } else { 0.0 };
        let u = free.clamp(limits[0], limits[1]);
        let slopes = small_rates(z, t, y, limits);
        let r = s[3] + 2.0 * s[4] + 0.2 * u + 0.7 * y;
        [
            slopes[0],
            slopes[1],
            slopes[2],
            -2.0 * s[3] + 0.3 * s[4] + 0.5 * u + y,
            0.1 * s[3] - s[4] - 0.4 * y,
            r,
        ]
    };
    let (h, mut s, mut followed) = (1e-5, [0.0; 6], Followed::default());
    for k in 0..100_000_u32 {
        let t = f64::from(k) * h;
        let along = |k: [f64; 6], f: f64| std::array::from_fn(|i| s[i] + f * h * k[i]);
        let k1 = rates(s, t);
        let k2 = rates(along(k1, 0.5), t + 0.5 * h);
        let k3 = rates(along(k2, 0.5), t + 0.5 * h);
        let k4 = rates(along(k3, 1.0), t + h);
        s = std::array::from_fn(|i| s[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
        if (k + 1) % 5000 == 0 {
            followed.residuals.push(s[5] / T.sqrt());
            s[5] = 0.0;
        }
    }
    followed.test(3, CONTINUOUS)
}

fn run(mut controller: AsoController, sizes: &[f64], end: f64) -> AsoController {
    let mut start = 0.0;
    for size in sizes.iter().cycle() {
        if start >= end - 1e-9 {
            return controller;
        }
        let size = size.min(end - start);
        step(&mut controller, start, size, &[0.4 + 0.5 * start], &[0.5]);
        start += size;
    }
    controller
}

/// The exporter integrates its equations, of which the filter of the residuals is no part.
#[test]
fn a_continuous_controller_with_a_schedule_has_no_detection() {
    let text = continuous("");
    let [first, end] = ["A = [[", "[experiment]"].map(|mark| text.find(mark).unwrap());
    let point = |at: f64| {
        let operating = "x_op = [0.0, 0.0]\nu_op = [0.0]\ny_op = [0.0]\n";
        format!("[[schedule.points]]\nat = {at:?}\n{}{operating}", &text[first..end])
    };
    let points = [1.0, 2.0].map(point).concat();
    let text = format!("{text}[schedule]\nvariable = \"mass\"\n{points}");
    let message = with_design(&text).err().unwrap().to_string();
    assert!(message.contains("schedule is stated together with detection"), "{message}");
}

#[test]
fn the_residuals_of_a_continuous_controller_do_not_depend_on_the_communication_step() {
    for (limits, range) in
        [("", [f64::NEG_INFINITY, f64::INFINITY]), ("limits = [-1.5, 0.3]", [-1.5, 0.3])]
    {
        let expected = reference(range);
        let [time, onset] = expected.alarm.unwrap();
        for sizes in [&[1.0][..], &[0.25], &[0.01], &[0.05], &[0.03, 0.011, 0.17]] {
            let mut actual = run(ready(with_design(&continuous(limits)).unwrap()), sizes, 1.0);
            let detector = actual.detector_mut();
            let (residual, last) = (detector.residuals[0], expected.residuals[19]);
            assert!((residual - last).abs() < 1e-5, "{limits} {sizes:?}: {residual} {last}");
            assert!((detector.statistics[0] - expected.statistic).abs() < 1e-4);
            let decision = &detector.decision;
            assert!(decision.detected);
            assert!((decision.time - time).abs() < 1e-9, "{sizes:?} {decision:?} {expected:?}");
            assert!((decision.onset - onset).abs() < 1e-9, "{sizes:?} {decision:?} {expected:?}");
        }
    }
}

/// Seconds since 1970 are rounded by up to 0.12 us, more than 1e-6 of the sample time. A run from zero is the oracle.
#[test]
fn a_continuous_controller_has_the_residual_of_each_step_at_its_end_in_seconds_since_1970() {
    let text = continuous("").replace("t_on = 0.35", "t_on = 0.0");
    let mut runs = [0.0, 1.7e9].map(|start_time| {
        let mut controller = with_design(&text).unwrap();
        controller.initialize(&Experiment { start_time, ..Experiment::default() }).unwrap();
        (start_time, controller)
    });
    for k in 0..40 {
        let elapsed = f64::from(k) * T;
        let [expected, actual] = runs.each_mut().map(|(start_time, controller)| {
            let start = *start_time + elapsed;
            step(controller, start, T, &[0.4 + 0.5 * elapsed], &[0.5]);
            controller.detector_mut().residuals[0]
        });
        assert!((actual - expected).abs() < 1e-4, "{k}: {actual} {expected}");
    }
}

#[test]
fn a_sampled_controller_tests_in_each_sample_with_the_command_of_that_sample() {
    let mut controller = ready(with_design(&sampled()).unwrap());
    let (mut x, mut followed) = ([0.0; 2], Followed::default());
    let y = |k: u32| 0.4 + 0.5 * f64::from(k) * T;
    // The importer has not set y in the sample of the start.
    let mut taken = [controller.values.u[0], 0.0];
    for k in 0..30_u32 {
        let [u, measured] = taken;
        if k > 0 {
            followed.residuals.push(x[0] + 2.0 * x[1] + 0.2 * u + 0.7 * measured);
        }
        x = [0.8 * x[0] + 0.1 * x[1] + 0.5 * u + measured, 0.9 * x[1] - 0.4 * measured];
        step(&mut controller, f64::from(k) * T, T, &[y(k)], &[0.5]);
        taken = [controller.values.u[0], y(k + 1)];
    }
    let expected = followed.test(3, SAMPLED);
    let detector = controller.detector_mut();
    // The step to the last instant takes its sample, too.
    let last = x[0] + 2.0 * x[1] + 0.2 * taken[0] + 0.7 * taken[1];
    assert!((detector.residuals[0] - last).abs() < 1e-9);
    let [time, onset] = expected.alarm.unwrap();
    assert!((detector.decision.time - time).abs() < 1e-9, "{:?} {expected:?}", detector.decision);
    assert!((detector.decision.onset - onset).abs() < 1e-9);
}

#[test]
fn the_decision_stays_over_more_alarms_until_it_is_reset() {
    let mut controller = run(ready(with_design(&continuous("")).unwrap()), &[0.1], 1.0);
    let first = controller.detector_mut().decision.clone();
    assert!(first.detected);
    for k in 0..4 {
        step(&mut controller, 1.0 + 0.1 * f64::from(k), 0.1, &[0.9], &[0.5]);
        let detector = controller.detector_mut();
        assert!(detector.statistics[0] > CONTINUOUS[1], "the test alarms again");
        assert_eq!(detector.decision, first);
    }
    controller.detector_mut().reset = true;
    controller.design.detection.as_mut().unwrap().tests[0].threshold = 1e9;
    step(&mut controller, 1.4, 0.1, &[0.0], &[0.0]);
    let decision = controller.detector_mut().decision.clone();
    assert_eq!((decision.detected, decision.isolated), (false, 0));
    assert!(decision.time < 0.0 && decision.onset < 0.0);
}

#[test]
fn a_copy_through_bytes_detects_with_the_same_bits() {
    for text in [continuous("limits = [-1.5, 0.3]"), sampled()] {
        let controller = run(ready(with_design(&text).unwrap()), &[0.03], 0.3);
        let bytes = postcard::to_stdvec(&controller).unwrap();
        let copy: AsoController = postcard::from_bytes(&bytes).unwrap();
        let [mut first, mut second] = [controller, copy].map(|mut controller| {
            for k in 0..20 {
                step(&mut controller, 0.3 + 0.03 * f64::from(k), 0.03, &[0.6], &[0.1]);
            }
            controller
        });
        let [first, second] = [first.detector_mut(), second.detector_mut()];
        assert_eq!(first.residuals[0].to_bits(), second.residuals[0].to_bits());
        assert_eq!(first.statistics[0].to_bits(), second.statistics[0].to_bits());
        assert_eq!(first.decision, second.decision);
    }
}

#[test]
fn the_detection_changes_no_command_and_allocates_nothing_in_steps_of_a_known_size() {
    for (with, without) in [
        (continuous(""), small("")),
        (continuous("limits = [-1.5, 0.3]"), small("limits = [-1.5, 0.3]")),
    ] {
        let [with, without] = [with, without].map(|text| with_design(&text).unwrap());
        let without = run(ready(without), &[0.02], 0.6);
        let mut with = run(ready(with), &[0.02], 0.6);
        assert_eq!(with.values.u[0].to_bits(), without.values.u[0].to_bits());
        let allocations = allocation_counter::measure(|| {
            for k in 0..40 {
                let start = 0.6 + 0.02 * f64::from(k);
                step(&mut with, start, 0.02, &[0.4 + 0.5 * start], &[0.5]);
            }
        });
        assert_eq!(allocations.count_total, 0);
    }
}

#[test]
fn a_window_of_several_residuals_is_tested_at_its_end() {
    let filter = FILTER
        .replace("C = [[1.0, 2.0]]", "C = [[0.0, 0.0], [0.0, 0.0]]")
        .replace("D_u = [[0.2]]", "D_u = [[0.0], [0.0]]")
        .replace("D_y = [[0.7]]", "D_y = [[1.0], [2.0]]");
    let test = "[[detection.tests]]\nname = \"all\"\nresiduals = 2\nwindow = 4\nthreshold = 0.5\n\
                reacts = [true]\n";
    let text = format!("{}[detection]\nsample_time = {T}\nfrom = 0.0\n{filter}{test}", small(""));
    let mut controller = ready(with_design(&text).unwrap());
    for k in 0..4 {
        assert!(!controller.detector_mut().decision.detected);
        step(&mut controller, f64::from(k) * T, T, &[1.0], &[0.0]);
    }
    // Averages of 1 and 2 times the root of T: 4 (1 + 4) T.
    assert!((controller.detector_mut().statistics[0] - 20.0 * T).abs() < 1e-9);
    let decision = controller.detector_mut().decision.clone();
    assert!((decision.time - 4.0 * T).abs() < 1e-12 && (decision.onset - T).abs() < 1e-12);
}

#[test]
fn the_fault_is_the_one_to_which_exactly_the_tests_with_an_alarm_react() {
    let isolation = aso_controller::design::detection::DetectionDesign {
        faults: ["a", "b", "c"].map(str::to_owned).to_vec(),
        tests: [[true, false, true], [false, true, true]]
            .map(|reacts| aso_controller::design::detection::TestDesign {
                name: String::new(),
                residuals: 1,
                drift: Some(1.0),
                window: None,
                threshold: 1.0,
                reacts: reacts.to_vec(),
            })
            .to_vec(),
        ..Default::default()
    };
    for (alarms, isolated) in
        [([true, false], 1), ([false, true], 2), ([true, true], 3), ([false, false], -1)]
    {
        let mut decision = crate::detection::Decision::default();
        decision.isolate(&isolation, |at| alarms[at]);
        assert_eq!(decision.isolated, 0, "without an alarm");
        decision.detected = true;
        decision.isolate(&isolation, |at| alarms[at]);
        assert_eq!(decision.isolated, isolated);
    }
}

#[test]
fn a_continuous_controller_with_a_detection_is_for_co_simulation_only() {
    assert!(with_design(&continuous("")).unwrap().model_exchange().is_none());
    assert!(with_design(&sampled()).unwrap().model_exchange().is_some());
    assert!(with_design(&small("")).unwrap().model_exchange().is_some());
}

#[test]
fn a_wrong_section_is_refused_with_its_entry() {
    for (from, to, part) in [
        ("C = [[1.0, 2.0]]\nD_u", "C = [[1.0]]\nD_u", "detection.C is 1 x 1, expected 1 x 2"),
        ("sample_time = 0.05\nfrom", "from", "detection.sample_time is missing"),
        ("residuals = 1", "residuals = 2", "the tests take 2 residuals"),
        ("reacts = [true]", "reacts = []", "reacts has 0 entries, expected 1"),
        ("faults = [\"f\"]", "faults = []", "detection.faults is empty, expected at least one"),
        ("drift = 0.005", "drift = -0.1", "drift = -0.1, expected above 0"),
        ("drift = 0.005", "drift = 0.005\nwindow = 3", "expected drift, or window"),
        ("from = 0.2", "from = -1.0", "detection.from = -1, expected a time in s from 0"),
    ] {
        let text = continuous("").replace(from, to);
        let Err(error) = with_design(&text) else { panic!("{to} was accepted") };
        assert!(error.to_string().contains(part), "{error}");
    }
}
