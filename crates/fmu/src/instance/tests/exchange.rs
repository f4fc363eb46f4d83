//! Model exchange, directional derivatives, aliases, enumerations and start values.

use std::path::Path;

use super::pendulum::{
    ACCELERATION, ANGLE, DAMPING, GAIN, HALF, HEIGHT, Pendulum, SPEED, TORQUE, pendulum,
};
use crate::instance::Instance;
use crate::interface::{Interface, problems};
use crate::model::{Failure, Model};
use crate::room::room_of;
use fmu_description::abi::Status;
use fmu_description::call_order::{Function, InterfaceType, State};
use fmu_description::{Causality, DependencyKind, Initial, Kind, Variability};

fn ok(
    instance: &mut Instance<Pendulum>,
    function: Function,
    body: impl FnOnce(&mut Instance<Pendulum>),
) {
    let status = instance.call(function, |inner| {
        body(inner);
        Ok(())
    });
    assert_eq!(status, Status::OK, "{function:?}");
}

/// An instance in event mode at time 0.
fn started() -> Instance<Pendulum> {
    let mut instance = pendulum(InterfaceType::ModelExchange);
    instance.call(Function::EnterInitializationMode, Instance::enter_initialization_mode);
    instance.call(Function::ExitInitializationMode, Instance::exit_initialization_mode);
    assert_eq!(instance.core.state, State::EventMode);
    instance
}

fn continuous() -> Instance<Pendulum> {
    let mut instance = started();
    ok(&mut instance, Function::EnterContinuousTimeMode, Instance::enter_continuous_time_mode);
    instance
}

fn set(instance: &mut Instance<Pendulum>, reference: u32, value: f64) -> Status {
    instance.call(Function::SetReal, |inner| inner.set_real(&[reference], &[value]))
}

fn set_time(instance: &mut Instance<Pendulum>, time: f64) -> Status {
    instance.call(Function::SetTime, |inner| inner.set_time(time))
}

fn set_side(instance: &mut Instance<Pendulum>, value: i32) -> Status {
    instance.call(Function::SetInteger, |inner| inner.set_integer(&[0], &[value]))
}

fn directional(instance: &mut Instance<Pendulum>, unknown: u32, known: u32) -> Result<f64, Status> {
    let mut value = [f64::NAN];
    let status = instance.call(Function::GetDirectionalDerivative, |inner| {
        inner.get_directional_derivative(&[unknown], &[known], &[2.0], room_of(&mut value))
    });
    if status == Status::OK { Ok(value[0] / 2.0) } else { Err(status) }
}

#[test]
fn the_description_with_states_aliases_and_enumerations_breaks_no_rule() {
    assert_eq!(problems::<Pendulum>(Path::new("")), Ok(Vec::new()));
    let (_, inner) = Interface::new(&mut Pendulum::new(Path::new("")).unwrap()).unwrap();
    let speed = inner.variable("speed").unwrap();
    assert_eq!(speed.value_reference, inner.variable("der(angle)").unwrap().value_reference);
    assert_eq!((speed.causality, speed.variability), (Causality::Output, Variability::Continuous));
    assert_eq!(speed.initial, Some(Initial::Calculated));
    let Kind::Real(real) = &inner.variable("der(speed)").unwrap().kind else { panic!("no Real") };
    assert_eq!(real.derivative, Some(5));
    let row = &inner.structure.outputs[1];
    assert_eq!((row.index, row.dependencies.as_deref()), (4, Some(&[5][..])), "alias of a state");
    let row = &inner.structure.derivatives[1];
    assert_eq!(row.dependencies.as_deref(), Some(&[2, 3, 5][..]));
    let kinds = [DependencyKind::Fixed, DependencyKind::Dependent, DependencyKind::Tunable];
    assert_eq!(row.kinds.as_deref(), Some(&kinds[..]));
    let unknowns: Vec<_> = inner.structure.initial_unknowns.iter().map(|row| row.index).collect();
    assert_eq!(unknowns, [4, 6, 7, 12], "speed, der(speed), height, half");
    assert_eq!(inner.types[0].items[1], ("right".to_owned(), 2));
    assert_eq!(inner.number_of_event_indicators, Some(1));
}

#[test]
fn an_importer_integrates_the_states_it_was_given() {
    let mut instance = continuous();
    let (mut x, mut slopes, mut nominals) = ([0.0; 2], [0.0; 2], [0.0; 2]);
    ok(&mut instance, Function::GetContinuousStates, |inner| {
        inner.get_continuous_states(room_of(&mut x)).unwrap();
    });
    assert_eq!(x, [0.5, 0.0]);
    ok(&mut instance, Function::GetNominalsOfContinuousStates, |inner| {
        inner.get_nominals(room_of(&mut nominals)).unwrap();
    });
    assert_eq!(nominals, [0.25, 1.0]);
    ok(&mut instance, Function::SetTime, |inner| inner.set_time(0.5).unwrap());
    ok(&mut instance, Function::SetContinuousStates, |inner| {
        inner.set_continuous_states(&[0.25, -2.0]).unwrap();
    });
    assert_eq!(set(&mut instance, TORQUE, 3.0), Status::OK);
    ok(&mut instance, Function::GetDerivatives, |inner| {
        inner.get_derivatives(room_of(&mut slopes)).unwrap();
    });
    assert_eq!(slopes, [-2.0, 2.0 * 3.0 - 0.25_f64.sin() + 0.1 * 2.0]);
    let mut indicator = [0.0];
    ok(&mut instance, Function::GetEventIndicators, |inner| {
        inner.get_event_indicators(room_of(&mut indicator)).unwrap();
    });
    assert_eq!(indicator, [0.75]);
}

#[test]
fn an_event_may_change_states_announce_the_next_one_and_end_the_simulation() {
    let mut instance = continuous();
    ok(&mut instance, Function::SetContinuousStates, |inner| {
        inner.set_continuous_states(&[1.0, 4.0]).unwrap();
    });
    ok(&mut instance, Function::EnterEventMode, |inner| inner.enter_event_mode().unwrap());
    ok(&mut instance, Function::NewDiscreteStates, |inner| {
        let info = inner.new_discrete_states().unwrap();
        assert_eq!((info.values_of_continuous_states_changed, info.terminate_simulation), (1, 0));
        assert_eq!((info.next_event_time_defined, info.next_event_time), (1, 3.0));
    });
    let mut x = [0.0; 2];
    ok(&mut instance, Function::GetContinuousStates, |inner| {
        inner.get_continuous_states(room_of(&mut x)).unwrap();
    });
    assert_eq!(x, [1.0, -4.0]);
    ok(&mut instance, Function::EnterContinuousTimeMode, Instance::enter_continuous_time_mode);
    ok(&mut instance, Function::SetTime, |inner| inner.set_time(9.5).unwrap());
    ok(&mut instance, Function::EnterEventMode, |inner| inner.enter_event_mode().unwrap());
    ok(&mut instance, Function::NewDiscreteStates, |inner| {
        let info = inner.new_discrete_states().unwrap();
        assert_eq!((info.values_of_continuous_states_changed, info.terminate_simulation), (0, 1));
        assert_eq!(info.next_event_time_defined, 0);
    });
}

#[test]
fn wrong_lengths_times_and_states_are_refused() {
    type Body = fn(&mut Instance<Pendulum>) -> Result<(), Failure>;
    let refusals: [(Function, Body, Status); 7] = [
        (Function::SetContinuousStates, |inner| inner.set_continuous_states(&[1.0]), Status::Error),
        (
            Function::SetContinuousStates,
            |inner| inner.set_continuous_states(&[1.0, f64::NAN]),
            Status::Discard,
        ),
        (
            Function::GetDerivatives,
            |inner| inner.get_derivatives(room_of(&mut [0.0; 3])),
            Status::Error,
        ),
        (
            Function::GetEventIndicators,
            |inner| inner.get_event_indicators(room_of(&mut [])),
            Status::Error,
        ),
        (Function::SetTime, |inner| inner.set_time(f64::NAN), Status::Error),
        (Function::SetTime, |inner| inner.set_time(-1.0), Status::Error),
        (
            Function::GetDerivatives,
            |inner| {
                inner.set_continuous_states(&[101.0, 0.0])?;
                inner.get_derivatives(room_of(&mut [0.0; 2]))
            },
            Status::Discard,
        ),
    ];
    for (function, body, expected) in refusals {
        assert_eq!(continuous().call(function, body), expected, "{function:?}");
    }
}

#[test]
fn each_mode_lets_its_own_variables_be_set() {
    let states = [
        State::Instantiated,
        State::InitializationMode,
        State::EventMode,
        State::ContinuousTimeMode,
    ];
    // Sections 3.2.3, conditions 1, 3, 4 and 5; inputs also before initialization.
    for (reference, allowed) in [
        (TORQUE, [true, true, true, true]),
        (ANGLE, [true, true, false, true]),
        (ACCELERATION, [false, false, false, false]),
        (DAMPING, [true, true, true, false]),
        (GAIN, [true, true, false, false]),
        (8, [true, false, false, false]),
        (HALF, [false, false, false, false]),
    ] {
        for (state, allowed) in states.into_iter().zip(allowed) {
            let mut instance = pendulum(InterfaceType::ModelExchange);
            instance.core.state = state;
            let expected = if allowed { Status::OK } else { Status::Error };
            assert_eq!(set(&mut instance, reference, 0.5), expected, "{reference} in {state:?}");
        }
    }
}

#[test]
fn an_enumeration_takes_its_items_only() {
    let mut instance = pendulum(InterfaceType::CoSimulation);
    assert_eq!(set_side(&mut instance, 3), Status::Discard);
    assert_eq!(instance.core.model.side, 2);
    assert_eq!(set_side(&mut instance, 1), Status::OK);
    assert_eq!(instance.core.model.side, 1);
}

#[test]
fn directional_derivatives_follow_the_seed_of_inputs_and_states() {
    let mut instance = continuous();
    assert_eq!(directional(&mut instance, ACCELERATION, TORQUE), Ok(2.0));
    assert_eq!(directional(&mut instance, ACCELERATION, ANGLE), Ok(-0.5_f64.cos()));
    assert_eq!(directional(&mut instance, HEIGHT, ANGLE), Ok(0.5_f64.sin()));
    assert_eq!(directional(&mut instance, SPEED, SPEED), Ok(1.0));
    assert_eq!(directional(&mut instance, ANGLE, SPEED), Ok(0.0));
    assert_eq!(directional(&mut instance, HEIGHT, 0), Ok(0.0), "time");
    assert_eq!(directional(&mut continuous(), ACCELERATION, GAIN), Err(Status::Error));
    assert_eq!(directional(&mut continuous(), TORQUE, ANGLE), Err(Status::Error));
}

#[test]
fn directional_derivatives_at_initialization_include_parameters() {
    let mut instance = pendulum(InterfaceType::CoSimulation);
    set(&mut instance, TORQUE, 5.0);
    instance.call(Function::EnterInitializationMode, Instance::enter_initialization_mode);
    assert_eq!(directional(&mut instance, ACCELERATION, GAIN), Ok(5.0));
    assert_eq!(directional(&mut instance, HALF, GAIN), Ok(0.5));
    assert_eq!(directional(&mut instance, HEIGHT, ANGLE), Ok(0.5_f64.sin()));
    assert_eq!(directional(&mut instance, ANGLE, GAIN), Err(Status::Error), "angle is given");
}

#[test]
fn a_model_that_requests_the_end_returns_discard_and_terminated() {
    let mut instance = pendulum(InterfaceType::CoSimulation);
    set(&mut instance, ANGLE, 2.0);
    instance.call(Function::EnterInitializationMode, Instance::enter_initialization_mode);
    instance.call(Function::ExitInitializationMode, Instance::exit_initialization_mode);
    assert!(!instance.is_terminated());
    let status = instance.call(Function::DoStep, |inner| inner.do_step(0.0, 0.25));
    assert_eq!((status, instance.core.state), (Status::Discard, State::StepFailed));
    assert!(instance.is_terminated());
    assert_eq!(instance.last_successful_time(), 0.0);
}

#[test]
fn a_state_of_one_interface_is_refused_by_the_other() {
    let snapshot = started().snapshot();
    let mut other = pendulum(InterfaceType::CoSimulation);
    assert_eq!(other.call(Function::SetFMUstate, |inner| inner.restore(&snapshot)), Status::Error);
    let mut same = pendulum(InterfaceType::ModelExchange);
    assert_eq!(same.call(Function::SetFMUstate, |inner| inner.restore(&snapshot)), Status::OK);
    assert_eq!(same.core.state, State::EventMode);
}

#[test]
fn the_loop_of_an_integrator_does_not_allocate() {
    let mut instance = continuous();
    directional(&mut instance, HEIGHT, ANGLE).unwrap();
    let allocations = allocation_counter::measure(|| {
        let (mut slopes, mut indicator) = ([0.0; 2], [0.0]);
        for k in 0..20 {
            let time = 0.5 * f64::from(k);
            instance.call(Function::SetTime, |inner| inner.set_time(time));
            instance.call(Function::SetContinuousStates, |inner| {
                inner.set_continuous_states(&[0.1, time])
            });
            instance.call(Function::GetDerivatives, |inner| {
                inner.get_derivatives(room_of(&mut slopes))
            });
            instance.call(Function::GetEventIndicators, |inner| {
                inner.get_event_indicators(room_of(&mut indicator))
            });
            directional(&mut instance, HEIGHT, ANGLE).unwrap();
        }
        assert_eq!(slopes[0], 9.5);
    });
    assert_eq!(allocations.count_total, 0);
}

#[test]
fn an_integrator_may_look_past_stop_time_but_complete_no_step_there() {
    type Body = fn(&mut Instance<Pendulum>) -> Result<(), Failure>;
    let completed: Body = |inner| inner.completed_integrator_step();
    for (function, body) in [
        (Function::CompletedIntegratorStep, completed),
        (Function::EnterEventMode, |inner| inner.enter_event_mode()),
    ] {
        for (time, expected) in [(2.0, Status::OK), (2.5, Status::Error)] {
            let mut instance = continuous();
            instance.core.experiment.stop_time = Some(2.0);
            ok(&mut instance, Function::SetTime, |inner| inner.set_time(time).unwrap());
            ok(&mut instance, Function::GetDerivatives, |inner| {
                inner.get_derivatives(room_of(&mut [0.0; 2])).unwrap();
            });
            assert_eq!(instance.call(function, body), expected, "{function:?} at {time}");
        }
    }
}

#[test]
fn an_importer_goes_back_to_the_second_last_completed_step_and_never_over_an_event() {
    let complete = |instance: &mut Instance<Pendulum>, time: f64| {
        assert_eq!(set_time(instance, time), Status::OK);
        ok(instance, Function::CompletedIntegratorStep, |inner| {
            inner.completed_integrator_step().unwrap();
        });
    };
    let back = |instance: &Instance<Pendulum>, time: f64| {
        let mut other = pendulum(InterfaceType::ModelExchange);
        let snapshot = instance.snapshot();
        ok(&mut other, Function::SetFMUstate, |inner| inner.restore(&snapshot).unwrap());
        set_time(&mut other, time)
    };
    let mut instance = continuous();
    complete(&mut instance, 0.5);
    assert_eq!(back(&instance, 0.0), Status::OK);
    complete(&mut instance, 1.0);
    assert_eq!([back(&instance, 0.5), back(&instance, 0.4)], [Status::OK, Status::Error]);
    assert_eq!(set_time(&mut instance, 0.75), Status::OK);
    ok(&mut instance, Function::EnterEventMode, |inner| inner.enter_event_mode().unwrap());
    ok(&mut instance, Function::EnterContinuousTimeMode, Instance::enter_continuous_time_mode);
    assert_eq!([back(&instance, 0.75), back(&instance, 0.74)], [Status::OK, Status::Error]);
    instance.reset().unwrap();
    assert_eq!(instance.core.earliest, 0.0);
}

#[test]
fn an_event_that_the_importer_handles_too_late_is_an_error_before_the_model_sees_it() {
    for (time, expected) in [(1e7, Status::OK), (1e300, Status::Error)] {
        let mut instance = continuous();
        instance.core.next_event = Some(1.0);
        assert_eq!(set_time(&mut instance, time), Status::OK);
        let status = instance.call(Function::EnterEventMode, Instance::enter_event_mode);
        assert_eq!(status, expected, "{time}");
    }
}
