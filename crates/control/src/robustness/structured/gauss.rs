//! The Gauss method. For a plant with varying entries its step is a linear fractional function of the deviations.

use crate::Error;
use nalgebra::{DMatrix, DVector};

/// The Gauss method with 1, 2 or 3 stages, of order 2, 4 or 6: a diagonal Padé approximation of the exponential.
///
/// Source: E. Hairer and G. Wanner, Solving ordinary differential equations II (1996), table IV.5.1 and theorem IV.3.9.
pub(super) struct Gauss {
    pub(super) coefficients: DMatrix<f64>,
    pub(super) weights: DVector<f64>,
}

impl Gauss {
    pub(super) fn new(stages: usize) -> Self {
        let root = 3.0_f64.sqrt() / 6.0;
        let fifteen = 15.0_f64.sqrt();
        let (coefficients, weights) = match stages {
            1 => (vec![0.5], vec![1.0]),
            2 => (vec![0.25, 0.25 - root, 0.25 + root, 0.25], vec![0.5, 0.5]),
            _ => (
                vec![
                    5.0 / 36.0,
                    2.0 / 9.0 - fifteen / 15.0,
                    5.0 / 36.0 - fifteen / 30.0,
                    5.0 / 36.0 + fifteen / 24.0,
                    2.0 / 9.0,
                    5.0 / 36.0 - fifteen / 24.0,
                    5.0 / 36.0 + fifteen / 30.0,
                    2.0 / 9.0 + fifteen / 15.0,
                    5.0 / 36.0,
                ],
                vec![5.0 / 18.0, 4.0 / 9.0, 5.0 / 18.0],
            ),
        };
        let stages = weights.len();
        Self {
            coefficients: DMatrix::from_row_slice(stages, stages, &coefficients),
            weights: DVector::from_vec(weights),
        }
    }

    /// One step of xi' = Z xi + L w, z = R' xi with a value of w for each stage.
    pub(super) fn step(
        &self,
        z: &DMatrix<f64>,
        [left, right]: [&DMatrix<f64>; 2],
        time: f64,
    ) -> Result<Step, Error> {
        let (stages, n) = (self.weights.len(), z.nrows());
        let identity = DMatrix::identity(n, n);
        let pencil =
            DMatrix::identity(stages * n, stages * n) - self.coefficients.kronecker(z) * time;
        let ones = DMatrix::from_element(stages, 1, 1.0);
        let each = DMatrix::identity(stages, stages);
        let from_start = ones.kronecker(z);
        let from_w = each.kronecker(left);
        let lu = pencil.lu();
        let singular = Error::Overflow { what: "a step of the Gauss method" };
        let from_start = lu.solve(&from_start).ok_or(singular.clone())?;
        let from_w = lu.solve(&from_w).ok_or(singular)?;
        // Stages xi + h (a x I) k, end xi + h (b' x I) k, with the derivatives k and the Kronecker product x.
        let inner = self.coefficients.kronecker(&identity) * time;
        let outer = self.weights.transpose().kronecker(&identity) * time;
        let read = each.kronecker(&right.transpose());
        Ok(Step {
            c: &read * (ones.kronecker(&identity) + &inner * from_start),
            d: read * inner * &from_w,
            b: outer * from_w,
        })
    }
}

/// A step of the Gauss method from xi: z of all stages is C xi + D w, and w adds B w to xi at the end.
pub(super) struct Step {
    pub(super) b: DMatrix<f64>,
    pub(super) c: DMatrix<f64>,
    pub(super) d: DMatrix<f64>,
}
