//! Step control: accepts or rejects a step and chooses the size of the next one.

use serde::{Deserialize, Serialize};

use crate::algorithm::{Algorithm, Extrapolation, StepControl};
use crate::error::SystemError;
use crate::exchange::Reals;
use crate::system::{Port, System};
use fmu_description::Kind;
use solve::{Bond, EnergyControl, ErrorControl, ForwardControl, Scale, SizeBounds, Verdict};

/// The state of the step control, which is part of a checkpoint.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) enum Controller {
    Fixed,
    Error(ErrorControl),
    Forward(ForwardControl),
    Energy(EnergyControl),
}

/// The step control of a simulation.
pub(super) struct Control {
    pub(super) kind: StepControl,
    pub(super) controller: Controller,
    /// Size of the next step in s.
    pub(super) size: f64,
    /// The smallest step in s; the number of steps since the last check of their pace, with their
    /// total length.
    pub(super) smallest: f64,
    pub(super) paced: (u32, f64),
    pub(super) scale: Scale,
    /// For each power bond, the outputs at the other ends of its connections.
    bonds: Vec<(usize, usize)>,
    /// Order of the method, used to compare a whole step with two halves.
    order: i32,
    errors: Vec<f64>,
    predicted: Vec<f64>,
    states: Vec<Bond>,
}

/// Number of steps between two checks of the pace.
const PACE_INTERVAL: u32 = 1000;
/// Limits of the check: the mean size of the steps as a multiple of the smallest step, and the
/// estimated number of remaining steps. The run ends if the mean is smaller and the number larger.
const SMALL: f64 = 10.0;
const MOST_REMAINING_STEPS: f64 = 1e7;

/// Returns the magnitude of a variable: its `nominal`, or 1.
pub(super) fn nominal(system: &System, port: Port) -> f64 {
    match &system.variable(port).kind {
        Kind::Real(real) => real.nominal.unwrap_or(1.0),
        _ => 1.0,
    }
}

impl Control {
    pub(super) fn new(
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
                (relative, absolute),
                &powers,
            )),
        };
        let count = nominals.len();
        Ok(Self {
            kind: algorithm.control,
            controller,
            size: algorithm.step,
            smallest: algorithm.smallest_step,
            paced: (0, 0.0),
            scale: Scale::new(relative, absolute, nominals),
            bonds,
            order: i32::from(order),
            errors: vec![0.0; count],
            predicted: vec![0.0; count],
            states: Vec::with_capacity(powers.len()),
        })
    }

    /// Returns the error of a step as a multiple of the tolerance. `halves` are the connected
    /// values after two half steps and `whole` those after one whole step: Richardson's estimate
    /// `|halves - whole| / (2^p - 1)`.
    pub(super) fn doubling_error(&self, halves: &[f64], whole: &[f64]) -> f64 {
        self.scale.distance(halves, whole) / (2_f64.powi(self.order) - 1.0)
    }

    /// Returns the error of the extrapolation over the last step of `size` s, as a multiple of the
    /// tolerance.
    pub(super) fn extrapolation_error(&mut self, reals: &Reals, size: f64) -> f64 {
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

    /// Accepts or rejects a step of `size` s with the error `error`.
    pub(super) fn judge(&mut self, size: f64, error: f64) -> Verdict {
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

    /// Chooses the next size after a step of `size` s, for controls that never reject a step.
    pub(super) fn update_size(&mut self, reals: &Reals, size: f64) {
        match self.kind {
            StepControl::Increment => {
                let measure = self.scale.distance(reals.outputs(), reals.starts());
                if let Controller::Forward(control) = &mut self.controller {
                    self.size = control.next(size, measure);
                }
            }
            StepControl::Energy => {
                self.predict(reals, size);
                let found = reals.outputs();
                self.states.clear();
                for &(first, second) in &self.bonds {
                    self.states.push(Bond {
                        first: (self.predicted[first], found[first]),
                        second: (self.predicted[second], found[second]),
                    });
                }
                if let Controller::Energy(control) = &mut self.controller {
                    self.size = control.next(size, &self.states);
                }
            }
            _ => {}
        }
    }

    /// Checks after a step of `size` s to `time` whether the run can reach `stop`, all in s.
    ///
    /// # Errors
    ///
    /// Returns an error if the last steps are so close to the smallest one that the run cannot
    /// reach its end.
    pub(super) fn check_pace(
        &mut self,
        time: f64,
        size: f64,
        stop: Option<f64>,
    ) -> Result<(), SystemError> {
        self.paced = (self.paced.0 + 1, self.paced.1 + size);
        if self.paced.0 < PACE_INTERVAL {
            return Ok(());
        }
        let (steps, length) = std::mem::take(&mut self.paced);
        let (mean, smallest) = (length / f64::from(steps), self.smallest);
        let left = stop.map_or(0.0, |stop| (stop - time) / mean);
        if mean > SMALL * smallest || left < MOST_REMAINING_STEPS {
            return Ok(());
        }
        Err(SystemError::TooManySteps { steps, length, smallest, time, left })
    }

    /// Clears the history of the step control after an event.
    pub(super) fn clear_history(&mut self) {
        match &mut self.controller {
            Controller::Fixed => {}
            Controller::Error(control) => control.forget(),
            Controller::Forward(control) => control.forget(),
            Controller::Energy(control) => control.forget(),
        }
    }
}

/// Returns the outputs that are connected to the inputs of each power bond.
fn bonds(
    system: &System,
    reals: &Reals,
    algorithm: &Algorithm,
) -> Result<Vec<(usize, usize)>, SystemError> {
    let source = |port: Port| {
        let connection = system.source(port);
        let output = connection.and_then(|connection| reals.output(connection.from));
        output.ok_or_else(|| SystemError::Algorithm {
            what: format!(
                "a power bond needs two connected Real inputs, and {} is none",
                system.name(port)
            ),
        })
    };
    algorithm.bonds.iter().map(|bond| Ok((source(bond.first)?, source(bond.second)?))).collect()
}
