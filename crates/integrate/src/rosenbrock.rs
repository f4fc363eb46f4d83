//! RODAS: a Rosenbrock method of order 4(3), L-stable, stiffly accurate, with a continuous extension of order 3.
//!
//! Source of method and coefficients: E. Hairer and G. Wanner, "Solving Ordinary Differential Equations
//! II" (2nd ed.), sections IV.7 and IV.10. Jacobian and derivative with respect to time are difference quotients.

use solve::Factors;

use crate::start::{StepStart, weighted};

/// The coefficient of the Jacobian in every stage.
const GAMMA: f64 = 0.25;

/// Nodes of the stages 2 to 6.
const NODES: [f64; 5] = [0.386, 0.21, 0.63, 1.0, 1.0];

/// Weights of the increments in the arguments of the stages 2 to 6.
const ARGUMENTS: [&[f64]; 5] = [
    &[1.544],
    &[0.946_678_528_081_582_6, 0.255_701_169_898_328_4],
    &[3.314_825_187_068_521, 2.896_124_015_972_201, 0.998_641_913_997_781_7],
    &[1.221_224_509_226_641, 6.019_134_481_288_629, 12.537_083_329_320_87, -0.687_886_036_105_895],
    &[
        1.221_224_509_226_641,
        6.019_134_481_288_629,
        12.537_083_329_320_87,
        -0.687_886_036_105_895,
        1.0,
    ],
];

/// Weights of the increments on the right-hand side of the stages 2 to 6.
const COUPLINGS: [&[f64]; 5] = [
    &[-5.6688],
    &[-2.430_093_356_833_875, -0.206_359_915_709_191_5],
    &[-0.107_352_905_815_137_5, -9.594_562_251_023_355, -20.470_286_148_096_16],
    &[7.496_443_313_967_647, -10.246_804_314_643_52, -33.999_903_528_199_05, 11.708_908_932_061_6],
    &[
        8.083_246_795_921_522,
        -7.981_132_988_064_893,
        -31.521_594_328_743_71,
        16.319_305_431_231_36,
        -6.058_818_238_834_054,
    ],
];

/// Weights of the derivative with respect to time in the stages.
const TIMES: [f64; 6] = [0.25, -0.1043, 0.1035, -0.036_200_000_000_000_23, 0.0, 0.0];

/// Weights of the increments in the two terms of the continuous extension.
const EXTENSION: [[f64; 5]; 2] = [
    [
        10.126_235_083_445_86,
        -7.487_995_877_610_167,
        -34.800_918_615_557_47,
        -7.992_771_707_568_823,
        1.025_137_723_295_662,
    ],
    [
        -0.676_280_339_280_689_8,
        6.087_714_651_678_606,
        16.430_843_208_924_78,
        24.767_225_114_183_86,
        -6.594_389_125_716_872,
    ],
];

/// The last step and the memory for the next one.
pub(crate) struct Rosenbrock {
    /// The states at the end of the step.
    pub(crate) end: Vec<f64>,
    /// The increments of the six stages.
    increments: [Vec<f64>; 6],
    argument: Vec<f64>,
    /// The right-hand side of a stage, then the increment of the stage.
    slope: Vec<f64>,
    /// The Jacobian, column by column.
    jacobian: Vec<f64>,
    /// `I / (gamma size)` minus the Jacobian, column by column.
    matrix: Vec<f64>,
    factors: Factors,
    /// The derivative of the right-hand side with respect to time.
    with_time: Vec<f64>,
}

impl Rosenbrock {
    pub(crate) fn new(n: usize) -> Self {
        let zeros = || vec![0.0; n];
        Self {
            end: zeros(),
            increments: std::array::from_fn(|_| zeros()),
            argument: zeros(),
            slope: zeros(),
            jacobian: vec![0.0; n * n],
            matrix: vec![0.0; n * n],
            factors: Factors::new(n),
            with_time: zeros(),
        }
    }

    /// Computes the Jacobian and the derivative with respect to time at the start of a step of about
    /// `size` s. The perturbation of a component is relative to its absolute value, but at least to `typical`.
    pub(crate) fn linearise<E>(
        &mut self,
        derivative: &mut impl FnMut(f64, &[f64], &mut [f64]) -> Result<(), E>,
        start: StepStart<'_>,
        size: f64,
        typical: impl Fn(usize) -> f64,
    ) -> Result<(), E> {
        let StepStart { time, states, slope } = start;
        let n = states.len();
        self.argument.copy_from_slice(states);
        for (column, &value) in states.iter().enumerate() {
            let change = f64::EPSILON.sqrt() * value.abs().max(typical(column));
            self.argument[column] = value + change;
            let change = self.argument[column] - value;
            let quotients = &mut self.jacobian[column * n..(column + 1) * n];
            derivative(time, &self.argument, quotients)?;
            for (quotient, slope) in quotients.iter_mut().zip(slope) {
                *quotient = (*quotient - slope) / change;
            }
            self.argument[column] = value;
        }
        // The perturbed time is within the step, because it must not pass an event.
        let change = (f64::EPSILON * time.abs().max(1e-5)).sqrt().min(1e-3 * size);
        let there = time + change.max(4.0 * f64::EPSILON * time.abs());
        derivative(there, states, &mut self.with_time)?;
        for (quotient, slope) in self.with_time.iter_mut().zip(slope) {
            *quotient = (*quotient - slope) / (there - time);
        }
        Ok(())
    }

    /// A bound of the moduli of the eigenvalues of the Jacobian: the largest sum of moduli in a row, weighted.
    pub(crate) fn bound_of_eigenvalues(&self, weight: impl Fn(usize) -> f64) -> f64 {
        let n = self.end.len();
        let row = |i: usize| -> f64 {
            let entry = |j: usize| (self.jacobian[j * n + i] * weight(j) / weight(i)).abs();
            (0..n).map(entry).sum()
        };
        (0..n).map(row).fold(0.0, f64::max)
    }

    /// Attempts a step of `size` s from `start` after [`Rosenbrock::linearise`]; false for a singular matrix.
    pub(crate) fn attempt<E>(
        &mut self,
        derivative: &mut impl FnMut(f64, &[f64], &mut [f64]) -> Result<(), E>,
        start: StepStart<'_>,
        size: f64,
    ) -> Result<bool, E> {
        let StepStart { time, states, slope } = start;
        let n = states.len();
        for (entry, value) in self.matrix.iter_mut().zip(&self.jacobian) {
            *entry = -value;
        }
        for diagonal in 0..n {
            self.matrix[diagonal * (n + 1)] += 1.0 / (GAMMA * size);
        }
        if !self.factors.decompose(&self.matrix) {
            return Ok(false);
        }
        for stage in 0..6 {
            if stage == 0 {
                self.slope.copy_from_slice(slope);
            } else {
                for (i, value) in self.argument.iter_mut().enumerate() {
                    *value = states[i] + weighted(ARGUMENTS[stage - 1], &self.increments, i);
                }
                derivative(time + NODES[stage - 1] * size, &self.argument, &mut self.slope)?;
            }
            let couplings = if stage == 0 { &[][..] } else { COUPLINGS[stage - 1] };
            for i in 0..n {
                let sum = weighted(couplings, &self.increments, i);
                self.slope[i] += sum / size + TIMES[stage] * size * self.with_time[i];
            }
            self.factors.solve(&mut self.slope);
            self.increments[stage].copy_from_slice(&self.slope);
        }
        for i in 0..n {
            self.end[i] = self.argument[i] + self.increments[5][i];
        }
        Ok(true)
    }

    /// The estimate of the local error.
    pub(crate) fn error(&self) -> &[f64] {
        &self.increments[5]
    }

    /// Computes the states at the fraction `part` of the step from `start`.
    pub(crate) fn interpolate(&self, part: f64, start: &[f64], states: &mut [f64]) {
        let rest = 1.0 - part;
        for (i, state) in states.iter_mut().enumerate() {
            let [first, second] = EXTENSION.map(|weights| weighted(&weights, &self.increments, i));
            let inner = first + part * second;
            *state = start[i] * rest + part * (self.end[i] + rest * inner);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    /// A nonlinear equation that depends on time: y = exp(-1 / (t + 1)), z = y^2 + t.
    #[expect(clippy::unnecessary_wraps, reason = "the signature of a right-hand side")]
    fn equations(t: f64, y: &[f64], slope: &mut [f64]) -> Result<(), Infallible> {
        let decay = (t + 1.0).powi(2);
        slope[0] = y[0] / decay;
        slope[1] = 2.0 * y[0] * y[0] / decay + 1.0 + (y[0] * y[0] + t - y[1]);
        Ok(())
    }

    fn exact(t: f64) -> [f64; 2] {
        let y = (-1.0 / (t + 1.0)).exp();
        [y, y * y + t]
    }

    fn distance(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    fn step(size: f64) -> Rosenbrock {
        let mut method = Rosenbrock::new(2);
        let (states, mut slope) = (exact(0.5), [0.0; 2]);
        let Ok(()) = equations(0.5, &states, &mut slope);
        let start = StepStart { time: 0.5, states: &states, slope: &slope };
        let Ok(()) = method.linearise(&mut equations, start, size, |_| 1.0);
        let Ok(true) = method.attempt(&mut equations, start, size) else { panic!() };
        method
    }

    fn order(error: impl Fn(f64) -> f64) -> f64 {
        (error(0.4) / error(0.05)).log2() / 3.0
    }

    #[test]
    fn the_local_error_is_of_order_five_and_its_estimate_of_order_four() {
        let actual = order(|h| distance(&step(h).end, &exact(0.5 + h)));
        assert!((actual - 5.0).abs() < 0.5, "{actual}");
        let actual = order(|h| distance(step(h).error(), &[0.0; 2]));
        assert!((actual - 4.0).abs() < 0.5, "{actual}");
    }

    #[test]
    fn the_continuous_extension_is_of_order_three_in_the_whole_step() {
        for part in [0.2, 0.5, 0.8] {
            let error = |h: f64| {
                let mut states = [0.0; 2];
                step(h).interpolate(part, &exact(0.5), &mut states);
                distance(&states, &exact(0.5 + part * h))
            };
            assert!((order(error) - 4.0).abs() < 0.5, "{part}: {}", order(error));
            assert!(error(0.1) < 1e-6, "{}", error(0.1));
        }
    }

    #[test]
    fn a_decay_far_faster_than_the_step_ends_at_zero() {
        let mut decay = |_: f64, y: &[f64], slope: &mut [f64]| -> Result<(), Infallible> {
            slope[0] = -1e9 * y[0];
            Ok(())
        };
        let mut method = Rosenbrock::new(1);
        let start = StepStart { time: 0.0, states: &[1.0], slope: &[-1e9] };
        let Ok(()) = method.linearise(&mut decay, start, 1.0, |_| 1.0);
        let Ok(true) = method.attempt(&mut decay, start, 1.0) else { panic!() };
        assert!(method.end[0].abs() < 1e-6, "{}", method.end[0]);
        assert!((method.bound_of_eigenvalues(|_| 1.0) / 1e9 - 1.0).abs() < 1e-6);
    }
}
