//! Which function may be called in which state: the tables of FMI 2.0.5, sections 3.2.3 and 4.2.4.

use serde::{Deserialize, Serialize};

/// `fmi2Type`: for which of the two interfaces an instance was made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum InterfaceType {
    /// `fmi2ModelExchange`.
    ModelExchange,
    /// `fmi2CoSimulation`.
    CoSimulation,
}

/// State of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum State {
    /// After `fmi2Instantiate` or `fmi2Reset`.
    Instantiated,
    /// After `fmi2EnterInitializationMode`.
    InitializationMode,
    /// Model exchange: after `fmi2ExitInitializationMode` or `fmi2EnterEventMode`.
    EventMode,
    /// Model exchange: after `fmi2EnterContinuousTimeMode`.
    ContinuousTimeMode,
    /// Co-simulation: after `fmi2ExitInitializationMode` or a completed step.
    StepComplete,
    /// Co-simulation: while `fmi2DoStep` runs.
    StepInProgress,
    /// Co-simulation: after `fmi2DoStep` returned `fmi2Discard`.
    StepFailed,
    /// Co-simulation: after `fmi2CancelStep`.
    StepCanceled,
    /// After `fmi2Terminate`.
    Terminated,
    /// After a function returned `fmi2Error`.
    Error,
    /// After a function returned `fmi2Fatal`.
    Fatal,
}

impl State {
    /// Every state, in the order of the tables.
    pub const EVERY: [State; 11] = {
        use State::{
            ContinuousTimeMode, Error, EventMode, Fatal, InitializationMode, Instantiated,
            StepCanceled, StepComplete, StepFailed, StepInProgress, Terminated,
        };
        [
            Instantiated,
            InitializationMode,
            EventMode,
            ContinuousTimeMode,
            StepComplete,
            StepInProgress,
            StepFailed,
            StepCanceled,
            Terminated,
            Error,
            Fatal,
        ]
    };
}

const I: u16 = 1 << State::Instantiated as u16;
const M: u16 = 1 << State::InitializationMode as u16;
const V: u16 = 1 << State::EventMode as u16;
const N: u16 = 1 << State::ContinuousTimeMode as u16;
const C: u16 = 1 << State::StepComplete as u16;
const P: u16 = 1 << State::StepInProgress as u16;
const F: u16 = 1 << State::StepFailed as u16;
const K: u16 = 1 << State::StepCanceled as u16;
const T: u16 = 1 << State::Terminated as u16;
const E: u16 = 1 << State::Error as u16;
/// Every state in which an instance is at rest.
const ALL: u16 = I | M | V | N | C | F | K | T | E;
/// The states in which values can be read.
const READ: u16 = ALL & !I;

macro_rules! functions {
    ($($name:ident: $exchange:expr, $simulation:expr;)*) => {
        /// A function of the standard that works on an instance.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Function { $(#[doc = concat!("`fmi2", stringify!($name), "`")] $name,)* }

        impl Function {
            /// Every function, in the order of the tables.
            pub const EVERY: &[Function] = &[$(Function::$name,)*];

            /// The name in the C ABI.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self { $(Function::$name => concat!("fmi2", stringify!($name)),)* }
            }

            /// The states in which it may be called, by interface.
            fn states(self, interface: InterfaceType) -> u16 {
                match (self, interface) {
                    $((Function::$name, InterfaceType::ModelExchange) => $exchange,
                    (Function::$name, InterfaceType::CoSimulation) => $simulation,)*
                }
            }
        }
    };
}

// A row: function: states in model exchange, states in co-simulation.
functions! {
    SetDebugLogging: ALL, ALL | P;
    FreeInstance: ALL, ALL;
    SetupExperiment: I, I;
    EnterInitializationMode: I, I;
    ExitInitializationMode: M, M;
    Terminate: V | N, C | F;
    Reset: ALL, ALL;
    GetReal: READ, READ;
    GetInteger: READ, READ;
    GetBoolean: READ, READ;
    GetString: READ, READ;
    SetReal: I | M | V | N, I | M | C;
    SetInteger: I | M | V, I | M | C;
    SetBoolean: I | M | V, I | M | C;
    SetString: I | M | V, I | M | C;
    GetFMUstate: ALL, ALL;
    SetFMUstate: ALL, ALL;
    FreeFMUstate: ALL, ALL;
    SerializedFMUstateSize: ALL, ALL;
    SerializeFMUstate: ALL, ALL;
    DeSerializeFMUstate: ALL, ALL;
    GetDirectionalDerivative: READ, READ;
    EnterEventMode: V | N, 0;
    NewDiscreteStates: V, 0;
    EnterContinuousTimeMode: V, 0;
    CompletedIntegratorStep: N, 0;
    SetTime: V | N, 0;
    SetContinuousStates: N, 0;
    GetEventIndicators: READ, 0;
    GetContinuousStates: READ, 0;
    GetDerivatives: READ, 0;
    GetNominalsOfContinuousStates: ALL, 0;
    SetRealInputDerivatives: 0, I | M | C;
    GetRealOutputDerivatives: 0, C | F | K | T | E;
    DoStep: 0, C;
    CancelStep: 0, P;
    GetStatus: 0, C | P | F | T;
    GetRealStatus: 0, C | P | F | T;
    GetIntegerStatus: 0, C | P | F | T;
    GetBooleanStatus: 0, C | P | F | T;
    GetStringStatus: 0, C | P | F | T;
}

/// Whether `function` may return `fmi2Discard`: section 2.1.3 lists them.
#[must_use]
pub fn may_discard(interface: InterfaceType, function: Function) -> bool {
    use Function as F;
    match function {
        F::SetReal | F::SetInteger | F::SetBoolean | F::SetString => true,
        F::SetContinuousStates
        | F::GetReal
        | F::GetDerivatives
        | F::GetContinuousStates
        | F::GetEventIndicators => interface == InterfaceType::ModelExchange,
        F::DoStep
        | F::GetStatus
        | F::GetRealStatus
        | F::GetIntegerStatus
        | F::GetBooleanStatus
        | F::GetStringStatus => interface == InterfaceType::CoSimulation,
        _ => false,
    }
}

/// Whether `function` may be called in `state` of an instance made for `interface`.
///
/// Conditions on single variables (the numbers in the cells) are tested where values are set.
#[must_use]
pub fn allowed(interface: InterfaceType, function: Function, state: State) -> bool {
    function.states(interface) & (1 << state as u16) != 0
}
