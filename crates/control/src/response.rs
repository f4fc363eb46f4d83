//! The response of a linear system to its input: gains, norms, step and frequency responses, and
//! the effect of faults on the closed loop.
//!
//! ```text
//! x' = A x + B w,  z = C x + D w             continuous
//! x[k+1] = A x[k] + B w[k],  z[k] = C x[k] + D w[k]      sampled
//! ```
//!
//! | question | answer |
//! |---|---|
//! | largest z for inputs w bounded by one | [`peak_gain`] |
//! | largest z for w of unit energy, energy of z for an impulse or white noise | [`energy`] |
//! | largest amplification of energy | [`h_infinity`] |
//! | amplification at one frequency | [`frequency_response`] |
//! | z for a step or a ramp of w | [`step_response`], [`ramp_response`], [`settled_output`] |
//! | bounds of errors and states of the loop of [`crate::aso`] under bounded faults | [`fault_bounds`] |
//! | peak gains of a sampled loop at all times, between its samples too | [`gains_between_samples`] |
//! | response of the loop of [`crate::aso`] to a reversal of friction | [`reversal`] |

mod between_samples;
mod energy;
mod fault;
mod fault_loop;
mod frequency;
mod h_infinity;
mod impulse_sum;
mod interval;
mod known;
mod peak_gain;
mod trace;
mod transient;

pub use between_samples::{SampledLoop, gains_between_samples};
pub use energy::{Energy, energy};
pub use fault::{FaultBounds, Reversal, fault_bounds, reversal};
pub use fault_loop::{error_part, fault_gains, fault_rate_system, fault_system};
pub use frequency::{FrequencyPoint, frequency_grid, frequency_response};
pub(crate) use frequency::{Transfer, grid, singular_values};
pub use h_infinity::{HInfinity, h_infinity};
pub(crate) use h_infinity::{continuous_equivalent, norm_of, original_frequency};
pub(crate) use known::{KnownResponse, resonances};
pub use peak_gain::{Bracket, peak_gain};
pub use trace::{TimeResponse, ramp_response, settled_output, step_response};
pub use transient::Transient;
