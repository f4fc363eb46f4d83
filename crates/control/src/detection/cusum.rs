//! Cumulative sums: a test of the mean of one white residual.

use super::Delay;
use super::chi_square::{normal_below, normal_density};
use crate::check::as_number;
use crate::{Error, check};
use nalgebra::{DMatrix, DVector};

/// Points of the quadrature for the density of a cumulative sum between 0 and the threshold.
const NODES: usize = 48;
/// Number of steps in which the density of a cumulative sum without a fault settles. For the smallest drifts, the
/// distance from the settled density decays by a factor of about exp(-(pi / h)^2) per step; the threshold h is at most
/// [`LARGE`].
const SETTLING: usize = 10_000;
const BISECTIONS: usize = 60;
/// The largest threshold for which the integral equation of single samples is solved.
const LARGE: f64 = 40.0;
/// A test with a threshold above [`LARGE`] is computed as a test of grouped samples with about this threshold.
const REDUCED: f64 = 20.0;
/// The largest threshold that the search for a threshold tries.
const LARGEST: f64 = 1e6;
/// Twice the mean overshoot of a random walk with standard normal steps over a distant threshold: Siegmund (1985),
/// (10.37).
const EXCESS: f64 = 1.166;
/// The largest run length that is computed from LU factors: their relative error is about 1e-16 times the run length.
const LONGEST: f64 = 1e12;

/// The two-sided test by cumulative sums of a residual g with variance 1 and, without faults, mean 0.
///
/// ```text
/// S+[k] = max(0, S+[k-1] + g[k] - kappa)
/// S-[k] = max(0, S-[k-1] - g[k] - kappa)      alarm: S+[k] > h or S-[k] > h
/// ```
///
/// The best drift kappa for a fault that moves the mean by delta is delta / 2 (Lorden 1971, Moustakides
/// 1986: the largest mean delay is the least possible for a given mean time between false alarms).
///
/// The run length L+ or L- of one sum solves an integral equation (Page 1954, (4)), here by the Gauss-Legendre
/// quadrature of Goel and Wu (1971); both sums together have 1/L = 1/L+ + 1/L- (Kemp 1961). Run lengths above 1e12 come
/// from the elimination of Grassmann, Taksar and Heyman (1985), which has no subtractions and so no cancellation. Brook
/// and Evans (1972) and textbooks have tables of run lengths.
///
/// Above a threshold of 40, N samples are replaced by one sample with N^(1/2) times the mean. This changes the run
/// length by less than 1 % for a small drift: the threshold plus 1.166, the mean excess on both sides (Siegmund 1985,
/// section 10.2), scales with N^(-1/2).
///
/// Source: E. S. Page, Biometrika 41 (1954); A. L. Goel and S. M. Wu, Technometrics 13 (1971); K. W. Kemp,
/// J. Royal Stat. Soc. B 23 (1961); D. Brook and D. A. Evans, Biometrika 59 (1972); D. Siegmund, Sequential
/// Analysis (1985); W. K. Grassmann, M. I. Taksar and D. P. Heyman, Operations Research 33 (1985).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cusum {
    /// The drift kappa, in standard deviations of the residual, above 0.
    pub drift: f64,
    /// The threshold h, in standard deviations of the residual, above 0.
    pub threshold: f64,
}

impl Cusum {
    /// Returns the test with drift `drift` and a mean of `samples` samples between false alarms.
    ///
    /// `drift`: above 0; `samples`: at least 2. With a large drift, false alarms may be rarer than required at every
    /// threshold: the threshold is then close to 0 and [`Cusum::between_false_alarms`] larger than `samples`, 1.7e6 for
    /// a drift of 5. Method: bisection, relative accuracy of the threshold 1e-12.
    ///
    /// # Example
    ///
    /// ```
    /// use control::detection::Cusum;
    /// // Montgomery, Introduction to Statistical Quality Control: k = 0.5, h = 5 has a run length of 465.
    /// let test = Cusum::with_false_alarms(0.5, 465.0)?;
    /// assert!((test.threshold - 5.0).abs() < 1e-3);
    /// # Ok::<(), control::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] for a drift that is not above 0, or a number of samples below 2 or so large
    /// that the threshold would be above 1e6.
    pub fn with_false_alarms(drift: f64, samples: f64) -> Result<Self, Error> {
        check::positive("the drift", drift)?;
        let name = "the number of samples between false alarms";
        check::that(samples >= 2.0, name, samples, "at least 2")?;
        let test = |threshold: f64| Self { drift, threshold };
        let (mut low, mut high) = (0.0, 1.0);
        // With `samples` = infinity, the loop ends with the error at the largest threshold.
        while test(high).between_false_alarms() <= samples {
            (low, high) = (high, 1.5 * high);
            let rule = "less, as the threshold would be above 1e6";
            check::that(high <= LARGEST, name, samples, rule)?;
        }
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            let is_short = test(middle).between_false_alarms() < samples;
            *(if is_short { &mut low } else { &mut high }) = middle;
        }
        Ok(test(high))
    }

    /// The mean number of samples from zero sums to a false alarm of either sum.
    #[must_use]
    pub fn between_false_alarms(&self) -> f64 {
        0.5 * self.run_length(0.0)
    }

    /// A lower bound of the mean number of samples between false alarms if errors of the model move the
    /// mean of the residual by at most `bias`, in either direction: the number for the constant mean `bias`.
    #[must_use]
    pub fn between_false_alarms_with_bias(&self, bias: f64) -> f64 {
        let bias = bias.abs();
        1.0 / (1.0 / self.run_length(bias) + 1.0 / self.run_length(-bias))
    }

    /// The mean number of samples until S+, started at 0, exceeds h, if the residual has this mean: L(0) of
    ///
    /// ```text
    /// L(s) = 1 + L(0) Phi(kappa - mean - s) + integral of L(y) phi(y - s + kappa - mean), y from 0 to h
    /// ```
    ///
    /// L(s) is the number from S+ = s; Phi and phi are the standard normal distribution function and density. Infinite
    /// beyond the range of double precision.
    #[must_use]
    pub fn run_length(&self, mean: f64) -> f64 {
        let (group, test) = self.grouped();
        as_number(group) * test.single_run_length(mean * as_number(group).sqrt())
    }

    fn single_run_length(&self, mean: f64) -> f64 {
        let (nodes, weights) = self.quadrature();
        let shift = self.drift - mean;
        // The unknowns are L(0), then L at the nodes.
        let count = nodes.len() + 1;
        let transitions = transitions(&nodes, &weights, shift);
        let matrix = DMatrix::<f64>::identity(count, count) - &transitions;
        let ones = DVector::from_element(count, 1.0);
        match matrix.lu().solve(&ones) {
            Some(lengths) if (1.0..=LONGEST).contains(&lengths[0]) => lengths[0],
            _ => {
                let alarm = |row: usize| normal_below(start(&nodes, row) - self.threshold - shift);
                mean_steps(transitions, DVector::from_fn(count, |row, _| alarm(row)))
            }
        }
    }

    /// The distribution of the delay of a fault that moves the mean of the residual to `mean(k)` in its
    /// k-th sample, k from 0 on; at most `most` samples are followed.
    ///
    /// When the fault starts, the sums have the distribution after a long time without faults and alarms. Only one sum
    /// is followed: S- if the sum of the first `most` means is negative, otherwise S+. The result ends early when less
    /// than 1e-6 of the faults are missed. With a threshold above 40, `mean` is also called for some k from `most` on.
    #[must_use]
    pub fn delay(&self, mean: impl Fn(usize) -> f64, most: usize) -> Delay {
        let (group, test) = self.grouped();
        let mut sums = Sums::settled(&test);
        let total: f64 = (0..most).map(&mean).sum();
        let sign = if total < 0.0 { -1.0 } else { 1.0 };
        let mut missed = vec![1.0];
        while missed.len() <= most {
            let start = missed.len() - 1;
            let sum: f64 = (start..start + group).map(&mean).sum();
            sums.step(sign * sum / as_number(group).sqrt());
            let (before, left) = (missed[start], sums.total());
            // Within a group the probability is interpolated.
            let part = |k| before + (left - before) * as_number(k) / as_number(group);
            missed.extend((1..=group).take(most - start).map(part));
            if left < 1e-6 {
                break;
            }
        }
        Delay { missed }
    }

    /// The number N of samples in a group, and the test for the sum of a group divided by N^(1/2). Up to a threshold of
    /// 40, N is 1 and the test is `self`.
    fn grouped(&self) -> (usize, Self) {
        if self.threshold <= LARGE {
            return (1, *self);
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 1e10")]
        let group = (self.threshold / REDUCED).powi(2).ceil() as usize;
        let root = as_number(group).sqrt();
        let threshold = (self.threshold + EXCESS) / root - EXCESS;
        (group, Self { drift: self.drift * root, threshold })
    }

    /// Nodes and weights of the quadrature from 0 to the threshold.
    fn quadrature(&self) -> (Vec<f64>, Vec<f64>) {
        // A node for each 0.2 standard deviations keeps the accuracy for large thresholds.
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 200")]
        let count = NODES.max((5.0 * self.threshold.min(LARGE)) as usize);
        let half = 0.5 * self.threshold;
        let (nodes, weights) = gauss_legendre(count);
        let nodes = nodes.iter().map(|node| half * (1.0 + node)).collect();
        (nodes, weights.iter().map(|weight| half * weight).collect())
    }
}

/// The value of a sum in state `row`: 0, then the nodes.
fn start(nodes: &[f64], row: usize) -> f64 {
    if row == 0 { 0.0 } else { nodes[row - 1] }
}

/// The probabilities that one step takes a cumulative sum from the state of the row to the state of the column. States:
/// 0, then the nodes. `shift`: the drift minus the mean of the residual.
fn transitions(nodes: &[f64], weights: &[f64], shift: f64) -> DMatrix<f64> {
    let count = nodes.len() + 1;
    DMatrix::from_fn(count, count, |row, column| match column {
        0 => normal_below(shift - start(nodes, row)),
        _ => weights[column - 1] * normal_density(nodes[column - 1] - start(nodes, row) + shift),
    })
}

/// The mean number of steps from state 0 to an alarm.
///
/// `transitions`: the probabilities from the states in the rows to those in the columns; `alarms`: the
/// probabilities of an alarm. States are eliminated from the last one on, without subtraction.
fn mean_steps(mut transitions: DMatrix<f64>, mut alarms: DVector<f64>) -> f64 {
    let mut steps = DVector::from_element(alarms.len(), 1.0);
    for last in (1..alarms.len()).rev() {
        let leaving = alarms[last] + transitions.row(last).columns(0, last).sum();
        for row in 0..last {
            let visits = transitions[(row, last)] / leaving;
            alarms[row] += visits * alarms[last];
            steps[row] += visits * steps[last];
            for column in 0..last {
                transitions[(row, column)] += visits * transitions[(last, column)];
            }
        }
    }
    steps[0] / alarms[0]
}

/// The distribution of a cumulative sum that has not been above its threshold: the probability of 0, and the density at
/// the nodes.
struct Sums {
    drift: f64,
    nodes: Vec<f64>,
    weights: Vec<f64>,
    zero: f64,
    density: Vec<f64>,
}

impl Sums {
    /// The distribution after many samples without a fault and without an alarm.
    fn settled(test: &Cusum) -> Self {
        let (nodes, weights) = test.quadrature();
        let transitions = transitions(&nodes, &weights, test.drift);
        let mut parts = DVector::<f64>::zeros(nodes.len() + 1);
        parts[0] = 1.0;
        for _ in 0..SETTLING {
            let mut next = transitions.tr_mul(&parts);
            next /= next.sum();
            let change = (&next - &parts).amax();
            parts = next;
            if change < 1e-14 {
                break;
            }
        }
        let density = parts.iter().skip(1).zip(&weights).map(|(part, weight)| part / weight);
        let density = density.collect();
        Self { drift: test.drift, nodes, weights, zero: parts[0], density }
    }

    /// Advances by one sample of a residual with mean `mean`, and drops the probability above the threshold.
    fn step(&mut self, mean: f64) {
        let shift = self.drift - mean;
        let masses: Vec<f64> =
            self.density.iter().zip(&self.weights).map(|(value, weight)| value * weight).collect();
        let points = || masses.iter().zip(&self.nodes);
        let density_at = |to: f64| {
            self.zero * normal_density(to + shift)
                + points().map(|(mass, node)| mass * normal_density(to - node + shift)).sum::<f64>()
        };
        let density = self.nodes.iter().map(|&to| density_at(to)).collect();
        self.zero = self.zero * normal_below(shift)
            + points().map(|(mass, node)| mass * normal_below(shift - node)).sum::<f64>();
        self.density = density;
    }

    /// The probability that there has been no alarm.
    fn total(&self) -> f64 {
        let inner = self.density.iter().zip(&self.weights).map(|(value, weight)| value * weight);
        self.zero + inner.sum::<f64>()
    }
}

/// Nodes and weights of the Gauss-Legendre quadrature on -1 to 1, by Newton's method.
fn gauss_legendre(count: usize) -> (Vec<f64>, Vec<f64>) {
    let legendre = |x: f64| {
        let (mut before, mut value) = (1.0, x);
        for k in 2..=count {
            let next =
                (as_number(2 * k - 1) * x * value - as_number(k - 1) * before) / as_number(k);
            (before, value) = (value, next);
        }
        (value, as_number(count) * (x * value - before) / (x * x - 1.0))
    };
    let root = |at: usize| {
        let mut x =
            (std::f64::consts::PI * (as_number(at) + 0.75) / (as_number(count) + 0.5)).cos();
        for _ in 0..100 {
            let (value, slope) = legendre(x);
            x -= value / slope;
            if (value / slope).abs() < 1e-15 {
                break;
            }
        }
        (x, 2.0 / ((1.0 - x * x) * legendre(x).1.powi(2)))
    };
    (0..count).map(root).unzip()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quadrature_integrates_polynomials_exactly() {
        let (nodes, weights) = gauss_legendre(6);
        let integral = |power: i32| -> f64 {
            nodes.iter().zip(&weights).map(|(node, weight)| weight * node.powi(power)).sum()
        };
        assert!((integral(0) - 2.0).abs() < 1e-14);
        assert!((integral(10) - 2.0 / 11.0).abs() < 1e-14);
        assert!(integral(9).abs() < 1e-14);
    }

    #[test]
    fn the_run_lengths_are_the_published_ones() {
        // D. C. Montgomery, Introduction to Statistical Quality Control, table of run lengths for k = 0.5.
        for (threshold, lengths) in
            [(4.0, [168.0, 26.6, 8.38, 3.34, 2.19]), (5.0, [465.0, 38.0, 10.4, 4.01, 2.57])]
        {
            let test = Cusum { drift: 0.5, threshold };
            for (shift, expected) in [0.0, 0.5, 1.0, 2.0, 3.0].into_iter().zip(lengths) {
                let length = test.between_false_alarms_with_bias(shift);
                assert!((length / expected - 1.0).abs() < 3e-3, "{shift}: {length} {expected}");
            }
        }
    }

    #[test]
    fn a_sum_with_a_negligible_threshold_is_a_test_of_single_samples() {
        let test = Cusum { drift: 1.0, threshold: 1e-9 };
        let single = 1.0 / normal_below(-1.0);
        assert!((test.run_length(0.0) / single - 1.0).abs() < 1e-8);
    }

    #[test]
    fn the_mean_delay_of_a_constant_shift_is_the_run_length_from_settled_sums() {
        // From zero sums the delay is longer than from settled ones.
        let test = Cusum { drift: 0.5, threshold: 4.0 };
        let delay = test.delay(|_| 1.0, 1000).mean().unwrap();
        let from_zero = test.run_length(1.0);
        assert!(delay < from_zero && delay > 0.8 * from_zero, "{delay} {from_zero}");
    }

    /// numpy 2 has the probability 0.348171645 from the left eigenvector of the largest eigenvalue; after 400 samples
    /// from zero sums it is 0.349198.
    #[test]
    fn sums_with_a_large_threshold_have_settled_when_a_fault_starts() {
        let test = Cusum { drift: 0.05, threshold: 30.0 };
        let missed = test.delay(|_| 0.1, 400).missed[400];
        assert!((missed - 0.348_171_645).abs() < 1e-8, "{missed}");
    }

    #[test]
    fn samples_taken_together_change_the_run_length_by_less_than_a_hundredth() {
        let test = Cusum { drift: 0.1, threshold: 39.0 };
        let group = 4.0_f64;
        let threshold = (39.0 + EXCESS) / group.sqrt() - EXCESS;
        let grouped = Cusum { drift: 0.1 * group.sqrt(), threshold };
        for mean in [0.0, 0.1, 0.3] {
            let (single, together) =
                (test.run_length(mean), group * grouped.run_length(mean * group.sqrt()));
            assert!((together / single - 1.0).abs() < 0.01, "{mean}: {single} {together}");
        }
        let slow = Cusum::with_false_alarms(0.005, 1e6).unwrap();
        assert!(slow.threshold > 400.0);
        let delay = slow.delay(|_| 0.01, 1_000_000).mean().unwrap();
        let from_zero = slow.run_length(0.01);
        assert!(delay < from_zero && delay > 0.6 * from_zero, "{delay} {from_zero}");
    }

    /// Siegmund (1985): with a drift of 0.5 the mean number of samples between false alarms of the two-sided test is
    /// about exp(h + 1.166).
    #[test]
    fn a_threshold_belongs_to_very_rare_false_alarms_too() {
        let [rare, rarest] =
            [1e12, 1e20].map(|samples| Cusum::with_false_alarms(0.5, samples).unwrap());
        assert!((rarest.threshold - 44.9).abs() < 0.5, "{rarest:?}");
        let grown = rarest.threshold - rare.threshold;
        assert!((grown - 1e8_f64.ln()).abs() < 0.2, "{rare:?} {rarest:?}");
        assert!((rarest.between_false_alarms() / 1e20 - 1.0).abs() < 1e-2);
    }

    #[test]
    fn both_eliminations_have_the_same_run_length() {
        let [short, long] = [LONGEST / 10.0, LONGEST * 10.0].map(|samples| {
            let test = Cusum::with_false_alarms(0.5, samples).unwrap();
            test.run_length(0.0) * (-test.threshold).exp()
        });
        assert!((short / long - 1.0).abs() < 1e-2, "{short} {long}");
    }

    #[test]
    fn a_large_drift_alone_makes_false_alarms_rarer() {
        let test = Cusum::with_false_alarms(5.0, 100.0).unwrap();
        assert!(test.threshold > 0.0 && test.threshold < 1e-15);
        let single = 0.5 / normal_below(-5.0);
        assert!((test.between_false_alarms() / single - 1.0).abs() < 1e-6);
    }

    #[test]
    fn numbers_without_a_threshold_are_refused() {
        assert!(Cusum::with_false_alarms(0.0, 100.0).is_err());
        assert!(Cusum::with_false_alarms(0.5, 1.0).is_err());
        assert!(Cusum::with_false_alarms(0.5, f64::NAN).is_err());
        assert!(Cusum::with_false_alarms(0.5, f64::INFINITY).is_err());
        assert!(Cusum::with_false_alarms(1e-12, 1e40).is_err());
    }

    #[test]
    fn a_large_threshold_needs_memory_for_the_samples_that_are_followed_alone() {
        let missed = Cusum { drift: 0.5, threshold: 1e4 }.delay(|_| 0.0, 3).missed;
        assert!(missed.len() == 4 && missed.capacity() < 1000, "{}", missed.capacity());
        assert!(missed.iter().all(|part| (part - 1.0).abs() < 1e-12), "{missed:?}");
    }
}
