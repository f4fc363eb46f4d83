//! The controller as a Rust crate without the standard library: the sources of `aso_controller::sample`, which are the
//! same for each design, and a library with its tables and named signals.

mod fields;
mod step;
mod tables;
mod types;

use std::path::{Path, PathBuf};

use super::controller::Controller;
use super::fields::Fields;
use super::rounding::RoundingBound;
use super::summary::{Vocabulary, summary};
use super::symbols::Kind;
use super::text::{Lines, ascii};
use super::{Precision, Request};

/// The data of the files: the request, the controller, its identifiers, and `f64` or `f32`.
struct Source<'a> {
    request: &'a Request<'a>,
    controller: &'a Controller,
    fields: &'a Fields,
    real: &'static str,
}

/// Returns the manifest, the library and the sources that take the samples, with their paths.
pub(super) fn files(
    request: &Request<'_>,
    controller: &Controller,
    fields: &Fields,
    bound: Option<&RoundingBound>,
) -> Vec<(PathBuf, String)> {
    let real = match request.precision {
        Precision::Double => "f64",
        Precision::Single => "f32",
    };
    let source = Source { request, controller, fields, real };
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
    let generated = [("Cargo.toml".into(), manifest), ("src/lib.rs".into(), source.library(bound))];
    let runtime = aso_controller::SOURCES;
    let runtime = runtime.map(|(path, text)| (Path::new("src").join(path), text.to_owned()));
    generated.into_iter().chain(runtime).collect()
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
            lost: "Status::lost".to_owned(),
            real: self.real,
            compiler: "rustc keeps it.",
        }
    }

    /// A number. Infinity stands for no limit and becomes the largest finite number.
    fn literal(&self, value: f64) -> String {
        match value {
            f64::INFINITY => format!("{}::MAX", self.real),
            f64::NEG_INFINITY => format!("{}::MIN", self.real),
            value => self.request.precision.literal(value),
        }
    }

    fn library(&self, bound: Option<&RoundingBound>) -> String {
        let Self { request, controller, fields, real } = self;
        let mut lines = Lines::default();
        lines.push("//! ```text");
        for line in summary(request, controller, fields, bound, &self.vocabulary()) {
            lines.push(format!("//! {line}").trim_end());
        }
        lines.push(format!(
            "//! ```
#![no_std]
#![forbid(unsafe_code)]
#![allow(non_snake_case)] // Fields have the names of the signals.

pub mod sample;

{}
",
            self.imports()
        ));
        let mut constant = |text: &str, head: &str, value: String| {
            lines.push(format!("/// {text}.\n{head} = {value};"));
        };
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
            let count = kind.count(controller);
            if count > 0 {
                let head = format!("pub const {}: usize", kind.plural());
                constant(&format!("Number of {what}"), &head, count.to_string());
            }
        }
        let estimates = fields.estimates(controller).len();
        constant("Number of estimates", "pub const ESTIMATES: usize", estimates.to_string());
        let sample_time = self.literal(controller.sample_time);
        constant("The sample time in s", &format!("pub const SAMPLE_TIME: {real}"), sample_time);
        if controller.first_compensated > 0 {
            let text = "The first sample at which faults are compensated";
            let first = controller.first_compensated.to_string();
            constant(text, "const FIRST_COMPENSATED: u32", first);
        }
        if let Some(transfer) = controller.transfer {
            let text =
                "The part of what a change of the law left in the commands that goes in a sample";
            constant(text, &format!("const TRANSFER: {real}"), self.literal(transfer));
        }
        if let Some(detection) = &controller.detection {
            let text = "The first sample whose residuals are tested";
            constant(text, "const FIRST_TESTED: u32", detection.first_tested.to_string());
        }
        self.tables(&mut lines);
        self.structures(&mut lines);
        self.start(&mut lines);
        self.step(&mut lines);
        lines.text()
    }
}
