//! The start of a step, and sums of its slopes.

/// The point from which a method steps.
#[derive(Clone, Copy)]
pub(crate) struct StepStart<'a> {
    /// The time at the start in s.
    pub(crate) time: f64,
    pub(crate) states: &'a [f64],
    /// The derivative of the states.
    pub(crate) slope: &'a [f64],
}

/// The sum of weight times component `i` of each vector.
pub(crate) fn weighted(weights: &[f64], vectors: &[Vec<f64>], i: usize) -> f64 {
    weights.iter().zip(vectors).map(|(weight, vector)| weight * vector[i]).sum()
}
