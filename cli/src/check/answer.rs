//! The summary for the user: whether the FMU runs here, and the tools in which it does not run.

use std::collections::BTreeMap;
use std::fmt;

use fmu_description::number::seconds;
use fmu_description::{Causality, ModelDescription, ScalarVariable};
use master::SignalType;
use serde::Serialize;

use super::finding::{Finding, Tool};

/// Largest number of names of variables of each type in the summary.
const SHOWN: usize = 8;

/// Result of a trial run in this master.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "runs", rename_all = "kebab-case")]
pub(super) enum TrialResult {
    /// The FMU was initialised and stepped with the start values of its description.
    Yes {
        steps: u32,
        /// Communication step in s.
        step: f64,
        /// Start time in s.
        start: f64,
        /// The tolerance that the FMU received.
        tolerance: Option<f64>,
        /// The reason for fewer steps than planned; none if all were made.
        but: Option<String>,
    },
    /// The FMU cannot run or failed.
    No { reason: String },
    /// The FMU was not run.
    NotTried { reason: String },
}

impl fmt::Display for TrialResult {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TrialResult::Yes { steps, step, start, tolerance, but } => {
                write!(formatter, "yes, {steps} steps of {} s from t = {start} s", seconds(*step))?;
                match tolerance {
                    Some(tolerance) => write!(formatter, " with tolerance {tolerance:e} and")?,
                    None => formatter.write_str(" without a tolerance, with")?,
                }
                formatter.write_str(" its own start values")?;
                but.as_ref().map_or(Ok(()), |but| write!(formatter, "; {but}"))
            }
            TrialResult::No { reason } => write!(formatter, "no: {reason}"),
            TrialResult::NotTried { reason } => write!(formatter, "not tried: {reason}"),
        }
    }
}

/// A tool that refuses the FMU.
#[derive(Debug, Serialize)]
pub(super) struct ToolRefusal {
    tool: Tool,
    /// The first finding for which the tool refuses the FMU.
    reason: String,
    /// Number of further findings for which the tool refuses the FMU.
    more: usize,
}

impl fmt::Display for ToolRefusal {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}: {}", self.tool, self.reason)?;
        match self.more {
            0 => Ok(()),
            1 => formatter.write_str("; and 1 more reason"),
            more => write!(formatter, "; and {more} more reasons"),
        }
    }
}

/// The names of the inputs and outputs of each type.
#[derive(Debug, Default, Serialize)]
pub(super) struct Signals {
    continuous: Vec<String>,
    discrete: Vec<String>,
    clocked: Vec<String>,
}

impl Signals {
    fn of(description: &ModelDescription) -> Self {
        let mut signals = Self::default();
        let is_signal = |variable: &&ScalarVariable| {
            matches!(variable.causality, Causality::Input | Causality::Output)
        };
        for variable in description.variables.iter().filter(is_signal) {
            let names = match SignalType::of(variable) {
                SignalType::Continuous => &mut signals.continuous,
                SignalType::Discrete => &mut signals.discrete,
                SignalType::Clocked => &mut signals.clocked,
            };
            names.push(variable.name.clone());
        }
        signals
    }
}

impl fmt::Display for Signals {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (what, names) in [
            (SignalType::Continuous, &self.continuous),
            (SignalType::Discrete, &self.discrete),
            (SignalType::Clocked, &self.clocked),
        ] {
            let shown = &names[..names.len().min(SHOWN)];
            if !shown.is_empty() {
                write!(formatter, "{what} inputs and outputs: {}", shown.join(", "))?;
                match names.len() - shown.len() {
                    0 => writeln!(formatter)?,
                    more => writeln!(formatter, " and {more} more")?,
                }
            }
        }
        Ok(())
    }
}

/// The summary.
#[derive(Debug, Serialize)]
pub(super) struct Answer {
    pub(super) here: TrialResult,
    signals: Signals,
    pub(super) not_in: Vec<ToolRefusal>,
}

impl Answer {
    /// Creates the summary from the trial, the description and the findings.
    pub(super) fn new(
        here: TrialResult,
        description: &ModelDescription,
        findings: &[Finding],
    ) -> Self {
        let mut tools: BTreeMap<Tool, ToolRefusal> = BTreeMap::new();
        for finding in findings {
            for &tool in &finding.stops {
                let reason = || format!("{}: {}", finding.place, finding.what);
                let entry = tools.entry(tool).and_modify(|refusal| refusal.more += 1);
                entry.or_insert_with(|| ToolRefusal { tool, reason: reason(), more: 0 });
            }
        }
        let signals = Signals::of(description);
        Self { here, signals, not_in: tools.into_values().collect() }
    }
}

impl fmt::Display for Answer {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(formatter, "runs in this master: {}", self.here)?;
        write!(formatter, "{}", self.signals)?;
        for refusal in &self.not_in {
            writeln!(formatter, "does not run in {refusal}")?;
        }
        let is_refused = !self.not_in.is_empty() || matches!(self.here, TrialResult::No { .. });
        let other = if is_refused { "no other" } else { "no" };
        write!(formatter, "{other} tool is known to refuse it")
    }
}
