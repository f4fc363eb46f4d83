//! The C functions with an instance, one entry each.

use std::ffi::c_void;

use super::{
    borrow_output, borrow_state, dispatch, free_state, read, snapshot, store, texts, write_one,
};
use crate::Experiment;
use crate::model::{Failure, Model};
use fmu_description::abi::{
    StatusKind, fmi2Boolean, fmi2Byte, fmi2Component, fmi2EventInfo, fmi2Integer, fmi2Real,
    fmi2Status, fmi2StatusKind, fmi2String, fmi2ValueReference,
};
use fmu_description::call_order::Function;

/// Defines C functions that call `dispatch`: their arguments, then the safe code.
macro_rules! entry_points {
    ($($name:ident = $function:ident($($argument:ident: $type:ty),*), $instance:ident => $body:expr;)*) => {
        $(pub unsafe fn $name<M: Model>(component: fmi2Component, $($argument: $type),*) -> fmi2Status {
            // SAFETY: pointers and lengths are as the standard requires; null is handled.
            unsafe { dispatch::<M, _>(component, Function::$function, |$instance| $body) }
        })*
    };
}

/// Defines by the macro `$entry_points` the functions that FMI 2.0 and 3.0 share, some with other names.
macro_rules! common_entry_points {
    ($entry_points:ident: $boolean:ty, $byte:ty, $get:ident $set:ident $free:ident $size:ident $serialize:ident
        $deserialize:ident, $de_serialize_fmu_state:ident $get_nominals:ident) => {
        $entry_points! {
            terminate = Terminate(), instance => { instance.terminate(); Ok(()) };
            reset = Reset(), instance => instance.reset();
            get_fmu_state = $get(state: *mut *mut c_void), instance => {
                let place = borrow_state(state)?;
                store(place, instance.snapshot());
                Ok(())
            };
            set_fmu_state = $set(state: *mut c_void), instance => instance.restore(snapshot(state)?);
            free_fmu_state = $free(state: *mut *mut c_void), _instance => {
                if !state.is_null() {
                    free_state::<M>(borrow_state(state)?);
                }
                Ok(())
            };
            serialized_fmu_state_size = $size(state: *mut c_void, size: *mut usize),
                _instance => write_one(size, snapshot::<M>(state)?.size()?);
            serialize_fmu_state = $serialize(state: *mut c_void, bytes: *mut $byte, size: usize),
                _instance => snapshot::<M>(state)?.write(borrow_output(bytes.cast::<u8>(), size)?);
            $de_serialize_fmu_state = $deserialize(
                bytes: *const $byte, size: usize, state: *mut *mut c_void
            ), instance => {
                let snapshot = instance.read_snapshot(read(bytes.cast::<u8>(), size)?)?;
                store(borrow_state(state)?, snapshot);
                Ok(())
            };
            completed_integrator_step = CompletedIntegratorStep(
                _no_set_fmu_state: $boolean, enter: *mut $boolean, terminate: *mut $boolean
            ), instance => {
                instance.completed_integrator_step()?;
                write_one(enter, 0)?;
                write_one(terminate, 0)
            };
            set_time = SetTime(time: f64), instance => instance.set_time(time);
            set_continuous_states = SetContinuousStates(x: *const f64, n: usize),
                instance => instance.set_continuous_states(read(x, n)?);
            get_continuous_states = GetContinuousStates(x: *mut f64, n: usize),
                instance => instance.get_continuous_states(borrow_output(x, n)?);
            $get_nominals = GetNominalsOfContinuousStates(x: *mut f64, n: usize),
                instance => instance.get_nominals(borrow_output(x, n)?);
            get_event_indicators = GetEventIndicators(z: *mut f64, n: usize),
                instance => instance.get_event_indicators(borrow_output(z, n)?);
        }
    };
}
pub(super) use common_entry_points;

common_entry_points! {
    entry_points: fmi2Boolean, fmi2Byte, GetFMUstate SetFMUstate FreeFMUstate SerializedFMUstateSize
    SerializeFMUstate DeSerializeFMUstate, de_serialize_fmu_state get_nominals
}

entry_points! {
    set_debug_logging = SetDebugLogging(on: fmi2Boolean, n: usize, categories: *const fmi2String),
        instance => {
            instance.set_debug_logging(texts(categories, n)?)?;
            instance.set_logging_on(on != 0);
            Ok(())
        };
    setup_experiment = SetupExperiment(
        tolerance_defined: fmi2Boolean, tolerance: fmi2Real, start_time: fmi2Real,
        stop_time_defined: fmi2Boolean, stop_time: fmi2Real
    ), instance => instance.setup_experiment(Experiment {
        start_time,
        stop_time: (stop_time_defined != 0).then_some(stop_time),
        tolerance: (tolerance_defined != 0).then_some(tolerance),
    });
    enter_initialization_mode = EnterInitializationMode(),
        instance => instance.enter_initialization_mode();
    exit_initialization_mode = ExitInitializationMode(),
        instance => instance.exit_initialization_mode();
    get_real = GetReal(vr: *const fmi2ValueReference, n: usize, value: *mut fmi2Real),
        instance => instance.get_real(read(vr, n)?, borrow_output(value, n)?);
    get_integer = GetInteger(vr: *const fmi2ValueReference, n: usize, value: *mut fmi2Integer),
        instance => instance.get_integer(read(vr, n)?, borrow_output(value, n)?);
    get_boolean = GetBoolean(vr: *const fmi2ValueReference, n: usize, value: *mut fmi2Boolean),
        instance => instance.get_boolean(read(vr, n)?, borrow_output(value, n)?);
    get_string = GetString(vr: *const fmi2ValueReference, n: usize, value: *mut fmi2String),
        instance => instance.get_string(read(vr, n)?, borrow_output(value, n)?);
    set_real = SetReal(vr: *const fmi2ValueReference, n: usize, value: *const fmi2Real),
        instance => instance.set_real(read(vr, n)?, read(value, n)?);
    set_integer = SetInteger(vr: *const fmi2ValueReference, n: usize, value: *const fmi2Integer),
        instance => instance.set_integer(read(vr, n)?, read(value, n)?);
    set_boolean = SetBoolean(vr: *const fmi2ValueReference, n: usize, value: *const fmi2Boolean),
        instance => instance.set_boolean(read(vr, n)?, read(value, n)?);
    set_string = SetString(vr: *const fmi2ValueReference, n: usize, value: *const fmi2String),
        instance => instance.set_string(read(vr, n)?, &texts(value, n)?);
    set_real_input_derivatives = SetRealInputDerivatives(
        vr: *const fmi2ValueReference, n: usize, order: *const fmi2Integer, value: *const fmi2Real
    ), instance => instance.set_real_input_derivatives(read(vr, n)?, read(order, n)?, read(value, n)?);
    get_real_output_derivatives = GetRealOutputDerivatives(
        vr: *const fmi2ValueReference, n: usize, order: *const fmi2Integer, value: *mut fmi2Real
    ), instance => instance.get_real_output_derivatives(read(vr, n)?, read(order, n)?, borrow_output(value, n)?);
    do_step = DoStep(start: fmi2Real, size: fmi2Real, _no_set_fmu_state: fmi2Boolean),
        instance => instance.do_step(start, size);
    cancel_step = CancelStep(), _instance =>
        Err(Failure::Error("no step is pending: fmi2DoStep completes every step".to_owned()));
    get_directional_derivative = GetDirectionalDerivative(
        unknown: *const fmi2ValueReference, n_unknown: usize,
        known: *const fmi2ValueReference, n_known: usize,
        known_delta: *const fmi2Real, unknown_delta: *mut fmi2Real
    ), instance => instance.get_directional_derivative(
        read(unknown, n_unknown)?,
        read(known, n_known)?,
        read(known_delta, n_known)?,
        borrow_output(unknown_delta, n_unknown)?,
    );
    enter_event_mode = EnterEventMode(), instance => instance.enter_event_mode();
    new_discrete_states = NewDiscreteStates(info: *mut fmi2EventInfo), instance => {
        let place = borrow_output(info, 1)?;
        place[0].write(instance.new_discrete_states()?);
        Ok(())
    };
    enter_continuous_time_mode = EnterContinuousTimeMode(), instance => {
        instance.enter_continuous_time_mode();
        Ok(())
    };
    get_derivatives = GetDerivatives(derivatives: *mut fmi2Real, n: usize),
        instance => instance.get_derivatives(borrow_output(derivatives, n)?);
    get_status = GetStatus(kind: fmi2StatusKind, _value: *mut fmi2Status),
        _instance => Err(unavailable(kind));
    get_real_status = GetRealStatus(kind: fmi2StatusKind, value: *mut fmi2Real), instance =>
        if kind == StatusKind::LastSuccessfulTime as fmi2StatusKind {
            write_one(value, instance.last_successful_time())
        } else {
            Err(unavailable(kind))
        };
    get_integer_status = GetIntegerStatus(kind: fmi2StatusKind, _value: *mut fmi2Integer),
        _instance => Err(unavailable(kind));
    get_boolean_status = GetBooleanStatus(kind: fmi2StatusKind, value: *mut fmi2Boolean),
        instance => if kind == StatusKind::Terminated as fmi2StatusKind {
            write_one(value, instance.is_terminated().into())
        } else {
            Err(unavailable(kind))
        };
    get_string_status = GetStringStatus(kind: fmi2StatusKind, _value: *mut fmi2String),
        _instance => Err(unavailable(kind));
}

/// Returns the failure (`fmi2Discard`) for a status kind that a synchronous slave does not have (section 4.2.3).
fn unavailable(kind: fmi2StatusKind) -> Failure {
    Failure::Discard(format!("no step is pending: status kind {kind} is not available"))
}
