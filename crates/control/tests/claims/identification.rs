//! Identified models beside the plants whose samples they are from.

use control::identification::{
    IdentifiedModel, MeasuredStates, Record, ResponseUnits, Subspace, Windows, equivalent_tolerance,
};
use control::{Domain, Error, StateSpace};
use nalgebra::{Complex, DMatrix, DVector};

/// Numbers of mean zero and variance 1 (a sum of 12 uniform ones) by a congruence of D. E. Knuth.
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        f64::from(u32::try_from(self.0 >> 32).expect("32 bits")) / f64::from(u32::MAX)
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }

    fn matrix(&mut self, rows: usize, columns: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |_, _| self.normal())
    }
}

/// Two measurements, two commands, an oscillation and a slow mode, sampled every second.
fn plant() -> StateSpace {
    StateSpace {
        a: DMatrix::from_row_slice(3, 3, &[0.8, 0.3, 0., -0.3, 0.8, 0.1, 0., 0., 0.95]),
        b: DMatrix::from_row_slice(3, 2, &[0., 1., 0.5, 0., 0.2, -0.1]),
        c: DMatrix::from_row_slice(2, 3, &[1., 0., 0., 0.3, 0., 2.]),
        d: DMatrix::zeros(2, 2),
        domain: Domain::Sampled { period: 1.0 },
    }
}

/// The record of a plant about the operating point u = 5, y = -3; `feedback`: u = random - feedback y.
fn record(plant: &StateSpace, noise: f64, feedback: &DMatrix<f64>, seed: u64) -> Record {
    let count = 800;
    let mut random = Noise(seed);
    let mut inputs = random.matrix(plant.b.ncols(), count);
    let disturbances = random.matrix(plant.c.nrows(), count) * noise;
    let mut outputs = DMatrix::zeros(plant.c.nrows(), count);
    let mut x = DVector::from_fn(plant.a.nrows(), |_, _| random.normal());
    for k in 0..count {
        let y = &plant.c * &x + disturbances.column(k);
        let u = inputs.column(k) - feedback * &y;
        x = &plant.a * x + &plant.b * &u;
        outputs.set_column(k, &(y + &plant.d * &u).add_scalar(-3.0));
        inputs.set_column(k, &u.add_scalar(5.0));
    }
    Record { inputs, outputs }
}

fn open(plant: &StateSpace) -> DMatrix<f64> {
    DMatrix::zeros(plant.b.ncols(), plant.c.nrows())
}

fn system(model: &IdentifiedModel) -> StateSpace {
    let [a, b, c, d] = [&model.a, &model.b, &model.c, &model.d].map(Clone::clone);
    StateSpace { a, b, c, d, domain: Domain::Sampled { period: 1.0 } }
}

/// C (z I - A)^-1 B + D on the unit circle.
fn response(plant: &StateSpace, angle: f64) -> DMatrix<Complex<f64>> {
    let complex = |m: &DMatrix<f64>| m.map(Complex::from);
    let n = plant.a.nrows();
    let shifted = DMatrix::identity(n, n) * Complex::from_polar(1.0, angle) - complex(&plant.a);
    complex(&plant.c) * shifted.lu().solve(&complex(&plant.b)).expect("no eigenvalue")
        + complex(&plant.d)
}

/// The largest error of the frequency response, relative to its norm.
fn error(model: &StateSpace, plant: &StateSpace) -> f64 {
    let at = |angle: f64| {
        let exact = response(plant, angle);
        (response(model, angle) - &exact).norm() / exact.norm()
    };
    (1..30).map(|k| at(0.1 * f64::from(k))).fold(0.0, f64::max)
}

#[test]
fn samples_without_noise_give_the_plant() {
    let exact = plant();
    let record = record(&exact, 0.0, &open(&exact), 1);
    let windows = Windows::new(&record, 6, 0..record.len()).unwrap();
    let subspace = Subspace::new(&windows, false).unwrap();
    let values = subspace.singular_values();
    assert!(values.len() == 3 || values[3] < 1e-9 * values[0], "{values:?}");
    let model = subspace.model(3).unwrap();
    assert!(error(&system(&model), &exact) < 1e-8);
    let simulated = model.predict(&record, 6..800, 794).unwrap();
    assert!((simulated - record.outputs.columns(6, 794)).amax() < 1e-8);
    assert_eq!(model.k.amax().to_bits(), 0.0_f64.to_bits(), "there are no innovations");
}

#[test]
fn a_command_in_the_measurements_is_identified() {
    let mut exact = plant();
    exact.d[(0, 1)] = 0.7;
    let record = record(&exact, 0.0, &open(&exact), 2);
    let windows = Windows::new(&record, 6, 0..record.len()).unwrap();
    let model = Subspace::new(&windows, true).unwrap().model(3).unwrap();
    assert!((&model.d - &exact.d).amax() < 1e-8);
    assert!(error(&system(&model), &exact) < 1e-8);
}

#[test]
fn an_unstable_plant_is_identified_from_its_closed_loop_with_noise() {
    let exact = StateSpace {
        a: DMatrix::from_row_slice(2, 2, &[1.1, 0.2, 0.0, 0.5]),
        b: DMatrix::from_row_slice(2, 1, &[0.0, 1.0]),
        c: DMatrix::from_row_slice(1, 2, &[1.0, 0.0]),
        d: DMatrix::zeros(1, 1),
        domain: Domain::Sampled { period: 1.0 },
    };
    // The closed loop z^2 - 1.6 z + 0.55 + 0.2 k is stable for k from 0.25 to 2.25.
    let feedback = DMatrix::from_element(1, 1, 0.6);
    assert!(record(&exact, 0.0, &feedback, 3).outputs.amax() < 1e6);
    let record = record(&exact, 0.05, &feedback, 3);
    let windows = Windows::new(&record, 10, 0..record.len()).unwrap();
    let model = system(&Subspace::new(&windows, false).unwrap().model(2).unwrap());
    let eigenvalues = control::eigen::eigenvalues(&model.a).unwrap();
    let largest = eigenvalues.iter().map(|value| value.norm()).fold(0.0, f64::max);
    assert!((largest - 1.1).abs() < 0.01, "{eigenvalues:?}");
    assert!(error(&model, &exact) < 0.1, "{}", error(&model, &exact));
}

#[test]
fn joined_parts_of_a_record_are_the_whole_record() {
    let exact = plant();
    let record = record(&exact, 0.1, &open(&exact), 4);
    let whole = Windows::new(&record, 5, 0..800).unwrap();
    let parts = [0..300, 300..310, 310..800].map(|range| Windows::new(&record, 5, range).unwrap());
    let joined = Windows::joined(&parts.each_ref()).unwrap();
    assert_eq!(joined.count(), 795);
    for (one, other) in joined.means().iter().zip(whole.means()) {
        assert!((one - other).abs() < 1e-12);
    }
    let [one, other] = [&joined, &whole]
        .map(|windows| system(&Subspace::new(windows, false).unwrap().model(3).unwrap()));
    assert!(error(&one, &other) < 1e-9);
}

/// Measurements that show 1e7 more, millions of times their deviations.
#[test]
fn the_means_of_the_signals_do_not_change_the_model() {
    let exact = plant();
    let record = record(&exact, 0.1, &open(&exact), 8);
    let shifted = Record { outputs: record.outputs.add_scalar(1e7), ..record.clone() };
    let [one, other] = [&record, &shifted].map(|record| {
        let windows = Windows::new(record, 8, 0..record.len()).unwrap();
        Subspace::new(&windows, false).unwrap().model(3).unwrap()
    });
    assert!(error(&system(&one), &system(&other)) < 1e-5);
    assert!((&one.c * &one.k - &other.c * &other.k).amax() < 1e-5);
    let expected = one.predict(&record, 8..800, 5).unwrap().add_scalar(1e7);
    assert!((other.predict(&shifted, 8..800, 5).unwrap() - expected).amax() < 1e-4);
}

#[test]
fn measurements_and_rates_become_states() {
    // Two masses and a spring: positions in m, seen in other coordinates.
    let a = DMatrix::from_row_slice(
        4,
        4,
        &[0., 0., 1., 0., 0., 0., 0., 1., -2., 2., -0.1, 0., 3., -3., 0., -0.2],
    );
    let c = DMatrix::identity(2, 4);
    let mut other = Noise(7);
    let change = DMatrix::identity(4, 4) + other.matrix(4, 4) * 0.2;
    let inverse = change.clone().try_inverse().unwrap();
    let (seen_a, seen_c) = (&change * &a * &inverse, &c * &inverse);
    let states = MeasuredStates::new(&seen_a, &seen_c).unwrap().unwrap();
    let mut order = states.rates.clone();
    order.sort_unstable();
    assert_eq!(order, [0, 1]);
    let back = &states.change * &seen_a * &states.inverse;
    for (row, rate) in states.rates.iter().enumerate() {
        assert!((back[(*rate, 2 + row)] - 1.0).abs() < 1e-12, "{back}");
        assert!((back.row(2 + row).columns(0, 2) - a.row(2 + rate).columns(0, 2)).amax() < 1e-11);
    }
    assert!((&seen_c * &states.inverse - c).amax() < 1e-12);
    assert_eq!(MeasuredStates::new(&a, &DMatrix::identity(1, 4)).unwrap(), None);
    let twice = DMatrix::from_rows(&[seen_c.row(0), seen_c.row(0)]);
    assert_eq!(MeasuredStates::new(&seen_a, &twice).unwrap(), None);
}

/// The errors of the estimates from one hundred records are below twice the deviation that each record states, and about as
/// large as this deviation on average.
#[test]
fn the_tolerance_covers_the_plant() {
    let exact = plant();
    let units = ResponseUnits {
        frequencies: (1..30).map(|k| 0.1 * f64::from(k)).collect(),
        inputs: vec![1.0; 2],
        outputs: vec![3.0; 2],
    };
    let (mut covered, mut errors, mut stated) = (0, 0.0, 0.0);
    for seed in 0..100 {
        let record = record(&exact, 0.3, &open(&exact), 100 + seed);
        let blocks: Vec<_> =
            (0..10).map(|k| Windows::new(&record, 8, 80 * k..80 * (k + 1)).unwrap()).collect();
        let estimate = |parts: &[&Windows]| {
            let windows = Windows::joined(parts).unwrap();
            system(&Subspace::new(&windows, false).unwrap().model(3).unwrap())
        };
        let model = estimate(&blocks.iter().collect::<Vec<_>>());
        let parts: Vec<_> = (0..10)
            .map(|out| {
                let others = blocks.iter().enumerate().filter(|(at, _)| *at != out);
                estimate(&others.map(|(_, block)| block).collect::<Vec<_>>())
            })
            .collect();
        let tolerance = equivalent_tolerance(&model, &model, &parts, &units).unwrap();
        // Two parts at the plant have the variance of the distance squared.
        let parts = [exact.clone(), exact.clone()];
        let distance = equivalent_tolerance(&model, &model, &parts, &units).unwrap() / 2.0;
        covered += usize::from(distance <= tolerance);
        errors += distance.powi(2);
        stated += (tolerance / 2.0).powi(2);
    }
    assert!(covered >= 90, "{covered} of 100");
    let ratio = (stated / errors).sqrt();
    assert!((0.8..1.5).contains(&ratio), "stated {ratio} times the errors");
}

#[test]
fn records_without_a_plant_are_refused_with_the_reason() {
    let exact = plant();
    let mut record = record(&exact, 0.1, &open(&exact), 6);
    let windows = Windows::new(&record, 6, 0..30).unwrap();
    let error = Subspace::new(&windows, false).unwrap_err();
    assert_eq!(error, Error::TooFewSamples { expected: 32, actual: 30 });
    let windows = Windows::new(&record, 6, 0..800).unwrap();
    assert_eq!(windows.excitation(1e-6).unwrap(), 14);
    let subspace = Subspace::new(&windows, false).unwrap();
    assert!(matches!(subspace.model(0), Err(Error::OutOfRange { name: "order", .. })));
    let other = Record { inputs: record.inputs.rows(0, 1).into(), ..record.clone() };
    let error = subspace.model(3).unwrap().predict(&other, 6..800, 1).unwrap_err();
    assert_eq!(error, Error::Shape { matrix: "u", expected: (2, 800), actual: (1, 800) });
    record.outputs[(1, 7)] = f64::NAN;
    let error = Windows::new(&record, 6, 0..800).unwrap_err();
    assert!(matches!(error, Error::NotFinite { matrix: "y", row: 2, col: 8, .. }));
}

#[test]
fn units_that_do_not_fit_the_plant_are_refused() {
    let (exact, one) = (plant(), vec![1.0]);
    let units = ResponseUnits { frequencies: one.clone(), inputs: one, outputs: vec![1.0; 2] };
    let refused = equivalent_tolerance(&exact, &exact, &[], &units);
    assert!(matches!(refused, Err(Error::Shape { expected: (2, 1), .. })), "{refused:?}");
}

#[test]
fn a_sine_excites_two_directions() {
    let inputs = DMatrix::from_iterator(1, 400, (0..400).map(|k| (0.3 * f64::from(k)).sin()));
    let record = Record { outputs: inputs.clone(), inputs };
    let windows = Windows::new(&record, 6, 0..400).unwrap();
    assert_eq!(windows.excitation(1e-6).unwrap(), 2);
}
