//! The sampled controller as source code: C99, or a Rust crate without the standard library.
//!
//! The design file, which the controller FMU reads, becomes a [`Controller`]. Its equations stand in two files that are the
//! same for each design: `aso_controller::sample`, which the Rust crate contains, and from which the count of operations
//! and the bound of rounding errors follow, and `runtime/aso_controller.h`.

mod arithmetic;
mod c;
mod constants;
mod controller;
mod detection;
mod fields;
mod names;
mod numbers;
mod parts;
mod reconfiguration;
mod rounding;
mod rust;
mod schedule;
mod summary;
mod symbols;
mod tables;
mod text;

use std::path::PathBuf;

use controller::Controller;
use fields::Fields;
use rounding::RoundingBound;

use crate::{Design, Error};

/// The programming language of a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Language {
    /// C99: a header and a source file.
    C,
    /// A Rust crate without the standard library.
    Rust,
}

/// The floating-point numbers of a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// 64 bits: the results of the FMU.
    Double,
    /// 32 bits: with a bound of the difference.
    Single,
}

impl Precision {
    /// Bytes of a number.
    fn size(self) -> usize {
        match self {
            Self::Double => 8,
            Self::Single => 4,
        }
    }

    /// The nearest number of this precision.
    fn rounded(self, value: f64) -> f64 {
        match self {
            Self::Double => value,
            #[expect(clippy::cast_possible_truncation, reason = "the nearest number")]
            Self::Single => f64::from(value as f32),
        }
    }

    /// A number as both languages write it, without suffix; the nearest one of this precision.
    fn literal(self, value: f64) -> String {
        match self {
            Self::Double => format!("{value:?}"),
            #[expect(clippy::cast_possible_truncation, reason = "the nearest number")]
            Self::Single => format!("{:?}", value as f32),
        }
    }
}

/// The source code of a controller.
pub struct Code {
    /// The files: their paths, relative to a folder, and their contents.
    pub files: Vec<(PathBuf, String)>,
    /// What makes the code worse than the design.
    pub warnings: Vec<String>,
}

/// What the code is written from, besides the controller.
struct Request<'a> {
    /// The name of files and types.
    prefix: String,
    identity: &'a str,
    verdict: &'static str,
    precision: Precision,
    /// In s, with all commands delayed together.
    delay_margin: Option<f64>,
}

impl Design {
    /// Writes the controller of a sampled design as source code.
    ///
    /// In double precision its results have the bits of the controller FMU of this design.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] for a continuous design; for an entry of the design that has no code; for a
    /// number beyond the range of the precision.
    pub fn code(&self, language: Language, precision: Precision) -> Result<Code, Error> {
        let file = aso_controller::Design::parse(&self.file, "design.toml".to_owned());
        let controller = Controller::of(file.map_err(|error| Error::Invalid(error.to_string()))?)?;
        controller.check_range(precision)?;
        let bound = match precision {
            Precision::Double => None,
            Precision::Single => Some(RoundingBound::of(&controller)),
        };
        let stem = std::path::Path::new(&self.report.plant_file).file_stem().unwrap_or_default();
        let request = Request {
            prefix: names::prefix(&stem.to_string_lossy()),
            identity: &self.identity,
            verdict: self.report.verdict.level.word(),
            precision,
            delay_margin: self.report.robustness.as_ref().map(|found| found.delay_margin),
        };
        let fields = Fields::of(&controller);
        let files = match language {
            Language::C => c::files(&request, &controller, &fields, bound.as_ref()),
            Language::Rust => rust::files(&request, &controller, &fields, bound.as_ref()),
        };
        let warnings = bound.map(|bound| bound.warnings(&controller)).unwrap_or_default();
        Ok(Code { files, warnings })
    }
}
