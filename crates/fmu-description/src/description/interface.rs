//! The interfaces of an FMU with their capability flags.

use serde::Serialize;

use crate::hash_form::{is_default, numbered};

/// Calls the macro `$apply` with a table of attributes of the interfaces: for each attribute its name in XML and its
/// field, in the order of the file. `modelIdentifier` is in none of the tables.
macro_rules! attributes {
    (COMMON_2, $apply:ident!($($argument:ident),*)) => {
        $apply! { ($($argument),*)
            "canBeInstantiatedOnlyOncePerProcess" can_be_instantiated_only_once_per_process,
            "canNotUseMemoryManagementFunctions" can_not_use_memory_management_functions,
            "canGetAndSetFMUstate" can_get_and_set_fmu_state,
            "canSerializeFMUstate" can_serialize_fmu_state,
            "providesDirectionalDerivative" provides_directional_derivative,
        }
    };
    (MODEL_EXCHANGE_2, $apply:ident!($($argument:ident),*)) => {
        $apply! { ($($argument),*)
            "needsExecutionTool" needs_execution_tool,
            "completedIntegratorStepNotNeeded" completed_integrator_step_not_needed,
        }
    };
    (CO_SIMULATION_2, $apply:ident!($($argument:ident),*)) => {
        $apply! { ($($argument),*)
            "needsExecutionTool" needs_execution_tool,
            "canHandleVariableCommunicationStepSize" can_handle_variable_communication_step_size,
            "canInterpolateInputs" can_interpolate_inputs,
            "maxOutputDerivativeOrder" max_output_derivative_order,
            "canRunAsynchronuously" can_run_asynchronuously,
        }
    };
    (COMMON_3, $apply:ident!($($argument:ident),*)) => {
        $apply! { ($($argument),*)
            "needsExecutionTool" needs_execution_tool,
            "canBeInstantiatedOnlyOncePerProcess" can_be_instantiated_only_once_per_process,
            "canGetAndSetFMUState" can_get_and_set_fmu_state,
            "canSerializeFMUState" can_serialize_fmu_state,
            "providesDirectionalDerivatives" provides_directional_derivative,
            "providesAdjointDerivatives" provides_adjoint_derivatives,
            "providesPerElementDependencies" provides_per_element_dependencies,
        }
    };
    (MODEL_EXCHANGE_3, $apply:ident!($($argument:ident),*)) => {
        $apply! { ($($argument),*)
            "needsCompletedIntegratorStep" needs_completed_integrator_step,
            "providesEvaluateDiscreteStates" provides_evaluate_discrete_states,
        }
    };
    (CO_SIMULATION_3, $apply:ident!($($argument:ident),*)) => {
        $apply! { ($($argument),*)
            "canHandleVariableCommunicationStepSize" can_handle_variable_communication_step_size,
            "fixedInternalStepSize" fixed_internal_step_size,
            "maxOutputDerivativeOrder" max_output_derivative_order,
            "recommendedIntermediateInputSmoothness" recommended_intermediate_input_smoothness,
            "providesIntermediateUpdate" provides_intermediate_update,
            "mightReturnEarlyFromDoStep" might_return_early_from_do_step,
            "canReturnEarlyAfterIntermediateUpdate" can_return_early_after_intermediate_update,
            "hasEventMode" has_event_mode,
            "providesEvaluateDiscreteStates" provides_evaluate_discrete_states,
        }
    };
}
pub(crate) use attributes;

/// `ModelExchange`: identifier and capability flags (FMI 2.0.5, section 3.3.1;
/// FMI 3.0.2, section 3.4).
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[expect(clippy::struct_excessive_bools, missing_docs, reason = "as in the standard")]
pub struct ModelExchange {
    /// `modelIdentifier`: file name of the library, without extension.
    pub model_identifier: String,
    pub needs_execution_tool: bool,
    pub completed_integrator_step_not_needed: bool,
    pub can_be_instantiated_only_once_per_process: bool,
    pub can_not_use_memory_management_functions: bool,
    pub can_get_and_set_fmu_state: bool,
    pub can_serialize_fmu_state: bool,
    pub provides_directional_derivative: bool,
    /// `SourceFiles`: names of files in `sources`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub source_files: Vec<String>,
    /// `needsCompletedIntegratorStep` (FMI 3.0). The reader sets `completed_integrator_step_not_needed`
    /// to its inverse, so that importers need only that flag.
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<1, _, _>")]
    pub needs_completed_integrator_step: bool,
    /// `providesEvaluateDiscreteStates` (FMI 3.0).
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<2, _, _>")]
    pub provides_evaluate_discrete_states: bool,
    /// `providesAdjointDerivatives` (FMI 3.0).
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<3, _, _>")]
    pub provides_adjoint_derivatives: bool,
    /// `providesPerElementDependencies` (FMI 3.0).
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<4, _, _>")]
    pub provides_per_element_dependencies: bool,
    /// `numberOfContinuousStates` (FMI 1.0); the later versions list the derivatives in `ModelStructure`.
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<5, _, _>")]
    pub number_of_continuous_states: u32,
}

/// `CoSimulation`: identifier and capability flags (FMI 2.0.5, section 4.3.1;
/// FMI 3.0.2, section 4.4).
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[expect(clippy::struct_excessive_bools, missing_docs, reason = "as in the standard")]
pub struct CoSimulation {
    /// `modelIdentifier`: file name of the library, without extension.
    pub model_identifier: String,
    pub needs_execution_tool: bool,
    pub can_handle_variable_communication_step_size: bool,
    /// `canInterpolateInputs`: `fmi2SetRealInputDerivatives` has an effect.
    pub can_interpolate_inputs: bool,
    pub max_output_derivative_order: u32,
    /// `canRunAsynchronuously` (spelt as in the standard).
    pub can_run_asynchronuously: bool,
    pub can_be_instantiated_only_once_per_process: bool,
    pub can_not_use_memory_management_functions: bool,
    pub can_get_and_set_fmu_state: bool,
    pub can_serialize_fmu_state: bool,
    pub provides_directional_derivative: bool,
    /// `SourceFiles`: names of files in `sources`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub source_files: Vec<String>,
    /// `hasEventMode` (FMI 3.0).
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<1, _, _>")]
    pub has_event_mode: bool,
    /// `mightReturnEarlyFromDoStep` (FMI 3.0).
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<2, _, _>")]
    pub might_return_early_from_do_step: bool,
    /// `canReturnEarlyAfterIntermediateUpdate` (FMI 3.0).
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<3, _, _>")]
    pub can_return_early_after_intermediate_update: bool,
    /// `providesIntermediateUpdate` (FMI 3.0).
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<4, _, _>")]
    pub provides_intermediate_update: bool,
    /// `fixedInternalStepSize` in s (FMI 3.0).
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<5, _, _>")]
    pub fixed_internal_step_size: Option<f64>,
    /// `recommendedIntermediateInputSmoothness` (FMI 3.0): number of continuous derivatives that inputs should have.
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<6, _, _>")]
    pub recommended_intermediate_input_smoothness: i32,
    /// `providesEvaluateDiscreteStates` (FMI 3.0).
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<7, _, _>")]
    pub provides_evaluate_discrete_states: bool,
    /// `providesAdjointDerivatives` (FMI 3.0).
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<8, _, _>")]
    pub provides_adjoint_derivatives: bool,
    /// `providesPerElementDependencies` (FMI 3.0).
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<9, _, _>")]
    pub provides_per_element_dependencies: bool,
    /// `canRejectSteps` (FMI 1.0): a step may be repeated with `newStep` false.
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<10, _, _>")]
    pub can_reject_steps: bool,
    /// `canHandleEvents` (FMI 1.0): a step of length 0 is allowed.
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<11, _, _>")]
    pub can_handle_events: bool,
}

/// `ScheduledExecution`: identifier and capability flags (FMI 3.0.2, section 5.4).
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[expect(clippy::struct_excessive_bools, missing_docs, reason = "as in the standard")]
pub struct ScheduledExecution {
    /// `modelIdentifier`: file name of the library, without extension.
    pub model_identifier: String,
    pub needs_execution_tool: bool,
    pub can_be_instantiated_only_once_per_process: bool,
    pub can_get_and_set_fmu_state: bool,
    pub can_serialize_fmu_state: bool,
    /// `providesDirectionalDerivatives`.
    pub provides_directional_derivative: bool,
    pub provides_adjoint_derivatives: bool,
    pub provides_per_element_dependencies: bool,
}
