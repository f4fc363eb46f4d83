//! The trajectory that `scipy` computed from an independent implementation of (20) and (21).

use super::*;

const REFERENCE: &str = include_str!("../../../../tests/data/plant_reference.csv");

/// Length in s of the straight pieces of the force, and how many lie between two rows.
const HOLD: f64 = 0.01;
const HOLDS_PER_ROW: u32 = 8;

/// The force in N at the start of piece `k`.
fn node(k: u32) -> f64 {
    55.0 * (2.0 * std::f64::consts::PI * (f64::from(k) * HOLD)).sin()
}

#[test]
fn the_motion_through_fourteen_events_is_the_one_scipy_finds() {
    let lines = REFERENCE.lines().filter(|line| !line.starts_with('#')).skip(1);
    let rows: Vec<Vec<f64>> =
        lines.map(|line| line.split(',').map(|value| value.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), 50);
    let p = Parameters::default();
    let mut motion = start(&p, [0.1, 1.0, 0.0, 0.0], &Force::constant(0.0));
    let range = [0.5, 4.5, 3.6, 22.0, 60.0];
    let mut k = 0;
    for row in rows {
        for _ in 0..HOLDS_PER_ROW {
            let time = f64::from(k) * HOLD;
            let slope = (node(k + 1) - node(k)) / HOLD;
            let force = Force { value: node(k), slope, curvature: 0.0, start: time };
            motion.advance(&p, &force, time, HOLD, &Tolerance::default()).unwrap();
            k += 1;
        }
        assert!((row[0] - f64::from(k) * HOLD).abs() < 1e-12);
        let [x, angle, v, rate] = *motion.state();
        let computed = [x, angle, v, rate, motion.response(&p, node(k)).friction];
        for ((computed, expected), range) in computed.iter().zip(&row[1..6]).zip(range) {
            let difference = (computed - expected).abs() / range;
            assert!(difference < 1e-7, "t = {}: {computed} {expected}", row[0]);
        }
        assert!((motion.regime().sign() - row[6]).abs() < 0.5, "t = {}", row[0]);
    }
}
