//! `TypeDefinitions` and `ModelVariables`.

use std::collections::{HashMap, HashSet};

use super::ParseError;
use super::xml::Element;
use crate::description::{
    Causality, IntegerType, Kind, RealType, ScalarVariable, SimpleType, Variability,
};

const KINDS: [&str; 5] = ["Real", "Integer", "Boolean", "String", "Enumeration"];

/// The types of `TypeDefinitions`, by name.
type Types<'a> = HashMap<&'a str, &'a SimpleType>;

pub(super) fn types(root: &Element) -> Result<Vec<SimpleType>, ParseError> {
    root.list("TypeDefinitions", "SimpleType", |element| {
        let typed = typed(element)?;
        Ok(SimpleType {
            name: element.required("name")?.to_owned(),
            description: element.text("description"),
            kind: match typed.name.as_str() {
                "Real" => Kind::Real(real_limits(typed, &RealType::default())?),
                "Integer" => Kind::Integer(integer_limits(typed, &IntegerType::default())?),
                "Boolean" => Kind::Boolean(None),
                "String" => Kind::String(None),
                _ => Kind::Enumeration(integer_limits(typed, &IntegerType::default())?),
            },
            items: typed.children_named("Item").map(item).collect::<Result<_, _>>()?,
        })
    })
}

fn item(element: &Element) -> Result<(String, i32), ParseError> {
    let value = element.required("value").and_then(|_| element.integer("value"))?;
    Ok((element.required("name")?.to_owned(), value.unwrap_or_default()))
}

pub(super) fn variables(
    list: &Element,
    types: &[SimpleType],
) -> Result<Vec<ScalarVariable>, ParseError> {
    let types: Types<'_> = types.iter().map(|own| (own.name.as_str(), own)).collect();
    let elements: Vec<&Element> = list.children_named("ScalarVariable").collect();
    let mut names = HashSet::new();
    let mut variables = Vec::with_capacity(elements.len());
    for element in &elements {
        let variable = variable(element, &types, elements.len())?;
        if !names.insert(element.required("name")?) {
            return Err(element.wrong("name", "a name that is used once", &variable.name));
        }
        variables.push(variable);
    }
    Ok(variables)
}

fn variable(
    element: &Element,
    types: &Types<'_>,
    count: usize,
) -> Result<ScalarVariable, ParseError> {
    element.required("valueReference")?;
    let causality = element
        .word("causality", "parameter, calculatedParameter, input, output, local or independent")?;
    let variability =
        element.word("variability", "constant, fixed, tunable, discrete or continuous")?;
    Ok(ScalarVariable {
        name: element.required("name")?.to_owned(),
        value_reference: element.unsigned("valueReference")?.unwrap_or_default(),
        description: element.text("description"),
        causality: causality.unwrap_or(Causality::Local),
        variability: variability.unwrap_or(Variability::Continuous),
        initial: element.word("initial", "exact, approx or calculated")?,
        kind: kind(typed(element)?, types, count)?,
    })
}

/// The one child that says which type a variable or a type definition has.
fn typed(element: &Element) -> Result<&Element, ParseError> {
    let is_kind = |child: &&Element| KINDS.contains(&child.name.as_str());
    let mut found = element.children.iter().filter(is_kind);
    match (found.next(), found.next()) {
        (Some(only), None) => Ok(only),
        (first, _) => {
            let found = if first.is_some() { "more" } else { "none" };
            let expected = "one of Real, Integer, Boolean, String and Enumeration";
            Err(element.misses(expected, found.to_owned()))
        }
    }
}

fn kind(element: &Element, types: &Types<'_>, count: usize) -> Result<Kind, ParseError> {
    let declared = declared(element, types)?;
    Ok(match (element.name.as_str(), declared) {
        ("Real", declared) => {
            let defaults = match declared {
                Some(Kind::Real(real)) => real.clone(),
                _ => RealType::default(),
            };
            let derivative = element.attribute("derivative");
            Kind::Real(RealType {
                declared_type: element.text("declaredType"),
                start: element.number("start")?,
                derivative: derivative
                    .map(|text| element.index("derivative", text, count))
                    .transpose()?,
                reinit: element.boolean("reinit")?.unwrap_or(false),
                ..real_limits(element, &defaults)?
            })
        }
        ("Boolean", _) => Kind::Boolean(element.boolean("start")?),
        ("String", _) => Kind::String(element.text("start")),
        (name, declared) => {
            let defaults = match declared {
                Some(Kind::Integer(own) | Kind::Enumeration(own)) => own.clone(),
                _ => IntegerType::default(),
            };
            let own = IntegerType {
                declared_type: element.text("declaredType"),
                start: element.integer("start")?,
                ..integer_limits(element, &defaults)?
            };
            if name == "Integer" { Kind::Integer(own) } else { Kind::Enumeration(own) }
        }
    })
}

/// The declared type of a variable: it must exist and be of the variable's own kind.
fn declared<'a>(element: &Element, types: &Types<'a>) -> Result<Option<&'a Kind>, ParseError> {
    let name = if element.name == "Enumeration" {
        element.required("declaredType")?
    } else {
        let Some(name) = element.attribute("declaredType") else {
            return Ok(None);
        };
        name
    };
    match types.get(name) {
        Some(own) if own.kind.element() == element.name => Ok(Some(&own.kind)),
        _ => {
            let expected = format!("the name of a SimpleType that is {}", element.name);
            Err(element.wrong("declaredType", &expected, name))
        }
    }
}

fn real_limits(element: &Element, defaults: &RealType) -> Result<RealType, ParseError> {
    Ok(RealType {
        quantity: element.text("quantity").or(defaults.quantity.clone()),
        unit: element.text("unit").or(defaults.unit.clone()),
        display_unit: element.text("displayUnit").or(defaults.display_unit.clone()),
        min: element.number("min")?.or(defaults.min),
        max: element.number("max")?.or(defaults.max),
        nominal: element.number("nominal")?.or(defaults.nominal),
        ..RealType::default()
    })
}

fn integer_limits(element: &Element, defaults: &IntegerType) -> Result<IntegerType, ParseError> {
    Ok(IntegerType {
        quantity: element.text("quantity").or(defaults.quantity.clone()),
        min: element.integer("min")?.or(defaults.min),
        max: element.integer("max")?.or(defaults.max),
        ..IntegerType::default()
    })
}
