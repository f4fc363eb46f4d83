//! The table `[reference]` of a plant file: set points of measurements.

use crate::read::Result;
use files::{Entry, Place, Table};
use fmu_description::unit::Unit;
use nalgebra::DMatrix;

use crate::signals::{Signal, description, name, position, position_of, unit};

/// Largest error of a sum of factors, such as three times 0.3333, with which the sum counts as 1.
const ROUNDING: f64 = 1e-3;

/// The references of a plant file.
#[derive(Clone, Debug, PartialEq)]
pub struct References {
    /// The references as inputs of the controller FMU, without operating points; see [`References::completed`].
    pub signals: Vec<Signal>,
    /// H, t x p: each reference is the set point of an entry of H y, with the measurements y.
    pub h: DMatrix<f64>,
    /// For each reference, the size of the step in the report, in the unit of the reference, if stated.
    pub steps: Vec<Option<f64>>,
    /// Place of each reference in the file.
    pub places: Vec<Place>,
    /// Whether the control errors are integrated; otherwise the references act by the feedforward only.
    pub integral: bool,
    /// Whether the references act on the commands by a constant gain.
    pub feedforward: bool,
    /// Places of `integral` and `feedforward` in the file; the place of the table for an entry that is not stated.
    pub action_places: [Place; 2],
    /// Time constant, in s, of the back-calculation of the integrals while a command is at its limit, if stated.
    pub windup_time: Option<f64>,
}

const KEYS: [&str; 4] = ["track", "integral", "feedforward", "windup_time"];
const REFERENCE: [&str; 6] = ["measurement", "combination", "name", "unit", "description", "step"];

impl References {
    /// Reads the table, if there is one.
    pub(crate) fn read(file: &Table<'_>, measurements: &[Signal]) -> Result<Option<Self>> {
        let Some(entry) = file.get("reference") else { return Ok(None) };
        let table = entry.table()?;
        table.allow(&KEYS)?;
        let track = table.require("track", "the measurements that follow references")?;
        let members = if track.is_list() { track.list()? } else { vec![track.clone()] };
        if members.is_empty() {
            return Err(track.error("expected at least one measurement"));
        }
        let integral_entry = table.get("integral");
        let integral = integral_entry.as_ref().map_or(Ok(true), Entry::flag)?;
        let feedforward_entry = table.get("feedforward");
        let feedforward = feedforward_entry.as_ref().map_or(Ok(!integral), Entry::flag)?;
        if let Some(entry) = feedforward_entry.as_ref().filter(|_| !integral && !feedforward) {
            let message = "`integral` and `feedforward` are false, so that no reference acts on a command; \
                           expected one of them";
            return Err(entry.error(message));
        }
        let windup_time = table.get("windup_time");
        if let Some(entry) = windup_time.as_ref().filter(|_| !integral) {
            return Err(entry.error("only integral action winds up, and `integral` is false"));
        }
        let mut references = Self {
            signals: Vec::new(),
            h: DMatrix::zeros(members.len(), measurements.len()),
            steps: Vec::new(),
            places: Vec::new(),
            integral,
            feedforward,
            action_places: [integral_entry, feedforward_entry]
                .map(|stated| stated.map_or_else(|| entry.place.clone(), |entry| entry.place)),
            windup_time: windup_time.map(|entry| entry.positive()).transpose()?,
        };
        for (at, member) in members.iter().enumerate() {
            let (signal, weights, step) = reference(member, measurements)?;
            if references.signals.iter().any(|other| other.name == signal.name) {
                return Err(member.error(format!("the name `{}` is there twice", signal.name)));
            }
            references.h.row_mut(at).copy_from_slice(&weights);
            references.signals.push(signal);
            references.steps.push(step);
            references.places.push(member.place.clone());
        }
        Ok(Some(references))
    }

    /// Returns the references with operating points and units. The operating points follow from the measurements,
    /// `None` if no measurement has one. A unit that is not stated is the common unit of the measurements, if any. A
    /// combination of temperatures in degC has this unit only if its factors add up to 1.
    #[must_use]
    pub fn completed(&self, measurements: &[Signal]) -> Vec<Signal> {
        let complete = |(at, signal): (usize, &Signal)| {
            let weights = self.h.row(at);
            let stated = measurements.iter().any(|one| one.operating.is_some());
            let operating = weights.iter().zip(measurements);
            let operating = operating.map(|(weight, one)| weight * one.operating.unwrap_or(0.0));
            let mut units = weights.iter().zip(measurements).filter(|(weight, _)| **weight != 0.0);
            let first = units.next().and_then(|(_, one)| one.unit.clone());
            let same = units.all(|(_, one)| one.unit == first);
            let is_mean = (weights.sum() - 1.0).abs() < ROUNDING;
            let has_offset = |unit: &String| {
                let base = Unit::parse(unit).ok().and_then(|unit| unit.base);
                base.is_some_and(|base| base.offset != 0.0)
            };
            let unit = first.filter(|unit| same && (is_mean || !has_offset(unit)));
            Signal {
                operating: stated.then(|| operating.sum()),
                unit: signal.unit.clone().or(unit),
                ..signal.clone()
            }
        };
        self.signals.iter().enumerate().map(complete).collect()
    }
}

/// Reads a reference: the name of a measurement, or a table. Returns the signal of the reference, the row of H and the
/// size of the step, if stated.
fn reference(
    entry: &Entry<'_>,
    measurements: &[Signal],
) -> Result<(Signal, Vec<f64>, Option<f64>)> {
    let mut weights = vec![0.0; measurements.len()];
    if entry.is_text() {
        let at = position(entry, measurements, "measurement")?;
        weights[at] = 1.0;
        return Ok((named_after(&measurements[at], entry), weights, None));
    }
    let table = entry.table()?;
    table.allow(&REFERENCE)?;
    let name_entry = table.get("name");
    let mut signal = match (table.get("measurement"), table.get("combination")) {
        (Some(_), Some(second)) => {
            return Err(second.error("expected `measurement` or `combination`, found both"));
        }
        (None, None) => {
            let message = "expected `measurement`, a name, or `combination`, a table from names of \
                           measurements to factors";
            return Err(entry.error(message));
        }
        (Some(measurement), None) => {
            let at = position(&measurement, measurements, "measurement")?;
            weights[at] = 1.0;
            named_after(&measurements[at], entry)
        }
        (None, Some(combination)) => {
            for (measurement, entry) in combination.table()?.entries() {
                let factor = entry.number()?;
                let at = position_of(measurement, &entry, measurements, "measurement")?;
                weights[at] = factor;
            }
            if weights.iter().all(|weight| *weight == 0.0) {
                return Err(combination.error("expected a factor other than 0"));
            }
            table.require("name", "the name of the input of the controller FMU")?;
            Signal::named(String::new())
        }
    };
    if let Some(entry) = name_entry {
        signal.name = name(&entry)?;
        signal.places[0] = Some(entry.place);
    }
    signal.unit = unit(&table)?.or(signal.unit);
    let text = description(&table)?;
    if !text.is_empty() {
        signal.description = text;
    }
    let size = |entry: Entry<'_>| match entry.number()? {
        0.0 => Err(entry.error("expected a step other than 0")),
        size => Ok(size),
    };
    Ok((signal, weights, table.get("step").map(size).transpose()?))
}

/// The reference of a measurement: `r_h1` for `h1`, `'r_level 1'` for `'level 1'`.
fn named_after(measurement: &Signal, entry: &Entry<'_>) -> Signal {
    let name = match measurement.name.strip_prefix('\'') {
        Some(rest) => format!("'r_{rest}"),
        None => format!("r_{}", measurement.name),
    };
    Signal {
        description: match measurement.description.as_str() {
            "" => format!("set point of {}", measurement.name),
            text => format!("set point of {text}"),
        },
        places: [Some(entry.place.clone()), None, None],
        ..Signal::named(name)
    }
}
