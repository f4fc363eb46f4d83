//! The settings of the master algorithm: method, extrapolation, coupling, step control, events.
//!
//! Each choice has a name in `system.toml` and on the command line; [`Algorithm::check`] tests
//! whether the FMUs of a system support a combination.

use fmu_description::CoSimulation;
use serde::{Deserialize, Serialize};

use crate::error::{SystemError, contradiction};
use crate::system::{Port, System};
use slave::ValueType;

/// Declares an enum whose variants have the names used in the configuration file.
macro_rules! choice {
    ($(#[$meta:meta])* $name:ident { $($(#[$doc:meta])* $variant:ident = $text:literal,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
        #[non_exhaustive]
        pub enum $name { $($(#[$doc])* #[serde(rename = $text)] $variant,)* }

        impl $name {
            /// All names, in the order of declaration.
            pub const NAMES: &[&str] = &[$($text),*];

            /// Returns the name used in the configuration file.
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
    /// The order in which the slaves step within a communication step.
    Method {
        /// All slaves step with the values at the start of the step. Slaves without states
        /// ([`crate::Slave::is_function`]) step last, with the values at the end of the step.
        Jacobi = "jacobi",
        /// The slaves step one after the other, in the order of their direct dependencies. A slave
        /// uses the values that earlier slaves have reached at the end of the step.
        GaussSeidel = "gauss-seidel",
    }
}

choice! {
    /// How an input varies within a communication step: a polynomial through known values of its
    /// source (Kuebler and Schiehlen 2000, "Two methods of simulator coupling").
    ///
    /// A slave without input derivatives (`canInterpolateInputs` is false) gets a constant input. For `linear` and
    /// `quadratic` this constant is the mean of the polynomial over the step, which is of order 2 (of order 1 if an
    /// output of the slave depends directly on the input). For `limited` the constant is the value at the end of the
    /// step if the source has already stepped, otherwise the value at the start; this is of order 1.
    Extrapolation {
        /// Constant: the value at the start of the step, or at the end of the step if the source has already stepped.
        Hold = "hold",
        /// A line. If the source has already stepped, the line interpolates; otherwise it
        /// extrapolates with the output derivative or the last difference quotient of the source,
        /// whichever is smaller, or with slope 0 if their signs differ (minmod limiter; P. L. Roe,
        /// Annu. Rev. Fluid Mech. 18, 1986).
        Limited = "limited",
        /// A line. If the source has already stepped, the line interpolates; otherwise it extrapolates with the output
        /// derivative of the source if the source provides one, otherwise with the last difference quotient of the
        /// source.
        Linear = "linear",
        /// A parabola through the output derivatives if the source provides them, otherwise through past values. If the
        /// source has already stepped, the parabola ends at the value that the source has reached.
        Quadratic = "quadratic",
    }
}

choice! {
    /// How a step is repeated until outputs and inputs agree at the end of the step.
    Coupling {
        /// The step is made once: explicit (weak) coupling.
        Once = "once",
        /// Newton's method on the inputs at the end of the step. The matrix comes from directional
        /// derivatives if all FMUs provide them, otherwise, and from the second matrix of a step on,
        /// from finite differences.
        Newton = "newton",
        /// Anderson mixing of the last iterates (Anderson 1965; Walker and Ni 2011).
        Anderson = "anderson",
        /// Interface quasi-Newton method with a least-squares approximation of the inverse
        /// (IQN-ILS; Degroote, Bathe and Vierendeels 2009).
        QuasiNewton = "quasi-newton",
    }
}

choice! {
    /// How the size of the communication step is chosen.
    StepControl {
        /// Constant steps: communication points at `t0 + k H`, and at events and jumps in between.
        Fixed = "fixed",
        /// Step doubling: each step is made once as a whole and once in two halves (Richardson's
        /// error estimate), and repeated with a smaller size if the difference is too large. Needs
        /// FMU states.
        Doubling = "doubling",
        /// The error estimate is the error of the input extrapolation at the end of the step; a step with a too large
        /// error is repeated with a smaller size. Needs FMU states.
        Embedded = "embedded",
        /// The size of the next step follows from the change of the connected signals in the last
        /// step. Never rejects a step.
        Increment = "increment",
        /// The size of the next step follows from the energy that the connections lost or generated
        /// (ECCO: Sadjina, Kyllingstad, Skjong and Pedersen 2017). Never rejects a step. Needs
        /// power bonds.
        Energy = "energy",
    }
}

/// A source of events. A communication step ends at an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum EventSource {
    /// A Real output whose value is the time in s of the next event of its FMU.
    NextTime(Port),
    /// A Real output whose zero crossing is an event, which the master locates by repeating the step.
    Crossing(Port),
}

/// Two connections whose product is a power: effort in one direction, flow in the other (for
/// example N and m/s, V and A, Pa and m3/s).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PowerBond {
    /// An input port, the target of the first connection.
    pub first: Port,
    /// An input port, the target of the second connection, which runs in the opposite direction.
    pub second: Port,
}

/// The settings of a master algorithm.
#[derive(Clone, Debug, PartialEq)]
pub struct Algorithm {
    /// Order in which the slaves step.
    pub method: Method,
    /// Extrapolation of the inputs.
    pub extrapolation: Extrapolation,
    /// Iteration of a step.
    pub coupling: Coupling,
    /// Choice of the step size.
    pub control: StepControl,
    /// Communication step H in s; with a variable step size, the first communication step.
    pub step: f64,
    /// For each slave, the number of communication steps in one of its steps; empty: 1 for all.
    pub multiples: Vec<u32>,
    /// Relative tolerance of the connected values, used by the iteration and the step control.
    pub relative_tolerance: f64,
    /// Absolute tolerance, as a fraction of each output's `nominal`.
    pub absolute_tolerance: f64,
    /// Smallest step in s of the step control.
    pub smallest_step: f64,
    /// Largest step in s of the step control.
    pub largest_step: f64,
    /// Largest number of iterations of one step.
    pub iterations: u32,
    /// Whether a step whose iteration fails is made once without iteration; otherwise the failure
    /// ends the run.
    pub fallback: bool,
    /// Events that end a step.
    pub events: Vec<EventSource>,
    /// Variables that are discrete although their FMU does not say so.
    pub discrete: Vec<Port>,
    /// Power bonds, for [`StepControl::Energy`].
    pub bonds: Vec<PowerBond>,
    /// Number of threads that step independent slaves at the same time if this is faster; 1: no
    /// threads.
    pub jobs: usize,
    /// Whether FMU states are saved before every step, so that all FMUs repeat a step that one FMU
    /// completed only in part (`fmi2Discard`).
    pub rollback: bool,
    /// Whether NaN and infinity are allowed on connections.
    pub allow_nan: bool,
}

impl Algorithm {
    /// Returns an algorithm with the fixed communication step `step` in s, the method `method` and
    /// the input extrapolation `extrapolation`; everything else is as in [`Algorithm::new`].
    #[must_use]
    pub fn fixed(method: Method, extrapolation: Extrapolation, step: f64) -> Self {
        Self { method, extrapolation, ..Self::new(step) }
    }

    /// Returns the default algorithm: Gauss-Seidel, limited extrapolation and the fixed
    /// communication step `step` in s.
    #[must_use]
    pub fn new(step: f64) -> Self {
        Self {
            method: Method::GaussSeidel,
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
            discrete: Vec::new(),
            bonds: Vec::new(),
            jobs: 1,
            rollback: false,
            allow_nan: false,
        }
    }

    /// Checks that the FMUs of `system` support the algorithm and that the algorithm's settings are consistent.
    ///
    /// # Errors
    ///
    /// Returns an error if a source of events is no Real, if an FMU lacks a capability flag that the
    /// algorithm needs, if two settings contradict each other, or if a tolerance or a limit of the step
    /// size is not above 0.
    pub fn check(&self, system: &System) -> Result<(), SystemError> {
        for event in &self.events {
            let (EventSource::NextTime(port) | EventSource::Crossing(port)) = *event;
            if ValueType::of(&system.variable(port).kind) != ValueType::Real {
                return Err(SystemError::Role {
                    name: system.name(port),
                    actual: format!("a variable of type {}", system.type_name(port)),
                    expected: "a Real output as a source of events".to_owned(),
                });
            }
        }
        if let Some(required_by) = self.repeated_by() {
            let lacks = "canGetAndSetFMUstate";
            require(system, lacks, &required_by, |flags| flags.can_get_and_set_fmu_state)?;
        }
        if self.control != StepControl::Fixed || !self.events.is_empty() {
            let lacks = "canHandleVariableCommunicationStepSize";
            let required_by = match self.control {
                StepControl::Fixed => "steps that end at events".to_owned(),
                control => format!("the step control {}", control.name()),
            };
            require(system, lacks, &required_by, |flags| {
                flags.can_handle_variable_communication_step_size
            })?;
        }
        let several = self.multiples.iter().any(|&multiple| multiple != 1);
        let plain = self.control == StepControl::Fixed && self.coupling == Coupling::Once;
        if several && !(plain && self.events.is_empty() && !self.rollback) {
            return Err(contradiction(
                "FMUs with multiples of the communication step need fixed steps, made once, without events: \
                 step-control fixed, coupling once, no rollback",
            ));
        }
        if self.control == StepControl::Energy && self.bonds.is_empty() {
            return Err(contradiction(
                "the step control energy needs power bonds: pairs of connected inputs whose product is a power",
            ));
        }
        self.check_numbers()
    }

    /// Whether steps may be repeated, so that every slave must be able to restore its state.
    pub(crate) fn repeats(&self) -> bool {
        self.repeated_by().is_some()
    }

    /// Names the setting that may repeat steps, for a message; `None` if there is none.
    fn repeated_by(&self) -> Option<String> {
        let is_crossing = |event: &EventSource| matches!(event, EventSource::Crossing(_));
        match (self.coupling, self.control) {
            (Coupling::Once, StepControl::Doubling | StepControl::Embedded) => {
                Some(format!("the step control {}", self.control.name()))
            }
            (Coupling::Once, _) if self.events.iter().any(is_crossing) => {
                Some("the location of crossings".to_owned())
            }
            (Coupling::Once, _) => self.rollback.then(|| "steps with rollback".to_owned()),
            (coupling, _) => Some(format!("the coupling {}", coupling.name())),
        }
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
                return Err(contradiction(format!("{what} is {value}, expected a number above 0")));
            }
        }
        if self.control != StepControl::Fixed
            && !(self.smallest_step <= self.step && self.step <= self.largest_step)
        {
            return Err(contradiction(format!(
                "the first step is {} s, expected one from the smallest, {} s, to the largest, {} s",
                self.step, self.smallest_step, self.largest_step
            )));
        }
        Ok(())
    }
}

fn require(
    system: &System,
    lacks: &'static str,
    required_by: &str,
    can: fn(&CoSimulation) -> bool,
) -> Result<(), SystemError> {
    match system.first_without(can) {
        None => Ok(()),
        Some(name) => Err(SystemError::Capability {
            slave: name.to_owned(),
            lacks,
            required_by: required_by.to_owned(),
        }),
    }
}
