//! The macros of the crate `fmu`, which documents and exports them.
#![forbid(unsafe_code)]

mod array;
mod attributes;
mod check;
mod field;
mod model;
mod table;
#[cfg(test)]
mod tests;

use proc_macro::TokenStream;
use syn::{DeriveInput, ItemImpl, parse_macro_input};

/// Implements `fmu::Variables` for a struct: the table of its variables, one for each field.
///
/// Each field has the attribute `#[fmu(...)]`. The first paragraph of its doc comment is the description of
/// the variable, the name of the field is the name of the variable. The type of the field decides the type of
/// the variable:
///
/// | field | variable |
/// |---|---|
/// | `f64` | Real |
/// | `i32` | Integer, or Enumeration with `enumeration(...)` |
/// | `bool` | Boolean |
/// | `String` | String |
/// | `f32`, `i8`, `u8`, `i16`, `u16`, `u32`, `i64`, `u64` | the type of FMI 3.0 with that name, `Float32` to `UInt64`; not in FMI 2.0 |
/// | `Vec<u8>` | Binary; not in FMI 2.0 |
/// | `[f64; N]`, `[[f64; M]; N]` and other arrays of these | one variable for each element, `x[1]` or `A[1,2]`, row by row; elements of an array `der(x)` are `der(x[1])` and so on |
/// | `fmu::Log` | none: the messages of the model; at most one field, without the attribute |
///
/// # The role
///
/// At most one of these; without one, the variable is local.
///
/// | attribute | meaning |
/// |---|---|
/// | `input` | the importer sets it |
/// | `output` | other FMUs may be connected to it |
/// | `parameter` | fixed after initialization |
/// | `tunable` | a parameter that the importer may change between steps |
/// | `calculated_parameter` | computed from parameters in `initialize`, or in `update` if it depends on a `tunable` one (`initially(...)` states on which; without it on all) |
/// | `local` | only observed |
/// | `constant` | local, with a value that never changes |
/// | `skip` | no variable: a field of the state that the importer does not see |
///
/// # Continuous states
///
/// `derivative_of = x` makes the field the time derivative of the field `x`, which is then a continuous
/// state. Both are an output or a local variable. A state may itself be a derivative (`v = h'`, `a = v'`).
/// `state` states that the field is a state; it is an error if no field is its derivative. `reinit` states
/// that an event may change the state.
///
/// # Values
///
/// | attribute | meaning |
/// |---|---|
/// | `start = VALUE` | the value in `Default`, and thus the start value; a local variable or an output then keeps it until a step or an event changes it (`initial = exact`); a state does so also without `start` |
/// | `exact`, `approximate` | `initial` of a local variable or an output, if it differs from the row above |
/// | `discrete` | an `f64` or `f32` that changes at events and communication points only |
/// | `min = A`, `max = B`, `nominal = C` | limits and typical magnitude |
/// | `unit = "m/s"`, `display_unit = "km/h"`, `quantity = "Velocity"` | the unit, as `Variable::unit` takes it |
/// | `relative_quantity` | an `f64` or `f32` that is a difference, as `Variable::relative_quantity` makes it |
/// | `enumeration("Mode", off = 0, manual = 1)` | the items of an Enumeration |
/// | `name = "T_room"` | the name of the variable, if it differs from the name of the field |
///
/// If a field has `start`, the macro implements `Default` for the struct; fields without `start` then
/// have the default value of their type.
///
/// # Dependencies
///
/// | attribute | meaning |
/// |---|---|
/// | `depends(u, x, time)` | the inputs and states on which an output or a derivative depends at a communication point; `depends()` for none. Without it: on all inputs and all states, and a state on itself only |
/// | `initially(a, b)` | the inputs and variables with start values on which the initial value depends; without it on all |
/// | `derivatives(u_slope, ...)` | the fields with the first and higher time derivatives of an input, which the importer sets, or of an output, which it reads |
///
/// # Errors
///
/// The macro refuses, at the place of the mistake: fields without the attribute, unknown and repeated
/// attributes, two roles, two variables of one name, types that no variable has, attributes that do not fit
/// the type or the role, and names of fields that do not exist. It also refuses enums, tuple structs and
/// structs with generic parameters. `fmu::problems` finds mistakes beyond the struct, such as unknown units
/// and start values outside of their limits.
#[proc_macro_derive(Variables, attributes(fmu))]
pub fn variables(input: TokenStream) -> TokenStream {
    let input = parse_macro_input!(input as DeriveInput);
    table::expand(&input).unwrap_or_else(|error| error.to_compile_error()).into()
}

/// Completes an implementation of `fmu::Model` for a struct with `#[derive(Variables)]`.
///
/// The macro adds the items that the block does not have:
///
/// | item | added |
/// |---|---|
/// | `IDENTIFIER` | the name of the struct |
/// | `about` | `fmu::about!()`: description, authors, version and licence of the crate, with the default experiment of the arguments |
/// | `new` | the struct's `Default` |
/// | `variables` | the table of the derive |
/// | `model_exchange` | model exchange, if the struct has continuous states or the argument `event_indicators` is stated |
/// | `log` | the field of the type `fmu::Log`, if there is one |
///
/// Arguments, all optional: `event_indicators = 1`, the number of event indicators; `start_time`,
/// `stop_time`, `step_size` and `tolerance` of the default experiment.
///
/// # Errors
///
/// The macro refuses unknown and repeated arguments, arguments for a function that the block has, event indicators
/// without the function `event_indicators`, continuous states without the function `update`, and a block that is not
/// `impl Model for` a struct.
#[proc_macro_attribute]
pub fn model(arguments: TokenStream, item: TokenStream) -> TokenStream {
    let arguments = parse_macro_input!(arguments as model::Arguments);
    let block = parse_macro_input!(item as ItemImpl);
    model::expand(&arguments, block).unwrap_or_else(|error| error.to_compile_error()).into()
}
