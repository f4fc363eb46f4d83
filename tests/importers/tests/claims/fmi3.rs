//! The FMUs of FMI 3.0 through the crate `fmi`, compared with our own loader.
#![expect(clippy::unwrap_used, reason = "a test fails by a panic, in its set-up too")]

use std::fs;

use fmi::EventFlags;
use fmi::fmi3::Fmi3Res;
use fmi::fmi3::import::Fmi3Import;
use fmi::fmi3::instance::{InstanceCS, InstanceME};
use fmi::fmi3::{CoSimulation as _, Common as _, Fmi3Model as _, GetSet as _, ModelExchange as _};
use fmi::traits::FmiImport as _;
use fmu_description::Experiment;
use fmu_description::Version;
use fmu_description::package::{Package, Unpacked};
use master::{Algorithm, Extrapolation, Method, Probe, Simulation};

const PLANT: &str = "FrictionPendulum.fmi3.fmu";
const CONTROLLER: &str = "AsoController.fmi3.fmu";
const STEP: f64 = 1e-3;

/// Attributes of Float64 variables in the schema of FMI 3.0 (`fmi3RealBaseAttributes`) that the crate
/// (0.8) refuses.
const REFUSED: [&str; 2] = ["unit", "nominal"];

/// The FMU as the crate reads it: the description is without [`REFUSED`], nothing else changes.
fn import(file: &str) -> Fmi3Import {
    let unpacked = Unpacked::open_whole(&tests::dist().join(file)).unwrap();
    let xml = fs::read_to_string(unpacked.folder().join("modelDescription.xml")).unwrap();
    let mut package =
        Package::new(REFUSED.iter().fold(xml, |xml, attribute| without(&xml, attribute)))
            .for_version(Version::V3);
    for folder in ["binaries", "resources"] {
        if unpacked.folder().join(folder).is_dir() {
            package.add_folder(folder, &unpacked.folder().join(folder)).unwrap();
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(file);
    package.write(&path).unwrap();
    fmi::import::from_path(path).unwrap()
}

/// `xml` without an attribute.
fn without(xml: &str, attribute: &str) -> String {
    let start = format!(" {attribute}=\"");
    let mut parts = xml.split(start.as_str());
    let first = parts.next().unwrap().to_owned();
    parts.fold(first, |joined, part| joined + part.split_once('"').unwrap().1)
}

#[test]
fn the_crate_fmi_refuses_units_of_variables() {
    let refused = fmi::import::from_path::<Fmi3Import>(tests::dist().join(PLANT)).unwrap_err();
    assert!(format!("{refused:?}").contains("unit"), "{refused:?}");
}

/// The value references of Float64 variables, as the crate reads them from the description.
fn references<const N: usize>(fmu: &Fmi3Import, names: [&str; N]) -> [u32; N] {
    names.map(|name| {
        let variables = &fmu.model_description().model_variables;
        let named = variables.iter_floating().find(|variable| variable.name() == name);
        named.unwrap().value_reference()
    })
}

/// An instance and its Float64 inputs and outputs.
struct Side<const I: usize, const O: usize> {
    instance: InstanceCS,
    inputs: [u32; I],
    outputs: [u32; O],
}

impl<const I: usize, const O: usize> Side<I, O> {
    fn new(file: &str, inputs: [&str; I], outputs: [&str; O]) -> Self {
        let fmu = import(file);
        let [inputs, outputs] =
            [references(&fmu, inputs).to_vec(), references(&fmu, outputs).to_vec()];
        let instance = fmu.instantiate_cs(file, false, true, false, false, &[]).unwrap();
        Self { instance, inputs: inputs.try_into().unwrap(), outputs: outputs.try_into().unwrap() }
    }

    fn get(&mut self) -> [f64; O] {
        let mut values = [f64::NAN; O];
        assert_eq!(self.instance.get_float64(&self.outputs, &mut values), Ok(Fmi3Res::OK));
        values
    }

    fn set(&mut self, values: [f64; I]) {
        assert_eq!(self.instance.set_float64(&self.inputs, &values), Ok(Fmi3Res::OK));
    }

    fn step(&mut self, time: f64) {
        let (mut event, mut end, mut early, mut last) = (false, false, false, f64::NAN);
        let done =
            self.instance.do_step(time, STEP, true, &mut event, &mut end, &mut early, &mut last);
        assert_eq!(done, Ok(Fmi3Res::OK));
        assert_eq!(
            (event, end, early, last.to_bits()),
            (false, false, false, (time + STEP).to_bits())
        );
    }
}

/// `x_p`, `theta`, `u` and `f_hat` after each step of the loop with held inputs (Jacobi), by the crate.
fn loop_of_the_crate(steps: u32) -> Vec<[f64; 4]> {
    let mut plant = Side::new(PLANT, ["u"], ["x_p", "theta"]);
    let mut controller = Side::new(CONTROLLER, ["x_p", "theta"], ["u", "f_hat"]);
    let [switch_on] = references(&import(CONTROLLER), ["t_on"]);
    controller.instance.set_float64(&[switch_on], &[0.5]).unwrap();
    plant.instance.enter_initialization_mode(None, 0.0, None).unwrap();
    controller.instance.enter_initialization_mode(None, 0.0, None).unwrap();
    controller.set(plant.get());
    plant.set([controller.get()[0]]);
    plant.instance.exit_initialization_mode().unwrap();
    controller.instance.exit_initialization_mode().unwrap();
    let mut rows = Vec::new();
    for step in 0..=steps {
        let (measured, [input, estimate]) = (plant.get(), controller.get());
        rows.push([measured[0], measured[1], input, estimate]);
        plant.set([input]);
        controller.set(measured);
        let time = f64::from(step) * STEP;
        plant.step(time);
        controller.step(time);
    }
    plant.instance.terminate().unwrap();
    controller.instance.terminate().unwrap();
    rows
}

/// The same by our own loader and master.
fn loop_of_the_master(steps: u32) -> Vec<[f64; 4]> {
    let system = tests::closed_loop_of(PLANT, CONTROLLER, &[("controller.t_on", "0.5")]);
    let ports = ["plant.x_p", "plant.theta", "controller.u", "controller.f_hat"]
        .map(|name| system.port(name).unwrap());
    let mut probe = Probe::new(&system, &ports);
    let algorithm = Algorithm::fixed(Method::Jacobi, Extrapolation::Hold, STEP);
    let mut simulation = Simulation::new(system, &algorithm, &Experiment::default()).unwrap();
    let mut rows = Vec::new();
    for _ in 0..=steps {
        let mut values = [f64::NAN; 4];
        let time = simulation.time();
        probe.read(simulation.system(), time, &mut values).unwrap();
        rows.push(values);
        simulation.step().unwrap();
    }
    rows
}

#[test]
fn the_loop_of_fmi_3_through_the_crate_fmi_has_the_bits_of_our_own_loader() {
    let [expected, actual] = [loop_of_the_master(2000), loop_of_the_crate(2000)];
    for (step, (expected, actual)) in expected.iter().zip(&actual).enumerate() {
        assert_eq!(actual.map(f64::to_bits), expected.map(f64::to_bits), "step {step}: {actual:?}");
    }
    assert!(actual.last().unwrap()[3].abs() > 1.0, "the observer estimates the friction");
}

/// Integrates in continuous-time mode by Euler's method to `end`.
fn euler(instance: &mut InstanceME, end: u32) -> Vec<f64> {
    let mut states = vec![f64::NAN; instance.get_number_of_continuous_states().unwrap()];
    let mut slopes = states.clone();
    instance.get_continuous_states(&mut states).unwrap();
    for step in 0..end {
        instance.set_time(f64::from(step) * STEP).unwrap();
        instance.set_continuous_states(&states).unwrap();
        instance.get_continuous_state_derivatives(&mut slopes).unwrap();
        states.iter_mut().zip(&slopes).for_each(|(state, slope)| *state += STEP * slope);
        let (mut event, mut end) = (false, false);
        instance.completed_integrator_step(true, &mut event, &mut end).unwrap();
        assert!(!event && !end);
    }
    states
}

#[test]
fn the_plant_of_fmi_3_swings_in_model_exchange_through_the_crate_fmi() {
    let fmu = import(PLANT);
    let mut instance = fmu.instantiate_me("plant", false, true).unwrap();
    // Far from upright without an input, the cart sticks and the pendulum swings.
    instance.enter_initialization_mode(None, 0.0, None).unwrap();
    instance.exit_initialization_mode().unwrap();
    let mut flags = EventFlags::default();
    instance.update_discrete_states(&mut flags).unwrap();
    assert!(!flags.discrete_states_need_update && !flags.terminate_simulation);
    instance.enter_continuous_time_mode().unwrap();
    assert!(instance.get_number_of_event_indicators().unwrap() >= 1);
    let [x_p, theta, v_p, omega] = euler(&mut instance, 100)[..] else { panic!("four states") };
    assert_eq!((x_p, v_p), (0.1, 0.0));
    assert!(theta < -0.1 && omega < 0.0, "theta = {theta}, omega = {omega}");
    instance.terminate().unwrap();
}
