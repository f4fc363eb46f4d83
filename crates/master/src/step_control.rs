//! Step control: accepts or rejects a step and chooses the size of the next one. A rejected step is
//! repeated from its start; for controls that reject, every slave must be able to restore its state.

use serde::{Deserialize, Serialize};

use crate::algorithm::{Algorithm, Extrapolation, StepControl};
use crate::coupling::Coupler;
use crate::drive::just_before;
use crate::engine::{Ending, Engine, SavedState, Swept};
use crate::error::{SystemError, contradiction};
use crate::exchange::Reals;
use crate::grid::{Grid, size_between};
use crate::signal::{near, reached};
use crate::system::{Port, System};
use solve::{Bond, EnergyControl, ErrorControl, ForwardControl, Scale, SizeBounds, Verdict};

/// The state of the step control, which is part of a checkpoint.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) enum Controller {
    Fixed,
    Error(ErrorControl),
    Forward(ForwardControl),
    Energy(EnergyControl),
}

/// The step control of a simulation.
pub(crate) struct SizeControl {
    kind: StepControl,
    pub(crate) controller: Controller,
    /// Size of the next step in s.
    pub(crate) size: f64,
    pub(crate) scale: Scale,
    /// For each power bond, the indices of the outputs at the other ends of its connections.
    bonds: Vec<(usize, usize)>,
    /// Order of the coupling method, for the comparison of a whole step with two half steps.
    order: i32,
    /// Errors of the extrapolated outputs, for the estimate of the step error.
    errors: Vec<f64>,
    /// The extrapolated outputs at the end of a step.
    predicted: Vec<f64>,
    /// The values of the power bonds at the end of a step.
    states: Vec<Bond>,
    /// State and time at the start of a step that may be repeated.
    start: SavedState,
    /// The connected values after one whole step, for comparison with the values after two half steps.
    whole: Vec<f64>,
}

/// The step to make next: its end and its size in s. The size may differ from end minus start by rounding; see
/// [`size_between`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlannedStep {
    pub(crate) end: f64,
    pub(crate) size: f64,
}

impl PlannedStep {
    pub(crate) fn between(start: f64, end: f64) -> Self {
        Self { end, size: size_between(start, end) }
    }
}

/// A completed step.
pub(crate) struct StepOutcome {
    /// The end of the step in s.
    pub(crate) end: f64,
    /// The slave that requested the end of the simulation.
    pub(crate) ending: Option<Ending>,
}

/// Slot of the FMU states to which a rejected step returns.
const SLOT: usize = 1;

/// Returns the magnitude of a variable: its `nominal`, or 1.
pub(crate) fn nominal(system: &System, port: Port) -> f64 {
    system.variable(port).kind.as_real().and_then(|real| real.nominal).unwrap_or(1.0)
}

impl SizeControl {
    pub(crate) fn new(
        system: &System,
        reals: &Reals,
        algorithm: &Algorithm,
    ) -> Result<Self, SystemError> {
        let order = reals.order();
        // The order of the extrapolation itself, even if a slave only takes held inputs.
        let extrapolation = match algorithm.extrapolation {
            Extrapolation::Hold => 1.0,
            Extrapolation::Limited | Extrapolation::Linear => 2.0,
            Extrapolation::Quadratic => 3.0,
        };
        let bounds =
            SizeBounds { smallest: algorithm.smallest_step, largest: algorithm.largest_step };
        let (relative, absolute) = (algorithm.relative_tolerance, algorithm.absolute_tolerance);
        let nominals: Vec<f64> = reals.ports().iter().map(|&port| nominal(system, port)).collect();
        let bonds = bonds(system, reals, algorithm)?;
        let powers: Vec<f64> =
            bonds.iter().map(|&(first, second)| nominals[first] * nominals[second]).collect();
        let controller = match algorithm.control {
            StepControl::Fixed => Controller::Fixed,
            StepControl::Doubling => {
                Controller::Error(ErrorControl::new(bounds, f64::from(order) + 1.0))
            }
            StepControl::Embedded => Controller::Error(ErrorControl::new(bounds, extrapolation)),
            StepControl::Increment => Controller::Forward(ForwardControl::new(bounds, 1.0)),
            StepControl::Energy => Controller::Energy(EnergyControl::new(
                bounds,
                extrapolation,
                relative,
                absolute,
                &powers,
            )),
        };
        let count = nominals.len();
        Ok(Self {
            kind: algorithm.control,
            controller,
            size: algorithm.step,
            scale: Scale::new(relative, absolute, nominals),
            bonds,
            order: i32::from(order),
            errors: vec![0.0; count],
            predicted: vec![0.0; count],
            states: Vec::with_capacity(powers.len()),
            start: SavedState::new(SLOT),
            whole: Vec::with_capacity(count),
        })
    }

    /// Plans the next step. If all slaves take steps of any size, the step ends where a signal or a fault starts, ends
    /// or has a kink, and at known events.
    #[inline]
    pub(crate) fn plan(&self, engine: &mut Engine) -> PlannedStep {
        if self.kind == StepControl::Fixed {
            let (end, size) = engine.grid.next();
            return match engine.earlier_end(engine.grid.time, end) {
                None => PlannedStep { end, size },
                Some(end) => PlannedStep::between(engine.grid.time, end),
            };
        }
        let (time, end) = (engine.grid.time, engine.grid.end_of(self.size));
        let end = engine.next_breaks(time + 1e-9 * self.size).fold(end, f64::min);
        PlannedStep::between(time, engine.earlier_end(time, end).unwrap_or(end))
    }

    /// Returns the end of a step from `time`, in s, in a run whose steps vary; `None` if all steps
    /// end on the grid.
    pub(crate) fn varied_end(&self, time: f64) -> Option<f64> {
        let varies = self.kind != StepControl::Fixed;
        // A size below the rounding of the time would end at the time itself.
        let mut size = self.size;
        while varies && reached(time, time + size) {
            size *= 2.0;
        }
        varies.then_some(time + size)
    }

    /// Makes the planned step. If steps may be repeated, makes a shorter step if slaves do not complete the planned one
    /// or if its error is above the tolerance.
    #[inline]
    pub(crate) fn step(
        &mut self,
        engine: &mut Engine,
        coupler: &mut Coupler,
        planned: PlannedStep,
    ) -> Result<StepOutcome, SystemError> {
        let PlannedStep { end, size } = planned;
        if engine.repeats {
            return self.step_within_tolerance(engine, coupler, end);
        }
        let swept = engine.sweep(engine.grid.time, size)?;
        if self.kind != StepControl::Fixed {
            self.update_size(&engine.exchange.reals, size);
        }
        let ending = if let Swept::Ended(ending) = swept { Some(ending) } else { None };
        Ok(StepOutcome { end, ending })
    }

    /// Attempts a step towards `end`; repeats it with a smaller size until it is accepted.
    fn step_within_tolerance(
        &mut self,
        engine: &mut Engine,
        coupler: &mut Coupler,
        mut end: f64,
    ) -> Result<StepOutcome, SystemError> {
        let time = engine.grid.time;
        engine.save(time, &mut self.start)?;
        loop {
            let size = size_between(time, end);
            let (error, swept) = match self.kind {
                StepControl::Doubling => self.step_by_halves(engine, coupler, time, size)?,
                _ => self.step_and_estimate(engine, coupler, time, size)?,
            };
            end = match swept {
                Swept::Ended(ending) => {
                    return step_to_ending(engine, coupler, &self.start, time, ending);
                }
                // A partial step has no error estimate.
                Swept::Part(reached) => reached,
                Swept::Whole => match self.judge(size, error) {
                    // With rounded times, the retry may be as long as the last attempt.
                    Verdict::Rejected { retry } if time + retry < end => time + retry,
                    // A signal or fault that changes at the start makes values jump in a step of any size.
                    Verdict::Rejected { .. } | Verdict::Stuck if is_break(engine, time) => {
                        engine.exchange.reals.clear_history();
                        self.clear_history();
                        return Ok(StepOutcome { end, ending: None });
                    }
                    Verdict::Rejected { .. } | Verdict::Stuck => {
                        return Err(SystemError::Stuck { time, size, error });
                    }
                    Verdict::Accepted { .. } => {
                        self.update_size(&engine.exchange.reals, size);
                        return Ok(StepOutcome { end, ending: None });
                    }
                },
            };
            engine.restore(&self.start)?;
        }
    }

    /// Makes one whole step and then two halves, keeps the result of the halves, and returns the error
    /// estimated from both results.
    fn step_by_halves(
        &mut self,
        engine: &mut Engine,
        coupler: &mut Coupler,
        time: f64,
        size: f64,
    ) -> Result<(f64, Swept), SystemError> {
        let whole = coupler.step(engine, time, size)?;
        if whole != Swept::Whole {
            return Ok((0.0, whole));
        }
        self.whole.clear();
        self.whole.extend_from_slice(engine.exchange.reals.outputs());
        engine.restore(&self.start)?;
        let middle = time + 0.5 * size;
        for (start, size) in [(time, middle - time), (middle, size_between(middle, time + size))] {
            let half = coupler.step(engine, start, size)?;
            if half != Swept::Whole {
                return Ok((0.0, half));
            }
        }
        let halves = engine.exchange.reals.outputs();
        Ok((self.doubling_error(halves, &self.whole), Swept::Whole))
    }

    /// Makes one step and returns the error estimated from the input extrapolation; 0 for all controls but
    /// [`StepControl::Embedded`].
    fn step_and_estimate(
        &mut self,
        engine: &mut Engine,
        coupler: &mut Coupler,
        time: f64,
        size: f64,
    ) -> Result<(f64, Swept), SystemError> {
        let swept = coupler.step(engine, time, size)?;
        if self.kind != StepControl::Embedded {
            return Ok((0.0, swept));
        }
        let error = self.extrapolation_error(&engine.exchange.reals, size);
        Ok((error, swept))
    }

    /// Returns the error of a step as a multiple of the tolerance. `halves` are the connected
    /// values after two half steps and `whole` those after one whole step: Richardson's estimate
    /// `|halves - whole| / (2^p - 1)`.
    pub(crate) fn doubling_error(&self, halves: &[f64], whole: &[f64]) -> f64 {
        self.scale.distance(halves, whole) / (2_f64.powi(self.order) - 1.0)
    }

    /// Returns the error of the extrapolation over the last step of `size` s, as a multiple of the
    /// tolerance.
    pub(crate) fn extrapolation_error(&mut self, reals: &Reals, size: f64) -> f64 {
        self.predict(reals, size);
        self.scale.distance(reals.outputs(), &self.predicted)
    }

    fn predict(&mut self, reals: &Reals, size: f64) {
        reals.extrapolation_errors(size, &mut self.errors);
        for ((predicted, error), value) in
            self.predicted.iter_mut().zip(&self.errors).zip(reals.outputs())
        {
            *predicted = value - error;
        }
    }

    /// Accepts or rejects a step of `size` s with the error `error`, and sets the size of the next step or
    /// of the repetition. Controls without an error estimate accept every step.
    pub(crate) fn judge(&mut self, size: f64, error: f64) -> Verdict {
        let verdict = match &mut self.controller {
            Controller::Error(control) => control.judge(size, error),
            _ => Verdict::Accepted { next: size },
        };
        match verdict {
            Verdict::Accepted { next } => self.size = next,
            Verdict::Rejected { retry } => self.size = retry,
            Verdict::Stuck => {}
        }
        verdict
    }

    /// Chooses the next size after a step of `size` s for [`StepControl::Increment`] and
    /// [`StepControl::Energy`], which never reject a step.
    pub(crate) fn update_size(&mut self, reals: &Reals, size: f64) {
        match self.kind {
            StepControl::Increment => {
                let measure = self.scale.distance(reals.outputs(), &reals.trace.start);
                if let Controller::Forward(control) = &mut self.controller {
                    self.size = control.next(size, measure);
                }
            }
            StepControl::Energy => {
                self.predict(reals, size);
                let outputs = reals.outputs();
                self.states.clear();
                for &(first, second) in &self.bonds {
                    self.states.push(Bond {
                        first: (self.predicted[first], outputs[first]),
                        second: (self.predicted[second], outputs[second]),
                    });
                }
                if let Controller::Energy(control) = &mut self.controller {
                    self.size = control.next(size, &self.states);
                }
            }
            _ => {}
        }
    }

    /// Clears the history of the step control after an event.
    pub(crate) fn clear_history(&mut self) {
        match &mut self.controller {
            Controller::Fixed => {}
            Controller::Error(control) => control.forget(),
            Controller::Forward(control) => control.forget(),
            Controller::Energy(control) => control.forget(),
        }
    }
}

/// Repeats the step from `time` in s and the state `start` up to the end of the run that a slave requested in it.
pub(crate) fn step_to_ending(
    engine: &mut Engine,
    coupler: &mut Coupler,
    start: &SavedState,
    time: f64,
    ending: Ending,
) -> Result<StepOutcome, SystemError> {
    engine.restore(start)?;
    if ending.time > time {
        coupler.step(engine, time, size_between(time, ending.time))?;
    }
    Ok(StepOutcome { end: ending.time, ending: Some(ending) })
}

/// Whether a signal or a fault on a connection changes at `time`, in s.
fn is_break(engine: &Engine, time: f64) -> bool {
    engine.next_breaks(just_before(time)).any(|next| near(next, time))
}

/// Number of steps between two checks whether the run can reach its stop time.
const PACE_INTERVAL: u32 = 1000;
/// Limits of the check: the mean size of the steps as a multiple of the smallest step, and the
/// estimated number of remaining steps. The run ends if the mean is smaller and the number larger.
const SMALL: f64 = 10.0;
const MOST_REMAINING_STEPS: f64 = 1e7;

/// Checks whether steps of variable size are large enough to reach the end of the run.
pub(crate) struct Pace {
    /// The smallest step in s that the step control may choose.
    smallest: f64,
    /// Number of steps since the last check.
    steps: u32,
    length: f64,
}

impl Pace {
    pub(crate) fn new(smallest: f64) -> Self {
        Self { smallest, steps: 0, length: 0.0 }
    }

    /// Counts a step of `size` s that ended at the time of `grid`. Returns an error if the last steps are so close to
    /// the smallest one that the run cannot reach its end.
    pub(crate) fn check(&mut self, size: f64, grid: &Grid) -> Result<(), SystemError> {
        (self.steps, self.length) = (self.steps + 1, self.length + size);
        if self.steps < PACE_INTERVAL {
            return Ok(());
        }
        let (steps, length, smallest) = (self.steps, self.length, self.smallest);
        (self.steps, self.length) = (0, 0.0);
        let mean = length / f64::from(steps);
        let left = grid.stop.map_or(0.0, |stop| (stop - grid.time) / mean);
        if mean > SMALL * smallest || left < MOST_REMAINING_STEPS {
            return Ok(());
        }
        Err(SystemError::TooManySteps { steps, length, smallest, time: grid.time, left })
    }
}

/// Returns the indices of the outputs that are connected to the inputs of each power bond; an error if an
/// input is not connected to a Real output.
fn bonds(
    system: &System,
    reals: &Reals,
    algorithm: &Algorithm,
) -> Result<Vec<(usize, usize)>, SystemError> {
    let source = |port: Port| {
        let connection = system.source(port);
        let output = connection.and_then(|connection| reals.output(connection.from));
        output.ok_or_else(|| {
            let name = system.name(port);
            contradiction(format!(
                "a power bond needs two connected Real inputs, and {name} is none"
            ))
        })
    };
    algorithm.bonds.iter().map(|bond| Ok((source(bond.first)?, source(bond.second)?))).collect()
}
