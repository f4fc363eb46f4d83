//! A filter with the unknown inputs that it decouples, exactly or as random walks.

use control::detection::{DetectionFilter, detection_filter, mean_after_step, mean_of_constant};
use control::{Domain, Error, StateSpace};
use nalgebra::{DMatrix, DVector};

use crate::assess::detection::largest;
use crate::assess::detection::prediction::whole;
use crate::assess::detection::problem::Problem;
use crate::plant::fixed_mode::shown;
use plant_file::PlantFile;

/// Time constants of the slowest mode after which a mean has settled.
const SETTLED: f64 = 15.0;
/// The most samples of a response that are computed.
const MOST_SAMPLES: usize = 20_000;
/// A constant fault leaves no trace if its steady mean is at most this part of its largest mean, or, with a further
/// input decoupled, of its steady mean without.
const NO_TRACE: f64 = 1e-6;

/// A filter of residuals.
#[derive(Clone)]
pub(super) struct Decoupling {
    pub(super) filter: DetectionFilter,
    /// The number of states of the plant with the random walks.
    pub(super) states: usize,
    /// Each decoupled input, and whether it is decoupled exactly.
    pub(super) inputs: Vec<(usize, bool)>,
}

impl Decoupling {
    /// Returns the filter that decouples nothing.
    pub(super) fn without(problem: &Problem) -> Result<Self, Error> {
        let decoupling = attempt(problem, Vec::new())?;
        decoupling
            .ok_or(Error::NotConverged { what: "the filter without unknown inputs", iterations: 0 })
    }

    /// Returns the filter that also decouples `input`, exactly or as a random walk; None if there is none.
    pub(super) fn with(
        &self,
        problem: &Problem,
        input: usize,
        exact: bool,
    ) -> Result<Option<Self>, Error> {
        let mut inputs = self.inputs.clone();
        inputs.push((input, exact));
        match attempt(problem, inputs) {
            Err(Error::NotDetectable { .. } | Error::Unweighted { .. }) => Ok(None),
            other => other,
        }
    }

    pub(super) fn has(&self, input: usize) -> bool {
        self.inputs.iter().any(|(decoupled, _)| *decoupled == input)
    }
}

fn attempt(problem: &Problem, inputs: Vec<(usize, bool)>) -> Result<Option<Decoupling>, Error> {
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
    Ok(filter.map(|filter| Decoupling { filter, states, inputs }))
}

impl Problem {
    /// Returns the filter for all faults, which decouples each disturbance, exactly if possible, otherwise as a random
    /// walk by its bound. An error names a disturbance that cannot be decoupled.
    pub(super) fn base(&self, file: &PlantFile<'_>) -> Result<Decoupling, crate::Error> {
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
            if let Some(next) = decoupling.with(self, input, true).map_err(refuse)? {
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
            decoupling = decoupling.with(self, input, false).map_err(refuse)?.ok_or_else(|| {
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

    /// Returns for each fault the length of the steady mean of the residuals of `base` after a step by its size; an
    /// error names a fault whose steady mean is negligible.
    pub(super) fn shifts(
        &self,
        file: &PlantFile<'_>,
        base: &Decoupling,
    ) -> Result<Vec<f64>, crate::Error> {
        let place = |fault: usize| &file.faults[fault].place;
        let shift = |fault: usize| {
            let refuse = |error: Error| file.error_at(place(fault), error.to_string());
            let at = self.fault_at(fault);
            let steady = self.steady_mean(base, at).map_err(refuse)?.norm();
            let means = self.means(base, at).map_err(refuse)?;
            if steady <= NO_TRACE * largest(&means) || steady <= 0.0 {
                let name = &self.names[at];
                let message = format!(
                    "a constant fault `{name}` leaves no trace in the residuals: the measurements cannot \
                     tell it from the disturbances or from a motion of the states"
                );
                return Err(file.error_at(place(fault), message).into());
            }
            Ok(steady)
        };
        self.faults.clone().map(shift).collect()
    }

    /// Returns the filter for `fault`: `base` that also decouples each of `others` in turn, exactly or else as a random
    /// walk, except those whose decoupling leaves no trace of `fault`. `shift`: the length of the steady mean of
    /// `fault` in `base`.
    pub(super) fn isolating(
        &self,
        base: &Decoupling,
        fault: usize,
        others: &[usize],
        shift: f64,
    ) -> Result<Decoupling, Error> {
        let mut decoupling = base.clone();
        for &other in others {
            for exact in [true, false] {
                let next = decoupling.with(self, self.fault_at(other), exact)?;
                let Some(next) = next else { continue };
                if self.steady_mean(&next, self.fault_at(fault))?.norm() > NO_TRACE * shift {
                    decoupling = next;
                    break;
                }
            }
        }
        Ok(decoupling)
    }

    fn effect(&self, decoupling: &Decoupling, input: usize) -> Result<StateSpace, Error> {
        decoupling.filter.effect(&self.inputs[input].extended(decoupling.states))
    }

    /// Returns the mean of the residuals long after a step of an input by its size.
    pub(super) fn steady_mean(
        &self,
        decoupling: &Decoupling,
        input: usize,
    ) -> Result<DVector<f64>, Error> {
        let size = self.sizes[input].unwrap_or(1.0);
        Ok(mean_of_constant(&self.effect(decoupling, input)?, self.period)? * size)
    }

    /// Returns the means of the residuals, residuals x samples, after a step of an input by its size, until they are
    /// settled; at least 2 and at most [`MOST_SAMPLES`] samples.
    pub(super) fn means(
        &self,
        decoupling: &Decoupling,
        input: usize,
    ) -> Result<DMatrix<f64>, Error> {
        let size = self.sizes[input].unwrap_or(1.0);
        let decay = self.decay(&decoupling.filter.generator.a)?;
        let samples = whole(SETTLED / (decay * self.period)).clamp(2, MOST_SAMPLES);
        Ok(mean_after_step(&self.effect(decoupling, input)?, self.period, samples)? * size)
    }

    /// Returns the decay rate in 1/s of the slowest of some filters.
    pub(super) fn slowest_decay<'a>(
        &self,
        filters: impl Iterator<Item = &'a Decoupling>,
    ) -> Result<f64, Error> {
        filters
            .map(|decoupling| self.decay(&decoupling.filter.generator.a))
            .try_fold(f64::INFINITY, |least, decay| Ok(least.min(decay?)))
    }
}
