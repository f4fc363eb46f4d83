//! Comparison of the eigenvalues of A + B K with the requested ones.

use super::pole_block::{PoleBlock, distance};
use super::{EXACT, PlacementProblem};
use crate::Error;
use crate::balance::{divide_rows, multiply_columns, similar};
use crate::blocks::{beside, block_diagonal, stacked};
use crate::check::as_number;
use crate::eigen::eigenvalues;
use crate::product::AccurateProduct;
use nalgebra::{Complex, DMatrix, DVector};

/// Largest relative error of an eigenvalue that is allowed.
///
/// The error is relative to the distance of the requested eigenvalue from 0, in sampled time from 1, because 1 - z is
/// about -s times the sample time for slow eigenvalues. Rounding errors of A + B K move a cluster of k eigenvalues near
/// zero by about the k-th root of these errors.
const ALLOWED: f64 = 1e-2;
/// Largest n eps times the condition number of the eigenvectors with which they give the error.
const INDEPENDENT: f64 = 1e-2;

/// The eigenvectors of an assignment in units of the states.
pub(super) struct Eigenvectors<'a> {
    /// V, n x n, in units of the states.
    pub(super) v: DMatrix<f64>,
    /// The units of the states, powers of two.
    pub(super) units: &'a DVector<f64>,
    /// The condition number of V.
    pub(super) condition: f64,
}

impl PlacementProblem<'_> {
    /// The largest relative error of an eigenvalue of A + B K; [`Error::PolesMissed`] if it is above 1e-2,
    /// [`Error::NotConverged`] if eigenvalues are not found.
    ///
    /// `assigned`: the eigenvectors in the order of `blocks`. The rounding errors of an eigenvalue are up to the
    /// condition number of V times those of A + B K. If the error is above 1e-9, it is computed again, from
    /// V^-1 (A + B K) V = M + V^-1 ((A + B K) V - V M) with the requested eigenvalues in M and a residual in twice the
    /// precision: the rounding errors are then relative to the deviation from M.
    pub(super) fn pole_error(
        &self,
        gain: &DMatrix<f64>,
        assigned: &Eigenvectors<'_>,
        blocks: impl Iterator<Item = PoleBlock>,
    ) -> Result<f64, Error> {
        let mut worst = self.largest_error(eigenvalues(&(self.a + self.b * gain))?);
        let rounding = as_number(self.poles.len()) * f64::EPSILON * assigned.condition;
        if worst > EXACT
            && rounding <= INDEPENDENT
            && let Some(similar) = self.similar(gain, assigned, blocks)
            && let Ok(eigenvalues) = eigenvalues(&similar)
        {
            worst = self.largest_error(eigenvalues);
        }
        if worst > ALLOWED {
            return Err(Error::PolesMissed { relative: worst, allowed: ALLOWED });
        }
        Ok(worst)
    }

    /// V^-1 (A + B K) V; None if V is singular.
    fn similar(
        &self,
        gain: &DMatrix<f64>,
        Eigenvectors { v, units, .. }: &Eigenvectors<'_>,
        blocks: impl Iterator<Item = PoleBlock>,
    ) -> Option<DMatrix<f64>> {
        let m = block_diagonal(&blocks.map(PoleBlock::block).collect::<Vec<_>>());
        let a = similar(self.a, units);
        let b = divide_rows(self.b, units);
        let response = AccurateProduct::new(&multiply_columns(gain, units), v);
        let factors = beside(&beside(&a, &b), &beside(&b, &-v));
        let terms = stacked(&stacked(v, &response.high), &stacked(&response.low, &m));
        let residual = AccurateProduct::new(&factors, &terms).high;
        Some(m + v.clone().lu().solve(&residual)?)
    }

    /// The largest relative error of `assigned`, with requested and assigned eigenvalues paired, nearest first.
    fn largest_error(&self, mut assigned: Vec<Complex<f64>>) -> f64 {
        let mut requested: Vec<_> = self.poles.iter().copied().zip(self.references()).collect();
        let mut worst = 0.0_f64;
        while !requested.is_empty() {
            let count = requested.len();
            let pairs = (0..count).flat_map(|i| (0..count).map(move |j| (i, j)));
            let relative = |(i, j): (usize, usize)| {
                let (pole, reference) = requested[i];
                let error = distance(assigned[j], pole);
                if error > 0.0 { error / reference } else { 0.0 }
            };
            let nearest = pairs.min_by(|&x, &y| relative(x).total_cmp(&relative(y)));
            let Some((i, j)) = nearest else { break };
            worst = worst.max(relative((i, j)));
            requested.swap_remove(i);
            assigned.swap_remove(j);
        }
        worst
    }

    /// For each requested eigenvalue, the reference of its error: its distance from 0 (in sampled time from 1). A zero
    /// distance is replaced by the largest distance or, if all are zero, by the norm of A (in sampled time of A - I).
    fn references(&self) -> Vec<f64> {
        let (a, origin) = (self.a, if self.sampled { 1.0 } else { 0.0 });
        let distances: Vec<f64> =
            self.poles.iter().map(|&pole| distance(pole, origin.into())).collect();
        let largest = distances.iter().copied().fold(0.0, f64::max);
        let shifted = || a - DMatrix::from_diagonal_element(a.nrows(), a.ncols(), origin);
        let substitute = if largest > 0.0 { largest } else { shifted().norm() };
        distances.into_iter().map(|far| if far > 0.0 { far } else { substitute }).collect()
    }
}
