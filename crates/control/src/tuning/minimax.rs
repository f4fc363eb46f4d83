//! The direction of descent of a maximum of several functions.

use nalgebra::{DMatrix, DVector};

const SWEEPS: usize = 400;
/// Relative precision of the multipliers' conditions.
const PRECISION: f64 = 1e-9;

/// The value and the gradient of a function.
pub(super) struct Cut {
    pub(super) value: f64,
    pub(super) gradient: DVector<f64>,
}

/// The minimum of the model max over i of `(f_i + g_i' d)` + d' W^-1 d / 2, W the inverse Hessian.
pub(super) struct Direction {
    /// The direction d.
    pub(super) step: DVector<f64>,
    /// The multipliers: not negative, with the sum 1.
    pub(super) multipliers: Vec<f64>,
    /// The predicted decrease of the maximum: the largest `f_i` less the largest `f_i + g_i' d`.
    pub(super) decrease: f64,
}

/// Computes the direction from its dual: the least of `l' G' W G l / 2 - f' l` over l >= 0, sum l = 1.
///
/// Method: exchange between the pair of multipliers that violates the conditions most (J. Platt 1998).
pub(super) fn direction(cuts: &[Cut], inverse: &DMatrix<f64>) -> Direction {
    let count = cuts.len();
    let columns: Vec<_> = cuts.iter().map(|cut| cut.gradient.clone()).collect();
    let g = DMatrix::from_columns(&columns);
    let gram = g.tr_mul(&(inverse * &g));
    let values = DVector::from_iterator(count, cuts.iter().map(|cut| cut.value));
    let first = values.imax();
    let mut multipliers = DVector::zeros(count);
    multipliers[first] = 1.0;
    let mut slope = gram.column(first) - &values;
    for _ in 0..SWEEPS * count {
        let target = slope.imin();
        let positive = (0..count).filter(|&at| multipliers[at] > 0.0);
        let source = positive.max_by(|&i, &j| slope[i].total_cmp(&slope[j]));
        let Some(source) = source else { break };
        let violation = slope[source] - slope[target];
        if violation <= PRECISION * values[first].abs() {
            break;
        }
        let curvature =
            gram[(target, target)] + gram[(source, source)] - 2.0 * gram[(target, source)];
        let amount = (violation / curvature.max(f64::MIN_POSITIVE)).min(multipliers[source]);
        multipliers[target] += amount;
        multipliers[source] -= amount;
        slope += (gram.column(target) - gram.column(source)) * amount;
    }
    let step = -(inverse * (&g * &multipliers));
    let model = &values + g.tr_mul(&step);
    let decrease = values[first] - model.max();
    Direction { step, multipliers: multipliers.iter().copied().collect(), decrease }
}

/// Updates the inverse Hessian matrix for a step and the change of the gradient (BFGS); no update if the curvature
/// along the step is not positive.
pub(super) fn update(inverse: &mut DMatrix<f64>, step: &DVector<f64>, change: &DVector<f64>) {
    let curvature = step.dot(change);
    if curvature <= 1e-10 * step.norm() * change.norm() {
        return;
    }
    let image = &*inverse * change;
    let scale = (1.0 + change.dot(&image) / curvature) / curvature;
    *inverse += step * step.transpose() * scale
        - (&image * step.transpose() + step * image.transpose()) / curvature;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_maximum_of_two_lines_and_a_parabola_has_the_step_of_its_closed_form() {
        // max(1 + d, 1 - d) + d^2 / 2 is least at d = 0; max(2 + d, 1 - d) + d^2 / 2 at d = -1/2.
        let line = |value, slope| Cut { value, gradient: DVector::from_element(1, slope) };
        let unit = DMatrix::identity(1, 1);
        let even = direction(&[line(1.0, 1.0), line(1.0, -1.0)], &unit);
        assert!(even.step[0].abs() < 1e-9 && (even.multipliers[0] - 0.5).abs() < 1e-9);
        let uneven = direction(&[line(2.0, 1.0), line(1.0, -1.0)], &unit);
        assert!((uneven.step[0] + 0.5).abs() < 1e-9, "{}", uneven.step[0]);
        assert!((uneven.decrease - 0.5).abs() < 1e-9);
    }

    #[test]
    fn updates_along_all_axes_of_a_quadratic_give_its_inverse() {
        let hessian = DMatrix::from_row_slice(2, 2, &[4.0, 1.0, 1.0, 3.0]);
        let mut inverse = DMatrix::identity(2, 2);
        let first = DVector::from_row_slice(&[1.0, 0.0]);
        // The second step is conjugate to the first one.
        let second = DVector::from_row_slice(&[-1.0, 4.0]);
        for step in [first, second] {
            update(&mut inverse, &step, &(&hessian * &step));
        }
        assert!((inverse * hessian - DMatrix::identity(2, 2)).amax() < 1e-12);
    }
}
