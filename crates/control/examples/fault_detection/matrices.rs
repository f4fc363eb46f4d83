//! Matrices in a text file: a line "NAME ROWS COLUMNS", then one line for each row. Lines that start with # are
//! comments.

use control::StateSpace;
use nalgebra::DMatrix;

/// The matrix with that name.
pub(crate) fn read(file: &str, name: &str) -> Result<DMatrix<f64>, String> {
    let mut lines = file.lines();
    let missing = || format!("the matrix {name} is missing or incomplete");
    let head = lines.find(|line| line.split(' ').next() == Some(name)).ok_or_else(missing)?;
    let number =
        |text: &str| text.parse::<f64>().map_err(|error| format!("{name}: {text}: {error}"));
    let sizes: Vec<usize> = head.split(' ').skip(1).filter_map(|size| size.parse().ok()).collect();
    let [rows, columns] = sizes[..] else { return Err(missing()) };
    let entries: Result<Vec<f64>, String> =
        lines.take(rows).flat_map(|row| row.split(' ').map(number)).collect();
    let entries = entries?;
    if entries.len() != rows * columns {
        return Err(missing());
    }
    Ok(DMatrix::from_row_slice(rows, columns, &entries))
}

/// The model `A_i`, `B_i`, `C_i`, `D_i`.
pub(crate) fn model(file: &str, index: usize) -> Result<StateSpace, String> {
    let part = |letter: &str| read(file, &format!("{letter}_{index}"));
    let (a, b, c, d) = (part("A")?, part("B")?, part("C")?, part("D")?);
    Ok(StateSpace { a, b, c, d, domain: control::Domain::Continuous })
}
