//! What an instance of FMI 3.0 refuses, by the rules of section 2.

use std::path::Path;

use super::Decay;
use super::fmi3::{initialized, instantiate, set};
use super::pendulum::Pendulum;
use crate::callbacks::{Callbacks, IntermediateUpdate};
use crate::instance::{Instance, Instantiation};
use crate::model::Model;
use crate::room::room_of;
use crate::{Failure, describe_3};
use fmu_description::NativeType;
use fmu_description::abi::Status;
use fmu_description::call_order::{InterfaceType, State};
use fmu_description::call_order3::Function;

fn reference<M: Model>(name: &str) -> u32 {
    describe_3::<M>(Path::new("")).unwrap().variable(name).unwrap().value_reference
}

fn refusal(required: &[u32], intermediate: Option<IntermediateUpdate>) -> Option<String> {
    let token = describe_3::<Decay>(Path::new("")).unwrap().guid;
    let inner = Instantiation {
        interface_type: InterfaceType::CoSimulation,
        token: &token,
        resources: Path::new(""),
        logging_on: false,
        event_mode_used: false,
        early_return_allowed: false,
        intermediate,
        required,
    };
    let instance = Instance::<Decay>::new_3(&inner, Callbacks::silent());
    instance.err().map(|failure| failure.to_string())
}

#[test]
fn only_variables_with_intermediate_update_are_required_intermediate_variables() {
    let [drive, x] = ["drive", "x"].map(reference::<Decay>);
    for update in [None, Some(IntermediateUpdate::silent())] {
        assert_eq!(refusal(&[], update), None);
        assert_eq!(refusal(&[drive], update), None);
        for (required, name) in [(&[x][..], "of x,"), (&[drive, 999], "999 of no variable,")] {
            let message = refusal(required, update).unwrap();
            assert!(message.contains(name) && message.contains("intermediateUpdate"), "{message}");
        }
    }
}

#[test]
fn a_calculated_variable_is_not_set_although_the_variable_with_its_value_is() {
    let set = |name: &str| {
        let mut instance =
            instantiate::<Pendulum>(InterfaceType::CoSimulation, false, false).unwrap();
        let status = instance.call(Function::SetFloat64, |inner| {
            inner.set_located(
                NativeType::Float64,
                &[reference::<Pendulum>(name)],
                1,
                |inner, places| inner.set_float64(places, &[0.25]),
            )
        });
        (status, instance.core.state)
    };
    assert_eq!(set("der(angle)"), (Status::OK, State::Instantiated));
    assert_eq!(set("speed"), (Status::Error, State::Terminated));
}

#[test]
fn a_value_beyond_32_bits_is_refused_as_no_item_of_an_enumeration() {
    let mut instance = instantiate::<Pendulum>(InterfaceType::CoSimulation, false, false).unwrap();
    let side = [reference::<Pendulum>("side")];
    let refused = instance.set_located(NativeType::Int64, &side, 1, |inner, places| {
        inner.set_int64(places, &[5_000_000_000])
    });
    let reason = "side = 5000000000, expected one of [1, 2]".to_owned();
    assert_eq!(refused, Err(Failure::Discard(reason)));
}

#[test]
fn a_state_is_set_in_event_mode_of_model_exchange_only() {
    for (kind, expected) in
        [(InterfaceType::ModelExchange, Status::OK), (InterfaceType::CoSimulation, Status::Error)]
    {
        let mut instance = initialized(kind, true);
        assert_eq!(instance.core.state, State::EventMode);
        assert_eq!(set(&mut instance, "x", &[1.0, 2.0]), expected, "{kind:?}");
    }
}

#[test]
fn derivatives_of_a_model_without_them_are_an_error_for_empty_lists_too() {
    type Body = fn(&mut Instance<Decay>) -> Result<(), Failure>;
    let adjoint: Body = |inner| inner.get_adjoint_derivative(&[], &[], &[], room_of(&mut []));
    let directional: Body =
        |inner| inner.get_directional_derivative(&[], &[], &[], room_of(&mut []));
    for (function, body) in [
        (Function::GetAdjointDerivative, adjoint),
        (Function::GetDirectionalDerivative, directional),
    ] {
        let mut instance = instantiate::<Decay>(InterfaceType::CoSimulation, false, false).unwrap();
        instance.core.state = State::StepComplete;
        assert_eq!(instance.call(function, body), Status::Error, "{function:?}");
    }
}
