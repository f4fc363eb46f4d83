//! Interventions: entries of the scenario that are added while the run goes on.

use std::path::Path;

use files::Source;
use fmu_description::number::seconds;

use super::Run;
use crate::error::Error;
use crate::scenario::{Scenario, Setup};

/// The entries that an intervention may have.
const EXPECTED: &str =
    "expected [[set]] or [[fault]], for example [[set]] variable = \"plant.F_c\" value = 15";

/// Reason for the earliest time of most entries.
const UNUSED: &str = "the first one that the run has not used yet";

/// A change of the scenario of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Intervention {
    /// Time in s that the run had reached.
    pub time: f64,
    /// The earliest time in s at which the change can take effect, and at which it does unless an
    /// entry states a later one.
    pub from: f64,
    /// The entries, complete, as they are in a `system.toml` below `scenario`.
    pub text: String,
}

impl Run {
    /// Adds entries to the scenario: `text` has `[[set]]` and `[[fault]]` as a `system.toml` has them
    /// below `scenario`. A time `at` or `from` that is not stated is
    /// [`master::Simulation::next_change`]; that of a delay is not before the present time plus the delay, because
    /// the run keeps the values on the connection from now on. Call it between steps, from [`Run::advance_open`].
    ///
    /// [`Run::config`] has the entries afterwards: a run of this configuration from the start gives
    /// the same results, bit for bit.
    ///
    /// # Errors
    ///
    /// Returns an error, and changes nothing, if the run ends before a change can take effect, or if
    /// an entry is invalid: a time that has passed, a delay in a run whose steps vary (which points it
    /// keeps depends on earlier steps), or for one of the reasons of a `system.toml`.
    pub fn intervene(&mut self, text: &str) -> Result<Intervention, Error> {
        let time = self.simulation.time();
        let from = self.simulation.next_change().ok_or_else(|| {
            Error::Invalid(format!(
                "t = {} s: the run ends before a change can take effect, at the second \
                 communication point from now or before",
                seconds(time)
            ))
        })?;
        let (added, text) = entries(text, time, from)?;
        let has_delay = added.fault.iter().any(|fault| fault.get_ref().delay.is_some());
        if has_delay && self.simulation.has_varying_steps() {
            return Err(Error::Invalid(
                "a delay depends on values from before its start, which the run has not kept, where the steps \
                 vary; put it into the scenario of the system.toml, with `from`"
                    .to_owned(),
            ));
        }
        let mut scenario = self.config.scenario.clone();
        scenario.set.extend(added.set);
        scenario.fault.extend(added.fault);
        let start = self.plan.experiment.start_time;
        // The paths are absolute already.
        let setup =
            Setup { folder: Path::new(""), start, step: self.plan.algorithm.step, tables: &[] };
        let resolved = scenario.resolve(self.simulation.system(), &setup)?;
        self.simulation.change_scenario(resolved.scenario)?;
        if let Some(recorder) = &mut self.recorder {
            recorder.follow(&self.simulation);
        }
        self.config.scenario = scenario;
        if let Some(checkpoints) = &mut self.checkpoints {
            checkpoints.text = self.config.render()?;
        }
        Ok(Intervention { time, from, text })
    }
}

/// Reads the entries of an intervention at `time` that takes effect at `from` or later, in s; also returns them
/// as a text with all times.
fn entries(text: &str, time: f64, from: f64) -> Result<(Scenario, String), Error> {
    let source = Source::new(Path::new("intervention"), text.to_owned());
    let mut table: toml::Table = text.parse().map_err(|error: toml::de::Error| {
        let end = text.len();
        source.error(&error.span().unwrap_or(end..end), error.message())
    })?;
    if let Some(other) = table.keys().find(|key| !["set", "fault"].contains(&key.as_str())) {
        return Err(Error::Invalid(format!("found {other:?}, {EXPECTED}")));
    }
    if table.is_empty() {
        return Err(Error::Invalid(format!("found no entry, {EXPECTED}")));
    }
    for set in members(&mut table, "set") {
        put_time(set, "at", from, UNUSED)?;
    }
    for fault in members(&mut table, "fault") {
        for (name, kind) in fault.iter_mut() {
            let Some(kind) = kind.as_table_mut() else { continue };
            let delay = kind.get("seconds").filter(|_| name == "delay").and_then(number);
            match delay.map(|delay| time + delay).filter(|full| *full > from) {
                Some(full) => put_time(kind, "from", full, "when the delayed values are known")?,
                None => put_time(kind, "from", from, UNUSED)?,
            }
        }
    }
    let complete = toml::to_string(&table).map_err(|error| Error::Invalid(error.to_string()))?;
    let added: Scenario =
        toml::from_str(&complete).map_err(|error| Error::Invalid(error.message().to_owned()))?;
    Ok((added, complete))
}

/// Returns the tables of the list `key`.
fn members<'a>(table: &'a mut toml::Table, key: &str) -> impl Iterator<Item = &'a mut toml::Table> {
    let list = table.get_mut(key).and_then(toml::Value::as_array_mut);
    list.into_iter().flatten().filter_map(toml::Value::as_table_mut)
}

/// Puts the time `key` into a table, or checks that it is not before `from`, in s; `reason` says what this time is.
fn put_time(
    table: &mut toml::Table,
    key: &'static str,
    from: f64,
    reason: &str,
) -> Result<(), Error> {
    let Some(stated) = table.get(key) else {
        table.insert(key.to_owned(), toml::Value::Float(from));
        return Ok(());
    };
    // Another type is refused with all others.
    let Some(stated) = number(stated) else { return Ok(()) };
    if stated >= from {
        return Ok(());
    }
    Err(Error::Invalid(format!(
        "{key} is {stated}, expected a time of {from} s or later, {reason}; without {key} this time is \
         taken"
    )))
}

#[expect(clippy::cast_precision_loss, reason = "a time")]
fn number(value: &toml::Value) -> Option<f64> {
    match value {
        toml::Value::Float(number) => Some(*number),
        toml::Value::Integer(number) => Some(*number as f64),
        _ => None,
    }
}

#[cfg(test)]
mod tests;
