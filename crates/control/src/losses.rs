//! Loss of effectiveness of actuators: its estimate, and the losses for which the loop is stable.

mod lossy_loop;
mod tolerance;

#[cfg(feature = "lmi")]
pub use lossy_loop::CertifiedLoss;
pub use lossy_loop::{ConstantLimit, LossyLoop};
pub use tolerance::{LossTolerance, estimated_loss, loss_tolerance};
