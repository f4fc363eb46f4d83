//! Reads the plants besides the plant of the file: the members of a family, and the points of a schedule.

use files::{Entry, Place, Table};

use crate::matrix::shaped;
use crate::read::{Result, optional, positive, refuse};
use crate::references::References;
use crate::signals::{Signal, description, name, unit};
use crate::{Model, PlantFile};

/// Matrices of a variant, which replace the matrices of the plant of the file.
const MATRICES: [&str; 4] = ["A", "B", "C", "F_a"];
/// The operating point of a plant that matrices describe.
const OPERATING: [&str; 3] = ["x_op", "u_op", "y_op"];
/// The operating point of an FMU.
const POINT: &str = "operating_point";

/// A plant besides the one of the file.
#[derive(Clone)]
pub struct Variant {
    /// Name of the plant.
    pub name: String,
    /// Place of the plant in the file.
    pub place: Place,
    model: Model,
    /// `u_op` and `y_op`, the operating values of commands and measurements, if stated.
    operating: [Option<Vec<f64>>; 2],
}

/// The schedule of a controller: the variable that selects the gains, and the plant at each grid point.
#[derive(Clone)]
pub struct Schedule {
    /// The scheduling variable, on which the gains depend.
    pub variable: Variable,
    /// Largest rate of the scheduling variable, per s, if stated.
    pub rate_bound: Option<f64>,
    /// The points of the grid, at least two, in ascending order.
    pub points: Vec<SchedulePoint>,
    /// The position, from 0, of the point with the plant of the file.
    pub nominal: usize,
}

/// The variable that selects the gains.
#[derive(Clone)]
pub enum Variable {
    /// The measurement at this position, from 0.
    Measurement(usize),
    /// An input of the controller.
    Input(Signal),
}

/// A plant at a value of the scheduling variable.
#[derive(Clone)]
pub struct SchedulePoint {
    /// The value of the scheduling variable.
    pub at: f64,
    /// The plant at this value.
    pub plant: Variant,
}

impl Schedule {
    /// The signal of the variable.
    #[must_use]
    pub fn variable<'a>(&'a self, measurements: &'a [Signal]) -> &'a Signal {
        match &self.variable {
            Variable::Measurement(at) => &measurements[*at],
            Variable::Input(signal) => signal,
        }
    }
}

impl PlantFile<'_> {
    /// Whether the file has a schedule, or is a point of the schedule of another file.
    #[must_use]
    pub fn is_scheduled(&self) -> bool {
        self.schedule.is_some() || self.is_point
    }

    /// The file with the plant of `variant`, without family and schedule. Operating values of actuators and
    /// measurements that the variant does not state are the values of the file; for an FMU the linearisation gives
    /// these values.
    #[must_use]
    pub fn with(&self, variant: &Variant) -> Self {
        let mut file = self.clone();
        file.is_point = self.schedule.is_some();
        (file.family, file.schedule) = (Vec::new(), None);
        file.model = variant.model.clone();
        let [u_op, y_op] = &variant.operating;
        for (signals, values) in [(&mut file.actuators, u_op), (&mut file.measurements, y_op)] {
            for (at, signal) in signals.iter_mut().enumerate() {
                match (values, &file.model) {
                    (Some(values), _) => signal.operating = Some(values[at]),
                    // The FMU states the values at its operating point.
                    (None, Model::Fmu(_)) => signal.operating = None,
                    (None, Model::Matrices { .. }) => {}
                }
            }
        }
        file
    }
}

/// Reads `[[family]]`, plants with different names; empty without it.
pub(crate) fn family(file: &Table<'_>, model: &Model) -> Result<Vec<Variant>> {
    let Some(entry) = file.get("family") else { return Ok(Vec::new()) };
    let message = "expected `family` (one gain) or `schedule` (gains by a variable)";
    refuse(file, &["schedule"], message)?;
    let mut variants: Vec<Variant> = Vec::new();
    for (at, member) in entry.list()?.iter().enumerate() {
        let table = member.table()?;
        let keys = allowed(model, &["name"], false);
        table.allow(&keys)?;
        let title = match table.get("name") {
            Some(entry) => name(&entry)?,
            None => format!("member {}", at + 1),
        };
        if title == "nominal" || variants.iter().any(|other| other.name == title) {
            let message =
                format!("the name `{title}` is there twice; `nominal` is the plant of the file");
            return Err(member.error(message));
        }
        let variant = variant(&table, title, model)?;
        if !keys[1..].iter().any(|key| table.get(key).is_some()) {
            let expected = keys[1..].join(", ");
            return Err(member.error(format!("the plant of the file again: expected {expected}")));
        }
        variants.push(variant);
    }
    if variants.is_empty() {
        return Err(entry.error("expected at least one plant"));
    }
    Ok(variants)
}

/// Reads `[schedule]`; `None` without it.
pub(crate) fn schedule(
    file: &Table<'_>,
    model: &Model,
    measurements: &[Signal],
) -> Result<Option<Schedule>> {
    let Some(entry) = file.get("schedule") else { return Ok(None) };
    let table = entry.table()?;
    table.allow(&["variable", "unit", "description", "rate_bound", "points"])?;
    let name_entry =
        table.require("variable", "a measurement, or the name of an input of the controller")?;
    let variable_name = name(&name_entry)?;
    let variable = match measurements.iter().position(|signal| signal.name == variable_name) {
        Some(at) => {
            let message = format!("the measurement `{variable_name}` states it");
            refuse(&table, &["unit", "description"], &message)?;
            Variable::Measurement(at)
        }
        None => Variable::Input(Signal {
            unit: unit(&table)?,
            description: description(&table)?,
            places: [Some(name_entry.place.clone()), None, None],
            ..Signal::named(variable_name)
        }),
    };
    let list = table.require("points", "the plants at two or more values of the variable")?;
    let (points, nominal) = points(&list, model)?;
    Ok(Some(Schedule { variable, rate_bound: positive(&table, "rate_bound")?, points, nominal }))
}

/// Reads the points of a schedule; also returns the position of the point with the plant of the file.
fn points(list: &Entry<'_>, model: &Model) -> Result<(Vec<SchedulePoint>, usize)> {
    let mut all: Vec<SchedulePoint> = Vec::new();
    let mut nominal = None;
    for member in &list.list()? {
        let table = member.table()?;
        let keys = allowed(model, &["at"], true);
        table.allow(&keys)?;
        let at = table.require("at", "the value of the scheduling variable")?;
        let value = at.number()?;
        if let Some(last) = all.last().filter(|last| last.at >= value) {
            let message = format!("expected ascending values, found {value} after {}", last.at);
            return Err(at.error(message));
        }
        let is_nominal = !keys[1..].iter().any(|key| table.get(key).is_some());
        if is_nominal && nominal.replace(all.len()).is_some() {
            let expected = keys[1..].join(", ");
            let message = format!("a second point with the plant of the file: expected {expected}");
            return Err(member.error(message));
        }
        let plant = variant(&table, value.to_string(), model)?;
        all.push(SchedulePoint { at: value, plant });
    }
    if all.len() < 2 {
        return Err(list.error(format!("expected at least two points, found {}", all.len())));
    }
    let missing = "expected exactly one point with only `at`: the plant of this file";
    let nominal = nominal.ok_or_else(|| list.error(missing))?;
    Ok((all, nominal))
}

/// `first`, then the entries that a variant of `model` may have. Variants of matrices have an operating point only with
/// `operating`, variants of an FMU always.
fn allowed(model: &Model, first: &[&'static str], operating: bool) -> Vec<&'static str> {
    let mut keys = first.to_vec();
    match model {
        Model::Fmu(_) => keys.push(POINT),
        Model::Matrices { f_a, .. } => {
            keys.extend(&MATRICES[..if f_a.is_some() { 4 } else { 3 }]);
            keys.extend(operating.then_some(OPERATING).iter().flatten());
        }
    }
    keys
}

/// Reads a plant: the plant of the file with the entries of `table`.
fn variant(table: &Table<'_>, name: String, model: &Model) -> Result<Variant> {
    let mut model = model.clone();
    let mut operating = [None, None];
    match &mut model {
        Model::Fmu(fmu) => {
            let stated = optional(table, POINT, Entry::table)?;
            for (name, value) in stated.iter().flat_map(Table::entries) {
                let value = value.number()?;
                fmu.operating_point.retain(|(other, _)| other != name);
                fmu.operating_point.push((name.to_owned(), value));
            }
        }
        Model::Matrices { a, b, c, d: _, f_a, states, sampled: _ } => {
            let matrices = [
                ("A", Some(&mut *a)),
                ("B", Some(&mut *b)),
                ("C", Some(&mut *c)),
                ("F_a", f_a.as_mut()),
            ];
            for (key, matrix) in matrices {
                if let (Some(entry), Some(matrix)) = (table.get(key), matrix) {
                    *matrix = shaped(&entry, matrix.shape().into(), "as that of the file")?;
                }
            }
            let (m, p) = (b.ncols(), c.nrows());
            if let Some(values) = numbers(table, "x_op", states.len())? {
                for (state, value) in states.iter_mut().zip(values) {
                    state.operating = Some(value);
                }
            }
            operating = [numbers(table, "u_op", m)?, numbers(table, "y_op", p)?];
        }
    }
    Ok(Variant { name, place: table.place.clone(), model, operating })
}

/// Reads a list of `count` numbers; `None` if the table does not have it.
fn numbers(table: &Table<'_>, key: &str, count: usize) -> Result<Option<Vec<f64>>> {
    let Some(entry) = table.get(key) else { return Ok(None) };
    let values = entry.numbers()?;
    if values.len() == count {
        return Ok(Some(values));
    }
    Err(entry.error(format!("expected {count} numbers, found {}", values.len())))
}

/// Refuses references without integral action in a file with a family, whose members would not reach the set points.
pub(crate) fn check_action(file: &PlantFile<'_>) -> Result<()> {
    let references = file
        .references
        .as_ref()
        .filter(|references| !references.integral && !file.family.is_empty());
    let Some(References { action_places: [place, _], .. }) = references else { return Ok(()) };
    let message = "without integral action the other members of the family would miss their references, \
                   because one constant gain N_r fits one plant; expected `integral = true`";
    Err(file.error_at(place, message))
}
