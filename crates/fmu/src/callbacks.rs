//! The functions of the importer that an instance calls.
#![expect(unsafe_code, reason = "functions of C")]

use std::ffi::CString;
use std::sync::{Arc, Mutex, PoisonError};

use fmu_description::abi::{Status, fmi2CallbackFunctions, fmi2Status};
use fmu_description::abi3::{
    fmi3InstanceEnvironment, fmi3IntermediateUpdateCallback, fmi3LogMessageCallback, fmi3Status,
};

use crate::fence::outside;

/// The importer's logger, with the arguments that are the same for every message.
#[derive(Clone)]
pub(crate) enum Callbacks {
    /// FMI 2.0.
    Version2 { functions: fmi2CallbackFunctions, instance_name: CString },
    /// FMI 3.0.
    Version3 { environment: fmi3InstanceEnvironment, log: Option<fmi3LogMessageCallback> },
    /// An importer in the same program, which collects the messages.
    Linked(Arc<Mutex<Vec<String>>>),
}

// SAFETY: by the standard the importer's callbacks may be called from any thread that calls the FMU;
// the instance only passes the environment pointer back.
unsafe impl Send for Callbacks {}

impl Callbacks {
    /// Callbacks that do nothing.
    #[cfg(test)]
    pub(crate) fn silent() -> Self {
        Self::Version3 { environment: std::ptr::null_mut(), log: None }
    }

    /// Whether the importer receives a message with this status whatever its logging settings are.
    ///
    /// FMI 3.0.2 demands both that `fmi3Error` and a failed instantiation are explained, and that nothing is logged
    /// while `loggingOn` is false (section 2.3.1). In the next release of FMI 3.0, errors are logged.
    pub(crate) fn needs(&self, status: Status) -> bool {
        matches!(self, Self::Version3 { .. }) && matches!(status, Status::Error | Status::Fatal)
    }

    /// Sends a message to the importer's logger, if there is one. The format string of FMI 2.0 is `%s`; `#`, by which
    /// the standard marks value references, is doubled, and zeros are removed.
    pub(crate) fn log(&self, status: Status, category: &str, message: &str) {
        if let Self::Linked(messages) = self {
            return messages
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .push(message.to_owned());
        }
        let c_string = |text: &str| CString::new(text.replace('\0', "")).unwrap_or_default();
        let (category, message) = (c_string(category), c_string(&message.replace('#', "##")));
        let (category, message) = (category.as_ptr(), message.as_ptr());
        match self {
            Self::Linked(_) => {}
            Self::Version2 { functions, instance_name } => {
                let Some(logger) = functions.logger else { return };
                let (environment, name) = (functions.component_environment, instance_name.as_ptr());
                let status = status as fmi2Status;
                // SAFETY: the logger has this signature by the standard; all strings outlive the call.
                outside(|| unsafe {
                    logger(environment, name, status, category, c"%s".as_ptr(), message);
                });
            }
            Self::Version3 { environment, log } => {
                let Some(log) = log else { return };
                // SAFETY: the logger has this signature by the standard; all strings outlive the call.
                outside(|| unsafe { log(*environment, status as fmi3Status, category, message) });
            }
        }
    }
}

/// `fmi3IntermediateUpdateCallback` of an importer.
#[derive(Clone, Copy)]
pub(crate) struct IntermediateUpdate {
    pub(crate) environment: fmi3InstanceEnvironment,
    pub(crate) function: fmi3IntermediateUpdateCallback,
}

// SAFETY: as for `Callbacks`.
unsafe impl Send for IntermediateUpdate {}

impl IntermediateUpdate {
    /// A callback that sets nothing.
    #[cfg(test)]
    pub(crate) fn silent() -> Self {
        unsafe extern "C" fn nothing(
            _: fmi3InstanceEnvironment,
            _: f64,
            _: u8,
            _: u8,
            _: u8,
            _: u8,
            _: *mut u8,
            _: *mut f64,
        ) {
        }
        Self { environment: std::ptr::null_mut(), function: nothing }
    }

    /// Asks the importer to set the inputs of `time` in s; the importer can neither read outputs nor end the step
    /// early.
    pub(crate) fn ask(self, time: f64) {
        let (mut return_requested, mut return_time) = (0, time);
        let (request, result) = (&raw mut return_requested, &raw mut return_time);
        // SAFETY: the callback has this signature by the standard; both places outlive the call.
        outside(|| unsafe { (self.function)(self.environment, time, 1, 0, 0, 0, request, result) });
    }
}
