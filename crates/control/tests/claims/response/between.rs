//! Sampled loops between their samples, against a simulation in steps of a fraction of the sample time.

use crate::paper::CONTROLLER_POLES;
use control::aso::{Estimator, FaultyPlant, Gains};
use control::controller::controller;
use control::faults::{ExtendedPlant, Fault, FaultEntry, FaultKind};
use control::hold::zero_order_hold;
use control::placement::real_poles;
use control::response::{
    SampledLoop, fault_rate_system, fault_system, gains_between_samples, peak_gain,
};
use control::sampled::{design, sampled_poles};
use control::{Domain, Error, StateSpace};
use nalgebra::{DMatrix, DVector};

const WIDTH: f64 = 1e-3;
/// All of [x; e; eps].
const ALL: [usize; 9] = [0, 1, 2, 3, 4, 5, 6, 7, 8];

/// The pendulum of the paper, and its controller sampled at `period`.
fn sampled(
    period: f64,
    estimator: Estimator,
) -> Result<(ExtendedPlant, FaultyPlant, Gains), Error> {
    let extended = ExtendedPlant::without_filter(crate::paper::plant());
    let feedback = sampled_poles(&real_poles(&CONTROLLER_POLES), period)?;
    let fast = real_poles(&[-1200.0, -1500.0, -1800.0, -2100.0, -3000.0]);
    let observer = sampled_poles(&fast, period)?;
    let designed = design(&extended, period, estimator, &feedback, &observer, None)?;
    Ok((extended, designed.plant, designed.gains))
}

/// The sums of the moduli of the states' impulse responses, from the impulses of each part of an
/// interval; of each state the largest over the parts at which it is read. `fault` gives the fault at
/// a part, counted from the impulse.
fn simulated(
    extended: &ExtendedPlant,
    (controller, period): (&StateSpace, f64),
    (parts, samples): (u32, u32),
    fault: impl Fn(u32) -> f64,
) -> Result<DVector<f64>, Error> {
    let FaultyPlant { a, b, c, f_a, .. } = &extended.plant;
    let n = a.nrows();
    let (phi, gamma) = zero_order_hold(a, b, period / f64::from(parts))?;
    let (_, entry) = zero_order_hold(a, f_a, period / f64::from(parts))?;
    let mut sums = DMatrix::<f64>::zeros(n, parts as usize);
    for impulse in 0..parts {
        let mut x = DVector::zeros(n);
        let mut z = DVector::zeros(controller.a.nrows());
        for k in 0..samples {
            let y = c * &x;
            let u = &controller.c * &z + &controller.d * &y;
            z = &controller.a * z + &controller.b * y;
            for part in 0..parts {
                let mut sum = sums.column_mut(part as usize);
                sum += x.abs();
                let at = k * parts + part;
                let f = if at < impulse { 0.0 } else { fault(at - impulse) };
                x = &phi * x + &gamma * &u + &entry * DVector::from_element(1, f);
            }
        }
    }
    Ok(DVector::from_iterator(n, sums.row_iter().map(|row| row.max())))
}

#[test]
fn gains_between_samples_are_those_of_a_simulation_in_small_steps() {
    for (estimator, milliseconds) in [(Estimator::Prediction, 2), (Estimator::Current, 10)] {
        let period = 1e-3 * f64::from(milliseconds);
        let (extended, plant, gains) = sampled(period, estimator).unwrap();
        let domain = Domain::Sampled { period };
        let sampled_controller = controller(&plant, &gains, domain).unwrap();
        let closed = SampledLoop { extended: &extended, plant: &plant, gains: &gains, period };
        let [of_faults, of_rates, _] = gains_between_samples(&closed, 8, &ALL, WIDTH).unwrap();
        let samples = 4000 / milliseconds;
        let pulse = |at: u32| f64::from(u8::from(at == 0));
        let same =
            simulated(&extended, (&sampled_controller, period), (8, samples), pulse).unwrap();
        let finer =
            simulated(&extended, (&sampled_controller, period), (32, samples), pulse).unwrap();
        let part = period / 8.0;
        let ramp = |at: u32| if at == 0 { 0.0 } else { part };
        let rates =
            simulated(&extended, (&sampled_controller, period), (8, samples), ramp).unwrap();
        for state in 0..4 {
            let gain = of_faults[(state, 0)];
            assert!(
                (gain / same[state] - 1.0).abs() < 2.0 * WIDTH,
                "{state}: {gain} {}",
                same[state]
            );
            assert!((finer[state] / gain - 1.0).abs() < 0.05, "{state}: {gain} {}", finer[state]);
            let of_rate = of_rates[(state, 0)];
            assert!(
                (of_rate / rates[state] - 1.0).abs() < 2.0 * WIDTH,
                "{state}: {of_rate} {}",
                rates[state]
            );
        }
    }
}

#[test]
fn with_one_part_the_gains_are_those_at_the_samples() {
    for estimator in [Estimator::Prediction, Estimator::Current] {
        let period = 0.005;
        let (extended, plant, gains) = sampled(period, estimator).unwrap();
        let domain = Domain::Sampled { period };
        let closed = SampledLoop { extended: &extended, plant: &plant, gains: &gains, period };
        let [of_faults, of_rates, _] = gains_between_samples(&closed, 1, &ALL, WIDTH).unwrap();
        let expected = peak_gain(&fault_system(&plant, &gains, domain).unwrap(), WIDTH).unwrap();
        let expected_of_rates =
            peak_gain(&fault_rate_system(&plant, &gains, domain).unwrap(), WIDTH).unwrap();
        for row in 0..9 {
            let [one_part, other] = [of_faults[(row, 0)], expected.upper[(row, 0)]];
            assert!((one_part / other - 1.0).abs() < 3.0 * WIDTH, "{row}: {one_part} {other}");
            let [one_part, other] =
                [of_rates[(row, 0)], period * expected_of_rates.upper[(row, 0)]];
            assert!((one_part / other - 1.0).abs() < 3.0 * WIDTH, "{row}: {one_part} {other}");
        }
    }
}

/// x1' = -x1 + u, x2' = -x2 + f, both measured: u does not reach x2, which follows f with the gain 1 at all times, and
/// an f that is estimated exactly causes no error.
#[test]
fn a_fault_that_no_command_reaches_and_that_is_known_causes_no_error() {
    let (period, domain) = (0.1, Domain::Sampled { period: 0.1 });
    let at = |row: usize| DMatrix::from_fn(2, 1, |i, _| f64::from(u8::from(i == row)));
    let identity = DMatrix::identity(2, 2);
    let plant = FaultyPlant::with_constant_faults(-&identity, at(0), identity.clone(), at(1));
    let extended = ExtendedPlant::without_filter(plant);
    let plant = control::sampled::sample(&extended, period).unwrap();
    for estimator in [Estimator::Prediction, Estimator::Current] {
        let gains = Gains {
            estimator,
            k_x: DMatrix::from_row_slice(1, 2, &[-0.2, 0.0]),
            k_f: DMatrix::zeros(1, 1),
            l_x: identity.clone() * 0.5,
            l_f: DMatrix::from_row_slice(1, 2, &[0.0, 1.0]),
            p_f: None,
            integral: None,
        };
        for parts in [1, 4] {
            let closed = SampledLoop { extended: &extended, plant: &plant, gains: &gains, period };
            let rows = [0, 1, 2, 3, 4];
            let [.., left] = gains_between_samples(&closed, parts, &rows, WIDTH).unwrap();
            assert!((left[1] - 1.0).abs() < 2.0 * WIDTH, "{parts}: {left}");
            assert!([0, 2, 3, 4].iter().all(|row| left[*row].abs() < 1e-11), "{parts}: {left}");
        }
        let rates = fault_rate_system(&plant, &gains, domain).unwrap();
        assert!((peak_gain(&rates, WIDTH).unwrap().upper[(1, 1)] - 1.0).abs() < 2.0 * WIDTH);
    }
}

/// x' = -x + f, and y = x - f / 2 at the samples, which the filter y_f follows with the gain 1: the worst f has one sign
/// between the samples and the other one at them.
#[test]
fn a_fault_may_have_another_value_at_a_sample_than_beside_it() {
    let period = 0.5;
    let one = |value| DMatrix::from_element(1, 1, value);
    let column = |value| DVector::from_element(1, value);
    let entry = FaultEntry::Both { states: column(1.0), measurements: column(-0.5) };
    let fault = Fault { entry, kind: FaultKind::Constant };
    let extended = ExtendedPlant::new(&one(-1.0), &one(1.0), &one(1.0), &[fault], &[3.0]).unwrap();
    let feedback = sampled_poles(&real_poles(&[-1.0]), period).unwrap();
    let observer = sampled_poles(&real_poles(&[-1.0, -1.5, -2.0]), period).unwrap();
    let estimator = Estimator::Prediction;
    let designed = design(&extended, period, estimator, &feedback, &observer, None).unwrap();
    let (plant, mut gains) = (designed.plant, designed.gains);
    gains.k_x.fill(0.0);
    gains.k_f.fill(0.0);
    let closed = SampledLoop { extended: &extended, plant: &plant, gains: &gains, period };
    for parts in [1, 4] {
        let [of_faults, ..] = gains_between_samples(&closed, parts, &[1], WIDTH).unwrap();
        let gain = of_faults[(0, 0)];
        assert!((gain / 1.5 - 1.0).abs() < 2.0 * WIDTH, "{parts}: {gain}");
    }
}

#[test]
fn a_slow_sampled_closedis_farther_from_rest_between_its_samples_than_at_them() {
    let period = 0.01;
    let (extended, plant, gains) = sampled(period, Estimator::Prediction).unwrap();
    let closed = SampledLoop { extended: &extended, plant: &plant, gains: &gains, period };
    let [of_faults, ..] = gains_between_samples(&closed, 16, &ALL, WIDTH).unwrap();
    let domain = Domain::Sampled { period };
    let at_samples = peak_gain(&fault_system(&plant, &gains, domain).unwrap(), WIDTH).unwrap();
    for state in 2..4 {
        assert!(of_faults[(state, 0)] > 1.02 * at_samples.lower[(state, 0)]);
    }
}

#[test]
fn a_slow_sampled_closedhas_the_gains_that_adding_all_samples_gives() {
    // Sampled so fast that adding the samples would take longer than intervals of many samples.
    let pole = (-1e-5_f64).exp();
    let system = StateSpace {
        a: DMatrix::from_row_slice(2, 2, &[pole, 1e-4, 0.0, 0.5]),
        b: DMatrix::from_row_slice(2, 1, &[1.0, -2.0]),
        c: DMatrix::from_row_slice(1, 2, &[1.0, 3.0]),
        d: DMatrix::from_element(1, 1, 0.25),
        domain: Domain::Sampled { period: 1.0 },
    };
    let actual = peak_gain(&system, WIDTH).unwrap();
    let (mut sum, mut x) = (0.25, system.b.clone());
    for _ in 0..4_000_000 {
        sum += (&system.c * &x)[0].abs();
        x = &system.a * x;
    }
    assert!(actual.lower[0] <= sum * (1.0 + 1e-9), "{actual:?} {sum}");
    assert!(
        sum <= actual.upper[0] && actual.upper[0] < sum * (1.0 + 2.0 * WIDTH),
        "{actual:?} {sum}"
    );
}
