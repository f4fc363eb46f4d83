//! The macro [`export!`](crate::export) and the C signatures that it defines.

/// Exports a [`Model`](crate::Model) with all C functions of FMI 2.0 and FMI 3.0. Write it as the last line of the
/// model's library, which must be a `cdylib`.
///
/// The library also exports the functions of model exchange if the model does not offer it; `fmi2Instantiate` for model
/// exchange then fails.
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

        // Unit tests of the model call no C function, and compile in a third of the time without these.
        #[cfg(test)]
        const _: &::core::primitive::str = <$model as $crate::Model>::IDENTIFIER;

        // A block and absolute paths, so that no name conflicts with names of the model's module.
        #[cfg(not(test))]
        const _: () = {
            $crate::entry_points! { $model;
                fmi2GetTypesPlatform = types_platform() -> fmi2String;
                fmi2GetVersion = version() -> fmi2String;
                fmuDescribe = describe(fmi2String, fmi2ComponentEnvironment, DescribeSink) -> fmi2Integer;
                fmi2Instantiate = instantiate(fmi2String, fmi2Type, fmi2String, fmi2String,
                    *const fmi2CallbackFunctions, fmi2Boolean, fmi2Boolean) -> fmi2Component;
                fmi2FreeInstance = free_instance(fmi2Component) -> void;
                fmi2SetDebugLogging = set_debug_logging(fmi2Component, fmi2Boolean, size_t,
                    *const fmi2String);
                fmi2SetupExperiment = setup_experiment(fmi2Component, fmi2Boolean, fmi2Real, fmi2Real,
                    fmi2Boolean, fmi2Real);
                fmi2EnterInitializationMode = enter_initialization_mode(fmi2Component);
                fmi2ExitInitializationMode = exit_initialization_mode(fmi2Component);
                fmi2Terminate = terminate(fmi2Component);
                fmi2Reset = reset(fmi2Component);
                fmi2GetReal = get_real(fmi2Component, References, size_t, *mut fmi2Real);
                fmi2GetInteger = get_integer(fmi2Component, References, size_t, *mut fmi2Integer);
                fmi2GetBoolean = get_boolean(fmi2Component, References, size_t, *mut fmi2Boolean);
                fmi2GetString = get_string(fmi2Component, References, size_t, *mut fmi2String);
                fmi2SetReal = set_real(fmi2Component, References, size_t, *const fmi2Real);
                fmi2SetInteger = set_integer(fmi2Component, References, size_t, *const fmi2Integer);
                fmi2SetBoolean = set_boolean(fmi2Component, References, size_t, *const fmi2Boolean);
                fmi2SetString = set_string(fmi2Component, References, size_t, *const fmi2String);
                fmi2GetFMUstate = get_fmu_state(fmi2Component, *mut fmi2FMUstate);
                fmi2SetFMUstate = set_fmu_state(fmi2Component, fmi2FMUstate);
                fmi2FreeFMUstate = free_fmu_state(fmi2Component, *mut fmi2FMUstate);
                fmi2SerializedFMUstateSize = serialized_fmu_state_size(fmi2Component, fmi2FMUstate,
                    *mut size_t);
                fmi2SerializeFMUstate = serialize_fmu_state(fmi2Component, fmi2FMUstate, *mut fmi2Byte,
                    size_t);
                fmi2DeSerializeFMUstate = de_serialize_fmu_state(fmi2Component, *const fmi2Byte, size_t,
                    *mut fmi2FMUstate);
                fmi2GetDirectionalDerivative = get_directional_derivative(fmi2Component, References,
                    size_t, References, size_t, *const fmi2Real, *mut fmi2Real);
                fmi2EnterEventMode = enter_event_mode(fmi2Component);
                fmi2NewDiscreteStates = new_discrete_states(fmi2Component, *mut fmi2EventInfo);
                fmi2EnterContinuousTimeMode = enter_continuous_time_mode(fmi2Component);
                fmi2CompletedIntegratorStep = completed_integrator_step(fmi2Component, fmi2Boolean,
                    *mut fmi2Boolean, *mut fmi2Boolean);
                fmi2SetTime = set_time(fmi2Component, fmi2Real);
                fmi2SetContinuousStates = set_continuous_states(fmi2Component, *const fmi2Real, size_t);
                fmi2GetEventIndicators = get_event_indicators(fmi2Component, *mut fmi2Real, size_t);
                fmi2GetContinuousStates = get_continuous_states(fmi2Component, *mut fmi2Real, size_t);
                fmi2GetDerivatives = get_derivatives(fmi2Component, *mut fmi2Real, size_t);
                fmi2GetNominalsOfContinuousStates = get_nominals(fmi2Component, *mut fmi2Real, size_t);
                fmi2SetRealInputDerivatives = set_real_input_derivatives(fmi2Component, References,
                    size_t, *const fmi2Integer, *const fmi2Real);
                fmi2GetRealOutputDerivatives = get_real_output_derivatives(fmi2Component, References,
                    size_t, *const fmi2Integer, *mut fmi2Real);
                fmi2DoStep = do_step(fmi2Component, fmi2Real, fmi2Real, fmi2Boolean);
                fmi2CancelStep = cancel_step(fmi2Component);
                fmi2GetStatus = get_status(fmi2Component, fmi2StatusKind, *mut fmi2Status);
                fmi2GetRealStatus = get_real_status(fmi2Component, fmi2StatusKind, *mut fmi2Real);
                fmi2GetIntegerStatus = get_integer_status(fmi2Component, fmi2StatusKind, *mut fmi2Integer);
                fmi2GetBooleanStatus = get_boolean_status(fmi2Component, fmi2StatusKind, *mut fmi2Boolean);
                fmi2GetStringStatus = get_string_status(fmi2Component, fmi2StatusKind, *mut fmi2String);
            }
            $crate::entry_points_of_fmi3! { $model }
        };
    };
}

/// Defines exported C functions from the types of their arguments. These functions call the generic functions for the
/// model. A row has the exported name, the generic function, the types of its arguments, and the type of its result
/// unless the result is a status.
#[doc(hidden)]
#[macro_export]
macro_rules! entry_points {
    ($model:ty; $($name:ident = $($function:ident)::+ ($($types:tt)*) $(-> $result:ident)?;)*) => {
        $($crate::entry_point! { $model; $name = [$($function)::+] -> [$($result)? fmi2Status];
            [fmi_1 fmi_2 fmi_3 fmi_4 fmi_5 fmi_6 fmi_7 fmi_8 fmi_9 fmi_10 fmi_11 fmi_12] []; $($types)* })*
    };
}

/// Defines one exported C function: gives each argument a name, and then writes the function.
///
/// The names of the arguments have a prefix, because a constant `n` of the model would turn an
/// argument `n` into a pattern.
#[doc(hidden)]
#[macro_export]
macro_rules! entry_point {
    ($model:ty; $name:ident = [$($function:tt)*] -> [$result:ident $($status:ident)?];
        [$($unused:ident)*] [$(($argument:ident $($type:tt)*))*];) => {
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $name($($argument: $($type)*),*) -> $crate::ffi::signature::$result {
            // SAFETY: the arguments are passed on unchanged from the importer.
            unsafe { $crate::ffi::$($function)*::<$model>($($argument),*) }
        }
    };
    ($model:ty; $name:ident = $function:tt -> $result:tt;
        [$next:ident $($unused:ident)*] [$($done:tt)*]; $(*$access:tt)? $type:ident $(, $($types:tt)*)?) => {
        $crate::entry_point! { $model; $name = $function -> $result;
            [$($unused)*] [$($done)* ($next $(*$access)? $crate::ffi::signature::$type)]; $($($types)*)? }
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

    /// An array of value references.
    pub type References = *const fmi3ValueReference;
    /// `fmi3LogMessageCallback`, which may be null, as the other callbacks may.
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
