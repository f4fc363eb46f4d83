//! Comparison of the eigenvalues of A + B K with the requested ones.

use super::PlacementProblem;
use crate::Error;
use crate::eigen::eigenvalues;
use nalgebra::{Complex, DMatrix};

/// Largest relative error of an eigenvalue that is allowed.
///
/// The error is relative to the distance of the requested eigenvalue from 0, in sampled time from 1, because 1 - z is
/// about -s times the sample time for slow eigenvalues. Rounding errors of A + B K move a cluster of k eigenvalues near
/// zero by about the k-th root of these errors.
const ALLOWED: f64 = 1e-2;

impl PlacementProblem<'_> {
    /// The largest relative error, with requested and assigned eigenvalues paired, nearest first;
    /// [`Error::PolesMissed`] if it is above 1e-2, [`Error::NotConverged`] if eigenvalues are not found.
    pub(super) fn pole_error(&self, gain: &DMatrix<f64>) -> Result<f64, Error> {
        let mut assigned = eigenvalues(&(self.a + self.b * gain))?;
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
        if worst > ALLOWED {
            return Err(Error::PolesMissed { relative: worst, allowed: ALLOWED });
        }
        Ok(worst)
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

/// |x - y|, without overflow of the squares.
pub(crate) fn distance(x: Complex<f64>, y: Complex<f64>) -> f64 {
    (x.re - y.re).hypot(x.im - y.im)
}
