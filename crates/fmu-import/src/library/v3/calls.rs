//! The calls of an instance: one method for each function of the standard, except for steps and events.
#![expect(unsafe_code, reason = "the boundary to C")]

use std::ffi::{c_int, c_void};
use std::ptr::null_mut;

use fmu_description::Experiment;

use super::super::calls::{equations, function, modes, same_length, strings, values};
use super::super::states::states;
use super::super::{c_string, canary, copy_strings};
use super::Component;
use slave::{CallError, CompletedStep, Failure, absent};

modes! {
    fn exit_initialization_mode = "fmi3ExitInitializationMode";
    fn enter_event_mode = "fmi3EnterEventMode";
    fn enter_step_mode = "fmi3EnterStepMode";
    fn enter_continuous_time_mode = "fmi3EnterContinuousTimeMode";
    fn enter_configuration_mode = "fmi3EnterConfigurationMode";
    fn exit_configuration_mode = "fmi3ExitConfigurationMode";
    fn terminate = "fmi3Terminate";
}

values! {
    fn get_float32, set_float32: f32 = "fmi3GetFloat32" "fmi3SetFloat32", reference_count length;
    fn get_float64, set_float64: f64 = "fmi3GetFloat64" "fmi3SetFloat64", reference_count length;
    fn get_int8, set_int8: i8 = "fmi3GetInt8" "fmi3SetInt8", reference_count length;
    fn get_uint8, set_uint8: u8 = "fmi3GetUInt8" "fmi3SetUInt8", reference_count length;
    fn get_int16, set_int16: i16 = "fmi3GetInt16" "fmi3SetInt16", reference_count length;
    fn get_uint16, set_uint16: u16 = "fmi3GetUInt16" "fmi3SetUInt16", reference_count length;
    fn get_int32, set_int32: i32 = "fmi3GetInt32" "fmi3SetInt32", reference_count length;
    fn get_uint32, set_uint32: u32 = "fmi3GetUInt32" "fmi3SetUInt32", reference_count length;
    fn get_int64, set_int64: i64 = "fmi3GetInt64" "fmi3SetInt64", reference_count length;
    fn get_uint64, set_uint64: u64 = "fmi3GetUInt64" "fmi3SetUInt64", reference_count length;
    fn get_boolean, set_boolean: u8 = "fmi3GetBoolean" "fmi3SetBoolean", reference_count length;
}

strings! {
    fn get_string, set_string = "fmi3GetString" "fmi3SetString", reference_count length;
}

equations! {
    fn set_time = "fmi3SetTime";
    fn set_continuous_states = "fmi3SetContinuousStates";
    fn get_continuous_states = "fmi3GetContinuousStates";
    fn get_derivatives = "fmi3GetContinuousStateDerivatives";
    fn get_event_indicators = "fmi3GetEventIndicators";
    fn get_nominals_of_continuous_states = "fmi3GetNominalsOfContinuousStates";
}

/// Defines a method for each function that returns a number of values.
macro_rules! numbers {
    ($($method:ident = $name:literal;)*) => {
        impl Component {
            $(pub(crate) fn $method(&mut self) -> Result<usize, CallError> {
                let function = function!(self.$method, $name);
                self.base.log_call($name, String::new);
                let mut count = 0;
                // SAFETY: the instance is alive; one place for the number.
                let status = unsafe { function(self.base.pointer, &raw mut count) };
                self.base.check_results($name, status, || format!(" {count}"))?;
                canary::check_number(count).map_err(|failure| self.base.failed($name, failure))
            })*
        }
    };
}

numbers! {
    get_number_of_states = "fmi3GetNumberOfContinuousStates";
    get_number_of_indicators = "fmi3GetNumberOfEventIndicators";
}

states! {
    fn save_state = "fmi3GetFMUState";
    restore_state = "fmi3SetFMUState";
    serialize_state = "fmi3SerializedFMUStateSize" "fmi3SerializeFMUState";
    deserialize_state = "fmi3DeserializeFMUState";
    free_state = "fmi3FreeFMUState";
}

/// Returns the number of references, which may be less than the number of values: variables may be arrays.
#[inline]
fn reference_count<T>(references: &[u32], _values: &[T]) -> usize {
    references.len()
}

impl Component {
    /// Calls `fmi3SetDebugLogging` for `categories`; an empty list means all (FMI 3.0.2, section 2.3.1).
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

    /// Calls `fmi3GetClock`; a value of 0 means inactive.
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

    /// Calls `fmi3GetDirectionalDerivative`. `seed` has a value for each element of the knowns, `changes` for each
    /// element of the unknowns.
    pub(crate) fn directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        changes: &mut [f64],
    ) -> Result<(), CallError> {
        const NAME: &str = "fmi3GetDirectionalDerivative";
        let function = function!(self.directional_derivative, NAME);
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

    /// Calls `fmi3GetOutputDerivatives`. `values` has a value for each element of the outputs.
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

    pub(crate) fn set_binary(
        &mut self,
        references: &[u32],
        values: &[Vec<u8>],
    ) -> Result<(), CallError> {
        const NAME: &str = "fmi3SetBinary";
        let function = function!(self.set_binary, NAME);
        self.base.log_call(NAME, || format!("{references:?}, {values:?}"));
        let sizes: Vec<_> = values.iter().map(Vec::len).collect();
        let contents: Vec<_> = values.iter().map(Vec::as_slice).collect();
        let (pointer, guards) = (self.base.pointer, self.base.guards);
        let (count, length) = (references.len(), contents.len());
        let done = canary::constants(guards, canary::BYTES, &contents, |array| {
            // SAFETY: the instance is alive; as many sizes as pointers, each to as many bytes.
            let call =
                |list, sizes| unsafe { function(pointer, list, count, sizes, array, length) };
            canary::write(guards, references, &sizes, call)
        });
        self.base.check_guarded(NAME, done, String::new)
    }

    /// Calls `fmi3GetBinary` and copies the bytes.
    pub(crate) fn get_binary(
        &mut self,
        references: &[u32],
        values: &mut [Vec<u8>],
    ) -> Result<(), CallError> {
        const NAME: &str = "fmi3GetBinary";
        let function = function!(self.get_binary, NAME);
        self.base.log_call(NAME, || format!("{references:?}"));
        let mut sizes = vec![0_usize; values.len()];
        let mut pointers = vec![std::ptr::null::<u8>(); values.len()];
        let (count, length) = (references.len(), pointers.len());
        let (pointer, guards) = (self.base.pointer, self.base.guards);
        let done = canary::filled(guards, canary::SIZES, &mut sizes, |sizes| {
            // SAFETY: the instance is alive; as many places for sizes as for pointers.
            let call =
                |list, array| unsafe { function(pointer, list, count, sizes, array, length) };
            canary::read(guards, references, &mut pointers, call)
        });
        self.base.check_guarded(NAME, done, String::new)?;
        self.base.place.enter(&NAME);
        for (value, (pointer, size)) in values.iter_mut().zip(pointers.into_iter().zip(sizes)) {
            value.clear();
            let mut checked = canary::check_size(size, "binary value");
            if size > 0 && pointer.is_null() {
                checked = Err(Failure::InvalidAnswer(format!(
                    "returned a null pointer for {size} bytes of the value references {references:?}, expected \
                     their address"
                )));
            }
            if let Err(failure) = checked {
                self.base.place.leave();
                return Err(self.base.failed(NAME, failure));
            }
            if size > 0 {
                // SAFETY: the FMU returns `size` bytes at `pointer`, which live until the next call.
                value.extend_from_slice(unsafe { std::slice::from_raw_parts(pointer, size) });
            }
        }
        self.base.place.leave();
        Ok(())
    }

    #[inline]
    pub(crate) fn completed_integrator_step(
        &mut self,
        never_back: bool,
    ) -> Result<CompletedStep, CallError> {
        const NAME: &str = "fmi3CompletedIntegratorStep";
        let function = function!(self.completed_integrator_step, NAME);
        self.base.log_call(NAME, || never_back.to_string());
        let [mut event, mut terminate] = [0_u8; 2];
        // SAFETY: the instance is alive; one place for each result.
        let status =
            unsafe { function(self.base.pointer, never_back, &raw mut event, &raw mut terminate) };
        self.base.check_results(NAME, status, || {
            format!(" enterEventMode {event}, terminateSimulation {terminate}")
        })?;
        Ok(CompletedStep { enter_event_mode: event != 0, terminate_simulation: terminate != 0 })
    }
}
