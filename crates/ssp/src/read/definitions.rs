//! Parses units, enumerations, types and transformations, which several kinds of files contain
//! (section 4).

use std::collections::HashSet;
use std::hash::Hash;

use fmu_description::unit::BaseUnit;

use crate::error::SspError;
use crate::structure::{
    Conversion, Definitions, Dimension, Enumeration, Transformation, Type, Unit,
};
use crate::xml::Node;

pub(super) fn definitions(root: &Node) -> Result<Definitions, SspError> {
    let enumerations = root.list("Enumerations", "Enumeration", enumeration)?;
    let units = root.list("Units", "Unit", unit)?;
    root.unique("enumerations", enumerations.iter().map(|enumeration| enumeration.name.as_str()))?;
    root.unique("units", units.iter().map(|unit| unit.name.as_str()))?;
    Ok(Definitions { enumerations, units })
}

fn enumeration(node: &Node) -> Result<Enumeration, SspError> {
    let items = node
        .children_named("Item")
        .map(|item| Ok((item.required("name")?.to_owned(), item.needed("value", Node::integer)?)));
    let items = items.collect::<Result<Vec<_>, SspError>>()?;
    node.unique("items", items.iter().map(|(name, _)| name.as_str()))?;
    Ok(Enumeration { name: node.required("name")?.to_owned(), items })
}

fn unit(node: &Node) -> Result<Unit, SspError> {
    let base = node.child("BaseUnit")?;
    let base = base.ok_or_else(|| node.wrong("an element BaseUnit", "none"))?;
    let factor = base.number("factor")?.unwrap_or(1.0);
    if factor == 0.0 {
        return Err(base.wrong("a factor other than zero", "0"));
    }
    let mut exponents = [0; 8];
    for (exponent, name) in exponents.iter_mut().zip(BaseUnit::EXPONENTS) {
        *exponent = base.integer(name)?.unwrap_or(0);
    }
    let base = BaseUnit::from_exponents(exponents, factor, base.number("offset")?.unwrap_or(0.0));
    Ok(Unit { name: node.required("name")?.to_owned(), base })
}

/// Reads the type from child elements: an array if there are dimensions, otherwise a clocked value if a clock is named,
/// otherwise the type of the type element. `None` if no type is stated; two type elements are an error.
pub(super) fn value_type(node: &Node) -> Result<Option<Type>, SspError> {
    let mut stated = None;
    for child in node.ssp_children() {
        let kind = match child.name.as_str() {
            "Real" | "Float64" | "Float32" => Type::Real(child.stated("unit")),
            "Integer" | "Int8" | "UInt8" | "Int16" | "UInt16" | "Int32" | "UInt32" | "Int64"
            | "UInt64" => Type::Integer,
            "Boolean" => Type::Boolean,
            "String" => Type::String,
            "Enumeration" => Type::Enumeration(child.required("name")?.to_owned()),
            "Binary" => Type::Binary,
            // An element `Clock` with a name is no type: it names the clock of the value.
            "Clock" if child.attribute("name").is_none() => Type::Clock,
            _ => continue,
        };
        if stated.is_some() {
            return Err(node.wrong("one type", format!("another one, {}", child.name)));
        }
        stated = Some(kind);
    }
    Ok(array(node)?.or_else(|| clocked(node)).or(stated))
}

/// Reads the dimensions; `None` if there are none or if all have the size 1.
fn array(node: &Node) -> Result<Option<Type>, SspError> {
    let dimensions = node.children_named("Dimension").map(|dimension| {
        let expected = "a size of at least 0 and below 2^64";
        let size = dimension.long("size")?.map(u64::try_from).transpose();
        let size = size.map_err(|_| dimension.wrong(expected, "another one"))?;
        Ok(match (size, dimension.text("sizeConnector")) {
            (Some(size), _) => Dimension::Size(size),
            (None, Some(connector)) => Dimension::Connector(connector),
            (None, None) => Dimension::Open,
        })
    });
    let dimensions = dimensions.collect::<Result<Vec<_>, SspError>>()?;
    let is_one = dimensions.iter().all(|dimension| *dimension == Dimension::Size(1));
    Ok((!is_one).then_some(Type::Array(dimensions)))
}

/// Reads the clock of a clocked value; `None` if no clock is named.
fn clocked(node: &Node) -> Option<Type> {
    let clock = node.children_named("Clock").find_map(|clock| clock.attribute("name"))?;
    Some(Type::Clocked(clock.to_owned()))
}

/// Reads the transformation in a child element, if there is one, and `suppressUnitConversion`.
pub(super) fn conversion(node: &Node) -> Result<Conversion, SspError> {
    let mut transformation = None;
    for child in node.ssp_children().filter(|child| child.name.ends_with("Transformation")) {
        if transformation.is_some() {
            return Err(node.wrong("one transformation", "two"));
        }
        transformation = Some(read_transformation(child)?);
    }
    let suppress_units = node.boolean("suppressUnitConversion")?.unwrap_or(false);
    Ok(Conversion { transformation, suppress_units })
}

fn read_transformation(node: &Node) -> Result<Transformation, SspError> {
    let text = |entry: &Node, name: &str| Ok(entry.text(name));
    Ok(match node.name.as_str() {
        "LinearTransformation" => Transformation::Linear {
            factor: node.number("factor")?.unwrap_or(1.0),
            offset: node.number("offset")?.unwrap_or(0.0),
        },
        "BooleanMappingTransformation" => Transformation::Boolean(entries(node, Node::boolean)?),
        "IntegerMappingTransformation" => Transformation::Integer(entries(node, Node::integer)?),
        "EnumerationMappingTransformation" => Transformation::Enumeration(entries(node, text)?),
        other => {
            let expected = "LinearTransformation or BooleanMappingTransformation, \
                 IntegerMappingTransformation or EnumerationMappingTransformation";
            return Err(node.wrong(expected, other));
        }
    })
}

/// Reads source and target of each `MapEntry`; a repeated source is an error.
fn entries<T: Clone + Eq + Hash>(
    node: &Node,
    read: impl Fn(&Node, &str) -> Result<Option<T>, SspError>,
) -> Result<Vec<(T, T)>, SspError> {
    let mut entries = Vec::new();
    let mut sources = HashSet::new();
    for entry in node.children_named("MapEntry") {
        let (source, target) = (entry.needed("source", &read)?, entry.needed("target", &read)?);
        if !sources.insert(source.clone()) {
            return Err(entry.wrong("a source that no other entry has", "a second one"));
        }
        entries.push((source, target));
    }
    Ok(entries)
}
