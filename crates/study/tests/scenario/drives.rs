//! The values that slaves receive from settings, signals and tables.

use std::path::Path;

use super::{Calls, of_fmi_3, scenario, setup, system};

/// Returns the calls that `plant` receives at the communication points `times`; leaves out points
/// without calls.
fn calls(text: &str, folder: &Path, times: &[f64]) -> Vec<(f64, Vec<String>)> {
    let (mut system, plant, ctrl) = system();
    let mut prepared = scenario(text).resolve(&system, &setup(folder)).unwrap();
    let mut all = Vec::new();
    for (position, &time) in times.iter().enumerate() {
        prepared.scenario.drives.write(&mut system, time).unwrap();
        let noted = take(&plant);
        if !noted.is_empty() {
            all.push((time, noted));
        }
        let end = times.get(position + 1).copied().unwrap_or(time);
        prepared.scenario.drives.commit(end);
    }
    assert!(take(&ctrl).is_empty());
    all
}

fn take(calls: &Calls) -> Vec<String> {
    std::mem::take(&mut *calls.lock().unwrap())
}

fn here() -> &'static Path {
    Path::new(".")
}

const TIMES: [f64; 6] = [0.0, 0.5, 1.0, 1.5, 2.0, 2.5];

fn expect(calls: &[(f64, Vec<String>)], expected: &[(f64, &[&str])]) {
    let calls: Vec<(f64, Vec<&str>)> =
        calls.iter().map(|(time, all)| (*time, all.iter().map(String::as_str).collect())).collect();
    let expected: Vec<_> = expected.iter().map(|(time, all)| (*time, all.to_vec())).collect();
    assert_eq!(calls, expected);
}

#[test]
fn a_setting_takes_effect_once_at_the_first_communication_point_not_before_its_time() {
    let text = r#"
        [[scenario.set]]
        variable = "plant.F_c"
        at = 1.75
        value = 20
        [[scenario.set]]
        variable = "plant.F_c"
        at = 0.5
        value = 10.5"#;
    let expected: [(f64, &[&str]); 2] = [(0.5, &["real [8] [10.5]"]), (2.0, &["real [8] [20.0]"])];
    expect(&calls(text, here(), &TIMES), &expected);
}

#[test]
fn of_two_settings_at_one_time_the_one_stated_last_holds() {
    let text = r#"
        scenario.set = [
            { variable = "plant.level", at = 1, value = 3 },
            { variable = "plant.level", at = 1, value = 4 },
        ]"#;
    expect(&calls(text, here(), &TIMES), &[(1.0, &["real [3] [4.0]"])]);
}

#[test]
fn variables_of_every_type_can_be_set() {
    let text = r#"
        [scenario]
        set = [
            { variable = "plant.mode", at = 1, value = "run" },
            { variable = "plant.on", at = 1, value = true },
            { variable = "plant.gear", at = 1, value = "reverse" },
            { variable = "plant.count", at = 1, value = -3 },
            { variable = "plant.force", at = 1, value = 2 },
            { variable = "plant.mode", at = 2, value = "idle" },
            { variable = "plant.gear", at = 2, value = 2 },
        ]"#;
    let first: &[&str] = &[
        "real [1] [2.0]",
        "derivative [1] [0.0]",
        "integer [5, 4] [-1, -3]",
        "boolean [6] [1]",
        "string [7] [\"run\"]",
    ];
    let second: &[&str] = &["integer [5] [2]", "string [7] [\"idle\"]"];
    expect(&calls(text, here(), &TIMES), &[(1.0, first), (2.0, second)]);
}

#[test]
fn a_continuous_input_receives_a_ramp_with_its_derivative_if_the_fmu_takes_derivatives() {
    let text = r#"
        [[scenario.signal]]
        variable = "plant.force"
        ramp = { from = 0.5, until = 1.5, begin = 1, end = 3 }
        [[scenario.signal]]
        variable = "plant.level"
        ramp = { from = 0.5, until = 1.5, begin = 0, end = -1 }"#;
    let expected: [(f64, &[&str]); 4] = [
        (0.0, &["real [1, 3] [1.0, 0.0]", "derivative [1] [0.0]"]),
        (0.5, &["real [1, 3] [1.0, 0.0]", "derivative [1] [2.0]"]),
        (1.0, &["real [1, 3] [2.0, -0.5]", "derivative [1] [2.0]"]),
        (1.5, &["real [1, 3] [3.0, -1.0]", "derivative [1] [0.0]"]),
    ];
    expect(&calls(text, here(), &TIMES), &expected);
}

#[test]
fn values_are_converted_from_the_unit_stated() {
    let text = r#"
        [[scenario.signal]]
        variable = "plant.angle"
        unit = "deg"
        points = [[0, 0], [1, 180], [1, 90]]
        [[scenario.set]]
        variable = "plant.F_c"
        at = 0
        value = 2
        unit = "kN"
        [[scenario.signal]]
        variable = "plant.temperature"
        unit = "K"
        constant = 300"#;
    let actual = calls(text, here(), &[0.0, 1.0]);
    let numbers = |line: &str| -> Vec<f64> {
        let inside = line.rsplit_once('[').unwrap().1.trim_end_matches(']');
        inside.split(", ").map(|number| number.parse().unwrap()).collect()
    };
    assert!(actual[0].1[0].starts_with("real [8, 2, 12] "), "{actual:?}");
    let values = numbers(&actual[0].1[0]);
    assert_eq!(values[..2], [2000.0, 0.0]);
    assert!((values[2] - 26.85).abs() < 1e-12, "{values:?}");
    assert!(actual[0].1[1].starts_with("derivative [2, 12] "), "{actual:?}");
    let slopes = numbers(&actual[0].1[1]);
    assert!((slopes[0] - std::f64::consts::PI).abs() < 1e-14 && slopes[1] == 0.0, "{slopes:?}");
    assert!(
        (numbers(&actual[1].1[0])[0] - std::f64::consts::FRAC_PI_2).abs() < 1e-15,
        "{actual:?}"
    );
}

#[test]
fn columns_of_a_file_are_lines_for_continuous_reals_and_held_for_the_others() {
    let folder = tempfile::tempdir().unwrap();
    let text = "\"time\",\"force\",\"level\",\"count\",\"on\",\"y\",\"other\"\n\
                0,0,0,1,0,9,9\n1,2,2,2,1,9,9\n2,2,4,3,1,9,9\n";
    std::fs::write(folder.path().join("inputs.csv"), text).unwrap();
    let text = r#"
        [[scenario.table]]
        csv = "inputs.csv"
        element = "plant""#;
    let expected: [(f64, &[&str]); 4] = [
        (
            0.0,
            &[
                "real [1, 3] [0.0, 0.0]",
                "derivative [1] [2.0]",
                "integer [4] [1]",
                "boolean [6] [0]",
            ],
        ),
        (0.5, &["real [1] [1.0]", "derivative [1] [2.0]"]),
        (
            1.0,
            &[
                "real [1, 3] [2.0, 2.0]",
                "derivative [1] [0.0]",
                "integer [4] [2]",
                "boolean [6] [1]",
            ],
        ),
        (2.0, &["real [3] [4.0]", "integer [4] [3]"]),
    ];
    expect(&calls(text, folder.path(), &TIMES), &expected);
    let prepared = scenario(text).resolve(&system().0, &setup(folder.path())).unwrap();
    let unused: Vec<_> = prepared.unused.iter().map(|(_, name)| name.as_str()).collect();
    assert_eq!(unused, ["y", "other"]);
}

#[test]
fn an_entry_of_its_own_goes_before_a_table_and_a_column_may_be_held_or_chosen() {
    let folder = tempfile::tempdir().unwrap();
    let text = "time,plant.force,plant.level,a\n0,1,1,5\n2,3,3,7\n";
    std::fs::write(folder.path().join("inputs.csv"), text).unwrap();
    let text = r#"
        [[scenario.table]]
        csv = "inputs.csv"
        [[scenario.signal]]
        variable = "plant.force"
        csv = { file = "inputs.csv", hold = true }
        [[scenario.signal]]
        variable = "plant.angle"
        csv = { file = "inputs.csv", column = "a" }"#;
    let expected: [(f64, &[&str]); 3] = [
        (0.0, &["real [1, 2, 3] [1.0, 5.0, 1.0]", "derivative [1, 2] [0.0, 1.0]"]),
        (1.0, &["real [2] [6.0]", "derivative [2] [1.0]"]),
        (2.0, &["real [1, 2, 3] [3.0, 7.0, 3.0]", "derivative [1, 2] [0.0, 0.0]"]),
    ];
    expect(&calls(text, folder.path(), &[0.0, 1.0, 2.0]), &expected);
}

#[test]
fn integers_of_every_width_follow_a_file_within_their_range() {
    let folder = tempfile::tempdir().unwrap();
    let write = |text: &str| std::fs::write(folder.path().join("in.csv"), text).unwrap();
    let text = "[[scenario.table]]\ncsv = \"in.csv\"\nelement = \"fmu\"\n";
    let resolve = |system: &master::System| scenario(text).resolve(system, &setup(folder.path()));
    let (mut system, calls) = of_fmi_3();
    write("time,small,large,wide,single\n0,-128,4294967295,-9007199254740991,0\n1,127,0,5,1\n");
    let mut prepared = resolve(&system).unwrap();
    prepared.scenario.drives.write(&mut system, 0.5).unwrap();
    let set = ["real [4] [0.5]", "integer [1, 2, 3] [-128, 4294967295, -9007199254740991]"];
    assert_eq!(take(&calls), set);
    for (name, value, expected) in [
        ("small", "128", "a whole number from -128 to 127"),
        ("large", "4294967296", "a whole number from 0 to 4294967295"),
        // 2^53 + 1, which is rounded to 2^53.
        ("wide", "9007199254740993", "a whole number from -9007199254740991 to 9007199254740991"),
    ] {
        write(&format!("time,{name}\n0,{value}\n"));
        let refused = resolve(&system).unwrap_err().to_string();
        assert!(refused.contains(&format!("expected {expected}")), "{refused}");
    }
}

/// A bias need not be a value of the input, such as -1 for a `UInt32`.
#[test]
fn the_sum_with_a_bias_is_limited_to_the_range_of_an_integer() {
    let (mut system, calls) = of_fmi_3();
    let text = r#"
        scenario.signal = [
            { variable = "fmu.small", constant = 100 },
            { variable = "fmu.large", constant = 5 },
        ]
        scenario.fault = [
            { connection = "fmu.small", bias = { value = 200 } },
            { connection = "fmu.large", bias = { value = -1 } },
        ]"#;
    let mut prepared = scenario(text).resolve(&system, &setup(here())).unwrap();
    prepared.scenario.drives.write(&mut system, 0.5).unwrap();
    assert_eq!(take(&calls), ["integer [1, 2] [127, 4]"]);
}

/// 2^40 is a double, 2^53 + 1 is not.
#[test]
fn an_item_of_more_than_32_bits_is_set_by_its_name() {
    let set = |item: &str| {
        let entry = format!("variable = \"fmu.size\", at = 0, value = \"{item}\"");
        scenario(&format!("scenario.set = [{{ {entry} }}]"))
    };
    let (mut system, calls) = of_fmi_3();
    let mut prepared = set("huge").resolve(&system, &setup(here())).unwrap();
    prepared.scenario.drives.write(&mut system, 0.0).unwrap();
    assert_eq!(take(&calls), ["integer [6] [1099511627776]"]);
    let refused = set("beyond").resolve(&system, &setup(here())).unwrap_err().to_string();
    assert!(refused.ends_with("expected a whole number or one of small, huge"), "{refused}");
}

#[test]
fn the_unit_of_a_value_is_converted_to_that_of_a_float32() {
    let (mut system, calls) = of_fmi_3();
    let text = r#"scenario.set = [{ variable = "fmu.single", at = 0, value = 5, unit = "km" }]"#;
    let mut prepared = scenario(text).resolve(&system, &setup(here())).unwrap();
    prepared.scenario.drives.write(&mut system, 0.0).unwrap();
    assert_eq!(take(&calls), ["real [4] [5000.0]"]);
}

#[test]
fn a_difference_of_5_kelvin_is_one_of_5_degrees_celsius() {
    let (mut system, calls) = of_fmi_3();
    let text = r#"scenario.set = [{ variable = "fmu.rise", at = 0, value = 5, unit = "K" }]"#;
    let mut prepared = scenario(text).resolve(&system, &setup(here())).unwrap();
    prepared.scenario.drives.write(&mut system, 0.0).unwrap();
    assert_eq!(take(&calls), ["real [5] [5.0]"]);
}

#[test]
fn a_variable_and_its_alias_are_driven_as_one() {
    let (mut system, calls) = of_fmi_3();
    let text = r#"
        scenario.set = [
            { variable = "fmu.single", at = 0, value = 1 },
            { variable = "fmu.also single", at = 1, value = 2 },
        ]"#;
    let mut prepared = scenario(text).resolve(&system, &setup(here())).unwrap();
    for (time, call) in [(0.0, "real [4] [1.0]"), (1.0, "real [4] [2.0]")] {
        prepared.scenario.drives.write(&mut system, time).unwrap();
        assert_eq!(take(&calls), [call]);
    }
    let signal = "\nscenario.signal = [{ variable = \"fmu.also single\", constant = 3 }]";
    let twice = scenario(&(text.to_owned() + signal)).resolve(&system, &setup(here()));
    let expected = "scenario.signal[1]: fmu.also single is driven twice, also by scenario.set[1]";
    assert_eq!(twice.unwrap_err().to_string(), expected);
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("in.csv"), "time,single,also single\n0,4,5\n").unwrap();
    let table = scenario("scenario.table = [{ csv = \"in.csv\", element = \"fmu\" }]");
    let mut prepared = table.resolve(&system, &setup(folder.path())).unwrap();
    prepared.scenario.drives.write(&mut system, 0.0).unwrap();
    assert_eq!(take(&calls), ["real [4] [4.0]"]);
    assert_eq!(prepared.unused[0].1, "also single");
}

#[test]
fn a_repeated_step_sets_its_values_again() {
    let (mut system, plant, _) = system();
    let text = r#"scenario.set = [{ variable = "plant.F_c", at = 1, value = 7 }]"#;
    let mut prepared = scenario(text).resolve(&system, &setup(here())).unwrap();
    let drives = &mut prepared.scenario.drives;
    drives.write(&mut system, 0.0).unwrap();
    drives.commit(1.0);
    for trial in 0..3 {
        drives.write(&mut system, 1.0).unwrap();
        assert_eq!(take(&plant), ["real [8] [7.0]"], "trial {trial}");
    }
    drives.commit(2.0);
    drives.write(&mut system, 2.0).unwrap();
    assert!(take(&plant).is_empty());
    // The checkpoint of the FMU holds the value, so it is not set again.
    let state = drives.state();
    let mut resumed = scenario(text).resolve(&system, &setup(here())).unwrap();
    resumed.scenario.drives.restore(state).unwrap();
    resumed.scenario.drives.write(&mut system, 2.0).unwrap();
    assert!(take(&plant).is_empty());
}

#[test]
fn steps_can_end_at_breaks_of_signals_and_settings() {
    let text = r#"
        [scenario]
        set = [{ variable = "plant.F_c", at = 1.25, value = 7 }]
        [[scenario.signal]]
        variable = "plant.force"
        steps = [[0, 1], [0.3, 2], [4, 2], [5, 0]]
        [[scenario.fault]]
        connection = "plant.force"
        bias = { value = 1, from = 0.7, until = 2 }"#;
    let prepared = scenario(text).resolve(&system().0, &setup(here())).unwrap();
    let next = |&last: &f64| prepared.scenario.drives.next_break(last);
    let actual: Vec<_> = std::iter::successors(next(&0.0), next).collect();
    assert_eq!(actual, [0.3, 0.7, 1.25, 2.0, 5.0]);
}
