//! Invariant zeros of a linear system.

#[cfg(feature = "lmi")]
mod nulling;

#[cfg(feature = "lmi")]
pub(crate) use nulling::{Nulling, output_nulling};

use crate::balance::unit_columns;
use crate::blocks::stacked;
use crate::eigen::eigenvalues;
use crate::svd::Svd;
use crate::{Domain, Error, StateSpace, check};
use nalgebra::{Complex, DMatrix};

/// A singular value counts as zero below this times the number of states, inputs and outputs together,
/// relative to the norm of the scaled matrices.
const TOLERANCE_PER_SIGNAL: f64 = 100.0 * f64::EPSILON;

/// The invariant zeros of a system, and the rank of its transfer function.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Zeros {
    /// The finite zeros, with multiplicity, ordered by real part, then by imaginary part.
    pub finite: Vec<Complex<f64>>,
    /// Rank of C (s I - A)^-1 B for almost every s. If it is below the number of inputs, some
    /// combination of the inputs has no effect on y.
    pub rank: usize,
}

/// The invariant zeros of x' = A x + B u, y = C x.
///
/// ```text
/// s with rank [A - s I, B; C, 0] below its rank for almost every s
/// ```
///
/// `a`: n x n; `b`: n x m; `c`: p x n; the numbers of inputs and outputs may differ. Uncontrollable
/// and unobservable modes are zeros if they lower the rank. Method: states are balanced, columns of
/// B and rows of C scaled to the norm of A; orthogonal transformations remove the states that y = 0
/// determines, until D of the remaining system is square and invertible; the zeros are the
/// eigenvalues of its A - B D^-1 C. About 20 n (n + m) (n + p) min(n, m + p) multiplications.
/// Tolerance of the ranks: 100 (n + m + p) eps, relative to the norm of the scaled matrices.
///
/// Source: A. Emami-Naeini and P. Van Dooren, Computation of zeros of linear multivariable systems,
/// Automatica 18 (1982), the algorithm of section 3.
///
/// # Example
///
/// (s - 3) / (s^2 + 2 s + 5) has the zero 3:
///
/// ```
/// use nalgebra::DMatrix;
/// let a = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -5.0, -2.0]);
/// let b = DMatrix::from_row_slice(2, 1, &[0.0, 1.0]);
/// let c = DMatrix::from_row_slice(1, 2, &[-3.0, 1.0]);
/// let zeros = control::zeros::zeros(&a, &b, &c)?;
/// assert_eq!((zeros.finite.len(), zeros.rank), (1, 1));
/// assert!((zeros.finite[0] - 3.0).norm() < 1e-13);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix;
/// [`Error::NotConverged`] when an inner iteration does not end; [`Error::Overflow`].
pub fn zeros(a: &DMatrix<f64>, b: &DMatrix<f64>, c: &DMatrix<f64>) -> Result<Zeros, Error> {
    let n = check::with_inputs(a, b)?;
    check::shape("C", c, (c.nrows(), n))?;
    let system = scale_system(a, b, c);
    let size = system.a.norm().hypot(system.b.norm()).hypot(system.c.norm());
    let signals = n + b.ncols() + c.nrows();
    let zero = TOLERANCE_PER_SIGNAL * check::as_number(signals) * size;
    let (system, _) = reduce(system, DMatrix::zeros(0, n), zero)?;
    let dual = system.dual();
    let no_outputs = DMatrix::zeros(0, dual.a.nrows());
    let square = reduce(dual, no_outputs, zero)?.0.dual();
    let rank = square.d.nrows();
    if square.a.is_empty() {
        return Ok(Zeros { finite: Vec::new(), rank });
    }
    if rank == 0 {
        return Ok(Zeros { finite: eigenvalues(&square.a)?, rank });
    }
    let quotient = square.d.lu().solve(&square.c).ok_or(Error::Overflow { what: "D^-1 C" })?;
    let dynamics = check::in_range("A - B D^-1 C", square.a - square.b * quotient)?;
    Ok(Zeros { finite: eigenvalues(&dynamics)?, rank })
}

/// The system {A, B, C, 0} with balanced states, and columns of B and rows of C scaled to the norm of A
/// (1 for A = 0). It has the same zeros.
fn scale_system(a: &DMatrix<f64>, b: &DMatrix<f64>, c: &DMatrix<f64>) -> StateSpace {
    let (d, domain) = (DMatrix::zeros(c.nrows(), b.ncols()), Domain::Continuous);
    let system = StateSpace { a: a.clone(), b: b.clone(), c: c.clone(), d, domain }.balanced();
    let size = if system.a.norm().is_normal() { system.a.norm() } else { 1.0 };
    StateSpace {
        b: unit_columns(&system.b) * size,
        c: unit_columns(&system.c.transpose()).transpose() * size,
        ..system
    }
}

/// Reduces a system to a subsystem with the same zeros whose D has full row rank. Returns this subsystem, and the
/// matrix of further outputs z = `output` x for its states.
///
/// One pass of the reduction, with `zero` the threshold of the ranks:
///
/// 1. An orthogonal change of the outputs splits y = C x + D u into outputs y1 with a D1 of full
///    row rank and outputs y2 = C2 x that D does not reach.
/// 2. At a zero y2 = 0, which fixes as many states as C2 has independent rows. An orthogonal change
///    of the states separates the fixed states from the free ones.
/// 3. The fixed states are zero, so that the right-hand sides of their differential equations
///    become outputs of the free states.
///
/// The passes end when C2 fixes no further state.
fn reduce(
    mut system: StateSpace,
    mut output: DMatrix<f64>,
    zero: f64,
) -> Result<(StateSpace, DMatrix<f64>), Error> {
    loop {
        let StateSpace { a, b, c, d, domain } = system;
        let outputs = Svd::new(&d.transpose())?;
        let reached = outputs.rank_above(zero);
        let (c, d) = (outputs.right.tr_mul(&c), outputs.right.tr_mul(&d));
        let (c1, d1) = (c.rows(0, reached).into_owned(), d.rows(0, reached).into_owned());
        let states = Svd::new(&c.rows(reached, c.nrows() - reached).into_owned())?;
        let fixed = states.rank_above(zero);
        if fixed == 0 {
            return Ok((StateSpace { a, b, c: c1, d: d1, domain }, output));
        }
        let free = a.nrows() - fixed;
        let v = &states.right;
        let (a, b, c) = (v.tr_mul(&a) * v, v.tr_mul(&b), c1 * v);
        output = (output * v).columns(fixed, free).into();
        system = StateSpace {
            c: stacked(&c.columns(fixed, free).into(), &a.view((0, fixed), (fixed, free)).into()),
            d: stacked(&d1, &b.rows(0, fixed).into()),
            a: a.view((fixed, fixed), (free, free)).into(),
            b: b.rows(fixed, free).into(),
            domain,
        };
    }
}
