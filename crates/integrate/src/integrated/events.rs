//! Events: event mode, and the iteration of the discrete states.

use fmu_description::number::seconds;
use slave::{CallError, EventInfo, Events};

use super::{Integrated, Mode, failed};

/// The most iterations of one event.
const ITERATIONS: usize = 1000;

impl Integrated {
    /// Enters event mode at the present time, unless the FMU is in event mode.
    pub(super) fn enter_event(&mut self) -> Result<(), CallError> {
        self.point.event = false;
        if self.point.mode == Mode::Continuous {
            self.instance.enter_event_mode()?;
            self.point.mode = Mode::Event;
        }
        Ok(())
    }

    /// Iterates the event and enters continuous-time mode; stays in event mode if the FMU requests the end. It is an
    /// error if the discrete states still change after 1000 iterations.
    pub(super) fn settle(&mut self) -> Result<(), CallError> {
        let mut iterations = 0;
        while self.update_discrete_states()?.discrete_states_need_update && !self.point.ends {
            iterations += 1;
            if iterations == ITERATIONS {
                let time = seconds(self.point.time);
                return Err(failed(format!(
                    "stops at t = {time} s: the discrete states of an event still change after \
                     {ITERATIONS} iterations"
                )));
            }
        }
        if self.point.ends { Ok(()) } else { self.leave_event_mode() }
    }
}

impl Events for Integrated {
    fn next_event(&mut self) -> Result<Option<f64>, CallError> {
        Ok(self.point.next_event)
    }

    fn enter_event_mode(&mut self) -> Result<(), CallError> {
        // The call also makes clocks tick, in event mode too.
        if self.point.mode == Mode::Continuous || !self.clocks.is_empty() {
            self.instance.enter_event_mode()?;
        }
        (self.point.event, self.point.mode) = (false, Mode::Event);
        Ok(())
    }

    fn update_discrete_states(&mut self) -> Result<EventInfo, CallError> {
        let info = self.instance.update_discrete_states()?;
        self.nominals_changed |= info.nominals_changed;
        self.point.ends |= info.terminate_simulation;
        self.point.next_event = info.next_event_time;
        Ok(info)
    }

    fn leave_event_mode(&mut self) -> Result<(), CallError> {
        self.instance.enter_continuous_time_mode()?;
        self.point.mode = Mode::Continuous;
        // Not all FMUs report that an event changed the states.
        if !self.states.is_empty() {
            self.instance.get_continuous_states(&mut self.states)?;
        }
        self.point.input_changed = false;
        if !self.indicators.is_empty() {
            self.instance.get_event_indicators(&mut self.indicators)?;
            check_indicators(self.point.time, &self.indicators)?;
        }
        if std::mem::take(&mut self.nominals_changed) {
            let scale = self.scale()?;
            self.stepper.set_scale(scale);
        }
        self.stepper.restart();
        Ok(())
    }
}

/// Returns an error if an indicator is NaN, which has no sign.
pub(super) fn check_indicators(time: f64, indicators: &[f64]) -> Result<(), CallError> {
    match indicators.iter().position(|indicator| indicator.is_nan()) {
        None => Ok(()),
        Some(index) => {
            let (number, time) = (index + 1, seconds(time));
            Err(failed(format!("stops: event indicator {number} is NaN at t = {time} s")))
        }
    }
}
