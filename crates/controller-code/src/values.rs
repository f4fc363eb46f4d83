//! The matrices of a controller by their symbols, and the numbers of its signals by their kinds.

use nalgebra::DMatrix;

use super::controller::Controller;
use super::symbols::{Kind, Matrix};

impl Matrix {
    /// The matrix of a controller, `None` without it.
    pub(super) fn of(self, controller: &Controller) -> Option<&DMatrix<f64>> {
        controller.matrices.get(self)
    }
}

impl Kind {
    /// The number of signals or other parts of this kind in a controller; 0 if there are none.
    pub(super) fn count(self, controller: &Controller) -> usize {
        let (detection, reconfiguration) = (&controller.detection, &controller.reconfiguration);
        let rows = |matrix: Matrix| matrix.of(controller).map_or(0, DMatrix::nrows);
        match self {
            Self::State => controller.states.len(),
            Self::Fault => controller.faults.len(),
            Self::Actuator => controller.actuators.len(),
            Self::Measurement => controller.measurements.len(),
            Self::Reference => controller.references.len(),
            Self::Integral => rows(Matrix::H),
            Self::Point => controller.schedule.as_ref().map_or(0, |schedule| schedule.points.len()),
            Self::ResidualState => rows(Matrix::ResidualA),
            Self::Residual => rows(Matrix::ResidualC),
            Self::Test => detection.as_ref().map_or(0, |all| all.tests.len()),
            Self::Suspect => detection.as_ref().map_or(0, |all| all.faults.len()),
            Self::GainSet => reconfiguration.as_ref().map_or(0, |all| all.sets.len()),
            Self::Case => reconfiguration.as_ref().map_or(0, |all| all.cases.len()),
        }
    }
}
