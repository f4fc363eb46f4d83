//! Output derivatives at the start time, before the first step.

use super::Exchange;
use crate::error::SystemError;
use crate::exchange::Reals;
use crate::system::System;
use slave::{CallError, Slave};

/// Number of passes: three passes carry first derivatives through two slaves and second derivatives through one.
const PASSES: usize = 3;

impl Exchange {
    /// Computes the derivatives of all outputs at the start time, before a first step of `size` s, including outputs
    /// that depend directly on inputs. Each pass carries derivatives through one more slave.
    pub(crate) fn derive_at_start(
        &mut self,
        system: &mut System,
        time: f64,
        size: f64,
    ) -> Result<(), SystemError> {
        for _ in 0..PASSES {
            for slave in 0..system.slaves.len() {
                self.shift(slave, time, size);
            }
            for slave in 0..system.slaves.len() {
                self.reals.gather(slave, time, size);
                let reals = &self.reals;
                system.perform(slave, time, |instance| reals.set_derivatives(slave, instance))?;
                self.read(system, slave, time)?;
            }
        }
        Ok(())
    }
}

impl Reals {
    /// Tests whether a slave supports derivatives: reads derivatives of its connected outputs and sets derivatives of 0
    /// at its connected inputs. Returns the results for outputs and for inputs.
    pub(crate) fn try_derivatives(
        &self,
        slave: usize,
        instance: &mut dyn Slave,
    ) -> (Result<(), CallError>, Result<(), CallError>) {
        let port_map = &self.layout.port_maps[slave];
        let (mut outputs, mut inputs) = (Ok(()), Ok(()));
        if !port_map.derived_outputs.is_empty() {
            let mut values = vec![0.0; port_map.derived_outputs.len()];
            let (references, orders) = (&port_map.derived_outputs, &port_map.output_orders);
            outputs = instance.get_output_derivatives(references, orders, &mut values);
        }
        if !port_map.derived_inputs.is_empty() {
            let values = vec![0.0; port_map.derived_inputs.len()];
            inputs = instance.set_input_derivatives(
                &port_map.derived_inputs,
                &port_map.input_orders,
                &values,
            );
        }
        (outputs, inputs)
    }

    /// Sets the gathered input derivatives of `slave` before its first step; output derivatives
    /// that depend directly on inputs follow from them.
    fn set_derivatives(&self, slave: usize, instance: &mut dyn Slave) -> Result<(), CallError> {
        let port_map = &self.layout.port_maps[slave];
        if port_map.derived_inputs.is_empty() {
            return Ok(());
        }
        let derivatives = &self.input_derivatives[port_map.input_derivative_range.clone()];
        instance.set_input_derivatives(
            &port_map.derived_inputs,
            &port_map.input_orders,
            derivatives,
        )
    }
}
