//! Run-time data of a variable, indexed by value reference.

use crate::variable::{Declaration, Field};
use fmu_description::{Causality, Initial, IntervalVariability, Variability};
use fmu_description::{call_order::settable, call_order3};

/// A variable of base type `T`; its position in [`Interface`](super::Interface) follows from its value reference.
#[expect(clippy::struct_excessive_bools, reason = "facts that are independent")]
pub(crate) struct Slot<M, T> {
    pub(crate) name: String,
    pub(crate) causality: Causality,
    pub(crate) variability: Variability,
    pub(crate) initial: Option<Initial>,
    pub(crate) is_state: bool,
    /// Whether an event may change the state.
    pub(crate) is_reinitialised: bool,
    /// Whether `Outputs` or `Derivatives` lists the variable or an alias of it.
    pub(crate) is_unknown: bool,
    /// Whether `InitialUnknowns` lists the variable or an alias of it.
    pub(crate) is_initial_unknown: bool,
    /// Smallest and largest value of a Real or Integer; finite.
    pub(crate) range: (f64, f64),
    /// The states of an instance in which the variable may be set: a set of
    /// [`State::bit`](fmu_description::call_order::State)s.
    pub(crate) settable: u16,
    /// The values of an enumeration; empty for all other types.
    pub(crate) items: Vec<i32>,
    /// The constant interval of a periodic clock in s.
    pub(crate) interval: Option<f64>,
    /// How the model determines the intervals; `None` unless the variable is a timed clock.
    pub(crate) interval_variability: Option<IntervalVariability>,
    pub(crate) field: Field<M, T>,
    /// The derivatives of a Real; the interval of a clock that the model determines.
    pub(crate) derivatives: Vec<Field<M, f64>>,
}

/// A slot without its field, which determines the base type.
pub(crate) struct SlotBuilder<M> {
    name: String,
    causality: Causality,
    variability: Variability,
    initial: Option<Initial>,
    range: (f64, f64),
    items: Vec<i32>,
    interval: Option<f64>,
    interval_variability: Option<IntervalVariability>,
    derivatives: Vec<Field<M, f64>>,
}

impl<M> SlotBuilder<M> {
    pub(super) fn new(variable: Declaration, derivatives: Vec<Field<M, f64>>) -> Self {
        let (min, max) = (variable.number.min, variable.number.max);
        Self {
            name: variable.name,
            causality: variable.causality,
            variability: variable.variability,
            initial: variable.initial,
            range: (min.unwrap_or(f64::MIN), max.unwrap_or(f64::MAX)),
            items: variable
                .enumeration
                .map(|enumeration| enumeration.items.iter().map(|(_, value)| *value).collect())
                .unwrap_or_default(),
            interval: variable.number.interval,
            interval_variability: variable.number.interval_variability,
            derivatives,
        }
    }

    /// Same as [`SlotBuilder::build`] for a type that FMI 2.0 does not have: the rules of FMI 3.0 say when
    /// the variable may be set.
    pub(crate) fn build_3<T>(self, slots: &mut Vec<Slot<M, T>>, field: Field<M, T>) -> u32 {
        let settable = call_order3::settable(self.causality, self.variability, self.initial, None);
        let position = self.build(slots, field);
        slots[position as usize].settable = settable;
        position
    }

    /// Adds the field, appends the slot and returns its position.
    pub(super) fn build<T>(self, slots: &mut Vec<Slot<M, T>>, field: Field<M, T>) -> u32 {
        slots.push(Slot {
            name: self.name,
            causality: self.causality,
            variability: self.variability,
            initial: self.initial,
            is_state: false,
            is_reinitialised: false,
            is_unknown: false,
            is_initial_unknown: false,
            range: self.range,
            settable: settable(self.causality, self.variability, self.initial, false),
            items: self.items,
            interval: self.interval,
            interval_variability: self.interval_variability,
            field,
            derivatives: self.derivatives,
        });
        u32::try_from(slots.len() - 1).unwrap_or(u32::MAX)
    }
}
