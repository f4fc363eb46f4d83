//! Parses `#[fmu(...)]` of a field.

use proc_macro2::Span;
use syn::meta::ParseNestedMeta;
use syn::parse::ParseStream;
use syn::punctuated::Punctuated;
use syn::spanned::Spanned;
use syn::{Error, Expr, Field, Ident, LitStr, Result, Token, parenthesized, token};

/// The names of all attributes, for messages.
const KNOWN: &str = "input, output, parameter, tunable, calculated_parameter, local, constant, skip, \
    state, derivative_of, reinit, start, exact, approximate, discrete, min, max, nominal, unit, \
    display_unit, relative_quantity, quantity, enumeration, name, depends, initially, derivatives";

/// The role of a variable.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Role {
    #[default]
    Local,
    Input,
    Output,
    Parameter,
    Tunable,
    CalculatedParameter,
    Constant,
    Skip,
}

impl Role {
    fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "input" => Self::Input,
            "output" => Self::Output,
            "parameter" => Self::Parameter,
            "tunable" => Self::Tunable,
            "calculated_parameter" => Self::CalculatedParameter,
            "local" => Self::Local,
            "constant" => Self::Constant,
            "skip" => Self::Skip,
            _ => return None,
        })
    }

    /// Whether the model computes the variable in steps and events: an output or a local variable.
    pub(crate) fn is_computed(self) -> bool {
        matches!(self, Self::Output | Self::Local)
    }
}

/// An enumeration: its name, and its items with their values.
pub(crate) struct Items {
    pub(crate) span: Span,
    pub(crate) name: LitStr,
    pub(crate) values: Vec<(LitStr, Expr)>,
}

/// The attributes of one field.
#[derive(Default)]
pub(crate) struct Attributes {
    pub(crate) role: Option<(Role, Span)>,
    /// Attributes without a value, except the role.
    pub(crate) flags: Vec<Ident>,
    /// Attributes with a number or an expression.
    pub(crate) values: Vec<(Ident, Expr)>,
    /// Attributes with a text.
    pub(crate) texts: Vec<(Ident, LitStr)>,
    pub(crate) derivative_of: Option<Ident>,
    pub(crate) enumeration: Option<Items>,
    /// The names in `depends`; `None` if this attribute is not stated.
    pub(crate) depends: Option<Vec<Ident>>,
    pub(crate) initially: Option<Vec<Ident>>,
    pub(crate) derivatives: Vec<Ident>,
    /// The names of all attributes that were read.
    names: Vec<String>,
}

impl Attributes {
    /// Reads all attributes `#[fmu(...)]` of the field; `None` for a field without such attributes. An error for the
    /// first attribute that is unknown, repeated, malformed or a second role.
    pub(crate) fn of(field: &Field) -> Result<Option<Self>> {
        let mut attributes = None;
        for attribute in field.attrs.iter().filter(|attribute| attribute.path().is_ident("fmu")) {
            let list: &mut Self = attributes.get_or_insert_with(Self::default);
            if !matches!(attribute.meta, syn::Meta::List(_)) {
                return Err(Error::new(attribute.span(), "expected #[fmu(...)]"));
            }
            attribute.parse_nested_meta(|meta| list.read(&meta))?;
        }
        Ok(attributes)
    }

    /// The role, local if none is stated.
    pub(crate) fn role(&self) -> Role {
        self.role.map_or(Role::default(), |(role, _)| role)
    }

    /// The span of a flag, if it is set.
    pub(crate) fn flag(&self, name: &str) -> Option<Span> {
        self.flags.iter().find(|flag| *flag == name).map(Ident::span)
    }

    /// The value of the attribute `name`, if it is stated.
    pub(crate) fn value(&self, name: &str) -> Option<&Expr> {
        self.values.iter().find(|(known, _)| known == name).map(|(_, value)| value)
    }

    /// The text of the attribute `name`, if it is stated.
    pub(crate) fn text(&self, name: &str) -> Option<&LitStr> {
        self.texts.iter().find(|(known, _)| known == name).map(|(_, text)| text)
    }

    /// Reads one attribute in the parentheses.
    fn read(&mut self, meta: &ParseNestedMeta<'_>) -> Result<()> {
        let Some(name) = meta.path.get_ident() else {
            return Err(meta.error(format!("unknown attribute, expected one of: {KNOWN}")));
        };
        let text = name.to_string();
        if self.names.contains(&text) {
            return Err(meta.error(format!("`{text}` is there twice")));
        }
        self.names.push(text.clone());
        if let Some(role) = Role::parse(&text) {
            if self.role.is_some() {
                return Err(meta.error("a variable has one role, and this is the second one"));
            }
            self.role = Some((role, name.span()));
            return Ok(());
        }
        match text.as_str() {
            "state" | "reinit" | "exact" | "approximate" | "discrete" | "relative_quantity" => {
                self.flags.push(name.clone());
            }
            "start" | "min" | "max" | "nominal" => {
                self.values.push((name.clone(), meta.value()?.parse()?));
            }
            "unit" | "display_unit" | "quantity" | "name" => {
                self.texts.push((name.clone(), meta.value()?.parse()?));
            }
            "derivative_of" => self.derivative_of = Some(field_name(meta.value()?)?),
            "depends" => self.depends = Some(names(meta)?),
            "initially" => self.initially = Some(names(meta)?),
            "derivatives" => self.derivatives = names(meta)?,
            "enumeration" => self.enumeration = Some(items(meta, name.span())?),
            _ => {
                let message = format!("unknown attribute `{text}`, expected one of: {KNOWN}");
                return Err(meta.error(message));
            }
        }
        Ok(())
    }
}

/// The name of a field or an item without `r#`.
pub(crate) fn plain(ident: &Ident) -> String {
    let name = ident.to_string();
    name.strip_prefix("r#").unwrap_or(&name).to_owned()
}

/// Parses the name of a field, an identifier or a text.
fn field_name(input: ParseStream<'_>) -> Result<Ident> {
    if input.peek(LitStr) {
        let text: LitStr = input.parse()?;
        return text.parse();
    }
    input.parse()
}

/// Parses names of fields in parentheses.
fn names(meta: &ParseNestedMeta<'_>) -> Result<Vec<Ident>> {
    let content;
    parenthesized!(content in meta.input);
    let names = Punctuated::<Ident, Token![,]>::parse_terminated_with(&content, field_name)?;
    Ok(names.into_iter().collect())
}

/// Parses `("Name", item = value, ...)`; an item is an identifier or a text.
fn items(meta: &ParseNestedMeta<'_>, span: Span) -> Result<Items> {
    if !meta.input.peek(token::Paren) {
        return Err(meta.error("expected enumeration(\"Name\", item = 0, ...)"));
    }
    let content;
    parenthesized!(content in meta.input);
    let name = content.parse()?;
    let mut values = Vec::new();
    while !content.is_empty() {
        content.parse::<Token![,]>()?;
        if content.is_empty() {
            break;
        }
        let item = if content.peek(LitStr) {
            content.parse()?
        } else {
            let item: Ident = content.parse()?;
            LitStr::new(&plain(&item), item.span())
        };
        content.parse::<Token![=]>()?;
        values.push((item, content.parse()?));
    }
    if values.is_empty() {
        return Err(Error::new(span, "an enumeration has at least one item: item = 0"));
    }
    Ok(Items { span, name, values })
}
