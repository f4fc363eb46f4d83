//! The vectors and matrices of a sample.

/// A vector of a sample.
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
    /// The state of the filter of the residuals, and the residuals of the last sample.
    StoredXR,
    StoredResidual,
    /// The commands of the sample before as deviations, for measurements that contain them.
    StoredU,
    /// What is left in the commands since their law changed.
    StoredUT,
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
    /// The integral part of `f_hat` in a law with a direct term.
    FHatI,
    /// `L_f` e of a sliding-mode law.
    S,
    YF,
    U,
    R,
    /// How far the limits are from the command without limits.
    Excess,
    /// The commands and estimates as values.
    Command,
    XValue,
    FValue,
    /// The estimate for the next sample, as values.
    NextXHat,
    NextFHat,
    NextYF,
    NextXI,
    NextUT,
    /// The residuals of this sample, and the state of their filter for the next one.
    Residual,
    NextXR,
}

/// A matrix of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Matrix {
    A,
    B,
    C,
    D,
    FA,
    AF,
    KX,
    KF,
    LX,
    LF,
    PF,
    H,
    KI,
    FI,
    LW,
    NR,
    /// A, `B_u`, `B_y`, C, `D_u`, `D_y` of the detection.
    ResidualA,
    ResidualBu,
    ResidualBy,
    ResidualC,
    ResidualDu,
    ResidualDy,
}

impl Matrix {
    pub(super) const ALL: [Self; 22] = [
        Self::A,
        Self::B,
        Self::C,
        Self::D,
        Self::FA,
        Self::AF,
        Self::KX,
        Self::KF,
        Self::LX,
        Self::LF,
        Self::PF,
        Self::H,
        Self::KI,
        Self::FI,
        Self::LW,
        Self::NR,
        Self::ResidualA,
        Self::ResidualBu,
        Self::ResidualBy,
        Self::ResidualC,
        Self::ResidualDu,
        Self::ResidualDy,
    ];

    /// The name in the design file.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::A => "A",
            Self::B => "B",
            Self::C => "C",
            Self::D => "D",
            Self::FA => "F_a",
            Self::AF => "A_f",
            Self::KX => "K_x",
            Self::KF => "K_f",
            Self::LX => "L_x",
            Self::LF => "L_f",
            Self::PF => "P_f",
            Self::H => "H",
            Self::KI => "K_i",
            Self::FI => "F_i",
            Self::LW => "L_w",
            Self::NR => "N_r",
            Self::ResidualA => "A_r",
            Self::ResidualBu => "B_ru",
            Self::ResidualBy => "B_ry",
            Self::ResidualC => "C_r",
            Self::ResidualDu => "D_ru",
            Self::ResidualDy => "D_ry",
        }
    }
}

impl Vector {
    /// The name without its owner.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::StoredXHat | Self::XHat => "x_hat",
            Self::StoredFHat | Self::FHat => "f_hat",
            Self::FHatI => "f_hat_i",
            Self::S => "s",
            Self::StoredYF | Self::YF => "y_f",
            Self::Measured | Self::Y => "y",
            Self::StoredU => "u_before",
            Self::StoredUT => "u_t",
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
            Self::Excess => "excess",
            Self::NextXI => "next_x_i",
            Self::NextUT => "next_u_t",
            Self::StoredXR => "x_r",
            Self::StoredResidual => "residual",
            Self::Residual => "next_residual",
            Self::NextXR => "next_x_r",
        }
    }

    /// The signals that its elements belong to.
    pub(super) fn kind(self) -> Kind {
        match self {
            Self::StoredXHat | Self::XHat | Self::XOp | Self::XValue | Self::NextXHat => {
                Kind::State
            }
            Self::StoredFHat
            | Self::FHat
            | Self::FHatI
            | Self::S
            | Self::FValue
            | Self::NextFHat => Kind::Fault,
            Self::StoredU
            | Self::StoredUT
            | Self::UOp
            | Self::U
            | Self::Excess
            | Self::Command
            | Self::NextUT => Kind::Actuator,
            Self::Referred | Self::ROp | Self::R => Kind::Reference,
            Self::StoredXI | Self::NextXI => Kind::Integral,
            Self::StoredXR | Self::NextXR => Kind::ResidualState,
            Self::StoredResidual | Self::Residual => Kind::Residual,
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
    /// No signals: a point of the schedule; of the detection a state of its filter, a residual, a test, a fault
    /// that it can isolate.
    Point,
    ResidualState,
    Residual,
    Test,
    Suspect,
    /// Of a reconfiguration: a set of gains, an actuator that may be gone.
    GainSet,
    Case,
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

    /// The kinds that are no signals.
    pub(super) const OTHERS: [Self; 7] = [
        Self::Point,
        Self::ResidualState,
        Self::Residual,
        Self::Test,
        Self::Suspect,
        Self::GainSet,
        Self::Case,
    ];

    /// The name of their number.
    pub(super) fn plural(self) -> &'static str {
        match self {
            Self::State => "STATES",
            Self::Fault => "FAULTS",
            Self::Actuator => "ACTUATORS",
            Self::Measurement => "MEASUREMENTS",
            Self::Reference | Self::Integral => "REFERENCES",
            Self::Point => "POINTS",
            Self::ResidualState => "RESIDUAL_STATES",
            Self::Residual => "RESIDUALS",
            Self::Test => "TESTS",
            Self::Suspect => "SUSPECTS",
            Self::GainSet => "GAIN_SETS",
            Self::Case => "CASES",
        }
    }
}
