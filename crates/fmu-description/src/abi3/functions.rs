//! The types of pointers to the functions of `fmi3FunctionTypes.h`, each named as in the header.

use std::ffi::c_char;

use super::{
    fmi3Binary, fmi3Boolean, fmi3Byte, fmi3Clock, fmi3ClockUpdateCallback, fmi3DependencyKind,
    fmi3FMUState, fmi3Float32, fmi3Float64, fmi3Instance, fmi3InstanceEnvironment, fmi3Int8,
    fmi3Int16, fmi3Int32, fmi3Int64, fmi3IntermediateUpdateCallback, fmi3IntervalQualifier,
    fmi3LockPreemptionCallback, fmi3LogMessageCallback, fmi3Status, fmi3String, fmi3UInt8,
    fmi3UInt16, fmi3UInt32, fmi3UInt64, fmi3UnlockPreemptionCallback, fmi3ValueReference,
};

/// Reads values: instance, value references, their number, values, their number.
pub type GetValues<T> = unsafe extern "C" fn(
    fmi3Instance,
    *const fmi3ValueReference,
    usize,
    *mut T,
    usize,
) -> fmi3Status;
/// Sets values: instance, value references, their number, values, their number.
pub type SetValues<T> = unsafe extern "C" fn(
    fmi3Instance,
    *const fmi3ValueReference,
    usize,
    *const T,
    usize,
) -> fmi3Status;
/// A function with the instance as its only argument.
pub type OfInstance = unsafe extern "C" fn(fmi3Instance) -> fmi3Status;
/// `fmi3GetVersion`.
pub type fmi3GetVersionTYPE = unsafe extern "C" fn() -> *const c_char;
/// `fmi3SetDebugLogging`: `instance`, `loggingOn`, `nCategories`, `categories`.
pub type fmi3SetDebugLoggingTYPE =
    unsafe extern "C" fn(fmi3Instance, fmi3Boolean, usize, *const fmi3String) -> fmi3Status;
/// `fmi3InstantiateModelExchange`: `instanceName`, `instantiationToken`, `resourcePath`, `visible`,
/// `loggingOn`, `instanceEnvironment`, `logMessage`.
pub type fmi3InstantiateModelExchangeTYPE = unsafe extern "C" fn(
    fmi3String,
    fmi3String,
    fmi3String,
    fmi3Boolean,
    fmi3Boolean,
    fmi3InstanceEnvironment,
    Option<fmi3LogMessageCallback>,
) -> fmi3Instance;
/// `fmi3InstantiateCoSimulation`: `instanceName`, `instantiationToken`, `resourcePath`, `visible`,
/// `loggingOn`, `eventModeUsed`, `earlyReturnAllowed`, `requiredIntermediateVariables`,
/// `nRequiredIntermediateVariables`, `instanceEnvironment`, `logMessage`, `intermediateUpdate`.
pub type fmi3InstantiateCoSimulationTYPE = unsafe extern "C" fn(
    fmi3String,
    fmi3String,
    fmi3String,
    fmi3Boolean,
    fmi3Boolean,
    fmi3Boolean,
    fmi3Boolean,
    *const fmi3ValueReference,
    usize,
    fmi3InstanceEnvironment,
    Option<fmi3LogMessageCallback>,
    Option<fmi3IntermediateUpdateCallback>,
) -> fmi3Instance;
/// `fmi3InstantiateScheduledExecution`: `instanceName`, `instantiationToken`, `resourcePath`,
/// `visible`, `loggingOn`, `instanceEnvironment`, `logMessage`, `clockUpdate`, `lockPreemption`,
/// `unlockPreemption`.
pub type fmi3InstantiateScheduledExecutionTYPE = unsafe extern "C" fn(
    fmi3String,
    fmi3String,
    fmi3String,
    fmi3Boolean,
    fmi3Boolean,
    fmi3InstanceEnvironment,
    Option<fmi3LogMessageCallback>,
    Option<fmi3ClockUpdateCallback>,
    Option<fmi3LockPreemptionCallback>,
    Option<fmi3UnlockPreemptionCallback>,
) -> fmi3Instance;
/// `fmi3FreeInstance`: `instance`.
pub type fmi3FreeInstanceTYPE = unsafe extern "C" fn(fmi3Instance);
/// `fmi3EnterInitializationMode`: `instance`, `toleranceDefined`, `tolerance`, `startTime`,
/// `stopTimeDefined`, `stopTime`.
pub type fmi3EnterInitializationModeTYPE = unsafe extern "C" fn(
    fmi3Instance,
    fmi3Boolean,
    fmi3Float64,
    fmi3Float64,
    fmi3Boolean,
    fmi3Float64,
) -> fmi3Status;
/// `fmi3ExitInitializationMode`.
pub type fmi3ExitInitializationModeTYPE = OfInstance;
/// `fmi3EnterEventMode`.
pub type fmi3EnterEventModeTYPE = OfInstance;
/// `fmi3Terminate`.
pub type fmi3TerminateTYPE = OfInstance;
/// `fmi3Reset`.
pub type fmi3ResetTYPE = OfInstance;
/// `fmi3GetFloat32`.
pub type fmi3GetFloat32TYPE = GetValues<fmi3Float32>;
/// `fmi3GetFloat64`.
pub type fmi3GetFloat64TYPE = GetValues<fmi3Float64>;
/// `fmi3GetInt8`.
pub type fmi3GetInt8TYPE = GetValues<fmi3Int8>;
/// `fmi3GetUInt8`.
pub type fmi3GetUInt8TYPE = GetValues<fmi3UInt8>;
/// `fmi3GetInt16`.
pub type fmi3GetInt16TYPE = GetValues<fmi3Int16>;
/// `fmi3GetUInt16`.
pub type fmi3GetUInt16TYPE = GetValues<fmi3UInt16>;
/// `fmi3GetInt32`.
pub type fmi3GetInt32TYPE = GetValues<fmi3Int32>;
/// `fmi3GetUInt32`.
pub type fmi3GetUInt32TYPE = GetValues<fmi3UInt32>;
/// `fmi3GetInt64`.
pub type fmi3GetInt64TYPE = GetValues<fmi3Int64>;
/// `fmi3GetUInt64`.
pub type fmi3GetUInt64TYPE = GetValues<fmi3UInt64>;
/// `fmi3GetBoolean`.
pub type fmi3GetBooleanTYPE = GetValues<fmi3Boolean>;
/// `fmi3GetString`.
pub type fmi3GetStringTYPE = GetValues<fmi3String>;
/// `fmi3GetBinary`: `instance`, `valueReferences`, `nValueReferences`, `valueSizes`, `values`,
/// `nValues`.
pub type fmi3GetBinaryTYPE = unsafe extern "C" fn(
    fmi3Instance,
    *const fmi3ValueReference,
    usize,
    *mut usize,
    *mut fmi3Binary,
    usize,
) -> fmi3Status;
/// `fmi3GetClock`: `instance`, `valueReferences`, `nValueReferences`, `values`.
pub type fmi3GetClockTYPE = unsafe extern "C" fn(
    fmi3Instance,
    *const fmi3ValueReference,
    usize,
    *mut fmi3Clock,
) -> fmi3Status;
/// `fmi3SetFloat32`.
pub type fmi3SetFloat32TYPE = SetValues<fmi3Float32>;
/// `fmi3SetFloat64`.
pub type fmi3SetFloat64TYPE = SetValues<fmi3Float64>;
/// `fmi3SetInt8`.
pub type fmi3SetInt8TYPE = SetValues<fmi3Int8>;
/// `fmi3SetUInt8`.
pub type fmi3SetUInt8TYPE = SetValues<fmi3UInt8>;
/// `fmi3SetInt16`.
pub type fmi3SetInt16TYPE = SetValues<fmi3Int16>;
/// `fmi3SetUInt16`.
pub type fmi3SetUInt16TYPE = SetValues<fmi3UInt16>;
/// `fmi3SetInt32`.
pub type fmi3SetInt32TYPE = SetValues<fmi3Int32>;
/// `fmi3SetUInt32`.
pub type fmi3SetUInt32TYPE = SetValues<fmi3UInt32>;
/// `fmi3SetInt64`.
pub type fmi3SetInt64TYPE = SetValues<fmi3Int64>;
/// `fmi3SetUInt64`.
pub type fmi3SetUInt64TYPE = SetValues<fmi3UInt64>;
/// `fmi3SetBoolean`.
pub type fmi3SetBooleanTYPE = SetValues<fmi3Boolean>;
/// `fmi3SetString`.
pub type fmi3SetStringTYPE = SetValues<fmi3String>;
/// `fmi3SetBinary`: `instance`, `valueReferences`, `nValueReferences`, `valueSizes`, `values`,
/// `nValues`.
pub type fmi3SetBinaryTYPE = unsafe extern "C" fn(
    fmi3Instance,
    *const fmi3ValueReference,
    usize,
    *const usize,
    *const fmi3Binary,
    usize,
) -> fmi3Status;
/// `fmi3SetClock`: `instance`, `valueReferences`, `nValueReferences`, `values`.
pub type fmi3SetClockTYPE = unsafe extern "C" fn(
    fmi3Instance,
    *const fmi3ValueReference,
    usize,
    *const fmi3Clock,
) -> fmi3Status;
/// `fmi3GetNumberOfVariableDependencies`: `instance`, `valueReference`, `nDependencies`.
pub type fmi3GetNumberOfVariableDependenciesTYPE =
    unsafe extern "C" fn(fmi3Instance, fmi3ValueReference, *mut usize) -> fmi3Status;
/// `fmi3GetVariableDependencies`: `instance`, `dependent`, `elementIndicesOfDependent`,
/// `independents`, `elementIndicesOfIndependents`, `dependencyKinds`, `nDependencies`.
pub type fmi3GetVariableDependenciesTYPE = unsafe extern "C" fn(
    fmi3Instance,
    fmi3ValueReference,
    *mut usize,
    *mut fmi3ValueReference,
    *mut usize,
    *mut fmi3DependencyKind,
    usize,
) -> fmi3Status;
/// `fmi3GetFMUState`: `instance`, `FMUState`.
pub type fmi3GetFMUStateTYPE = unsafe extern "C" fn(fmi3Instance, *mut fmi3FMUState) -> fmi3Status;
/// `fmi3SetFMUState`: `instance`, `FMUState`.
pub type fmi3SetFMUStateTYPE = unsafe extern "C" fn(fmi3Instance, fmi3FMUState) -> fmi3Status;
/// `fmi3FreeFMUState`: `instance`, `FMUState`.
pub type fmi3FreeFMUStateTYPE = unsafe extern "C" fn(fmi3Instance, *mut fmi3FMUState) -> fmi3Status;
/// `fmi3SerializedFMUStateSize`: `instance`, `FMUState`, `size`.
pub type fmi3SerializedFMUStateSizeTYPE =
    unsafe extern "C" fn(fmi3Instance, fmi3FMUState, *mut usize) -> fmi3Status;
/// `fmi3SerializeFMUState`: `instance`, `FMUState`, `serializedState`, `size`.
pub type fmi3SerializeFMUStateTYPE =
    unsafe extern "C" fn(fmi3Instance, fmi3FMUState, *mut fmi3Byte, usize) -> fmi3Status;
/// `fmi3DeserializeFMUState`: `instance`, `serializedState`, `size`, `FMUState`.
pub type fmi3DeserializeFMUStateTYPE =
    unsafe extern "C" fn(fmi3Instance, *const fmi3Byte, usize, *mut fmi3FMUState) -> fmi3Status;
/// `fmi3GetDirectionalDerivative`: `instance`, `unknowns`, `nUnknowns`, `knowns`, `nKnowns`,
/// `seed`, `nSeed`, `sensitivity`, `nSensitivity`.
pub type fmi3GetDirectionalDerivativeTYPE = unsafe extern "C" fn(
    fmi3Instance,
    *const fmi3ValueReference,
    usize,
    *const fmi3ValueReference,
    usize,
    *const fmi3Float64,
    usize,
    *mut fmi3Float64,
    usize,
) -> fmi3Status;
/// `fmi3GetAdjointDerivative`: `instance`, `unknowns`, `nUnknowns`, `knowns`, `nKnowns`, `seed`,
/// `nSeed`, `sensitivity`, `nSensitivity`.
pub type fmi3GetAdjointDerivativeTYPE = unsafe extern "C" fn(
    fmi3Instance,
    *const fmi3ValueReference,
    usize,
    *const fmi3ValueReference,
    usize,
    *const fmi3Float64,
    usize,
    *mut fmi3Float64,
    usize,
) -> fmi3Status;
/// `fmi3EnterConfigurationMode`.
pub type fmi3EnterConfigurationModeTYPE = OfInstance;
/// `fmi3ExitConfigurationMode`.
pub type fmi3ExitConfigurationModeTYPE = OfInstance;
/// `fmi3GetIntervalDecimal`: `instance`, `valueReferences`, `nValueReferences`, `intervals`,
/// `qualifiers`.
pub type fmi3GetIntervalDecimalTYPE = unsafe extern "C" fn(
    fmi3Instance,
    *const fmi3ValueReference,
    usize,
    *mut fmi3Float64,
    *mut fmi3IntervalQualifier,
) -> fmi3Status;
/// `fmi3GetIntervalFraction`: `instance`, `valueReferences`, `nValueReferences`, `counters`,
/// `resolutions`, `qualifiers`.
pub type fmi3GetIntervalFractionTYPE = unsafe extern "C" fn(
    fmi3Instance,
    *const fmi3ValueReference,
    usize,
    *mut fmi3UInt64,
    *mut fmi3UInt64,
    *mut fmi3IntervalQualifier,
) -> fmi3Status;
/// `fmi3GetShiftDecimal`: `instance`, `valueReferences`, `nValueReferences`, `shifts`.
pub type fmi3GetShiftDecimalTYPE = unsafe extern "C" fn(
    fmi3Instance,
    *const fmi3ValueReference,
    usize,
    *mut fmi3Float64,
) -> fmi3Status;
/// `fmi3GetShiftFraction`: `instance`, `valueReferences`, `nValueReferences`, `counters`,
/// `resolutions`.
pub type fmi3GetShiftFractionTYPE = unsafe extern "C" fn(
    fmi3Instance,
    *const fmi3ValueReference,
    usize,
    *mut fmi3UInt64,
    *mut fmi3UInt64,
) -> fmi3Status;
/// `fmi3SetIntervalDecimal`: `instance`, `valueReferences`, `nValueReferences`, `intervals`.
pub type fmi3SetIntervalDecimalTYPE = unsafe extern "C" fn(
    fmi3Instance,
    *const fmi3ValueReference,
    usize,
    *const fmi3Float64,
) -> fmi3Status;
/// `fmi3SetIntervalFraction`: `instance`, `valueReferences`, `nValueReferences`, `counters`,
/// `resolutions`.
pub type fmi3SetIntervalFractionTYPE = unsafe extern "C" fn(
    fmi3Instance,
    *const fmi3ValueReference,
    usize,
    *const fmi3UInt64,
    *const fmi3UInt64,
) -> fmi3Status;
/// `fmi3SetShiftDecimal`: `instance`, `valueReferences`, `nValueReferences`, `shifts`.
pub type fmi3SetShiftDecimalTYPE = unsafe extern "C" fn(
    fmi3Instance,
    *const fmi3ValueReference,
    usize,
    *const fmi3Float64,
) -> fmi3Status;
/// `fmi3SetShiftFraction`: `instance`, `valueReferences`, `nValueReferences`, `counters`,
/// `resolutions`.
pub type fmi3SetShiftFractionTYPE = unsafe extern "C" fn(
    fmi3Instance,
    *const fmi3ValueReference,
    usize,
    *const fmi3UInt64,
    *const fmi3UInt64,
) -> fmi3Status;
/// `fmi3EvaluateDiscreteStates`.
pub type fmi3EvaluateDiscreteStatesTYPE = OfInstance;
/// `fmi3UpdateDiscreteStates`: `instance`, `discreteStatesNeedUpdate`, `terminateSimulation`,
/// `nominalsOfContinuousStatesChanged`, `valuesOfContinuousStatesChanged`, `nextEventTimeDefined`,
/// `nextEventTime`.
pub type fmi3UpdateDiscreteStatesTYPE = unsafe extern "C" fn(
    fmi3Instance,
    *mut fmi3Boolean,
    *mut fmi3Boolean,
    *mut fmi3Boolean,
    *mut fmi3Boolean,
    *mut fmi3Boolean,
    *mut fmi3Float64,
) -> fmi3Status;
/// `fmi3EnterContinuousTimeMode`.
pub type fmi3EnterContinuousTimeModeTYPE = OfInstance;
/// `fmi3CompletedIntegratorStep`: `instance`, `noSetFMUStatePriorToCurrentPoint`, `enterEventMode`,
/// `terminateSimulation`.
pub type fmi3CompletedIntegratorStepTYPE = unsafe extern "C" fn(
    fmi3Instance,
    fmi3Boolean,
    *mut fmi3Boolean,
    *mut fmi3Boolean,
) -> fmi3Status;
/// `fmi3SetTime`: `instance`, `time`.
pub type fmi3SetTimeTYPE = unsafe extern "C" fn(fmi3Instance, fmi3Float64) -> fmi3Status;
/// `fmi3SetContinuousStates`: `instance`, `continuousStates`, `nContinuousStates`.
pub type fmi3SetContinuousStatesTYPE =
    unsafe extern "C" fn(fmi3Instance, *const fmi3Float64, usize) -> fmi3Status;
/// `fmi3GetContinuousStateDerivatives`: `instance`, `derivatives`, `nContinuousStates`.
pub type fmi3GetContinuousStateDerivativesTYPE =
    unsafe extern "C" fn(fmi3Instance, *mut fmi3Float64, usize) -> fmi3Status;
/// `fmi3GetEventIndicators`: `instance`, `eventIndicators`, `nEventIndicators`.
pub type fmi3GetEventIndicatorsTYPE =
    unsafe extern "C" fn(fmi3Instance, *mut fmi3Float64, usize) -> fmi3Status;
/// `fmi3GetContinuousStates`: `instance`, `continuousStates`, `nContinuousStates`.
pub type fmi3GetContinuousStatesTYPE =
    unsafe extern "C" fn(fmi3Instance, *mut fmi3Float64, usize) -> fmi3Status;
/// `fmi3GetNominalsOfContinuousStates`: `instance`, `nominals`, `nContinuousStates`.
pub type fmi3GetNominalsOfContinuousStatesTYPE =
    unsafe extern "C" fn(fmi3Instance, *mut fmi3Float64, usize) -> fmi3Status;
/// `fmi3GetNumberOfEventIndicators`: `instance`, `nEventIndicators`.
pub type fmi3GetNumberOfEventIndicatorsTYPE =
    unsafe extern "C" fn(fmi3Instance, *mut usize) -> fmi3Status;
/// `fmi3GetNumberOfContinuousStates`: `instance`, `nContinuousStates`.
pub type fmi3GetNumberOfContinuousStatesTYPE =
    unsafe extern "C" fn(fmi3Instance, *mut usize) -> fmi3Status;
/// `fmi3EnterStepMode`.
pub type fmi3EnterStepModeTYPE = OfInstance;
/// `fmi3GetOutputDerivatives`: `instance`, `valueReferences`, `nValueReferences`, `orders`,
/// `values`, `nValues`.
pub type fmi3GetOutputDerivativesTYPE = unsafe extern "C" fn(
    fmi3Instance,
    *const fmi3ValueReference,
    usize,
    *const fmi3Int32,
    *mut fmi3Float64,
    usize,
) -> fmi3Status;
/// `fmi3DoStep`: `instance`, `currentCommunicationPoint`, `communicationStepSize`,
/// `noSetFMUStatePriorToCurrentPoint`, `eventHandlingNeeded`, `terminateSimulation`, `earlyReturn`,
/// `lastSuccessfulTime`.
pub type fmi3DoStepTYPE = unsafe extern "C" fn(
    fmi3Instance,
    fmi3Float64,
    fmi3Float64,
    fmi3Boolean,
    *mut fmi3Boolean,
    *mut fmi3Boolean,
    *mut fmi3Boolean,
    *mut fmi3Float64,
) -> fmi3Status;
/// `fmi3ActivateModelPartition`: `instance`, `clockReference`, `activationTime`.
pub type fmi3ActivateModelPartitionTYPE =
    unsafe extern "C" fn(fmi3Instance, fmi3ValueReference, fmi3Float64) -> fmi3Status;
