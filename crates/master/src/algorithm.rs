//! Master algorithms: what can be chosen, by name.

use fmu_description::CoSimulation;
use serde::{Deserialize, Serialize};

use crate::error::SystemError;
use crate::system::{Port, System};

/// Declares a choice whose variants have the names of the configuration file.
macro_rules! choice {
    ($(#[$meta:meta])* $name:ident { $($(#[$doc:meta])* $variant:ident = $text:literal,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
        pub enum $name { $($(#[$doc])* #[serde(rename = $text)] $variant,)* }

        impl $name {
            /// The names, in the order of declaration.
            pub const NAMES: &[&str] = &[$($text),*];

            /// The name in the configuration file.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $text,)* }
            }
        }

        impl std::str::FromStr for $name {
            type Err = String;

            fn from_str(text: &str) -> Result<Self, String> {
                match text {
                    $($text => Ok(Self::$variant),)*
                    _ => Err(format!("expected one of {}, found {text:?}", Self::NAMES.join(", "))),
                }
            }
        }
    };
}

choice! {
    /// In which order the slaves step.
    Method {
        /// All from the values at the begin of the step.
        Jacobi = "jacobi",
        /// One after the other, in the order of their direct dependencies: a slave sees the values
        /// at the end of the step of those that went before.
        GaussSeidel = "gauss-seidel",
    }
}

choice! {
    /// What an input does during a step. Polynomials through known values: Kuebler and Schiehlen
    /// 2000, "Two methods of simulator coupling". A slave that takes no input derivatives
    /// (`canInterpolateInputs`) gets the mean of the line or parabola over the step, held, which is
    /// of order 2 (1 where its outputs depend directly on such an input); of a limited line the
    /// value at the end where that is known, else at the begin, which is of order 1.
    Extrapolation {
        /// Its value at the begin of the step, or at the end where the source has stepped already.
        Hold = "hold",
        /// A line. Interpolated where the source has stepped already; else extrapolated by the
        /// source's output derivative or its last difference quotient, whichever is smaller, zero
        /// where their signs differ (minmod limiter; P. L. Roe, Annu. Rev. Fluid Mech. 18, 1986).
        Limited = "limited",
        /// A line, extrapolated by the source's output derivative, or its difference quotient.
        Linear = "linear",
        /// A parabola, through output derivatives where there are any, else through past values.
        Quadratic = "quadratic",
    }
}

choice! {
    /// How often a step is repeated until outputs and inputs agree at its end.
    Coupling {
        /// Once: explicit ("weak") coupling.
        Once = "once",
        /// Newton's method on the inputs at the end of the step; its matrix from directional
        /// derivatives, where the FMUs have them.
        Newton = "newton",
        /// Anderson's mixing of the last iterates (Anderson 1965; Walker and Ni 2011).
        Anderson = "anderson",
        /// Interface quasi-Newton with the inverse by least squares (Degroote, Bathe and
        /// Vierendeels 2009, IQN-ILS).
        QuasiNewton = "quasi-newton",
    }
}

choice! {
    /// How the communication step is chosen.
    StepControl {
        /// `t0 + k H`.
        Fixed = "fixed",
        /// Each step once whole and once in two halves (Richardson's estimate), repeated where the
        /// difference is too large. Needs FMU states.
        Doubling = "doubling",
        /// The error of the inputs' extrapolation at the end of the step; repeated where it is too
        /// large. Needs FMU states.
        Embedded = "embedded",
        /// The next step from how far the connected signals moved in the last; nothing is repeated.
        Increment = "increment",
        /// The next step from the energy that the connections lost or made (ECCO: Sadjina, Kyllingstad,
        /// Skjong and Pedersen 2017); nothing is repeated. Needs power bonds.
        Energy = "energy",
    }
}

/// Where an event is looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventSource {
    /// A Real output that holds the time of its FMU's next event: a step ends there.
    NextTime(Port),
    /// A Real output whose change of sign ends a step; located by repeating the step.
    Crossing(Port),
}

/// Two connections that carry power: effort one way, flow the other (N and m/s, V and A, Pa and
/// m3/s).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PowerBond {
    /// An input port, the target of the first connection.
    pub first: Port,
    /// An input port, the target of the second connection, which leads back.
    pub second: Port,
}

/// A master algorithm.
#[derive(Clone, Debug, PartialEq)]
pub struct Algorithm {
    /// Order of stepping.
    pub sweep: Method,
    /// Extrapolation of the inputs.
    pub extrapolation: Extrapolation,
    /// Repetition of a step.
    pub coupling: Coupling,
    /// Choice of the step.
    pub control: StepControl,
    /// Communication step H in s; the first one where it is chosen on the way.
    pub step: f64,
    /// Each slave steps every so many steps; empty: all every step.
    pub multiples: Vec<u32>,
    /// Relative tolerance of the connected values: of the iteration and of the step control.
    pub relative_tolerance: f64,
    /// Absolute tolerance, as a fraction of each output's `nominal`.
    pub absolute_tolerance: f64,
    /// Smallest step in s of the step control.
    pub smallest_step: f64,
    /// Largest step in s of the step control.
    pub largest_step: f64,
    /// Most iterations of one step.
    pub iterations: u32,
    /// A step whose iteration fails is made once; otherwise it ends the run.
    pub fallback: bool,
    /// Events that end a step.
    pub events: Vec<EventSource>,
    /// Power bonds, for [`StepControl::Energy`].
    pub bonds: Vec<PowerBond>,
    /// Threads that step slaves of one sweep side by side where that pays; 1: none.
    pub jobs: usize,
    /// FMU states are kept before every step, so that one that an FMU does not finish (`fmi2Discard`)
    /// is repeated by all, as far as that one came.
    pub rollback: bool,
    /// Values on connections may be no numbers or infinite.
    pub allow_nan: bool,
}

impl Algorithm {
    /// Fixed communication steps of `step` s, by that method and with that extrapolation of the
    /// inputs; the rest as in [`Algorithm::new`].
    #[must_use]
    pub fn fixed(sweep: Method, extrapolation: Extrapolation, step: f64) -> Self {
        Self { sweep, extrapolation, ..Self::new(step) }
    }

    /// Gauss-Seidel with limited slopes and the fixed communication step `step` in s.
    #[must_use]
    pub fn new(step: f64) -> Self {
        Self {
            sweep: Method::GaussSeidel,
            extrapolation: Extrapolation::Limited,
            coupling: Coupling::Once,
            control: StepControl::Fixed,
            step,
            multiples: Vec::new(),
            relative_tolerance: 1e-4,
            absolute_tolerance: 1e-6,
            smallest_step: step * 1e-6,
            largest_step: step * 1e3,
            iterations: 50,
            fallback: false,
            events: Vec::new(),
            bonds: Vec::new(),
            jobs: 1,
            rollback: false,
            allow_nan: false,
        }
    }

    /// Whether the FMUs of `system` can do what the algorithm asks for, and the algorithm makes sense.
    ///
    /// # Errors
    ///
    /// The flag that an FMU lacks and what needs it; a port that is not what it should be.
    pub fn check(&self, system: &System) -> Result<(), SystemError> {
        let repeats = match (self.coupling, self.control) {
            (Coupling::Once, StepControl::Doubling | StepControl::Embedded) => {
                Some(format!("the step control {}", self.control.name()))
            }
            (Coupling::Once, _) => None,
            (coupling, _) => Some(format!("the coupling {}", coupling.name())),
        };
        let crossing = self.events.iter().any(|event| matches!(event, EventSource::Crossing(_)));
        let located = crossing.then(|| "the location of crossings".to_owned());
        let kept = self.rollback.then(|| "steps with rollback".to_owned());
        if let Some(wanted) = repeats.or(located).or(kept) {
            let lacks = "canGetAndSetFMUstate";
            require(system, lacks, &wanted, |flags| flags.can_get_and_set_fmu_state)?;
        }
        if self.control != StepControl::Fixed || !self.events.is_empty() {
            let lacks = "canHandleVariableCommunicationStepSize";
            let wanted = match self.control {
                StepControl::Fixed => "steps that end at events".to_owned(),
                control => format!("the step control {}", control.name()),
            };
            require(system, lacks, &wanted, |flags| {
                flags.can_handle_variable_communication_step_size
            })?;
        }
        let several = self.multiples.iter().any(|&multiple| multiple != 1);
        let plain = self.control == StepControl::Fixed && self.coupling == Coupling::Once;
        if several && !(plain && self.events.is_empty()) {
            let what = "FMUs with multiples of the communication step need fixed steps, made once, \
                        without events: step-control fixed, coupling once";
            return Err(SystemError::Algorithm { what: what.to_owned() });
        }
        if self.control == StepControl::Energy && self.bonds.is_empty() {
            let what = "the step control energy needs power bonds: pairs of connected inputs whose \
                        product is a power";
            return Err(SystemError::Algorithm { what: what.to_owned() });
        }
        self.check_numbers()
    }

    /// Whether steps are repeated, which every slave must be able to do.
    pub(crate) fn repeats(&self) -> bool {
        let crossing = self.events.iter().any(|event| matches!(event, EventSource::Crossing(_)));
        crossing
            || self.rollback
            || self.coupling != Coupling::Once
            || matches!(self.control, StepControl::Doubling | StepControl::Embedded)
    }

    fn check_numbers(&self) -> Result<(), SystemError> {
        let numbers = [
            ("the relative tolerance", self.relative_tolerance),
            ("the absolute tolerance", self.absolute_tolerance),
            ("the smallest step", self.smallest_step),
            ("the largest step", self.largest_step),
        ];
        for (what, value) in numbers {
            if !(value > 0.0 && value.is_finite()) {
                let what = format!("{what} is {value}, expected a number above 0");
                return Err(SystemError::Algorithm { what });
            }
        }
        if self.control != StepControl::Fixed
            && !(self.smallest_step <= self.step && self.step <= self.largest_step)
        {
            let what = format!(
                "the first step is {} s, expected one from the smallest, {} s, to the largest, {} s",
                self.step, self.smallest_step, self.largest_step
            );
            return Err(SystemError::Algorithm { what });
        }
        Ok(())
    }
}

fn require(
    system: &System,
    lacks: &'static str,
    wanted: &str,
    can: fn(&CoSimulation) -> bool,
) -> Result<(), SystemError> {
    let unable = system
        .slaves
        .iter()
        .find(|(_, slave)| !slave.description().co_simulation.as_ref().is_some_and(can));
    match unable {
        None => Ok(()),
        Some((name, _)) => {
            Err(SystemError::Capability { slave: name.clone(), lacks, wanted: wanted.to_owned() })
        }
    }
}
