use crate::paper::{CONTROLLER_POLES, OBSERVER_POLES, plant, printed};
use crate::{entry_error, integers, matrix};
use control::Error;
use control::eigen::eigenvalues;
use control::exponential::exponential;
use control::placement::{Placement, place, place_balanced, place_discrete, real_poles};
use nalgebra::{Complex, DMatrix};

mod loops;
mod scipy;

/// p and its conjugate.
fn pair(re: f64, im: f64) -> [Complex<f64>; 2] {
    [Complex::new(re, im), Complex::new(re, -im)]
}

/// In ascending order of the real part, then of the imaginary part, which must not be close.
fn assert_assigned(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    placement: &Placement,
    poles: &[Complex<f64>],
) {
    let mut required = poles.to_vec();
    required.sort_by(|x, y| x.re.total_cmp(&y.re).then(x.im.total_cmp(&y.im)));
    for (eigenvalue, required) in
        eigenvalues(&(a + b * &placement.gain)).expect("eigenvalues exist").iter().zip(required)
    {
        assert!((eigenvalue - required).norm() < 1e-6 * required.norm(), "{eigenvalue} {required}");
    }
}

/// (`A_0`', `C_0`') of the pendulum.
fn observer() -> (DMatrix<f64>, DMatrix<f64>) {
    let plant = plant();
    (plant.augmented_dynamics().transpose(), plant.augmented_output().transpose())
}

#[test]
fn the_order_in_which_eigenvalues_are_stated_does_not_change_a_bit() {
    let (a, b) = observer();
    let mut poles = [&real_poles(&[-1200., -1500., -2500.])[..], &pair(-3000., 800.)].concat();
    let first = place_balanced(&a, &b, &poles).unwrap();
    for _ in 0..poles.len() {
        poles.rotate_left(1);
        assert_eq!(place_balanced(&a, &b, &poles).unwrap().gain, first.gain);
    }
    poles.reverse();
    assert_eq!(place_balanced(&a, &b, &poles).unwrap().gain, first.gain);
}

/// Published with these digits, from the printed A and B.
#[test]
fn one_input_gives_the_published_gain() {
    let placement = place(&printed().a, &printed().b, &real_poles(&CONTROLLER_POLES)).unwrap();
    let published = matrix(1, 4, &[184.10, 365.71, 123.66, 63.86]);
    assert!((&placement.gain - published).amax() < 5.1e-3, "{}", placement.gain);
}

/// `-place_poles(A, B, [-4.5, -6, -7.5, -9]).gain_matrix` of scipy 1.17.1, A and B from the
/// parameters.
#[test]
fn one_input_gives_the_gain_of_scipy() {
    let placement = place(&plant().a, &plant().b, &real_poles(&CONTROLLER_POLES)).unwrap();
    let scipy = [184.088_126_31, 365.721_398_02, 123.654_284_82, 63.865_665_69];
    assert!(entry_error(&placement.gain, &matrix(1, 4, &scipy)) < 1e-9);
}

/// (s + 1) (s^2 + 6 s + 25) (s^2 + 2 s + 1.0625) expanded; in this form K is the difference of the
/// coefficients.
#[test]
fn with_one_input_and_pairs_the_closed_loop_has_the_required_polynomial() {
    let mut a = DMatrix::zeros(5, 5);
    a.view_mut((0, 1), (4, 4)).fill_with_identity();
    a.row_mut(4).copy_from(&matrix(1, 5, &[3.0, -1.0, 4.0, 1.0, -5.0]));
    let b = matrix(5, 1, &[0.0, 0.0, 0.0, 0.0, 1.0]);
    let poles = [&pair(-3.0, 4.0)[..], &real_poles(&[-1.0]), &pair(-1.0, 0.25)].concat();
    let placement = place(&a, &b, &poles).unwrap();
    let asked = [26.5625, 82.9375, 94.4375, 46.0625, 9.0];
    let expected = DMatrix::from_fn(1, 5, |_, j| -asked[j] - a[(4, j)]);
    assert!(entry_error(&placement.gain, &expected) < 1e-11, "{}", placement.gain);
}

/// The lowest condition number, 3.198767e7, is the result of a search over the five free angles
/// (Nelder-Mead, 60 random starts, scipy).
#[test]
fn the_observer_of_the_pendulum_has_the_condition_number_that_a_random_search_finds() {
    let (a, c) = observer();
    let placement = place(&a, &c, &real_poles(&OBSERVER_POLES)).unwrap();
    assert!((placement.quality.condition / 3.198_767e7 - 1.0).abs() < 1e-6);
    assert!(placement.quality.pole_error < 1e-9);
    assert_assigned(&a, &c, &placement, &real_poles(&OBSERVER_POLES));
}

/// Each gain is the best in its own coordinates.
#[test]
fn the_coordinates_decide_which_condition_number_is_low() {
    let (a, c) = observer();
    let poles = real_poles(&OBSERVER_POLES);
    let (given, balanced) =
        (place(&a, &c, &poles).unwrap().quality, place_balanced(&a, &c, &poles).unwrap().quality);
    assert!(given.condition < 0.95 * balanced.condition, "{given:?} {balanced:?}");
    assert!(balanced.balanced_condition < 0.95 * given.balanced_condition);
}

/// Up to the powers of two that limit the balancing, and to the figures in the given units that the
/// choice takes into account.
#[test]
fn the_balanced_placement_hardly_depends_on_the_units_of_the_states() {
    let (a, c) = observer();
    let units = [1.0, 1024.0, 0.125, 8.0, 1.0 / 65536.0];
    let scaled_a = DMatrix::from_fn(5, 5, |i, j| a[(i, j)] * units[j] / units[i]);
    let scaled_c = DMatrix::from_fn(5, 2, |i, j| c[(i, j)] / units[i]);
    let poles =
        [&pair(-1500.0, 300.0)[..], &pair(-2000.0, 1000.0), &real_poles(&[-1200.0])].concat();
    let given = place_balanced(&a, &c, &poles).unwrap();
    let scaled = place_balanced(&scaled_a, &scaled_c, &poles).unwrap();
    let ratio = scaled.quality.balanced_condition / given.quality.balanced_condition;
    assert!(0.7 < ratio && ratio < 1.4, "{ratio}");
    assert_assigned(&a, &c, &given, &poles);
    assert_assigned(&scaled_a, &scaled_c, &scaled, &poles);
}

/// With as many inputs as states every closed-loop matrix is possible; the best conditioned has
/// orthogonal eigenvectors, of which gain and peak of S take at most 8 %.
#[test]
fn as_many_inputs_as_states_give_almost_orthogonal_eigenvectors() {
    let a = integers(3, 3, |i, j| (3 * i * i + 2 * i * j + j) % 7 - 3);
    let b = matrix(3, 3, &[1., 2., 0., 0., 1., 3., 1., 0., 1.]);
    for poles in
        [real_poles(&[-1.0, -2.0, -3.0]), [&pair(-1.0, 5.0)[..], &real_poles(&[-2.0])].concat()]
    {
        let placement = place(&a, &b, &poles).unwrap();
        assert!(placement.quality.condition < 1.08, "{:?}", placement.quality);
    }
}

#[test]
fn the_multiplicity_of_an_eigenvalue_may_equal_the_number_of_inputs() {
    let a = integers(4, 4, |i, j| (7 * i * i + 3 * i * j + 5 * j + i * j * j) % 11 - 5);
    let b = integers(4, 2, |i, j| (5 * i * i + 3 * j + 2 * i * j + i) % 7 - 3);
    let twice = real_poles(&[-2.0, -1.0, -2.0, -1.0]);
    assert_assigned(&a, &b, &place(&a, &b, &twice).unwrap(), &twice);
    let [p, q] = pair(-1.0, 3.0);
    let placement = place(&a, &b, &[p, q, p, q]).unwrap();
    let actual = eigenvalues(&(&a + &b * &placement.gain)).unwrap();
    assert!(actual.iter().all(|value| (value - p).norm().min((value - q).norm()) < 1e-12));
    assert!(placement.quality.condition < 100.0, "{:?}", placement.quality);
}

#[test]
fn a_multiplicity_above_the_number_of_inputs_is_refused() {
    let a = integers(6, 6, |i, j| (7 * i * i + 3 * i * j + 5 * j + i * j * j) % 11 - 5);
    let b = integers(6, 2, |i, j| (5 * i * i + 3 * j + 2 * i * j + i) % 7 - 3);
    let refused = place(&a, &b, &real_poles(&[-2.0, -1.0, -2.0, -2.0, -3.0, -4.0])).unwrap_err();
    let expected = "the eigenvalue -2 is requested 3 times, expected at most 2, the rank of B";
    assert_eq!(refused.to_string(), expected);
    let refused = place(&a, &b, &[pair(-1.0, 3.0); 3].concat()).unwrap_err();
    let expected = "the eigenvalue -1+3i is requested 3 times, expected at most 2, the rank of B";
    assert_eq!(refused.to_string(), expected);
}

#[test]
fn a_complex_eigenvalue_without_its_conjugate_is_refused_by_name() {
    let (a, b) = (DMatrix::zeros(3, 3), DMatrix::identity(3, 3));
    let [p, q] = pair(-1.0, 2.0);
    let alone = [Complex::new(-3.0, 0.0), q, Complex::new(-4.0, 0.0)];
    let refused = place(&a, &b, &alone).unwrap_err();
    assert_eq!(refused, Error::UnpairedPole { pole: q });
    let expected = "the eigenvalue -1-2i is requested without its conjugate -1+2i";
    assert_eq!(refused.to_string(), expected);
    assert_eq!(place(&a, &b, &[p, q, p]), Err(Error::UnpairedPole { pole: p }));
}

/// Two equal motors share the work of one.
#[test]
fn dependent_inputs_get_the_smallest_gain() {
    let (a, one) = (plant().a, plant().b);
    let both = DMatrix::from_fn(4, 2, |i, _| one[i]);
    for poles in [real_poles(&CONTROLLER_POLES), [pair(-5.0, 2.0), pair(-6.0, 6.0)].concat()] {
        let single = place(&a, &one, &poles).unwrap().gain;
        let shared = place(&a, &both, &poles).unwrap().gain;
        let expected = DMatrix::from_fn(2, 4, |_, j| single[j] / 2.0);
        assert!(entry_error(&shared, &expected) < 1e-12, "{shared}");
    }
}

#[test]
fn an_eigenvalue_of_the_plant_may_be_kept_and_zero_may_be_assigned() {
    let a = matrix(2, 2, &[0.0, 1.0, 0.0, -3.0]);
    let b = matrix(2, 1, &[0.0, 1.0]);
    let kept = place(&a, &b, &real_poles(&[-3.0, 0.0])).unwrap();
    assert!(kept.gain.amax() < 1e-13, "{}", kept.gain);
    let oscillator = matrix(2, 2, &[0.0, 1.0, -25.0, -6.0]);
    let kept = place(&oscillator, &b, &pair(-3.0, 4.0)).unwrap();
    assert!(kept.gain.amax() < 1e-13, "{}", kept.gain);
}

/// Each input has half of the effect.
#[test]
fn a_single_state_needs_one_division() {
    let (a, b) = (matrix(1, 1, &[2.0]), matrix(1, 2, &[3.0, 4.0]));
    let placement = place(&a, &b, &real_poles(&[-8.0])).unwrap();
    assert!(entry_error(&placement.gain, &matrix(2, 1, &[-5.0 / 3.0, -5.0 / 4.0])) < 1e-15);
    assert!((placement.quality.condition - 1.0).abs() < 1e-15);
}

/// K of the double integrator is [-p q, p + q].
#[test]
fn eigenvalues_of_very_different_size_are_each_reached() {
    let (a, b) = (matrix(2, 2, &[0.0, 1.0, 0.0, 0.0]), matrix(2, 1, &[0.0, 1.0]));
    let gain = place(&a, &b, &real_poles(&[-1e-3, -1e6])).unwrap().gain;
    assert!(entry_error(&gain, &matrix(1, 2, &[-1e3, -1e6 - 1e-3])) < 1e-14, "{gain}");
    let two = matrix(3, 2, &[0.0, 0.3, 1.0, 0.0, 0.0, 1.0]);
    let three = matrix(3, 3, &[0.0, 1.0, 0.2, 0.0, 0.0, 1.0, 0.5, 0.0, 0.0]);
    let poles = [&real_poles(&[-1e-3])[..], &pair(-1e5, 1e5)].concat();
    let placement = place(&three, &two, &poles).unwrap();
    assert!(placement.quality.pole_error < 1e-6, "{:?}", placement.quality);
}

#[test]
fn a_state_out_of_reach_is_refused() {
    let a = matrix(2, 2, &[1.0, 0.0, 0.0, 2.0]);
    let refused = place(&a, &matrix(2, 1, &[1.0, 0.0]), &real_poles(&[-1.0, -2.0]));
    assert_eq!(refused, Err(Error::NotControllable { rank: 1, n: 2 }));
    let refused = place(&a, &matrix(2, 1, &[1.0, 0.0]), &pair(-1.0, 2.0));
    assert_eq!(refused, Err(Error::NotControllable { rank: 1, n: 2 }));
}

/// The eigenvalues -1200 to -3000 sampled: from well separated to almost zero.
#[test]
fn the_sampled_observer_of_the_pendulum_is_placed_at_every_sample_time() {
    let (a, c) = observer();
    for outputs in [1, 2] {
        let c = c.columns(0, outputs).into_owned();
        for sample_time in [1e-4, 1e-3, 5e-3, 1e-2, 2e-2] {
            let poles = real_poles(&OBSERVER_POLES.map(|pole| (pole * sample_time).exp()));
            let a = exponential(&(&a * sample_time)).unwrap();
            let placement = place_discrete(&a, &c, &poles).unwrap();
            let radius = poles[0].re;
            let actual = eigenvalues(&(a + &c * &placement.gain)).unwrap();
            assert!(actual.iter().all(|value| value.norm() < radius + 1e-2), "{actual:?}");
            assert!(outputs == 1 || placement.quality.pole_error < 1e-3);
        }
    }
}

/// All eigenvalues are zero, as often as there are inputs: K = -B^-1 A.
#[test]
fn a_plant_with_as_many_inputs_as_states_comes_to_rest_in_one_sample() {
    let a = matrix(2, 2, &[0.9, 0.1, -0.3, 1.1]);
    let b = matrix(2, 2, &[1.0, 2.0, 0.0, 1.0]);
    for placement in
        [place, place_discrete].map(|way| way(&a, &b, &real_poles(&[0.0, 0.0])).unwrap())
    {
        assert!((&a + &b * &placement.gain).amax() < 1e-15, "{}", placement.gain);
    }
}

/// z = 1 in discrete time corresponds to s = 0 in continuous time.
#[test]
fn a_slow_eigenvalue_in_discrete_time_is_judged_by_its_distance_from_one() {
    let a = matrix(2, 2, &[1.0, 1e-3, 0.0, 1.0]);
    let b = matrix(2, 1, &[5e-7, 1e-3]);
    let poles = pair(1.0 - 1e-5, 1e-5);
    let placement = place_discrete(&a, &b, &poles).unwrap();
    let actual = eigenvalues(&(a + b * &placement.gain)).unwrap();
    let far = (actual[0] - poles[1]).norm() / (poles[1] - 1.0).norm();
    assert!((placement.quality.pole_error - far).abs() < 1e-13, "{far:e}");
    assert!(far < 1e-9, "{far:e}");
}

/// A chain of equal masses, springs and dampers, forces on every fifth mass.
fn chain(masses: usize) -> (DMatrix<f64>, DMatrix<f64>) {
    let mut a = DMatrix::zeros(2 * masses, 2 * masses);
    a.view_mut((0, masses), (masses, masses)).fill_with_identity();
    for i in 0..masses {
        a[(masses + i, i)] = -2.0;
        a[(masses + i, masses + i)] = -0.02;
        if i > 0 {
            a[(masses + i, i - 1)] = 1.0;
            a[(masses + i - 1, i)] = 1.0;
        }
    }
    let b =
        DMatrix::from_fn(
            2 * masses,
            masses / 5,
            |i, j| {
                if i == masses + 5 * j + 2 { 1.0 } else { 0.0 }
            },
        );
    (a, b)
}

#[test]
fn fifty_eigenvalues_of_a_chain_of_masses_are_moved_to_the_left() {
    let (a, b) = chain(25);
    let poles: Vec<_> = eigenvalues(&a).unwrap().iter().map(|pole| pole - 0.3).collect();
    let placement = place(&a, &b, &poles).unwrap();
    assert!(placement.quality.pole_error < 1e-11, "{:?}", placement.quality);
    let actual = eigenvalues(&(&a + &b * &placement.gain)).unwrap();
    let far = |pole: &Complex<f64>| {
        actual.iter().map(|actual| (actual - pole).norm()).fold(f64::INFINITY, f64::min)
    };
    assert!(poles.iter().map(far).fold(0.0, f64::max) < 1e-11);
}

/// The eigenvalues of a companion matrix are the roots of a polynomial whose coefficients, multiples of 2^-52, are
/// known without error: to first order a root differs from p by -P(p) / P'(p). Eigenvalues in double precision differ
/// by three times as much.
#[test]
#[expect(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "exact integers")]
fn an_eigenvalue_error_that_rounding_leaves_is_stated() {
    let integer = |x: f64| (x * 2f64.powi(52)) as i128;
    let mut a = DMatrix::zeros(13, 13);
    a.view_mut((0, 1), (12, 12)).fill_with_identity();
    for (j, sign) in (0..13).zip([1.0, -1.0].into_iter().cycle()) {
        a[(12, j)] = sign * (j + 1) as f64;
    }
    let b = DMatrix::from_fn(13, 1, |i, _| if i == 12 { 1.0 } else { 0.0 });
    let real: Vec<f64> = (1..10).map(|k| -f64::from(k)).collect();
    let poles = [&real_poles(&real)[..], &pair(-10.0, 2.0), &pair(-5.0, 6.0)].concat();
    let placement = place(&a, &b, &poles).unwrap();
    let error = |p: &Complex<f64>| {
        let (x, y) = (p.re as i128, p.im as i128);
        let (mut re, mut im) = (integer(1.0), 0);
        for j in (0..13).rev() {
            let coefficient = integer(a[(12, j)]) + integer(placement.gain[j]);
            (re, im) = (re * x - im * y - coefficient, re * y + im * x);
        }
        let others = poles.iter().filter(|other| *other != p);
        let slope = others.map(|other| p - other).product::<Complex<f64>>();
        Complex::new(re as f64, im as f64).norm() / 2f64.powi(52) / slope.norm() / p.norm()
    };
    let expected = poles.iter().map(error).fold(0.0, f64::max);
    let stated = placement.quality.pole_error;
    assert!(1e-9 < expected && (stated / expected - 1.0).abs() < 0.01, "{stated:e} {expected:e}");
}

/// Also with a pair that the plant keeps.
#[test]
fn the_eigenvalues_of_a_plant_with_several_inputs_may_be_requested() {
    let a = integers(6, 6, |i, j| (7 * i * i + 3 * i * j + 5 * j + i * j * j) % 11 - 5);
    let b = integers(6, 2, |i, j| (5 * i * i + 3 * j + 2 * i * j + i) % 7 - 3);
    let poles = eigenvalues(&a).unwrap();
    for way in [place, place_balanced, place_discrete] {
        let placement = way(&a, &b, &poles).unwrap();
        assert!(placement.quality.pole_error < 1e-9, "{:?}", placement.quality);
        assert_assigned(&a, &b, &placement, &poles);
    }
    let decoupled = DMatrix::from_diagonal(&vec![-1.0, -2.0, -3.0, -4.0].into());
    let b = matrix(4, 2, &[1., 0., 0., 1., 1., 1., 1., -1.]);
    let kept = real_poles(&[-1.0, -2.0, -3.0, -4.0]);
    assert_assigned(&decoupled, &b, &place(&decoupled, &b, &kept).unwrap(), &kept);
}

#[test]
fn inputs_in_units_of_very_different_size_are_placed_alike() {
    let a = integers(6, 6, |i, j| (7 * i * i + 3 * i * j + 5 * j + i * j * j) % 11 - 5);
    let b = integers(6, 2, |i, j| (5 * i * i + 3 * j + 2 * i * j + i) % 7 - 3);
    let poles = [&pair(-2.0, 1.0)[..], &real_poles(&[-1.0, -3.0, -4.0, -5.0])].concat();
    let plain = place(&a, &b, &poles).unwrap();
    let units = vec![1e-9, 1e7].into();
    let scaled_b = &b * DMatrix::from_diagonal(&units);
    let scaled = place(&a, &scaled_b, &poles).unwrap();
    assert_assigned(&a, &scaled_b, &scaled, &poles);
    let ratio = scaled.quality.condition / plain.quality.condition;
    assert!(0.5 < ratio && ratio < 2.0, "{:?} {:?}", scaled.quality, plain.quality);
}

/// `L_x` and `L_f` of fmu-controller/resources/design.toml, to the last bit.
#[test]
fn the_shipped_observer_of_the_pendulum_keeps_its_gain() {
    let (a, c) = observer();
    let gain = -place_balanced(&a, &c, &real_poles(&OBSERVER_POLES)).unwrap().gain.transpose();
    let file = include_str!("../../../../fmu-controller/resources/design.toml");
    let of = |name: &str| -> Vec<f64> {
        let text = file.split(&format!("{name} = [")).nth(1).expect(name);
        let text = text.split("\n]").next().expect("an end").replace(['[', ']', '\n', ' '], "");
        text.split(',').filter(|text| !text.is_empty()).map(|text| text.parse().unwrap()).collect()
    };
    let shipped = [of("L_x"), of("L_f").iter().map(|value| -value).collect()].concat();
    assert_eq!(gain, matrix(5, 2, &shipped));
}
