//! The functions with an instance, except functions for values and clocks.

use std::ffi::c_void;

use super::super::entry::common_entry_points;
use super::super::{
    ask_for_inputs, borrow_output, borrow_state, dispatch, free_state, read, snapshot, store,
    texts, write_one,
};
use super::entry_points_3;
use crate::Experiment;
use crate::instance::Jacobian;
use crate::model::{Failure, Model};
use fmu_description::abi3::{
    DependencyKind, fmi3Boolean, fmi3Byte, fmi3DependencyKind, fmi3Float64, fmi3Instance,
    fmi3Int32, fmi3Status, fmi3String, fmi3ValueReference,
};
use fmu_description::call_order3::Function;

common_entry_points! {
    entry_points_3: fmi3Boolean, fmi3Byte, GetFMUState SetFMUState FreeFMUState SerializedFMUStateSize
    SerializeFMUState DeserializeFMUState, deserialize_fmu_state get_nominals_of_continuous_states
}

entry_points_3! {
    set_debug_logging = SetDebugLogging(on: fmi3Boolean, n: usize, categories: *const fmi3String),
        instance => instance.set_debug_logging_3(on != 0, &texts(categories, n)?);
    enter_initialization_mode = EnterInitializationMode(
        tolerance_defined: fmi3Boolean, tolerance: fmi3Float64, start_time: fmi3Float64,
        stop_time_defined: fmi3Boolean, stop_time: fmi3Float64
    ), instance => {
        instance.setup_experiment(Experiment {
            start_time,
            stop_time: (stop_time_defined != 0).then_some(stop_time),
            tolerance: (tolerance_defined != 0).then_some(tolerance),
        })?;
        instance.enter_initialization_mode()
    };
    exit_initialization_mode = ExitInitializationMode(),
        instance => instance.exit_initialization_mode_3();
    enter_event_mode = EnterEventMode(), instance => instance.enter_event_mode_3();
    get_number_of_variable_dependencies = GetNumberOfVariableDependencies(
        reference: fmi3ValueReference, n: *mut usize
    ), instance => write_one(n, instance.dependencies(reference)?.len());
    get_variable_dependencies = GetVariableDependencies(
        dependent: fmi3ValueReference, elements: *mut usize,
        independents: *mut fmi3ValueReference, elements_of_independents: *mut usize,
        kinds: *mut fmi3DependencyKind, n: usize
    ), instance => {
        let dependencies = instance.dependencies(dependent)?;
        if dependencies.len() != n {
            let expected = dependencies.len();
            return Err(Failure::Error(format!("nDependencies is {n}, expected {expected}")));
        }
        let (elements, independents) = (borrow_output(elements, n)?, borrow_output(independents, n)?);
        let of_independents = borrow_output(elements_of_independents, n)?;
        let kinds = borrow_output(kinds, n)?;
        for (k, dependency) in dependencies.into_iter().enumerate() {
            elements[k].write(dependency.element);
            independents[k].write(dependency.known);
            of_independents[k].write(dependency.element_of_known);
            kinds[k].write(to_c(dependency.kind) as fmi3DependencyKind);
        }
        Ok(())
    };
    #[expect(clippy::too_many_arguments, reason = "the arguments of the standard")]
    get_directional_derivative = GetDirectionalDerivative(
        unknowns: *const fmi3ValueReference, n_unknowns: usize,
        knowns: *const fmi3ValueReference, n_knowns: usize,
        seed: *const fmi3Float64, n_seed: usize,
        sensitivity: *mut fmi3Float64, n_sensitivity: usize
    ), instance => {
        let (unknowns, knowns) = (read(unknowns, n_unknowns)?, read(knowns, n_knowns)?);
        let jacobian = Jacobian { unknowns, knowns, unknown_count: n_sensitivity, known_count: n_seed };
        instance.jacobian(&jacobian, |instance, unknowns, knowns| instance.get_directional_derivative(
            unknowns,
            knowns,
            read(seed, n_seed)?,
            borrow_output(sensitivity, n_sensitivity)?,
        ))
    };
    #[expect(clippy::too_many_arguments, reason = "the arguments of the standard")]
    get_adjoint_derivative = GetAdjointDerivative(
        unknowns: *const fmi3ValueReference, n_unknowns: usize,
        knowns: *const fmi3ValueReference, n_knowns: usize,
        seed: *const fmi3Float64, n_seed: usize,
        sensitivity: *mut fmi3Float64, n_sensitivity: usize
    ), instance => {
        let (unknowns, knowns) = (read(unknowns, n_unknowns)?, read(knowns, n_knowns)?);
        let jacobian = Jacobian { unknowns, knowns, unknown_count: n_seed, known_count: n_sensitivity };
        instance.jacobian(&jacobian, |instance, unknowns, knowns| instance.get_adjoint_derivative(
            unknowns,
            read(seed, n_seed)?,
            knowns,
            borrow_output(sensitivity, n_sensitivity)?,
        ))
    };
    enter_configuration_mode = EnterConfigurationMode(),
        instance => instance.enter_configuration_mode();
    exit_configuration_mode = ExitConfigurationMode(),
        instance => instance.exit_configuration_mode();
    // Ignored, because providesEvaluateDiscreteStates is false (section 2.3.5).
    evaluate_discrete_states = EvaluateDiscreteStates(), _instance => Ok(());
    update_discrete_states = UpdateDiscreteStates(
        need_update: *mut fmi3Boolean, terminate: *mut fmi3Boolean,
        nominals_changed: *mut fmi3Boolean, values_changed: *mut fmi3Boolean,
        next_defined: *mut fmi3Boolean, next: *mut fmi3Float64
    ), instance => {
        let event = instance.update_discrete_states_3()?;
        write_one(need_update, event.new_discrete_states_needed.into())?;
        write_one(terminate, event.terminate_simulation.is_some().into())?;
        write_one(nominals_changed, 0)?;
        write_one(values_changed, event.values_of_continuous_states_changed.into())?;
        write_one(next_defined, event.next_event_time.is_some().into())?;
        write_one(next, event.next_event_time.unwrap_or_default())
    };
    enter_continuous_time_mode = EnterContinuousTimeMode(), instance => {
        instance.enter_continuous_time_mode_3();
        Ok(())
    };
    get_continuous_state_derivatives = GetContinuousStateDerivatives(x: *mut fmi3Float64, n: usize),
        instance => instance.get_derivatives(borrow_output(x, n)?);
    get_number_of_event_indicators = GetNumberOfEventIndicators(n: *mut usize),
        instance => write_one(n, instance.indicator_count());
    get_number_of_continuous_states = GetNumberOfContinuousStates(n: *mut usize),
        instance => write_one(n, instance.state_count());
    enter_step_mode = EnterStepMode(), instance => instance.enter_step_mode();
    get_output_derivatives = GetOutputDerivatives(
        references: *const fmi3ValueReference, n: usize, orders: *const fmi3Int32,
        values: *mut fmi3Float64, n_values: usize
    ), instance => instance.get_output_derivatives(
        read(references, n)?,
        read(orders, n)?,
        borrow_output(values, n_values)?,
    );
    activate_model_partition = ActivateModelPartition(
        _clock: fmi3ValueReference, _time: fmi3Float64
    ), _instance => Err(Failure::Error("this FMU offers no scheduled execution".to_owned()));
}

/// `fmi3DoStep`. The importer first sets its inputs within the step.
#[expect(clippy::too_many_arguments, reason = "the arguments of the standard")]
pub unsafe fn do_step<M: Model>(
    instance: fmi3Instance,
    start: fmi3Float64,
    size: fmi3Float64,
    _no_set_fmu_state: fmi3Boolean,
    event: *mut fmi3Boolean,
    terminate: *mut fmi3Boolean,
    early: *mut fmi3Boolean,
    last: *mut fmi3Float64,
) -> fmi3Status {
    // SAFETY: pointers are as the standard requires; null is handled.
    unsafe {
        ask_for_inputs::<M>(instance, start, size);
        dispatch::<M, _>(instance, Function::DoStep, |instance| {
            for place in [event, terminate, early] {
                write_one(place, 0)?;
            }
            let reached = borrow_output(last, 1)?;
            let step = instance.do_step_3(start, size);
            reached[0].write(instance.last_successful_time());
            let step = step?;
            write_one(event, step.event_handling_needed.into())?;
            write_one(terminate, step.terminate_simulation.into())?;
            write_one(early, step.early_return.into())?;
            write_one(last, step.last_successful_time)
        })
    }
}

fn to_c(kind: fmu_description::DependencyKind) -> DependencyKind {
    use fmu_description::DependencyKind as Kind;
    match kind {
        Kind::Dependent => DependencyKind::Dependent,
        Kind::Constant => DependencyKind::Constant,
        Kind::Fixed => DependencyKind::Fixed,
        Kind::Tunable => DependencyKind::Tunable,
        Kind::Discrete => DependencyKind::Discrete,
    }
}
