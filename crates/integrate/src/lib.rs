//! Integrates model-exchange FMUs: [`Integrated`] presents an instance as a [`slave::Slave`], so that a
//! co-simulation master steps it like a co-simulation FMU.
//!
//! Between events, the states follow an explicit Runge-Kutta method of order 5 or, where the equations
//! are stiff, a Rosenbrock method of order 4; both have adaptive steps. State events are located in the
//! continuous extension of a step by the signs of the event indicators. Time events end a step. After
//! each event, the discrete states are iterated until they agree.
//!
//! Both methods are written here. Solvers of other crates, diffsol among them, take the right-hand side as a function
//! that cannot fail and borrow it as long as they live: an FMU that refuses a state (`fmi2Discard`) could not shorten
//! the step, its error would be lost, and neither an FMU state nor a checkpoint could contain the solver. Multistep
//! methods would restart at order 1 at each communication point, because inputs jump there. The methods here have one
//! step, report the FMU's error, allocate nothing while they step, and their state is a few numbers.
#![forbid(unsafe_code)]

mod explicit;
mod inputs;
mod integrated;
mod method;
mod rosenbrock;
mod start;
mod stepper;

pub use integrated::{Integrated, Options, description_of};
pub use method::Method;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
