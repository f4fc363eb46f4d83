//! `fmi3DoStep`.

use super::super::Instance;
use crate::model::{Failure, Model};
use crate::stepper::Stop;
use fmu_description::abi::Status;

/// The results of `fmi3DoStep` (section 4.2.1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StepResult {
    pub(crate) event_handling_needed: bool,
    pub(crate) terminate_simulation: bool,
    pub(crate) early_return: bool,
    pub(crate) last_successful_time: f64,
}

impl<M: Model> Instance<M> {
    /// `fmi3DoStep`.
    ///
    /// If the importer handles events (`eventModeUsed`) and allows early return, the step ends at the first event
    /// ([`Model::step_to_event`], or the integration by the exporter if the model has no step). The step also ends
    /// where the model ends the simulation.
    ///
    /// # Errors
    ///
    /// The failures of the model, and [`Failure::Error`] for a step that is not possible or an event outside of it.
    /// [`Failure::Incomplete`] becomes `fmi3Error`, because `earlyReturn` must not signal a failure.
    pub(crate) fn do_step_3(&mut self, start: f64, size: f64) -> Result<StepResult, Failure> {
        let session = self.session()?;
        let (events, may_return) = (session.event_mode_used, session.early_return_allowed);
        let end = start + size;
        let mut stop = Stop { time: end, is_event: false };
        let done = if events && may_return {
            self.step_to_event(start, size).map(|reached| stop = reached)
        } else {
            self.do_step(start, size)
        };
        let terminated = match done {
            Ok(()) => false,
            Err(Failure::Terminated { time, message }) => {
                stop.time = if time.is_finite() { time.clamp(start, end) } else { start };
                self.core.time = stop.time;
                self.core.terminated = true;
                self.log(Status::OK, "logEvents", &format!("the simulation ends: {message}"));
                true
            }
            Err(failure) => return Err(failure),
        };
        self.leave_inputs(stop.time - start, stop.time >= end);
        Ok(StepResult {
            event_handling_needed: stop.is_event,
            terminate_simulation: terminated,
            early_return: may_return && stop.time < end,
            last_successful_time: stop.time,
        })
    }

    /// Advances to the end of the step or to the first event, which event mode will handle.
    fn step_to_event(&mut self, start: f64, size: f64) -> Result<Stop, Failure> {
        let (step, end) = self.begin_step(start, size)?;
        let core = &mut self.core;
        let stop = match core.model.step_to_event(&step) {
            Ok(None) => Stop { time: end, is_event: false },
            Ok(Some(time)) if time > step.start && time <= step.end() => {
                Stop { time, is_event: true }
            }
            Ok(Some(time)) => {
                return Err(Failure::Error(format!(
                    "the model reports an event at {time} s in the step from {} s to {} s",
                    step.start,
                    step.end()
                )));
            }
            Err(Failure::Unsolved) => {
                let Self { stepper, interface, .. } = self;
                let tolerance = core.experiment.tolerance;
                let next = core.next_event;
                stepper.run_to_event(&mut core.model, interface, &step, tolerance, next)?
            }
            Err(failure) => return Err(failure),
        };
        let stop = if stop.time < step.end() { stop } else { Stop { time: end, ..stop } };
        core.time = stop.time;
        core.stale = false;
        Ok(stop)
    }
}
