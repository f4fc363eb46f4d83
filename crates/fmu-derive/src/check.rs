//! Checks of the fields of a struct against each other.

use proc_macro2::Span;
use syn::{Error, Expr, ExprLit, ExprUnary, Ident, Lit, Result, UnOp};

use crate::attributes::Role;
use crate::field::{Base, Variable};

/// Marks the states, and checks each variable alone and all together. The error has all mistakes, each with its span.
pub(crate) fn check(variables: &mut [Variable<'_>]) -> Result<()> {
    let mut errors = Vec::new();
    errors.extend(mark_states(variables));
    errors.extend(check_names(variables));
    for variable in &*variables {
        errors.extend(check_attributes(variable));
        errors.extend(check_references(variables, variable));
    }
    let all = errors.into_iter().reduce(|mut all, error| {
        all.combine(error);
        all
    });
    all.map_or(Ok(()), Err)
}

/// Returns the variable of the field called `field`.
pub(crate) fn find<'a, 'b>(
    variables: &'b [Variable<'a>],
    field: &Ident,
) -> Option<&'b Variable<'a>> {
    variables.iter().find(|variable| variable.field == field)
}

/// Sets `is_state` of each variable whose derivative is another field, and checks these pairs.
fn mark_states(variables: &mut [Variable<'_>]) -> Vec<Error> {
    let mut errors = Vec::new();
    let mut states: Vec<Ident> = Vec::new();
    for variable in &*variables {
        let Some(state) = &variable.attributes.derivative_of else { continue };
        let refuse = |message: String| Error::new(state.span(), message);
        match find(variables, state) {
            None => errors.push(refuse(format!("`{state}` is no variable of this struct"))),
            Some(other) if other.field == variable.field => {
                errors.push(refuse(format!("`{state}` cannot be its own derivative")));
            }
            Some(other) if other.base != Base::Real || variable.base != Base::Real => {
                errors
                    .push(refuse("a state and its derivative are f64 or arrays of f64".to_owned()));
            }
            Some(other) if other.extents.len() != variable.extents.len() => {
                let message = "a state and its derivative have the same dimensions";
                errors.push(refuse(message.to_owned()));
            }
            Some(_) if states.contains(state) => {
                errors.push(refuse(format!("`{state}` has two derivatives")));
            }
            Some(other)
                if !other.role().is_computed() || other.attributes.flag("discrete").is_some() =>
            {
                let message = format!("the state `{state}` must be an output or local, continuous");
                errors.push(refuse(message));
            }
            Some(_) => states.push(state.clone()),
        }
    }
    for variable in variables {
        variable.is_state = states.contains(variable.field);
    }
    errors
}

/// Checks that names are unique, not empty and not `time`.
fn check_names(variables: &[Variable<'_>]) -> Vec<Error> {
    let mut errors = Vec::new();
    for (k, variable) in variables.iter().enumerate() {
        let place = || match variable.attributes.text("name") {
            Some(text) => text.span(),
            None => variable.field.span(),
        };
        let name = &variable.name;
        if variables[..k].iter().any(|other| other.name == *name) {
            let message =
                format!("two variables have the name {name:?} (FMI 2.0.5, section 2.2.7)");
            errors.push(Error::new(place(), message));
        }
        if name == "time" || name.is_empty() {
            let message = format!("a variable cannot have the name {name:?}");
            errors.push(Error::new(place(), message));
        }
    }
    errors
}

/// Checks the attributes of one variable.
fn check_attributes(variable: &Variable<'_>) -> Vec<Error> {
    let attributes = &variable.attributes;
    let (role, mut errors) = (variable.role(), Vec::new());
    let mut require = |holds: bool, span: Span, message: &str| {
        if !holds {
            errors.push(Error::new(span, message));
        }
    };
    let is_real = variable.base.is_float();
    let is_number = is_real
        || variable.base.is_fmi3_number()
        || variable.base == Base::Integer && attributes.enumeration.is_none();
    for name in ["unit", "display_unit"] {
        if let Some(text) = attributes.text(name) {
            require(is_real, text.span(), "only a variable of type f64 or f32 has a unit");
        }
    }
    if let Some(span) = attributes.flag("relative_quantity") {
        require(is_real, span, "only a variable of type f64 or f32 is a relative quantity");
    }
    for (name, value) in attributes.values.iter().filter(|(name, _)| name != "start") {
        let fits = if name == "nominal" { is_real } else { is_number };
        require(fits, name.span(), &format!("`{name}` does not fit the type of the field"));
        let positive = name != "nominal" || number(value).is_none_or(|value| value > 0.0);
        require(positive, name.span(), "`nominal` must be above 0 (FMI 2.0.5, section 2.2.7)");
    }
    let [min, max] = ["min", "max"].map(|name| attributes.value(name));
    if let (Some(min), Some(max)) = (min.and_then(number), max.and_then(number)) {
        let message = "`min` is above `max` (FMI 2.0.5, section 2.2.7)";
        require(min <= max, span_of(variable, "min"), message);
    }
    if let Some(enumeration) = &attributes.enumeration {
        let message = "an enumeration is a field of type i32";
        require(variable.base == Base::Integer, enumeration.span, message);
    }
    if let Some(span) = attributes.flag("discrete") {
        require(is_real, span, "only a variable of type f64 or f32 can be discrete or not");
        let changes = role.is_computed() || role == Role::Input;
        require(changes, span, "only an input, an output or a local variable can be discrete");
    }
    if let Some(span) = attributes.flag("state") {
        let message =
            "no field is the derivative of this state: expected #[fmu(derivative_of = ...)]";
        require(variable.is_state, span, message);
    }
    if let Some(span) = attributes.flag("reinit") {
        require(variable.is_state, span, "only a continuous state has `reinit`");
    }
    for flag in ["exact", "approximate"] {
        if let Some(span) = attributes.flag(flag) {
            let message = "only an output or a local variable states how it starts";
            require(role.is_computed(), span, message);
        }
    }
    if role == Role::CalculatedParameter
        && let Some(start) = attributes.value("start")
    {
        let message = "`initialize` computes a calculated parameter: it has no start value";
        require(false, syn::spanned::Spanned::span(start), message);
    }
    let computed = role.is_computed();
    if let Some(state) = &attributes.derivative_of {
        require(
            computed,
            state.span(),
            "a derivative is an output or local: the model computes it",
        );
    }
    if attributes.depends.is_some() {
        let message = "only an output or a derivative depends on other variables";
        require(role == Role::Output || variable.is_derivative(), variable.field.span(), message);
    }
    errors
}

/// Checks the fields that `depends` and `initially` name, and that the variable may have `derivatives`.
fn check_references(variables: &[Variable<'_>], variable: &Variable<'_>) -> Vec<Error> {
    let attributes = &variable.attributes;
    let mut errors = Vec::new();
    let lists = attributes.depends.iter().chain(&attributes.initially);
    for name in lists.flatten().filter(|name| *name != "time") {
        if find(variables, name).is_none() {
            let message = format!("`{name}` is no variable of this struct");
            errors.push(Error::new(name.span(), message));
        }
    }
    for name in attributes.depends.iter().flatten().filter(|name| *name != "time") {
        let fits = |known: &Variable<'_>| known.role() == Role::Input || known.is_state;
        if find(variables, name).is_some_and(|known| !fits(known)) {
            let message = format!(
                "`{name}` is neither an input nor a state (FMI 2.0.5, section 2.2.8: knowns)"
            );
            errors.push(Error::new(name.span(), message));
        }
    }
    if let Some(first) = attributes.derivatives.first() {
        let fits = matches!(variable.role(), Role::Input | Role::Output);
        if !fits || variable.base != Base::Real || !variable.extents.is_empty() {
            let message = "only an input or output of type f64 has `derivatives`";
            errors.push(Error::new(first.span(), message));
        }
    }
    errors
}

/// The span of the attribute `name`, or of the macro if the attribute is not stated.
fn span_of(variable: &Variable<'_>, name: &str) -> Span {
    let value = variable.attributes.values.iter().find(|(known, _)| known == name);
    value.map_or_else(Span::call_site, |(known, _)| known.span())
}

/// The value of a literal number, also with a minus; `None` for any other expression.
fn number(value: &Expr) -> Option<f64> {
    match value {
        Expr::Lit(ExprLit { lit: Lit::Float(number), .. }) => number.base10_parse().ok(),
        Expr::Lit(ExprLit { lit: Lit::Int(number), .. }) => number.base10_parse().ok(),
        Expr::Unary(ExprUnary { op: UnOp::Neg(_), expr, .. }) => number(expr).map(|value| -value),
        _ => None,
    }
}
