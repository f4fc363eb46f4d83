//! A plant with the channels of its perturbations, and its loop with a controller.

use crate::blocks::{beside, block_2x2, stacked};
use crate::{Domain, StateSpace};
use nalgebra::DMatrix;

/// Rounding error of an entry, relative to the sum of the sizes of the numbers that were subtracted.
const ROUNDING: f64 = 1e-14;

/// The plant x' = A x + B1 w + B2 u, z = C1 x + D11 w + D12 u, y = C2 x + D21 w + D22 u, perturbed from z to w.
pub(super) struct GeneralisedPlant {
    pub(super) a: DMatrix<f64>,
    pub(super) b: [DMatrix<f64>; 2],
    pub(super) c: [DMatrix<f64>; 2],
    pub(super) d: [[DMatrix<f64>; 2]; 2],
    pub(super) domain: Domain,
}

impl GeneralisedPlant {
    /// M, from w to z, with u = K y; D of the controller or D22 is zero.
    pub(super) fn with_controller(&self, controller: &StateSpace) -> StateSpace {
        let Self { a, b: [b1, b2], c: [c1, c2], d: [[d11, d12], [d21, d22]], domain } = self;
        let StateSpace { a: a_k, b: b_k, c: c_k, d: d_k, .. } = controller;
        let fed_back = b2 * d_k;
        let measured = d12 * d_k;
        StateSpace {
            a: block_2x2(
                [&(a + &fed_back * c2), &(b2 * c_k)],
                [&(b_k * c2), &(a_k + b_k * d22 * c_k)],
            ),
            b: stacked(&(b1 + &fed_back * d21), &(b_k * d21)),
            c: beside(&(c1 + &measured * c2), &(d12 * c_k)),
            d: d11 + measured * d21,
            domain: *domain,
        }
    }
}

/// The channels of all deviations: deviation i changes a matrix by `L_i R_i'`; `left` is all `L_i`, `right` all `R_i`.
pub(super) struct Channels {
    pub(super) left: DMatrix<f64>,
    pub(super) right: DMatrix<f64>,
    /// The number of channels of each deviation.
    pub(super) ranks: Vec<usize>,
}

impl Channels {
    pub(super) fn of(changes: &[DMatrix<f64>], (rows, columns): (usize, usize)) -> Self {
        let (left, right) = (DMatrix::zeros(rows, 0), DMatrix::zeros(columns, 0));
        let mut channels = Self { left, right, ranks: Vec::with_capacity(changes.len()) };
        for change in changes {
            let [left, right] = factors(change);
            channels.ranks.push(left.ncols());
            channels.left = beside(&channels.left, &left);
            channels.right = beside(&channels.right, &right);
        }
        channels
    }
}

/// L and R with P = L R' and as many columns as the rank of P, by elimination with complete pivoting.
fn factors(p: &DMatrix<f64>) -> [DMatrix<f64>; 2] {
    let (mut rest, mut size) = (p.clone(), p.abs());
    let (mut left, mut right) = (Vec::new(), Vec::new());
    for _ in 0..p.nrows().min(p.ncols()) {
        let (row, column) = rest.iamax_full();
        let pivot = rest[(row, column)];
        if pivot == 0.0 {
            break;
        }
        let l = rest.column(column).into_owned();
        let r = rest.row(row).transpose() / pivot;
        let product = &l * r.transpose();
        size += product.abs();
        rest -= product;
        rest.row_mut(row).fill(0.0);
        rest.column_mut(column).fill(0.0);
        rest.zip_apply(&size, |entry, size| {
            if entry.abs() <= ROUNDING * size {
                *entry = 0.0;
            }
        });
        // Both factors get equal norms, so that channels are of similar size.
        let share = (l.norm() / r.norm()).sqrt();
        left.push(l / share);
        right.push(r * share);
    }
    let matrix = |columns: &[nalgebra::DVector<f64>], rows: usize| {
        DMatrix::from_fn(rows, columns.len(), |i, j| columns[j][i])
    };
    [matrix(&left, p.nrows()), matrix(&right, p.ncols())]
}
