//! Reads the matrices A, B, C and D of a MAT file, the file format of MATLAB.

use std::fs::File;
use std::path::Path;

use matfile::{Array, MatFile, NumericData};
use nalgebra::DMatrix;

use crate::Error;
use crate::init::draft::{Draft, Identification, Model, shown};
use plant_file::signals::Signal;

/// The variables of a MAT file that describe the plant.
const READ: [&str; 5] = ["A", "B", "C", "D", "Ts"];

/// Reads A, B and C, D if the file has it, and the sample time `Ts` if the matrices are sampled; warns of other numeric
/// variables, such as E of a descriptor system or `dt`.
pub(super) fn draft(path: &Path) -> Result<Draft, Error> {
    let file = File::open(path).map_err(Error::file("read", path))?;
    let invalid = |reason: String| Error::Invalid(format!("{}: {reason}", path.display()));
    let content = MatFile::parse(file).map_err(|_| {
        invalid(
            "expected a MAT file of version 5 or 7 (in MATLAB save -v7, in scipy savemat); version 7.3 is \
             HDF5, version 4 is not read"
                .to_owned(),
        )
    })?;
    let matrix = |name: &str| matrix(&content, name).map_err(&invalid);
    let required = |name: &str| {
        let names: Vec<_> = content.arrays().iter().map(Array::name).collect();
        let listed = if names.is_empty() {
            "none; those in a struct are not read".to_owned()
        } else {
            names.join(", ")
        };
        let missing = || {
            invalid(format!(
                "expected the variables A, B and C, found {listed}; sparse matrices are not read (in MATLAB full(A), \
                 in scipy A.toarray()); a log is a .csv or .parquet file, or results of Dymola or OpenModelica"
            ))
        };
        matrix(name)?.ok_or_else(missing)
    };
    let (a, mut b, mut c) = (required("A")?, required("B")?, required("C")?);
    // scipy writes an array of one dimension as a row.
    if b.shape() == (1, a.nrows()) {
        b = b.transpose();
    }
    if c.shape() == (a.nrows(), 1) {
        c = c.transpose();
    }
    let (n, m, p) = (a.nrows(), b.ncols(), c.nrows());
    // `ss` of MATLAB takes the number 0 for a D of any size.
    let stated = matrix("D")?.filter(|d| d.iter().any(|&entry| entry != 0.0));
    let mut d = stated.unwrap_or_else(|| DMatrix::zeros(p, m));
    if m.min(p) == 1 && d.shape() == (m, p) {
        d = d.transpose();
    }
    for (name, matrix, expected) in
        [("A", &a, (n, n)), ("B", &b, (n, m)), ("C", &c, (p, n)), ("D", &d, (p, m))]
    {
        if matrix.shape() != expected {
            let ((rows, columns), (i, j)) = (expected, matrix.shape());
            return Err(invalid(format!("{name}: expected {rows} x {columns}, found {i} x {j}")));
        }
    }
    let sampled = matrix("Ts")?.and_then(|period| period.iter().copied().find(|&h| h != 0.0));
    if let Some(period) = sampled.filter(|&period| period < 0.0) {
        return Err(invalid(format!("Ts: expected the time of a sample in s, found {period}")));
    }
    let numbered = |letter: &str, count: usize| {
        let one = |k| Signal::named(format!("{letter}{k}"));
        (1..=count).map(one).collect()
    };
    Ok(Draft {
        origin: format!("the matrices of {}", shown(path)),
        actuators: numbered("u", m),
        measurements: numbered("y", p),
        left_out: Vec::new(),
        has_feedthrough: d.amax() > 0.0,
        identification: Identification {
            warnings: not_read(&content).into_iter().collect(),
            ..Identification::default()
        },
        model: Model::Matrices { a, b, c, d, states: numbered("x", n), sampled },
    })
}

/// Returns the warning of numeric variables that are not read; None if there are none.
fn not_read(content: &MatFile) -> Option<String> {
    let names = content.arrays().iter().map(Array::name);
    let others: Vec<_> = names.filter(|name| !name.is_empty() && !READ.contains(name)).collect();
    (!others.is_empty()).then(|| {
        let (read, others) = (READ.join(", "), others.join(", "));
        format!(
            "of the file only {read} are read, not {others}, which the plant must not depend on"
        )
    })
}

/// Returns the matrix called `name`; None if the file has none, an error if the variable is no finite real matrix.
fn matrix(content: &MatFile, name: &str) -> Result<Option<DMatrix<f64>>, String> {
    let Some(array) = content.find_by_name(name) else { return Ok(None) };
    macro_rules! numbers {
        ($($kind:ident),*) => {
            match array.data() {
                NumericData::Double { real, imag } => (real.clone(), imag.is_some()),
                $(NumericData::$kind { real, imag } => {
                    (real.iter().map(|&entry| entry as f64).collect(), imag.is_some())
                })*
            }
        };
    }
    #[expect(clippy::cast_precision_loss, clippy::cast_lossless, reason = "as MATLAB's double()")]
    let (real, imaginary) =
        numbers!(Single, Int8, UInt8, Int16, UInt16, Int32, UInt32, Int64, UInt64);
    let size = array.size();
    let &[rows, columns] = size.as_slice() else {
        return Err(format!("{name}: expected a matrix, found {} dimensions", size.len()));
    };
    if imaginary || real.len() != rows * columns || real.iter().any(|entry| !entry.is_finite()) {
        return Err(format!("{name}: expected finite real numbers"));
    }
    Ok(Some(DMatrix::from_vec(rows, columns, real)))
}
