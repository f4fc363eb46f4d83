//! Call order of FMI 3.0.2: the functions allowed in each state, as sections 2.3, 3.2.1 and 4.2.1 state
//! them.
//!
//! The states are those of [`call_order`]: [`State::StepComplete`] is Step Mode. After
//! `fmi3Error` an instance is in state [`State::Terminated`] (section 2.3.1), so no state `Error` exists.

use crate::call_order::{self, C, I, InterfaceType, M, N, State, T, V, functions};
use crate::{Causality, Initial, Variability};

const G: u16 = State::ConfigurationMode.bit();
const U: u16 = State::IntermediateUpdateMode.bit();
const R: u16 = State::ReconfigurationMode.bit();
/// The states in the super state "FMU State Settable": `ME` in model exchange, `CS` in co-simulation.
const ME: u16 = I | G | M | V | N | R | T;
const CS: u16 = I | G | M | V | C | R | T;
/// The states in which values of every type may be set in model exchange and in co-simulation. Each interface has one
/// further state, in which only floating-point values may be set.
const SET_ME: u16 = I | G | M | V | R;
const SET_CS: u16 = I | G | M | V | C | R;
/// The states in which values may be read in model exchange and in co-simulation.
const GET_ME: u16 = I | M | V | N | T;
const GET_CS: u16 = I | M | V | C | U | T;
/// The states in which the number of states or event indicators may be read. Section 2.3 names `Instantiated` and
/// Event Mode only; reading in the other states is harmless.
const COUNT: u16 = I | M | V | N | T;

// A row: functions: states in model exchange, states in co-simulation.
functions! {
    "fmi3",
    /// A function of FMI 3.0 that takes an instance.
    {
        SetDebugLogging FreeInstance: ME, CS;
        EnterInitializationMode: I, I;
        ExitInitializationMode: M, M;
        EnterEventMode: N, C;
        Terminate: V | N | R, V | C | R;
        Reset: ME, CS;
        GetFloat32 GetFloat64: GET_ME, GET_CS;
        GetInt8 GetUInt8 GetInt16 GetUInt16 GetInt32 GetUInt32 GetInt64 GetUInt64: GET_ME, GET_CS;
        GetBoolean GetString GetBinary: GET_ME, GET_CS;
        GetClock: V, V;
        SetFloat32 SetFloat64: SET_ME | N, SET_CS | U;
        SetInt8 SetUInt8 SetInt16 SetUInt16 SetInt32 SetUInt32 SetInt64 SetUInt64: SET_ME, SET_CS;
        SetBoolean SetString SetBinary: SET_ME, SET_CS;
        SetClock: V, V;
        GetNumberOfVariableDependencies GetVariableDependencies: ME, CS;
        GetFMUState SetFMUState FreeFMUState: ME, CS;
        SerializedFMUStateSize SerializeFMUState DeserializeFMUState: ME, CS;
        GetDirectionalDerivative GetAdjointDerivative: M | V | N | T, M | V | C | T;
        EnterConfigurationMode: I | V, I | C;
        ExitConfigurationMode: G | R, G | R;
        GetIntervalDecimal GetIntervalFraction: M | V, M | V;
        GetShiftDecimal GetShiftFraction: M, M;
        SetIntervalDecimal SetIntervalFraction: M | V, M | V;
        SetShiftDecimal SetShiftFraction: M, M;
        EvaluateDiscreteStates UpdateDiscreteStates: V, V;
        EnterContinuousTimeMode: V, 0;
        CompletedIntegratorStep SetTime SetContinuousStates: N, 0;
        GetContinuousStateDerivatives GetEventIndicators GetContinuousStates: M | V | N | T, 0;
        GetNominalsOfContinuousStates: M | V | N | R | T, 0;
        GetNumberOfEventIndicators GetNumberOfContinuousStates: COUNT, 0;
        EnterStepMode: 0, V;
        GetOutputDerivatives: 0, C | U | T;
        DoStep: 0, C;
        ActivateModelPartition: 0, 0;
    }
    /// Whether `function` may return `fmi3Discard`, which leaves the instance unchanged (section 2.2.4, "handling
    /// of min/max violation" and "numerical problems during model evaluation").
    {
        SetFloat32 SetFloat64 SetInt8 SetUInt8 SetInt16 SetUInt16 SetInt32 SetUInt32 SetInt64 SetUInt64
            SetBoolean SetString SetBinary;
        SetContinuousStates GetFloat32 GetFloat64 GetContinuousStateDerivatives GetContinuousStates
            GetEventIndicators;
        DoStep;
    }
}

/// Returns the set of states in which a variable may be set ([`State::bit`]; sections 2.3.2 to 2.3.5, 3.2.1,
/// 4.2.1). `reinit` is the attribute `reinit` of a continuous state, `None` for other variables.
#[must_use]
pub fn settable(
    causality: Causality,
    variability: Variability,
    initial: Option<Initial>,
    reinit: Option<bool>,
) -> u16 {
    if causality == Causality::StructuralParameter {
        return if variability == Variability::Tunable { G | R } else { G };
    }
    let in_callback = (causality, variability) == (Causality::Input, Variability::Continuous);
    call_order::settable(causality, variability, initial, reinit.is_some())
        | if in_callback { U } else { 0 }
        | if reinit == Some(false) { V } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LISTS: &str = include_str!("call_order3/allowed_function_calls.csv");
    const TYPES: &str =
        "Float32 Float64 Int8 UInt8 Int16 UInt16 Int32 UInt32 Int64 UInt64 Boolean String Binary";

    /// The functions that an entry of the lists names.
    fn named(entry: &str) -> Vec<String> {
        let entry = format!("fmi3{}", entry.trim_start_matches('~'));
        let parts = |mark: &str, parts: &str| {
            let parts = parts.split(' ');
            parts.map(|part| entry.replace(mark, part)).collect()
        };
        match &entry {
            entry if entry.contains("{T}") => parts("{T}", TYPES),
            entry if entry.contains("{R}") => parts("{R}", "Float32 Float64"),
            entry if entry.contains("{D}") => parts("{D}", "Decimal Fraction"),
            _ => vec![entry],
        }
    }

    /// The states that a name of the standard means, for an interface.
    fn states(name: &str, interface: InterfaceType) -> Vec<State> {
        use State as S;
        let of_interface = match interface {
            InterfaceType::ModelExchange => S::ContinuousTimeMode,
            InterfaceType::CoSimulation => S::StepComplete,
        };
        let initialized = [S::EventMode, of_interface, S::ReconfigurationMode];
        match name {
            "FMUStateSettable" => {
                let others =
                    [S::Instantiated, S::ConfigurationMode, S::InitializationMode, S::Terminated];
                initialized.into_iter().chain(others).collect()
            }
            "Initialized" => initialized.to_vec(),
            "StepMode" => vec![S::StepComplete],
            name => State::EVERY.into_iter().filter(|state| format!("{state:?}") == name).collect(),
        }
    }

    #[test]
    fn a_function_may_be_called_exactly_in_the_states_that_the_standard_lists() {
        for interface in [InterfaceType::ModelExchange, InterfaceType::CoSimulation] {
            let mut listed = Vec::new();
            for line in LISTS.lines().filter(|line| !line.starts_with('#')) {
                let [_, state, of, functions] =
                    line.split(',').collect::<Vec<_>>().try_into().unwrap();
                if of != "both" && of != format!("{interface:?}") {
                    continue;
                }
                let states = states(state, interface);
                assert!(!states.is_empty(), "{line}");
                for name in functions.split(' ').flat_map(named) {
                    assert!(
                        Function::EVERY.iter().any(|function| function.name() == name),
                        "{name}"
                    );
                    listed.extend(states.iter().map(|state| (name.clone(), *state)));
                }
            }
            for &function in Function::EVERY {
                for state in State::EVERY {
                    let expected = listed.contains(&(function.name().to_owned(), state));
                    let actual = allowed(interface, function, state);
                    assert_eq!(actual, expected, "{function:?} in {state:?}, {interface:?}");
                }
            }
        }
    }

    #[test]
    fn variables_are_set_in_the_states_that_the_standard_names() {
        use Causality::{Input, Local, Output, Parameter, StructuralParameter};
        use Variability::{Constant, Continuous, Discrete, Fixed, Tunable};
        let exact = Some(Initial::Exact);
        for ((causality, variability), initial, state, expected) in [
            ((Input, Continuous), None, None, I | M | V | N | C | U),
            ((Input, Discrete), None, None, I | M | V | C),
            ((Parameter, Fixed), exact, None, I | M),
            ((Parameter, Tunable), exact, None, I | M | V | C),
            ((Output, Constant), exact, None, 0),
            ((Local, Continuous), Some(Initial::Approx), None, I),
            ((Local, Continuous), exact, Some(false), I | M | N | V),
            ((Local, Continuous), exact, Some(true), I | M | N),
            ((Output, Continuous), Some(Initial::Calculated), None, 0),
            ((StructuralParameter, Fixed), exact, None, G),
            ((StructuralParameter, Tunable), exact, None, G | R),
        ] {
            let states = settable(causality, variability, initial, state);
            assert_eq!(states, expected, "{causality:?} {variability:?}");
        }
    }
}
