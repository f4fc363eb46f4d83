//! The requests to a worker, and the call of the instance that answers each. The commands that run in every step are
//! no requests; the module `words` encodes them.

use std::borrow::Cow;

use fmu_description::Experiment;
use serde::{Deserialize, Serialize};

use super::function::Function;
use super::perform::{invalid_command, reply};
use crate::error::events;
use slave::{CallError, Events, Slave};

/// A list that the master borrows from its caller, and that the worker owns after decoding.
type List<'a, T> = Cow<'a, [T]>;

/// Defines the requests that the worker itself answers, and the requests in the table, which its instance answers. A
/// row has the request, named as its [`Function`], with its arguments, and the call of the instance `$slave`.
macro_rules! requests {
    ($a:lifetime, $slave:ident; $($request:ident($($argument:ident: $type:ty),*) = $answer:expr;)*) => {
        /// A request to a worker.
        #[derive(Debug, PartialEq, Serialize, Deserialize)]
        pub(super) enum Request<$a> {
            /// Loads the FMU and creates an instance. The answer is an [`Opening`](super::message::Opening).
            #[serde(borrow)]
            Open(Open<$a>),
            /// Frees the instance and creates another one. The answer is an [`Opening`](super::message::Opening).
            Renew {
                name: &$a str,
                logging: bool,
            },
            /// Asks which process-wide settings the FMU has changed.
            ProcessChanges,
            Free,
            $($request($($type),*),)*
        }

        impl Request<'_> {
            /// Returns the function that the errors of the request name.
            pub(super) fn function(&self) -> Function {
                match self {
                    Request::Open(_) | Request::Renew { .. } | Request::ProcessChanges => {
                        Function::Instantiate
                    }
                    Request::Free => Function::Free,
                    $(Request::$request(..) => Function::$request,)*
                }
            }

            /// Lets the instance execute the request, and encodes the answer.
            pub(super) fn execute(self, $slave: &mut dyn Slave, answer: &mut Vec<u8>) {
                match self {
                    $(Request::$request($($argument),*) => reply($answer, answer),)*
                    other => reply(Err::<(), _>(invalid_command(other.function())), answer),
                }
            }
        }
    };
}

requests! { 'a, slave;
    SetDebugLogging(on: bool) = slave.set_debug_logging(on);
    SetupExperiment(experiment: Experiment) = slave.setup_experiment(&experiment);
    EnterInitializationMode() = slave.enter_initialization_mode();
    ExitInitializationMode() = slave.exit_initialization_mode();
    Terminate() = slave.terminate();
    Configure(list: List<'a, u32>, values: List<'a, i64>) = slave.configure(&list, &values);
    SetString(list: List<'a, u32>, values: List<'a, String>) = slave.set_string(&list, &values);
    SetBinary(list: List<'a, u32>, values: List<'a, Vec<u8>>) = slave.set_binary(&list, &values);
    SetInputDerivatives(list: List<'a, u32>, orders: List<'a, i32>, values: List<'a, f64>) =
        slave.set_input_derivatives(&list, &orders, &values);
    GetString(list: List<'a, u32>) = filled(list.len(), |values| slave.get_string(&list, values));
    GetBinary(list: List<'a, u32>) = filled(list.len(), |values| slave.get_binary(&list, values));
    GetOutputDerivatives(list: List<'a, u32>, orders: List<'a, i32>) =
        filled(list.len(), |values| slave.get_output_derivatives(&list, &orders, values));
    DirectionalDerivative(unknowns: List<'a, u32>, knowns: List<'a, u32>, seed: List<'a, f64>) =
        filled(unknowns.len(), |changes| {
            slave.directional_derivative(&unknowns, &knowns, &seed, changes)
        });
    SaveState(slot: usize) = slave.save_state(slot);
    RestoreState(slot: usize) = slave.restore_state(slot);
    SerializeState() = slave.serialize_state();
    DeserializeState(bytes: &'a [u8]) = slave.deserialize_state(bytes);
    HandOverEvents(stop: bool) = slave.hand_over_events(stop);
    NextEvent() = events(slave).and_then(Events::next_event);
    EnterEventMode() = events(slave).and_then(Events::enter_event_mode);
    UpdateDiscreteStates() = events(slave).and_then(Events::update_discrete_states);
    LeaveEventMode() = events(slave).and_then(Events::leave_event_mode);
}

/// The arguments of [`Request::Open`].
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Open<'a> {
    /// The folder of the unpacked FMU.
    pub(super) folder: &'a [u8],
    pub(super) name: &'a str,
    pub(super) logging: bool,
    pub(super) strict_binding: bool,
    pub(super) guard_arrays: bool,
    /// Memory limit of the worker in bytes; 0 for no limit.
    pub(super) memory_limit: u64,
    #[serde(borrow)]
    pub(super) preload: Vec<&'a [u8]>,
    /// The options of the integrator, for an instance for model exchange.
    pub(super) integration: Option<&'a str>,
}

impl Request<'_> {
    /// Returns whether lists that belong together are equally long.
    pub(super) fn has_matching_lists(&self) -> bool {
        match self {
            Request::Configure(references, values) => references.len() == values.len(),
            Request::SetBinary(references, values) => references.len() == values.len(),
            Request::SetString(references, values) => references.len() == values.len(),
            Request::SetInputDerivatives(references, orders, values) => {
                [orders.len(), values.len()] == [references.len(); 2]
            }
            Request::GetOutputDerivatives(references, orders) => references.len() == orders.len(),
            Request::DirectionalDerivative(_, knowns, seed) => knowns.len() == seed.len(),
            _ => true,
        }
    }
}

/// Returns `count` values that `fill` writes.
fn filled<T: Clone + Default>(
    count: usize,
    fill: impl FnOnce(&mut [T]) -> Result<(), CallError>,
) -> Result<Vec<T>, CallError> {
    let mut values = vec![T::default(); count];
    fill(&mut values).map(|()| values)
}

#[cfg(test)]
mod tests {
    use super::super::message::{decode, encode};
    use super::*;

    fn requests<'a>() -> [Request<'a>; 5] {
        let (logging, memory_limit) = (true, u64::MAX);
        let preload = vec![&b"a"[..], &[0xff, 0]];
        [
            Request::Open(Open {
                folder: b"/tmp/\xff",
                name: "grün",
                logging,
                strict_binding: true,
                guard_arrays: true,
                memory_limit,
                preload,
                integration: Some("stiff"),
            }),
            Request::SetString(
                vec![1, u32::MAX, 3].into(),
                ["", "a b", "Größe\n"].map(str::to_owned).to_vec().into(),
            ),
            Request::DirectionalDerivative([1, 2][..].into(), [7][..].into(), [-0.5][..].into()),
            Request::SetInputDerivatives(
                [1][..].into(),
                [-2][..].into(),
                [f64::INFINITY][..].into(),
            ),
            Request::DeserializeState(&[1, 2, 0]),
        ]
    }

    #[test]
    fn requests_pass_and_parts_of_them_are_refused() {
        for request in requests() {
            let mut bytes = vec![9; 3];
            encode(&request, &mut bytes);
            assert_eq!(decode::<Request<'_>>(&bytes), Some(request));
            for length in 0..bytes.len() {
                assert_eq!(decode::<Request<'_>>(&bytes[..length]), None, "{length}");
            }
            bytes.push(0);
            assert_eq!(decode::<Request<'_>>(&bytes), None, "one byte more");
        }
    }

    #[test]
    fn lists_that_belong_together_match_if_they_are_equally_long() {
        assert!(requests().iter().all(Request::has_matching_lists));
        let (two, one) = (|| [1, 2][..].into(), || [0.5][..].into());
        assert!(!Request::DirectionalDerivative(two(), two(), one()).has_matching_lists());
        let orders = [1, 2][..].into();
        assert!(!Request::SetInputDerivatives(two(), orders, one()).has_matching_lists());
    }
}
