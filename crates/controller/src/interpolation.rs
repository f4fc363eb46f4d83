//! A controller whose matrices and operating point depend on a scheduling variable.
//!
//! A sampled controller interpolates at each sample, a continuous one at each instant. The scheduling variable theta is
//! limited to the grid, at whose points `theta_i` the design states the matrices `M_i`:
//!
//! ```text
//! M(theta) = (1 - t) M_i + t M_{i+1},  t = (theta - theta_i) / (theta_{i+1} - theta_i)
//! ```
//!
//! for each of A, B, C, F_a, K_x, K_f, L_x, L_f, x_op, u_op, y_op, and, where the design has them, P_f, K_i,
//! L_w, N_r, r_op. The sample, or the derivatives and the commands, are those of a controller whose design states these
//! numbers. The estimates are values, not deviations, so that a change of the operating point does not change them.

use crate::design::Design;
use crate::design::schedule::Schedule;

/// The place of a value in the grid.
#[derive(Clone, Copy)]
struct Place {
    /// The index of the interval, from 0.
    interval: usize,
    /// The position of the value in the interval, from 0 to 1.
    part: f64,
    /// Whether the value is within the grid, ends included.
    inside: bool,
}

impl Schedule {
    /// The position of the measurement that is the scheduling variable; `None` if the variable is a separate input.
    #[must_use]
    pub fn measurement(&self, design: &Design) -> Option<usize> {
        design.measurements.iter().position(|signal| signal.name == self.variable)
    }

    /// The first and the last value of the grid, which has at least two points.
    #[must_use]
    pub fn range(&self) -> [f64; 2] {
        [self.points[0].at, self.points[self.points.len() - 1].at]
    }

    fn place(&self, value: f64) -> Place {
        let [first, last] = self.range();
        let inside = value >= first && value <= last;
        // NaN selects the first point.
        let value = if value > first { value.min(last) } else { first };
        let after = self.points.partition_point(|point| point.at <= value);
        let interval = after.clamp(1, self.points.len() - 1) - 1;
        let [from, to] = [0, 1].map(|end| self.points[interval + end].at);
        Place { interval, part: (value - from) / (to - from), inside }
    }

    /// Writes the interpolated matrices and operating point into `design`; returns the value limited to the grid. NaN
    /// gives the first point.
    pub fn interpolate(&self, value: f64, design: &mut Design) -> f64 {
        let Place { interval, part, .. } = self.place(value);
        let mix = |[from, to]: [f64; 2]| from * (1.0 - part) + to * part;
        self.write(interval, mix, design);
        mix([self.points[interval].at, self.points[interval + 1].at])
    }

    /// Writes the derivatives of the interpolated matrices and operating point into `direction`, for the derivative
    /// `slope` of the scheduling variable. The derivatives are zero outside of the grid; at a point of the grid they
    /// belong to the next interval, at the last point to the last interval. A_f, H and F_i, which are constant, become
    /// zero. Returns the derivative of the value limited to the grid.
    pub fn differentiate(&self, value: f64, slope: f64, direction: &mut Design) -> f64 {
        let Place { interval, inside, .. } = self.place(value);
        let [from, to] = [0, 1].map(|end| self.points[interval + end].at);
        let slope = if inside { slope } else { 0.0 };
        self.write(interval, |[low, high]| (high - low) / (to - from) * slope, direction);
        direction.clear_constant();
        slope
    }

    /// Writes the combination `mix` of both ends of the interval into each scheduled matrix and the operating point.
    fn write(&self, interval: usize, mix: impl Fn([f64; 2]) -> f64, design: &mut Design) {
        let [from, to] = [0, 1].map(|end| &self.points[interval + end]);
        let places = design.scheduled_mut();
        for ((place, (_, from)), (_, to)) in places.zip(from.matrices()).zip(to.matrices()) {
            let ends = from.values.iter().zip(&to.values);
            for (value, (from, to)) in place.values.iter_mut().zip(ends) {
                *value = mix([*from, *to]);
            }
        }
        let ends = from.operating().zip(to.operating());
        for (place, (from, to)) in design.operating_mut().zip(ends) {
            *place = Some(mix([*from, *to]));
        }
    }
}
