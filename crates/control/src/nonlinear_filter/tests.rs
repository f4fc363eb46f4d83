//! Tests against closed forms and the linear Kalman filter.

use std::convert::Infallible;

use nalgebra::{DMatrix, DVector};

use super::{FilterError, NonlinearFilter, SampledPlant, Transform, square_root};
use crate::Domain;
use crate::riccati::kalman;

fn matrix<const R: usize, const C: usize>(rows: [[f64; C]; R]) -> DMatrix<f64> {
    DMatrix::from_fn(R, C, |i, j| rows[i][j])
}

const BOTH: [Transform; 2] = [Transform::Extended, Transform::Unscented];

/// z[k+1] = A z[k], y[k] = C z[k].
struct Linear {
    a: DMatrix<f64>,
    c: DMatrix<f64>,
}

impl SampledPlant for Linear {
    type Error = Infallible;

    fn advance(&mut self, z: &mut [f64]) -> Result<(), Infallible> {
        let next = &self.a * DVector::from_column_slice(z);
        z.copy_from_slice(next.as_slice());
        Ok(())
    }

    fn advance_tangent(&mut self, z: &mut [f64], g: &mut DMatrix<f64>) -> Result<(), Infallible> {
        g.copy_from(&self.a);
        self.advance(z)
    }

    fn measure(&mut self, z: &[f64], y: &mut [f64]) -> Result<(), Infallible> {
        y.copy_from_slice((&self.c * DVector::from_column_slice(z)).as_slice());
        Ok(())
    }

    fn measure_tangent(
        &mut self,
        z: &[f64],
        y: &mut [f64],
        h: &mut DMatrix<f64>,
    ) -> Result<(), Infallible> {
        h.copy_from(&self.c);
        self.measure(z, y)
    }
}

/// One constant state, whose square is measured.
struct Square;

impl SampledPlant for Square {
    type Error = Infallible;

    fn advance(&mut self, _z: &mut [f64]) -> Result<(), Infallible> {
        Ok(())
    }

    fn advance_tangent(&mut self, _z: &mut [f64], g: &mut DMatrix<f64>) -> Result<(), Infallible> {
        g.fill(1.0);
        Ok(())
    }

    fn measure(&mut self, z: &[f64], y: &mut [f64]) -> Result<(), Infallible> {
        y[0] = z[0] * z[0];
        Ok(())
    }

    fn measure_tangent(
        &mut self,
        z: &[f64],
        y: &mut [f64],
        h: &mut DMatrix<f64>,
    ) -> Result<(), Infallible> {
        h[(0, 0)] = 2.0 * z[0];
        self.measure(z, y)
    }
}

#[test]
fn for_a_linear_plant_the_covariance_converges_to_the_riccati_solution() {
    let a = matrix([[1.0, 0.1, 0.005], [0.0, 0.95, 0.1], [0.0, 0.0, 1.0]]);
    let c = matrix([[1.0, 0.0, 0.0]]);
    let w = DMatrix::from_diagonal(&DVector::from_vec(vec![0.0, 1e-4, 1e-2]));
    let v = matrix([[1e-3]]);
    let stationary = kalman(&a, &c, &w, &v, Domain::Sampled { period: 0.1 }).unwrap();
    for transform in BOTH {
        let mut filter = NonlinearFilter::new(w.clone(), v.clone());
        let mut plant = Linear { a: a.clone(), c: c.clone() };
        for _ in 0..2000 {
            filter.correct(&mut plant, &[0.0], |_| true, transform).unwrap();
            filter.predict(&mut plant, transform).unwrap();
        }
        let difference = (&filter.covariance - &stationary.covariance).norm();
        assert!(difference < 1e-9 * stationary.covariance.norm(), "{transform:?}: {difference}");
    }
}

#[test]
fn for_a_linear_plant_both_transforms_give_the_same_estimate() {
    let plant =
        || Linear { a: matrix([[0.9, 0.2], [-0.1, 0.8]]), c: matrix([[1.0, 0.5], [0.0, 1.0]]) };
    let w = matrix([[0.1, 0.02], [0.02, 0.05]]);
    let [one, other] = BOTH.map(|transform| {
        let mut filter = NonlinearFilter::new(w.clone(), matrix([[0.2, 0.1], [0.1, 0.4]]));
        filter.covariance.fill_with_identity();
        let mut squared = 0.0;
        for y in [[1.0, -2.0], [0.3, 0.4], [5.0, 1.0]] {
            squared += filter.correct(&mut plant(), &y, |_| true, transform).unwrap();
            filter.predict(&mut plant(), transform).unwrap();
        }
        (filter.mean, filter.covariance, squared)
    });
    assert!((one.0 - other.0).norm() < 1e-13);
    assert!((one.1 - other.1).norm() < 1e-13);
    assert!((one.2 - other.2).abs() < 1e-12);
}

/// For z of mean m and variance P, the mean of z^2 is m^2 + P; the extended filter takes m^2. The covariance of z^2 and
/// z is 2 m P for both.
#[test]
fn the_unscented_transform_knows_the_mean_of_a_square() {
    let (mean, variance, v, y) = (3.0, 0.25, 0.5, 10.0);
    for (transform, expected, own_variance) in [
        (Transform::Extended, mean * mean, 4.0 * mean * mean * variance),
        (Transform::Unscented, mean * mean + variance, 4.0 * mean * mean * variance),
    ] {
        let mut filter = NonlinearFilter::new(matrix([[0.0]]), matrix([[v]]));
        filter.mean[0] = mean;
        filter.covariance[(0, 0)] = variance;
        let squared = filter.correct(&mut Square, &[y], |_| true, transform).unwrap();
        let (s, e) = (own_variance + v, y - expected);
        let cross = 2.0 * mean * variance;
        assert!((filter.innovation[0] - e).abs() < 1e-14);
        assert!((filter.mean[0] - (mean + cross / s * e)).abs() < 1e-14);
        assert!((filter.covariance[(0, 0)] - (variance - cross * cross / s)).abs() < 1e-14);
        assert!((squared - e * e / s).abs() < 1e-14);
    }
}

#[test]
fn a_state_that_is_known_exactly_stays_so() {
    for transform in BOTH {
        let mut filter = NonlinearFilter::new(DMatrix::zeros(2, 2), matrix([[1.0]]));
        filter.mean.copy_from_slice(&[1.0, 2.0]);
        filter.covariance[(0, 0)] = 1.0;
        let mut plant = Linear { a: DMatrix::identity(2, 2), c: matrix([[1.0, 1.0]]) };
        filter.correct(&mut plant, &[5.0], |_| true, transform).unwrap();
        filter.predict(&mut plant, transform).unwrap();
        assert_eq!(filter.mean.as_slice(), [2.0, 2.0], "{transform:?}");
        let expected = matrix([[0.5, 0.0], [0.0, 0.0]]);
        assert!((filter.covariance - expected).amax() < 1e-15);
    }
}

#[test]
fn a_measurement_that_is_not_due_is_as_none() {
    let (a, w) = (matrix([[0.9, 0.2], [-0.1, 0.8]]), matrix([[0.1, 0.02], [0.02, 0.05]]));
    for transform in BOTH {
        let c = matrix([[1.0, 0.5], [0.3, -1.0]]);
        let v = matrix([[0.2, 0.1], [0.1, 0.4]]);
        let mut both = NonlinearFilter::new(w.clone(), v.clone());
        let mut alone = NonlinearFilter::new(w.clone(), matrix([[v[(1, 1)]]]));
        let mut plant = Linear { a: a.clone(), c: c.clone() };
        let mut plant_of_one = Linear { a: a.clone(), c: c.rows(1, 1).into_owned() };
        both.covariance.fill_with_identity();
        alone.covariance.fill_with_identity();
        for y in [2.0, -1.0, 0.5] {
            let due = |k| k == 1;
            let one = both.correct(&mut plant, &[f64::NAN, y], due, transform).unwrap();
            let other = alone.correct(&mut plant_of_one, &[y], |_| true, transform).unwrap();
            assert!((one - other).abs() < 1e-13);
            assert!((&both.mean - &alone.mean).amax() < 1e-14);
            assert!((&both.covariance - &alone.covariance).amax() < 1e-14);
            both.predict(&mut plant, transform).unwrap();
            alone.predict(&mut plant_of_one, transform).unwrap();
        }
    }
}

#[test]
fn a_measurement_without_noise_of_a_known_state_is_refused() {
    for transform in BOTH {
        let mut filter = NonlinearFilter::new(matrix([[0.0]]), matrix([[0.0]]));
        let mut plant = Linear { a: matrix([[1.0]]), c: matrix([[1.0]]) };
        let refused = filter.correct(&mut plant, &[1.0], |_| true, transform);
        assert_eq!(refused, Err(FilterError::NotDefinite));
        // The filter can be used afterwards.
        filter.covariance[(0, 0)] = 1.0;
        assert!(filter.correct(&mut plant, &[1.0], |_| true, transform).is_ok());
    }
}

/// 1e200 squared is above the range of double precision.
#[test]
fn a_covariance_that_overflows_is_named() {
    for transform in BOTH {
        let mut filter = NonlinearFilter::new(matrix([[1.0]]), matrix([[1.0]]));
        filter.covariance[(0, 0)] = 1.0;
        let mut plant = Linear { a: matrix([[1.0]]), c: matrix([[1e200]]) };
        let refused = filter.correct(&mut plant, &[1.0], |_| true, transform);
        assert_eq!(refused, Err(FilterError::NotFinite));
        let mut plant = Linear { a: matrix([[1e200]]), c: matrix([[1.0]]) };
        assert_eq!(filter.predict(&mut plant, transform), Err(FilterError::NotFinite));
    }
}

#[test]
fn the_root_of_a_singular_covariance_has_it_as_square() {
    let columns = matrix([[1e6, 2e6], [-3.0, 1.0], [0.0, 0.0], [2e-5, 7e-5]]);
    let covariance = &columns * columns.transpose();
    let mut root = DMatrix::zeros(4, 4);
    square_root(&covariance, &mut root);
    let square = &root * root.transpose();
    for i in 0..4 {
        for j in 0..4 {
            let scale = (covariance[(i, i)] * covariance[(j, j)]).sqrt();
            assert!((square[(i, j)] - covariance[(i, j)]).abs() <= 1e-14 * scale);
        }
    }
}
