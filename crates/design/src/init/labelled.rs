//! Reads a table of the matrices A, B, C and D with the names of its rows and columns.
//!
//! ```text
//!             , position [m] , speed [m/s] , force [N]
//! position    , 0            , 1           , 0
//! speed       , 0            , -0.5        , 0.5
//! y [m]       , 1            , 0           , 0
//! ```
//!
//! A column that has the name of a row is a state, and this row its derivative; other columns are commands, other
//! rows measurements.

use std::fs;
use std::path::Path;

use nalgebra::DMatrix;

use crate::Error;
use crate::init::draft::{Draft, Identification, Model, shown};
use plant_file::signals::Signal;

/// Reads the table in the file at `path`.
pub(super) fn draft(path: &Path) -> Result<Draft, Error> {
    let text = fs::read_to_string(path).map_err(Error::file("read", path))?;
    table(&text, &shown(path))
        .map_err(|reason| Error::Invalid(format!("{}: {reason}", path.display())))
}

fn table(text: &str, file: &str) -> Result<Draft, String> {
    let header = text.lines().next().unwrap_or_default();
    // Outside of quotes.
    let names: String = header.split('"').step_by(2).collect();
    let count = |sign: &char| names.matches(*sign).count();
    let separator = [',', ';', '\t'].into_iter().max_by_key(count).unwrap_or(',');
    let cells = |line: &str| -> Vec<String> {
        // A separator in quotes is part of a name: "q[1,2]".
        let (mut is_quoted, mut is_start) = (false, true);
        let ends = |sign: char| {
            is_quoted ^= sign == '"' && (is_quoted || is_start);
            let is_end = sign == separator && !is_quoted;
            is_start = is_end || is_start && sign == ' ';
            is_end
        };
        line.split(ends).map(|cell| cell.trim().trim_matches('"').trim().to_owned()).collect()
    };
    let columns: Vec<Signal> = cells(header).iter().skip(1).map(|cell| named(cell)).collect();
    if columns.is_empty() {
        let start: String = header.chars().take(60).collect();
        return Err(format!(
            "line 1 is {start:?}, {EXPECTED}; a comment before it is to be removed"
        ));
    }
    let (mut rows, mut others) = (Vec::new(), Vec::new());
    for (at, line) in text.lines().enumerate().skip(1).filter(|(_, line)| !line.trim().is_empty()) {
        let cells = cells(line);
        if cells.len() != columns.len() + 1 {
            let (expected, count) = (columns.len() + 1, cells.len());
            return Err(format!("line {}: expected {expected} cells, found {count}", at + 1));
        }
        let number = |(place, (cell, column)): (usize, (&String, &Signal))| {
            // A table with other separators may have decimal commas.
            let digits = if separator == ',' { cell.clone() } else { cell.replace(',', ".") };
            let value = digits.parse::<f64>().ok().filter(|value| value.is_finite());
            value.ok_or_else(|| {
                let (line, name) = (at + 1, &column.name);
                let name =
                    if name.is_empty() { format!("column {}", place + 2) } else { name.clone() };
                format!("line {line}, {name}: expected a number, found {cell:?}")
            })
        };
        let values = cells[1..].iter().zip(&columns).enumerate().map(number);
        let values = values.collect::<Result<Vec<_>, _>>()?;
        let row = named(&cells[0]);
        let name = derivative(&row.name).to_owned();
        // The first row with the name of a state is its derivative: `der(x)`, also behind a measurement x.
        let list = if name == row.name { &mut others } else { &mut rows };
        list.push((Signal { name, ..row }, values));
    }
    rows.append(&mut others);
    split(&rows, &columns, file)
}

/// The form of the table, for messages.
const EXPECTED: &str = "expected a table of the matrices: the first line names states and commands, the first cell of \
                        each further line the state whose derivative it is, or the measurement";

fn split(rows: &[(Signal, Vec<f64>)], columns: &[Signal], file: &str) -> Result<Draft, String> {
    let row_of = |name: &str| rows.iter().position(|(row, _)| row.name == name);
    let of_states: Vec<_> = columns.iter().filter_map(|column| row_of(&column.name)).collect();
    let of_outputs: Vec<_> = (0..rows.len()).filter(|row| !of_states.contains(row)).collect();
    let (n, m, p) = (of_states.len(), columns.len() - of_states.len(), of_outputs.len());
    if n == 0 || m == 0 || p == 0 {
        return Err(format!(
            "found {n} states, {m} commands and {p} measurements; {EXPECTED}, or a log of signals, a .csv file with a column `time`"
        ));
    }
    let is_state = |at: &usize| row_of(&columns[*at].name).is_some();
    let (states, commands): (Vec<_>, Vec<_>) = (0..columns.len()).partition(is_state);
    let block = |of_rows: &[usize], of_columns: &[usize]| {
        DMatrix::from_fn(of_rows.len(), of_columns.len(), |i, j| rows[of_rows[i]].1[of_columns[j]])
    };
    let d = block(&of_outputs, &commands);
    let has_feedthrough = d.amax() > 0.0;
    let model = Model::Matrices {
        a: block(&of_states, &states),
        b: block(&of_states, &commands),
        c: block(&of_outputs, &states),
        d,
        states: states.iter().map(|&at| columns[at].clone()).collect(),
        sampled: None,
    };
    Ok(Draft {
        origin: format!("the matrices of {file}"),
        model,
        actuators: commands.iter().map(|&at| columns[at].clone()).collect(),
        measurements: of_outputs.iter().map(|&at| rows[at].0.clone()).collect(),
        left_out: Vec::new(),
        has_feedthrough,
        identification: Identification::default(),
    })
}

/// Returns x for `der(x)` and `x'`; other names, also those in apostrophes, are returned unchanged.
fn derivative(name: &str) -> &str {
    let inner = name.strip_prefix("der(").and_then(|rest| rest.strip_suffix(')'));
    let is_quoted = name.starts_with('\'') && !name.ends_with("''");
    inner.or_else(|| name.strip_suffix('\'').filter(|_| !is_quoted)).unwrap_or(name)
}

/// Reads a signal from a cell: `name` or `name [unit]`. Digits in brackets directly behind the name, `q[2]` or
/// `q[1,2]`, are the index of an element.
pub(super) fn named(cell: &str) -> Signal {
    let is_index = |name: &str, text: &str| {
        let all = text.split(',').all(|index| index.parse::<u32>().is_ok());
        all && !name.is_empty() && !name.ends_with(char::is_whitespace)
    };
    let parts = cell.strip_suffix(']').and_then(|rest| rest.rsplit_once('['));
    let parts = parts.filter(|(name, text)| !is_index(name, text));
    let (name, unit) =
        parts.map_or((cell, None), |(name, unit)| (name, Some(unit.trim().to_owned())));
    let unit = unit.filter(|unit| !unit.is_empty());
    Signal { unit, ..Signal::named(name.trim().to_owned()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Only .csv files are read as logs; this one has a column of the time.
    #[test]
    fn a_log_in_a_file_of_tables_is_told_the_ending_of_logs() {
        let refused = table("time\tu\ty\n0\t1\t2\n", "log.tsv").err().unwrap();
        assert!(refused.ends_with("a .csv file with a column `time`"), "{refused}");
    }

    #[test]
    fn errors_of_a_table_say_what_was_found_and_where() {
        for (text, part) in [
            ("# logged today\n,x,u\nx,1,1\n", "line 1 is \"# logged today\", expected a table"),
            (",x,\nx,1,a\n", "line 2, column 3: expected a number, found \"a\""),
        ] {
            let refused = table(text, "plant.csv").err().unwrap();
            assert!(refused.contains(part), "{refused}");
        }
    }

    /// `x_1' = x_2` and `x_2' = -0.5 x_2 + 0.5 u`, the first with the unit of the derivative.
    #[test]
    fn a_derivative_with_a_unit_is_that_of_a_state() {
        let text = ",position [m],speed [m/s],force [N]\nder(position) [m/s],0,1,0\n\
                    speed,0,-0.5,0.5\ny [m],1,0,0\n";
        let Model::Matrices { a, b, c, .. } = table(text, "trolley.csv").unwrap().model else {
            panic!("matrices")
        };
        assert_eq!(a, DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, -0.5]));
        assert_eq!(b, DMatrix::from_row_slice(2, 1, &[0.0, 0.5]));
        assert_eq!(c, DMatrix::from_row_slice(1, 2, &[1.0, 0.0]));
    }

    #[test]
    fn a_measurement_with_the_name_of_a_state_may_precede_the_derivative_of_the_state() {
        let text = ",position,speed,force\nposition,1,0,0\nposition',0,1,0\nspeed',0,-0.5,0.5\n";
        let Model::Matrices { a, c, .. } = table(text, "trolley.csv").unwrap().model else {
            panic!("matrices")
        };
        assert_eq!(a, DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, -0.5]));
        assert_eq!(c, DMatrix::from_row_slice(1, 2, &[1.0, 0.0]));
    }

    #[test]
    fn a_name_in_quotes_may_contain_the_separator() {
        let commas = "\"\",\"q[1,1] [m]\", \"q[1,2]\",u\n\"q[1,1]\",0,1,0\n\
                      \"q[1,2]\",0,-0.5,0.5\npipe 2\" wide,1,0,0\n";
        let semicolons = ";\"q[1,1]\";\"q[1,2]\";\"u[1,1,1]\"\n\"q[1,1]\";0;1;0\n\
                          \"q[1,2]\";0;-0,5;0,5\npipe 2\" wide;1;0;0\n";
        for text in [commas, semicolons] {
            let draft = table(text, "trolley.csv").unwrap();
            let Model::Matrices { a, states, .. } = draft.model else { panic!("matrices") };
            assert_eq!(a, DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, -0.5]));
            assert_eq!([&states[0].name, &states[1].name], ["q[1,1]", "q[1,2]"]);
            assert_eq!(draft.measurements[0].name, "pipe 2\" wide");
        }
    }

    #[test]
    fn a_unit_that_fmi_does_not_know_is_left_out_with_a_warning() {
        let text = ",x [m],u [N]\nx,-1,1\ny [furlong],1,0\n";
        let draft = table(text, "plant.csv").unwrap().without_unknown_units();
        assert_eq!(draft.actuators[0].unit.as_deref(), Some("N"));
        assert_eq!(draft.measurements[0].unit, None);
        let warnings = draft.identification.warnings;
        assert!(
            warnings[0].starts_with("the unit of y is left out: unit \"furlong\""),
            "{warnings:?}"
        );
    }

    #[test]
    fn an_index_is_no_unit_and_an_apostrophe_around_a_name_no_derivative() {
        for (cell, name, unit) in [
            ("q[2]", "q[2]", None),
            ("q[1,2] [m]", "q[1,2]", Some("m")),
            ("part [1]", "part", Some("1")),
            ("speed[m/s]", "speed", Some("m/s")),
        ] {
            let signal = named(cell);
            assert_eq!((signal.name.as_str(), signal.unit.as_deref()), (name, unit), "{cell}");
        }
        let names = ["x'", "'level 1'", "'level 1''", "der('level 1')"].map(derivative);
        assert_eq!(names, ["x", "'level 1'", "'level 1'", "'level 1'"]);
    }
}
