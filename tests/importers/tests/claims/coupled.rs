//! The closed loop through the crate `fmi`, compared with our own loader.
#![expect(clippy::unwrap_used, reason = "a test fails by a panic, in its set-up too")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use fmu_description::Causality;
use fmu_description::Experiment;
use fmu_description::package::{Package, platforms};
use fmu_import::{Fmu, FmuError, LoadError};
use importers::{FmiCrateError, FmiSlave};
use master::{Algorithm, Extrapolation, Failure, Method, Probe, Simulation, Slave, System};

const PENDULUM: &str = "FrictionPendulum.fmu";

fn own_loader(path: &Path, name: &str) -> Box<dyn Slave> {
    Box::new(Fmu::open(path).unwrap().instantiate(name).unwrap())
}

fn crate_fmi(path: &Path, name: &str) -> Box<dyn Slave> {
    Box::new(FmiSlave::open(path, name).unwrap())
}

/// The closed loop with every output and local variable, with compensation from 0.5 s on.
fn closed_loop(
    open: fn(&Path, &str) -> Box<dyn Slave>,
    method: (Method, Extrapolation),
) -> (Simulation, Probe) {
    let mut system = System::default();
    for (name, file) in [("plant", PENDULUM), ("controller", "AsoController.fmu")] {
        system.add(name, open(&tests::dist().join(file), name)).unwrap();
    }
    assert_eq!(system.connect_equal_names().unwrap(), 3);
    system.set("controller.t_on", "0.5").unwrap();
    let mut ports = system.ports(Causality::Output);
    ports.extend(system.ports(Causality::Local));
    let probe = Probe::new(&system, &ports);
    let algorithm = Algorithm::fixed(method.0, method.1, 1e-3);
    (Simulation::new(system, &algorithm, &Experiment::default()).unwrap(), probe)
}

fn values((simulation, probe): &mut (Simulation, Probe)) -> Vec<f64> {
    let mut values = vec![f64::NAN; probe.names().len()];
    let time = simulation.time();
    probe.read(simulation.system(), time, &mut values).unwrap();
    values
}

/// Steps both over 2 s and compares all values bit by bit, including the initial ones.
fn expect_equal_runs(mut one: (Simulation, Probe), mut other: (Simulation, Probe)) {
    let names = one.1.names().to_vec();
    assert_eq!(names, other.1.names());
    for step in 0..=2000 {
        let (expected, actual) = (values(&mut one), values(&mut other));
        for ((name, expected), actual) in names.iter().zip(&expected).zip(&actual) {
            let same = expected.to_bits() == actual.to_bits();
            assert!(same, "{name} after {step} steps: {expected:e} and {actual:e}");
        }
        one.0.step().unwrap();
        other.0.step().unwrap();
    }
    let estimate = names.iter().position(|name| name == "controller.f_hat").unwrap();
    assert!(values(&mut one)[estimate].abs() > 1.0, "the observer estimates the friction");
}

#[test]
fn the_closed_loop_through_the_crate_fmi_is_bit_identical_to_the_one_through_our_own_loader() {
    // Without derivatives, the default method holds all inputs.
    expect_equal_runs(
        closed_loop(own_loader, (Method::GaussSeidel, Extrapolation::Hold)),
        closed_loop(crate_fmi, (Method::GaussSeidel, Extrapolation::Limited)),
    );
    expect_equal_runs(
        closed_loop(own_loader, (Method::Jacobi, Extrapolation::Hold)),
        closed_loop(crate_fmi, (Method::Jacobi, Extrapolation::Hold)),
    );
}

#[test]
fn what_the_crate_fmi_lacks_is_neither_declared_nor_silently_omitted() {
    let path = tests::dist().join(PENDULUM);
    let mut slave = FmiSlave::open(&path, "plant").unwrap();
    let promised = slave.description().co_simulation.clone().unwrap();
    assert!(!promised.can_interpolate_inputs);
    assert_eq!(promised.max_output_derivative_order, 0);

    let error = slave.set_input_derivatives(&[1], &[1], &[0.0]).unwrap_err();
    assert_eq!(error.function, "fmi2SetRealInputDerivatives");
    let error = slave.get_output_derivatives(&[1], &[1], &mut [0.0]).unwrap_err();
    assert_eq!(error.function, "fmi2GetRealOutputDerivatives");
    assert_eq!(error.failure, Failure::Missing);
}

/// Functions that return a status, among those that a slave of the crate calls.
const STATUS_FUNCTIONS: [&str; 14] = [
    "fmi2SetupExperiment",
    "fmi2EnterInitializationMode",
    "fmi2ExitInitializationMode",
    "fmi2Terminate",
    "fmi2GetReal",
    "fmi2GetInteger",
    "fmi2GetBoolean",
    "fmi2SetReal",
    "fmi2SetInteger",
    "fmi2SetBoolean",
    "fmi2SetString",
    "fmi2SetRealInputDerivatives",
    "fmi2GetRealOutputDerivatives",
    "fmi2DoStep",
];

const STUB_XML: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Stub" guid="{1}">
<CoSimulation modelIdentifier="Stub"/><ModelVariables/><ModelStructure/></fmiModelDescription>"#;

const FRAME: &str = r#"
static int instance;
const char *fmi2GetVersion(void) { return "2.0"; }
void *fmi2Instantiate() { return &instance; }
void fmi2FreeInstance() {}
"#;

/// An FMU in C that has `functions`, each returning `status`.
fn stub(folder: &Path, functions: &[&str], status: i32) -> PathBuf {
    let mut source = vec![FRAME.to_owned()];
    source.extend(functions.iter().map(|name| format!("int {name}() {{ return {status}; }}\n")));
    let (code, library) = (folder.join("stub.c"), folder.join("stub"));
    fs::write(&code, source.concat()).unwrap();
    let mut compiler = Command::new("cc");
    compiler.args(["-shared", "-fPIC", "-w", "-o"]).args([&library, &code]);
    assert!(compiler.status().unwrap().success());
    let mut package = Package::new(STUB_XML.to_owned());
    let suffix = std::env::consts::DLL_SUFFIX;
    package.add(format!("binaries/{}/Stub{suffix}", platforms()[0]), fs::read(library).unwrap());
    let path = folder.join("Stub.fmu");
    package.write(&path).unwrap();
    path
}

#[test]
fn a_pending_step_is_an_error_although_the_crate_fmi_panics() {
    let folder = tempfile::tempdir().unwrap();
    let path = stub(folder.path(), &STATUS_FUNCTIONS, 5);
    let mut slave = FmiSlave::open(&path, "stub").unwrap();
    let error = slave.do_step(0.0, 1.0, true).unwrap_err();
    assert_eq!(error.function, "fmi2DoStep");
    assert!(matches!(error.failure, Failure::Panicked(_)), "{error}");
}

#[test]
fn a_library_without_a_function_that_every_instance_needs_is_refused_before_the_crate_fmi_loads_it()
{
    for missing in ["fmi2SetupExperiment", "fmi2ExitInitializationMode", "fmi2DoStep"] {
        let folder = tempfile::tempdir().unwrap();
        let mut functions = STATUS_FUNCTIONS.to_vec();
        functions.retain(|function| *function != missing);
        let path = stub(folder.path(), &functions, 0);
        let refused = FmiSlave::open(&path, "stub").err();
        let Some(FmiCrateError::Fmu(FmuError::Load(LoadError::Missing { function, .. }))) = refused
        else {
            panic!("{refused:?}");
        };
        assert_eq!(function, missing);
    }
}

#[test]
fn a_call_of_a_missing_optional_function_is_an_error_although_the_crate_fmi_panics() {
    let folder = tempfile::tempdir().unwrap();
    let mut functions = STATUS_FUNCTIONS.to_vec();
    functions.retain(|function| !["fmi2GetReal", "fmi2Terminate"].contains(function));
    let path = stub(folder.path(), &functions, 0);
    let mut slave = FmiSlave::open(&path, "stub").unwrap();
    slave.setup_experiment(&Experiment::default()).unwrap();
    slave.enter_initialization_mode().unwrap();
    slave.exit_initialization_mode().unwrap();
    let errors = [slave.get_real(&[1], &mut [0.0]), slave.terminate()].map(Result::unwrap_err);
    assert_eq!(errors.each_ref().map(|error| error.function), ["fmi2GetReal", "fmi2Terminate"]);
    assert!(errors.iter().all(|error| matches!(error.failure, Failure::Panicked(_))), "{errors:?}");
    slave.do_step(0.0, 1.0, true).unwrap();
}
