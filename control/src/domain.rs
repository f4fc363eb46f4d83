//! Continuous or sampled time.

/// What the A of a system advances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Domain {
    /// x' = A x + B w.
    Continuous,
    /// `x[k+1] = A x[k] + B w[k]`.
    Sampled {
        /// Time from sample to sample, above zero.
        period: f64,
    },
}
