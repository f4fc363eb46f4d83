//! The vectors and matrices of the recursion.

use nalgebra::DMatrix;

use super::controller::Controller;

/// A vector of the recursion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Vector {
    /// The estimate for this sample from the measurements before it, as values.
    StoredXHat,
    StoredFHat,
    StoredYF,
    /// The measurements as values; the last finite ones.
    Measured,
    /// The references as values; the last finite ones.
    Referred,
    /// The integrals of the distances from the references.
    StoredXI,
    /// The operating point.
    XOp,
    UOp,
    YOp,
    ROp,
    /// Deviations from the operating point.
    Y,
    E,
    XHat,
    FHat,
    YF,
    U,
    R,
    /// The command without limits, and how far the limits are from it.
    V,
    Excess,
    /// The commands and estimates as values.
    Command,
    XValue,
    FValue,
    XIValue,
    /// The estimate for the next sample, as values.
    NextXHat,
    NextFHat,
    NextYF,
    NextXI,
}

/// A matrix of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Matrix {
    A,
    B,
    C,
    FA,
    AF,
    KX,
    KF,
    LX,
    LF,
    H,
    KI,
    FI,
    LW,
    NR,
}

impl Matrix {
    pub(super) const ALL: [Self; 14] = [
        Self::A,
        Self::B,
        Self::C,
        Self::FA,
        Self::AF,
        Self::KX,
        Self::KF,
        Self::LX,
        Self::LF,
        Self::H,
        Self::KI,
        Self::FI,
        Self::LW,
        Self::NR,
    ];

    /// The matrix of a controller, if it has it.
    pub(super) fn of(self, controller: &Controller) -> Option<&DMatrix<f64>> {
        Some(match self {
            Self::A => &controller.a,
            Self::B => &controller.b,
            Self::C => &controller.c,
            Self::FA => &controller.f_a,
            Self::AF => &controller.a_f,
            Self::KX => &controller.k_x,
            Self::KF => &controller.k_f,
            Self::LX => &controller.l_x,
            Self::LF => &controller.l_f,
            Self::H => return controller.h.as_ref(),
            Self::KI => return controller.k_i.as_ref(),
            Self::FI => return controller.f_i.as_ref(),
            Self::LW => return controller.l_w.as_ref(),
            Self::NR => return controller.n_r.as_ref(),
        })
    }

    /// The name in the design file.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::A => "A",
            Self::B => "B",
            Self::C => "C",
            Self::FA => "F_a",
            Self::AF => "A_f",
            Self::KX => "K_x",
            Self::KF => "K_f",
            Self::LX => "L_x",
            Self::LF => "L_f",
            Self::H => "H",
            Self::KI => "K_i",
            Self::FI => "F_i",
            Self::LW => "L_w",
            Self::NR => "N_r",
        }
    }
}

impl Vector {
    /// The name without its owner.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::StoredXHat | Self::XHat => "x_hat",
            Self::StoredFHat | Self::FHat => "f_hat",
            Self::StoredYF | Self::YF => "y_f",
            Self::Measured | Self::Y => "y",
            Self::XOp => "x_op",
            Self::UOp => "u_op",
            Self::YOp => "y_op",
            Self::E => "e",
            Self::U => "u",
            Self::Command => "command",
            Self::XValue => "x_value",
            Self::FValue => "f_value",
            Self::NextXHat => "next_x_hat",
            Self::NextFHat => "next_f_hat",
            Self::NextYF => "next_y_f",
            Self::Referred | Self::R => "r",
            Self::StoredXI => "x_i",
            Self::ROp => "r_op",
            Self::V => "v",
            Self::Excess => "excess",
            Self::XIValue => "x_i_value",
            Self::NextXI => "next_x_i",
        }
    }

    /// Whether it is part of the controller's state.
    pub(super) fn is_stored(self) -> bool {
        matches!(
            self,
            Self::StoredXHat
                | Self::StoredFHat
                | Self::StoredYF
                | Self::StoredXI
                | Self::Measured
                | Self::Referred
        )
    }

    /// The signals that its elements belong to.
    pub(super) fn kind(self) -> Kind {
        match self {
            Self::StoredXHat | Self::XHat | Self::XOp | Self::XValue | Self::NextXHat => {
                Kind::State
            }
            Self::StoredFHat | Self::FHat | Self::FValue | Self::NextFHat => Kind::Fault,
            Self::UOp | Self::U | Self::V | Self::Excess | Self::Command => Kind::Actuator,
            Self::Referred | Self::ROp | Self::R => Kind::Reference,
            Self::StoredXI | Self::XIValue | Self::NextXI => Kind::Integral,
            Self::StoredYF
            | Self::Measured
            | Self::YOp
            | Self::Y
            | Self::E
            | Self::YF
            | Self::NextYF => Kind::Measurement,
        }
    }
}

/// The signals of a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    State,
    Fault,
    Actuator,
    Measurement,
    Reference,
    /// The integral of the distance from a reference.
    Integral,
    /// A point of the schedule: no signal.
    Point,
}

impl Kind {
    /// All kinds of signals.
    pub(super) const ALL: [Self; 6] = [
        Self::State,
        Self::Fault,
        Self::Measurement,
        Self::Actuator,
        Self::Reference,
        Self::Integral,
    ];

    pub(super) fn count(self, controller: &Controller) -> usize {
        match self {
            Self::State => controller.states.len(),
            Self::Fault => controller.faults.len(),
            Self::Actuator => controller.actuators.len(),
            Self::Measurement => controller.measurements.len(),
            Self::Reference => controller.references.len(),
            Self::Integral => controller.h.as_ref().map_or(0, DMatrix::nrows),
            Self::Point => controller.schedule.as_ref().map_or(0, |own| own.points.len()),
        }
    }

    /// The name of their number.
    pub(super) fn plural(self) -> &'static str {
        match self {
            Self::State => "STATES",
            Self::Fault => "FAULTS",
            Self::Actuator => "ACTUATORS",
            Self::Measurement => "MEASUREMENTS",
            Self::Reference | Self::Integral => "REFERENCES",
            Self::Point => "POINTS",
        }
    }
}
