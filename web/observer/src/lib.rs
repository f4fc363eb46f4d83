//! Computes the gains of an observer for given eigenvalues, with the function that `aso-ftc design` uses.
#![deny(unsafe_code)]

#[path = "../../src/text.rs"]
mod text;

use control::placement::place_balanced;
use files::sentence;
use nalgebra::{Complex, DMatrix};

// The augmented plant: A_0 and C_0, column by column, and their sizes.
include!(concat!(env!("OUT_DIR"), "/plant.rs"));

/// Replaces the eigenvalues in the text buffer, in 1/s, by lines `controller.variable=value` with the gains; returns 0.
/// An eigenvalue is `-900`, `-900+200i` or, for a pair, `-900±200i`. Returns 1, with an error message in the buffer, if
/// the text is wrong or no observer has these eigenvalues.
#[allow(unsafe_code, reason = "exported name")]
#[unsafe(no_mangle)]
pub extern "C" fn place() -> i32 {
    text::answer(gains(&text::read()).map(Some))
}

/// Returns `L_x` and `L_f` for the eigenvalues, as settings of the controller FMU.
fn gains(eigenvalues: &str) -> Result<String, String> {
    let mut poles = Vec::new();
    for part in eigenvalues.split([' ', ',']).filter(|part| !part.is_empty()) {
        let eigenvalue = parse(part).ok_or_else(|| {
            format!(
                "eigenvalues={eigenvalues}: expected a number such as -900 or -900±200i, found {part:?}"
            )
        })?;
        if eigenvalue[0].re >= 0.0 {
            return Err(format!(
                "eigenvalue {part} 1/s of the observer: expected a real part below 0"
            ));
        }
        poles.extend(eigenvalue);
    }
    let order = STATES + FAULTS;
    let a_0 = DMatrix::from_column_slice(order, order, &DYNAMICS);
    let c_0 = DMatrix::from_column_slice(MEASUREMENTS, order, &OUTPUT);
    let placed = place_balanced(&a_0.transpose(), &c_0.transpose(), &poles);
    // A_0 - L C_0 has the eigenvalues, L = [L_x; -L_f].
    let l = -placed.map_err(|error| sentence(&error))?.gain.transpose();
    let matrices = [("L_x", l.rows(0, STATES).into_owned()), ("L_f", -l.rows(STATES, FAULTS))];
    let mut lines = String::new();
    for (name, matrix) in matrices {
        for (i, row) in matrix.row_iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                lines += &format!("controller.{name}[{},{}]={value:?}\n", i + 1, j + 1);
            }
        }
    }
    Ok(lines)
}

/// Parses one eigenvalue, or a pair for `±`; `None` if the text is neither.
fn parse(part: &str) -> Option<Vec<Complex<f64>>> {
    let Some(complex) = part.strip_suffix(['i', 'j']) else {
        return Some(vec![Complex::new(text::number(part)?, 0.0)]);
    };
    if let Some((real, imaginary)) = complex.split_once('±') {
        let pole = Complex::new(text::number(real)?, text::number(imaginary)?);
        return Some(vec![pole, pole.conj()]);
    }
    // Splits before the last sign that does not belong to an exponent.
    let bytes = complex.as_bytes();
    let is_sign =
        |k: &usize| matches!(bytes[*k], b'+' | b'-') && !matches!(bytes[k - 1], b'e' | b'E');
    let (real, imaginary) = complex.split_at((1..bytes.len()).rfind(is_sign)?);
    Some(vec![Complex::new(text::number(real)?, text::number(imaginary)?)])
}
