//! Step sizes chosen by the step control.

use master::algorithm::PowerBond;
use master::{Algorithm, Extrapolation, Method, StepControl, SystemError};
use tests::linear::{ABLE, Abilities};
use tests::network::{Network, Run};
use tests::problems;

const STOP: f64 = 5.0;

fn chosen(control: StepControl, tolerance: f64) -> Algorithm {
    Algorithm {
        control,
        relative_tolerance: tolerance,
        absolute_tolerance: tolerance,
        largest_step: 1.0,
        smallest_step: 1e-9,
        ..Algorithm::fixed(Method::GaussSeidel, Extrapolation::Linear, 1e-3)
    }
}

fn run(network: &Network, algorithm: &Algorithm) -> Run {
    network.run(ABLE, algorithm, STOP).unwrap()
}

/// The number of fixed steps that gives an error of at most `error`, to within a tenth.
fn fixed_of(network: &Network, error: f64) -> Run {
    let mut steps = 16.0;
    loop {
        let outcome = run(
            network,
            &Algorithm::fixed(Method::GaussSeidel, Extrapolation::Linear, STOP / steps),
        );
        if outcome.error <= error {
            return outcome;
        }
        steps = f64::ceil(steps * 1.1);
    }
}

/// Both controls keep the error of one step at the tolerance.
///
/// The error that `doubling` estimates is of order 3, so the steps are proportional to
/// `tolerance^(1/3)` and the error of the run to `tolerance^(2/3)`. The error that `embedded`
/// estimates is of order 2, so the steps are proportional to `tolerance^(1/2)` and the error of the
/// run to the tolerance.
#[test]
fn repeated_steps_keep_the_error_near_the_tolerance() {
    let network = problems::transient();
    for (control, exponent) in [(StepControl::Doubling, 2.0 / 3.0), (StepControl::Embedded, 1.0)] {
        for tolerance in [1e-3, 1e-4, 1e-5, 1e-6] {
            let actual = run(&network, &chosen(control, tolerance));
            let label = format!("{} {tolerance}: {actual:?}", control.name());
            assert!(actual.error < 5.0 * f64::powf(tolerance, exponent), "{label}");
            assert!(actual.error > 0.01 * tolerance, "{label}");
        }
    }
}

#[test]
fn repeated_steps_are_fewer_than_fixed_ones_at_the_same_error() {
    let network = problems::transient();
    for control in [StepControl::Doubling, StepControl::Embedded] {
        for tolerance in [1e-4, 1e-5] {
            let actual = run(&network, &chosen(control, tolerance));
            let fixed = fixed_of(&network, actual.error);
            let label = format!("{} {tolerance}: {actual:?}, {fixed:?}", control.name());
            assert!(2 * actual.points < fixed.points, "{label}");
            assert!(actual.calls < fixed.calls, "{label}");
        }
    }
}

/// The connected signals change by the tolerance in each step, which is the error of held inputs.
#[test]
fn the_increment_makes_steps_small_where_signals_move_fast() {
    let network = problems::transient();
    let of = |tolerance: f64| {
        let control = chosen(StepControl::Increment, tolerance);
        run(&network, &Algorithm { extrapolation: Extrapolation::Hold, step: 1e-4, ..control })
    };
    let (coarse, fine) = (of(1e-2), of(1e-3));
    assert!(coarse.sizes.1 > 10.0 * coarse.sizes.0, "{coarse:?}");
    assert!(fine.points > 5 * coarse.points, "{coarse:?} {fine:?}");
    assert!(fine.error < 0.3 * coarse.error, "{coarse:?} {fine:?}");
    assert_eq!(fine.calls, 2 * fine.points, "nothing is repeated");
}

fn bond(network: &Network) -> PowerBond {
    let system = network.system(ABLE, &std::sync::Arc::default());
    PowerBond { first: system.port("b.u1").unwrap(), second: system.port("a.u0").unwrap() }
}

#[test]
fn the_energy_control_makes_steps_small_where_a_bond_loses_energy() {
    let network = problems::two_masses(1e3, 20.0);
    let of = |tolerance: f64| {
        let bonds = vec![bond(&network)];
        run(&network, &Algorithm { bonds, ..chosen(StepControl::Energy, tolerance) })
    };
    let (coarse, fine) = (of(1e-3), of(1e-5));
    assert!(coarse.sizes.1 > 3.0 * coarse.sizes.0, "{coarse:?}");
    // Order 2: a hundredth of the tolerance gives a tenth of the step.
    let times = 5 * coarse.points..15 * coarse.points;
    assert!(times.contains(&fine.points), "{coarse:?} {fine:?}");
    assert!(fine.error < 0.2 * coarse.error, "{coarse:?} {fine:?}");
    assert_eq!(fine.calls, 2 * fine.points, "nothing is repeated");
}

/// On a stiff and damped coupling. The first step is not controlled, so it has to be small.
#[test]
fn increment_and_energy_need_fewer_steps_than_fixed_steps_at_the_same_error() {
    let network = problems::two_masses(1e3, 20.0);
    for (control, tolerance) in [(StepControl::Increment, 0.03), (StepControl::Energy, 1e-5)] {
        let bonds = vec![bond(&network)];
        let algorithm = Algorithm { bonds, step: 1e-4, ..chosen(control, tolerance) };
        let actual = run(&network, &algorithm);
        let fixed = fixed_of(&network, actual.error);
        assert!(3 * actual.points < 2 * fixed.points, "{actual:?}, {fixed:?}");
    }
}

#[test]
fn the_energy_control_needs_power_bonds() {
    let network = problems::two_masses(1e3, 20.0);
    let refused = network.run(ABLE, &chosen(StepControl::Energy, 1e-2), STOP).unwrap_err();
    assert!(matches!(refused, SystemError::Algorithm { .. }), "{refused}");
}

#[test]
fn a_tolerance_that_the_smallest_step_cannot_meet_is_an_error() {
    let network = problems::transient();
    let algorithm = Algorithm { smallest_step: 1e-3, ..chosen(StepControl::Embedded, 1e-9) };
    let refused = network.run(ABLE, &algorithm, STOP).unwrap_err();
    assert!(matches!(refused, SystemError::Stuck { .. }), "{refused}");
}

/// The estimate accounts for order 2 of inputs held at their mean, whatever the extrapolation, and
/// order 1 of inputs held at their end value.
#[test]
fn doubling_keeps_the_tolerance_with_slaves_that_hold_their_inputs() {
    let network = problems::coupled_oscillators();
    let able = Abilities { interpolates: false, ..ABLE };
    for (extrapolation, exponent) in [
        (Extrapolation::Hold, 1.0 / 2.0),
        (Extrapolation::Limited, 1.0 / 2.0),
        (Extrapolation::Linear, 2.0 / 3.0),
        (Extrapolation::Quadratic, 2.0 / 3.0),
    ] {
        let algorithm = Algorithm { extrapolation, ..chosen(StepControl::Doubling, 1e-5) };
        let actual = network.run(able, &algorithm, STOP).unwrap();
        assert!(
            actual.error < 5.0 * f64::powf(1e-5, exponent),
            "{}: {actual:?}",
            extrapolation.name()
        );
    }
}
