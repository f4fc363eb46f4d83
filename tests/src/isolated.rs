//! The misbehaving FMU `troubles` in a process of its own.

use std::time::Duration;

use fmu_description::Experiment;
use fmu_import::isolate::{self, Isolated, Options};
use master::Slave as _;

use crate::{command, troubles};

/// Options for isolation by the command `aso-ftc`, without a time limit.
#[must_use]
pub fn options() -> Options {
    Options { executable: Some(command().to_owned()), ..Options::default() }
}

/// Same as [`options`], with a time limit for each call.
#[must_use]
pub fn limited(milliseconds: u64) -> Options {
    Options { time_limit: Some(Duration::from_millis(milliseconds)), ..options() }
}

/// The misbehaving FMU, ready to step.
///
/// # Panics
///
/// If it cannot be isolated or initialised.
#[must_use]
pub fn ready(options: &Options) -> Isolated {
    let mut slave = isolate::open(troubles(), "one", options).expect("it can be isolated");
    slave.setup_experiment(&Experiment::default()).expect("set up");
    slave.enter_initialization_mode().expect("entered");
    slave.exit_initialization_mode().expect("left");
    slave
}
