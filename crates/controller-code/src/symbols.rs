//! The vectors and matrices of a sample.

macro_rules! vectors {
    ($($(#[$text:meta])* $vector:ident $name:literal $kind:ident,)*) => {
        /// A vector of a sample.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(super) enum Vector {
            $($(#[$text])* $vector,)*
        }

        impl Vector {
            /// The name of the vector in the code, without the structure that contains it.
            pub(super) fn name(self) -> &'static str {
                match self {
                    $(Self::$vector => $name,)*
                }
            }

            /// The kind of signals to which the elements belong.
            pub(super) fn kind(self) -> Kind {
                match self {
                    $(Self::$vector => Kind::$kind,)*
                }
            }
        }
    };
}

// Each vector with its name and the signals that its elements belong to.
vectors! {
    /// The estimate for this sample from the measurements before it, as values.
    StoredXHat "x_hat" State,
    StoredFHat "f_hat" Fault,
    StoredYF "y_f" Measurement,
    /// The measurements as values: the last ones that are used.
    Measured "y" Measurement,
    /// The references as values: the last finite ones.
    Referred "r" Reference,
    /// The integrals of the distances from the references.
    StoredXI "x_i" Integral,
    /// The state of the filter of the residuals, and the residuals of the last sample.
    StoredXR "x_r" ResidualState,
    StoredResidual "residual" Residual,
    /// The commands of the sample before as deviations, for measurements that contain them.
    StoredU "u_before" Actuator,
    /// The remaining distance of the commands from the law that is in force.
    StoredUT "u_t" Actuator,
    /// The operating point.
    XOp "x_op" State,
    UOp "u_op" Actuator,
    YOp "y_op" Measurement,
    ROp "r_op" Reference,
    /// Deviations from the operating point.
    Y "y" Measurement,
    E "e" Measurement,
    XHat "x_hat" State,
    FHat "f_hat" Fault,
    /// The integral part of `f_hat` in a law with a direct term.
    FHatI "f_hat_i" Fault,
    /// The sliding variable `L_f` e of a sliding-mode law.
    S "s" Fault,
    YF "y_f" Measurement,
    U "u" Actuator,
    R "r" Reference,
    /// The change of the commands by their limits.
    Excess "excess" Actuator,
    /// The commands and estimates as values.
    Command "command" Actuator,
    XValue "x_value" State,
    FValue "f_value" Fault,
    /// The estimate for the next sample, as values.
    NextXHat "next_x_hat" State,
    NextFHat "next_f_hat" Fault,
    NextYF "next_y_f" Measurement,
    NextXI "next_x_i" Integral,
    NextUT "next_u_t" Actuator,
    /// The residuals of this sample, and the state of their filter for the next one.
    Residual "next_residual" Residual,
    NextXR "next_x_r" ResidualState,
}

macro_rules! matrices {
    ($($(#[$text:meta])* $matrix:ident $name:literal [$($kind:ident),*],)*) => {
        /// A matrix of the controller.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(super) enum Matrix {
            $($(#[$text])* $matrix,)*
        }

        impl Matrix {
            pub(super) const ALL: [Self; 22] = [$(Self::$matrix),*];

            /// The name in the design file; of a matrix of the detection the one in the code.
            pub(super) fn name(self) -> &'static str {
                match self {
                    $(Self::$matrix => $name,)*
                }
            }

            /// The kinds of its rows and columns.
            pub(super) fn kinds(self) -> [Kind; 2] {
                match self {
                    $(Self::$matrix => [$(Kind::$kind),*],)*
                }
            }
        }
    };
}

// Each matrix with its name and the kinds of its rows and columns.
matrices! {
    A "A" [State, State],
    B "B" [State, Actuator],
    C "C" [Measurement, State],
    D "D" [Measurement, Actuator],
    FA "F_a" [State, Fault],
    AF "A_f" [Fault, Fault],
    KX "K_x" [Actuator, State],
    KF "K_f" [Actuator, Fault],
    LX "L_x" [State, Measurement],
    LF "L_f" [Fault, Measurement],
    PF "P_f" [Fault, Measurement],
    H "H" [Integral, Measurement],
    KI "K_i" [Actuator, Integral],
    FI "F_i" [Integral, Fault],
    LW "L_w" [Integral, Actuator],
    NR "N_r" [Actuator, Reference],
    /// A, `B_u`, `B_y`, C, `D_u`, `D_y` of the detection.
    ResidualA "A_r" [ResidualState, ResidualState],
    ResidualBu "B_ru" [ResidualState, Actuator],
    ResidualBy "B_ry" [ResidualState, Measurement],
    ResidualC "C_r" [Residual, ResidualState],
    ResidualDu "D_ru" [Residual, Actuator],
    ResidualDy "D_ry" [Residual, Measurement],
}

macro_rules! kinds {
    ($($(#[$about:meta])* $list:ident: $count:literal {
        $($(#[$text:meta])* $kind:ident $plural:literal,)*
    })*) => {
        /// The kinds of signals and of other numbered parts of a controller.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(super) enum Kind {
            $($($(#[$text])* $kind,)*)*
        }

        impl Kind {
            $($(#[$about])* pub(super) const $list: [Self; $count] = [$(Self::$kind),*];)*

            /// The name of the constant with the number of members of this kind.
            pub(super) fn plural(self) -> &'static str {
                match self {
                    $($(Self::$kind => $plural,)*)*
                }
            }
        }
    };
}

// Each kind with the name of the constant with the number of its members.
kinds! {
    /// All kinds of signals.
    ALL: 6 {
        State "STATES",
        Fault "FAULTS",
        Measurement "MEASUREMENTS",
        Actuator "ACTUATORS",
        Reference "REFERENCES",
        /// The integral of the distance from a reference.
        Integral "REFERENCES",
    }

    /// The kinds that are no signals.
    OTHERS: 7 {
        /// The points of the schedule.
        Point "POINTS",
        /// The states of the filter of the detection, its residuals, its tests, and the faults that it can isolate.
        ResidualState "RESIDUAL_STATES",
        Residual "RESIDUALS",
        Test "TESTS",
        Suspect "SUSPECTS",
        /// Of the reconfiguration: sets of gains, and actuators that may be gone.
        GainSet "GAIN_SETS",
        Case "CASES",
    }
}
