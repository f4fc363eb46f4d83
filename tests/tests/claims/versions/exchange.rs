//! FMI 3.0, model exchange, by our integrator.

use fmu_description::Experiment;
use fmu_import::Fmu;
use integrate::{Integrated, Options};
use master::{Slave, StepResult};
use tests::c_versions;

/// The integrated slave, initialised with these Reals, and a lookup of references.
fn ready(token: &str, settings: &[(&str, f64)]) -> Integrated {
    let folder = tempfile::tempdir().unwrap();
    let path = c_versions::equations_3(folder.path(), token);
    let fmu = Fmu::open_any(&path).unwrap();
    let equations = fmu.instantiate_equations("equations").unwrap();
    let mut slave = Integrated::new(equations, Options::default());
    slave.setup_experiment(&Experiment::default()).unwrap();
    for (name, value) in settings {
        let reference = reference(&slave, name);
        slave.set_real(&[reference], &[*value]).unwrap();
    }
    slave.enter_initialization_mode().unwrap();
    slave.exit_initialization_mode().unwrap();
    slave
}

fn reference(slave: &Integrated, name: &str) -> u32 {
    let variables = &slave.description().variables;
    variables.iter().find(|variable| variable.name == name).unwrap().value_reference
}

fn real(slave: &mut Integrated, name: &str) -> f64 {
    let (reference, mut value) = (reference(slave, name), [f64::NAN]);
    slave.get_real(&[reference], &mut value).unwrap();
    value[0]
}

fn integer(slave: &mut Integrated, name: &str) -> i64 {
    let (reference, mut value) = (reference(slave, name), [0]);
    slave.get_integer(&[reference], &mut value).unwrap();
    value[0]
}

fn ticked(slave: &mut Integrated, name: &str) -> bool {
    let (reference, mut value) = (reference(slave, name), [7]);
    slave.get_boolean(&[reference], &mut value).unwrap();
    value[0] != 0
}

#[test]
fn states_state_events_time_events_and_clocks_of_fmi_3_are_those_of_co_simulation() {
    let mut slave = ready("plain", &[("level", 0.45), ("u", 1.0)]);
    assert_eq!(slave.do_step(0.0, 1.0, true), Ok(StepResult::Whole));
    assert!((real(&mut slave, "y") - 1.0).abs() < 1e-12);
    // 10 ticks after 0 s, 0.25 s and 0.75 s, and the state event at 0.45 s.
    assert_eq!(integer(&mut slave, "events"), 13);
    assert_eq!(integer(&mut slave, "ticks"), 11);
}

#[test]
fn a_clock_of_model_exchange_is_true_until_the_next_step() {
    let mut slave = ready("plain", &[("level", 9.0)]);
    assert_eq!(slave.do_step(0.0, 0.1, true), Ok(StepResult::Whole));
    assert!(ticked(&mut slave, "tick") && !ticked(&mut slave, "third"));
    assert_eq!(slave.do_step(0.1, 0.05, true), Ok(StepResult::Whole));
    assert!(!ticked(&mut slave, "tick"));
    assert_eq!(slave.do_step(0.15, 0.05, true), Ok(StepResult::Whole));
    assert!(ticked(&mut slave, "tick") && ticked(&mut slave, "third"));
}

#[test]
fn arrays_and_discrete_inputs_of_model_exchange_are_set() {
    let mut slave = ready("plain", &[("level", 9.0), ("a[2]", 5.0)]);
    assert_eq!(slave.do_step(0.0, 0.01, true), Ok(StepResult::Whole));
    assert_eq!((real(&mut slave, "b[1]"), real(&mut slave, "b[2]")), (2.0, 10.0));
    let number = reference(&slave, "k_in");
    slave.set_integer(&[number], &[7]).unwrap();
    assert_eq!(slave.do_step(0.01, 0.01, true), Ok(StepResult::Whole));
    assert_eq!(integer(&mut slave, "k_out"), 7);
    assert_eq!(integer(&mut slave, "events"), 1);
}

#[test]
fn a_state_of_model_exchange_brings_back_clocks_and_events() {
    let mut slave = ready("plain", &[]);
    assert_eq!(slave.do_step(0.0, 0.32, true), Ok(StepResult::Whole));
    let bytes = slave.serialize_state().unwrap();
    let mut ends = Vec::new();
    for _ in 0..2 {
        assert_eq!(slave.do_step(0.32, 0.5, true), Ok(StepResult::Whole));
        let (y, ticks) = (real(&mut slave, "y"), integer(&mut slave, "ticks"));
        ends.push((y, ticks, integer(&mut slave, "events")));
        slave.deserialize_state(&bytes).unwrap();
    }
    assert_eq!(ends[0].1, 9);
    assert_eq!(ends[0], ends[1]);
}

#[test]
fn an_fmu_of_fmi_3_ends_its_integration() {
    let mut slave = ready("terminate", &[]);
    let done = slave.do_step(0.0, 1.0, true);
    let Ok(StepResult::Part { reached, terminated: true }) = done else {
        panic!("the FMU is not stopped: {done:?}");
    };
    assert!((reached - 0.5).abs() < 1e-9, "{reached}");
}
