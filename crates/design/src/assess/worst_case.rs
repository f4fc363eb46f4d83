//! A plant file with the worst plant within the tolerances.

use control::faults::FaultEntry;
use nalgebra::DMatrix;
use toml::{Table, Value};

use crate::report::Report;
use crate::report::identity::identity;
use crate::report::robustness::Parameter;
use crate::solve::solution::Solution;
use plant_file::detection::DisturbanceEntry;
use plant_file::{Model, PlantFile};

/// Returns the plant file with the matrices of the worst plant; a plant that is an FMU becomes one
/// that matrices describe.
pub(crate) fn plant_file(
    file: &PlantFile<'_>,
    designed: &Solution,
    report: &Report,
) -> Result<Option<String>, crate::Error> {
    let Some(robustness) = &report.robustness else {
        return Ok(None);
    };
    let unwritable = |error: &dyn std::fmt::Display| crate::Error::Invalid(error.to_string());
    let mut table: Table = file.text().parse().map_err(|error| unwritable(&error))?;
    for matrix in &robustness.tolerance.worst {
        let rows = matrix.values.iter().map(floats).collect();
        table.insert(matrix.name.clone(), Value::Array(rows));
    }
    if let Model::Matrices { f_a, sampled: Some(sampled), .. } = &file.model
        && sampled.only_samples.is_none()
    {
        without_samples(&mut table, file, f_a.as_ref());
    }
    if file.fmu().is_some() && !without_fmu(&mut table, designed) {
        return Ok(None);
    }
    let text = toml::to_string(&table).map_err(|error| unwritable(&error))?;
    let parameters = &robustness.tolerance.parameters;
    let within = if parameters.is_empty() {
        format!("within {}", robustness.tolerance.range())
    } else {
        let worst = |parameter: &Parameter| format!("{} = {}", parameter.name, parameter.worst);
        format!("with {}", parameters.iter().map(worst).collect::<Vec<_>>().join(", "))
    };
    Ok(Some(format!(
        "# Written by {}: the worst plant found {within}.\n\n{text}",
        identity(report)
    )))
}

/// Replaces what is of sampled time; the worst matrices are of continuous time.
fn without_samples(table: &mut Table, file: &PlantFile<'_>, f_a: Option<&DMatrix<f64>>) {
    table.remove("matrices");
    if let Some(f_a) = f_a {
        let rows = f_a.row_iter().map(|row| floats(row.iter()));
        table.insert("F_a".to_owned(), Value::Array(rows.collect()));
    }
    let Some(Value::Array(disturbances)) = table.get_mut("disturbances") else { return };
    for (disturbance, read) in disturbances.iter_mut().zip(&file.disturbances) {
        if let (Value::Table(disturbance), DisturbanceEntry::Column(e)) =
            (disturbance, &read.entry_point)
        {
            disturbance.insert("E".to_owned(), floats(e));
        }
    }
}

/// Replaces what refers to the plant's FMU; false if a fault cannot be stated without it.
fn without_fmu(table: &mut Table, designed: &Solution) -> bool {
    // Members and points of a schedule are linearised from the FMU.
    for key in ["plant", "operating_point", "preload", "linearisation_step", "family", "schedule"] {
        table.remove(key);
    }
    let linear = &designed.linear;
    let names = linear.plant_states().iter().map(|signal| Value::String(signal.name.clone()));
    table.insert("states".to_owned(), Value::Array(names.collect()));
    if let Some(Value::Table(robustness)) = table.get_mut("robustness") {
        robustness.remove("parameters");
    }
    let n = linear.undelayed.a.nrows();
    let mut columns = Vec::new();
    if let Some(Value::Array(faults)) = table.get_mut("faults") {
        let first = linear.models.len() - faults.len();
        for (fault, model) in faults.iter_mut().zip(&linear.models[first..]) {
            let input = fault.as_table_mut().and_then(|fault| fault.remove("input"));
            match (input, &model.entry) {
                (None, _) => {}
                (Some(_), FaultEntry::Actuator(column))
                    if column.iter().skip(n).all(|entry| *entry == 0.0) =>
                {
                    columns.push(column.clone());
                }
                (Some(_), _) => return false,
            }
        }
    }
    if !columns.is_empty() {
        let rows = (0..n).map(|at| floats(columns.iter().map(|column| &column[at])));
        table.insert("F_a".to_owned(), Value::Array(rows.collect()));
    }
    true
}

fn floats<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> Value {
    Value::Array(numbers.into_iter().copied().map(Value::Float).collect())
}
