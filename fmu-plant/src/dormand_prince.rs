//! One step of the Dormand-Prince method of order 5(4), with its continuous extension.
//!
//! Source: J. R. Dormand and P. J. Prince, "A family of embedded Runge-Kutta formulae" (1980);
//! continuous extension of order 4: E. Hairer, S. P. Norsett and G. Wanner, "Solving Ordinary
//! Differential Equations I" (2nd ed.), section II.6.

use crate::dynamics::State;

/// A step from `start` to `end` of the given `length`, with its slopes.
pub(crate) struct Step {
    pub(crate) start: State,
    pub(crate) end: State,
    pub(crate) length: f64,
    slopes: [State; 7],
}

impl Step {
    /// Integrates `y' = derivative(t, y)` from `t = time`, where its value is `slope`.
    ///
    /// `derivative_at_end` is the same function; it computes the last slope, so that a caller can
    /// remember its terms. Cost: six evaluations of the derivative.
    pub(crate) fn take(
        derivative: impl Fn(f64, &State) -> State,
        derivative_at_end: impl Fn(f64, &State) -> State,
        time: f64,
        start: &State,
        slope: &State,
        length: f64,
    ) -> Self {
        let h = length;
        let stage = |node: f64, state: &State| derivative(time + node * h, state);
        let k1 = *slope;
        let k2 = stage(0.2, &combine(start, h, [(0.2, &k1)]));
        let k3 = stage(0.3, &combine(start, h, [(3.0 / 40.0, &k1), (9.0 / 40.0, &k2)]));
        let sum = [(44.0 / 45.0, &k1), (-56.0 / 15.0, &k2), (32.0 / 9.0, &k3)];
        let k4 = stage(0.8, &combine(start, h, sum));
        let sum = [
            (19372.0 / 6561.0, &k1),
            (-25360.0 / 2187.0, &k2),
            (64448.0 / 6561.0, &k3),
            (-212.0 / 729.0, &k4),
        ];
        let k5 = stage(8.0 / 9.0, &combine(start, h, sum));
        let sum = [
            (9017.0 / 3168.0, &k1),
            (-355.0 / 33.0, &k2),
            (46732.0 / 5247.0, &k3),
            (49.0 / 176.0, &k4),
            (-5103.0 / 18656.0, &k5),
        ];
        let k6 = stage(1.0, &combine(start, h, sum));
        let sum = [
            (35.0 / 384.0, &k1),
            (500.0 / 1113.0, &k3),
            (125.0 / 192.0, &k4),
            (-2187.0 / 6784.0, &k5),
            (11.0 / 84.0, &k6),
        ];
        let end = combine(start, h, sum);
        let k7 = derivative_at_end(time + h, &end);
        Self { start: *start, end, length, slopes: [k1, k2, k3, k4, k5, k6, k7] }
    }

    /// The derivative at the start of the step.
    pub(crate) fn first_slope(&self) -> &State {
        &self.slopes[0]
    }

    /// The derivative at the end of the step.
    pub(crate) fn last_slope(&self) -> &State {
        &self.slopes[6]
    }

    /// Difference of the solutions of order 5 and 4: the local error estimate per component.
    pub(crate) fn error(&self) -> State {
        let [k1, _, k3, k4, k5, k6, k7] = &self.slopes;
        let sum = [
            (71.0 / 57600.0, k1),
            (-71.0 / 16695.0, k3),
            (71.0 / 1920.0, k4),
            (-17253.0 / 339_200.0, k5),
            (22.0 / 525.0, k6),
            (-1.0 / 40.0, k7),
        ];
        combine(&[0.0; 4], self.length, sum)
    }

    /// The continuous extension at the middle of the step, of order 4.
    ///
    /// With the values and slopes at both ends it determines the whole extension, a polynomial
    /// of degree 4 in every component.
    pub(crate) fn middle(&self) -> State {
        let [k1, _, k3, k4, k5, k6, k7] = &self.slopes;
        let correction = [
            (-12_715_105_075.0 / 11_282_082_432.0, k1),
            (87_487_479_700.0 / 32_700_410_799.0, k3),
            (-10_690_763_975.0 / 1_880_347_072.0, k4),
            (701_980_252_875.0 / 199_316_789_632.0, k5),
            (-1_453_857_185.0 / 822_651_844.0, k6),
            (69_997_945.0 / 29_380_423.0, k7),
        ];
        let bend = combine(&[0.0; 4], self.length, correction);
        std::array::from_fn(|i| {
            let mean = 0.5 * (self.start[i] + self.end[i]);
            mean + self.length / 8.0 * (k1[i] - k7[i]) + bend[i] / 16.0
        })
    }
}

/// `base + length * sum(weight * slope)`.
fn combine<const TERMS: usize>(base: &State, length: f64, sum: [(f64, &State); TERMS]) -> State {
    std::array::from_fn(|i| {
        let total: f64 = sum.iter().map(|(weight, slope)| weight * slope[i]).sum();
        base[i] + length * total
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oscillators of angular frequency 1 and 2 that start with sine and cosine.
    fn oscillators(_: f64, y: &State) -> State {
        [y[1], -y[0], 2.0 * y[3], -2.0 * y[2]]
    }

    fn exact(time: f64) -> State {
        [time.sin(), time.cos(), (2.0 * time).sin(), (2.0 * time).cos()]
    }

    fn step(length: f64) -> Step {
        let start = exact(0.3);
        Step::take(oscillators, oscillators, 0.3, &start, &oscillators(0.3, &start), length)
    }

    fn distance(a: &State, b: &State) -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    /// Exponent of the step length in a local error that is halved from step to step.
    fn order(error: impl Fn(f64) -> f64) -> f64 {
        (error(0.1) / error(0.05)).log2()
    }

    #[test]
    fn the_local_error_of_the_end_is_of_order_six() {
        let measured = order(|h| distance(&step(h).end, &exact(0.3 + h)));
        assert!((measured - 6.0).abs() < 0.3, "order {measured}");
    }

    #[test]
    fn the_local_error_of_the_middle_is_of_order_five() {
        let measured = order(|h| distance(&step(h).middle(), &exact(0.3 + h / 2.0)));
        assert!((measured - 5.0).abs() < 0.3, "order {measured}");
    }

    #[test]
    fn the_error_estimate_is_of_order_five_and_covers_the_error() {
        let estimate = |h| distance(&step(h).error(), &[0.0; 4]);
        assert!((order(estimate) - 5.0).abs() < 0.3);
        assert!(estimate(0.1) > distance(&step(0.1).end, &exact(0.4)));
    }

    #[test]
    fn a_polynomial_of_degree_four_in_time_is_integrated_without_error() {
        let derivative = |t: f64, _: &State| [1.0, 2.0 * t, 3.0 * t * t, 4.0 * t * t * t];
        let power = |t: f64| [t, t * t, t.powi(3), t.powi(4)];
        let step =
            Step::take(derivative, derivative, 0.5, &power(0.5), &derivative(0.5, &[0.0; 4]), 1.5);
        assert!(distance(&step.end, &power(2.0)) < 1e-13);
        assert!(distance(&step.middle(), &power(1.25)) < 1e-13);
        assert!(distance(&step.error(), &[0.0; 4]) < 1e-13);
    }
}
