//! The example of Patton and Klinkhieo (2009): an inverted pendulum on a cart.

use crate::matrix;
use control::aso::{Estimator, FaultyPlant, Gains};
use nalgebra::DMatrix;

pub(crate) const CONTROLLER_POLES: [f64; 4] = [-4.5, -6.0, -7.5, -9.0];
pub(crate) const OBSERVER_POLES: [f64; 5] = [-1200.0, -1500.0, -1800.0, -2100.0, -3000.0];

fn pendulum(a: DMatrix<f64>, b: DMatrix<f64>) -> FaultyPlant {
    let c = matrix(2, 4, &[1., 0., 0., 0., 0., 1., 0., 0.]);
    let f_a = -&b;
    FaultyPlant::with_constant_faults(a, b, c, f_a)
}

/// A and B as printed.
pub(crate) fn printed() -> FaultyPlant {
    let a = [
        0., 0., 1., 0., 0., 0., 0., 1., //
        0., -1.9333, -1.9872, 0.0091, 0., 36.9771, 6.2589, -0.1738,
    ];
    pendulum(matrix(4, 4, &a), matrix(4, 1, &[0., 0., 0.3205, -1.0095]))
}

/// A and B from the parameters that the printed ones determine.
pub(crate) fn plant() -> FaultyPlant {
    let (cart, m, j, l, f_x, f_theta, g) = (3.2, 0.535, 0.062, 0.365, 6.2, 0.009, 9.807);
    let (total, ml) = (cart + m, m * l);
    let d = total * j - ml * ml;
    let a = [
        [0., 0., 1., 0.],
        [0., 0., 0., 1.],
        [0., -ml * ml * g / d, -f_x * j / d, ml * f_theta / d],
        [0., total * ml * g / d, ml * f_x / d, -total * f_theta / d],
    ];
    pendulum(matrix(4, 4, &a.concat()), matrix(4, 1, &[0., 0., j / d, -ml / d]))
}

/// The printed L with the signs of L[3,2] and L[4,2] reversed, L = [`L_x`; -`L_f`].
pub(crate) fn repaired_gains() -> Gains {
    let l_x = [38.0, -4.8, -3.8, 51.8, 379.2, 169.0, -129.7, 884.1];
    Gains {
        estimator: Estimator::Prediction,
        k_x: matrix(1, 4, &[184.10, 365.71, 123.66, 63.86]),
        k_f: matrix(1, 1, &[1.0]),
        l_x: matrix(4, 2, &l_x),
        l_f: matrix(1, 2, &[-3343.2, 894.1]),
        p_f: None,
        integral: None,
    }
}

/// The printed entries have four decimals.
#[test]
fn the_parameters_give_the_printed_matrices_to_their_digits() {
    assert!((plant().a - printed().a).amax() < 5.1e-5);
    assert!((plant().b - printed().b).amax() < 5.1e-5);
}
