//! Entries from 1e-60 to 1e60: an answer or an error, never a panic or a run without end.

use super::CONTINUOUS;
use crate::integers;
use control::Domain;
use control::StateSpace;
use control::lyapunov::discrete_lyapunov;
use control::response::{
    energy, frequency_grid, frequency_response, h_infinity, peak_gain, step_response,
};
use control::riccati::{Weights, kalman, lqr};
use nalgebra::DMatrix;

fn wild(case: i32, rows: usize, cols: usize, seed: i32) -> DMatrix<f64> {
    let entry = |i: i32, j: i32| (case * 13 + seed + 7 * i * i + 5 * i * j + 3 * j) % 31 - 15;
    integers(rows, cols, entry).map(|k| k.signum() * (10.0 * k).exp2().powf(1.0 + k.abs() / 40.0))
}

fn assert_finite(m: &DMatrix<f64>) {
    assert!(m.iter().all(|entry| entry.is_finite()), "{m}");
}

#[test]
fn riccati_equations_end_in_an_answer_or_an_error() {
    for case in 0..40 {
        let (a, b) = (wild(case, 4, 4, 0), wild(case, 4, 2, 1));
        let root = wild(case, 4, 4, 5);
        let size = wild(case, 2, 2, 7).map(f64::abs);
        let q = DMatrix::from_diagonal(&root.diagonal().map(f64::abs));
        let r = DMatrix::from_diagonal(&size.diagonal());
        let n = (case % 2 == 0).then(|| wild(case, 4, 2, 9) * 1e-30);
        let weights = Weights { q: q.clone(), r: r.clone(), n };
        for domain in [CONTINUOUS, Domain::Sampled { period: 0.1 }] {
            let _ = lqr(&a, &b, &weights, domain).map(|actual| assert_finite(&actual.gain));
            let _ = kalman(&a, &b.transpose(), &q, &r, domain).map(|f| assert_finite(&f.gain));
        }
        let _ = discrete_lyapunov(&a, &q).map(|actual| assert_finite(&actual.p));
    }
}

#[test]
fn responses_end_in_an_answer_or_an_error() {
    for case in 0..20 {
        let mut a = wild(case, 4, 4, 0).upper_triangle();
        for i in 0..4 {
            a[(i, i)] = -a[(i, i)].abs() - 1e-3;
        }
        let (b, c, d) = (wild(case, 4, 2, 1), wild(case, 2, 4, 3), DMatrix::zeros(2, 2));
        let contracted = a.map(|entry| entry % 1.0);
        let sampled = Domain::Sampled { period: 0.1 };
        for (a, domain) in [(a, CONTINUOUS), (contracted, sampled)] {
            let system = StateSpace { a, b: b.clone(), c: c.clone(), d: d.clone(), domain };
            let _ = peak_gain(&system, 1e-2).map(|gain| {
                assert!(gain.lower.iter().zip(gain.upper.iter()).all(|(low, up)| low <= up));
            });
            let _ = energy(&system).map(|actual| assert!(actual.h2.is_finite()));
            let _ = h_infinity(&system, 1e-6).map(|actual| assert!(actual.lower < f64::INFINITY));
            let _ = step_response(&system, 0).map(|trace| assert_finite(&trace.output));
            let _ = frequency_grid(&system, 5).and_then(|grid| frequency_response(&system, &grid));
        }
    }
}
