//! `fmi2GetXXX` and `fmi2SetXXX` of an instance.

use std::ffi::CString;

use super::{Core, Instance};
use crate::interface::{Interface, Slot};
use crate::model::{Failure, Model};
use crate::room::Room;
use fmu_description::Causality;
use fmu_description::abi::fmi2String;
use fmu_description::call_order::State;

/// Returns the slot with value reference `reference`; an error if there is none.
fn slot<'a, M, T>(
    slots: &'a [Slot<M, T>],
    reference: u32,
    kind: &str,
) -> Result<&'a Slot<M, T>, Failure> {
    slots.get(reference as usize).ok_or_else(|| {
        Failure::Error(format!("no {kind} variable has the value reference {reference}"))
    })
}

impl<M> Interface<M> {
    /// Returns the Real with value reference `reference`; `None` for time, an error for an unknown reference.
    pub(super) fn real(&self, reference: u32) -> Result<Option<&Slot<M, f64>>, Failure> {
        match reference.checked_sub(1) {
            None => Ok(None),
            Some(position) => self.reals.get(position as usize).map(Some).ok_or_else(|| {
                Failure::Error(format!("no Real variable has the value reference {reference}"))
            }),
        }
    }

    /// Sets the derivatives of all inputs to zero.
    pub(crate) fn clear_input_derivatives(&self, model: &mut M) {
        for &position in &self.interpolated {
            for field in &self.reals[position].derivatives {
                *field(model) = 0.0;
            }
        }
    }
}

/// Checks that the variable may be set in `state`.
fn check_settable<M, T>(slot: &Slot<M, T>, state: State) -> Result<(), Failure> {
    if slot.settable & state.bit() != 0 {
        return Ok(());
    }
    let (name, variability) = (&slot.name, slot.variability.as_str());
    let causality = slot.causality.as_str();
    Err(Failure::Error(format!(
        "{name} ({causality}, {variability}) must not be set in state {state:?}"
    )))
}

/// Returns the failure for a value beyond the range of the variable `name`. A limit that the variable does not have is
/// [`f64::MIN`] or [`f64::MAX`] in the range, and the message leaves it out.
pub(super) fn out_of_range(name: &str, (min, max): (f64, f64), value: f64) -> Failure {
    let expected = match (min > f64::MIN, max < f64::MAX) {
        (true, true) if value.is_finite() => format!("{min} to {max}"),
        (true, false) if value.is_finite() => format!("at least {min}"),
        (false, true) if value.is_finite() => format!("at most {max}"),
        _ => "a finite number".to_owned(),
    };
    Failure::Discard(format!("{name} = {value}, expected {expected}"))
}

/// Checks that `value` is in the variable's range, which excludes infinity.
fn check_real<M>(slot: &Slot<M, f64>, value: f64) -> Result<(), Failure> {
    let (min, max) = slot.range;
    if min <= value && value <= max {
        return Ok(());
    }
    Err(out_of_range(&slot.name, slot.range, value))
}

/// Checks that `value` is in the range of the Integer or an item of the Enumeration.
pub(super) fn check_integer<M>(slot: &Slot<M, i32>, value: i32) -> Result<(), Failure> {
    let (min, max) = slot.range;
    let name = &slot.name;
    if f64::from(value) < min || f64::from(value) > max {
        return Err(out_of_range(name, slot.range, value.into()));
    }
    if !slot.items.is_empty() && !slot.items.contains(&value) {
        let items = &slot.items;
        return Err(Failure::Discard(format!("{name} = {value}, expected one of {items:?}")));
    }
    Ok(())
}

impl<M: Model> Core<M> {
    /// Records that the variable of `slot` was set.
    fn mark_stale<T>(&mut self, slot: &Slot<M, T>) {
        self.stale = true;
        self.unchecked |= slot.causality == Causality::Parameter;
    }

    /// Checks that all `values` can be set: the variables exist, may be set in this state, and `accept` the values.
    pub(super) fn check_all<T, V>(
        &self,
        slots: &[Slot<M, T>],
        references: &[u32],
        values: &[V],
        accept: impl Fn(&Slot<M, T>, &V) -> Result<(), Failure>,
        kind: &str,
    ) -> Result<(), Failure> {
        for (&reference, value) in references.iter().zip(values) {
            let slot = slot(slots, reference, kind)?;
            check_settable(slot, self.state)?;
            accept(slot, value)?;
        }
        Ok(())
    }

    /// Reads values and converts each with `convert`.
    fn get<T, V>(
        &mut self,
        slots: &[Slot<M, T>],
        references: &[u32],
        values: &mut Room<V>,
        convert: impl Fn(&T) -> V,
        kind: &str,
    ) -> Result<(), Failure> {
        for (&reference, value) in references.iter().zip(values) {
            let slot = slot(slots, reference, kind)?;
            value.write(convert((slot.field)(&mut self.model)));
        }
        Ok(())
    }

    /// Sets all `values`, or none if one of them cannot be set.
    pub(super) fn set<T, V>(
        &mut self,
        slots: &[Slot<M, T>],
        references: &[u32],
        values: &[V],
        assign: impl Fn(&mut T, &V),
        accept: impl Fn(&Slot<M, T>, &V) -> Result<(), Failure>,
        kind: &str,
    ) -> Result<(), Failure> {
        self.check_all(slots, references, values, accept, kind)?;
        for (&reference, value) in references.iter().zip(values) {
            let slot = slot(slots, reference, kind)?;
            assign((slot.field)(&mut self.model), value);
            self.mark_stale(slot);
        }
        Ok(())
    }
}

impl<M: Model> Instance<M> {
    /// `fmi2GetReal`.
    pub(crate) fn get_real(&mut self, from: &[u32], to: &mut Room<f64>) -> Result<(), Failure> {
        self.refresh()?;
        for (&reference, value) in from.iter().zip(to) {
            value.write(match self.interface.real(reference)? {
                Some(slot) => *(slot.field)(&mut self.core.model),
                None => self.core.time,
            });
        }
        Ok(())
    }

    /// `fmi2GetInteger`.
    pub(crate) fn get_integer(&mut self, from: &[u32], to: &mut Room<i32>) -> Result<(), Failure> {
        self.refresh()?;
        self.core.get(&self.interface.integers, from, to, |value| *value, "Integer")
    }

    /// `fmi2GetBoolean`.
    pub(crate) fn get_boolean(&mut self, from: &[u32], to: &mut Room<i32>) -> Result<(), Failure> {
        self.refresh()?;
        self.core.get(&self.interface.booleans, from, to, |value| i32::from(*value), "Boolean")
    }

    /// `fmi2GetString`. The pointers stay valid until the next call.
    pub(crate) fn get_string(
        &mut self,
        from: &[u32],
        to: &mut Room<fmi2String>,
    ) -> Result<(), Failure> {
        self.refresh()?;
        self.strings.clear();
        for &reference in from {
            let slot = slot(&self.interface.strings, reference, "String")?;
            let text = (slot.field)(&mut self.core.model).replace('\0', "\u{fffd}");
            self.strings.push(CString::new(text).unwrap_or_default());
        }
        for (text, pointer) in self.strings.iter().zip(to) {
            pointer.write(text.as_ptr());
        }
        Ok(())
    }

    /// `fmi2SetReal`: sets all values or, after a failure, none.
    pub(crate) fn set_real(&mut self, to: &[u32], values: &[f64]) -> Result<(), Failure> {
        let Self { core, interface, .. } = self;
        let reals = interface.reals.as_slice();
        let slot = |reference: u32| reals.get((reference as usize).wrapping_sub(1));
        let state = core.state.bit();
        let mut parameters = false;
        for (&reference, &value) in to.iter().zip(values) {
            let is_accepted = |slot: &&Slot<M, f64>| {
                slot.settable & state != 0 && slot.range.0 <= value && value <= slot.range.1
            };
            let Some(slot) = slot(reference).filter(is_accepted) else {
                return self.check_reals(to, values);
            };
            parameters |= slot.causality == Causality::Parameter;
        }
        core.stale = true;
        core.unchecked |= parameters;
        for (&reference, value) in to.iter().zip(values) {
            if let Some(slot) = slot(reference) {
                let field = (slot.field)(&mut core.model);
                *field = *value;
            }
        }
        Ok(())
    }

    /// Checks all values; returns the failure of the first one that cannot be set.
    #[cold]
    fn check_reals(&self, to: &[u32], values: &[f64]) -> Result<(), Failure> {
        for (&reference, &value) in to.iter().zip(values) {
            let slot = self.interface.real(reference)?.ok_or_else(time_is_independent)?;
            check_settable(slot, self.core.state)?;
            check_real(slot, value)?;
        }
        Ok(())
    }

    /// `fmi2SetInteger`: sets all values or, after a failure, none.
    pub(crate) fn set_integer(&mut self, to: &[u32], values: &[i32]) -> Result<(), Failure> {
        let accept = |slot: &Slot<M, i32>, value: &i32| check_integer(slot, *value);
        self.core.set(&self.interface.integers, to, values, i32::clone_from, accept, "Integer")
    }

    /// `fmi2SetBoolean`: sets all values or, after a failure, none.
    pub(crate) fn set_boolean(&mut self, to: &[u32], values: &[i32]) -> Result<(), Failure> {
        let assign = |field: &mut bool, value: &i32| *field = *value != 0;
        self.core.set(&self.interface.booleans, to, values, assign, |_, _| Ok(()), "Boolean")
    }

    /// `fmi2SetString`: sets all values or, after a failure, none.
    pub(crate) fn set_string(&mut self, to: &[u32], values: &[String]) -> Result<(), Failure> {
        let accept = |_: &Slot<M, String>, _: &String| Ok(());
        self.core.set(&self.interface.strings, to, values, String::clone_from, accept, "String")
    }

    /// `fmi2SetRealInputDerivatives`: sets all derivatives or, after a failure, none. Orders that the model does not
    /// use have no effect.
    pub(crate) fn set_real_input_derivatives(
        &mut self,
        to: &[u32],
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), Failure> {
        for ((&reference, &order), &value) in to.iter().zip(orders).zip(values) {
            let slot = self.interface.real(reference)?.ok_or_else(time_is_independent)?;
            let name = &slot.name;
            if slot.causality != Causality::Input {
                return Err(Failure::Error(format!("{name} is not an input")));
            }
            if order < 1 {
                return Err(Failure::Error(format!("{name}: order {order}, expected 1 or more")));
            }
            if !value.is_finite() {
                return Err(Failure::Discard(format!(
                    "derivative {order} of {name} = {value}, expected a finite number"
                )));
            }
        }
        for ((&reference, &order), &value) in to.iter().zip(orders).zip(values) {
            let slot = self.interface.real(reference)?;
            if let Some(field) = slot.and_then(|slot| derivative_field(slot, order)) {
                *field(&mut self.core.model) = value;
                self.core.sloped = true;
            }
        }
        Ok(())
    }

    /// `fmi2GetRealOutputDerivatives`. A derivative that the model does not have is 0, up to the highest order of any
    /// output; an error for other orders, and for a variable that is no output.
    pub(crate) fn get_real_output_derivatives(
        &mut self,
        from: &[u32],
        orders: &[i32],
        values: &mut Room<f64>,
    ) -> Result<(), Failure> {
        self.refresh()?;
        let highest = self.interface.max_output_derivative_order;
        for ((&reference, &order), value) in from.iter().zip(orders).zip(values) {
            let slot = self.interface.real(reference)?.ok_or_else(time_is_independent)?;
            let name = &slot.name;
            if slot.causality != Causality::Output {
                return Err(Failure::Error(format!("{name} is not an output")));
            }
            if u32::try_from(order).map_or(true, |order| order < 1 || order > highest) {
                return Err(Failure::Error(format!(
                    "{name}: order {order}, expected 1 to maxOutputDerivativeOrder = {highest}"
                )));
            }
            let field = derivative_field(slot, order);
            value.write(field.map_or(0.0, |field| *field(&mut self.core.model)));
        }
        Ok(())
    }
}

/// Returns the field of the derivative of this order, if the model has one.
fn derivative_field<M>(slot: &Slot<M, f64>, order: i32) -> Option<&crate::variable::Field<M, f64>> {
    let position = usize::try_from(order).ok()?.checked_sub(1)?;
    slot.derivatives.get(position)
}

fn time_is_independent() -> Failure {
    Failure::Error("time is the independent variable, neither input nor output".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The largest number of double precision has 309 digits.
    #[test]
    fn a_message_on_a_range_has_only_the_limits_of_the_variable() {
        let (nan, inf) = (f64::NAN, f64::INFINITY);
        for (range, value, expected) in [
            ((0.0, 10.0), 11.0, "m = 11, expected 0 to 10"),
            ((0.001, f64::MAX), -1.0, "m = -1, expected at least 0.001"),
            ((f64::MIN, 5.0), 6.0, "m = 6, expected at most 5"),
            ((0.001, f64::MAX), inf, "m = inf, expected a finite number"),
            ((f64::MIN, f64::MAX), nan, "m = NaN, expected a finite number"),
        ] {
            assert_eq!(out_of_range("m", range, value).to_string(), expected);
        }
    }
}
