//! The functions of FMI 3.0, called as the C functions call them.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::super::{Instantiation, Jacobian, Snapshot};
use super::pendulum::Pendulum;
use crate::callbacks::Callbacks;
use crate::instance::Instance;
use crate::model::{Failure, Model, Step};
use crate::room::room_of;
use crate::variable::Variable;
use crate::{About, Event, ModelExchange, describe, describe_3};
use fmu_description::abi::Status;
use fmu_description::call_order::{InterfaceType, State};
use fmu_description::call_order3::{Function, allowed};
use fmu_description::{Dimension, Elements, ModelDescription, NativeType};

/// x' = A x + u with a 2 x 2 matrix A, as a model without a step; the event at x[1] = 2 ends nothing.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct Linear {
    a: Vec<f64>,
    x: Vec<f64>,
    rates: Vec<f64>,
    u: f64,
    events: i32,
}

impl Model for Linear {
    const IDENTIFIER: &'static str = "Linear";
    const PROVIDES_DIRECTIONAL_DERIVATIVE: bool = true;

    fn about(&self) -> About {
        About::default()
    }

    fn new(_: &Path) -> Result<Self, Failure> {
        let (a, x) = (vec![0.0, 1.0, 0.0, 0.0], vec![1.0, 1.0]);
        Ok(Self { a, x, rates: vec![0.0; 2], u: 0.0, events: 0 })
    }

    fn variables(&self) -> Vec<Variable<Self>> {
        let mut all = vec![
            Variable::real("u", "input", |model: &mut Self| &mut model.u).input(),
            Variable::integer("events", "number of events", |model: &mut Self| &mut model.events)
                .output(&[])
                .exact(),
        ];
        all.extend(
            Variable::real_array("A", "matrix", &[2, 2], |model: &mut Self| &mut model.a[..])
                .map(Variable::parameter),
        );
        all.extend(
            Variable::real_array("x", "states", &[2], |model: &mut Self| &mut model.x[..])
                .map(|element| element.output(&[]).exact()),
        );
        let rates =
            Variable::real_array("der(x)", "rates", &[2], |model: &mut Self| &mut model.rates[..]);
        all.extend(rates.enumerate().map(|(k, element)| {
            let kind = fmu_description::DependencyKind::Fixed;
            let on = if k == 0 { vec!["x[1]", "x[2]"] } else { vec!["x[1]", "x[2]", "u"] };
            element.derivative_of(format!("x[{}]", k + 1)).depends(kind, on)
        }));
        all
    }

    fn update(&mut self, _: f64) -> Result<(), Failure> {
        for (row, rate) in self.rates.iter_mut().enumerate() {
            *rate = self.a[2 * row] * self.x[0] + self.a[2 * row + 1] * self.x[1];
        }
        self.rates[1] += self.u;
        Ok(())
    }

    fn differentiate(&self, _: &crate::At, direction: &mut Self) -> Result<(), Failure> {
        let x = direction.x.clone();
        for row in 0..2 {
            direction.rates[row] = self.a[2 * row] * x[0] + self.a[2 * row + 1] * x[1];
        }
        direction.rates[1] += direction.u;
        Ok(())
    }

    fn model_exchange(&self) -> Option<ModelExchange> {
        Some(ModelExchange { event_indicators: 1 })
    }

    fn event_indicators(&self, _: f64, indicators: &mut [f64]) {
        indicators[0] = 2.0 - self.x[0] - f64::from(self.events) * 100.0;
    }

    fn event(&mut self, _: f64) -> Result<Event, Failure> {
        if self.events == 0 && self.x[0] >= 2.0 {
            self.events = 1;
        }
        Ok(Event::default())
    }
}

fn description() -> ModelDescription {
    describe_3::<Linear>(Path::new("")).unwrap()
}

fn reference(name: &str) -> u32 {
    description().variable(name).unwrap().value_reference
}

pub(super) fn instantiate<M: Model>(
    kind: InterfaceType,
    events: bool,
    early: bool,
) -> Result<Instance<M>, Failure> {
    let token = describe_3::<M>(Path::new("")).unwrap().guid;
    let instantiation = Instantiation {
        interface_type: kind,
        token: &token,
        resources: Path::new(""),
        logging_on: true,
        event_mode_used: events,
        early_return_allowed: early,
        intermediate: None,
        required: &[],
    };
    Instance::new_3(&instantiation, Callbacks::silent())
}

pub(super) fn initialized(kind: InterfaceType, events: bool) -> Instance<Linear> {
    let mut instance = instantiate(kind, events, events).unwrap();
    let done = [
        instance.call(Function::EnterInitializationMode, Instance::enter_initialization_mode),
        instance.call(Function::ExitInitializationMode, Instance::exit_initialization_mode_3),
    ];
    assert_eq!(done, [Status::OK; 2]);
    instance
}

fn get(instance: &mut Instance<Linear>, names: &[&str], count: usize) -> (Status, Vec<f64>) {
    let references: Vec<_> = names.iter().map(|name| reference(name)).collect();
    let mut values = vec![f64::NAN; count];
    let status = instance.call(Function::GetFloat64, |i| {
        i.located(NativeType::Float64, &references, count, |i, places| {
            i.get_float64(places, room_of(&mut values))
        })
    });
    (status, values)
}

pub(super) fn set(instance: &mut Instance<Linear>, name: &str, values: &[f64]) -> Status {
    instance.call(Function::SetFloat64, |i| {
        i.located(NativeType::Float64, &[reference(name)], values.len(), |i, places| {
            i.set_float64(places, values)
        })
    })
}

#[test]
fn the_description_breaks_no_rule_of_fmi_3() {
    let pendulum = describe_3::<Pendulum>(Path::new("")).unwrap();
    for description in [description(), pendulum] {
        assert_eq!(description.problems(), vec![], "{}", description.model_name);
        let (read, warnings) = ModelDescription::read(description.to_xml().as_bytes()).unwrap();
        assert!(warnings.is_empty(), "{warnings:?}");
        assert_eq!(read.variables, description.variables);
        assert_eq!(read.structure, description.structure);
    }
}

#[test]
fn matrices_and_vectors_are_arrays_in_fmi_3_and_scalars_in_fmi_2() {
    let a = description().variable("A").cloned().unwrap();
    assert_eq!(a.dimensions, [Dimension::Fixed(2), Dimension::Fixed(2)]);
    assert_eq!(a.start_elements, Some(Elements::Real(vec![0.0, 1.0, 0.0, 0.0])));
    assert!(describe::<Linear>(Path::new("")).unwrap().variable("A[2,1]").is_some());
}

#[test]
fn an_array_is_set_whole_and_read_in_row_major_order() {
    let mut instance = instantiate(InterfaceType::CoSimulation, false, false).unwrap();
    assert_eq!(set(&mut instance, "A", &[1.0, 2.0, 3.0, 4.0]), Status::OK);
    assert_eq!(instance.core.model.a, [1.0, 2.0, 3.0, 4.0]);
    let expected = vec![1.0, 2.0, 3.0, 4.0, 0.0];
    assert_eq!(get(&mut instance, &["A", "u"], 5), (Status::OK, expected));
}

#[test]
fn a_wrong_number_of_values_is_an_error_before_a_value_is_touched() {
    for count in [0, 1, 3, 5] {
        let mut instance = instantiate(InterfaceType::CoSimulation, false, false).unwrap();
        let (status, values) = get(&mut instance, &["A"], count);
        assert_eq!((status, instance.core.state), (Status::Error, State::Terminated));
        assert!(values.iter().all(|value| value.is_nan()));
    }
}

#[test]
fn a_variable_of_another_type_is_an_error() {
    let mut instance = instantiate::<Linear>(InterfaceType::CoSimulation, false, false).unwrap();
    let status = instance.call(Function::GetInt32, |i| {
        i.located(NativeType::Int32, &[reference("u")], 1, |_, _| Ok(()))
    });
    assert_eq!(status, Status::Error);
    let mut instance = instantiate::<Linear>(InterfaceType::CoSimulation, false, false).unwrap();
    let status =
        instance.call(Function::GetClock, |i| i.located(NativeType::Clock, &[0], 1, |_, _| Ok(())));
    assert_eq!(status, Status::Error);
}

/// x[1] = 1 + t reaches 2 at t = 1 s.
#[test]
fn a_step_returns_early_at_an_event_that_the_importer_handles() {
    let mut instance = initialized(InterfaceType::CoSimulation, true);
    assert_eq!(instance.core.state, State::EventMode);
    let update = |instance: &mut Instance<Linear>| {
        let mut event = None;
        instance.call(Function::UpdateDiscreteStates, |i| {
            event = Some(i.update_discrete_states_3()?);
            Ok(())
        });
        instance.call(Function::EnterStepMode, Instance::enter_step_mode);
        event.unwrap()
    };
    assert!(!update(&mut instance).new_discrete_states_needed);
    let step = instance.do_step_3(0.0, 1.5).unwrap();
    assert!((step.last_successful_time - 1.0).abs() < 1e-9, "{step:?}");
    assert!(step.early_return && step.event_handling_needed && !step.terminate_simulation);
    assert_eq!(instance.core.model.events, 0);
    let entered = instance.call(Function::EnterEventMode, Instance::enter_event_mode_3);
    assert_eq!(entered, Status::OK);
    update(&mut instance);
    assert_eq!(instance.core.model.events, 1);
    let time = step.last_successful_time;
    let step = instance.do_step_3(time, 0.5).unwrap();
    assert!(!step.early_return && step.last_successful_time == time + 0.5, "{step:?}");
}

/// A clock that ticks while an input is above 1.
#[derive(Clone, Serialize, Deserialize)]
struct Alarm {
    u: f64,
    high: bool,
}

impl Model for Alarm {
    const IDENTIFIER: &'static str = "Alarm";

    fn about(&self) -> About {
        About::default()
    }

    fn new(_: &Path) -> Result<Self, Failure> {
        Ok(Self { u: 0.0, high: false })
    }

    fn variables(&self) -> Vec<Variable<Self>> {
        vec![
            Variable::real("u", "input", |model: &mut Self| &mut model.u).input(),
            Variable::triggered_clock("high", "u > 1", |model: &mut Self| &mut model.high)
                .output(&["u"]),
        ]
    }

    fn tick(&mut self, _: f64) {
        self.high = self.u > 1.0;
    }

    fn model_exchange(&self) -> Option<ModelExchange> {
        Some(ModelExchange::default())
    }
}

#[test]
fn an_output_clock_follows_the_inputs_that_are_set_in_the_same_event() {
    let mut instance = instantiate::<Alarm>(InterfaceType::ModelExchange, false, false).unwrap();
    instance.call(Function::EnterInitializationMode, Instance::enter_initialization_mode);
    instance.call(Function::ExitInitializationMode, Instance::exit_initialization_mode_3);
    let u = describe_3::<Alarm>(Path::new("")).unwrap().variable("u").unwrap().value_reference;
    for (value, expected) in [(2.0, 1), (0.0, 0), (3.0, 1)] {
        let status = instance.call(Function::SetFloat64, |i| {
            i.set_located(NativeType::Float64, &[u], 1, |i, places| i.set_float64(places, &[value]))
        });
        let mut ticks = [0];
        instance.get_clock(&[0], room_of(&mut ticks));
        assert_eq!((status, ticks[0]), (Status::OK, expected), "{value}");
    }
}

#[test]
fn a_step_without_event_mode_handles_its_events_and_is_complete() {
    let mut instance = initialized(InterfaceType::CoSimulation, false);
    let step = instance.do_step_3(0.0, 1.5).unwrap();
    assert!(!step.early_return && !step.event_handling_needed && step.last_successful_time == 1.5);
    assert_eq!(instance.core.model.events, 1);
    let entered = instance.call(Function::EnterEventMode, Instance::enter_event_mode_3);
    assert_eq!(entered, Status::Error);
}

#[test]
fn an_adjoint_derivative_is_the_product_with_the_transposed_matrix() {
    let mut instance = initialized(InterfaceType::ModelExchange, false);
    instance.core.model.a = vec![1.0, 2.0, 3.0, 4.0];
    let jacobian = Jacobian {
        unknowns: &[reference("der(x)")],
        knowns: &[reference("x"), reference("u")],
        unknown_count: 2,
        known_count: 3,
    };
    let mut actual = [f64::NAN; 3];
    let status = instance.call(Function::GetAdjointDerivative, |i| {
        i.jacobian(&jacobian, |i, unknowns, knowns| {
            i.get_adjoint_derivative(unknowns, &[10.0, 1.0], knowns, room_of(&mut actual))
        })
    });
    assert_eq!((status, actual), (Status::OK, [13.0, 24.0, 1.0]));
}

#[test]
fn dependencies_are_given_for_each_element() {
    let instance = initialized(InterfaceType::ModelExchange, false);
    let actual = instance.dependencies(reference("der(x)")).unwrap();
    let on = |element: usize, name: &str, of: usize| {
        actual.iter().any(|dependency| {
            (dependency.element, dependency.known, dependency.element_of_known)
                == (element, reference(name), of)
        })
    };
    assert!(on(1, "x", 1) && on(1, "x", 2) && !on(1, "u", 0));
    assert!(on(2, "x", 1) && on(2, "u", 0) && on(2, "A", 4));
}

#[test]
fn an_event_indicator_is_a_variable() {
    let mut instance = initialized(InterfaceType::ModelExchange, false);
    assert_eq!(get(&mut instance, &["event_indicator[1]"], 1), (Status::OK, vec![1.0]));
    assert_eq!(set(&mut instance, "event_indicator[1]", &[1.0]), Status::Error);
}

#[test]
fn an_event_indicator_depends_on_all_knowns_as_its_description_states() {
    let (description, indicator) = (description(), reference("event_indicator[1]"));
    assert_eq!(description.structure.event_indicators[0].dependencies, None);
    let dependencies = |instance: &Instance<Linear>| instance.dependencies(indicator).unwrap();
    let all = dependencies(&initialized(InterfaceType::ModelExchange, false));
    let on = |name: &str| all.iter().filter(|one| one.known == reference(name)).count();
    assert_eq!(["time", "u", "A", "x"].map(on), [1, 1, 4, 2]);
    assert_eq!(all.len(), 8);
    let starting = instantiate(InterfaceType::ModelExchange, false, false).unwrap();
    assert!(dependencies(&starting).is_empty());
}

#[test]
fn event_mode_of_co_simulation_is_refused_without_has_event_mode() {
    assert!(instantiate::<super::Decay>(InterfaceType::CoSimulation, true, true).is_err());
    assert!(instantiate::<super::Decay>(InterfaceType::ModelExchange, false, false).is_err());
}

#[test]
fn a_saved_state_keeps_event_mode() {
    let instance = initialized(InterfaceType::CoSimulation, true);
    let bytes = instance.snapshot().to_bytes().unwrap();
    let snapshot = Snapshot::from_bytes(&bytes, instance.guid()).unwrap();
    let mut other = instantiate::<Linear>(InterfaceType::CoSimulation, true, true).unwrap();
    assert_eq!(other.restore(&snapshot), Ok(()));
    assert_eq!(other.core.state, State::EventMode);
    let mut without = instantiate::<Linear>(InterfaceType::CoSimulation, false, true).unwrap();
    assert!(without.restore(&snapshot).is_err());
}

#[test]
fn categories_are_turned_on_and_off() {
    let mut instance = instantiate::<Linear>(InterfaceType::CoSimulation, false, false).unwrap();
    assert_eq!(instance.categories, None);
    instance.set_debug_logging_3(false, &[]).unwrap();
    assert_eq!(instance.categories, Some(Vec::new()));
    instance.set_debug_logging_3(true, &["logStatusFatal".to_owned()]).unwrap();
    assert_eq!(instance.categories, Some(vec!["logStatusFatal".to_owned()]));
    assert!(instance.set_debug_logging_3(true, &["logNothing".to_owned()]).is_err());
}

#[test]
fn a_step_with_the_model_s_own_end_of_the_simulation_says_so() {
    #[derive(Clone, Serialize, Deserialize)]
    struct Ending;
    impl Model for Ending {
        const IDENTIFIER: &'static str = "Ending";
        fn about(&self) -> About {
            About::default()
        }
        fn new(_: &Path) -> Result<Self, Failure> {
            Ok(Self)
        }
        fn variables(&self) -> Vec<Variable<Self>> {
            Vec::new()
        }
        fn step(&mut self, step: &Step) -> Result<(), Failure> {
            let time = if step.size > 1.0 { f64::NAN } else { step.start + 0.25 };
            Err(Failure::Terminated { time, message: "enough".to_owned() })
        }
    }
    for early in [false, true] {
        let mut instance =
            instantiate::<Ending>(InterfaceType::CoSimulation, false, early).unwrap();
        let step = instance.do_step_3(0.0, 1.0).unwrap();
        assert_eq!((step.early_return, step.last_successful_time), (early, 0.25));
        assert!(step.terminate_simulation);
        // If the model ends the simulation at the time NaN, the start of the step is the time reached, as in FMI 2.0.
        let mut instance =
            instantiate::<Ending>(InterfaceType::CoSimulation, false, early).unwrap();
        let step = instance.do_step_3(0.0, 2.0).unwrap();
        assert_eq!((step.early_return, step.last_successful_time), (early, 0.0));
        assert!(step.terminate_simulation);
    }
}

#[test]
fn a_call_out_of_order_is_an_error_after_which_the_instance_is_terminated() {
    for kind in [InterfaceType::CoSimulation, InterfaceType::ModelExchange] {
        for state in State::EVERY {
            for &function in Function::EVERY {
                let mut instance = instantiate::<Linear>(kind, false, false).unwrap();
                instance.core.state = state;
                let mut reached = false;
                let status = instance.call(function, |_| {
                    reached = true;
                    Ok(())
                });
                let legal = allowed(kind, function, state);
                assert_eq!(reached, legal, "{function:?} in {state:?}");
                let expected = match (state, legal) {
                    (State::Fatal, _) => (Status::Fatal, State::Fatal),
                    (_, true) => (Status::OK, state),
                    (_, false) => (Status::Error, State::Terminated),
                };
                assert_eq!((status, instance.core.state), expected, "{function:?} in {state:?}");
            }
        }
    }
}
