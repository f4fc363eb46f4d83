//! Clocked variables. A clocked variable has a value only while one of its clocks ticks, in Event Mode, and in
//! Initialization Mode (FMI 3.0.2, section 2.2.6). The slave remembers the outputs and locals of the last tick for
//! later reads, and the inputs for the next tick.

use std::collections::BTreeMap;

use super::Instance;
use super::buffer::ElementValue;
use super::elements::ElementView;
use super::modes::Mode;
use super::plan::Run;
use fmu_description::{Causality, NativeType};
use slave::CallError;

/// Values of clocked elements at their last tick, or to be set at their next tick. The key is the position of the
/// element among all elements that may change in Event Mode only.
pub(super) type Memory = BTreeMap<usize, ElementValue>;

/// The calls for all clocked variables of an FMU.
#[derive(Debug, Default)]
pub(super) struct ClockedRuns {
    /// Runs of clocked inputs, one variable in each run.
    inputs: Vec<Run>,
    /// Runs of clocked outputs and local variables.
    others: Vec<Run>,
}

impl ClockedRuns {
    pub(super) fn new(view: &ElementView) -> Self {
        let clocked = || view.variables.iter().filter(|variable| !variable.clocks.is_empty());
        let is_input =
            |variable: &&super::elements::Variable| variable.causality == Causality::Input;
        let inputs = clocked().filter(is_input).flat_map(|variable| Run::of_whole([variable]));
        let inputs = inputs.collect();
        Self { inputs, others: Run::of_whole(clocked().filter(|variable| !is_input(variable))) }
    }
}

impl Instance {
    /// Returns whether the variables of a run can be neither read nor set now: the initialization has ended, the
    /// variables are clocked, and no clock of theirs ticks. False in scheduled execution.
    pub(super) fn is_silent(&self, run: &Run) -> bool {
        let is_clocked = !run.clocks.is_empty() && !self.is_scheduled();
        let ticks = || self.state.mode == Mode::Event && self.state.clocks.is_active(&run.clocks);
        is_clocked && self.state.mode.is_initialized() && !ticks()
    }

    /// Remembers the values in the buffer of a run.
    pub(super) fn remember(&mut self, run: &Run) {
        for (place, shadow) in run.shadows.iter().enumerate() {
            self.state.memory.insert(*shadow, run.buffer.value(place));
        }
    }

    /// Copies the remembered values into the buffer of a run; an element without a remembered value becomes 0 or
    /// empty. Returns whether every element had one.
    pub(super) fn recall(&self, run: &mut Run) -> bool {
        let mut all = true;
        for (place, shadow) in run.shadows.iter().enumerate() {
            all &= run.buffer.put_value(place, self.state.memory.get(shadow));
        }
        all
    }

    /// Reads and remembers the clocked outputs and locals whose clocks tick.
    pub(super) fn read_clocked(&mut self) -> Result<(), CallError> {
        if self.clocked.others.is_empty() || !self.state.clocks.any_active() {
            return Ok(());
        }
        let mut runs = std::mem::take(&mut self.clocked.others);
        let done = runs.iter_mut().try_for_each(|run| {
            if run.kind != NativeType::Clock && self.state.clocks.is_active(&run.clocks) {
                run.buffer.get(&mut self.component, &run.references)?;
                self.remember(run);
            }
            Ok(())
        });
        self.clocked.others = runs;
        done
    }

    /// Passes the values that were set last to the clocked inputs of `clocks`, which have started to tick. Inputs that
    /// were never set are left as they are.
    pub(super) fn set_clocked(&mut self, clocks: &[u32]) -> Result<(), CallError> {
        let mut runs = std::mem::take(&mut self.clocked.inputs);
        let is_set = |run: &&mut Run| {
            run.kind != NativeType::Clock && run.clocks.iter().any(|clock| clocks.contains(clock))
        };
        let done = runs.iter_mut().filter(is_set).try_for_each(|run| {
            if self.recall(run) {
                run.buffer.set(&mut self.component, &run.references)
            } else {
                Ok(())
            }
        });
        self.clocked.inputs = runs;
        done
    }
}
