//! Statistics of a variable over the whole run.

use results::Column;

/// Statistics of a variable. Values that are not finite are counted and otherwise left out; without any
/// finite value all figures are NaN.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Statistics {
    /// The first value.
    pub first: f64,
    /// The last value.
    pub last: f64,
    /// The smallest value, and its time in s.
    pub smallest: (f64, f64),
    /// The largest value, and its time in s.
    pub largest: (f64, f64),
    /// The mean over time: the integral by the trapezoidal rule (held values for integers and Booleans),
    /// divided by the length of the run.
    pub mean: f64,
    /// The root of the mean over time of the square, by the same rule.
    pub rms: f64,
    /// The number of values that are not finite.
    pub not_finite: u64,
}

/// Collects the statistics of a variable row by row.
pub(crate) struct Builder {
    statistics: Statistics,
    holds: bool,
    before: Option<(f64, f64)>,
    length: f64,
    integral: f64,
    integral_of_square: f64,
}

impl Builder {
    pub(crate) fn new(column: &Column) -> Self {
        let nan = f64::NAN;
        let statistics = Statistics {
            first: nan,
            last: nan,
            smallest: (nan, nan),
            largest: (nan, nan),
            mean: nan,
            rms: nan,
            not_finite: 0,
        };
        let holds = crate::holds(column);
        Self {
            statistics,
            holds,
            before: None,
            length: 0.0,
            integral: 0.0,
            integral_of_square: 0.0,
        }
    }

    pub(crate) fn push(&mut self, time: f64, value: f64) {
        if !(value.is_finite() && time.is_finite()) {
            self.statistics.not_finite += 1;
            self.before = None;
            return;
        }
        let statistics = &mut self.statistics;
        if statistics.first.is_nan() {
            (statistics.first, statistics.smallest, statistics.largest) =
                (value, (value, time), (value, time));
        }
        statistics.last = value;
        if value < statistics.smallest.0 {
            statistics.smallest = (value, time);
        }
        if value > statistics.largest.0 {
            statistics.largest = (value, time);
        }
        if let Some((at, old)) = self.before {
            let (step, end) = ((time - at).max(0.0), if self.holds { old } else { value });
            self.length += step;
            self.integral += step * (0.5 * old + 0.5 * end);
            self.integral_of_square += step * (0.5 * old * old + 0.5 * end * end);
        }
        self.before = Some((time, value));
    }

    pub(crate) fn finish(self) -> Statistics {
        let Self { mut statistics, length, integral, integral_of_square, .. } = self;
        if length > 0.0 {
            (statistics.mean, statistics.rms) =
                (integral / length, (integral_of_square / length).sqrt());
        } else {
            (statistics.mean, statistics.rms) = (statistics.last, statistics.last.abs());
        }
        statistics
    }
}
