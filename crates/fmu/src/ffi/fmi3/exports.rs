//! The C signatures of FMI 3.0 that [`export!`](crate::export) defines.

/// Defines the functions of `fmi3Functions.h` for a model, and `fmuDescribe3`.
#[doc(hidden)]
#[macro_export]
macro_rules! entry_points_of_fmi3 {
    ($model:ty) => {
        $crate::entry_points! { $model;
            fmi3GetVersion = fmi3::version() -> fmi3String;
            fmi3SetDebugLogging = fmi3::set_debug_logging(fmi3Instance, fmi3Boolean, size_t,
                *const fmi3String);
            fmi3InstantiateModelExchange = fmi3::instantiate_model_exchange(fmi3String, fmi3String,
                fmi3String, fmi3Boolean, fmi3Boolean, fmi3InstanceEnvironment,
                fmi3LogMessage) -> fmi3Instance;
            fmi3InstantiateCoSimulation = fmi3::instantiate_co_simulation(fmi3String, fmi3String,
                fmi3String, fmi3Boolean, fmi3Boolean, fmi3Boolean, fmi3Boolean, References, size_t,
                fmi3InstanceEnvironment, fmi3LogMessage, fmi3IntermediateUpdate) -> fmi3Instance;
            fmi3InstantiateScheduledExecution = fmi3::instantiate_scheduled_execution(fmi3String,
                fmi3String, fmi3String, fmi3Boolean, fmi3Boolean, fmi3InstanceEnvironment,
                fmi3LogMessage, fmi3ClockUpdate, fmi3LockPreemption,
                fmi3UnlockPreemption) -> fmi3Instance;
            fmi3FreeInstance = fmi3::free_instance(fmi3Instance) -> void;
            fmi3EnterInitializationMode = fmi3::enter_initialization_mode(fmi3Instance, fmi3Boolean,
                fmi3Float64, fmi3Float64, fmi3Boolean, fmi3Float64);
            fmi3ExitInitializationMode = fmi3::exit_initialization_mode(fmi3Instance);
            fmi3EnterEventMode = fmi3::enter_event_mode(fmi3Instance);
            fmi3Terminate = fmi3::terminate(fmi3Instance);
            fmi3Reset = fmi3::reset(fmi3Instance);
            fmi3GetFloat32 = fmi3::get_float32(fmi3Instance, References, size_t, *mut fmi3Float32, size_t);
            fmi3GetFloat64 = fmi3::get_float64(fmi3Instance, References, size_t, *mut fmi3Float64, size_t);
            fmi3GetInt8 = fmi3::get_int8(fmi3Instance, References, size_t, *mut fmi3Int8, size_t);
            fmi3GetUInt8 = fmi3::get_uint8(fmi3Instance, References, size_t, *mut fmi3UInt8, size_t);
            fmi3GetInt16 = fmi3::get_int16(fmi3Instance, References, size_t, *mut fmi3Int16, size_t);
            fmi3GetUInt16 = fmi3::get_uint16(fmi3Instance, References, size_t, *mut fmi3UInt16, size_t);
            fmi3GetInt32 = fmi3::get_int32(fmi3Instance, References, size_t, *mut fmi3Int32, size_t);
            fmi3GetUInt32 = fmi3::get_uint32(fmi3Instance, References, size_t, *mut fmi3UInt32, size_t);
            fmi3GetInt64 = fmi3::get_int64(fmi3Instance, References, size_t, *mut fmi3Int64, size_t);
            fmi3GetUInt64 = fmi3::get_uint64(fmi3Instance, References, size_t, *mut fmi3UInt64, size_t);
            fmi3GetBoolean = fmi3::get_boolean(fmi3Instance, References, size_t, *mut fmi3Boolean, size_t);
            fmi3GetString = fmi3::get_string(fmi3Instance, References, size_t, *mut fmi3String, size_t);
            fmi3GetBinary = fmi3::get_binary(fmi3Instance, References, size_t, *mut size_t,
                *mut fmi3Binary, size_t);
            fmi3GetClock = fmi3::get_clock(fmi3Instance, References, size_t, *mut fmi3Clock);
            fmi3SetFloat32 = fmi3::set_float32(fmi3Instance, References, size_t, *const fmi3Float32, size_t);
            fmi3SetFloat64 = fmi3::set_float64(fmi3Instance, References, size_t, *const fmi3Float64, size_t);
            fmi3SetInt8 = fmi3::set_int8(fmi3Instance, References, size_t, *const fmi3Int8, size_t);
            fmi3SetUInt8 = fmi3::set_uint8(fmi3Instance, References, size_t, *const fmi3UInt8, size_t);
            fmi3SetInt16 = fmi3::set_int16(fmi3Instance, References, size_t, *const fmi3Int16, size_t);
            fmi3SetUInt16 = fmi3::set_uint16(fmi3Instance, References, size_t, *const fmi3UInt16, size_t);
            fmi3SetInt32 = fmi3::set_int32(fmi3Instance, References, size_t, *const fmi3Int32, size_t);
            fmi3SetUInt32 = fmi3::set_uint32(fmi3Instance, References, size_t, *const fmi3UInt32, size_t);
            fmi3SetInt64 = fmi3::set_int64(fmi3Instance, References, size_t, *const fmi3Int64, size_t);
            fmi3SetUInt64 = fmi3::set_uint64(fmi3Instance, References, size_t, *const fmi3UInt64, size_t);
            fmi3SetBoolean = fmi3::set_boolean(fmi3Instance, References, size_t, *const fmi3Boolean, size_t);
            fmi3SetString = fmi3::set_string(fmi3Instance, References, size_t, *const fmi3String, size_t);
            fmi3SetBinary = fmi3::set_binary(fmi3Instance, References, size_t, *const size_t,
                *const fmi3Binary, size_t);
            fmi3SetClock = fmi3::set_clock(fmi3Instance, References, size_t, *const fmi3Clock);
            fmi3GetNumberOfVariableDependencies = fmi3::get_number_of_variable_dependencies(
                fmi3Instance, fmi3ValueReference, *mut size_t);
            fmi3GetVariableDependencies = fmi3::get_variable_dependencies(fmi3Instance,
                fmi3ValueReference, *mut size_t, *mut fmi3ValueReference, *mut size_t,
                *mut fmi3DependencyKind, size_t);
            fmi3GetFMUState = fmi3::get_fmu_state(fmi3Instance, *mut fmi3FMUState);
            fmi3SetFMUState = fmi3::set_fmu_state(fmi3Instance, fmi3FMUState);
            fmi3FreeFMUState = fmi3::free_fmu_state(fmi3Instance, *mut fmi3FMUState);
            fmi3SerializedFMUStateSize = fmi3::serialized_fmu_state_size(fmi3Instance, fmi3FMUState,
                *mut size_t);
            fmi3SerializeFMUState = fmi3::serialize_fmu_state(fmi3Instance, fmi3FMUState, *mut fmi3Byte,
                size_t);
            fmi3DeserializeFMUState = fmi3::deserialize_fmu_state(fmi3Instance, *const fmi3Byte, size_t,
                *mut fmi3FMUState);
            fmi3GetDirectionalDerivative = fmi3::get_directional_derivative(fmi3Instance, References,
                size_t, References, size_t, *const fmi3Float64, size_t, *mut fmi3Float64, size_t);
            fmi3GetAdjointDerivative = fmi3::get_adjoint_derivative(fmi3Instance, References, size_t,
                References, size_t, *const fmi3Float64, size_t, *mut fmi3Float64, size_t);
            fmi3EnterConfigurationMode = fmi3::enter_configuration_mode(fmi3Instance);
            fmi3ExitConfigurationMode = fmi3::exit_configuration_mode(fmi3Instance);
            fmi3GetIntervalDecimal = fmi3::get_interval_decimal(fmi3Instance, References, size_t,
                *mut fmi3Float64, *mut fmi3IntervalQualifier);
            fmi3GetIntervalFraction = fmi3::get_interval_fraction(fmi3Instance, References, size_t,
                *mut fmi3UInt64, *mut fmi3UInt64, *mut fmi3IntervalQualifier);
            fmi3GetShiftDecimal = fmi3::get_shift_decimal(fmi3Instance, References, size_t, *mut fmi3Float64);
            fmi3GetShiftFraction = fmi3::get_shift_fraction(fmi3Instance, References, size_t,
                *mut fmi3UInt64, *mut fmi3UInt64);
            fmi3SetIntervalDecimal = fmi3::set_interval_decimal(fmi3Instance, References, size_t,
                *const fmi3Float64);
            fmi3SetIntervalFraction = fmi3::set_interval_fraction(fmi3Instance, References, size_t,
                *const fmi3UInt64, *const fmi3UInt64);
            fmi3SetShiftDecimal = fmi3::set_shift_decimal(fmi3Instance, References, size_t,
                *const fmi3Float64);
            fmi3SetShiftFraction = fmi3::set_shift_fraction(fmi3Instance, References, size_t,
                *const fmi3UInt64, *const fmi3UInt64);
            fmi3EvaluateDiscreteStates = fmi3::evaluate_discrete_states(fmi3Instance);
            fmi3UpdateDiscreteStates = fmi3::update_discrete_states(fmi3Instance, *mut fmi3Boolean,
                *mut fmi3Boolean, *mut fmi3Boolean, *mut fmi3Boolean, *mut fmi3Boolean,
                *mut fmi3Float64);
            fmi3EnterContinuousTimeMode = fmi3::enter_continuous_time_mode(fmi3Instance);
            fmi3CompletedIntegratorStep = fmi3::completed_integrator_step(fmi3Instance, fmi3Boolean,
                *mut fmi3Boolean, *mut fmi3Boolean);
            fmi3SetTime = fmi3::set_time(fmi3Instance, fmi3Float64);
            fmi3SetContinuousStates = fmi3::set_continuous_states(fmi3Instance, *const fmi3Float64, size_t);
            fmi3GetContinuousStateDerivatives = fmi3::get_continuous_state_derivatives(fmi3Instance,
                *mut fmi3Float64, size_t);
            fmi3GetEventIndicators = fmi3::get_event_indicators(fmi3Instance, *mut fmi3Float64, size_t);
            fmi3GetContinuousStates = fmi3::get_continuous_states(fmi3Instance, *mut fmi3Float64, size_t);
            fmi3GetNominalsOfContinuousStates = fmi3::get_nominals_of_continuous_states(fmi3Instance,
                *mut fmi3Float64, size_t);
            fmi3GetNumberOfEventIndicators = fmi3::get_number_of_event_indicators(fmi3Instance, *mut size_t);
            fmi3GetNumberOfContinuousStates = fmi3::get_number_of_continuous_states(fmi3Instance,
                *mut size_t);
            fmi3EnterStepMode = fmi3::enter_step_mode(fmi3Instance);
            fmi3GetOutputDerivatives = fmi3::get_output_derivatives(fmi3Instance, References, size_t,
                *const fmi3Int32, *mut fmi3Float64, size_t);
            fmi3DoStep = fmi3::do_step(fmi3Instance, fmi3Float64, fmi3Float64, fmi3Boolean,
                *mut fmi3Boolean, *mut fmi3Boolean, *mut fmi3Boolean, *mut fmi3Float64);
            fmi3ActivateModelPartition = fmi3::activate_model_partition(fmi3Instance,
                fmi3ValueReference, fmi3Float64);
            fmuDescribe3 = fmi3::describe(fmi3String, fmi3InstanceEnvironment, DescribeSink) -> fmi3Int32;
        }
    };
}
