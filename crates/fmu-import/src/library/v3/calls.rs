//! Modes, logging, clocks and derivatives: one method for each function of the standard.
#![expect(unsafe_code, reason = "the boundary to C")]

use std::ffi::c_int;

use fmu_description::Experiment;

use super::super::calls::{function, modes, same_length};
use super::super::{c_string, canary};
use super::Component;
use slave::{CallError, absent};

modes! {
    pub(crate) fn exit_initialization_mode = "fmi3ExitInitializationMode";
    pub(crate) fn enter_event_mode = "fmi3EnterEventMode";
    pub(crate) fn enter_step_mode = "fmi3EnterStepMode";
    pub(crate) fn enter_continuous_time_mode = "fmi3EnterContinuousTimeMode";
    pub(crate) fn enter_configuration_mode = "fmi3EnterConfigurationMode";
    pub(crate) fn exit_configuration_mode = "fmi3ExitConfigurationMode";
    pub(crate) fn terminate = "fmi3Terminate";
}

impl Component {
    /// Calls `fmi3SetDebugLogging` for these categories; none means all, and a null list (FMI 3.0.2, section 2.3.1).
    pub(crate) fn set_debug_logging(
        &mut self,
        on: bool,
        categories: &[&str],
    ) -> Result<(), CallError> {
        const NAME: &str = "fmi3SetDebugLogging";
        let function = function!(self.set_debug_logging, NAME);
        self.base.log_call(NAME, || format!("{on}, {categories:?}"));
        let texts: Vec<_> = categories.iter().map(|category| c_string(category)).collect();
        let pointers: Vec<_> = texts.iter().map(|text| text.as_ptr()).collect();
        let list = if pointers.is_empty() { std::ptr::null() } else { pointers.as_ptr() };
        // SAFETY: the instance is alive; terminated strings, as many as stated.
        let status = unsafe { function(self.base.pointer, on, pointers.len(), list) };
        self.base.check(NAME, status)
    }

    /// Calls `fmi3EnterInitializationMode`.
    pub(crate) fn enter_initialization_mode(&mut self, e: &Experiment) -> Result<(), CallError> {
        const NAME: &str = "fmi3EnterInitializationMode";
        let (tolerance, stop) = (e.tolerance.unwrap_or(0.0), e.stop_time.unwrap_or(0.0));
        let (has_tolerance, has_stop) = (e.tolerance.is_some(), e.stop_time.is_some());
        let function = function!(self.enter_initialization_mode, NAME);
        self.base.log_call(NAME, || {
            format!(
                "tolerance {:?}, start time {:?}, stop time {:?}",
                e.tolerance, e.start_time, e.stop_time
            )
        });
        self.base.place.set_time(e.start_time);
        // SAFETY: the instance is alive.
        let status = unsafe {
            function(self.base.pointer, has_tolerance, tolerance, e.start_time, has_stop, stop)
        };
        self.base.check(NAME, status)
    }

    /// Calls `fmi3GetClock`: 0 is inactive.
    pub(crate) fn get_clock(
        &mut self,
        references: &[u32],
        values: &mut [u8],
    ) -> Result<(), CallError> {
        const NAME: &str = "fmi3GetClock";
        let function = function!(self.get_clock, NAME);
        self.base.log_call(NAME, || format!("{references:?}"));
        let count = same_length(references, values);
        // SAFETY: the instance is alive; as many references as values.
        let call = |list, array| unsafe { function(self.base.pointer, list, count, array) };
        let done = canary::read(self.base.guards, references, values, call);
        self.base.check_guarded(NAME, done, || format!(" {values:?}"))
    }

    /// Calls `fmi3SetClock` to activate clocks.
    pub(crate) fn activate_clocks(&mut self, references: &[u32]) -> Result<(), CallError> {
        const NAME: &str = "fmi3SetClock";
        let function = function!(self.set_clock, NAME);
        self.base.log_call(NAME, || format!("{references:?}, active"));
        let values = vec![1_u8; references.len()];
        // SAFETY: the instance is alive; as many references as values.
        let call = |list, array| unsafe { function(self.base.pointer, list, values.len(), array) };
        self.base.check_guarded(
            NAME,
            canary::write(self.base.guards, references, &values, call),
            String::new,
        )
    }

    /// Calls `fmi3ActivateModelPartition` at `time` in s.
    pub(crate) fn activate_model_partition(
        &mut self,
        clock: u32,
        time: f64,
    ) -> Result<(), CallError> {
        const NAME: &str = "fmi3ActivateModelPartition";
        let function = function!(self.activate_model_partition, NAME);
        self.base.log_call(NAME, || format!("[{clock}], {time:?}"));
        self.base.place.set_time(time);
        // SAFETY: the instance is alive.
        let status = unsafe { function(self.base.pointer, clock, time) };
        self.base.check(NAME, status)
    }

    /// Calls `fmi3GetIntervalDecimal` for one clock: interval in s, and `fmi3IntervalQualifier`.
    pub(crate) fn get_interval(&mut self, clock: u32) -> Result<(f64, c_int), CallError> {
        const NAME: &str = "fmi3GetIntervalDecimal";
        let function = function!(self.get_interval_decimal, NAME);
        self.base.log_call(NAME, || format!("[{clock}]"));
        let (mut interval, mut qualifier) = (0.0, 0);
        // SAFETY: the instance is alive; one reference, one place for each result.
        let status = unsafe {
            function(self.base.pointer, &raw const clock, 1, &raw mut interval, &raw mut qualifier)
        };
        self.base
            .check_results(NAME, status, || format!(" {interval:?}, qualifier {qualifier}"))?;
        Ok((interval, qualifier))
    }

    /// Calls `fmi3GetShiftDecimal` for one clock: shift in s.
    pub(crate) fn get_shift(&mut self, clock: u32) -> Result<f64, CallError> {
        const NAME: &str = "fmi3GetShiftDecimal";
        let function = function!(self.get_shift_decimal, NAME);
        self.base.log_call(NAME, || format!("[{clock}]"));
        let mut shift = 0.0;
        // SAFETY: the instance is alive; one reference, one place for the result.
        let status = unsafe { function(self.base.pointer, &raw const clock, 1, &raw mut shift) };
        self.base.check_results(NAME, status, || format!(" {shift:?}"))?;
        Ok(shift)
    }

    /// Calls `fmi3GetDirectionalDerivative`. `seed` and `changes` have as many values as the elements of
    /// the knowns and unknowns together.
    pub(crate) fn directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        changes: &mut [f64],
    ) -> Result<(), CallError> {
        const NAME: &str = "fmi3GetDirectionalDerivative";
        let function = function!(self.get_directional_derivative, NAME);
        self.base.log_call(NAME, || format!("{unknowns:?}, {knowns:?}, {seed:?}"));
        let (pointer, guards) = (self.base.pointer, self.base.guards);
        let (rows, columns) = (unknowns.len(), knowns.len());
        let (seeds, results) = (seed.len(), changes.len());
        let done = canary::constant(guards, canary::REFERENCES, knowns, |knowns| {
            canary::constant(guards, canary::SEED, seed, |seed| {
                // SAFETY: the instance is alive; each pointer comes with its number of values.
                let call = |unknowns, changes| unsafe {
                    function(
                        pointer, unknowns, rows, knowns, columns, seed, seeds, changes, results,
                    )
                };
                canary::read(guards, unknowns, changes, call)
            })
        });
        self.base.check_guarded(NAME, done, || format!(" {changes:?}"))
    }

    /// Calls `fmi3GetOutputDerivatives`. `values` has as many values as the elements of the outputs
    /// together.
    pub(crate) fn get_output_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &mut [f64],
    ) -> Result<(), CallError> {
        const NAME: &str = "fmi3GetOutputDerivatives";
        let function = function!(self.get_output_derivatives, NAME);
        self.base.log_call(NAME, || format!("{references:?}, orders {orders:?}"));
        let count = same_length(references, orders);
        let (pointer, guards, length) = (self.base.pointer, self.base.guards, values.len());
        let done = canary::constant(guards, canary::ORDERS, orders, |orders| {
            // SAFETY: the instance is alive; as many references as orders, and `length` values.
            let call =
                |list, array| unsafe { function(pointer, list, count, orders, array, length) };
            canary::read(guards, references, values, call)
        });
        self.base.check_guarded(NAME, done, || format!(" {values:?}"))
    }
}
