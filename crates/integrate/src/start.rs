//! The start of a step, and sums of its slopes.

/// The point from which a method steps.
#[derive(Clone, Copy)]
pub(crate) struct StepStart<'a> {
    /// The time in s.
    pub(crate) time: f64,
    pub(crate) states: &'a [f64],
    /// The derivative of the states.
    pub(crate) slope: &'a [f64],
}
