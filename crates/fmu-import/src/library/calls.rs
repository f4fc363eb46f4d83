//! The calls of an instance: one method for each function of the standard.
#![expect(unsafe_code, reason = "the boundary to C")]

use fmu_description::abi::{fmi2Boolean, fmi2EventInfo};

use super::{Component, c_string, canary, copy_strings};
use slave::{CallError, CompletedStep, EventInfo, absent};

/// Evaluates to the C function in `$field` and marks it as entered. If the library lacks the function, the caller of
/// the macro returns an error. `Base::check` marks the return.
macro_rules! function {
    ($self:ident.$field:ident, $name:expr) => {
        match $self.base.functions.$field {
            Some(function) => {
                $self.base.place.enter(&$name);
                function
            }
            None => return Err(absent($name)),
        }
    };
}
pub(super) use function;

/// Defines a method for each function that changes the mode only.
macro_rules! modes {
    ($(fn $method:ident = $name:literal;)*) => {
        impl Component {
            $(#[inline]
            pub(crate) fn $method(&mut self) -> Result<(), CallError> {
                let function = function!(self.$method, $name);
                self.base.log_call($name, String::new);
                // SAFETY: the instance is alive.
                let status = unsafe { function(self.base.pointer) };
                self.base.check($name, status)
            })*
        }
    };
}
pub(super) use modes;

/// Defines the methods of the types whose values are copied. `$count` returns the number of references; `$length`
/// names the number of values, which only the functions of FMI 3.0 get.
macro_rules! values {
    ($(
        fn $get:ident, $set:ident: $type:ty =
            $get_name:literal $set_name:literal, $count:ident $($length:ident)?;
    )*) => {
        impl Component {
            $(#[inline]
            pub(crate) fn $get(
                &mut self,
                references: &[u32],
                values: &mut [$type],
            ) -> Result<(), CallError> {
                let function = function!(self.$get, $get_name);
                self.base.log_call($get_name, || format!("{references:?}"));
                let (pointer, count) = (self.base.pointer, $count(references, values));
                $(let $length = values.len();)?
                // SAFETY: the instance is alive; both arrays have the stated numbers.
                let call = |list, array| unsafe { function(pointer, list, count, array $(, $length)?) };
                let done = canary::read(self.base.guards, references, values, call);
                self.base.check_guarded($get_name, done, || format!(" {values:?}"))
            }

            #[inline]
            pub(crate) fn $set(
                &mut self,
                references: &[u32],
                values: &[$type],
            ) -> Result<(), CallError> {
                let function = function!(self.$set, $set_name);
                self.base.log_call($set_name, || format!("{references:?}, {values:?}"));
                let (pointer, count) = (self.base.pointer, $count(references, values));
                $(let $length = values.len();)?
                // SAFETY: the instance is alive; both arrays have the stated numbers.
                let call = |list, array| unsafe { function(pointer, list, count, array $(, $length)?) };
                let done = canary::write(self.base.guards, references, values, call);
                self.base.check_guarded($set_name, done, String::new)
            })*
        }
    };
}
pub(super) use values;

/// Defines the methods for Strings, with the parameters of `values`.
macro_rules! strings {
    (
        fn $get:ident, $set:ident =
            $get_name:literal $set_name:literal, $count:ident $($length:ident)?;
    ) => {
        impl Component {
            pub(crate) fn $set(
                &mut self,
                references: &[u32],
                values: &[String],
            ) -> Result<(), CallError> {
                let function = function!(self.$set, $set_name);
                self.base.log_call($set_name, || format!("{references:?}, {values:?}"));
                let count = $count(references, values);
                $(let $length = values.len();)?
                let values: Vec<_> = values.iter().map(|value| c_string(value)).collect();
                let texts: Vec<_> = values.iter().map(std::ffi::CString::as_bytes_with_nul).collect();
                let (pointer, guards) = (self.base.pointer, self.base.guards);
                let done = canary::constants(guards, canary::STRING, &texts, |array| {
                    canary::constant(guards, canary::REFERENCES, references, |list| {
                        // SAFETY: the instance is alive; both arrays have the stated numbers, of terminated strings.
                        (unsafe { function(pointer, list, count, array.cast() $(, $length)?) }, None)
                    })
                });
                self.base.check_guarded($set_name, done, String::new)
            }

            #[doc = concat!("Calls `", $get_name, "` and copies the strings.")]
            pub(crate) fn $get(
                &mut self,
                references: &[u32],
                values: &mut [String],
            ) -> Result<(), CallError> {
                let function = function!(self.$get, $get_name);
                self.base.log_call($get_name, || format!("{references:?}"));
                let (pointer, count) = (self.base.pointer, $count(references, values));
                $(let $length = values.len();)?
                let mut pointers = vec![std::ptr::null(); values.len()];
                // SAFETY: the instance is alive; both arrays have the stated numbers.
                let call = |list, array| unsafe { function(pointer, list, count, array $(, $length)?) };
                let done = canary::read(self.base.guards, references, &mut pointers, call);
                self.base.check_guarded($get_name, done, String::new)?;
                self.base.place.enter(&$get_name);
                // SAFETY: the FMU returns null or terminated strings, which live until the next call.
                unsafe { copy_strings(&pointers, values) };
                self.base.place.leave();
                Ok(())
            }
        }
    };
}
pub(super) use strings;

/// Defines the methods for derivatives of inputs and outputs with respect to time, for FMI 1.0 and 2.0.
macro_rules! derivatives {
    (fn $set:ident, $get:ident = $set_name:literal $get_name:literal;) => {
        impl Component {
            #[inline]
            pub(crate) fn $set(
                &mut self,
                references: &[u32],
                orders: &[i32],
                values: &[f64],
            ) -> Result<(), CallError> {
                let function = function!(self.$set, $set_name);
                let (pointer, guards) = (self.base.pointer, self.base.guards);
                let count = same_length(references, values);
                let done = canary::constant(guards, canary::ORDERS, &orders[..count], |orders| {
                    let call = |list, array| {
                        // SAFETY: the instance is alive; as many references as orders and values.
                        unsafe { function(pointer, list, count, orders, array) }
                    };
                    canary::write(guards, references, values, call)
                });
                self.base.check_guarded($set_name, done, String::new)
            }

            #[inline]
            pub(crate) fn $get(
                &mut self,
                references: &[u32],
                orders: &[i32],
                values: &mut [f64],
            ) -> Result<(), CallError> {
                let function = function!(self.$get, $get_name);
                let (pointer, guards) = (self.base.pointer, self.base.guards);
                let count = same_length(references, values);
                let done = canary::constant(guards, canary::ORDERS, &orders[..count], |orders| {
                    let call = |list, array| {
                        // SAFETY: the instance is alive; as many references as orders and values.
                        unsafe { function(pointer, list, count, orders, array) }
                    };
                    canary::read(guards, references, values, call)
                });
                self.base.check_guarded($get_name, done, String::new)
            }
        }
    };
}
pub(super) use derivatives;

/// Defines the methods of model exchange that set the time or the states, or get a vector: states, derivatives, nominal
/// values, event indicators.
macro_rules! equations {
    (
        fn set_time = $set_time:literal;
        fn set_continuous_states = $set_states:literal;
        $(fn $get:ident = $name:literal;)*
    ) => {
        impl Component {
            /// `time` is in s.
            #[inline]
            pub(crate) fn set_time(&mut self, time: f64) -> Result<(), CallError> {
                let function = function!(self.set_time, $set_time);
                self.base.log_call($set_time, || format!("{time:?}"));
                self.base.place.set_time(time);
                // SAFETY: the instance is alive.
                let status = unsafe { function(self.base.pointer, time) };
                self.base.check($set_time, status)
            }

            #[inline]
            pub(crate) fn set_continuous_states(
                &mut self,
                states: &[f64],
            ) -> Result<(), CallError> {
                let function = function!(self.set_continuous_states, $set_states);
                self.base.log_call($set_states, || format!("{states:?}"));
                // SAFETY: the instance is alive; `states.len()` values.
                let call = |array| unsafe { function(self.base.pointer, array, states.len()) };
                let done = canary::send(self.base.guards, states, call);
                self.base.check_guarded($set_states, done, String::new)
            }

            $(#[inline]
            pub(crate) fn $get(&mut self, values: &mut [f64]) -> Result<(), CallError> {
                let function = function!(self.$get, $name);
                self.base.log_call($name, String::new);
                let count = values.len();
                // SAFETY: the instance is alive; a place for each value.
                let call = |array| unsafe { function(self.base.pointer, array, count) };
                let done = canary::fill(self.base.guards, values, call);
                self.base.check_guarded($name, done, || format!(" {values:?}"))
            })*
        }
    };
}
pub(super) use equations;

modes! {
    fn enter_initialization_mode = "fmi2EnterInitializationMode";
    fn exit_initialization_mode = "fmi2ExitInitializationMode";
    fn terminate = "fmi2Terminate";
    fn enter_event_mode = "fmi2EnterEventMode";
    fn enter_continuous_time_mode = "fmi2EnterContinuousTimeMode";
}

values! {
    fn get_real, set_real: f64 = "fmi2GetReal" "fmi2SetReal", same_length;
    fn get_integer, set_integer: i32 = "fmi2GetInteger" "fmi2SetInteger", same_length;
    fn get_boolean, set_boolean: i32 = "fmi2GetBoolean" "fmi2SetBoolean", same_length;
}

strings! {
    fn get_string, set_string = "fmi2GetString" "fmi2SetString", same_length;
}

derivatives! {
    fn set_input_derivatives, get_output_derivatives =
        "fmi2SetRealInputDerivatives" "fmi2GetRealOutputDerivatives";
}

equations! {
    fn set_time = "fmi2SetTime";
    fn set_continuous_states = "fmi2SetContinuousStates";
    fn get_continuous_states = "fmi2GetContinuousStates";
    fn get_derivatives = "fmi2GetDerivatives";
    fn get_nominals_of_continuous_states = "fmi2GetNominalsOfContinuousStates";
    fn get_event_indicators = "fmi2GetEventIndicators";
}

/// Returns the common length of both slices; panics if they differ.
#[inline]
pub(super) fn same_length<A, B>(references: &[A], values: &[B]) -> usize {
    assert_eq!(references.len(), values.len(), "references and values are equally many");
    references.len()
}

impl Component {
    /// Calls `fmi2SetDebugLogging` for all categories.
    pub(crate) fn set_debug_logging(&mut self, on: bool) -> Result<(), CallError> {
        const NAME: &str = "fmi2SetDebugLogging";
        let function = function!(self.set_debug_logging, NAME);
        // SAFETY: the instance is alive; no categories.
        let status = unsafe { function(self.base.pointer, on.into(), 0, std::ptr::null()) };
        self.base.check(NAME, status)
    }

    pub(crate) fn setup_experiment(
        &mut self,
        e: &fmu_description::Experiment,
    ) -> Result<(), CallError> {
        const NAME: &str = "fmi2SetupExperiment";
        let (tolerance, stop) = (e.tolerance.unwrap_or(0.0), e.stop_time.unwrap_or(0.0));
        let (has_tolerance, has_stop) =
            (fmi2Boolean::from(e.tolerance.is_some()), fmi2Boolean::from(e.stop_time.is_some()));
        let function = function!(self.setup_experiment, NAME);
        self.base.place.set_time(e.start_time);
        // SAFETY: the instance is alive.
        let status = unsafe {
            function(self.base.pointer, has_tolerance, tolerance, e.start_time, has_stop, stop)
        };
        self.base.check(NAME, status)
    }

    pub(crate) fn update_discrete_states(&mut self) -> Result<EventInfo, CallError> {
        const NAME: &str = "fmi2NewDiscreteStates";
        let mut info = fmi2EventInfo::default();
        let function = function!(self.new_discrete_states, NAME);
        // SAFETY: the instance is alive; one structure to write to.
        let status = unsafe { function(self.base.pointer, &raw mut info) };
        self.base.check(NAME, status)?;
        Ok(EventInfo {
            discrete_states_need_update: info.new_discrete_states_needed != 0,
            terminate_simulation: info.terminate_simulation != 0,
            nominals_changed: info.nominals_of_continuous_states_changed != 0,
            values_changed: info.values_of_continuous_states_changed != 0,
            next_event_time: (info.next_event_time_defined != 0).then_some(info.next_event_time),
        })
    }

    /// Calls `fmi2CompletedIntegratorStep`. `never_back` is `noSetFMUStatePriorToCurrentPoint`.
    pub(crate) fn completed_integrator_step(
        &mut self,
        never_back: bool,
    ) -> Result<CompletedStep, CallError> {
        const NAME: &str = "fmi2CompletedIntegratorStep";
        let (mut event, mut end): (fmi2Boolean, fmi2Boolean) = (0, 0);
        let function = function!(self.completed_integrator_step, NAME);
        // SAFETY: the instance is alive; two Booleans to write to.
        let status =
            unsafe { function(self.base.pointer, never_back.into(), &raw mut event, &raw mut end) };
        self.base.check(NAME, status)?;
        Ok(CompletedStep { enter_event_mode: event != 0, terminate_simulation: end != 0 })
    }

    pub(crate) fn directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        changes: &mut [f64],
    ) -> Result<(), CallError> {
        const NAME: &str = "fmi2GetDirectionalDerivative";
        let function = function!(self.directional_derivative, NAME);
        let (unknown, known) = (same_length(unknowns, changes), same_length(knowns, seed));
        let (pointer, guards) = (self.base.pointer, self.base.guards);
        let done = canary::constant(guards, canary::REFERENCES, knowns, |columns| {
            canary::constant(guards, canary::SEED, seed, |seed| {
                // SAFETY: the instance is alive; arrays that belong together have the same length.
                let call = |rows, changes| unsafe {
                    function(pointer, rows, unknown, columns, known, seed, changes)
                };
                canary::read(guards, unknowns, changes, call)
            })
        });
        self.base.check_guarded(NAME, done, String::new)
    }
}
