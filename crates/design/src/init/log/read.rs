//! Reads logs, and decides which columns are commands and measurements.

use std::path::{Path, PathBuf};

use control::identification::Record;
use fmu_description::unit::{BaseUnit, Unit};
use nalgebra::DMatrix;
use results::Table;

use crate::Error;
use crate::init::labelled::named;
use crate::init::log::{LogOptions, rounded};
use plant_file::signals::{Signal, is_one_unit};

/// The largest deviation of a time stamp from the equidistant grid, as a part of the sample time.
const JITTER: f64 = 0.2;

/// A log of commands and measurements at equidistant instants.
pub(super) struct Log {
    /// The sample time in s.
    pub(super) period: f64,
    pub(super) inputs: Vec<Signal>,
    pub(super) outputs: Vec<Signal>,
    pub(super) record: Record,
}

/// Whether the file is a table of signals over time, by its `ending`: Parquet, a MAT file with results of Dymola or
/// OpenModelica, or CSV whose column of the time is called `time` or `t`, also with a unit: `time [ms]`, `time (ms)`.
pub(in crate::init) fn is_log(path: &Path, ending: &str) -> bool {
    let is_named = |table: Table| {
        let name = named(&table.columns()[table.time()].name).name;
        let mut words = words(&name);
        let first = words.next().unwrap_or_default();
        let is_time = ["time", "t"].iter().any(|time| first.eq_ignore_ascii_case(time));
        is_time && words.all(|word| time_unit(word).is_some())
    };
    match ending {
        "parquet" => true,
        "mat" => Table::open(path).is_ok(),
        "csv" => Table::open(path).is_ok_and(is_named),
        _ => false,
    }
}

/// Reads all logs; an error if one has other columns or units, or another sample time, than the first.
pub(super) fn logs(paths: &[PathBuf], options: &LogOptions) -> Result<Vec<Log>, Error> {
    let mut logs: Vec<Log> = Vec::new();
    for path in paths {
        let invalid = |reason: String| Error::Invalid(format!("{}: {reason}", path.display()));
        let table = Table::open(path).map_err(|error| Error::Invalid(files::sentence(&error)))?;
        let log = Log::read(&table, options).map_err(invalid)?;
        if let Some(first) = logs.first() {
            let (expected, names) = (first.names(), log.names());
            if names != expected {
                return Err(invalid(format!(
                    "expected the columns {expected} as in the first log, found {names}; the same columns in the same \
                     order are needed, or --inputs and --outputs"
                )));
            }
            let conflict = first.signals().zip(log.signals()).find_map(|(signal, other)| {
                let (expected, unit) = (signal.unit.as_ref()?, other.unit.as_ref()?);
                // Units that FMI does not know are compared as texts.
                let are_known = [unit, expected].iter().all(|unit| Unit::parse(unit).is_ok());
                let is_same = unit == expected || (are_known && is_one_unit(unit, expected));
                (!is_same).then_some((&signal.name, expected, unit))
            });
            if let Some((name, expected, unit)) = conflict {
                return Err(invalid(format!(
                    "expected {name} in {expected} as in the first log, found {unit}; convert one of them"
                )));
            }
            let (expected, period) = (first.period, log.period);
            if (period / expected - 1.0).abs() > 1e-3 {
                return Err(invalid(format!(
                    "expected samples every {expected} s as in the first log, found every {period} s; resample one of them"
                )));
            }
        }
        logs.push(log);
    }
    Ok(logs)
}

impl Log {
    /// Returns the commands, then the measurements.
    fn signals(&self) -> impl Iterator<Item = &Signal> {
        self.inputs.iter().chain(&self.outputs)
    }

    fn names(&self) -> String {
        self.signals().map(|signal| signal.name.as_str()).collect::<Vec<_>>().join(", ")
    }

    fn read(table: &Table, options: &LogOptions) -> Result<Self, String> {
        let columns = Columns(table);
        let (inputs, outputs) = columns.choose(options)?;
        let positions = [&inputs[..], &outputs[..]].concat();
        let seconds = columns.seconds()?;
        let (mut times, mut values) = (Vec::new(), Vec::new());
        let visited = table.visit(&positions, &mut |time, row| {
            times.push(seconds * time);
            values.extend_from_slice(row);
        });
        visited.map_err(|error| files::sentence(&error))?;
        if let Some(at) = values.iter().position(|value| !value.is_finite()) {
            let (row, column) = (at / positions.len(), at % positions.len());
            let name = &columns.name(positions[column]).name;
            return Err(format!(
                "row {} ({} s), {name}: expected a number, found {}; cut the log there, into several logs",
                row + 1,
                rounded(times[row]),
                values[at]
            ));
        }
        let all = DMatrix::from_vec(positions.len(), times.len(), values);
        Ok(Self {
            period: period(&times)?,
            record: Record {
                inputs: all.rows(0, inputs.len()).into(),
                outputs: all.rows(inputs.len(), outputs.len()).into(),
            },
            inputs: inputs.iter().map(|&at| columns.name(at)).collect(),
            outputs: outputs.iter().map(|&at| columns.name(at)).collect(),
        })
    }
}

/// The columns of a log, including the column of the time.
struct Columns<'a>(&'a Table);

impl Columns<'_> {
    fn name(&self, position: usize) -> Signal {
        let column = &self.0.columns()[position];
        let name = named(&column.name);
        Signal { unit: column.unit.clone().or(name.unit), ..name }
    }

    /// Returns the length in s of the unit of the times, which the last word of the name may state: `time (ms)`,
    /// `time_ms`; 1 without a stated unit; an error for a unit of another quantity.
    fn seconds(&self) -> Result<f64, String> {
        let Signal { name, unit, .. } = self.name(self.0.time());
        let Some(text) = unit else {
            return Ok(words(&name).next_back().and_then(time_unit).unwrap_or(1.0));
        };
        let refusal = || format!("the time is in {text}, expected s, ms, min, h or d");
        seconds(&text).ok_or_else(refusal)
    }

    /// Returns the positions of all columns but the time.
    fn all(&self) -> impl Iterator<Item = usize> {
        (0..self.0.columns().len()).filter(|position| *position != self.0.time())
    }

    /// Returns the positions of commands and of measurements; an error if there are none, or if a column is both.
    fn choose(&self, options: &LogOptions) -> Result<(Vec<usize>, Vec<usize>), String> {
        let inputs = if options.inputs.is_empty() {
            self.numbered("u")
        } else {
            self.positions("--inputs", &options.inputs)?
        };
        let outputs = if !options.outputs.is_empty() {
            self.positions("--outputs", &options.outputs)?
        } else if options.inputs.is_empty() {
            self.numbered("y")
        } else {
            self.all().filter(|position| !inputs.contains(position)).collect()
        };
        if outputs.is_empty() && !options.inputs.is_empty() {
            return Err(format!(
                "--inputs names all columns but the time, {}, so that none is left for the measurements; expected a log \
                 with a measurement",
                self.names()
            ));
        }
        if inputs.is_empty() || outputs.is_empty() {
            return Err(format!(
                "it is a log, and {} says which columns are commands and which measurements; expected --inputs and --outputs, \
                 names of its columns {}",
                if inputs.is_empty() { "no name `u`, `u1`, ..." } else { "no name `y`, `y1`, ..." },
                self.names()
            ));
        }
        if let Some(both) = inputs.iter().find(|position| outputs.contains(position)) {
            let name = self.name(*both).name;
            return Err(format!(
                "{name} is among --inputs and --outputs, expected it in one of them"
            ));
        }
        Ok((inputs, outputs))
    }

    fn names(&self) -> String {
        self.all().map(|position| self.name(position).name).collect::<Vec<_>>().join(", ")
    }

    /// Returns the columns whose name is `letter`, alone or followed by a number.
    fn numbered(&self, letter: &str) -> Vec<usize> {
        let is_numbered = |position: &usize| {
            let name = self.name(*position).name;
            let rest = name.strip_prefix(letter);
            rest.is_some_and(|rest| rest.chars().all(|sign| sign.is_ascii_digit()))
        };
        self.all().filter(is_numbered).collect()
    }

    /// Returns the positions of the columns that `option` names; an error names a column that is missing or stated
    /// twice.
    fn positions(&self, option: &str, names: &[String]) -> Result<Vec<usize>, String> {
        let one = |name: &String| {
            let is_it = |position: &usize| {
                self.name(*position).name == *name || self.0.columns()[*position].name == *name
            };
            let missing =
                || format!("{option}: there is no column {name}; expected one of {}", self.names());
            self.all().find(is_it).ok_or_else(missing)
        };
        let positions = names.iter().map(one).collect::<Result<Vec<_>, _>>()?;
        let repeated = (1..positions.len()).find(|&at| positions[..at].contains(&positions[at]));
        if let Some(at) = repeated {
            let name = &names[at];
            return Err(format!("{option}: the column {name} is stated twice, expected it once"));
        }
        Ok(positions)
    }
}

/// Returns the length in s of a unit or of a word for it, 1 for `-`; None for a unit of another quantity.
fn seconds(unit: &str) -> Option<f64> {
    let length = match unit.to_lowercase().as_str() {
        "sec" | "secs" | "second" | "seconds" | "-" => 1.0,
        "msec" | "msecs" | "millis" | "millisecond" | "milliseconds" => 1e-3,
        "usec" | "usecs" | "micros" | "microsecond" | "microseconds" => 1e-6,
        "nsec" | "nsecs" | "nanos" | "nanosecond" | "nanoseconds" => 1e-9,
        "mins" | "minute" | "minutes" => 60.0,
        "hr" | "hrs" | "hour" | "hours" => 3600.0,
        "day" | "days" => 86_400.0,
        _ => {
            let second = BaseUnit { s: 1, ..BaseUnit::default() };
            Unit::parse(unit).ok()?.base?.conversion(&second)?.0
        }
    };
    Some(length)
}

/// Returns the words of a name, `time` and `ms` of `time (ms)`.
fn words(name: &str) -> impl DoubleEndedIterator<Item = &str> {
    name.split(|sign: char| !sign.is_alphanumeric()).filter(|word| !word.is_empty())
}

/// Returns the length in s of the unit of time that is a word of a name; None for other words, such as Ts, a sample time
/// or 1e12 s.
fn time_unit(word: &str) -> Option<f64> {
    seconds(word).filter(|length| (1e-9..=86_400.0).contains(length))
}

/// Returns the sample time; an error if times do not increase, or not by equal steps.
fn period(times: &[f64]) -> Result<f64, String> {
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    let median = steps.get(steps.len() / 2).copied().unwrap_or_default();
    if median <= 0.0 {
        return Err(format!("expected many rows with increasing times, found {}", times.len()));
    }
    let step = |at: usize| times[at] - times[at - 1];
    let irregular = |at: &usize| (step(*at) - median).abs() > JITTER * median;
    if let Some(at) = (1..times.len()).find(irregular) {
        return Err(format!(
            "row {} ({} s): expected the next sample after {median:.6} s as elsewhere, found it after {:.6} s; resample the log to \
             equidistant times, or cut it there, into several logs",
            at + 1,
            rounded(times[at]),
            step(at)
        ));
    }
    #[expect(clippy::cast_precision_loss, reason = "a number of rows")]
    let mean = (times[times.len() - 1] - times[0]) / (times.len() - 1) as f64;
    Ok(rounded(mean))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_of_a_column_states_the_unit_of_its_times() {
        let unit = |name: &str| words(name).next_back().and_then(time_unit);
        for (name, expected) in [
            ("time (ms)", Some(0.001)),
            ("time_ms", Some(0.001)),
            ("ms", Some(0.001)),
            ("Time (s)", Some(1.0)),
            ("t/h", Some(3600.0)),
            ("time_minutes", Some(60.0)),
            ("Time (Milliseconds)", Some(0.001)),
            ("time", None),
            ("t", None),
            ("Ts", None),
            ("timestamp", None),
            ("", None),
        ] {
            assert_eq!(unit(name), expected, "{name}");
        }
    }

    /// Measuring systems write seconds in several ways, of which FMI knows one.
    #[test]
    fn a_unit_of_time_has_its_length_in_seconds() {
        for (unit, expected) in [
            ("s", Some(1.0)),
            ("Sec", Some(1.0)),
            ("seconds", Some(1.0)),
            ("-", Some(1.0)),
            ("ms", Some(0.001)),
            ("h", Some(3600.0)),
            ("hours", Some(3600.0)),
            ("usec", Some(1e-6)),
            ("K", None),
            ("samples", None),
        ] {
            assert_eq!(seconds(unit), expected, "{unit}");
        }
    }
}
