//! Valid and invalid plant files, and the places that errors point at.

use std::path::Path;
use std::time::Duration;

use nalgebra::Complex;

use crate::assess::checks::checks;
use crate::assess::detection::detection;
use crate::assess::remedies::remedies;
use crate::assess::reporting::{Assessment, effectiveness, report};
use crate::assess::robustness::robustness;
use crate::assess::verdict::verdict;
use crate::budget::TimeLimits;
use crate::report::Report;
use crate::report::robustness::Level;
use crate::solve::designed::{Designed, design};
use files::Source;
use plant_file::channel::Channel;
use plant_file::faults::{EntryPoint, FaultDynamics};
use plant_file::requirements::{Bandwidth, Region, Requirement};
use plant_file::{Model, PlantFile};

const MASS: &str = r#"A = [[0, 1], [0, 0]]
B = [[0], [1]]
C = [[1, 0]]
actuator_faults = "all"
feedback.eigenvalues = [-1, -2]
observer.eigenvalues = [-5, { re = -6, im = 2.5 }]
"#;

/// What is replaced in `MASS`, by what, and a part of the error.
const REFUSALS: [(&str, &str, &str); 68] = [
    (
        "A = [[0, 1], [0, 0]]",
        "A = [[0, 1], [0]]",
        "1:14: A[2]: expected 2 entries as in row 1, found 1",
    ),
    ("A = [[0, 1], [0, 0]]", "A = [[0, 1]]", "1:5: A: expected 1x1 (states x states), found 1x2"),
    ("[0, 0]]", "[0, nan]]", "1:18: A[2][2]: expected a finite number, found nan"),
    ("[0], [1]", "[0], [1], [2]", "2:5: B: expected 2x1 (states x actuators), found 3x1"),
    ("[[1, 0]]", "[[1, 0, 0]]", "3:5: C: expected 1x2 (measurements x states), found 1x3"),
    (
        "\"all\"",
        "\"both\"",
        "4:19: actuator_faults: expected a list of names or \"all\", found \"both\"",
    ),
    ("observer", "obsever", "6:1: unknown entry `obsever`; did you mean `observer`?"),
    ("feedback", "something", "5:1: unknown entry `something`; expected one of description, "),
    (
        "feedback.eigenvalues = [-1, -2]",
        "feedback.bandwidth = -1",
        "5:22: feedback.bandwidth: expected a number above 0, found -1",
    ),
    (
        "feedback.eigenvalues = [-1, -2]",
        "feedback.Q = [1, 1]",
        "`feedback.R` is missing: the weight of",
    ),
    (
        "feedback.eigenvalues = [-1, -2]",
        "feedback.bandwidth = 1\nfeedback.R = [1]",
        "6:14: feedback.R: it belongs to `Q`",
    ),
    (
        "feedback.eigenvalues = [-1, -2]",
        "feedback.h_infinity = \"least\"",
        "5:23: feedback.h_infinity: \"least\" needs a `region` with a disc: without",
    ),
    (
        "feedback.eigenvalues = [-1, -2]",
        "sample_time = 1\nfeedback.region = { decay = 1, sector = 30 }",
        "6:41: feedback.region.sector: a sampled design has a region by `decay` only",
    ),
    (
        "feedback.eigenvalues = [-1, -2]",
        "feedback.region = {}",
        "5:19: feedback.region: expected at least one of decay",
    ),
    (
        "feedback.eigenvalues = [-1, -2]",
        "feedback.region = { sector = 95 }",
        "expected less than 90 degrees, found 95",
    ),
    ("feedback.", "feedback.Q = [1, 1]\nfeedback.", "5:14: feedback.Q: only one of bandwidth, "),
    (
        "feedback.",
        "feedback.sampled_",
        "5:32: feedback.sampled_eigenvalues: the design has no `sample_time`",
    ),
    ("im = 2.5", "im = -2.5", "expected a number above 0, found -2.5"),
    ("C = ", "sample_time = 0\nC = ", "3:15: sample_time: expected a number above 0, found 0"),
    ("C = ", "estimator = \"current\"\nC = ", "3:13: estimator: the design has no `sample_time`"),
    ("C = ", "F_a = [[0], [1]]\nfaults = []\nC = ", "4:10: faults: expected at least one fault"),
    (
        "C = ",
        "faults = [{ name = \"f\" }]\nC = ",
        "3:11: fault `f`: expected `actuator`, `sensor` or `loss_of`, or a matrix F_a",
    ),
    (
        "C = ",
        "faults = [{ name = \"f\", input = \"d\" }]\nC = ",
        "3:11: fault `f`: the plant is no FMU: expected `actuator`, `sensor` or `loss_of`",
    ),
    ("actuator_faults = \"all\"", "", "no fault is stated: expected `F_a`, `actuator_faults"),
    (
        "C = ",
        "F_a = [[0, 1], [1, 0]]\nfaults = [{ name = \"f\" }]\nC = ",
        "3:7: F_a: expected 1 columns, one per fault, found 2",
    ),
    (
        "C = ",
        "faults = [{ name = \"f\", sensor = \"y\" }]\nC = ",
        "no measurement is named \"y\"; there are y1",
    ),
    (
        "C = ",
        "faults = [{ name = \"f\", sensor = \"y1\" }]\nC = ",
        "3:11: sensor fault `f` needs `filter`",
    ),
    (
        "C = ",
        "faults = [{ name = \"f\", loss_of = \"u1\" }]\nC = ",
        "`faults[1].least_command` is missing: the command, in its unit",
    ),
    (
        "C = ",
        "faults = [{ name = \"f\", sensor = \"y1\", loss_of = \"u1\" }]\nC = ",
        "a fault has only one of actuator, sensor, loss_of, input",
    ),
    (
        "C = ",
        "actuators = [{ name = \"u\", unit = \"N\" }]\nfaults = [{ name = \"f\", actuator = \"u\", unit = \"kN\" }]\nC = ",
        "4:48: faults[1].unit: expected N, the unit of `u`, found kN",
    ),
    ("C = ", "states = [\"p\", \"p\"]\nC = ", "3:16: states[2]: the name `p` is there twice"),
    ("C = ", "states = [\"p\"]\nC = ", "3:10: states: expected 2 states, the rows of A, found 1"),
    (
        "C = ",
        "actuators = [{ name = \"u\", limits = [2, 1] }]\nC = ",
        "expected lower < upper, found 2 and 1",
    ),
    (
        "C = ",
        "measurements = [{ name = \"y\", range = [2, 2] }]\nC = ",
        "3:39: measurements[1].range: expected lower < upper, found 2 and 2",
    ),
    (
        "C = ",
        "measurements = [{ name = \"y\", range = [-inf, 2] }]\nC = ",
        "3:40: measurements[1].range[1]: expected a finite number, found -inf",
    ),
    (
        "C = ",
        "measurements = [{ name = \"y\", range = [1] }]\nC = ",
        "3:39: measurements[1].range: expected 2 numbers, lower and upper, found 1",
    ),
    (
        "C = ",
        "measurements = [{ name = \"y\", longest_hold = 0 }]\nC = ",
        "3:46: measurements[1].longest_hold: expected a number above 0, found 0",
    ),
    (
        "C = ",
        "measurements = [{ name = \"y\", limits = [0, 1] }]\nC = ",
        "unknown entry `measurements[1].limits`",
    ),
    (
        "C = ",
        "actuators = [{ name = \"u\", range = [0, 1] }]\nC = ",
        "unknown entry `actuators[1].range`",
    ),
    (
        "C = ",
        "sample_time = 1e-3\nmeasurements = [{ name = \"y\", longest_hold = 1e9 }]\nC = ",
        "4:46: 1000000000 s are 1.0e12 samples of 0.001 s; expected fewer than 2^32 samples",
    ),
    (
        "C = ",
        "measurements = [{ name = \"measurement_lost\", range = [0, 1] }]\nC = ",
        "3:26: the controller FMU has a variable `measurement_lost` of its own",
    ),
    ("C = ", "actuators = [{ name = \"u\", unit = \"N m!\" }]\nC = ", "actuators[1].unit: "),
    ("C = ", "operating_point = { x = 1 }\nC = ", "3:19: operating_point: it belongs to `plant`"),
    ("C = ", "plant = \"P.fmu\"\nC = ", "1:5: A: an FMU is the plant; its matrices are not stated"),
    (
        "C = ",
        "robustness.limit = 3\nC = ",
        "3:12: unknown entry `robustness.limit`; expected one of",
    ),
    (
        "C = ",
        "robustness.tolerance = 1\nC = ",
        "3:24: robustness.tolerance: expected a number from 0 to below 1, found 1",
    ),
    (
        "C = ",
        "robustness.tolerance = { A = 0.1, E = 0.1 }\nC = ",
        "3:35: unknown entry `robustness.tolerance.E`; did you mean `A`?",
    ),
    (
        "C = ",
        "robustness.tolerance = { entries = { \"A[9][1]\" = 0.1 } }\nC = ",
        "A[9][1]: the matrix has 2 rows and 2 columns",
    ),
    (
        "C = ",
        "robustness.red = 0.5\nC = ",
        "3:18: robustness.red: the peak of S is never below 1: expected more, found 0.5",
    ),
    (
        "C = ",
        "robustness = { red = 3, amber = 3.5 }\nC = ",
        "3:22: robustness.red: expected amber <= red, found 3.5 and 3",
    ),
    (
        "C = ",
        "robustness.cases = 10.5\nC = ",
        "3:20: robustness.cases: expected a whole number from 0 to 100000, found 10.5",
    ),
    (
        "C = ",
        "robustness.noise = [1, 2]\nC = ",
        "3:20: robustness.noise: expected 1 numbers, one per measurement, found 2",
    ),
    (
        "C = ",
        "robustness.noise = [-1]\nC = ",
        "robustness.noise[1]: expected no less than 0, found -1",
    ),
    ("C = ", "actuators = [\"motor 1\"]\nC = ", "3:14: `motor 1` cannot be the name of a variable"),
    (
        "C = ",
        "measurements = [{ name = \"φ\" }]\nC = ",
        "3:26: `φ` cannot be the name of a variable of the controller FMU: expected letters A to Z",
    ),
    ("C = ", "actuators = [\"y1\"]\nC = ", "3:13: the actuator and the measurement `y1` would be"),
    (
        "C = ",
        "actuators = [\"v\"]\nmeasurements = [\"v\"]\nC = ",
        "4:17: the actuator and the measurement `v` would be one variable",
    ),
    (
        "C = ",
        "reference.track = \"y1\"\nschedule = { variable = \"r_y1\", \
         points = [{ at = 0 }, { at = 1, B = [[0], [2]] }] }\nC = ",
        "4:25: the scheduling variable `r_y1` is a reference; expected a measurement, or another name",
    ),
    ("C = ", "measurements = [\"compensate\"]\nC = ", "3:17: the controller FMU has a variable"),
    ("C = ", "measurements = [\"f_hat\"]\nC = ", "3:17: the controller FMU has a variable `f_hat`"),
    (
        "C = ",
        "actuators = [\"x_hat[2]\"]\nC = ",
        "3:14: the controller FMU has a variable `x_hat[2]`",
    ),
    (
        "C = ",
        "actuators = [\"K_x[9,9]\"]\nC = ",
        "3:14: the controller FMU has a variable `K_x[9,9]`",
    ),
    ("C = ", "measurements = [\"der(f_hat)\"]\nC = ", "3:17: the controller FMU has a variable"),
    (
        "C = ",
        "transfer_time = 1\nmeasurements = [\"der(u_t)\"]\nC = ",
        "4:17: the controller FMU has a variable `der(u_t)`",
    ),
    (
        "C = ",
        "measurements = [\"q[1]\"]\nactuators = [\"q[2]\"]\nC = ",
        "4:14: in the controller FMU the variable q[2] stands apart from the other elements of q",
    ),
    (
        "C = ",
        "faults = [{ name = \"f_u1\", actuator = \"u1\" }]\nC = ",
        "3:11: two faults have the name `f_u1`; expected different names",
    ),
    (
        "actuator_faults = \"all\"",
        "F_a = [[0, 0], [1, 1]]\nfaults = [{ name = \"f\", kind = \"ramp\" }, { name = \"f_rate\" }]",
        "5:42: fault `f_rate` has the name of the rate of the ramp `f`; expected another name",
    ),
    (
        "C = ",
        "states = [\"p\", \"v\\u0007\"]\nC = ",
        "3:16: states[2]: expected a name of one line without control characters, found '\\u{7}'",
    ),
];

/// Reads a plant file, and returns what `look` sees in it.
pub(crate) fn read<T>(text: &str, look: impl FnOnce(&PlantFile<'_>) -> T) -> Result<T, String> {
    let source = Source::new(Path::new("plant.toml"), text.to_owned());
    let file = PlantFile::read(&source);
    file.map(|file| look(&file)).map_err(|error| error.to_string())
}

/// The first line of the error for `MASS` with `from` replaced by `to`.
fn refusal(from: &str, to: &str) -> String {
    assert!(MASS.contains(from), "{from}");
    let message = read(&MASS.replacen(from, to, 1), |_| ()).expect_err(to);
    message.lines().next().unwrap().to_owned()
}

#[test]
fn unnamed_signals_get_a_letter_and_a_number() {
    let names = read(MASS, |file| {
        let Model::Matrices { states, .. } = &file.model else { panic!("matrices") };
        let signals = states.iter().chain(&file.actuators).chain(&file.measurements);
        let faults = file.faults.iter().map(|fault| fault.name.clone());
        signals.map(|signal| signal.name.clone()).chain(faults).collect::<Vec<_>>()
    });
    assert_eq!(names.unwrap(), ["x1", "x2", "u1", "y1", "f_u1"]);
}

#[test]
fn a_pair_of_complex_eigenvalues_counts_twice() {
    let expected = read(MASS, |file| file.observer.requirement.clone()).unwrap();
    let pair = [Complex::new(-6.0, 2.5), Complex::new(-6.0, -2.5)];
    assert_eq!(expected, Requirement::Eigenvalues(vec![Complex::new(-5.0, 0.0), pair[0], pair[1]]));
}

#[test]
fn requirements_that_are_not_stated_are_open() {
    let bandwidth = Requirement::Bandwidth(Bandwidth { rate: None, is_stated: false });
    let open = MASS.replace("feedback.eigenvalues = [-1, -2]", "");
    assert_eq!(read(&open, |file| file.feedback.requirement.clone()).unwrap(), bandwidth);
    let stated = MASS.replace("feedback.eigenvalues = [-1, -2]", "feedback.bandwidth = 3");
    let bandwidth = Requirement::Bandwidth(Bandwidth { rate: Some(3.0), is_stated: true });
    assert_eq!(read(&stated, |file| file.feedback.requirement.clone()).unwrap(), bandwidth);
}

/// The controller has one bit of 64 for each actuator.
#[test]
fn a_plant_with_more_than_64_actuators_is_refused() {
    let text = |count: usize| {
        let row = |entry: &str| format!("[{}]", vec![entry; count].join(", "));
        let b = format!("B = [{}, {}]", row("0"), row("1"));
        MASS.replace("B = [[0], [1]]", &b).replace("\"all\"", "[\"u1\"]")
    };
    read(&text(64), |_| ()).unwrap();
    let refused = read(&text(65), |_| ()).unwrap_err();
    let expected = "plant.toml:2:5: expected at most 64 actuators of a controller, found 65";
    assert!(refused.starts_with(expected), "{refused}");
}

/// A fault adds to its signal: 1 K and 1 degC are one difference, 1 degF is 5/9 of it.
#[test]
fn a_fault_of_a_temperature_may_have_the_unit_of_a_difference() {
    let with = |unit: &str| {
        let measured = "measurements = [{ name = \"y\", unit = \"degC\" }]\nfilter = 50\nC = ";
        let fault = format!("faults = [{{ name = \"f\", sensor = \"y\", unit = \"{unit}\" }}]");
        let text = MASS.replace("C = ", measured).replace("actuator_faults = \"all\"", &fault);
        read(&text, |file| file.faults[0].unit.clone().unwrap())
    };
    assert_eq!(with("K").as_deref(), Ok("K"));
    let refused = with("degF").unwrap_err();
    assert!(refused.contains("expected degC, the unit of `y`, found degF"), "{refused}");
}

#[test]
fn an_error_shows_the_line_and_underlines_the_value() {
    let message = read(&MASS.replace("[0, 0]]", "[0, zero]]"), |_| ()).unwrap_err();
    let lines: Vec<_> = message.lines().collect();
    assert!(lines[0].starts_with("plant.toml:1:18: "), "{message}");
    let message = read(&MASS.replace("[0], [1]", "[0], [\"ü\"]"), |_| ()).unwrap_err();
    let expected = "plant.toml:2:12: B[2][1]: expected a number, found the text \"ü\"\n  \
                    |\n2 | B = [[0], [\"ü\"]]\n  |            ^^^";
    assert_eq!(message, expected);
}

#[test]
fn each_error_states_position_expectation_and_finding() {
    for (from, to, expected) in REFUSALS {
        let message = refusal(from, to);
        assert!(message.contains(expected), "{to}: {message}");
        assert!(message.starts_with("plant.toml:"), "{message}");
    }
}

/// These are names of variables that the FMU of this design does not have.
#[test]
fn names_like_those_of_the_controller_fmu_are_accepted() {
    for name in
        ["f_hat[1]", "x_hat", "A", "y_f", "T_s", "u_min", "x_op[1]", "'motor 1'", "a.b[3].c"]
    {
        for key in ["actuators", "measurements"] {
            read(&MASS.replace("C = ", &format!("{key} = [\"{name}\"]\nC = ")), |_| ()).unwrap();
        }
    }
}

#[test]
fn faults_enter_at_the_points_that_the_file_states() {
    let more = r#"
filter = [50]
F_a = [[1], [1]]
[[faults]]
name = "own"
[[faults]]
name = "sensor"
sensor = "y1"
kind = "ramp"
[[faults]]
name = "loss"
loss_of = "u1"
least_command = 0.1
bound = 1
"#;
    let faults = read(&(MASS.to_owned() + more), |file| file.faults.clone()).unwrap();
    let entry_points: Vec<_> = faults.iter().map(|fault| fault.entry_point.clone()).collect();
    let loss = EntryPoint::Loss { actuator: 0, least_command: 0.1 };
    assert_eq!(
        entry_points,
        [EntryPoint::Actuator(0), EntryPoint::Column(0), EntryPoint::Sensor(0), loss]
    );
    assert_eq!(faults[2].dynamics, FaultDynamics::Ramp);
    assert_eq!((faults[3].bound, faults[3].rate_bound), (Some(1.0), None));
}

#[test]
fn a_region_is_required_alone_or_with_a_norm() {
    let region = Region { decay: Some(3.0), disc: Some((-10.0, 9.0)), sector: Some(45.0) };
    let text = "region = { decay = 3, disc = { center = -10, radius = 9 }, sector = 45 }";
    let alone = MASS.replace("feedback.eigenvalues = [-1, -2]", &format!("feedback.{text}"));
    assert_eq!(
        read(&alone, |file| file.feedback.requirement.clone()).unwrap(),
        Requirement::Region(region)
    );
    let norm = alone.replace("feedback.region", "feedback.h_infinity = \"least\"\nfeedback.region");
    let channel = Channel::default();
    let expected = Requirement::HInfinity { bound: None, region, channel };
    assert_eq!(read(&norm, |file| file.feedback.requirement.clone()).unwrap(), expected);
}

#[test]
fn an_fmu_beside_the_file_can_replace_the_matrices() {
    let text = r#"
plant = "Plant.fmu"
actuators = ["u"]
measurements = [{ name = "phi", unit = "rad" }]
operating_point = { "tau.c" = 0, phi = 0.5 }
faults = [{ name = "f", input = "tau_f" }]
feedback.Q = [1, 1]
feedback.R = [[2]]
observer.region = { decay = 20 }
"#;
    let (path, point) = read(text, |file| {
        let Model::Fmu(fmu) = &file.model else { panic!("an FMU") };
        (fmu.path.clone(), fmu.operating_point.clone())
    })
    .unwrap();
    assert_eq!(path, Path::new("Plant.fmu"));
    assert_eq!(point, [("phi".to_owned(), 0.5), ("tau.c".to_owned(), 0.0)]);
    // The file has no F_a.
    let without = text.replace("faults = [{ name = \"f\", input = \"tau_f\" }]", "");
    let refused = read(&without, |_| ()).unwrap_err();
    let expected = "no fault is stated: expected `actuator_faults = \"all\"` or [[faults]]";
    assert!(refused.contains(expected), "{refused}");
}

/// The pendulum sampled at 5 ms by a prediction estimator of a ramp; without estimating the friction
/// its observer has the spectral radius 1.0825 (numpy), and the pendulum falls at once.
#[test]
fn an_observer_that_is_unstable_before_t_on_fails_a_check_unless_it_estimates_from_the_start() {
    let pendulum = include_str!("../../../fmu-controller/pendulum.toml")
        .replace("bound = 30.0", "kind = \"ramp\"\nbound = 30.0")
        .replace("-3000.0]", "-3000.0, -2500.0]")
        .replace("t_on = 40.0", "t_on = 40.0\nsample_time = 0.005\nestimator = \"prediction\"");
    let failed = |text: &str| {
        read(text, |file| {
            let checks = checks(&design(file).unwrap().nominal);
            let failed = checks.into_iter().filter(|check| !check.holds);
            failed.map(|check| (check.condition, check.value.unwrap())).collect::<Vec<_>>()
        })
        .unwrap()
    };
    let [(condition, value)] = &failed(&pendulum)[..] else { panic!("one check fails") };
    assert!(condition.contains("before t_on"), "{condition}");
    assert!((value - 0.0825).abs() < 5e-4, "{value}");
    assert!(failed(&pendulum.replace("monitor = false", "monitor = true")).is_empty());
}

/// A bias of one of two sensors of a position.
#[test]
fn a_plant_with_faults_of_sensors_only_has_no_check_of_the_compensation() {
    let sensor = MASS
        .replace("[0, 0]]", "[0, -1]]")
        .replace("C = [[1, 0]]", "C = [[1, 0], [1, 0]]\nfilter = 50")
        .replace("actuator_faults = \"all\"", "faults = [{ name = \"bias\", sensor = \"y1\" }]")
        .replace("[-5, { re = -6, im = 2.5 }]", "[-5, -6, -7, -8, -9]");
    let count = |text: &str| {
        let checks = read(text, |file| checks(&design(file).unwrap().nominal)).unwrap();
        checks.iter().filter(|check| check.condition.starts_with("the compensation")).count()
    };
    assert_eq!([count(MASS), count(&sensor)], [1, 0]);
}

/// The first line of the error of a design, or its warnings.
fn designed(text: &str) -> Result<Vec<String>, String> {
    let warnings = read(text, |file| {
        let first = |error: crate::Error| error.to_string().lines().next().unwrap().to_owned();
        let line = |warning: &files::PlaceError| crate::plant::plausibility::line(file, warning);
        let design_result = design(file).map_err(first)?;
        Ok(design_result.warnings.iter().map(line).collect())
    });
    warnings.unwrap()
}

#[test]
fn limits_that_exclude_the_operating_point_are_refused_and_a_limit_at_it_is_a_warning() {
    let with = |actuator: &str| {
        designed(
            &MASS.replace("C = ", &format!("actuators = [{{ name = \"u\", {actuator} }}]\nC = ")),
        )
    };
    let refused = with("unit = \"N\", limits = [1, 5]").unwrap_err();
    let expected = "plant.toml:3:49: the operating point of the actuator `u`, 0 N, is outside of its \
                    limits 1 and 5; expected";
    assert!(refused.starts_with(expected), "{refused}");
    let refused = with("limits = [-1, 5], operating = 5.5").unwrap_err();
    assert!(refused.contains(":37: the operating point of the actuator `u`, 5.5, is"), "{refused}");
    let expected =
        ["plant.toml:3:37: the operating point of the actuator `u`, 0, is at a limit, so that \
                     the controller acts in one direction only"];
    assert_eq!(with("limits = [0, 5]").unwrap(), expected);
    assert!(with("limits = [1, 5], operating = 2").unwrap().is_empty());
}

#[test]
fn a_range_that_excludes_the_operating_point_is_refused() {
    let with = |measurement: &str| {
        let text = format!("measurements = [{{ name = \"y\", {measurement} }}]\nC = ");
        designed(&MASS.replace("C = ", &text))
    };
    let refused = with("unit = \"m\", range = [1, 5]").unwrap_err();
    let expected = "plant.toml:3:51: the operating point of the measurement `y`, 0 m, is outside of its range \
                    from 1 to 5; expected a range that contains it";
    assert!(refused.starts_with(expected), "{refused}");
    let refused = with("range = [1, 5], operating = 5.5").unwrap_err();
    assert!(refused.contains("measurement `y`, 5.5, is outside"), "{refused}");
    assert!(with("range = [1, 5], operating = 1, longest_hold = 2").unwrap().is_empty());
}

#[test]
fn a_continuous_schedule_has_no_ranges() {
    let text = MASS.replace("C = ", "measurements = [{ name = \"y\", longest_hold = 2 }]\nC = ")
        + "[schedule]\nvariable = \"load\"\n[[schedule.points]]\nat = 0\n[[schedule.points]]\nat = 1\nA = [[0, 2], [0, 0]]\n";
    let message = read(&text, |_| ()).unwrap_err();
    let expected = "plant.toml:3:46: `y` has a range or a longest time of a hold, which a continuous controller";
    assert!(message.starts_with(expected), "{message}");
    let sampled = format!("sample_time = 0.1\n{text}");
    read(&sampled, |_| ()).unwrap();
}

/// A single number, not in a list, applies to all signals, as in `[robustness]`.
#[test]
fn a_list_of_noise_has_one_number_for_each_signal() {
    let text = |noise: &str| {
        let two = MASS.replace("C = [[1, 0]]", "C = [[1, 0], [0, 1]]");
        let detection =
            "[detection]\nmethod = \"cusum\"\nfalse_alarm_interval = 1e4\nsizes = { f_u1 = 1 }";
        format!("{two}{detection}\n{noise}\n")
    };
    let noise = |stated: &str| read(&text(stated), |file| file.detection.clone().unwrap().noise);
    assert_eq!(noise("noise = 2").unwrap(), [2.0, 2.0]);
    assert_eq!(noise("noise = [2, 3]").unwrap(), [2.0, 3.0]);
    let refused = noise("noise = [2]").unwrap_err();
    let expected = "detection.noise: expected 2 numbers, one per measurement, found 1";
    assert!(refused.contains(expected), "{refused}");
    let refused = read(&text("noise = 2\nprocess_noise = [0.1]"), |file| {
        let error = detection(file, &design(file).unwrap(), None).err().unwrap();
        error.to_string()
    });
    assert!(refused.unwrap().contains("expected 2 numbers, one per state, found 1"));
}

#[test]
fn false_alarms_in_every_sample_are_refused_with_the_entry() {
    let entry = "[detection]\nmethod = \"cusum\"\nfalse_alarm_interval = 0.02\nnoise = 1\nsizes = { f_u1 = 1 }";
    let message = read(&format!("sample_time = 0.1\n{MASS}{entry}\n"), |file| {
        let error = detection(file, &design(file).unwrap(), None).err().unwrap();
        error.to_string()
    });
    let expected = "`false_alarm_interval` or `false_alarms_per_hour`: a false alarm every 0.02 s is one every 0.2 samples";
    assert!(message.clone().unwrap().contains(expected), "{message:?}");
}

#[test]
fn faults_that_no_measurement_can_tell_apart_are_named_with_the_reason() {
    let two = MASS.replace("C = [[1, 0]]", "C = [[1, 0], [0, 1]]").replace("[-5,", "[-4, -5,");
    let of = |text: &str, f_a: &str, names: &[&str]| {
        let names: Vec<_> = names.iter().map(|name| format!("{{ name = \"{name}\" }}")).collect();
        let faults = format!("F_a = {f_a}\nfaults = [{}]", names.join(", "));
        designed(&text.replace("actuator_faults = \"all\"", &faults)).unwrap_err()
    };
    let message = of(&two, "[[0, 0], [1, -2]]", &["wind", "slope"]);
    let expected = "plant.toml:5:30: the faults `wind` and `slope` act on the plant in the same \
                    direction (their columns of F_a are parallel)";
    assert!(message.starts_with(expected), "{message}");
    let message = of(&two, "[[0, 1, 2], [1, 0, 3]]", &["a", "b", "c"]);
    let expected = "plant.toml:5:43: fault `c` acts on the plant as a combination of `a`, `b` does";
    assert!(message.starts_with(expected), "{message}");
    let message = of(&two, "[[0, 0], [1, 0]]", &["a", "b"]);
    let expected =
        "plant.toml:5:27: fault `b` has no effect on the plant: its column of F_a is zero";
    assert_eq!(message, expected);
    let message = of(MASS, "[[0, 1], [1, 0]]", &["a", "b"]);
    let expected = "plant.toml:5:27: 2 faults (a, b) cannot be estimated from 1 measurement (y1): \
                    expected at least as many independent measurements as faults";
    assert_eq!(message, expected);
    let copies = two.replace("C = [[1, 0], [0, 1]]", "C = [[1, 0], [-3, 0]]");
    let message = of(&copies, "[[0, 1], [1, 0]]", &["a", "b"]);
    assert!(message.contains("from 1 independent measurement (y1, y2)"), "{message}");
}

/// The second state and its fault reach no measurement.
#[test]
fn a_fault_of_a_mode_that_no_measurement_shows_is_refused() {
    let text = "A = [[1, 0], [0, -2]]\nB = [[1], [0]]\nC = [[1, 0]]\nF_a = [[0], [1]]\n\
                faults = [{ name = \"leak\" }]\nfeedback.Q = [1, 1]\nfeedback.R = [1]\n\
                observer.W = [1, 1, 1]\nobserver.V = [1]\n";
    let message = designed(text).unwrap_err();
    assert_eq!(message, "plant.toml:5:11: fault `leak` cannot be seen from the measurements y1");
}

/// The fault acts on the measurement with the gain 1 at rest; W has hardly any noise for the second state, whose mode
/// the observer therefore leaves at -0.01.
#[test]
fn a_warning_of_slow_estimates_names_w() {
    let text = "A = [[-1, 0], [0, -0.01]]\nB = [[1, 0], [0, 1]]\nC = [[1, 1]]\n\
                [[faults]]\nname = \"f\"\nactuator = \"u1\"\n\
                [feedback]\neigenvalues = [-1, -2]\n[observer]\nW = [1, 1e-8, 1]\nV = [1]\n";
    let warning = |file: &PlantFile<'_>| {
        let designed = design(file).unwrap();
        crate::assess::slow_estimates::warning(file, &designed.nominal).unwrap()
    };
    let warning = read(text, warning).unwrap().unwrap();
    let time = warning.split(' ').nth(4).unwrap().parse::<f64>().unwrap();
    assert!((time - 400.0).abs() < 0.1 && warning.contains("or a larger W"), "{warning}");
}

/// The plant is much faster than the bandwidths that the file asks for.
#[test]
fn estimates_as_fast_as_the_bandwidth_of_the_observer_are_no_warning() {
    let text = "A = [[-10]]\nB = [[10]]\nC = [[1]]\nactuator_faults = \"all\"\n\
                feedback.bandwidth = 0.1\nobserver.bandwidth = 0.3\n";
    let warning = |file: &PlantFile<'_>| {
        let designed = design(file).unwrap();
        crate::assess::slow_estimates::warning(file, &designed.nominal).unwrap()
    };
    assert_eq!(read(text, warning).unwrap(), None);
}

/// The same loop in seconds and in nanoseconds: the gain of the integral is a rate.
#[test]
fn a_bandwidth_gives_fast_samples_the_integral_action_of_slow_ones() {
    let gain = |speed: f64| {
        let text = format!(
            "A = [[-{speed:e}]]\nB = [[{speed:e}]]\nC = [[1]]\nactuator_faults = \"all\"\n\
             sample_time = {:e}\nfeedback.bandwidth = {speed:e}\nobserver.bandwidth = {:e}\n\
             reference.track = [\"y1\"]\n",
            0.1 / speed,
            4.0 * speed
        );
        let gains = read(&text, |file| design(file).unwrap().nominal.gains);
        gains.unwrap().integral.unwrap().gain[(0, 0)] / speed
    };
    let gains = [1.0, 1e9].map(gain);
    assert!((gains[1] / gains[0] - 1.0).abs() < 1e-4, "{gains:?}");
}

/// The level and the reasons of a plant file.
fn judged(text: &str) -> (Level, String) {
    read(text, |file| {
        let designed = design(file).unwrap();
        let time = TimeLimits { certificates: Duration::ZERO, ..TimeLimits::default() };
        let (nominal, steps) = (&designed.nominal, unobserved());
        let (figures, _) = robustness(nominal, &file.robustness, None, &time, &steps).unwrap();
        let verdict =
            verdict(&checks(&designed.nominal), figures.as_ref(), &file.robustness, vec![], vec![]);
        (verdict.level, verdict.reasons.join("; "))
    })
    .unwrap()
}

/// The peak of S is 1.6992 (python-control 0.10.2, linfnorm).
#[test]
fn the_limits_of_the_peak_of_s_decide_the_level() {
    let (level, reasons) =
        judged(&format!("{MASS}robustness.amber = 1.6\nrobustness.red = 1.69\n"));
    assert_eq!(level, Level::Red, "{reasons}");
    assert!(reasons.contains("above 1.69 (red)"), "{reasons}");
    let (level, reasons) =
        judged(&format!("{MASS}robustness.amber = 1.69\nrobustness.red = 1.71\n"));
    assert_eq!(level, Level::Amber, "{reasons}");
    let (level, reasons) = judged(&format!("{MASS}robustness.amber = 30\nrobustness.red = 30\n"));
    assert_eq!((level, reasons.as_str()), (Level::Green, ""));
}

/// A fast unstable plant with a slow observer.
#[test]
fn parameters_within_their_tolerances_that_destabilise_make_a_design_red() {
    let lag = "A = [[10]]\nB = [[1]]\nC = [[1]]\nactuator_faults = \"all\"\n\
               feedback.eigenvalues = [-1]\nobserver.eigenvalues = [-1.5, -2]\n\
               robustness.amber = 100\nrobustness.red = 100\n";
    let (level, reasons) = judged(&format!("{lag}robustness.tolerance = {{ A = 0.5 }}\n"));
    assert_eq!(level, Level::Red, "{reasons}");
    assert!(reasons.contains("±50 % of A[1][1]"), "{reasons}");
    let (level, reasons) = judged(&format!("{lag}robustness.tolerance = 0.001\n"));
    assert_eq!(level, Level::Green, "{reasons}");
}

/// Eigenvalues of a sampled loop are not scaled.
#[test]
fn there_is_no_remedy_where_no_other_design_is_tried() {
    let text = format!("{MASS}robustness.amber = 1.6\n");
    let nominal = read(&text, |file| design(file).unwrap().nominal).unwrap();
    let examine = |file: &PlantFile<'_>| {
        robustness(&nominal, &file.robustness, None, &TimeLimits::default(), &unobserved()).unwrap()
    };
    let (figures, budget) = read(&text, examine).unwrap();
    let plant = text.replace("feedback.eigenvalues = [-1, -2]\n", "");
    let plant = plant.replace("observer.eigenvalues = [-5, { re = -6, im = 2.5 }]\n", "");
    let sampled = "sample_time = 0.1\nfeedback.sampled_eigenvalues = [0.8, 0.9]\n\
                   observer.sampled_eigenvalues = [0.5, 0.6, 0.7]";
    let count = |file: &PlantFile<'_>| remedies(file, &nominal, figures.as_ref(), &budget).len();
    assert!(read(&text, count).unwrap() > 0);
    assert_eq!(read(&format!("{plant}{sampled}\n"), count).unwrap(), 0);
}

/// The worst plant, as a plant file, has the matrices of the report and is a plant file.
#[test]
fn the_worst_plant_is_a_plant_file() {
    let of = |tolerance: &str| {
        let text = format!("{MASS}robustness.tolerance = {tolerance}\n");
        let worst = |file: &PlantFile<'_>| {
            let designed = design(file).unwrap();
            let report = report_within(file, &designed, TimeLimits::default()).unwrap();
            let a = report.robustness.as_ref().unwrap().tolerance.worst[0].values.clone();
            let worst = crate::assess::worst_case::plant_file(file, &designed.nominal, &report);
            (worst.unwrap().unwrap(), a)
        };
        read(&text.replace("[0, 0]]", "[-2.0, -0.5]]"), worst).unwrap()
    };
    let (exact, _) = of("0");
    let expected = ": the worst plant found is the plant itself, because nothing varies.\n";
    assert!(exact.contains(expected), "{exact}");
    let (worst, a) = of("0.2");
    assert!((a[1][0].abs() - 2.0).abs() > 0.39 && a[0] == [0.0, 1.0], "{a:?}");
    let stated = read(&worst, |file| {
        let Model::Matrices { a, .. } = &file.model else { panic!("matrices") };
        [a[(1, 0)], a[(1, 1)]]
    });
    assert_eq!(stated.unwrap().map(f64::to_bits), [a[1][0], a[1][1]].map(f64::to_bits));
}

fn report_within(
    file: &PlantFile<'_>,
    designed: &Designed,
    limits: TimeLimits,
) -> Result<Report, crate::Error> {
    let steps = unobserved();
    let assessment = Assessment::new(file, None, designed, &steps);
    report(Assessment { limits, ..assessment })
}

#[test]
fn the_bound_of_the_rate_of_a_fault_is_per_second() {
    let fault =
        "[[faults]]\nname = \"f\"\nactuator = \"u1\"\nbound = 2\nrate_bound = 0.5\nstep = 1\n";
    let text = MASS.replace("actuator_faults = \"all\"\n", "") + fault;
    let limits = TimeLimits { certificates: Duration::ZERO, ..TimeLimits::default() };
    let notes = |file: &PlantFile<'_>| {
        let report = report_within(file, &design(file).unwrap(), limits.clone()).unwrap();
        report.plant.faults[0].notes.clone()
    };
    let notes = read(&text, notes).unwrap();
    assert!(notes.ends_with(", at most 2, rate at most 0.5 per s, jumps by 1"), "{notes}");
}

/// The nominal trolley has a drag and a force, the member a spring, too; positions and speeds are exact.
#[test]
fn the_entries_of_a_member_of_a_family_vary_and_not_those_of_the_plant_of_the_file() {
    let text = MASS.replace("[0, 0]]", "[0, -0.5]]") + "[[family]]\nA = [[0, 1], [-2, -0.5]]\n";
    let limits = TimeLimits { certificates: Duration::ZERO, ..TimeLimits::default() };
    let varying = |file: &PlantFile<'_>| {
        let report = report_within(file, &design(file).unwrap(), limits.clone()).unwrap();
        let members = report.family.unwrap().members.into_iter();
        let tolerances = members.filter_map(|member| member.margins?.tolerance);
        tolerances.map(|tolerance| tolerance.entries).collect::<Vec<_>>()
    };
    assert_eq!(read(&text, varying).unwrap(), [2, 3]);
}

/// The proven fraction is below that of the worst case found, which is in one direction only; without time, or without
/// an entry that varies, the proof says so.
#[test]
fn a_fraction_of_the_tolerances_is_proven() {
    let proof = |text: &str, time: Duration| {
        let time = TimeLimits { certificates: time, ..TimeLimits::default() };
        let report = |file: &PlantFile<'_>| {
            report_within(file, &design(file).unwrap(), time.clone()).unwrap().robustness.unwrap()
        };
        let robustness = read(text, report).unwrap();
        let fraction = robustness.tolerance_proof.map(|proof| proof.fraction);
        // 16 is the largest multiple that is examined.
        (fraction, robustness.tolerance.first_unstable.min(16.0))
    };
    let damped = MASS.replace("[0, 0]]", "[-1, -0.5]]");
    let long = TimeLimits::default().certificates;
    for sampling in ["", "sample_time = 0.05\n"] {
        let one = "robustness.tolerance = { entries = { \"A[2][1]\" = 0.5 } }\n";
        let (fraction, first) = proof(&format!("{damped}{sampling}{one}"), long);
        let part = fraction.unwrap() / first;
        assert!((0.3..1.0).contains(&part), "{sampling}: {part} {first}");
        let (fraction, first) = proof(&format!("{damped}{sampling}"), long);
        let part = fraction.unwrap() / first;
        assert!((0.3..1.0).contains(&part), "{sampling}: {part} {first}");
    }
    let reason = |text: &str, time| proof(text, time).0.unwrap_err();
    let expected = "left out after 0 s, the time for the proof for the tolerances; \
                    --certificate-time allows more";
    assert_eq!(reason(&damped, Duration::ZERO), expected);
    let none = format!("{damped}robustness.tolerance = 0\n");
    assert_eq!(reason(&none, long), "not examined: no entry of the plant varies");
}

#[test]
fn without_time_for_certificates_the_report_says_what_is_left_out() {
    for text in [MASS.to_owned(), format!("{MASS}sample_time = 0.01\n")] {
        let [none, all] =
            [Duration::ZERO, TimeLimits::default().certificates].map(|certificates| {
                let limits = TimeLimits { certificates, ..TimeLimits::default() };
                let report = |file: &PlantFile<'_>| {
                    let designed = design(file).unwrap();
                    report_within(file, &designed, limits.clone()).unwrap()
                };
                read(&text, report).unwrap()
            });
        assert!(none.bounds.is_empty() && !all.bounds.is_empty());
        let refused = none.certificate.free.err().unwrap_or_default();
        assert!(refused.contains("left out after 0 s"), "{refused}");
        let sentence =
            format!("the bounds of {} states and errors were left out", all.bounds.len());
        assert!(none.warnings.iter().any(|warning| warning.starts_with(&sentence)));
        assert!(all.warnings.iter().all(|warning| !warning.contains("left out")));
        assert_eq!(none.verdict.level, all.verdict.level);
    }
}

/// The reader of plant files refuses a law that another table excludes.
#[test]
fn a_comparison_has_results_only_of_laws_that_the_plant_file_may_name() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reference/plant-file");
    for name in ["family.toml", "reconfiguration.toml"] {
        let path = folder.join(name);
        let text = std::fs::read_to_string(&path).unwrap();
        let mut laws = crate::compare(&path).unwrap().laws;
        laws.retain(|law| law.result.is_some());
        assert!(!laws.is_empty(), "{name}");
        for law in laws {
            let stated = format!("{text}\n[estimation]\nlaw = \"{}\"\n", law.law);
            read(&stated, |_| ()).expect(name);
        }
    }
}

/// `BLESS=1 cargo test -p aso-design --lib schema` writes the file.
#[test]
fn the_schema_in_the_book_is_that_of_the_report() {
    let file =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reference/design.schema.json");
    let expected = serde_json::to_string_pretty(&crate::report::schema()).unwrap() + "\n";
    if std::env::var_os("BLESS").is_some() {
        std::fs::write(&file, &expected).unwrap();
    }
    assert_eq!(std::fs::read_to_string(&file).unwrap(), expected);
}

/// A plant file for a chain of masses with dampers, forces on every tenth mass, positions of every
/// tenth, and one fault.
fn chain(masses: usize) -> String {
    let n = 2 * masses;
    let row = |row: usize| -> Vec<f64> {
        let mut entries = vec![0.0; n];
        if row < masses {
            entries[masses + row] = 1.0;
            return entries;
        }
        let mass = row - masses;
        entries[mass] = -2.0;
        entries[row] = -0.1;
        if mass > 0 {
            entries[mass - 1] = 1.0;
        }
        if mass + 1 < masses {
            entries[mass + 1] = 1.0;
        }
        entries
    };
    let a: Vec<_> = (0..n).map(row).collect();
    let at = |mass: usize| (4..masses).step_by(10).position(|other| other == mass);
    let count = (4..masses).step_by(10).count();
    let unit = |at: Option<usize>| -> Vec<f64> {
        (0..count).map(|k| if Some(k) == at { 1.0 } else { 0.0 }).collect()
    };
    let b: Vec<_> = (0..n).map(|row| unit(row.checked_sub(masses).and_then(at))).collect();
    let c: Vec<Vec<f64>> = (0..count)
        .map(|k| (0..n).map(|i| if i == 4 + 10 * k { 1.0 } else { 0.0 }).collect())
        .collect();
    let [q, r, w, v] = [n, count, n + 1, count].map(|length| vec![1.0; length]);
    format!(
        "A = {a:?}\nB = {b:?}\nC = {c:?}\nfeedback.Q = {q:?}\nfeedback.R = {r:?}\n\
         observer.W = {w:?}\nobserver.V = {v:?}\n[[faults]]\nname = \"f\"\nactuator = \"u1\"\nbound = 1.0\n"
    )
}

#[test]
fn fifty_states_get_a_linear_quadratic_design_without_linear_matrix_inequalities() {
    let text = chain(25);
    let (instability, certificate) = read(&text, |file| {
        let designed = design(file).unwrap();
        let budget = TimeLimits::default().of_certificates();
        (
            designed.nominal.instability,
            crate::assess::certificate::certificate(&designed.nominal, vec![], &budget),
        )
    })
    .unwrap();
    assert!(instability < 0.0, "{instability}");
    assert!(certificate.printed.is_ok());
    let refused = certificate.free.err().unwrap();
    let expected =
        "linear matrix inequalities are solved for up to 30 states of the observer, found 51";
    assert_eq!(refused, expected);
}

fn unobserved() -> crate::progress::Steps<'static> {
    crate::progress::Steps::new(&|_| {})
}

#[test]
fn each_step_of_a_design_is_reported_once_with_the_part_that_is_done() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let steps_done = std::sync::Mutex::new(Vec::new());
    let observe = |step| steps_done.lock().unwrap().push(step);
    let plant = root.join("fmu-controller/pendulum.toml");
    crate::design_within(&plant, &TimeLimits::default(), &observe).unwrap();
    let reported = steps_done.into_inner().unwrap();
    let mut names: Vec<_> = reported.iter().map(|step| step.step).collect();
    assert_eq!((names.len(), names[0]), (10, "gains"), "{names:?}");
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), 10);
    assert!(reported.iter().all(|step| (0.0..1.0).contains(&step.done)), "{reported:?}");
    assert!(reported[9].done > 0.5);
}

/// Lags that do not act on each other, each with an actuator that may lose its effect.
#[test]
fn each_of_ten_actuators_has_the_largest_stable_loss_of_one_alone() {
    let losses = |rates: &[f64]| {
        let count = rates.len();
        let diagonal = |entry: &dyn Fn(usize) -> f64| -> Vec<Vec<f64>> {
            let row = |i| (0..count).map(|j| if i == j { entry(i) } else { 0.0 }).collect();
            (0..count).map(row).collect()
        };
        let (a, b) = (diagonal(&|i| -rates[i]), diagonal(&|_| 1.0));
        let [q, w] = [count, 2 * count].map(|length| vec![1.0; length]);
        let faults = (1..=count).map(|k| {
            format!("[[faults]]\nname = \"f{k}\"\nloss_of = \"u{k}\"\nleast_command = 0.5\n")
        });
        let faults = faults.collect::<String>();
        let text = format!(
            "A = {a:?}\nB = {b:?}\nC = {b:?}\nfeedback.Q = {q:?}\nfeedback.R = {q:?}\n\
             observer.W = {w:?}\nobserver.V = {q:?}\n{faults}"
        );
        let losses = |file: &PlantFile<'_>| effectiveness(&design(file).unwrap().nominal).unwrap();
        read(&text, losses).unwrap()
    };
    let rates: Vec<f64> = (0..10).map(|k| 1.0 + 0.25 * f64::from(k)).collect();
    let together = losses(&rates);
    assert_eq!(together.len(), 10);
    for (rate, loss) in rates.iter().zip(together) {
        let (loss, alone) = (loss.largest_stable_loss, losses(&[*rate])[0].largest_stable_loss);
        assert!(alone > 0.5 && (loss - alone).abs() < 1e-6, "{rate}: {loss}, alone {alone}");
    }
}

/// From the fault to y: (10 s + 1) / (s^2 + s + 1). The observer has s^3 + 18 s^2 + 107 s + 210 with the estimate, and
/// s^2 + 18 s + 107 - 10 * 210 while it is held.
#[test]
fn a_loop_that_is_unstable_without_any_loss_is_so_from_a_loss_of_zero_on() {
    let text = "A = [[0, 1], [-1, -1]]\nB = [[0], [1]]\nC = [[1, 10]]\n\
                feedback.eigenvalues = [-1, -2]\nobserver.eigenvalues = [-5, -6, -7]\n\
                [[faults]]\nname = \"f\"\nloss_of = \"u1\"\nleast_command = 0.5\nup_to = 0.3\n";
    let reasons = read(text, |file| {
        let budget = TimeLimits { certificates: Duration::ZERO, ..TimeLimits::default() };
        let nominal = design(file).unwrap().nominal;
        let report = crate::assess::losses::losses(&nominal, &budget.of_certificates()).unwrap();
        crate::assess::losses::reasons(&report.unwrap())
    });
    let expected = "constant losses of effectiveness within the stated range make the loop unstable, \
                    compensation off: from u1 0 on (amber)";
    let reasons = reasons.unwrap();
    assert!(reasons.iter().any(|(_, reason)| reason == expected), "{reasons:?}");
}
