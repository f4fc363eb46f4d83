//! Comparison of the eigenvalues of A + B K with the requested ones.

use super::PlacementProblem;
use crate::Error;
use crate::eigen::eigenvalues;
use nalgebra::{Complex, DMatrix};

/// Largest distance of an eigenvalue from the requested one, relative to the distance of the latter from 0, for
/// `x[k+1] = A x[k]` from 1: there 1 - z is about -s times the sample time for slow eigenvalues. Rounding errors of
/// A + B K move a cluster of k eigenvalues near zero by about their k-th root.
const ALLOWED: f64 = 1e-2;

impl PlacementProblem<'_> {
    /// The largest relative error, with requested and assigned eigenvalues paired, nearest first.
    pub(super) fn pole_error(&self, gain: &DMatrix<f64>) -> Result<f64, Error> {
        let mut reached = eigenvalues(&(self.a + self.b * gain))?;
        let mut open: Vec<_> = self.poles.iter().copied().zip(self.references()).collect();
        let mut worst = 0.0_f64;
        while !open.is_empty() {
            let pairs = (0..open.len()).flat_map(|i| (0..reached.len()).map(move |j| (i, j)));
            let relative = |(i, j): (usize, usize)| {
                let far = distance(reached[j], open[i].0);
                if far > 0.0 { far / open[i].1 } else { 0.0 }
            };
            let nearest = pairs.min_by(|&x, &y| relative(x).total_cmp(&relative(y)));
            let Some((i, j)) = nearest else { break };
            worst = worst.max(relative((i, j)));
            open.swap_remove(i);
            reached.swap_remove(j);
        }
        if worst > ALLOWED {
            return Err(Error::PolesMissed { relative: worst, allowed: ALLOWED });
        }
        Ok(worst)
    }

    /// For each requested eigenvalue its distance from the origin; for an eigenvalue at the origin
    /// the largest of these distances, or the norm of A if all are there.
    fn references(&self) -> Vec<f64> {
        let (a, origin) = (self.a, if self.sampled { 1.0 } else { 0.0 });
        let far: Vec<f64> = self.poles.iter().map(|&pole| distance(pole, origin.into())).collect();
        let largest = far.iter().copied().fold(0.0, f64::max);
        let moved = || a - DMatrix::from_diagonal_element(a.nrows(), a.ncols(), origin);
        let least = if largest > 0.0 { largest } else { moved().norm() };
        far.into_iter().map(|far| if far > 0.0 { far } else { least }).collect()
    }
}

/// |x - y|, of numbers whose squares may leave the range.
pub(crate) fn distance(x: Complex<f64>, y: Complex<f64>) -> f64 {
    (x.re - y.re).hypot(x.im - y.im)
}
