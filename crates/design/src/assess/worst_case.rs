//! A plant file with the worst plant within the tolerances.

use control::detection::UnknownInput;
use control::faults::FaultEntry;
use nalgebra::DMatrix;
use toml::{Table, Value};

use crate::report::Report;
use crate::report::identity::identity;
use crate::report::robustness::Parameter;
use crate::solve::solution::Solution;
use plant_file::detection::DisturbanceEntry;
use plant_file::signals::Signal;
use plant_file::{Model, PlantFile};

/// Returns the plant file with the matrices of the worst plant within the tolerances; matrices replace an FMU.
///
/// None if the loop is not stable, or if a plant file of matrices cannot state how a fault or a disturbance enters the
/// FMU.
pub(crate) fn plant_file(
    file: &PlantFile<'_>,
    designed: &Solution,
    report: &Report,
) -> Result<Option<String>, crate::Error> {
    let Some(robustness) = &report.robustness else { return Ok(None) };
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
    let within = if !robustness.tolerance.is_examined() {
        "is the plant itself, because nothing varies".to_owned()
    } else if parameters.is_empty() {
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

/// Replaces the entries of sampled time; the worst matrices are of continuous time.
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

/// Replaces the entries that refer to the plant's FMU; false if a fault or a disturbance needs the FMU.
fn without_fmu(table: &mut Table, designed: &Solution) -> bool {
    // Members and points of a schedule are linearised from the FMU.
    for key in ["plant", "operating_point", "preload", "linearisation_step", "family", "schedule"] {
        table.remove(key);
    }
    let linear = &designed.linear;
    let names = linear.plant_states().iter().map(|signal| Value::String(signal.name.clone()));
    table.insert("states".to_owned(), Value::Array(names.collect()));
    state_operating_point(table, "states", linear.plant_states());
    state_operating_point(table, "actuators", &linear.actuators);
    state_operating_point(table, "measurements", &linear.measurements);
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
    match table.get_mut("disturbances") {
        Some(Value::Array(disturbances)) => state_columns(disturbances, &linear.disturbances, n),
        _ => true,
    }
}

/// States the operating point that the FMU gave for each signal under `key`: a name becomes a table.
fn state_operating_point(table: &mut Table, key: &str, signals: &[Signal]) {
    let Some(Value::Array(entries)) = table.get_mut(key) else { return };
    for (entry, signal) in entries.iter_mut().zip(signals) {
        if entry.is_str() {
            let name = ("name".to_owned(), Value::String(signal.name.clone()));
            *entry = Value::Table(Table::from_iter([name]));
        }
        if let (Some(stated), Some(operating)) = (entry.as_table_mut(), signal.operating) {
            stated.insert("operating".to_owned(), Value::Float(operating));
        }
    }
}

/// Replaces `input` of each disturbance by its column E of the `n` states; false if a disturbance acts on a measurement
/// or on the state of a delay.
fn state_columns(disturbances: &mut [Value], inputs: &[UnknownInput], n: usize) -> bool {
    for (disturbance, input) in disturbances.iter_mut().zip(inputs) {
        let Some(stated) = disturbance.as_table_mut() else { continue };
        if stated.remove("input").is_none() {
            continue;
        }
        let mut others = input.on_states.iter().skip(n).chain(input.on_measurements.iter());
        if others.any(|entry| *entry != 0.0) {
            return false;
        }
        stated.insert("E".to_owned(), floats(input.on_states.iter().take(n)));
    }
    true
}

fn floats<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> Value {
    Value::Array(numbers.into_iter().copied().map(Value::Float).collect())
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;

    use super::*;

    const OFFSET: &str = "[[disturbances]]\nsensor = \"y\"\n";

    fn table(text: &str) -> Table {
        text.parse().unwrap()
    }

    #[test]
    fn a_disturbance_by_an_input_of_the_fmu_gets_its_column() {
        let unknown_input = |on_states: &[f64], on_measurement: f64| UnknownInput {
            on_states: DVector::from_column_slice(on_states),
            on_measurements: DVector::from_element(1, on_measurement),
        };
        let columns = |disturbance: UnknownInput| {
            let mut file = table(&format!("{OFFSET}[[disturbances]]\ninput = \"d\""));
            let Some(Value::Array(all)) = file.get_mut("disturbances") else { panic!("a list") };
            // The third state belongs to a delay.
            let is_stated = state_columns(all, &[unknown_input(&[0.0; 3], 1.0), disturbance], 2);
            is_stated.then_some(file)
        };
        let expected = table(&format!("{OFFSET}[[disturbances]]\nE = [0.0, 2.0]"));
        assert_eq!(columns(unknown_input(&[0.0, 2.0, 0.0], 0.0)), Some(expected));
        assert_eq!(columns(unknown_input(&[0.0, 2.0, 0.0], 1.0)), None);
        assert_eq!(columns(unknown_input(&[0.0, 2.0, 3.0], 0.0)), None);
    }

    #[test]
    fn matrices_in_place_of_an_fmu_state_the_operating_point() {
        let mut file = table("actuators = [\"u\", { name = \"v\", limits = [1, 5] }]");
        let signal = |name: &str, value: f64| Signal {
            operating: Some(value),
            ..Signal::named(name.to_owned())
        };
        let signals = [signal("u", 0.5), signal("v", 2.0)];
        state_operating_point(&mut file, "actuators", &signals);
        let u = "{ name = \"u\", operating = 0.5 }";
        let v = "{ name = \"v\", limits = [1, 5], operating = 2.0 }";
        assert_eq!(file, table(&format!("actuators = [{u}, {v}]")));
    }
}
