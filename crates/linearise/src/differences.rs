//! Derivatives by difference quotients, extrapolated to step zero.

use nalgebra::DMatrix;

use super::LineariseError;
use super::parts::Part;
use super::point::Equations;

/// Number of steps for which each difference quotient is computed.
const LEVELS: usize = 8;
/// Ratio of each step to the next smaller one.
const RATIO: f64 = 4.0;
/// The first step, relative to the typical size of a change.
const FIRST: f64 = 1e-2;

/// The side of the operating point on which a variable can be changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Both,
    Above,
    Below,
}

impl Side {
    /// Returns the exponent of the step in the error term number `order` of a difference quotient.
    pub(super) fn exponent(self, order: i32) -> i32 {
        if self == Side::Both { 2 * order } else { order }
    }
}

/// Returns the side of `value` on which `part` can be changed within its `min` and `max`, and the largest change, at
/// most `size`. If one side has less room than `size`, only the side with more room is used; no room is an error.
pub(super) fn reach(part: &Part, value: f64, size: f64) -> Result<(Side, f64), LineariseError> {
    let (below, above) = (value - part.min, part.max - value);
    if below.max(above) <= 0.0 {
        return Err(LineariseError::Role {
            name: part.name.clone(),
            actual: format!("{value} between min = {} and max = {}", part.min, part.max),
            expected: "room for a change",
        });
    }
    Ok(if below >= size && above >= size {
        (Side::Both, size)
    } else if above >= below {
        (Side::Above, above.min(size))
    } else {
        (Side::Below, below.min(size))
    })
}

/// A value and its estimated error.
pub(super) type Estimate = (f64, f64);

/// Returns the limit h -> 0 of a sequence whose value k belongs to the step h / ratio^k.
///
/// The error of a value is a series in the powers `exponent`(1), `exponent`(2), ... of its step; `noise`(k) is the
/// rounding error of value k. The result is the entry of the extrapolation table with the smallest error. The error
/// of a single value is infinite; without values the result is NaN.
///
/// C. J. F. Ridders, Accurate computation of F'(x) and F'(x) F''(x), Adv. Eng. Softw. 4 (1982).
pub(super) fn extrapolate(
    values: &[f64],
    noise: impl Fn(usize) -> f64,
    ratio: f64,
    exponent: impl Fn(i32) -> i32,
) -> Estimate {
    let mut best = (values.last().copied().unwrap_or(f64::NAN), f64::INFINITY);
    let mut previous: Vec<f64> = Vec::new();
    for (level, &value) in values.iter().enumerate() {
        let mut row = vec![value];
        for (order, &coarser) in (1..).zip(&previous) {
            let finer = row[row.len() - 1];
            let better = finer + (finer - coarser) / (ratio.powi(exponent(order)) - 1.0);
            let error = (better - finer).abs().max((better - coarser).abs()) + noise(level);
            if error < best.1 {
                best = (better, error);
            }
            row.push(better);
        }
        previous = row;
    }
    best
}

/// Difference quotients of a vector function at a point, for decreasing steps.
struct Samples {
    side: Side,
    /// The function at the point.
    middle: Vec<f64>,
    /// The distance of the two points of each step.
    widths: Vec<f64>,
    /// For each component, the difference quotient of each step.
    slopes: Vec<Vec<f64>>,
    /// For each component, the right slope minus the left slope of each step; only valid for [`Side::Both`].
    kinks: Vec<Vec<f64>>,
}

impl Samples {
    fn of(
        mut function: impl FnMut(f64) -> Result<Vec<f64>, LineariseError>,
        value: f64,
        side: Side,
        first: f64,
    ) -> Result<Self, LineariseError> {
        let middle = function(value)?;
        let empty = vec![Vec::with_capacity(LEVELS); middle.len()];
        let (slopes, kinks) = (empty.clone(), empty);
        let mut samples = Self { side, middle, widths: Vec::with_capacity(LEVELS), slopes, kinks };
        let mut step = first;
        for _ in 0..LEVELS {
            let (from, to) = match side {
                Side::Both => (value - step, value + step),
                Side::Above => (value, value + step),
                Side::Below => (value - step, value),
            };
            let (low, high) = (function(from)?, function(to)?);
            let width = to - from;
            for (row, &centre) in samples.middle.iter().enumerate() {
                let kink = (high[row] - centre) - (centre - low[row]);
                samples.slopes[row].push((high[row] - low[row]) / width);
                samples.kinks[row].push(kink / (0.5 * width));
            }
            samples.widths.push(width);
            step /= RATIO;
        }
        Ok(samples)
    }

    /// Returns the slope of a component; `magnitude`, the size of its largest term, determines the rounding error.
    ///
    /// With two sides, half of the difference between the right and the left slope is added to the error if the
    /// difference is larger than four times its own error, because there is no derivative at a kink.
    fn slope(&self, row: usize, magnitude: f64) -> Estimate {
        let noise = |level: usize| f64::EPSILON * magnitude / self.widths[level];
        let exponent = |order| self.side.exponent(order);
        let (slope, error) = extrapolate(&self.slopes[row], noise, RATIO, exponent);
        if self.side != Side::Both {
            return (slope, error);
        }
        let noise = |level: usize| 4.0 * noise(level);
        let (kink, kink_error) = extrapolate(&self.kinks[row], noise, RATIO, |order| 2 * order - 1);
        (slope, if kink.abs() > 4.0 * kink_error { error + 0.5 * kink.abs() } else { error })
    }
}

/// The Jacobian of state derivatives and outputs with respect to states and inputs, its errors, and the first step
/// of each column.
pub(super) struct Differences {
    pub(super) jacobian: DMatrix<f64>,
    pub(super) errors: DMatrix<f64>,
    pub(super) steps: Vec<f64>,
}

/// Differentiates `fmi2GetDerivatives` and the outputs; `scales`: the typical sizes of the columns.
pub(super) fn of_equations(
    equations: &mut Equations,
    scales: &[f64],
) -> Result<Differences, LineariseError> {
    let rows = equations.states.len() + equations.parts.outputs.len();
    let mut differences = Differences {
        jacobian: DMatrix::zeros(rows, scales.len()),
        errors: DMatrix::zeros(rows, scales.len()),
        steps: Vec::with_capacity(scales.len()),
    };
    let mut columns = Vec::with_capacity(scales.len());
    // The rounding error of a sum is the rounding error of its largest term, which may be much larger than the sum.
    let mut magnitudes = vec![0.0_f64; rows];
    for (column, scale) in scales.iter().enumerate() {
        let (part, value) = equations.known(column);
        let (side, first) = reach(part, value, FIRST * scale)?;
        let function = |at| equations.evaluate(Some((column, at)));
        let samples = Samples::of(function, value, side, first)?;
        for (row, magnitude) in magnitudes.iter_mut().enumerate() {
            let term = samples.slopes[row][LEVELS / 2] * value.abs().max(first);
            *magnitude = magnitude.max(samples.middle[row].abs()).max(term.abs());
        }
        differences.steps.push(first);
        columns.push(samples);
    }
    for (column, samples) in columns.iter().enumerate() {
        for (row, &magnitude) in magnitudes.iter().enumerate() {
            let (slope, error) = samples.slope(row, magnitude);
            differences.jacobian[(row, column)] = slope;
            differences.errors[(row, column)] = error;
        }
    }
    Ok(differences)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slope_at(value: f64, side: Side, function: impl Fn(f64) -> f64) -> Estimate {
        let samples = Samples::of(|at| Ok(vec![function(at)]), value, side, 1e-2).unwrap();
        samples.slope(0, samples.middle[0].abs().max(value.abs()))
    }

    #[test]
    fn slopes_of_smooth_functions_are_within_their_small_error_estimates() {
        type Function = fn(f64) -> f64;
        let functions: [(Function, Function); 3] =
            [(f64::exp, f64::exp), (f64::sin, f64::cos), (|x| x.powi(5), |x| 5.0 * x.powi(4))];
        for (function, derivative) in functions {
            for side in [Side::Both, Side::Above, Side::Below] {
                let (slope, error) = slope_at(0.7, side, function);
                assert!((slope - derivative(0.7)).abs() <= error, "{side:?} {slope} {error:e}");
                assert!(error < 1e-9, "{side:?} {error:e}");
            }
        }
    }

    #[test]
    fn at_a_kink_half_of_the_jump_of_the_slope_is_the_error() {
        let (slope, error) = slope_at(0.0, Side::Both, |x| x.abs() + x.sin());
        assert!((slope - 1.0).abs() < 1e-9);
        assert!((error - 1.0).abs() < 1e-6, "{error}");
        let (slope, error) = slope_at(0.0, Side::Above, |x| x.abs() + x.sin());
        assert!((slope - 2.0).abs() <= error && error < 1e-9, "{slope} {error:e}");
    }

    #[test]
    fn a_step_that_is_a_thousand_times_too_large_is_seen_in_the_error() {
        let (slope, error) = slope_at(0.0, Side::Both, |x| (x * 1e4).sin());
        assert!((slope - 1e4).abs() <= error && error < 10.0, "{slope} {error}");
    }

    #[test]
    fn at_a_limit_the_step_goes_to_the_other_side() {
        let part = |min, max| Part {
            name: String::new(),
            reference: 0,
            unit: None,
            min,
            max,
            typical: None,
        };
        let reach = |min, max, value| reach(&part(min, max), value, 0.1).ok();
        assert_eq!(reach(0.0, 1.0, 0.0), Some((Side::Above, 0.1)));
        assert_eq!(reach(0.0, 1.0, 1.0), Some((Side::Below, 0.1)));
        assert_eq!(reach(0.0, 1.0, 0.5), Some((Side::Both, 0.1)));
        assert_eq!(reach(0.0, 0.05, 0.04), Some((Side::Below, 0.04)));
        assert_eq!(reach(2.0, 2.0, 2.0), None);
    }
}
