//! The crate `fmi-rs` as an importer: it reads, checks, couples and simulates both FMUs.
//!
//! It offers neither input and output derivatives nor `fmi2GetStatus`, so inputs are held.
#![expect(clippy::unwrap_used, reason = "a test fails by a panic, in its set-up too")]

use std::fs;
use std::sync::{Arc, Mutex};

use fmi_rs::fmi2::builder::FMU2Builder;
use fmi_rs::fmi2::log::Logger;
use fmi_rs::fmi2::types::{fmi2False, fmi2Status};
use fmi_rs::fmi2::{CS, FMU2};
use fmi_rs::model_description::fmi2::{ModelDescription, Unknown, VariableType};
use fmi_rs::sim::fmi2::recorder::Recorder;
use fmi_rs::sim::fmi2::{
    SimulationSettings, Trajectories, VariableValue, cs, parse_variable_value, set_variable_value,
};
use fmu_description::Experiment;
use fmu_description::{Causality, Initial};
use fmu_import::Fmu;
use master::{Algorithm, Extrapolation, Method, Simulation, Slave, System};

const FILES: [&str; 2] = ["FrictionPendulum.fmu", "AsoController.fmu"];
const STEP: f64 = 1e-3;

/// A message reported by an FMU.
#[derive(Default)]
struct Messages(Mutex<Vec<String>>);

impl Logger for Messages {
    fn log_call(&self, _: fmi2Status, _: &str) {}

    fn log_message(&self, status: fmi2Status, category: &str, message: &str) {
        self.0.lock().unwrap().push(format!("{status:?} {category}: {message}"));
    }
}

/// An instance in initialization mode, created by fmi-rs.
struct Instance {
    unpacked: FMU2Builder,
    fmu: Arc<FMU2<CS>>,
    messages: Arc<Messages>,
}

impl Instance {
    fn new(file: &str, settings: &[(&str, &str)]) -> Self {
        let unpacked = open(file);
        let messages = Arc::new(Messages::default());
        let logger: Arc<dyn Logger> = messages.clone();
        let (description, folder) = (&unpacked.model_description, unpacked.unzipdir.path());
        let flags = description.coSimulation.as_ref().unwrap();
        let (identifier, guid) = (&flags.modelIdentifier, &description.guid);
        let memory = !flags.canNotUseMemoryManagementFunctions;
        let fmu = FMU2::<CS>::new(
            folder, identifier, "fmi-rs", guid, false, false, false, logger, memory,
        );
        let fmu = fmu.unwrap();
        for (name, text) in settings {
            let variable = description.variable_by_name(name).unwrap();
            let value = parse_variable_value(&variable.variableType, text).unwrap();
            set_variable_value(&fmu, variable.valueReference, &value).unwrap();
        }
        expect_ok(fmu.setupExperiment(None, 0.0, None));
        expect_ok(fmu.enterInitializationMode());
        Self { unpacked, fmu, messages }
    }

    fn references(&self, names: &[&str]) -> Vec<u32> {
        let description = &self.unpacked.model_description;
        let reference = |name: &&str| description.variable_by_name(name).unwrap().valueReference;
        names.iter().map(reference).collect()
    }

    fn get(&self, names: &[&str]) -> Vec<f64> {
        let mut values = vec![f64::NAN; names.len()];
        expect_ok(self.fmu.getReal(&self.references(names), &mut values));
        values
    }

    fn set(&self, names: &[&str], values: &[f64]) {
        expect_ok(self.fmu.setReal(&self.references(names), values));
    }
}

fn open(file: &str) -> FMU2Builder {
    FMU2Builder::new(&tests::dist().join(file)).unwrap()
}

fn expect_ok(status: fmi2Status) {
    assert_eq!(status, fmi2Status::Ok);
}

/// Real outputs, in the order of the description.
fn real_outputs(description: &ModelDescription) -> Vec<&str> {
    use fmi_rs::model_description::fmi2::Causality;

    let variables = description.modelVariables.iter().filter(|variable| {
        let real = matches!(variable.variableType, VariableType::Real { .. });
        real && variable.causality == Causality::Output
    });
    variables.map(|variable| variable.name.as_str()).collect()
}

fn exchange(plant: &Instance, controller: &Instance) {
    let (y, u) = (plant.get(&["x_p", "theta"]), controller.get(&["u"]));
    controller.set(&["x_p", "theta"], &y);
    plant.set(&["u"], &u);
}

#[test]
fn fmi_rs_finds_no_fault_in_the_descriptions() {
    for file in FILES {
        let problems = open(file).model_description.validate();
        let texts: Vec<_> = problems.iter().map(|problem| &problem.message).collect();
        assert!(texts.is_empty(), "{file}: {texts:?}");
    }
}

#[test]
fn fmi_rs_reads_the_same_variables_and_dependencies_as_our_parser() {
    for file in FILES {
        let (theirs, ours) = (open(file), Fmu::open(&tests::dist().join(file)).unwrap());
        let (theirs, ours) = (&theirs.model_description, ours.description());
        assert_eq!(theirs.modelVariables.len(), ours.variables.len());
        for (theirs, ours) in theirs.modelVariables.iter().zip(&ours.variables) {
            assert_eq!(theirs.name, ours.name);
            assert_eq!(theirs.valueReference, ours.value_reference, "{}", ours.name);
            assert_eq!(theirs.variableType.name(), ours.kind.element(), "{}", ours.name);
            // The crate gives inputs initial = exact, but section 2.2.7 allows no `initial` for
            // them.
            let input = (ours.causality == Causality::Input).then_some(Initial::Exact);
            let initial = ours.initial_in_force().or(input);
            let theirs = (theirs.causality, theirs.variability, theirs.initial);
            let own_text = format!("{:?}", (ours.causality, ours.variability, initial));
            assert_eq!(format!("{theirs:?}"), own_text, "{}", ours.name);
        }
        let plain = |list: &[Unknown]| -> Vec<_> {
            list.iter().map(|unknown| (unknown.index, unknown.dependencies.clone())).collect()
        };
        let structure = &ours.structure;
        for (theirs, ours) in [
            (&theirs.outputs, &structure.outputs),
            (&theirs.derivatives, &structure.derivatives),
            (&theirs.initialUnknowns, &structure.initial_unknowns),
        ] {
            let rows: Vec<_> =
                ours.iter().map(|row| (row.index, row.dependencies.clone())).collect();
            assert_eq!(plain(theirs), rows, "{file}");
        }
    }
}

#[test]
fn the_closed_loop_by_fmi_rs_is_bit_identical_to_that_by_our_master() {
    let settings = [("plant.F_s", "60"), ("plant.linearised", "true"), ("controller.t_on", "0.5")];
    let of = |slave: &str| -> Vec<(&str, &str)> {
        let setting = |(name, value): &(&'static str, &'static str)| {
            Some((name.strip_prefix(slave)?.strip_prefix('.')?, *value))
        };
        settings.iter().filter_map(setting).collect()
    };
    let plant = Instance::new(FILES[0], &of("plant"));
    let controller = Instance::new(FILES[1], &of("controller"));
    let names = real_outputs(&plant.unpacked.model_description);
    let estimates = real_outputs(&controller.unpacked.model_description);
    let qualified: Vec<_> = (names.iter().map(|name| format!("plant.{name}")))
        .chain(estimates.iter().map(|name| format!("controller.{name}")))
        .collect();
    let ports: Vec<_> = qualified.iter().map(String::as_str).collect();
    let system = tests::closed_loop(&settings);
    let (mut simulation, mut probe) = tests::simulation(
        system,
        &Algorithm::fixed(Method::Jacobi, Extrapolation::Hold, STEP),
        &ports,
    );

    exchange(&plant, &controller);
    exchange(&plant, &controller);
    expect_ok(plant.fmu.exitInitializationMode());
    expect_ok(controller.fmu.exitInitializationMode());
    let mut expected = vec![f64::NAN; ports.len()];
    for step in 0..2000 {
        exchange(&plant, &controller);
        let time = simulation.time();
        expect_ok(plant.fmu.doStep(time, STEP, fmi2False));
        expect_ok(controller.fmu.doStep(time, STEP, fmi2False));
        simulation.step().unwrap();
        let end = simulation.time();
        probe.read(simulation.system(), end, &mut expected).unwrap();
        let values = [plant.get(&names), controller.get(&estimates)].concat();
        for ((name, expected), value) in ports.iter().zip(&expected).zip(&values) {
            let same = expected.to_bits() == value.to_bits();
            assert!(same, "{name} after {step} steps: {expected:e} and {value:e}");
        }
    }
    let [position, estimate] = ["plant.x_p", "controller.f_hat"]
        .map(|name| expected[ports.iter().position(|port| *port == name).unwrap()]);
    assert!(position.abs() < 1.0 && estimate.abs() > 1.0, "the loop is closed");
    for instance in [plant, controller] {
        expect_ok(instance.fmu.terminate());
        assert_eq!(*instance.messages.0.lock().unwrap(), Vec::<String>::new());
    }
}

/// Simulates by fmi-rs alone and returns the values of the Real outputs over time; nothing may be
/// reported.
#[expect(clippy::arc_with_non_send_sync, reason = "the simulator takes its recorder so")]
fn simulated(file: &str, settings: &[(&str, &str)], stop: f64) -> Trajectories {
    let unpacked = open(file);
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log.txt");
    let description = Arc::new(unpacked.model_description);
    let indices = real_outputs(&description)
        .into_iter()
        .map(|name| description.variable_index_by_name(name).unwrap())
        .collect();
    let recorder = Arc::new(Recorder::new(Trajectories::new(description.clone(), indices)));
    let pair = |(name, value): &(&str, &str)| ((*name).to_owned(), (*value).to_owned());
    let settings = SimulationSettings {
        unzipdir: unpacked.unzipdir.path().to_owned(),
        model_description: description,
        start_time: 0.0,
        stop_time: stop,
        logging_on: true,
        set_stop_time: true,
        output_interval: STEP,
        log_time_scale: false,
        tolerance: 1e-6,
        set_tolerance: false,
        start_values: settings.iter().map(pair).collect(),
        log_fmi_calls: false,
        input_file: None,
        early_return_allowed: false,
        event_mode_used: false,
        log_file: Some(log.clone()),
        initial_fmu_state_file: None,
        final_fmu_state_file: Some(folder.path().join("state")),
    };
    cs::simulate(&settings, None, recorder.clone()).unwrap();
    assert_eq!(fs::read_to_string(log).unwrap(), "", "{file} reports something");
    assert!(fs::metadata(folder.path().join("state")).unwrap().len() > 0);
    Arc::into_inner(recorder).unwrap().into_trajectories()
}

/// An initialised instance of our own loader.
fn own_slave(file: &str, settings: &[(&str, &str)]) -> Box<dyn Slave> {
    let mut system = System::default();
    let fmu = Fmu::open(&tests::dist().join(file)).unwrap();
    system.add("alone", Box::new(fmu.instantiate("alone").unwrap())).unwrap();
    for (name, value) in settings {
        system.set(&format!("alone.{name}"), value).unwrap();
    }
    // Initialises the slave with its settings.
    let algorithm = Algorithm::new(1e-3);
    let mut simulation = Simulation::new(system, &algorithm, &Experiment::default()).unwrap();
    simulation.system().slaves.remove(0).1
}

#[test]
fn the_simulator_of_fmi_rs_gives_the_values_of_our_loader_for_each_fmu() {
    for (file, settings) in [
        (FILES[0], vec![("x_p_0", "0.5"), ("linearised", "false")]),
        (FILES[1], vec![("x_p", "0.02"), ("theta", "-0.01"), ("t_on", "0.25")]),
    ] {
        let simulated_run = simulated(file, &settings, 1.0);
        assert_eq!(simulated_run.time.len(), 1001);
        let references: Vec<_> =
            simulated_run.variables().map(|variable| variable.valueReference).collect();
        let mut slave = own_slave(file, &settings);
        let mut values = vec![f64::NAN; references.len()];
        for (row, (time, simulated_row)) in
            simulated_run.time.iter().zip(&simulated_run.rows).enumerate()
        {
            slave.get_real(&references, &mut values).unwrap();
            let numbers: Vec<_> = simulated_row.iter().filter_map(VariableValue::to_f64).collect();
            let bits =
                |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&numbers), bits(&values), "{file}, row {row}: {numbers:?}, {values:?}");
            #[expect(clippy::cast_precision_loss, reason = "a thousand rows")]
            let next = (row + 1) as f64 * STEP;
            slave.do_step(*time, next - time, true).unwrap();
        }
    }
}
