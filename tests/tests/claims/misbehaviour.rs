//! FMUs in C through our own loader: unusual behaviour is accepted, wrong behaviour is reported.
#![expect(clippy::unwrap_used, clippy::float_cmp, reason = "tests; exact by construction")]

use std::path::PathBuf;

use fmu_description::Experiment;
use fmu_description::abi::Status;
use fmu_import::{Fmu, FmuError, Instance, LoadError};
use linearise::{Differences, Method};
use linearise::{Linearise, linearise};
use master::{CallError, Failure, Readout, Slave, StepResult, System, SystemError};
use tempfile::TempDir;
use tests::c_fmu::CFmu;

/// Value references of the FMU's variables.
const U: u32 = 0;
const Y: u32 = 1;
const PARAMETER: u32 = 2;

fn written(fmu: &CFmu) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = fmu.write(folder.path(), "slave");
    (folder, path)
}

fn open(fmu: &CFmu) -> Fmu {
    let (_folder, path) = written(fmu);
    Fmu::open(&path).unwrap()
}

/// Returns the error of opening it.
fn refused(fmu: &CFmu) -> FmuError {
    let (_folder, path) = written(fmu);
    Fmu::open(&path).err().unwrap()
}

pub(crate) fn instance(fmu: &CFmu) -> Instance {
    open(fmu).instantiate("slave").unwrap()
}

pub(crate) fn initialise(slave: &mut Instance) -> Result<(), CallError> {
    slave.setup_experiment(&Experiment::default())?;
    slave.enter_initialization_mode()?;
    slave.exit_initialization_mode()
}

/// An instance that is ready to step.
pub(crate) fn ready(behaviour: &str) -> Instance {
    let mut slave = instance(&CFmu::that(behaviour));
    initialise(&mut slave).unwrap();
    slave
}

fn output(slave: &mut Instance) -> f64 {
    let mut values = [f64::NAN];
    slave.get_real(&[Y], &mut values).unwrap();
    values[0]
}

/// The name of the FMU has a dot, so that it cannot be found in the name of the variable.
#[test]
fn the_error_of_a_variable_that_cannot_be_read_names_its_fmu() {
    let mut slave = instance(&CFmu::well_behaved().with_unreadable_variable());
    initialise(&mut slave).unwrap();
    let mut system = System::default();
    system.add("car.engine", Box::new(slave)).unwrap();
    let ports = [system.port("car.engine.hidden").unwrap()];
    let mut readout = Readout::new(&system, &ports);
    let error = readout.unreadable(&mut system, &ports, 0.0).unwrap_err();
    let SystemError::Unreadable { slave, name, .. } = &error else { panic!("{error}") };
    assert_eq!((&**slave, &**name), ("car.engine", "car.engine.hidden"));
}

#[test]
fn values_of_all_types_pass_through_an_fmu_unchanged() {
    let mut slave = ready("as it should");
    let long = "x".repeat(19_999);
    let texts = ["", "Grüße, \"Ångström\"\n", long.as_str()];
    for (step, text) in texts.into_iter().enumerate() {
        let number = [i64::from(i32::MIN), i32::MAX.into(), 0][step];
        let (item, boolean) = ([1, 2, 1][step], [1, 0, 1][step]);
        slave.set_real(&[U], &[f64::MIN_POSITIVE]).unwrap();
        slave.set_integer(&[0, 10], &[number, item]).unwrap();
        slave.set_boolean(&[0], &[boolean]).unwrap();
        slave.set_string(&[0], &[text.to_owned()]).unwrap();
        let time = [0.0, 1.0, 2.0][step];
        assert_eq!(slave.do_step(time, 1.0, true), Ok(StepResult::Whole));
        let (mut integers, mut booleans) = ([0, 0], [7]);
        let mut strings = ["before".to_owned(), "before".to_owned()];
        slave.get_integer(&[1, 11], &mut integers).unwrap();
        slave.get_boolean(&[1], &mut booleans).unwrap();
        slave.get_string(&[1, 2], &mut strings).unwrap();
        assert_eq!(output(&mut slave), (time + 1.0) * f64::MIN_POSITIVE);
        assert_eq!((integers, booleans), ([number, item], [boolean]));
        assert_eq!(strings, [text, "as it should"]);
    }
}

#[test]
fn a_null_string_is_read_as_an_empty_one() {
    let mut values = ["before".to_owned()];
    ready("no text").get_string(&[1], &mut values).unwrap();
    assert_eq!(values, [""]);
}

#[test]
fn instances_of_one_fmu_are_independent() {
    let fmu = open(&CFmu::well_behaved());
    let mut slaves = [1.0, 2.0, -3.0].map(|input| {
        let mut slave = fmu.instantiate("slave").unwrap();
        slave.set_real(&[U], &[input]).unwrap();
        initialise(&mut slave).unwrap();
        slave
    });
    drop(fmu);
    for slave in &mut slaves {
        slave.do_step(0.0, 0.5, true).unwrap();
    }
    assert_eq!(slaves.each_mut().map(output), [0.5, 1.0, -1.5]);
}

#[test]
fn a_second_instance_of_an_fmu_that_allows_one_is_refused_and_the_first_continues() {
    let one = CFmu::that("one instance only").flag("canBeInstantiatedOnlyOncePerProcess", true);
    let fmu = open(&one);
    let mut first = fmu.instantiate("first").unwrap();
    let second = fmu.instantiate("second").err().unwrap().to_string();
    for part in ["second", "canBeInstantiatedOnlyOncePerProcess", "--isolate"] {
        assert!(second.contains(part), "{second}");
    }
    initialise(&mut first).unwrap();
    first.do_step(0.0, 0.5, true).unwrap();
    assert_eq!(output(&mut first), 0.5);
}

#[test]
fn an_fmu_that_allows_one_instance_has_two_if_it_is_opened_twice() {
    let one = CFmu::that("one instance only").flag("canBeInstantiatedOnlyOncePerProcess", true);
    let (_folder, path) = written(&one);
    let opened = [Fmu::open(&path).unwrap(), Fmu::open(&path).unwrap()];
    for (slave, size) in opened.iter().map(|fmu| fmu.instantiate("slave")).zip([0.5, 0.25]) {
        let mut slave = slave.unwrap();
        initialise(&mut slave).unwrap();
        slave.do_step(0.0, size, true).unwrap();
        assert_eq!(output(&mut slave), size);
    }
}

#[test]
fn an_fmu_that_needs_a_tool_runs_if_it_can_and_otherwise_the_error_names_the_tool() {
    let tool = "Bench 4 & Co".replace('&', "and");
    let mut slave = instance(&CFmu::well_behaved().needing(&tool));
    initialise(&mut slave).unwrap();
    slave.do_step(0.0, 0.5, true).unwrap();
    assert_eq!(output(&mut slave), 0.5);

    let silent = open(&CFmu::that("fail in fmi2Instantiate").needing(&tool));
    let error = silent.instantiate("slave").err().unwrap().to_string();
    assert!(error.contains(&tool) && error.contains("needsExecutionTool"), "{error}");
    let error = refused(&CFmu::well_behaved().needing(&tool).without(&["fmi2DoStep"])).to_string();
    assert!(error.contains(&tool) && error.contains("fmi2DoStep"), "{error}");
}

#[test]
fn a_library_of_another_fmi_version_is_refused_with_that_version() {
    let FmuError::Load(LoadError::Version { actual, .. }) =
        refused(&CFmu::well_behaved().version("1.0"))
    else {
        panic!("refused for another reason");
    };
    assert_eq!(actual, "1.0");
    assert!(!open(&CFmu::well_behaved().version("2.0.4")).description().variables.is_empty());
}

#[test]
fn a_missing_function_that_every_instance_needs_is_named_when_the_fmu_is_opened() {
    for function in [
        "fmi2Instantiate",
        "fmi2FreeInstance",
        "fmi2SetupExperiment",
        "fmi2EnterInitializationMode",
        "fmi2ExitInitializationMode",
        "fmi2DoStep",
    ] {
        let error = refused(&CFmu::well_behaved().without(&[function]));
        let FmuError::Load(LoadError::Missing { function: missed, .. }) = error else {
            panic!("{function}: {error}");
        };
        assert_eq!(missed, function);
    }
}

type Call = fn(&mut Instance) -> Result<(), CallError>;

/// Optional functions, each with a call that needs it.
const OPTIONAL: [(&str, Call); 17] = [
    ("fmi2SetDebugLogging", |slave| slave.set_debug_logging(true)),
    ("fmi2GetReal", |slave| slave.get_real(&[1], &mut [0.0])),
    ("fmi2SetReal", |slave| slave.set_real(&[0], &[0.0])),
    ("fmi2GetInteger", |slave| slave.get_integer(&[1], &mut [0])),
    ("fmi2SetInteger", |slave| slave.set_integer(&[0], &[0])),
    ("fmi2GetBoolean", |slave| slave.get_boolean(&[1], &mut [0])),
    ("fmi2SetBoolean", |slave| slave.set_boolean(&[0], &[0])),
    ("fmi2GetString", |slave| slave.get_string(&[1], &mut [String::new()])),
    ("fmi2SetString", |slave| slave.set_string(&[0], &[String::new()])),
    ("fmi2SetRealInputDerivatives", |slave| slave.set_input_derivatives(&[0], &[1], &[0.0])),
    ("fmi2GetRealOutputDerivatives", |slave| slave.get_output_derivatives(&[1], &[1], &mut [0.0])),
    ("fmi2GetDirectionalDerivative", |slave| {
        slave.directional_derivative(&[1], &[0], &[1.0], &mut [0.0])
    }),
    ("fmi2GetFMUstate", |slave| slave.save_state(0)),
    ("fmi2SetFMUstate", |slave| slave.save_state(0).and_then(|()| slave.restore_state(0))),
    ("fmi2SerializeFMUstate", |slave| slave.serialize_state().map(|_| ())),
    ("fmi2DeSerializeFMUstate", |slave| slave.deserialize_state(b"state")),
    ("fmi2Terminate", Slave::terminate),
];

#[test]
fn a_missing_optional_function_is_named_when_it_is_called_and_harmless_otherwise() {
    for (function, call) in OPTIONAL {
        let mut slave = instance(&CFmu::well_behaved().without(&[function]));
        initialise(&mut slave).unwrap();
        assert_eq!(slave.do_step(0.0, 0.5, true), Ok(StepResult::Whole), "{function}");
        let error = call(&mut slave).unwrap_err();
        assert_eq!((error.function, &error.failure), (function, &Failure::Missing), "{error}");
    }
}

#[test]
fn an_fmu_without_any_optional_function_still_steps() {
    let mut missing = OPTIONAL.map(|(function, _)| function).to_vec();
    missing.extend(["fmi2GetVersion", "fmi2GetTypesPlatform", "fmi2Reset", "fmi2FreeFMUstate"]);
    missing.extend(["fmi2SerializedFMUstateSize", "fmi2CancelStep", "fmi2GetStatus"]);
    missing.extend(["fmi2GetRealStatus", "fmi2GetIntegerStatus", "fmi2GetBooleanStatus"]);
    missing.push("fmi2GetStringStatus");
    let mut slave = instance(&CFmu::well_behaved().without(&missing));
    initialise(&mut slave).unwrap();
    assert_eq!(slave.do_step(0.0, 0.5, true), Ok(StepResult::Whole));
    assert_eq!(slave.do_step(0.5, 0.5, true), Ok(StepResult::Whole));
}

#[test]
fn a_serialised_state_is_restored_in_another_instance() {
    let mut slave = ready("as it should");
    slave.do_step(0.0, 0.5, true).unwrap();
    let bytes = slave.serialize_state().unwrap();
    let mut other = instance(&CFmu::well_behaved());
    other.deserialize_state(&bytes).unwrap();
    other.do_step(0.5, 0.25, true).unwrap();
    assert_eq!(output(&mut other), 0.75);
    let error = other.deserialize_state(&bytes[1..]).unwrap_err();
    assert_eq!(error.failure, Failure::Status(Status::Error));
    assert_eq!(error.messages, ["these bytes are no state"]);
}

#[test]
fn an_fmu_without_saved_states_says_so_when_one_is_requested() {
    let fmu = CFmu::that("no way back").without_rollback();
    let mut slave = instance(&fmu);
    let flags = slave.description().co_simulation.clone().unwrap();
    assert!(!flags.can_get_and_set_fmu_state && !flags.can_serialize_fmu_state);
    let error = slave.save_state(0).unwrap_err();
    assert_eq!(error.function, "fmi2GetFMUstate");
    assert_eq!(error.messages, ["there is no way back"]);
}

#[test]
fn restoring_a_state_that_was_never_saved_is_an_error_without_a_call_of_the_fmu() {
    let error = ready("as it should").restore_state(3).unwrap_err();
    assert!(matches!(error.failure, Failure::InvalidAnswer(_)), "{error}");
}

#[test]
fn parameters_choose_the_behaviour_of_a_built_library() {
    let mut slave = instance(&CFmu::well_behaved());
    slave.set_string(&[PARAMETER], &["fail in fmi2Terminate".to_owned()]).unwrap();
    initialise(&mut slave).unwrap();
    let error = slave.terminate().unwrap_err();
    assert_eq!(error.to_string(), "fmi2Terminate returned fmi2Error: as it was told");
}

/// x' = u; the library refuses a second instance while one exists.
#[test]
fn an_fmu_that_allows_one_instance_is_linearised_by_steps() {
    let once = CFmu::that("one instance only").flag("canBeInstantiatedOnlyOncePerProcess", true);
    let fmu = open(&once);
    let names = |name: &str| vec![name.to_owned()];
    let request = Linearise {
        inputs: names("u"),
        outputs: names("y"),
        states: names("y"),
        at: vec![("u".to_owned(), "0".to_owned())],
        step: Some(0.125),
        ..Linearise::default()
    };
    for _ in 0..2 {
        let plant = linearise(&fmu, &request).unwrap();
        assert!(matches!(
            plant.method,
            Method::FiniteDifferences { how: Differences::OfSteps { .. }, .. }
        ));
        let (a, b) = (plant.matrices.a[(0, 0)], plant.matrices.b[(0, 0)]);
        assert!(a.abs() < 1e-9 && (b - 1.0).abs() < 1e-9, "{a} {b}");
    }
}
