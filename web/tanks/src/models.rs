//! The models of the three tanks, and the variables that the page shows.

use aso_controller::Design;

pub use three_tank::ThreeTank as Plant;

/// The design that `aso-ftc design` writes for `examples/three-tank/detection.toml`.
pub fn design() -> Design {
    use aso_controller::Matrix;
    use aso_controller::design::Estimator::Current;
    use aso_controller::design::detection::{DetectionDesign, TestDesign};
    use aso_controller::design::{Actuator, Defaults, Fault, Measurement, Signal};
    include!(concat!(env!("OUT_DIR"), "/design.rs"))
}

/// The variables of a row, after the time.
pub const COLUMNS: [&str; 15] = [
    "plant.h_1",
    "plant.h_2",
    "plant.h_3",
    "plant.y_1",
    "plant.Q_1",
    "plant.Q_2",
    "plant.q_01",
    "plant.q_02",
    "controller.f_hat[1]",
    "controller.f_hat[2]",
    "controller.f_hat[3]",
    "controller.fault_detected",
    "controller.fault_isolated",
    "controller.t_detected",
    "controller.t_onset",
];
