//! The functions for clocks, which no exported model has: each call that names a variable is an error.

use super::super::read;
use super::entry_points_3;
use fmu_description::abi3::{
    fmi3Clock, fmi3Float64, fmi3IntervalQualifier, fmi3UInt64, fmi3ValueReference,
};

/// Defines functions whose first arguments are value references of clocks.
macro_rules! clock_functions {
    ($($name:ident = $function:ident($($argument:ident: $type:ty),*);)*) => {
        entry_points_3! {
            $($name = $function(
                vr: *const fmi3ValueReference, n: usize, $($argument: $type),*
            ), instance => instance.without_variables("Clock", read(vr, n)?);)*
        }
    };
}

clock_functions! {
    get_clock = GetClock(_values: *mut fmi3Clock);
    set_clock = SetClock(_values: *const fmi3Clock);
    get_interval_decimal = GetIntervalDecimal(
        _intervals: *mut fmi3Float64, _qualifiers: *mut fmi3IntervalQualifier
    );
    get_interval_fraction = GetIntervalFraction(
        _counters: *mut fmi3UInt64, _resolutions: *mut fmi3UInt64,
        _qualifiers: *mut fmi3IntervalQualifier
    );
    get_shift_decimal = GetShiftDecimal(_shifts: *mut fmi3Float64);
    get_shift_fraction = GetShiftFraction(_counters: *mut fmi3UInt64, _resolutions: *mut fmi3UInt64);
    set_interval_decimal = SetIntervalDecimal(_intervals: *const fmi3Float64);
    set_interval_fraction = SetIntervalFraction(
        _counters: *const fmi3UInt64, _resolutions: *const fmi3UInt64
    );
    set_shift_decimal = SetShiftDecimal(_shifts: *const fmi3Float64);
    set_shift_fraction = SetShiftFraction(
        _counters: *const fmi3UInt64, _resolutions: *const fmi3UInt64
    );
}
