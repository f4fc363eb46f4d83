//! A filter with the unknown inputs that it decouples, exactly or as random walks.

use control::detection::{DetectionFilter, detection_filter};
use control::{Domain, Error};

use crate::detection::problem::Problem;

/// A filter of residuals.
#[derive(Clone)]
pub(super) struct Decoupling {
    pub(super) filter: DetectionFilter,
    /// The number of states of the plant with the random walks.
    pub(super) states: usize,
    /// Each decoupled input, and whether it is decoupled exactly.
    inputs: Vec<(usize, bool)>,
}

impl Decoupling {
    /// The filter that decouples nothing.
    pub(super) fn without(problem: &Problem) -> Result<Self, Error> {
        let found = attempt(problem, Vec::new())?;
        found
            .ok_or(Error::NotConverged { what: "the filter without unknown inputs", iterations: 0 })
    }

    /// The filter that also decouples `input`; None if there is none.
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

    /// The decoupled inputs, and whether each is decoupled exactly.
    pub(super) fn inputs(&self) -> &[(usize, bool)] {
        &self.inputs
    }

    pub(super) fn has(&self, input: usize) -> bool {
        self.inputs.iter().any(|(own, _)| *own == input)
    }
}

fn attempt(problem: &Problem, inputs: Vec<(usize, bool)>) -> Result<Option<Decoupling>, Error> {
    let mut plant = problem.plant.clone();
    for &(input, _) in inputs.iter().filter(|(_, exact)| !exact) {
        // It moves by its size within a time constant of the loop.
        let size = problem.sizes[input].unwrap_or(1.0);
        let intensity = size * size * problem.rate;
        let intensity = match plant.domain {
            Domain::Continuous => intensity,
            Domain::Sampled { period } => intensity * period,
        };
        let own = problem.inputs[input].extended(plant.a.nrows());
        plant = plant.with_random_walk(&own, intensity)?;
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
