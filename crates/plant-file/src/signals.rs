//! The signals of a plant file: states, actuators and measurements.

use fmu_description::unit::Unit;
use fmu_description::xml::is_character;

use crate::read::{Result, optional, whole, within};
use files::{Entry, Place, Table};

/// A state, an actuator, a measurement, a reference or a scheduling variable.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Signal {
    /// Name of the signal.
    pub name: String,
    /// Unit of the signal in the notation of FMI.
    pub unit: Option<String>,
    /// The meaning of the signal, for a reader.
    pub description: String,
    /// The value at the operating point, if stated.
    pub operating: Option<f64>,
    /// The smallest and the largest value: the limits of an actuator or the range of a measurement, if stated.
    pub limits: Option<[f64; 2]>,
    /// The longest time in s for which the last valid value of a measurement may replace it, if stated.
    pub longest_hold: Option<f64>,
    /// The time in s after which a command acts or a measurement arrives; 0 if not stated.
    pub delay: f64,
    /// The places of name, limits or range, and longest time of a hold, if the file states them.
    pub places: [Option<Place>; 3],
}

impl Signal {
    /// A signal with a name and nothing else.
    #[must_use]
    pub fn named(name: String) -> Self {
        Self { name, ..Self::default() }
    }

    /// The signal with unit and operating point of `other` where the signal has none.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        Self {
            unit: self.unit.or(other.unit),
            operating: self.operating.or(other.operating),
            ..self
        }
    }
}

/// Default number of states of the observer for each delay.
const DELAY_ORDER: usize = 3;
/// The largest number of states of the observer for each delay.
const MOST_DELAY_ORDER: u32 = 8;
/// The entries of a state.
pub(crate) const STATE: &[&str] = &["name", "unit", "description", "operating"];
/// The entries of an actuator.
pub(crate) const ACTUATOR: &[&str] =
    &["name", "unit", "description", "operating", "limits", "delay"];
/// The entries of a measurement.
pub(crate) const MEASUREMENT: &[&str] =
    &["name", "unit", "description", "operating", "range", "longest_hold", "delay"];

/// Reads a list of at least one signal, each a text (its name) or a table with some of `keys`. Refuses equal names.
pub(crate) fn signals(entry: &Entry<'_>, keys: &[&str]) -> Result<Vec<Signal>> {
    let members = entry.list()?;
    if members.is_empty() {
        return Err(entry.error("expected at least one"));
    }
    let mut all: Vec<Signal> = Vec::with_capacity(members.len());
    for member in &members {
        let signal = signal(member, keys)?;
        if all.iter().any(|other| other.name == signal.name) {
            return Err(member.error(format!("the name `{}` is there twice", signal.name)));
        }
        all.push(signal);
    }
    Ok(all)
}

fn signal(entry: &Entry<'_>, keys: &[&str]) -> Result<Signal> {
    if entry.is_text() {
        let places = [Some(entry.place.clone()), None, None];
        return Ok(Signal { places, ..Signal::named(name(entry)?) });
    }
    let table = entry.table()?;
    table.allow(keys)?;
    let range = table.get("range").or_else(|| table.get("limits"));
    let longest_hold = table.get("longest_hold");
    let delay = |entry: &Entry<'_>| within(entry, 0.0.., "expected a time in s, 0 or more");
    let name_entry = table.require("name", "the name of the signal")?;
    Ok(Signal {
        name: name(&name_entry)?,
        unit: unit(&table)?,
        description: description(&table)?,
        operating: optional(&table, "operating", Entry::number)?,
        limits: range.as_ref().map(limits).transpose()?,
        longest_hold: longest_hold.as_ref().map(Entry::positive).transpose()?,
        delay: optional(&table, "delay", delay)?.unwrap_or(0.0),
        places: [
            Some(name_entry.place),
            range.map(|entry| entry.place),
            longest_hold.map(|entry| entry.place),
        ],
    })
}

/// Reads a name: a text of one line that is not empty.
pub(crate) fn name(entry: &Entry<'_>) -> Result<String> {
    match entry.text()? {
        "" => Err(entry.error("expected a name, found an empty text")),
        name => match name
            .chars()
            .find(|character| character.is_control() || !is_character(*character))
        {
            None => Ok(name.to_owned()),
            Some(character) => Err(entry.error(format!(
                "expected a name of one line without control characters, found {character:?} in it"
            ))),
        },
    }
}

/// Reads the entry `description`, whose characters XML must allow; empty without it.
pub(crate) fn description(table: &Table<'_>) -> Result<String> {
    let Some(entry) = table.get("description") else { return Ok(String::new()) };
    let text = entry.text()?;
    match text.chars().find(|character| !is_character(*character)) {
        None => Ok(text.to_owned()),
        Some(character) => {
            Err(entry.error(format!("found {character:?}, which the XML of an FMU cannot hold")))
        }
    }
}

/// Reads the entry `unit`, which must be a unit of FMI; `None` without it.
pub(crate) fn unit(table: &Table<'_>) -> Result<Option<String>> {
    let Some(entry) = table.get("unit") else { return Ok(None) };
    let text = entry.text()?;
    match Unit::parse(text) {
        Ok(_) => Ok(Some(text.to_owned())),
        Err(error) => Err(entry.error(error)),
    }
}

/// Relative difference of the factors of two units, and distance of their zeros, below which the units are the same.
const SAME_UNIT: f64 = 1e-6;

/// Whether two units are the same, or FMI does not know one of them.
#[must_use]
pub fn is_one_unit(one: &str, other: &str) -> bool {
    conversion(one, other)
        .is_none_or(|(factor, offset)| (factor - 1.0).abs() < SAME_UNIT && offset.abs() < SAME_UNIT)
}

/// Whether differences have the same values in two units, such as K and degC, or FMI does not know one of them.
#[must_use]
pub fn is_one_unit_of_differences(one: &str, other: &str) -> bool {
    conversion(one, other).is_none_or(|(factor, _)| (factor - 1.0).abs() < SAME_UNIT)
}

/// Returns factor and offset between two units, NaN for different quantities; `None` if FMI does not know one of them.
fn conversion(one: &str, other: &str) -> Option<(f64, f64)> {
    let base = |text: &str| Unit::parse(text).ok()?.base;
    let (one, other) = (base(one)?, base(other)?);
    Some(one.conversion(&other).unwrap_or((f64::NAN, f64::NAN)))
}

/// Reads `delay_order`, the number of states with which the observer approximates each delay; an error if no signal has
/// a delay.
pub(crate) fn delay_order(file: &Table<'_>, signals: [&[Signal]; 2]) -> Result<usize> {
    let Some(entry) = file.get("delay_order") else { return Ok(DELAY_ORDER) };
    if signals.into_iter().flatten().all(|signal| signal.delay <= 0.0) {
        return Err(entry.error("no actuator and no measurement has a `delay`"));
    }
    Ok(whole(&entry, 1..=MOST_DELAY_ORDER)? as usize)
}

/// Reads a lower and an upper limit.
fn limits(entry: &Entry<'_>) -> Result<[f64; 2]> {
    match entry.numbers()?.as_slice() {
        &[low, high] if low < high => Ok([low, high]),
        &[low, high] => Err(entry.error(format!("expected lower < upper, found {low} and {high}"))),
        other => {
            Err(entry.error(format!("expected 2 numbers, lower and upper, found {}", other.len())))
        }
    }
}

/// Returns the position of the signal that the entry names; `what` says in errors what the signals are.
pub(crate) fn position(entry: &Entry<'_>, signals: &[Signal], what: &str) -> Result<usize> {
    position_of(entry.text()?, entry, signals, what)
}

/// Returns the position of the signal `name`; an error is at `entry`.
pub(crate) fn position_of(
    name: &str,
    entry: &Entry<'_>,
    signals: &[Signal],
    what: &str,
) -> Result<usize> {
    signals.iter().position(|signal| signal.name == name).ok_or_else(|| {
        entry.error(format!("no {what} is named {name:?}; there are {}", signal_names(signals)))
    })
}

/// Reads names of signals, each once, or the text "all"; returns the positions of at least one signal.
pub(crate) fn positions(entry: &Entry<'_>, signals: &[Signal], what: &str) -> Result<Vec<usize>> {
    if entry.is_text() {
        return match entry.text()? {
            "all" => Ok((0..signals.len()).collect()),
            other => {
                Err(entry.error(format!("expected a list of names or \"all\", found {other:?}")))
            }
        };
    }
    let mut all = Vec::new();
    for member in entry.list()? {
        let at = position(&member, signals, what)?;
        if all.contains(&at) {
            return Err(member.error(format!("the {what} `{}` is there twice", signals[at].name)));
        }
        all.push(at);
    }
    if all.is_empty() {
        return Err(entry.error("expected at least one name, or \"all\""));
    }
    Ok(all)
}

/// Whether all signals have the same unit, or none has one.
#[must_use]
pub fn same_unit(signals: &[Signal]) -> bool {
    signals.iter().all(|signal| signal.unit == signals[0].unit)
}

/// The names of signals, separated by commas.
#[must_use]
pub fn signal_names(signals: &[Signal]) -> String {
    joined(signals.iter().map(|signal| signal.name.as_str()))
}

/// Names, separated by commas.
pub fn joined<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.collect::<Vec<_>>().join(", ")
}
