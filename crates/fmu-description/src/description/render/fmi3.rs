//! Renders a model description in the schema of FMI 3.0.2.

mod variables;

use super::tag::Tag;
use super::{Output, integer_limits, kinds, number, real_limits, write_attributes};
use crate::description::{Kind, ModelDescription, SimpleType, Unknown, Version, attributes};

/// Returns the tag of an interface with the attributes that all three interfaces have.
macro_rules! interface {
    ($name:literal, $flags:ident) => {{
        let tag = Tag::new($name).with("modelIdentifier", &$flags.model_identifier);
        attributes!(COMMON_3, write_attributes!(tag, $flags))
    }};
}

impl Output {
    pub(super) fn interfaces_3(&mut self, description: &ModelDescription) {
        if let Some(flags) = &description.model_exchange {
            let tag = interface!("ModelExchange", flags);
            self.empty(attributes!(MODEL_EXCHANGE_3, write_attributes!(tag, flags)));
        }
        if let Some(flags) = &description.co_simulation {
            let tag = interface!("CoSimulation", flags);
            self.empty(attributes!(CO_SIMULATION_3, write_attributes!(tag, flags)));
        }
        if let Some(flags) = &description.scheduled_execution {
            self.empty(interface!("ScheduledExecution", flags));
        }
    }

    pub(super) fn type_definition(&mut self, declared: &SimpleType) {
        let element = format!("{}Type", declared.kind.element_in(Version::V3));
        let tag = Tag::new(&element)
            .with("name", &declared.name)
            .maybe("description", declared.description.as_ref());
        let tag = attributes_of(tag, &declared.kind);
        if declared.items.is_empty() {
            return self.empty(tag);
        }
        self.around(tag, |output| {
            for (name, value) in &declared.items {
                output.empty(Tag::new("Item").with("name", name).with("value", value));
            }
        });
    }

    pub(super) fn structure_3(&mut self, description: &ModelDescription) {
        let structure = &description.structure;
        let rows = [
            ("Output", &structure.outputs),
            ("ContinuousStateDerivative", &structure.derivatives),
            ("ClockedState", &structure.clocked_states),
            ("InitialUnknown", &structure.initial_unknowns),
            ("EventIndicator", &structure.event_indicators),
        ];
        if rows.iter().all(|(_, rows)| rows.is_empty()) {
            return self.empty(Tag::new("ModelStructure"));
        }
        self.around(Tag::new("ModelStructure"), |output| {
            for (name, rows) in rows {
                for row in rows {
                    output.empty(unknown(name, row, description));
                }
            }
        });
    }
}

/// Returns the value reference of the variable with a 1-based index; 0 if there is no such variable.
fn reference(description: &ModelDescription, index: u32) -> u32 {
    description.at(index).map(|variable| variable.value_reference).unwrap_or_default()
}

/// Returns the value references of variables with 1-based indices, separated by blanks.
fn references(description: &ModelDescription, indices: &[u32]) -> String {
    let words = indices.iter().map(|index| reference(description, *index).to_string());
    words.collect::<Vec<_>>().join(" ")
}

fn unknown<'a>(name: &'a str, row: &Unknown, description: &ModelDescription) -> Tag<'a> {
    let dependencies = row.dependencies.as_ref().map(|indices| references(description, indices));
    Tag::new(name)
        .with("valueReference", &reference(description, row.index))
        .maybe("dependencies", dependencies.as_ref())
        .maybe("dependenciesKind", kinds(row).as_ref())
}

/// Adds the attributes that a type and a variable have in common.
fn attributes_of<'a>(tag: Tag<'a>, kind: &Kind) -> Tag<'a> {
    match kind {
        Kind::Real(real) => real_limits(tag, real, number),
        Kind::Float32(real) => real_limits(tag, real, single),
        Kind::Boolean(_) | Kind::String(_) => tag,
        Kind::Binary(binary) => tag
            .maybe("mimeType", binary.mime_type.as_ref())
            .maybe("maxSize", binary.max_size.as_ref()),
        Kind::Clock(clock) => tag
            .unless_default("canBeDeactivated", &clock.can_be_deactivated)
            .maybe("priority", clock.priority.as_ref())
            .with("intervalVariability", clock.interval_variability.as_str())
            .maybe("intervalDecimal", clock.interval_decimal.as_ref())
            .maybe("shiftDecimal", clock.shift_decimal.as_ref())
            .unless_default("supportsFraction", &clock.supports_fraction)
            .maybe("resolution", clock.resolution.as_ref())
            .maybe("intervalCounter", clock.interval_counter.as_ref())
            .maybe("shiftCounter", clock.shift_counter.as_ref()),
        other => match other.as_integer() {
            Some(integer) => integer_limits(tag, integer),
            None => tag,
        },
    }
}

/// Returns the shortest text of a Float32 that reads back to the same bits.
#[expect(clippy::cast_possible_truncation, reason = "the numbers of a Float32 are those of an f32")]
fn single(value: f64) -> String {
    format!("{:?}", value as f32)
}
