//! Literal values of the file.

use std::fmt;

use fmu_description::{Kind, ModelDescription, ScalarVariable};
use serde::Serialize;

use crate::from_toml::from_toml;

/// A number, `true` or `false`, or a text.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Literal {
    /// A number.
    Number(f64),
    /// A Boolean.
    Boolean(bool),
    /// A text: the value of a String, or the name of an Enumeration item.
    Text(String),
}

impl fmt::Display for Literal {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Literal::Number(number) => write!(formatter, "{number}"),
            Literal::Boolean(flag) => write!(formatter, "{flag}"),
            Literal::Text(text) => write!(formatter, "{text:?}"),
        }
    }
}

from_toml! {
    Literal, "a number, true, false or a text in quotes";
    visit_bool(value: bool) => Ok(Literal::Boolean(value));
    visit_i64(value: i64) => Ok(Literal::Number(slave::to_real(value)));
    #[expect(clippy::cast_precision_loss, reason = "a number of the file is a double")]
    visit_u64(value: u64) => Ok(Literal::Number(value as f64));
    visit_f64(value: f64) => Ok(Literal::Number(value));
    visit_str(text: &str) => Ok(Literal::Text(text.to_owned()));
}

/// Description of the value expected for a Binary.
const NO_BINARY: &str =
    "another variable: a scenario sets no Binary, `--set` with hexadecimal digits does";

impl Literal {
    /// Converts the value to a number of the type of `variable`: Booleans become 0 or 1, an Enumeration item its
    /// number. Returns a description of the expected value if the value does not fit, and for a String or Binary.
    pub(super) fn number(
        &self,
        variable: &ScalarVariable,
        description: &ModelDescription,
    ) -> Result<f64, String> {
        match (&variable.kind, self) {
            (Kind::Real(_) | Kind::Float32(_), Literal::Number(number)) if number.is_finite() => {
                Ok(*number)
            }
            (Kind::Real(_) | Kind::Float32(_), _) => Err("a finite number".to_owned()),
            (kind, Literal::Number(number)) if fits_integer(*number, kind, description) => {
                Ok(*number)
            }
            (Kind::Enumeration(kind), _) => {
                let named = |name: &String| description.types.iter().find(|one| one.name == *name);
                let items = kind.declared_type.as_ref().and_then(named);
                let items = items.map_or(&[][..], |one| &one.items[..]);
                #[expect(clippy::cast_precision_loss, reason = "a rounded number does not fit")]
                let items = items.iter().map(|(name, number)| (name, *number as f64));
                let fits = |item: &(_, f64)| fits_integer(item.1, &variable.kind, description);
                let items: Vec<(&String, f64)> = items.filter(fits).collect();
                if items.is_empty() {
                    return Err("a whole number".to_owned());
                }
                let item = items
                    .iter()
                    .find(|(name, _)| matches!(self, Self::Text(text) if text == *name));
                item.map(|(_, number)| *number).ok_or_else(|| {
                    let names: Vec<_> = items.iter().map(|(name, _)| name.as_str()).collect();
                    format!("a whole number or one of {}", names.join(", "))
                })
            }
            (Kind::Boolean(_) | Kind::Clock(_), Literal::Boolean(flag)) => {
                Ok(f64::from(u8::from(*flag)))
            }
            (Kind::Boolean(_) | Kind::Clock(_), _) => Err("true or false".to_owned()),
            (Kind::String(_), _) => Err("no number, as it is a String".to_owned()),
            (Kind::Binary(_), _) => Err(NO_BINARY.to_owned()),
            (kind, _) => Err(integers(kind, description)),
        }
    }
}

/// 2^53 - 1, the largest magnitude up to which no two integers round to the same double.
const EXACT: i128 = (1 << f64::MANTISSA_DIGITS) - 1;

/// Returns the smallest and largest integer that a signal can give to a variable of this type; `None` if its values are
/// not integers.
fn range(kind: &Kind, description: &ModelDescription) -> Option<(i128, i128)> {
    let (least, largest) = kind.integer_range(description.version())?.into_inner();
    Some((least.max(-EXACT), largest.min(EXACT)))
}

/// Returns whether a number is an integer that a signal can give to a variable of this type.
#[expect(clippy::cast_precision_loss, reason = "up to 2^53")]
pub(super) fn fits_integer(number: f64, kind: &Kind, description: &ModelDescription) -> bool {
    range(kind, description).is_some_and(|(least, largest)| {
        number.fract() == 0.0 && (least as f64..=largest as f64).contains(&number)
    })
}

/// Describes the integers that a signal can give to a variable of this type.
pub(super) fn integers(kind: &Kind, description: &ModelDescription) -> String {
    match range(kind, description) {
        Some((least, largest)) if (least, largest) != (i32::MIN.into(), i32::MAX.into()) => {
            format!("a whole number from {least} to {largest}")
        }
        _ => "an Integer of 32 bits".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_description::IntegerType;

    #[test]
    fn an_enumeration_without_items_expects_a_whole_number() {
        let kind = Kind::Enumeration(IntegerType::default());
        let variable = ScalarVariable { kind, ..ScalarVariable::default() };
        let refused =
            Literal::Text("on".to_owned()).number(&variable, &ModelDescription::default());
        assert_eq!(refused, Err("a whole number".to_owned()));
    }
}
