//! The controller in C99: a header and a source file with the tables of the design, and `aso_controller.h`, which is
//! the same for each design and takes the samples.

mod header;
mod integers;
mod source;
mod switches;

pub(super) use integers::reactions;

use std::path::PathBuf;

use super::constants::Constants;
use super::controller::Controller;
use super::fields::Fields;
use super::rounding::RoundingBound;
use super::summary::Vocabulary;
use super::symbols::Kind;
use super::text::Lines;
use super::{Precision, Request};

/// The largest number of characters in a line of a table.
const WIDTH: usize = 100;
/// The file of C code that all designs share.
const RUNTIME: &str = "aso_controller.h";
/// The text of [`RUNTIME`], whose functions compute a sample.
const RUNTIME_TEXT: &str = include_str!("../runtime/aso_controller.h");

/// The data of the files: the request, the controller, its identifiers.
struct Source<'a> {
    request: &'a Request<'a>,
    controller: &'a Controller,
    fields: &'a Fields,
    /// The name of the number type: `double` or `float`.
    real: &'static str,
    /// The start of the names of macros: the prefix in capitals.
    capital: String,
}

/// Returns the header, the source file and [`RUNTIME`], with their names.
pub(super) fn files(
    request: &Request<'_>,
    controller: &Controller,
    fields: &Fields,
    bound: Option<&RoundingBound>,
) -> Vec<(PathBuf, String)> {
    let real = match request.precision {
        Precision::Double => "double",
        Precision::Single => "float",
    };
    let capital = request.prefix.to_ascii_uppercase();
    let source = Source { request, controller, fields, real, capital };
    let name = &request.prefix;
    vec![
        (format!("{name}.h").into(), source.header(bound)),
        (format!("{name}.c").into(), source.implementation()),
        (RUNTIME.into(), RUNTIME_TEXT.to_owned()),
    ]
}

impl Source<'_> {
    fn vocabulary(&self) -> Vocabulary {
        let (name, capital) = (&self.request.prefix, &self.capital);
        let flag = |suffix: &str| format!("{capital}_{suffix}");
        Vocabulary {
            init: format!("{name}_init"),
            init_at: format!("{name}_init_at"),
            step: format!("{name}_step"),
            held: flag("HELD"),
            at_limit: flag("AT_LIMIT"),
            overflow: flag("OVERFLOW"),
            outside: flag("OUTSIDE"),
            lost: flag("LOST"),
            real: self.real,
            compiler: "-std=c99 -ffp-contract=off without -ffast-math (gcc, clang); on 32-bit x86 also \
                       -msse2 -mfpmath=sse.",
        }
    }

    /// A number with the suffix of its type. Infinity stands for no limit and becomes the largest finite number.
    fn literal(&self, value: f64) -> String {
        let (suffix, largest) = match self.request.precision {
            Precision::Double => ("", "DBL_MAX"),
            Precision::Single => ("F", "FLT_MAX"),
        };
        match value {
            f64::INFINITY => largest.to_owned(),
            f64::NEG_INFINITY => format!("-{largest}"),
            value => format!("{}{suffix}", self.request.precision.literal(value)),
        }
    }

    fn count(&self, kind: Kind) -> String {
        format!("{}_{}", self.capital, kind.plural())
    }

    /// The head of the function that takes a sample.
    fn signature(&self) -> String {
        let name = &self.request.prefix;
        let pointer = |owner: &str, parameter: &str, fields: &[String]| match fields {
            [] => String::new(),
            _ => format!("const {name}_{owner} *{parameter}, "),
        };
        let references = pointer("References", "references", &self.fields.references);
        let schedule = pointer("Schedule", "schedule", &self.fields.schedule);
        let (actuators, reconfiguration) = match self.controller.reconfiguration {
            None => (String::new(), ""),
            Some(_) => {
                (format!("const {name}_Actuators *actuators, "), ",\n    int32_t *reconfiguration")
            }
        };
        let (reset, detection) = match self.controller.detection {
            None => ("", String::new()),
            Some(_) => (", bool detection_reset", format!(",\n    {name}_Detection *detection")),
        };
        format!(
            "uint32_t {name}_step({name}_State *state, const {name}_Measurements *measurements,\n    \
             {references}{schedule}{actuators}bool compensate{reset},\n    {name}_Commands *commands, {name}_Estimates *estimates{detection}{reconfiguration})"
        )
    }

    /// Adds a table: a vector, a matrix, or a matrix for each point of a schedule or set of gains.
    fn table(&self, lines: &mut Lines, table: &Constants) {
        let Constants { name, meaning, rows, columns, layers, values } = table;
        if !meaning.is_empty() {
            lines.extend([String::new(), format!("/* The {meaning}. */")]);
        }
        let count = rows.count(self.controller);
        let rows = self.count(*rows);
        let points = layers.map_or_else(String::new, |kind| format!("[{}]", self.count(kind)));
        let sizes = match columns {
            Some(columns) => format!("{points}[{rows}][{}]", self.count(*columns)),
            None => format!("[{rows}]"),
        };
        lines.push(format!("static const {} {name}{sizes} =", self.real));
        lines.push("{");
        let mut indent = "    ".to_owned();
        if layers.is_some() {
            indent.push_str("    ");
            for rows in values.chunks(count) {
                lines.push("    {");
                self.rows(lines, rows, &indent);
                lines.push("    },");
            }
            lines.end_list();
        } else if columns.is_some() {
            self.rows(lines, values, &indent);
        } else {
            for row in values {
                lines.extend(self.numbers(row, &indent).0);
            }
        }
        lines.push("};");
    }

    /// Lines of numbers, without a comma after the last one.
    fn numbers(&self, values: &[f64], indent: &str) -> Lines {
        let mut lines = Lines(wrapped(values.iter().map(|value| self.literal(*value)), indent));
        lines.end_list();
        lines
    }

    /// Adds the rows of a matrix, without a comma after the last one.
    fn rows(&self, lines: &mut Lines, rows: &[Vec<f64>], indent: &str) {
        for row in rows {
            match self.numbers(row, &format!("{indent}    ")).0.as_slice() {
                [only] => lines.push(format!("{indent}{{{}}},", only.trim())),
                several => {
                    lines.push(format!("{indent}{{"));
                    lines.extend(several);
                    lines.push(format!("{indent}}},"));
                }
            }
        }
        lines.end_list();
    }
}

/// Lines of numbers, each number with a comma, as many in a line as fit into [`WIDTH`].
pub(super) fn wrapped(numbers: impl Iterator<Item = String>, indent: &str) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for number in numbers {
        match lines.last_mut() {
            Some(line) if line.len() + number.len() + 2 <= WIDTH => {
                line.extend([" ", &number, ","]);
            }
            _ => lines.push(format!("{indent}{number},")),
        }
    }
    lines
}
