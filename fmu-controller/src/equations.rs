//! The equations of the controller, and their derivative along a direction.
//!
//! With z = [x_hat; f_hat], measurements y and the command u that is really applied (equations
//! (1), (2), (4), (5), (18) of Patton and Klinkhieo (2009) in the general form)
//!
//! ```text
//! x_hat' = A x_hat + B u + F_a f_hat + L_x (y - C x_hat)
//! f_hat' = L_f (y - C x_hat)                    while estimating, else 0
//! u      = K_x x_hat + K_f f_hat                while compensating, else K_x x_hat
//! ```
//!
//! and every channel of u kept within its limits.

use serde::{Deserialize, Serialize};

use crate::design::Design;
use crate::matrix::Matrix;

/// What the equations start from, or a direction in all of it.
pub(crate) struct Knowns<'a> {
    pub(crate) design: &'a Design,
    pub(crate) z: &'a [f64],
    pub(crate) y: &'a [f64],
}

/// The measurements over a step: y(t) = `value` + `slope` t.
#[derive(Clone, Copy)]
pub(crate) struct Measurement<'a> {
    pub(crate) value: &'a [f64],
    pub(crate) slope: &'a [f64],
}

/// Which of the linear systems is in force: as long as the mode stays, all equations are linear.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Mode {
    /// K_f f_hat is part of the command.
    pub(crate) compensating: bool,
    /// f_hat follows the observer.
    pub(crate) estimating: bool,
    /// Bit j: channel j is at its lower limit.
    lower: u64,
    /// Bit j: channel j is at its upper limit.
    upper: u64,
}

impl Mode {
    /// The mode in which z evolves from here.
    pub(crate) fn of(design: &Design, z: &[f64], compensating: bool, estimating: bool) -> Self {
        let mut mode = Self { compensating, estimating, lower: 0, upper: 0 };
        for (j, actuator) in design.actuators.iter().enumerate() {
            if let Some([low, high]) = actuator.limits {
                let command = mode.free_command(design, z, j);
                mode.lower |= u64::from(command < low) << j;
                mode.upper |= u64::from(command > high) << j;
            }
        }
        mode
    }

    /// Whether channel `j` is at its lower (0) or upper (1) limit.
    pub(crate) fn is_at(self, side: usize, j: usize) -> bool {
        [self.lower, self.upper][side] & (1 << j) != 0
    }

    /// Whether channel `j` is at a limit.
    pub(crate) fn is_limited(self, j: usize) -> bool {
        self.is_at(0, j) || self.is_at(1, j)
    }

    /// Whether both have the same matrices.
    pub(crate) fn has_the_system_of(self, other: Self) -> bool {
        (self.compensating, self.estimating, self.lower | self.upper)
            == (other.compensating, other.estimating, other.lower | other.upper)
    }

    /// The limit that channel `j` is at.
    pub(crate) fn limit(self, design: &Design, j: usize) -> Option<f64> {
        let side = [0, 1].into_iter().find(|side| self.is_at(*side, j))?;
        design.actuators[j].limits.map(|limits| limits[side])
    }

    /// Channel `j` of K_x x_hat + K_f f_hat, the second part while compensating.
    pub(crate) fn free_command(self, design: &Design, z: &[f64], j: usize) -> f64 {
        let (x_hat, f_hat) = z.split_at(design.states.len());
        let mut command = design.k_x.row_times(j, x_hat);
        if self.compensating {
            command += design.k_f.row_times(j, f_hat);
        }
        command
    }

    /// The command u at z.
    pub(crate) fn command(self, design: &Design, z: &[f64], u: &mut [f64]) {
        for (j, u) in u.iter_mut().enumerate() {
            *u = self.limit(design, j).unwrap_or_else(|| self.free_command(design, z, j));
        }
    }

    /// z' and u' at z under the command `u`, `offset` s after the begin of `y`.
    pub(crate) fn slopes(
        self,
        design: &Design,
        z: &[f64],
        (y, offset): (Measurement<'_>, f64),
        u: &[f64],
        (z_slope, u_slope): (&mut [f64], &mut [f64]),
    ) {
        let Design { a, b, c, f_a, k_x, k_f, l_x, l_f, .. } = design;
        let (x_hat, f_hat) = z.split_at(design.states.len());
        z_slope.fill(0.0);
        let (x_slope, f_slope) = z_slope.split_at_mut(design.states.len());
        for (i, slope) in x_slope.iter_mut().enumerate() {
            *slope = a.row_times(i, x_hat) + b.row_times(i, u) + f_a.row_times(i, f_hat);
        }
        for (k, (value, slope)) in y.value.iter().zip(y.slope).enumerate() {
            let innovation = value + slope * offset - c.row_times(k, x_hat);
            for (i, slope) in x_slope.iter_mut().enumerate() {
                *slope += l_x.entry(i, k) * innovation;
            }
            for (i, slope) in f_slope.iter_mut().enumerate().filter(|_| self.estimating) {
                *slope += l_f.entry(i, k) * innovation;
            }
        }
        for (j, slope) in u_slope.iter_mut().enumerate() {
            let fault = if self.compensating { k_f.row_times(j, f_slope) } else { 0.0 };
            *slope = if self.is_limited(j) { 0.0 } else { k_x.row_times(j, x_slope) + fault };
        }
    }

    /// [`Mode::command`] and [`Mode::slopes`] differentiated: du and dz' at `point` along `along`,
    /// by the product rule in every term. Exact.
    pub(crate) fn differentiate(
        self,
        point: &Knowns<'_>,
        u: &[f64],
        along: &Knowns<'_>,
        (du, dz_slope): (&mut [f64], &mut [f64]),
    ) {
        let n = point.design.states.len();
        let both = |matrix: fn(&Design) -> &Matrix| [matrix(point.design), matrix(along.design)];
        let [x_hat, f_hat] = [[&point.z[..n], &along.z[..n]], [&point.z[n..], &along.z[n..]]];
        for (j, du) in du.iter_mut().enumerate() {
            *du = self.limit(along.design, j).unwrap_or_else(|| {
                let fault = product(both(|design| &design.k_f), j, f_hat);
                let state = product(both(|design| &design.k_x), j, x_hat);
                if self.compensating { state + fault } else { state }
            });
        }
        let (dx_slope, df_slope) = dz_slope.split_at_mut(n);
        for (i, slope) in dx_slope.iter_mut().enumerate() {
            *slope = product(both(|design| &design.a), i, x_hat)
                + product(both(|design| &design.b), i, [u, du])
                + product(both(|design| &design.f_a), i, f_hat);
        }
        df_slope.fill(0.0);
        for (k, (y, dy)) in point.y.iter().zip(along.y).enumerate() {
            let innovation = y - point.design.c.row_times(k, x_hat[0]);
            let change = dy - product(both(|design| &design.c), k, x_hat);
            let term = |[gain, dgain]: [&Matrix; 2], i| {
                gain.entry(i, k) * change + dgain.entry(i, k) * innovation
            };
            for (i, slope) in dx_slope.iter_mut().enumerate() {
                *slope += term(both(|design| &design.l_x), i);
            }
            for (i, slope) in df_slope.iter_mut().enumerate().filter(|_| self.estimating) {
                *slope += term(both(|design| &design.l_f), i);
            }
        }
    }
}

/// M dv + dM v in row `row`, of a matrix M and a vector v with their directions.
fn product([matrix, along]: [&Matrix; 2], row: usize, [vector, change]: [&[f64]; 2]) -> f64 {
    matrix.row_times(row, change) + along.row_times(row, vector)
}
