//! The controller as a Rust crate without the standard library.

mod detection;
mod reconfiguration;
mod sample;
mod schedule;
mod types;

use std::path::PathBuf;

use super::c::wrapped;
use super::constants::Constants;
use super::controller::Controller;
use super::fields::Fields;
use super::recursion::Recursion;
use super::rounding::RoundingBound;
use super::summary::{Vocabulary, summary};
use super::symbols::Kind;
use super::tables::{has_constant_matrix, tables};
use super::text::ascii;
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
            outside: "Status::outside".to_owned(),
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
            (Kind::Point, "points of the schedule"),
            (Kind::ResidualState, "states of the filter of the residuals"),
            (Kind::Residual, "residuals"),
            (Kind::Test, "tests of the residuals"),
            (Kind::Suspect, "faults that the detection knows"),
            (Kind::GainSet, "sets of gains"),
            (Kind::Case, "actuators that may be gone"),
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
        if let Some(own) = &controller.detection {
            lines.push("/// The first sample whose residuals are tested.".to_owned());
            lines.push(format!("const FIRST_TESTED: u32 = {};", own.first_tested));
        }
        for table in tables(controller, recursion) {
            self.table(&mut lines, &table);
        }
        self.detection_tables(&mut lines);
        self.reconfiguration_tables(&mut lines);
        self.structures(&mut lines);
        self.start(&mut lines);
        self.step(&mut lines);
        self.detection_methods(&mut lines);
        self.reconfiguration_methods(&mut lines);
        self.helpers(&mut lines);
        let mut text = lines.join("\n");
        text.push('\n');
        text
    }

    fn table(&self, lines: &mut Vec<String>, table: &Constants) {
        let Constants { name, rows, columns, layers, values, .. } = table;
        let count = rows.count(self.controller);
        let (real, rows) = (self.real, rows.plural());
        let kind = match columns {
            Some(columns) => format!("[[{real}; {}]; {rows}]", columns.plural()),
            None => format!("[{real}; {rows}]"),
        };
        let kind = match layers {
            Some(layers) => format!("[{kind}; {}]", layers.plural()),
            None => kind,
        };
        lines.push(format!("\nstatic {}: {kind} = [", name.to_ascii_uppercase()));
        if layers.is_some() {
            for rows in values.chunks(count) {
                lines.push("    [".to_owned());
                self.rows(lines, rows, ("        ", columns.is_some()));
                lines.push("    ],".to_owned());
            }
        } else {
            self.rows(lines, values, ("    ", columns.is_some()));
        }
        lines.push("];".to_owned());
    }

    /// The rows of a matrix, or the one of a vector.
    fn rows(&self, lines: &mut Vec<String>, rows: &[Vec<f64>], (indent, is_matrix): (&str, bool)) {
        for row in rows {
            let numbers = row.iter().map(|value| self.literal(*value));
            if is_matrix {
                lines.push(format!("{indent}["));
                lines.extend(wrapped(numbers, &format!("{indent}    ")));
                lines.push(format!("{indent}],"));
            } else {
                lines.extend(wrapped(numbers, indent));
            }
        }
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
}}"
        ));
        if has_constant_matrix(self.controller, self.recursion) {
            lines.push(format!(
                "
/// Adds a row times a vector to a sum, one product after the other.
fn accumulate(start: {real}, row: &[{real}], vector: &[{real}]) -> {real} {{
    row.iter().zip(vector).fold(start, |sum, (entry, element)| sum + entry * element)
}}

/// A row times a vector. -0.0 + x has the bits of x.
fn product(row: &[{real}], vector: &[{real}]) -> {real} {{
    accumulate(-0.0, row, vector)
}}"
            ));
        }
        self.schedule_helpers(lines);
        if self.controller.sliding_mode.is_some() {
            lines.push(format!(
                "
/// rho s / (|s| + delta).
fn injection(s: {real}, rho: {real}, delta: {real}) -> {real} {{
    let size = if s < 0.0 {{ -s }} else {{ s }};
    rho * s / (size + delta)
}}"
            ));
        }
        self.detection_helpers(lines);
        if !self.controller.losses.is_empty() {
            lines.push(format!(
                "
/// E_hat = -u f_hat / (u^2 + u_e^2), the largest number where it is beyond the range.
fn lost_effectiveness(u: {real}, f_hat: {real}, squared_least_command: {real}) -> {real} {{
    let scale = 1.0 / (u * u + squared_least_command);
    let loss = -(u * scale) * f_hat;
    if loss > {real}::MAX {{
        {real}::MAX
    }} else if loss < {real}::MIN {{
        {real}::MIN
    }} else {{
        loss
    }}
}}"
            ));
        }
    }
}
