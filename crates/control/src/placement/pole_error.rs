//! Comparison of the eigenvalues of A + B K with the requested ones.

use crate::Error;
use crate::eigen::eigenvalues;
use nalgebra::{Complex, DMatrix};

/// The tolerance of assigned eigenvalues.
pub(crate) struct PoleTolerance {
    /// Errors are relative to the distance of the requested eigenvalue from this point.
    pub(crate) origin: f64,
    /// Largest relative distance.
    pub(crate) allowed: f64,
    /// Whether the eigenvalues are those of a sampled system.
    pub(crate) sampled: bool,
}

/// The tolerance for x' = A x.
pub(crate) const CONTINUOUS: PoleTolerance =
    PoleTolerance { origin: 0.0, allowed: 1e-2, sampled: false };
/// The tolerance for `x[k+1] = A x[k]`, where 1 - z is about -s times the sample time for slow
/// eigenvalues. Rounding errors of A + B K move a cluster of k eigenvalues near zero by about their
/// k-th root.
pub(crate) const DISCRETE: PoleTolerance =
    PoleTolerance { origin: 1.0, allowed: 1e-2, sampled: true };

impl PoleTolerance {
    /// The largest relative error, with requested and assigned eigenvalues paired, nearest first.
    pub(crate) fn pole_error(
        &self,
        a: &DMatrix<f64>,
        b: &DMatrix<f64>,
        gain: &DMatrix<f64>,
        poles: &[Complex<f64>],
    ) -> Result<f64, Error> {
        let mut reached = eigenvalues(&(a + b * gain))?;
        let references = self.references(a, poles);
        let mut open: Vec<_> = poles.iter().copied().zip(references).collect();
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
        if worst > self.allowed {
            return Err(Error::PolesMissed { relative: worst, allowed: self.allowed });
        }
        Ok(worst)
    }

    /// For each requested eigenvalue its distance from the origin; for an eigenvalue at the origin
    /// the largest of these distances, or the norm of A if all are there.
    fn references(&self, a: &DMatrix<f64>, poles: &[Complex<f64>]) -> Vec<f64> {
        let origin = Complex::new(self.origin, 0.0);
        let far: Vec<f64> = poles.iter().map(|&pole| distance(pole, origin)).collect();
        let largest = far.iter().copied().fold(0.0, f64::max);
        let moved = || a - DMatrix::from_diagonal_element(a.nrows(), a.ncols(), self.origin);
        let least = if largest > 0.0 { largest } else { moved().norm() };
        far.into_iter().map(|far| if far > 0.0 { far } else { least }).collect()
    }
}

/// |x - y|, of numbers whose squares may leave the range.
pub(crate) fn distance(x: Complex<f64>, y: Complex<f64>) -> f64 {
    (x.re - y.re).hypot(x.im - y.im)
}
