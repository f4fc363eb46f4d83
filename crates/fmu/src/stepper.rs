//! The default step: integrates the derivatives of a model, with located events.

use crate::interface::Interface;
use crate::model::{Failure, Model, Step};
use crate::solver::{Integrator, Reached, System, TOLERANCE};
use fmu_description::DefaultExperiment;

/// Most events in one communication step.
const EVENT_LIMIT: u32 = 10_000;

/// The longest communication step, divided by the step size of the default experiment. In a much longer step, a model
/// that samples or integrates with shorter steps of its own would not return.
const LONGEST: f64 = 1e7;

/// Most calls of [`Model::event`] at one event.
const ITERATION_LIMIT: u32 = 1000;

/// End of a step that stops at events.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stop {
    /// The time reached, in s.
    pub(crate) time: f64,
    /// Whether an event is to be handled at this time.
    pub(crate) is_event: bool,
}

/// Integrates the continuous states of a model over communication steps.
///
/// The stepper has no memory between steps, so that the struct of the model remains the whole FMU state.
pub(crate) struct Stepper {
    integrator: Integrator,
    /// The relative tolerance if the importer defines none.
    tolerance: f64,
    /// The longest communication step in s.
    longest: f64,
    /// Whether the model has states or event indicators.
    has_equations: bool,
    state: Vec<f64>,
    /// The inputs with derivatives at the start of the step.
    inputs: Vec<f64>,
}

impl Stepper {
    pub(crate) fn new<M>(interface: &Interface<M>, experiment: Option<DefaultExperiment>) -> Self {
        let experiment = experiment.unwrap_or_default();
        let unit = experiment.step_size.unwrap_or(1.0).min(interface.shortest_interval());
        let nominals = interface.nominals();
        let indicators = interface.event_indicators.unwrap_or_default();
        Self {
            tolerance: experiment.tolerance.unwrap_or(TOLERANCE),
            longest: LONGEST * unit,
            has_equations: !nominals.is_empty() || indicators > 0,
            state: vec![0.0; nominals.len()],
            inputs: vec![0.0; interface.interpolated.len()],
            integrator: Integrator::new(nominals, indicators),
        }
    }

    /// Checks the size of a communication step in s, before the model sees it. [`Failure::Discard`] for a too long
    /// step.
    #[inline]
    pub(crate) fn check_size(&self, size: f64) -> Result<(), Failure> {
        if size <= self.longest { Ok(()) } else { Err(too_long(size, self.longest)) }
    }

    /// Checks the delay from `next`, the announced time of an event, to `time`, at which it is handled, both in s. An
    /// error if this delay exceeds the longest communication step: a model that samples might not return.
    pub(crate) fn check_delay(&self, next: f64, time: f64) -> Result<(), Failure> {
        if time - next <= self.longest {
            return Ok(());
        }
        let message = format!("{time:e} s is too long after {next} s, the time of the next event");
        Err(Failure::Error(message))
    }

    /// Advances the model over the step: handles the event at its start, and then integrates from event to event.
    /// Inputs with derivatives follow their polynomials; after the step these inputs again have the values that they
    /// had at its start.
    ///
    /// # Errors
    ///
    /// [`Failure::Incomplete`] or [`Failure::Terminated`] with the time reached, at which the model then
    /// is; other failures of the model.
    pub(crate) fn run<M: Model>(
        &mut self,
        model: &mut M,
        interface: &Interface<M>,
        step: &Step,
        tolerance: Option<f64>,
    ) -> Result<(), Failure> {
        self.with_equations(model, interface, step, tolerance, |stepper, equations| {
            stepper.run_with_events(equations, step)
        })
    }

    /// Advances the model to the end of the step, to the first state event or to the event at `next` in s, whichever is
    /// first. Handles no event, and does nothing if `next` is not after the start of the step. Has the errors of
    /// [`Stepper::run`].
    pub(crate) fn run_to_event<M: Model>(
        &mut self,
        model: &mut M,
        interface: &Interface<M>,
        step: &Step,
        tolerance: Option<f64>,
        next: Option<f64>,
    ) -> Result<Stop, Failure> {
        let (start, end) = (step.start, step.end());
        let target = next.map_or(end, |next| next.min(end));
        if target <= start {
            return Ok(Stop { time: start, is_event: true });
        }
        self.with_equations(model, interface, step, tolerance, |stepper, equations| {
            Ok(match stepper.integrate(equations, start, target)? {
                Reached::End => {
                    Stop { time: target, is_event: next.is_some_and(|next| next <= end) }
                }
                Reached::Event => Stop { time: stepper.integrator.time(), is_event: true },
            })
        })
    }

    /// Runs `body` with the equations of the model during a step.
    fn with_equations<M: Model, T>(
        &mut self,
        model: &mut M,
        interface: &Interface<M>,
        step: &Step,
        tolerance: Option<f64>,
        body: impl FnOnce(&mut Self, &mut Equations<'_, M>) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        self.integrator.set_tolerance(tolerance.unwrap_or(self.tolerance));
        let mut inputs = std::mem::take(&mut self.inputs);
        interface.read_interpolated(model, &mut inputs);
        let mut equations = Equations { model, interface, start: step.start, inputs: &inputs };
        let result = body(self, &mut equations);
        interface.write_interpolated(model, &inputs);
        self.inputs = inputs;
        result
    }

    /// Integrates over the step and handles its events.
    fn run_with_events<M: Model>(
        &mut self,
        equations: &mut Equations<'_, M>,
        step: &Step,
    ) -> Result<(), Failure> {
        let (mut time, end) = (step.start, step.end());
        for _ in 0..EVENT_LIMIT {
            let next = equations.handle_event(time).map_err(|failure| stopped(failure, time))?;
            let target = next.map_or(end, |next| next.min(end));
            let reached = self.integrate(equations, time, target)?;
            time = if reached == Reached::End { target } else { self.integrator.time() };
            if reached == Reached::End && next.is_none_or(|next| next > end) {
                return Ok(());
            }
            if time >= end {
                equations.handle_event(time).map_err(|failure| stopped(failure, time))?;
                return equations.model.update(time).map_err(|failure| stopped(failure, time));
            }
        }
        let message = format!("more than {EVENT_LIMIT} events in one communication step");
        Err(Failure::Incomplete { time, message })
    }

    /// Integrates from `time` to `target` or to the first state event, and sets the model to that point.
    fn integrate<M: Model>(
        &mut self,
        equations: &mut Equations<'_, M>,
        time: f64,
        target: f64,
    ) -> Result<Reached, Failure> {
        let Self { integrator, state, .. } = self;
        if !self.has_equations {
            let shown = equations.show(target, state);
            return shown.map(|()| Reached::End).map_err(|failure| stopped(failure, time));
        }
        equations.interface.read_states(equations.model, state);
        // A trait object, so that the integrator is compiled once for all models.
        let system: &mut dyn System = equations;
        let reached = integrator
            .start(system, time, state, target)
            .and_then(|()| integrator.advance(system, target));
        let time = integrator.time();
        let shown = equations.show(time, integrator.state());
        let reached = reached.map_err(|failure| stopped(failure, time))?;
        shown.map(|()| reached).map_err(|failure| stopped(failure, time))
    }
}

#[cold]
fn too_long(size: f64, longest: f64) -> Failure {
    Failure::Discard(format!(
        "communicationStepSize is {size:e} s, expected at most {longest:e} s: {LONGEST:e} steps of the \
         default experiment, or intervals of a clock"
    ))
}

/// Returns the failure of a step that reached `time`: [`Failure::Discard`] becomes [`Failure::Incomplete`], because the
/// model has changed.
fn stopped(failure: Failure, time: f64) -> Failure {
    match failure {
        Failure::Discard(message) => Failure::Incomplete { time, message },
        other => other,
    }
}

/// The equations of a model during one step.
struct Equations<'a, M> {
    model: &'a mut M,
    interface: &'a Interface<M>,
    start: f64,
    inputs: &'a [f64],
}

impl<M: Model> Equations<'_, M> {
    /// Sets the model to a state at a time and computes its outputs and derivatives.
    fn show(&mut self, time: f64, state: &[f64]) -> Result<(), Failure> {
        self.interface.write_states(self.model, state);
        self.interface.extrapolate(self.model, self.inputs, time - self.start);
        self.model.update(time)
    }

    /// Handles the event at `time`, until no new discrete states are needed, and returns the time of the next event, if
    /// the model states one.
    fn handle_event(&mut self, time: f64) -> Result<Option<f64>, Failure> {
        for _ in 0..ITERATION_LIMIT {
            let event = self.model.event(time)?;
            if let Some(message) = event.terminate_simulation {
                return Err(Failure::Terminated { time, message });
            }
            if event.new_discrete_states_needed {
                continue;
            }
            return match event.next_event_time {
                Some(next) if next.is_nan() || next <= time => Err(Failure::Error(format!(
                    "the event at {time} s states the next event time {next} s, expected a later one"
                ))),
                next => Ok(next),
            };
        }
        Err(Failure::Error(format!(
            "the event at {time} s still needs new discrete states after {ITERATION_LIMIT} calls"
        )))
    }
}

impl<M: Model> System for Equations<'_, M> {
    fn derivative(&mut self, time: f64, state: &[f64], slope: &mut [f64]) -> Result<(), Failure> {
        self.show(time, state)?;
        self.interface.read_derivatives(self.model, slope);
        Ok(())
    }

    fn indicators(&mut self, time: f64, state: &[f64], z: &mut [f64]) -> Result<(), Failure> {
        self.show(time, state)?;
        self.model.event_indicators(time, z);
        Ok(())
    }
}
