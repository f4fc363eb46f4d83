//! Interventions: entries of the scenario that are added while the run goes on.

use std::path::Path;

use files::Source;

use super::Run;
use crate::error::Error;
use crate::scenario::{Scenario, Setup};

/// The entries that an intervention may have.
const EXPECTED: &str =
    "expected [[set]] or [[fault]], for example [[set]] variable = \"plant.F_c\" value = 15";

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
    /// [`master::Simulation::next_change`]. Call it between steps, from [`Run::advance_open`].
    ///
    /// [`Run::config`] has the entries afterwards: a run of this configuration from the start gives
    /// the same results, bit for bit.
    ///
    /// # Errors
    ///
    /// Returns an error, and changes nothing, if the run ends before a change can take effect, or if
    /// an entry is invalid: a delay (the values before it are not known), a time that has passed, or
    /// for one of the reasons of a `system.toml`.
    pub fn intervene(&mut self, text: &str) -> Result<Intervention, Error> {
        let time = self.simulation.time();
        let from = self.simulation.next_change().ok_or_else(|| {
            Error::Invalid(format!(
                "t = {time} s: the run ends before a change can take effect, at the second \
                 communication point from now or before"
            ))
        })?;
        let (added, text) = entries(text, from)?;
        let mut scenario = self.config.scenario.clone();
        scenario.set.extend(added.set);
        scenario.fault.extend(added.fault);
        let start = self.plan.experiment.start_time;
        // The paths are absolute already.
        let setup = Setup { folder: Path::new(""), start, step: self.plan.algorithm.step };
        let resolved = scenario.resolve(&*self.simulation.system(), &setup)?;
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

/// Reads the entries of an intervention that takes effect at `from` or later, in s; also returns them
/// as a text with all times.
fn entries(text: &str, from: f64) -> Result<(Scenario, String), Error> {
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
        put_time(set, "at", from)?;
    }
    for fault in members(&mut table, "fault") {
        for (_, kind) in fault.iter_mut() {
            if let Some(kind) = kind.as_table_mut() {
                put_time(kind, "from", from)?;
            }
        }
    }
    let complete = toml::to_string(&table).map_err(|error| Error::Invalid(error.to_string()))?;
    let added: Scenario =
        toml::from_str(&complete).map_err(|error| Error::Invalid(error.message().to_owned()))?;
    if added.fault.iter().any(|fault| fault.get_ref().delay.is_some()) {
        return Err(Error::Invalid(
            "a delay needs the values from before its start, which the run has not kept; put it into \
             the scenario of the system.toml, with `from`"
                .to_owned(),
        ));
    }
    Ok((added, complete))
}

/// Returns the tables of the list `key`.
fn members<'a>(table: &'a mut toml::Table, key: &str) -> impl Iterator<Item = &'a mut toml::Table> {
    let list = table.get_mut(key).and_then(toml::Value::as_array_mut);
    list.into_iter().flatten().filter_map(toml::Value::as_table_mut)
}

/// Puts the time `key` into a table, or checks that it is not before `from`, in s.
#[expect(clippy::cast_precision_loss, reason = "a time")]
fn put_time(table: &mut toml::Table, key: &'static str, from: f64) -> Result<(), Error> {
    let stated = match table.get(key) {
        None => {
            table.insert(key.to_owned(), toml::Value::Float(from));
            return Ok(());
        }
        Some(toml::Value::Float(time)) => *time,
        Some(toml::Value::Integer(time)) => *time as f64,
        // The type is refused with all others.
        Some(_) => return Ok(()),
    };
    if stated >= from {
        return Ok(());
    }
    Err(Error::Invalid(format!(
        "{key} is {stated}, expected a time of {from} s or later, the first one that the run has not \
         used yet; without {key} this time is taken"
    )))
}

#[cfg(test)]
mod tests;
