//! Faults on the connections of Reals.

use super::reals::Reals;
use crate::fault::FaultChain;
use crate::system::Port;

impl Reals {
    /// Puts a fault on the way to an input; false where there is no such connected input.
    pub(crate) fn set_fault(&mut self, input: Port, fault: &FaultChain) -> bool {
        let Some(k) = self.layout.input_ports.iter().position(|&port| port == input) else {
            return false;
        };
        self.simple = false;
        self.faults.resize(self.layout.sources.len(), None);
        self.faults[k] = Some(fault.clone());
        true
    }

    /// Tells the faults the undisturbed values at `time`, which is reached for good.
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

    /// The first time past `after` at which a fault begins or ends.
    pub(crate) fn next_break(&self, after: f64) -> Option<f64> {
        let faults = self.faults.iter().flatten();
        faults.filter_map(|fault| fault.next_break(after)).reduce(f64::min)
    }

    /// The faults, for a checkpoint.
    pub(crate) fn faults(&mut self) -> impl Iterator<Item = &mut FaultChain> {
        self.faults.iter_mut().flatten()
    }
}
