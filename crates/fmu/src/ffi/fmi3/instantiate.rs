//! `fmi3InstantiateXXX`.

use std::path::{Path, PathBuf};

use super::super::{folder, into_component, read, text};
use crate::callbacks::{Callbacks, IntermediateUpdate};
use crate::instance::{Instance, Instantiation};
use crate::model::{Failure, Model};
use fmu_description::abi::Status;
use fmu_description::abi3::{
    fmi3Boolean, fmi3ClockUpdateCallback, fmi3Instance, fmi3InstanceEnvironment,
    fmi3IntermediateUpdateCallback, fmi3LockPreemptionCallback, fmi3LogMessageCallback, fmi3String,
    fmi3UnlockPreemptionCallback, fmi3ValueReference,
};
use fmu_description::call_order::InterfaceType;
use fmu_description::location::NO_FOLDER;

/// The strings of `fmi3InstantiateXXX`, and `requiredIntermediateVariables` with its length.
struct Pointers {
    name: fmi3String,
    token: fmi3String,
    resources: fmi3String,
    required: *const fmi3ValueReference,
    required_count: usize,
}

/// Returns token, folder of resources and required intermediate variables. A null or empty path means that the importer
/// has no resources. An error for an empty name, and for null or misaligned pointers.
unsafe fn read_pointers<'a>(pointers: &Pointers) -> Result<(String, PathBuf, &'a [u32]), Failure> {
    // SAFETY: strings are null or zero-terminated, and the array has the stated length, by the standard.
    unsafe {
        let name = text(pointers.name, "instanceName")?;
        if name.trim().is_empty() {
            return Err(Failure::Error("instanceName is empty".to_owned()));
        }
        let token = text(pointers.token, "instantiationToken")?;
        let folder = folder(pointers.resources, "resourcePath")?;
        let folder = folder.unwrap_or_else(|| NO_FOLDER.to_owned());
        Ok((token, folder.into(), read(pointers.required, pointers.required_count)?))
    }
}

/// Makes an instance, or logs why there is none and returns null.
unsafe fn instantiate<M: Model>(
    function: &str,
    pointers: &Pointers,
    callbacks: &Callbacks,
    instantiation: &Instantiation<'_>,
) -> fmi3Instance {
    // SAFETY: strings and array as the standard demands them.
    let instance = unsafe { read_pointers(pointers) }.and_then(|(token, resources, required)| {
        let complete =
            Instantiation { token: &token, resources: &resources, required, ..*instantiation };
        Instance::<M>::new_3(&complete, callbacks.clone())
    });
    into_component(function, instance, callbacks)
}

fn instantiation(interface_type: InterfaceType, logging_on: fmi3Boolean) -> Instantiation<'static> {
    Instantiation {
        interface_type,
        token: "",
        resources: Path::new(NO_FOLDER),
        logging_on: logging_on != 0,
        event_mode_used: false,
        early_return_allowed: false,
        intermediate: None,
        required: &[],
    }
}

#[must_use]
pub unsafe fn instantiate_model_exchange<M: Model>(
    name: fmi3String,
    token: fmi3String,
    resources: fmi3String,
    _visible: fmi3Boolean,
    logging_on: fmi3Boolean,
    environment: fmi3InstanceEnvironment,
    log: Option<fmi3LogMessageCallback>,
) -> fmi3Instance {
    let callbacks = Callbacks::Version3 { environment, log };
    let pointers =
        Pointers { name, token, resources, required: std::ptr::null(), required_count: 0 };
    let instantiation = instantiation(InterfaceType::ModelExchange, logging_on);
    // SAFETY: strings as the standard demands them.
    unsafe {
        instantiate::<M>("fmi3InstantiateModelExchange", &pointers, &callbacks, &instantiation)
    }
}

/// `fmi3InstantiateCoSimulation`. With a callback and `requiredIntermediateVariables` the importer sets inputs within a
/// step.
#[must_use]
#[expect(clippy::too_many_arguments, reason = "the arguments of the standard")]
pub unsafe fn instantiate_co_simulation<M: Model>(
    name: fmi3String,
    token: fmi3String,
    resources: fmi3String,
    _visible: fmi3Boolean,
    logging_on: fmi3Boolean,
    event_mode_used: fmi3Boolean,
    early_return_allowed: fmi3Boolean,
    required: *const fmi3ValueReference,
    required_count: usize,
    environment: fmi3InstanceEnvironment,
    log: Option<fmi3LogMessageCallback>,
    intermediate_update: Option<fmi3IntermediateUpdateCallback>,
) -> fmi3Instance {
    let callbacks = Callbacks::Version3 { environment, log };
    let pointers = Pointers { name, token, resources, required, required_count };
    let update = |function| IntermediateUpdate { environment, function };
    let instantiation = Instantiation {
        intermediate: intermediate_update.map(update),
        event_mode_used: event_mode_used != 0,
        early_return_allowed: early_return_allowed != 0,
        ..instantiation(InterfaceType::CoSimulation, logging_on)
    };
    // SAFETY: strings and array as the standard demands them.
    unsafe {
        instantiate::<M>("fmi3InstantiateCoSimulation", &pointers, &callbacks, &instantiation)
    }
}

/// `fmi3InstantiateScheduledExecution`: logs that the FMU does not offer it, and returns null.
#[must_use]
#[expect(clippy::too_many_arguments, reason = "the arguments of the standard")]
pub unsafe fn instantiate_scheduled_execution<M: Model>(
    _name: fmi3String,
    _token: fmi3String,
    _resources: fmi3String,
    _visible: fmi3Boolean,
    _logging_on: fmi3Boolean,
    environment: fmi3InstanceEnvironment,
    log: Option<fmi3LogMessageCallback>,
    _clock_update: Option<fmi3ClockUpdateCallback>,
    _lock_preemption: Option<fmi3LockPreemptionCallback>,
    _unlock_preemption: Option<fmi3UnlockPreemptionCallback>,
) -> fmi3Instance {
    let message = format!(
        "fmi3InstantiateScheduledExecution: {} offers no scheduled execution",
        M::IDENTIFIER
    );
    Callbacks::Version3 { environment, log }.log(Status::Error, "logStatusError", &message);
    std::ptr::null_mut()
}
