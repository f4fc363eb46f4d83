//! References: feedforward, integral action, anti-windup.

use control::aso::{Estimator, FaultyPlant, Gains};
use control::controller::complete_controller;
use control::eigen::eigenvalues;
use control::faults::{ExtendedPlant, Fault, FaultEntry, FaultKind};
use control::placement::{place, place_discrete, real_poles};
use control::response::{
    SampledLoop, fault_rate_system, fault_system, frequency_response, gains_between_samples,
    peak_gain,
};
use control::robustness::Loop;
use control::tracking::{
    Action, IntegralAction, InterpolatedWindup, extended_pair, feedforward, integral_feedforward,
    interpolated_windup, reference_system, tracking_rank, windup_gain,
};
use control::{Domain, Error, StateSpace, sampled};
use nalgebra::{Complex, DMatrix, DVector};

const PERIOD: f64 = 0.1;

fn matrix(rows: usize, values: &[f64]) -> DMatrix<f64> {
    DMatrix::from_row_slice(rows, values.len() / rows, values)
}

fn one(value: f64) -> DMatrix<f64> {
    DMatrix::from_element(1, 1, value)
}

/// Three states, two commands, three measurements.
fn plant() -> [DMatrix<f64>; 3] {
    [
        matrix(3, &[-1.0, 0.6, 0.0, 0.4, -1.5, 0.7, 0.2, 0.5, -0.8]),
        matrix(3, &[1.0, 0.0, 0.0, 0.5, 0.3, 1.0]),
        matrix(3, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.2, 1.0]),
    ]
}

/// References for the first measurement and the difference of the others.
fn h() -> DMatrix<f64> {
    matrix(2, &[1.0, 0.0, 0.0, 0.0, 1.0, -1.0])
}

/// A design with a fault of the first command and, if `sensor`, one of the second measurement.
struct Designed {
    extended: ExtendedPlant,
    plant: FaultyPlant,
    gains: Gains,
    filter: Option<Vec<f64>>,
    domain: Domain,
    feedback: Vec<Complex<f64>>,
}

fn designed(domain: Domain, estimator: Estimator, sensor: bool) -> Designed {
    let [a, b, c] = plant();
    let kind = FaultKind::Constant;
    let actuator = FaultEntry::Actuator(b.column(0).into());
    let mut faults = vec![Fault { entry: actuator, kind }];
    let f_s = DVector::from_vec(vec![0.0, 1.0, 0.0]);
    if sensor {
        faults.push(Fault { entry: FaultEntry::Sensor(f_s.clone()), kind });
    }
    let extended = ExtendedPlant::new(&a, &b, &c, &faults, &[20.0, 21.0, 22.0])
        .expect("the design of the test exists");
    let output = h() * &c;
    let all = extended.plant.a.nrows();
    let order = all + faults.len();
    let observer: Vec<_> =
        [-4.0, -4.5, -5.0, -5.5, -6.0, -6.5, -7.0, -7.5].into_iter().take(order).collect();
    let feedback = real_poles(&[-1.0, -1.2, -1.4, -1.6, -1.8]);
    let (plant, poles, observer) = match domain {
        Domain::Continuous => (extended.plant.clone(), feedback, real_poles(&observer)),
        Domain::Sampled { period } => (
            sampled::sample(&extended, period).expect("the design of the test exists"),
            sampled::sampled_poles(&feedback, period).expect("the design of the test exists"),
            sampled::sampled_poles(&real_poles(&observer), period)
                .expect("the design of the test exists"),
        ),
    };
    let n = extended.states;
    let pair = (plant.a.view((0, 0), (n, n)).into_owned(), plant.b.rows(0, n).into_owned());
    let (a_e, b_e) =
        extended_pair(&pair.0, &pair.1, &output, domain).expect("the design of the test exists");
    let assign = if domain == Domain::Continuous { place } else { place_discrete };
    let k = assign(&a_e, &b_e, &poles).expect("the design of the test exists").gain;
    let (a_0, c_0) = (plant.augmented_dynamics(), plant.augmented_output());
    let output_matrix = estimator.output_matrix(&a_0, &c_0);
    let l = -assign(&a_0.transpose(), &output_matrix.transpose(), &observer)
        .expect("the design of the test exists")
        .gain
        .transpose();
    let mut sensed = DMatrix::zeros(2, faults.len());
    if sensor {
        sensed.set_column(1, &(h() * f_s));
    }
    let gains = Gains {
        estimator,
        k_x: k.columns(0, n).into_owned().resize_horizontally(all, 0.0),
        k_f: sampled::compensation_gain(&extended, domain).expect("the design of the test exists"),
        l_x: l.rows(0, all).into(),
        l_f: -l.rows(all, faults.len()),
        p_f: None,
        integral: Some(IntegralAction {
            h: h(),
            output: output.resize_horizontally(all, 0.0),
            faults: sensed,
            gain: k.columns(n, 2).into(),
        }),
    };
    let filter = sampled::filter(&extended, domain);
    Designed { extended, plant, gains, filter, domain, feedback: poles }
}

fn all_designs() -> Vec<Designed> {
    let sampled = Domain::Sampled { period: PERIOD };
    let kinds = [
        (Domain::Continuous, Estimator::Prediction),
        (sampled, Estimator::Prediction),
        (sampled, Estimator::Current),
    ];
    let both = kinds.into_iter().flat_map(|(domain, estimator)| {
        [false, true].map(|sensor| designed(domain, estimator, sensor))
    });
    both.collect()
}

/// The plant without filter, from [u; f] to y.
fn physical(designed: &Designed) -> StateSpace {
    let n = designed.extended.states;
    let (m, q) = (designed.plant.b.ncols(), designed.plant.f_a.ncols());
    let mut b = DMatrix::zeros(n, m + q);
    b.columns_mut(0, m).copy_from(&designed.plant.b.rows(0, n));
    b.columns_mut(m, q).copy_from(&designed.plant.f_a.rows(0, n));
    let c = plant()[2].clone();
    let mut d = DMatrix::zeros(c.nrows(), m + q);
    if q > 1 {
        d[(1, m + 1)] = 1.0;
    }
    StateSpace { a: designed.plant.a.view((0, 0), (n, n)).into(), b, c, d, domain: designed.domain }
}

/// The gain for constant signals.
fn at_constant_signals(system: &StateSpace) -> DMatrix<f64> {
    let n = system.a.nrows();
    let held = match system.domain {
        Domain::Continuous => 0.0,
        Domain::Sampled { .. } => 1.0,
    };
    let states = (DMatrix::identity(n, n) * held - &system.a)
        .lu()
        .solve(&system.b)
        .expect("the design of the test exists");
    &system.c * states + &system.d
}

/// The largest distance of a number from the nearest one of the other list.
fn distance(actual: &[Complex<f64>], expected: &[Complex<f64>]) -> f64 {
    assert_eq!(actual.len(), expected.len());
    let nearest = |one: &Complex<f64>| {
        expected.iter().map(|other| (other - one).norm()).fold(f64::INFINITY, f64::min)
    };
    actual.iter().map(nearest).fold(0.0, f64::max)
}

#[test]
fn the_loop_has_the_eigenvalues_of_feedback_with_integrals_observer_and_filter() {
    for design in all_designs() {
        let complete = complete_controller(
            &design.plant,
            &design.gains,
            design.filter.as_deref(),
            design.domain,
        )
        .unwrap();
        let whole = physical(&design);
        let m = design.plant.b.ncols();
        let alone = StateSpace {
            b: whole.b.columns(0, m).into(),
            d: DMatrix::zeros(whole.c.nrows(), m),
            ..whole
        };
        let computed = Loop::new(alone, complete.commands).unwrap().dynamics();
        let mut required = design.feedback.clone();
        required.extend(eigenvalues(&design.gains.error_dynamics(&design.plant)).unwrap());
        let filtered = design.filter.iter().flatten().map(|w| match design.domain {
            Domain::Continuous => Complex::new(-w, 0.0),
            Domain::Sampled { .. } => Complex::new(1.0 - w, 0.0),
        });
        required.extend(filtered);
        // A current estimator with a filter predicts y_f from x: no eigenvalue is lost.
        let computed = eigenvalues(&computed).unwrap();
        let away = distance(&required, &computed);
        assert!(away < 2e-4, "{:?} {:?} {away}", design.domain, design.gains.estimator);
    }
}

#[test]
fn the_loop_of_faults_and_errors_is_that_of_plant_and_complete_controller() {
    for design in all_designs() {
        let Designed { plant, gains, domain, .. } = &design;
        let complete =
            complete_controller(plant, gains, design.filter.as_deref(), *domain).unwrap();
        let control = &complete.commands;
        let whole = physical(&design);
        let (n, m, q) = (design.extended.states, plant.b.ncols(), plant.f_a.ncols());
        let (b, f) = (whole.b.columns(0, m).into_owned(), whole.b.columns(m, q).into_owned());
        let seen = whole.d.columns(m, q).into_owned();
        let k = control.a.nrows();
        // From f to [x; f_hat - f] with u = C z + D y, y = C x + F_s f.
        let mut a = DMatrix::zeros(n + k, n + k);
        a.view_mut((0, 0), (n, n)).copy_from(&(&whole.a + &b * &control.d * &whole.c));
        a.view_mut((0, n), (n, k)).copy_from(&(&b * &control.c));
        a.view_mut((n, 0), (k, n)).copy_from(&(&control.b * &whole.c));
        a.view_mut((n, n), (k, k)).copy_from(&control.a);
        let mut into = DMatrix::zeros(n + k, q);
        into.rows_mut(0, n).copy_from(&(&f + &b * &control.d * &seen));
        into.rows_mut(n, k).copy_from(&(&control.b * &seen));
        let mut c = DMatrix::zeros(n + q, n + k);
        c.view_mut((0, 0), (n, n)).fill_with_identity();
        c.view_mut((n, 0), (q, n)).copy_from(&(&complete.estimates.d * &whole.c));
        c.view_mut((n, n), (q, k)).copy_from(&complete.estimates.c);
        let mut d = DMatrix::zeros(n + q, q);
        d.rows_mut(n, q).copy_from(&(&complete.estimates.d * &seen - DMatrix::identity(q, q)));
        let expected = StateSpace { a, b: into, c, d, domain: *domain };
        let all = plant.a.nrows();
        let mut rows: Vec<_> = (0..n).collect();
        rows.extend(2 * all..2 * all + q);
        let mut computed = fault_system(plant, gains, *domain).unwrap();
        (computed.c, computed.d) = (computed.c.select_rows(&rows), computed.d.select_rows(&rows));
        let grid = [0.03, 0.3, 1.0, 3.0, 10.0];
        let responses =
            [&computed, &expected].map(|system| frequency_response(system, &grid).unwrap());
        for (computed, expected) in responses[0].iter().zip(&responses[1]) {
            let error = (&computed.gain - &expected.gain).norm();
            assert!(error < 1e-9 * expected.gain.norm(), "{domain:?} {error}");
        }
        // f' acts on the same loop.
        let rates = fault_rate_system(plant, gains, *domain).unwrap();
        assert!((rates.a - computed.a).amax() <= 0.0);
    }
}

#[test]
fn with_one_part_the_bounds_between_samples_are_those_of_the_samples() {
    for design in all_designs().into_iter().filter(|design| design.domain != Domain::Continuous) {
        let Designed { plant, gains, extended, domain, .. } = &design;
        let rows: Vec<_> = (0..2 * plant.f_a.nrows() + plant.f_a.ncols()).collect();
        let closed = SampledLoop { extended, plant, gains, period: PERIOD };
        let [of_faults, ..] = gains_between_samples(&closed, 1, &rows, 1e-4).unwrap();
        let at_samples =
            peak_gain(&fault_system(plant, gains, *domain).unwrap(), 1e-4).unwrap().upper;
        for (computed, expected) in of_faults.iter().zip(at_samples.iter()) {
            assert!(
                (computed - expected).abs() < 1e-3 * expected.max(1e-6),
                "{computed} {expected}"
            );
        }
    }
}

#[test]
fn a_constant_sensor_fault_and_a_constant_actuator_fault_leave_no_error_of_the_reference() {
    for design in all_designs() {
        let system = fault_system(&design.plant, &design.gains, design.domain).unwrap();
        let n = design.extended.states;
        let tracked = h() * &plant()[2] * at_constant_signals(&system).rows(0, n);
        assert!(tracked.amax() < 1e-10, "{tracked}");
    }
}

#[test]
fn the_extended_plant_of_one_state_has_the_printed_matrices() {
    let (a_e, b_e) = extended_pair(&one(-2.0), &one(3.0), &one(5.0), Domain::Continuous).unwrap();
    assert_eq!(a_e, matrix(2, &[-2.0, 0.0, -5.0, 0.0]));
    assert_eq!(b_e, matrix(2, &[3.0, 0.0]));
    let domain = Domain::Sampled { period: 0.25 };
    let (a_e, _) = extended_pair(&one(-2.0), &one(3.0), &one(5.0), domain).unwrap();
    assert_eq!(a_e, matrix(2, &[-2.0, 0.0, -1.25, 1.0]));
}

#[test]
fn the_feedforward_of_one_state_is_its_closed_form() {
    // x' = a x + b u, u = k x + n r, y = c x: n = -(a + b k) / (b c).
    let (a, b, c, k) = (0.5, 3.0, 2.0, -1.0);
    let computed = feedforward(&one(a), &one(b), &one(c), &one(k), Domain::Continuous).unwrap();
    assert!((computed[(0, 0)] + (a + b * k) / (b * c)).abs() < 1e-15);
    let domain = Domain::Sampled { period: 0.1 };
    let computed = feedforward(&one(a), &one(b), &one(c), &one(0.1), domain).unwrap();
    assert!((computed[(0, 0)] - (1.0 - a - b * 0.1) / (b * c)).abs() < 1e-15);
}

/// A reference in a thousandth of its unit has a thousandth of the gain.
#[test]
fn the_feedforward_of_references_in_very_different_units_is_the_same() {
    let [a, b, c] = plant();
    let (output, k) = (h() * c, -DMatrix::identity(2, 3) * 0.3);
    let expected = feedforward(&a, &b, &output, &k, Domain::Continuous).unwrap();
    for unit in [1e3, 1e5, 1e9] {
        let units = DMatrix::from_diagonal(&DVector::from_vec(vec![unit, 1.0 / unit]));
        let computed = feedforward(&a, &b, &(&units * &output), &k, Domain::Continuous).unwrap();
        assert!((computed * units - &expected).amax() < 1e-13, "{unit}");
    }
}

#[test]
fn a_feedforward_for_which_a_state_overflows_is_refused() {
    // r_1 = 1 needs u_1 = 1e10, which leads x_2 to 1e310.
    let a = DMatrix::from_diagonal(&DVector::from_vec(vec![-1.0, -1e-300, -1.0]));
    let b = matrix(3, &[1.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let output = matrix(2, &[1e-10, 0.0, 0.0, 0.0, 0.0, 1.0]);
    let refused = feedforward(&a, &b, &output, &DMatrix::zeros(2, 3), Domain::Continuous);
    assert!(matches!(refused, Err(Error::Overflow { .. })), "{refused:?}");
}

#[test]
fn references_are_reached_without_error_by_both_actions() {
    let [a, b, c] = plant();
    let output = h() * &c;
    let k = -DMatrix::identity(2, 3) * 0.3;
    let n_r = feedforward(&a, &b, &output, &k, Domain::Continuous).unwrap();
    let (a_e, b_e) = extended_pair(&a, &b, &output, Domain::Continuous).unwrap();
    let whole = place(&a_e, &b_e, &real_poles(&[-1.0, -1.2, -1.4, -1.6, -1.8])).unwrap().gain;
    let (k_x, k_i) = (whole.columns(0, 3).into_owned(), whole.columns(3, 2).into_owned());
    let integral = Action::Integral { output: &output, gain: &k_i, feedforward: None };
    for (k_x, action) in [(&k, Action::Feedforward(&n_r)), (&k_x, integral)] {
        let design = reference_system(&a, &b, k_x, &action, Domain::Continuous).unwrap();
        let computed = at_constant_signals(&design);
        let error = &output * computed.rows(0, 3) - DMatrix::identity(2, 2);
        assert!(error.amax() < 1e-13, "{error}");
        // The commands hold the plant there: A x + B u = 0.
        assert!((&a * computed.rows(0, 3) + &b * computed.rows(3, 2)).amax() < 1e-13);
    }
}

#[test]
fn constant_references_need_commands_independent_outputs_and_no_zero_at_the_origin() {
    let [a, b, c] = plant();
    let full = tracking_rank(&a, &b, &(h() * &c)).unwrap();
    assert!(full.is_full() && full.rank == 5 && full.outputs == 2);
    let many = tracking_rank(&a, &b.columns(0, 1).into(), &(h() * &c)).unwrap();
    assert_eq!((many.rank, many.expected), (4, 5));
    let twice = matrix(2, &[1.0, 2.0, 0.0, 2.0, 4.0, 0.0]);
    assert_eq!(tracking_rank(&a, &b, &twice).unwrap().outputs, 1);
    // s / (s^2 + 3 s + 2), with states in very different units.
    let [a, b] = [matrix(2, &[0.0, 1e-6, -2e6, -3.0]), matrix(2, &[0.0, 1e6])];
    let zero = tracking_rank(&a, &b, &matrix(1, &[0.0, 1e-6])).unwrap();
    assert_eq!((zero.rank, zero.expected, zero.outputs), (2, 3, 1));
    // In any unit of the measurement.
    for unit in [1e-200, 1.0, 1e200] {
        let full = tracking_rank(&a, &b, &matrix(1, &[unit, 0.0])).unwrap();
        assert_eq!((full.rank, full.outputs), (3, 1), "{unit:e}");
    }
}

#[test]
fn back_calculation_lets_the_integrals_follow_in_any_units_and_with_any_commands_at_a_limit() {
    let k_i = matrix(3, &[1.0, 0.2, -0.4, 3.0, 0.7, 0.6]);
    let ranges = [Some(2.0), Some(0.5), None];
    let rate = 4.0;
    let l_w = windup_gain(&k_i, &ranges, rate, Domain::Continuous).unwrap();
    assert!(l_w.column(2).amax() <= 0.0);
    for limited in 0..4_u32 {
        let s = DMatrix::from_fn(3, 3, |i, j| {
            f64::from(u8::from(i == j && i < 2 && limited & (1 << i) != 0))
        });
        let matrix = -(&l_w * s * &k_i);
        for value in eigenvalues(&matrix).unwrap() {
            assert!(value.im.abs() < 1e-12 && value.re < 1e-12 && value.re > -rate - 1e-12);
        }
        if limited == 3 {
            assert!((matrix + DMatrix::identity(2, 2) * rate).amax() < 1e-12);
        }
    }
    // Commands in thousandths: K_i and ranges grow, the effect of a command shrinks.
    let scale = DMatrix::from_diagonal(&DVector::from_vec(vec![1e3, 1.0, 1.0]));
    let scaled =
        windup_gain(&(&scale * &k_i), &[Some(2e3), Some(0.5), None], rate, Domain::Continuous);
    assert!((scaled.unwrap() * scale - &l_w).amax() < 1e-12);
    let sampled = windup_gain(&k_i, &ranges, rate, Domain::Sampled { period: 0.1 }).unwrap();
    assert!((sampled * rate - l_w * (1.0 - (-0.4_f64).exp())).amax() < 1e-12);
}

#[test]
fn feedforward_beside_integrals_leaves_the_slowest_modes_at_rest_and_the_constant_error_at_zero() {
    let [a, b, c] = plant();
    let output = h() * c;
    for domain in [Domain::Continuous, Domain::Sampled { period: PERIOD }] {
        let poles = real_poles(&[-1.0, -1.2, -3.0, -3.3, -3.6]);
        let (design, poles) = match domain {
            Domain::Continuous => ((a.clone(), b.clone()), poles),
            Domain::Sampled { period } => (
                control::hold::zero_order_hold(&a, &b, period).unwrap(),
                sampled::sampled_poles(&poles, period).unwrap(),
            ),
        };
        let (a_e, b_e) = extended_pair(&design.0, &design.1, &output, domain).unwrap();
        let assign = if domain == Domain::Continuous { place } else { place_discrete };
        let k = assign(&a_e, &b_e, &poles).unwrap().gain;
        let computed =
            integral_feedforward(&design.0, &design.1, &output, &k, domain).unwrap().unwrap();
        let (k_x, k_i) = (k.columns(0, 3).into_owned(), k.columns(3, 2).into_owned());
        let action =
            Action::Integral { output: &output, gain: &k_i, feedforward: Some(&computed.gain) };
        let system = reference_system(&design.0, &design.1, &k_x, &action, domain).unwrap();
        // The constant response: H C x = r.
        let at_rest = match domain {
            Domain::Continuous => -&system.a,
            Domain::Sampled { .. } => DMatrix::identity(5, 5) - &system.a,
        };
        let constant = at_rest.lu().solve(&system.b).unwrap();
        let error = &output * constant.rows(0, 3) - DMatrix::identity(2, 2);
        assert!(error.amax() < 1e-9, "{error}");
        // (A_cl - s_1)(A_cl - s_2) removes the silent modes: the references reach three directions only.
        let reached = DMatrix::from_fn(5, 10, |i, j| {
            let power = (0..j / 2).fold(system.b.clone(), |v, _| &system.a * v);
            power[(i, j % 2)]
        });
        let values = reached.clone().svd(false, false).singular_values;
        assert!(values[3] < 1e-9 * values[0] && values[2] > 1e-6 * values[0], "{values}");
        let slow: Vec<_> = poles.iter().take(2).map(|value| value.re).collect();
        for value in &computed.silent {
            assert!(slow.iter().any(|design| (design - value.re).abs() < 1e-7), "{value}");
        }
    }
}

#[test]
fn a_slow_mode_that_no_command_moves_leaves_the_feedforward_beside_integrals_as_it_is() {
    let [a, b, c] = plant();
    let poles = real_poles(&[-1.0, -1.2, -3.0, -3.3, -3.6]);
    let output = h() * c;
    let (a_e, b_e) = extended_pair(&a, &b, &output, Domain::Continuous).unwrap();
    let k = place(&a_e, &b_e, &poles).unwrap().gain;
    let alone = integral_feedforward(&a, &b, &output, &k, Domain::Continuous).unwrap().unwrap();
    // A fourth state x_4' = -0.1 x_4 moves the others, the controlled outputs and the commands.
    let mut wide = a.resize(4, 4, 0.0);
    wide.view_mut((0, 3), (3, 1)).copy_from(&matrix(3, &[1.0, -2.0, 0.5]));
    wide[(3, 3)] = -0.1;
    let commands = b.ncols();
    let b = b.resize(4, commands, 0.0);
    let output = output.insert_column(3, 0.7);
    let k = k.insert_column(3, -0.4);
    // Other coordinates x = M z, so that the mode is in every state.
    let m = matrix(4, &[2., 1., 0., 1., 0., 1., 1., 0., 1., 0., 3., 1., 1., 0., 0., 1.]);
    let inverse = m.clone().try_inverse().unwrap();
    let (wide, b, output) = (&inverse * wide * &m, &inverse * b, output * &m);
    let k_x = k.columns(0, 4) * &m;
    let k = DMatrix::from_fn(k.nrows(), 6, |i, j| if j < 4 { k_x[(i, j)] } else { k[(i, j)] });
    let computed =
        integral_feedforward(&wide, &b, &output, &k, Domain::Continuous).unwrap().unwrap();
    assert!((&computed.gain - &alone.gain).amax() < 1e-9 * alone.gain.amax(), "{}", computed.gain);
    assert!(computed.silent.iter().all(|value| value.re < -0.9), "{:?}", computed.silent);
}

#[test]
fn half_of_a_pair_is_no_silent_mode_and_a_faster_one_does_not_take_its_place() {
    // One state, one integral, two complex eigenvalues.
    let k = matrix(1, &[-1.0, 4.0]);
    let computed = integral_feedforward(&one(-1.0), &one(1.0), &one(1.0), &k, Domain::Continuous);
    assert!(computed.unwrap().unwrap_err().contains("half of a complex pair"));
    // x'' = u with the eigenvalues -1 ± i and -3, of which the real one is the fastest.
    let [a, b, output] = double_integrator();
    let k = matrix(1, &[-8.0, -5.0, 6.0]);
    let computed = integral_feedforward(&a, &b, &output, &k, Domain::Continuous);
    assert!(computed.unwrap().unwrap_err().contains("half of a complex pair"));
    // With -0.5 in place of -3 the real one is the slowest: N_r = -W_i / (W_x' B) by its left eigenvector.
    let k = matrix(1, &[-3.0, -2.5, 1.0]);
    let computed = integral_feedforward(&a, &b, &output, &k, Domain::Continuous).unwrap().unwrap();
    // s^3 + 2.5 s^2 + 3 s + 1 over s + 0.5: (s^2 + 2 s + 2); x = y responds by 2 / (s^2 + 2 s + 2).
    assert!((computed.silent[0].re + 0.5).abs() < 1e-12 && computed.silent.len() == 1);
    assert!((computed.gain[(0, 0)] - 2.0).abs() < 1e-12, "{}", computed.gain);
}

/// x' = -(p + q) x + p q x_i + N_r r, x_i' = r - x: x = (p q + N_r s) / ((s + p) (s + q)) r lacks -p for N_r = q. Of
/// whole numbers some eigenvalues are exact.
#[test]
fn an_exact_eigenvalue_is_silent_too() {
    for (p, q) in (1..9).flat_map(|p| (p + 1..10).map(move |q| (f64::from(p), f64::from(q)))) {
        let k = matrix(1, &[-p - q, p * q]);
        let domain = Domain::Continuous;
        let computed = integral_feedforward(&one(0.0), &one(1.0), &one(1.0), &k, domain);
        let computed = computed.unwrap().unwrap();
        assert!((computed.gain[(0, 0)] / q - 1.0).abs() < 1e-10, "{p} {q}: {}", computed.gain);
        assert!((computed.silent[0].re / p + 1.0).abs() < 1e-10 && computed.silent.len() == 1);
    }
}

fn double_integrator() -> [DMatrix<f64>; 3] {
    [matrix(2, &[0.0, 1.0, 0.0, 0.0]), matrix(2, &[0.0, 1.0]), matrix(1, &[1.0, 0.0])]
}

const SAMPLED: Domain = Domain::Sampled { period: 1.0 };

/// The back-calculations of two K_i with the same ranges and the factor f, in continuous time the rate.
fn calculations(
    k: [&DMatrix<f64>; 2],
    ranges: &[Option<f64>],
    f: f64,
    domain: Domain,
) -> Result<([DMatrix<f64>; 2], InterpolatedWindup), Error> {
    let rate = if domain == SAMPLED { -(1.0 - f).ln() } else { f };
    let gain = |k| windup_gain(k, ranges, rate, domain);
    let l = [gain(k[0])?, gain(k[1])?];
    let windup = interpolated_windup(k, [&l[0], &l[1]], ranges, domain)?;
    Ok((l, windup))
}

/// The largest modulus of the eigenvalues of I - L_w S K_i on the way, less 1; in continuous time the largest
/// real part of those of -L_w S K_i.
fn excess(
    k: [&DMatrix<f64>; 2],
    l: &[DMatrix<f64>; 2],
    set: &[usize],
    (s, domain): (f64, Domain),
) -> f64 {
    let k = (k[0] * (1.0 - s) + k[1] * s).select_rows(set);
    let l = (&l[0] * (1.0 - s) + &l[1] * s).select_columns(set);
    let dynamics = -(l * k);
    if domain == SAMPLED {
        let dynamics = DMatrix::identity(dynamics.nrows(), dynamics.nrows()) + dynamics;
        return dynamics.complex_eigenvalues().iter().map(|value| value.norm()).fold(0.0, f64::max)
            - 1.0;
    }
    dynamics.complex_eigenvalues().iter().map(|value| value.re).fold(f64::NEG_INFINITY, f64::max)
}

#[test]
fn an_interpolated_back_calculation_is_stable_where_the_eigenvalues_are_and_for_no_other() {
    stable_where_the_eigenvalues_are(SAMPLED);
}

#[test]
fn a_continuous_one_too() {
    stable_where_the_eigenvalues_are(Domain::Continuous);
}

fn stable_where_the_eigenvalues_are(domain: Domain) {
    // 400 random pairs of K_i: 1 to 3 commands with and without limits, 1 or 2 integrals.
    let mut numbers = Numbers(7);
    let mut counts = [0; 3];
    for case in 0..400 {
        let (m, t) = [(1, 1), (2, 1), (2, 2), (3, 1), (3, 2)][case % 5];
        let k_0 = DMatrix::from_fn(m, t, |_, _| numbers.next() - 0.5);
        let change = 1.6 * numbers.next();
        let k_1 = &k_0 + DMatrix::from_fn(m, t, |_, _| change * (numbers.next() - 0.5));
        let ranges: Vec<_> =
            (0..m).map(|_| (numbers.next() < 0.8).then(|| 0.2 + 3.0 * numbers.next())).collect();
        let k = [&k_0, &k_1];
        let outcome = calculations(k, &ranges, 0.05 + 0.9 * numbers.next(), domain);
        let (l, windup) = outcome.expect("gains of small matrices");
        match windup {
            InterpolatedWindup::Stable => {
                let limited: Vec<_> = (0..m).filter(|&j| ranges[j].is_some()).collect();
                for bits in 1_usize..1 << limited.len() {
                    let set: Vec<_> = (0..limited.len()).filter(|j| bits >> j & 1 == 1).collect();
                    let set: Vec<_> = set.into_iter().map(|j| limited[j]).collect();
                    for step in 0..=50 {
                        let at = (f64::from(step) / 50.0, domain);
                        assert!(excess(k, &l, &set, at) < 1e-9);
                    }
                }
                counts[0] += 1;
            }
            InterpolatedWindup::Unstable { part, limited, instability } => {
                let growth = excess(k, &l, &limited, (part, domain));
                assert!((growth - instability).abs() < 1e-9 * (1.0 + growth) && growth > 1e-10);
                counts[1] += 1;
            }
            InterpolatedWindup::Undecided { limited } => {
                // K_i of these commands passes zero: an eigenvalue is near the stability limit.
                let at = |step: i32| (f64::from(step) / 1e3, domain);
                let steps = (0..=1000).map(|step| excess(k, &l, &limited, at(step)));
                assert!(steps.fold(f64::NEG_INFINITY, f64::max).abs() < 1e-3);
                counts[2] += 1;
            }
        }
    }
    assert!(counts[0] > 40 && counts[1] > 40 && counts[2] < 20, "{counts:?}");
}

#[test]
fn commands_in_one_direction_and_commands_without_integral_do_not_hinder_the_proof() {
    // The second command is twice the first, the third has no part of the integrals.
    let k_0 = matrix(3, &[1.0, 0.5, 2.0, 1.0, 0.0, 0.0]);
    let k_1 = matrix(3, &[1.2, 0.5, 2.4, 1.0, 0.0, 0.0]);
    let ranges = [Some(1.0), Some(2.0), Some(1.0)];
    for domain in [SAMPLED, Domain::Continuous] {
        let (_, computed) = calculations([&k_0, &k_1], &ranges, 0.3, domain).unwrap();
        assert_eq!(computed, InterpolatedWindup::Stable);
    }
    // Half of the way K_i is zero, and L_w is not.
    let (_, computed) = calculations([&one(1.0), &one(-1.0)], &[Some(1.0)], 0.3, SAMPLED).unwrap();
    assert!(matches!(computed, InterpolatedWindup::Undecided { .. }), "{computed:?}");
    // K_i changes by a factor of 100: near the middle L_w K_i = f 101^2 / 400 > 2.
    let far = [&one(1.0), &one(100.0)];
    let (_, computed) = calculations(far, &[Some(1.0)], 0.3, SAMPLED).unwrap();
    assert!(matches!(computed, InterpolatedWindup::Unstable { .. }), "{computed:?}");
    // In continuous time this is only fast.
    let (_, computed) = calculations(far, &[Some(1.0)], 0.3, Domain::Continuous).unwrap();
    assert_eq!(computed, InterpolatedWindup::Stable);
    let many = DMatrix::from_element(11, 1, 1.0);
    let (_, computed) = calculations([&many, &many], &[Some(1.0); 11], 0.3, SAMPLED).unwrap();
    assert!(matches!(computed, InterpolatedWindup::Undecided { limited } if limited.len() == 11));
}

/// Reproducible numbers between 0 and 1.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        u32::try_from(self.0 >> 32).map_or(0.0, f64::from) / f64::from(u32::MAX)
    }
}
