//! Plants with y = C x + D u: transfer functions, derivatives and runs in time.

use crate::matrix;
use control::controller::with_feedthrough;
use control::hold::zero_order_hold;
use control::response::h_infinity;
use control::robustness::{
    EntryFamily, Loop, Point, SensitivityPeak, Tolerances, held_plant, longest_hold,
    longest_period, peak_derivatives, sampled_delay_margin, tolerance_test,
};
use control::stability::instability;
use control::{Domain, Error, StateSpace};
use nalgebra::{Complex, DMatrix};

type ComplexMatrix = DMatrix<Complex<f64>>;

const PERIOD: f64 = 0.05;
const SAMPLED: Domain = Domain::Sampled { period: PERIOD };

/// Two oscillators with two commands; the measurements contain them.
fn plant() -> StateSpace {
    StateSpace {
        a: matrix(
            4,
            4,
            &[0.0, 1.0, 0.0, 0.0, -4.0, -0.3, 1.5, 0.1, 0.0, 0.0, 0.0, 1.0, 0.9, 0.2, -9.0, -0.6],
        ),
        b: matrix(4, 2, &[0.0, 0.0, 1.3, 0.2, 0.0, 0.0, -0.4, 2.0]),
        c: matrix(2, 4, &[1.2, 0.0, 0.3, 0.0, -4.0, -0.3, 1.5, 0.1]),
        d: matrix(2, 2, &[0.0, 0.3, 1.3, 0.2]),
        domain: Domain::Continuous,
    }
}

/// A controller whose D is zero, weak enough for a stable loop.
fn controller(domain: Domain) -> StateSpace {
    let (a, scale) = match domain {
        Domain::Continuous => (matrix(2, 2, &[-6.0, 1.0, -2.0, -9.0]), 1.5),
        Domain::Sampled { .. } => (matrix(2, 2, &[0.7, 0.05, -0.1, 0.6]), 0.06),
    };
    StateSpace {
        a,
        b: matrix(2, 2, &[2.0, -0.5, 0.4, 3.0]) * scale,
        c: matrix(2, 2, &[-1.5, 0.4, 0.2, -1.1]),
        d: DMatrix::zeros(2, 2),
        domain,
    }
}

fn complex(m: &DMatrix<f64>) -> ComplexMatrix {
    m.map(Complex::from)
}

/// C (s I - A)^-1 B + D.
fn response(system: &StateSpace, s: Complex<f64>) -> ComplexMatrix {
    let n = system.a.nrows();
    let pencil = ComplexMatrix::identity(n, n) * s - complex(&system.a);
    let solved = pencil.lu().solve(&complex(&system.b)).expect("no pole");
    complex(&system.c) * solved + complex(&system.d)
}

/// The response of [`plant`] under a hold, from its own matrices: a sample contains the command before.
fn held_response(z: Complex<f64>) -> ComplexMatrix {
    let plant = plant();
    let (a, b) = zero_order_hold(&plant.a, &plant.b, PERIOD).expect("a plant");
    let strict = StateSpace { a, b, d: DMatrix::zeros(2, 2), ..plant.clone() };
    response(&strict, z) + complex(&plant.d) / z
}

fn points(domain: Domain) -> impl Iterator<Item = Complex<f64>> {
    [0.3, 2.0, 3.1, 20.0].into_iter().map(move |w| match domain {
        Domain::Continuous => Complex::new(0.0, w),
        Domain::Sampled { period } => Complex::from_polar(1.0, w * period),
    })
}

#[track_caller]
fn assert_same(actual: &ComplexMatrix, expected: &ComplexMatrix) {
    let error = (actual - expected).norm() / expected.norm();
    assert!(error < 1e-11, "{error:e}");
}

#[test]
fn sensitivities_are_those_of_the_transfer_functions() {
    let identity = ComplexMatrix::identity(2, 2);
    for domain in [Domain::Continuous, SAMPLED] {
        let controller_system = controller(domain);
        let model = match domain {
            Domain::Continuous => plant(),
            Domain::Sampled { period } => held_plant(&plant(), period).expect("a plant"),
        };
        let closed = Loop::new(model, controller_system.clone()).expect("a loop");
        for s in points(domain) {
            let g = if domain == SAMPLED { held_response(s) } else { response(&plant(), s) };
            let k = response(&controller_system, s);
            for (at, product) in [(Point::Input, &k * &g), (Point::Output, &g * &k)] {
                let expected = (&identity - product).try_inverse().expect("regular");
                assert_same(&response(&closed.sensitivity(at), s), &expected);
                let expected = &identity - expected;
                assert_same(&response(&closed.complementary(at), s), &expected);
            }
            // From noise of the measurements to the commands: K S_o.
            let noise = closed.from_noise(&controller_system).expect("fits");
            let expected = &k * (&identity - &g * &k).try_inverse().expect("regular");
            assert_same(&response(&noise, s), &expected);
        }
    }
}

/// u = K (y - D u), in sampled time with D u of the sample before.
#[test]
fn a_controller_takes_its_own_commands_off_the_measurements() {
    let d = plant().d;
    for domain in [Domain::Continuous, SAMPLED] {
        let controller_system = controller(domain);
        let computed =
            with_feedthrough(&controller_system, &controller_system.c, &d).expect("fits");
        for s in points(domain) {
            let k = response(&controller_system, s);
            let fed = if domain == SAMPLED { complex(&d) / s } else { complex(&d) };
            let regular = ComplexMatrix::identity(2, 2) + &k * fed;
            assert_same(&response(&computed, s), &(regular.try_inverse().expect("regular") * k));
        }
    }
    let controller_system = controller(SAMPLED);
    let infinite = matrix(2, 2, &[0.0, f64::INFINITY, 1.3, 0.2]);
    let refused = with_feedthrough(&controller_system, &controller_system.c, &infinite);
    assert!(matches!(refused, Err(Error::NotFinite { matrix: "D", .. })), "{refused:?}");
    let controller_system = StateSpace { d: DMatrix::identity(2, 2), ..controller_system };
    let refused = with_feedthrough(&controller_system, &controller_system.c, &d);
    assert!(matches!(refused, Err(Error::OutOfRange { .. })), "{refused:?}");
    let refused =
        Loop::new(plant(), StateSpace { domain: Domain::Continuous, ..controller_system });
    assert!(matches!(refused, Err(Error::OutOfRange { .. })), "{refused:?}");
}

#[test]
fn derivatives_of_the_peak_are_differences() {
    let strict = StateSpace { d: DMatrix::zeros(2, 2), ..plant() };
    let cases = [Domain::Continuous, SAMPLED]
        .map(|domain| [plant(), strict.clone()].map(|plant| (domain, plant)));
    for (domain, plant) in cases.iter().flatten() {
        let controller_system = controller(*domain);
        for (point, scaled) in [(Point::Input, false), (Point::Output, true)] {
            let peak = SensitivityPeak { point, frequency: 2.3, scaled };
            let value = |plant: &StateSpace| {
                peak_derivatives(plant, &controller_system, &peak).expect("a value")
            };
            let computed = value(plant);
            for (which, slopes) in
                [&computed.a, &computed.b, &computed.c, &computed.d].into_iter().enumerate()
            {
                for at in 0..slopes.len() {
                    let moved = |change: f64| {
                        let mut plant = plant.clone();
                        let StateSpace { a, b, c, d, .. } = &mut plant;
                        let matrices = [a, b, c, d];
                        matrices.into_iter().nth(which).expect("four")[at] += change;
                        value(&plant).value
                    };
                    let expected = (moved(1e-5) - moved(-1e-5)) / 2e-5;
                    let error = (slopes[at] - expected).abs();
                    assert!(error < 1e-7 * computed.value.max(1.0), "{which} {at}: {error:e}");
                }
            }
        }
    }
}

/// The growth of the states over a run of plant and controller that exchange their signals every `hold`
/// seconds, with commands that arrive `delay` later; a sample contains the command that is in force.
fn growth(controller: &StateSpace, hold: f64, delay: f64) -> f64 {
    const SAMPLES: usize = 20_000;
    const PARTS: f64 = 40.0;
    let plant = plant();
    let (a, b) = zero_order_hold(&plant.a, &plant.b, hold / PARTS).expect("a plant");
    let (phi, gamma) = match controller.domain {
        Domain::Continuous => {
            zero_order_hold(&controller.a, &controller.b, hold).expect("a controller")
        }
        Domain::Sampled { .. } => (controller.a.clone(), controller.b.clone()),
    };
    let later = (0..1000_u16)
        .find(|parts| f64::from(*parts) >= delay / hold * PARTS - 0.5)
        .expect("a short delay");
    let mut x = DMatrix::from_element(4, 1, 1.0);
    let mut z = DMatrix::zeros(2, 1);
    let mut queue =
        std::collections::VecDeque::from(vec![DMatrix::zeros(2, 1); usize::from(later) + 1]);
    let mut norms = Vec::with_capacity(SAMPLES);
    for _ in 0..SAMPLES {
        // What the plant received last is in the measurement.
        let y = &plant.c * &x + &plant.d * &queue[0];
        let u = &controller.c * &z + &controller.d * &y;
        z = &phi * z + &gamma * y;
        for _ in 0..40 {
            queue.push_back(u.clone());
            queue.pop_front();
            x = &a * x + &b * &queue[0];
        }
        norms.push(x.norm());
    }
    let largest = |part: &[f64]| part.iter().copied().fold(0.0, f64::max);
    largest(&norms[SAMPLES * 9 / 10..]) / largest(&norms[SAMPLES / 2..SAMPLES * 6 / 10])
}

#[test]
fn hold_times_and_delays_are_the_limits_of_runs() {
    let controller_system = controller(Domain::Continuous);
    let closed = Loop::new(plant(), controller_system.clone()).expect("a loop");
    let longest = longest_hold(&closed).expect("a time");
    assert!(growth(&controller_system, 0.95 * longest, 0.0) < 1.0, "{longest}");
    assert!(growth(&controller_system, 1.05 * longest, 0.0) > 1.0, "{longest}");
    let controller_system = controller(SAMPLED);
    let longest = longest_period(&plant(), &controller_system).expect("a time");
    assert!(growth(&controller_system, 0.95 * longest, 0.0) < 1.0, "{longest}");
    assert!(growth(&controller_system, 1.05 * longest, 0.0) > 1.0, "{longest}");
    let delay = sampled_delay_margin(&plant(), &controller_system).expect("a time");
    assert!(growth(&controller_system, PERIOD, 0.95 * delay) < 1.0, "{delay}");
    assert!(growth(&controller_system, PERIOD, 1.05 * delay) > 1.0, "{delay}");
}

/// No vertex of C and D is worse than the one that the search found.
#[test]
fn the_worst_case_includes_the_feedthrough() {
    for domain in [Domain::Continuous, SAMPLED] {
        let controller_system = controller(domain);
        let tolerances = Tolerances::unless_structural(&plant(), [0.0, 0.0, 0.05, 0.2]);
        let nominal = plant();
        let family = EntryFamily::new(&nominal, &tolerances).expect("fits");
        let computed = tolerance_test(&family, &controller_system, 20, 3).expect("a test");
        let value = |plant: &StateSpace| {
            let model = match domain {
                Domain::Continuous => plant.clone(),
                Domain::Sampled { period } => held_plant(plant, period).expect("a plant"),
            };
            let closed = Loop::new(model, controller_system.clone()).expect("a loop");
            instability(&closed.dynamics(), domain).expect("a number")
        };
        assert!((computed.worst.d - &nominal.d).amax() > 0.0, "D varies");
        for bits in 0_u32..1 << 9 {
            let mut vertex = nominal.clone();
            let varied = vertex.c.iter_mut().zip(&tolerances.of[2]);
            let varied = varied.chain(vertex.d.iter_mut().zip(&tolerances.of[3]));
            for (at, (entry, relative)) in
                varied.filter(|(_, relative)| **relative > 0.0).enumerate()
            {
                *entry *= 1.0 + if bits >> at & 1 == 0 { *relative } else { -relative };
            }
            assert!(value(&vertex) <= computed.worst_instability + 1e-9, "{domain:?} {bits}");
        }
    }
}

#[test]
fn the_peak_of_s_is_that_of_a_grid() {
    let controller_system = controller(Domain::Continuous);
    let closed = Loop::new(plant(), controller_system.clone()).expect("a loop");
    let identity = ComplexMatrix::identity(2, 2);
    let largest = (1..4000_u32).map(|k| {
        let s = Complex::new(0.0, 0.005 * f64::from(k));
        let product = response(&plant(), s) * response(&controller_system, s);
        let s = (&identity - product).try_inverse().expect("regular");
        s.svd(false, false).singular_values.max()
    });
    let grid = largest.fold(0.0, f64::max);
    let computed = h_infinity(&closed.sensitivity(Point::Output), 1e-4).expect("a norm");
    assert!((computed.lower / grid - 1.0).abs() < 1e-3, "{} {grid}", computed.lower);
}
