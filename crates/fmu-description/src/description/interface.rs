//! The interfaces of an FMU with their capability flags.

use serde::Serialize;

use crate::hash_form::{is_default, numbered};

/// `ModelExchange`: identifier and capability flags (FMI 2.0.5, section 3.3.1;
/// FMI 3.0.2, section 3.4).
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[expect(clippy::struct_excessive_bools, reason = "the flags of the standard, one for one")]
pub struct ModelExchange {
    /// `modelIdentifier`: file name of the library, without extension.
    pub model_identifier: String,
    /// `needsExecutionTool`.
    pub needs_execution_tool: bool,
    /// `completedIntegratorStepNotNeeded`.
    pub completed_integrator_step_not_needed: bool,
    /// `canBeInstantiatedOnlyOncePerProcess`.
    pub can_be_instantiated_only_once_per_process: bool,
    /// `canNotUseMemoryManagementFunctions`.
    pub can_not_use_memory_management_functions: bool,
    /// `canGetAndSetFMUstate`.
    pub can_get_and_set_fmu_state: bool,
    /// `canSerializeFMUstate`.
    pub can_serialize_fmu_state: bool,
    /// `providesDirectionalDerivative`.
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
#[expect(clippy::struct_excessive_bools, reason = "the flags of the standard, one for one")]
pub struct CoSimulation {
    /// `modelIdentifier`: file name of the library, without extension.
    pub model_identifier: String,
    /// `needsExecutionTool`.
    pub needs_execution_tool: bool,
    /// `canHandleVariableCommunicationStepSize`.
    pub can_handle_variable_communication_step_size: bool,
    /// `canInterpolateInputs`: `fmi2SetRealInputDerivatives` has an effect.
    pub can_interpolate_inputs: bool,
    /// `maxOutputDerivativeOrder`.
    pub max_output_derivative_order: u32,
    /// `canRunAsynchronuously` (spelt as in the standard).
    pub can_run_asynchronuously: bool,
    /// `canBeInstantiatedOnlyOncePerProcess`.
    pub can_be_instantiated_only_once_per_process: bool,
    /// `canNotUseMemoryManagementFunctions`.
    pub can_not_use_memory_management_functions: bool,
    /// `canGetAndSetFMUstate`.
    pub can_get_and_set_fmu_state: bool,
    /// `canSerializeFMUstate`.
    pub can_serialize_fmu_state: bool,
    /// `providesDirectionalDerivative`.
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
    /// `recommendedIntermediateInputSmoothness` (FMI 3.0): the order of the derivatives of inputs that
    /// should be continuous.
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
#[expect(clippy::struct_excessive_bools, reason = "the flags of the standard, one for one")]
pub struct ScheduledExecution {
    /// `modelIdentifier`: file name of the library, without extension.
    pub model_identifier: String,
    /// `needsExecutionTool`.
    pub needs_execution_tool: bool,
    /// `canBeInstantiatedOnlyOncePerProcess`.
    pub can_be_instantiated_only_once_per_process: bool,
    /// `canGetAndSetFMUState`.
    pub can_get_and_set_fmu_state: bool,
    /// `canSerializeFMUState`.
    pub can_serialize_fmu_state: bool,
    /// `providesDirectionalDerivatives`.
    pub provides_directional_derivative: bool,
    /// `providesAdjointDerivatives`.
    pub provides_adjoint_derivatives: bool,
    /// `providesPerElementDependencies`.
    pub provides_per_element_dependencies: bool,
}
