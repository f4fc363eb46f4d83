//! The errors of this crate.

use nalgebra::Complex;

/// The reason for which a computation failed. Rows, columns and faults count from 1, as in the literature.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message says what its fields are")]
#[non_exhaustive]
pub enum Error {
    /// An entry is NaN or infinite.
    #[error("{matrix}[{row},{col}] is {value}, expected a finite number")]
    NotFinite { matrix: &'static str, row: usize, col: usize, value: f64 },
    /// A matrix has the wrong number of rows or columns.
    #[error("{matrix} is {}x{}, expected {}x{}", actual.0, actual.1, expected.0, expected.1)]
    Shape { matrix: &'static str, expected: (usize, usize), actual: (usize, usize) },
    /// A matrix has no rows or no columns.
    #[error("{matrix} is {}x{}, expected at least one row and one column", actual.0, actual.1)]
    Empty { matrix: &'static str, actual: (usize, usize) },
    /// A matrix that must be symmetric is not.
    #[error("{matrix} differs from its transpose at [{row},{col}]")]
    NotSymmetric { matrix: &'static str, row: usize, col: usize },
    /// A number is outside of its range.
    #[error("{name} is {value}, expected {rule}")]
    OutOfRange { name: &'static str, value: f64, rule: &'static str },
    /// The pair (A, B) is not controllable.
    #[error("the pair (A, B) is not controllable: {rank} of {n} states can be reached")]
    NotControllable { rank: usize, n: usize },
    /// A record has fewer samples than a model needs.
    #[error("{actual} samples, expected at least {expected}")]
    TooFewSamples { expected: usize, actual: usize },
    /// No continuous plant has these samples.
    #[error(
        "no continuous plant has these samples: its A would be the logarithm of the sampled A, which needs \
         eigenvalues that are neither zero nor negative"
    )]
    NoContinuousPlant,
    /// The pair (A, C) is not observable.
    #[error("the pair (A, C) is not observable: {rank} of {n} states can be seen")]
    NotObservable { rank: usize, n: usize },
    /// There are more fault channels than measurements, so that no observer can distinguish them.
    #[error(
        "{faults} fault channels need at least {faults} independent measurements, \
         found {measurements}"
    )]
    TooManyFaults { faults: usize, measurements: usize },
    /// The measurements cannot distinguish a fault from a motion of the states.
    #[error(
        "a fault that develops with s = {} cannot be told from a state: rank [A - s I, F_a; C, 0] is \
         {rank}, expected {expected}; it hides in the columns {faults:?} of F_a", shown(*at)
    )]
    HiddenFault {
        /// s, an eigenvalue of the fault model: 0 for a constant fault, 1 in sampled time.
        at: Complex<f64>,
        /// Rank of [A - s I, `F_a` N; C, 0], N the eigenvectors of the fault model.
        rank: usize,
        expected: usize,
        /// Columns of `F_a` that take part in one hidden combination, from 1.
        faults: Vec<usize>,
    },
    /// The measurements do not show the rates of the faults directly.
    #[error(
        "the faults do not act on the derivatives of the measurements directly: rank C F_a is {rank}, \
         expected {faults}"
    )]
    FaultsNotDirect { rank: usize, faults: usize },
    /// The invariant zeros of (A, `F_a`, C) are not all stable.
    #[error(
        "(A, F_a, C) has invariant zeros that are not stable: {}",
        zeros.iter().map(|zero| shown(*zero)).collect::<Vec<_>>().join(", ")
    )]
    UnstableZeros { zeros: Vec<Complex<f64>> },
    /// No residual responds to a fault that is decoupled from the disturbances and the other faults.
    #[error(
        "no residual responds to fault {fault} and is decoupled from the disturbances{}",
        also_decoupled(decoupled)
    )]
    FaultNotIsolable { fault: usize, decoupled: Vec<usize> },
    /// The number of eigenvalues differs from the number of states.
    #[error("{actual} eigenvalues are given, expected {expected}, one per state")]
    PoleCount { expected: usize, actual: usize },
    /// An eigenvalue is requested more often than there are independent inputs.
    #[error(
        "the eigenvalue {} is requested {times} times, expected at most {inputs}, the rank of B", shown(*.pole)
    )]
    RepeatedPole { pole: Complex<f64>, times: usize, inputs: usize },
    /// A complex eigenvalue is requested more often than its conjugate.
    #[error("the eigenvalue {} is requested without its conjugate {}", shown(*.pole), shown(.pole.conj()))]
    UnpairedPole { pole: Complex<f64> },
    /// The computed gain does not assign the requested eigenvalues.
    #[error(
        "the assigned eigenvalues differ from the requested ones by {relative:e} relative, expected at most {allowed:e}"
    )]
    PolesMissed { relative: f64, allowed: f64 },
    /// A matrix has an eigenvalue in the closed right half plane.
    #[error("{matrix} is not Hurwitz: its largest real part is {abscissa}")]
    NotHurwitz { matrix: &'static str, abscissa: f64 },
    /// A matrix has an eigenvalue on or outside the unit circle.
    #[error("{matrix} is not Schur stable: its spectral radius is {radius}")]
    NotSchur { matrix: &'static str, radius: f64 },
    /// (A, B) has an unstable mode that is not controllable.
    #[error("the pair (A, B) is not stabilisable: no feedback moves the eigenvalue {}", rounded(*eigenvalue))]
    NotStabilisable { eigenvalue: Complex<f64> },
    /// (A, C) has an unstable mode that is not observable.
    #[error("the pair (A, C) is not detectable: no observer moves the eigenvalue {}", rounded(*eigenvalue))]
    NotDetectable { eigenvalue: Complex<f64> },
    /// A mode on the stability limit does not appear in the weight: there is no stabilising solution.
    #[error("the mode {} on the stability limit does not appear in the weight {weight}", rounded(*eigenvalue))]
    Unweighted { weight: &'static str, eigenvalue: Complex<f64> },
    /// A symmetric matrix has a negative eigenvalue.
    #[error("{matrix} is not positive semidefinite")]
    NotPositiveSemidefinite { matrix: &'static str },
    /// A symmetric matrix is not positive definite.
    #[error("{matrix} is not positive definite")]
    NotPositiveDefinite { matrix: &'static str },
    /// An iteration did not converge within its limit.
    #[error("{what} did not converge within {iterations} iterations")]
    NotConverged { what: &'static str, iterations: usize },
    /// The residual of a computed solution is too large.
    #[error(
        "the solution of {equation} has the relative residual {residual:e}, expected at most {allowed:e}"
    )]
    ResidualTooLarge { equation: &'static str, residual: f64, allowed: f64 },
    /// A result exceeds the range of double precision.
    #[error("{what} exceeds the range of double precision")]
    Overflow { what: &'static str },
}

/// Formats a complex number, without an imaginary part of zero.
fn shown(value: Complex<f64>) -> String {
    if value.im == 0.0 { value.re.to_string() } else { value.to_string() }
}

fn rounded(value: Complex<f64>) -> String {
    format!("{:.6}{:+.6}i", value.re, value.im)
}

fn also_decoupled(faults: &[usize]) -> String {
    if faults.is_empty() { String::new() } else { format!(" and the faults {faults:?}") }
}

impl Error {
    /// Whether rounding errors or the number of iterations prevented a result that exists in theory.
    #[must_use]
    pub fn is_numerical(&self) -> bool {
        matches!(
            self,
            Self::NotConverged { .. } | Self::ResidualTooLarge { .. } | Self::Overflow { .. }
        )
    }
}
