//! Reads the table `[detection]` and the list `[[disturbances]]` of a plant file.

use files::{Entry, Place, Table};
use nalgebra::{DMatrix, DVector};

use crate::Model;
use crate::faults::Fault;
use crate::read::{Result, each, is_first, optional, positive, positives, refuse, within};
use crate::signals::{Signal, name, position};

/// The requirements on the detection of faults.
#[derive(Clone, Debug)]
pub struct DetectionRequest {
    /// Place of the requirements in the file.
    pub place: Place,
    /// The test of the residuals.
    pub method: Method,
    /// Mean time between false alarms, s.
    pub false_alarm_interval: f64,
    /// Whether each test should, as far as possible, react to a single fault only.
    pub isolation: bool,
    /// Noise of each measurement: the root of its spectral density, or its standard deviation in a
    /// sampled design.
    pub noise: Vec<f64>,
    /// Process noise of the states, stated as `noise` is; `None` if the file states none.
    pub process_noise: Option<ProcessNoise>,
    /// The size of each fault that should be detected.
    pub sizes: Vec<f64>,
    /// Time between two tests of a continuous controller, s; `None` if not stated, and in a sampled design.
    pub sample_time: Option<f64>,
    /// The model errors that must give no alarm, if the file states `model_error`.
    pub model_error: Option<ModelError>,
    /// Time in s within which the least detectable fault is detected, if stated.
    pub delay: Option<f64>,
    /// Time in s from the start of a run to the first test, if stated.
    pub from: Option<f64>,
}

/// The statistic of the tests.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Cumulative sums.
    Cusum,
    /// Chi-square of the mean over a window.
    ChiSquare {
        /// Length of the window, s, if stated.
        window: Option<f64>,
    },
}

/// The model errors that must give no alarm: deviations within the tolerances of `[robustness]`.
#[derive(Clone, Debug)]
pub struct ModelError {
    /// Safety factor, at least 1, on the largest residual that model errors cause.
    pub margin: f64,
    /// For each command, the largest deviation from the operating point, if stated.
    pub commands: Vec<Option<f64>>,
    /// Place of `model_error` in the file.
    pub place: Place,
}

/// The process noise of the states.
#[derive(Clone, Debug)]
pub struct ProcessNoise {
    /// One number for all states, or one number for each state.
    pub values: Vec<f64>,
    /// Whether the file states a list, which has one number for each state.
    pub is_list: bool,
    /// Place of `process_noise` in the file.
    pub place: Place,
}

/// An unknown input that is no fault.
#[derive(Clone, Debug)]
pub struct Disturbance {
    /// Name of the disturbance.
    pub name: String,
    /// The point where the disturbance enters the plant.
    pub entry_point: DisturbanceEntry,
    /// Largest absolute value of the disturbance, if stated.
    pub bound: Option<f64>,
    /// Place of the disturbance in the file.
    pub place: Place,
}

/// The point where a disturbance enters the plant.
#[derive(Clone, Debug)]
pub enum DisturbanceEntry {
    /// The column E of x' = A x + E d.
    Column(DVector<f64>),
    /// Position, from 0, of the actuator to whose command the disturbance is added.
    Actuator(usize),
    /// Position, from 0, of the measurement to which the disturbance is added.
    Sensor(usize),
    /// An input of the plant's FMU.
    Input(String),
}

const KEYS: [&str; 13] = [
    "method",
    "false_alarm_interval",
    "false_alarms_per_hour",
    "window",
    "isolation",
    "noise",
    "process_noise",
    "sizes",
    "model_error",
    "commands",
    "sample_time",
    "delay",
    "from",
];
const DISTURBANCE: [&str; 6] = ["name", "E", "actuator", "sensor", "input", "bound"];

impl DetectionRequest {
    /// Reads `[detection]`; `None` without it.
    pub(crate) fn read(
        file: &Table<'_>,
        actuators: &[Signal],
        measurements: usize,
        faults: &[Fault],
    ) -> Result<Option<Self>> {
        let Some(entry) = file.get("detection") else { return Ok(None) };
        let table = entry.table()?;
        table.allow(&KEYS)?;
        let sample_time = positive(&table, "sample_time")?;
        if file.get("sample_time").is_some() {
            refuse(&table, &["sample_time"], "a sampled controller tests in each of its samples")?;
        }
        Ok(Some(Self {
            method: method(&table)?,
            false_alarm_interval: false_alarms(&table)?,
            isolation: table.get("isolation").map_or(Ok(false), |entry| entry.flag())?,
            noise: noise(file, &table, measurements)?,
            process_noise: optional(&table, "process_noise", process_noise)?,
            sizes: sizes(&entry, faults)?,
            model_error: model_error(&table, actuators)?,
            sample_time,
            delay: positive(&table, "delay")?,
            from: optional(&table, "from", |entry| within(entry, 0.0.., "expected a time from 0"))?,
            place: entry.place,
        }))
    }
}

fn method(table: &Table<'_>) -> Result<Method> {
    let meaning = "the test: \"cusum\" or \"chi-square\"";
    let entry = table.require("method", meaning)?;
    if !is_first(&entry, ["cusum", "chi-square"])? {
        return Ok(Method::ChiSquare { window: positive(table, "window")? });
    }
    refuse(table, &["window"], "it belongs to the method \"chi-square\"")?;
    Ok(Method::Cusum)
}

/// Returns the mean time between false alarms in s, stated as such or as a number per hour.
fn false_alarms(table: &Table<'_>) -> Result<f64> {
    match (table.get("false_alarm_interval"), table.get("false_alarms_per_hour")) {
        (Some(entry), None) => entry.positive(),
        (None, Some(entry)) => Ok(3600.0 / entry.positive()?),
        (Some(_), Some(entry)) => {
            Err(entry.error("expected it or `false_alarm_interval`, found both"))
        }
        (None, None) => {
            let meaning = "the mean time between false alarms in s; or `false_alarms_per_hour`";
            table.require("false_alarm_interval", meaning)?.positive()
        }
    }
}

/// Reads `noise` of `[detection]`, otherwise of `[robustness]`: one number above 0 for all measurements, or one for
/// each.
fn noise(file: &Table<'_>, table: &Table<'_>, measurements: usize) -> Result<Vec<f64>> {
    let robustness = optional(file, "robustness", Entry::table)?;
    let inherited = robustness.and_then(|table| table.get("noise"));
    let meaning = "the noise of the measurements (or `noise` in [robustness]): in continuous time the root \
                   of the spectral density, in a sampled design the standard deviation";
    let entry = match table.get("noise").or(inherited) {
        Some(entry) => entry,
        None => table.require("noise", meaning)?,
    };
    let rule = "thresholds follow from the noise: expected numbers above 0";
    let level = |entry: &Entry<'_>| within(entry, f64::MIN_POSITIVE.., rule);
    each(&entry, measurements, "numbers, one per measurement", level)
}

/// Reads one number or a list of numbers, none below 0.
fn process_noise(entry: &Entry<'_>) -> Result<ProcessNoise> {
    let is_list = entry.is_list();
    let values = if is_list { entry.numbers()? } else { vec![entry.number()?] };
    match values.iter().find(|number| **number < 0.0) {
        Some(number) => Err(entry.error(format!("expected no less than 0, found {number}"))),
        None if values.is_empty() => Err(entry.error("expected at least one number")),
        None => Ok(ProcessNoise { values, is_list, place: entry.place.clone() }),
    }
}

/// Reads the size of each fault: the entry of the fault in `sizes`, otherwise `step`, otherwise `bound` of the fault.
fn sizes(entry: &Entry<'_>, faults: &[Fault]) -> Result<Vec<f64>> {
    let names: Vec<_> = faults.iter().map(|fault| fault.name.as_str()).collect();
    let stated = positives(&entry.table()?, "sizes", &names)?;
    let size = |(fault, stated): (&Fault, Result<Option<f64>>)| {
        stated?.or(fault.step).or(fault.bound).ok_or_else(|| {
            entry.error(format!(
                "the size of fault `{0}` that shall be detected is missing: expected sizes.{0} here, or \
                 `step` or `bound` of the fault",
                fault.name
            ))
        })
    };
    faults.iter().zip(stated).map(size).collect()
}

/// Reads the margin for errors of the model, and the bounds of the commands; `None` without `model_error`.
fn model_error(table: &Table<'_>, actuators: &[Signal]) -> Result<Option<ModelError>> {
    let Some(entry) = table.get("model_error") else {
        return refuse(table, &["commands"], "it belongs to `model_error`").map(|()| None);
    };
    let margin = within(&entry, 1.0.., "expected a factor from 1")?;
    let names: Vec<_> = actuators.iter().map(|actuator| actuator.name.as_str()).collect();
    let commands = positives(table, "commands", &names)?.into_iter().collect::<Result<_>>()?;
    Ok(Some(ModelError { margin, commands, place: entry.place }))
}

/// Reads the list `[[disturbances]]`; empty if the file has none. Columns E of sampled matrices are converted to the
/// time domain of the plant.
pub(crate) fn disturbances(
    file: &Table<'_>,
    signals: [&[Signal]; 2],
    model: &Model,
) -> Result<Vec<Disturbance>> {
    let Some(entry) = file.get("disturbances") else { return Ok(Vec::new()) };
    if file.get("detection").is_none() {
        return Err(entry.error("the detection decouples them; expected [detection], too"));
    }
    let mut all: Vec<Disturbance> = Vec::new();
    for member in entry.list()? {
        let mut stated = disturbance(file, &member, signals)?;
        if let (DisturbanceEntry::Column(e), Model::Matrices { sampled: Some(sampled), .. }) =
            (&mut stated.entry_point, model)
        {
            let column = DMatrix::from_column_slice(e.len(), 1, e.as_slice());
            e.copy_from(&sampled.input_columns(&column).column(0));
        }
        if all.iter().any(|other| other.name == stated.name) {
            return Err(member.error(format!("the name `{}` is there twice", stated.name)));
        }
        all.push(stated);
    }
    Ok(all)
}

fn disturbance(
    file: &Table<'_>,
    entry: &Entry<'_>,
    [actuators, measurements]: [&[Signal]; 2],
) -> Result<Disturbance> {
    let table = entry.table()?;
    table.allow(&DISTURBANCE)?;
    let keys = ["E", "actuator", "sensor", "input"];
    let stated: Vec<_> = keys.iter().filter_map(|key| Some((*key, table.get(key)?))).collect();
    let [(key, value)] = stated.as_slice() else {
        return Err(entry.error("expected one of E, actuator, sensor, input"));
    };
    let is_fmu = file.get("plant").is_some();
    let entry_point = match *key {
        "E" if is_fmu => {
            return Err(value.error("the plant is an FMU: expected `input`, one of its inputs"));
        }
        "input" if !is_fmu => {
            return Err(value.error("the plant is no FMU: expected `E`, a number for each state"));
        }
        "E" => {
            let states =
                file.get("A").map_or(Ok(0), |entry| entry.list().map(|rows| rows.len()))?;
            let column = value.numbers()?;
            if column.len() != states {
                let message =
                    format!("expected {states} numbers, one per state, found {}", column.len());
                return Err(value.error(message));
            }
            if column.iter().all(|number| *number == 0.0) {
                return Err(value.error("expected a number other than 0"));
            }
            DisturbanceEntry::Column(column.into())
        }
        "actuator" => DisturbanceEntry::Actuator(position(value, actuators, "actuator")?),
        "sensor" => DisturbanceEntry::Sensor(position(value, measurements, "measurement")?),
        _ => DisturbanceEntry::Input(name(value)?),
    };
    Ok(Disturbance {
        name: name(&table.require("name", "the name of the disturbance")?)?,
        entry_point,
        bound: positive(&table, "bound")?,
        place: entry.place.clone(),
    })
}
