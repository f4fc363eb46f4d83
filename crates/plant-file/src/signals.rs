//! The signals of a plant file: states, actuators, measurements and faults.

use fmu_description::unit::Unit;
use fmu_description::xml::is_character;

use files::{Entry, Place, PlaceError, Table};

/// A state, an actuator or a measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    /// Its name.
    pub name: String,
    /// Its unit, as FMI writes it.
    pub unit: Option<String>,
    /// What it is, for a reader.
    pub description: String,
    /// The value at the operating point, if stated.
    pub operating: Option<f64>,
    /// The limits of an actuator, the range of a measurement: smallest and largest value.
    pub limits: Option<[f64; 2]>,
    /// The longest time in s for which the last value of a measurement may replace it.
    pub longest_hold: Option<f64>,
    /// The time in s after which a command acts or a measurement arrives.
    pub delay: f64,
    /// The places of name, limits or range, and longest time of a hold, if the file states them.
    pub places: [Option<Place>; 3],
}

/// What a signal is, which decides what may be stated about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// A state.
    State,
    /// A command.
    Actuator,
    /// A measurement.
    Measurement,
}

impl Signal {
    /// Creates a signal with a name only.
    #[must_use]
    pub fn named(name: String) -> Self {
        let (unit, operating, limits, longest_hold) = (None, None, None, None);
        let (description, places) = (String::new(), [None, None, None]);
        Self { name, unit, description, operating, limits, longest_hold, delay: 0.0, places }
    }

    /// Fills missing fields from `other`.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        Self {
            unit: self.unit.or(other.unit),
            operating: self.operating.or(other.operating),
            ..self
        }
    }
}

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
    /// An actuator, from 0: the fault is added to its command.
    Actuator(usize),
    /// A measurement, from 0: the fault is added to it.
    Sensor(usize),
    /// An actuator, from 0, that loses a fraction of its command. The fraction is estimated while
    /// the command is well above `least_command`.
    Loss {
        /// The actuator, from 0.
        actuator: usize,
        /// The command, in its unit, below which no loss is estimated.
        least_command: f64,
    },
    /// An input of the plant's FMU.
    Input(String),
}

/// A fault.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// Its name.
    pub name: String,
    /// Its unit, as FMI writes it.
    pub unit: Option<String>,
    /// What it is, for a reader.
    pub description: String,
    /// Its assumed dynamics.
    pub dynamics: FaultDynamics,
    /// Where it enters the plant.
    pub entry_point: EntryPoint,
    /// Largest absolute value.
    pub bound: Option<f64>,
    /// Largest absolute rate, per s.
    pub rate_bound: Option<f64>,
    /// Largest step change.
    pub step: Option<f64>,
    /// The largest fraction of a loss of effectiveness for which the loop must be stable.
    pub up_to: Option<f64>,
    /// Where the file states it.
    pub place: Place,
}

/// Number of states of the observer for each delay, unless stated.
const DELAY_ORDER: usize = 3;
/// The largest number of them.
const MOST_DELAY_ORDER: f64 = 8.0;
/// Largest number of actuators with a stated loss.
const MOST_LOSSES: usize = 4;
const SIGNAL: [&str; 4] = ["name", "unit", "description", "operating"];
const ACTUATOR: [&str; 6] = ["name", "unit", "description", "operating", "limits", "delay"];
const MEASUREMENT: [&str; 7] =
    ["name", "unit", "description", "operating", "range", "longest_hold", "delay"];
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

/// Reads the signals under `key`: texts (names) or tables.
///
/// # Errors
///
/// Returns a [`PlaceError`] at the entry that is wrong or missing.
pub fn signals(entry: &Entry<'_>, role: Role) -> Result<Vec<Signal>, PlaceError> {
    let members = entry.list()?;
    if members.is_empty() {
        return Err(entry.error("expected at least one"));
    }
    let mut all: Vec<Signal> = Vec::with_capacity(members.len());
    for member in &members {
        let signal = signal(member, role)?;
        if all.iter().any(|other| other.name == signal.name) {
            return Err(member.error(format!("the name `{}` is there twice", signal.name)));
        }
        all.push(signal);
    }
    Ok(all)
}

fn signal(entry: &Entry<'_>, role: Role) -> Result<Signal, PlaceError> {
    if entry.is_text() {
        let places = [Some(entry.place.clone()), None, None];
        return Ok(Signal { places, ..Signal::named(name(entry)?) });
    }
    let table = entry.table()?;
    table.allow(match role {
        Role::State => &SIGNAL[..],
        Role::Actuator => &ACTUATOR,
        Role::Measurement => &MEASUREMENT,
    })?;
    let limited = table.get(if role == Role::Measurement { "range" } else { "limits" });
    let longest_hold = table.get("longest_hold");
    let named = table.require("name", "the name of the signal")?;
    Ok(Signal {
        name: name(&named)?,
        unit: unit(&table)?,
        description: description(&table)?,
        operating: table.get("operating").map(|entry| entry.number()).transpose()?,
        limits: limited.as_ref().map(limits).transpose()?,
        longest_hold: longest_hold.as_ref().map(Entry::positive).transpose()?,
        delay: table.get("delay").map_or(Ok(0.0), |entry| delay(&entry))?,
        places: [
            Some(named.place),
            limited.map(|entry| entry.place),
            longest_hold.map(|entry| entry.place),
        ],
    })
}

/// Reads a name of one line.
///
/// # Errors
///
/// Returns a [`PlaceError`] at the entry that is wrong or missing.
pub fn name(entry: &Entry<'_>) -> Result<String, PlaceError> {
    match entry.text()? {
        "" => Err(entry.error("expected a name, found an empty text")),
        name => match name.chars().find(|sign| sign.is_control() || !is_character(*sign)) {
            None => Ok(name.to_owned()),
            Some(sign) => Err(entry.error(format!(
                "expected a name of one line without control characters, found {sign:?} in it"
            ))),
        },
    }
}

/// Reads the entry `description`, in which XML allows all characters.
///
/// # Errors
///
/// Returns a [`PlaceError`] at the entry that is wrong or missing.
pub fn description(table: &Table<'_>) -> Result<String, PlaceError> {
    let Some(entry) = table.get("description") else {
        return Ok(String::new());
    };
    let text = entry.text()?;
    match text.chars().find(|sign| !is_character(*sign)) {
        None => Ok(text.to_owned()),
        Some(sign) => {
            let message = format!("found {sign:?}, which the XML of an FMU cannot hold");
            Err(entry.error(message))
        }
    }
}

/// Reads the entry `unit`, which has to be a unit of FMI.
///
/// # Errors
///
/// Returns a [`PlaceError`] at the entry that is wrong or missing.
pub fn unit(table: &Table<'_>) -> Result<Option<String>, PlaceError> {
    let Some(entry) = table.get("unit") else {
        return Ok(None);
    };
    let text = entry.text()?;
    match Unit::parse(text) {
        Ok(_) => Ok(Some(text.to_owned())),
        Err(error) => Err(entry.error(error)),
    }
}

fn delay(entry: &Entry<'_>) -> Result<f64, PlaceError> {
    match entry.number()? {
        seconds if seconds >= 0.0 => Ok(seconds),
        seconds => Err(entry.error(format!("expected a time in s, 0 or more, found {seconds}"))),
    }
}

/// Reads `delay_order`, the number of states by which the observer approximates each delay.
pub(crate) fn delay_order(file: &Table<'_>, signals: [&[Signal]; 2]) -> Result<usize, PlaceError> {
    let Some(entry) = file.get("delay_order") else { return Ok(DELAY_ORDER) };
    if signals.into_iter().flatten().all(|signal| signal.delay <= 0.0) {
        return Err(entry.error("no actuator and no measurement has a `delay`"));
    }
    match entry.number()? {
        order if order.fract() == 0.0 && (1.0..=MOST_DELAY_ORDER).contains(&order) => {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
            let order = order as usize;
            Ok(order)
        }
        other => {
            let most = MOST_DELAY_ORDER;
            Err(entry.error(format!("expected a whole number from 1 to {most}, found {other}")))
        }
    }
}

fn limits(entry: &Entry<'_>) -> Result<[f64; 2], PlaceError> {
    match entry.numbers()?.as_slice() {
        &[low, high] if low < high => Ok([low, high]),
        &[low, high] => Err(entry.error(format!("expected lower < upper, found {low} and {high}"))),
        other => {
            Err(entry.error(format!("expected 2 numbers, lower and upper, found {}", other.len())))
        }
    }
}

/// Reads the faults under `[[faults]]`. Faults without an entry point take the columns of F_a in
/// turn.
///
/// # Errors
///
/// Returns a [`PlaceError`] at the entry that is wrong or missing.
pub fn faults(
    entry: &Entry<'_>,
    actuators: &[Signal],
    measurements: &[Signal],
) -> Result<Vec<Fault>, PlaceError> {
    let members = entry.list()?;
    if members.is_empty() {
        return Err(entry.error("expected at least one fault"));
    }
    let mut all: Vec<Fault> = Vec::with_capacity(members.len());
    for member in &members {
        let columns = all.iter().filter(|fault| matches!(fault.entry_point, EntryPoint::Column(_)));
        let fault = fault(member, actuators, measurements, columns.count())?;
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

fn fault(
    entry: &Entry<'_>,
    actuators: &[Signal],
    measurements: &[Signal],
    column: usize,
) -> Result<Fault, PlaceError> {
    let table = entry.table()?;
    table.allow(&FAULT)?;
    let number = |key: &str| table.get(key).map(|entry| entry.positive()).transpose();
    let entry_point = entry_point(&table, actuators, measurements, column)?;
    let own_unit = unit(&table)?;
    let unit = own_unit.or_else(|| match entry_point {
        EntryPoint::Actuator(at) | EntryPoint::Loss { actuator: at, .. } => {
            actuators[at].unit.clone()
        }
        EntryPoint::Sensor(at) => measurements[at].unit.clone(),
        EntryPoint::Column(_) | EntryPoint::Input(_) => None,
    });
    Ok(Fault {
        name: name(&table.require("name", "the name of the fault")?)?,
        unit,
        description: description(&table)?,
        dynamics: dynamics(&table)?,
        entry_point,
        bound: number("bound")?,
        rate_bound: number("rate_bound")?,
        step: number("step")?,
        up_to: up_to(&table)?,
        place: entry.place.clone(),
    })
}

fn dynamics(table: &Table<'_>) -> Result<FaultDynamics, PlaceError> {
    let Some(entry) = table.get("kind") else {
        return Ok(FaultDynamics::Constant);
    };
    match entry.text()? {
        "constant" => Ok(FaultDynamics::Constant),
        "ramp" => Ok(FaultDynamics::Ramp),
        other => Err(entry.error(format!("expected \"constant\" or \"ramp\", found {other:?}"))),
    }
}

fn entry_point(
    table: &Table<'_>,
    actuators: &[Signal],
    measurements: &[Signal],
    column: usize,
) -> Result<EntryPoint, PlaceError> {
    let keys = ["actuator", "sensor", "loss_of", "input"];
    let stated: Vec<_> = keys.iter().filter_map(|key| table.get(key)).collect();
    if let [_, second, ..] = stated.as_slice() {
        return Err(second.error(format!("a fault has only one of {}", keys.join(", "))));
    }
    let least_command = table.get("least_command");
    if let Some(actuator) = table.get("loss_of") {
        let at = position(&actuator, actuators, "actuator")?;
        let meaning = "the command, in its unit, below which no loss of effectiveness is estimated";
        let least_command = table.require("least_command", meaning)?.positive()?;
        return Ok(EntryPoint::Loss { actuator: at, least_command });
    }
    if let Some(entry) = least_command {
        return Err(entry.error("this belongs to a fault with `loss_of`"));
    }
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

/// Reads the largest fraction of a loss of effectiveness.
fn up_to(table: &Table<'_>) -> Result<Option<f64>, PlaceError> {
    let Some(entry) = table.get("up_to") else {
        return Ok(None);
    };
    if table.get("loss_of").is_none() {
        return Err(entry.error("this belongs to a fault with `loss_of`"));
    }
    match entry.positive()? {
        fraction if fraction <= 1.0 => Ok(Some(fraction)),
        other => Err(entry.error(format!(
            "expected a fraction above 0 and at most 1, the largest part of its effect that the \
             actuator may lose, found {other}"
        ))),
    }
}

/// Returns the index of the signal that the entry names.
///
/// # Errors
///
/// Returns a [`PlaceError`] at the entry that is wrong or missing.
pub fn position(entry: &Entry<'_>, signals: &[Signal], what: &str) -> Result<usize, PlaceError> {
    let text = entry.text()?;
    signals.iter().position(|signal| signal.name == text).ok_or_else(|| {
        let names: Vec<_> = signals.iter().map(|signal| signal.name.as_str()).collect();
        entry.error(format!("no {what} is named {text:?}; there are {}", names.join(", ")))
    })
}

/// Returns one additive fault for each actuator at `positions`.
#[must_use]
pub fn actuator_faults(actuators: &[Signal], positions: &[usize], place: &Place) -> Vec<Fault> {
    let fault = |&at: &usize| Fault {
        name: format!("f_{}", actuators[at].name),
        unit: actuators[at].unit.clone(),
        description: format!("fault of {}", actuators[at].name),
        entry_point: EntryPoint::Actuator(at),
        ..Fault::constant(place)
    };
    positions.iter().map(fault).collect()
}

impl Fault {
    /// Returns a constant fault on the first column of F_a with no other data.
    #[must_use]
    pub fn constant(place: &Place) -> Self {
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

/// Whether all signals have the same unit, or none.
#[must_use]
pub fn same_unit(signals: &[Signal]) -> bool {
    signals.iter().all(|signal| signal.unit == signals[0].unit)
}
