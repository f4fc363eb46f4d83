use super::*;
use crate::hold::zero_order_hold;

fn matrix(rows: usize, columns: usize, entries: &[f64]) -> DMatrix<f64> {
    DMatrix::from_row_slice(rows, columns, entries)
}

/// Two states, two commands, two measurements, D other than zero.
fn plant() -> StateSpace {
    StateSpace {
        a: matrix(2, 2, &[-0.3, 1.0, -2.0, -0.5]),
        b: matrix(2, 2, &[0.4, -1.0, 1.5, 0.7]),
        c: matrix(2, 2, &[1.0, 0.2, -0.6, 1.1]),
        d: matrix(2, 2, &[0.0, 0.3, 0.2, 0.0]),
        domain: Domain::Continuous,
    }
}

/// A system with one state, one input and one output, in continuous time.
fn scalar(a: f64, b: f64, c: f64, d: f64) -> StateSpace {
    let [a, b, c, d] = [a, b, c, d].map(|entry| DMatrix::from_element(1, 1, entry));
    StateSpace { a, b, c, d, domain: Domain::Continuous }
}

fn response(system: &StateSpace, frequency: f64) -> DMatrix<Complex<f64>> {
    frequency_response(system, &[frequency]).unwrap()[0].gain.clone()
}

/// The approximant with degrees q - 1 and q of its numerator and denominator, from the closed form; `order`: q.
fn closed_form(order: u32, s: Complex<f64>) -> Complex<f64> {
    let factorial = |n: u32| (1..=n).map(f64::from).product::<f64>();
    let term = |top: u32, degree: u32, k: u32, s: Complex<f64>| {
        let coefficient = factorial(top - k) * factorial(degree)
            / (factorial(top) * factorial(k) * factorial(degree - k));
        s.powu(k) * coefficient
    };
    let sum = |degree: u32, s: Complex<f64>| {
        (0..=degree).map(|k| term(2 * order - 1, degree, k, s)).sum::<Complex<f64>>()
    };
    sum(order - 1, -s) / sum(order, s)
}

#[test]
fn the_legendre_form_is_the_pade_approximant_of_a_delay() {
    for order in 1..=10_u32 {
        let (a, b) = pade(order as usize);
        let size = a.nrows();
        let c = DMatrix::from_fn(1, size, |_, j| f64::from(u8::from(j == 0)));
        let system = StateSpace {
            a,
            b: DMatrix::from_column_slice(size, 1, b.as_slice()),
            c,
            d: DMatrix::zeros(1, 1),
            domain: Domain::Continuous,
        };
        for frequency in [0.0, 0.3, 2.0, 7.0, 40.0] {
            let error = response(&system, frequency)[(0, 0)]
                - closed_form(order, Complex::new(0.0, frequency));
            assert!(error.norm() < 1e-12, "{order} {frequency}: {error}");
        }
    }
}

/// Each path has the approximants of its command's delay and of its measurement's delay as factors.
#[test]
fn an_approximated_plant_is_the_plant_between_the_approximants() {
    let plant = plant();
    for (inputs, outputs) in
        [([0.7, 0.0], [0.0, 0.2]), ([0.0, 0.0], [0.4, 0.9]), ([0.3, 0.1], [0.0, 0.0])]
    {
        let delays = Delays { inputs: inputs.to_vec(), outputs: outputs.to_vec() };
        let extended = delays.approximated(&plant, 3).unwrap();
        assert_eq!(extended.a.nrows(), 2 + delays.states(3));
        for frequency in [0.0, 0.8, 5.0] {
            let (whole, alone) = (response(&extended, frequency), response(&plant, frequency));
            for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let late = |delay: f64| closed_form(3, Complex::new(0.0, frequency * delay));
                let expected = late(outputs[row]) * alone[(row, column)] * late(inputs[column]);
                let error = whole[(row, column)] - expected;
                assert!(error.norm() < 1e-12, "{inputs:?} {outputs:?} {frequency}: {error}");
            }
        }
        let matrices = |StateSpace { a, b, c, d, .. }: StateSpace| [a, b, c, d];
        assert_eq!(delays.of_plant(2, 3, &matrices(extended)), matrices(plant.clone()));
    }
}

/// Compares with a simulation in the time domain: the state at the time of each sample minus the delay.
#[test]
fn samples_of_a_delayed_plant_are_those_of_a_simulation() {
    let (plant, period) = (StateSpace { d: DMatrix::zeros(2, 2), ..plant() }, 0.25);
    for (inputs, outputs) in
        [([0.7, 0.0], [0.0, 0.2]), ([0.25, 0.5], [0.0, 0.0]), ([0.1, 0.1], [0.4, 0.9])]
    {
        let delays = Delays { inputs: inputs.to_vec(), outputs: outputs.to_vec() };
        let domain = Domain::Sampled { period };
        let z = Complex::from_polar(1.0, 0.9 * period);
        let sampled = delays.responses(&plant, domain, &[0.9]).unwrap().remove(0);
        // The response of one path to 1 in the first sample: h_n = c x(n T - d), x the state of a pulse from 0 to T.
        for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let b = plant.b.columns(column, 1).into_owned();
            let state = |time: f64| {
                let held = time.clamp(0.0, period);
                if held <= 0.0 {
                    return DMatrix::zeros(2, 1);
                }
                let pulse = zero_order_hold(&plant.a, &b, held).unwrap().1;
                let free = time - held;
                if free <= 0.0 {
                    return pulse;
                }
                zero_order_hold(&plant.a, &b, free).unwrap().0 * pulse
            };
            let delay = inputs[column] + outputs[row];
            let mut sum = Complex::from(0.0);
            let mut power = Complex::from(1.0);
            for n in 0..600 {
                let time = f64::from(n) * period - delay;
                sum += power * (plant.c.rows(row, 1) * state(time))[(0, 0)];
                power /= z;
            }
            let error = sum - sampled[(row, column)];
            assert!(error.norm() < 1e-9, "{inputs:?} {outputs:?} {row} {column}: {error}");
        }
    }
}

/// x' = u(t - d), u = -k x, is stable for k d < pi / 2 (Hayes 1950).
#[test]
fn the_delayed_integrator_is_stable_up_to_a_quarter_turn() {
    let plant = scalar(0.0, 1.0, 1.0, 0.0);
    let delays = Delays { inputs: vec![0.6], outputs: vec![0.4] };
    let frequencies: Vec<_> =
        (0..4000_u16).map(|k| 10.0_f64.powf(f64::from(k) / 1000.0 - 2.0)).collect();
    let exact = |gain: f64, order: usize| {
        // A static gain; its one state, the least that a system has, is not used.
        let controller = scalar(-1.0, 0.0, 0.0, -gain);
        let closed = Loop::new(delays.approximated(&plant, order).unwrap(), controller).unwrap();
        delays.exact(&plant, &closed, &frequencies).unwrap()
    };
    // Peaks of S from 1 / |1 + k e^(-j w) / (j w)| on a finer grid.
    for gain in [0.5, 1.0, 1.4] {
        let peak = (1..400_000_u32)
            .map(|k| {
                let w = f64::from(k) * 2e-5;
                let back = Complex::from_polar(gain, -w) / Complex::new(0.0, w);
                1.0 / (Complex::from(1.0) + back).norm()
            })
            .fold(0.0, f64::max);
        let result = exact(gain, 4);
        assert!(result.radius < 0.2, "{gain}: {result:?}");
        assert!(
            result.peaks.iter().all(|value| (value / peak - 1.0).abs() < 1e-3),
            "{gain} {peak}: {result:?}"
        );
    }
    // Approximated by two lags the loop is stable up to k = 1 / 0.6 + 1 / 0.4.
    assert!(exact(1.5, 4).radius < 1.0);
    assert!(exact(1.6, 1).radius > 1.0);
}

/// Fast states of the delay act on nothing but the measurement: balancing A alone would not end, with errors of 1e3 in
/// the responses.
#[test]
fn a_long_sample_time_spoils_no_response() {
    let plant = scalar(-0.01, 0.02, 1.0, 0.0);
    let delays = Delays { inputs: vec![30.0], outputs: vec![5.0] };
    for order in [3, 10] {
        let approximated = delays.approximated(&plant, order).unwrap();
        let held = crate::robustness::held_plant(&approximated, 40.0).unwrap();
        let n = held.a.nrows();
        for frequency in [1e-5, 0.02, 0.07] {
            let z = Complex::from_polar(1.0, frequency * 40.0);
            let pencil = DMatrix::identity(n, n) * z - to_complex(&held.a);
            let states = pencil.lu().solve(&to_complex(&held.b)).unwrap();
            let expected = (to_complex(&held.c) * states)[(0, 0)];
            let error = response(&held, frequency)[(0, 0)] - expected;
            assert!(error.norm() < 1e-12, "{order} {frequency}: {error}");
        }
    }
}

#[test]
fn delays_that_do_not_fit_the_plant_are_refused() {
    let plant = plant();
    let refused = |inputs: &[f64], outputs: &[f64], order: usize| {
        let delays = Delays { inputs: inputs.to_vec(), outputs: outputs.to_vec() };
        delays.approximated(&plant, order).unwrap_err()
    };
    assert!(matches!(refused(&[0.1; 3], &[0.1; 2], 2), Error::Shape { .. }));
    assert!(matches!(refused(&[0.1; 2], &[0.1], 2), Error::Shape { .. }));
    assert!(matches!(refused(&[0.1; 2], &[0.0; 2], 0), Error::OutOfRange { .. }));
    assert!(matches!(refused(&[-0.1; 2], &[0.0; 2], 2), Error::OutOfRange { .. }));
}
