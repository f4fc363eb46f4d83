//! Margins against python-control, SLICOT and scipy, and against closed forms.

use crate::recorded::{Case, cases};
use crate::{entry_error, matrix};
use control::hold::zero_order_hold;
use control::response::h_infinity;
use control::robustness::{
    EntryFamily, Loop, Point, SensitivityPeak, Tolerances, channel_margins, delay_margin,
    disk_margin, longest_hold, longest_period, noise_gains, peak_derivatives,
    regulator_of_same_speed, sampled_channel_delay, sampled_delay_margin, scaled_peak,
    tolerance_test,
};
use control::stability::instability;
use control::{Domain, Error, StateSpace};
use nalgebra::{Complex, DMatrix};
use std::f64::consts::PI;

const RECORDED: &str = include_str!("../data/robustness.txt");
const POINTS: [(&str, Point); 2] = [("in", Point::Input), ("out", Point::Output)];

/// The continuous plant and the controller of a case.
fn parts(case: &Case) -> (StateSpace, StateSpace) {
    let get = |name: &str| case.get(name).clone();
    let (b, c) = (get("B"), get("C"));
    let d = DMatrix::zeros(c.nrows(), b.ncols());
    let plant = StateSpace { a: get("A"), b, c, d, domain: Domain::Continuous };
    let period = case.number("period");
    let domain = if period > 0.0 { Domain::Sampled { period } } else { Domain::Continuous };
    (plant, StateSpace { a: get("a"), b: get("b"), c: get("c"), d: get("d"), domain })
}

fn closed(case: &Case) -> Loop {
    let (mut plant, controller) = parts(case);
    if let Domain::Sampled { period } = controller.domain {
        (plant.a, plant.b) = zero_order_hold(&plant.a, &plant.b, period).expect("a plant");
        plant.domain = controller.domain;
    }
    Loop::new(plant, controller).expect("a loop")
}

#[track_caller]
fn assert_near(actual: f64, expected: f64, tolerance: f64, what: &str) {
    let same =
        actual.to_bits() == expected.to_bits() || (actual / expected - 1.0).abs() <= tolerance;
    assert!(same, "{what}: found {actual}, expected {expected}");
}

/// 1 / (s (s + 1)) with u = -k y.
fn servo(k: f64) -> Loop {
    let domain = Domain::Continuous;
    let plant = StateSpace {
        a: matrix(2, 2, &[0.0, 1.0, 0.0, -1.0]),
        b: matrix(2, 1, &[0.0, 1.0]),
        c: matrix(1, 2, &[1.0, 0.0]),
        d: matrix(1, 1, &[0.0]),
        domain,
    };
    Loop::new(plant, gain(&matrix(1, 1, &[-k]), domain)).expect("a loop")
}

/// A controller without dynamics; it has one idle state.
fn gain(k: &DMatrix<f64>, domain: Domain) -> StateSpace {
    let idle = if domain == Domain::Continuous { -1.0 } else { 0.0 };
    StateSpace {
        a: matrix(1, 1, &[idle]),
        b: DMatrix::zeros(1, k.ncols()),
        c: DMatrix::zeros(k.nrows(), 1),
        d: k.clone(),
        domain,
    }
}

#[test]
fn peaks_of_sensitivities_agree_with_slicot() {
    for case in cases(RECORDED, "loop") {
        let closed = closed(&case);
        for (name, point) in POINTS {
            let norm = |system: &StateSpace| h_infinity(system, 1e-7).expect("a norm").lower;
            let what = format!("{} {name}", case.name);
            let expected = case.number(&format!("s_{name}"));
            assert_near(norm(&closed.sensitivity(point)), expected, 1e-6, &what);
            let expected = case.number(&format!("t_{name}"));
            assert_near(norm(&closed.complementary(point)), expected, 1e-6, &what);
        }
    }
}

/// Returns A, B or C.
type Field = fn(&mut StateSpace) -> &mut DMatrix<f64>;

/// Checks the derivatives of a peak against differences of `peak`, entry by entry, relative to the
/// largest effect of a relative change.
fn assert_derivatives(
    case: &Case,
    at: SensitivityPeak,
    step: f64,
    tolerance: f64,
    peak: impl Fn(&Loop) -> f64,
) {
    let (plant, controller) = parts(case);
    let sensitivity = peak_derivatives(&plant, &controller, &at).expect("a peak");
    let reached = peak(&closed(case));
    assert_near(sensitivity.value, reached, 1e-4, case.name);
    let fields: [(&DMatrix<f64>, Field); 3] = [
        (&sensitivity.a, |plant| &mut plant.a),
        (&sensitivity.b, |plant| &mut plant.b),
        (&sensitivity.c, |plant| &mut plant.c),
    ];
    let mut effects = Vec::new();
    for (derivatives, field) in fields {
        let values = field(&mut plant.clone()).clone();
        for at in (0..values.len()).filter(|&at| values[at] != 0.0) {
            let moved = |factor: f64| {
                let mut plant = plant.clone();
                field(&mut plant)[at] *= factor;
                if let Domain::Sampled { period } = controller.domain {
                    (plant.a, plant.b) =
                        zero_order_hold(&plant.a, &plant.b, period).expect("a loop");
                    plant.domain = controller.domain;
                }
                peak(&Loop::new(plant, controller.clone()).expect("a loop"))
            };
            let expected = (moved(1.0 + step) - moved(1.0 - step)) / (2.0 * step);
            effects.push((derivatives[at] * values[at], expected));
        }
    }
    let largest = effects.iter().map(|(_, expected)| expected.abs()).fold(0.0, f64::max);
    assert!(largest > 0.1, "{} {at:?}: {largest}", case.name);
    for (effect, expected) in effects {
        let error = (effect - expected).abs() / largest;
        assert!(error < tolerance, "{} {at:?}: {effect} {expected}", case.name);
    }
}

#[test]
fn derivatives_of_the_peaks_are_those_of_the_peaks_of_changed_plants() {
    for case in cases(RECORDED, "loop") {
        for (_, point) in POINTS {
            let norm = |closed: &Loop| h_infinity(&closed.sensitivity(point), 1e-8).unwrap();
            let frequency = norm(&closed(&case)).frequency;
            let at = SensitivityPeak { point, frequency, scaled: false };
            assert_derivatives(&case, at, 1e-4, 1e-3, |closed| norm(closed).lower);
            let scaled = |closed: &Loop| scaled_peak(&closed.sensitivity(point)).unwrap();
            let frequency = scaled(&closed(&case)).frequency;
            let at = SensitivityPeak { point, frequency, scaled: true };
            assert_derivatives(&case, at, 5e-3, 5e-2, |closed| scaled(closed).value);
        }
    }
}

/// S = 1 / (1 - K D) with K = -k at infinite frequency, and the derivative with respect to D is K where D = 0.
#[test]
fn a_peak_at_infinite_frequency_depends_on_the_direct_term_of_the_plant() {
    let closed = servo(0.5);
    for (name, point) in POINTS {
        for scaled in [false, true] {
            let at = SensitivityPeak { point, frequency: f64::INFINITY, scaled };
            let peak = peak_derivatives(closed.plant(), closed.controller(), &at).expect("a peak");
            assert_near(peak.value, 1.0, 1e-15, name);
            assert_near(peak.d[0], -0.5, 1e-15, name);
            assert!(peak.a.amax() <= 0.0 && peak.b.amax() <= 0.0 && peak.c.amax() <= 0.0);
        }
    }
}

#[test]
fn disk_margins_agree_with_slicot_and_are_certified() {
    for case in cases(RECORDED, "loop") {
        let closed = closed(&case);
        for (name, point) in POINTS {
            let computed = disk_margin(&closed, point, None).expect("a margin");
            let expected = case.number(&format!("disk_{name}"));
            assert_near(computed.alpha, expected, 1e-3, case.name);
            assert!(
                computed.certified <= computed.alpha && computed.certified > 0.9 * computed.alpha
            );
            let whole = h_infinity(&closed.sensitivity(point), 1e-6).expect("a norm").upper;
            let scaled = scaled_peak(&closed.sensitivity(point)).expect("a peak");
            assert!(scaled.value <= whole * 1.0001, "{} {scaled:?} {whole}", case.name);
        }
    }
}

/// A change of each channel by its own factor needs as many inputs as outputs.
#[test]
fn a_system_that_is_not_square_has_no_scaled_peak() {
    for (p, m) in [(2, 3), (3, 2), (1, 2)] {
        let (a, b) = (DMatrix::from_element(1, 1, -1.0), DMatrix::from_element(1, m, 1.0));
        let (c, d) = (DMatrix::from_element(p, 1, 1.0), DMatrix::zeros(p, m));
        let system = StateSpace { a, b, c, d, domain: Domain::Continuous };
        assert!(matches!(scaled_peak(&system), Err(Error::Shape { .. })), "{p} x {m}");
    }
}

#[test]
fn margins_of_single_channels_agree_with_python_control() {
    for case in cases(RECORDED, "loop") {
        let closed = closed(&case);
        for (name, point) in POINTS {
            for (channel, row) in case.get(&format!("channels_{name}")).row_iter().enumerate() {
                let computed = channel_margins(&closed, point, channel).expect("margins");
                let disk = disk_margin(&closed, point, Some(channel)).expect("a margin").alpha;
                let what = format!("{} {name} {channel} {computed:?}", case.name);
                assert_near(computed.gain[0], row[0], 1e-4, &what);
                assert_near(computed.gain[1], row[1], 1e-4, &what);
                assert_near(computed.phase, row[2], 1e-4, &what);
                assert_near(computed.delay, row[3], 1e-4, &what);
                assert_near(disk, row[4], 1e-3, &what);
            }
        }
    }
}

#[test]
fn noise_hold_and_delay_agree_with_python_control_and_scipy() {
    for case in cases(RECORDED, "loop") {
        let closed = closed(&case);
        let of_noise = closed.from_noise(closed.controller()).expect("a system");
        let noise = noise_gains(&of_noise).expect("gains");
        assert!(entry_error(&noise, case.get("noise")) < 1e-6, "{} {noise}", case.name);
        let (plant, controller) = parts(&case);
        let (hold, delay) = if controller.domain == Domain::Continuous {
            (longest_hold(&closed), delay_margin(&closed))
        } else {
            (longest_period(&plant, &controller), sampled_delay_margin(&plant, &controller))
        };
        assert_near(hold.expect("a time"), case.number("hold"), 1e-6, case.name);
        assert_near(delay.expect("a delay"), case.number("delay"), 1e-6, case.name);
    }
}

/// |L| = 1 at w with k^2 = w^2 (w^2 + 1); the phase margin is pi / 2 - atan w.
#[test]
fn the_margins_of_a_servo_are_the_closed_form() {
    for k in [0.2, 1.0, 30.0] {
        let computed = channel_margins(&servo(k), Point::Output, 0).expect("margins");
        let frequency = (0.5 * ((1.0 + 4.0 * k * k).sqrt() - 1.0)).sqrt();
        let phase = 0.5 * PI - frequency.atan();
        assert_near(computed.phase, phase, 1e-9, "phase");
        assert_near(computed.phase_frequency, frequency, 1e-9, "frequency");
        assert_near(computed.delay, phase / frequency, 1e-9, "delay");
        assert_near(delay_margin(&servo(k)).expect("a delay"), phase / frequency, 1e-9, "delay");
        assert!(computed.gain[0] <= 0.0 && computed.gain[1] == f64::INFINITY, "{computed:?}");
    }
}

/// L = k / (s^2 + d s + w0^2) with a narrow peak, from which the gain moves the closed loop away: |L| = 1 at w with
/// (w0^2 - w^2)^2 + (d w)^2 = k^2, and above w0 the lag to -1 is atan(d w / (w^2 - w0^2)).
#[test]
fn a_lightly_damped_mode_has_its_margins_although_its_peak_is_narrow() {
    let domain = Domain::Continuous;
    for (w0, damping, k) in [(3.0, 0.006, 0.1), (5.0, 0.01, 0.3), (2.0, 0.004, 0.06)] {
        let square: f64 = w0 * w0;
        let plant = StateSpace {
            a: matrix(2, 2, &[0.0, 1.0, -square, -damping]),
            b: matrix(2, 1, &[0.0, 1.0]),
            c: matrix(1, 2, &[1.0, 0.0]),
            d: matrix(1, 1, &[0.0]),
            domain,
        };
        let closed = Loop::new(plant, gain(&matrix(1, 1, &[-k]), domain)).expect("a loop");
        let half = square - 0.5 * damping * damping;
        let frequency = (half + (half * half - square * square + k * k).sqrt()).sqrt();
        let phase = (damping * frequency / (frequency * frequency - square)).atan();
        let computed = channel_margins(&closed, Point::Output, 0).expect("margins");
        assert_near(computed.phase, phase, 1e-9, "phase");
        assert_near(computed.phase_frequency, frequency, 1e-9, "frequency");
        assert_near(computed.delay, phase / frequency, 1e-9, "delay");
        assert_near(delay_margin(&closed).expect("a delay"), phase / frequency, 1e-9, "delay");
    }
}

/// A feedback of n integrators in series with all eigenvalues -1 has L = (1 + 1 / s)^n - 1; together they are so fast
/// that |L| = 1 is above ten times each of them.
#[test]
fn many_fast_modes_together_have_their_margins_far_above_each_of_them() {
    let (n, domain) = (16_u32, Domain::Continuous);
    let order = n as usize;
    let plant = StateSpace {
        a: DMatrix::from_fn(order, order, |i, j| f64::from(u8::from(j == i + 1))),
        b: DMatrix::from_fn(order, 1, |i, _| f64::from(u8::from(i + 1 == order))),
        c: DMatrix::identity(order, order),
        d: DMatrix::zeros(order, 1),
        domain,
    };
    let binomials = (0..n).scan(1.0, |binomial, i| {
        let before = *binomial;
        *binomial *= f64::from(n - i) / f64::from(i + 1);
        Some(-before)
    });
    let k = DMatrix::from_iterator(1, order, binomials);
    let closed = Loop::new(plant, gain(&k, domain)).expect("a loop");
    let computed = channel_margins(&closed, Point::Input, 0).expect("margins");
    let frequency = computed.phase_frequency;
    assert!((15.0..16.0).contains(&frequency), "{computed:?}");
    let one = Complex::new(1.0, 0.0);
    let l = (one + Complex::new(0.0, -frequency.recip())).powu(n) - one;
    assert_near(l.norm(), 1.0, 1e-9, "|L|");
    assert_near(computed.phase, (-l).arg(), 1e-9, "phase");
    assert_near(computed.delay, computed.phase / frequency, 1e-9, "delay");
    assert_near(delay_margin(&closed).expect("a delay"), computed.delay, 1e-9, "delay");
}

/// y[k+1] = -0.5 y[k] + u[k], u = 1.2 y: the eigenvalue 0.7. |L| = 2.4 at z = -1, and with one sample of delay an
/// eigenvalue is (-0.5 - sqrt(5.05)) / 2 = -1.37, while |L| = 1 at 1.38 rad per sample asks for 3.9 samples.
#[test]
fn a_loop_of_more_than_one_at_half_of_the_sample_rate_bears_no_delay() {
    let one = |value| DMatrix::from_element(1, 1, value);
    let domain = Domain::Sampled { period: 0.1 };
    let plant = StateSpace { a: one(-0.5), b: one(1.0), c: one(1.0), d: one(0.0), domain };
    let gain = |gain| StateSpace { a: one(0.0), b: one(0.0), c: one(0.0), d: one(gain), domain };
    for (k, delay) in [(1.2, 0.0), (0.2, f64::INFINITY), (-0.45, f64::INFINITY)] {
        let closed = Loop::new(plant.clone(), gain(k)).unwrap();
        let computed = [
            delay_margin(&closed).unwrap(),
            channel_margins(&closed, Point::Output, 0).unwrap().delay,
            sampled_delay_margin(&plant, &gain(k)).unwrap(),
        ];
        assert_eq!(
            computed.map(|computed| computed.total_cmp(&delay)),
            [std::cmp::Ordering::Equal; 3],
            "{computed:?}"
        );
    }
}

/// An oscillator that is sampled once in each turn, and decays by d in it: x[k+1] = d x[k] - (1 - d) k x[k-j], stable
/// for every delay of j samples if k < 1. With a delay of half a sample, with r = d^(1/2),
/// x[k+1] = (d - k (1 + r)) x[k] + k r (1 + r) x[k-1], unstable for k r (1 + r) > 1.
#[test]
fn a_loop_may_bear_every_whole_sample_of_delay_and_not_a_part_of_one() {
    let (d, k, period) = (0.9_f64, 0.8, 0.5);
    let (decay, turn) = (-d.ln() / period, 2.0 * PI / period);
    let square = decay * decay + turn * turn;
    let plant = StateSpace {
        a: matrix(2, 2, &[0.0, 1.0, -square, -2.0 * decay]),
        b: matrix(2, 1, &[0.0, square]),
        c: matrix(1, 2, &[1.0, 0.0]),
        d: matrix(1, 1, &[0.0]),
        domain: Domain::Continuous,
    };
    let controller = gain(&matrix(1, 1, &[-k]), Domain::Sampled { period });
    let delay = sampled_delay_margin(&plant, &controller).expect("a delay");
    assert!(delay < 0.5 * period, "{delay}");
    // The size of x after many samples, by the states at the instants at which the command changes.
    let grown = |delay: f64| {
        let hold = |time: f64| zero_order_hold(&plant.a, &plant.b, time).expect("a plant");
        let (before, after) = (hold(delay), hold(period - delay));
        let (mut x, mut old) = (matrix(2, 1, &[1.0, 0.0]), 0.0);
        for _ in 0..4000 {
            let new = -k * x[0];
            x = &before.0 * x + &before.1 * old;
            x = &after.0 * x + &after.1 * new;
            old = new;
        }
        x.norm()
    };
    assert!(grown(0.99 * delay) < 1e-3 && grown(1.01 * delay) > 1e3, "{delay}");
    for at in [Point::Input, Point::Output] {
        let alone = sampled_channel_delay(&plant, &controller, (at, 0), 0.0).expect("a delay");
        assert_near(alone, delay, 1e-9, "delay of the only channel");
    }
}

#[test]
fn each_channel_of_uncoupled_sampled_loops_bears_the_delay_of_its_loop() {
    let domain = Domain::Sampled { period: 0.5 };
    let loops = [(-1.0, 3.0), (0.0, 1.2)];
    let diagonal = |[x, y]: [f64; 2]| matrix(2, 2, &[x, 0.0, 0.0, y]);
    let both = StateSpace {
        a: diagonal(loops.map(|(pole, _)| pole)),
        b: diagonal([1.0, 1.0]),
        c: diagonal([1.0, 1.0]),
        d: diagonal([0.0, 0.0]),
        domain: Domain::Continuous,
    };
    let controller = gain(&diagonal(loops.map(|(_, k)| -k)), domain);
    for (channel, (pole, k)) in loops.into_iter().enumerate() {
        let one = |value| matrix(1, 1, &[value]);
        let plant =
            StateSpace { a: one(pole), b: one(1.0), c: one(1.0), d: one(0.0), ..both.clone() };
        let expected = sampled_delay_margin(&plant, &gain(&one(-k), domain)).expect("a delay");
        for at in [Point::Input, Point::Output] {
            let computed = sampled_channel_delay(&both, &controller, (at, channel), 0.0);
            assert_near(computed.expect("a delay"), expected, 1e-9, "delay");
        }
    }
}

/// x'' = -2 zeta x' - x - k x(t - tau) decays at zeta - k sin(tau) / 2 for small zeta and k. The hold delays by half
/// of a sample h, and lowers k by the factor sin(h / 2) / (h / 2). In a sample the mode grows by less than 5e-7.
#[test]
fn a_resonance_that_grows_slowly_limits_the_delay() {
    let (zeta, k, period) = (1e-5, 3e-5, 0.1);
    let plant = StateSpace {
        a: matrix(2, 2, &[0.0, 1.0, -1.0, -2.0 * zeta]),
        b: matrix(2, 1, &[0.0, 1.0]),
        c: matrix(1, 2, &[1.0, 0.0]),
        d: matrix(1, 1, &[0.0]),
        domain: Domain::Continuous,
    };
    let controller = gain(&matrix(1, 1, &[-k]), Domain::Sampled { period });
    let half: f64 = 0.5 * period;
    let expected = (2.0 * zeta / (k * half.sin() / half)).asin() - half;
    let delay = sampled_delay_margin(&plant, &controller).expect("a delay");
    assert_near(delay, expected, 1e-4, "delay");
}

/// y[k+2] = -r y[k+1] - r^2 y[k] + u[k], whose mode turns by a third in each sample, with u[k] = -g y[k-j]. The
/// frequencies with |L| = 1 ask for 2.37 and 2.97 samples, between which there is no whole one.
#[test]
fn the_delay_margin_of_a_plant_in_samples_is_its_largest_number_of_stable_samples() {
    let (r, g, period) = (0.8_f64, 0.33, 0.1);
    let domain = Domain::Sampled { period };
    let plant = StateSpace {
        a: matrix(2, 2, &[0.0, 1.0, -r * r, -r]),
        b: matrix(2, 1, &[0.0, 1.0]),
        c: matrix(1, 2, &[1.0, 0.0]),
        d: matrix(1, 1, &[0.0]),
        domain,
    };
    let size = |delay: usize| {
        let mut y = vec![1.0_f64; delay + 2];
        for k in 0..20_000 {
            y.push(-r * y[k + delay + 1] - r * r * y[k + delay] - g * y[k]);
        }
        y[20_000].abs().max(y[20_001].abs())
    };
    assert!((0..=5).all(|delay| size(delay) < 1e-3) && size(6) > 1e3);
    let controller = gain(&matrix(1, 1, &[-g]), domain);
    let delay = sampled_delay_margin(&plant, &controller).expect("a delay");
    assert_near(delay, 5.0 * period, 1e-12, "delay");
}

/// An integrator with u = -k y, held over h, has the eigenvalue 1 - k h.
#[test]
fn an_integrator_may_be_held_for_two_time_constants() {
    let one = |value| matrix(1, 1, &[value]);
    let domain = Domain::Continuous;
    let plant = StateSpace { a: one(0.0), b: one(1.0), c: one(1.0), d: one(0.0), domain };
    let k = 4.0;
    let closed = Loop::new(plant, gain(&one(-k), domain)).expect("a loop");
    assert_near(longest_hold(&closed).expect("a time"), 2.0 / k, 1e-9, "hold");
}

/// The vertices of two intervals: a scalar plant x' = a x + b u with u = -k y, a = 1, b = 2: the
/// worst eigenvalue is 1.1 a - 0.9 b k, and it is zero at the tolerance (b k - a) / (b k + a).
#[test]
fn the_worst_plant_of_two_parameters_is_a_vertex() {
    let one = |value| matrix(1, 1, &[value]);
    let domain = Domain::Continuous;
    let plant = StateSpace { a: one(3.0), b: one(2.0), c: one(1.0), d: one(0.0), domain };
    let tolerances = Tolerances::unless_structural(&plant, [0.1; 4]);
    let family = EntryFamily::new(&plant, &tolerances).expect("fits");
    assert_eq!(tolerances.entries().count(), 2, "C is one");
    let test = |k: f64| tolerance_test(&family, &gain(&one(-k), domain), 200, 1);
    let computed = test(3.0).expect("a test");
    assert_eq!((computed.cases, computed.stable), (200, 200));
    // The idle state of the controller has -1.
    assert_near(computed.worst_instability, -1.0, 1e-12, "worst");
    let computed = test(1.7).expect("a test");
    assert_near(computed.worst_instability, 3.3 - 1.8 * 1.7, 1e-12, "worst");
    assert_near(computed.worst.a[(0, 0)], 3.3, 1e-12, "a");
    assert_near(computed.worst.b[(0, 0)], 1.8, 1e-12, "b");
    assert_near(computed.first_unstable.expect("unstable"), 0.4 / 6.4 / 0.1, 1e-9, "limit");
    // P(a + b k > 0) for independent uniform deviations: 0.3 x + 0.34 y > 0.4.
    let corner = 0.5 * (0.24 / 0.3) * (0.24 / 0.34) / 4.0;
    let part = f64::from(computed.cases - computed.stable) / 200.0;
    assert!((part - corner).abs() < 0.06, "{part} {corner}");
}

/// No random vertex is worse than the one that the search found, and the worst plant has the
/// instability that is stated.
#[test]
fn the_worst_case_is_at_least_as_bad_as_random_vertices() {
    for case in cases(RECORDED, "loop") {
        let (plant, controller) = parts(&case);
        let tolerances = Tolerances::unless_structural(&plant, [0.03; 4]);
        let computed = EntryFamily::new(&plant, &tolerances)
            .and_then(|family| tolerance_test(&family, &controller, 40, 7))
            .expect("a test");
        let value = |plant: &StateSpace| {
            let mut plant = plant.clone();
            if let Domain::Sampled { period } = controller.domain {
                (plant.a, plant.b) = zero_order_hold(&plant.a, &plant.b, period).expect("a plant");
                plant.domain = controller.domain;
            }
            let closed = Loop::new(plant, controller.clone()).expect("a loop");
            instability(&closed.dynamics(), controller.domain).expect("a number")
        };
        assert_near(value(&computed.worst), computed.worst_instability, 1e-9, case.name);
        let mut bits = 12345_u64;
        for _ in 0..100 {
            let mut vertex = plant.clone();
            for (values, of) in
                [&mut vertex.a, &mut vertex.b, &mut vertex.c].into_iter().zip(&tolerances.of)
            {
                for (entry, relative) in values.iter_mut().zip(of) {
                    bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                    *entry *= 1.0 + if bits >> 63 == 0 { *relative } else { -relative };
                }
            }
            assert!(value(&vertex) <= computed.worst_instability + 1e-9, "{}", case.name);
        }
    }
}

#[test]
fn the_regulator_of_the_same_speed_has_the_same_sum_of_eigenvalues() {
    let a = matrix(3, 3, &[0.2, 1.0, 0.0, -2.0, 0.1, 0.5, 0.0, 0.3, -1.0]);
    let b = matrix(3, 2, &[0.0, 1.0, 1.0, 0.0, 0.2, 0.3]);
    let k = matrix(2, 3, &[-1.0, -5.0, 0.0, -4.0, 0.0, -1.0]);
    let computed = regulator_of_same_speed(&a, &b, &k, Domain::Continuous).expect("no error");
    let computed = computed.expect("a regulator");
    assert_near((&a + &b * &computed).trace(), (&a + &b * &k).trace(), 1e-3, "trace");
    let (phi, gamma) = zero_order_hold(&a, &b, 0.1).expect("a plant");
    let domain = Domain::Sampled { period: 0.1 };
    let computed = regulator_of_same_speed(&phi, &gamma, &k, domain).expect("no error");
    let computed = computed.expect("a regulator");
    let log = |k: &DMatrix<f64>| (&phi + &gamma * k).determinant().abs().ln();
    assert_near(log(&computed), log(&k), 1e-3, "determinant");
}

#[test]
fn loops_that_are_not_stable_or_do_not_fit_are_refused() {
    let unstable = servo(-1.0);
    let refused = disk_margin(&unstable, Point::Input, None);
    assert!(matches!(refused, Err(Error::NotHurwitz { .. })), "{refused:?}");
    assert!(matches!(longest_hold(&unstable), Err(Error::NotHurwitz { .. })));
    let plant = servo(1.0).plant().clone();
    let sampled = gain(&matrix(1, 1, &[1.0]), Domain::Sampled { period: 1.0 });
    let refused = Loop::new(plant.clone(), sampled);
    assert!(matches!(refused, Err(Error::OutOfRange { name: "the domain", .. })), "{refused:?}");
    let refused = Loop::new(plant, gain(&matrix(2, 1, &[1.0, 1.0]), Domain::Continuous));
    assert!(matches!(refused, Err(Error::Shape { .. })), "{refused:?}");
}
