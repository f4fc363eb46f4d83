//! The matrices of a controller by their symbols, and the numbers of its signals by their kinds.

use nalgebra::DMatrix;

use super::controller::Controller;
use super::symbols::{Kind, Matrix};

impl Matrix {
    /// The matrix of a controller, `None` without it; the identity for `A_f` of constant faults.
    pub(super) fn of(self, controller: &Controller) -> Option<&DMatrix<f64>> {
        let detection = controller.detection.as_ref();
        match self {
            Self::A => Some(&controller.a),
            Self::B => Some(&controller.b),
            Self::C => Some(&controller.c),
            Self::D => controller.d.as_ref(),
            Self::FA => Some(&controller.f_a),
            Self::AF => Some(&controller.a_f),
            Self::KX => Some(&controller.k_x),
            Self::KF => Some(&controller.k_f),
            Self::LX => Some(&controller.l_x),
            Self::LF => Some(&controller.l_f),
            Self::PF => controller.p_f.as_ref(),
            Self::H => controller.h.as_ref(),
            Self::KI => controller.k_i.as_ref(),
            Self::FI => controller.f_i.as_ref(),
            Self::LW => controller.l_w.as_ref(),
            Self::NR => controller.n_r.as_ref(),
            Self::ResidualA => Some(&detection?.a),
            Self::ResidualBu => Some(&detection?.b_u),
            Self::ResidualBy => Some(&detection?.b_y),
            Self::ResidualC => Some(&detection?.c),
            Self::ResidualDu => Some(&detection?.d_u),
            Self::ResidualDy => Some(&detection?.d_y),
        }
    }
}

impl Kind {
    /// The number of signals or other parts of this kind in a controller; 0 if there are none.
    pub(super) fn count(self, controller: &Controller) -> usize {
        let (detection, reconfiguration) = (&controller.detection, &controller.reconfiguration);
        match self {
            Self::State => controller.states.len(),
            Self::Fault => controller.faults.len(),
            Self::Actuator => controller.actuators.len(),
            Self::Measurement => controller.measurements.len(),
            Self::Reference => controller.references.len(),
            Self::Integral => controller.h.as_ref().map_or(0, DMatrix::nrows),
            Self::Point => controller.schedule.as_ref().map_or(0, |schedule| schedule.points.len()),
            Self::ResidualState => detection.as_ref().map_or(0, |all| all.a.nrows()),
            Self::Residual => detection.as_ref().map_or(0, |all| all.c.nrows()),
            Self::Test => detection.as_ref().map_or(0, |all| all.tests.len()),
            Self::Suspect => detection.as_ref().map_or(0, |all| all.faults.len()),
            Self::GainSet => reconfiguration.as_ref().map_or(0, |all| all.sets.len()),
            Self::Case => reconfiguration.as_ref().map_or(0, |all| all.cases.len()),
        }
    }
}
