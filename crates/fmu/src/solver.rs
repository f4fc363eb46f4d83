//! Integration of ordinary differential equations with located events.
//!
//! The default [`Model::step`](crate::Model::step) uses this module; an author needs it for another step only:
//!
//! * [`Integrator`] integrates a [`System`] of any size with an adaptive step and stops at the first
//!   state event.
//! * [`Step`] is one step of the method, for arrays (`[f64; 4]`) and vectors.
//! * [`Quartic`] estimates the first point at which a margin, the distance to an event, becomes negative; [`search`]
//!   and [`locate`] find it.
//!
//! Method: Dormand-Prince of order 5(4). The method suits systems that are not stiff; an importer integrates a stiff
//! model better by model exchange.
//!
//! ```
//! use fmu::Failure;
//! use fmu::solver::{Integrator, Reached, System};
//!
//! /// A falling stone, `h' = v`, `v' = -9.81`; the event indicator is the height.
//! struct Stone;
//!
//! impl System for Stone {
//!     fn derivative(&mut self, _: f64, y: &[f64], slope: &mut [f64]) -> Result<(), Failure> {
//!         slope.copy_from_slice(&[y[1], -9.81]);
//!         Ok(())
//!     }
//!     fn indicators(&mut self, _: f64, y: &[f64], z: &mut [f64]) -> Result<(), Failure> {
//!         z[0] = y[0];
//!         Ok(())
//!     }
//! }
//!
//! let mut integrator = Integrator::new(vec![1.0; 2], 1);
//! integrator.start(&mut Stone, 0.0, &[1.0, 0.0], 2.0)?;
//! assert_eq!(integrator.advance(&mut Stone, 2.0)?, Reached::Event);
//! assert!((integrator.time() - (2.0_f64 / 9.81).sqrt()).abs() < 1e-14);
//! # Ok::<(), Failure>(())
//! ```

mod crossing;
mod dormand_prince;
mod indicators;
mod integrator;
#[cfg(test)]
mod tests;

pub use crossing::{Crossing, Quartic, locate, search};
pub use dormand_prince::{Step, Vector};
pub(crate) use integrator::TOLERANCE;
pub use integrator::{Integrator, Reached, System};
