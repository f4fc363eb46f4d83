//! Clocks: the ones that tick in an event, and their intervals (section 2.2.8).

use super::super::Instance;
use crate::interface::{Native, Slot};
use crate::model::{Failure, Model};
use crate::room::Room;
use fmu_description::abi3::{IntervalQualifier, fmi3Clock};
use fmu_description::{Causality, IntervalVariability as Variability};

impl<M: Model> Instance<M> {
    /// Lets the model tick its clocks: when event mode starts, after a clock or a variable was set, and before discrete
    /// states are updated again.
    pub(super) fn tick(&mut self) {
        if !bool::slots(&self.interface.typed).is_empty() {
            self.core.model.tick(self.core.time);
        }
    }

    /// Ends the ticks of all clocks.
    pub(super) fn clear_clocks(&mut self) {
        for clock in bool::slots(&self.interface.typed) {
            *(clock.field)(&mut self.core.model) = false;
        }
    }

    /// Whether a clock ticks.
    pub(super) fn ticks(&mut self) -> bool {
        let clocks = bool::slots(&self.interface.typed);
        clocks.iter().any(|clock| *(clock.field)(&mut self.core.model))
    }

    /// Runs `read` on the values after the present event: handles the event, and restores the model afterwards. A
    /// clocked variable has its new value while its clock ticks, and `fmi3UpdateDiscreteStates` keeps this value
    /// (section 2.2.8.3).
    #[inline(never)]
    pub(super) fn at_tick(
        &mut self,
        read: impl FnOnce(&mut Self) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        self.core.check()?;
        let (model, stale) = (self.core.model.clone(), self.core.stale);
        let handled = self.core.model.event(self.core.time);
        self.core.stale = true;
        let result = handled.and_then(|_| read(self));
        (self.core.model, self.core.stale) = (model, stale);
        result
    }

    /// `fmi3GetClock`.
    pub(crate) fn get_clock(&mut self, places: &[u32], to: &mut Room<fmi3Clock>) {
        let clocks = bool::slots(&self.interface.typed);
        for (&place, value) in places.iter().zip(to) {
            let ticks =
                clocks.get(place as usize).map(|clock| *(clock.field)(&mut self.core.model));
            value.write(ticks.unwrap_or(false).into());
        }
    }

    /// `fmi3SetClock`: sets all input clocks or, after a failure, none.
    pub(crate) fn set_clock(
        &mut self,
        places: &[u32],
        values: &[fmi3Clock],
    ) -> Result<(), Failure> {
        let clocks = bool::slots(&self.interface.typed);
        let named = places.iter().filter_map(|place| clocks.get(*place as usize));
        if let Some(other) = named.into_iter().find(|clock| clock.causality != Causality::Input) {
            let (name, causality) = (&other.name, other.causality.as_str());
            return Err(Failure::Error(format!(
                "{name} is a clock with causality {causality}: only an input clock can be set"
            )));
        }
        for (&place, &value) in places.iter().zip(values) {
            if let Some(clock) = clocks.get(place as usize) {
                *(clock.field)(&mut self.core.model) = value != 0;
            }
        }
        self.tick();
        Ok(())
    }

    /// `fmi3GetIntervalDecimal`: intervals in s. An error for a triggered clock.
    pub(crate) fn get_intervals(
        &mut self,
        places: &[u32],
        intervals: &mut Room<f64>,
        qualifiers: &mut Room<i32>,
    ) -> Result<(), Failure> {
        self.refresh()?;
        for ((&place, interval), qualifier) in places.iter().zip(intervals).zip(qualifiers) {
            let (length, kind) = self.interval(place)?;
            interval.write(length);
            qualifier.write(kind as i32);
        }
        Ok(())
    }

    /// `fmi3GetShiftDecimal`: 0, because the first tick of every periodic clock is at the start time. An error for a
    /// clock that is not periodic.
    pub(crate) fn get_shifts(&self, places: &[u32], shifts: &mut Room<f64>) -> Result<(), Failure> {
        for (&place, shift) in places.iter().zip(shifts) {
            let clock = bool::slots(&self.interface.typed).get(place as usize);
            let is_periodic = |clock: &Slot<M, bool>| {
                let variability = clock.interval_variability;
                clock.interval.is_some()
                    || matches!(variability, Some(Variability::Fixed | Variability::Tunable))
            };
            if !clock.is_some_and(is_periodic) {
                let name = clock.map(|clock| clock.name.as_str()).unwrap_or_default();
                return Err(Failure::Error(format!(
                    "{name} is no periodic clock: it has no shift"
                )));
            }
            shift.write(0.0);
        }
        Ok(())
    }

    /// Returns the interval of a clock in s with its qualifier. The interval of a clock that is changing or a countdown
    /// is `Changed` at its first read, then `Unchanged` or `NotYetKnown`; the interval of any other timed clock is
    /// always `Changed`. An error for a triggered clock.
    fn interval(&mut self, place: u32) -> Result<(f64, IntervalQualifier), Failure> {
        let clock = bool::slots(&self.interface.typed).get(place as usize);
        if let Some(interval) = clock.and_then(|clock| clock.interval) {
            return Ok((interval, IntervalQualifier::Changed));
        }
        let field = clock.and_then(|clock| clock.derivatives.first());
        let model = &mut self.core.model;
        Ok(match (clock.and_then(|clock| clock.interval_variability), field) {
            (Some(Variability::Fixed | Variability::Tunable), Some(field)) => {
                (*field(model), IntervalQualifier::Changed)
            }
            (Some(variability), Some(field)) => {
                let interval = std::mem::replace(field(model), f64::INFINITY);
                if interval.is_finite() {
                    (interval, IntervalQualifier::Changed)
                } else if variability == Variability::Countdown {
                    (0.0, IntervalQualifier::NotYetKnown)
                } else {
                    (0.0, IntervalQualifier::Unchanged)
                }
            }
            _ => {
                let name = clock.map(|clock| clock.name.as_str()).unwrap_or_default();
                let what = format!("{name} is a triggered clock: it has no interval");
                return Err(Failure::Error(what));
            }
        })
    }
}
