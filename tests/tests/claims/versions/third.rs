//! FMI 3.0.

use fmu_description::Experiment;
use fmu_import::Fmu;
use master::{Failure, Slave, StepResult};
use tests::c_versions;

use super::Loaded;

fn ready(token: &str) -> Loaded {
    Loaded::third(token).initialised()
}

#[test]
fn an_array_is_set_and_read_whole_or_by_element() {
    let mut loaded = ready("plain");
    let whole = ["a[1]", "a[2]"].map(|name| loaded.reference(name));
    loaded.slave.set_real(&whole, &[3.0, 4.0]).unwrap();
    loaded.set_real("a[2]", 5.0);
    assert_eq!(loaded.step(0.0, 0.1), Ok(StepResult::Whole));
    let list = ["b[2]", "u", "a[1]", "b[1]"].map(|name| loaded.reference(name));
    let mut values = [0.0; 4];
    loaded.slave.get_real(&list, &mut values).unwrap();
    assert_eq!(values, [10.0, 1.0, 3.0, 6.0]);
}

#[test]
fn the_elements_of_a_matrix_are_in_row_major_order() {
    let mut loaded = Loaded::third("plain");
    loaded.set_real("M[1,3]", 30.0);
    loaded.set_real("M[2,1]", 40.0);
    let mut loaded = loaded.initialised();
    assert_eq!(loaded.real("M[1,2]"), 2.0);
    assert_eq!(loaded.real("M[1,3]"), 30.0);
    assert_eq!(loaded.real("M[2,1]"), 40.0);
    assert_eq!(loaded.real("sum"), 1.0 + 2.0 + 30.0 + 40.0 + 5.0 + 6.0);
}

#[test]
fn a_structural_parameter_changes_the_size_of_arrays() {
    let mut loaded = Loaded::third("plain");
    let size = loaded.reference("n");
    loaded.slave.configure(&[size], &[4]).unwrap();
    let mut loaded = loaded.initialised();
    loaded.set_real("a[4]", 1.5);
    assert_eq!(loaded.step(0.0, 0.1), Ok(StepResult::Whole));
    assert_eq!(loaded.real("b[4]"), 3.0);
    let names = loaded.slave.description().variables.iter().map(|variable| variable.name.as_str());
    assert_eq!(names.filter(|name| name.starts_with("b[")).count(), 4);
}

/// The FMU ends the process if it is in Configuration Mode already.
#[test]
fn after_a_refused_size_another_one_is_set() {
    let mut loaded = Loaded::third("plain");
    let size = loaded.reference("n");
    let error = loaded.slave.configure(&[size], &[-1]).unwrap_err();
    assert!(error.to_string().contains("cannot take the value -1 for n"), "{error}");
    loaded.slave.configure(&[size], &[4]).unwrap();
    loaded.initialised().set_real("a[4]", 1.5);
}

/// A state has the values of its arrays.
#[test]
fn a_state_from_before_a_change_of_sizes_is_discarded() {
    let mut loaded = Loaded::third("plain");
    let size = loaded.reference("n");
    loaded.slave.save_state(0).unwrap();
    loaded.slave.configure(&[size], &[4]).unwrap();
    let error = loaded.slave.restore_state(0).unwrap_err().to_string();
    assert!(error.contains("the slot is empty"), "{error}");
    loaded.slave.save_state(0).unwrap();
    loaded.slave.restore_state(0).unwrap();
    loaded.initialised().set_real("a[4]", 1.5);
}

#[test]
fn events_within_a_step_are_handled_and_the_step_is_finished() {
    let mut loaded = Loaded::third("plain");
    loaded.set_real("level", 0.45);
    let mut loaded = loaded.initialised();
    assert_eq!(loaded.step(0.0, 1.0), Ok(StepResult::Whole));
    // 10 ticks after 0 s, 0.25 s and 0.75 s, and the state event.
    assert_eq!(loaded.integer("events"), 13);
    assert!((loaded.real("y") - 1.0).abs() < 1e-12);
}

#[test]
fn a_periodic_clock_ticks_from_the_start_and_sets_clocked_inputs_at_its_ticks() {
    let mut loaded = ready("plain");
    assert_eq!(loaded.integer("ticks"), 1);
    loaded.set_integer("weight", 10);
    assert_eq!(loaded.step(0.0, 0.35), Ok(StepResult::Whole));
    assert_eq!(loaded.integer("ticks"), 31);
    assert!(loaded.boolean("tick"));
    assert_eq!(loaded.step(0.35, 0.01), Ok(StepResult::Whole));
    assert!(!loaded.boolean("tick"));
    assert!(!loaded.boolean("third"));
    // 41 and 51 are the next ones; the latter is divisible by 3.
    assert_eq!(loaded.step(0.36, 0.1), Ok(StepResult::Whole));
    assert!(loaded.boolean("tick") && !loaded.boolean("third"));
    assert_eq!(loaded.step(0.46, 0.1), Ok(StepResult::Whole));
    assert!(loaded.boolean("third"));
}

#[test]
fn a_clock_that_ticks_at_times_cannot_be_triggered() {
    let mut loaded = ready("plain");
    let tick = loaded.reference("tick");
    let error = loaded.slave.set_boolean(&[tick], &[1]).unwrap_err();
    assert!(error.to_string().contains("expected a triggered input clock"), "{error}");
}

#[test]
fn discrete_inputs_are_set_in_event_mode_and_only_if_they_change() {
    let mut loaded = Loaded::third("plain");
    loaded.set_real("level", 9.0);
    let mut loaded = loaded.initialised();
    for (time, value) in [(0.01, 5), (0.02, 5), (0.03, 6)] {
        loaded.set_integer("k_in", value);
        assert_eq!(loaded.step(time - 0.01, 0.01), Ok(StepResult::Whole));
        assert_eq!(loaded.integer("k_out"), value);
    }
    assert_eq!(loaded.integer("events"), 2);
}

#[test]
fn binaries_and_arrays_of_strings_pass_unchanged() {
    let mut loaded = ready("plain");
    let (from, to) = (loaded.reference("bytes_in"), loaded.reference("bytes_out"));
    let mut bytes = [Vec::new()];
    loaded.slave.get_binary(&[to], &mut bytes).unwrap();
    assert_eq!(bytes[0], b"foo");
    loaded.slave.set_binary(&[from], &[vec![0, 255, 7]]).unwrap();
    let text = loaded.reference("texts[1]");
    loaded.slave.set_string(&[text], &["Grüße".to_owned()]).unwrap();
    assert_eq!(loaded.step(0.0, 0.01), Ok(StepResult::Whole));
    loaded.slave.get_binary(&[to], &mut bytes).unwrap();
    assert_eq!(bytes[0], [0, 255, 7]);
    let (copy, mut texts) = (loaded.reference("texts[2]"), [String::new()]);
    loaded.slave.get_string(&[copy], &mut texts).unwrap();
    assert_eq!(texts[0], "Grüße");
}

/// A binary without bytes needs no pointer.
#[test]
fn a_null_pointer_to_bytes_is_an_error() {
    let mut loaded = ready("null");
    let (from, to) = (loaded.reference("bytes_in"), loaded.reference("bytes_out"));
    let mut bytes = [Vec::new()];
    let error = loaded.slave.get_binary(&[to], &mut bytes).unwrap_err();
    assert!(matches!(error.failure, Failure::InvalidAnswer(_)), "{error}");
    let what =
        format!("fmi3GetBinary returned a null pointer for 3 bytes of the value references [{to}]");
    assert!(error.to_string().contains(&what), "{error}");
    loaded.slave.set_binary(&[from], &[Vec::new()]).unwrap();
    assert_eq!(loaded.step(0.0, 0.01), Ok(StepResult::Whole));
    loaded.slave.get_binary(&[to], &mut bytes).unwrap();
    assert!(bytes[0].is_empty(), "{bytes:?}");
}

#[test]
fn a_float32_has_its_own_precision() {
    let mut loaded = ready("plain");
    loaded.set_real("f", 0.1);
    assert_eq!(loaded.step(0.0, 0.01), Ok(StepResult::Whole));
    assert_eq!(loaded.real("g"), f64::from(0.1_f32));
}

#[test]
fn a_number_beyond_63_bits_is_an_error_that_names_its_variable() {
    assert_eq!(ready("plain").integer("big"), 42);
    let mut loaded = ready("huge");
    let error = loaded.slave.get_integer(&[loaded.reference("big")], &mut [0]).unwrap_err();
    assert!(error.to_string().contains("big"), "{error}");
}

#[test]
fn a_state_brings_back_time_events_and_clocks() {
    let mut loaded = ready("plain");
    assert_eq!(loaded.step(0.0, 0.32), Ok(StepResult::Whole));
    loaded.slave.save_state(0).unwrap();
    let bytes = loaded.slave.serialize_state().unwrap();
    let mut ends = Vec::new();
    for again in 0..3 {
        match again {
            0 => {}
            1 => loaded.slave.restore_state(0).unwrap(),
            _ => loaded.slave.deserialize_state(&bytes).unwrap(),
        }
        assert_eq!(loaded.step(0.32, 0.5), Ok(StepResult::Whole));
        let end = (loaded.real("y"), loaded.integer("ticks"), loaded.integer("events"));
        ends.push(end);
    }
    // Ticks at 0 s to 0.8 s.
    assert_eq!(ends[0].1, 9);
    assert!(ends.iter().all(|end| *end == ends[0]), "{ends:?}");
}

#[test]
fn directional_derivatives_of_elements_are_those_of_their_arrays() {
    let mut loaded = ready("plain");
    let (outputs, inputs) = (["b[1]", "b[2]"], ["a[2]"]);
    let unknowns = outputs.map(|name| loaded.reference(name));
    let knowns = inputs.map(|name| loaded.reference(name));
    let mut changes = [f64::NAN; 2];
    loaded.slave.directional_derivative(&unknowns, &knowns, &[3.0], &mut changes).unwrap();
    assert_eq!(changes, [0.0, 6.0]);
}

#[test]
fn a_discarded_step_is_made_in_smaller_parts() {
    let mut loaded = ready("discard");
    assert_eq!(loaded.step(0.0, 0.2), Ok(StepResult::Whole));
    assert!((loaded.real("y") - 0.2).abs() < 1e-12);
}

#[test]
fn an_fmu_that_requests_the_end_ends_there() {
    let mut loaded = ready("terminate");
    let Ok(StepResult::Part { reached, terminated: true }) = loaded.step(0.0, 1.0) else {
        panic!("the FMU is not stopped");
    };
    assert!((reached - 0.5).abs() < 1e-9, "{reached}");
}

#[test]
fn impossible_answers_to_a_step_are_errors_that_say_what_was_expected() {
    let error = ready("lie").step(0.0, 0.1).unwrap_err();
    assert!(matches!(error.failure, Failure::InvalidAnswer(_)));
    assert!(error.to_string().contains("last successful time"), "{error}");
    let error = ready("stay").step(0.0, 0.1).unwrap_err();
    assert!(error.to_string().contains("returned early 1000 times at t = 0 s"), "{error}");
}

#[test]
fn logging_is_switched_on_for_all_categories_without_a_list() {
    assert_eq!(ready("plain").slave.set_debug_logging(true), Ok(()));
}

/// A unit in the last place of 1000 s is 1.1e-13 s, and the step is 1e-6 s.
#[test]
fn an_early_return_that_rounding_makes_late_is_at_the_end_of_the_step() {
    let mut loaded = Loaded::third("late");
    let experiment = Experiment { start_time: 1e3, ..Experiment::default() };
    loaded.slave.setup_experiment(&experiment).unwrap();
    loaded.slave.enter_initialization_mode().unwrap();
    loaded.slave.exit_initialization_mode().unwrap();
    assert_eq!(loaded.step(1e3, 1e-6), Ok(StepResult::Whole));
    assert_eq!(loaded.step(1e3 + 1e-6, 1e-6), Ok(StepResult::Whole));
    // der(y) = 1.
    assert!((loaded.real("y") - 2e-6).abs() < 1e-12);
}

/// The FMU is a unit in the last place beyond the end.
#[test]
fn an_event_at_the_end_of_a_step_has_the_time_of_this_end() {
    let mut loaded = Loaded::third("late");
    assert_eq!(loaded.slave.hand_over_events(false), Ok(true));
    let mut loaded = loaded.initialised();
    assert_eq!(loaded.step(0.0, 0.25), Ok(StepResult::Event { reached: 0.25 }));
}

#[test]
fn an_fmu_that_lacks_the_event_mode_it_promises_runs_without() {
    let mut loaded = ready("no event mode");
    loaded.set_integer("k_in", 5);
    assert_eq!(loaded.step(0.0, 1.0), Ok(StepResult::Whole));
    assert_eq!(loaded.integer("events"), 0);
    assert_eq!(loaded.integer("k_out"), 5);
    assert!((loaded.real("y") - 1.0).abs() < 1e-12);
}

/// Loads the FMU that asks for u and a within a step.
fn asking() -> Loaded {
    let folder = tempfile::tempdir().unwrap();
    let path = c_versions::slave_3(folder.path(), "intermediate", false);
    let slave = Fmu::open(&path).unwrap().instantiate("slave").unwrap();
    Loaded { slave, _folder: folder }
}

#[test]
fn elements_of_an_array_follow_their_derivatives_within_a_step_after_a_change_of_its_size_too() {
    let mut loaded = asking();
    let size = loaded.reference("n");
    loaded.slave.configure(&[size], &[3]).unwrap();
    loaded.set_real("a[1]", 1.0);
    loaded.set_real("a[3]", 2.0);
    let mut loaded = loaded.initialised();
    let [u, third] = ["u", "a[3]"].map(|name| loaded.reference(name));
    loaded.slave.set_input_derivatives(&[third, u], &[1, 1], &[3.0, 2.0]).unwrap();
    assert_eq!(loaded.step(0.0, 1.0), Ok(StepResult::Whole));
    // u = 1 + 2 t, a = [1, 0, 2 + 3 t], b = 2 a.
    assert!((loaded.real("y") - 2.0).abs() < 1e-12);
    assert_eq!(["b[1]", "b[2]", "b[3]"].map(|name| loaded.real(name)), [2.0, 0.0, 10.0]);
}

#[test]
fn inputs_follow_their_derivatives_where_the_fmu_asks_for_them_within_a_step() {
    let mut loaded = asking().initialised();
    let flags = loaded.slave.description().co_simulation.clone().unwrap();
    assert!(flags.can_interpolate_inputs);
    let u = loaded.reference("u");
    loaded.slave.set_input_derivatives(&[u, u], &[1, 2], &[2.0, 6.0]).unwrap();
    assert_eq!(loaded.step(0.0, 1.0), Ok(StepResult::Whole));
    // u = 1 + 2 t + 3 t^2.
    assert!((loaded.real("y") - 3.0).abs() < 1e-12);
    assert_eq!(loaded.real("u"), 6.0);
    // The derivatives are for one step.
    assert_eq!(loaded.step(1.0, 1.0), Ok(StepResult::Whole));
    assert!((loaded.real("y") - 9.0).abs() < 1e-12);
    let error = loaded.slave.set_input_derivatives(&[u], &[4], &[1.0]).unwrap_err();
    assert!(error.to_string().contains("order 4, expected 1 to 3"), "{error}");
}

#[test]
fn inputs_of_an_fmu_that_does_not_ask_for_them_are_held() {
    let loaded = ready("plain");
    let flags = loaded.slave.description().co_simulation.clone().unwrap();
    assert!(!flags.can_interpolate_inputs);
}

#[test]
fn an_fmu_of_fmi_3_explains_its_errors_although_logging_is_off() {
    let fmu = Fmu::open(&tests::dist().join("AsoController.fmi3.fmu")).unwrap();
    let mut slave = fmu.instantiate("controller").unwrap();
    slave.setup_experiment(&Experiment::default()).unwrap();
    slave.enter_initialization_mode().unwrap();
    let error = slave.get_real(&[1 << 30], &mut [0.0]).unwrap_err();
    assert_eq!(error.function, "fmi3GetFloat64");
    assert!(
        error.messages.iter().any(|message| message.contains("value reference 1073741824")),
        "{error}"
    );
}

#[test]
fn a_value_beyond_the_range_of_a_type_names_the_function_of_that_type() {
    let mut loaded = ready("plain");
    let error = loaded.slave.set_real(&[loaded.reference("f")], &[1e300]).unwrap_err();
    assert_eq!(error.function, "fmi3SetFloat32");
    assert!(error.to_string().contains("1e300 for f, expected a value of type Float32"), "{error}");
}

#[test]
fn a_structural_parameter_that_would_need_too_much_memory_is_refused_and_may_be_set_again() {
    let mut loaded = Loaded::third("plain");
    let size = loaded.reference("n");
    let error = loaded.slave.configure(&[size], &[1 << 40]).unwrap_err().to_string();
    assert!(
        error.contains("fmi3EnterConfigurationMode was not called: its arrays have"),
        "{error}"
    );
    loaded.slave.configure(&[size], &[3]).unwrap();
    let mut loaded = loaded.initialised();
    loaded.set_real("a[3]", 1.5);
}
