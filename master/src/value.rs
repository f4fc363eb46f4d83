//! The value of a variable, read from text.

use fmi2::description::Kind;

/// A value of one of the types of the standard; an Enumeration is an Integer.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    Real(f64),
    Integer(i32),
    Boolean(bool),
    String(String),
}

impl Value {
    /// What `text` spells for a variable of that kind, or what was expected.
    pub(crate) fn parse(kind: &Kind, text: &str) -> Result<Self, &'static str> {
        let trimmed = text.trim();
        match kind {
            Kind::Real(_) => trimmed.parse().map(Value::Real).map_err(|_| "a number"),
            Kind::Integer(_) | Kind::Enumeration(_) => {
                trimmed.parse().map(Value::Integer).map_err(|_| "an integer")
            }
            Kind::Boolean(_) => match trimmed {
                "true" | "1" => Ok(Value::Boolean(true)),
                "false" | "0" => Ok(Value::Boolean(false)),
                _ => Err("true or false"),
            },
            Kind::String(_) => Ok(Value::String(text.to_owned())),
        }
    }
}
