//! The member of a family of residuals with the largest gain for its weakest fault.

use crate::balance::unit_columns;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// The largest number of faults for which all patterns of signs are tried.
const ENUMERATED: usize = 7;
const SWEEPS: usize = 2000;

/// A combination of the members of a family.
pub(super) struct Direction {
    /// One factor for each member.
    pub(super) factors: DVector<f64>,
    /// The smallest relative gain of the faults. The gain of a fault is relative to the largest gain that this fault
    /// can have for the same effect of noise: 1 if each fault has its largest gain.
    pub(super) quality: f64,
}

/// The combination whose smallest gain of a fault is largest for a given effect of noise.
///
/// ```text
/// max over v of min over j of |g_j' v| / |g_j|_W,  v' W v = 1,  |g|_W^2 = g' W^-1 g
/// ```
///
/// `gains`: the columns are the `g_j`, none zero; `noise`: W, positive definite. For each pattern of
/// signs the problem is a quadratic programme with one constraint per fault, solved by Hildreth's
/// sweeps over the multipliers (C. Hildreth, A quadratic programming procedure, Naval Research
/// Logistics Quarterly 4 (1957)). With more than 7 faults only one pattern is tried: each fault has the
/// sign of its product with the first one. None if no pattern of signs is feasible.
pub(super) fn strongest_weakest(
    gains: &DMatrix<f64>,
    noise: &Cholesky<f64, Dyn>,
) -> Option<Direction> {
    let unit = unit_columns(&noise.l().solve_lower_triangular(gains)?);
    let products = unit.tr_mul(&unit);
    let solutions = signs(&products)
        .into_iter()
        .filter_map(|signs| multipliers(&products, &signs))
        .map(|multipliers| &unit * multipliers);
    let shortest = solutions.min_by(|x, y| x.norm().total_cmp(&y.norm()))?;
    let quality = 1.0 / shortest.norm();
    let factors = noise.l().transpose().solve_upper_triangular(&shortest)?;
    Some(Direction { factors, quality })
}

/// The patterns of signs to try, the first fault positive.
fn signs(products: &DMatrix<f64>) -> Vec<Vec<f64>> {
    let faults = products.nrows();
    let sign = |negative: bool| if negative { -1.0 } else { 1.0 };
    if faults > ENUMERATED {
        return vec![products.column(0).iter().map(|x| sign(*x < 0.0)).collect()];
    }
    (0..1_u32 << (faults - 1))
        .map(|bits| (0..faults).map(|fault| sign((bits << 1) >> fault & 1 == 1)).collect())
        .collect()
}

/// Multipliers of the shortest v with `s_j` `u_j'` v >= 1, times the signs `s_j`, scaled so that the smallest
/// of the products is 1; None if the sweeps find no such v.
///
/// `products`: `u_i'` `u_j`.
fn multipliers(products: &DMatrix<f64>, signs: &[f64]) -> Option<DVector<f64>> {
    let faults = signs.len();
    let mut signed = DVector::zeros(faults);
    for _ in 0..SWEEPS {
        let mut change: f64 = 0.0;
        for j in 0..faults {
            let before: f64 = signed[j];
            let margin = signs[j] * products.column(j).dot(&signed);
            let after = signs[j] * (before * signs[j] + 1.0 - margin).max(0.0);
            signed[j] = after;
            change = change.max((after - before).abs());
        }
        if change <= 1e-12 * (1.0 + signed.norm()) {
            break;
        }
    }
    let least = (products * &signed).iter().zip(signs).map(|(x, s)| x * s).fold(f64::MAX, f64::min);
    (least > 0.5).then(|| signed / least)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn direction(gains: &[f64], faults: usize) -> Option<Direction> {
        let gains = DMatrix::from_column_slice(gains.len() / faults, faults, gains);
        let noise = DMatrix::identity(gains.nrows(), gains.nrows()).cholesky().unwrap();
        strongest_weakest(&gains, &noise)
    }

    #[test]
    fn two_orthogonal_faults_get_the_diagonal_and_opposite_ones_opposite_signs() {
        let diagonal = direction(&[3.0, 0.0, 0.0, 5.0], 2).unwrap();
        assert!((diagonal.quality - 0.5_f64.sqrt()).abs() < 1e-12);
        assert!((diagonal.factors[0] - diagonal.factors[1]).abs() < 1e-12);
        let opposite = direction(&[1.0, 0.1, -1.0, 0.1], 2).unwrap();
        assert!((opposite.quality - 1.0 / 1.01_f64.sqrt()).abs() < 1e-9);
        assert!(opposite.factors[0] > 0.9);
    }

    /// The best of 100,000 directions in the plane, for three faults.
    #[test]
    fn no_direction_of_a_fine_grid_is_better() {
        let gains = [1.0, 0.2, -0.3, 1.0, 0.8, 0.9];
        let best = direction(&gains, 3).unwrap().quality;
        let units: Vec<[f64; 2]> =
            gains.chunks(2).map(|g| [g[0] / g[0].hypot(g[1]), g[1] / g[0].hypot(g[1])]).collect();
        let on_grid = (0..100_000).map(|k| {
            let (s, c) = (f64::from(k) * std::f64::consts::PI / 1e5).sin_cos();
            units.iter().map(|u| (u[0] * c + u[1] * s).abs()).fold(f64::MAX, f64::min)
        });
        let on_grid = on_grid.fold(0.0, f64::max);
        assert!((best - on_grid).abs() < 1e-4, "{best} {on_grid}");
    }
}
