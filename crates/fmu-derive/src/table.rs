//! Generates the implementation of `fmu::Variables`.

use proc_macro2::TokenStream;
use quote::{quote, quote_spanned};
use syn::{Data, DeriveInput, Error, Expr, Fields, Ident, Result};

use crate::array;
use crate::attributes::Role;
use crate::check::{check, find};
use crate::field::{Base, Part, Variable, read};

/// The fields of a model's struct by their kinds.
struct Model<'a> {
    variables: Vec<Variable<'a>>,
    logs: Vec<&'a Ident>,
    /// All fields with their start values.
    starts: Vec<(&'a Ident, Option<Expr>)>,
}

/// Generates the implementation for the struct `input`.
pub(crate) fn expand(input: &DeriveInput) -> Result<TokenStream> {
    let Data::Struct(data) = &input.data else {
        return Err(Error::new(input.ident.span(), "expected a struct: the state of the FMU"));
    };
    let Fields::Named(fields) = &data.fields else {
        return Err(Error::new(input.ident.span(), "expected a struct with named fields"));
    };
    if !input.generics.params.is_empty() {
        let message = "expected a struct without generic parameters: an FMU has one model";
        return Err(Error::new_spanned(&input.generics, message));
    }
    let mut model = read_all(fields)?;
    check(&mut model.variables)?;
    let ident = &input.ident;
    let identifier = ident.to_string();
    let has_states = model.variables.iter().any(|variable| variable.is_state);
    let rows = model.variables.iter().map(|variable| row(&model.variables, variable));
    let log = model.logs.first().map_or(
        quote!(::core::option::Option::None),
        |field| quote!(::core::option::Option::Some(&mut self.#field)),
    );
    let default = default(ident, &model);
    Ok(quote! {
        impl ::fmu::Variables for #ident {
            const IDENTIFIER: &'static str = #identifier;
            const HAS_STATES: bool = #has_states;

            fn table() -> ::std::vec::Vec<::fmu::Variable<Self>> {
                let mut table = ::std::vec::Vec::new();
                #(#rows)*
                table
            }

            fn log_field(&mut self) -> ::core::option::Option<&mut ::fmu::Log> {
                #log
            }
        }
        #default
    })
}

/// Reads all fields. The error is a second field of type `Log`, or has the mistakes of all fields.
fn read_all(fields: &syn::FieldsNamed) -> Result<Model<'_>> {
    let mut model = Model { variables: Vec::new(), logs: Vec::new(), starts: Vec::new() };
    let mut errors: Option<Error> = None;
    for field in &fields.named {
        match read(field) {
            Ok(Part::Variable(variable)) => {
                let start = variable.attributes.value("start").cloned();
                model.starts.push((variable.field, start));
                model.variables.push(*variable);
            }
            Ok(Part::Log(field)) => {
                model.starts.push((field, None));
                model.logs.push(field);
            }
            Ok(Part::Skipped { field, start }) => model.starts.push((field, start)),
            Err(error) => match &mut errors {
                Some(all) => all.combine(error),
                None => errors = Some(error),
            },
        }
    }
    if let [_, second, ..] = model.logs[..] {
        return Err(Error::new(second.span(), "a model has one field of the type Log"));
    }
    errors.map_or(Ok(model), Err)
}

/// Generates `Default` if a field has a start value.
fn default(ident: &Ident, model: &Model<'_>) -> Option<TokenStream> {
    model.starts.iter().any(|(_, start)| start.is_some()).then_some(())?;
    let fields = model.starts.iter().map(|(field, start)| {
        let variable = find(&model.variables, field);
        if let Some(value) = start {
            // By `into`, a literal would be an i32 or f64, which does not convert to every type of FMI 3.0.
            if variable.is_some_and(|variable| variable.base.is_fmi3_number()) {
                return quote!(#field: #value);
            }
            return quote!(#field: ::core::convert::Into::into(#value));
        }
        let value = array::default_value(variable.map_or(0, |variable| variable.extents.len()));
        quote_spanned!(field.span()=> #field: #value)
    });
    Some(quote! {
        impl ::core::default::Default for #ident {
            /// The start values.
            fn default() -> Self {
                Self { #(#fields),* }
            }
        }
    })
}

/// Generates the statements that add a variable, or each element of an array, to the table.
fn row(variables: &[Variable<'_>], variable: &Variable<'_>) -> TokenStream {
    let (field, description) = (variable.field, &variable.description);
    let constructor = constructor(variable);
    let attributes = attributes(variables, variable);
    let dimensions = variable.extents.len();
    let name = array::element_name(&variable.name, dimensions);
    let element = array::element(dimensions);
    let enumeration = enumeration(variable);
    let add = quote_spanned! {field.span()=>
        let variable = ::fmu::Variable::#constructor(
            #name, #description, #enumeration move |model: &mut Self| &mut model.#field #element
        );
        table.push(variable #attributes);
    };
    array::for_each(&variable.extents, add)
}

/// The name of the constructor in `fmu::Variable`.
fn constructor(variable: &Variable<'_>) -> TokenStream {
    match variable.base {
        Base::Real => quote!(real),
        Base::Integer if variable.attributes.enumeration.is_some() => quote!(enumeration),
        Base::Integer => quote!(integer),
        Base::Boolean => quote!(boolean),
        Base::String => quote!(string),
        Base::Typed(name) => {
            let name = Ident::new(name, variable.field.span());
            quote!(#name)
        }
    }
}

/// The argument with the enumeration, followed by a comma; `None` if the variable has none.
fn enumeration(variable: &Variable<'_>) -> Option<TokenStream> {
    let enumeration = variable.attributes.enumeration.as_ref()?;
    let name = &enumeration.name;
    let items = enumeration.values.iter().map(|(name, value)| quote!((#name, #value)));
    Some(quote!(::fmu::Enumeration::new(#name, [#(#items),*]),))
}

/// The calls of methods of `fmu::Variable` that set the attributes.
fn attributes(variables: &[Variable<'_>], variable: &Variable<'_>) -> TokenStream {
    let attributes = &variable.attributes;
    let mut calls = role(variable);
    if attributes.flag("discrete").is_some() {
        calls.extend(quote!(.discrete()));
    }
    let computed = variable.role().is_computed();
    if attributes.flag("approximate").is_some() {
        calls.extend(quote!(.approximate()));
    } else if computed && (variable.is_state || attributes.value("start").is_some())
        || attributes.flag("exact").is_some()
    {
        calls.extend(quote!(.exact()));
    }
    if attributes.flag("reinit").is_some() {
        calls.extend(quote!(.reinit()));
    }
    if attributes.flag("relative_quantity").is_some() {
        calls.extend(quote!(.relative_quantity()));
    }
    for (name, text) in attributes.texts.iter().filter(|(name, _)| name != "name") {
        calls.extend(quote_spanned!(text.span()=> .#name(#text)));
    }
    for (name, value) in attributes.values.iter().filter(|(name, _)| name != "start") {
        calls.extend(quote!(.#name(::core::convert::Into::into(#value))));
    }
    for field in &attributes.derivatives {
        calls.extend(quote_spanned!(field.span()=> .derivative(|model| &mut model.#field)));
    }
    if let Some(state) = &attributes.derivative_of {
        let name = state.to_string();
        let name = find(variables, state).map_or(&name, |known| &known.name);
        let name = array::element_name(name, variable.extents.len());
        calls.extend(quote!(.derivative_of(#name)));
    }
    calls.extend(dependencies(variables, variable));
    calls
}

/// The call that sets the role; nothing for a local variable.
fn role(variable: &Variable<'_>) -> TokenStream {
    match variable.role() {
        Role::Local | Role::Skip => quote!(),
        Role::Input => quote!(.input()),
        Role::Output => quote!(.output(&[])),
        Role::Parameter => quote!(.parameter()),
        Role::Tunable => quote!(.tunable()),
        Role::CalculatedParameter => quote!(.calculated_parameter()),
        Role::Constant => quote!(.constant()),
    }
}

/// Generates an expression for a `Vec` with the names of the variables of `fields`, one for each element of an array.
fn name_list<'a>(
    variables: &[Variable<'_>],
    fields: impl IntoIterator<Item = &'a Ident>,
) -> TokenStream {
    let mut names = quote!(let mut names = ::std::vec::Vec::<::std::string::String>::new(););
    for field in fields {
        let name = field.to_string();
        let (name, extents) = find(variables, field)
            .map_or((&name, &[][..]), |known| (&known.name, &known.extents[..]));
        let name = array::element_name(name, extents.len());
        names.extend(array::for_each(extents, quote!(names.push(#name.into());)));
    }
    quote!({ #names names })
}

/// The calls that set the dependencies: of an output or a derivative at communication points, and of any
/// variable with `initially` at initialization.
fn dependencies(variables: &[Variable<'_>], variable: &Variable<'_>) -> TokenStream {
    let attributes = &variable.attributes;
    let mut calls = TokenStream::new();
    let depends = variable.role() == Role::Output || variable.is_derivative();
    // Without `depends`, a state depends on itself only, which the exporter knows.
    if depends && !(variable.is_state && attributes.depends.is_none()) {
        let all = || {
            let known = |other: &&Variable<'_>| other.is_state || other.role() == Role::Input;
            variables.iter().filter(known).map(|other| other.field.clone()).collect()
        };
        let fields: Vec<Ident> = attributes.depends.clone().unwrap_or_else(all);
        let names = name_list(variables, &fields);
        let kind = quote!(::fmu::description::DependencyKind::Dependent);
        calls.extend(quote!(.depends(#kind, #names)));
    }
    if let Some(fields) = &attributes.initially {
        let names = name_list(variables, fields);
        calls.extend(quote!(.initially(#names)));
    }
    calls
}
