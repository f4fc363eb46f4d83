//! The levels over time.
//!
//! Dormand-Prince steps of order 5(4) and adaptive size, which end where a tank becomes full or stops
//! spilling. Source: J. R. Dormand and P. J. Prince, "A family of embedded Runge-Kutta formulae" (1980).

use std::array::from_fn;

use crate::flows::{H_MAX, Tanks};

/// Maximum error of one integration step, in m.
const TOLERANCE: f64 = 1e-9;
/// Maximum number of integration steps in one call of `advance`.
const STEPS: u32 = 50_000_000;
/// Number of bisection steps that locate the end of a shortened step.
const HALVINGS: u32 = 60;

const STAGES: [[f64; 6]; 6] = [
    [0.2, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
    [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0],
    [9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0, 0.0],
    [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];
/// Weights of the difference of the solutions of order 5 and 4.
const ERROR: [f64; 7] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339_200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];

impl Tanks<f64> {
    /// Limits the levels to the brim; returns which tanks spill: tanks that are full and have more inflow than outflow.
    pub(crate) fn settle(&self, h: &mut [f64; 3]) -> [bool; 3] {
        let brim = self.parameters[H_MAX];
        *h = h.map(|level| level.min(brim));
        let net = self.flows(h).net;
        from_fn(|i| h[i] >= brim && net[i] > 0.0)
    }

    /// Returns the levels after one Dormand-Prince step of `length` in s, and its estimated error in m. A tank that is
    /// `full` spills: its level is constant.
    fn stride(&self, h: &[f64; 3], full: [bool; 3], length: f64) -> ([f64; 3], f64) {
        let mut slopes = [[0.0; 3]; 7];
        let increment = |weights: &[f64], slopes: &[[f64; 3]; 7], i: usize| -> f64 {
            length
                * weights.iter().zip(slopes).map(|(weight, slope)| weight * slope[i]).sum::<f64>()
        };
        slopes[0] = self.slope(h, full);
        let mut end = *h;
        for (stage, weights) in STAGES.iter().enumerate() {
            end = from_fn(|i| h[i] + increment(weights, &slopes, i));
            slopes[stage + 1] = self.slope(&end, full);
        }
        (end, (0..3).map(|i| increment(&ERROR, &slopes, i).abs()).fold(0.0, f64::max))
    }

    /// Integrates the levels over `duration` in s and returns the time advanced in s, which is less after [`STEPS`]
    /// integration steps. `trial` is the size of the first integration step, and is replaced by the size of the next one.
    pub(crate) fn advance(&self, h: &mut [f64; 3], trial: &mut f64, duration: f64) -> f64 {
        let mut elapsed = 0.0;
        for _ in 0..STEPS {
            let left = duration - elapsed;
            if left <= 0.0 {
                break;
            }
            let full = self.settle(h);
            let length = if left <= 1.01 * *trial { left } else { *trial };
            let (end, error) = self.stride(h, full, length);
            let growth = (0.9 * (TOLERANCE / error).powf(0.2)).clamp(0.2, 5.0);
            if error > TOLERANCE || length >= *trial {
                *trial = length * growth;
            }
            if error > TOLERANCE {
                continue;
            }
            (*h, elapsed) = match self.cut(h, &end, full, length) {
                Some(length) => (self.stride(h, full, length).0, elapsed + length),
                None if length < left => (end, elapsed + length),
                None => (end, duration),
            };
        }
        elapsed
    }

    /// Returns the length of a step that ends just after a tank becomes full or stops spilling; `None` if no tank does.
    ///
    /// If a level has its maximum inside the step and may have been above the brim, the step ends at
    /// this maximum.
    fn cut(&self, h: &[f64; 3], end: &[f64; 3], full: [bool; 3], length: f64) -> Option<f64> {
        let brim = self.parameters[H_MAX];
        let slope = self.slope(h, full);
        let passed = |end: &[f64; 3]| {
            let net = self.flows(end).net;
            (0..3).any(|i| {
                let may_pass = full[i] || h[i] + length * slope[i] > brim;
                end[i] > brim || may_pass && net[i] < 0.0
            })
        };
        passed(end).then(|| {
            let (mut low, mut high) = (0.0, length);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (low + high);
                let beyond = passed(&self.stride(h, full, middle).0);
                (low, high) = if beyond { (low, middle) } else { (middle, high) };
            }
            high
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::variables::PARAMETERS;

    #[test]
    fn a_level_above_the_brim_inside_a_step_only_cuts_the_step() {
        // Tank 2 rises until the flow from tank 3, which also empties into tank 1, is too small.
        let mut tanks = Tanks {
            command: [0.0, 1.2e-4],
            parameters: PARAMETERS.map(|(.., value, _)| value),
            faulty: [false; 2],
        };
        for (place, value) in [(2, 1.0), (3, 1.0), (4, 0.5), (H_MAX, 1.0)] {
            tanks.parameters[place] = value;
        }
        let (mut h, mut before, mut trial) = ([0.0, 0.598, 0.6], [0.0; 3], 0.1);
        while tanks.flows(&h).net[1] > 0.0 {
            before = h;
            assert_eq!(tanks.advance(&mut h, &mut trial, 1.0).to_bits(), 1.0_f64.to_bits());
        }
        let none = [false; 3];
        let mut highest = 0.0_f64;
        for k in 0..=1000 {
            highest = highest.max(tanks.stride(&before, none, 1e-3 * f64::from(k)).0[1]);
        }
        assert!(highest > before[1].max(h[1]), "the peak lies inside: {highest}");
        tanks.parameters[H_MAX] = highest - 1e-9;
        assert!(before[1].max(h[1]) < tanks.parameters[H_MAX]);
        let cut = tanks.cut(&before, &h, none, 1.0).unwrap();
        let level = tanks.stride(&before, none, cut).0[1];
        assert!((level - highest).abs() < 1e-8, "{level} {highest}");
        tanks.parameters[H_MAX] = highest + 0.1;
        assert_eq!(tanks.cut(&before, &h, none, 1.0).map(f64::to_bits), None);
    }
}
