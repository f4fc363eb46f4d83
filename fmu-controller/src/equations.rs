//! The equations of the controller, and their derivative along a direction.
//!
//! With z = [x_hat; f_hat; y_f], measurements y and the command u that is really applied (equations
//! (1), (2), (4), (5), (18) of Patton and Klinkhieo (2009) in the general form)
//!
//! ```text
//! x_hat' = A x_hat + B u + F_a f_hat + L_x (y - C x_hat)
//! f_hat' = A_f f_hat + L_f (y - C x_hat)        while estimating, else 0
//! u      = K_x x_hat + K_f f_hat                while compensating, else K_x x_hat
//! ```
//!
//! and every channel of u kept within its limits. A design without A_f has A_f = 0. In a design with
//! a filter, y_f takes the place of y, and
//!
//! ```text
//! y_f' = W (y - y_f)
//! ```
//!
//! else z has no y_f. In a design with an operating point all signals, limits included, are
//! deviations from it. A sampled controller has the same terms (`sampled.rs`).

use serde::{Deserialize, Serialize};

use crate::design::Design;
use crate::matrix::Matrix;
use crate::signals::Signals;

/// What the equations start from, or a direction in all of it.
#[derive(Clone, Copy)]
pub(crate) struct Knowns<'a> {
    pub(crate) design: &'a Design,
    pub(crate) signals: &'a Signals,
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
    /// With no channel at a limit.
    pub(crate) fn free(compensating: bool, estimating: bool) -> Self {
        Self { compensating, estimating, lower: 0, upper: 0 }
    }

    /// The mode in which z evolves from here.
    pub(crate) fn of(design: &Design, z: &[f64], compensating: bool, estimating: bool) -> Self {
        let mut mode = Self::free(compensating, estimating);
        for (j, actuator) in design.actuators.iter().enumerate() {
            if let Some([low, high]) = actuator.range() {
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

    /// The one of a pair of limits that channel `j` is at.
    pub(crate) fn side(self, [low, high]: [f64; 2], j: usize) -> f64 {
        if self.is_at(0, j) { low } else { high }
    }

    /// The limit that channel `j` is at.
    pub(crate) fn limit(self, design: &Design, j: usize) -> Option<f64> {
        if !self.is_limited(j) {
            return None;
        }
        design.actuators[j].range().map(|limits| self.side(limits, j))
    }

    /// Channel `j` of K_x x_hat + K_f f_hat, the second part while compensating.
    pub(crate) fn free_command(self, design: &Design, z: &[f64], j: usize) -> f64 {
        let [x_hat, f_hat, _] = design.parts(z);
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

    /// A x_hat + B u + F_a f_hat and, while estimating, A_f f_hat; zero for y_f.
    pub(crate) fn free_rates(self, design: &Design, z: &[f64], u: &[f64], rates: &mut [f64]) {
        let [x_hat, f_hat, _] = design.parts(z);
        rates.fill(0.0);
        let [x_rates, f_rates, _] = design.parts_mut(rates);
        for (i, rate) in x_rates.iter_mut().enumerate() {
            *rate = design.a.row_times(i, x_hat)
                + design.b.row_times(i, u)
                + design.f_a.row_times(i, f_hat);
        }
        for a_f in design.a_f.iter().filter(|_| self.estimating) {
            for (i, rate) in f_rates.iter_mut().enumerate() {
                *rate = a_f.row_times(i, f_hat);
            }
        }
    }

    /// Adds column `k` of L_x and, while estimating, of L_f times `innovation` to `x` and `f`.
    pub(crate) fn correct(
        self,
        design: &Design,
        (k, innovation): (usize, f64),
        x: &mut [f64],
        f: &mut [f64],
    ) {
        for (i, x) in x.iter_mut().enumerate() {
            *x += design.l_x.entry(i, k) * innovation;
        }
        for (i, f) in f.iter_mut().enumerate().filter(|_| self.estimating) {
            *f += design.l_f.entry(i, k) * innovation;
        }
    }

    /// z' and u' of a point, `offset` s after the instant of its measurements, which have slopes.
    pub(crate) fn slopes(
        self,
        Knowns { design, signals: Signals { z, y, u } }: Knowns<'_>,
        (y_slopes, offset): (&[f64], f64),
        (z_slopes, u_slopes): (&mut [f64], &mut [f64]),
    ) {
        self.free_rates(design, z, u, z_slopes);
        let [x_hat, _, y_f] = design.parts(z);
        let [x_slopes, f_slopes, filter_slopes] = design.parts_mut(z_slopes);
        for (k, (value, slope)) in y.iter().zip(y_slopes).enumerate() {
            let innovation = innovation(design, x_hat, y_f, (k, value + slope * offset));
            self.correct(design, (k, innovation), x_slopes, f_slopes);
        }
        for (k, (w, slope)) in design.filter.iter().flatten().zip(filter_slopes).enumerate() {
            *slope = w * (y[k] + y_slopes[k] * offset - y_f[k]);
        }
        for (j, slope) in u_slopes.iter_mut().enumerate() {
            let fault = if self.compensating { design.k_f.row_times(j, f_slopes) } else { 0.0 };
            let free = design.k_x.row_times(j, x_slopes) + fault;
            *slope = if self.is_limited(j) { 0.0 } else { free };
        }
    }
}

/// y - C x_hat of measurement `k`, which is `y`; with a filter, y_f - C x_hat.
#[inline]
pub(crate) fn innovation(design: &Design, x_hat: &[f64], y_f: &[f64], (k, y): (usize, f64)) -> f64 {
    y_f.get(k).unwrap_or(&y) - design.c.row_times(k, x_hat)
}

/// The derivatives of all that along a direction, by the product rule in every term. Exact.
impl Mode {
    /// Of the command: du for dz, both in `along`.
    pub(crate) fn command_along(self, point: Knowns<'_>, design: &Design, along: &mut Signals) {
        let Signals { z, u, .. } = along;
        let [x_hat, f_hat] = states_and_faults(point.design, &point.signals.z, z);
        for (j, du) in u.iter_mut().enumerate() {
            *du = self.limit(design, j).unwrap_or_else(|| {
                let fault = product([&point.design.k_f, &design.k_f], j, f_hat);
                let state = product([&point.design.k_x, &design.k_x], j, x_hat);
                if self.compensating { state + fault } else { state }
            });
        }
    }

    /// Of [`Mode::correct`]: adds to `x` and `f`, for the innovation with its own derivative.
    pub(crate) fn correct_along(
        self,
        [point, along]: [&Design; 2],
        (k, [innovation, change]): (usize, [f64; 2]),
        x: &mut [f64],
        f: &mut [f64],
    ) {
        self.correct(point, (k, change), x, f);
        self.correct(along, (k, innovation), x, f);
    }

    /// Of z', for dz, dy and du in `along`.
    pub(crate) fn slopes_along(self, point: Knowns<'_>, along: Knowns<'_>, slopes: &mut [f64]) {
        let both = [point.design, along.design];
        let (z, dz) = (&point.signals.z, &along.signals.z);
        self.free_rates_along(point, along, slopes);
        let [x_hat, _, y_f] = point.design.parts(z);
        let [_, _, dy_f] = point.design.parts(dz);
        let [x, f, filter_slopes] = point.design.parts_mut(slopes);
        for (k, (y, dy)) in point.signals.y.iter().zip(&along.signals.y).enumerate() {
            let innovation = innovation(point.design, x_hat, y_f, (k, *y));
            let change = innovation_along(both, [z, dz], k, *dy);
            self.correct_along(both, (k, [innovation, change]), x, f);
            if let (Some(w), Some(dw)) = (&point.design.filter, &along.design.filter) {
                filter_slopes[k] = w[k] * (dy - dy_f[k]) + dw[k] * (y - y_f[k]);
            }
        }
    }

    fn free_rates_along(self, point: Knowns<'_>, along: Knowns<'_>, rates: &mut [f64]) {
        let [x_hat, f_hat] = states_and_faults(point.design, &point.signals.z, &along.signals.z);
        let u = [&point.signals.u[..], &along.signals.u[..]];
        let both = |matrix: fn(&Design) -> &Matrix| [matrix(point.design), matrix(along.design)];
        rates.fill(0.0);
        let [x_rates, f_rates, _] = point.design.parts_mut(rates);
        for (i, rate) in x_rates.iter_mut().enumerate() {
            *rate = product(both(|design| &design.a), i, x_hat)
                + product(both(|design| &design.b), i, u)
                + product(both(|design| &design.f_a), i, f_hat);
        }
        let fault_models = point.design.a_f.iter().zip(&along.design.a_f);
        for (a_f, da_f) in fault_models.filter(|_| self.estimating) {
            for (i, rate) in f_rates.iter_mut().enumerate() {
                *rate = product([a_f, da_f], i, f_hat);
            }
        }
    }
}

/// Of [`innovation`], for dz and dy.
pub(crate) fn innovation_along(
    [point, along]: [&Design; 2],
    [z, dz]: [&[f64]; 2],
    k: usize,
    dy: f64,
) -> f64 {
    let [x_hat, _] = states_and_faults(point, z, dz);
    let [_, _, dy_f] = point.parts(dz);
    dy_f.get(k).unwrap_or(&dy) - product([&point.c, &along.c], k, x_hat)
}

/// x_hat and f_hat, each with its direction.
fn states_and_faults<'a>(design: &Design, z: &'a [f64], dz: &'a [f64]) -> [[&'a [f64]; 2]; 2] {
    let ([x_hat, f_hat, _], [dx_hat, df_hat, _]) = (design.parts(z), design.parts(dz));
    [[x_hat, dx_hat], [f_hat, df_hat]]
}

/// M dv + dM v in row `row`, of a matrix M and a vector v with their directions.
fn product([matrix, along]: [&Matrix; 2], row: usize, [vector, change]: [&[f64]; 2]) -> f64 {
    matrix.row_times(row, change) + along.row_times(row, vector)
}
