//! The first test of a model, and its results.

use std::path::Path;

use fmu::Simulation;

use super::BouncingBall;

#[test]
fn the_variables_keep_the_rules_of_the_standard() {
    assert_eq!(fmu::problems::<BouncingBall>(Path::new("resources")), Ok(vec![]));
}

/// Height and velocity after a fall from 1 m; the times of the impacts are a geometric series.
fn closed_form(time: f64, e: f64) -> [f64; 2] {
    let (mut impact, mut speed) = ((2.0_f64 / 9.81).sqrt(), (2.0_f64 * 9.81).sqrt());
    if time < impact {
        return [1.0 - 9.81 * time * time / 2.0, -9.81 * time];
    }
    loop {
        speed *= e;
        if speed < 0.1 {
            return [0.0; 2];
        }
        let flown = time - impact;
        impact += 2.0 * speed / 9.81;
        if time < impact {
            return [flown * (speed - 9.81 * flown / 2.0), speed - 9.81 * flown];
        }
    }
}

#[test]
fn the_ball_follows_the_closed_form_at_every_communication_step() {
    for (e, size, steps) in [(0.7, 3.0, 1), (0.7, 0.01, 300), (0.9, 0.37, 30), (0.5, 0.1, 20)] {
        let mut simulation = Simulation::<BouncingBall>::new(Path::new("resources")).unwrap();
        simulation.model_mut().e = e;
        for _ in 0..steps {
            simulation.step(size).unwrap();
            let [h, v] = closed_form(simulation.time(), e);
            let ball = simulation.model();
            assert!((ball.h - h).abs() < 1e-11 && (ball.v - v).abs() < 1e-10, "{} {}", ball.h, h);
        }
    }
}
