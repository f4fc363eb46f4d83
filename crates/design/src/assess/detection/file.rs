//! The section `[detection]` of the design file.

use aso_controller::design::detection::{DetectionDesign, TestDesign};
use control::Domain;
use nalgebra::DMatrix;

use crate::assess::detection::problem::Problem;
use crate::assess::detection::{Part, tests};
use crate::matrix::matrix;
use crate::solve::solution::Solution;

/// Returns the section: the filters of all parts as one filter, and their tests. `from`: the time, s, at which the
/// tests start.
pub(super) fn section(
    problem: &Problem,
    parts: &[Part<'_>],
    from: f64,
    designed: &Solution,
) -> DetectionDesign {
    let orders = parts.iter().map(|part| part.decoupling.filter.generator.a.nrows());
    let k: usize = orders.sum();
    let all: usize = tests(parts).map(|(_, test)| test.rows.nrows()).sum();
    let (n, m) = problem.plant.b.shape();
    let p = problem.plant.c.nrows();
    let zeros = |rows, columns| DMatrix::<f64>::zeros(rows, columns);
    let (mut a, mut b_u, mut b_y) = (zeros(k, k), zeros(k, m), zeros(k, p));
    let (mut c, mut d_u, mut d_y) = (zeros(all, k), zeros(all, m), zeros(all, p));
    let mut start = zeros(k, designed.plant.a.nrows());
    let (mut state, mut row) = (0, 0);
    for part in parts {
        let filter = &part.decoupling.filter;
        let generator = &filter.generator;
        let order = generator.a.nrows();
        a.view_mut((state, state), (order, order)).copy_from(&generator.a);
        b_u.rows_mut(state, order).copy_from(&generator.b_u);
        b_y.rows_mut(state, order).copy_from(&generator.b_y);
        start.view_mut((state, 0), (order, n)).copy_from(&filter.start.columns(0, n));
        for test in &part.tests {
            let count = test.rows.nrows();
            c.view_mut((row, state), (count, order)).copy_from(&(&test.rows * &generator.c));
            d_u.rows_mut(row, count).copy_from(&(&test.rows * &generator.d_u));
            d_y.rows_mut(row, count).copy_from(&(&test.rows * &generator.d_y));
            row += count;
        }
        state += order;
    }
    let entry = |(_, test): (_, &crate::assess::detection::PlannedTest)| TestDesign {
        name: test.name.clone(),
        residuals: test.rows.nrows(),
        drift: test.kind.drift(),
        window: test.kind.window(),
        threshold: test.kind.threshold(),
        reacts: test.reacts.clone(),
    };
    let fault = |fault| problem.names[problem.fault_at(fault)].clone();
    DetectionDesign {
        sample_time: (designed.domain == Domain::Continuous).then_some(problem.period),
        from,
        a: matrix(&a),
        b_u: matrix(&b_u),
        b_y: matrix(&b_y),
        c: matrix(&c),
        d_u: matrix(&d_u),
        d_y: matrix(&d_y),
        start: matrix(&start),
        faults: problem.faults.clone().map(fault).collect(),
        tests: tests(parts).map(entry).collect(),
    }
}
