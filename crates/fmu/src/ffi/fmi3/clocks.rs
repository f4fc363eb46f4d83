//! The functions for clocks. The model determines the intervals, in seconds. Therefore functions that set intervals or
//! shifts, or get intervals as fractions, return an error for every clock.

use super::super::{borrow_output, read};
use super::entry_points_3;
use crate::model::Failure;
use fmu_description::NativeType;
use fmu_description::abi3::{
    fmi3Clock, fmi3Float64, fmi3IntervalQualifier, fmi3UInt64, fmi3ValueReference,
};

entry_points_3! {
    get_clock = GetClock(vr: *const fmi3ValueReference, n: usize, values: *mut fmi3Clock),
        instance => {
            let to = borrow_output(values, n)?;
            instance.located(NativeType::Clock, read(vr, n)?, n, |instance, places| {
                instance.get_clock(places, to);
                Ok(())
            })
        };
    set_clock = SetClock(vr: *const fmi3ValueReference, n: usize, values: *const fmi3Clock),
        instance => {
            let values = read(values, n)?;
            instance
                .located(NativeType::Clock, read(vr, n)?, n, |instance, places| instance.set_clock(places, values))
        };
    get_interval_decimal = GetIntervalDecimal(
        vr: *const fmi3ValueReference, n: usize, intervals: *mut fmi3Float64,
        qualifiers: *mut fmi3IntervalQualifier
    ), instance => {
        let (intervals, qualifiers) = (borrow_output(intervals, n)?, borrow_output(qualifiers, n)?);
        instance.located(NativeType::Clock, read(vr, n)?, n, |instance, places| {
            instance.get_intervals(places, intervals, qualifiers)
        })
    };
    get_shift_decimal = GetShiftDecimal(
        vr: *const fmi3ValueReference, n: usize, shifts: *mut fmi3Float64
    ), instance => {
        let shifts = borrow_output(shifts, n)?;
        instance.located(NativeType::Clock, read(vr, n)?, n, |instance, places| instance.get_shifts(places, shifts))
    };
}

/// Defines functions that return an error for every clock.
macro_rules! refused {
    ($($name:ident = $function:ident($($argument:ident: $type:ty),*), $reason:literal;)*) => {
        entry_points_3! {
            $($name = $function(
                vr: *const fmi3ValueReference, n: usize, $($argument: $type),*
            ), instance => {
                instance.located(NativeType::Clock, read(vr, n)?, n, |_, places| match places {
                    [] => Ok(()),
                    _ => Err(Failure::Error($reason.to_owned())),
                })
            };)*
        }
    };
}

refused! {
    get_interval_fraction = GetIntervalFraction(
        _counters: *mut fmi3UInt64, _resolutions: *mut fmi3UInt64,
        _qualifiers: *mut fmi3IntervalQualifier
    ), "supportsFraction of the clock is false";
    get_shift_fraction = GetShiftFraction(_counters: *mut fmi3UInt64, _resolutions: *mut fmi3UInt64),
        "supportsFraction of the clock is false";
    set_interval_decimal = SetIntervalDecimal(_intervals: *const fmi3Float64),
        "the model determines the interval of the clock";
    set_interval_fraction = SetIntervalFraction(
        _counters: *const fmi3UInt64, _resolutions: *const fmi3UInt64
    ), "the model determines the interval of the clock";
    set_shift_decimal = SetShiftDecimal(_shifts: *const fmi3Float64),
        "the model determines the interval of the clock";
    set_shift_fraction = SetShiftFraction(
        _counters: *const fmi3UInt64, _resolutions: *const fmi3UInt64
    ), "the model determines the interval of the clock";
}
