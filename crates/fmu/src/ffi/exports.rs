//! The macro [`export!`](crate::export) and the C signatures that it defines.

/// Exports a [`Model`](crate::Model) with all C functions of FMI 2.0 and FMI 3.0. Write it as the last line of the
/// model's library, which must be a `cdylib`.
///
/// The library also has the functions of model exchange if the model has no such interface;
/// `fmi2Instantiate` for model exchange then fails.
///
/// ```
/// use std::path::Path;
///
/// use fmu::{About, Experiment, Failure, Model, Step, Variable};
/// use serde::{Deserialize, Serialize};
///
/// /// A tank that drains through a hole: `level' = inflow - level / time_constant`.
/// #[derive(Clone, Serialize, Deserialize)]
/// struct Tank {
///     inflow: f64,
///     level: f64,
///     time_constant: f64,
/// }
///
/// impl Model for Tank {
///     const IDENTIFIER: &'static str = "Tank";
///
///     fn about(&self) -> About {
///         About { description: "A tank that drains".to_owned(), ..About::default() }
///     }
///
///     fn new(_resources: &Path) -> Result<Self, Failure> {
///         Ok(Self { inflow: 0.0, level: 0.0, time_constant: 10.0 })
///     }
///
///     fn variables(&self) -> Vec<Variable<Self>> {
///         vec![
///             Variable::real("inflow", "Inflow", |tank: &mut Self| &mut tank.inflow)
///                 .input()
///                 .unit("m/s"),
///             Variable::real("level", "Level", |tank: &mut Self| &mut tank.level)
///                 .output(&[])
///                 .unit("m"),
///             Variable::real("T", "Time constant", |tank: &mut Self| &mut tank.time_constant)
///                 .parameter()
///                 .unit("s"),
///         ]
///     }
///
///     fn initialize(&mut self, _experiment: &Experiment) -> Result<(), Failure> {
///         self.level = 1.0;
///         Ok(())
///     }
///
///     fn step(&mut self, step: &Step) -> Result<(), Failure> {
///         let rest = self.inflow * self.time_constant;
///         self.level = rest + (self.level - rest) * (-step.size / self.time_constant).exp();
///         Ok(())
///     }
/// }
///
/// fmu::export!(Tank);
/// # fn main() {}
/// ```
///
/// The library also exports [`fmuDescribe`](fmu_description::abi::DESCRIBE) and
/// [`fmuDescribe3`](fmu_description::abi::DESCRIBE_3), from which `aso-ftc pack` gets the model
/// descriptions.
#[macro_export]
macro_rules! export {
    ($model:ty) => {
        #[cfg(not(panic = "unwind"))]
        ::core::compile_error!(
            "an FMU needs panic = \"unwind\": an aborting panic takes the importer down"
        );

        // A block and absolute paths, so that no name conflicts with names of the model's module.
        const _: () = {
            $crate::entry_points! { $model;
                fmi2GetTypesPlatform = types_platform() -> fmi2String;
                fmi2GetVersion = version() -> fmi2String;
                fmuDescribe = describe(fmi2_resources: fmi2String,
                    fmi2_context: fmi2ComponentEnvironment, fmi2_sink: DescribeSink) -> fmi2Integer;
                fmi2Instantiate = instantiate(fmi2_name: fmi2String, fmi2_fmu_type: fmi2Type,
                    fmi2_guid: fmi2String, fmi2_resource_location: fmi2String,
                    fmi2_functions: *const fmi2CallbackFunctions, fmi2_visible: fmi2Boolean,
                    fmi2_logging_on: fmi2Boolean) -> fmi2Component;
                fmi2FreeInstance = free_instance(fmi2_c: fmi2Component) -> void;
                fmi2SetDebugLogging = set_debug_logging(fmi2_c: fmi2Component, fmi2_on: fmi2Boolean,
                    fmi2_n: size_t, fmi2_categories: *const fmi2String) -> fmi2Status;
                fmi2SetupExperiment = setup_experiment(fmi2_c: fmi2Component,
                    fmi2_tolerance_defined: fmi2Boolean, fmi2_tolerance: fmi2Real,
                    fmi2_start_time: fmi2Real, fmi2_stop_time_defined: fmi2Boolean,
                    fmi2_stop_time: fmi2Real) -> fmi2Status;
                fmi2EnterInitializationMode = enter_initialization_mode(
                    fmi2_c: fmi2Component) -> fmi2Status;
                fmi2ExitInitializationMode = exit_initialization_mode(
                    fmi2_c: fmi2Component) -> fmi2Status;
                fmi2Terminate = terminate(fmi2_c: fmi2Component) -> fmi2Status;
                fmi2Reset = reset(fmi2_c: fmi2Component) -> fmi2Status;
                fmi2GetReal = get_real(fmi2_c: fmi2Component, fmi2_vr: *const fmi2ValueReference,
                    fmi2_n: size_t, fmi2_value: *mut fmi2Real) -> fmi2Status;
                fmi2GetInteger = get_integer(fmi2_c: fmi2Component, fmi2_vr: *const fmi2ValueReference,
                    fmi2_n: size_t, fmi2_value: *mut fmi2Integer) -> fmi2Status;
                fmi2GetBoolean = get_boolean(fmi2_c: fmi2Component, fmi2_vr: *const fmi2ValueReference,
                    fmi2_n: size_t, fmi2_value: *mut fmi2Boolean) -> fmi2Status;
                fmi2GetString = get_string(fmi2_c: fmi2Component, fmi2_vr: *const fmi2ValueReference,
                    fmi2_n: size_t, fmi2_value: *mut fmi2String) -> fmi2Status;
                fmi2SetReal = set_real(fmi2_c: fmi2Component, fmi2_vr: *const fmi2ValueReference,
                    fmi2_n: size_t, fmi2_value: *const fmi2Real) -> fmi2Status;
                fmi2SetInteger = set_integer(fmi2_c: fmi2Component, fmi2_vr: *const fmi2ValueReference,
                    fmi2_n: size_t, fmi2_value: *const fmi2Integer) -> fmi2Status;
                fmi2SetBoolean = set_boolean(fmi2_c: fmi2Component, fmi2_vr: *const fmi2ValueReference,
                    fmi2_n: size_t, fmi2_value: *const fmi2Boolean) -> fmi2Status;
                fmi2SetString = set_string(fmi2_c: fmi2Component, fmi2_vr: *const fmi2ValueReference,
                    fmi2_n: size_t, fmi2_value: *const fmi2String) -> fmi2Status;
                fmi2GetFMUstate = get_fmu_state(fmi2_c: fmi2Component,
                    fmi2_state: *mut fmi2FMUstate) -> fmi2Status;
                fmi2SetFMUstate = set_fmu_state(fmi2_c: fmi2Component,
                    fmi2_state: fmi2FMUstate) -> fmi2Status;
                fmi2FreeFMUstate = free_fmu_state(fmi2_c: fmi2Component,
                    fmi2_state: *mut fmi2FMUstate) -> fmi2Status;
                fmi2SerializedFMUstateSize = serialized_fmu_state_size(fmi2_c: fmi2Component,
                    fmi2_state: fmi2FMUstate, fmi2_size: *mut size_t) -> fmi2Status;
                fmi2SerializeFMUstate = serialize_fmu_state(fmi2_c: fmi2Component,
                    fmi2_state: fmi2FMUstate, fmi2_bytes: *mut fmi2Byte,
                    fmi2_size: size_t) -> fmi2Status;
                fmi2DeSerializeFMUstate = de_serialize_fmu_state(fmi2_c: fmi2Component,
                    fmi2_bytes: *const fmi2Byte, fmi2_size: size_t,
                    fmi2_state: *mut fmi2FMUstate) -> fmi2Status;
                fmi2GetDirectionalDerivative = get_directional_derivative(fmi2_c: fmi2Component,
                    fmi2_unknown: *const fmi2ValueReference, fmi2_n_unknown: size_t,
                    fmi2_known: *const fmi2ValueReference, fmi2_n_known: size_t,
                    fmi2_known_delta: *const fmi2Real, fmi2_unknown_delta: *mut fmi2Real) -> fmi2Status;
                fmi2EnterEventMode = enter_event_mode(fmi2_c: fmi2Component) -> fmi2Status;
                fmi2NewDiscreteStates = new_discrete_states(fmi2_c: fmi2Component,
                    fmi2_info: *mut fmi2EventInfo) -> fmi2Status;
                fmi2EnterContinuousTimeMode = enter_continuous_time_mode(
                    fmi2_c: fmi2Component) -> fmi2Status;
                fmi2CompletedIntegratorStep = completed_integrator_step(fmi2_c: fmi2Component,
                    fmi2_no_set_fmu_state: fmi2Boolean, fmi2_enter_event_mode: *mut fmi2Boolean,
                    fmi2_terminate_simulation: *mut fmi2Boolean) -> fmi2Status;
                fmi2SetTime = set_time(fmi2_c: fmi2Component, fmi2_time: fmi2Real) -> fmi2Status;
                fmi2SetContinuousStates = set_continuous_states(fmi2_c: fmi2Component,
                    fmi2_x: *const fmi2Real, fmi2_n: size_t) -> fmi2Status;
                fmi2GetEventIndicators = get_event_indicators(fmi2_c: fmi2Component,
                    fmi2_z: *mut fmi2Real, fmi2_n: size_t) -> fmi2Status;
                fmi2GetContinuousStates = get_continuous_states(fmi2_c: fmi2Component,
                    fmi2_x: *mut fmi2Real, fmi2_n: size_t) -> fmi2Status;
                fmi2GetDerivatives = get_derivatives(fmi2_c: fmi2Component,
                    fmi2_derivatives: *mut fmi2Real, fmi2_n: size_t) -> fmi2Status;
                fmi2GetNominalsOfContinuousStates = get_nominals(fmi2_c: fmi2Component,
                    fmi2_nominals: *mut fmi2Real, fmi2_n: size_t) -> fmi2Status;
                fmi2SetRealInputDerivatives = set_real_input_derivatives(fmi2_c: fmi2Component,
                    fmi2_vr: *const fmi2ValueReference, fmi2_n: size_t, fmi2_order: *const fmi2Integer,
                    fmi2_value: *const fmi2Real) -> fmi2Status;
                fmi2GetRealOutputDerivatives = get_real_output_derivatives(fmi2_c: fmi2Component,
                    fmi2_vr: *const fmi2ValueReference, fmi2_n: size_t, fmi2_order: *const fmi2Integer,
                    fmi2_value: *mut fmi2Real) -> fmi2Status;
                fmi2DoStep = do_step(fmi2_c: fmi2Component, fmi2_start: fmi2Real, fmi2_size: fmi2Real,
                    fmi2_no_set_fmu_state: fmi2Boolean) -> fmi2Status;
                fmi2CancelStep = cancel_step(fmi2_c: fmi2Component) -> fmi2Status;
                fmi2GetStatus = get_status(fmi2_c: fmi2Component, fmi2_kind: fmi2StatusKind,
                    fmi2_value: *mut fmi2Status) -> fmi2Status;
                fmi2GetRealStatus = get_real_status(fmi2_c: fmi2Component, fmi2_kind: fmi2StatusKind,
                    fmi2_value: *mut fmi2Real) -> fmi2Status;
                fmi2GetIntegerStatus = get_integer_status(fmi2_c: fmi2Component,
                    fmi2_kind: fmi2StatusKind, fmi2_value: *mut fmi2Integer) -> fmi2Status;
                fmi2GetBooleanStatus = get_boolean_status(fmi2_c: fmi2Component,
                    fmi2_kind: fmi2StatusKind, fmi2_value: *mut fmi2Boolean) -> fmi2Status;
                fmi2GetStringStatus = get_string_status(fmi2_c: fmi2Component,
                    fmi2_kind: fmi2StatusKind, fmi2_value: *mut fmi2String) -> fmi2Status;
            }
            $crate::entry_points_of_fmi3! { $model }
        };
    };
}

/// Defines one exported C function per line, which calls the generic function for the model.
///
/// The names of the arguments have a prefix, because a constant `n` of the model would turn an
/// argument `n` into a pattern.
#[doc(hidden)]
#[macro_export]
macro_rules! entry_points {
    ($model:ty; $($name:ident =
        $($function:ident)::+ ($($argument:ident: $(*$access:tt)? $type:ident),*)
            -> $result:ident;)*) => {
        $(
            #[unsafe(no_mangle)]
            unsafe extern "C" fn $name(
                $($argument: $(*$access)? $crate::ffi::signature::$type),*
            ) -> $crate::ffi::signature::$result {
                // SAFETY: the arguments are passed on unchanged from the importer.
                unsafe { $crate::ffi::$($function)::+::<$model>($($argument),*) }
            }
        )*
    };
}

/// The types in the signatures of the C functions.
pub mod signature {
    #![expect(non_camel_case_types, reason = "the names of C")]

    pub use fmu_description::abi::*;
    pub use fmu_description::abi3::{
        fmi3Binary, fmi3Boolean, fmi3Byte, fmi3Clock, fmi3DependencyKind, fmi3FMUState,
        fmi3Float32, fmi3Float64, fmi3Instance, fmi3InstanceEnvironment, fmi3Int8, fmi3Int16,
        fmi3Int32, fmi3Int64, fmi3IntervalQualifier, fmi3Status, fmi3String, fmi3UInt8, fmi3UInt16,
        fmi3UInt32, fmi3UInt64, fmi3ValueReference,
    };
    use fmu_description::abi3::{
        fmi3ClockUpdateCallback, fmi3IntermediateUpdateCallback, fmi3LockPreemptionCallback,
        fmi3LogMessageCallback, fmi3UnlockPreemptionCallback,
    };

    /// `fmi3LogMessageCallback`, which may be null; likewise the other callbacks.
    pub type fmi3LogMessage = Option<fmi3LogMessageCallback>;
    /// `fmi3IntermediateUpdateCallback`.
    pub type fmi3IntermediateUpdate = Option<fmi3IntermediateUpdateCallback>;
    /// `fmi3ClockUpdateCallback`.
    pub type fmi3ClockUpdate = Option<fmi3ClockUpdateCallback>;
    /// `fmi3LockPreemptionCallback`.
    pub type fmi3LockPreemption = Option<fmi3LockPreemptionCallback>;
    /// `fmi3UnlockPreemptionCallback`.
    pub type fmi3UnlockPreemption = Option<fmi3UnlockPreemptionCallback>;

    /// `size_t`.
    pub type size_t = usize;
    /// `void`.
    pub type void = ();
}
