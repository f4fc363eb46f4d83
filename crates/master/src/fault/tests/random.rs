//! Noise and random dropouts: bounds are five standard deviations of the estimate.

use super::{
    Fault, FaultChain, LossPattern, NoiseDistribution, RandomSeries, Sample, single, window,
};

const COUNT: u32 = 40_000;

fn noise(spread: NoiseDistribution, draw: RandomSeries) -> FaultChain {
    single(Fault::Noise { spread, draw }, 0.0, None)
}

fn normal(seed: u64, name: &str, place: u64) -> FaultChain {
    noise(NoiseDistribution::Normal(2.0), RandomSeries::new(seed, name, place, None))
}

/// Returns the noise at `COUNT` communication points, 1 ms apart.
fn drawn(line: &FaultChain) -> Vec<f64> {
    (0..COUNT).map(|step| line.apply(1e-3 * f64::from(step), 0.0)).collect()
}

fn part_of(number: usize) -> f64 {
    f64::from(u32::try_from(number).unwrap()) / f64::from(COUNT)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / f64::from(COUNT)
}

fn mean_product(one: &[f64], other: &[f64]) -> f64 {
    one.iter().zip(other).map(|(one, other)| one * other).sum::<f64>() / f64::from(COUNT)
}

#[test]
fn normal_noise_has_mean_deviation_and_shape_as_stated_and_no_memory() {
    let n = f64::from(COUNT);
    let values = drawn(&normal(1, "ctrl.y", 0));
    assert!(mean(&values).abs() < 5.0 * 2.0 / n.sqrt(), "mean {}", mean(&values));
    // The variance of the estimated variance is 2 sigma^4 / n.
    let variance = mean_product(&values, &values);
    assert!((variance - 4.0).abs() < 5.0 * 4.0 * (2.0 / n).sqrt(), "variance {variance}");
    // The fourth moment is 3 sigma^4, its estimate has the variance 96 sigma^8 / n.
    let squares: Vec<_> = values.iter().map(|value| value * value).collect();
    let fourth = mean_product(&squares, &squares);
    assert!((fourth - 48.0).abs() < 5.0 * 16.0 * (96.0 / n).sqrt(), "fourth moment {fourth}");
    for lag in [1, 2, 7, 100] {
        let along = mean_product(&values[lag..], &values) / 4.0;
        assert!(along.abs() < 5.0 / n.sqrt(), "autocorrelation {along} over {lag}");
    }
}

#[test]
fn uniform_noise_fills_its_bounds_evenly() {
    let n = f64::from(COUNT);
    let values =
        drawn(&noise(NoiseDistribution::Uniform(3.0), RandomSeries::new(9, "ctrl.y", 0, None)));
    assert!(values.iter().all(|value| value.abs() <= 3.0));
    assert!(mean(&values).abs() < 5.0 * 3.0_f64.sqrt() / n.sqrt());
    // a^2 / 3; the fourth moment is a^4 / 5.
    let variance = mean_product(&values, &values);
    assert!((variance - 3.0).abs() < 5.0 * ((81.0 / 5.0 - 9.0) / n).sqrt(), "{variance}");
    for tenth in 0..10 {
        let lower = -3.0 + 0.6 * f64::from(tenth);
        let within = |value: &&f64| (lower..lower + 0.6).contains(*value);
        let part = part_of(values.iter().filter(within).count());
        assert!((part - 0.1).abs() < 5.0 * (0.09 / n).sqrt(), "{part} from {lower}");
    }
}

#[test]
fn equal_seeds_give_equal_series_and_other_seeds_names_or_places_independent_ones() {
    let first = drawn(&normal(1, "ctrl.y", 0));
    assert_eq!(first, drawn(&normal(1, "ctrl.y", 0)));
    for other in [normal(2, "ctrl.y", 0), normal(1, "ctrl.x", 0), normal(1, "ctrl.y", 1)] {
        let other = drawn(&other);
        let equal = first.iter().zip(&other).filter(|(one, other)| one == other).count();
        assert_eq!(equal, 0);
        let across = mean_product(&first, &other) / 4.0;
        assert!(across.abs() < 5.0 / f64::from(COUNT).sqrt(), "correlation {across}");
    }
}

#[test]
fn noise_with_a_sample_time_is_constant_between_samples_with_any_rounding() {
    let line = noise(NoiseDistribution::Normal(1.0), RandomSeries::new(3, "ctrl.y", 0, Some(0.01)));
    let mut before = None;
    for step in 0..5000_u32 {
        let value = line.apply(1e-3 * f64::from(step), 0.0);
        let is_sample = step % 10 == 0;
        assert_eq!(before != Some(value), is_sample, "step {step}");
        before = Some(value);
    }
}

#[test]
fn noise_leaves_the_slope_and_is_added_to_the_value() {
    let line = normal(1, "ctrl.y", 0);
    let (alone, added) = (line.apply(0.5, 0.0), Sample { value: 8.0, slope: 3.0 });
    assert_eq!(line.apply_sample(0.5, added), Sample { value: 8.0 + alone, slope: 3.0 });
    assert_ne!(alone, 0.0);
}

#[test]
fn a_random_dropout_loses_its_part_of_the_samples() {
    let (n, probability) = (f64::from(COUNT), 0.2);
    let lost = LossPattern::Random { probability, draw: RandomSeries::new(4, "ctrl.y", 0, None) };
    let fault = Fault::Dropout { lost, instead: Some(0.0) };
    let line = FaultChain::new(vec![(window(0.0, None), fault)], 1e-3).unwrap();
    let arrived: Vec<_> = (0..COUNT).map(|step| line.apply(1e-3 * f64::from(step), 1.0)).collect();
    let part = 1.0 - mean(&arrived);
    let deviation = (probability * (1.0 - probability) / n).sqrt();
    assert!((part - probability).abs() < 5.0 * deviation, "{part}");
    // Independence: two consecutive samples are lost with the square of the probability.
    let pairs = arrived.windows(2).filter(|pair| pair[0] + pair[1] == 0.0).count();
    let pairs = part_of(pairs);
    assert!((pairs - probability * probability).abs() < 10.0 * deviation, "{pairs}");
}

#[test]
fn a_dropout_is_never_or_always_at_the_ends_of_the_probabilities() {
    for (probability, expected) in [(0.0, 1.0), (1.0, 0.0)] {
        let lost =
            LossPattern::Random { probability, draw: RandomSeries::new(4, "ctrl.y", 0, Some(0.5)) };
        let line = single(Fault::Dropout { lost, instead: Some(0.0) }, 0.0, None);
        for step in 0..1000 {
            assert_eq!(line.apply(0.1 * f64::from(step), 1.0), expected);
        }
    }
}
