//! The explicit Runge-Kutta method of order 5(4) with its continuous extension of order 4.
//!
//! Source: J. R. Dormand and P. J. Prince, "A family of embedded Runge-Kutta formulae" (1980); continuous
//! extension and measure of stiffness: E. Hairer, S. P. Norsett and G. Wanner, "Solving Ordinary
//! Differential Equations I" (2nd ed.), section II.6, and part II (2nd ed.), section IV.2.

use crate::start::{StepStart, weighted};

/// Nodes of the stages 2 to 7.
const NODES: [f64; 6] = [0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0];

/// Weights of the slopes in the stages 2 to 7; the last stage is the end of the step.
const STAGES: [&[f64]; 6] = [
    &[0.2],
    &[3.0 / 40.0, 9.0 / 40.0],
    &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
    &[19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0],
    &[9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0],
    &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];

/// Differences between the weights of order 5 and 4.
const ERROR: [f64; 7] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339_200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];

/// Weights of the last term of the continuous extension.
const BEND: [f64; 7] = [
    -12_715_105_075.0 / 11_282_082_432.0,
    0.0,
    87_487_479_700.0 / 32_700_410_799.0,
    -10_690_763_975.0 / 1_880_347_072.0,
    701_980_252_875.0 / 199_316_789_632.0,
    -1_453_857_185.0 / 822_651_844.0,
    69_997_945.0 / 29_380_423.0,
];

/// The last step and the memory for the next one.
pub(crate) struct Explicit {
    /// The states at the end of the step.
    pub(crate) end: Vec<f64>,
    /// The estimate of the local error.
    pub(crate) error: Vec<f64>,
    /// The derivatives of the seven stages.
    slopes: [Vec<f64>; 7],
    /// The argument of stage 6.
    stage: Vec<f64>,
}

impl Explicit {
    pub(crate) fn new(n: usize) -> Self {
        let zeros = || vec![0.0; n];
        Self {
            end: zeros(),
            error: zeros(),
            slopes: std::array::from_fn(|_| zeros()),
            stage: zeros(),
        }
    }

    /// Attempts a step of `size` s from `start`; sets `end` and `error`. Returns an error of `derivative`.
    pub(crate) fn attempt<E>(
        &mut self,
        derivative: &mut impl FnMut(f64, &[f64], &mut [f64]) -> Result<(), E>,
        start: StepStart<'_>,
        size: f64,
    ) -> Result<(), E> {
        self.slopes[0].copy_from_slice(start.slope);
        for (stage, (weights, node)) in STAGES.iter().zip(NODES).enumerate() {
            let argument = if stage == 5 { &mut self.end } else { &mut self.stage };
            combine(argument, Some(start.states), size, weights, &self.slopes);
            derivative(start.time + node * size, argument, &mut self.slopes[stage + 1])?;
        }
        combine(&mut self.error, None, size, &ERROR, &self.slopes);
        Ok(())
    }

    pub(crate) fn last_slope(&self) -> &[f64] {
        &self.slopes[6]
    }

    /// Returns an estimate of `size |lambda|` for the dominant eigenvalue of the Jacobian, from the two derivatives at
    /// the end of the step; 0 if both derivatives are at the same states. Components are divided by `weight`.
    pub(crate) fn stiffness(&self, size: f64, weight: impl Fn(usize) -> f64) -> f64 {
        let (mut slopes, mut states) = (0.0, 0.0);
        for i in 0..self.end.len() {
            slopes += ((self.slopes[6][i] - self.slopes[5][i]) / weight(i)).powi(2);
            states += ((self.end[i] - self.stage[i]) / weight(i)).powi(2);
        }
        if states > 0.0 { size * (slopes / states).sqrt() } else { 0.0 }
    }

    /// Computes the states at the fraction `part` of the last step, which began at `start` and had `size` s.
    pub(crate) fn interpolate(&self, part: f64, size: f64, start: &[f64], states: &mut [f64]) {
        let rest = 1.0 - part;
        for (i, state) in states.iter_mut().enumerate() {
            let rise = self.end[i] - start[i];
            let first = size * self.slopes[0][i] - rise;
            let last = rise - size * self.slopes[6][i] - first;
            let inner = last + rest * size * weighted(&BEND, &self.slopes, i);
            *state = start[i] + part * (rise + rest * (first + part * inner));
        }
    }
}

/// Computes `base + size * sum(weight * slope)`, with zero for a missing `base`.
fn combine(
    result: &mut [f64],
    base: Option<&[f64]>,
    size: f64,
    weights: &[f64],
    slopes: &[Vec<f64>; 7],
) {
    for (i, value) in result.iter_mut().enumerate() {
        *value = base.map_or(0.0, |base| base[i]) + size * weighted(weights, slopes, i);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    #[expect(clippy::unnecessary_wraps, reason = "the signature of a right-hand side")]
    fn circle(_: f64, y: &[f64], slope: &mut [f64]) -> Result<(), Infallible> {
        (slope[0], slope[1]) = (y[1], -y[0]);
        Ok(())
    }

    fn exact(t: f64) -> [f64; 2] {
        [t.sin(), t.cos()]
    }

    fn distance(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    fn step(size: f64) -> Explicit {
        let mut method = Explicit::new(2);
        let (states, mut slope) = (exact(0.3), [0.0; 2]);
        let Ok(()) = circle(0.3, &states, &mut slope);
        let start = StepStart { time: 0.3, states: &states, slope: &slope };
        let Ok(()) = method.attempt(&mut circle, start, size);
        method
    }

    fn order(error: impl Fn(f64) -> f64) -> f64 {
        (error(0.2) / error(0.1)).log2()
    }

    #[test]
    fn the_local_error_is_of_order_six_and_its_estimate_of_order_five() {
        let actual = order(|h| distance(&step(h).end, &exact(0.3 + h)));
        assert!((actual - 6.0).abs() < 0.3, "{actual}");
        let actual = order(|h| distance(&step(h).error, &[0.0; 2]));
        assert!((actual - 5.0).abs() < 0.3, "{actual}");
        assert!(distance(&step(0.2).error, &[0.0; 2]) > distance(&step(0.2).end, &exact(0.5)));
    }

    #[test]
    fn the_continuous_extension_is_of_order_four_in_the_whole_step() {
        for part in [0.1, 0.5, 0.77] {
            let error = |h: f64| {
                let mut states = [0.0; 2];
                step(h).interpolate(part, h, &exact(0.3), &mut states);
                distance(&states, &exact(0.3 + part * h))
            };
            assert!((order(error) - 5.0).abs() < 0.5, "{part}: {}", order(error));
        }
        let (mut first, mut last) = ([0.0; 2], [0.0; 2]);
        step(0.2).interpolate(0.0, 0.2, &exact(0.3), &mut first);
        step(0.2).interpolate(1.0, 0.2, &exact(0.3), &mut last);
        assert!(distance(&first, &exact(0.3)) < 1e-15);
        assert!(distance(&last, &step(0.2).end) < 1e-15);
    }

    #[test]
    fn the_measure_of_stiffness_is_step_times_eigenvalue() {
        let mut decay = |_: f64, y: &[f64], slope: &mut [f64]| -> Result<(), Infallible> {
            slope[0] = -1000.0 * y[0];
            Ok(())
        };
        let mut method = Explicit::new(1);
        let start = StepStart { time: 0.0, states: &[1.0], slope: &[-1000.0] };
        let Ok(()) = method.attempt(&mut decay, start, 0.004);
        let actual = method.stiffness(0.004, |_| 1.0);
        assert!((actual - 4.0).abs() < 1e-9, "{actual}");
    }
}
