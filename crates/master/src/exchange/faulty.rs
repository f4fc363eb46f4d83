//! Faults on the connections of Reals.

use super::reals::Reals;
use crate::fault::FaultChain;
use crate::system::Port;

impl Reals {
    /// Puts a fault on the connection to an input; returns false if the input has no connection.
    pub(crate) fn set_fault(&mut self, input: Port, fault: &FaultChain) -> bool {
        let Some(k) = self.layout.input_ports.iter().position(|&port| port == input) else {
            return false;
        };
        self.copies_latest = false;
        self.faults.resize(self.layout.sources.len(), None);
        self.faults[k] = Some(fault.clone());
        true
    }

    /// Returns the faults on the connection to an input.
    pub(crate) fn fault(&self, input: Port) -> Option<&FaultChain> {
        let k = self.layout.input_ports.iter().position(|&port| port == input)?;
        self.faults.get(k)?.as_ref()
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

    /// Returns the first time after `after` at which a fault starts or ends.
    pub(crate) fn next_break(&self, after: f64) -> Option<f64> {
        let faults = self.faults.iter().flatten();
        faults.filter_map(|fault| fault.next_break(after)).reduce(f64::min)
    }

    /// Iterates over the faults, for a checkpoint.
    pub(crate) fn faults(&mut self) -> impl Iterator<Item = &mut FaultChain> {
        self.faults.iter_mut().flatten()
    }
}
