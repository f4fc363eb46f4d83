//! An instance of an FMU in this process, which implements [`Slave`] for every version of FMI.

mod co_simulation;
mod model_exchange;

use std::time::Duration;

use fmu_description::{Experiment, ModelDescription};

use crate::fmu::{Fmu, OnlyInstance};
use crate::{v1, v2, v3};
use slave::{CallError, CallSink, CommunicationStep, Events, Slave, StepResult, absent};

/// An instance of an FMU in this process, for any interface.
pub struct Instance {
    pub(crate) inner: Inner,
    /// Dropped after `inner`.
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
    fn new(inner: Inner, only: Option<OnlyInstance>, fmu: Fmu) -> Self {
        Self { inner, _only: only, fmu }
    }

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

/// Calls a method of the instance in the version of its FMU, or of the listed part of it. Without a list of versions,
/// calls a method of the component. In a version that is not listed, returns the error that `$absent` is missing.
macro_rules! of_version {
    ($instance:ident.$method:ident $arguments:tt) => {
        of_version!(
            $instance.$method $arguments,
            V1.component, V2.component, V3.component
        )
    };
    (
        $instance:ident.$method:ident $arguments:tt,
        $($version:ident$(.$part:ident)*),+ $(; $absent:literal)?
    ) => {
        match &mut $instance.inner {
            $(Inner::$version(instance) => instance$(.$part)*.$method $arguments,)+
            $(_ => Err(absent($absent)),)?
        }
    };
}
use of_version;

impl Slave for Instance {
    fn description(&self) -> &ModelDescription {
        match &self.inner {
            Inner::V1(instance) => instance.description(),
            Inner::V2(_) => self.fmu.description(),
            Inner::V3(instance) => instance.description(),
        }
    }

    fn set_debug_logging(&mut self, on: bool) -> Result<(), CallError> {
        of_version!(self.set_debug_logging(on), V1.component, V2.component, V3)
    }

    fn configure(&mut self, references: &[u32], values: &[i64]) -> Result<(), CallError> {
        match &mut self.inner {
            Inner::V3(instance) => instance.configure(self.fmu.description(), references, values),
            _ => Err(absent("fmi3EnterConfigurationMode")),
        }
    }

    fn setup_experiment(&mut self, experiment: &Experiment) -> Result<(), CallError> {
        match &mut self.inner {
            Inner::V1(instance) => instance.setup_experiment(experiment),
            Inner::V2(instance) => return instance.component.setup_experiment(experiment),
            Inner::V3(instance) => instance.setup_experiment(experiment),
        }
        Ok(())
    }

    fn enter_initialization_mode(&mut self) -> Result<(), CallError> {
        of_version!(self.enter_initialization_mode(), V1, V2.component, V3)
    }

    fn exit_initialization_mode(&mut self) -> Result<(), CallError> {
        match &mut self.inner {
            Inner::V1(instance) => {
                instance.exit_initialization_mode();
                Ok(())
            }
            Inner::V2(instance) => instance.component.exit_initialization_mode(),
            Inner::V3(instance) => instance.exit_initialization_mode(),
        }
    }

    fn terminate(&mut self) -> Result<(), CallError> {
        of_version!(self.terminate())
    }

    #[inline]
    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        of_version!(self.get_real(references, values), V1, V2.component, V3)
    }

    #[inline]
    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError> {
        of_version!(self.set_real(references, values), V1, V2.component, V3)
    }

    fn get_integer(&mut self, references: &[u32], values: &mut [i64]) -> Result<(), CallError> {
        of_version!(self.get_integer(references, values), V1, V2, V3)
    }

    fn set_integer(&mut self, references: &[u32], values: &[i64]) -> Result<(), CallError> {
        of_version!(self.set_integer(references, values), V1, V2, V3)
    }

    fn get_boolean(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        of_version!(self.get_boolean(references, values), V1, V2.component, V3)
    }

    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        of_version!(self.set_boolean(references, values), V1, V2.component, V3)
    }

    fn get_string(&mut self, references: &[u32], values: &mut [String]) -> Result<(), CallError> {
        of_version!(self.get_string(references, values), V1.component, V2.component, V3)
    }

    fn set_string(&mut self, references: &[u32], values: &[String]) -> Result<(), CallError> {
        of_version!(self.set_string(references, values), V1, V2.component, V3)
    }

    fn get_binary(&mut self, references: &[u32], values: &mut [Vec<u8>]) -> Result<(), CallError> {
        of_version!(self.get_binary(references, values), V3; "fmi3GetBinary")
    }

    fn set_binary(&mut self, references: &[u32], values: &[Vec<u8>]) -> Result<(), CallError> {
        of_version!(self.set_binary(references, values), V3; "fmi3SetBinary")
    }

    fn set_input_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), CallError> {
        match &mut self.inner {
            Inner::V1(instance) => instance.set_input_derivatives(references, orders, values),
            Inner::V2(instance) => {
                instance.component.set_real_input_derivatives(references, orders, values)
            }
            Inner::V3(instance) => instance.set_input_derivatives(references, orders, values),
        }
    }

    fn get_output_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &mut [f64],
    ) -> Result<(), CallError> {
        match &mut self.inner {
            Inner::V1(instance) => instance.get_output_derivatives(references, orders, values),
            Inner::V2(instance) => {
                instance.component.get_real_output_derivatives(references, orders, values)
            }
            Inner::V3(instance) => instance.get_output_derivatives(references, orders, values),
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

    fn directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        changes: &mut [f64],
    ) -> Result<(), CallError> {
        of_version!(
            self.directional_derivative(unknowns, knowns, seed, changes),
            V2.component, V3; "fmi2GetDirectionalDerivative"
        )
    }

    fn save_state(&mut self, slot: usize) -> Result<(), CallError> {
        of_version!(self.save_state(slot), V2.component, V3; "fmi2GetFMUstate")
    }

    fn restore_state(&mut self, slot: usize) -> Result<(), CallError> {
        of_version!(self.restore_state(slot), V2.component, V3; "fmi2SetFMUstate")
    }

    fn serialize_state(&mut self) -> Result<Vec<u8>, CallError> {
        of_version!(self.serialize_state(), V2.component, V3; "fmi2SerializeFMUstate")
    }

    fn deserialize_state(&mut self, bytes: &[u8]) -> Result<(), CallError> {
        of_version!(self.deserialize_state(bytes), V2.component, V3; "fmi2DeSerializeFMUstate")
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
        if !inputs.is_empty() {
            self.set_real(inputs, values)?;
        }
        let done = self.do_step(step.time, step.size, step.never_back)?;
        if !outputs.is_empty() {
            self.get_real(outputs, results)?;
        }
        Ok(done)
    }

    fn hand_over_events(&mut self, stop: bool) -> Result<bool, CallError> {
        Ok(if let Inner::V3(instance) = &mut self.inner {
            instance.hand_over_events(stop)
        } else {
            false
        })
    }

    fn events(&mut self) -> Option<&mut dyn Events> {
        if let Inner::V3(instance) = &mut self.inner { Some(instance.as_mut()) } else { None }
    }

    fn log_calls(&mut self, sink: CallSink) -> bool {
        match &mut self.inner {
            Inner::V1(_) | Inner::V2(_) => false,
            Inner::V3(instance) => {
                instance.component.base.log_calls(sink);
                true
            }
        }
    }

    fn guard_arrays(&mut self) {
        of_version!(self.guard_arrays(), V1.component.base, V2.component.base, V3.component.base);
    }

    fn take_warning(&mut self) -> bool {
        of_version!(self.take_warning(), V1.component.base, V2.component.base, V3.component.base)
    }
}
