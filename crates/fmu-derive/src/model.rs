//! Generates the items that an implementation of `fmu::Model` does not have.

use proc_macro2::TokenStream;
use quote::quote;
use syn::parse::{Parse, ParseStream};
use syn::punctuated::Punctuated;
use syn::{Error, Expr, Ident, ImplItem, ItemImpl, Result, Token, parse_quote};

/// Names of the arguments.
const KNOWN: [&str; 5] = ["event_indicators", "start_time", "stop_time", "step_size", "tolerance"];

/// The arguments of `#[fmu::model(...)]`.
pub(crate) struct Arguments(Vec<(Ident, Expr)>);

fn argument(input: ParseStream<'_>) -> Result<(Ident, Expr)> {
    let name = input.parse()?;
    input.parse::<Token![=]>()?;
    Ok((name, input.parse()?))
}

impl Parse for Arguments {
    fn parse(input: ParseStream<'_>) -> Result<Self> {
        let mut all: Vec<(Ident, Expr)> = Vec::new();
        for (name, value) in Punctuated::<_, Token![,]>::parse_terminated_with(input, argument)? {
            if !KNOWN.iter().any(|known| name == known) {
                let message = format!("unknown argument, expected one of: {}", KNOWN.join(", "));
                return Err(Error::new(name.span(), message));
            }
            if all.iter().any(|(other, _)| *other == name) {
                return Err(Error::new(name.span(), "this argument is there twice"));
            }
            all.push((name, value));
        }
        Ok(Self(all))
    }
}

/// Adds the items that `block` does not have.
pub(crate) fn expand(arguments: &Arguments, mut block: ItemImpl) -> Result<TokenStream> {
    let trait_name = block.trait_.as_ref().and_then(|(path, _)| path.segments.last());
    if trait_name.is_none_or(|segment| segment.ident != "Model") {
        return Err(Error::new_spanned(&block.self_ty, "expected `impl Model for` a struct"));
    }
    let present: Vec<String> = block.items.iter().filter_map(name).collect();
    let has = |function: &str| present.iter().any(|name| name == function);
    if let Some((argument, count)) = event_indicators(arguments)
        && !has("event_indicators")
        && quote!(#count).to_string() != "0"
    {
        let message = "expected the function `event_indicators`, which computes them";
        return Err(Error::new(argument.span(), message));
    }
    let is_derived = !has("variables") && !has("model_exchange");
    let check = (is_derived && !has("update")).then(|| derivatives_check(&block));
    for (item, argument) in items(arguments) {
        if !name(&item).is_some_and(|name| present.contains(&name)) {
            block.items.push(item);
        } else if let Some(argument) = argument {
            let message = "the block has the function that this argument is for";
            return Err(Error::new(argument.span(), message));
        }
    }
    Ok(quote!(#block #check))
}

/// Returns the argument `event_indicators` with its value.
fn event_indicators(arguments: &Arguments) -> Option<&(Ident, Expr)> {
    arguments.0.iter().find(|(name, _)| name == "event_indicators")
}

/// Returns code that the compiler refuses if the struct of `block`, which has no function `update`, has states.
fn derivatives_check(block: &ItemImpl) -> TokenStream {
    let model = &block.self_ty;
    quote! {
        const _: () = ::core::assert!(
            !<#model as ::fmu::Variables>::HAS_STATES,
            "the model has continuous states: expected the function `update`, which computes their derivatives"
        );
    }
}

/// The name of a constant or a function; `None` for other items.
fn name(item: &ImplItem) -> Option<String> {
    match item {
        ImplItem::Const(item) => Some(item.ident.to_string()),
        ImplItem::Fn(item) => Some(item.sig.ident.to_string()),
        _ => None,
    }
}

/// All items that can be added, each with the first argument that the item uses, if any.
fn items(arguments: &Arguments) -> Vec<(ImplItem, Option<Ident>)> {
    let indicators = event_indicators(arguments);
    let experiment: Vec<_> =
        arguments.0.iter().filter(|(name, _)| name != "event_indicators").collect();
    let fields = experiment.iter().map(|(name, value)| quote!(#name: #value));
    let interface = if let Some((_, count)) = indicators {
        quote!(::core::option::Option::Some(::fmu::ModelExchange { event_indicators: #count }))
    } else {
        quote!(<Self as ::fmu::Variables>::HAS_STATES.then(::core::default::Default::default))
    };
    let exchange = parse_quote! {
        fn model_exchange(&self) -> ::core::option::Option<::fmu::ModelExchange> {
            #interface
        }
    };
    let about = parse_quote! {
        fn about(&self) -> ::fmu::About {
            ::fmu::about!(#(#fields),*)
        }
    };
    let others: [ImplItem; 4] = [
        parse_quote! {
            const IDENTIFIER: &'static str = <Self as ::fmu::Variables>::IDENTIFIER;
        },
        parse_quote! {
            fn new(_: &::std::path::Path) -> ::core::result::Result<Self, ::fmu::Failure> {
                ::core::result::Result::Ok(<Self as ::core::default::Default>::default())
            }
        },
        parse_quote! {
            fn variables(&self) -> ::std::vec::Vec<::fmu::Variable<Self>> {
                <Self as ::fmu::Variables>::table()
            }
        },
        parse_quote! {
            fn log(&mut self) -> ::core::option::Option<&mut ::fmu::Log> {
                <Self as ::fmu::Variables>::log_field(self)
            }
        },
    ];
    let from_arguments = [
        (about, experiment.first().map(|(name, _)| name.clone())),
        (exchange, indicators.map(|(name, _)| name.clone())),
    ];
    from_arguments.into_iter().chain(others.map(|item| (item, None))).collect()
}
