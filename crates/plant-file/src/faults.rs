//! The faults of a plant file.

use files::{Entry, Place, Table};

use crate::matrix::matrix;
use crate::read::{Result, is_first, positive, positive_within, refuse};
use crate::signals::{
    Signal, description, is_one_unit_of_differences, name, position, positions, unit,
};

/// The assumed dynamics of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultDynamics {
    /// f' = 0.
    Constant,
    /// f'' = 0.
    Ramp,
}

/// The point where a fault enters the plant.
#[derive(Clone, Debug, PartialEq)]
pub enum EntryPoint {
    /// Column of F_a, from 0.
    Column(usize),
    /// An actuator, from 0: the fault is added to the command of this actuator.
    Actuator(usize),
    /// A measurement, from 0: the fault is added to this measurement.
    Sensor(usize),
    /// A loss of effectiveness: an actuator loses a fraction of its command. The fraction is estimated while the
    /// command is well above `least_command`.
    Loss {
        /// The actuator, from 0.
        actuator: usize,
        /// The command, in its unit, at which the estimate is half of the loss.
        least_command: f64,
    },
    /// An input of the plant's FMU.
    Input(String),
}

/// A fault.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// Name of the fault.
    pub name: String,
    /// Unit of the fault in the notation of FMI: stated, otherwise the unit of its actuator or sensor.
    pub unit: Option<String>,
    /// A description of the fault for readers.
    pub description: String,
    /// Assumed dynamics of the fault.
    pub dynamics: FaultDynamics,
    /// The point where the fault enters the plant.
    pub entry_point: EntryPoint,
    /// Largest absolute value of the fault, if stated.
    pub bound: Option<f64>,
    /// Largest absolute rate of the fault, per s, if stated.
    pub rate_bound: Option<f64>,
    /// Largest step change of the fault, if stated.
    pub step: Option<f64>,
    /// The largest fraction of a loss of effectiveness for which the loop must be stable, if stated.
    pub up_to: Option<f64>,
    /// Place of the fault in the file.
    pub place: Place,
}

/// The entries that state faults. An error about all faults is at the first of these entries in the file.
pub const FAULTS: [&str; 3] = ["faults", "F_a", "actuator_faults"];

/// Largest number of faults with `up_to`.
const MOST_LOSSES: usize = 4;
const FAULT: [&str; 13] = [
    "name",
    "unit",
    "description",
    "kind",
    "actuator",
    "sensor",
    "loss_of",
    "least_command",
    "up_to",
    "input",
    "bound",
    "rate_bound",
    "step",
];

/// Reads all faults: the faults of `actuator_faults` ("all" or names), then the faults of `[[faults]]` or, without that
/// list, one fault for each column of `F_a`, named f1, f2 and so on. No fault at all is an error.
///
/// `signals`: actuators and measurements.
pub(crate) fn all_faults(file: &Table<'_>, signals: [&[Signal]; 2]) -> Result<Vec<Fault>> {
    let [actuators, _] = signals;
    let mut all = Vec::new();
    if let Some(entry) = file.get("actuator_faults") {
        let fault = |at: usize| Fault {
            name: format!("f_{}", actuators[at].name),
            unit: actuators[at].unit.clone(),
            description: format!("fault of {}", actuators[at].name),
            entry_point: EntryPoint::Actuator(at),
            ..Fault::constant(&entry.place)
        };
        all.extend(positions(&entry, actuators, "actuator")?.into_iter().map(fault));
    }
    if let Some(entry) = file.get("faults") {
        all.extend(faults(&entry, signals)?);
    } else if let Some(entry) = file.get("F_a") {
        let unnamed = |k: usize| Fault {
            name: format!("f{k}"),
            entry_point: EntryPoint::Column(k - 1),
            ..Fault::constant(&entry.place)
        };
        all.extend((1..=matrix(&entry)?.ncols()).map(unnamed));
    }
    if all.is_empty() {
        let f_a = if file.get("plant").is_none() { "`F_a`, " } else { "" };
        let message =
            format!("no fault is stated: expected {f_a}`actuator_faults = \"all\"` or [[faults]]");
        return Err(file.source.error(&file.place, message));
    }
    Ok(all)
}

/// Reads the faults under `[[faults]]`. Faults without an entry point take the columns of F_a in
/// turn.
fn faults(entry: &Entry<'_>, signals: [&[Signal]; 2]) -> Result<Vec<Fault>> {
    let members = entry.list()?;
    if members.is_empty() {
        return Err(entry.error("expected at least one fault"));
    }
    let mut all: Vec<Fault> = Vec::with_capacity(members.len());
    for member in &members {
        let columns = all.iter().filter(|fault| matches!(fault.entry_point, EntryPoint::Column(_)));
        let fault = fault(member, signals, columns.count())?;
        if all.iter().any(|other| other.name == fault.name) {
            return Err(member.error(format!("the name `{}` is there twice", fault.name)));
        }
        all.push(fault);
        if all.iter().filter(|fault| fault.up_to.is_some()).count() > MOST_LOSSES {
            return Err(member.error(format!(
                "losses are proven for all combinations: expected `up_to` for at most {MOST_LOSSES} faults"
            )));
        }
    }
    Ok(all)
}

/// Reads a fault; without an entry point the fault enters by `column` of F_a, from 0.
fn fault(entry: &Entry<'_>, signals: [&[Signal]; 2], column: usize) -> Result<Fault> {
    let [actuators, measurements] = signals;
    let table = entry.table()?;
    table.allow(&FAULT)?;
    let entry_point = entry_point(&table, signals, column)?;
    let signal = match entry_point {
        EntryPoint::Actuator(at) | EntryPoint::Loss { actuator: at, .. } => Some(&actuators[at]),
        EntryPoint::Sensor(at) => Some(&measurements[at]),
        EntryPoint::Column(_) | EntryPoint::Input(_) => None,
    };
    let stated = unit(&table)?;
    if let (Some(stated), Some(signal), Some(entry)) = (&stated, signal, table.get("unit"))
        && let Some(expected) = &signal.unit
        && !is_one_unit_of_differences(stated, expected)
    {
        let name = &signal.name;
        let message = format!("expected {expected}, the unit of `{name}`, found {stated}");
        return Err(entry.error(message));
    }
    let unit = stated.or_else(|| signal?.unit.clone());
    Ok(Fault {
        name: name(&table.require("name", "the name of the fault")?)?,
        unit,
        description: description(&table)?,
        dynamics: dynamics(&table)?,
        entry_point,
        bound: positive(&table, "bound")?,
        rate_bound: positive(&table, "rate_bound")?,
        step: positive(&table, "step")?,
        up_to: up_to(&table)?,
        place: entry.place.clone(),
    })
}

fn dynamics(table: &Table<'_>) -> Result<FaultDynamics> {
    match table.get("kind") {
        Some(entry) if !is_first(&entry, ["constant", "ramp"])? => Ok(FaultDynamics::Ramp),
        _ => Ok(FaultDynamics::Constant),
    }
}

fn entry_point(
    table: &Table<'_>,
    [actuators, measurements]: [&[Signal]; 2],
    column: usize,
) -> Result<EntryPoint> {
    let keys = ["actuator", "sensor", "loss_of", "input"];
    let stated: Vec<_> = keys.iter().filter_map(|key| table.get(key)).collect();
    if let [_, second, ..] = stated.as_slice() {
        return Err(second.error(format!("a fault has only one of {}", keys.join(", "))));
    }
    if let Some(actuator) = table.get("loss_of") {
        let at = position(&actuator, actuators, "actuator")?;
        let meaning = "the command, in its unit, at which the estimate is half of the loss";
        let least_command = table.require("least_command", meaning)?.positive()?;
        return Ok(EntryPoint::Loss { actuator: at, least_command });
    }
    refuse(table, &["least_command"], "this belongs to a fault with `loss_of`")?;
    if let Some(actuator) = table.get("actuator") {
        return Ok(EntryPoint::Actuator(position(&actuator, actuators, "actuator")?));
    }
    if let Some(sensor) = table.get("sensor") {
        return Ok(EntryPoint::Sensor(position(&sensor, measurements, "measurement")?));
    }
    match table.get("input") {
        Some(input) => Ok(EntryPoint::Input(name(&input)?)),
        None => Ok(EntryPoint::Column(column)),
    }
}

/// Reads `up_to`, the largest fraction of a loss of effectiveness; `None` if not stated.
fn up_to(table: &Table<'_>) -> Result<Option<f64>> {
    let Some(entry) = table.get("up_to") else { return Ok(None) };
    if table.get("loss_of").is_none() {
        return Err(entry.error("this belongs to a fault with `loss_of`"));
    }
    let rule = "expected a fraction above 0 and at most 1, the largest part of its effect that the \
                actuator may lose";
    positive_within(&entry, ..=1.0, rule).map(Some)
}

impl Fault {
    /// Returns a constant fault on the first column of F_a with no other data.
    fn constant(place: &Place) -> Self {
        Self {
            name: String::new(),
            unit: None,
            description: String::new(),
            dynamics: FaultDynamics::Constant,
            entry_point: EntryPoint::Column(0),
            bound: None,
            rate_bound: None,
            step: None,
            up_to: None,
            place: place.clone(),
        }
    }
}
