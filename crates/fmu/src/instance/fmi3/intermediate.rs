//! Intermediate update: the importer sets the inputs within a communication step (section 4.2.2).
//!
//! At the start of a step the instance asks for the inputs in the middle and at the end of the step. The model then
//! follows the parabola through start, middle and end, as with the input derivatives of FMI 2.0.

use super::super::Instance;
use super::Session;
use crate::callbacks::IntermediateUpdate;
use crate::model::Model;
use fmu_description::call_order::{InterfaceType, State};

/// The importer's callback, and the inputs with derivatives at start, middle and end of the step.
pub(super) struct Intermediate {
    update: IntermediateUpdate,
    values: [Vec<f64>; 3],
    /// At the start of the step: whether a value was set since the outputs were computed.
    stale: bool,
    /// Whether the importer has been asked for the present step.
    asked: bool,
}

impl Intermediate {
    pub(super) fn new(update: IntermediateUpdate, inputs: usize) -> Self {
        let values = || vec![0.0; inputs];
        Self { update, values: [values(), values(), values()], stale: false, asked: false }
    }

    /// Changes the number of inputs.
    pub(super) fn resize(&mut self, inputs: usize) {
        for values in &mut self.values {
            values.resize(inputs, 0.0);
        }
    }
}

fn intermediate(session: &mut Option<Box<Session>>) -> Option<&mut Intermediate> {
    session.as_mut()?.intermediate.as_deref_mut()
}

impl<M: Model> Instance<M> {
    /// Enters intermediate update mode for a step of `size` s, and returns the callback. Does nothing and returns
    /// `None` without a callback, if a step is not allowed now, and if `size` is not a positive number.
    pub(crate) fn begin_intermediate(&mut self, size: f64) -> Option<IntermediateUpdate> {
        let core = &mut self.core;
        let intermediate = intermediate(&mut self.session)?;
        intermediate.asked = false;
        if core.state != State::StepComplete
            || core.interface_type != InterfaceType::CoSimulation
            || !(size > 0.0 && size.is_finite())
        {
            return None;
        }
        (intermediate.asked, intermediate.stale) = (true, core.stale);
        core.state = State::IntermediateUpdateMode;
        self.interface.read_interpolated(&mut core.model, &mut intermediate.values[0]);
        Some(intermediate.update)
    }

    /// Records the inputs in the middle (1) or at the end (2) of the step.
    pub(crate) fn record_intermediate(&mut self, place: usize) {
        if let Some(intermediate) = intermediate(&mut self.session) {
            self.interface.read_interpolated(&mut self.core.model, &mut intermediate.values[place]);
        }
    }

    /// Restores the inputs at the start of the step. Unless a call in intermediate update mode failed, leaves this mode
    /// and sets the derivatives of the inputs.
    pub(crate) fn end_intermediate(&mut self, size: f64) {
        let Some(intermediate) = intermediate(&mut self.session) else { return };
        let core = &mut self.core;
        let [start, middle, end] = &intermediate.values;
        self.interface.write_interpolated(&mut core.model, start);
        core.stale = intermediate.stale;
        if core.state == State::IntermediateUpdateMode {
            core.state = State::StepComplete;
            core.sloped = self.interface.interpolate(&mut core.model, [start, middle, end], size);
        }
    }

    /// Sets the inputs to their values at the end of the step, `elapsed` s after its start: to the recorded values if
    /// the step `is_whole`, otherwise to the values of the polynomials. Then clears the input derivatives. Does nothing
    /// if the importer was not asked for inputs.
    pub(super) fn leave_inputs(&mut self, elapsed: f64, is_whole: bool) {
        let Self { core, interface, session, .. } = self;
        let Some(intermediate) = intermediate(session) else { return };
        if !std::mem::take(&mut intermediate.asked) {
            return;
        }
        if is_whole {
            interface.write_interpolated(&mut core.model, &intermediate.values[2]);
        } else {
            interface.extrapolate(&mut core.model, &intermediate.values[0], elapsed);
        }
        if std::mem::take(&mut core.sloped) {
            interface.clear_input_derivatives(&mut core.model);
        }
    }
}
