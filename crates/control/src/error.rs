//! The errors of this crate.

use nalgebra::Complex;

/// The reason for which a computation failed. Rows and columns count from 1, as in the literature.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An entry is NaN or infinite.
    #[error("{matrix}[{row},{col}] is {value}, expected a finite number")]
    NotFinite {
        /// Name of the matrix as in the documentation of the function.
        matrix: &'static str,
        /// Row of the first such entry, from 1.
        row: usize,
        /// Column of the first such entry, from 1.
        col: usize,
        /// The entry.
        value: f64,
    },
    /// A matrix has the wrong number of rows or columns.
    #[error("{matrix} is {}x{}, expected {}x{}", actual.0, actual.1, expected.0, expected.1)]
    Shape {
        /// Name of the matrix as in the documentation of the function.
        matrix: &'static str,
        /// Rows and columns it must have.
        expected: (usize, usize),
        /// Rows and columns it has.
        actual: (usize, usize),
    },
    /// A matrix has no rows or no columns.
    #[error("{matrix} is {}x{}, expected at least one row and one column", actual.0, actual.1)]
    Empty {
        /// Name of the matrix.
        matrix: &'static str,
        /// Rows and columns it has.
        actual: (usize, usize),
    },
    /// A matrix that must be symmetric is not.
    #[error("{matrix} differs from its transpose at [{row},{col}]")]
    NotSymmetric {
        /// Name of the matrix.
        matrix: &'static str,
        /// Row of the first differing entry, from 1.
        row: usize,
        /// Column of the first differing entry, from 1.
        col: usize,
    },
    /// A number is outside of its range.
    #[error("{name} is {value}, expected {rule}")]
    OutOfRange {
        /// Name of the argument.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The range.
        rule: &'static str,
    },
    /// The pair (A, B) is not controllable.
    #[error("the pair (A, B) is not controllable: {rank} of {n} states can be reached")]
    NotControllable {
        /// Dimension of the controllable subspace.
        rank: usize,
        /// Number of states.
        n: usize,
    },
    /// A record has fewer samples than a model needs.
    #[error("{actual} samples, expected at least {expected}")]
    TooFewSamples {
        /// The number of samples that is needed.
        expected: usize,
        /// The number of samples.
        actual: usize,
    },
    /// No continuous plant has these samples.
    #[error(
        "no continuous plant has these samples: its A would be the logarithm of the sampled A, which needs \
         eigenvalues that are neither zero nor negative"
    )]
    NoContinuousPlant,
    /// The pair (A, C) is not observable.
    #[error("the pair (A, C) is not observable: {rank} of {n} states can be seen")]
    NotObservable {
        /// Rank of the observability matrix.
        rank: usize,
        /// Number of states.
        n: usize,
    },
    /// There are more fault channels than measurements, so that no observer can distinguish them.
    #[error(
        "{faults} fault channels need at least {faults} independent measurements, \
         found {measurements}"
    )]
    TooManyFaults {
        /// Columns of `F_a`.
        faults: usize,
        /// Rows of C.
        measurements: usize,
    },
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
        /// Number of its columns.
        expected: usize,
        /// Columns of `F_a` that take part in one hidden combination, from 1.
        faults: Vec<usize>,
    },
    /// The measurements do not show the rates of the faults directly.
    #[error(
        "the faults do not act on the derivatives of the measurements directly: rank C F_a is {rank}, \
         expected {faults}"
    )]
    FaultsNotDirect {
        /// Rank of C `F_a`.
        rank: usize,
        /// Columns of `F_a`.
        faults: usize,
    },
    /// The invariant zeros of (A, `F_a`, C) are not all stable.
    #[error(
        "(A, F_a, C) has invariant zeros that are not stable: {}",
        zeros.iter().map(|zero| shown(*zero)).collect::<Vec<_>>().join(", ")
    )]
    UnstableZeros {
        /// The zeros that are not stable.
        zeros: Vec<Complex<f64>>,
    },
    /// No residual responds to a fault that is decoupled from the disturbances and the other faults.
    #[error(
        "no residual responds to fault {fault} and is decoupled from the disturbances{}",
        also_decoupled(decoupled)
    )]
    FaultNotIsolable {
        /// The fault, from 1.
        fault: usize,
        /// The faults to be decoupled, from 1.
        decoupled: Vec<usize>,
    },
    /// The number of eigenvalues differs from the number of states.
    #[error("{actual} eigenvalues are given, expected {expected}, one per state")]
    PoleCount {
        /// Number of states.
        expected: usize,
        /// Number of eigenvalues given.
        actual: usize,
    },
    /// An eigenvalue is requested more often than there are independent inputs.
    #[error(
        "the eigenvalue {} is requested {times} times, expected at most {inputs}, the rank of B", shown(*.pole)
    )]
    RepeatedPole {
        /// The eigenvalue.
        pole: Complex<f64>,
        /// How often it is requested.
        times: usize,
        /// Rank of B.
        inputs: usize,
    },
    /// A complex eigenvalue is requested more often than its conjugate.
    #[error("the eigenvalue {} is requested without its conjugate {}", shown(*.pole), shown(.pole.conj()))]
    UnpairedPole {
        /// The eigenvalue.
        pole: Complex<f64>,
    },
    /// The computed gain does not assign the requested eigenvalues.
    #[error(
        "the assigned eigenvalues differ from the requested ones by {relative:e} relative, expected at most {allowed:e}"
    )]
    PolesMissed {
        /// Largest relative distance.
        relative: f64,
        /// Largest relative distance allowed.
        allowed: f64,
    },
    /// A matrix has an eigenvalue in the closed right half plane.
    #[error("{matrix} is not Hurwitz: its largest real part is {abscissa}")]
    NotHurwitz {
        /// Name of the matrix.
        matrix: &'static str,
        /// Largest real part of the eigenvalues.
        abscissa: f64,
    },
    /// A matrix has an eigenvalue on or outside the unit circle.
    #[error("{matrix} is not Schur stable: its spectral radius is {radius}")]
    NotSchur {
        /// Name of the matrix.
        matrix: &'static str,
        /// Largest absolute value of the eigenvalues.
        radius: f64,
    },
    /// (A, B) has an unstable mode that is not controllable.
    #[error(
        "the pair (A, B) is not stabilisable: no feedback moves the eigenvalue {:.6}{:+.6}i",
        eigenvalue.re, eigenvalue.im
    )]
    NotStabilisable {
        /// The eigenvalue of A.
        eigenvalue: Complex<f64>,
    },
    /// (A, C) has an unstable mode that is not observable.
    #[error(
        "the pair (A, C) is not detectable: no observer moves the eigenvalue {:.6}{:+.6}i",
        eigenvalue.re, eigenvalue.im
    )]
    NotDetectable {
        /// The eigenvalue of A.
        eigenvalue: Complex<f64>,
    },
    /// A mode on the stability limit does not appear in the weight, so that no stabilising solution
    /// exists.
    #[error(
        "the mode {:.6}{:+.6}i on the stability limit does not appear in the weight {weight}",
        eigenvalue.re, eigenvalue.im
    )]
    Unweighted {
        /// Name of the weight.
        weight: &'static str,
        /// The eigenvalue.
        eigenvalue: Complex<f64>,
    },
    /// A symmetric matrix has a negative eigenvalue.
    #[error("{matrix} is not positive semidefinite")]
    NotPositiveSemidefinite {
        /// Name of the matrix.
        matrix: &'static str,
    },
    /// A symmetric matrix is not positive definite.
    #[error("{matrix} is not positive definite")]
    NotPositiveDefinite {
        /// Name of the matrix.
        matrix: &'static str,
    },
    /// An iteration did not converge within its limit.
    #[error("{what} did not converge within {iterations} iterations")]
    NotConverged {
        /// The iteration.
        what: &'static str,
        /// The limit.
        iterations: usize,
    },
    /// The residual of a computed solution is too large.
    #[error(
        "the solution of {equation} has the relative residual {residual:e}, expected at most {allowed:e}"
    )]
    ResidualTooLarge {
        /// The equation.
        equation: &'static str,
        /// Relative residual of the solution.
        residual: f64,
        /// Relative residual allowed.
        allowed: f64,
    },
    /// A result exceeds the range of double precision.
    #[error("{what} exceeds the range of double precision")]
    Overflow {
        /// The quantity.
        what: &'static str,
    },
}

/// A complex number as text, without the imaginary part if it is zero.
fn shown(value: Complex<f64>) -> String {
    if value.im == 0.0 { value.re.to_string() } else { value.to_string() }
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
