//! The schedule of a controller: matrices and operating points at values of a scheduling variable.
//!
//! Between two points the controller uses
//!
//! ```text
//! M(theta) = (1 - t) M_i + t M_{i+1},  t = (theta - theta_i) / (theta_{i+1} - theta_i)
//! ```
//!
//! with the scheduling variable theta limited to the grid, as in `Schedule::interpolate` of `aso_controller`.

use aso_controller::design::{self, schedule};
use nalgebra::DMatrix;

use super::Precision;
use super::matrices::Matrices;
use super::parts::Signal;
use super::symbols::{Matrix, Vector};
use crate::Error;

/// The schedule of a controller.
pub(super) struct Schedule {
    /// The scheduling variable; its start value is the first point.
    pub(super) variable: Signal,
    /// The position of the measurement that is the scheduling variable; `None` if the variable is a separate input.
    pub(super) measurement: Option<usize>,
    /// The points of the grid, at least two, in ascending order.
    pub(super) points: Vec<Point>,
}

/// The controller at a value of the scheduling variable.
pub(super) struct Point {
    pub(super) at: f64,
    x_op: Vec<f64>,
    u_op: Vec<f64>,
    y_op: Vec<f64>,
    r_op: Vec<f64>,
    matrices: Matrices,
}

impl Schedule {
    /// The schedule of a design file whose measurements are `measurements`.
    pub(super) fn of(file: schedule::Schedule, measurements: &[design::Measurement]) -> Self {
        let schedule::Schedule { variable, unit, description, points } = file;
        let measurement = measurements.iter().position(|signal| signal.name == variable);
        let points: Vec<_> = points.into_iter().map(Point::of).collect();
        let start = points.first().map_or(0.0, |point| point.at);
        let variable = Signal::new(variable, unit, description, start);
        Self { variable, measurement, points }
    }

    /// The scheduling variable, if it is a separate input.
    pub(super) fn input(&self) -> Option<&Signal> {
        Some(&self.variable).filter(|_| self.measurement.is_none())
    }

    /// The first and the last value of the grid.
    pub(super) fn range(&self) -> [f64; 2] {
        let at = |point: Option<&Point>| point.map_or(f64::NAN, |point| point.at);
        [at(self.points.first()), at(self.points.last())]
    }

    /// A matrix at each point; `None` if the matrix does not depend on the scheduling variable.
    pub(super) fn matrices(&self, matrix: Matrix) -> Option<Vec<&DMatrix<f64>>> {
        self.points.iter().map(|point| point.matrices.get(matrix)).collect()
    }

    /// A part of the operating point at each point: one of [`super::tables::operating_vectors`].
    pub(super) fn operating(&self, vector: Vector) -> Vec<Vec<f64>> {
        let values = |point: &Point| match vector {
            Vector::XOp => point.x_op.clone(),
            Vector::UOp => point.u_op.clone(),
            Vector::YOp => point.y_op.clone(),
            _ => point.r_op.clone(),
        };
        self.points.iter().map(values).collect()
    }

    /// Checks that the values of the grid differ in `precision`, and that no number is beyond `largest`.
    pub(super) fn check_range(&self, precision: Precision, largest: f64) -> Result<(), Error> {
        let name = &self.variable.name;
        for (point, next) in self.points.iter().zip(self.points.iter().skip(1)) {
            if precision.rounded(point.at) >= precision.rounded(next.at) {
                return Err(Error(format!(
                    "schedule: {name} = {:?} and {:?} are equal in `float`",
                    point.at, next.at
                )));
            }
        }
        for point in &self.points {
            let matrices = point.matrices.0.iter().flat_map(|(_, values)| values.iter());
            let operating = [&point.x_op, &point.u_op, &point.y_op, &point.r_op];
            let numbers = matrices.chain(operating.into_iter().flatten()).chain([&point.at]);
            if let Some(value) = numbers.copied().find(|value| value.abs() > largest) {
                return Err(Error(format!(
                    "the schedule at {name} = {:?} has the number {value:?}; `float` code has constants up to \
                     {largest:?} only",
                    point.at
                )));
            }
        }
        Ok(())
    }
}

impl Point {
    fn of(file: schedule::Point) -> Self {
        let matrices = Matrices::of(file.matrices());
        let schedule::Point { at, x_op, u_op, y_op, r_op, .. } = file;
        Self { at, x_op, u_op, y_op, r_op, matrices }
    }
}
