//! The type of a signal: continuous, discrete or clocked. It decides how the signal passes a connection.

use std::fmt;

use fmu_description::{Kind, ScalarVariable, Variability};
use slave::ValueType;

use crate::system::{Connection, Port, System};

/// The type of a signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SignalType {
    /// A floating-point number that varies with time.
    Continuous,
    /// Piecewise constant: the value changes at events or communication points only.
    Discrete,
    /// Present at the ticks of a clock only (FMI 3.0.2, section 2.2.8), or a clock itself.
    Clocked,
}

impl fmt::Display for SignalType {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Continuous => "continuous",
            Self::Discrete => "discrete",
            Self::Clocked => "clocked",
        })
    }
}

impl SignalType {
    /// Returns the type of a variable by its description: clocked if it is a clock or has clocks, discrete if it is no
    /// floating-point number or if its variability is not continuous.
    #[must_use]
    pub fn of(variable: &ScalarVariable) -> Self {
        let is_real = ValueType::of(&variable.kind) == ValueType::Real;
        if matches!(variable.kind, Kind::Clock(_)) || !variable.clocks.is_empty() {
            SignalType::Clocked
        } else if is_real && variable.variability == Variability::Continuous {
            SignalType::Continuous
        } else {
            SignalType::Discrete
        }
    }
}

impl System {
    /// Returns the type of the variable at `port` by its description; the user may declare a continuous one discrete.
    #[must_use]
    pub fn signal_type(&self, port: Port) -> SignalType {
        match SignalType::of(self.variable(port)) {
            SignalType::Continuous if self.discrete.contains(&port) => SignalType::Discrete,
            described => described,
        }
    }

    /// Whether the variable at `port` has a value at the ticks of its clocks only. False for a clock, and in scheduled
    /// execution, where a variable can be read at any time.
    #[must_use]
    pub fn is_absent_between_ticks(&self, port: Port) -> bool {
        let variable = self.variable(port);
        !variable.clocks.is_empty()
            && !matches!(variable.kind, Kind::Clock(_))
            && self.slaves[port.slave].1.description().scheduled_execution.is_none()
    }

    /// Whether the signal of a connection is held: one of its ends is not continuous.
    pub(crate) fn is_held(&self, connection: &Connection) -> bool {
        let continuous = |port| self.signal_type(port) == SignalType::Continuous;
        !(continuous(connection.from) && continuous(connection.to))
    }
}

/// How a connection passes its values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Way {
    /// As a Real, which may be extrapolated, before a step.
    Real,
    /// Held, before a step.
    Held,
    /// In event mode, at instants: to a discrete or clocked input of a slave whose events the master handles.
    AtEvents,
    /// As a tick of a clock, in event mode.
    Tick,
}

impl Way {
    pub(crate) fn of(system: &System, connection: &Connection) -> Self {
        let (from, to) = (system.variable(connection.from), system.variable(connection.to));
        let is_clock = |kind: &Kind| matches!(kind, Kind::Clock(_));
        let is_real = |kind: &Kind| ValueType::of(kind) == ValueType::Real;
        let has_events = system.events.get(connection.to.slave).copied().unwrap_or(false);
        if has_events && is_clock(&from.kind) && is_clock(&to.kind) {
            Way::Tick
        } else if !is_real(&to.kind) {
            if has_events { Way::AtEvents } else { Way::Held }
        } else if has_events
            && is_real(&from.kind)
            && system.signal_type(connection.to) != SignalType::Continuous
        {
            Way::AtEvents
        } else {
            Way::Real
        }
    }
}
