//! The search for the worst plant within tolerances.

use super::family::{PlantFamily, ToleranceCase, ToleranceSearch};
use crate::Domain;
use crate::blocks::{beside, to_complex};
use crate::eigen::eigenvalues;
use crate::exponential::exponential;
use nalgebra::{Complex, DMatrix, DVector};

type Vector = DVector<Complex<f64>>;

const ROUNDS: usize = 12;
/// Number of eigenvalues whose directions are tried from each start.
const MODES: usize = 6;
/// After a failed trial the number of parameters to move is divided by `FEWER`; with a controller of more than `LARGE`
/// states by `FEWER_IF_LARGE`, because each trial costs the eigenvalues of the loop.
const FEWER: usize = 2;
const FEWER_IF_LARGE: usize = 8;
const LARGE: usize = 50;
/// Relative shift of the eigenvalue in the inverse iteration.
const SHIFT: f64 = 1e-9;

/// Returns the worst case reached from `start` by moving the deviations with the largest gradients to their limits.
pub(super) fn climb<F: PlantFamily>(
    loops: &ToleranceSearch<'_, F>,
    start: ToleranceCase,
) -> Result<ToleranceCase, F::Error> {
    let mut worst = start;
    let large = loops.controller.a.nrows() > LARGE;
    for round in 0..ROUNDS {
        // No case is worse than a plant beyond the range of double precision, and it has no gradient.
        if worst.instability.is_infinite() {
            break;
        }
        let modes = if round == 0 { MODES } else { 1 };
        let mut improved = false;
        for gradient in gradients(loops, &worst.deviations, modes)? {
            let mut order: Vec<usize> = (0..gradient.len()).collect();
            order.sort_by(|i, j| gradient[*j].abs().total_cmp(&gradient[*i].abs()));
            let mut moved = gradient.len();
            while moved > 0 {
                let mut deviations = worst.deviations.clone();
                for &at in &order[..moved] {
                    if gradient[at].abs() > 0.0 {
                        deviations[at] = gradient[at].signum();
                    }
                }
                let instability = loops.instability(&deviations)?;
                if instability > worst.instability {
                    (worst, improved) = (ToleranceCase { instability, deviations }, true);
                    break;
                }
                moved /= if large { FEWER_IF_LARGE } else { FEWER };
            }
        }
        if !improved {
            break;
        }
    }
    Ok(worst)
}

/// The derivatives, with respect to the deviations, of [`Domain::excess`] of the `count` eigenvalues nearest to
/// instability; eigenvalues for which [`eigenvectors`] returns None are left out.
fn gradients<F: PlantFamily>(
    loops: &ToleranceSearch<'_, F>,
    deviations: &[f64],
    count: usize,
) -> Result<Vec<Vec<f64>>, F::Error> {
    let plant = loops.family.plant(deviations)?;
    let (n, m) = plant.b.shape();
    let domain = loops.controller.domain;
    let dynamics = loops.dynamics(plant.clone())?;
    let mut modes: Vec<_> =
        eigenvalues(&dynamics)?.into_iter().filter(|mode| mode.im >= 0.0).collect();
    modes.sort_by(|x, y| domain.excess(*y).total_cmp(&domain.excess(*x)));
    let half = match (plant.domain, domain) {
        (Domain::Sampled { .. }, _) | (_, Domain::Continuous) => None,
        (Domain::Continuous, Domain::Sampled { period }) => {
            let block = beside(&plant.a, &plant.b).resize_vertically(n + m, 0.0) * (0.5 * period);
            Some((to_complex(&exponential(&block)?), period))
        }
    };
    let controller = loops.controller;
    let command = to_complex(&controller.c);
    let direct = to_complex(&controller.d);
    let mut slopes = Vec::new();
    for mode in modes.into_iter().take(count) {
        let Some((left, right)) = eigenvectors(&dynamics, mode) else {
            continue;
        };
        let x: Vector = right.rows(0, n).into();
        // A held plant with a direct term has the previous commands among its states.
        let first = dynamics.nrows() - controller.a.nrows();
        let before: Vector = right.rows(n, first - n).into();
        let fed_back = &command * right.rows(first, controller.a.nrows());
        let through_d = if first > n { &before } else { &fed_back };
        let y = to_complex(&plant.c) * &x + to_complex(&plant.d) * through_d;
        let u = &fed_back + &direct * &y;
        // d lambda = of_plant [dA, dB] [x; u] + of_output [dC, dD] [x; u], the previous u with D in a held plant.
        let mut of_plant: Vector = left.rows(0, n).into();
        let mut input: Vector = DVector::zeros(n + m);
        input.rows_mut(0, n).copy_from(&x);
        input.rows_mut(n, m).copy_from(&u);
        let mut through = to_complex(&plant.b).tr_mul(&of_plant);
        if let Some((half, period)) = &half {
            let whole = half * half;
            through = whole.view((0, n), (n, m)).tr_mul(&of_plant);
            input = half * input;
            let product = half.view((0, 0), (n, n)).tr_mul(&of_plant);
            of_plant = product * Complex::new(*period, 0.0);
        }
        let of_output = direct.tr_mul(&through)
            + to_complex(&controller.b).tr_mul(&left.rows(first, controller.a.nrows()));
        let phase = match domain {
            Domain::Continuous => Complex::new(1.0, 0.0),
            Domain::Sampled { .. } => mode.conj() / mode.norm().max(f64::MIN_POSITIVE),
        };
        let outer = |effect: &Vector, by: &[Complex<f64>]| {
            DMatrix::from_fn(effect.nrows(), by.len(), |row, column| {
                (phase * effect[row] * by[column]).re
            })
        };
        let (of_x, of_u) = input.as_slice().split_at(n);
        let entries = [
            outer(&of_plant, of_x),
            outer(&of_plant, of_u),
            outer(&of_output, x.as_slice()),
            outer(&of_output, through_d.as_slice()),
        ];
        slopes.push(loops.family.slopes(&entries));
    }
    Ok(slopes)
}

/// Left and right eigenvector (row and column) with the product 1, by inverse iteration; None if the iteration fails
/// or the product of the unit vectors is exactly zero. For a defective eigenvalue that product is about `SHIFT`, so
/// that the left vector is large.
fn eigenvectors(m: &DMatrix<f64>, mode: Complex<f64>) -> Option<(Vector, Vector)> {
    let n = m.nrows();
    let shift = mode + Complex::new(SHIFT, SHIFT) * mode.norm().max(m.amax() * f64::EPSILON);
    let shifted = to_complex(m) - DMatrix::from_diagonal_element(n, n, shift);
    let iterate = |matrix: DMatrix<Complex<f64>>| {
        let lu = matrix.lu();
        let mut v = DVector::from_element(n, Complex::new(1.0, 0.3));
        for _ in 0..3 {
            v = lu.solve(&v)?;
            let size = v.norm();
            if !size.is_finite() || size <= 0.0 {
                return None;
            }
            v.unscale_mut(size);
        }
        Some(v)
    };
    let left = iterate(shifted.transpose())?;
    let right = iterate(shifted)?;
    let product = left.dot(&right);
    (product.norm() > 0.0).then(|| (left / product, right))
}
