//! Peak and settling time of an output.

use super::TimeResponse;
use nalgebra::DMatrix;

/// Peak and settling of an output.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Transient {
    /// The value of z with the largest modulus.
    pub peak: f64,
    /// The time of the peak.
    pub peak_time: f64,
    /// The time after which z stays within the band around its final value; zero if it always does, infinite if it
    /// is outside to the end of the response.
    pub settling_time: f64,
    /// The limit of z for large times.
    pub final_value: f64,
}

impl TimeResponse {
    /// Computes peak and settling time of an output.
    ///
    /// `output`: its index, from 0. The band is `fraction` times the largest distance of z from its
    /// final value. In continuous time peaks between grid points are those of the cubic through both values and
    /// slopes (error 1e-6 of the peak, 1e-5 from 48 states on), and settling times are interpolated linearly. In
    /// sampled time, and where the points do not follow every oscillation, both are at grid points.
    ///
    /// # Panics
    ///
    /// If there is no such output.
    #[must_use]
    pub fn transient(&self, output: usize, fraction: f64) -> Transient {
        let (z, final_value) = (self.output.row(output), self.final_value[output]);
        let (mut peak, mut peak_time) = (0.0_f64, 0.0);
        let mut distance = 0.0_f64;
        let mut update = |time: f64, value: f64| {
            distance = distance.max((value - final_value).abs());
            if value.abs() > peak.abs() {
                (peak, peak_time) = (value, time);
            }
        };
        for (k, &time) in self.time.iter().enumerate() {
            update(time, z[k]);
            if let Some((time, value)) = self.extremum(output, k) {
                update(time, value);
            }
        }
        let band = fraction * distance;
        let outside = (0..self.time.len()).rev().find(|&k| (z[k] - final_value).abs() > band);
        let settling_time = outside.map_or(0.0, |k| self.entry(output, k, band));
        Transient { peak, peak_time, settling_time, final_value }
    }

    /// Time and value of an extremum between points k and k + 1; None without a known change of sign of the slope.
    fn extremum(&self, output: usize, k: usize) -> Option<(f64, f64)> {
        let slopes: &DMatrix<f64> = &self.slope;
        if k + 1 >= slopes.ncols() {
            return None;
        }
        let (from, to) = (slopes[(output, k)], slopes[(output, k + 1)]);
        if from * to >= 0.0 {
            return None;
        }
        let step = self.time[k + 1] - self.time[k];
        let part = from / (from - to);
        let (begin, end) = (self.output[(output, k)], self.output[(output, k + 1)]);
        let (rest, rise) = (1.0 - part, part * part * (3.0 - 2.0 * part));
        let curve = part * rest * (rest * from - part * to) * step;
        Some((self.time[k] + part * step, begin + rise * (end - begin) + curve))
    }

    /// The time at which z enters the band for the last time, infinite if it does not; k is the last point outside.
    fn entry(&self, output: usize, k: usize, band: f64) -> f64 {
        if k + 1 == self.time.len() {
            return f64::INFINITY;
        }
        if self.slope.ncols() == 0 {
            return self.time[k + 1];
        }
        let distance = |k: usize| (self.output[(output, k)] - self.final_value[output]).abs();
        let part = (distance(k) - band) / (distance(k) - distance(k + 1));
        self.time[k] + part.min(1.0) * (self.time[k + 1] - self.time[k])
    }
}
