//! Code for the elements of an array, each of which is a variable.

use proc_macro2::{Span, TokenStream};
use quote::quote;
use syn::{Expr, Ident, LitStr};

/// The loop variable of dimension `k`, counted from 0.
fn index(k: usize) -> Ident {
    Ident::new(&format!("index_{k}"), Span::mixed_site())
}

/// The expression for the name of the element at the indices of the loops: `x[1]`, `A[1,2]`, and `der(x[1])`
/// if `name` is `der(x)`; `name` itself without dimensions.
pub(crate) fn element_name(name: &str, dimensions: usize) -> TokenStream {
    if dimensions == 0 {
        return quote!(#name);
    }
    let state = name.strip_prefix("der(").and_then(|state| state.strip_suffix(')'));
    let (head, tail) = match state {
        Some(state) => (format!("der({state}["), "])"),
        None => (format!("{name}["), "]"),
    };
    let places = format!("{{}}{}{{}}", vec!["{}"; dimensions].join(","));
    let places = LitStr::new(&places, Span::mixed_site());
    let numbers = (0..dimensions).map(|k| {
        let index = index(k);
        quote!(#index + 1)
    });
    quote!(::std::format!(#places, #head, #(#numbers,)* #tail))
}

/// The indices that select the element of a field: `[i][j]`; nothing without dimensions.
pub(crate) fn element(dimensions: usize) -> TokenStream {
    let indices = (0..dimensions).map(index);
    quote!(#([#indices])*)
}

/// Loops that run `body` for each element, in row-major order; `body` alone without dimensions.
pub(crate) fn for_each(extents: &[&Expr], body: TokenStream) -> TokenStream {
    extents.iter().enumerate().rev().fold(body, |body, (k, extent)| {
        let index = index(k);
        quote!(for #index in 0..(#extent) { #body })
    })
}

/// The expression for an array whose elements have the default value of their type; without dimensions,
/// for the default value itself.
pub(crate) fn default_value(dimensions: usize) -> TokenStream {
    let element = quote!(::core::default::Default::default());
    (0..dimensions).fold(element, |inner, _| quote!(::core::array::from_fn(|_| #inner)))
}
