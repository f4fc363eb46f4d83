//! History of the connected outputs: values and derivatives over the last steps.

use serde::{Deserialize, Serialize};

/// The last step of a slave, and the sizes of the steps before it.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Span {
    /// Start of the last step in s.
    pub(super) start: f64,
    /// Size of the last step in s.
    pub(super) size: f64,
    /// Size in s of the step before the last step.
    pub(super) last_size: f64,
    /// Size in s of the step two before the last step.
    pub(super) earlier_size: f64,
    /// Whether the slave has made its step, so that the latest values belong to its end.
    pub(super) stepped: bool,
}

/// Size in s of a step that was never made; difference quotients over this size are 0.
const NEVER: f64 = f64::MAX;

impl Default for Span {
    fn default() -> Self {
        let (start, stepped) = (0.0, false);
        Self { start, size: NEVER, last_size: NEVER, earlier_size: NEVER, stepped }
    }
}

impl Span {
    /// Whether the slave has started a step since the history was cleared.
    pub(super) fn has_size(&self) -> bool {
        self.size < NEVER
    }

    /// Removes the sizes of the steps made so far.
    pub(super) fn clear_history(&mut self) {
        (self.size, self.last_size, self.earlier_size) = (NEVER, NEVER, NEVER);
    }
}

/// The values that change during the run.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Trace {
    /// Values of all outputs at the end of the last step.
    pub(super) latest: Vec<f64>,
    /// Values of all outputs at the start of the last step.
    pub(crate) start: Vec<f64>,
    /// Values of all outputs at the start of the step before the last one.
    pub(super) before: Vec<f64>,
    /// Values of all outputs at the start of the step two before the last one.
    pub(super) earlier: Vec<f64>,
    /// Derivatives of all outputs at the end of the last step.
    pub(super) derivatives: Vec<f64>,
    /// Derivatives of all outputs at the start of the last step.
    pub(super) start_derivatives: Vec<f64>,
    /// The last step of each slave.
    pub(super) spans: Vec<Span>,
}

impl Trace {
    pub(crate) fn lengths(&self) -> [usize; 7] {
        let values = [&self.latest, &self.start, &self.before, &self.earlier];
        let [latest, start, before, earlier] = values.map(Vec::len);
        let derivatives = [&self.derivatives, &self.start_derivatives].map(Vec::len);
        [latest, start, before, earlier, derivatives[0], derivatives[1], self.spans.len()]
    }

    /// Copies all values of `other`, which belongs to the same system, without allocating.
    pub(crate) fn copy(&mut self, other: &Self) {
        self.latest.clone_from(&other.latest);
        self.start.clone_from(&other.start);
        self.before.clone_from(&other.before);
        self.earlier.clone_from(&other.earlier);
        self.derivatives.clone_from(&other.derivatives);
        self.start_derivatives.clone_from(&other.start_derivatives);
        self.spans.clone_from(&other.spans);
    }
}
