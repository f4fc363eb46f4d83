//! `fmi3GetXXX` and `fmi3SetXXX` by places: value references of FMI 2.0, some of them with the mark [`INDICATOR`] or
//! [`INT64`].

use super::super::Instance;
use super::super::values::{check_integer, out_of_range};
use crate::interface::fmi3::{INDICATOR, INT64};
use crate::interface::{Native, Slot};
use crate::model::{Failure, Model};
use crate::room::Room;

/// Reads the values of located variables.
fn copy<M, T, V>(
    slots: &[Slot<M, T>],
    model: &mut M,
    places: &[u32],
    to: &mut Room<V>,
    read: impl Fn(&T) -> V,
) {
    for (&place, value) in places.iter().zip(to) {
        if let Some(slot) = slots.get(place as usize) {
            value.write(read((slot.field)(model)));
        }
    }
}

/// Checks that a number is in the range of its variable, which excludes infinity; accepts every clock and binary.
fn accept_number<M, T: Native>(slot: &Slot<M, T>, value: &T) -> Result<(), Failure> {
    let (min, max) = slot.range;
    match value.number() {
        Some(number) if number.is_nan() || number < min || number > max => {
            Err(out_of_range(&slot.name, slot.range, number))
        }
        _ => Ok(()),
    }
}

impl<M: Model> Instance<M> {
    /// `fmi3GetFloat64`.
    pub(crate) fn get_float64(
        &mut self,
        places: &[u32],
        to: &mut Room<f64>,
    ) -> Result<(), Failure> {
        if places.iter().any(|place| place & INDICATOR != 0) {
            return self.get_with_indicators(places, to);
        }
        self.get_real(places, to)
    }

    /// Reads variables of which some are event indicators.
    #[cold]
    fn get_with_indicators(&mut self, places: &[u32], to: &mut Room<f64>) -> Result<(), Failure> {
        self.refresh()?;
        let mut indicators = std::mem::take(&mut self.session_mut()?.indicators);
        self.core.model.event_indicators(self.core.time, &mut indicators);
        for (&place, value) in places.iter().zip(to) {
            match indicators.get((place & !INDICATOR) as usize) {
                Some(indicator) if place & INDICATOR != 0 => {
                    value.write(*indicator);
                }
                _ => self.get_real(&[place], std::slice::from_mut(value))?,
            }
        }
        self.session_mut()?.indicators = indicators;
        Ok(())
    }

    /// `fmi3GetInt64`, for `Int64` variables and enumerations.
    pub(crate) fn get_int64(&mut self, places: &[u32], to: &mut Room<i64>) -> Result<(), Failure> {
        self.refresh()?;
        let model = &mut self.core.model;
        for (&place, value) in places.iter().zip(to) {
            let (one, value) = (&[place & !INT64], std::slice::from_mut(value));
            if place & INT64 == 0 {
                copy(&self.interface.integers, model, one, value, |value| i64::from(*value));
            } else {
                copy(i64::slots(&self.interface.typed), model, one, value, |value| *value);
            }
        }
        Ok(())
    }

    /// `fmi3SetInt64`: sets all values or, after a failure, none.
    pub(crate) fn set_int64(&mut self, places: &[u32], values: &[i64]) -> Result<(), Failure> {
        if places.iter().all(|place| place & INT64 == 0) {
            return self.set_enumerations(places, values);
        }
        let (mut enumerations, mut integers) = ((Vec::new(), Vec::new()), (Vec::new(), Vec::new()));
        for (&place, &value) in places.iter().zip(values) {
            let (places, values) =
                if place & INT64 == 0 { &mut enumerations } else { &mut integers };
            places.push(place & !INT64);
            values.push(value);
        }
        self.core.check_all(
            i64::slots(&self.interface.typed),
            &integers.0,
            &integers.1,
            accept_number,
            "Int64",
        )?;
        self.set_enumerations(&enumerations.0, &enumerations.1)?;
        self.set_typed(&integers.0, &integers.1)
    }

    /// `fmi3Get{VariableType}` for a type of numbers that FMI 2.0 does not have.
    pub(crate) fn get_typed<T: Native + Copy>(
        &mut self,
        places: &[u32],
        to: &mut Room<T>,
    ) -> Result<(), Failure> {
        self.refresh()?;
        copy(T::slots(&self.interface.typed), &mut self.core.model, places, to, |value| *value);
        Ok(())
    }

    /// `fmi3Set{VariableType}` for a type that FMI 2.0 does not have: sets all values or, after a
    /// failure, none.
    pub(crate) fn set_typed<T: Native>(
        &mut self,
        places: &[u32],
        values: &[T],
    ) -> Result<(), Failure> {
        let slots = T::slots(&self.interface.typed);
        self.core.set(slots, places, values, T::clone_from, accept_number, T::TYPE.name())
    }

    /// `fmi3GetBinary`: passes each value to `write` with its position. The bytes stay valid until the
    /// next call.
    pub(crate) fn get_binary(
        &mut self,
        places: &[u32],
        mut write: impl FnMut(usize, &[u8]),
    ) -> Result<(), Failure> {
        self.refresh()?;
        let slots = <Vec<u8>>::slots(&self.interface.typed);
        let slots_of_places = places.iter().filter_map(|&place| slots.get(place as usize));
        let model = &mut self.core.model;
        let values: Vec<_> = slots_of_places.map(|slot| (slot.field)(model).clone()).collect();
        let binaries = &mut self.session_mut()?.binaries;
        *binaries = values;
        for (position, value) in binaries.iter().enumerate() {
            write(position, value);
        }
        Ok(())
    }

    /// `fmi3GetBoolean`.
    pub(crate) fn get_boolean_3(
        &mut self,
        places: &[u32],
        to: &mut Room<u8>,
    ) -> Result<(), Failure> {
        self.refresh()?;
        let read = |value: &bool| u8::from(*value);
        copy(&self.interface.booleans, &mut self.core.model, places, to, read);
        Ok(())
    }

    /// Sets all enumerations or, after a failure, none.
    fn set_enumerations(&mut self, places: &[u32], values: &[i64]) -> Result<(), Failure> {
        // A value beyond 32 bits is no item of any enumeration.
        let accept = |slot: &Slot<M, i32>, value: &i64| {
            if let Ok(value) = i32::try_from(*value) {
                return check_integer(slot, value);
            }
            let (name, items) = (&slot.name, &slot.items);
            Err(Failure::Discard(format!("{name} = {value}, expected one of {items:?}")))
        };
        let assign =
            |field: &mut i32, value: &i64| *field = i32::try_from(*value).unwrap_or(*field);
        self.core.set(&self.interface.integers, places, values, assign, accept, "Enumeration")
    }

    /// `fmi3SetBoolean`: sets all values or, after a failure, none.
    pub(crate) fn set_boolean_3(&mut self, places: &[u32], values: &[u8]) -> Result<(), Failure> {
        let assign = |field: &mut bool, value: &u8| *field = *value != 0;
        self.core.set(&self.interface.booleans, places, values, assign, |_, _| Ok(()), "Boolean")
    }

    /// `fmi3SetFloat64`: sets all values or, after a failure, none.
    pub(crate) fn set_float64(&mut self, places: &[u32], values: &[f64]) -> Result<(), Failure> {
        if places.iter().any(|place| place & INDICATOR != 0) {
            return Err(Failure::Error("an event indicator must not be set".to_owned()));
        }
        self.set_real(places, values)
    }
}
