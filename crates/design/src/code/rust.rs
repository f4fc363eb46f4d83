//! The controller as a Rust crate without the standard library.

use std::path::PathBuf;

use super::c::wrapped;
use super::controller::Controller;
use super::recursion::{Operation, Recursion, Statement, Term, When};
use super::rounding::RoundingBound;
use super::summary::{Fields, Vocabulary, ascii, descriptions, descriptions_of_estimates, summary};
use super::symbols::{Kind, Vector};
use super::tables::{Constants, kept, locals, shown, stored, tables};
use super::{Precision, Request};

/// What every function of this file renders from.
struct Source<'a> {
    request: &'a Request<'a>,
    controller: &'a Controller,
    recursion: &'a Recursion,
    fields: &'a Fields,
    real: &'static str,
}

/// Returns manifest and library with their paths.
pub(super) fn files(
    request: &Request<'_>,
    (controller, recursion, fields): (&Controller, &Recursion, &Fields),
    bound: Option<&RoundingBound>,
) -> Vec<(PathBuf, String)> {
    let real = match request.precision {
        Precision::Double => "f64",
        Precision::Single => "f32",
    };
    let source = Source { request, controller, recursion, fields, real };
    let manifest = format!(
        "# Written by {}; src/lib.rs describes it.
[package]
name = \"{}\"
version = \"0.1.0\"
edition = \"2021\"
rust-version = \"1.70\"
publish = false

[dependencies]
",
        ascii(request.identity),
        request.prefix,
    );
    vec![("Cargo.toml".into(), manifest), ("src/lib.rs".into(), source.library(bound))]
}

impl Source<'_> {
    fn vocabulary(&self) -> Vocabulary {
        Vocabulary {
            init: "Controller::new()".to_owned(),
            init_at: "Controller::starting_at()".to_owned(),
            step: "Controller::step()".to_owned(),
            held: "Status::held".to_owned(),
            at_limit: "Status::at_limit".to_owned(),
            overflow: "Status::overflow".to_owned(),
            real: self.real,
            compiler: "rustc keeps it.",
        }
    }

    /// A number; an infinite one stands for the largest finite one.
    fn literal(&self, value: f64) -> String {
        match value {
            f64::INFINITY => format!("{}::MAX", self.real),
            f64::NEG_INFINITY => format!("{}::MIN", self.real),
            value => self.request.precision.literal(value),
        }
    }

    fn library(&self, bound: Option<&RoundingBound>) -> String {
        let Self { request, controller, recursion, fields, real } = self;
        let mut lines = vec!["//! ```text".to_owned()];
        let parts = (*recursion, *fields);
        for line in summary(request, controller, parts, bound, &self.vocabulary()) {
            lines.push(format!("//! {line}").trim_end().to_owned());
        }
        lines.extend([
            "//! ```".to_owned(),
            "#![no_std]".to_owned(),
            "#![forbid(unsafe_code)]".to_owned(),
            "#![allow(non_snake_case)] // Fields have the names of the signals.".to_owned(),
            String::new(),
        ]);
        for (kind, what) in [
            (Kind::State, "states"),
            (Kind::Fault, "faults"),
            (Kind::Actuator, "actuators"),
            (Kind::Measurement, "measurements"),
            (Kind::Reference, "references"),
        ] {
            if kind.count(controller) == 0 {
                continue;
            }
            lines.push(format!("/// Number of {what}."));
            let count = kind.count(controller);
            lines.push(format!("pub const {}: usize = {count};", kind.plural()));
        }
        lines.push("/// Number of estimates.".to_owned());
        lines.push(format!("pub const ESTIMATES: usize = {};", fields.estimates(controller).len()));
        lines.push("/// The sample time in s.".to_owned());
        let sample_time = self.literal(controller.sample_time);
        lines.push(format!("pub const SAMPLE_TIME: {real} = {sample_time};"));
        if controller.first_compensated > 0 {
            lines.push("/// The first sample at which faults are compensated.".to_owned());
            let first = controller.first_compensated;
            lines.push(format!("const FIRST_COMPENSATED: u32 = {first};"));
        }
        for table in tables(controller, recursion) {
            self.table(&mut lines, &table);
        }
        self.structures(&mut lines);
        self.start(&mut lines);
        self.step(&mut lines);
        self.helpers(&mut lines);
        let mut text = lines.join("\n");
        text.push('\n');
        text
    }

    fn table(&self, lines: &mut Vec<String>, table: &Constants) {
        let Constants { name, rows, columns, values, .. } = table;
        let (real, rows) = (self.real, rows.plural());
        let kind = match columns {
            Some(columns) => format!("[[{real}; {}]; {rows}]", columns.plural()),
            None => format!("[{real}; {rows}]"),
        };
        lines.push(format!("\nstatic {}: {kind} = [", name.to_ascii_uppercase()));
        for row in values {
            let numbers = row.iter().map(|value| self.literal(*value));
            if columns.is_some() {
                lines.push("    [".to_owned());
                lines.extend(wrapped(numbers, "        "));
                lines.push("    ],".to_owned());
            } else {
                lines.extend(wrapped(numbers, "    "));
            }
        }
        lines.push("];".to_owned());
    }

    fn structures(&self, lines: &mut Vec<String>) {
        let Self { controller, recursion: _, fields, real, .. } = self;
        let estimates = fields.estimates(controller);
        let described = [
            descriptions(&controller.measurements),
            descriptions(&controller.references),
            descriptions(&controller.actuators),
            descriptions_of_estimates(controller),
        ];
        let groups = [
            ("Measurements", "The measurements of a sample.", "MEASUREMENTS", &fields.measurements),
            ("References", "The references of a sample.", "REFERENCES", &fields.references),
            ("Commands", "The commands of a sample.", "ACTUATORS", &fields.actuators),
            ("Estimates", "The estimates of a sample.", "ESTIMATES", &estimates),
        ];
        for ((name, text, count, fields), described) in groups.into_iter().zip(&described) {
            if fields.is_empty() {
                continue;
            }
            lines.push(format!("\n/// {text}"));
            lines.push("#[derive(Clone, Copy, Debug, Default, PartialEq)]".to_owned());
            lines.push(format!("pub struct {name} {{"));
            for (field, text) in fields.iter().zip(described) {
                lines.push(format!("    /// {text}.\n    pub {field}: {real},"));
            }
            lines.push("}".to_owned());
            let values: Vec<_> = (1..=fields.len()).map(|k| format!("v{k}")).collect();
            let pairs =
                fields.iter().zip(&values).map(|(field, value)| format!("{field}: {value}"));
            lines.push(format!("\nimpl From<[{real}; {count}]> for {name} {{"));
            lines.push(format!(
                "    fn from([{}]: [{real}; {count}]) -> Self {{",
                values.join(", ")
            ));
            lines.push(format!("        Self {{ {} }}", pairs.collect::<Vec<_>>().join(", ")));
            lines.push("    }\n}".to_owned());
            let reads: Vec<_> = fields.iter().map(|field| format!("own.{field}")).collect();
            lines.push(format!("\nimpl From<{name}> for [{real}; {count}] {{"));
            lines.push(format!("    fn from(own: {name}) -> Self {{"));
            lines.push(format!("        [{}]", reads.join(", ")));
            lines.push("    }\n}".to_owned());
        }
        lines.push(
            "
/// What was unusual in a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Status {
    /// A measurement or reference was NaN or infinite; its last finite value was used.
    pub held: bool,
    /// A command is at a limit.
    pub at_limit: bool,
    /// A sum was beyond the range of the numbers; commands and estimates keep their values.
    pub overflow: bool,
}

/// The results of a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outputs {
    /// The commands.
    pub commands: Commands,
    /// The estimates.
    pub estimates: Estimates,
    /// What was unusual.
    pub status: Status,
}

/// One instance of the controller.
#[derive(Clone, Debug, PartialEq)]
pub struct Controller {"
                .to_owned(),
        );
        for vector in stored(controller).into_iter().chain([Vector::U]) {
            lines.push(format!("    {}: [{real}; {}],", vector.name(), vector.kind().plural()));
        }
        if controller.first_compensated > 0 {
            lines.push("    sample: u32,".to_owned());
        }
        if controller.filter.is_some() {
            lines.push("    started: bool,".to_owned());
        }
        lines.push("}".to_owned());
    }

    fn start(&self, lines: &mut Vec<String>) {
        let Self { controller, real, .. } = self;
        lines.push(format!(
            "
impl Default for Controller {{
    fn default() -> Self {{
        Self::new()
    }}
}}

impl Controller {{
    /// Starts at the operating point, without faults.
    #[must_use]
    pub fn new() -> Self {{
        Self::starting_at(X_OP, [0.0; FAULTS])
    }}

    /// Starts at these estimates of states and faults.
    #[must_use]
    pub fn starting_at(x_hat: [{real}; STATES], f_hat: [{real}; FAULTS]) -> Self {{
        Self {{
            x_hat,
            f_hat,"
        ));
        if controller.filter.is_some() {
            lines.push("            y_f: Y_OP,\n            started: false,".to_owned());
        }
        if controller.first_compensated > 0 {
            lines.push("            sample: 0,".to_owned());
        }
        if !controller.references.is_empty() {
            lines.push("            r: R_OP,".to_owned());
        }
        if controller.h.is_some() {
            lines.push("            x_i: [0.0; REFERENCES],".to_owned());
        }
        lines.push("            y: Y_OP,\n            u: U_OP,\n        }\n    }".to_owned());
    }

    fn step(&self, lines: &mut Vec<String>) {
        let Self { controller, recursion, real, .. } = self;
        let (parameter, pair, taken) = match controller.references.as_slice() {
            [] => ("", "", ""),
            _ => (
                " references: &References,",
                "\n        let referred: [REAL; REFERENCES] = (*references).into();",
                "\n        status.held |= take(&mut self.r, &referred);",
            ),
        };
        let pair = pair.replace("REAL", real);
        lines.push(format!(
            "
    /// Takes a sample.
    #[must_use]
    pub fn step(&mut self, measurements: &Measurements,{parameter} compensate: bool) -> Outputs {{
        let mut status = Status::default();
        // The last finite inputs.
        let measured: [{real}; MEASUREMENTS] = (*measurements).into();{pair}
        status.held |= take(&mut self.y, &measured);{taken}"
        ));
        let compensating = match controller.first_compensated {
            0 => "compensate",
            _ => "compensate && self.sample >= FIRST_COMPENSATED",
        };
        lines.push(format!("        let compensating = {compensating};"));
        for vector in locals(recursion) {
            let (name, count) = (vector.name(), vector.kind().plural());
            lines.push(format!("        let mut {name} = [0.0; {count}];"));
        }
        if controller.filter.is_some() {
            lines.push(
                "        if !self.started {
            self.y_f = self.y;
            self.started = true;
        }"
                .to_owned(),
            );
        }
        for statement in &recursion.before_limits {
            write_statement(lines, statement);
        }
        lines.push("        let mut finite = all_finite(&command) && all_finite(&x_value) && all_finite(&f_value);".to_owned());
        if controller.is_limited() {
            lines.push(
                "        // The observer uses the limited commands.
        let limits = U_LOW.iter().zip(&U_HIGH).zip(U_MIN.iter().zip(&U_MAX));
        for ((u, command), ((low, high), (min, max))) in u.iter_mut().zip(&mut command).zip(limits) {
            if *u < *low {
                (*u, *command) = (*low, *min);
                status.at_limit = true;
            } else if *u > *high {
                (*u, *command) = (*high, *max);
                status.at_limit = true;
            }
        }"
                .to_owned(),
            );
        }
        for statement in &recursion.after_limits {
            write_statement(lines, statement);
        }
        let kept = kept(controller);
        let checks = kept.iter().map(|(next, _)| format!(" && all_finite(&{})", next.name()));
        lines.push(format!("        finite = finite{};", checks.collect::<String>()));
        lines.push("        if finite {".to_owned());
        lines.extend(
            kept.iter()
                .map(|(next, own)| format!("            {} = {};", owned(*own), next.name())),
        );
        lines.push("            self.u = command;\n        } else {".to_owned());
        for (value, stored) in shown(controller) {
            lines.push(format!("            {} = {};", value.name(), owned(stored)));
        }
        lines.push(
            "            status.at_limit = false;\n            status.overflow = true;\n        }"
                .to_owned(),
        );
        if controller.first_compensated > 0 {
            lines.push(
                "        self.sample = FIRST_COMPENSATED.min(self.sample.saturating_add(1));"
                    .to_owned(),
            );
        }
        self.outputs(lines);
    }

    fn outputs(&self, lines: &mut Vec<String>) {
        let Self { controller, fields, .. } = self;
        let [states, faults] = [("x", fields.states.len()), ("f", fields.faults.len())]
            .map(|(letter, count)| (1..=count).map(|k| format!("{letter}{k}")).collect::<Vec<_>>());
        lines.push("        let commands = Commands::from(self.u);".to_owned());
        lines.push(format!("        let [{}] = x_value;", states.join(", ")));
        lines.push(format!("        let [{}] = f_value;", faults.join(", ")));
        let integrals: Vec<_> = (1..=fields.integrals.len()).map(|k| format!("i{k}")).collect();
        if !integrals.is_empty() {
            lines.push(format!("        let [{}] = x_i_value;", integrals.join(", ")));
        }
        let losses = controller.losses.iter().map(|loss| {
            format!(
                "lost_effectiveness(commands.{}, {}, {})",
                fields.actuators[loss.actuator],
                faults[loss.fault],
                self.literal(loss.least_command * loss.least_command)
            )
        });
        let values = states.iter().chain(&faults).cloned().chain(losses).chain(integrals);
        lines.push("        let estimates = Estimates {".to_owned());
        for (field, value) in fields.estimates(controller).iter().zip(values) {
            lines.push(format!("            {field}: {value},"));
        }
        lines.push(
            "        };\n        Outputs { commands, estimates, status }\n    }\n}".to_owned(),
        );
    }

    fn helpers(&self, lines: &mut Vec<String>) {
        let real = self.real;
        lines.push(format!(
            "
/// Keeps the values that are numbers; returns whether there is another one.
fn take(kept: &mut [{real}], values: &[{real}]) -> bool {{
    let mut held = false;
    for (kept, value) in kept.iter_mut().zip(values) {{
        if value.is_finite() {{
            *kept = *value;
        }} else {{
            held = true;
        }}
    }}
    held
}}

fn all_finite(vector: &[{real}]) -> bool {{
    vector.iter().all(|value| value.is_finite())
}}

/// Adds a row times a vector to a sum, one product after the other.
fn accumulate(start: {real}, row: &[{real}], vector: &[{real}]) -> {real} {{
    row.iter().zip(vector).fold(start, |sum, (entry, element)| sum + entry * element)
}}

/// A row times a vector. -0.0 + x has the bits of x.
fn product(row: &[{real}], vector: &[{real}]) -> {real} {{
    accumulate(-0.0, row, vector)
}}"
        ));
        if !self.controller.losses.is_empty() {
            lines.push(format!(
                "
/// E_hat = -u f_hat / (u^2 + u_e^2).
fn lost_effectiveness(u: {real}, f_hat: {real}, squared_least_command: {real}) -> {real} {{
    let scale = 1.0 / (u * u + squared_least_command);
    -(u * scale) * f_hat
}}"
            ));
        }
    }
}

/// Adds the loop of a statement.
fn write_statement(lines: &mut Vec<String>, statement: &Statement) {
    let Statement { when, equation, target, start, operations } = statement;
    if !equation.is_empty() {
        lines.push(format!("        // {equation}"));
    }
    let mut zipped = Zipped::of(*target);
    let mut sums = vec![zipped.term(*start)];
    for operation in operations {
        let sum = match *operation {
            Operation::Add(term) => format!("sum + {}", zipped.term(term)),
            Operation::Subtract(term) => format!("sum - {}", zipped.term(term)),
            Operation::TimesPeriod => "sum * SAMPLE_TIME".to_owned(),
            Operation::Accumulate(matrix, vector) => {
                let row = zipped.row(&matrix.name().to_ascii_uppercase());
                format!("accumulate(sum, {row}, &{})", owned(vector))
            }
        };
        sums.push(sum);
    }
    let depth = if *when == When::Always { 8 } else { 12 };
    let indent = " ".repeat(depth);
    match when {
        When::Always => {}
        When::Compensating => lines.push("        if compensating {".to_owned()),
        When::NotCompensating => lines.push("        if !compensating {".to_owned()),
    }
    lines.push(format!("{indent}for {} in {} {{", zipped.pattern, zipped.iterator));
    let last = sums.pop().unwrap_or_default();
    lines.extend(sums.iter().map(|sum| format!("{indent}    let sum = {sum};")));
    lines.push(format!("{indent}    *target = {last};"));
    lines.push(format!("{indent}}}"));
    if *when != When::Always {
        lines.push("        }".to_owned());
    }
}

/// The vectors and rows that a loop runs through together.
struct Zipped {
    target: Vector,
    pattern: String,
    iterator: String,
    known: Vec<String>,
}

impl Zipped {
    fn of(target: Vector) -> Self {
        let iterator = format!("{}.iter_mut()", target.name());
        Self { target, pattern: "target".to_owned(), iterator, known: Vec::new() }
    }

    /// The element of a vector, or the row of a matrix, that belongs to the target.
    fn row(&mut self, source: &str) -> String {
        let name = format!("{}_i", source.trim_start_matches("self.").to_ascii_lowercase());
        if !self.known.contains(&name) {
            self.known.push(name.clone());
            self.pattern = format!("({}, {name})", self.pattern);
            self.iterator.extend([".zip(&", source, ")"]);
        }
        name
    }

    fn term(&mut self, term: Term) -> String {
        match term {
            Term::Zero => "0.0".to_owned(),
            Term::Element(vector) if vector == self.target => "*target".to_owned(),
            Term::Element(vector) => format!("*{}", self.row(&owned(vector))),
            Term::Product(matrix, vector) => {
                let row = self.row(&matrix.name().to_ascii_uppercase());
                format!("product({row}, &{})", owned(vector))
            }
            Term::FilterStep => {
                let [w, y, y_f] = ["FILTER", "y", "y_f"].map(|source| self.row(source));
                format!("*{w} * (*{y} - *{y_f})")
            }
        }
    }
}

/// A vector as an expression.
fn owned(vector: Vector) -> String {
    match vector {
        Vector::XOp | Vector::UOp | Vector::YOp | Vector::ROp => vector.name().to_ascii_uppercase(),
        _ if vector.is_stored() => format!("self.{}", vector.name()),
        _ => vector.name().to_owned(),
    }
}
