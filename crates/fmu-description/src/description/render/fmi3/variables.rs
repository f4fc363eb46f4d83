//! Renders `ModelVariables`: variables, arrays with their start values, aliases.

use super::{attributes_of, reference, references, single};
use crate::description::render::Output;
use crate::description::render::tag::Tag;
use crate::description::{
    Dimension, Elements, Initial, Kind, ModelDescription, ScalarVariable, Version,
};
use crate::hex::to_hex;

impl Output {
    /// Writes each variable that is no alias, with its aliases inside, which are the variables with its name in
    /// `alias_of`, at any position. An alias of an unknown variable or of another alias is not written.
    pub(in crate::description::render) fn variables_3(&mut self, description: &ModelDescription) {
        let mut aliases = std::collections::HashMap::<&str, Vec<&ScalarVariable>>::new();
        for alias in &description.variables {
            if let Some(of) = &alias.alias_of {
                aliases.entry(of).or_default().push(alias);
            }
        }
        for variable in description.variables.iter().filter(|variable| variable.alias_of.is_none())
        {
            let aliases_of_variable =
                aliases.get(variable.name.as_str()).map_or(&[][..], Vec::as_slice);
            self.variable_3(variable, aliases_of_variable, description);
        }
    }

    fn variable_3(
        &mut self,
        variable: &ScalarVariable,
        aliases: &[&ScalarVariable],
        description: &ModelDescription,
    ) {
        let tag = tag(variable, description);
        let starts = start_elements(variable);
        if variable.dimensions.is_empty() && starts.is_empty() && aliases.is_empty() {
            return self.empty(tag);
        }
        self.around(tag, |output| {
            for dimension in &variable.dimensions {
                let tag = Tag::new("Dimension");
                output.empty(match dimension {
                    Dimension::Fixed(extent) => tag.with("start", extent),
                    Dimension::Variable(reference) => tag.with("valueReference", reference),
                });
            }
            for start in &starts {
                output.empty(Tag::new("Start").with("value", start));
            }
            for variable_alias in aliases {
                output.empty(alias(variable_alias, variable));
            }
        });
    }
}

fn tag<'a>(variable: &'a ScalarVariable, description: &ModelDescription) -> Tag<'a> {
    let kind = &variable.kind;
    let clocks =
        Some(references(description, &variable.clocks)).filter(|references| !references.is_empty());
    let previous = variable.previous.map(|index| reference(description, index));
    let multiple_set = variable.can_handle_multiple_set_per_time_instant.as_ref();
    let tag = Tag::new(kind.element_in(Version::V3))
        .with("name", &variable.name)
        .with("valueReference", &variable.value_reference)
        .maybe("description", variable.description.as_ref())
        .with("causality", variable.causality.as_str())
        .with("variability", variable.variability.as_str())
        .maybe("canHandleMultipleSetPerTimeInstant", multiple_set)
        .maybe("clocks", clocks.as_ref())
        .unless_default("intermediateUpdate", &variable.intermediate_update)
        .maybe("previous", previous.as_ref())
        .maybe("declaredType", kind.declared_type())
        .maybe("initial", variable.initial.map(Initial::as_str));
    let tag = attributes_of(tag, kind).maybe("start", start_list(variable).as_ref());
    let Some(real) = kind.as_real() else { return tag };
    let derivative = real.derivative.map(|index| reference(description, index));
    tag.maybe("derivative", derivative.as_ref()).unless_default("reinit", &real.reinit)
}

/// Returns the tag of an alias: its name, and its description and display unit if they differ from `variable`.
fn alias<'a>(alias: &'a ScalarVariable, variable: &ScalarVariable) -> Tag<'a> {
    let description = alias.description.as_ref();
    let display_unit = alias.kind.as_real().and_then(|real| real.display_unit.as_ref());
    let unit = variable.kind.as_real().and_then(|real| real.display_unit.as_ref());
    Tag::new("Alias")
        .with("name", &alias.name)
        .maybe("description", description.filter(|_| alias.description != variable.description))
        .maybe("displayUnit", display_unit.filter(|display| Some(*display) != unit))
}

/// Returns the attribute `start`: one value, or a list; `None` for types with elements `Start`.
fn start_list(variable: &ScalarVariable) -> Option<String> {
    let number = |value: f64| match &variable.kind {
        _ if value.is_nan() => "NaN".to_owned(),
        _ if value.is_infinite() => if value > 0.0 { "INF" } else { "-INF" }.to_owned(),
        Kind::Float32(_) => single(value),
        _ => format!("{value:?}"),
    };
    match &variable.start_elements {
        Some(Elements::Real(values)) => return Some(join(values, |value| number(*value))),
        Some(Elements::Integer(values)) => return Some(join(values, i128::to_string)),
        Some(Elements::Boolean(values)) => return Some(join(values, bool::to_string)),
        _ => {}
    }
    match &variable.kind {
        Kind::Boolean(start) => start.map(|start| start.to_string()),
        kind => match (kind.as_real(), kind.as_integer()) {
            (Some(real), _) => real.start.map(number),
            (_, integer) => integer?.start.map(|start| start.to_string()),
        },
    }
}

fn join<T>(values: &[T], text: impl Fn(&T) -> String) -> String {
    values.iter().map(text).collect::<Vec<_>>().join(" ")
}

/// Returns the values of the elements `Start` of a String or Binary; empty for other types.
fn start_elements(variable: &ScalarVariable) -> Vec<String> {
    let digits = |bytes: &Vec<u8>| to_hex(bytes);
    match (&variable.start_elements, &variable.kind) {
        (Some(Elements::String(texts)), _) => texts.clone(),
        (Some(Elements::Binary(binaries)), _) => binaries.iter().map(digits).collect(),
        (_, Kind::String(start)) => start.iter().cloned().collect(),
        (_, Kind::Binary(binary)) => binary.start.iter().map(digits).collect(),
        _ => Vec::new(),
    }
}
