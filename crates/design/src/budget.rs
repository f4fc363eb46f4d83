//! The time that certificates and bounds may take.

use std::time::{Duration, Instant};

/// Time that certificates (the linear matrix inequalities of Theorem 1) and bounds (peak gains) of one
/// design may take before the rest of them is left out. A part that has begun is completed.
pub(crate) struct Budget {
    start: Instant,
    limit: Duration,
}

impl Budget {
    /// Starts the clock.
    pub(crate) fn start(limit: Duration) -> Self {
        Self { start: Instant::now(), limit }
    }

    pub(crate) fn is_over(&self) -> bool {
        self.start.elapsed() >= self.limit
    }

    /// The reason for leaving something out.
    pub(crate) fn reason(&self) -> String {
        format!(
            "left out after {} s, the time for certificates and bounds; --certificate-time allows more",
            self.limit.as_secs_f64()
        )
    }
}
