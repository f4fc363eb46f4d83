//! The Hermitian form by which scales D and G prove a bound.

use super::hermitian::times;
use crate::blocks::ComplexMatrix;
use nalgebra::Complex;

/// F = beta^2 D - M* D M - j (G M - M* G).
///
/// If F is positive definite, I - Delta M is regular for every Delta of the structure with a norm up to 1 / beta. With
/// a w = Delta M w other than 0 and z = M w, w* F w = beta^2 w* D w - z* D z would be at most zero, because D commutes
/// with Delta and G Delta is Hermitian.
pub(super) fn form(
    m: &ComplexMatrix,
    d: &ComplexMatrix,
    g: &ComplexMatrix,
    beta: f64,
) -> ComplexMatrix {
    let (adjoint, j_g) = (m.adjoint(), g.map(|x| x * Complex::i()));
    let left = times(&adjoint, d) + &j_g;
    d.scale(beta * beta) - times(&left, m) + times(&adjoint, &j_g)
}

/// The sums of the moduli of the terms in each diagonal entry of [`form`]: its rounding errors are relative to them.
pub(super) fn form_size(
    m: &ComplexMatrix,
    d: &ComplexMatrix,
    g: &ComplexMatrix,
    beta: f64,
) -> Vec<f64> {
    let [m, d, g] = [m, d, g].map(|matrix| matrix.map(Complex::norm));
    let (of_d, of_g) = (&d * &m, &g * &m);
    let size = |at: usize| {
        beta * beta * d[(at, at)] + m.column(at).dot(&of_d.column(at)) + 2.0 * of_g[(at, at)]
    };
    (0..m.ncols()).map(size).collect()
}
