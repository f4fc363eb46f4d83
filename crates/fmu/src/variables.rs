//! The trait [`Variables`], which the derive macro implements.

#[cfg(test)]
mod tests;

use crate::log::Log;
use crate::variable::Variable;

/// The table of variables of a struct, made by `#[derive(Variables)]`.
///
/// [`#[fmu::model]`](macro@crate::model) completes the implementation of [`Model`](crate::Model) with it.
///
/// ```
/// use fmu::{Failure, Model, Simulation, Variables};
///
/// /// A tank that drains: level' = inflow - level / time constant.
/// #[derive(Clone, Variables, serde::Serialize, serde::Deserialize)]
/// struct Tank {
///     /// Inflow
///     #[fmu(input, unit = "m/s")]
///     inflow: f64,
///     /// Level
///     #[fmu(output, unit = "m", min = 0, start = 1)]
///     level: f64,
///     /// Rise of the level
///     #[fmu(derivative_of = level, unit = "m/s")]
///     rise: f64,
///     /// Time constant
///     #[fmu(parameter, unit = "s", min = 1e-3, start = 10)]
///     time_constant: f64,
/// }
///
/// #[fmu::model(stop_time = 60)]
/// impl Model for Tank {
///     fn update(&mut self, _time: f64) -> Result<(), Failure> {
///         self.rise = self.inflow - self.level / self.time_constant;
///         Ok(())
///     }
/// }
///
/// fmu::export!(Tank);
///
/// # fn main() -> Result<(), Failure> {
/// assert_eq!(fmu::problems::<Tank>("resources".as_ref()), Ok(vec![]));
/// let mut tank = Simulation::<Tank>::new("resources".as_ref())?;
/// tank.step(20.0)?;
/// assert!((tank.model().level - (-2.0_f64).exp()).abs() < 1e-6);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
///
/// Mistakes are errors of the compiler at their places. Two variables of one name:
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
///
/// The derivative of a field that does not exist:
///
/// ```compile_fail
/// #[derive(Clone, fmu::Variables)]
/// struct Tank {
///     #[fmu(output)]
///     level: f64,
///     #[fmu(derivative_of = lever)]
///     rise: f64,
/// }
/// ```
///
/// A type that no variable has:
///
/// ```compile_fail
/// #[derive(Clone, fmu::Variables)]
/// struct Tank {
///     #[fmu(output)]
///     level: u128,
/// }
/// ```
///
/// An unknown attribute:
///
/// ```compile_fail
/// #[derive(Clone, fmu::Variables)]
/// struct Tank {
///     #[fmu(outptu)]
///     level: f64,
/// }
/// ```
///
/// A field that is neither a variable nor marked with `skip`:
///
/// ```compile_fail
/// #[derive(Clone, fmu::Variables)]
/// struct Tank {
///     level: f64,
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
