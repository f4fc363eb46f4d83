//! The functions of model exchange (section 3.2).

use super::{Instance, time_tolerance};
use crate::model::{Event, Failure, Model};
use crate::room::{Room, filled};
use fmu_description::abi::{Status, fmi2EventInfo};
use fmu_description::call_order::{InterfaceType, State};

/// Checks that the length of an array is the number of `what` in the model description.
fn check_length(what: &str, actual: usize, expected: usize) -> Result<(), Failure> {
    if actual == expected {
        return Ok(());
    }
    Err(Failure::Error(format!("expected {expected} {what}, found {actual}")))
}

impl<M: Model> Instance<M> {
    /// `fmi2EnterEventMode`. An error after `stopTime`, and in model exchange too long after the next event.
    pub(crate) fn enter_event_mode(&mut self) -> Result<(), Failure> {
        let core = &mut self.core;
        core.before_stop(core.time)?;
        if core.interface_type == InterfaceType::ModelExchange {
            self.stepper.check_delay(core.next_event.unwrap_or(core.time), core.time)?;
        }
        core.state = State::EventMode;
        (core.earliest, core.stale) = (core.time, true);
        Ok(())
    }

    /// `fmi2CompletedIntegratorStep`.
    pub(crate) fn completed_integrator_step(&mut self) -> Result<(), Failure> {
        let core = &mut self.core;
        core.before_stop(core.time)?;
        core.earliest = core.earliest.max(core.completed);
        core.completed = core.time;
        Ok(())
    }

    /// Handles an event, for `fmi2NewDiscreteStates` and `fmi3UpdateDiscreteStates`. Logs the reason if the model ends
    /// the simulation. An error if the next event has no time.
    pub(crate) fn update_discrete_states(&mut self) -> Result<Event, Failure> {
        let core = &mut self.core;
        core.check()?;
        let event = core.model.event(core.time)?;
        if event.next_event_time.is_some_and(f64::is_nan) {
            let time = core.time;
            return Err(Failure::Error(format!(
                "the event at {time} s states the next event time NaN s, expected a later one"
            )));
        }
        (core.next_event, core.stale) = (event.next_event_time, true);
        if let Some(reason) = &event.terminate_simulation {
            let message = format!("the simulation ends at t = {} s: {reason}", self.core.time);
            self.log(Status::OK, "logEvents", &message);
        }
        Ok(event)
    }

    /// `fmi2NewDiscreteStates`.
    pub(crate) fn new_discrete_states(&mut self) -> Result<fmi2EventInfo, Failure> {
        let event = self.update_discrete_states()?;
        Ok(fmi2EventInfo {
            new_discrete_states_needed: event.new_discrete_states_needed.into(),
            terminate_simulation: event.terminate_simulation.is_some().into(),
            nominals_of_continuous_states_changed: 0,
            values_of_continuous_states_changed: event.values_of_continuous_states_changed.into(),
            next_event_time_defined: event.next_event_time.is_some().into(),
            next_event_time: event.next_event_time.unwrap_or_default(),
        })
    }

    /// `fmi2EnterContinuousTimeMode`.
    pub(crate) fn enter_continuous_time_mode(&mut self) {
        self.core.state = State::ContinuousTimeMode;
        self.core.stale = true;
    }

    /// `fmi2SetTime`. In event mode this call is allowed only for an FMU without continuous states (condition 8).
    ///
    /// The importer may go back to the second last completed step, but not beyond an event (FMI 3.0.2, section 3.2.1).
    /// Integrators that interpolate, such as those of FMPy and fmusim, evaluate the model after `stopTime`; a
    /// completed step or an event there is an error.
    pub(crate) fn set_time(&mut self, time: f64) -> Result<(), Failure> {
        if self.core.state == State::EventMode {
            if !self.interface.states.is_empty() {
                let message = "allowed in EventMode only for an FMU without continuous states";
                return Err(Failure::Error(message.to_owned()));
            }
            self.stepper.check_delay(self.core.next_event.unwrap_or(self.core.time), time)?;
        }
        if !time.is_finite() {
            return Err(Failure::Error(format!("time is {time}, expected a time in s")));
        }
        let earliest = self.core.earliest;
        if time < earliest - time_tolerance(earliest) {
            return Err(Failure::Error(format!(
                "{time} s is before {earliest} s, the time of the start, of the last event or of the second \
                 last completed integrator step"
            )));
        }
        self.core.time = time;
        self.core.stale = true;
        Ok(())
    }

    /// `fmi2SetContinuousStates`: sets all states or, after a failure, none.
    pub(crate) fn set_continuous_states(&mut self, values: &[f64]) -> Result<(), Failure> {
        let states = &self.interface.states;
        check_length("states", values.len(), states.len())?;
        for (state, value) in states.iter().zip(values) {
            if !value.is_finite() {
                let name = &self.interface.reals[state.state].name;
                return Err(Failure::Discard(format!(
                    "state {name} = {value}, expected a finite number"
                )));
            }
        }
        self.interface.write_states(&mut self.core.model, values);
        self.core.stale = true;
        Ok(())
    }

    /// `fmi2GetContinuousStates`.
    pub(crate) fn get_continuous_states(&mut self, values: &mut Room<f64>) -> Result<(), Failure> {
        check_length("states", values.len(), self.interface.states.len())?;
        self.refresh()?;
        for (state, value) in self.interface.states.iter().zip(values) {
            value.write(*(self.interface.reals[state.state].field)(&mut self.core.model));
        }
        Ok(())
    }

    /// `fmi2GetDerivatives`.
    pub(crate) fn get_derivatives(&mut self, values: &mut Room<f64>) -> Result<(), Failure> {
        check_length("derivatives", values.len(), self.interface.states.len())?;
        self.refresh()?;
        for (state, value) in self.interface.states.iter().zip(values) {
            value.write(*(self.interface.reals[state.derivative].field)(&mut self.core.model));
        }
        Ok(())
    }

    /// `fmi2GetNominalsOfContinuousStates`.
    pub(crate) fn get_nominals(&self, values: &mut Room<f64>) -> Result<(), Failure> {
        check_length("nominal values", values.len(), self.interface.states.len())?;
        for (state, value) in self.interface.states.iter().zip(values) {
            value.write(state.nominal);
        }
        Ok(())
    }

    /// `fmi2GetEventIndicators`.
    pub(crate) fn get_event_indicators(&mut self, values: &mut Room<f64>) -> Result<(), Failure> {
        let expected = self.interface.event_indicators.unwrap_or_default();
        check_length("event indicators", values.len(), expected)?;
        self.refresh()?;
        self.core.model.event_indicators(self.core.time, filled(values, 0.0));
        Ok(())
    }
}
