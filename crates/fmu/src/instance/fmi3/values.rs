//! `fmi3GetXXX` and `fmi3SetXXX` by places: value references of FMI 2.0, or event indicators.

use std::mem::MaybeUninit;

use super::super::Instance;
use crate::interface::Slot;
use crate::interface::fmi3::INDICATOR;
use crate::model::{Failure, Model};

/// Reads the values of located variables.
fn copy<M, T, V>(
    slots: &[Slot<M, T>],
    model: &mut M,
    places: &[u32],
    to: &mut [MaybeUninit<V>],
    read: impl Fn(&T) -> V,
) {
    for (&place, value) in places.iter().zip(to) {
        if let Some(slot) = slots.get(place as usize) {
            value.write(read((slot.field)(model)));
        }
    }
}

impl<M: Model> Instance<M> {
    /// `fmi3GetFloat64`.
    pub(crate) fn get_float64(
        &mut self,
        places: &[u32],
        to: &mut [MaybeUninit<f64>],
    ) -> Result<(), Failure> {
        if places.iter().any(|place| place & INDICATOR != 0) {
            return self.get_with_indicators(places, to);
        }
        self.get_real(places, to)
    }

    /// Reads variables of which some are event indicators.
    #[cold]
    fn get_with_indicators(
        &mut self,
        places: &[u32],
        to: &mut [MaybeUninit<f64>],
    ) -> Result<(), Failure> {
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

    /// `fmi3GetInt64` of enumerations.
    pub(crate) fn get_enumerations(
        &mut self,
        places: &[u32],
        to: &mut [MaybeUninit<i64>],
    ) -> Result<(), Failure> {
        self.refresh()?;
        let read = |value: &i32| i64::from(*value);
        copy(&self.interface.integers, &mut self.core.model, places, to, read);
        Ok(())
    }

    /// `fmi3GetBoolean`.
    pub(crate) fn get_boolean_3(
        &mut self,
        places: &[u32],
        to: &mut [MaybeUninit<u8>],
    ) -> Result<(), Failure> {
        self.refresh()?;
        let read = |value: &bool| u8::from(*value);
        copy(&self.interface.booleans, &mut self.core.model, places, to, read);
        Ok(())
    }

    /// `fmi3SetInt64` of enumerations: sets all values or, after a failure, none.
    pub(crate) fn set_enumerations(
        &mut self,
        places: &[u32],
        values: &[i64],
    ) -> Result<(), Failure> {
        let mut narrow = std::mem::take(&mut self.session_mut()?.integers);
        narrow.clear();
        // A value beyond 32 bits is no item of any enumeration; neither is the one that replaces it.
        narrow.extend(values.iter().map(|&value| i32::try_from(value).unwrap_or(i32::MIN)));
        let done = self.set_integer(places, &narrow);
        self.session_mut()?.integers = narrow;
        done
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
