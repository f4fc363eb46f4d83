//! The Jacobian by `fmi2GetDirectionalDerivative`.

use nalgebra::DMatrix;

use super::LineariseError;
use super::parts::{Parts, State};
use super::point::row_name;
use slave::Slave;

/// Returns the Jacobian of state derivatives and outputs with respect to states and inputs.
///
/// A row whose variable is itself a state or an input is a unit vector and needs no call.
pub(super) fn jacobian(
    component: &mut (impl Slave + ?Sized),
    parts: &Parts,
    states: &[State],
) -> Result<DMatrix<f64>, LineariseError> {
    let (rows, knowns) = references(parts, states);
    let unknown_rows: Vec<usize> =
        (0..rows.len()).filter(|&row| !knowns.contains(&rows[row])).collect();
    check_listed(parts, states, &rows, &unknown_rows)?;
    let unknowns: Vec<u32> = unknown_rows.iter().map(|&row| rows[row]).collect();
    let mut jacobian =
        DMatrix::from_fn(rows.len(), knowns.len(), |i, j| f64::from(rows[i] == knowns[j]));
    let mut values = vec![0.0; unknowns.len()];
    for (column, &known) in knowns.iter().enumerate() {
        if !unknowns.is_empty() {
            component.directional_derivative(&unknowns, &[known], &[1.0], &mut values)?;
        }
        for (&row, &value) in unknown_rows.iter().zip(&values) {
            if !value.is_finite() {
                let name = format!("the derivative of {}", row_name(states, parts, row));
                return Err(LineariseError::NotFinite { name, value });
            }
            jacobian[(row, column)] = value;
        }
    }
    Ok(jacobian)
}

/// Returns the value references of the rows, state derivatives and outputs, and of the columns, states and inputs.
pub(super) fn references(parts: &Parts, states: &[State]) -> (Vec<u32>, Vec<u32>) {
    let rates = states.iter().map(|state| state.derivative);
    let rows = rates.chain(parts.outputs.iter().map(|part| part.reference)).collect();
    let columns = states.iter().map(|state| &state.part).chain(&parts.inputs);
    (rows, columns.map(|part| part.reference).collect())
}

/// Checks that `ModelStructure` lists the variables of `unknown_rows`, as directional derivatives require.
fn check_listed(
    parts: &Parts,
    states: &[State],
    rows: &[u32],
    unknown_rows: &[usize],
) -> Result<(), LineariseError> {
    let variables = &parts.description.variables;
    let listed = parts.description.structure.outputs.iter().filter_map(|unknown| {
        Some(variables.get((unknown.index as usize).checked_sub(1)?)?.value_reference)
    });
    let listed: Vec<u32> = listed.collect();
    let is_rate = |reference: &u32| states.iter().any(|state| state.derivative == *reference);
    let is_missing = |row: &&usize| !listed.contains(&rows[**row]) && !is_rate(&rows[**row]);
    let Some(&row) = unknown_rows.iter().find(is_missing) else { return Ok(()) };
    Err(LineariseError::Role {
        name: row_name(states, parts, row),
        actual: "a variable that ModelStructure does not list: it has no directional derivative"
            .to_owned(),
        expected: "an output, a state or the derivative of one",
    })
}
