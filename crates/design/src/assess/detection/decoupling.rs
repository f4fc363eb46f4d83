//! A residual filter with the unknown inputs that it decouples, exactly or as random walks.

use control::detection::{DetectionFilter, detection_filter, mean_after_step, mean_of_constant};
use control::{Domain, Error, StateSpace};
use nalgebra::{DMatrix, DVector};

use crate::assess::detection::largest;
use crate::assess::detection::prediction::whole;
use crate::assess::detection::problem::Problem;
use crate::plant::fixed_mode::shown;
use plant_file::PlantFile;

/// Number of time constants of the slowest mode after which the mean of the residuals has settled.
const SETTLED: f64 = 15.0;
/// Largest number of samples of a response of the residuals that are computed.
const MOST_SAMPLES: usize = 20_000;
/// Largest steady mean of the residuals that counts as no trace of a constant fault, relative to the largest mean or,
/// if other faults are decoupled, to the steady mean without this decoupling.
const NO_TRACE: f64 = 1e-6;

/// A filter of residuals.
#[derive(Clone)]
pub(super) struct Decoupling<'a> {
    pub(super) problem: &'a Problem,
    pub(super) filter: DetectionFilter,
    /// The number of states of the plant with the random walks.
    states: usize,
    /// Position of each decoupled input, and whether the input is decoupled exactly.
    pub(super) inputs: Vec<(usize, bool)>,
}

impl<'a> Decoupling<'a> {
    /// Returns the filter that decouples nothing.
    pub(super) fn without(problem: &'a Problem) -> Result<Self, Error> {
        let decoupling = attempt(problem, Vec::new())?;
        decoupling
            .ok_or(Error::NotConverged { what: "the filter without unknown inputs", iterations: 0 })
    }

    /// Returns the filter that also decouples `input`, exactly or as a random walk; None if there is none.
    fn with(&self, input: usize, exact: bool) -> Result<Option<Self>, Error> {
        let mut inputs = self.inputs.clone();
        inputs.push((input, exact));
        match attempt(self.problem, inputs) {
            Err(Error::NotDetectable { .. } | Error::Unweighted { .. }) => Ok(None),
            other => other,
        }
    }

    pub(super) fn has(&self, input: usize) -> bool {
        self.inputs.iter().any(|(decoupled, _)| *decoupled == input)
    }

    /// Returns for each fault the norm of the steady mean of the residuals after a step by its size; an error names a
    /// fault whose steady mean is negligible.
    pub(super) fn shifts(&self, file: &PlantFile<'_>) -> Result<Vec<f64>, crate::Error> {
        let place = |fault: usize| &file.faults[fault].place;
        let shift = |fault: usize| {
            let refuse = |error: Error| file.error_at(place(fault), error.to_string());
            let at = self.problem.fault_at(fault);
            let steady = self.steady_mean(at).map_err(refuse)?.norm();
            let means = self.means(at).map_err(refuse)?;
            if steady <= NO_TRACE * largest(&means) || steady <= 0.0 {
                let name = &self.problem.names[at];
                let message = format!(
                    "a constant fault `{name}` leaves no trace in the residuals: the measurements cannot \
                     tell it from the disturbances or from a motion of the states"
                );
                return Err(file.error_at(place(fault), message).into());
            }
            Ok(steady)
        };
        self.problem.faults.clone().map(shift).collect()
    }

    /// Returns the filter for `fault`: this filter, extended to decouple each of `others` (exactly, else as a random
    /// walk) unless that leaves no trace of `fault`. `shift`: the norm of the steady mean of `fault` in this filter.
    pub(super) fn isolating(
        &self,
        fault: usize,
        others: &[usize],
        shift: f64,
    ) -> Result<Self, Error> {
        let problem = self.problem;
        let mut decoupling = self.clone();
        for &other in others {
            for exact in [true, false] {
                let next = decoupling.with(problem.fault_at(other), exact)?;
                let Some(next) = next else { continue };
                if next.steady_mean(problem.fault_at(fault))?.norm() > NO_TRACE * shift {
                    decoupling = next;
                    break;
                }
            }
        }
        Ok(decoupling)
    }

    fn effect(&self, input: usize) -> Result<StateSpace, Error> {
        self.filter.effect(&self.problem.inputs[input].extended(self.states))
    }

    /// Returns the mean of the residuals long after a step of an input by its size.
    pub(super) fn steady_mean(&self, input: usize) -> Result<DVector<f64>, Error> {
        let size = self.problem.sizes[input].unwrap_or(1.0);
        Ok(mean_of_constant(&self.effect(input)?, self.problem.period)? * size)
    }

    /// Returns the means of the residuals, residuals x samples, after a step of an input by its size, until they are
    /// settled; at least 2 and at most [`MOST_SAMPLES`] samples.
    pub(super) fn means(&self, input: usize) -> Result<DMatrix<f64>, Error> {
        let (size, period) = (self.problem.sizes[input].unwrap_or(1.0), self.problem.period);
        let samples = whole(SETTLED / (self.decay()? * period)).clamp(2, MOST_SAMPLES);
        Ok(mean_after_step(&self.effect(input)?, period, samples)? * size)
    }

    /// Returns the decay rate in 1/s of the slowest eigenvalue of the filter.
    pub(super) fn decay(&self) -> Result<f64, Error> {
        self.problem.decay(&self.filter.generator.a)
    }
}

fn attempt(problem: &Problem, inputs: Vec<(usize, bool)>) -> Result<Option<Decoupling<'_>>, Error> {
    let mut plant = problem.plant.clone();
    for &(input, _) in inputs.iter().filter(|(_, exact)| !exact) {
        // The random walk moves by the size of the input within a time constant of the loop.
        let size = problem.sizes[input].unwrap_or(1.0);
        let intensity = size * size * problem.rate * plant.domain.step();
        let entry = problem.inputs[input].extended(plant.a.nrows());
        plant = plant.with_random_walk(&entry, intensity)?;
    }
    let states = plant.a.nrows();
    let exact: Vec<_> = inputs
        .iter()
        .filter(|(_, exact)| *exact)
        .map(|(input, _)| problem.inputs[*input].extended(states))
        .collect();
    let filter = detection_filter(&plant, &exact)?;
    Ok(filter.map(|filter| Decoupling { problem, filter, states, inputs }))
}

impl Problem {
    /// Returns the filter for all faults, which decouples each disturbance: exactly if possible, otherwise as a random
    /// walk of the size of its bound. An error names a disturbance that cannot be decoupled.
    pub(super) fn base(&self, file: &PlantFile<'_>) -> Result<Decoupling<'_>, crate::Error> {
        let refuse = |error: Error| {
            let request = file.detection.as_ref();
            let stated = request.and_then(|request| request.process_noise.as_ref());
            if let (Error::Unweighted { eigenvalue, .. }, Some(stated)) = (&error, stated) {
                let value = match self.plant.domain {
                    Domain::Continuous => *eigenvalue,
                    Domain::Sampled { period } => eigenvalue.ln() / period,
                };
                let message = format!(
                    "the residuals need a filter that corrects every state, and a mode of the plant at the \
                     limit of stability ({} 1/s) gets no noise: expected numbers above 0 for the states in \
                     which it shows, or no `process_noise`, which finds enough",
                    shown(value)
                );
                return file.error_at(&stated.place, message);
            }
            let place = request.map_or(0..0, |request| request.place.clone());
            file.error_at(&place, error.to_string())
        };
        let mut decoupling = Decoupling::without(self).map_err(refuse)?;
        for (input, disturbance) in file.disturbances.iter().enumerate() {
            if let Some(next) = decoupling.with(input, true).map_err(refuse)? {
                decoupling = next;
                continue;
            }
            if disturbance.bound.is_none() {
                let message = format!(
                    "the measurements do not show disturbance `{}` at once, so that it cannot be removed \
                     exactly (rank C E = rank E, stable zeros): expected `bound`, its largest value, for an \
                     approximation",
                    disturbance.name
                );
                return Err(file.error_at(&disturbance.place, message).into());
            }
            decoupling = decoupling.with(input, false).map_err(refuse)?.ok_or_else(|| {
                let message = format!(
                    "the measurements cannot tell disturbance `{}` from a motion of the states, or no \
                     residual is left without it; expected more measurements, or fewer disturbances",
                    disturbance.name
                );
                file.error_at(&disturbance.place, message)
            })?;
        }
        Ok(decoupling)
    }
}
