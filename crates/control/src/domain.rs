//! The domain of time in which a model holds.

/// The domain of time in which a model holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Domain {
    /// x' = A x + B u: stable when every eigenvalue of A has a negative real part.
    Continuous,
    /// `x[k+1] = A x[k] + B u[k]`: stable when every eigenvalue of A has a modulus below one.
    Sampled {
        /// Time from one sample to the next, in s, above zero.
        period: f64,
    },
}
