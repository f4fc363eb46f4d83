//! Resolves `[[scenario.set]]`, `[[scenario.signal]]` and `[[scenario.table]]`.

use std::collections::BTreeMap;
use std::path::Path;

use fmu_description::Kind;
use serde_spanned::Spanned;

use super::convert::Conversion;
use super::literal::{Literal, fits_integer, integers};
use super::resolve::{Resolver, Target, at, finite, kinds, only, positive, require};
use super::{Csv, Ramp, Reason, ScenarioError, SetEntry, SignalEntry, Sine, TableEntry};
use crate::table::Table;
use master::drive::DriveSource;
use master::signal::{Interpolation, Signal, Track};
use master::{Port, SystemError, Value};

/// Kinds of a signal.
const KINDS: &str = "constant, steps, points, ramp, sine, csv";
/// Largest number of names in a message about columns.
const MOST_NAMES: usize = 10;

/// The settings of one variable: times with values, and the first of the entries with the path of this entry.
struct Settings<'a> {
    target: Target<'a>,
    path: String,
    entry: &'a Spanned<SetEntry>,
    points: Vec<(f64, f64)>,
    texts: Vec<String>,
}

impl<'a> Resolver<'a> {
    /// Resolves `[[scenario.set]]`.
    pub(super) fn settings(
        &mut self,
        entries: &'a [Spanned<SetEntry>],
    ) -> Result<(), ScenarioError> {
        let mut variables: Vec<Settings<'a>> = Vec::new();
        let mut positions: BTreeMap<(usize, usize), usize> = BTreeMap::new();
        for (index, entry) in entries.iter().enumerate() {
            let path = format!("scenario.set[{}]", index + 1);
            let set = entry.get_ref();
            let target = self.drivable(set.variable.get_ref()).map_err(at(&set.variable, &path))?;
            finite("at", set.at).map_err(at(entry, &path))?;
            let Port { slave, variable } = target.port;
            let position = *positions.entry((slave, variable)).or_insert_with(|| {
                let (points, texts) = (Vec::new(), Vec::new());
                variables.push(Settings { target, path: path.clone(), entry, points, texts });
                variables.len() - 1
            });
            let Settings { target, points, texts, .. } = &mut variables[position];
            let value = conversion(set.unit.as_ref(), target)
                .and_then(|conversion| encode(set.value.get_ref(), target, conversion, texts))
                .map_err(at(&set.value, &path))?;
            // Adding zero maps minus zero to plus zero, which is the same time.
            points.push((set.at + 0.0, value));
        }
        for Settings { target, path, entry, points, texts } in variables {
            let source = source_of_settings(points, texts).map_err(at(entry, &path))?;
            self.add(&target, source, &path).map_err(at(entry, &path))?;
        }
        Ok(())
    }

    /// Resolves an entry of `[[scenario.signal]]`.
    pub(super) fn signal(&mut self, entry: &SignalEntry, path: &str) -> Result<(), Reason> {
        let target = self.drivable(entry.variable.get_ref())?;
        let kind = only(&kinds!(entry: constant, steps, points, ramp, sine, csv), KINDS)?;
        if ["points", "ramp", "sine"].contains(&kind) && !target.is_real() {
            return Err(unfit(kind, &target, "constant, steps or csv"));
        }
        let conversion = conversion(entry.unit.as_ref(), &target)?;
        let mut texts = Vec::new();
        let signal = if let Some(value) = &entry.constant {
            Signal::Constant(encode(value.get_ref(), &target, conversion, &mut texts)?)
        } else if let Some(steps) = &entry.steps {
            held_steps(steps.get_ref(), &target, conversion, &mut texts)?
        } else if let Some(points) = &entry.points {
            scaled(track(points.get_ref().iter().copied(), Interpolation::Line)?, conversion)
        } else if let Some(ramp) = &entry.ramp {
            scaled(ramp_signal(ramp.get_ref())?, conversion)
        } else if let Some(sine) = &entry.sine {
            scaled(sine_signal(sine.get_ref(), self.setup.start)?, conversion)
        } else if let Some(csv) = &entry.csv {
            scaled(self.column(csv.get_ref(), &target)?, conversion)
        } else {
            return Err(Reason::Kinds { actual: Vec::new(), expected: KINDS });
        };
        self.add(&target, DriveSource { signal, start: f64::NEG_INFINITY, texts }, path)
    }

    /// Returns the signal of a column; by default the column has the name of the variable, with or without its slave.
    fn column(&mut self, csv: &Csv, target: &Target<'_>) -> Result<Signal, Reason> {
        let (path, table) = self.file(csv.file.get_ref())?;
        let name = match &csv.column {
            Some(column) => column.get_ref().clone(),
            None if table.column(&target.name).is_some() => target.name.clone(),
            None => target.variable.name.clone(),
        };
        column_signal(&path, &table, &name, target, csv.hold)
    }

    /// Resolves an entry of `[[scenario.table]]`. Skips columns of variables that an entry of `set` or `signal` drives:
    /// drives before the position `first_table_drive`. Also skips columns of further aliases of a variable.
    /// Returns an error if no column has the name of a variable that can be driven.
    pub(super) fn table(
        &mut self,
        entry: &TableEntry,
        path: &str,
        first_table_drive: usize,
    ) -> Result<(), Reason> {
        let (file, table) = self.file(entry.csv.get_ref())?;
        let mut used = false;
        for column in &table.names {
            let name = match &entry.element {
                Some(element) => format!("{}.{column}", element.get_ref()),
                None => column.clone(),
            };
            match self.drivable(&name) {
                Ok(target) => {
                    used = true;
                    let mut drives = self.drives.iter().enumerate();
                    let is_driven = drives.any(|(position, (drive, origin))| {
                        drive.port() == target.port
                            && (position < first_table_drive || origin == path)
                    });
                    if !is_driven {
                        let signal = column_signal(&file, &table, column, &target, false)?;
                        let texts = Vec::new();
                        let source = DriveSource { signal, start: f64::NEG_INFINITY, texts };
                        self.add(&target, source, path)?;
                        continue;
                    }
                }
                Err(Reason::Name(error @ SystemError::UnknownSlave { .. }))
                    if entry.element.is_some() =>
                {
                    return Err(error.into());
                }
                Err(_) => {}
            }
            self.unused.push((file.clone(), column.clone()));
        }
        if used {
            return Ok(());
        }
        let known = first_names(&table.names);
        let expected = match &entry.element {
            Some(element) => format!("a free input of {}", element.get_ref()),
            None => "FMU.VARIABLE of a free input".to_owned(),
        };
        Err(Reason::NoColumn { path: file, expected, known })
    }
}

/// Lists up to [`MOST_NAMES`] column names of a file.
fn first_names(names: &[String]) -> String {
    let more = if names.len() > MOST_NAMES { ", .." } else { "" };
    format!("{}{more}", names[..names.len().min(MOST_NAMES)].join(", "))
}

pub(super) fn unfit(what: &'static str, target: &Target<'_>, expected: &'static str) -> Reason {
    let kind = target.variable.kind.element();
    Reason::Unfit { what, name: target.name.clone(), kind, expected }
}

pub(super) fn conversion(
    unit: Option<&Spanned<String>>,
    target: &Target<'_>,
) -> Result<Conversion, Reason> {
    let stated = unit.map(|unit| unit.get_ref().as_str());
    Conversion::find(stated, &target.name, target.variable, target.description)
}

/// Encodes a value as a number in the unit of the variable; a text for a String is added to `texts` and becomes
/// its index. Returns an error if the value does not fit the type.
#[expect(clippy::cast_precision_loss, reason = "a position")]
fn encode(
    value: &Literal,
    target: &Target<'_>,
    conversion: Conversion,
    texts: &mut Vec<String>,
) -> Result<f64, Reason> {
    if let Kind::String(_) = target.variable.kind {
        let Literal::Text(text) = value else {
            return Err(target.value_error(value, "a text in quotes"));
        };
        let parsed = Value::parse(&target.variable.kind, &[], text);
        parsed.map_err(|expected| target.value_error(value, expected))?;
        texts.push(text.clone());
        return Ok((texts.len() - 1) as f64);
    }
    let number = value.number(target.variable, target.description);
    let number = number.map_err(|expected| target.value_error(value, expected))?;
    Ok(conversion.absolute(number))
}

/// Returns the signal that holds each setting until the next one; of several settings at the same time, the last one
/// stated applies.
fn source_of_settings(
    mut points: Vec<(f64, f64)>,
    texts: Vec<String>,
) -> Result<DriveSource, Reason> {
    points.reverse();
    points.sort_by(|one, other| one.0.total_cmp(&other.0));
    points.dedup_by(|later, first| later.0 <= first.0);
    let start = points.first().map_or(f64::NEG_INFINITY, |&(time, _)| time);
    Ok(DriveSource { signal: track(points.into_iter(), Interpolation::Hold)?, start, texts })
}

fn held_steps(
    steps: &[(f64, Spanned<Literal>)],
    target: &Target<'_>,
    conversion: Conversion,
    texts: &mut Vec<String>,
) -> Result<Signal, Reason> {
    let mut points = Vec::with_capacity(steps.len());
    for (time, value) in steps {
        points.push((*time, encode(value.get_ref(), target, conversion, texts)?));
    }
    if points.windows(2).any(|pair| (pair[1].0 - pair[0].0) == 0.0) {
        return Err(Reason::Members { what: "steps", expected: "each time once" });
    }
    track(points.into_iter(), Interpolation::Hold)
}

fn track(
    points: impl Iterator<Item = (f64, f64)>,
    interpolation: Interpolation,
) -> Result<Signal, Reason> {
    let (times, values): (Vec<_>, Vec<_>) = points.unzip();
    Ok(Signal::Track(Track::new(times.into(), values.into(), interpolation)?))
}

fn ramp_signal(ramp: &Ramp) -> Result<Signal, Reason> {
    let (from, until) = (finite("from", ramp.from)?, finite("until", ramp.until)?);
    require("until", until, until > from, "a time after from")?;
    let (begin, end) = (finite("begin", ramp.begin)?, finite("end", ramp.end)?);
    Ok(Signal::Ramp { from, until, begin, end })
}

fn sine_signal(sine: &Sine, start: f64) -> Result<Signal, Reason> {
    Ok(Signal::Sine {
        amplitude: finite("amplitude", sine.amplitude)?,
        frequency: positive("frequency", sine.frequency)?,
        phase: finite("phase", sine.phase)?,
        offset: finite("offset", sine.offset)?,
        from: finite("from", sine.from.unwrap_or(start))?,
    })
}

/// Returns the signal of the column `name` as FMPy interprets it: linear interpolation for continuous inputs of
/// a floating-point type unless `hold` is true, held values otherwise; for a clock, ticks at single points.
/// Returns an error if there is no such column or if a value does not fit the type of the variable.
fn column_signal(
    path: &Path,
    table: &Table,
    name: &str,
    target: &Target<'_>,
    hold: bool,
) -> Result<Signal, Reason> {
    let Some(values) = table.column(name) else {
        let (path, name) = (path.to_owned(), name.to_owned());
        return Err(Reason::Column { path, name, known: first_names(&table.names) });
    };
    let (kind, description) = (&target.variable.kind, target.description);
    let (fits, expected): (&dyn Fn(f64) -> bool, String) = match kind {
        Kind::Boolean(_) | Kind::Clock(_) => {
            (&|value| [0.0, 1.0].contains(&value), "0 or 1".to_owned())
        }
        _ if target.is_real() => (&f64::is_finite, "a finite number".to_owned()),
        _ if kind.as_integer().is_some() => {
            (&|value| fits_integer(value, kind, description), integers(kind, description))
        }
        _ => return Err(unfit("csv", target, "constant or steps")),
    };
    if let Some(row) = values.iter().position(|value| !fits(*value)) {
        let actual = format!("{} in row {} of {}", values[row], row + 1, path.display());
        return Err(Reason::Value { name: target.name.clone(), actual, expected });
    }
    let interpolation = match kind {
        Kind::Clock(_) => Interpolation::Points,
        _ if hold || !target.is_continuous() => Interpolation::Hold,
        _ => Interpolation::Line,
    };
    Ok(Signal::Track(Track::new(table.times.clone(), values.clone(), interpolation)?))
}

/// Returns the signal in the unit of the variable. Without a conversion, signal and table still share the values.
fn scaled(signal: Signal, conversion: Conversion) -> Signal {
    if conversion == Conversion::NONE {
        return signal;
    }
    signal.scaled(conversion.factor, conversion.offset)
}
