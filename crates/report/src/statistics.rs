//! Statistics of a variable over the whole run.

use results::Column;

/// Statistics of a variable. Values that are not finite are counted and otherwise left out; without any
/// finite value, `first` to `rms` are NaN.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Statistics {
    /// The first finite value.
    pub first: f64,
    /// The last finite value.
    pub last: f64,
    /// The smallest value, and the first time in s of this value.
    pub smallest: (f64, f64),
    /// The largest value, and the first time in s of this value.
    pub largest: (f64, f64),
    /// The mean over [`Statistics::basis`].
    pub mean: f64,
    /// The root of the mean of the square over [`Statistics::basis`].
    pub rms: f64,
    /// The quantity over which mean and rms are taken.
    pub basis: Basis,
    /// The number of rows without a finite value or a finite time.
    pub not_finite: u64,
}

/// The quantity over which a mean is taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Basis {
    /// Time, of this length in s: the integral by the trapezoidal rule (integers and Booleans are held), divided by the
    /// length.
    Time(f64),
    /// The given number of finite values, equally weighted, because some rows have none or the time does not advance.
    Values(u64),
}

/// Factors by which values are scaled: sums and squares of the second do not overflow, and squares of the third do not
/// underflow.
const SCALES: [f64; 3] = [1.0, 1e-163, 1e200];
/// Squares below have lost digits.
const SMALL: f64 = 1e-280;

/// Returns the squares of a value, scaled by each of [`SCALES`].
pub(crate) fn squares(value: f64) -> [f64; 3] {
    SCALES.map(|scale| (value * scale) * (value * scale))
}

/// Returns the root of the mean of squares from [`squares`].
pub(crate) fn root([square, low, high]: [f64; 3]) -> f64 {
    let [_, down, up] = SCALES;
    if square.is_infinite() {
        low.sqrt() / down
    } else if square < SMALL {
        high.sqrt() / up
    } else {
        square.sqrt()
    }
}

/// Collects the statistics of a variable row by row.
pub(crate) struct Builder {
    statistics: Statistics,
    /// Whether the variable keeps its value between two rows, which determines how its integrals are computed.
    is_held: bool,
    /// Time and value of the last finite row.
    before: Option<(f64, f64)>,
    /// Time in s between the first and the last finite row.
    length: f64,
    /// Integrals of the [`powers`].
    integrals: [f64; 5],
    /// Number of finite values.
    count: u64,
    /// Sums of the [`powers`] of the finite values.
    sums: [f64; 5],
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
            basis: Basis::Values(0),
            not_finite: 0,
        };
        let is_held = column.is_held();
        let (integrals, sums) = ([0.0; 5], [0.0; 5]);
        Self { statistics, is_held, before: None, length: 0.0, integrals, count: 0, sums }
    }

    pub(crate) fn push(&mut self, time: f64, value: f64) {
        if !(value.is_finite() && time.is_finite()) {
            self.statistics.not_finite += 1;
            return;
        }
        let statistics = &mut self.statistics;
        if self.count == 0 {
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
        self.count += 1;
        let powers = powers(value);
        if let Some((at, old)) = self.before.filter(|(at, _)| *at < time) {
            let (step, starts) = (time - at, self::powers(old));
            self.length += step;
            let ends = if self.is_held { starts } else { powers };
            for ((integral, start), end) in self.integrals.iter_mut().zip(starts).zip(ends) {
                *integral += step * (0.5 * start + 0.5 * end);
            }
        }
        self.sums.iter_mut().zip(powers).for_each(|(sum, power)| *sum += power);
        self.before = Some((time, value));
    }

    pub(crate) fn finish(self) -> Statistics {
        let Self { mut statistics, length, integrals, count, sums, .. } = self;
        let (basis, [mean, scaled_mean, squares @ ..]) =
            if length > 0.0 && statistics.not_finite == 0 {
                (Basis::Time(length), integrals.map(|integral| integral / length))
            } else {
                #[expect(clippy::cast_precision_loss, reason = "fewer than 2^53 values")]
                let number = count as f64;
                (Basis::Values(count), sums.map(|sum| sum / number))
            };
        statistics.rms = root(squares);
        statistics.mean =
            if count > 0 && !mean.is_finite() { scaled_mean / SCALES[1] } else { mean };
        statistics.basis = basis;
        statistics
    }
}

/// Returns a value, the value scaled so that sums do not overflow, and its [`squares`].
fn powers(value: f64) -> [f64; 5] {
    let [square, low, high] = squares(value);
    [value, value * SCALES[1], square, low, high]
}

#[cfg(test)]
mod tests {
    use results::ColumnKind;

    use super::*;

    fn statistics(kind: ColumnKind, values: &[f64]) -> Statistics {
        let column = Column { name: "x".to_owned(), kind, unit: None, clocked: false };
        let mut builder = Builder::new(&column);
        for (time, value) in (0_u32..).zip(values) {
            builder.push(f64::from(time), *value);
        }
        builder.finish()
    }

    #[test]
    fn values_between_empty_cells_have_the_same_weight() {
        let gap = f64::NAN;
        let values = [10.0, gap, 20.0, gap, 30.0, gap, 40.0];
        for kind in [ColumnKind::Real, ColumnKind::Integer] {
            let actual = statistics(kind, &values);
            assert_eq!((actual.mean, actual.rms), (25.0, 750.0_f64.sqrt()));
            assert_eq!((actual.basis, actual.not_finite), (Basis::Values(4), 3));
        }
        assert!(statistics(ColumnKind::Real, &[gap]).mean.is_nan());
    }

    #[test]
    fn the_rms_of_values_whose_squares_overflow_or_underflow_and_their_mean_are_finite() {
        for value in [1.7e308, 3e200, 1.0, 3e-141, 3e-155, 3e-170, 3e-310] {
            for values in [[value, value, value], [value, f64::NAN, value]] {
                let Statistics { rms, mean, .. } = statistics(ColumnKind::Real, &values);
                assert!((rms / value - 1.0).abs() < 1e-12, "{value}: {rms}");
                assert!((mean / value - 1.0).abs() < 1e-12, "{value}: {mean}");
            }
            // A triangle from -v to v has the mean 0 and the mean square v^2 by the trapezoidal rule.
            let swing = statistics(ColumnKind::Real, &[value, -value, value]);
            assert!(swing.mean.abs() <= 0.0, "{}", swing.mean);
            assert!((swing.rms / value - 1.0).abs() < 1e-12, "{value}: {}", swing.rms);
        }
    }

    #[test]
    fn without_empty_cells_the_mean_is_over_time() {
        let actual = statistics(ColumnKind::Real, &[0.0, 3.0, 3.0]);
        assert_eq!((actual.mean, actual.basis), (2.25, Basis::Time(2.0)));
        let held = statistics(ColumnKind::Integer, &[0.0, 3.0, 3.0]);
        assert_eq!((held.mean, held.basis), (1.5, Basis::Time(2.0)));
        let single = statistics(ColumnKind::Real, &[-2.0]);
        assert_eq!((single.mean, single.rms, single.basis), (-2.0, 2.0, Basis::Values(1)));
    }
}
