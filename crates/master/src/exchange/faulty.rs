//! Faults on the connections of Reals.

use super::reals::Reals;
use crate::fault::FaultChain;
use crate::system::Port;

impl Reals {
    /// Puts a fault on the connection to an input; returns false if no connection of Reals leads there.
    pub(crate) fn set_fault(&mut self, input: Port, fault: &FaultChain) -> bool {
        let Some(k) = self.layout.input_ports.iter().position(|&port| port == input) else {
            return false;
        };
        self.copies_latest = false;
        self.faults.resize(self.layout.sources.len(), None);
        self.faults[k] = Some(fault.clone());
        true
    }

    /// Records the undisturbed values in the faults at the final communication point `time`.
    pub(crate) fn commit(&mut self, time: f64) {
        for k in 0..self.faults.len() {
            if self.faults[k].is_none() {
                continue;
            }
            let value = self.value_at(self.layout.sources[k] as usize, time);
            if let Some(fault) = &mut self.faults[k] {
                fault.commit(time, self.layout.factors[k] * value + self.layout.offsets[k]);
            }
        }
    }

    /// Iterates over the faults, each with the input of its connection.
    pub(crate) fn faults(&self) -> impl Iterator<Item = (Port, &FaultChain)> {
        let inputs = self.layout.input_ports.iter().zip(&self.faults);
        inputs.filter_map(|(port, fault)| Some((*port, fault.as_ref()?)))
    }
}
