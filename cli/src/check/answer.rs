//! The answer to the question of the user: does the FMU run here, and which tools does it not run in?

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use super::finding::{Finding, Tool};

/// What came of a trial in this master.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "runs", rename_all = "kebab-case")]
pub(super) enum TrialResult {
    /// It was initialised and stepped with its own start values.
    Yes {
        steps: u32,
        /// Communication step in s.
        step: f64,
        /// Start time in s.
        start: f64,
        /// The tolerance that it was given.
        tolerance: Option<f64>,
        /// Why there were not more steps.
        but: Option<String>,
    },
    /// It failed.
    No { reason: String },
    /// It was not run.
    NotTried { reason: String },
}

impl fmt::Display for TrialResult {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TrialResult::Yes { steps, step, start, tolerance, but } => {
                write!(formatter, "yes, {steps} steps of {step} s from t = {start} s")?;
                match tolerance {
                    Some(tolerance) => write!(formatter, " with tolerance {tolerance:e}")?,
                    None => write!(formatter, " without a tolerance")?,
                }
                formatter.write_str(" and its own start values")?;
                but.as_ref().map_or(Ok(()), |but| write!(formatter, "; {but}"))
            }
            TrialResult::No { reason } => write!(formatter, "no: {reason}"),
            TrialResult::NotTried { reason } => write!(formatter, "not tried: {reason}"),
        }
    }
}

/// A tool in which the FMU does not run.
#[derive(Debug, Serialize)]
pub(super) struct ToolRefusal {
    tool: Tool,
    /// The first finding that stops it.
    reason: String,
    /// How many more there are.
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

/// The answer.
#[derive(Debug, Serialize)]
pub(super) struct Answer {
    pub(super) here: TrialResult,
    pub(super) not_in: Vec<ToolRefusal>,
}

impl Answer {
    /// By what was tried and found.
    pub(super) fn new(here: TrialResult, findings: &[Finding]) -> Self {
        let mut tools: BTreeMap<Tool, ToolRefusal> = BTreeMap::new();
        for finding in findings {
            for &tool in &finding.stops {
                let reason = || format!("{}: {}", finding.place, finding.what);
                let known = tools.entry(tool).and_modify(|own| own.more += 1);
                known.or_insert_with(|| ToolRefusal { tool, reason: reason(), more: 0 });
            }
        }
        Self { here, not_in: tools.into_values().collect() }
    }
}

impl fmt::Display for Answer {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(formatter, "runs in this master: {}", self.here)?;
        for elsewhere in &self.not_in {
            writeln!(formatter, "does not run in {elsewhere}")?;
        }
        let alone = self.not_in.is_empty() && !matches!(self.here, TrialResult::No { .. });
        let other = if alone { "no" } else { "no other" };
        write!(formatter, "{other} tool is known to refuse it")
    }
}
