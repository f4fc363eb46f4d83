//! The state machine with a small model: x' = -rate x + drive, stepped exactly for a held drive.
#![expect(clippy::float_cmp, reason = "values that are set and read back")]

mod calls;
mod equations;
mod exchange;
mod fmi3;
mod layout;
mod pendulum;
mod refusals;
mod steps;

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{Instance, Snapshot};
use crate::Experiment;
use crate::callbacks::Callbacks;
use crate::interface::Interface;
use crate::model::{About, Failure, Model, Step};
use crate::room::room_of;
use crate::variable::Variable;
use fmu_description::Guid;
use fmu_description::abi::Status;
use fmu_description::call_order::{Function, InterfaceType};

#[derive(Clone, Serialize, Deserialize)]
struct Decay {
    rate: f64,
    drive: f64,
    drive_slope: f64,
    x: f64,
    label: String,
    count: i32,
    active: bool,
}

impl Model for Decay {
    const IDENTIFIER: &'static str = "Decay";

    fn about(&self) -> About {
        About::default()
    }

    fn new(_: &Path) -> Result<Self, Failure> {
        Ok(Self {
            rate: 2.0,
            drive: 0.0,
            drive_slope: 0.0,
            x: 0.0,
            label: "a % sign".to_owned(),
            count: 0,
            active: true,
        })
    }

    fn variables(&self) -> Vec<Variable<Self>> {
        vec![
            Variable::real("drive", "input", |model: &mut Self| &mut model.drive)
                .input()
                .derivative(|model| &mut model.drive_slope),
            Variable::real("x", "state", |model: &mut Self| &mut model.x).output(&[]),
            Variable::real("rate", "rate", |model: &mut Self| &mut model.rate)
                .range(0.0, 10.0)
                .parameter(),
            Variable::integer("count", "steps", |model: &mut Self| &mut model.count),
            Variable::boolean("active", "switch", |model: &mut Self| &mut model.active).input(),
            Variable::string("label", "text", |model: &mut Self| &mut model.label).tunable(),
        ]
    }

    fn check(&self) -> Result<(), Failure> {
        if self.rate == 7.0 {
            return Err(Failure::Error("rate = 7, expected anything else".to_owned()));
        }
        Ok(())
    }

    fn initialize(&mut self, _: &Experiment) -> Result<(), Failure> {
        self.x = 1.0;
        Ok(())
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        assert!(self.drive != 99.0, "a model that panics at 99");
        if self.drive == 50.0 {
            let time = step.start + 0.5 * step.size;
            return Err(Failure::Incomplete { time, message: "half way".to_owned() });
        }
        let level = if self.rate > 0.0 { self.drive / self.rate } else { 0.0 };
        self.x = level + (self.x - level) * (-self.rate * step.size).exp();
        self.count += 1;
        Ok(())
    }
}

const DRIVE: u32 = 1;
const X: u32 = 2;
const RATE: u32 = 3;

fn fresh() -> Instance<Decay> {
    let mut model = Decay::new(Path::new("")).unwrap();
    let (_, description) = Interface::new(&mut model).unwrap();
    let none = Path::new("");
    Instance::new(InterfaceType::CoSimulation, none, &description.guid, Callbacks::silent())
        .unwrap()
}

fn initialized() -> Instance<Decay> {
    let mut instance = fresh();
    let experiment = Experiment { stop_time: Some(10.0), ..Experiment::default() };
    let done = [
        instance.call(Function::SetupExperiment, |i| i.setup_experiment(experiment)),
        instance.call(Function::EnterInitializationMode, Instance::enter_initialization_mode),
        instance.call(Function::ExitInitializationMode, Instance::exit_initialization_mode),
    ];
    assert_eq!(done, [Status::OK; 3]);
    instance
}

fn step(instance: &mut Instance<Decay>, start: f64, size: f64) -> Status {
    instance.call(Function::DoStep, |i| i.do_step(start, size))
}

fn set(instance: &mut Instance<Decay>, reference: u32, value: f64) -> Status {
    instance.call(Function::SetReal, |i| i.set_real(&[reference], &[value]))
}

fn get(instance: &mut Instance<Decay>, reference: u32) -> f64 {
    let mut value = [f64::NAN];
    let status =
        instance.call(Function::GetReal, |i| i.get_real(&[reference], room_of(&mut value)));
    assert_eq!(status, Status::OK);
    value[0]
}

#[test]
fn a_panic_of_the_model_is_fatal_and_stays_inside() {
    let mut instance = initialized();
    set(&mut instance, DRIVE, 99.0);
    assert_eq!(step(&mut instance, 0.0, 0.1), Status::Fatal);
    assert_eq!(set(&mut instance, DRIVE, 0.0), Status::Fatal);
}

#[test]
fn setting_several_values_is_all_or_nothing() {
    let mut instance = fresh();
    let status = instance.call(Function::SetReal, |i| i.set_real(&[DRIVE, RATE], &[5.0, f64::NAN]));
    assert_eq!(status, Status::Discard);
    let status = instance.call(Function::SetReal, |i| i.set_real(&[DRIVE, RATE], &[5.0, 11.0]));
    assert_eq!(status, Status::Discard);
    assert_eq!((instance.core.model.drive, instance.core.model.rate), (0.0, 2.0));
    let status = instance.call(Function::SetReal, |i| i.set_real(&[DRIVE, 77], &[5.0, 1.0]));
    assert_eq!(status, Status::Error);
    assert_eq!(instance.core.model.drive, 0.0);
}

#[test]
fn a_fixed_parameter_cannot_be_set_after_initialization() {
    let mut instance = initialized();
    assert_eq!(set(&mut instance, RATE, 1.0), Status::Error);
}

#[test]
fn an_output_cannot_be_set() {
    assert_eq!(set(&mut fresh(), X, 1.0), Status::Error);
}

#[test]
fn parameters_that_do_not_fit_are_refused_before_the_start() {
    let mut instance = fresh();
    assert_eq!(set(&mut instance, RATE, 7.0), Status::OK);
    let status =
        instance.call(Function::EnterInitializationMode, Instance::enter_initialization_mode);
    assert_eq!(status, Status::Error);
}

#[test]
fn input_derivatives_hold_for_one_step() {
    let mut instance = initialized();
    let status = instance.call(Function::SetRealInputDerivatives, |i| {
        i.set_real_input_derivatives(&[DRIVE, DRIVE], &[1, 2], &[3.0, 4.0])
    });
    assert_eq!((status, instance.core.model.drive_slope), (Status::OK, 3.0));
    step(&mut instance, 0.0, 0.1);
    assert_eq!(instance.core.model.drive_slope, 0.0);
    let status = instance.call(Function::SetRealInputDerivatives, |i| {
        i.set_real_input_derivatives(&[DRIVE], &[0], &[3.0])
    });
    assert_eq!(status, Status::Error);
}

fn bytes_of(snapshot: &Snapshot<Decay>) -> Vec<u8> {
    let mut bytes = vec![0; snapshot.size().unwrap()];
    snapshot.write(room_of(&mut bytes)).unwrap();
    bytes
}

#[test]
fn a_restored_state_and_a_serialized_one_continue_with_the_same_bits() {
    let mut instance = initialized();
    step(&mut instance, 0.0, 0.1);
    let snapshot = instance.snapshot();
    let bytes = bytes_of(&snapshot);
    step(&mut instance, 0.1, 0.1);
    let expected = get(&mut instance, X).to_bits();
    let mut other = fresh();
    for state in [snapshot, Snapshot::from_bytes(&bytes, other.guid()).unwrap()] {
        other.restore(&state).unwrap();
        step(&mut other, 0.1, 0.1);
        assert_eq!(get(&mut other, X).to_bits(), expected);
    }
}

#[test]
fn a_damaged_or_foreign_serialized_state_is_refused() {
    let instance = initialized();
    let bytes = bytes_of(&instance.snapshot());
    for length in 0..bytes.len() {
        assert!(Snapshot::<Decay>::from_bytes(&bytes[..length], instance.guid()).is_err());
        let mut altered = bytes.clone();
        altered[length] ^= 1;
        assert!(Snapshot::<Decay>::from_bytes(&altered, instance.guid()).is_err());
    }
    assert!(Snapshot::<Decay>::from_bytes(&bytes, Guid([7; 16])).is_err());
}

#[test]
fn reset_is_as_after_instantiation() {
    let mut instance = initialized();
    step(&mut instance, 0.0, 0.1);
    instance.reset().unwrap();
    let start = fresh();
    assert_eq!(bytes_of(&instance.snapshot()), bytes_of(&start.snapshot()));
}

#[test]
fn a_wrong_guid_is_refused_with_both_guids() {
    let (kind, none) = (InterfaceType::CoSimulation, Path::new(""));
    let Err(failure) = Instance::<Decay>::new(kind, none, "{other}", Callbacks::silent()) else {
        panic!("accepted");
    };
    assert!(failure.to_string().contains("{other}") && failure.to_string().contains("Decay"));
}

#[test]
fn the_loop_of_set_step_get_does_not_allocate() {
    let mut instance = initialized();
    let mut value = [0.0];
    let allocations = allocation_counter::measure(|| {
        for k in 0..50 {
            set(&mut instance, DRIVE, 1.0);
            instance.call(Function::SetRealInputDerivatives, |i| {
                i.set_real_input_derivatives(&[DRIVE], &[1], &[0.5])
            });
            step(&mut instance, f64::from(k) * 0.1, 0.1);
            instance.call(Function::GetReal, |i| i.get_real(&[X], room_of(&mut value)));
        }
    });
    assert!(value[0] > 0.0);
    assert_eq!(allocations.count_total, 0);
}

#[test]
fn the_description_of_a_model_breaks_no_rule() {
    let (_, description) = Interface::new(&mut Decay::new(Path::new("")).unwrap()).unwrap();
    assert_eq!(description.problems(), []);
    assert_eq!(description.guid, Guid::of(&description).to_string());
}
