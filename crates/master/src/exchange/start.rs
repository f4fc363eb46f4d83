//! Derivatives of outputs before the first step.

use super::{Exchange, call};
use crate::error::SystemError;
use crate::exchange::Reals;
use crate::system::System;
use slave::{CallError, Slave};

/// Passes for the derivatives at the start: first derivatives through two slaves, second through one.
const PASSES: usize = 3;

impl Exchange {
    /// At the start `time`, before a first step of `size` s: derivatives of all outputs, also of
    /// those that depend directly on inputs. Each pass brings them through one more slave.
    pub(crate) fn derive_at_start(
        &mut self,
        system: &mut System,
        (time, size): (f64, f64),
    ) -> Result<(), SystemError> {
        for _ in 0..PASSES {
            for slave in 0..system.slaves.len() {
                self.shift(slave, time, size);
            }
            for slave in 0..system.slaves.len() {
                self.reals.gather(slave, time, size);
                let (name, instance) = &mut system.slaves[slave];
                self.reals
                    .set_derivatives(slave, instance.as_mut())
                    .map_err(|source| call(name, time, source))?;
                self.read(system, slave, time)?;
            }
        }
        Ok(())
    }
}

impl Reals {
    /// Asks a slave for the derivatives of its connected outputs, and gives its connected inputs
    /// derivatives of 0.
    pub(crate) fn try_derivatives(
        &self,
        slave: usize,
        instance: &mut dyn Slave,
    ) -> (Result<(), CallError>, Result<(), CallError>) {
        let lane = &self.layout.port_maps[slave];
        let (mut outputs, mut inputs) = (Ok(()), Ok(()));
        if !lane.derived_outputs.is_empty() {
            let mut values = vec![0.0; lane.derived_outputs.len()];
            let (references, orders) = (&lane.derived_outputs, &lane.output_orders);
            outputs = instance.get_output_derivatives(references, orders, &mut values);
        }
        if !lane.derived_inputs.is_empty() {
            let values = vec![0.0; lane.derived_inputs.len()];
            inputs =
                instance.set_input_derivatives(&lane.derived_inputs, &lane.input_orders, &values);
        }
        (outputs, inputs)
    }

    /// Tells `slave` the gathered derivatives of its inputs before its first step: derivatives of
    /// outputs that depend directly on inputs are made of them.
    fn set_derivatives(&self, slave: usize, instance: &mut dyn Slave) -> Result<(), CallError> {
        let lane = &self.layout.port_maps[slave];
        if lane.derived_inputs.is_empty() {
            return Ok(());
        }
        let derivatives = &self.input_derivatives[lane.input_derivative_range.clone()];
        instance.set_input_derivatives(&lane.derived_inputs, &lane.input_orders, derivatives)
    }
}
