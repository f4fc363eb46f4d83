//! The weight whose magnitude is nearest to a table.

use super::affine::Affine;
use super::{Outcome, Problem};
use crate::check::as_number;
use crate::weight::Weight;
use crate::{Error, check};

/// Points between successive frequencies of the table, including the first frequency.
const BETWEEN: usize = 6;
/// The search ends when ln alpha is known to this fraction of its value for a constant weight.
const NARROW: f64 = 1e-3;
/// Smallest value of the first and the last coefficient of the squared magnitude: magnitudes at frequency 0 and
/// infinity are neither 0 nor infinite. Second-order poles or zeros at an end of four decades give 1e-8.
const SMALLEST: f64 = 1e-10;
/// Least damping ratio of poles and zeros.
const DAMPING: f64 = 0.2;

/// Coefficients of numerator and denominator, the highest power first.
type Quotient = (Vec<f64>, Vec<f64>);

/// A weight and its largest deviation from a table.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct TableWeight {
    /// The weight that is nearest to the table.
    pub weight: Weight,
    /// The largest factor between the magnitudes of the weight and of the table, at least 1.
    pub deviation: f64,
}

/// Computes the weight of order 1 or 2 whose largest deviation from a table is least. `table`: frequencies w (rad/s,
/// ascending) and magnitudes m, with straight lines of their logarithms in between.
///
/// ```text
/// |W(j w)|^2 = N(w^2) / D(w^2),  minimise alpha:  m^2 / alpha <= N / D <= alpha m^2
/// ```
///
/// For a given alpha these are linear inequalities for the coefficients of N and D, and "N and D are positive
/// with damping ratios of at least 0.2" is a linear matrix inequality. Bisection finds ln alpha to 0.1 % of its
/// value for a constant weight; no other weight of this order with such damping is nearer by more than
/// that. The inequalities hold at the frequencies of the table and five points between each two of
/// them. Poles and zeros are the roots in the left half plane (spectral factorisation).
///
/// Source: S. P. Wu, S. Boyd and L. Vandenberghe, FIR filter design via spectral factorization and convex
/// optimization (1996), here for a quotient.
///
/// # Errors
///
/// [`Error::OutOfRange`] for numbers that are not above zero, frequencies that are not ascending, an
/// order other than 1 and 2; [`Error::Empty`] for fewer than two points; [`Error::NotConverged`].
pub fn weight_of_table(table: &[(f64, f64)], order: usize) -> Result<TableWeight, Error> {
    for &(frequency, magnitude) in table {
        check::positive("frequency", frequency)?;
        check::positive("magnitude", magnitude)?;
    }
    for pair in table.windows(2) {
        let (before, frequency) = (pair[0].0, pair[1].0);
        check::that(frequency > before, "frequency", frequency, "above the frequency before it")?;
    }
    let [(first, _), .., (last, _)] = table else {
        return Err(Error::Empty { matrix: "table", actual: (table.len(), 2) });
    };
    check::that((1..=2).contains(&order), "order", as_number(order), "1 or 2")?;
    let unit = (first * last).sqrt();
    let points = interpolated(table);
    let size = (points.iter().map(|(_, m)| m.ln()).sum::<f64>() / as_number(points.len())).exp();
    let fit = |deviation: f64| {
        let scaled = points.iter().map(|(w, m)| ((w / unit).powi(2), (m / size).powi(2)));
        coefficients(&scaled.collect::<Vec<_>>(), order, deviation.powi(2))
    };
    let farthest = points.iter().map(|(_, m)| (m / size).ln().abs()).fold(0.0, f64::max);
    let (mut low, mut high) = (0.0, farthest + NARROW);
    let mut best = fit(high.exp())?;
    while high - low > NARROW * farthest.max(NARROW) {
        let middle = 0.5 * (low + high);
        match fit(middle.exp())? {
            Some(quotient) => (best, high) = (Some(quotient), middle),
            None => low = middle,
        }
    }
    let what = "the weight of a table";
    let (numerator, denominator) = best.ok_or(Error::NotConverged { what, iterations: 1 })?;
    let lead = denominator[0];
    let monic = |all: &[f64], factor: f64| all.iter().map(|one| one * factor / lead).collect();
    let weight = Weight::from_coefficients(monic(&numerator, size), monic(&denominator, 1.0), unit);
    let apart = |(w, m): &(f64, f64)| (weight.magnitude(*w) / m).ln().abs();
    let deviation = points.iter().map(apart).fold(0.0, f64::max).exp();
    Ok(TableWeight { weight, deviation })
}

/// The table with further points between its frequencies.
fn interpolated(table: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let before_last = table.windows(2).flat_map(|pair| {
        let ((w, m), (w_next, m_next)) = (pair[0], pair[1]);
        let part = |at| as_number(at) / as_number(BETWEEN);
        let between = move |part| (w * (w_next / w).powf(part), m * (m_next / m).powf(part));
        (0..BETWEEN).map(part).map(between)
    });
    before_last.chain(table.last().copied()).collect()
}

/// Coefficients of numerator and denominator of a weight whose squared magnitude is within `factor` of the
/// points (w^2, magnitude^2); None if the solver finds none.
fn coefficients(
    points: &[(f64, f64)],
    order: usize,
    factor: f64,
) -> Result<Option<Quotient>, Error> {
    let mut problem = Problem::new();
    let [numerator, denominator] =
        [(); 2].map(|()| (0..=order).map(|_| problem.scalar()).collect::<Vec<_>>());
    for polynomial in [&numerator, &denominator] {
        for coefficient in [&polynomial[0], &polynomial[order]] {
            problem.constrain(coefficient, SMALLEST);
        }
        if let [b_0, b_1, b_2] = polynomial.as_slice() {
            // b_1 >= -(2 - 4 zeta^2) sqrt(b_0 b_2): the matrix bounds b_1 - slack, which is at most b_1.
            let slack = problem.scalar();
            problem.constrain(&slack, 0.0);
            let side = &(b_1 - &slack) * (0.5 / (1.0 - 2.0 * DAMPING * DAMPING));
            problem.constrain(&Affine::blocks(&[&[b_0, &side], &[&side, b_2]]), 0.0);
        }
    }
    let sum = denominator.iter().skip(1).fold(denominator[0].clone(), |sum, one| &sum + one);
    problem.constrain(&(&Affine::identity(1, 1.0) - &sum), 0.0);
    for &(w_squared, m_squared) in points {
        let scale = 1.0 / (1.0 + w_squared).powi(i32::try_from(order).unwrap_or(2));
        let value = |all: &[Affine], gain: f64| {
            let mut power = scale * gain;
            let mut sum = Affine::zeros(1, 1);
            for coefficient in all {
                sum = &sum + &(coefficient * power);
                power *= w_squared;
            }
            sum
        };
        let (n, d) = (value(&numerator, 1.0 / m_squared), value(&denominator, 1.0));
        problem.constrain(&(&(&d * factor) - &n), 0.0);
        problem.constrain(&(&(&n * factor) - &d), 0.0);
    }
    let Outcome::Optimal(solution) = problem.solve()? else { return Ok(None) };
    let factored = |all: &[Affine]| {
        let values: Vec<_> = all.iter().map(|one| solution.value(one)[(0, 0)]).collect();
        spectral_factor(&values)
    };
    Ok(Some((factored(&numerator), factored(&denominator))))
}

/// The polynomial b in p, the highest power first, with roots in the left half plane and |b(j w)|^2 =
/// `c_0` + `c_1` w^2 + `c_2` w^4.
fn spectral_factor(c: &[f64]) -> Vec<f64> {
    match *c {
        [c_0, c_1, c_2] => {
            let (lead, last) = (c_2.sqrt(), c_0.sqrt());
            vec![lead, (c_1 + 2.0 * lead * last).max(0.0).sqrt(), last]
        }
        _ => c.iter().rev().map(|one| one.sqrt()).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten frequencies in a decade, from 0.01 rad/s.
    fn table_of(weight: &Weight, last: i32) -> Vec<(f64, f64)> {
        let frequencies = (-20..=last).map(|k| 10_f64.powf(0.1 * f64::from(k)));
        frequencies.map(|w| (w, weight.magnitude(w))).collect()
    }

    #[test]
    fn the_table_of_a_weight_gives_this_weight() {
        for order in [1, 2] {
            let weight = Weight::lead_lag(5.0, 3.0, 0.05, order).unwrap();
            let fit = weight_of_table(&table_of(&weight, 30), order).unwrap();
            assert!(fit.deviation < 1.02, "{}", fit.deviation);
            let apart = fit.weight.magnitude(1.0) / weight.magnitude(1.0);
            assert!((apart - 1.0).abs() < 0.02);
        }
    }

    /// Poles with a damping ratio of 0.25: |W|^2 has a negative coefficient of w^2 in its denominator.
    #[test]
    fn the_table_of_a_resonance_gives_its_weight() {
        let weight = Weight::from_coefficients(vec![0.5, 2.0, 1.0], vec![1.0, 0.5, 1.0], 1.0);
        // Straight lines between the points of the table differ from the weight by 3 %.
        let deviation = weight_of_table(&table_of(&weight, 20), 2).unwrap().deviation;
        assert!(deviation < 1.05, "{deviation}");
    }

    /// 1 / (s + 0.001)^2 differs from 1 / s^2 by 1 % at 0.01 rad/s, and by less above.
    #[test]
    fn a_table_with_a_slope_at_both_ends_is_met() {
        for slope in [-2, 2] {
            let table = [0.01, 1.0, 100.0].map(|w: f64| (w, w.powi(slope)));
            let deviation = weight_of_table(&table, 2).unwrap().deviation;
            assert!(deviation < 1.02, "{slope}: {deviation}");
        }
    }

    /// A step from 1 to 4 within a factor of 2 of the frequency is too steep for a first-order weight.
    #[test]
    fn the_stated_deviation_is_that_of_the_weight() {
        let table = [(1.0, 1.0), (2.0, 4.0), (100.0, 4.0)];
        let first = weight_of_table(&table, 1).unwrap();
        let most = table.iter().map(|(w, m)| (first.weight.magnitude(*w) / m).ln().abs());
        assert!(most.fold(0.0, f64::max) <= first.deviation.ln() + 1e-9);
        assert!(first.deviation > 1.05 && first.deviation < 1.5, "{}", first.deviation);
        let second = weight_of_table(&table, 2).unwrap();
        assert!(second.deviation < first.deviation);
    }

    #[test]
    fn bad_tables_are_refused() {
        assert!(weight_of_table(&[(1.0, 1.0)], 1).is_err());
        for (second, order) in [((1.0, 2.0), 1), ((2.0, 0.0), 1), ((2.0, 1.0), 3)] {
            assert!(weight_of_table(&[(1.0, 1.0), second], order).is_err());
        }
    }
}
