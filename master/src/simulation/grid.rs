//! Communication points.

use fmi2::Experiment;

use crate::algorithm::Algorithm;
use crate::error::SystemError;
use crate::system::System;

/// Where the simulation is and where it goes.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    start: f64,
    stop: Option<f64>,
    step: f64,
    /// Points of the grid passed.
    pub(super) count: u64,
    /// Time reached in s.
    pub(super) time: f64,
}

impl Grid {
    /// The grid of a run, which every slave can follow.
    pub(super) fn new(
        system: &System,
        algorithm: &Algorithm,
        experiment: &Experiment,
    ) -> Result<Self, SystemError> {
        let (start, stop, step) = (experiment.start_time, experiment.stop_time, algorithm.step);
        if !(step > 0.0 && step.is_finite()) {
            let (what, rule) = ("the communication step", "more than 0".to_owned());
            return Err(SystemError::Time { what, value: step, rule });
        }
        if let Some(stop) = stop
            && !(stop > start && stop.is_finite())
        {
            let (what, rule) = ("the stop time", "more than the start time".to_owned());
            return Err(SystemError::Time { what, value: stop, rule });
        }
        let grid = Self { start, stop, step, count: 0, time: start };
        grid.check_rigid(system)?;
        Ok(grid)
    }

    /// Slaves that take equal steps only get equal steps.
    fn check_rigid(&self, system: &System) -> Result<(), SystemError> {
        let rigid = system.slaves.iter().find(|(_, slave)| {
            let flags = slave.description().co_simulation.as_ref();
            flags.is_some_and(|flags| !flags.can_handle_variable_communication_step_size)
        });
        let (Some((name, _)), Some(stop)) = (rigid, self.stop) else { return Ok(()) };
        let steps = (stop - self.start) / self.step;
        if (steps - steps.round()).abs() > 1e-6 {
            let rule = format!(
                "a multiple of the communication step {} s, as {name} takes equal steps only",
                self.step
            );
            return Err(SystemError::Time { what: "the stop time", value: stop, rule });
        }
        Ok(())
    }

    pub(super) fn is_finished(&self) -> bool {
        self.stop.is_some_and(|stop| self.time >= stop)
    }

    /// End of a step of `size` s from now: the stop time where that is less, or so near that
    /// nothing sensible would be left.
    pub(super) fn end_of(&self, size: f64) -> f64 {
        let end = self.time + size;
        match self.stop {
            Some(stop) if end > stop - 1e-6 * size => stop,
            _ => end,
        }
    }

    /// End and size of the next step: H, or what is left where that is less.
    #[expect(clippy::cast_precision_loss, reason = "2^53 steps take longer than anyone waits")]
    pub(super) fn next(&self) -> (f64, f64) {
        let begin = self.start + self.count as f64 * self.step;
        let end = self.start + (self.count + 1) as f64 * self.step;
        let rounding = 1e-6 * self.step;
        // After an event the rest of the way to the grid.
        let size = if self.time.total_cmp(&begin).is_eq() { self.step } else { end - self.time };
        match self.stop {
            Some(stop) if end > stop + rounding => (stop, stop - self.time),
            Some(stop) if end > stop - rounding => (stop, size),
            _ => (end, size),
        }
    }

    /// Size of the step from `time` of a slave that makes `multiple` steps of the grid at once: the
    /// size of the common step where that is one, 0 where it has gone on already.
    #[expect(clippy::cast_precision_loss, reason = "2^53 steps take longer than anyone waits")]
    pub(super) fn size_of(&self, multiple: u32, time: f64, size: f64) -> f64 {
        if multiple == 1 {
            return size;
        }
        if !self.count.is_multiple_of(u64::from(multiple)) {
            return 0.0;
        }
        let end = self.start + (self.count + u64::from(multiple)) as f64 * self.step;
        self.stop.map_or(end, |stop| end.min(stop)) - time
    }

    /// The step to `end`, from [`Grid::next`], is done.
    pub(super) fn advance(&mut self, end: f64) {
        self.count += 1;
        self.time = end;
    }

    /// A step to `end` is done, a point of the grid or not.
    pub(super) fn reach(&mut self, end: f64) {
        if end >= self.next().0 {
            self.count += 1;
        }
        self.time = end;
    }
}

/// How many steps of the grid each slave makes at once.
pub(super) fn multiples(system: &System, algorithm: &Algorithm) -> Result<Vec<u32>, SystemError> {
    let count = system.slaves.len();
    if algorithm.multiples.is_empty() {
        return Ok(vec![1; count]);
    }
    match algorithm.multiples.iter().position(|&multiple| multiple == 0) {
        _ if algorithm.multiples.len() != count => Err(SystemError::Algorithm {
            what: format!(
                "the multiples of the step are {}, expected one for each of {count} FMUs",
                algorithm.multiples.len()
            ),
        }),
        Some(slave) => Err(SystemError::Algorithm {
            what: format!(
                "{} steps every 0 communication steps, expected 1 or more",
                system.slaves[slave].0
            ),
        }),
        None => Ok(algorithm.multiples.clone()),
    }
}
