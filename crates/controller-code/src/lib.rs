//! The sampled controller as source code: C99, or a Rust crate without the standard library.
//!
//! The equations are the same for each design. In C they are in `runtime/aso_controller.h`, in Rust in
//! `aso_controller::sample`, from which the count of operations and the bound of rounding errors follow, too.
#![forbid(unsafe_code)]

mod arithmetic;
mod c;
mod constants;
mod controller;
mod detection;
mod fields;
mod matrices;
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
mod values;

use std::path::PathBuf;

use controller::Controller;
use fields::Fields;
use rounding::RoundingBound;

pub use names::prefix;

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
    /// 64 bits: the results have the bits of the FMU.
    Double,
    /// 32 bits: the code states a bound of the difference to 64 bits, if there is one.
    Single,
}

impl Precision {
    /// The number of bytes of a floating-point number.
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

    /// The nearest number of this precision as text, which is the same in C and Rust, without suffix.
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
    /// Sentences on what single precision may do to the loop, or why the rounding errors have no bound; empty in
    /// double precision.
    pub warnings: Vec<String>,
}

/// The facts about the design that the code states, and the form of the code.
pub struct Request<'a> {
    /// The start of the names of files, types and functions: an identifier that [`prefix`] returns.
    pub prefix: String,
    /// The text that every file of the design contains.
    pub identity: &'a str,
    /// The verdict on the design: one word.
    pub verdict: &'static str,
    /// The common delay of all commands in s that makes the loop unstable; infinite without one, `None` if unknown.
    pub delay_margin: Option<f64>,
    /// The programming language of the code.
    pub language: Language,
    /// The precision of the numbers in the code.
    pub precision: Precision,
}

/// Why a design has no code, in a sentence.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Error(String);

/// Writes the controller of a sampled design as source code.
///
/// In double precision, the code gives the bits of the controller FMU of this design.
///
/// # Errors
///
/// Returns an [`Error`] for a continuous design; for a detection with tests of both methods; for a time beyond 2^32
/// samples; for a number beyond the range of the precision, or values of the scheduling variable that it makes equal.
pub fn write(design: aso_controller::Design, request: &Request<'_>) -> Result<Code, Error> {
    let controller = Controller::of(design)?;
    controller.check_range(request.precision)?;
    let bound = match request.precision {
        Precision::Double => None,
        Precision::Single => Some(RoundingBound::of(&controller)),
    };
    let fields = Fields::of(&controller);
    let files = match request.language {
        Language::C => c::files(request, &controller, &fields, bound.as_ref()),
        Language::Rust => rust::files(request, &controller, &fields, bound.as_ref()),
    };
    let warnings = bound.map(|bound| bound.warnings(&controller)).unwrap_or_default();
    Ok(Code { files, warnings })
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
