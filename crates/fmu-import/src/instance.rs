//! An instance of an FMU in this process, which implements [`Slave`] for every version of FMI.

mod co_simulation;
mod model_exchange;

use std::time::Duration;

use fmu_description::{Experiment, ModelDescription};

use crate::fmu::{Fmu, OnlyInstance};
use crate::{v1, v2, v3};
use slave::{CallError, CallSink, CommunicationStep, EventInfo, Events, Slave, StepResult, absent};

/// An instance of an FMU in this process, for either interface.
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
            Inner::V1(fmu) => fmu.component.base.time_limit = limit,
            Inner::V2(fmu) => fmu.component.base.time_limit = limit,
            Inner::V3(_) => {}
        }
    }
}

impl Slave for Instance {
    fn description(&self) -> &ModelDescription {
        match &self.inner {
            Inner::V1(instance) => instance.description(),
            Inner::V2(_) => self.fmu.description(),
            Inner::V3(instance) => instance.description(),
        }
    }

    fn set_debug_logging(&mut self, on: bool) -> Result<(), CallError> {
        match &mut self.inner {
            Inner::V1(instance) => instance.component.set_debug_logging(on),
            Inner::V2(instance) => instance.component.set_debug_logging(on),
            Inner::V3(instance) => instance.set_debug_logging(on),
        }
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
        match &mut self.inner {
            Inner::V1(instance) => instance.enter_initialization_mode(),
            Inner::V2(instance) => instance.component.enter_initialization_mode(),
            Inner::V3(instance) => instance.enter_initialization_mode(),
        }
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
        match &mut self.inner {
            Inner::V1(instance) => instance.component.terminate(),
            Inner::V2(instance) => instance.component.terminate(),
            Inner::V3(instance) => instance.terminate(),
        }
    }

    #[inline]
    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        match &mut self.inner {
            Inner::V1(instance) => instance.get_real(references, values),
            Inner::V2(instance) => instance.component.get_real(references, values),
            Inner::V3(instance) => instance.get_real(references, values),
        }
    }

    #[inline]
    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError> {
        match &mut self.inner {
            Inner::V1(instance) => instance.set_real(references, values),
            Inner::V2(instance) => instance.component.set_real(references, values),
            Inner::V3(instance) => instance.set_real(references, values),
        }
    }

    fn get_integer(&mut self, references: &[u32], values: &mut [i64]) -> Result<(), CallError> {
        match &mut self.inner {
            Inner::V1(instance) => instance.get_integer(references, values),
            Inner::V2(instance) => instance.get_integer(references, values),
            Inner::V3(instance) => instance.get_integer(references, values),
        }
    }

    fn set_integer(&mut self, references: &[u32], values: &[i64]) -> Result<(), CallError> {
        match &mut self.inner {
            Inner::V1(instance) => instance.set_integer(references, values),
            Inner::V2(instance) => instance.set_integer(references, values),
            Inner::V3(instance) => instance.set_integer(references, values),
        }
    }

    fn get_boolean(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        match &mut self.inner {
            Inner::V1(instance) => instance.get_boolean(references, values),
            Inner::V2(instance) => instance.component.get_boolean(references, values),
            Inner::V3(instance) => instance.get_boolean(references, values),
        }
    }

    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        match &mut self.inner {
            Inner::V1(instance) => instance.set_boolean(references, values),
            Inner::V2(instance) => instance.component.set_boolean(references, values),
            Inner::V3(instance) => instance.set_boolean(references, values),
        }
    }

    fn get_string(&mut self, references: &[u32], values: &mut [String]) -> Result<(), CallError> {
        match &mut self.inner {
            Inner::V1(instance) => instance.component.get_string(references, values),
            Inner::V2(instance) => instance.component.get_string(references, values),
            Inner::V3(instance) => instance.get_string(references, values),
        }
    }

    fn set_string(&mut self, references: &[u32], values: &[String]) -> Result<(), CallError> {
        match &mut self.inner {
            Inner::V1(instance) => instance.set_string(references, values),
            Inner::V2(instance) => instance.component.set_string(references, values),
            Inner::V3(instance) => instance.set_string(references, values),
        }
    }

    fn get_binary(&mut self, references: &[u32], values: &mut [Vec<u8>]) -> Result<(), CallError> {
        match &mut self.inner {
            Inner::V3(instance) => instance.get_binary(references, values),
            _ => Err(absent("fmi3GetBinary")),
        }
    }

    fn set_binary(&mut self, references: &[u32], values: &[Vec<u8>]) -> Result<(), CallError> {
        match &mut self.inner {
            Inner::V3(instance) => instance.set_binary(references, values),
            _ => Err(absent("fmi3SetBinary")),
        }
    }

    fn set_input_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), CallError> {
        match &mut self.inner {
            Inner::V1(instance) => {
                instance.component.set_input_derivatives(references, orders, values)
            }
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
            Inner::V1(instance) => {
                instance.component.get_output_derivatives(references, orders, values)
            }
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
        match &mut self.inner {
            Inner::V1(_) => Err(absent("fmi2GetDirectionalDerivative")),
            Inner::V2(instance) => {
                instance.component.directional_derivative(unknowns, knowns, seed, changes)
            }
            Inner::V3(instance) => instance.directional_derivative(unknowns, knowns, seed, changes),
        }
    }

    fn save_state(&mut self, slot: usize) -> Result<(), CallError> {
        match &mut self.inner {
            Inner::V1(_) => Err(absent("fmi2GetFMUstate")),
            Inner::V2(instance) => instance.component.save_state(slot),
            Inner::V3(instance) => instance.save_state(slot),
        }
    }

    fn restore_state(&mut self, slot: usize) -> Result<(), CallError> {
        match &mut self.inner {
            Inner::V1(_) => Err(absent("fmi2SetFMUstate")),
            Inner::V2(instance) => instance.component.restore_state(slot),
            Inner::V3(instance) => instance.restore_state(slot),
        }
    }

    fn serialize_state(&mut self) -> Result<Vec<u8>, CallError> {
        match &mut self.inner {
            Inner::V1(_) => Err(absent("fmi2SerializeFMUstate")),
            Inner::V2(instance) => instance.component.serialize_state(),
            Inner::V3(instance) => instance.serialize_state(),
        }
    }

    fn deserialize_state(&mut self, bytes: &[u8]) -> Result<(), CallError> {
        match &mut self.inner {
            Inner::V1(_) => Err(absent("fmi2DeSerializeFMUstate")),
            Inner::V2(instance) => instance.component.deserialize_state(bytes),
            Inner::V3(instance) => instance.deserialize_state(bytes),
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
        match &mut self.inner {
            Inner::V1(instance) => instance.component.base.guards = true,
            Inner::V2(instance) => instance.component.guard_arrays(),
            Inner::V3(instance) => instance.component.base.guards = true,
        }
    }

    fn take_warning(&mut self) -> bool {
        match &mut self.inner {
            Inner::V1(instance) => instance.component.base.take_warning(),
            Inner::V2(instance) => instance.component.take_warning(),
            Inner::V3(instance) => instance.component.base.take_warning(),
        }
    }
}

impl Events for v3::Instance {
    fn next_event(&mut self) -> Result<Option<f64>, CallError> {
        Ok(v3::Instance::next_event(self))
    }

    fn enter_event_mode(&mut self) -> Result<(), CallError> {
        v3::Instance::enter_event_mode(self)
    }

    fn update_discrete_states(&mut self) -> Result<EventInfo, CallError> {
        v3::Instance::update_discrete_states(self)
    }

    fn leave_event_mode(&mut self) -> Result<(), CallError> {
        v3::Instance::leave_event_mode(self)
    }
}
