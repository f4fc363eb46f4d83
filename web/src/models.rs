//! The models of the paper, and the variables that the page shows.

use aso_controller::Design;

pub use plant::FrictionPendulum as Plant;

/// The design that the controller FMU contains.
pub fn design() -> Design {
    use aso_controller::Matrix;
    use aso_controller::design::{Actuator, Defaults, Fault, Measurement, Signal};
    include!(concat!(env!("OUT_DIR"), "/design.rs"))
}

/// The variables of a row, after the time.
pub const COLUMNS: [&str; 8] = [
    "plant.x_p",
    "plant.theta",
    "plant.v_p",
    "plant.omega",
    "plant.f_fric",
    "plant.regime",
    "controller.u",
    "controller.f_hat",
];
