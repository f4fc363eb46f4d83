//! The section `[detection]` of the design file.

use control::Domain;
use nalgebra::DMatrix;
use serde::Serialize;

use super::problem::Problem;
use super::{Part, tests};
use crate::designed::ControllerDesign;
use crate::report::rows;

/// The content of the section; the names are those of the controller FMU.
#[derive(Serialize)]
pub(crate) struct Section {
    #[serde(skip_serializing_if = "Option::is_none")]
    sample_time: Option<f64>,
    from: f64,
    #[serde(rename = "A")]
    a: Vec<Vec<f64>>,
    #[serde(rename = "B_u")]
    b_u: Vec<Vec<f64>>,
    #[serde(rename = "B_y")]
    b_y: Vec<Vec<f64>>,
    #[serde(rename = "C")]
    c: Vec<Vec<f64>>,
    #[serde(rename = "D_u")]
    d_u: Vec<Vec<f64>>,
    #[serde(rename = "D_y")]
    d_y: Vec<Vec<f64>>,
    start: Vec<Vec<f64>>,
    faults: Vec<String>,
    tests: Vec<TestEntry>,
}

#[derive(Serialize)]
struct TestEntry {
    name: String,
    residuals: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    drift: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    window: Option<u32>,
    threshold: f64,
    reacts: Vec<bool>,
}

impl Section {
    /// The filters of all parts as one filter.
    pub(super) fn new(
        problem: &Problem,
        parts: &[Part],
        from: f64,
        designed: &ControllerDesign,
    ) -> Self {
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
            let own = &filter.generator;
            let order = own.a.nrows();
            a.view_mut((state, state), (order, order)).copy_from(&own.a);
            b_u.rows_mut(state, order).copy_from(&own.b_u);
            b_y.rows_mut(state, order).copy_from(&own.b_y);
            start.view_mut((state, 0), (order, n)).copy_from(&filter.start.columns(0, n));
            for test in &part.tests {
                let count = test.rows.nrows();
                c.view_mut((row, state), (count, order)).copy_from(&(&test.rows * &own.c));
                d_u.rows_mut(row, count).copy_from(&(&test.rows * &own.d_u));
                d_y.rows_mut(row, count).copy_from(&(&test.rows * &own.d_y));
                row += count;
            }
            state += order;
        }
        let entry = |(_, test): (_, &super::PlannedTest)| TestEntry {
            name: test.name.clone(),
            residuals: test.rows.nrows(),
            drift: test.kind.drift(),
            window: test.kind.window(),
            threshold: test.kind.threshold(),
            reacts: test.reacts.clone(),
        };
        let fault = |fault| problem.names[problem.fault_at(fault)].clone();
        Self {
            sample_time: match designed.domain {
                Domain::Continuous => Some(problem.period),
                Domain::Sampled { .. } => None,
            },
            from,
            a: rows(&a),
            b_u: rows(&b_u),
            b_y: rows(&b_y),
            c: rows(&c),
            d_u: rows(&d_u),
            d_y: rows(&d_y),
            start: rows(&start),
            faults: problem.faults.clone().map(fault).collect(),
            tests: tests(parts).map(entry).collect(),
        }
    }
}
