//! The functions that a worker executes. The number of a function is the command of the master, and
//! names the function that crashed.

use serde::{Deserialize, Serialize};

/// Defines the functions, each with the name that its errors have.
macro_rules! functions {
    ($($function:ident = $name:literal,)*) => {
        /// A function of a worker.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
        pub(super) enum Function {
            $($function,)*
        }

        impl Function {
            const ALL: &[Function] = &[$(Function::$function,)*];

            /// Returns a static reference to the name, for the report of a crash of the master.
            #[inline]
            pub(super) fn static_name(self) -> &'static &'static str {
                match self {
                    $(Function::$function => &$name,)*
                }
            }
        }
    };
}

functions! {
    Load = "loading the library",
    Instantiate = "fmi2Instantiate",
    SetDebugLogging = "fmi2SetDebugLogging",
    SetupExperiment = "fmi2SetupExperiment",
    EnterInitializationMode = "fmi2EnterInitializationMode",
    ExitInitializationMode = "fmi2ExitInitializationMode",
    Terminate = "fmi2Terminate",
    GetReal = "fmi2GetReal",
    SetReal = "fmi2SetReal",
    GetInteger = "fmi2GetInteger",
    SetInteger = "fmi2SetInteger",
    GetBoolean = "fmi2GetBoolean",
    SetBoolean = "fmi2SetBoolean",
    GetString = "fmi2GetString",
    SetString = "fmi2SetString",
    SetInputDerivatives = "fmi2SetRealInputDerivatives",
    GetOutputDerivatives = "fmi2GetRealOutputDerivatives",
    DoStep = "fmi2DoStep",
    DirectionalDerivative = "fmi2GetDirectionalDerivative",
    SaveState = "fmi2GetFMUstate",
    RestoreState = "fmi2SetFMUstate",
    SerializeState = "fmi2SerializeFMUstate",
    DeserializeState = "fmi2DeSerializeFMUstate",
    Free = "fmi2FreeInstance",
    GetStatus = "fmi2GetStatus",
    GetRealStatus = "fmi2GetRealStatus",
    GetBooleanStatus = "fmi2GetBooleanStatus",
    SerializedSize = "fmi2SerializedFMUstateSize",
    // Transfer the parts of a request or of an answer that is longer than the shared memory.
    Upload = "the transfer of data to it",
    Download = "the transfer of data from it",
}

impl Function {
    /// Returns the name.
    pub(super) fn name(self) -> &'static str {
        self.static_name()
    }

    /// Returns the function with this name.
    pub(super) fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|function| function.name() == name)
    }

    /// Whether arguments and results pass as words without allocation, because the function runs in
    /// every step. The other functions are requests.
    #[inline]
    pub(super) fn is_exchange(self) -> bool {
        use Function::{DoStep, GetBoolean, GetInteger, GetReal, SetBoolean, SetInteger, SetReal};
        matches!(
            self,
            DoStep | GetReal | SetReal | GetInteger | SetInteger | GetBoolean | SetBoolean
        )
    }

    /// Returns the number of the function.
    pub(super) fn to_word(self) -> u64 {
        self as u64
    }

    /// Returns the function with this number.
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
            assert_eq!(Function::named(function.name()), Some(*function));
        }
        assert_eq!(Function::from_word(u64::MAX), None);
        assert_eq!(Function::named("fmi2Nothing"), None);
    }
}
