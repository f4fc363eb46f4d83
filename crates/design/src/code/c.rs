//! The controller in C99: a header and a source file.

mod detection;
mod header;
mod reconfiguration;
mod sample;
mod schedule;

pub(super) use detection::reactions;

use std::path::PathBuf;

use super::arithmetic::Memory;
use super::constants::Constants;
use super::controller::Controller;
use super::fields::Fields;
use super::recursion::Recursion;
use super::rounding::RoundingBound;
use super::summary::Vocabulary;
use super::symbols::Kind;
use super::tables::{has_constant_matrix, starts, tables};
use super::{Precision, Request};

/// The longest line of a table.
const WIDTH: usize = 100;

/// What every function of this file renders from.
struct Source<'a> {
    request: &'a Request<'a>,
    controller: &'a Controller,
    recursion: &'a Recursion,
    fields: &'a Fields,
    /// `double` or `float`, and the start of the names of macros.
    real: &'static str,
    capital: String,
}

/// Returns header and source with their names.
pub(super) fn files(
    request: &Request<'_>,
    (controller, recursion, fields): (&Controller, &Recursion, &Fields),
    bound: Option<&RoundingBound>,
) -> Vec<(PathBuf, String)> {
    let real = match request.precision {
        Precision::Double => "double",
        Precision::Single => "float",
    };
    let capital = request.prefix.to_ascii_uppercase();
    let source = Source { request, controller, recursion, fields, real, capital };
    let name = &request.prefix;
    vec![
        (format!("{name}.h").into(), source.header(bound)),
        (format!("{name}.c").into(), source.implementation()),
    ]
}

impl Source<'_> {
    fn vocabulary(&self) -> Vocabulary {
        let (name, capital) = (&self.request.prefix, &self.capital);
        let flag = |own: &str| format!("{capital}_{own}");
        Vocabulary {
            init: format!("{name}_init"),
            init_at: format!("{name}_init_at"),
            step: format!("{name}_step"),
            held: flag("HELD"),
            at_limit: flag("AT_LIMIT"),
            overflow: flag("OVERFLOW"),
            outside: flag("OUTSIDE"),
            real: self.real,
            compiler: "-std=c99 -ffp-contract=off without -ffast-math (gcc, clang); on 32-bit x86 also \
                       -msse2 -mfpmath=sse.",
        }
    }

    /// A number with the suffix of its type.
    fn literal(&self, value: f64) -> String {
        let suffix = if self.request.precision == Precision::Single { "F" } else { "" };
        let most = if self.request.precision == Precision::Single { "FLT_MAX" } else { "DBL_MAX" };
        if value.is_infinite() {
            return format!("{}{most}", if value < 0.0 { "-" } else { "" });
        }
        format!("{}{suffix}", self.request.precision.literal(value))
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

    fn implementation(&self) -> String {
        let Self { request, controller, recursion, .. } = self;
        let name = &request.prefix;
        let Memory { constants, .. } = Memory::of(controller, recursion, request.precision);
        let mut lines = vec![
            format!(
                "/* Written by {}; {name}.h describes it. */",
                super::text::ascii(request.identity)
            ),
            format!("#include \"{name}.h\""),
            String::new(),
            "#include <float.h>".to_owned(),
            String::new(),
            "#if defined(__FAST_MATH__)".to_owned(),
            "#error \"-ffast-math removes the checks of NaN and changes the results\"".to_owned(),
            "#endif".to_owned(),
            "#if defined(__clang__) || !defined(__GNUC__)".to_owned(),
            "#pragma STDC FP_CONTRACT OFF".to_owned(),
            "#endif".to_owned(),
            String::new(),
            format!("/* Constants: {constants} bytes. */"),
        ];
        for table in tables(controller, recursion) {
            self.table(&mut lines, &table);
        }
        self.detection_tables(&mut lines);
        self.reconfiguration_tables(&mut lines);
        self.helpers(&mut lines);
        self.initialisation(&mut lines);
        self.step(&mut lines);
        finished(&lines)
    }

    fn table(&self, lines: &mut Vec<String>, table: &Constants) {
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
        lines.push("{".to_owned());
        if layers.is_some() {
            for rows in values.chunks(count) {
                lines.push("    {".to_owned());
                self.rows(lines, rows, ("        ", columns.is_some()));
                lines.push("    },".to_owned());
            }
            end_list(lines);
        } else {
            self.rows(lines, values, ("    ", columns.is_some()));
        }
        lines.push("};".to_owned());
    }

    /// The rows of a matrix, or the one of a vector.
    fn rows(&self, lines: &mut Vec<String>, rows: &[Vec<f64>], (indent, is_matrix): (&str, bool)) {
        for row in rows {
            let numbers = row.iter().map(|value| self.literal(*value));
            let inner = if is_matrix { format!("{indent}    ") } else { indent.to_owned() };
            let mut wrapped = wrapped(numbers, &inner);
            if is_matrix {
                end_list(&mut wrapped);
            }
            match (is_matrix, wrapped.as_slice()) {
                (false, _) => lines.extend(wrapped),
                (true, [only]) => lines.push(format!("{indent}{{{}}},", only.trim())),
                (true, _) => {
                    lines.push(format!("{indent}{{"));
                    lines.extend(wrapped);
                    lines.push(format!("{indent}}},"));
                }
            }
        }
        end_list(lines);
    }

    fn helpers(&self, lines: &mut Vec<String>) {
        let real = self.real;
        let most = self.literal(f64::INFINITY);
        let (zero, one) = (self.literal(0.0), self.literal(1.0));
        lines.push(format!(
            "
/* False for NaN, too. */
static bool is_finite({real} value)
{{
    return (value >= -{most}) && (value <= {most});
}}

/* Keeps a value that is a number; returns the flag for one that is none. */
static uint32_t take({real} *kept, {real} value, uint32_t flag)
{{
    uint32_t status = flag;

    if (is_finite(value))
    {{
        *kept = value;
        status = 0U;
    }}
    return status;
}}"
        ));
        if has_constant_matrix(self.controller, self.recursion) {
            lines.push(format!(
                "
/* Adds a row times a vector to a sum, one product after the other. */
static {real} accumulate({real} start, const {real} row[], const {real} vector[], uint32_t count)
{{
    {real} sum = start;
    uint32_t k;

    for (k = 0U; k < count; k++)
    {{
        sum = sum + (row[k] * vector[k]);
    }}
    return sum;
}}

/* A row times a vector. -0.0 + x has the bits of x. */
static {real} product(const {real} row[], const {real} vector[], uint32_t count)
{{
    return accumulate(-{zero}, row, vector, count);
}}"
            ));
        }
        self.schedule_helpers(lines);
        if self.controller.sliding_mode.is_some() {
            lines.push(format!(
                "
/* rho s / (|s| + delta): largest is rho, width is delta. */
static {real} injection({real} s, {real} largest, {real} width)
{{
    const {real} size = (s < {zero}) ? (-s) : s;

    return (largest * s) / (size + width);
}}"
            ));
        }
        self.detection_helpers(lines);
        self.reconfiguration_helpers(lines);
        if !self.controller.losses.is_empty() {
            lines.push(format!(
                "
/* E_hat = -u f_hat / (u^2 + u_e^2), the largest number where it is beyond the range. */
static {real} lost_effectiveness({real} u, {real} f_hat, {real} squared_least_command)
{{
    const {real} scale = {one} / ((u * u) + squared_least_command);
    {real} loss = (-(u * scale)) * f_hat;

    if (loss > {most})
    {{
        loss = {most};
    }}
    else if (loss < -{most})
    {{
        loss = -{most};
    }}
    else
    {{
        /* within the range */
    }}
    return loss;
}}"
            ));
        }
    }

    fn initialisation(&self, lines: &mut Vec<String>) {
        let Self { request, controller, real, .. } = self;
        let name = &request.prefix;
        let (n, q) = (self.count(Kind::State), self.count(Kind::Fault));
        let [x_op, u, y, r] = starts(controller).map(|(name, _)| name);
        let x = match controller.detection {
            Some(_) => format!("\n    {real} x[{n}];"),
            None => String::new(),
        };
        let zeros = vec![self.literal(0.0); controller.faults.len()];
        let zeros = wrapped(zeros.into_iter(), "        ").join("\n");
        let zeros = zeros.trim_end_matches(',');
        lines.push(format!(
            "
void {name}_init({name}_State *state)
{{
    static const {real} no_faults[{q}] =
    {{
{zeros}
    }};

    {name}_init_at(state, {x_op}, no_faults);
}}

void {name}_init_at({name}_State *state, const {real} x_hat_0[{n}],
    const {real} f_hat_0[{q}])
{{
    uint32_t i;{x}
"
        ));
        let filtered = match controller.filter {
            Some(_) => format!("        state->y_f[i] = {y}[i];\n"),
            None => String::new(),
        };
        let before = match controller.d {
            Some(_) => format!("        state->u_before[i] = {};\n", self.literal(0.0)),
            None => String::new(),
        };
        for (kind, body) in [
            (Kind::State, "        state->x_hat[i] = x_hat_0[i];".to_owned()),
            (Kind::Fault, "        state->f_hat[i] = f_hat_0[i];".to_owned()),
            (Kind::Measurement, format!("{filtered}        state->y[i] = {y}[i];")),
            (Kind::Actuator, format!("{before}        state->u[i] = {u}[i];")),
            (Kind::Reference, format!("        state->r[i] = {r}[i];")),
            (Kind::Integral, format!("        state->x_i[i] = {};", self.literal(0.0))),
        ] {
            if kind.count(controller) > 0 {
                self.loop_over(lines, 1, kind, &[&body]);
            }
        }
        if let [input] = controller.schedule_inputs() {
            lines.push(format!("    state->theta = {};", self.literal(input.operating)));
        }
        if controller.has_counter() {
            lines.push("    state->sample = 0U;".to_owned());
        }
        if controller.filter.is_some() {
            lines.push("    state->started = false;".to_owned());
        }
        self.detection_start(lines, x_op);
        self.reconfiguration_start(lines);
        lines.push("}".to_owned());
    }

    /// A loop over the signals of a kind; `body` has its indent.
    fn loop_over(&self, lines: &mut Vec<String>, depth: usize, kind: Kind, body: &[&str]) {
        let indent = "    ".repeat(depth);
        lines.push(format!("{indent}for (i = 0U; i < {}; i++)", self.count(kind)));
        lines.push(format!("{indent}{{"));
        lines.extend(body.iter().map(|line| (*line).to_owned()));
        lines.push(format!("{indent}}}"));
    }
}

/// Removes the comma after the last entry of a list.
fn end_list(lines: &mut [String]) {
    if let Some(last) = lines.last_mut() {
        let trimmed = last.trim_end_matches(',').len();
        last.truncate(trimmed);
    }
}

/// Numbers with commas, as many in a line as fit.
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

fn finished(lines: &[String]) -> String {
    let mut text = lines.join("\n");
    text.push('\n');
    text
}
