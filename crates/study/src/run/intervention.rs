//! Interventions: entries that are added to the scenario during the run.

use std::path::Path;

use files::Source;
use fmu_description::number::seconds;

use super::Run;
use crate::error::Error;
use crate::scenario::{Scenario, Setup};

/// The entries that an intervention may have.
const EXPECTED: &str =
    "expected [[set]] or [[fault]], for example [[set]] variable = \"plant.F_c\" value = 15";

/// The reason for the earliest time of an entry that is not a delay, for messages.
const UNUSED: &str = "the first one that the run has not used yet";

/// A change of the scenario of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Intervention {
    /// Time in s that the run had reached when the entries were added.
    pub time: f64,
    /// The earliest time in s at which the change can take effect: the default time of an entry.
    pub from: f64,
    /// The entries with all times, in the form of `scenario` in a `system.toml`.
    pub text: String,
}

impl Run {
    /// Adds entries to the scenario. `text` has `[[set]]` and `[[fault]]` as `scenario` in a `system.toml`. Call it
    /// between steps, from [`Run::advance_open`].
    ///
    /// The default of a time `at` or `from` is [`master::Simulation::next_change`]. A delay starts at the present time
    /// plus the delay if this sum is later, because the run has no earlier values of the connection.
    ///
    /// [`Run::config`] has the entries afterwards: a run of this configuration from the start gives
    /// the same results, bit for bit.
    ///
    /// # Errors
    ///
    /// Returns an error, and changes nothing, if the run ends before a change can take effect, if `text` has no entry
    /// or an entry that a `system.toml` does not allow, if a time is before its default, or if a delay is added to a
    /// run whose steps vary: which values such a run keeps depends on its steps so far.
    pub fn intervene(&mut self, text: &str) -> Result<Intervention, Error> {
        let time = self.simulation.time();
        let from = self.simulation.next_change().ok_or_else(|| {
            Error::Invalid(format!(
                "t = {} s: the run ends before a change can take effect: the first communication \
                 point after all steps so far is not before its stop time",
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
        let (start, step) = (self.plan.experiment.start_time, self.plan.algorithm.step);
        // The paths are absolute already.
        let setup = Setup { folder: Path::new(""), start, step, tables: &self.tables };
        let resolved = scenario.resolve(self.simulation.system(), &setup)?;
        self.simulation.change_scenario(resolved.scenario)?;
        if let Some(recorder) = &mut self.recorder {
            self.simulation.follow(&mut recorder.readout);
        }
        self.config.scenario = scenario;
        if let Some(checkpoints) = &mut self.checkpoints {
            checkpoints.text = self.config.render()?;
        }
        Ok(Intervention { time, from, text })
    }
}

/// Parses the entries of an intervention at `time` that takes effect at `from` or later, in s; also returns them
/// as TOML with all times. Returns an error if the text is not TOML, has other or no entries, or a time that is too
/// early.
fn entries(text: &str, time: f64, from: f64) -> Result<(Scenario, String), Error> {
    let source = Source::new(Path::new("intervention"), text.to_owned());
    let mut table: toml::Table = text.parse().map_err(|error: toml::de::Error| {
        let end = text.len();
        source.error(&error.span().unwrap_or(end..end), error.message())
    })?;
    if let Some(other) = table.keys().find(|key| !["set", "fault"].contains(&key.as_str())) {
        return Err(Error::Invalid(format!("found {other:?}, {EXPECTED}")));
    }
    if table.values().all(|list| list.as_array().is_some_and(Vec::is_empty)) {
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

/// Returns the tables in the list `key`; none if there is no such list.
fn members<'a>(table: &'a mut toml::Table, key: &str) -> impl Iterator<Item = &'a mut toml::Table> {
    let list = table.get_mut(key).and_then(toml::Value::as_array_mut);
    list.into_iter().flatten().filter_map(toml::Value::as_table_mut)
}

/// Inserts the time `key` = `from` in s into a table, or checks that the stated time is not before `from`; `reason`
/// explains this limit in the message.
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
    // The parser of the scenario refuses another type.
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
