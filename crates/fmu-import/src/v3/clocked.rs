//! Clocked variables. The FMU has their values only while one of their clocks ticks, in Event Mode, and in
//! Initialization Mode (FMI 3.0.2, section 2.2.6). The slave remembers the outputs and locals of the last tick for
//! later reads, and the inputs for the next tick.

use std::collections::BTreeMap;

use fmu_description::{Causality, NativeType};
use serde::{Deserialize, Serialize};

use super::Instance;
use super::elements::ElementView;
use super::modes::Mode;
use super::plan::Run;
use crate::library::v3::Component;
use slave::CallError;

/// The value of an element.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum ElementValue {
    /// The bits of a number.
    Number(u64),
    Text(String),
    Bytes(Vec<u8>),
}

/// Values of clocked elements at their last tick, or to be set at their next one. The key is the position of the
/// element among all elements that may change in Event Mode only.
pub(super) type Memory = BTreeMap<usize, ElementValue>;

/// A value of type String or Binary.
pub(super) trait TextOrBytes: Clone + Default {
    fn to_value(&self) -> ElementValue;
    /// `None` if the value has another type.
    fn from_value(value: &ElementValue) -> Option<&Self>;
    /// Reads the values of whole variables.
    fn get(component: &mut Component, list: &[u32], values: &mut [Self]) -> Result<(), CallError>;
    /// Passes the values of whole variables.
    fn set(component: &mut Component, list: &[u32], values: &[Self]) -> Result<(), CallError>;
}

macro_rules! text_or_bytes {
    ($($type:ty: $variant:ident, $get:ident, $set:ident;)*) => {
        $(impl TextOrBytes for $type {
            fn to_value(&self) -> ElementValue {
                ElementValue::$variant(self.clone())
            }

            fn from_value(value: &ElementValue) -> Option<&Self> {
                if let ElementValue::$variant(value) = value { Some(value) } else { None }
            }

            fn get(
                component: &mut Component,
                list: &[u32],
                values: &mut [Self],
            ) -> Result<(), CallError> {
                component.$get(list, values)
            }

            fn set(component: &mut Component, list: &[u32], values: &[Self]) -> Result<(), CallError> {
                component.$set(list, values)
            }
        })*
    };
}

text_or_bytes! {
    String: Text, get_string, set_string;
    Vec<u8>: Bytes, get_binary, set_binary;
}

/// The calls for all clocked variables of an FMU.
#[derive(Debug, Default)]
pub(super) struct ClockedRuns {
    /// Inputs, one variable in each.
    inputs: Vec<Run>,
    /// Outputs and locals.
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
    /// Returns whether the variables of a run can be neither read nor set now: the initialization has ended, they are
    /// clocked, and none of their clocks ticks. In scheduled execution they always can.
    pub(super) fn is_silent(&self, run: &Run) -> bool {
        let is_clocked = !run.clocks.is_empty() && !self.is_scheduled();
        let ticks = || self.state.mode == Mode::Event && self.state.clocks.is_active(&run.clocks);
        is_clocked && self.state.mode.is_initialized() && !ticks()
    }

    /// Remembers the numbers in the buffer of a run.
    pub(super) fn remember(&mut self, run: &Run) {
        for (place, shadow) in run.shadows.iter().enumerate() {
            self.state.memory.insert(*shadow, ElementValue::Number(run.buffer.bits(place)));
        }
    }

    /// Puts the remembered numbers into the buffer of a run; elements without one are 0. Returns whether all have one.
    pub(super) fn recall(&self, run: &mut Run) -> bool {
        let mut all = true;
        for (place, shadow) in run.shadows.iter().enumerate() {
            let known = self.state.memory.get(shadow);
            let bits = match known {
                Some(ElementValue::Number(bits)) => Some(*bits),
                _ => None,
            };
            all &= bits.is_some();
            run.buffer.put_bits(place, bits.unwrap_or(0));
        }
        all
    }

    /// Remembers the Strings or binaries of a run.
    pub(super) fn remember_list<T: TextOrBytes>(&mut self, run: &Run, values: &[T]) {
        for (shadow, value) in run.shadows.iter().zip(values) {
            self.state.memory.insert(*shadow, value.to_value());
        }
    }

    /// Returns the remembered Strings or binaries of a run; `None` for an element without one.
    pub(super) fn recall_list<T: TextOrBytes>(&self, run: &Run) -> Vec<Option<T>> {
        let value = |shadow| self.state.memory.get(shadow).and_then(T::from_value).cloned();
        run.shadows.iter().map(value).collect()
    }

    /// Reads and remembers the clocked outputs and locals whose clocks tick.
    pub(super) fn read_clocked(&mut self) -> Result<(), CallError> {
        if self.clocked.others.is_empty() || !self.state.clocks.any_active() {
            return Ok(());
        }
        let mut runs = std::mem::take(&mut self.clocked.others);
        let done = runs.iter_mut().try_for_each(|run| {
            if !self.state.clocks.is_active(&run.clocks) {
                return Ok(());
            }
            match run.kind {
                NativeType::Clock => {}
                NativeType::String => self.read_and_remember::<String>(run)?,
                NativeType::Binary => self.read_and_remember::<Vec<u8>>(run)?,
                _ => {
                    run.buffer.get(&mut self.component, &run.references)?;
                    self.remember(run);
                }
            }
            Ok(())
        });
        self.clocked.others = runs;
        done
    }

    fn read_and_remember<T: TextOrBytes>(&mut self, run: &Run) -> Result<(), CallError> {
        let mut values = vec![T::default(); run.shadows.len()];
        T::get(&mut self.component, &run.references, &mut values)?;
        self.remember_list(run, &values);
        Ok(())
    }

    /// Passes the values that were set last to the clocked inputs of `clocks`, which have started to tick. Inputs that
    /// were never set are left as they are.
    pub(super) fn set_clocked(&mut self, clocks: &[u32]) -> Result<(), CallError> {
        let mut runs = std::mem::take(&mut self.clocked.inputs);
        let done = runs.iter_mut().try_for_each(|run| {
            if !run.clocks.iter().any(|clock| clocks.contains(clock)) {
                return Ok(());
            }
            match run.kind {
                NativeType::String => self.set_remembered::<String>(run),
                NativeType::Binary => self.set_remembered::<Vec<u8>>(run),
                NativeType::Clock => Ok(()),
                _ => {
                    if !self.recall(run) {
                        return Ok(());
                    }
                    run.buffer.set(&mut self.component, &run.references)
                }
            }
        });
        self.clocked.inputs = runs;
        done
    }

    fn set_remembered<T: TextOrBytes>(&mut self, run: &Run) -> Result<(), CallError> {
        let values: Option<Vec<T>> = self.recall_list(run).into_iter().collect();
        values.map_or(Ok(()), |all| T::set(&mut self.component, &run.references, &all))
    }
}
