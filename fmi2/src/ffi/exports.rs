//! The export line of a model, and the C signatures behind it.

/// Exports a [`Model`](crate::Model) as all functions of FMI 2.0: the last line of a model's
/// library, which is a `cdylib`. The functions of model exchange are there in any case; a model
/// without that interface is not instantiated for it.
///
/// ```
/// use std::path::Path;
///
/// use fmi2::{About, Experiment, Failure, Model, Step, Variable};
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
/// fmi2::export!(Tank);
/// # fn main() {}
/// ```
///
/// Beside the standard's functions the library gets
/// [`fmuDescribe`](crate::abi::DESCRIBE), by which the packer asks for the model description.
#[macro_export]
macro_rules! export {
    ($model:ty) => {
        const _: () = assert!(
            cfg!(panic = "unwind"),
            "an FMU needs panic = \"unwind\": an aborting panic takes the importer down"
        );

        mod fmi2_entry_points {
            use super::*;
            use $crate::abi::*;
            use $crate::ffi::*;

            $crate::entry_points! { $model;
                fmi2GetTypesPlatform = types_platform() -> fmi2String;
                fmi2GetVersion = version() -> fmi2String;
                fmuDescribe = describe(resources: fmi2String, context: fmi2ComponentEnvironment,
                    sink: DescribeSink) -> fmi2Integer;
                fmi2Instantiate = instantiate(name: fmi2String, fmu_type: fmi2Type,
                    guid: fmi2String, resource_location: fmi2String,
                    functions: *const fmi2CallbackFunctions, visible: fmi2Boolean,
                    logging_on: fmi2Boolean) -> fmi2Component;
                fmi2FreeInstance = free_instance(c: fmi2Component) -> ();
                fmi2SetDebugLogging = set_debug_logging(c: fmi2Component, on: fmi2Boolean,
                    n: usize, categories: *const fmi2String) -> fmi2Status;
                fmi2SetupExperiment = setup_experiment(c: fmi2Component,
                    tolerance_defined: fmi2Boolean, tolerance: fmi2Real, start_time: fmi2Real,
                    stop_time_defined: fmi2Boolean, stop_time: fmi2Real) -> fmi2Status;
                fmi2EnterInitializationMode =
                    enter_initialization_mode(c: fmi2Component) -> fmi2Status;
                fmi2ExitInitializationMode =
                    exit_initialization_mode(c: fmi2Component) -> fmi2Status;
                fmi2Terminate = terminate(c: fmi2Component) -> fmi2Status;
                fmi2Reset = reset(c: fmi2Component) -> fmi2Status;
                fmi2GetReal = get_real(c: fmi2Component, vr: *const fmi2ValueReference, n: usize,
                    value: *mut fmi2Real) -> fmi2Status;
                fmi2GetInteger = get_integer(c: fmi2Component, vr: *const fmi2ValueReference,
                    n: usize, value: *mut fmi2Integer) -> fmi2Status;
                fmi2GetBoolean = get_boolean(c: fmi2Component, vr: *const fmi2ValueReference,
                    n: usize, value: *mut fmi2Boolean) -> fmi2Status;
                fmi2GetString = get_string(c: fmi2Component, vr: *const fmi2ValueReference,
                    n: usize, value: *mut fmi2String) -> fmi2Status;
                fmi2SetReal = set_real(c: fmi2Component, vr: *const fmi2ValueReference, n: usize,
                    value: *const fmi2Real) -> fmi2Status;
                fmi2SetInteger = set_integer(c: fmi2Component, vr: *const fmi2ValueReference,
                    n: usize, value: *const fmi2Integer) -> fmi2Status;
                fmi2SetBoolean = set_boolean(c: fmi2Component, vr: *const fmi2ValueReference,
                    n: usize, value: *const fmi2Boolean) -> fmi2Status;
                fmi2SetString = set_string(c: fmi2Component, vr: *const fmi2ValueReference,
                    n: usize, value: *const fmi2String) -> fmi2Status;
                fmi2GetFMUstate = get_fmu_state(c: fmi2Component, state: *mut fmi2FMUstate)
                    -> fmi2Status;
                fmi2SetFMUstate = set_fmu_state(c: fmi2Component, state: fmi2FMUstate)
                    -> fmi2Status;
                fmi2FreeFMUstate = free_fmu_state(c: fmi2Component, state: *mut fmi2FMUstate)
                    -> fmi2Status;
                fmi2SerializedFMUstateSize = serialized_fmu_state_size(c: fmi2Component,
                    state: fmi2FMUstate, size: *mut usize) -> fmi2Status;
                fmi2SerializeFMUstate = serialize_fmu_state(c: fmi2Component, state: fmi2FMUstate,
                    bytes: *mut fmi2Byte, size: usize) -> fmi2Status;
                fmi2DeSerializeFMUstate = de_serialize_fmu_state(c: fmi2Component,
                    bytes: *const fmi2Byte, size: usize, state: *mut fmi2FMUstate) -> fmi2Status;
                fmi2GetDirectionalDerivative = get_directional_derivative(c: fmi2Component,
                    unknown: *const fmi2ValueReference, n_unknown: usize,
                    known: *const fmi2ValueReference, n_known: usize,
                    known_delta: *const fmi2Real, unknown_delta: *mut fmi2Real) -> fmi2Status;
                fmi2EnterEventMode = enter_event_mode(c: fmi2Component) -> fmi2Status;
                fmi2NewDiscreteStates = new_discrete_states(c: fmi2Component,
                    info: *mut fmi2EventInfo) -> fmi2Status;
                fmi2EnterContinuousTimeMode =
                    enter_continuous_time_mode(c: fmi2Component) -> fmi2Status;
                fmi2CompletedIntegratorStep = completed_integrator_step(c: fmi2Component,
                    no_set_fmu_state: fmi2Boolean, enter_event_mode: *mut fmi2Boolean,
                    terminate_simulation: *mut fmi2Boolean) -> fmi2Status;
                fmi2SetTime = set_time(c: fmi2Component, time: fmi2Real) -> fmi2Status;
                fmi2SetContinuousStates = set_continuous_states(c: fmi2Component,
                    x: *const fmi2Real, n: usize) -> fmi2Status;
                fmi2GetEventIndicators = get_event_indicators(c: fmi2Component,
                    z: *mut fmi2Real, n: usize) -> fmi2Status;
                fmi2GetContinuousStates = get_continuous_states(c: fmi2Component,
                    x: *mut fmi2Real, n: usize) -> fmi2Status;
                fmi2GetDerivatives = get_derivatives(c: fmi2Component,
                    derivatives: *mut fmi2Real, n: usize) -> fmi2Status;
                fmi2GetNominalsOfContinuousStates = get_nominals(c: fmi2Component,
                    nominals: *mut fmi2Real, n: usize) -> fmi2Status;
                fmi2SetRealInputDerivatives = set_real_input_derivatives(c: fmi2Component,
                    vr: *const fmi2ValueReference, n: usize, order: *const fmi2Integer,
                    value: *const fmi2Real) -> fmi2Status;
                fmi2GetRealOutputDerivatives = get_real_output_derivatives(c: fmi2Component,
                    vr: *const fmi2ValueReference, n: usize, order: *const fmi2Integer,
                    value: *mut fmi2Real) -> fmi2Status;
                fmi2DoStep = do_step(c: fmi2Component, start: fmi2Real, size: fmi2Real,
                    no_set_fmu_state: fmi2Boolean) -> fmi2Status;
                fmi2CancelStep = cancel_step(c: fmi2Component) -> fmi2Status;
                fmi2GetStatus = get_status(c: fmi2Component, kind: fmi2StatusKind,
                    value: *mut fmi2Status) -> fmi2Status;
                fmi2GetRealStatus = get_real_status(c: fmi2Component, kind: fmi2StatusKind,
                    value: *mut fmi2Real) -> fmi2Status;
                fmi2GetIntegerStatus = get_integer_status(c: fmi2Component, kind: fmi2StatusKind,
                    value: *mut fmi2Integer) -> fmi2Status;
                fmi2GetBooleanStatus = get_boolean_status(c: fmi2Component, kind: fmi2StatusKind,
                    value: *mut fmi2Boolean) -> fmi2Status;
                fmi2GetStringStatus = get_string_status(c: fmi2Component, kind: fmi2StatusKind,
                    value: *mut fmi2String) -> fmi2Status;
            }
        }
    };
}

/// One exported C function for each line, each a call of the generic function for the model.
#[doc(hidden)]
#[macro_export]
macro_rules! entry_points {
    ($model:ty; $($name:ident =
        $function:ident($($argument:ident: $type:ty),*) -> $result:ty;)*) => {
        $(
            #[unsafe(no_mangle)]
            unsafe extern "C" fn $name($($argument: $type),*) -> $result {
                // SAFETY: the arguments are handed on as the importer gave them.
                unsafe { $function::<$model>($($argument),*) }
            }
        )*
    };
}
