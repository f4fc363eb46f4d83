//! Peak and settling time of an output.

use super::TimeResponse;
use nalgebra::DMatrix;

/// How an output goes to its settled value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transient {
    /// The z that is largest in size, with its sign.
    pub peak: f64,
    /// When.
    pub peak_time: f64,
    /// From here on z stays within the band around its settled value; zero if always.
    pub settling_time: f64,
    /// z after all time.
    pub final_value: f64,
}

impl TimeResponse {
    /// Peak and settling time of output `output`, an index from 0.
    ///
    /// The band is `fraction` times the largest distance of z from its settled value. Between the
    /// points of the grid z is the cubic through both values and slopes in continuous time, 1e-6
    /// relative to its peak; settling times are between the points where a straight line leaves the
    /// band. In sampled time both are those of the points.
    ///
    /// # Panics
    ///
    /// If there is no such output.
    #[must_use]
    pub fn transient(&self, output: usize, fraction: f64) -> Transient {
        let (z, final_value) = (self.output.row(output), self.final_value[output]);
        let (mut peak, mut peak_time) = (0.0_f64, 0.0);
        let mut distance = 0.0_f64;
        let mut see = |time: f64, value: f64| {
            distance = distance.max((value - final_value).abs());
            if value.abs() > peak.abs() {
                (peak, peak_time) = (value, time);
            }
        };
        for (k, &time) in self.time.iter().enumerate() {
            see(time, z[k]);
            if let Some((time, value)) = self.turn(output, k) {
                see(time, value);
            }
        }
        let band = fraction * distance;
        let outside = (0..self.time.len()).rev().find(|&k| (z[k] - final_value).abs() > band);
        let settling_time = outside.map_or(0.0, |k| self.entry(output, k, band));
        Transient { peak, peak_time, settling_time, final_value }
    }

    /// Where z turns between points k and k + 1, and its value there.
    fn turn(&self, output: usize, k: usize) -> Option<(f64, f64)> {
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

    /// When z enters the band for good, after the last point k outside.
    fn entry(&self, output: usize, k: usize, band: f64) -> f64 {
        if self.slope.ncols() == 0 || k + 1 == self.time.len() {
            return self.time[(k + 1).min(self.time.len() - 1)];
        }
        let distance = |k: usize| (self.output[(output, k)] - self.final_value[output]).abs();
        let part = (distance(k) - band) / (distance(k) - distance(k + 1));
        self.time[k] + part.min(1.0) * (self.time[k + 1] - self.time[k])
    }
}
