//! Get and set: values of a list of variables through the calls of its plan.

use fmu_description::NativeType;

use super::Instance;
use super::buffer::Buffer;
use super::modes::Mode;
use super::plan::Run;
use super::unknown;
use crate::error::refused;
use slave::{CallError, Failure};

impl Instance {
    /// Performs `action` for each run (C call) of the plan of a list; an error if a reference belongs to no variable.
    fn for_runs(
        &mut self,
        function: &'static str,
        list: &[u32],
        mut action: impl FnMut(&mut Self, &mut Run) -> Result<(), CallError>,
    ) -> Result<(), CallError> {
        let plan = self.plans.find(&self.view, list);
        let plan = plan.map_err(|reference| unknown(function, reference))?;
        let mut runs = std::mem::take(self.plans.runs(plan));
        let done = runs.iter_mut().try_for_each(|run| action(self, run));
        *self.plans.runs(plan) = runs;
        done
    }

    /// Reads values. `fill` copies one value from a buffer, a text without allocation if there is room, and returns
    /// `None` on failure.
    pub(super) fn read<T>(
        &mut self,
        function: &'static str,
        list: &[u32],
        values: &mut [T],
        fill: fn(&Buffer, usize, &mut T) -> Option<()>,
    ) -> Result<(), CallError> {
        self.for_runs(function, list, |instance, run| {
            if run.kind == NativeType::Clock {
                instance.read_clocks(run)?;
            } else if instance.is_silent(run) {
                instance.recall(run);
            } else {
                run.buffer.get(&mut instance.component, &run.references)?;
            }
            for &(position, place) in &run.places {
                if fill(&run.buffer, place, &mut values[position]).is_none() {
                    let (name, kind) = (instance.view.name(list[position]), run.kind.name());
                    let failure = if run.kind == NativeType::UInt64 {
                        Failure::Unrepresentable(format!(
                            "gives {name} a value of type {kind} that the importer cannot \
                             represent: it has 64 bits with a sign"
                        ))
                    } else {
                        let what = format!("cannot read {name}, a variable of type {kind}");
                        Failure::InvalidAnswer(what)
                    };
                    let function = run.kind.getter();
                    return Err(CallError { function, failure, messages: Vec::new() });
                }
            }
            Ok(())
        })
    }

    /// Passes values. `put` stores one value in a buffer, and returns `None` on failure.
    pub(super) fn write<T: Clone + std::fmt::Debug>(
        &mut self,
        function: &'static str,
        list: &[u32],
        values: &[T],
        put: fn(&mut Buffer, usize, T) -> Option<()>,
    ) -> Result<(), CallError> {
        self.for_runs(function, list, |instance, run| {
            let silent = instance.is_silent(run);
            if run.partial && silent {
                instance.recall(run);
            } else if run.partial && run.kind != NativeType::Clock {
                run.buffer.get(&mut instance.component, &run.references)?;
            }
            for &(position, place) in &run.places {
                let value = &values[position];
                if put(&mut run.buffer, place, value.clone()).is_none() {
                    let (name, kind) = (instance.view.name(list[position]), run.kind.name());
                    let what = format!(
                        "cannot take the value {value:?} for {name}, expected a value of type {kind}"
                    );
                    return Err(refused(run.kind.setter(), what));
                }
            }
            if run.kind == NativeType::Clock {
                return instance.let_tick(function, run);
            }
            if !run.clocks.is_empty() {
                instance.remember(run);
            }
            if silent {
                // The values are passed when a clock of the run ticks.
                return Ok(());
            }
            if instance.may_set(run.event, &run.shadows, |place| run.buffer.bits(place))? {
                run.buffer.set(&mut instance.component, &run.references)?;
            }
            Ok(())
        })
    }

    /// Returns whether variables must be passed to the FMU. Enters Event Mode if a variable that may change in Event
    /// Mode only changes. `bits` returns the bits of the value at a place, which are compared with the bits set last.
    fn may_set(
        &mut self,
        event: bool,
        shadows: &[usize],
        bits: impl Fn(usize) -> u64,
    ) -> Result<bool, CallError> {
        if !(event && self.event_mode) || self.is_scheduled() {
            return Ok(true);
        }
        let mut changed = false;
        for (place, shadow) in shadows.iter().enumerate() {
            let value = Some(bits(place));
            changed |= self.state.held[*shadow] != value;
            self.state.held[*shadow] = value;
        }
        if self.state.mode != Mode::Step {
            return Ok(true);
        }
        if changed {
            self.enter_event()?;
        }
        Ok(changed)
    }
}
