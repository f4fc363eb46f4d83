//! Initialization of the connected system.

use fmi2::Experiment;

use crate::error::SystemError;
use crate::exchange::{Exchange, call};
use crate::order::Order;
use crate::system::System;

/// Initialises all slaves; the connected values are exchanged in initialization mode until each has
/// passed through every slave.
pub(super) fn initialise(
    system: &mut System,
    exchange: &mut Exchange,
    order: &Order,
    experiment: &Experiment,
) -> Result<(), SystemError> {
    let start = experiment.start_time;
    for (name, slave) in &mut system.slaves {
        slave
            .setup_experiment(experiment)
            .and_then(|()| slave.enter_initialization_mode())
            .map_err(|source| call(name, start, source))?;
    }
    for &slave in &order.sequence {
        exchange.read_values(system, slave, start)?;
    }
    for _ in 0..=system.slaves.len() {
        for &slave in &order.sequence {
            exchange.set(system, slave, start)?;
            exchange.read_values(system, slave, start)?;
        }
    }
    for (name, slave) in &mut system.slaves {
        slave.exit_initialization_mode().map_err(|source| call(name, start, source))?;
    }
    for slave in 0..system.slaves.len() {
        exchange.read(system, slave, start)?;
    }
    exchange.reals.forget();
    Ok(())
}
