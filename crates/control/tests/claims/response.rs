mod between;
mod extremes;
mod fault;
mod norms;
mod time;

use crate::matrix;
use crate::recorded::Case;
use control::Domain;
use control::StateSpace;
use nalgebra::DMatrix;

const RECORDED: &str = include_str!("../data/response.txt");
const CONTINUOUS: Domain = Domain::Continuous;

fn system(case: &Case, domain: Domain) -> StateSpace {
    let get = |name| case.get(name).clone();
    StateSpace { a: get("A"), b: get("B"), c: get("C"), d: get("D"), domain }
}

/// One input, one output, no D.
fn single(a: DMatrix<f64>, b: &[f64], c: &[f64], domain: Domain) -> StateSpace {
    let n = a.nrows();
    StateSpace { a, b: matrix(n, 1, b), c: matrix(1, n, c), d: DMatrix::zeros(1, 1), domain }
}

/// w^2 / (s^2 + 2 zeta w s + w^2).
fn oscillator(w: f64, zeta: f64) -> StateSpace {
    let a = matrix(2, 2, &[0.0, 1.0, -w * w, -2.0 * zeta * w]);
    single(a, &[0.0, w * w], &[1.0, 0.0], CONTINUOUS)
}
