//! Which function may be called in which state: the table of FMI 2.0.5, section 4.2.4.

use serde::{Deserialize, Serialize};

/// State of a co-simulation slave.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum State {
    /// After `fmi2Instantiate` or `fmi2Reset`.
    Instantiated,
    /// After `fmi2EnterInitializationMode`.
    InitializationMode,
    /// After `fmi2ExitInitializationMode` or a completed step.
    StepComplete,
    /// After `fmi2DoStep` returned `fmi2Discard`.
    StepFailed,
    /// After `fmi2Terminate`.
    Terminated,
    /// After a function returned `fmi2Error`.
    Error,
    /// After a function returned `fmi2Fatal`.
    Fatal,
}

const I: u8 = 1 << State::Instantiated as u8;
const M: u8 = 1 << State::InitializationMode as u8;
const C: u8 = 1 << State::StepComplete as u8;
const F: u8 = 1 << State::StepFailed as u8;
const T: u8 = 1 << State::Terminated as u8;
const E: u8 = 1 << State::Error as u8;
const X: u8 = 1 << State::Fatal as u8;
const ALL: u8 = I | M | C | F | T | E;

macro_rules! functions {
    ($($name:ident = $states:expr,)*) => {
        /// A function of the standard that works on an instance.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Function { $(#[doc = concat!("`fmi2", stringify!($name), "`")] $name,)* }

        impl Function {
            /// Every function, in the order of the table.
            pub const EVERY: &[Function] = &[$(Function::$name,)*];

            /// The name in the C ABI.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self { $(Function::$name => concat!("fmi2", stringify!($name)),)* }
            }

            fn states(self) -> u8 {
                match self { $(Function::$name => $states,)* }
            }
        }
    };
}

// The columns stepInProgress and stepCanceled do not occur: every step is finished on return.
functions! {
    SetDebugLogging = ALL,
    FreeInstance = ALL | X,
    SetupExperiment = I,
    EnterInitializationMode = I,
    ExitInitializationMode = M,
    Terminate = C | F,
    Reset = ALL,
    GetReal = M | C | F | T | E,
    GetInteger = M | C | F | T | E,
    GetBoolean = M | C | F | T | E,
    GetString = M | C | F | T | E,
    SetReal = I | M | C,
    SetInteger = I | M | C,
    SetBoolean = I | M | C,
    SetString = I | M | C,
    GetFMUstate = ALL,
    SetFMUstate = ALL,
    FreeFMUstate = ALL,
    SerializedFMUstateSize = ALL,
    SerializeFMUstate = ALL,
    DeSerializeFMUstate = ALL,
    GetDirectionalDerivative = M | C | F | T | E,
    SetRealInputDerivatives = I | M | C,
    GetRealOutputDerivatives = C | F | T | E,
    DoStep = C,
    CancelStep = 0,
    GetStatus = C | F | T,
    GetRealStatus = C | F | T,
    GetIntegerStatus = C | F | T,
    GetBooleanStatus = C | F | T,
    GetStringStatus = C | F | T,
}

/// Whether `function` may be called in `state`.
#[must_use]
pub fn allowed(function: Function, state: State) -> bool {
    function.states() & (1 << state as u8) != 0
}
