//! The trait [`Variables`], which the derive macro implements.

#[cfg(test)]
mod tests;

use crate::log::Log;
use crate::variable::Variable;

/// The table of variables of a struct, made by `#[derive(Variables)]`.
///
/// [`#[fmu::model]`](macro@crate::model) completes the implementation of [`Model`](crate::Model) with this table.
///
/// The page of the [crate] has an example.
///
/// # Errors
///
/// Mistakes are errors of the compiler at their places: two variables of one name, the derivative of a field that does
/// not exist, a type that no variable has, an unknown attribute, a field that is neither a variable nor marked with
/// `skip`, and more.
///
/// ```compile_fail
/// #[derive(Clone, fmu::Variables)]
/// struct Tank {
///     #[fmu(output)]
///     level: f64,
///     #[fmu(output, name = "level")]
///     height: f64,
/// }
/// ```
pub trait Variables: Sized {
    /// The name of the struct.
    const IDENTIFIER: &'static str;

    /// Whether a variable is the derivative of another one.
    const HAS_STATES: bool;

    /// Returns the variables in the order of the fields.
    fn table() -> Vec<Variable<Self>>;

    /// Returns the field with the messages of the model, if the struct has one.
    fn log_field(&mut self) -> Option<&mut Log> {
        None
    }
}
