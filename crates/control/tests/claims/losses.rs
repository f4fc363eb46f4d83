//! Loops whose actuators lose effectiveness: proofs, their limits, and simulations that the proofs cover.

use crate::data::reference;
use crate::matrix;
use crate::paper::{CONTROLLER_POLES, plant};
use control::aso::{FaultyPlant, design};
use control::controller::controller;
use control::exponential::exponential;
use control::lmi::{Outcome, Region, certify_common, common_reachable_set};
use control::losses::LossyLoop;
use control::placement::real_poles;
use control::{Domain, Error};
use nalgebra::{DMatrix, DVector};

fn decay(rate: f64) -> Region {
    Region { decay: Some(rate), ..Region::default() }
}

/// A sequence without a pattern, the same in every run, each number 0 or 1.
fn coin(seed: u32) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 31)
    }
}

/// [-1, -1; 1, -1] and [-1, -a; 1/a, -1] are stable, as is their hull; a common quadratic Lyapunov function
/// exists for a < 3 + sqrt(8) = 5.83 only (Dayawansa and Martin 1999).
#[test]
fn a_common_lyapunov_matrix_is_found_where_it_exists_and_only_there() {
    let family =
        |a: f64| [matrix(2, 2, &[-1.0, -1.0, 1.0, -1.0]), matrix(2, 2, &[-1.0, -a, 1.0 / a, -1.0])];
    let prove = |a: f64| certify_common(&family(a), &Region::default(), Domain::Continuous);
    let Outcome::Optimal(actual) = prove(5.75).unwrap() else { panic!() };
    for corner in family(5.75) {
        let left = corner.transpose() * &actual.p + &actual.p * corner;
        assert!(left.symmetric_eigenvalues().max() < 0.0);
    }
    let Outcome::Infeasible { conflict } = prove(5.9).unwrap() else { panic!() };
    assert_eq!(conflict, [0, 1]);
}

#[test]
fn bad_families_are_refused() {
    let one = DVector::from_element(1, 1.0);
    let unit = DMatrix::identity(1, 1);
    let none = common_reachable_set(&[], &one, &unit, 1.0, Domain::Continuous);
    assert!(matches!(none, Err(Error::Empty { .. })));
    let mixed = [DMatrix::identity(1, 1) * -1.0, DMatrix::identity(3, 3) * -1.0];
    let mixed = common_reachable_set(&mixed, &one, &unit, 1.0, Domain::Continuous);
    assert!(matches!(mixed, Err(Error::Shape { .. })));
    let (plant, _) = carts_loop();
    let actual = LossyLoop::new(&plant.0, &plant.1, &[2]);
    assert!(matches!(actual, Err(Error::OutOfRange { .. })));
    let lossy = LossyLoop::new(&plant.0, &plant.1, &[0, 1]).unwrap();
    for largest in [[0.0, 0.0], [0.5, 1.5], [-0.1, 0.5]] {
        assert!(matches!(lossy.constant_limit(&largest, 1.0), Err(Error::OutOfRange { .. })));
    }
}

/// x' = -a x + w with a from 2 to 3: |x| <= 1 / 2; sampled x[k+1] = a x + w with a up to 0.8: |x| <= 5.
#[test]
fn the_reachable_set_of_a_scalar_family_is_that_of_its_slowest_member() {
    let one = DVector::from_element(1, 1.0);
    let peak = |family: &[f64], rate: f64, domain| {
        let family: Vec<_> = family.iter().map(|a| matrix(1, 1, &[*a])).collect();
        let actual = common_reachable_set(&family, &one, &DMatrix::identity(1, 1), rate, domain);
        actual.unwrap().optimal().map(|actual| actual.peak(&one))
    };
    let actual = peak(&[-2.0, -3.0], 2.0, Domain::Continuous).unwrap();
    assert!((0.5..0.5001).contains(&actual), "{actual}");
    assert_eq!(peak(&[-2.0, -3.0], 4.1, Domain::Continuous), None);
    let period = 0.5;
    // r = 1 - 0.8 is the best choice.
    let rate = -0.8_f64.ln() / period;
    let actual = peak(&[0.8, 0.5], rate, Domain::Sampled { period }).unwrap();
    assert!((5.0..5.001).contains(&actual), "{actual}");
}

/// x1' = -x1 + w, x2' = -2 x2 + e x1: x2 is in proportion to e, and so is its bound.
#[test]
fn bounds_of_states_do_not_depend_on_their_units() {
    let peak = |e: f64| {
        let family = [matrix(2, 2, &[-1.0, 0.0, e, -2.0]), matrix(2, 2, &[-1.2, 0.0, e, -2.5])];
        let disturbance = DVector::from_vec(vec![1.0, 0.0]);
        let output = matrix(1, 2, &[0.0, 1.0]);
        let domain = Domain::Continuous;
        let actual = common_reachable_set(&family, &disturbance, &output, 0.9, domain);
        actual.unwrap().optimal().unwrap().peak(&DVector::from_vec(vec![0.0, 1.0]))
    };
    let unit = peak(1.0);
    for e in [1e-3, 1e-5, 1e-8] {
        assert!((peak(e) / (e * unit) - 1.0).abs() < 1e-3, "{e:e}: {} {unit}", peak(e));
    }
}

type Loop = (FaultyPlant, control::StateSpace);

/// Two carts whose forces may lose effect, with the controller that estimates and compensates both losses.
fn carts_loop() -> (Loop, LossyLoop) {
    let (a, b) = (reference("loss_a"), reference("loss_b"));
    let plant = FaultyPlant::with_constant_faults(a, b.clone(), DMatrix::identity(2, 4), b);
    let poles = real_poles(&[-6.0, -7.0, -8.0, -9.0, -10.0, -11.0]);
    let designed =
        design(&plant, &real_poles(&[-1.0, -1.5, -2.0, -2.5]), &poles, None).expect("a design");
    let controller = controller(&plant, &designed.gains, Domain::Continuous).expect("a controller");
    let lossy = LossyLoop::new(&plant, &controller, &[0, 1]).expect("a loop");
    ((plant, controller), lossy)
}

#[test]
fn the_certified_losses_are_below_the_limit_of_constant_losses() {
    let (_, lossy) = carts_loop();
    for largest in [[1.0, 1.0], [1.0, 0.0], [0.2, 0.8]] {
        let constant = lossy.constant_limit(&largest, 1.0).unwrap();
        let actual = lossy.certified(&largest, constant.factor).unwrap();
        assert!(actual.factor > 0.0 && actual.factor <= constant.factor, "{actual:?} {constant:?}");
        // Beyond the limit the loop is unstable.
        if constant.factor < 1.0 {
            let beyond: Vec<_> = constant.loss.iter().map(|loss| loss * 1.001).collect();
            assert!(
                control::stability::instability(&lossy.at(&beyond), lossy.domain).unwrap() > 0.0
            );
        }
        // The certificate covers losses within the box, which the test chooses itself.
        let p = &actual.certificate.unwrap().p;
        let root = p.clone().cholesky().unwrap().l().transpose();
        let inverse = root.clone().try_inverse().unwrap();
        for (i, j) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (0.3, 0.6), (0.5, 0.5)] {
            let loss = [i * actual.factor * largest[0], j * actual.factor * largest[1]];
            let corner = &root * lossy.at(&loss) * &inverse;
            let left = &corner + corner.transpose();
            assert!(left.symmetric_eigenvalues().max() < 0.0, "{loss:?}");
        }
    }
}

/// Losses jump between nothing and the largest one, the disturbance between -1 and 1, at random and in
/// the direction that increases the first state.
#[test]
fn losses_that_jump_keep_the_proven_decay_rate_and_the_bounds_of_the_states() {
    let (_, lossy) = carts_loop();
    let most = lossy.constant_limit(&[1.0, 1.0], 1.0).unwrap().factor;
    let largest = [0.8 * lossy.certified(&[1.0, 1.0], most).unwrap().factor; 2];
    let rate = lossy.decay(&largest).unwrap().unwrap();
    let p = match lossy.certificate(&largest, &decay(rate)).unwrap() {
        Outcome::Optimal(actual) => actual.p,
        other => panic!("{other:?}"),
    };
    let order = lossy.intact.nrows();
    let disturbance = DVector::from_fn(order, |k, _| if k == 2 { 1.0 } else { 0.0 });
    let outputs = DMatrix::identity(4, order);
    let set =
        common_reachable_set(&lossy.corners(&largest), &disturbance, &outputs, rate, lossy.domain);
    let set = set.unwrap().optimal().unwrap();
    let step = 0.02;
    let corner = |loss: [f64; 2]| {
        let mut system = DMatrix::zeros(order + 1, order + 1);
        system.view_mut((0, 0), (order, order)).copy_from(&lossy.at(&loss));
        system.view_mut((0, order), (order, 1)).copy_from(&disturbance);
        exponential(&(system * step)).unwrap()
    };
    let corners: Vec<_> =
        [[0.0, 0.0], [0.0, largest[1]], [largest[0], 0.0], largest].map(corner).into();
    let mut coin = coin(7);
    let mut free = DVector::from_fn(order, |k, _| 1.0 - 0.3 * f64::from(u32::try_from(k).unwrap()));
    let value = |x: &DVector<f64>| x.dot(&(&p * x));
    let start = value(&free);
    let mut driven = DVector::zeros(order + 1);
    let mut seen = DVector::<f64>::zeros(4);
    for k in 1..=5000 {
        let chosen = &corners[usize::from(coin() > 0.5) + 2 * usize::from(coin() > 0.5)];
        free = chosen.view((0, 0), (order, order)) * free;
        let time = f64::from(k) * step;
        assert!(value(&free) <= start * (-2.0 * rate * time).exp() * (1.0 + 1e-9), "{time}");
        // The corner and the sign that move the first state farthest.
        let next = |corner: &DMatrix<f64>, sign: f64| {
            let mut from = driven.clone();
            from[order] = sign;
            corner * from
        };
        let outward = if coin() > 0.5 { 1.0 } else { -1.0 };
        let moved = corners.iter().flat_map(|corner| [next(corner, 1.0), next(corner, -1.0)]);
        driven = moved.max_by(|a, b| (outward * a[0]).total_cmp(&(outward * b[0]))).unwrap();
        for (state, seen) in seen.iter_mut().enumerate() {
            *seen = seen.max(driven[state].abs());
        }
    }
    for (state, seen) in seen.iter().enumerate() {
        let bound = set.peak(&outputs.row(state).transpose());
        assert!(*seen <= bound && *seen > 0.02 * bound, "{state}: {seen} {bound}");
    }
}

/// Without an actuator the pendulum falls: the limit is where an eigenvalue crosses the axis.
#[test]
fn the_largest_certified_loss_of_the_pendulum_is_near_the_necessary_one() {
    let plant = plant();
    let observer = real_poles(&[-12.0, -15.0, -18.0, -21.0, -30.0]);
    let actual = design(&plant, &real_poles(&CONTROLLER_POLES), &observer, None).unwrap();
    let controller = controller(&plant, &actual.gains, Domain::Continuous).unwrap();
    let lossy = LossyLoop::new(&plant, &controller, &[0]).unwrap();
    let constant = lossy.constant_limit(&[1.0], 1.0).unwrap();
    let certified = lossy.certified(&[1.0], constant.factor).unwrap();
    assert!(constant.factor < 1.0 && certified.factor > 0.3 * constant.factor);
    assert!(certified.factor < constant.factor);
}
