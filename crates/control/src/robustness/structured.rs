//! The structured singular value over all frequencies: stability for all parameters of a range, proven.
//!
//! ```text
//! mu(M) = 1 / min { size of Delta: det(I - M Delta) = 0 },  Delta = diag(delta_1 I, ..., full blocks)
//! ```

mod barrier;
mod blocks;
mod cover;
mod form;
mod gauss;
mod generalised_plant;
mod held;
mod hermitian;
mod interval;
mod proof;
mod remainder;
mod scales;

pub use blocks::Block;
pub use proof::{ProvenTolerance, Unproven, proven_tolerance};

use crate::response::{continuous_equivalent, original_frequency};
use crate::{Error, StateSpace, check};
use cover::Cover;

/// The relative increase of the bound that allows for rounding errors.
const ROUNDING: f64 = 1e-4;

/// An upper bound of the structured singular value over all frequencies.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct StructuredBound {
    /// The bound: fed back by Delta, the system is stable for every constant Delta of the structure with a
    /// size below 1 / `upper`.
    pub upper: f64,
    /// The frequency that determines the bound, in rad per unit of time.
    pub frequency: f64,
    /// Number of intervals, each with its own D and G, that cover the frequencies.
    pub intervals: usize,
}

/// Bounds the structured singular value of a stable square M(s) = C (s I - A)^-1 B + D over all frequencies.
///
/// For each frequency the bound is the least beta with Hermitian D > 0 and G that commute with the structure and
///
/// ```text
/// beta^2 D - M* D M - j (G M - M* G) > 0
/// ```
///
/// G acts on the real blocks; without G they would be bounded as complex ones. `blocks`: the structure, with as many
/// channels as M. `enough`: a bound that need not be improved, above zero. `ending`: called at each interval; the
/// result is None if `ending` returns true before the end.
///
/// D and G of one frequency prove the bound up to the next imaginary eigenvalue of a Hamiltonian matrix on each side.
/// Frequencies outside this interval are treated in the same way, with a bound that rises by 0.5 % where it is
/// exceeded, until intervals cover all frequencies. So `upper` is about 1 % above the largest of the least bounds, or
/// more if these need a G above 1000 times D and M, in loops with less than about 1 % of damping. The least bounds
/// equal mu for up to three full blocks or one real one; otherwise mu may be smaller.
///
/// Method for one frequency: method of centres with Newton's method. Cost for r channels, n states and v unknowns in D
/// and G (2 r if no real block is repeated): 200 (2 n)^3 multiplications and some hundred Newton steps of r^3 + v^3
/// for each of some 1 to 100 intervals.
///
/// In sampled time z = (1 + s) / (1 - s) makes the system continuous.
///
/// Source: bound by D: J. C. Doyle, Analysis of feedback systems with structured uncertainties, IEE Proc. D 129
/// (1982); by D and G: M. K. H. Fan, A. L. Tits and J. C. Doyle, Robustness in the presence of mixed parametric
/// uncertainty and unmodeled dynamics, IEEE Trans. Autom. Control 36 (1991); overview: A. Packard and J. Doyle, The
/// complex structured singular value, Automatica 29 (1993); intervals: C. T. Lawrence, A. L. Tits and P. Van Dooren,
/// A fast algorithm for the computation of an upper bound on the mu-norm, Automatica 36 (2000).
///
/// # Example
///
/// x'' + 0.1 x' + (1 + delta) x = 0 is stable for delta > -1: the real bound is 1. With complex delta it is the peak of
/// 1 / (s^2 + 0.1 s + 1), about 10.
///
/// ```
/// use control::robustness::{Block, structured_bound};
/// use control::{Domain, StateSpace};
/// use nalgebra::DMatrix;
/// let system = StateSpace {
///     a: DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -1.0, -0.1]),
///     b: DMatrix::from_row_slice(2, 1, &[0.0, -1.0]),
///     c: DMatrix::from_row_slice(1, 2, &[1.0, 0.0]),
///     d: DMatrix::zeros(1, 1),
///     domain: Domain::Continuous,
/// };
/// let real = structured_bound(&system, &[Block::Real(1)], 1e-3, &|| false)?;
/// let complex = structured_bound(&system, &[Block::Full(1)], 1e-3, &|| false)?;
/// assert!((real.unwrap().upper - 1.0).abs() < 0.02);
/// assert!((complex.unwrap().upper - 10.0).abs() < 0.2);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// Same as [`StateSpace::check`]; [`Error::Shape`] for blocks that do not fit; [`Error::OutOfRange`] for `enough`;
/// [`Error::NotHurwitz`], [`Error::NotSchur`]; [`Error::NotConverged`]; [`Error::Overflow`].
pub fn structured_bound(
    system: &StateSpace,
    blocks: &[Block],
    enough: f64,
    ending: &dyn Fn() -> bool,
) -> Result<Option<StructuredBound>, Error> {
    let channels = blocks.iter().map(|block| block.size()).sum();
    check::positive("enough", enough)?;
    check::shape("D of M", &system.d, (channels, channels))?;
    system.stable_eigenvalues()?;
    let mut cover = Cover::new(&continuous_equivalent(system)?, blocks, enough)?;
    if !cover.complete(ending)? {
        return Ok(None);
    }
    let frequency = original_frequency(cover.frequency, system.domain);
    let upper = cover.bound * (1.0 + ROUNDING);
    Ok(Some(StructuredBound { upper, frequency, intervals: cover.intervals }))
}
