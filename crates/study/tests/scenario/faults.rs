//! Faults, read from a file.

use std::path::Path;

use allocation_counter::measure;
use master::drive::DriveState;
use master::fault::FaultChain;
use study::scenario::ResolvedScenario;

use super::{listener, of_fmi_3, resolve, scenario, setup, system};

fn lines(text: &str) -> Vec<(String, FaultChain)> {
    let system = system().0;
    let faults = scenario(text).resolve(&system, &setup(Path::new("."))).unwrap().scenario.faults;
    faults.into_iter().map(|(port, line)| (system.name(port), line)).collect()
}

fn line(body: &str) -> FaultChain {
    let text = format!("[[scenario.fault]]\nconnection = \"ctrl.force\"\n{body}\n");
    lines(&text).remove(0).1
}

/// Returns the disturbed values of 1, 2, 3, .. at 0 s, 0.5 s, 1 s, ..
fn series(mut line: FaultChain) -> [f64; 6] {
    [0, 1, 2, 3, 4, 5].map(|step: u8| {
        let (time, value) = (0.5 * f64::from(step), 1.0 + f64::from(step));
        let arrived = line.apply(time, value);
        line.commit(time, value);
        arrived
    })
}

#[test]
fn each_kind_of_fault_changes_the_value_by_its_formula() {
    for (body, expected) in [
        ("bias = { value = 0.5, from = 1 }", [1.0, 2.0, 3.5, 4.5, 5.5, 6.5]),
        ("gain = { factor = 2, until = 1 }", [2.0, 4.0, 3.0, 4.0, 5.0, 6.0]),
        ("drift = { rate = 2, from = 0.5, until = 2 }", [1.0, 2.0, 4.0, 6.0, 5.0, 6.0]),
        ("stuck = { from = 1 }", [1.0, 2.0, 3.0, 3.0, 3.0, 3.0]),
        ("stuck = { value = -1, from = 1, until = 2 }", [1.0, 2.0, -1.0, -1.0, 5.0, 6.0]),
        ("dropout = { from = 1, until = 2 }", [1.0, 2.0, 2.0, 2.0, 5.0, 6.0]),
        ("dropout = { value = 0, from = 1, until = 2 }", [1.0, 2.0, 0.0, 0.0, 5.0, 6.0]),
        ("dropout = { period = 1, lost = 0.4 }", [1.0, 2.0, 2.0, 4.0, 4.0, 6.0]),
        ("dropout = { probability = 1, from = 1 }", [1.0, 2.0, 2.0, 2.0, 2.0, 2.0]),
        ("delay = { seconds = 0.75 }", [1.0, 1.0, 1.5, 2.5, 3.5, 4.5]),
        ("delay = { seconds = 0.75, hold = true, initial = 9 }", [9.0, 9.0, 1.0, 2.0, 3.0, 4.0]),
        ("quantisation = { step = 2 }", [2.0, 2.0, 4.0, 4.0, 6.0, 6.0]),
        ("quantisation = { step = 4, offset = 1 }", [1.0, 1.0, 5.0, 5.0, 5.0, 5.0]),
        ("saturation = { min = 2, max = 4, from = 0 }", [2.0, 2.0, 3.0, 4.0, 4.0, 4.0]),
        ("saturation = { max = 4 }", [1.0, 2.0, 3.0, 4.0, 4.0, 4.0]),
    ] {
        assert_eq!(series(line(body)), expected, "{body}");
    }
}

#[test]
fn an_alias_of_the_connected_output_names_the_connection_too() {
    let mut system = of_fmi_3().0;
    system.add("other", listener(false).0).unwrap();
    system.connect("fmu.y", "other.force").unwrap();
    for source in ["fmu.y", "fmu.also y"] {
        let text = format!(
            "[[scenario.fault]]\nconnection = \"{source}=other.force\"\nbias = {{ value = 1 }}"
        );
        let resolved = scenario(&text).resolve(&system, &setup(Path::new("."))).unwrap();
        assert_eq!(system.name(resolved.scenario.faults[0].0), "other.force");
    }
}

#[test]
fn values_of_faults_are_in_the_unit_stated() {
    for (body, expected) in [
        ("unit = \"kN\"\nbias = { value = 0.002 }", [3.0, 4.0, 5.0, 6.0, 7.0, 8.0]),
        ("unit = \"kN\"\nstuck = { value = 0.002 }", [2.0; 6]),
        ("unit = \"kN\"\nquantisation = { step = 0.002 }", [2.0, 2.0, 4.0, 4.0, 6.0, 6.0]),
        ("unit = \"kN\"\nsaturation = { max = 0.004 }", [1.0, 2.0, 3.0, 4.0, 4.0, 4.0]),
    ] {
        assert_eq!(series(line(body)), expected, "{body}");
    }
    // A difference has no offset: 1 K is 1 degC.
    let text = r#"
        [[scenario.signal]]
        variable = "plant.temperature"
        constant = 20
        [[scenario.fault]]
        connection = "plant.temperature"
        unit = "K"
        bias = { value = 1 }"#;
    let mut prepared = resolve(text).unwrap();
    let sample = prepared.scenario.drives.iter_mut().next().unwrap().sample(0.0).unwrap();
    assert_eq!(sample.value, 21.0);
}

#[test]
fn a_connection_is_named_by_its_input_or_by_both_ends() {
    for name in ["ctrl.force", "plant.y=ctrl.force", " plant.y = ctrl.force "] {
        let text = format!("scenario.fault = [{{ connection = \"{name}\", stuck = {{}} }}]");
        let actual = lines(&text);
        assert_eq!(actual.len(), 1);
        assert_eq!(actual[0].0, "ctrl.force");
    }
}

#[test]
fn faults_of_one_connection_act_in_the_order_of_the_file() {
    let text = r#"
        [[scenario.fault]]
        connection = "ctrl.force"
        bias = { value = 1 }
        [[scenario.fault]]
        connection = "ctrl.angle"
        bias = { value = 100 }
        [[scenario.fault]]
        connection = "ctrl.force"
        gain = { factor = 10 }"#;
    let mut actual = lines(text);
    assert_eq!(actual.len(), 2);
    assert_eq!(actual.remove(0).1.apply(0.0, 2.0), 30.0);
    assert_eq!(actual.remove(0).1.apply(0.0, 2.0), 102.0);
}

#[test]
fn equal_noise_on_two_connections_is_independent_and_the_seed_is_all_that_it_depends_on() {
    let text = |name: &str, seed: u64| {
        format!(
            "[[scenario.fault]]\nconnection = \"ctrl.{name}\"\n\
             noise = {{ deviation = 1, seed = {seed} }}\n"
        )
    };
    let value = |text: &str| lines(text).remove(0).1.apply(0.25, 0.0);
    assert_eq!(value(&text("force", 3)), value(&text("force", 3)));
    assert_ne!(value(&text("force", 3)), value(&text("force", 4)));
    assert_ne!(value(&text("force", 3)), value(&text("angle", 3)));
    // Other entries of the file change nothing.
    let after = format!("{}{}", text("angle", 3), text("force", 3));
    assert_eq!(lines(&after).remove(1).1.apply(0.25, 0.0), value(&text("force", 3)));
}

#[test]
fn integers_are_disturbed_as_integers() {
    let text = r#"
        [[scenario.fault]]
        connection = "ctrl.count"
        delay = { seconds = 0.75 }
        [[scenario.fault]]
        connection = "ctrl.count"
        bias = { value = -2 }"#;
    let mut line = lines(text).remove(0).1;
    let actual = [4, 8, 16, 32].map(|value| {
        let time = 0.5 * f64::from(value).log2() - 1.0;
        let arrived = line.apply_integer(time, value.into());
        line.commit(time, f64::from(value));
        arrived
    });
    assert_eq!(actual, [2, 2, 2, 6]);
}

/// Serialises and deserialises the state of the drives.
fn checkpoint(prepared: &ResolvedScenario) -> Vec<DriveState> {
    postcard::from_bytes(&postcard::to_allocvec(&prepared.scenario.drives.state()).unwrap())
        .unwrap()
}

#[test]
fn a_checkpoint_of_another_scenario_is_refused() {
    let of = |scenario: &str| resolve(scenario).unwrap();
    let mut other = of("[scenario]");
    let one = of("scenario.signal = [{ variable = \"plant.force\", constant = 1 }]");
    let actual = other.scenario.drives.restore(checkpoint(&one)).unwrap_err().to_string();
    assert_eq!(actual, "the checkpoint is of 1 driven variables, expected 0 as in the scenario");
}

#[test]
fn a_signal_can_have_a_fault_and_continue_from_a_checkpoint() {
    let text = r#"
        [[scenario.signal]]
        variable = "plant.force"
        points = [[0, 0], [8, 8]]
        [[scenario.fault]]
        connection = "plant.force"
        stuck = { from = 2, until = 4 }"#;
    let mut prepared = resolve(text).unwrap();
    assert!(prepared.scenario.faults.is_empty());
    let arrived = |prepared: &mut ResolvedScenario, time| {
        let sample = prepared.scenario.drives.iter_mut().next().unwrap().sample(time).unwrap();
        prepared.scenario.drives.commit(time);
        (sample.value, sample.slope)
    };
    let actual = [1.0, 2.0, 3.0].map(|time| arrived(&mut prepared, time));
    assert_eq!(actual, [(1.0, 1.0), (2.0, 0.0), (2.0, 0.0)]);
    let mut resumed = resolve(text).unwrap();
    resumed.scenario.drives.restore(checkpoint(&prepared)).unwrap();
    let actual = [3.5, 4.0].map(|time| arrived(&mut resumed, time));
    assert_eq!(actual, [(2.0, 0.0), (4.0, 1.0)]);
}

#[test]
fn no_memory_is_allocated_between_the_steps() {
    let text = r#"
        [[scenario.signal]]
        variable = "plant.angle"
        points = [[0, 0], [3, 1], [3, 2], [9, 1]]
        [[scenario.fault]]
        connection = "plant.angle"
        dropout = { probability = 0.5 }"#;
    let disturbed = |name: &str| {
        [
            "bias = { value = 1 }",
            "stuck = { from = 90 }",
            "delay = { seconds = 7 }",
            "dropout = { probability = 0.1 }",
            "noise = { deviation = 1, every = 0.1 }",
            "noise = { amplitude = 1 }",
            "quantisation = { step = 0.1 }",
        ]
        .map(|body| format!("\n[[scenario.fault]]\nconnection = \"{name}\"\n{body}\n"))
        .concat()
    };
    let text = format!("{text}{}", disturbed("ctrl.force"));
    let mut prepared = resolve(&text).unwrap();
    let line = &mut prepared.scenario.faults[0].1;
    let bytes = postcard::to_allocvec(line).unwrap();
    let mut restored: FaultChain = postcard::from_bytes(&bytes).unwrap();
    let drives = &mut prepared.scenario.drives;
    let counted = measure(|| {
        let mut time = 0.0;
        while time < 100.0 {
            for line in [&mut *line, &mut restored] {
                std::hint::black_box(line.apply(time, time));
                line.commit(time, time);
                std::hint::black_box(line.next_break(time));
            }
            for drive in drives.iter_mut() {
                std::hint::black_box(drive.sample(time));
            }
            drives.commit(time);
            std::hint::black_box(drives.next_break(time));
            // Steps from far below to far above the expected 0.5 s.
            time += if time < 20.0 { 0.01 } else { 0.9 };
        }
    });
    assert_eq!(counted.count_total, 0);
}
