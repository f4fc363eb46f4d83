//! An instance of an FMU in this process, which implements [`Slave`] for every version of FMI.

mod create;
mod model_exchange;

use std::time::Duration;

use fmu_description::{Experiment, ModelDescription};

use crate::fmu::{Fmu, OnlyInstance};
use crate::{v1, v2, v3};
use slave::{
    CallError, CallSink, CommunicationStep, Events, Slave, StepRequest, StepResult, absent,
};

/// An instance of an FMU in this process, for any interface.
pub struct Instance {
    pub(crate) inner: Inner,
    /// The reservation of an FMU that allows one instance only; dropped after `inner`, which frees the instance.
    _only: Option<OnlyInstance>,
    fmu: Fmu,
}

/// An instance, by the version of its FMU.
#[expect(clippy::large_enum_variant, reason = "there are few, and FMI 2.0 is the usual one")]
pub(crate) enum Inner {
    V1(Box<v1::Instance>),
    V2(v2::Instance),
    V3(Box<v3::Instance>),
}

impl Instance {
    /// Returns the FMU of this instance.
    #[must_use]
    pub fn fmu(&self) -> &Fmu {
        &self.fmu
    }

    /// Limits how long a step that returned `fmi2Pending` (FMI 1.0: `fmiPending`) may take; `None`: no
    /// limit. FMI 3.0 has no pending steps.
    pub fn set_time_limit(&mut self, limit: Option<Duration>) {
        match &mut self.inner {
            Inner::V1(instance) => instance.component.base.time_limit = limit,
            Inner::V2(instance) => instance.component.base.time_limit = limit,
            Inner::V3(_) => {}
        }
    }
}

/// Calls a method of the instance, or of its part `$part`, if the FMI version of its FMU is listed. For other
/// versions, returns the error that the C function `$absent` is missing.
macro_rules! of_version {
    (
        $instance:ident.$method:ident $arguments:tt,
        [$($version:ident$(.$part:ident)*),+] $($absent:literal)?
    ) => {
        match &mut $instance.inner {
            $(Inner::$version(instance) => instance$(.$part)*.$method $arguments,)+
            $(_ => Err(absent($absent)),)?
        }
    };
}
use of_version;

/// Defines methods that call the method of the same name by `of_version`: signature, versions and, if a version is not
/// listed, the C function that it lacks.
macro_rules! methods {
    ($(
        fn $method:ident($($argument:ident: $type:ty),*) -> $result:ty =
            $versions:tt $(else $absent:literal)?;
    )*) => {
        $(#[inline]
        fn $method(&mut self, $($argument: $type),*) -> Result<$result, CallError> {
            of_version!(self.$method($($argument),*), $versions $($absent)?)
        })*
    };
}
use methods;

impl Slave for Instance {
    fn description(&self) -> &ModelDescription {
        match &self.inner {
            Inner::V1(instance) => instance.description(),
            Inner::V2(_) => self.fmu.description(),
            Inner::V3(instance) => instance.description(),
        }
    }

    methods! {
        fn set_debug_logging(on: bool) -> () = [V1.component, V2.component, V3];
        fn setup_experiment(experiment: &Experiment) -> () = [V1, V2.component, V3];
        fn enter_initialization_mode() -> () = [V1, V2.component, V3];
        fn exit_initialization_mode() -> () = [V1, V2.component, V3];
        fn terminate() -> () = [V1.component, V2.component, V3.component];
        fn get_real(references: &[u32], values: &mut [f64]) -> () = [V1, V2.component, V3];
        fn set_real(references: &[u32], values: &[f64]) -> () = [V1, V2.component, V3];
        fn get_integer(references: &[u32], values: &mut [i64]) -> () = [V1, V2, V3];
        fn set_integer(references: &[u32], values: &[i64]) -> () = [V1, V2, V3];
        fn get_boolean(references: &[u32], values: &mut [i32]) -> () = [V1, V2.component, V3];
        fn set_boolean(references: &[u32], values: &[i32]) -> () = [V1, V2.component, V3];
        fn get_string(references: &[u32], values: &mut [String]) -> () =
            [V1.component, V2.component, V3];
        fn set_string(references: &[u32], values: &[String]) -> () = [V1, V2.component, V3];
        fn get_binary(references: &[u32], values: &mut [Vec<u8>]) -> () = [V3] else "fmi3GetBinary";
        fn set_binary(references: &[u32], values: &[Vec<u8>]) -> () = [V3] else "fmi3SetBinary";
        fn set_input_derivatives(references: &[u32], orders: &[i32], values: &[f64]) -> () =
            [V1, V2.component, V3];
        fn get_output_derivatives(references: &[u32], orders: &[i32], values: &mut [f64]) -> () =
            [V1, V2.component, V3];
        fn directional_derivative(
            unknowns: &[u32], knowns: &[u32], seed: &[f64], changes: &mut [f64]
        ) -> () = [V2.component, V3] else "fmi2GetDirectionalDerivative";
        fn save_state(slot: usize) -> () = [V2.component, V3] else "fmi2GetFMUstate";
        fn restore_state(slot: usize) -> () = [V2.component, V3] else "fmi2SetFMUstate";
        fn serialize_state() -> Vec<u8> = [V2.component, V3] else "fmi2SerializeFMUstate";
        fn deserialize_state(bytes: &[u8]) -> () =
            [V2.component, V3] else "fmi2DeSerializeFMUstate";
    }

    fn configure(&mut self, references: &[u32], values: &[i64]) -> Result<(), CallError> {
        match &mut self.inner {
            Inner::V3(instance) => instance.configure(self.fmu.description(), references, values),
            _ => Err(absent("fmi3EnterConfigurationMode")),
        }
    }

    #[inline]
    fn do_step(&mut self, time: f64, size: f64, never_back: bool) -> Result<StepResult, CallError> {
        match &mut self.inner {
            Inner::V1(instance) => instance.component.do_step(time, size),
            Inner::V2(instance) => instance.component.do_step(time, size, never_back),
            Inner::V3(instance) => instance.do_step(time, size, never_back),
        }
    }

    #[inline]
    fn pass(
        &mut self,
        inputs: &[u32],
        values: &[f64],
        step: CommunicationStep,
        outputs: &[u32],
        results: &mut [f64],
    ) -> Result<StepResult, CallError> {
        if let Inner::V2(instance) = &mut self.inner {
            return instance.component.pass(inputs, values, step, outputs, results);
        }
        self.advance(&mut StepRequest::held(inputs, values, step, outputs, results))
    }

    fn hand_over_events(&mut self, stop: bool) -> Result<bool, CallError> {
        match &mut self.inner {
            Inner::V3(instance) => Ok(instance.hand_over_events(stop)),
            Inner::V1(_) | Inner::V2(_) => Ok(false),
        }
    }

    fn events(&mut self) -> Option<&mut dyn Events> {
        if let Inner::V3(instance) = &mut self.inner { Some(instance.as_mut()) } else { None }
    }

    fn log_calls(&mut self, sink: CallSink) -> bool {
        if let Inner::V3(instance) = &mut self.inner {
            instance.component.base.log_calls(sink);
        }
        matches!(self.inner, Inner::V3(_))
    }

    fn guard_arrays(&mut self) {
        of_version!(self.guard_arrays(), [V1.component.base, V2.component.base, V3.component.base]);
    }

    fn take_warning(&mut self) -> bool {
        of_version!(self.take_warning(), [V1.component.base, V2.component.base, V3.component.base])
    }
}
