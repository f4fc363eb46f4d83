//! Writes a design file.

use std::fmt::Write as _;

use super::Design;
use super::schedule::{Point, Schedule};
use crate::matrix::Matrix;

/// The lists of the file whose entries have keys that are not written, because [`Design::parse`] computes these keys:
/// names of the lists and of the keys.
const POSITIONS: [(&str, &[&str]); 2] =
    [("reconfigurations", &["actuator", "restarted"]), ("combinations", &["mask"])];
/// The matrices that are written first, in this order; other matrices follow.
const FIRST: [&str; 6] = ["A", "B", "C", "F_a", "A_f", "D"];

impl Design {
    /// The text of the file: numbers and lists, the matrices with one row per line, tables, the schedule.
    ///
    /// # Errors
    ///
    /// The error of the serializer for an entry that TOML cannot hold.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        let mut all = toml::Table::try_from(Self { schedule: None, ..self.clone() })?;
        let (mut first, others): (Vec<_>, Vec<_>) =
            self.matrices().partition(|(name, _)| FIRST.contains(name));
        first.sort_by_key(|(name, _)| FIRST.iter().position(|other| other == name));
        for (name, _) in first.iter().chain(&others) {
            all.remove(*name);
        }
        for (list, positions) in POSITIONS {
            for entry in all.get_mut(list).and_then(toml::Value::as_array_mut).into_iter().flatten()
            {
                if let Some(entry) = entry.as_table_mut() {
                    entry.retain(|name, _| !positions.contains(&name));
                }
            }
        }
        remove_empty(&mut all);
        let is_table = |value: &toml::Value| {
            value.as_array().map_or(value.is_table(), |list| list.iter().any(toml::Value::is_table))
        };
        let (tables, scalars): (toml::Table, toml::Table) =
            all.into_iter().partition(|(_, value)| is_table(value));
        let mut text = toml::to_string(&scalars)?;
        for (name, matrix) in first.into_iter().chain(others) {
            text += "\n";
            write_matrix(&mut text, name, matrix);
        }
        text += "\n";
        text += &toml::to_string(&tables)?;
        if let Some(schedule) = &self.schedule {
            write_schedule(&mut text, schedule)?;
        }
        Ok(text)
    }
}

/// Removes the lists and texts without content, which are the defaults.
fn remove_empty(table: &mut toml::Table) {
    table.retain(|_, value| match value {
        toml::Value::String(text) => !text.is_empty(),
        toml::Value::Array(list) => !list.is_empty(),
        _ => true,
    });
    for (_, value) in table.iter_mut() {
        match value {
            toml::Value::Table(inner) => remove_empty(inner),
            toml::Value::Array(list) => {
                list.iter_mut().filter_map(toml::Value::as_table_mut).for_each(remove_empty);
            }
            _ => {}
        }
    }
}

/// Writes the table `[schedule]`: the variable, and matrices and operating point at each of its values.
fn write_schedule(text: &mut String, schedule: &Schedule) -> Result<(), toml::ser::Error> {
    let Schedule { variable, unit, description, points } = schedule;
    *text += "\n[schedule]\n";
    let entries = [("variable", Some(variable)), ("unit", unit.as_ref())];
    let description = ("description", Some(description).filter(|text| !text.is_empty()));
    for (name, value) in entries.into_iter().chain([description]) {
        if let Some(value) = value {
            *text += &toml::to_string(&toml::Table::from_iter([(
                name.to_owned(),
                value.as_str().into(),
            )]))?;
        }
    }
    for point in points {
        let Point { at, x_op, u_op, y_op, r_op, .. } = point;
        // Writing to a String does not fail.
        let _ = write!(text, "\n[[schedule.points]]\nat = {at:?}\n");
        for (name, values) in [("x_op", x_op), ("u_op", u_op), ("y_op", y_op), ("r_op", r_op)] {
            if !values.is_empty() {
                let _ = writeln!(text, "{name} = [{}]", numbers(values));
            }
        }
        for (name, matrix) in point.matrices() {
            write_matrix(text, name, matrix);
        }
    }
    Ok(())
}

/// Writes a matrix, one row per line.
fn write_matrix(text: &mut String, name: &str, matrix: &Matrix) {
    text.extend([name, " = [\n"]);
    for row in matrix.values.chunks(matrix.columns) {
        text.extend(["    [", &numbers(row), "],\n"]);
    }
    *text += "]\n";
}

/// Numbers with all their digits; -0.0 is 0.0.
fn numbers(values: &[f64]) -> String {
    let values: Vec<_> = values.iter().map(|value| format!("{:?}", value + 0.0)).collect();
    values.join(", ")
}
