//! Secant information: a least squares model of the inverse matrix from past iterates.

use serde::{Deserialize, Serialize};

/// A residual whose change is below this fraction of the change of the values changes only by rounding.
const ROUNDING: f64 = 1e-11;

/// Pairs of differences, dR of residuals and dG of values, the newest first.
///
/// The least squares problem `min |r - dR c|`, r the residual, in the weighted norm is solved by Gram-Schmidt
/// orthogonalisation, done twice, from the newest column to the oldest. If orthogonalisation against the newer
/// columns reduces the norm of a column below a given ratio, the column is linearly dependent and is
/// dropped: the filter QR2 of Haelterman, Bogaers, Scheufele, Uekermann and Mehl 2016, "Improving the
/// performance of the partitioned QN-ILS procedure for fluid-structure interaction problems: Filtering".
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Secants {
    n: usize,
    /// The number of slots, with one pair of differences in each slot.
    capacity: usize,
    /// The slots in use, the newest pair first.
    order: Vec<usize>,
    /// The age of the pair in each slot, in solutions.
    ages: Vec<u32>,
    /// The slots that are not in use.
    free: Vec<usize>,
    /// dR, the differences of residuals, n entries for each slot.
    residuals: Vec<f64>,
    /// dG, the differences of values, n entries for each slot.
    values: Vec<f64>,
    /// The factor Q, column by column.
    orthonormal: Vec<f64>,
    /// The triangle R, column by column, `capacity` entries for each.
    triangle: Vec<f64>,
    /// `Q' r`, overwritten by the coefficients c.
    coefficients: Vec<f64>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Evaluation {
    /// The residual G(u) - u.
    residual: Vec<f64>,
    /// The value G(u).
    value: Vec<f64>,
}

impl Evaluation {
    pub(super) fn new(n: usize) -> Self {
        Self { residual: vec![0.0; n], value: vec![0.0; n] }
    }
}

/// The ratios of norms below which pairs are dropped as linearly dependent.
#[derive(Clone, Copy)]
pub(super) struct Filters {
    /// The ratio for pairs of the present solution.
    pub(super) present: f64,
    /// The ratio for pairs of earlier solutions.
    pub(super) earlier: f64,
}

impl Secants {
    pub(super) fn new(n: usize, capacity: usize) -> Self {
        Self {
            n,
            capacity,
            order: Vec::with_capacity(capacity),
            ages: vec![0; capacity],
            free: (0..capacity).collect(),
            residuals: vec![0.0; n * capacity],
            values: vec![0.0; n * capacity],
            orthonormal: vec![0.0; n * capacity],
            triangle: vec![0.0; capacity * capacity],
            coefficients: vec![0.0; capacity],
        }
    }

    pub(super) fn clear(&mut self) {
        self.free.append(&mut self.order);
        self.free.sort_unstable_by(|a, b| b.cmp(a));
    }

    pub(super) fn is_empty(&self) -> bool {
        self.order.is_empty()
    }

    /// Increments the age of all pairs after a solution and drops pairs older than `oldest`.
    pub(super) fn age_pairs(&mut self, oldest: u32) {
        for &slot in &self.order {
            self.ages[slot] += 1;
        }
        let (ages, free) = (&self.ages, &mut self.free);
        self.order.retain(|&slot| {
            let is_recent = ages[slot] <= oldest;
            if !is_recent {
                free.push(slot);
            }
            is_recent
        });
    }

    /// Adds the differences of `residual` and `g` from the `last` ones; drops the oldest pair if no slot is free.
    fn push(&mut self, residual: &[f64], g: &[f64], last: &Evaluation) {
        let Some(slot) = self.free.pop().or_else(|| self.order.pop()) else { return };
        let entries = slot * self.n..(slot + 1) * self.n;
        subtract(&mut self.residuals[entries.clone()], residual, &last.residual);
        subtract(&mut self.values[entries], g, &last.value);
        self.ages[slot] = 0;
        self.order.insert(0, slot);
    }

    /// Adds the differences between this evaluation and the `last` one, unless it is the `first`; replaces `last`.
    pub(super) fn learn(
        &mut self,
        last: &mut Evaluation,
        residual: &[f64],
        g: &[f64],
        first: bool,
    ) {
        if !first {
            self.push(residual, g, last);
        }
        last.residual.copy_from_slice(residual);
        last.value.copy_from_slice(g);
    }

    /// Computes `u_next = g - dG c`, where c is the least squares solution of `dR c = residual`, and drops
    /// linearly dependent pairs. Without pairs `u_next` is g.
    pub(super) fn apply(
        &mut self,
        residual: &[f64],
        weights: &[f64],
        filters: Filters,
        g: &[f64],
        u_next: &mut [f64],
    ) {
        let mut rank = 0;
        while rank < self.order.len() {
            let slot = self.order[rank];
            let filter = if self.ages[slot] == 0 { filters.present } else { filters.earlier };
            if rank < self.n && self.orthogonalise(slot, rank, weights, filter) {
                rank += 1;
            } else {
                self.order.remove(rank);
                self.free.push(slot);
            }
        }
        self.project(rank, residual, weights);
        u_next.copy_from_slice(g);
        for (&slot, coefficient) in self.order.iter().zip(&self.coefficients) {
            let column = &self.values[slot * self.n..(slot + 1) * self.n];
            for (next, entry) in u_next.iter_mut().zip(column) {
                *next -= coefficient * entry;
            }
        }
    }

    /// Computes column `rank` of Q and R from the pair in `slot`. Returns false if the norm of the column falls below
    /// the ratio `filter`, is a rounding error of the change of the values, or is NaN.
    fn orthogonalise(&mut self, slot: usize, rank: usize, weights: &[f64], filter: f64) -> bool {
        let n = self.n;
        let (done, rest) = self.orthonormal.split_at_mut(rank * n);
        let column = &mut rest[..n];
        let source = &self.residuals[slot * n..(slot + 1) * n];
        for ((entry, value), weight) in column.iter_mut().zip(source).zip(weights) {
            *entry = value / weight;
        }
        let whole = length(column);
        let triangle = &mut self.triangle[rank * self.capacity..][..=rank];
        triangle.fill(0.0);
        for _ in 0..2 {
            for (other, entry) in done.chunks_exact(n).zip(triangle.iter_mut()) {
                let part = dot(other, column);
                *entry += part;
                for (value, direction) in column.iter_mut().zip(other) {
                    *value -= part * direction;
                }
            }
        }
        let remainder = length(column);
        let change = &self.values[slot * n..(slot + 1) * n];
        let change = change.iter().zip(weights).map(|(value, weight)| (value / weight).powi(2));
        let negligible = ROUNDING * change.sum::<f64>().sqrt();
        if remainder <= filter * whole || remainder <= negligible || remainder.is_nan() {
            return false;
        }
        triangle[rank] = remainder;
        for entry in column {
            *entry /= remainder;
        }
        true
    }

    /// Computes the first `rank` coefficients c from `R c = Q' residual`.
    fn project(&mut self, rank: usize, residual: &[f64], weights: &[f64]) {
        for (column, entry) in self.orthonormal.chunks_exact(self.n).zip(&mut self.coefficients) {
            let products = column.iter().zip(residual).zip(weights);
            *entry = products.map(|((q, r), weight)| q * r / weight).sum();
        }
        for column in (0..rank).rev() {
            let entries = &self.triangle[column * self.capacity..][..=column];
            let value = self.coefficients[column] / entries[column];
            self.coefficients[column] = value;
            for (other, entry) in self.coefficients.iter_mut().zip(&entries[..column]) {
                *other -= entry * value;
            }
        }
    }
}

fn subtract(target: &mut [f64], after: &[f64], before: &[f64]) {
    for ((target, after), before) in target.iter_mut().zip(after).zip(before) {
        *target = after - before;
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn length(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}
