//! Detection and isolation of faults: residuals without the effect of unknown inputs, tests with a stated
//! rate of false alarms, predicted detection delays.
//!
//! | task | item |
//! |---|---|
//! | white residuals, insensitive to unknown inputs and to other faults | [`detection_filter`] |
//! | what a fault does to a residual | [`DetectionFilter::effect`], [`mean_after_step`], [`mean_of_constant`] |
//! | test of one residual by cumulative sums | [`Cusum`] |
//! | test of the mean of several residuals over a window | [`WindowTest`] |
//! | what errors of the model do to residuals | [`UncertainPlant::largest_mean`] |
//! | chi-square distribution, central and noncentral | [`chi_square`] |
//!
//! The filter is a Kalman filter of the plant without faults, so that its residuals are white: the false
//! alarms and the delays of the tests then follow from the normal distribution alone. Unknown inputs are
//! removed exactly where the measurements allow it (unknown-input observer), and modelled as a random walk
//! otherwise ([`NoisyPlant::with_random_walk`]).

pub mod chi_square;
mod cusum;
mod delay;
mod effect;
mod filter;
mod model_error;
mod window;

pub use cusum::Cusum;
pub use delay::Delay;
pub use effect::{mean_after_step, mean_of_constant};
pub use filter::{DetectionFilter, NoisyPlant, UnknownInput, detection_filter};
pub use model_error::UncertainPlant;
pub use window::WindowTest;
