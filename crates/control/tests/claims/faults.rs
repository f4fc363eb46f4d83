//! Each fault model in a closed loop: the user's plant, the filter and the controller as one linear
//! system, written out here and advanced exactly. The observer uses only u and y.

use crate::data::reference;
use crate::matrix;
use crate::paper::{CONTROLLER_POLES, plant};
use control::StateSpace;
use control::aso::{AsoDesign, Estimator, FaultyPlant, Gains};
use control::controller::controller;
use control::faults::{ExtendedPlant, Fault, FaultEntry, FaultKind};
use control::hold::FirstOrderHold;
use control::losses::{estimated_loss, loss_tolerance};
use control::placement::real_poles;
use control::{Domain, Error};
use nalgebra::{DMatrix, DVector};

/// Two carts joined by a spring on an unstable slope, a force on each, both positions measured.
struct Carts {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
}

const CARTS: [f64; 4] = [-1.0, -1.5, -2.0, -2.5];

fn carts() -> Carts {
    Carts { a: reference("loss_a"), b: reference("loss_b"), c: DMatrix::identity(2, 4) }
}

fn poles(count: usize) -> Vec<f64> {
    (6..).take(count).map(|rate: i32| -f64::from(rate)).collect()
}

fn fault(entry: FaultEntry, kind: FaultKind) -> Fault {
    Fault { entry, kind }
}

fn column(entries: &[f64]) -> DVector<f64> {
    DVector::from_column_slice(entries)
}

/// x' = A x + B diag(effect) u + `F_a` f, y = C x + `F_s` f, and `r` added to u.
struct Truth<'a> {
    carts: &'a Carts,
    f_a: DMatrix<f64>,
    f_s: DMatrix<f64>,
    effect: [f64; 2],
}

/// A linear system, its inputs [f; r] and the position of the controller's states in it.
struct Loop {
    dynamics: DMatrix<f64>,
    inputs: DMatrix<f64>,
    controller: StateSpace,
    before: usize,
}

impl Truth<'_> {
    /// [x; `y_f`; `x_hat`; `f_hat`]'.
    fn close(&self, extended: &ExtendedPlant, gains: &Gains) -> Loop {
        let Carts { a, b, c } = self.carts;
        let (n, faults) = (4, self.f_a.ncols());
        let w = DMatrix::from_diagonal(&column(extended.filter.as_deref().unwrap_or(&[])));
        let p = w.nrows();
        let controller =
            controller(&extended.plant, gains, Domain::Continuous).expect("gains that fit");
        let (order, before) = (controller.a.nrows(), n + p);
        let left = b * DMatrix::from_diagonal(&column(&self.effect));
        let mut dynamics = DMatrix::zeros(before + order, before + order);
        let mut put = |at: (usize, usize), block: &DMatrix<f64>| {
            dynamics.view_mut(at, block.shape()).copy_from(block);
        };
        put((0, 0), a);
        put((0, before), &(&left * &controller.c));
        put((before, before), &controller.a);
        let mut inputs = DMatrix::zeros(before + order, faults + 2);
        inputs.view_mut((0, 0), (n, faults)).copy_from(&self.f_a);
        inputs.view_mut((0, faults), (n, 2)).copy_from(&left);
        inputs.view_mut((before, faults), (n, 2)).copy_from(b);
        if p > 0 {
            put((n, 0), &(&w * c));
            put((n, n), &-&w);
            put((before, n), &controller.b);
            inputs.view_mut((n, 0), (p, faults)).copy_from(&(&w * &self.f_s));
        } else {
            put((before, 0), &(&controller.b * c));
        }
        Loop { dynamics, inputs, controller, before }
    }

    /// Returns `f_hat` and u at the end, for f = f0 + f1 t and a constant r, by exact steps.
    fn run(
        &self,
        extended: &ExtendedPlant,
        gains: &Gains,
        (f0, f1): (&[f64], &[f64]),
        r: [f64; 2],
        seconds: u32,
    ) -> (Vec<f64>, Vec<f64>) {
        let closed = self.close(extended, gains);
        let h = 1.0 / 64.0;
        let hold = FirstOrderHold::new(&closed.dynamics, &closed.inputs, h).expect("a hold");
        let mut x = vec![0.0; closed.dynamics.nrows()];
        x[0] = 0.1;
        let slopes: Vec<f64> = f1.iter().copied().chain([0.0; 2]).collect();
        for step in 0..64 * seconds {
            let t = h * f64::from(step);
            let faults = f0.iter().zip(f1).map(|(f, slope)| f + slope * t);
            let start: Vec<f64> = faults.chain(r).collect();
            let mut next = vec![0.0; x.len()];
            hold.step_into(&x, &start, &slopes, &mut next).expect("lengths that fit");
            x = next;
        }
        let u = &closed.controller.c * column(&x[closed.before..]) + column(&r);
        (x[x.len() - extended.plant.f_a.ncols()..].to_vec(), u.as_slice().to_vec())
    }
}

/// The remaining error after `seconds` of the slowest mode e^(-6 t), at a condition number up to
/// 1e7.
fn modal_bound(design: &AsoDesign, seconds: f64, size: f64) -> f64 {
    assert!(design.observer.condition < 1e7, "{:?}", design.observer);
    design.observer.condition * (-6.0 * seconds).exp() * size + 1e-11 * size
}

fn built(faults: &[Fault]) -> (Carts, ExtendedPlant, AsoDesign) {
    let carts = carts();
    let measured = faults.iter().any(|fault| fault.entry.is_measured());
    let filter: &[f64] = if measured { &[30.0, 40.0] } else { &[] };
    let extended =
        ExtendedPlant::new(&carts.a, &carts.b, &carts.c, faults, filter).expect("shapes that fit");
    let order = extended.plant.a.nrows() + extended.plant.f_a.ncols();
    let design =
        extended.design(&real_poles(&CARTS), &real_poles(&poles(order)), None).expect("a design");
    (carts, extended, design)
}

#[test]
fn two_constant_actuator_faults_at_once_are_estimated() {
    let f_a = matrix(4, 2, &[0., 0., 0., 0., 1., 0.5, 0., -1.]);
    let enters = |at: usize| FaultEntry::Actuator(f_a.column(at).into());
    let faults = [fault(enters(0), FaultKind::Constant), fault(enters(1), FaultKind::Constant)];
    let (carts, extended, design) = built(&faults);
    assert!(extended.filter.is_none() && design.cancellation_residual < 1e-15);
    let truth = Truth { carts: &carts, f_a, f_s: DMatrix::zeros(2, 2), effect: [1.0; 2] };
    let (f_hat, _) = truth.run(&extended, &design.gains, (&[2.0, -3.0], &[0.0; 2]), [0.0; 2], 10);
    let bound = modal_bound(&design, 10.0, 4.0);
    for (actual, expected) in f_hat.iter().zip([2.0, -3.0]) {
        assert!((actual - expected).abs() < bound, "{f_hat:?} {bound:e}");
    }
}

/// The observer for constant faults lags behind a ramp; the observer for ramps does not.
#[test]
fn a_ramp_is_followed_without_a_lag_by_the_model_of_a_ramp_only() {
    let force = || FaultEntry::Actuator(column(&[0., 0., 1., 0.]));
    let run = |kind: FaultKind| {
        let (carts, extended, design) = built(&[fault(force(), kind)]);
        let f_a = matrix(4, 1, &[0., 0., 1., 0.]);
        let truth = Truth { carts: &carts, f_a, f_s: DMatrix::zeros(2, 1), effect: [1.0; 2] };
        let (f_hat, _) = truth.run(&extended, &design.gains, (&[1.0], &[0.5]), [0.0; 2], 10);
        (f_hat, modal_bound(&design, 10.0, 6.0), extended.channels[0])
    };
    let (f_hat, bound, channel) = run(FaultKind::Ramp);
    assert!((f_hat[channel.estimate] - 6.0).abs() < bound, "{f_hat:?} {bound:e}");
    assert!((f_hat[channel.rate.unwrap()] - 0.5).abs() < bound, "{f_hat:?}");
    let (f_hat, ..) = run(FaultKind::Constant);
    assert!((f_hat[0] - 6.0).abs() > 0.1, "{f_hat:?}");
}

#[test]
fn sensor_faults_constant_and_ramp_are_estimated_beside_an_actuator_fault() {
    for kind in [FaultKind::Constant, FaultKind::Ramp] {
        let slope = if kind == FaultKind::Ramp { -0.02 } else { 0.0 };
        let sensor = fault(FaultEntry::Sensor(column(&[1.0, 0.0])), kind);
        let force = fault(FaultEntry::Actuator(column(&[0., 0., 0., 1.])), FaultKind::Constant);
        let (carts, extended, design) = built(&[sensor, force]);
        assert_eq!((extended.plant.a.nrows(), extended.states), (6, 4));
        let f_a = matrix(4, 2, &[0., 0., 0., 0., 0., 0., 0., 1.]);
        let f_s = matrix(2, 2, &[1., 0., 0., 0.]);
        let truth = Truth { carts: &carts, f_a, f_s, effect: [1.0; 2] };
        let (f_hat, _) =
            truth.run(&extended, &design.gains, (&[0.3, -1.0], &[slope, 0.0]), [0.0; 2], 10);
        let bound = modal_bound(&design, 10.0, 1.5);
        let actual = (f_hat[0], f_hat[1]);
        assert!((actual.0 - (0.3 + 10.0 * slope)).abs() < bound, "{f_hat:?} {bound:e}");
        assert!((actual.1 + 1.0).abs() < bound, "{f_hat:?} {bound:e}");
    }
}

#[test]
fn the_compensation_ignores_sensor_faults_and_rates_and_restores_lost_effect() {
    let loss = fault(FaultEntry::LossOfEffectiveness(1), FaultKind::Ramp);
    let sensor = fault(FaultEntry::Sensor(column(&[1.0, 0.0])), FaultKind::Constant);
    let (_, extended, design) = built(&[loss, sensor]);
    let expected = matrix(2, 3, &[0., 0., 0., -1., 0., 0.]);
    assert!((&design.gains.k_f - expected).amax() < 1e-15, "{}", design.gains.k_f);
    assert!(design.gains.k_x.columns(4, 2).amax() <= 0.0);
    assert_eq!((extended.channels[0].rate, extended.channels[1].rate), (Some(2), None));
}

/// Input 1 has lost 30 %, input 2 10 %; a constant command excites both.
#[test]
fn the_loss_of_effectiveness_is_estimated_where_the_command_shows_it() {
    let loss = |input| fault(FaultEntry::LossOfEffectiveness(input), FaultKind::Constant);
    let (carts, extended, design) = built(&[loss(0), loss(1)]);
    let nothing = (DMatrix::zeros(4, 2), DMatrix::zeros(2, 2));
    let truth = Truth { carts: &carts, f_a: nothing.0, f_s: nothing.1, effect: [0.7, 0.9] };
    let (f_hat, u) = truth.run(&extended, &design.gains, (&[0.0; 2], &[0.0; 2]), [3.0, -4.0], 60);
    for (at, expected) in [0.3, 0.1].into_iter().enumerate() {
        let actual = estimated_loss(u[at], f_hat[at], 1e-4 * u[at].abs()).unwrap();
        assert!((actual - expected).abs() < 1e-7, "{actual} {u:?} {f_hat:?}");
    }
    assert!(estimated_loss(1e-6, -0.5, 1.0).unwrap().abs() < 1e-6);
    assert!(matches!(estimated_loss(1.0, 1.0, 0.0), Err(Error::OutOfRange { name: "u_e", .. })));
}

/// The gains are from `place_poles`, the limits from brentq.
#[test]
fn the_loss_that_a_loop_survives_is_that_of_scipy() {
    let Carts { a, b, c } = carts();
    let plant = FaultyPlant::with_constant_faults(a, b.clone(), c, b);
    let gains = Gains {
        estimator: Estimator::Prediction,
        k_x: reference("loss_k_x"),
        k_f: -DMatrix::identity(2, 2),
        l_x: reference("loss_l_x"),
        l_f: reference("loss_l_f"),
        p_f: None,
        integral: None,
    };
    let controller = controller(&plant, &gains, Domain::Continuous).unwrap();
    let actual = loss_tolerance(&plant, &controller, &[0, 1], 1.0).unwrap();
    let expected = reference("loss_limits");
    let limits = [actual.common, actual.single[0], actual.single[1]];
    for (limit, expected) in limits.iter().zip(expected.iter()) {
        assert!((limit - expected).abs() < 1e-9, "{actual:?} {expected}");
    }
    assert!(actual.worst_instability > 0.0);
    let small = loss_tolerance(&plant, &controller, &[0, 1], 0.3).unwrap();
    assert!(small.worst_instability < 0.0 && (small.common - 0.3).abs() < 1e-15, "{small:?}");
}

/// The same with the loop written in Python as one step of the algorithm.
#[test]
fn the_loss_that_a_sampled_loop_survives_is_that_of_scipy() {
    let of = |part: &str| reference(&format!("sampled_loss_{part}"));
    let plant = FaultyPlant {
        a: of("a"),
        b: of("b"),
        c: DMatrix::identity(2, 4),
        f_a: of("b"),
        a_f: DMatrix::identity(2, 2),
    };
    let gains = Gains {
        estimator: Estimator::Current,
        k_x: of("k_x"),
        k_f: -DMatrix::identity(2, 2),
        l_x: of("m_x"),
        l_f: of("m_f"),
        p_f: None,
        integral: None,
    };
    let controller = controller(&plant, &gains, Domain::Sampled { period: 0.1 }).unwrap();
    let actual = loss_tolerance(&plant, &controller, &[0, 1], 1.0).unwrap();
    let limits = [actual.common, actual.single[0], actual.single[1]];
    for (limit, expected) in limits.iter().zip(of("limits").iter()) {
        assert!((limit - expected).abs() < 1e-9, "{actual:?} {expected}");
    }
}

/// With a single measurement of the position, its bias cannot be distinguished from another
/// position, because a cart can rest at any position.
#[test]
fn the_bias_of_a_position_without_another_measurement_of_it_is_refused() {
    let FaultyPlant { a, b, c, .. } = plant();
    let bias = fault(FaultEntry::Sensor(column(&[1.0, 0.0])), FaultKind::Constant);
    let extended = ExtendedPlant::new(&a, &b, &c, &[bias], &[100.0, 100.0]).unwrap();
    let refused =
        extended.design(&real_poles(&CONTROLLER_POLES), &real_poles(&poles(7)), None).unwrap_err();
    assert!(matches!(&refused, Error::HiddenFault { faults, .. } if *faults == [1]), "{refused:?}");
}

#[test]
fn bad_faults_are_refused_by_name() {
    let Carts { a, b, c } = carts();
    let build = |entry: FaultEntry, filter: &[f64]| {
        ExtendedPlant::new(&a, &b, &c, &[fault(entry, FaultKind::Constant)], filter).unwrap_err()
    };
    let short = column(&[1.0]);
    let message = build(FaultEntry::Actuator(short.clone()), &[]).to_string();
    assert_eq!(message, "a column of F_a is 1x1, expected 4x1");
    let message = build(FaultEntry::Sensor(short), &[]).to_string();
    assert_eq!(message, "a column of F_s is 1x1, expected 2x1");
    let message = build(FaultEntry::Sensor(column(&[1.0, 0.0])), &[]).to_string();
    assert_eq!(message, "W is 0x1, expected 2x1");
    let refused = build(FaultEntry::Sensor(column(&[1.0, 0.0])), &[10.0, -1.0]);
    assert!(matches!(refused, Error::OutOfRange { value: -1.0, .. }), "{refused:?}");
    let refused = build(FaultEntry::LossOfEffectiveness(2), &[]);
    assert!(matches!(refused, Error::OutOfRange { value: 2.0, .. }), "{refused:?}");
    let refused = ExtendedPlant::new(&a, &b, &c, &[], &[]).unwrap().plant.check().unwrap_err();
    assert!(matches!(refused, Error::Empty { matrix: "F_a", .. }), "{refused:?}");
}
