//! A field of the struct that is a variable.

use syn::spanned::Spanned;
use syn::{
    Error, Expr, ExprLit, Field, GenericArgument, Ident, Lit, Meta, PathArguments, Result, Type,
    TypeArray,
};

use crate::attributes::{Attributes, Role, plain};

/// The base type of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Base {
    Real,
    Integer,
    Boolean,
    String,
    /// A type that FMI 2.0 lacks, by the name of the constructor of its variables in `fmu::Variable`.
    Typed(&'static str),
}

impl Base {
    /// Whether the type is `f64` or `f32`.
    pub(crate) fn is_float(self) -> bool {
        matches!(self, Base::Real | Base::Typed("float32"))
    }

    /// Whether the type is a number that FMI 2.0 does not have.
    pub(crate) fn is_fmi3_number(self) -> bool {
        matches!(self, Base::Typed(name) if name != "binary")
    }
}

/// A field with the attribute `#[fmu(...)]`, except `#[fmu(skip)]`.
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

/// The kind of a field of the struct.
pub(crate) enum Part<'a> {
    Variable(Box<Variable<'a>>),
    /// A field of type `Log` without attribute: the messages of the model.
    Log(&'a Ident),
    /// A field with `#[fmu(skip)]`, which the importer does not see, and its start value.
    Skipped {
        field: &'a Ident,
        start: Option<Expr>,
    },
}

/// Reads a field. An error for a field without name, with invalid attributes, without attribute unless its type is
/// `Log`, or of a type that no variable has.
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

/// The last name in the path of a type: `Log` of `fmu::Log`; `None` if the type is no path.
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

/// The base type of a field, and the extents of an array, the outermost first.
fn base(field_type: &Type) -> Result<(Base, Vec<&Expr>)> {
    if let Type::Array(TypeArray { elem, len, .. }) = field_type {
        let (base, mut extents) = base(elem)?;
        extents.insert(0, len);
        return Ok((base, extents));
    }
    let name = last_segment(field_type).unwrap_or_default();
    let base = match name.as_str() {
        "f64" => Base::Real,
        "i32" => Base::Integer,
        "bool" => Base::Boolean,
        "String" => Base::String,
        "Vec" if is_bytes(field_type) => Base::Typed("binary"),
        "f32" => Base::Typed("float32"),
        "i8" => Base::Typed("int8"),
        "u8" => Base::Typed("uint8"),
        "i16" => Base::Typed("int16"),
        "u16" => Base::Typed("uint16"),
        "u32" => Base::Typed("uint32"),
        "i64" => Base::Typed("int64"),
        "u64" => Base::Typed("uint64"),
        _ => {
            let message = "no variable has this type: expected f64, i32, bool, String; for FMI 3.0 only \
                           f32, i8, u8, i16, u16, u32, i64, u64, Vec<u8>; an array of them, or #[fmu(skip)] for a field that is no variable";
            return Err(Error::new(field_type.span(), message));
        }
    };
    Ok((base, Vec::new()))
}

/// Whether the type, a `Vec`, is `Vec<u8>`.
fn is_bytes(vector: &Type) -> bool {
    let Type::Path(path) = vector else { return false };
    let last = path.path.segments.last().map(|segment| &segment.arguments);
    let Some(PathArguments::AngleBracketed(list)) = last else { return false };
    match list.args.first() {
        Some(GenericArgument::Type(item)) => last_segment(item).is_some_and(|name| name == "u8"),
        _ => false,
    }
}

/// The first paragraph of the doc comment, in one line; empty without doc comment.
fn description(field: &Field) -> String {
    let mut lines = Vec::new();
    for attribute in field.attrs.iter().filter(|attribute| attribute.path().is_ident("doc")) {
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
