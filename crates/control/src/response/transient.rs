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
    /// The time after which z stays within the band around its final value; zero if z always does, infinite if z
    /// is outside to the end of the response.
    pub settling_time: f64,
    /// The limit of z for large times.
    pub final_value: f64,
}

impl TimeResponse {
    /// Computes peak and settling time of an output.
    ///
    /// `output`: the index of the output, from 0. The band is `fraction` times the largest distance of z from its final
    /// value. In continuous time peaks between grid points are those of the cubic through both values and slopes (error
    /// 1e-6 of the peak, 1e-5 from 48 states on), and settling times are interpolated linearly after the last point or
    /// peak outside of the band. In sampled time, and if the points do not follow every oscillation, peaks and settling
    /// times are at grid points.
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
        let is_outside = |(_, value): &(f64, f64)| (value - final_value).abs() > band;
        let outside = (0..self.time.len()).rev().find_map(|k| {
            let last = self.extremum(output, k).filter(is_outside);
            Some((k, last.or(Some((self.time[k], z[k])).filter(is_outside))?))
        });
        let settling_time = outside.map_or(0.0, |(k, last)| self.entry(output, k, last, band));
        Transient { peak, peak_time, settling_time, final_value }
    }

    /// Times and values of the extrema between grid points in continuous time, ascending, see [`Self::transient`].
    ///
    /// # Panics
    ///
    /// If there is no such output.
    #[must_use]
    pub fn extrema(&self, output: usize) -> Vec<(f64, f64)> {
        (0..self.time.len()).filter_map(|k| self.extremum(output, k)).collect()
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

    /// The time at which z enters the band for the last time, infinite if z ends outside. `last`: time and value of the
    /// last point or extremum outside, from point k on and before point k + 1.
    fn entry(&self, output: usize, k: usize, last: (f64, f64), band: f64) -> f64 {
        if k + 1 == self.time.len() {
            return f64::INFINITY;
        }
        if self.slope.ncols() == 0 {
            return self.time[k + 1];
        }
        let distance = |value: f64| (value - self.final_value[output]).abs();
        let (from, to) = (distance(last.1), distance(self.output[(output, k + 1)]));
        let part = (from - band) / (from - to);
        last.0 + part.min(1.0) * (self.time[k + 1] - last.0)
    }
}
