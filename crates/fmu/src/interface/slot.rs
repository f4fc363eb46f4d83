//! One variable as an instance reaches it.

use crate::variable::{Access, Field, Variable};
use fmu_description::call_order::settable;
use fmu_description::{Causality, Initial, Variability};

/// One variable of base type `T`; its position in [`Interface`] is its value reference.
pub(crate) struct Slot<M, T> {
    pub(crate) name: String,
    pub(crate) causality: Causality,
    pub(crate) variability: Variability,
    pub(crate) initial: Option<Initial>,
    pub(crate) is_state: bool,
    /// Listed under `Outputs` or `Derivatives`, by this name or an alias.
    pub(crate) is_unknown: bool,
    /// Listed under `InitialUnknowns`, by this name or an alias.
    pub(crate) is_initial_unknown: bool,
    /// Smallest and largest value of a Real or Integer; finite.
    pub(crate) range: (f64, f64),
    /// The states in which it may be set, as a set of [`State::bit`](fmu_description::call_order::State).
    pub(crate) settable: u16,
    /// The values of an enumeration; empty for all other types.
    pub(crate) items: Vec<i32>,
    pub(crate) field: Field<M, T>,
    pub(crate) derivatives: Vec<Field<M, f64>>,
}

/// A slot whose field is still to come.
pub(super) struct Blank<M> {
    name: String,
    causality: Causality,
    variability: Variability,
    initial: Option<Initial>,
    range: (f64, f64),
    items: Vec<i32>,
    derivatives: Vec<Field<M, f64>>,
}

impl<M> Blank<M> {
    pub(super) fn of(variable: Variable<M>) -> (Self, Access<M>) {
        let (min, max) = (variable.number.min, variable.number.max);
        let blank = Self {
            name: variable.name,
            causality: variable.causality,
            variability: variable.variability,
            initial: variable.initial,
            range: (min.unwrap_or(f64::MIN), max.unwrap_or(f64::MAX)),
            items: variable
                .enumeration
                .map(|own| own.items.iter().map(|(_, value)| *value).collect())
                .unwrap_or_default(),
            derivatives: variable.derivatives,
        };
        (blank, variable.access)
    }

    /// Appends the slot and returns its position.
    pub(super) fn fill<T>(self, slots: &mut Vec<Slot<M, T>>, field: Field<M, T>) -> u32 {
        slots.push(Slot {
            name: self.name,
            causality: self.causality,
            variability: self.variability,
            initial: self.initial,
            is_state: false,
            is_unknown: false,
            is_initial_unknown: false,
            range: self.range,
            settable: settable((self.causality, self.variability), self.initial, false),
            items: self.items,
            field,
            derivatives: self.derivatives,
        });
        u32::try_from(slots.len() - 1).unwrap_or(u32::MAX)
    }
}
