//! The feedforward of references beside integral action.

use super::{extended_pair, integration, require_residual};
use crate::blocks::beside;
use crate::eigen::eigenvalues;
use crate::rank::controllable_part;
use crate::svd::Svd;
use crate::{Domain, Error, check};
use nalgebra::{Complex, DMatrix};

/// Rounding gives a double real eigenvalue an imaginary part of at most this fraction of its modulus.
const DOUBLE: f64 = 1e-8;

/// The feedforward `N_r` beside integral action, and the eigenvalues that references do not excite.
#[derive(Debug, Clone, PartialEq)]
pub struct IntegralFeedforward {
    /// The feedforward `N_r`, m x t.
    pub gain: DMatrix<f64>,
    /// The t slowest eigenvalues of the feedback, which no reference excites.
    pub silent: Vec<Complex<f64>>,
}

/// The feedforward `N_r`, m x t, beside integral action: the references do not excite the t slowest modes.
///
/// ```text
/// x_e' = (A_e + B_e K) x_e + [B N_r; I] r,   x_e = [x; x_i]        sampled: T I in place of I
/// W' (A_e + B_e K) = S W',   W = [W_x; W_i], (n + t) x t
/// W' [B N_r; I] = 0,   so   N_r = -(W_x' B)^+ W_i'                 sampled: -T (W_x' B)^+ W_i'
/// ```
///
/// S has the t slowest eigenvalues that the feedback moves, by real part or, sampled, by modulus; the
/// uncontrollable modes of A, which references do not excite, are left out first. With this `N_r` the signal s = W'
/// `x_e` obeys s' = S s for all references: only disturbances, faults and errors of the model move it. References
/// excite only the other n modes, which are faster. H y reaches a constant r for every plant for which the loop is
/// stable, because the loop contains the integrals. `N_r` does not change the response to faults and disturbances.
///
/// `a`, `b`, `output`: as in [`extended_pair`]; `k`: K = [`K_x`, `K_i`], m x (n + t), such that `A_e` + `B_e` K
/// is stable. W is the left null space of the polynomial of `A_e` + `B_e` K with these t roots, from a singular
/// value decomposition. Of several `N_r` (more commands than references) the result is the one of least norm in the
/// given units. The inner error says why no `N_r` exists: the t slowest eigenvalues end with half of a complex pair, or
/// `W_x'` B has a rank below t.
///
/// For one reference `N_r` is the classical set-point weight, whose zero cancels the slowest pole: K. J.
/// Åström and T. Hägglund, PID controllers, 2nd edition (1995), section 3.4; G. F. Franklin, J. D. Powell and
/// M. Workman (1998), section 8.5.
///
/// # Errors
///
/// Same as [`extended_pair`]; [`Error::NotHurwitz`], [`Error::NotSchur`] for an unstable feedback;
/// [`Error::NotConverged`]; [`Error::ResidualTooLarge`] when W is not invariant to 1e-8 or W' [B `N_r`; I]
/// is above 1e-9, both relative.
pub fn integral_feedforward(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    output: &DMatrix<f64>,
    k: &DMatrix<f64>,
    domain: Domain,
) -> Result<Result<IntegralFeedforward, &'static str>, Error> {
    let controlled = closed_loop(a, b, output, k, domain)?;
    crate::stability::require_stable("A_e + B_e K", &controlled, domain)?;
    let (n, t, part) = (a.nrows(), output.nrows(), controllable_part(a, b)?);
    if part.fixed.is_empty() {
        return of_controllable(&controlled, b, t, domain);
    }
    let gain = beside(&(k.columns(0, n) * &part.basis), &k.columns(n, t).into());
    let controlled = closed_loop(&part.a, &part.b, &(output * &part.basis), &gain, domain)?;
    of_controllable(&controlled, &part.b, t, domain)
}

/// The dynamics `A_e` + `B_e` K of the loop with integrals.
fn closed_loop(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    output: &DMatrix<f64>,
    k: &DMatrix<f64>,
    domain: Domain,
) -> Result<DMatrix<f64>, Error> {
    let (a_e, b_e) = extended_pair(a, b, output, domain)?;
    check::shape("K", k, (b.ncols(), a_e.nrows()))?;
    Ok(a_e + b_e * k)
}

/// Same as [`integral_feedforward`], for a controllable (A, B); `controlled` is `A_e` + `B_e` K, t the number of
/// integrals.
fn of_controllable(
    controlled: &DMatrix<f64>,
    b: &DMatrix<f64>,
    t: usize,
    domain: Domain,
) -> Result<Result<IntegralFeedforward, &'static str>, Error> {
    let n = b.nrows();
    let Some(silent) = slowest(&eigenvalues(controlled)?, t, domain) else {
        return Ok(Err(
            "the slowest eigenvalues of the feedback, one for each integral, end with half of a complex \
             pair; expected a real eigenvalue slower than this pair, or as slow",
        ));
    };
    let w = left_invariant(controlled, &silent)?;
    let dynamics = w.transpose() * controlled * &w;
    let residual =
        (w.transpose() * controlled - &dynamics * w.transpose()).norm() / controlled.norm();
    require_residual("W' (A_e + B_e K) = S W'", residual, 1e-8)?;
    let input = w.rows(0, n).transpose() * b;
    let svd = Svd::new(&input.transpose())?;
    if svd.rank(1e-9) < t {
        return Ok(Err(
            "the commands act on the slowest modes of the feedback in fewer independent ways than there \
             are integrals",
        ));
    }
    let required = w.rows(n, t).transpose() * -integration(domain).0;
    // (W_x' B)^+ = (B' W_x)^+ transposed.
    let left = svd.left.columns(0, t);
    let gain = left * svd.whitening(t).transpose() * &required;
    let residual = (&input * &gain - &required).norm() / required.norm();
    require_residual("W' [B N_r; I] = 0", residual, 1e-9)?;
    Ok(Ok(IntegralFeedforward { gain, silent }))
}

/// The `count` slowest eigenvalues; None if they would split a complex pair, or if there are fewer.
fn slowest(values: &[Complex<f64>], count: usize, domain: Domain) -> Option<Vec<Complex<f64>>> {
    let exact = |value: &Complex<f64>| {
        let is_real = value.im.abs() <= DOUBLE * value.norm();
        if is_real { Complex::from(value.re) } else { *value }
    };
    let mut upper: Vec<_> = values.iter().map(exact).filter(|value| value.im >= 0.0).collect();
    // Among equally slow eigenvalues a real one precedes a pair.
    upper.sort_by(|x, y| {
        domain.excess(*y).total_cmp(&domain.excess(*x)).then(x.im.total_cmp(&y.im))
    });
    let with_conjugate =
        |value: Complex<f64>| std::iter::once(value).chain((value.im > 0.0).then(|| value.conj()));
    let slow: Vec<_> = upper.into_iter().flat_map(with_conjugate).take(count).collect();
    let ends_with_half_a_pair = slow.last().is_some_and(|last| last.im > 0.0);
    (slow.len() == count && !ends_with_half_a_pair).then_some(slow)
}

/// An orthonormal basis W of the left invariant subspace of `a` for the eigenvalues `values`, which contain both
/// halves of each complex pair.
fn left_invariant(a: &DMatrix<f64>, values: &[Complex<f64>]) -> Result<DMatrix<f64>, Error> {
    let n = a.nrows();
    let identity = DMatrix::<f64>::identity(n, n);
    let mut polynomial = identity.clone();
    for value in values.iter().filter(|value| value.im >= 0.0) {
        let factor = if value.im > 0.0 {
            a * a - a * (2.0 * value.re) + &identity * value.norm_sqr()
        } else {
            a - &identity * value.re
        };
        let product = polynomial * factor;
        let size = product.norm();
        polynomial = if size > 0.0 { product / size } else { product };
    }
    let svd = Svd::new(&polynomial.transpose())?;
    Ok(svd.right.columns(n - values.len(), values.len()).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_double_real_eigenvalue_that_rounding_makes_a_pair_is_no_pair() {
        let pair = |im: f64| [Complex::new(-1.0, im), Complex::new(-1.0, -im)];
        let of = |[one, other]: [Complex<f64>; 2], count| {
            slowest(&[one, Complex::from(-3.0), other], count, Domain::Continuous)
        };
        let real = Complex::from(-1.0);
        assert_eq!(of(pair(1e-15), 1), Some(vec![real]));
        assert_eq!(of(pair(1e-15), 2), Some(vec![real, real]));
        assert_eq!(of(pair(1e-3), 1), None);
        assert_eq!(of(pair(1e-3), 2), Some(pair(1e-3).to_vec()));
    }
}
