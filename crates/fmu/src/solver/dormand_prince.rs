//! One step of the Dormand-Prince method of order 5(4), with its continuous extension.
//!
//! Source: J. R. Dormand and P. J. Prince, "A family of embedded Runge-Kutta formulae" (1980);
//! continuous extension of order 4: E. Hairer, S. P. Norsett and G. Wanner, "Solving Ordinary
//! Differential Equations I" (2nd ed.), section II.6.

use std::ops::Index;

use super::Quartic;

/// A state: an array for a model of fixed size, a `Vec` for any size.
pub trait Vector: Clone + Index<usize, Output = f64> {
    /// Sets each component to the value of its index.
    fn set(&mut self, value: impl FnMut(usize) -> f64);
}

impl<const N: usize> Vector for [f64; N] {
    #[inline]
    fn set(&mut self, value: impl FnMut(usize) -> f64) {
        *self = std::array::from_fn(value);
    }
}

impl Vector for Vec<f64> {
    #[inline]
    fn set(&mut self, mut value: impl FnMut(usize) -> f64) {
        for (i, component) in self.iter_mut().enumerate() {
            *component = value(i);
        }
    }
}

/// A step of [`Step::length`] from [`Step::start`] to [`Step::end`], with its slopes.
#[derive(Clone, Debug)]
pub struct Step<V> {
    start: V,
    end: V,
    length: f64,
    slopes: [V; 7],
    /// The state of the stage that is evaluated.
    stage: V,
}

impl<V: Vector> Step<V> {
    /// Creates a step of length 0 at the state `start`, where the derivative is `slope`.
    #[inline]
    #[must_use]
    pub fn new(start: V, slope: &V) -> Self {
        let (end, stage) = (start.clone(), start.clone());
        let slopes = std::array::from_fn(|_| slope.clone());
        Self { start, end, length: 0.0, slopes, stage }
    }

    /// Moves the start to the state `start`, where `derivative` computes the slope.
    pub fn restart(&mut self, start: &V, derivative: impl FnOnce(&V, &mut V)) {
        self.start.clone_from(start);
        self.length = 0.0;
        derivative(&self.start, &mut self.slopes[0]);
    }

    /// Moves the start to the end of the step that was taken. The new first slope is the last slope of that step.
    pub fn proceed(&mut self) {
        std::mem::swap(&mut self.start, &mut self.end);
        self.slopes.swap(0, 6);
        self.length = 0.0;
    }

    /// Integrates `y' = derivative(t, y)` from the start, at `t = time`, for `length`.
    ///
    /// `derivative_at_end`, the same function, computes the last slope, so that a caller can remember its terms. Cost:
    /// six evaluations of the derivative, the last one at the end.
    #[inline]
    pub fn take(
        &mut self,
        mut derivative: impl FnMut(f64, &V, &mut V),
        derivative_at_end: impl FnOnce(f64, &V, &mut V),
        time: f64,
        length: f64,
    ) {
        let h = length;
        let Self { start, end, slopes: [k1, k2, k3, k4, k5, k6, k7], stage, .. } = self;
        let k1 = &*k1;
        combine(stage, start, h, [(0.2, k1)]);
        derivative(time + 0.2 * h, stage, k2);
        let k2 = &*k2;
        combine(stage, start, h, [(3.0 / 40.0, k1), (9.0 / 40.0, k2)]);
        derivative(time + 0.3 * h, stage, k3);
        let k3 = &*k3;
        combine(stage, start, h, [(44.0 / 45.0, k1), (-56.0 / 15.0, k2), (32.0 / 9.0, k3)]);
        derivative(time + 0.8 * h, stage, k4);
        let k4 = &*k4;
        let sum = [
            (19372.0 / 6561.0, k1),
            (-25360.0 / 2187.0, k2),
            (64448.0 / 6561.0, k3),
            (-212.0 / 729.0, k4),
        ];
        combine(stage, start, h, sum);
        derivative(time + 8.0 / 9.0 * h, stage, k5);
        let k5 = &*k5;
        let sum = [
            (9017.0 / 3168.0, k1),
            (-355.0 / 33.0, k2),
            (46732.0 / 5247.0, k3),
            (49.0 / 176.0, k4),
            (-5103.0 / 18656.0, k5),
        ];
        combine(stage, start, h, sum);
        derivative(time + h, stage, k6);
        let k6 = &*k6;
        let sum = [
            (35.0 / 384.0, k1),
            (500.0 / 1113.0, k3),
            (125.0 / 192.0, k4),
            (-2187.0 / 6784.0, k5),
            (11.0 / 84.0, k6),
        ];
        combine(end, start, h, sum);
        derivative_at_end(time + h, end, k7);
        self.length = length;
    }

    /// The state at the start.
    #[inline]
    #[must_use]
    pub fn start(&self) -> &V {
        &self.start
    }

    /// The state at the end.
    #[inline]
    #[must_use]
    pub fn end(&self) -> &V {
        &self.end
    }

    /// The length of the step.
    #[inline]
    #[must_use]
    pub fn length(&self) -> f64 {
        self.length
    }

    /// The derivative at the start of the step.
    #[inline]
    #[must_use]
    pub fn first_slope(&self) -> &V {
        &self.slopes[0]
    }

    /// The derivative at the end of the step.
    #[inline]
    #[must_use]
    pub fn last_slope(&self) -> &V {
        &self.slopes[6]
    }

    /// Difference of the solutions of order 5 and 4 in component `i`: the estimate of the local error.
    #[inline]
    #[must_use]
    pub fn error(&self, i: usize) -> f64 {
        let [k1, _, k3, k4, k5, k6, k7] = &self.slopes;
        let sum = [
            (71.0 / 57600.0, k1),
            (-71.0 / 16695.0, k3),
            (71.0 / 1920.0, k4),
            (-17253.0 / 339_200.0, k5),
            (22.0 / 525.0, k6),
            (-1.0 / 40.0, k7),
        ];
        component(0.0, self.length, i, &sum)
    }

    /// Component `i` of the continuous extension at the middle of the step, of order 4.
    ///
    /// This value and the values and slopes at both ends determine the whole extension, a polynomial of degree 4.
    #[inline]
    #[must_use]
    pub fn middle(&self, i: usize) -> f64 {
        let [k1, _, k3, k4, k5, k6, k7] = &self.slopes;
        let correction = [
            (-12_715_105_075.0 / 11_282_082_432.0, k1),
            (87_487_479_700.0 / 32_700_410_799.0, k3),
            (-10_690_763_975.0 / 1_880_347_072.0, k4),
            (701_980_252_875.0 / 199_316_789_632.0, k5),
            (-1_453_857_185.0 / 822_651_844.0, k6),
            (69_997_945.0 / 29_380_423.0, k7),
        ];
        let bend = component(0.0, self.length, i, &correction);
        let mean = 0.5 * (self.start[i] + self.end[i]);
        mean + self.length / 8.0 * (k1[i] - k7[i]) + bend / 16.0
    }

    /// The continuous extension of component `i` over the step, whose ends are 0 and 1.
    #[inline]
    #[must_use]
    pub fn extension(&self, i: usize) -> Quartic {
        Quartic::new(
            (self.start[i], self.length * self.slopes[0][i]),
            self.middle(i),
            (self.end[i], self.length * self.slopes[6][i]),
        )
    }
}

/// `result = base + length * sum(weight * slope)`.
#[inline]
fn combine<V: Vector, const TERMS: usize>(
    result: &mut V,
    base: &V,
    length: f64,
    sum: [(f64, &V); TERMS],
) {
    result.set(|i| component(base[i], length, i, &sum));
}

/// `base + length * sum(weight * slope[i])`.
#[inline]
fn component<V: Vector, const TERMS: usize>(
    base: f64,
    length: f64,
    i: usize,
    sum: &[(f64, &V); TERMS],
) -> f64 {
    let total: f64 = sum.iter().map(|(weight, slope)| weight * slope[i]).sum();
    base + length * total
}

#[cfg(test)]
mod tests {
    use super::*;

    type State = [f64; 4];

    /// Oscillators of angular frequency 1 and 2 that start with sine and cosine.
    fn oscillators(_: f64, y: &State) -> State {
        [y[1], -y[0], 2.0 * y[3], -2.0 * y[2]]
    }

    fn exact(time: f64) -> State {
        [time.sin(), time.cos(), (2.0 * time).sin(), (2.0 * time).cos()]
    }

    fn take(f: impl Fn(f64, &State) -> State, time: f64, start: State, length: f64) -> Step<State> {
        let mut step = Step::new(start, &f(time, &start));
        let evaluate = |t: f64, y: &State, slope: &mut State| *slope = f(t, y);
        step.take(evaluate, evaluate, time, length);
        step
    }

    fn step(length: f64) -> Step<State> {
        take(oscillators, 0.3, exact(0.3), length)
    }

    fn middle(step: &Step<State>) -> State {
        std::array::from_fn(|i| step.middle(i))
    }

    fn error(step: &Step<State>) -> State {
        std::array::from_fn(|i| step.error(i))
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
        let measured = order(|h| distance(step(h).end(), &exact(0.3 + h)));
        assert!((measured - 6.0).abs() < 0.3, "order {measured}");
    }

    #[test]
    fn the_local_error_of_the_middle_is_of_order_five() {
        let measured = order(|h| distance(&middle(&step(h)), &exact(0.3 + h / 2.0)));
        assert!((measured - 5.0).abs() < 0.3, "order {measured}");
    }

    #[test]
    fn the_local_error_of_the_whole_extension_is_of_order_five() {
        let largest = |h: f64| {
            let step = step(h);
            let at =
                |part: f64| -> State { std::array::from_fn(|i| step.extension(i).value(part)) };
            let parts = [0.1, 0.25, 0.4, 0.6, 0.75, 0.9];
            parts
                .map(|part| distance(&at(part), &exact(0.3 + part * h)))
                .into_iter()
                .fold(0.0, f64::max)
        };
        let measured = order(largest);
        assert!((measured - 5.0).abs() < 0.3, "order {measured}");
    }

    #[test]
    fn the_error_estimate_is_of_order_five_and_covers_the_error() {
        let estimate = |h| distance(&error(&step(h)), &[0.0; 4]);
        assert!((order(estimate) - 5.0).abs() < 0.3);
        assert!(estimate(0.1) > distance(step(0.1).end(), &exact(0.4)));
    }

    #[test]
    fn a_polynomial_of_degree_four_in_time_is_integrated_without_error() {
        let derivative = |t: f64, _: &State| [1.0, 2.0 * t, 3.0 * t * t, 4.0 * t * t * t];
        let power = |t: f64| [t, t * t, t.powi(3), t.powi(4)];
        let step = take(derivative, 0.5, power(0.5), 1.5);
        assert!(distance(step.end(), &power(2.0)) < 1e-13);
        assert!(distance(&middle(&step), &power(1.25)) < 1e-13);
        assert!(distance(&error(&step), &[0.0; 4]) < 1e-13);
    }

    #[test]
    fn arrays_and_vectors_give_the_same_bits() {
        let array = step(0.1);
        let start = exact(0.3);
        let mut vector = Step::new(start.to_vec(), &oscillators(0.3, &start).to_vec());
        let evaluate = |t: f64, y: &Vec<f64>, slope: &mut Vec<f64>| {
            slope.copy_from_slice(&oscillators(t, &[y[0], y[1], y[2], y[3]]));
        };
        vector.take(evaluate, evaluate, 0.3, 0.1);
        assert_eq!(array.end().map(f64::to_bits).to_vec(), bits(vector.end()));
    }

    fn bits(values: &[f64]) -> Vec<u64> {
        values.iter().map(|value| value.to_bits()).collect()
    }
}
