//! Set points: integral action and feedforward for references of the measurements.
//!
//! t references r are set points of H y, with y = C x the measurements of x' = A x + B u. Either the error r - H y is
//! integrated, and the integral `x_i` fed back,
//!
//! ```text
//! x_i' = r - H (y - F_s f_hat),   u = K_x x_hat + K_f f_hat + K_i x_i
//! x_i[k+1] = x_i[k] + T (r[k] - H (y[k] - F_s f_hat))      sampled, f_hat the estimate that u[k] uses
//! ```
//!
//! or the references act on the commands by a constant gain, u = `K_x` `x_hat` + `K_f` `f_hat` + `N_r` r.
//! `F_s` f is the effect of sensor faults on y. The integral makes H y equal to a constant r for every
//! plant for which the loop is stable; the feedforward only if A, B, C are right. Both together,
//! u = `K_x` `x_hat` + `K_f` `f_hat` + `K_i` `x_i` + `N_r` r, are two degrees of freedom
//! ([`integral_feedforward`]): the commands react to a reference at once, and the integrals remove the error of the
//! model from H y.
//!
//! K = [`K_x`, `K_i`] is the gain of the plant [x; `x_i`] of [`extended_pair`]. The estimation errors do not
//! depend on r, `x_i` or K, so that the loop has the eigenvalues of the extended plant under K and those of
//! the observer: x' contains `K_i` `x_i`, but the errors obey the equations of [`crate::aso`], and `x_i'`
//! = r - H C x + H `F_s` eps.
//!
//! Source: E. J. Davison and H. W. Smith, Pole assignment in linear time-invariant multivariable systems
//! with constant disturbances, Automatica 7 (1971); G. F. Franklin, J. D. Powell and M. Workman, Digital
//! control of dynamic systems, 3rd edition (1998), sections 8.5 and 9.3 for the sampled form.

mod integral_feedforward;
mod interpolated_windup;
mod windup;

pub use integral_feedforward::{IntegralFeedforward, integral_feedforward};
pub use interpolated_windup::{InterpolatedWindup, interpolated_windup};
pub use windup::windup_gain;

use crate::balance::{divide_rows, multiply_columns, power_of_two_or_one};
use crate::blocks::{beside, block_2x2, stacked};
use crate::svd::Svd;
use crate::{Domain, Error, StateSpace, check};
use nalgebra::{DMatrix, DVector};

/// Singular values below this fraction of the largest count as zero, with rows and columns scaled to length one.
const TOLERANCE: f64 = 1e-12;
/// Sweeps that scale rows and columns to length one.
const SWEEPS: usize = 4;

/// Integral action of a controller.
#[derive(Debug, Clone, PartialEq)]
pub struct IntegralAction {
    /// H, t x p: H y follows the references.
    pub h: DMatrix<f64>,
    /// H C, t x n, from the states of the observer's model to H y; zero for the states of a measurement filter, because
    /// y is taken before the filter.
    pub output: DMatrix<f64>,
    /// H `F_s`, t x q: the effect of the faults on H y.
    pub faults: DMatrix<f64>,
    /// `K_i`, m x t: the gain of the integrals.
    pub gain: DMatrix<f64>,
}

/// Rank of the plant at constant signals.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct TrackingRank {
    /// Rank of [A, B; H C, 0].
    pub rank: usize,
    /// The full rank n + t: if `rank` reaches it, a constant H y of any value is possible.
    pub expected: usize,
    /// Rank of H C.
    pub outputs: usize,
}

impl TrackingRank {
    /// Whether every constant reference can be reached.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.rank == self.expected
    }
}

/// Rank of [A, B; H C, 0]: whether a plant can hold H y at every constant value.
///
/// `a`: n x n; `b`: n x m; `output`: H C, t x n, all in continuous time. With (A, B) stabilisable, the rank is
/// n + t if and only if for each r there are x and u with A x + B u = 0 and H C x = r. This needs at least as
/// many commands as references, independent references, and no invariant zero at s = 0. A full rank is
/// then the condition for the pair of [`extended_pair`] to be stabilisable: its modes at s = 0 are those of the
/// integrals. For a sampled plant the condition is the same unless the sample time hides a mode, as
/// [`A_T` - I, `B_T`] of the samples is an invertible matrix times [A, B].
///
/// Rows and columns are scaled to length one; singular values below 1e-12 of the largest count as zero.
///
/// Source: E. J. Davison and H. W. Smith (1971), theorem 1.
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix; [`Error::NotConverged`].
pub fn tracking_rank(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    output: &DMatrix<f64>,
) -> Result<TrackingRank, Error> {
    let [n, m, t] = sizes(a, b, output)?;
    let whole = block_2x2([a, b], [output, &DMatrix::zeros(t, m)]);
    let rank = |matrix: &DMatrix<f64>| Ok::<_, Error>(Svd::new(&scaled(matrix))?.rank(TOLERANCE));
    let outputs = rank(&output.transpose())?;
    Ok(TrackingRank { rank: rank(&whole.transpose())?, expected: n + t, outputs })
}

/// Checks A, B and H C; returns the numbers of states, commands and references.
fn sizes(a: &DMatrix<f64>, b: &DMatrix<f64>, output: &DMatrix<f64>) -> Result<[usize; 3], Error> {
    let (n, m, t) = (check::with_inputs(a, b)?, b.ncols(), output.nrows());
    check::shape("H C", output, (t, n))?;
    Ok([n, m, t])
}

/// Scales rows and columns to about length one.
fn scaled(m: &DMatrix<f64>) -> DMatrix<f64> {
    let mut m = m.clone();
    let unit = |length: f64| if length.is_normal() { 1.0 / length } else { 1.0 };
    // Largest entries are scaled to one first, so that no square in a length overflows or vanishes.
    m.row_iter_mut().for_each(|mut row| row *= unit(row.amax()));
    m.column_iter_mut().for_each(|mut column| column *= unit(column.amax()));
    for _ in 0..SWEEPS {
        m.row_iter_mut().for_each(|mut row| row *= unit(row.norm()));
        m.column_iter_mut().for_each(|mut column| column *= unit(column.norm()));
    }
    m
}

/// The plant [x; `x_i`] without the references: the pair that K = [`K_x`, `K_i`] is designed for.
///
/// ```text
/// A_e = [A, 0; -H C, 0],   B_e = [B; 0]                  continuous
/// A_e = [A, 0; -T H C, I], B_e = [B; 0]                  sampled, A and B the sampled matrices
/// ```
///
/// `a`: n x n; `b`: n x m; `output`: H C, t x n, in `domain`.
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix.
pub fn extended_pair(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    output: &DMatrix<f64>,
    domain: Domain,
) -> Result<(DMatrix<f64>, DMatrix<f64>), Error> {
    let [n, _, t] = sizes(a, b, output)?;
    let (step, last) = integration(domain);
    let last = DMatrix::identity(t, t) * last;
    Ok((
        block_2x2([a, &DMatrix::zeros(n, t)], [&(output * -step), &last]),
        b.clone().resize_vertically(n + t, 0.0),
    ))
}

/// The factors of the integrand and of the last value in an integral: 1 and 0 in continuous time, T and 1 in sampled
/// time.
pub(crate) fn integration(domain: Domain) -> (f64, f64) {
    match domain {
        Domain::Continuous => (1.0, 0.0),
        Domain::Sampled { period } => (period, 1.0),
    }
}

/// The feedforward `N_r`, m x t, for which H y follows a constant r without error.
///
/// ```text
/// N_r = G^+,   G = H C (s I - A - B K_x)^-1 B   at s = 0, or z = 1 in place of s
/// ```
///
/// `a`, `b`, `output`: as in [`extended_pair`]; `k_x`: m x n, such that A + B `K_x` is stable. G^+ is the
/// pseudoinverse: of several `N_r` (more commands than references) the one of least norm in the given
/// units. It exists if [`tracking_rank`] is full. Method: singular value decomposition of G, the references in units in
/// which its rows have about length one, and one step of iterative refinement.
///
/// # Errors
///
/// Same as [`extended_pair`]; [`Error::NotHurwitz`], [`Error::NotSchur`] for an unstable A + B `K_x`;
/// [`Error::ResidualTooLarge`] if G `N_r` differs from I by more than 1e-9 in these units; [`Error::Overflow`],
/// [`Error::NotConverged`].
pub fn feedforward(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    output: &DMatrix<f64>,
    k_x: &DMatrix<f64>,
    domain: Domain,
) -> Result<DMatrix<f64>, Error> {
    let [n, m, t] = sizes(a, b, output)?;
    check::shape("K_x", k_x, (m, n))?;
    let controlled = StateSpace::strictly_proper(a + b * k_x, b.clone(), output.clone(), domain);
    crate::stability::require_stable("A + B K_x", &controlled.a, domain)?;
    let constant = controlled.dc_matrix().lu();
    let gain = |input: &DMatrix<f64>| {
        let what = "the gain at s = 0";
        let states = constant.solve(&(b * input)).ok_or(Error::Overflow { what })?;
        check::in_range(what, output * states)
    };
    let whole = gain(&DMatrix::identity(m, m))?;
    // Units of the references in which each row of G has about length one.
    let units = whole.row_iter().map(|row| power_of_two_or_one(row.norm()));
    let units = DVector::from_iterator(t, units);
    let svd = Svd::new(&divide_rows(&whole, &units).transpose())?;
    let rank = svd.rank(TOLERANCE);
    // (G')^+ = (G^+)'.
    let solve = |r: &DMatrix<f64>| {
        let left = svd.left.columns(0, rank);
        left * svd.whitening(rank).transpose() * divide_rows(r, &units)
    };
    let identity = DMatrix::identity(t, t);
    let first = solve(&identity);
    let n_r = &first + solve(&(&identity - gain(&first)?));
    let remainder = multiply_columns(&(gain(&n_r)? - identity), &units);
    require_residual("G N_r = I", divide_rows(&remainder, &units).amax(), 1e-9)?;
    Ok(n_r)
}

/// Refuses a residual above `allowed`, and NaN.
fn require_residual(equation: &'static str, residual: f64, allowed: f64) -> Result<(), Error> {
    if residual <= allowed {
        return Ok(());
    }
    Err(Error::ResidualTooLarge { equation, residual, allowed })
}

/// The loop from the references to [x; u], without faults and estimation errors.
///
/// ```text
/// [x; x_i]' = (A_e + B_e [K_x, K_i]) [x; x_i] + [B N_r; I] r
/// u = [K_x, K_i] [x; x_i] + N_r r
/// ```
///
/// with the pair of [`extended_pair`]; in sampled time T I in place of I. `a`, `b`: n x n, n x m in
/// `domain`; `k_x`: m x n. With integral action the state is [x; `x_i`], with a feedforward x.
///
/// # Errors
///
/// Same as [`extended_pair`]; [`Error::Shape`] for a gain that does not fit.
pub fn reference_system(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    k_x: &DMatrix<f64>,
    action: &Action<'_>,
    domain: Domain,
) -> Result<StateSpace, Error> {
    let (n, m) = (check::with_inputs(a, b)?, b.ncols());
    check::shape("K_x", k_x, (m, n))?;
    let (a_e, b_e, k, entry, direct) = match action {
        Action::Integral { output, gain, feedforward } => {
            let t = output.nrows();
            check::shape("K_i", gain, (m, t))?;
            let (a_e, b_e) = extended_pair(a, b, output, domain)?;
            let k = beside(k_x, gain);
            let mut entry = DMatrix::zeros(n + t, t);
            entry.rows_mut(n, t).fill_diagonal(integration(domain).0);
            let mut direct = DMatrix::zeros(m, t);
            if let Some(feedforward) = feedforward {
                check::shape("N_r", feedforward, (m, t))?;
                entry.rows_mut(0, n).copy_from(&(b * *feedforward));
                direct.copy_from(feedforward);
            }
            (a_e, b_e, k, entry, direct)
        }
        Action::Feedforward(gain) => {
            check::shape("N_r", gain, (m, gain.ncols()))?;
            (a.clone(), b.clone(), k_x.clone(), b * *gain, (*gain).clone())
        }
    };
    let states = DMatrix::identity(n, a_e.nrows());
    let t = direct.ncols();
    Ok(StateSpace {
        a: a_e + b_e * &k,
        b: entry,
        c: stacked(&states, &k),
        d: stacked(&DMatrix::zeros(n, t), &direct),
        domain,
    })
}

/// The way in which references act on the loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Action<'a> {
    /// Integral action.
    Integral {
        /// H C, t x n: from the states to H y.
        output: &'a DMatrix<f64>,
        /// `K_i`, m x t: the gain of the integrals.
        gain: &'a DMatrix<f64>,
        /// The feedforward `N_r`, m x t, in addition to the integrals.
        feedforward: Option<&'a DMatrix<f64>>,
    },
    /// The feedforward `N_r`, m x t, without integrals.
    Feedforward(&'a DMatrix<f64>),
}
