//! Renders a model description as XML.

mod fmi3;
mod tag;

use quick_xml::events::{BytesDecl, BytesEnd, Event};
use quick_xml::writer::Writer;

use super::{
    DefaultExperiment, IntegerType, Kind, LogCategory, ModelDescription, ModelStructure, RealType,
    ScalarVariable, SimpleType, Unknown, Version, attributes,
};
use crate::unit::{BaseUnit, Unit};
pub(crate) use tag::Tag;

/// Adds the attributes of a table of [`attributes`] to a tag, unless they are false, zero or absent.
macro_rules! write_attributes {
    (($tag:ident, $flags:ident) $($name:literal $field:ident,)*) => {
        $tag$(.unless_default($name, &$flags.$field))*
    };
}
use write_attributes;

impl ModelDescription {
    /// Renders `modelDescription.xml` in the order of the schema of its version, FMI 2.0.5 or 3.0.2. FMI 1.0 cannot
    /// be rendered: the result for such a description is not valid.
    ///
    /// The text is UTF-8 with an indentation of two blanks. Numbers have the shortest form that reads back to the
    /// same bits. Empty lists and flags that are false are absent. All text is escaped; characters that XML 1.0
    /// cannot hold (control characters) become U+FFFD.
    ///
    /// Numbers must be finite: FMI has no infinity, and an importer would not accept a text for infinity.
    /// [`ModelDescription::problems`] reports such numbers. If a description has no problems, the result is valid by
    /// `fmi2ModelDescription.xsd` or `fmi3ModelDescription.xsd`.
    ///
    /// ```
    /// use fmu_description::ModelDescription;
    /// let description = ModelDescription {
    ///     fmi_version: "2.0".to_owned(),
    ///     model_name: "A & B".to_owned(),
    ///     ..ModelDescription::default()
    /// };
    /// assert!(description.to_xml().contains("modelName=\"A &amp; B\""));
    /// ```
    #[must_use]
    pub fn to_xml(&self) -> String {
        Output::file(|output| output.root(self))
    }
}

/// An XML file that is being written.
pub(crate) struct Output {
    writer: Writer<Vec<u8>>,
}

impl Output {
    /// Returns the text of a file: the XML declaration and what `content` writes.
    pub(crate) fn file(content: impl FnOnce(&mut Self)) -> String {
        let mut output = Output { writer: Writer::new_with_indent(Vec::new(), b' ', 2) };
        output.event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)));
        content(&mut output);
        let mut bytes = output.writer.into_inner();
        bytes.push(b'\n');
        String::from_utf8_lossy(&bytes).into_owned()
    }

    fn event(&mut self, event: Event<'_>) {
        self.writer.write_event(event).expect("a vector takes all bytes");
    }

    /// Writes an element without content.
    pub(crate) fn empty(&mut self, tag: Tag<'_>) {
        self.event(Event::Empty(tag.0));
    }

    /// Writes an element with the content that `content` writes.
    pub(crate) fn around(&mut self, tag: Tag<'_>, content: impl FnOnce(&mut Self)) {
        let end = BytesEnd::new(tag.0.name().as_ref().to_owned());
        self.event(Event::Start(tag.0));
        content(self);
        self.event(Event::End(end));
    }

    /// Writes the element `name` with all `items`; nothing if there are none.
    fn list<T>(&mut self, name: &str, items: &[T], item: impl Fn(&mut Self, &T)) {
        if !items.is_empty() {
            self.around(Tag::new(name), |output| {
                for element in items {
                    item(output, element);
                }
            });
        }
    }

    fn root(&mut self, description: &ModelDescription) {
        let third = description.version() == Version::V3;
        let naming = description.structured_names.then_some("structured");
        let date = description.generation_date_and_time.as_ref();
        let indicators = description.number_of_event_indicators.as_ref().filter(|_| !third);
        let tag = Tag::new("fmiModelDescription")
            .with("fmiVersion", &description.fmi_version)
            .with("modelName", &description.model_name)
            .with(if third { "instantiationToken" } else { "guid" }, &description.guid)
            .maybe("description", description.description.as_ref())
            .maybe("author", description.author.as_ref())
            .maybe("version", description.version.as_ref())
            .maybe("copyright", description.copyright.as_ref())
            .maybe("license", description.license.as_ref())
            .maybe("generationTool", description.generation_tool.as_ref())
            .maybe("generationDateAndTime", date)
            .maybe("variableNamingConvention", naming)
            .maybe("numberOfEventIndicators", indicators);
        let simple_type = if third { Self::type_definition } else { Self::simple_type };
        self.around(tag, |output| {
            if third {
                output.interfaces_3(description);
            } else {
                output.interfaces(description);
            }
            output.list("UnitDefinitions", &description.units, Self::unit);
            output.list("TypeDefinitions", &description.types, simple_type);
            output.list("LogCategories", &description.log_categories, Self::category);
            if let Some(experiment) = &description.default_experiment {
                output.experiment(experiment);
            }
            output.around(Tag::new("ModelVariables"), |output| {
                if third {
                    output.variables_3(description);
                } else {
                    description.variables.iter().for_each(|variable| output.variable(variable));
                }
            });
            if third {
                output.structure_3(description);
            } else {
                output.structure(&description.structure);
            }
        });
    }

    fn interfaces(&mut self, description: &ModelDescription) {
        if let Some(flags) = &description.model_exchange {
            let tag = Tag::new("ModelExchange").with("modelIdentifier", &flags.model_identifier);
            let tag = attributes!(MODEL_EXCHANGE_2, write_attributes!(tag, flags));
            let tag = attributes!(COMMON_2, write_attributes!(tag, flags));
            self.interface(tag, &flags.source_files);
        }
        if let Some(flags) = &description.co_simulation {
            let tag = Tag::new("CoSimulation").with("modelIdentifier", &flags.model_identifier);
            let tag = attributes!(CO_SIMULATION_2, write_attributes!(tag, flags));
            let tag = attributes!(COMMON_2, write_attributes!(tag, flags));
            self.interface(tag, &flags.source_files);
        }
    }

    /// Writes an interface with its source files.
    fn interface(&mut self, tag: Tag<'_>, files: &[String]) {
        if files.is_empty() {
            return self.empty(tag);
        }
        self.around(tag, |output| {
            output.around(Tag::new("SourceFiles"), |output| {
                for file in files {
                    output.empty(Tag::new("File").with("name", file));
                }
            });
        });
    }

    fn unit(&mut self, unit: &Unit) {
        let tag = Tag::new("Unit").with("name", &unit.name);
        if unit.base.is_none() && unit.display_units.is_empty() {
            return self.empty(tag);
        }
        self.around(tag, |output| {
            if let Some(base) = &unit.base {
                output.base_unit(base);
            }
            for display in &unit.display_units {
                let tag = Tag::new("DisplayUnit").with("name", &display.name);
                let tag = conversion(tag, display.factor, display.offset);
                output.empty(tag.unless_default("inverse", &display.inverse));
            }
        });
    }

    fn base_unit(&mut self, base: &BaseUnit) {
        let exponents = BaseUnit::EXPONENTS.into_iter().zip(base.exponents());
        let tag = exponents.fold(Tag::new("BaseUnit"), |tag, (name, exponent)| {
            tag.unless_default(name, &exponent)
        });
        self.empty(conversion(tag, base.factor, base.offset));
    }

    fn simple_type(&mut self, declared: &SimpleType) {
        let tag = Tag::new("SimpleType")
            .with("name", &declared.name)
            .maybe("description", declared.description.as_ref());
        self.around(tag, |output| {
            let element = Tag::new(declared.kind.element());
            match &declared.kind {
                Kind::Real(real) => output.empty(real_limits(element, real, number)),
                Kind::Integer(integer) => output.empty(integer_limits(element, integer)),
                Kind::Enumeration(integer) => {
                    let element = element.maybe("quantity", integer.quantity.as_ref());
                    output.around(element, |output| {
                        for (name, value) in &declared.items {
                            output.empty(Tag::new("Item").with("name", name).with("value", value));
                        }
                    });
                }
                _ => output.empty(element),
            }
        });
    }

    fn category(&mut self, category: &LogCategory) {
        self.empty(
            Tag::new("Category")
                .with("name", &category.name)
                .maybe("description", category.description.as_ref()),
        );
    }

    fn experiment(&mut self, experiment: &DefaultExperiment) {
        self.empty(
            Tag::new("DefaultExperiment")
                .maybe("startTime", experiment.start_time.as_ref())
                .maybe("stopTime", experiment.stop_time.as_ref())
                .maybe("tolerance", experiment.tolerance.as_ref())
                .maybe("stepSize", experiment.step_size.as_ref()),
        );
    }

    fn variable(&mut self, variable: &ScalarVariable) {
        let tag = Tag::new("ScalarVariable")
            .with("name", &variable.name)
            .with("valueReference", &variable.value_reference)
            .maybe("description", variable.description.as_ref())
            .with("causality", variable.causality.as_str())
            .with("variability", variable.variability.as_str())
            .maybe("initial", variable.initial.map(super::Initial::as_str));
        self.around(tag, |output| {
            let element = Tag::new(variable.kind.element());
            output.empty(match &variable.kind {
                Kind::Real(real) => {
                    let element = element.maybe("declaredType", real.declared_type.as_ref());
                    real_limits(element, real, number)
                        .maybe("start", real.start.as_ref())
                        .maybe("derivative", real.derivative.as_ref())
                        .unless_default("reinit", &real.reinit)
                }
                Kind::Integer(integer) | Kind::Enumeration(integer) => {
                    let element = element.maybe("declaredType", integer.declared_type.as_ref());
                    integer_limits(element, integer).maybe("start", integer.start.as_ref())
                }
                Kind::Boolean(start) => element.maybe("start", start.as_ref()),
                Kind::String(start) => element.maybe("start", start.as_ref()),
                // FMI 2.0 has no other types.
                _ => element,
            });
        });
    }

    fn structure(&mut self, structure: &ModelStructure) {
        if *structure == ModelStructure::default() {
            return self.empty(Tag::new("ModelStructure"));
        }
        self.around(Tag::new("ModelStructure"), |output| {
            output.list("Outputs", &structure.outputs, Self::unknown);
            output.list("Derivatives", &structure.derivatives, Self::unknown);
            output.list("InitialUnknowns", &structure.initial_unknowns, Self::unknown);
        });
    }

    fn unknown(&mut self, unknown: &Unknown) {
        let dependencies = unknown
            .dependencies
            .as_ref()
            .map(|indices| indices.iter().map(u32::to_string).collect::<Vec<_>>().join(" "));
        self.empty(
            Tag::new("Unknown")
                .with("index", &unknown.index)
                .maybe("dependencies", dependencies.as_ref())
                .maybe("dependenciesKind", kinds(unknown).as_ref()),
        );
    }
}

/// Adds the attributes of a unit conversion, unless they are 1 and 0.
fn conversion(tag: Tag<'_>, factor: f64, offset: f64) -> Tag<'_> {
    let factor = Some(factor).filter(|factor| (factor - 1.0).abs() > 0.0);
    tag.maybe("factor", factor.as_ref()).unless_default("offset", &offset)
}

/// Returns the value of the attribute `dependenciesKind`; `None` if the row has no kinds.
fn kinds(row: &Unknown) -> Option<String> {
    let kinds = row.kinds.as_ref()?;
    Some(kinds.iter().map(|kind| kind.as_str()).collect::<Vec<_>>().join(" "))
}

/// Returns the shortest text of a number that reads back to the same bits.
fn number(value: f64) -> String {
    format!("{value:?}")
}

/// Adds quantity, units, `relativeQuantity`, limits and nominal value; `text` formats numbers.
fn real_limits<'a>(tag: Tag<'a>, real: &RealType, text: fn(f64) -> String) -> Tag<'a> {
    tag.maybe("quantity", real.quantity.as_ref())
        .maybe("unit", real.unit.as_ref())
        .maybe("displayUnit", real.display_unit.as_ref())
        .maybe("relativeQuantity", real.relative_quantity.as_ref())
        .maybe("min", real.min.map(text).as_ref())
        .maybe("max", real.max.map(text).as_ref())
        .maybe("nominal", real.nominal.map(text).as_ref())
}

/// Adds quantity and limits.
fn integer_limits<'a>(tag: Tag<'a>, integer: &IntegerType) -> Tag<'a> {
    tag.maybe("quantity", integer.quantity.as_ref())
        .maybe("min", integer.min.as_ref())
        .maybe("max", integer.max.as_ref())
}

#[cfg(test)]
mod tests;
