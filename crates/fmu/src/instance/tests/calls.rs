//! Every function in every state, against the tables of the standard.

use super::pendulum::pendulum;
use super::{Decay, Instance, fresh};
use crate::model::Model;
use fmu_description::abi::Status;
use fmu_description::call_order::{Function, InterfaceType, State, allowed};

/// The tables of FMI 2.0.5, sections 3.2.3 and 4.2.4, cell by cell: `-` forbidden, `x` allowed, a
/// number allowed under that condition.
const TABLES: [(InterfaceType, &str); 2] = [
    (
        InterfaceType::ModelExchange,
        include_str!("../../../../fmu-description/src/call_order/section_3_2_3.csv"),
    ),
    (
        InterfaceType::CoSimulation,
        include_str!("../../../../fmu-description/src/call_order/section_4_2_4.csv"),
    ),
];

/// Function, state and cell, for every cell that belongs to a function with an instance.
fn cells(table: &str) -> Vec<(Function, State, String)> {
    let mut lines = table.lines();
    let states: Vec<_> = lines.next().unwrap().split(',').skip(1).collect();
    let mut cells = Vec::new();
    for line in lines {
        let (name, row) = line.split_once(',').unwrap();
        let Some(&function) = Function::EVERY.iter().find(|known| known.name() == name) else {
            assert!(["fmi2GetTypesPlatform", "fmi2GetVersion", "fmi2Instantiate"].contains(&name));
            continue;
        };
        for (state, cell) in states.iter().zip(row.split(',')).skip(1) {
            let known = State::EVERY.into_iter().find(|known| format!("{known:?}") == *state);
            cells.push((function, known.unwrap(), cell.to_owned()));
        }
    }
    cells
}

#[test]
fn a_function_may_be_called_exactly_in_the_states_of_sections_3_2_3_and_4_2_4() {
    for (interface, table) in TABLES {
        let cells = cells(table);
        for (function, state, cell) in &cells {
            let stated = cell != "-";
            assert_eq!(allowed(interface, *function, *state), stated, "{function:?} in {state:?}");
        }
        for &function in Function::EVERY {
            if cells.iter().all(|cell| cell.0 != function) {
                for (_, state, _) in &cells {
                    assert!(!allowed(interface, function, *state), "{function:?} in {state:?}");
                }
            }
        }
    }
}

/// Calls each function in each state: only an allowed call reaches the model. Any other call is an error after
/// which the instance is in the state error; after a fatal failure the state stays fatal.
fn call_in_every_state<M: Model>(interface: InterfaceType, instantiate: impl Fn() -> Instance<M>) {
    for state in State::EVERY {
        for &function in Function::EVERY {
            let mut instance = instantiate();
            instance.core.state = state;
            let mut reached = false;
            let status = instance.call(function, |_| {
                reached = true;
                Ok(())
            });
            let legal = allowed(interface, function, state);
            assert_eq!(reached, legal, "{function:?} in {state:?}");
            let expected = match (state, legal) {
                (State::Fatal, _) => (Status::Fatal, State::Fatal),
                (_, true) => (Status::OK, state),
                (_, false) => (Status::Error, State::Error),
            };
            assert_eq!((status, instance.core.state), expected, "{function:?} in {state:?}");
        }
    }
}

#[test]
fn a_call_out_of_order_is_an_error_and_never_reaches_the_model() {
    call_in_every_state::<Decay>(InterfaceType::CoSimulation, fresh);
    call_in_every_state(InterfaceType::ModelExchange, || pendulum(InterfaceType::ModelExchange));
}
