//! Values and derivatives of connected outputs over the last steps.

use serde::{Deserialize, Serialize};

/// When a slave last stepped.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Span {
    /// Begin of its last step in s.
    pub(super) begin: f64,
    /// Sizes of the last step and of those before it in s.
    pub(super) size: f64,
    pub(super) last_size: f64,
    pub(super) earlier_size: f64,
    /// Whether the values at its end count already.
    pub(super) stepped: bool,
}

/// Size in s of a step that never was: by it values of now change at no rate.
const NEVER: f64 = f64::MAX;

impl Default for Span {
    fn default() -> Self {
        let (begin, stepped) = (0.0, false);
        Self { begin, size: NEVER, last_size: NEVER, earlier_size: NEVER, stepped }
    }
}

impl Span {
    /// Whether there was a step.
    pub(super) fn has_size(&self) -> bool {
        self.size < NEVER
    }

    /// No step was before now.
    pub(super) fn forget(&mut self) {
        (self.size, self.last_size, self.earlier_size) = (NEVER, NEVER, NEVER);
    }
}

/// Everything that changes on the way.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Trace {
    /// Values of all outputs at the end of the last step, at its begin, and before.
    pub(super) latest: Vec<f64>,
    pub(super) begin: Vec<f64>,
    pub(super) before: Vec<f64>,
    pub(super) earlier: Vec<f64>,
    /// Derivatives of all outputs at the end of the last step and at its begin.
    pub(super) derivatives: Vec<f64>,
    pub(super) begin_derivatives: Vec<f64>,
    /// For each slave.
    pub(super) spans: Vec<Span>,
}

impl Trace {
    pub(crate) fn has_shape_of(&self, other: &Self) -> bool {
        let shape = |trace: &Self| {
            [
                trace.latest.len(),
                trace.begin.len(),
                trace.before.len(),
                trace.earlier.len(),
                trace.derivatives.len(),
                trace.begin_derivatives.len(),
                trace.spans.len(),
            ]
        };
        shape(self) == shape(other)
    }

    /// Takes over all values of `other`, of the same system, into the arrays that are there.
    pub(crate) fn copy(&mut self, other: &Self) {
        self.latest.clone_from(&other.latest);
        self.begin.clone_from(&other.begin);
        self.before.clone_from(&other.before);
        self.earlier.clone_from(&other.earlier);
        self.derivatives.clone_from(&other.derivatives);
        self.begin_derivatives.clone_from(&other.begin_derivatives);
        self.spans.clone_from(&other.spans);
    }
}
