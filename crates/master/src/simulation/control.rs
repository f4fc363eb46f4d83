//! How large the next step is, and whether the last one stands.

use serde::{Deserialize, Serialize};

use crate::algorithm::{Algorithm, Extrapolation, StepControl};
use crate::error::SystemError;
use crate::exchange::Reals;
use crate::system::{Port, System};
use fmu_description::Kind;
use solve::{Bond, EnergyControl, ErrorControl, ForwardControl, Scale, SizeBounds, Verdict};

/// The state of the step control: what a run that goes on later needs.
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
    /// The next step in s.
    pub(super) size: f64,
    /// The smallest step in s, and the steps since the pace was last looked at, with their length.
    pub(super) smallest: f64,
    pub(super) paced: (u32, f64),
    pub(super) scale: Scale,
    /// For each bond the outputs at the other ends of its connections.
    bonds: Vec<(usize, usize)>,
    /// Order of the method: what a whole step and two halves are compared by.
    order: i32,
    errors: Vec<f64>,
    predicted: Vec<f64>,
    states: Vec<Bond>,
}

/// Steps after which their pace is looked at.
const PACED: u32 = 1000;
/// Mean size of these steps in smallest steps up to which a run may be hopeless, and the steps that are
/// left to the stop time from which it is.
const SMALL: f64 = 10.0;
const HOPELESS: f64 = 1e7;

/// Magnitude of a variable: its `nominal`, else 1.
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
        // Of the extrapolation: that of the extrapolation, whatever the slaves make of it.
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

    /// Error of a step whose connected values are `halves` when it is made in halves and `whole`
    /// otherwise, in tolerances: Richardson's estimate `|halves - whole| / (2^p - 1)`.
    pub(super) fn doubling_error(&self, halves: &[f64], whole: &[f64]) -> f64 {
        self.scale.distance(halves, whole) / (2_f64.powi(self.order) - 1.0)
    }

    /// Error of the extrapolation over the last step of `size` s, in tolerances.
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

    /// The verdict of an error control.
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

    /// The next step after one of `size` s, for the controls that repeat nothing.
    pub(super) fn look_back(&mut self, reals: &Reals, size: f64) {
        match self.kind {
            StepControl::Increment => {
                let measure = self.scale.distance(reals.outputs(), reals.begins());
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

    /// A step of `size` s to `time` is done, and the run is to end at `stop`, in s.
    ///
    /// # Errors
    ///
    /// Where the last steps are so near the smallest that the run will not come to its end.
    pub(super) fn check_pace(
        &mut self,
        time: f64,
        size: f64,
        stop: Option<f64>,
    ) -> Result<(), SystemError> {
        self.paced = (self.paced.0 + 1, self.paced.1 + size);
        if self.paced.0 < PACED {
            return Ok(());
        }
        let (steps, length) = std::mem::take(&mut self.paced);
        let (mean, smallest) = (length / f64::from(steps), self.smallest);
        let left = stop.map_or(0.0, |stop| (stop - time) / mean);
        if mean > SMALL * smallest || left < HOPELESS {
            return Ok(());
        }
        Err(SystemError::Crawl { steps, length, smallest, time, left })
    }

    /// After an event the past says nothing.
    pub(super) fn forget(&mut self) {
        match &mut self.controller {
            Controller::Fixed => {}
            Controller::Error(control) => control.forget(),
            Controller::Forward(control) => control.forget(),
            Controller::Energy(control) => control.forget(),
        }
    }
}

/// The outputs that are connected to the inputs of each bond.
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
