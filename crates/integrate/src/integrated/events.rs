//! Events: their iteration, and changes of variables that need one.

use fmu_description::number::seconds;
use slave::{CallError, EventInfo};

use super::{Integrated, Mode, failed};

/// The most iterations of one event.
const ITERATIONS: usize = 1000;

impl Integrated {
    /// Enters event mode at the present point.
    pub(super) fn enter_event(&mut self) -> Result<(), CallError> {
        self.instance.enter_event_mode()?;
        self.point.mode = Mode::Event;
        Ok(())
    }

    /// Iterates the event and enters continuous-time mode, unless the FMU requests the end.
    pub(super) fn settle(&mut self) -> Result<(), CallError> {
        let mut nominals_changed = false;
        let mut info = EventInfo { discrete_states_need_update: true, ..EventInfo::default() };
        let mut iterations = 0;
        while info.discrete_states_need_update {
            if iterations == ITERATIONS {
                let time = seconds(self.point.time);
                return Err(failed(format!(
                    "stops at t = {time} s: the discrete states of an event still change after \
                     {ITERATIONS} iterations"
                )));
            }
            iterations += 1;
            info = self.instance.update_discrete_states()?;
            nominals_changed |= info.nominals_changed;
            if info.terminate_simulation {
                self.point.ends = true;
                return Ok(());
            }
        }
        self.point.next_event = info.next_event_time;
        self.instance.enter_continuous_time_mode()?;
        self.point.mode = Mode::Continuous;
        self.read_point()?;
        if nominals_changed {
            let scale = self.scale()?;
            self.stepper.set_scale(scale);
        }
        self.stepper.restart();
        Ok(())
    }

    /// Reads states and event indicators. Not all FMUs say that an event changed the states.
    fn read_point(&mut self) -> Result<(), CallError> {
        if !self.states.is_empty() {
            self.instance.get_continuous_states(&mut self.states)?;
        }
        self.read_indicators()
    }

    /// Reads the event indicators at the present point.
    pub(super) fn read_indicators(&mut self) -> Result<(), CallError> {
        self.point.input_changed = false;
        if self.indicators.is_empty() {
            return Ok(());
        }
        self.instance.get_event_indicators(&mut self.indicators)?;
        check_indicators(self.point.time, &self.indicators)
    }
}

/// Returns an error if an indicator has no sign.
pub(super) fn check_indicators(time: f64, indicators: &[f64]) -> Result<(), CallError> {
    match indicators.iter().position(|indicator| indicator.is_nan()) {
        None => Ok(()),
        Some(index) => {
            let (number, time) = (index + 1, seconds(time));
            Err(failed(format!("stops: event indicator {number} is NaN at t = {time} s")))
        }
    }
}
