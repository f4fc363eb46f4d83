//! The functions that a worker executes. The master sends the number of a function as its command. Errors use the
//! name of the function if the worker fails while it executes no C function.

use crate::library::function_names;
use fmu_description::Version;

/// Names in errors of a worker that are neither C functions nor in the table of [`Function`].
const OTHERS: [&str; 5] = [
    crate::crash::UNLOADING,
    "the integration of the model-exchange FMU",
    "numberOfContinuousStates",
    "numberOfEventIndicators",
    "modelDescription.xml",
];

/// Returns the static name of a function of any version; `None` if no error of a worker names it.
pub(super) fn known_name(name: &str) -> Option<&'static str> {
    let table = Function::ALL.iter().map(|function| function.name(Version::V2));
    table.chain(OTHERS).chain(function_names()).find(|known| *known == name)
}

/// Defines the functions, each with its names in errors for FMI 2.0, 3.0 and 1.0.
macro_rules! functions {
    ($($function:ident = $name:literal $name_3:literal $name_1:literal,)*) => {
        /// A function of a worker.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(super) enum Function {
            $($function,)*
        }

        impl Function {
            const ALL: &[Function] = &[$(Function::$function,)*];

            /// Returns a static reference to the name, for crash reports of the master's process.
            #[inline]
            pub(super) fn static_name(self, version: Version) -> &'static &'static str {
                match (self, version) {
                    $((Function::$function, Version::V2) => &$name,
                    (Function::$function, Version::V3) => &$name_3,
                    (Function::$function, Version::V1) => &$name_1,)*
                }
            }
        }
    };
}

functions! {
    Load = "loading the library" "loading the library" "loading the library",
    Instantiate = "fmi2Instantiate" "fmi3InstantiateCoSimulation" "fmiInstantiateSlave",
    SetDebugLogging = "fmi2SetDebugLogging" "fmi3SetDebugLogging" "fmiSetDebugLogging",
    SetupExperiment = "fmi2SetupExperiment" "fmi3EnterInitializationMode" "fmiInitializeSlave",
    EnterInitializationMode = "fmi2EnterInitializationMode" "fmi3EnterInitializationMode" "fmiInitializeSlave",
    ExitInitializationMode = "fmi2ExitInitializationMode" "fmi3ExitInitializationMode" "fmiInitializeSlave",
    Terminate = "fmi2Terminate" "fmi3Terminate" "fmiTerminateSlave",
    GetReal = "fmi2GetReal" "fmi3GetFloat64" "fmiGetReal",
    SetReal = "fmi2SetReal" "fmi3SetFloat64" "fmiSetReal",
    GetInteger = "fmi2GetInteger" "fmi3GetInt64" "fmiGetInteger",
    SetInteger = "fmi2SetInteger" "fmi3SetInt64" "fmiSetInteger",
    GetBoolean = "fmi2GetBoolean" "fmi3GetBoolean" "fmiGetBoolean",
    SetBoolean = "fmi2SetBoolean" "fmi3SetBoolean" "fmiSetBoolean",
    GetString = "fmi2GetString" "fmi3GetString" "fmiGetString",
    SetString = "fmi2SetString" "fmi3SetString" "fmiSetString",
    SetInputDerivatives = "fmi2SetRealInputDerivatives" "fmi3GetFloat64" "fmiSetRealInputDerivatives",
    GetOutputDerivatives = "fmi2GetRealOutputDerivatives" "fmi3GetOutputDerivatives" "fmiGetRealOutputDerivatives",
    DoStep = "fmi2DoStep" "fmi3DoStep" "fmiDoStep",
    DirectionalDerivative = "fmi2GetDirectionalDerivative" "fmi3GetDirectionalDerivative" "fmi2GetDirectionalDerivative",
    SaveState = "fmi2GetFMUstate" "fmi3GetFMUState" "fmi2GetFMUstate",
    RestoreState = "fmi2SetFMUstate" "fmi3SetFMUState" "fmi2SetFMUstate",
    SerializeState = "fmi2SerializeFMUstate" "fmi3SerializeFMUState" "fmi2SerializeFMUstate",
    DeserializeState = "fmi2DeSerializeFMUstate" "fmi3DeserializeFMUState" "fmi2DeSerializeFMUstate",
    Free = "fmi2FreeInstance" "fmi3FreeInstance" "fmiFreeSlaveInstance",
    GetBinary = "fmi3GetBinary" "fmi3GetBinary" "fmi3GetBinary",
    SetBinary = "fmi3SetBinary" "fmi3SetBinary" "fmi3SetBinary",
    Configure = "fmi3EnterConfigurationMode" "fmi3EnterConfigurationMode" "fmi3EnterConfigurationMode",
    HandOverEvents = "fmi2Instantiate" "fmi3InstantiateCoSimulation" "fmiInstantiateSlave",
    NextEvent = "fmi2NewDiscreteStates" "fmi3UpdateDiscreteStates" "fmi2NewDiscreteStates",
    EnterEventMode = "fmi2EnterEventMode" "fmi3EnterEventMode" "fmi2EnterEventMode",
    UpdateDiscreteStates = "fmi2NewDiscreteStates" "fmi3UpdateDiscreteStates" "fmi2NewDiscreteStates",
    LeaveEventMode = "fmi2EnterContinuousTimeMode" "fmi3EnterStepMode" "fmi2EnterContinuousTimeMode",
    // Transfer the parts of a request or of an answer that is longer than the shared memory.
    Upload = "the transfer of data to it" "the transfer of data to it" "the transfer of data to it",
    Download = "the transfer of data from it" "the transfer of data from it" "the transfer of data from it",
}

impl Function {
    /// Returns the name in a version of FMI.
    pub(super) fn name(self, version: Version) -> &'static str {
        self.static_name(version)
    }

    /// Whether arguments and results pass as words without allocation, because the function runs in every step. All
    /// other functions are requests.
    #[inline]
    pub(super) fn is_exchange(self) -> bool {
        use Function::{DoStep, GetBoolean, GetInteger, GetReal, SetBoolean, SetInteger, SetReal};
        matches!(
            self,
            DoStep | GetReal | SetReal | GetInteger | SetInteger | GetBoolean | SetBoolean
        )
    }

    pub(super) fn to_word(self) -> u64 {
        self as u64
    }

    /// Returns the function with this number; `None` if there is none.
    pub(super) fn from_word(word: u64) -> Option<Self> {
        Self::ALL.get(usize::try_from(word).ok()?).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_function_has_its_number_and_name() {
        for function in Function::ALL {
            assert_eq!(Function::from_word(function.to_word()), Some(*function));
            for version in [Version::V1, Version::V2, Version::V3] {
                let name = function.name(version);
                assert_eq!(known_name(name), Some(name));
            }
        }
        assert_eq!(Function::from_word(u64::MAX), None);
        assert!(known_name("the integration of the model-exchange FMU").is_some());
        assert_eq!(known_name("fmi2GetDerivatives"), Some("fmi2GetDerivatives"));
        assert_eq!(known_name("fmi2Nothing"), None);
    }
}
