//! The gains of an observer with other eigenvalues than those of the paper, by the function of `aso-ftc design`.
#![deny(unsafe_code)]

#[path = "../../src/text.rs"]
mod text;

use control::placement::{place_balanced, real_poles};
use files::sentence;
use nalgebra::DMatrix;

// The augmented plant: A_0 and C_0, column by column, and their sizes.
include!(concat!(env!("OUT_DIR"), "/plant.rs"));

/// Replaces the eigenvalues in the text buffer, real numbers in 1/s, by the gains: lines
/// `controller.variable=value`. Returns 1, with a sentence in the buffer, if no observer has them.
#[allow(unsafe_code, reason = "exported name")]
#[unsafe(no_mangle)]
pub extern "C" fn place() -> i32 {
    text::answer(gains(&text::read()).map(Some))
}

/// `L_x` and `L_f` for the eigenvalues, as settings of the controller FMU.
fn gains(eigenvalues: &str) -> Result<String, String> {
    let parts = eigenvalues.split([' ', ',']).filter(|part| !part.is_empty());
    let number = |part: &str| {
        text::number(part)
            .ok_or_else(|| format!("eigenvalues={eigenvalues}: expected a number, found {part:?}"))
    };
    let eigenvalues = parts.map(number).collect::<Result<Vec<_>, _>>()?;
    if let Some(slow) = eigenvalues.iter().find(|value| **value >= 0.0) {
        return Err(format!("eigenvalue {slow} 1/s of the observer: expected below 0"));
    }
    let order = STATES + FAULTS;
    let a_0 = DMatrix::from_column_slice(order, order, &DYNAMICS);
    let c_0 = DMatrix::from_column_slice(MEASUREMENTS, order, &OUTPUT);
    let placed = place_balanced(&a_0.transpose(), &c_0.transpose(), &real_poles(&eigenvalues));
    // A_0 - L C_0 has the eigenvalues, L = [L_x; -L_f].
    let l = -placed.map_err(|error| sentence(&error))?.gain.transpose();
    let named = [("L_x", l.rows(0, STATES).into_owned()), ("L_f", -l.rows(STATES, FAULTS))];
    let mut lines = String::new();
    for (name, matrix) in named {
        for (i, row) in matrix.row_iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                lines += &format!("controller.{name}[{},{}]={value:?}\n", i + 1, j + 1);
            }
        }
    }
    Ok(lines)
}
