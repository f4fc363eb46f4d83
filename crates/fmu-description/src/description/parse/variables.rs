//! Reads `TypeDefinitions` and `ModelVariables` of FMI 2.0; some functions are also for FMI 1.0 and 3.0.

use std::collections::HashMap;

use super::attributes::{Node, Result};
use super::structure::{index, indices};
use crate::defect::ParseError;
use crate::description::{
    Causality, Initial, IntegerType, Kind, RealType, ScalarVariable, SimpleType, Variability,
    Version,
};
use crate::limits::{HELP, exceeds};

const KINDS: [&str; 5] = ["Real", "Integer", "Boolean", "String", "Enumeration"];
/// Maximum number of variables.
pub(super) const VARIABLES: usize = 1_000_000;

/// The types of `TypeDefinitions`, by name.
pub(super) type Types<'a> = HashMap<&'a str, &'a SimpleType>;

pub(super) fn types(root: Node<'_>) -> Result<Vec<SimpleType>> {
    root.list("TypeDefinitions", "SimpleType", |element| {
        let typed = typed(element)?;
        if let Some(other) = typed.attribute("declaredType") {
            // Types that refer to types could form a circle.
            return Err(typed.wrong("declaredType", "no reference to another type", other));
        }
        Ok(SimpleType {
            name: element.required("name")?.to_owned(),
            description: element.text("description"),
            kind: kind_of_type(typed, typed.element.name)?,
            items: typed.children_named("Item").map(item).collect::<Result<_, _>>()?,
        })
    })
}

/// Reads the kind of a type definition of FMI 1.0 or 2.0; a `name` that is no type is read as `Real`.
pub(super) fn kind_of_type(element: Node<'_>, name: &str) -> Result<Kind> {
    Ok(match name {
        "Integer" => Kind::Integer(integer_limits(element, None)?),
        "Boolean" => Kind::Boolean(None),
        "String" => Kind::String(None),
        "Enumeration" => Kind::Enumeration(integer_limits(element, None)?),
        _ => Kind::Real(real_limits(element, None)?),
    })
}

fn item(element: Node<'_>) -> Result<(String, i64)> {
    let text = element.required("value")?;
    let value = element.integer("value")?;
    let value = value.ok_or_else(|| element.wrong("value", "an integer", text))?;
    Ok((element.required("name")?.to_owned(), value.into()))
}

pub(super) fn variables(list: Node<'_>, types: &[SimpleType]) -> Result<Vec<ScalarVariable>> {
    let (elements, variables) = scalar_variables(list, types, variable)?;
    check_names(&elements, &variables)?;
    check_references(&elements, &variables)?;
    Ok(variables)
}

/// Returns the types by name; of several with one name the last.
pub(super) fn by_name(types: &[SimpleType]) -> Types<'_> {
    types.iter().map(|declared| (declared.name.as_str(), declared)).collect()
}

/// Reads each `ScalarVariable` by `variable`, whose arguments are the element, the types and the number of variables.
/// Returns the elements and the variables in the same order.
pub(super) fn scalar_variables<'a>(
    list: Node<'a>,
    types: &[SimpleType],
    variable: fn(Node<'_>, &Types<'_>, usize) -> Result<ScalarVariable>,
) -> Result<(Vec<Node<'a>>, Vec<ScalarVariable>)> {
    let elements: Vec<Node<'a>> = list.children_named("ScalarVariable").collect();
    if exceeds(elements.len(), VARIABLES) {
        let at = list.element.at;
        return Err(ParseError::Limit { at, what: "variables", limit: VARIABLES, help: HELP });
    }
    let types = by_name(types);
    let variables = elements.iter().map(|element| variable(*element, &types, elements.len()));
    let variables = variables.collect::<Result<_, _>>()?;
    Ok((elements, variables))
}

/// Refuses a name that two variables have. Only warns if both are local, or have one base type and value reference,
/// because then either variable may be meant.
pub(super) fn check_names(elements: &[Node<'_>], variables: &[ScalarVariable]) -> Result<()> {
    let mut names: HashMap<&str, &ScalarVariable> = HashMap::with_capacity(variables.len());
    for (element, variable) in elements.iter().zip(variables) {
        let Some(first) = names.get(variable.name.as_str()) else {
            names.insert(&variable.name, variable);
            continue;
        };
        let expected = "a name that is used once";
        let local =
            [first, &variable].iter().all(|variable| variable.causality == Causality::Local);
        if !local
            && (first.kind.base(), first.value_reference)
                != (variable.kind.base(), variable.value_reference)
        {
            return Err(element.wrong("name", expected, &variable.name));
        }
        element.warn_text("name", expected, &variable.name, "the name stands for the first one");
    }
    Ok(())
}

/// Refuses two inputs or parameters of one base type with the same value reference, except aliases.
pub(super) fn check_references(elements: &[Node<'_>], variables: &[ScalarVariable]) -> Result<()> {
    let mut settable: HashMap<(&str, u32), &str> = HashMap::new();
    for (element, variable) in elements.iter().zip(variables) {
        let set_from_outside =
            matches!(variable.causality, Causality::Input | Causality::Parameter);
        if !set_from_outside || variable.alias_of.is_some() {
            continue;
        }
        let key = (variable.kind.base(), variable.value_reference);
        if let Some(first) = settable.insert(key, &variable.name) {
            let expected =
                format!("one that no other input or parameter of this type has, {first} has it");
            let actual = variable.value_reference.to_string();
            return Err(element.wrong("valueReference", &expected, &actual));
        }
    }
    Ok(())
}

fn variable(element: Node<'_>, types: &Types<'_>, count: usize) -> Result<ScalarVariable> {
    let name = element.required("name")?.to_owned();
    let value_reference = element.unsigned("valueReference")?;
    // The last word, structuralParameter, belongs to FMI 3.0.
    let causalities = &Causality::WORDS[..6];
    let causality = element.word("causality", causalities).unwrap_or(Causality::Local);
    let kind = kind(typed(element)?, types, count)?;
    Ok(ScalarVariable {
        name,
        value_reference,
        description: element.text("description"),
        causality,
        variability: variability(element, causality, &kind),
        initial: element.word("initial", Initial::WORDS),
        kind,
        ..ScalarVariable::default()
    })
}

/// Reads `variability`, continuous by default. For types that cannot be continuous, warns and reads continuous as
/// fixed for parameters and as discrete for other variables.
fn variability(element: Node<'_>, causality: Causality, kind: &Kind) -> Variability {
    let stated = element.word("variability", Variability::WORDS);
    let variability = stated.unwrap_or(Variability::Continuous);
    if matches!(kind, Kind::Real(_)) || variability != Variability::Continuous {
        return variability;
    }
    let (assumed, name) = match causality {
        Causality::Parameter | Causality::CalculatedParameter => (Variability::Fixed, "fixed"),
        _ => (Variability::Discrete, "discrete"),
    };
    let expected = format!("another one than continuous, the default, for {}", kind.element());
    let assumed_as = format!("read as {name}");
    let stated = element.attribute("variability");
    let actual = stated.map_or_else(|| "no such attribute".to_owned(), |text| format!("{text:?}"));
    element.warn_of(false, element.place("variability"), &expected, actual, &assumed_as);
    assumed
}

/// Returns the only child that names the type of a variable or a type definition; none or two are an error.
pub(super) fn typed(element: Node<'_>) -> Result<Node<'_>> {
    let is_kind = |child: &&crate::xml::tree::Element<'_>| KINDS.contains(&child.name);
    let mut kinds = element.element.children.iter().filter(is_kind);
    match (kinds.next(), kinds.next()) {
        (Some(only), None) => Ok(Node { element: only, ..element }),
        (first, _) => {
            let actual = if first.is_some() { "more" } else { "none" };
            let expected = "one of Real, Integer, Boolean, String and Enumeration";
            Err(element.child_error(expected, actual.to_owned()))
        }
    }
}

/// Reads the type of a variable with its own attributes and the attributes of its declared type.
pub(super) fn kind(element: Node<'_>, types: &Types<'_>, count: usize) -> Result<Kind> {
    let (declared_type, defaults) = declared(element, types).unzip();
    Ok(match element.element.name {
        "Real" => Kind::Real(RealType {
            declared_type,
            start: element.number("start")?,
            derivative: derivative(element, count)?,
            reinit: element.flag("reinit"),
            ..real_limits(element, defaults.and_then(Kind::as_real))?
        }),
        "Boolean" => Kind::Boolean(element.boolean("start")?),
        "String" => Kind::String(element.text("start")),
        other => {
            let integer_type = IntegerType {
                declared_type,
                start: element.integer("start")?.map(i128::from),
                ..integer_limits(element, defaults.and_then(Kind::as_integer))?
            };
            if other == "Integer" {
                Kind::Integer(integer_type)
            } else {
                Kind::Enumeration(integer_type)
            }
        }
    })
}

fn derivative(element: Node<'_>, count: usize) -> Result<Option<u32>> {
    let Some(text) = element.attribute("derivative") else { return Ok(None) };
    let index = index(text, count);
    index.map(Some).ok_or_else(|| element.wrong("derivative", &indices(count), text))
}

/// Returns the name and the kind of the declared type; `None` if no type is declared or, with a warning, if this type
/// does not exist or differs in kind from the variable. Also warns of an Enumeration without a type.
pub(super) fn declared<'a>(element: Node<'_>, types: &Types<'a>) -> Option<(String, &'a Kind)> {
    const NAME: &str = "declaredType";
    let (kind, version) = (element.element.name, element.warnings.version);
    let Some(name) = element.attribute(NAME) else {
        if kind == "Enumeration" {
            let assumed = "read without names of its items";
            element.warn_missing(NAME, "the name of an enumeration", assumed);
        }
        return None;
    };
    match types.get(name) {
        Some(declared_type) if declared_type.kind.element_in(version) == kind => {
            Some((name.to_owned(), &declared_type.kind))
        }
        _ => {
            let expected = match version {
                Version::V3 => format!("the name of a {kind}Type"),
                _ => format!("the name of a SimpleType that is {kind}"),
            };
            element.warn_text(NAME, &expected, name, "read without declared type");
            None
        }
    }
}

fn real_limits(element: Node<'_>, defaults: Option<&RealType>) -> Result<RealType> {
    let defaults = defaults.cloned().unwrap_or_default();
    Ok(RealType {
        quantity: element.text("quantity").or(defaults.quantity),
        unit: element.text("unit").or(defaults.unit),
        display_unit: element.text("displayUnit").or(defaults.display_unit),
        min: element.number("min")?.or(defaults.min),
        max: element.number("max")?.or(defaults.max),
        nominal: element.number("nominal")?.or(defaults.nominal),
        relative_quantity: element.optional_flag("relativeQuantity").or(defaults.relative_quantity),
        ..RealType::default()
    })
}

fn integer_limits(element: Node<'_>, defaults: Option<&IntegerType>) -> Result<IntegerType> {
    let defaults = defaults.cloned().unwrap_or_default();
    Ok(IntegerType {
        quantity: element.text("quantity").or(defaults.quantity),
        min: element.integer("min")?.map(i128::from).or(defaults.min),
        max: element.integer("max")?.map(i128::from).or(defaults.max),
        ..IntegerType::default()
    })
}
