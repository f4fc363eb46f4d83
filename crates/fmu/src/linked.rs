//! A model that is linked into the program that runs it: the functions of FMI 2.0 without the C ABI.

use std::sync::{Arc, Mutex, PoisonError};

use crate::Experiment;
use crate::callbacks::Callbacks;
use crate::instance::{Instance, Snapshot};
use crate::model::{Failure, Model};
use crate::room::room_of;
use fmu_description::ModelDescription;
use fmu_description::abi::Status;
use fmu_description::call_order::Function;

/// An instance for co-simulation in the same program, for platforms that cannot load a library.
///
/// Each function works as the FMI 2.0 function of the same name in the FMU: checks, call order, panic fence and numbers
/// are the same. Each function returns the status of FMI; [`Linked::take_messages`] returns the reasons.
pub struct Linked<M: Model> {
    instance: Instance<M>,
    description: ModelDescription,
    messages: Arc<Mutex<Vec<String>>>,
    saved: Vec<Option<Snapshot<M>>>,
}

/// Defines functions that call a function of the instance by [`Instance::call`].
macro_rules! calls {
    ($($(#[$doc:meta])* $name:ident = $function:ident($($argument:ident: $type:ty),*),
        $instance:ident => $body:expr;)*) => {
        $($(#[$doc])* pub fn $name(&mut self, $($argument: $type),*) -> Status {
            self.instance.call(Function::$function, |$instance| $body)
        })*
    };
}

impl<M: Model> Linked<M> {
    /// Creates an instance of `model`.
    ///
    /// # Errors
    ///
    /// [`Failure::Error`] if the variables of the model cannot be described in FMI 2.0; [`Failure::Fatal`] if the model
    /// panics.
    pub fn new(model: M) -> Result<Self, Failure> {
        let messages = Arc::new(Mutex::new(Vec::new()));
        let (instance, description) = Instance::linked(model, Callbacks::Linked(messages.clone()))?;
        Ok(Self { instance, description, messages, saved: Vec::new() })
    }

    /// The model description of FMI 2.0.
    pub fn description(&self) -> &ModelDescription {
        &self.description
    }

    /// Returns and removes the messages since the last call of this function.
    pub fn take_messages(&mut self) -> Vec<String> {
        std::mem::take(&mut *self.messages.lock().unwrap_or_else(PoisonError::into_inner))
    }

    calls! {
        /// `fmi2SetupExperiment`.
        setup_experiment = SetupExperiment(experiment: &Experiment),
            instance => instance.setup_experiment(*experiment);
        /// `fmi2EnterInitializationMode`.
        enter_initialization_mode = EnterInitializationMode(),
            instance => instance.enter_initialization_mode();
        /// `fmi2ExitInitializationMode`.
        exit_initialization_mode = ExitInitializationMode(),
            instance => instance.exit_initialization_mode();
        /// `fmi2Terminate`.
        terminate = Terminate(), instance => { instance.terminate(); Ok(()) };
        /// `fmi2GetReal`.
        get_real = GetReal(references: &[u32], values: &mut [f64]),
            instance => instance.get_real(references, room_of(values));
        /// `fmi2GetInteger`.
        get_integer = GetInteger(references: &[u32], values: &mut [i32]),
            instance => instance.get_integer(references, room_of(values));
        /// `fmi2GetBoolean`.
        get_boolean = GetBoolean(references: &[u32], values: &mut [i32]),
            instance => instance.get_boolean(references, room_of(values));
        /// `fmi2SetReal`.
        set_real = SetReal(references: &[u32], values: &[f64]),
            instance => instance.set_real(references, values);
        /// `fmi2SetInteger`.
        set_integer = SetInteger(references: &[u32], values: &[i32]),
            instance => instance.set_integer(references, values);
        /// `fmi2SetBoolean`.
        set_boolean = SetBoolean(references: &[u32], values: &[i32]),
            instance => instance.set_boolean(references, values);
        /// `fmi2SetRealInputDerivatives`.
        set_real_input_derivatives = SetRealInputDerivatives(references: &[u32], orders: &[i32], values: &[f64]),
            instance => instance.set_real_input_derivatives(references, orders, values);
        /// `fmi2GetRealOutputDerivatives`.
        get_real_output_derivatives = GetRealOutputDerivatives(references: &[u32], orders: &[i32], values: &mut [f64]),
            instance => instance.get_real_output_derivatives(references, orders, room_of(values));
        /// `fmi2DoStep` from `start` over `size`, both in s.
        do_step = DoStep(start: f64, size: f64), instance => instance.do_step(start, size);
    }

    /// `fmi2GetRealStatus(fmi2LastSuccessfulTime)` in s.
    pub fn last_successful_time(&self) -> f64 {
        self.instance.last_successful_time()
    }

    /// `fmi2GetBooleanStatus(fmi2Terminated)`.
    pub fn is_terminated(&self) -> bool {
        self.instance.is_terminated()
    }

    /// `fmi2GetFMUstate`: saves the state in `slot` (0, 1, 2, ...), which is empty after a failure.
    pub fn save_state(&mut self, slot: usize) -> Status {
        let mut saved = None;
        let status = self.instance.call(Function::GetFMUstate, |instance| {
            saved = Some(instance.snapshot());
            Ok(())
        });
        if self.saved.len() <= slot {
            self.saved.resize_with(slot + 1, || None);
        }
        self.saved[slot] = saved;
        status
    }

    /// `fmi2SetFMUstate`: restores the state of `slot`; [`Status::Error`] for an empty slot.
    pub fn restore_state(&mut self, slot: usize) -> Status {
        let saved = self.saved.get(slot).and_then(Option::as_ref);
        self.instance.call(Function::SetFMUstate, |instance| match saved {
            Some(saved) => instance.restore(saved),
            None => Err(Failure::Error(format!("no state is saved in slot {slot}"))),
        })
    }

    /// `fmi2SerializeFMUstate` of the present state; appends to `bytes`.
    pub fn serialize_state(&mut self, bytes: &mut Vec<u8>) -> Status {
        self.instance.call(Function::SerializeFMUstate, |instance| {
            bytes.extend(instance.snapshot().to_bytes()?);
            Ok(())
        })
    }

    /// `fmi2DeSerializeFMUstate` and `fmi2SetFMUstate`: restores the state in `bytes`.
    pub fn deserialize_state(&mut self, bytes: &[u8]) -> Status {
        self.instance.call(Function::SetFMUstate, |instance| {
            let snapshot = instance.read_snapshot(bytes)?;
            instance.restore(&snapshot)
        })
    }
}
