//! Warns of elements and attributes that the schema of the standard does not have, and of elements in
//! another order.

mod fmi1;
mod fmi2;
mod fmi3;

use super::attributes::Node;
use crate::description::Version;

/// Converts names, without quotes and commas, to a slice of texts.
macro_rules! names {
    ($($name:ident)*) => { &[$(stringify!($name)),*] };
}
use names;

/// The names of a table of [`attributes`](crate::description::attributes).
macro_rules! names_in_table {
    (() $($name:literal $field:ident,)*) => { &[$($name),*] };
}
use names_in_table;

/// An element of the schema: its attributes and its children in order.
struct Shape {
    attributes: &'static [&'static str],
    /// Further attributes: lists that this element shares with other elements.
    shared: [&'static [&'static str]; 3],
    children: &'static [&'static str],
    /// Whether the element needs at least one child.
    list: bool,
    /// The children up to this position, counted from 0, may come in any order.
    unordered: usize,
}

impl Shape {
    /// Adds a list of shared attributes; a shape has at most three.
    const fn with(self, shared: &'static [&'static str]) -> Shape {
        let [first, second, third] = self.shared;
        assert!(third.is_empty(), "room for three lists");
        Shape { shared: [shared, first, second], ..self }
    }
}

const fn leaf(attributes: &'static [&'static str]) -> Shape {
    branch(attributes, &[])
}

const fn list(children: &'static [&'static str]) -> Shape {
    Shape { list: true, ..branch(&[], children) }
}

const fn branch(attributes: &'static [&'static str], children: &'static [&'static str]) -> Shape {
    Shape { attributes, shared: [&[]; 3], children, list: false, unordered: 0 }
}

/// Warns of everything in the element `root` of a file that the schema of `version` does not allow.
pub(super) fn check(root: Node<'_>, version: Version) {
    match version {
        Version::V1 => check_element(root, "", fmi1::shape),
        Version::V2 => check_element(root, "", fmi2::shape),
        Version::V3 => check_element(root, "", fmi3::shape),
    }
}

/// Warns of the attributes and children of `node`, a child of the element `parent`, and of everything below `node`.
/// Does nothing if `shapes` has no shape for `node`.
fn check_element(node: Node<'_>, parent: &str, shapes: fn(&str, &str) -> Option<Shape>) {
    let element = node.element;
    let Some(shape) = shapes(parent, element.name) else { return };
    for (name, value) in &element.attributes {
        // Any attribute with a namespace is accepted: FMI defines no namespaces.
        let mut lists = shape.shared.iter().chain([&shape.attributes]);
        let known = lists.any(|list| list.contains(name)) || *name == "xmlns" || name.contains(':');
        if !known {
            node.warn(name, "an attribute of the standard", value, "it was skipped");
        }
    }
    if shape.list && element.children.is_empty() {
        let place = format!("<{}>", element.name);
        let expected = "an item, or no such list";
        node.warn_of(true, place, expected, "none".to_owned(), "read as no list");
    }
    let mut last = 0;
    for child in &element.children {
        let inner = Node { element: child, ..node };
        let position = shape.children.iter().position(|name| *name == child.name);
        let Some(position) = position else {
            let place = format!("<{}> in <{}>", child.name, element.name);
            let (expected, actual) = ("an element of the standard", "another one".to_owned());
            inner.warn_of(true, place, expected, actual, "it was skipped");
            continue;
        };
        let position = position.max(shape.unordered);
        if position < last {
            let place = format!("<{}>", child.name);
            let expected = format!("the order {}", shape.children.join(", "));
            let actual = format!("it after {}", shape.children[last]);
            inner.warn_of(true, place, &expected, actual, "it was read all the same");
        }
        last = last.max(position);
        check_element(inner, element.name, shapes);
    }
}
