//! Writes the plain data of [`super::structure`] as XML. Equal data give equal bytes.

mod tag;

use fmu_description::unit::BaseUnit;

use super::structure::{
    Component, Connection, Connector, ConnectorKind, Conversion, DefaultExperiment, Definitions,
    DictionarySource, Dimension, Element, ElementBase, End, Implementation, MappingEntry,
    Parameter, ParameterBinding, ParameterMapping, ParameterSet, ParameterValue, SignalDictionary,
    Source, System, SystemStructure, Transformation, Type,
};
use tag::Tag;

/// Returns the text of an SSD file.
#[must_use]
pub fn render_ssd(structure: &SystemStructure) -> String {
    let mut root = Tag::root("ssd:SystemStructureDescription")
        .with("name", &structure.name)
        .maybe("generationTool", structure.generation_tool.as_deref())
        .add(system(&structure.system));
    root = definitions(root, "ssd", &structure.definitions);
    root.maybe_add(structure.experiment.as_ref().map(experiment)).versioned().render()
}

/// Returns the text of an SSV file.
#[must_use]
pub fn render_ssv(set: &ParameterSet) -> String {
    parameter_set(Tag::root("ssv:ParameterSet"), set).render()
}

/// Returns the text of an SSM file.
#[must_use]
pub fn render_ssm(mapping: &ParameterMapping) -> String {
    parameter_mapping(Tag::root("ssm:ParameterMapping"), mapping).render()
}

/// Returns the text of an SSB file.
#[must_use]
pub fn render_ssb(dictionary: &SignalDictionary) -> String {
    signal_dictionary(Tag::root("ssb:SignalDictionary"), dictionary).render()
}

fn system(system: &System) -> Tag {
    let elements = system.elements.iter().map(|element| match element {
        Element::System(inner) => self::system(inner),
        Element::Component(component) => self::component(component),
        Element::Dictionary(reference) => {
            let tag = Tag::new("ssd:SignalDictionaryReference");
            base(tag, &reference.base).with("dictionary", &reference.dictionary)
        }
    });
    base(Tag::new("ssd:System"), &system.base)
        .list("ssd:Elements", elements)
        .list("ssd:Connections", system.connections.iter().map(connection))
        .list("ssd:SignalDictionaries", system.dictionaries.iter().map(dictionary))
}

fn base(tag: Tag, base: &ElementBase) -> Tag {
    tag.maybe("id", base.id.as_deref())
        .with("name", &base.name)
        .list("ssd:Connectors", base.connectors.iter().map(connector))
        .list("ssd:ParameterBindings", base.bindings.iter().map(binding))
}

fn component(component: &Component) -> Tag {
    let implementation =
        Some(component.implementation).filter(|stated| *stated != Implementation::Any);
    let source = Some(component.source.as_str()).filter(|source| !source.is_empty());
    let newer = source.is_none() || implementation == Some(Implementation::ScheduledExecution);
    let hint =
        component.step_size.map(|size| Tag::new("osp:StepSizeHint").with("value", number(size)));
    base(Tag::new("ssd:Component"), &component.base)
        .with("type", component.content.as_str())
        .maybe("source", source)
        .maybe("implementation", implementation.map(Implementation::as_str))
        .newer(newer)
        .maybe_add(hint.map(annotation))
}

fn annotation(content: Tag) -> Tag {
    let annotation = Tag::new("ssc:Annotation").with("type", "com.opensimulationplatform");
    Tag::new("ssd:Annotations").add(annotation.add(content))
}

fn connector(connector: &Connector) -> Tag {
    use ConnectorKind::{CalculatedParameter, Inout, Input, Output, Parameter};
    let kind = connector.kind;
    let is_old = matches!(kind, Input | Output | Parameter | CalculatedParameter | Inout);
    let tag = Tag::new("ssd:Connector")
        .with("name", &connector.name)
        .with("kind", kind.as_str())
        .newer(!is_old);
    match &connector.kind_of_value {
        Some(kind) => of_type(tag, kind),
        None => tag,
    }
}

/// Adds the elements that state the type; of an array, only the dimensions.
fn of_type(tag: Tag, kind: &Type) -> Tag {
    let element = match kind {
        Type::Real(unit) => Tag::new("ssc:Real").maybe("unit", unit.as_deref()),
        Type::Integer => Tag::new("ssc:Integer"),
        Type::Boolean => Tag::new("ssc:Boolean"),
        Type::String => Tag::new("ssc:String"),
        Type::Enumeration(name) => Tag::new("ssc:Enumeration").with("name", name),
        Type::Binary => Tag::new("ssc:Binary"),
        Type::Clock => Tag::new("ssc:Clock").newer(true),
        Type::Clocked(clock) => Tag::new("ssd:Clock").with("name", clock).newer(true),
        Type::Array(sizes) => {
            return sizes.iter().fold(tag, |tag, size| {
                let dimension = Tag::new("ssc:Dimension").newer(true);
                tag.add(match size {
                    Dimension::Size(size) => dimension.with("size", size.to_string()),
                    Dimension::Connector(name) => dimension.with("sizeConnector", name),
                    Dimension::Open => dimension,
                })
            });
        }
    };
    tag.add(element)
}

fn connection(connection: &Connection) -> Tag {
    let end = |tag: Tag, element, connector, end: &End| {
        tag.maybe(element, end.element.as_deref()).with(connector, &end.connector)
    };
    let tag = Tag::new("ssd:Connection");
    let tag = end(tag, "startElement", "startConnector", &connection.start);
    let tag = end(tag, "endElement", "endConnector", &connection.end);
    conversion(tag, &connection.conversion)
}

fn conversion(tag: Tag, conversion: &Conversion) -> Tag {
    let suppress = conversion.suppress_units.then_some("true");
    tag.maybe("suppressUnitConversion", suppress)
        .maybe_add(conversion.transformation.as_ref().map(transformation))
}

/// Writes both attributes of a linear transformation, because Ecos reads a missing factor as zero.
fn transformation(transformation: &Transformation) -> Tag {
    fn entries<T: ToString>(kind: &str, pairs: &[(T, T)]) -> Tag {
        let tag = Tag::new(&format!("ssc:{kind}MappingTransformation"));
        pairs.iter().fold(tag, |tag, (source, target)| {
            let entry = Tag::new("ssc:MapEntry").with("source", source.to_string());
            tag.add(entry.with("target", target.to_string()))
        })
    }
    match transformation {
        Transformation::Linear { factor, offset } => Tag::new("ssc:LinearTransformation")
            .with("factor", number(*factor))
            .with("offset", number(*offset)),
        Transformation::Boolean(pairs) => entries("Boolean", pairs),
        Transformation::Integer(pairs) => entries("Integer", pairs),
        Transformation::Enumeration(pairs) => entries("Enumeration", pairs),
    }
}

fn binding(binding: &ParameterBinding) -> Tag {
    let prefix = Some(binding.prefix.as_str()).filter(|prefix| !prefix.is_empty());
    let tag = Tag::new("ssd:ParameterBinding").maybe("prefix", prefix);
    let tag = match &binding.values {
        Source::Inline(set) => {
            let inline = parameter_set(Tag::new("ssv:ParameterSet"), set);
            tag.add(Tag::new("ssd:ParameterValues").add(inline))
        }
        Source::File { uri, in_component } => file(tag, uri, *in_component),
    };
    tag.maybe_add(binding.mapping.as_ref().map(|mapping| {
        let tag = Tag::new("ssd:ParameterMapping");
        match mapping {
            Source::Inline(mapping) => {
                tag.add(parameter_mapping(Tag::new("ssm:ParameterMapping"), mapping))
            }
            Source::File { uri, in_component } => file(tag, uri, *in_component),
        }
    }))
}

fn file(tag: Tag, uri: &str, in_component: bool) -> Tag {
    tag.with("source", uri).maybe("sourceBase", in_component.then_some("component"))
}

fn dictionary(dictionary: &DictionarySource) -> Tag {
    let tag = Tag::new("ssd:SignalDictionary").with("name", &dictionary.name);
    match &dictionary.content {
        Source::Inline(content) => {
            tag.add(signal_dictionary(Tag::new("ssb:SignalDictionary"), content))
        }
        Source::File { uri, .. } => tag.with("source", uri),
    }
}

fn signal_dictionary(tag: Tag, dictionary: &SignalDictionary) -> Tag {
    let tag = dictionary.entries.iter().fold(tag, |tag, (name, kind)| {
        tag.add(of_type(Tag::new("ssb:DictionaryEntry").with("name", name), kind))
    });
    definitions(tag, "ssb", &dictionary.definitions).versioned()
}

fn parameter_set(tag: Tag, set: &ParameterSet) -> Tag {
    let parameters = set.parameters.iter().map(parameter);
    let list = parameters.fold(Tag::new("ssv:Parameters"), Tag::add);
    let tag = tag.with("name", &set.name).add(list);
    definitions(tag, "ssv", &set.definitions).versioned()
}

fn parameter(parameter: &Parameter) -> Tag {
    let of_kind = |kind: &str, value: &str| Tag::new(kind).with("value", value);
    let value = match &parameter.value {
        ParameterValue::Real(value, unit) => {
            of_kind("ssv:Real", &number(*value)).maybe("unit", unit.as_deref())
        }
        ParameterValue::Integer(value) => of_kind("ssv:Integer", &value.to_string()),
        ParameterValue::Boolean(value) => of_kind("ssv:Boolean", &value.to_string()),
        ParameterValue::String(text) => of_kind("ssv:String", text),
        ParameterValue::Enumeration(item, name) => {
            of_kind("ssv:Enumeration", item).maybe("name", name.as_deref())
        }
        ParameterValue::Binary(digits) => of_kind("ssv:Binary", digits),
        ParameterValue::Long(value) => {
            let kind = if i64::try_from(*value).is_ok() { "ssv:Int64" } else { "ssv:UInt64" };
            of_kind(kind, &value.to_string()).newer(true)
        }
        ParameterValue::Array(kind, values) => array(kind, values),
    };
    Tag::new("ssv:Parameter").with("name", &parameter.name).add(value)
}

/// Writes numbers in one attribute, texts in separate elements.
fn array(kind: &str, values: &[String]) -> Tag {
    let tag = Tag::new(&format!("ssv:{kind}")).newer(true);
    if matches!(kind, "String" | "Enumeration" | "Binary") {
        let values = values.iter().map(|value| Tag::new("ssv:Value").with("value", value));
        return values.fold(tag, Tag::add);
    }
    tag.with("value", values.join(" "))
}

fn parameter_mapping(tag: Tag, mapping: &ParameterMapping) -> Tag {
    let entries = mapping.entries.iter().fold(tag, |tag, entry: &MappingEntry| {
        let row = Tag::new("ssm:MappingEntry")
            .with("source", &entry.source)
            .with("target", &entry.target);
        tag.add(conversion(row, &entry.conversion))
    });
    entries.versioned()
}

/// Writes `Enumerations` and `Units` in the namespace of the file, and the content of both in the common namespace.
fn definitions(tag: Tag, space: &str, definitions: &Definitions) -> Tag {
    let enumerations = definitions.enumerations.iter().map(|enumeration| {
        let items = enumeration.items.iter().map(|(name, value)| {
            Tag::new("ssc:Item").with("name", name).with("value", value.to_string())
        });
        items.fold(Tag::new("ssc:Enumeration").with("name", &enumeration.name), Tag::add)
    });
    let units = definitions.units.iter().map(|unit| {
        let base = &unit.base;
        let exponents = BaseUnit::EXPONENTS.into_iter().zip(base.exponents());
        let stated = exponents.filter(|(_, exponent)| *exponent != 0);
        let tag = stated.fold(Tag::new("ssc:BaseUnit"), |tag, (name, exponent)| {
            tag.with(name, exponent.to_string())
        });
        let factor = Some(number(base.factor)).filter(|factor| factor != "1.0");
        let offset = (base.offset != 0.0).then(|| number(base.offset));
        let tag = tag.maybe("factor", factor.as_deref()).maybe("offset", offset.as_deref());
        Tag::new("ssc:Unit").with("name", &unit.name).add(tag)
    });
    tag.list(&format!("{space}:Enumerations"), enumerations).list(&format!("{space}:Units"), units)
}

/// Writes the times as attributes, and the step size as the annotation that libcosim reads.
fn experiment(experiment: &DefaultExperiment) -> Tag {
    let time = |time: Option<f64>| time.map(number);
    let step = experiment.step_size.map(|size| {
        let fixed = Tag::new("osp:FixedStepAlgorithm").with("baseStepSize", number(size));
        annotation(Tag::new("osp:Algorithm").add(fixed))
    });
    Tag::new("ssd:DefaultExperiment")
        .maybe("startTime", time(experiment.start_time).as_deref())
        .maybe("stopTime", time(experiment.stop_time).as_deref())
        .maybe_add(step)
}

/// Returns the shortest text that parses to the same number.
fn number(value: f64) -> String {
    format!("{value:?}")
}
