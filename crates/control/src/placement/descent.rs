//! Quasi-Newton descent for functions that need not be differentiable everywhere.

use nalgebra::{DMatrix, DVector};

const ITERATIONS: usize = 300;
const TRIALS: usize = 20;
/// Fraction of the predicted decrease that a step must reach.
const ENOUGH: f64 = 1e-4;
/// Largest fraction of the slope that may remain after a step.
const FLATTER: f64 = 0.9;
/// Relative rounding error of the function; a step that changes the function by less is accepted if it reduces the
/// slope.
const NOISE: f64 = 1e-15;
/// The descent ends when this many iterations lower the value by less than the tolerance.
const PATIENCE: usize = 10;
/// The descent ends at a gradient shorter than this.
const FLAT: f64 = 1e-12;

/// Value and gradient at a point; None where the function is not defined.
type Evaluation = Option<(f64, DVector<f64>)>;

struct Point {
    at: DVector<f64>,
    value: f64,
    gradient: DVector<f64>,
}

/// Minimises a function from the starting point zero; returns the point and its value (infinite if
/// the function is undefined at zero). It ends when ten iterations lower the value by less than `tolerance`.
///
/// BFGS with a line search by bisection for the weak Wolfe conditions: Lewis and Overton (see [`super::place`]),
/// algorithms 2.1, 2.6.
pub(crate) fn minimise(
    function: &dyn Fn(&DVector<f64>) -> Evaluation,
    dimension: usize,
    tolerance: f64,
) -> (DVector<f64>, f64) {
    let start = DVector::zeros(dimension);
    let Some((value, gradient)) = function(&start) else {
        return (start, f64::INFINITY);
    };
    let mut here = Point { at: start, value, gradient };
    let mut inverse_hessian = DMatrix::identity(dimension, dimension);
    let mut earlier = here.value;
    for iteration in 1..=ITERATIONS {
        let direction = -(&inverse_hessian * &here.gradient);
        if here.gradient.norm() <= FLAT || direction.dot(&here.gradient) >= 0.0 {
            break;
        }
        let Some(next) = search(function, &here, &direction) else {
            break;
        };
        let (step, change) = (&next.at - &here.at, &next.gradient - &here.gradient);
        update(&mut inverse_hessian, &step, &change);
        here = next;
        if iteration % PATIENCE == 0 {
            if here.value > earlier - tolerance {
                break;
            }
            earlier = here.value;
        }
    }
    (here.at, here.value)
}

/// Searches for the next point along `direction`; None if no trial lowers the value.
fn search(
    function: &dyn Fn(&DVector<f64>) -> Evaluation,
    from: &Point,
    direction: &DVector<f64>,
) -> Option<Point> {
    let slope = direction.dot(&from.gradient);
    let noise = NOISE * from.value.abs();
    let is_accepted = |value: f64, gradient: &DVector<f64>, length: f64| {
        value < from.value + ENOUGH * length * slope
            || (value <= from.value + noise && direction.dot(gradient).abs() < -FLATTER * slope)
    };
    let (mut low, mut high, mut length) = (0.0, f64::INFINITY, 1.0);
    let mut accepted = None;
    for _ in 0..TRIALS {
        let at = &from.at + direction * length;
        match function(&at) {
            Some((value, gradient)) if is_accepted(value, &gradient, length) => {
                let flat_enough = direction.dot(&gradient) > FLATTER * slope;
                accepted = Some(Point { at, value, gradient });
                if flat_enough {
                    break;
                }
                low = length;
            }
            _ => high = length,
        }
        length = if high.is_finite() { 0.5 * (low + high) } else { 2.0 * low };
    }
    accepted
}

/// The BFGS update of an inverse Hessian: H becomes (I - r s y') H (I - r y s') + r s s' with r = 1 / s'y.
fn update(h: &mut DMatrix<f64>, s: &DVector<f64>, y: &DVector<f64>) {
    let curvature = s.dot(y);
    if curvature <= f64::EPSILON * s.norm() * y.norm() {
        return;
    }
    let r = 1.0 / curvature;
    let hy = &*h * y;
    let weight = r * (1.0 + r * y.dot(&hy));
    *h += s * s.transpose() * weight - (&hy * s.transpose() + s * hy.transpose()) * r;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_minimum_of_a_function_with_a_kink_is_found() {
        let kinked = |t: &DVector<f64>| {
            let (x, y) = (t[0] - 1.0, t[1] + 2.0);
            let gradient = DVector::from_vec(vec![5.0 * x.signum(), 2.0 * y]);
            Some((5.0 * x.abs() + y * y, gradient))
        };
        let (at, value) = minimise(&kinked, 2, 1e-6);
        assert!(value < 1e-6, "{value}");
        assert!((at - DVector::from_vec(vec![1.0, -2.0])).norm() < 1e-3);
    }

    #[test]
    fn the_minimum_of_a_narrow_valley_is_found() {
        let valley = |t: &DVector<f64>| {
            let (x, y) = (t[0], t[1]);
            let across = y - x * x;
            let gradient =
                DVector::from_vec(vec![2.0 * (x - 1.0) - 400.0 * x * across, 200.0 * across]);
            Some(((x - 1.0).powi(2) + 100.0 * across * across, gradient))
        };
        let (at, _) = minimise(&valley, 2, 1e-6);
        assert!((at - DVector::from_element(2, 1.0)).norm() < 1e-8);
    }
}
