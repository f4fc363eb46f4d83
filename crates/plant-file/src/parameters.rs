//! Reads the tolerances of parameters of the plant's FMU.

use std::ops::Range;

use crate::read::{Result, within};
use files::Entry;

/// A parameter of the plant's FMU, and its tolerance.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterTolerance {
    /// The name of the parameter of the FMU.
    pub name: String,
    /// Tolerance of the parameter.
    pub tolerance: Tolerance,
    /// Place of the parameter in the plant file.
    pub place: Range<usize>,
}

/// Largest deviation of a parameter from its value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tolerance {
    /// Fraction of the value.
    Relative(f64),
    /// Lowest and highest value; the linearisation of the FMU checks that the value is between these.
    Limits([f64; 2]),
}

/// Reads a table of one or more parameters: `m = 0.1` (relative) or `m = [0.9, 1.1]` (lowest and highest value).
pub(crate) fn read(entry: &Entry<'_>) -> Result<Vec<ParameterTolerance>> {
    let one = |(name, entry): (&str, Entry<'_>)| {
        let tolerance = if entry.is_list() {
            match entry.list()?.as_slice() {
                [low, high] => Tolerance::Limits([low.number()?, high.number()?]),
                other => {
                    let count = other.len();
                    let message =
                        format!("expected the lowest and the highest value, found {count} numbers");
                    return Err(entry.error(message));
                }
            }
        } else {
            Tolerance::Relative(fraction(&entry)?)
        };
        Ok(ParameterTolerance { name: name.to_owned(), tolerance, place: entry.place.clone() })
    };
    let all: Vec<_> = entry.table()?.entries().map(one).collect::<Result<_, _>>()?;
    if all.is_empty() {
        return Err(entry.error("expected parameters of the FMU and their tolerances, found none"));
    }
    Ok(all)
}

/// Reads a fraction from 0 to below 1.
pub(crate) fn fraction(entry: &Entry<'_>) -> Result<f64> {
    within(entry, 0.0..1.0, "expected a number from 0 to below 1")
}
