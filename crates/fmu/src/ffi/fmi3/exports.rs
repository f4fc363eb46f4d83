//! The C signatures of FMI 3.0 that [`export!`](crate::export) defines.

/// Defines the functions of `fmi3Functions.h` for a model, and `fmuDescribe3`.
#[doc(hidden)]
#[macro_export]
macro_rules! entry_points_of_fmi3 {
    ($model:ty) => {
        $crate::entry_points! { $model;
            fmi3GetVersion = fmi3::version() -> fmi3String;
            fmi3SetDebugLogging = fmi3::set_debug_logging(fmi3_instance: fmi3Instance,
                fmi3_logging_on: fmi3Boolean, fmi3_n_categories: size_t, fmi3_categories: *const
                fmi3String) -> fmi3Status;
            fmi3InstantiateModelExchange = fmi3::instantiate_model_exchange(fmi3_instance_name:
                fmi3String, fmi3_instantiation_token: fmi3String, fmi3_resource_path:
                fmi3String, fmi3_visible: fmi3Boolean, fmi3_logging_on: fmi3Boolean,
                fmi3_instance_environment: fmi3InstanceEnvironment, fmi3_log_message:
                fmi3LogMessage) -> fmi3Instance;
            fmi3InstantiateCoSimulation = fmi3::instantiate_co_simulation(fmi3_instance_name:
                fmi3String, fmi3_instantiation_token: fmi3String, fmi3_resource_path:
                fmi3String, fmi3_visible: fmi3Boolean, fmi3_logging_on: fmi3Boolean,
                fmi3_event_mode_used: fmi3Boolean, fmi3_early_return_allowed: fmi3Boolean,
                fmi3_required_intermediate_variables: *const fmi3ValueReference,
                fmi3_n_required_intermediate_variables: size_t, fmi3_instance_environment:
                fmi3InstanceEnvironment, fmi3_log_message: fmi3LogMessage,
                fmi3_intermediate_update: fmi3IntermediateUpdate) -> fmi3Instance;
            fmi3InstantiateScheduledExecution =
                fmi3::instantiate_scheduled_execution(fmi3_instance_name: fmi3String,
                fmi3_instantiation_token: fmi3String, fmi3_resource_path: fmi3String,
                fmi3_visible: fmi3Boolean, fmi3_logging_on: fmi3Boolean,
                fmi3_instance_environment: fmi3InstanceEnvironment, fmi3_log_message:
                fmi3LogMessage, fmi3_clock_update: fmi3ClockUpdate, fmi3_lock_preemption:
                fmi3LockPreemption, fmi3_unlock_preemption: fmi3UnlockPreemption) ->
                fmi3Instance;
            fmi3FreeInstance = fmi3::free_instance(fmi3_instance: fmi3Instance) -> void;
            fmi3EnterInitializationMode = fmi3::enter_initialization_mode(fmi3_instance:
                fmi3Instance, fmi3_tolerance_defined: fmi3Boolean, fmi3_tolerance: fmi3Float64,
                fmi3_start_time: fmi3Float64, fmi3_stop_time_defined: fmi3Boolean,
                fmi3_stop_time: fmi3Float64) -> fmi3Status;
            fmi3ExitInitializationMode = fmi3::exit_initialization_mode(fmi3_instance:
                fmi3Instance) -> fmi3Status;
            fmi3EnterEventMode = fmi3::enter_event_mode(fmi3_instance: fmi3Instance) -> fmi3Status;
            fmi3Terminate = fmi3::terminate(fmi3_instance: fmi3Instance) -> fmi3Status;
            fmi3Reset = fmi3::reset(fmi3_instance: fmi3Instance) -> fmi3Status;
            fmi3GetFloat32 = fmi3::get_float32(fmi3_instance: fmi3Instance,
                fmi3_value_references: *const fmi3ValueReference, fmi3_n_value_references:
                size_t, fmi3_values: *mut fmi3Float32, fmi3_n_values: size_t) -> fmi3Status;
            fmi3GetFloat64 = fmi3::get_float64(fmi3_instance: fmi3Instance,
                fmi3_value_references: *const fmi3ValueReference, fmi3_n_value_references:
                size_t, fmi3_values: *mut fmi3Float64, fmi3_n_values: size_t) -> fmi3Status;
            fmi3GetInt8 = fmi3::get_int8(fmi3_instance: fmi3Instance, fmi3_value_references:
                *const fmi3ValueReference, fmi3_n_value_references: size_t, fmi3_values: *mut
                fmi3Int8, fmi3_n_values: size_t) -> fmi3Status;
            fmi3GetUInt8 = fmi3::get_uint8(fmi3_instance: fmi3Instance, fmi3_value_references:
                *const fmi3ValueReference, fmi3_n_value_references: size_t, fmi3_values: *mut
                fmi3UInt8, fmi3_n_values: size_t) -> fmi3Status;
            fmi3GetInt16 = fmi3::get_int16(fmi3_instance: fmi3Instance, fmi3_value_references:
                *const fmi3ValueReference, fmi3_n_value_references: size_t, fmi3_values: *mut
                fmi3Int16, fmi3_n_values: size_t) -> fmi3Status;
            fmi3GetUInt16 = fmi3::get_uint16(fmi3_instance: fmi3Instance, fmi3_value_references:
                *const fmi3ValueReference, fmi3_n_value_references: size_t, fmi3_values: *mut
                fmi3UInt16, fmi3_n_values: size_t) -> fmi3Status;
            fmi3GetInt32 = fmi3::get_int32(fmi3_instance: fmi3Instance, fmi3_value_references:
                *const fmi3ValueReference, fmi3_n_value_references: size_t, fmi3_values: *mut
                fmi3Int32, fmi3_n_values: size_t) -> fmi3Status;
            fmi3GetUInt32 = fmi3::get_uint32(fmi3_instance: fmi3Instance, fmi3_value_references:
                *const fmi3ValueReference, fmi3_n_value_references: size_t, fmi3_values: *mut
                fmi3UInt32, fmi3_n_values: size_t) -> fmi3Status;
            fmi3GetInt64 = fmi3::get_int64(fmi3_instance: fmi3Instance, fmi3_value_references:
                *const fmi3ValueReference, fmi3_n_value_references: size_t, fmi3_values: *mut
                fmi3Int64, fmi3_n_values: size_t) -> fmi3Status;
            fmi3GetUInt64 = fmi3::get_uint64(fmi3_instance: fmi3Instance, fmi3_value_references:
                *const fmi3ValueReference, fmi3_n_value_references: size_t, fmi3_values: *mut
                fmi3UInt64, fmi3_n_values: size_t) -> fmi3Status;
            fmi3GetBoolean = fmi3::get_boolean(fmi3_instance: fmi3Instance,
                fmi3_value_references: *const fmi3ValueReference, fmi3_n_value_references:
                size_t, fmi3_values: *mut fmi3Boolean, fmi3_n_values: size_t) -> fmi3Status;
            fmi3GetString = fmi3::get_string(fmi3_instance: fmi3Instance, fmi3_value_references:
                *const fmi3ValueReference, fmi3_n_value_references: size_t, fmi3_values: *mut
                fmi3String, fmi3_n_values: size_t) -> fmi3Status;
            fmi3GetBinary = fmi3::get_binary(fmi3_instance: fmi3Instance, fmi3_value_references:
                *const fmi3ValueReference, fmi3_n_value_references: size_t, fmi3_value_sizes:
                *mut size_t, fmi3_values: *mut fmi3Binary, fmi3_n_values: size_t) -> fmi3Status;
            fmi3GetClock = fmi3::get_clock(fmi3_instance: fmi3Instance, fmi3_value_references:
                *const fmi3ValueReference, fmi3_n_value_references: size_t, fmi3_values: *mut
                fmi3Clock) -> fmi3Status;
            fmi3SetFloat32 = fmi3::set_float32(fmi3_instance: fmi3Instance,
                fmi3_value_references: *const fmi3ValueReference, fmi3_n_value_references:
                size_t, fmi3_values: *const fmi3Float32, fmi3_n_values: size_t) -> fmi3Status;
            fmi3SetFloat64 = fmi3::set_float64(fmi3_instance: fmi3Instance,
                fmi3_value_references: *const fmi3ValueReference, fmi3_n_value_references:
                size_t, fmi3_values: *const fmi3Float64, fmi3_n_values: size_t) -> fmi3Status;
            fmi3SetInt8 = fmi3::set_int8(fmi3_instance: fmi3Instance, fmi3_value_references:
                *const fmi3ValueReference, fmi3_n_value_references: size_t, fmi3_values: *const
                fmi3Int8, fmi3_n_values: size_t) -> fmi3Status;
            fmi3SetUInt8 = fmi3::set_uint8(fmi3_instance: fmi3Instance, fmi3_value_references:
                *const fmi3ValueReference, fmi3_n_value_references: size_t, fmi3_values: *const
                fmi3UInt8, fmi3_n_values: size_t) -> fmi3Status;
            fmi3SetInt16 = fmi3::set_int16(fmi3_instance: fmi3Instance, fmi3_value_references:
                *const fmi3ValueReference, fmi3_n_value_references: size_t, fmi3_values: *const
                fmi3Int16, fmi3_n_values: size_t) -> fmi3Status;
            fmi3SetUInt16 = fmi3::set_uint16(fmi3_instance: fmi3Instance, fmi3_value_references:
                *const fmi3ValueReference, fmi3_n_value_references: size_t, fmi3_values: *const
                fmi3UInt16, fmi3_n_values: size_t) -> fmi3Status;
            fmi3SetInt32 = fmi3::set_int32(fmi3_instance: fmi3Instance, fmi3_value_references:
                *const fmi3ValueReference, fmi3_n_value_references: size_t, fmi3_values: *const
                fmi3Int32, fmi3_n_values: size_t) -> fmi3Status;
            fmi3SetUInt32 = fmi3::set_uint32(fmi3_instance: fmi3Instance, fmi3_value_references:
                *const fmi3ValueReference, fmi3_n_value_references: size_t, fmi3_values: *const
                fmi3UInt32, fmi3_n_values: size_t) -> fmi3Status;
            fmi3SetInt64 = fmi3::set_int64(fmi3_instance: fmi3Instance, fmi3_value_references:
                *const fmi3ValueReference, fmi3_n_value_references: size_t, fmi3_values: *const
                fmi3Int64, fmi3_n_values: size_t) -> fmi3Status;
            fmi3SetUInt64 = fmi3::set_uint64(fmi3_instance: fmi3Instance, fmi3_value_references:
                *const fmi3ValueReference, fmi3_n_value_references: size_t, fmi3_values: *const
                fmi3UInt64, fmi3_n_values: size_t) -> fmi3Status;
            fmi3SetBoolean = fmi3::set_boolean(fmi3_instance: fmi3Instance,
                fmi3_value_references: *const fmi3ValueReference, fmi3_n_value_references:
                size_t, fmi3_values: *const fmi3Boolean, fmi3_n_values: size_t) -> fmi3Status;
            fmi3SetString = fmi3::set_string(fmi3_instance: fmi3Instance, fmi3_value_references:
                *const fmi3ValueReference, fmi3_n_value_references: size_t, fmi3_values: *const
                fmi3String, fmi3_n_values: size_t) -> fmi3Status;
            fmi3SetBinary = fmi3::set_binary(fmi3_instance: fmi3Instance, fmi3_value_references:
                *const fmi3ValueReference, fmi3_n_value_references: size_t, fmi3_value_sizes:
                *const size_t, fmi3_values: *const fmi3Binary, fmi3_n_values: size_t) ->
                fmi3Status;
            fmi3SetClock = fmi3::set_clock(fmi3_instance: fmi3Instance, fmi3_value_references:
                *const fmi3ValueReference, fmi3_n_value_references: size_t, fmi3_values: *const
                fmi3Clock) -> fmi3Status;
            fmi3GetNumberOfVariableDependencies =
                fmi3::get_number_of_variable_dependencies(fmi3_instance: fmi3Instance,
                fmi3_value_reference: fmi3ValueReference, fmi3_n_dependencies: *mut size_t) ->
                fmi3Status;
            fmi3GetVariableDependencies = fmi3::get_variable_dependencies(fmi3_instance:
                fmi3Instance, fmi3_dependent: fmi3ValueReference,
                fmi3_element_indices_of_dependent: *mut size_t, fmi3_independents: *mut
                fmi3ValueReference, fmi3_element_indices_of_independents: *mut size_t,
                fmi3_dependency_kinds: *mut fmi3DependencyKind, fmi3_n_dependencies: size_t) ->
                fmi3Status;
            fmi3GetFMUState = fmi3::get_fmu_state(fmi3_instance: fmi3Instance, fmi3_fmu_state:
                *mut fmi3FMUState) -> fmi3Status;
            fmi3SetFMUState = fmi3::set_fmu_state(fmi3_instance: fmi3Instance, fmi3_fmu_state:
                fmi3FMUState) -> fmi3Status;
            fmi3FreeFMUState = fmi3::free_fmu_state(fmi3_instance: fmi3Instance, fmi3_fmu_state:
                *mut fmi3FMUState) -> fmi3Status;
            fmi3SerializedFMUStateSize = fmi3::serialized_fmu_state_size(fmi3_instance:
                fmi3Instance, fmi3_fmu_state: fmi3FMUState, fmi3_size: *mut size_t) ->
                fmi3Status;
            fmi3SerializeFMUState = fmi3::serialize_fmu_state(fmi3_instance: fmi3Instance,
                fmi3_fmu_state: fmi3FMUState, fmi3_serialized_state: *mut fmi3Byte, fmi3_size:
                size_t) -> fmi3Status;
            fmi3DeserializeFMUState = fmi3::deserialize_fmu_state(fmi3_instance: fmi3Instance,
                fmi3_serialized_state: *const fmi3Byte, fmi3_size: size_t, fmi3_fmu_state: *mut
                fmi3FMUState) -> fmi3Status;
            fmi3GetDirectionalDerivative = fmi3::get_directional_derivative(fmi3_instance:
                fmi3Instance, fmi3_unknowns: *const fmi3ValueReference, fmi3_n_unknowns: size_t,
                fmi3_knowns: *const fmi3ValueReference, fmi3_n_knowns: size_t, fmi3_seed: *const
                fmi3Float64, fmi3_n_seed: size_t, fmi3_sensitivity: *mut fmi3Float64,
                fmi3_n_sensitivity: size_t) -> fmi3Status;
            fmi3GetAdjointDerivative = fmi3::get_adjoint_derivative(fmi3_instance: fmi3Instance,
                fmi3_unknowns: *const fmi3ValueReference, fmi3_n_unknowns: size_t, fmi3_knowns:
                *const fmi3ValueReference, fmi3_n_knowns: size_t, fmi3_seed: *const fmi3Float64,
                fmi3_n_seed: size_t, fmi3_sensitivity: *mut fmi3Float64, fmi3_n_sensitivity:
                size_t) -> fmi3Status;
            fmi3EnterConfigurationMode = fmi3::enter_configuration_mode(fmi3_instance:
                fmi3Instance) -> fmi3Status;
            fmi3ExitConfigurationMode = fmi3::exit_configuration_mode(fmi3_instance:
                fmi3Instance) -> fmi3Status;
            fmi3GetIntervalDecimal = fmi3::get_interval_decimal(fmi3_instance: fmi3Instance,
                fmi3_value_references: *const fmi3ValueReference, fmi3_n_value_references:
                size_t, fmi3_intervals: *mut fmi3Float64, fmi3_qualifiers: *mut
                fmi3IntervalQualifier) -> fmi3Status;
            fmi3GetIntervalFraction = fmi3::get_interval_fraction(fmi3_instance: fmi3Instance,
                fmi3_value_references: *const fmi3ValueReference, fmi3_n_value_references:
                size_t, fmi3_counters: *mut fmi3UInt64, fmi3_resolutions: *mut fmi3UInt64,
                fmi3_qualifiers: *mut fmi3IntervalQualifier) -> fmi3Status;
            fmi3GetShiftDecimal = fmi3::get_shift_decimal(fmi3_instance: fmi3Instance,
                fmi3_value_references: *const fmi3ValueReference, fmi3_n_value_references:
                size_t, fmi3_shifts: *mut fmi3Float64) -> fmi3Status;
            fmi3GetShiftFraction = fmi3::get_shift_fraction(fmi3_instance: fmi3Instance,
                fmi3_value_references: *const fmi3ValueReference, fmi3_n_value_references:
                size_t, fmi3_counters: *mut fmi3UInt64, fmi3_resolutions: *mut fmi3UInt64) ->
                fmi3Status;
            fmi3SetIntervalDecimal = fmi3::set_interval_decimal(fmi3_instance: fmi3Instance,
                fmi3_value_references: *const fmi3ValueReference, fmi3_n_value_references:
                size_t, fmi3_intervals: *const fmi3Float64) -> fmi3Status;
            fmi3SetIntervalFraction = fmi3::set_interval_fraction(fmi3_instance: fmi3Instance,
                fmi3_value_references: *const fmi3ValueReference, fmi3_n_value_references:
                size_t, fmi3_counters: *const fmi3UInt64, fmi3_resolutions: *const fmi3UInt64)
                -> fmi3Status;
            fmi3SetShiftDecimal = fmi3::set_shift_decimal(fmi3_instance: fmi3Instance,
                fmi3_value_references: *const fmi3ValueReference, fmi3_n_value_references:
                size_t, fmi3_shifts: *const fmi3Float64) -> fmi3Status;
            fmi3SetShiftFraction = fmi3::set_shift_fraction(fmi3_instance: fmi3Instance,
                fmi3_value_references: *const fmi3ValueReference, fmi3_n_value_references:
                size_t, fmi3_counters: *const fmi3UInt64, fmi3_resolutions: *const fmi3UInt64)
                -> fmi3Status;
            fmi3EvaluateDiscreteStates = fmi3::evaluate_discrete_states(fmi3_instance:
                fmi3Instance) -> fmi3Status;
            fmi3UpdateDiscreteStates = fmi3::update_discrete_states(fmi3_instance: fmi3Instance,
                fmi3_discrete_states_need_update: *mut fmi3Boolean, fmi3_terminate_simulation:
                *mut fmi3Boolean, fmi3_nominals_of_continuous_states_changed: *mut fmi3Boolean,
                fmi3_values_of_continuous_states_changed: *mut fmi3Boolean,
                fmi3_next_event_time_defined: *mut fmi3Boolean, fmi3_next_event_time: *mut
                fmi3Float64) -> fmi3Status;
            fmi3EnterContinuousTimeMode = fmi3::enter_continuous_time_mode(fmi3_instance:
                fmi3Instance) -> fmi3Status;
            fmi3CompletedIntegratorStep = fmi3::completed_integrator_step(fmi3_instance:
                fmi3Instance, fmi3_no_set_fmu_state_prior_to_current_point: fmi3Boolean,
                fmi3_enter_event_mode: *mut fmi3Boolean, fmi3_terminate_simulation: *mut
                fmi3Boolean) -> fmi3Status;
            fmi3SetTime = fmi3::set_time(fmi3_instance: fmi3Instance, fmi3_time: fmi3Float64) ->
                fmi3Status;
            fmi3SetContinuousStates = fmi3::set_continuous_states(fmi3_instance: fmi3Instance,
                fmi3_continuous_states: *const fmi3Float64, fmi3_n_continuous_states: size_t) ->
                fmi3Status;
            fmi3GetContinuousStateDerivatives =
                fmi3::get_continuous_state_derivatives(fmi3_instance: fmi3Instance,
                fmi3_derivatives: *mut fmi3Float64, fmi3_n_continuous_states: size_t) ->
                fmi3Status;
            fmi3GetEventIndicators = fmi3::get_event_indicators(fmi3_instance: fmi3Instance,
                fmi3_event_indicators: *mut fmi3Float64, fmi3_n_event_indicators: size_t) ->
                fmi3Status;
            fmi3GetContinuousStates = fmi3::get_continuous_states(fmi3_instance: fmi3Instance,
                fmi3_continuous_states: *mut fmi3Float64, fmi3_n_continuous_states: size_t) ->
                fmi3Status;
            fmi3GetNominalsOfContinuousStates =
                fmi3::get_nominals_of_continuous_states(fmi3_instance: fmi3Instance,
                fmi3_nominals: *mut fmi3Float64, fmi3_n_continuous_states: size_t) ->
                fmi3Status;
            fmi3GetNumberOfEventIndicators = fmi3::get_number_of_event_indicators(fmi3_instance:
                fmi3Instance, fmi3_n_event_indicators: *mut size_t) -> fmi3Status;
            fmi3GetNumberOfContinuousStates =
                fmi3::get_number_of_continuous_states(fmi3_instance: fmi3Instance,
                fmi3_n_continuous_states: *mut size_t) -> fmi3Status;
            fmi3EnterStepMode = fmi3::enter_step_mode(fmi3_instance: fmi3Instance) -> fmi3Status;
            fmi3GetOutputDerivatives = fmi3::get_output_derivatives(fmi3_instance: fmi3Instance,
                fmi3_value_references: *const fmi3ValueReference, fmi3_n_value_references:
                size_t, fmi3_orders: *const fmi3Int32, fmi3_values: *mut fmi3Float64,
                fmi3_n_values: size_t) -> fmi3Status;
            fmi3DoStep = fmi3::do_step(fmi3_instance: fmi3Instance,
                fmi3_current_communication_point: fmi3Float64, fmi3_communication_step_size:
                fmi3Float64, fmi3_no_set_fmu_state_prior_to_current_point: fmi3Boolean,
                fmi3_event_handling_needed: *mut fmi3Boolean, fmi3_terminate_simulation: *mut
                fmi3Boolean, fmi3_early_return: *mut fmi3Boolean, fmi3_last_successful_time:
                *mut fmi3Float64) -> fmi3Status;
            fmi3ActivateModelPartition = fmi3::activate_model_partition(fmi3_instance:
                fmi3Instance, fmi3_clock_reference: fmi3ValueReference, fmi3_activation_time:
                fmi3Float64) -> fmi3Status;
            fmuDescribe3 = fmi3::describe(fmi3_resources: fmi3String,
            fmi3_context: fmi3InstanceEnvironment, fmi3_sink: DescribeSink) -> fmi3Int32;
        }
    };
}
