//! Serialised states of other builds of one FMU: the same description, other private fields.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::callbacks::Callbacks;
use crate::instance::{Instance, Snapshot};
use crate::interface::Interface;
use crate::model::{About, Failure, Model, Step};
use crate::variable::Variable;
use fmu_description::call_order::InterfaceType;

/// A build of the model Counter with these private fields.
macro_rules! build {
    ($build:ident { $($field:ident: $type:ty = $value:expr),* } $($more:item)*) => {
        mod $build {
            use super::*;

            $($more)*

            #[derive(Clone, Serialize, Deserialize)]
            pub(super) struct Counter {
                y: f64,
                $($field: $type,)*
            }

            impl Model for Counter {
                const IDENTIFIER: &'static str = "Counter";

                fn about(&self) -> About {
                    About::default()
                }

                fn new(_: &Path) -> Result<Self, Failure> {
                    Ok(Self { y: 0.0, $($field: $value),* })
                }

                fn variables(&self) -> Vec<Variable<Self>> {
                    vec![Variable::real("y", "", |slave: &mut Self| &mut slave.y).output(&[])]
                }

                fn step(&mut self, _: &Step) -> Result<(), Failure> {
                    Ok(())
                }
            }
        }
    };
}

build!(first { a: f64 = 1.0, b: f64 = 2.0 });
build!(second { b: f64 = 2.0, a: f64 = 1.0 });
build!(renamed { a: f64 = 1.0, c: f64 = 2.0 });
build!(retyped { a: f64 = 1.0, b: u64 = 0x4000_0000_0000_0000 });
build!(longer { a: f64 = 1.0, b: f64 = 2.0, c: Vec<f64> = Vec::new() });
build!(in_a_tuple { a: (f64, f64) = (1.0, 2.0) });
build!(inner { a: Part = Part { p: 1.0, q: 2.0 } }
    #[derive(Clone, Serialize, Deserialize)]
    pub(super) struct Part { p: f64, q: f64 }
);
build!(inner_swapped { a: Part = Part { p: 1.0, q: 2.0 } }
    #[derive(Clone, Serialize, Deserialize)]
    pub(super) struct Part { q: f64, p: f64 }
);
build!(listed { a: Vec<Option<Mode>> = vec![None, Some(Mode::On { level: 1 }), Some(Mode::Off)] }
    #[derive(Clone, Serialize, Deserialize)]
    pub(super) enum Mode { Off, On { level: i32 } }
);
build!(listed_swapped { a: Vec<Option<Mode>> = vec![None, Some(Mode::On { level: 1 }), Some(Mode::Off)] }
    #[derive(Clone, Serialize, Deserialize)]
    pub(super) enum Mode { On { level: i32 }, Off }
);

fn instance<M: Model>() -> Instance<M> {
    let none = Path::new("");
    let (_, description) = Interface::new(&mut M::new(none).unwrap()).unwrap();
    let callbacks = Callbacks::silent();
    Instance::new(InterfaceType::CoSimulation, none, &description.guid, callbacks).unwrap()
}

/// The message with which the build `To` refuses a state of the build `From` of the same FMU.
fn refusal<From: Model, To: Model>() -> Option<String> {
    let (from, to) = (instance::<From>(), instance::<To>());
    assert_eq!(from.guid(), to.guid(), "the descriptions are the same");
    let bytes = from.snapshot().to_bytes().unwrap();
    Snapshot::<To>::from_bytes(&bytes, to.guid()).err().map(|failure| failure.to_string())
}

#[test]
fn a_state_of_a_build_with_other_private_fields_is_refused() {
    for refused in [
        refusal::<first::Counter, second::Counter>(),
        refusal::<second::Counter, first::Counter>(),
        refusal::<first::Counter, renamed::Counter>(),
        refusal::<first::Counter, retyped::Counter>(),
        refusal::<first::Counter, longer::Counter>(),
        refusal::<longer::Counter, first::Counter>(),
        refusal::<first::Counter, in_a_tuple::Counter>(),
        refusal::<first::Counter, inner::Counter>(),
        refusal::<inner::Counter, inner_swapped::Counter>(),
        refusal::<listed::Counter, listed_swapped::Counter>(),
    ] {
        let message = refused.expect("refused");
        assert!(message.contains("another build of this FMU"), "{message}");
    }
}

#[test]
fn a_state_of_the_same_build_is_accepted() {
    for refused in [
        refusal::<first::Counter, first::Counter>(),
        refusal::<longer::Counter, longer::Counter>(),
        refusal::<inner_swapped::Counter, inner_swapped::Counter>(),
        refusal::<listed::Counter, listed::Counter>(),
    ] {
        assert_eq!(refused, None);
    }
}
