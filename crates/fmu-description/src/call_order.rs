//! Call order: the functions allowed in each state, as in the tables of FMI 2.0.5, sections 3.2.3 and
//! 4.2.4.

use serde::{Deserialize, Serialize};

use crate::{Causality, Initial, Variability};

/// `fmi2Type`: the interface of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum InterfaceType {
    /// `fmi2ModelExchange`.
    ModelExchange,
    /// `fmi2CoSimulation`.
    CoSimulation,
}

macro_rules! states {
    ($($(#[$doc:meta])* $name:ident,)*) => {
        /// The state of an instance.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
        pub enum State { $($(#[$doc])* $name,)* }

        impl State {
            /// Every state, in the order of the tables.
            pub const EVERY: [State; [$(stringify!($name)),*].len()] = [$(State::$name),*];

            /// Returns the bit mask of this state. Masks joined by `|` are sets of states.
            pub const fn bit(self) -> u16 {
                1 << self as u16
            }
        }
    };
}

states! {
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
    /// Co-simulation: `fmi2DoStep` runs, or has returned `fmi2Pending` and its step is not finished.
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
    /// FMI 3.0: after `fmi3EnterConfigurationMode` in state `Instantiated`.
    ConfigurationMode,
    /// FMI 3.0: after `fmi3EnterConfigurationMode` in event mode or step mode.
    ReconfigurationMode,
    /// FMI 3.0: during `fmi3IntermediateUpdateCallback`.
    IntermediateUpdateMode,
}

pub(crate) const I: u16 = State::Instantiated.bit();
pub(crate) const M: u16 = State::InitializationMode.bit();
pub(crate) const V: u16 = State::EventMode.bit();
pub(crate) const N: u16 = State::ContinuousTimeMode.bit();
pub(crate) const C: u16 = State::StepComplete.bit();
const P: u16 = State::StepInProgress.bit();
const F: u16 = State::StepFailed.bit();
const K: u16 = State::StepCanceled.bit();
pub(crate) const T: u16 = State::Terminated.bit();
const E: u16 = State::Error.bit();
/// Every state of FMI 2.0 except during a step and after `fmi2Fatal`.
const ALL: u16 = I | M | V | N | C | F | K | T | E;
/// The states in which values may be read.
const READ: u16 = ALL & !I;

/// Declares the functions of a version of FMI. A row of the first table has functions, then the states in which they
/// may be called: in model exchange, in co-simulation. The second table has the functions that may return `Discard`: in
/// both interfaces, only in model exchange, only in co-simulation.
macro_rules! functions {
    (
        $prefix:literal, $(#[$meta:meta])* { $($($name:ident)+: $exchange:expr, $simulation:expr;)* }
        $(#[$discards_meta:meta])* { $($always:ident)+; $($in_exchange:ident)+; $($in_simulation:ident)+; }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Function {
            $($(#[doc = concat!("`", $prefix, stringify!($name), "`")] $name,)+)*
        }

        impl Function {
            /// Every function, in the order of the table; in FMI 3.0 that is the order of `fmi3Functions.h`.
            pub const EVERY: &[Function] = &[$($(Function::$name,)+)*];

            /// Returns the name in the C ABI.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self { $($(Function::$name => concat!($prefix, stringify!($name)),)+)* }
            }

            /// Returns the states in which the function may be called for an interface.
            fn states(self, interface: InterfaceType) -> u16 {
                match (self, interface) {
                    $($((Function::$name, InterfaceType::ModelExchange) => $exchange,
                    (Function::$name, InterfaceType::CoSimulation) => $simulation,)+)*
                }
            }
        }

        /// Whether `function` may be called in `state` of an instance for `interface`.
        ///
        /// Conditions on single variables (in FMI 2.0 the numbers in the cells of the tables) are covered by
        /// [`settable`].
        #[must_use]
        pub fn allowed(interface: InterfaceType, function: Function, state: State) -> bool {
            function.states(interface) & state.bit() != 0
        }

        $(#[$discards_meta])*
        #[must_use]
        pub fn may_discard(interface: InterfaceType, function: Function) -> bool {
            match function {
                $(Function::$always)|+ => true,
                $(Function::$in_exchange)|+ => interface == InterfaceType::ModelExchange,
                $(Function::$in_simulation)|+ => interface == InterfaceType::CoSimulation,
                _ => false,
            }
        }
    };
}
pub(crate) use functions;

// A row: functions: states in model exchange, states in co-simulation.
functions! {
    "fmi2",
    /// A function of FMI that takes an instance.
    {
        SetDebugLogging: ALL, ALL | P;
        FreeInstance: ALL, ALL;
        SetupExperiment EnterInitializationMode: I, I;
        ExitInitializationMode: M, M;
        Terminate: V | N, C | F;
        Reset: ALL, ALL;
        GetReal GetInteger GetBoolean GetString: READ, READ;
        SetReal: I | M | V | N, I | M | C;
        SetInteger SetBoolean SetString: I | M | V, I | M | C;
        GetFMUstate SetFMUstate FreeFMUstate: ALL, ALL;
        SerializedFMUstateSize SerializeFMUstate DeSerializeFMUstate: ALL, ALL;
        GetDirectionalDerivative: READ, READ;
        EnterEventMode: V | N, 0;
        NewDiscreteStates EnterContinuousTimeMode: V, 0;
        CompletedIntegratorStep: N, 0;
        SetTime: V | N, 0;
        SetContinuousStates: N, 0;
        GetEventIndicators GetContinuousStates GetDerivatives: READ, 0;
        GetNominalsOfContinuousStates: ALL, 0;
        SetRealInputDerivatives: 0, I | M | C;
        GetRealOutputDerivatives: 0, C | F | K | T | E;
        DoStep: 0, C;
        CancelStep: 0, P;
        GetStatus GetRealStatus GetIntegerStatus GetBooleanStatus GetStringStatus: 0, C | P | F | T;
    }
    /// Whether `function` may return `fmi2Discard` (section 2.1.3).
    {
        SetReal SetInteger SetBoolean SetString;
        SetContinuousStates GetReal GetDerivatives GetContinuousStates GetEventIndicators;
        DoStep GetStatus GetRealStatus GetIntegerStatus GetBooleanStatus GetStringStatus;
    }
}

/// Returns the set of states in which a variable may be set ([`State::bit`]): conditions 1, 3 and 6 of section 4.2.4, 4
/// and 5 of section 3.2.3. The set also has inputs before initialization mode, because importers set inputs there.
/// `is_state` is true for a continuous state.
#[must_use]
pub fn settable(
    causality: Causality,
    variability: Variability,
    initial: Option<Initial>,
    is_state: bool,
) -> u16 {
    let at_the_start = match initial {
        Some(Initial::Exact) if variability != Variability::Constant => I | M,
        Some(Initial::Approx) => I,
        _ => 0,
    };
    let at_points = match (causality, variability) {
        (Causality::Input, Variability::Continuous) => I | M | V | N | C,
        (Causality::Input, _) => I | M | V | C,
        (Causality::Parameter, Variability::Tunable) => V | C,
        _ => 0,
    };
    at_the_start | at_points | if is_state { N } else { 0 }
}
