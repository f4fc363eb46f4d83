//! Integration against closed forms.

use super::{Integrator, Reached, System};
use crate::model::Failure;

/// A system given by two functions.
struct Functions<F, Z> {
    derivative: F,
    indicators: Z,
    evaluations: u32,
}

impl<F, Z> System for Functions<F, Z>
where
    F: Fn(f64, &[f64], &mut [f64]) -> Result<(), Failure>,
    Z: Fn(f64, &[f64], &mut [f64]),
{
    fn derivative(&mut self, time: f64, state: &[f64], slope: &mut [f64]) -> Result<(), Failure> {
        self.evaluations += 1;
        (self.derivative)(time, state, slope)
    }

    fn indicators(&mut self, time: f64, state: &[f64], z: &mut [f64]) -> Result<(), Failure> {
        (self.indicators)(time, state, z);
        Ok(())
    }
}

fn system<F, Z>(derivative: F, indicators: Z) -> Functions<F, Z>
where
    F: Fn(f64, &[f64], &mut [f64]) -> Result<(), Failure>,
    Z: Fn(f64, &[f64], &mut [f64]),
{
    Functions { derivative, indicators, evaluations: 0 }
}

#[expect(clippy::unnecessary_wraps, reason = "the signature of a system")]
fn oscillator(_: f64, y: &[f64], slope: &mut [f64]) -> Result<(), Failure> {
    slope.copy_from_slice(&[y[1], -y[0]]);
    Ok(())
}

fn no_indicators(_: f64, _: &[f64], _: &mut [f64]) {}

#[test]
fn the_global_error_follows_the_tolerance() {
    let mut last = f64::INFINITY;
    for tolerance in [1e-4, 1e-6, 1e-8, 1e-10] {
        let mut system = system(oscillator, no_indicators);
        let mut integrator = Integrator::new(vec![1.0; 2], 0);
        integrator.set_tolerance(tolerance);
        integrator.start(&mut system, 0.0, &[0.0, 1.0], 20.0).unwrap();
        assert_eq!(integrator.advance(&mut system, 20.0), Ok(Reached::End));
        let error = (integrator.state()[0] - 20.0_f64.sin()).abs();
        assert!(error < 30.0 * tolerance && error < last, "{tolerance}: {error}");
        assert_eq!(integrator.time().to_bits(), 20.0_f64.to_bits());
        last = error;
    }
}

#[test]
fn every_zero_of_the_sine_is_an_event_at_a_multiple_of_pi() {
    let mut system = system(oscillator, |_, y, z| z[0] = y[0]);
    let mut integrator = Integrator::new(vec![1.0; 2], 1);
    integrator.set_tolerance(1e-10);
    let (mut time, mut state) = (0.0, vec![1e-30, 1.0]);
    for k in 1..=10 {
        integrator.start(&mut system, time, &state, 100.0).unwrap();
        assert_eq!(integrator.advance(&mut system, 100.0), Ok(Reached::Event));
        (time, state) = (integrator.time(), integrator.state().to_vec());
        assert!((time - f64::from(k) * std::f64::consts::PI).abs() < 1e-8, "event {k} at {time}");
        assert!(state[0].abs() < 1e-13);
        assert_eq!(state[0] > 0.0, k % 2 == 0, "the sign has changed");
    }
}

#[test]
fn two_crossings_in_one_step_are_found() {
    // The state is time, so that the integrator takes one long step; z is negative within 2 ms only.
    let derivative = |_: f64, _: &[f64], slope: &mut [f64]| {
        slope[0] = 1.0;
        Ok(())
    };
    let mut system = system(derivative, |_, y, z| z[0] = (y[0] - 0.6).powi(2) - 1e-6);
    let mut integrator = Integrator::new(vec![1.0], 1);
    integrator.start(&mut system, 0.0, &[0.0], 1.0).unwrap();
    assert_eq!(integrator.advance(&mut system, 1.0), Ok(Reached::Event));
    assert!((integrator.time() - 0.599).abs() < 1e-12, "{}", integrator.time());
}

#[test]
fn an_indicator_that_only_touches_zero_from_below_is_no_event() {
    let derivative = |_: f64, _: &[f64], slope: &mut [f64]| {
        slope[0] = 1.0;
        Ok(())
    };
    let mut system = system(derivative, |_, y, z| z[0] = -(y[0] - 0.5).powi(2));
    let mut integrator = Integrator::new(vec![1.0], 1);
    integrator.start(&mut system, 0.0, &[0.0], 1.0).unwrap();
    assert_eq!(integrator.advance(&mut system, 1.0), Ok(Reached::End));
}

#[test]
fn a_zero_exactly_at_the_end_of_a_step_is_an_event() {
    let derivative = |_: f64, _: &[f64], slope: &mut [f64]| {
        slope[0] = -1.0;
        Ok(())
    };
    let mut system = system(derivative, |t, _, z| z[0] = 1.0 - t);
    let mut integrator = Integrator::new(vec![1.0], 1);
    integrator.start(&mut system, 0.0, &[1.0], 1.0).unwrap();
    assert_eq!(integrator.advance(&mut system, 1.0), Ok(Reached::Event));
    assert!((integrator.time() - 1.0).abs() < 1e-15);
}

#[test]
fn an_indicator_that_stays_at_zero_has_its_event_where_it_reaches_zero() {
    let derivative = |_: f64, _: &[f64], slope: &mut [f64]| {
        slope[0] = 1.0;
        Ok(())
    };
    let mut system = system(derivative, |_, y, z| z[0] = (0.6 - y[0]).max(0.0));
    let mut integrator = Integrator::new(vec![1.0], 1);
    integrator.start(&mut system, 0.0, &[0.0], 1.0).unwrap();
    assert_eq!(integrator.advance(&mut system, 1.0), Ok(Reached::Event));
    assert!((integrator.time() - 0.6).abs() < 1e-12, "{}", integrator.time());
}

#[test]
fn an_indicator_that_is_nan_only_close_to_its_zero_stops_the_integration_before_it() {
    let derivative = |_: f64, _: &[f64], slope: &mut [f64]| {
        slope[0] = 1.0;
        Ok(())
    };
    let indicator = |_: f64, y: &[f64], z: &mut [f64]| {
        z[0] = if (y[0] - 0.6).abs() < 1e-3 { f64::NAN } else { 0.6 - y[0] };
    };
    let mut system = system(derivative, indicator);
    let mut integrator = Integrator::new(vec![1.0], 1);
    integrator.start(&mut system, 0.0, &[0.0], 1.0).unwrap();
    let Err(Failure::Incomplete { time, message }) = integrator.advance(&mut system, 1.0) else {
        panic!("at {} s the state is {:?}", integrator.time(), integrator.state());
    };
    assert!(time < 0.6 && message.contains("NaN"), "{time}: {message}");
}

#[test]
fn a_pole_stops_the_integration_with_the_time_reached() {
    // y' = y^2 has the solution 1 / (1 - t).
    let square = |_: f64, y: &[f64], slope: &mut [f64]| {
        slope[0] = y[0] * y[0];
        Ok(())
    };
    let mut system = system(square, no_indicators);
    let mut integrator = Integrator::new(vec![1.0], 0);
    integrator.start(&mut system, 0.0, &[1.0], 2.0).unwrap();
    let Err(Failure::Incomplete { time, .. }) = integrator.advance(&mut system, 2.0) else {
        panic!("reached the end");
    };
    assert!((time - 1.0).abs() < 1e-6, "{time}");
}

#[test]
fn states_without_a_derivative_are_avoided_and_other_failures_end_the_integration() {
    // y' = -sqrt(y) reaches 0 at t = 2 and must not be evaluated below.
    let root = |_: f64, y: &[f64], slope: &mut [f64]| {
        if y[0] < 0.0 {
            return Err(Failure::Discard("below the ground".to_owned()));
        }
        slope[0] = -y[0].sqrt();
        Ok(())
    };
    let mut system = system(root, no_indicators);
    let mut integrator = Integrator::new(vec![1.0], 0);
    integrator.start(&mut system, 0.0, &[1.0], 1.5).unwrap();
    assert_eq!(integrator.advance(&mut system, 1.5), Ok(Reached::End));
    assert!((integrator.state()[0] - 0.0625).abs() < 1e-5);
    let fatal = |_: f64, _: &[f64], _: &mut [f64]| Err(Failure::Fatal("lost".to_owned()));
    let mut system = self::system(fatal, no_indicators);
    let failure = integrator.start(&mut system, 0.0, &[1.0], 1.0);
    assert_eq!(failure, Err(Failure::Fatal("lost".to_owned())));
}

#[test]
fn a_short_interval_costs_seven_evaluations_and_allocates_nothing() {
    let mut system = system(oscillator, no_indicators);
    let mut integrator = Integrator::new(vec![1.0; 2], 0);
    let allocations = allocation_counter::measure(|| {
        integrator.start(&mut system, 0.0, &[0.6, 0.8], 1e-3).unwrap();
        integrator.advance(&mut system, 1e-3).unwrap();
    });
    assert_eq!((system.evaluations, allocations.count_total), (7, 0));
}
