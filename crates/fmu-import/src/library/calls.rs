//! The calls of an instance: one method for each function of the standard.
#![expect(unsafe_code, reason = "the boundary to C")]

use std::ffi::CString;

use fmu_description::abi::{fmi2Boolean, fmi2EventInfo};

use super::{Component, c_string, canary, copy_strings};
use slave::{CallError, CompletedStep, EventInfo, absent};

/// Evaluates to the C function in `$field` and marks it as entered; returns an error from the caller
/// if the library lacks it. [`Component::check`] marks its return.
macro_rules! function {
    ($self:ident.$field:ident, $name:expr) => {
        match $self.functions.$field {
            Some(function) => {
                $self.place.enter(&$name);
                function
            }
            None => return Err(absent($name)),
        }
    };
}
pub(super) use function;

/// Defines a method for each function that changes the mode only.
macro_rules! modes {
    ($($method:ident = $name:literal;)*) => {
        impl Component {
            $(#[doc = concat!("Calls `", $name, "`.")]
            ///
            /// # Errors
            ///
            /// [`CallError`] if the library lacks the function, or if its status is neither `fmi2OK`
            /// nor `fmi2Warning`.
            #[inline]
            pub fn $method(&mut self) -> Result<(), CallError> {
                let function = function!(self.$method, $name);
                // SAFETY: the instance is alive.
                let status = unsafe { function(self.pointer) };
                self.check($name, status)
            })*
        }
    };
}

modes! {
    enter_initialization_mode = "fmi2EnterInitializationMode";
    exit_initialization_mode = "fmi2ExitInitializationMode";
    terminate = "fmi2Terminate";
    enter_event_mode = "fmi2EnterEventMode";
    enter_continuous_time_mode = "fmi2EnterContinuousTimeMode";
}

/// Defines the methods of the types whose values are copied.
macro_rules! values {
    ($($get:ident $set:ident: $type:ty = $get_name:literal $set_name:literal;)*) => {
        impl Component {
            $(#[doc = concat!("Calls `", $get_name, "`.")]
            ///
            /// # Errors
            ///
            /// [`CallError`] if the library lacks the function, or if its status is neither `fmi2OK`
            /// nor `fmi2Warning`.
            #[inline]
            pub fn $get(&mut self, references: &[u32], values: &mut [$type]) -> Result<(), CallError> {
                let function = function!(self.$get, $get_name);
                let count = same_length(references, values);
                // SAFETY: the instance is alive; as many references as values.
                let call = |list, array| unsafe { function(self.pointer, list, count, array) };
                self.check_guarded($get_name, canary::read(self.guards, references, values, call))
            }

            #[doc = concat!("Calls `", $set_name, "`.")]
            ///
            /// # Errors
            ///
            /// [`CallError`] if the library lacks the function, or if its status is neither `fmi2OK`
            /// nor `fmi2Warning`.
            #[inline]
            pub fn $set(&mut self, references: &[u32], values: &[$type]) -> Result<(), CallError> {
                let function = function!(self.$set, $set_name);
                let count = same_length(references, values);
                // SAFETY: the instance is alive; as many references as values.
                let call = |list, array| unsafe { function(self.pointer, list, count, array) };
                self.check_guarded($set_name, canary::write(self.guards, references, values, call))
            })*
        }
    };
}

values! {
    get_real set_real: f64 = "fmi2GetReal" "fmi2SetReal";
    get_integer set_integer: i32 = "fmi2GetInteger" "fmi2SetInteger";
    get_boolean set_boolean: i32 = "fmi2GetBoolean" "fmi2SetBoolean";
}

/// Defines the methods that fill a vector.
macro_rules! vectors {
    ($($method:ident = $name:literal;)*) => {
        impl Component {
            $(#[doc = concat!("Calls `", $name, "`.")]
            ///
            /// # Errors
            ///
            /// [`CallError`] if the library lacks the function, or if its status is neither `fmi2OK`
            /// nor `fmi2Warning`.
            #[inline]
            pub fn $method(&mut self, values: &mut [f64]) -> Result<(), CallError> {
                let function = function!(self.$method, $name);
                let count = values.len();
                // SAFETY: the instance is alive; a place for each value.
                let call = |array| unsafe { function(self.pointer, array, count) };
                self.check_guarded($name, canary::fill(self.guards, values, call))
            })*
        }
    };
}

vectors! {
    get_continuous_states = "fmi2GetContinuousStates";
    get_derivatives = "fmi2GetDerivatives";
    get_nominals = "fmi2GetNominalsOfContinuousStates";
    get_event_indicators = "fmi2GetEventIndicators";
}

/// Returns the common length of both slices.
#[inline]
pub(super) fn same_length<A, B>(references: &[A], values: &[B]) -> usize {
    assert_eq!(references.len(), values.len(), "references and values are equally many");
    references.len()
}

impl Component {
    /// Calls `fmi2SetContinuousStates`.
    ///
    /// # Errors
    ///
    /// [`CallError`] if the library lacks the function, or if its status is neither `fmi2OK` nor
    /// `fmi2Warning`.
    #[inline]
    pub fn set_continuous_states(&mut self, values: &[f64]) -> Result<(), CallError> {
        const NAME: &str = "fmi2SetContinuousStates";
        let function = function!(self.set_continuous_states, NAME);
        // SAFETY: the instance is alive; `values.len()` values.
        let call = |array| unsafe { function(self.pointer, array, values.len()) };
        self.check_guarded(NAME, canary::send(self.guards, values, call))
    }

    /// Calls `fmi2SetDebugLogging` for all categories.
    ///
    /// # Errors
    ///
    /// [`CallError`] if the library lacks the function, or if its status is neither `fmi2OK` nor
    /// `fmi2Warning`.
    pub fn set_debug_logging(&mut self, on: bool) -> Result<(), CallError> {
        const NAME: &str = "fmi2SetDebugLogging";
        let function = function!(self.set_debug_logging, NAME);
        // SAFETY: the instance is alive; no categories.
        let status = unsafe { function(self.pointer, on.into(), 0, std::ptr::null()) };
        self.check(NAME, status)
    }

    /// Calls `fmi2SetupExperiment`.
    ///
    /// # Errors
    ///
    /// [`CallError`] if the library lacks the function, or if its status is neither `fmi2OK` nor
    /// `fmi2Warning`.
    pub fn setup_experiment(&mut self, e: &fmu_description::Experiment) -> Result<(), CallError> {
        const NAME: &str = "fmi2SetupExperiment";
        let (tolerance, stop) = (e.tolerance.unwrap_or(0.0), e.stop_time.unwrap_or(0.0));
        let (has_tolerance, has_stop) =
            (fmi2Boolean::from(e.tolerance.is_some()), fmi2Boolean::from(e.stop_time.is_some()));
        let function = function!(self.setup_experiment, NAME);
        self.place.set_time(e.start_time);
        // SAFETY: the instance is alive.
        let status = unsafe {
            function(self.pointer, has_tolerance, tolerance, e.start_time, has_stop, stop)
        };
        self.check(NAME, status)
    }

    /// Calls `fmi2SetString`.
    ///
    /// # Errors
    ///
    /// [`CallError`] if the library lacks the function, or if its status is neither `fmi2OK` nor
    /// `fmi2Warning`.
    pub fn set_string(&mut self, references: &[u32], values: &[String]) -> Result<(), CallError> {
        const NAME: &str = "fmi2SetString";
        let function = function!(self.set_string, NAME);
        let count = same_length(references, values);
        let values: Vec<_> = values.iter().map(|value| c_string(value)).collect();
        let texts: Vec<_> = values.iter().map(CString::as_bytes_with_nul).collect();
        let (pointer, guards) = (self.pointer, self.guards);
        let done = canary::constants(guards, canary::STRING, &texts, |array| {
            canary::constant(guards, canary::REFERENCES, references, |list| {
                // SAFETY: the instance is alive; as many references as terminated strings.
                (unsafe { function(pointer, list, count, array.cast()) }, None)
            })
        });
        self.check_guarded(NAME, done)
    }

    /// Calls `fmi2GetString` and copies the strings.
    ///
    /// # Errors
    ///
    /// [`CallError`] if the library lacks the function, or if its status is neither `fmi2OK` nor
    /// `fmi2Warning`.
    pub fn get_string(
        &mut self,
        references: &[u32],
        values: &mut [String],
    ) -> Result<(), CallError> {
        const NAME: &str = "fmi2GetString";
        let function = function!(self.get_string, NAME);
        let count = same_length(references, values);
        let mut pointers = vec![std::ptr::null(); count];
        // SAFETY: the instance is alive; as many references as pointers to write.
        let call = |list, array| unsafe { function(self.pointer, list, count, array) };
        self.check_guarded(NAME, canary::read(self.guards, references, &mut pointers, call))?;
        self.place.enter(&NAME);
        // SAFETY: the FMU returns null or terminated strings, which live until the next call.
        unsafe { copy_strings(&pointers, values) };
        self.place.leave();
        Ok(())
    }

    /// Calls `fmi2SetRealInputDerivatives`.
    ///
    /// # Errors
    ///
    /// [`CallError`] if the library lacks the function, or if its status is neither `fmi2OK` nor
    /// `fmi2Warning`.
    #[inline]
    pub fn set_real_input_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), CallError> {
        const NAME: &str = "fmi2SetRealInputDerivatives";
        let function = function!(self.set_real_input_derivatives, NAME);
        let (count, guards) = (same_length(references, values), self.guards);
        let done = canary::constant(guards, canary::ORDERS, &orders[..count], |orders| {
            // SAFETY: the instance is alive; as many references as orders and values.
            let call = |list, array| unsafe { function(self.pointer, list, count, orders, array) };
            canary::write(guards, references, values, call)
        });
        self.check_guarded(NAME, done)
    }

    /// Calls `fmi2GetRealOutputDerivatives`.
    ///
    /// # Errors
    ///
    /// [`CallError`] if the library lacks the function, or if its status is neither `fmi2OK` nor
    /// `fmi2Warning`.
    #[inline]
    pub fn get_real_output_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &mut [f64],
    ) -> Result<(), CallError> {
        const NAME: &str = "fmi2GetRealOutputDerivatives";
        let function = function!(self.get_real_output_derivatives, NAME);
        let (count, guards) = (same_length(references, values), self.guards);
        let done = canary::constant(guards, canary::ORDERS, &orders[..count], |orders| {
            // SAFETY: the instance is alive; as many references as orders and values.
            let call = |list, array| unsafe { function(self.pointer, list, count, orders, array) };
            canary::read(guards, references, values, call)
        });
        self.check_guarded(NAME, done)
    }

    /// Calls `fmi2NewDiscreteStates`.
    ///
    /// # Errors
    ///
    /// [`CallError`] if the library lacks the function, or if its status is neither `fmi2OK` nor
    /// `fmi2Warning`.
    pub fn update_discrete_states(&mut self) -> Result<EventInfo, CallError> {
        const NAME: &str = "fmi2NewDiscreteStates";
        let mut info = fmi2EventInfo::default();
        let function = function!(self.new_discrete_states, NAME);
        // SAFETY: the instance is alive; one structure to write to.
        let status = unsafe { function(self.pointer, &raw mut info) };
        self.check(NAME, status)?;
        Ok(EventInfo {
            discrete_states_need_update: info.new_discrete_states_needed != 0,
            terminate_simulation: info.terminate_simulation != 0,
            nominals_changed: info.nominals_of_continuous_states_changed != 0,
            values_changed: info.values_of_continuous_states_changed != 0,
            next_event_time: (info.next_event_time_defined != 0).then_some(info.next_event_time),
        })
    }

    /// Calls `fmi2SetTime`; `time` is in s.
    ///
    /// # Errors
    ///
    /// [`CallError`] if the library lacks the function, or if its status is neither `fmi2OK` nor
    /// `fmi2Warning`.
    pub fn set_time(&mut self, time: f64) -> Result<(), CallError> {
        const NAME: &str = "fmi2SetTime";
        let function = function!(self.set_time, NAME);
        self.place.set_time(time);
        // SAFETY: the instance is alive.
        let status = unsafe { function(self.pointer, time) };
        self.check(NAME, status)
    }

    /// Calls `fmi2CompletedIntegratorStep`. `never_back` is `noSetFMUStatePriorToCurrentPoint`.
    ///
    /// # Errors
    ///
    /// [`CallError`] if the library lacks the function, or if its status is neither `fmi2OK` nor
    /// `fmi2Warning`.
    pub fn completed_integrator_step(
        &mut self,
        never_back: bool,
    ) -> Result<CompletedStep, CallError> {
        const NAME: &str = "fmi2CompletedIntegratorStep";
        let (mut event, mut end): (fmi2Boolean, fmi2Boolean) = (0, 0);
        let function = function!(self.completed_integrator_step, NAME);
        // SAFETY: the instance is alive; two Booleans to write to.
        let status =
            unsafe { function(self.pointer, never_back.into(), &raw mut event, &raw mut end) };
        self.check(NAME, status)?;
        Ok(CompletedStep { enter_event_mode: event != 0, terminate_simulation: end != 0 })
    }

    /// Calls `fmi2GetDirectionalDerivative`.
    ///
    /// # Errors
    ///
    /// [`CallError`] if the library lacks the function, or if its status is neither `fmi2OK` nor
    /// `fmi2Warning`.
    pub fn directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        changes: &mut [f64],
    ) -> Result<(), CallError> {
        const NAME: &str = "fmi2GetDirectionalDerivative";
        let function = function!(self.get_directional_derivative, NAME);
        let (unknown, known) = (same_length(unknowns, changes), same_length(knowns, seed));
        let (pointer, guards) = (self.pointer, self.guards);
        let done = canary::constant(guards, canary::REFERENCES, knowns, |columns| {
            canary::constant(guards, canary::SEED, seed, |seed| {
                // SAFETY: the instance is alive; arrays that belong together have the same length.
                let call = |rows, changes| unsafe {
                    function(pointer, rows, unknown, columns, known, seed, changes)
                };
                canary::read(guards, unknowns, changes, call)
            })
        });
        self.check_guarded(NAME, done)
    }
}
