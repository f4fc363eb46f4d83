//! The reasons for which a computation is refused.

use nalgebra::Complex;

/// Why a computation was refused. Rows and columns count from 1, as in the literature.
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
    #[error("{matrix} is {}x{}, expected {}x{}", found.0, found.1, expected.0, expected.1)]
    Shape {
        /// Name of the matrix as in the documentation of the function.
        matrix: &'static str,
        /// Rows and columns it must have.
        expected: (usize, usize),
        /// Rows and columns it has.
        found: (usize, usize),
    },
    /// A matrix has no rows or no columns.
    #[error("{matrix} is {}x{}, expected at least one row and one column", found.0, found.1)]
    Empty {
        /// Name of the matrix.
        matrix: &'static str,
        /// Rows and columns it has.
        found: (usize, usize),
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
        /// The rule it breaks.
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
    /// The pair (A, C) is not observable.
    #[error("the pair (A, C) is not observable: {rank} of {n} states can be seen")]
    NotObservable {
        /// Dimension of the observable quotient.
        rank: usize,
        /// Number of states.
        n: usize,
    },
    /// More fault channels than measurements: no observer tells them apart.
    #[error(
        "{faults} fault channels need at least as many independent measurements, \
         found {measurements}"
    )]
    TooManyFaults {
        /// Columns of `F_a`.
        faults: usize,
        /// Rows of C.
        measurements: usize,
    },
    /// A fault is hidden by a state that develops like it.
    #[error(
        "a fault that develops with {} cannot be told from a state: rank [A - s I, F_a; C, 0] is \
         {rank}, expected {expected}; it hides in the columns {faults:?} of F_a", development(*at)
    )]
    HiddenFault {
        /// s, an eigenvalue of the fault model: 0 for a constant fault, 1 when sampled.
        at: Complex<f64>,
        /// Rank of the matrix, `F_a` taken times the eigenvectors of the fault model.
        rank: usize,
        /// Number of its columns.
        expected: usize,
        /// Columns of `F_a` that take part in one hidden combination, from 1.
        faults: Vec<usize>,
    },
    /// Not one eigenvalue per state.
    #[error("{found} eigenvalues are given, expected {expected}, one per state")]
    PoleCount {
        /// Number of states.
        expected: usize,
        /// Number of eigenvalues given.
        found: usize,
    },
    /// An eigenvalue is wanted more often than there are independent inputs.
    #[error(
        "the eigenvalue {} is wanted {times} times, at most {inputs} are possible", shown(*.pole)
    )]
    RepeatedPole {
        /// The eigenvalue.
        pole: Complex<f64>,
        /// How often it is wanted.
        times: usize,
        /// Rank of B.
        inputs: usize,
    },
    /// A complex eigenvalue is wanted more often than its conjugate.
    #[error("the eigenvalue {} is wanted without its conjugate {}", shown(*.pole), shown(.pole.conj()))]
    UnpairedPole {
        /// The eigenvalue.
        pole: Complex<f64>,
    },
    /// The gain found does not give the wanted eigenvalues.
    #[error("the wanted eigenvalues are missed by {relative:e} relative, allowed is {allowed:e}")]
    PolesMissed {
        /// Largest relative distance.
        relative: f64,
        /// Largest relative distance allowed.
        allowed: f64,
    },
    /// An eigenvalue lies in the closed right half plane.
    #[error("{matrix} is not Hurwitz: its largest real part is {abscissa}")]
    NotHurwitz {
        /// Name of the matrix.
        matrix: &'static str,
        /// Largest real part of the eigenvalues.
        abscissa: f64,
    },
    /// An eigenvalue lies on the unit circle or outside.
    #[error("{matrix} is not Schur stable: its spectral radius is {radius}")]
    NotSchur {
        /// Name of the matrix.
        matrix: &'static str,
        /// Largest absolute value of the eigenvalues.
        radius: f64,
    },
    /// No feedback moves an eigenvalue that has to be moved.
    #[error(
        "the pair (A, B) is not stabilisable: no feedback moves the eigenvalue {:.6}{:+.6}i",
        eigenvalue.re, eigenvalue.im
    )]
    NotStabilisable {
        /// The eigenvalue of A.
        eigenvalue: Complex<f64>,
    },
    /// No observer moves an eigenvalue that has to be moved.
    #[error(
        "the pair (A, C) is not detectable: no observer moves the eigenvalue {:.6}{:+.6}i",
        eigenvalue.re, eigenvalue.im
    )]
    NotDetectable {
        /// The eigenvalue of A.
        eigenvalue: Complex<f64>,
    },
    /// An eigenvalue on the limit of stability that the weight does not reach stays there.
    #[error(
        "{weight} does not reach the eigenvalue {:.6}{:+.6}i on the limit of stability",
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
    /// An iteration did not end within its bound.
    #[error("{what} did not converge within {iterations} iterations")]
    NotConverged {
        /// What was iterated.
        what: &'static str,
        /// The bound.
        iterations: usize,
    },
    /// A solution does not satisfy its equation well enough.
    #[error("{equation} is satisfied to {residual:e} only, allowed is {allowed:e}")]
    ResidualTooLarge {
        /// The equation.
        equation: &'static str,
        /// Relative residual found.
        residual: f64,
        /// Relative residual allowed.
        allowed: f64,
    },
    /// The result exceeds the range of double precision.
    #[error("{what} exceeds the range of double precision")]
    Overflow {
        /// The quantity.
        what: &'static str,
    },
}

fn shown(value: Complex<f64>) -> String {
    if value.im == 0.0 { value.re.to_string() } else { value.to_string() }
}

/// The eigenvalue s of a fault model.
fn development(s: Complex<f64>) -> String {
    format!("s = {}", shown(s))
}
