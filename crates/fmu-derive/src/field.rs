//! A field of the struct that is a variable.

use syn::spanned::Spanned;
use syn::{Error, Expr, ExprLit, Field, Ident, Lit, Meta, Result, Type, TypeArray};

use crate::attributes::{Attributes, Role};

/// The base type of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Base {
    Real,
    Integer,
    Boolean,
    String,
}

/// A field with the attribute `#[fmu(...)]`.
pub(crate) struct Variable<'a> {
    pub(crate) field: &'a Ident,
    pub(crate) name: String,
    pub(crate) description: String,
    pub(crate) base: Base,
    /// The extents of the dimensions of an array; empty for a scalar.
    pub(crate) extents: Vec<&'a Expr>,
    pub(crate) attributes: Attributes,
    /// Whether another field is the derivative of this one.
    pub(crate) is_state: bool,
}

impl Variable<'_> {
    pub(crate) fn role(&self) -> Role {
        self.attributes.role()
    }

    /// Whether the field is the derivative of a state.
    pub(crate) fn is_derivative(&self) -> bool {
        self.attributes.derivative_of.is_some()
    }
}

/// What a field is for the table of variables.
pub(crate) enum Part<'a> {
    Variable(Box<Variable<'a>>),
    /// The field with the messages of the model.
    Log(&'a Ident),
    /// A field that the importer does not see, with its start value.
    Skipped {
        field: &'a Ident,
        start: Option<Expr>,
    },
}

/// Reads a field.
pub(crate) fn read(field: &Field) -> Result<Part<'_>> {
    let Some(ident) = &field.ident else {
        return Err(Error::new(field.span(), "expected a field with a name"));
    };
    let Some(attributes) = Attributes::of(field)? else {
        if is_log(&field.ty) {
            return Ok(Part::Log(ident));
        }
        let message = format!(
            "field `{ident}`: expected #[fmu(...)] with the role of the variable, such as \
             #[fmu(output)], or #[fmu(skip)] for a field that is no variable"
        );
        return Err(Error::new(ident.span(), message));
    };
    if attributes.role() == Role::Skip {
        let start = attributes.value("start").cloned();
        return Ok(Part::Skipped { field: ident, start });
    }
    let (base, extents) = base(&field.ty)?;
    let name = attributes.text("name").map_or_else(|| plain(ident), syn::LitStr::value);
    Ok(Part::Variable(Box::new(Variable {
        field: ident,
        name,
        description: description(field),
        base,
        extents,
        attributes,
        is_state: false,
    })))
}

/// The name of a field without `r#`.
fn plain(ident: &Ident) -> String {
    let name = ident.to_string();
    name.strip_prefix("r#").map_or(name.clone(), str::to_owned)
}

fn last_segment(path: &Type) -> Option<String> {
    match path {
        Type::Path(path) => path.path.segments.last().map(|segment| segment.ident.to_string()),
        Type::Group(group) => last_segment(&group.elem),
        _ => None,
    }
}

fn is_log(path: &Type) -> bool {
    last_segment(path).is_some_and(|name| name == "Log")
}

/// The base type of a field, and the extents of an array.
fn base(of: &Type) -> Result<(Base, Vec<&Expr>)> {
    if let Type::Array(TypeArray { elem, len, .. }) = of {
        let (base, mut extents) = base(elem)?;
        extents.insert(0, len);
        return Ok((base, extents));
    }
    let base = match last_segment(of).as_deref() {
        Some("f64") => Base::Real,
        Some("i32") => Base::Integer,
        Some("bool") => Base::Boolean,
        Some("String") => Base::String,
        _ => {
            let message = "no variable has this type: expected f64, i32, bool, String or an array of \
                           them, or #[fmu(skip)] for a field that is no variable";
            return Err(Error::new(of.span(), message));
        }
    };
    Ok((base, Vec::new()))
}

/// The first paragraph of the doc comment, in one line.
fn description(field: &Field) -> String {
    let mut lines = Vec::new();
    for attribute in field.attrs.iter().filter(|own| own.path().is_ident("doc")) {
        let Meta::NameValue(meta) = &attribute.meta else { continue };
        let Expr::Lit(ExprLit { lit: Lit::Str(text), .. }) = &meta.value else { continue };
        lines.extend(text.value().lines().map(|line| line.trim().to_owned()));
        if text.value().is_empty() {
            lines.push(String::new());
        }
    }
    let paragraph = lines.iter().skip_while(|line| line.is_empty());
    paragraph.take_while(|line| !line.is_empty()).cloned().collect::<Vec<_>>().join(" ")
}
