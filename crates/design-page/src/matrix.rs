//! A matrix as a table, and as text for TOML, numpy and MATLAB.

use maud::{Markup, html};

use super::number::exact;
use super::table::scrolled;
use design_report::Matrix;
use design_report::number::rounded;

/// Returns the matrices as tables, each followed by its text in three languages; identifiers on the page start with
/// `id`.
pub(super) fn matrices(id: &str, matrices: &[Matrix]) -> Markup {
    html! {
        div.side {
            @for (index, matrix) in matrices.iter().enumerate() {
                (self::matrix(&format!("{id}-{}", index + 1), matrix))
            }
        }
    }
}

/// Returns a matrix whose rows and columns have the same names.
pub(super) fn square(
    id: &str,
    [name, meaning]: [&str; 2],
    names: &[String],
    values: &[Vec<f64>],
) -> Markup {
    let (name, meaning) = (name.to_owned(), meaning.to_owned());
    let (rows, columns, values) = (names.to_vec(), names.to_vec(), values.to_vec());
    matrix(id, &Matrix { name, meaning, rows, columns, values })
}

pub(super) fn matrix(id: &str, matrix: &Matrix) -> Markup {
    let shape = format!("{} × {}", matrix.rows.len(), matrix.columns.len());
    html! {
        div.matrix {
            (scrolled(&matrix.name, &html! {
                table style={ "--columns:" (matrix.columns.len()) } {
                    caption {
                        strong { (matrix.name) }
                        @if !matrix.meaning.is_empty() { ", " (matrix.meaning) }
                        span.shape { " (" (shape) ")" }
                    }
                    thead {
                        tr {
                            td {}
                            @for column in &matrix.columns { th.number scope="col" { (column) } }
                        }
                    }
                    tbody {
                        @for (name, row) in matrix.rows.iter().zip(&matrix.values) {
                            tr {
                                th scope="row" { (name) }
                                @for value in row {
                                    td.number title=(exact(*value)) { (rounded(*value)) }
                                }
                            }
                        }
                    }
                }
            }))
            (literals(id, &matrix.name, &[matrix]))
        }
    }
}

/// Returns the text of matrices in three languages, with buttons to copy it.
pub(super) fn literals(id: &str, name: &str, matrices: &[&Matrix]) -> Markup {
    let text = |write: fn(&Matrix) -> String| -> String {
        matrices.iter().map(|matrix| write(matrix)).collect()
    };
    let forms = [("TOML", text(toml)), ("numpy", text(numpy)), ("MATLAB", text(matlab))];
    html! {
        details.stays {
            summary { (name) " in full precision: TOML, numpy, MATLAB" }
            @for (form, text) in forms {
                @let target = format!("{id}-{}", form.to_lowercase());
                div.literal {
                    p {
                        (form) " "
                        button type="button" hidden data-copy=(target)
                            aria-label={ "Copy " (name) " for " (form) } { "Copy" }
                    }
                    pre id=(target) data-form=(form) tabindex="0" {
                        code { (text) }
                    }
                }
            }
        }
    }
}

/// Writes each row between `open` and `close`, separated by `between`.
fn rows(matrix: &Matrix, [open, close, between]: [&str; 3]) -> String {
    let row = |row: &Vec<f64>| {
        let entries: Vec<String> = row.iter().map(|value| exact(*value)).collect();
        format!("    {open}{}{close}", entries.join(", "))
    };
    matrix.values.iter().map(row).collect::<Vec<_>>().join(between)
}

fn toml(matrix: &Matrix) -> String {
    let plain = |sign: char| sign.is_ascii_alphanumeric() || "_-".contains(sign);
    let name = matrix.name.replace(char::is_control, " ");
    let bare = !name.is_empty() && name.chars().all(plain);
    let key = if bare { name } else { toml::Value::from(name).to_string() };
    format!("{key} = [\n{}\n]\n", rows(matrix, ["[", "]", ",\n"]))
}

fn numpy(matrix: &Matrix) -> String {
    format!("{} = np.array([\n{}\n])\n", variable(&matrix.name), rows(matrix, ["[", "]", ",\n"]))
}

fn matlab(matrix: &Matrix) -> String {
    format!("{} = [\n{}\n];\n", variable(&matrix.name), rows(matrix, ["", "", ";\n"]))
}

/// Returns a variable name that Python and MATLAB accept: `_` in place of other characters, after an `M` if it would
/// not start with a letter.
fn variable(name: &str) -> String {
    let plain = |sign: char| if sign.is_ascii_alphanumeric() { sign } else { '_' };
    let text: String = name.chars().map(plain).collect();
    if text.starts_with(|first: char| first.is_ascii_alphabetic()) {
        text
    } else {
        format!("M{text}")
    }
}
