//! `documentation/index.html` of an FMU: the page for users of the model.

use std::borrow::Cow;

use crate::description::{
    CoSimulation, DefaultExperiment, Dimension, Elements, IntegerType, Kind, ModelDescription,
    ModelExchange, ScalarVariable, SimpleType, Unknown, Version, attributes,
};
use crate::hex::to_hex;

const STYLE: &str = ":root { color-scheme: light dark; --text: #222; --page: #fff; --rule: #ccc; --band: #f2f2f2; } \
@media (prefers-color-scheme: dark) { :root { --text: #ddd; --page: #16181c; --rule: #555; --band: #26292f; } } \
body { font: 16px/1.5 sans-serif; max-width: 72rem; margin: 2rem auto; \
padding: 0 1rem; color: var(--text); background: var(--page); } h1, h2 { line-height: 1.2; } \
h1, p, li { overflow-wrap: anywhere; } table { border-collapse: collapse; margin: 1rem 0; } \
table, pre { display: block; overflow-x: auto; } \
th, td { border: 1px solid var(--rule); padding: .2rem .6rem; text-align: left; vertical-align: top; } \
th { background: var(--band); } code { font-family: monospace; white-space: pre-wrap; } \
pre code { white-space: pre; } img, svg { max-width: 100%; } @media print { table, pre { display: revert; } }";

/// Name of the file in `documentation/` with the author's part of the page.
pub const FRAGMENT: &str = "model.html";

/// Renders the page of a model: its description, version, author, copyright, tool and time of generation, and GUID,
/// `model_html` with the author's equations and text, the variables, the log categories, the default experiment, the
/// capabilities in co-simulation and model exchange, and the licence. A section without content is absent.
///
/// The page is one self-contained file without scripts, well-formed as HTML and as XML if `model_html`
/// is. Texts of `description` are escaped; the author's fragment `model_html` is inserted unchanged.
///
/// ```
/// use fmu_description::{ModelDescription, documentation};
/// let description = ModelDescription { model_name: "a < b".to_owned(), ..Default::default() };
/// let page = documentation::page(&description, "<p>x\u{2032} = <i>u</i></p>");
/// assert!(page.contains("<h1>a &lt; b</h1>") && page.contains("<i>u</i>"));
/// ```
#[must_use]
pub fn page(description: &ModelDescription, model_html: &str) -> String {
    let title = escaped(&description.model_name);
    let experiment = description.default_experiment.as_ref().map(experiment);
    let third = description.version() == Version::V3;
    let simulation = description.co_simulation.as_ref();
    let simulation =
        simulation.map(|flags| if third { co_simulation_3(flags) } else { co_simulation(flags) });
    let exchange = description.model_exchange.as_ref().map(|flags| {
        if third {
            model_exchange_3(flags, description)
        } else {
            model_exchange(flags, description)
        }
    });
    let sections = [
        format!("<h1>{title}</h1>\n"),
        paragraph(description.description.as_deref()),
        facts(description),
        section("Model", model_html),
        section("Variables", &variables(description)),
        section("Log categories", &log_categories(description)),
        section("Default experiment", &experiment.unwrap_or_default()),
        section("Co-simulation interface", &simulation.unwrap_or_default()),
        section("Model-exchange interface", &exchange.unwrap_or_default()),
        section("Licence", &paragraph(description.license.as_deref())),
    ];
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
         <title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n{}</body>\n</html>\n",
        sections.concat()
    )
}

fn escaped(text: &str) -> Cow<'_, str> {
    quick_xml::escape::escape(text)
}

/// Renders a section with a heading; empty if the content is only white space.
fn section(heading: &str, content: &str) -> String {
    if content.trim().is_empty() {
        return String::new();
    }
    format!("<h2>{heading}</h2>\n{content}\n")
}

/// Renders text as a paragraph with its line breaks; empty if the text is absent or only white space.
fn paragraph(text: Option<&str>) -> String {
    let text = text.filter(|text| !text.trim().is_empty());
    text.map(|text| format!("<p>{}</p>\n", escaped(text).replace('\n', "<br/>\n")))
        .unwrap_or_default()
}

/// Renders a table, with a header row unless `header` is empty; nothing if there are no `rows`. Cells are HTML.
fn table(header: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    let row = |cells: Vec<String>| format!("<tr>{}</tr>\n", cells.concat());
    let body: String = rows
        .map(|cells| row(cells.iter().map(|cell| format!("<td>{cell}</td>")).collect()))
        .collect();
    if body.is_empty() {
        return body;
    }
    let names: Vec<String> = header.iter().map(|name| format!("<th>{name}</th>")).collect();
    let head = if names.is_empty() { String::new() } else { row(names) };
    format!("<table>\n{head}{body}</table>\n")
}

/// Renders the table of version, author, copyright, generation and GUID, without absent values.
fn facts(description: &ModelDescription) -> String {
    let token = if description.version() == Version::V3 { "Instantiation token" } else { "GUID" };
    let facts = [
        ("Version", description.version.as_deref()),
        ("Author", description.author.as_deref()),
        ("Copyright", description.copyright.as_deref()),
        ("Made by", description.generation_tool.as_deref()),
        ("Made at", description.generation_date_and_time.as_deref()),
        (token, Some(description.guid.as_str()).filter(|guid| !guid.is_empty())),
    ];
    let row = |(name, value): (&str, Option<&str>)| {
        Some(vec![name.to_owned(), escaped(value?).into_owned()])
    };
    table(&[], facts.into_iter().filter_map(row))
}

fn variables(description: &ModelDescription) -> String {
    let header =
        ["Name", "Causality", "Variability", "Type", "Unit", "Start", "Min", "Max", "Description"];
    let row = |variable: &ScalarVariable| {
        let (unit, [start, min, max]) = texts(&variable.kind, &description.types);
        let start = variable.start_elements.as_ref().map_or(start, list);
        vec![
            code(&variable.name),
            variable.causality.as_str().to_owned(),
            variable.variability.as_str().to_owned(),
            type_name(variable, description.version()),
            escaped(&unit).into_owned(),
            code(&start),
            code(&min),
            code(&max),
            escaped(variable.description.as_deref().unwrap_or_default()).into_owned(),
        ]
    };
    table(&header, description.variables.iter().map(row))
}

fn code(text: &str) -> String {
    if text.is_empty() { String::new() } else { format!("<code>{}</code>", escaped(text)) }
}

/// Returns the name of the type as HTML, with the dimensions of an array: extents, or the value references of
/// the variables that determine them.
fn type_name(variable: &ScalarVariable, version: Version) -> String {
    let name = match &variable.kind {
        Kind::Enumeration(integer) => {
            let name = integer.declared_type.as_deref().unwrap_or_default();
            format!("Enumeration {}", escaped(name))
        }
        other => other.element_in(version).to_owned(),
    };
    let extents = variable.dimensions.iter().map(|dimension| match dimension {
        Dimension::Fixed(extent) => extent.to_string(),
        Dimension::Variable(reference) => format!("value of {reference}"),
    });
    let extents: Vec<String> = extents.collect();
    if extents.is_empty() { name } else { format!("{name} [{}]", extents.join(", ")) }
}

/// Returns the first 20 start values of an array as text, for a Binary their lengths.
fn list(elements: &Elements) -> String {
    const SHOWN: usize = 20;
    fn first<T>(values: &[T], text: fn(&T) -> String) -> Vec<String> {
        values.iter().take(SHOWN).map(text).collect()
    }
    let texts = match elements {
        Elements::Real(values) => first(values, |value| format!("{value:?}")),
        Elements::Integer(values) => first(values, i128::to_string),
        Elements::Boolean(values) => first(values, bool::to_string),
        Elements::String(values) => first(values, |value| format!("{value:?}")),
        Elements::Binary(values) => first(values, |value| format!("{} bytes", value.len())),
    };
    let more = if elements.len() > SHOWN { ", ..." } else { "" };
    format!("{}{more}", texts.join(", "))
}

/// Returns the unit, and start, min and max, as texts; an absent value is an empty text.
///
/// `types` are the types of the description, with the names of the items of enumerations. The start of a Clock is its
/// interval in s.
#[must_use]
pub fn texts(kind: &Kind, types: &[SimpleType]) -> (String, [String; 3]) {
    let none = String::new;
    let only = |start: Option<String>| [start.unwrap_or_default(), none(), none()];
    match kind {
        Kind::Real(real) | Kind::Float32(real) => {
            let number = |value: Option<f64>| value.map_or_else(none, |value| format!("{value:?}"));
            let unit = real.unit.clone().unwrap_or_default();
            (unit, [number(real.start), number(real.min), number(real.max)])
        }
        Kind::Enumeration(integer) => {
            let declared =
                types.iter().find(|other| Some(&other.name) == integer.declared_type.as_ref());
            let items = declared.map_or(&[][..], |declared| &declared.items);
            let item = |value: Option<i128>| {
                let Some(value) = value else { return none() };
                let item =
                    items.iter().find(|(_, value_of_item)| i128::from(*value_of_item) == value);
                item.map_or_else(|| value.to_string(), |(name, _)| format!("{value} ({name})"))
            };
            (none(), [item(integer.start), item(integer.min), item(integer.max)])
        }
        Kind::Boolean(start) => (none(), only(start.map(|start| start.to_string()))),
        Kind::String(start) => (none(), only(start.as_ref().map(|start| format!("\"{start}\"")))),
        Kind::Binary(binary) => (none(), only(binary.start.as_deref().map(to_hex))),
        Kind::Clock(clock) => {
            let interval = clock.interval_decimal.map(|value| format!("{value:?}"));
            ("s".to_owned(), only(interval))
        }
        other => {
            let number = |value: Option<i128>| value.map_or_else(none, |value| value.to_string());
            let numbers = |integer: &IntegerType| [integer.start, integer.min, integer.max];
            (none(), other.as_integer().map_or([None; 3], numbers).map(number))
        }
    }
}

fn log_categories(description: &ModelDescription) -> String {
    let rows = description.log_categories.iter().map(|category| {
        let text = category.description.as_deref().unwrap_or_default();
        vec![code(&category.name), escaped(text).into_owned()]
    });
    table(&["Category", "Messages"], rows)
}

fn experiment(default_experiment: &DefaultExperiment) -> String {
    let rows = [
        ("Start time in s", default_experiment.start_time),
        ("Stop time in s", default_experiment.stop_time),
        ("Relative tolerance", default_experiment.tolerance),
        ("Step size in s", default_experiment.step_size),
    ];
    let row = |(name, value): (&str, Option<f64>)| {
        Some(vec![name.to_owned(), code(&format!("{:?}", value?))])
    };
    table(&[], rows.into_iter().filter_map(row))
}

/// Returns the text of a flag or a number.
fn shown(value: &impl ToString) -> String {
    match value.to_string().as_str() {
        "true" => "yes".to_owned(),
        "false" => "no".to_owned(),
        number => number.to_owned(),
    }
}

/// Renders the attributes of an interface, pairs of name and value, as one table.
fn interface(parts: &[&[(&str, String)]]) -> String {
    let row = |(name, value): &(&str, String)| vec![code(name), escaped(value).into_owned()];
    table(&[], parts.iter().copied().flatten().map(row))
}

/// Expands a table of [`attributes`] to pairs of name and value as text.
macro_rules! show_attributes {
    (($flags:ident) $($name:literal $field:ident,)*) => {
        &[$(($name, shown(&$flags.$field)),)*][..]
    };
}

/// The flags that model exchange and co-simulation in FMI 3.0 have in common, shown last.
macro_rules! common_3 {
    ($flags:ident) => {
        show_attributes! { ($flags)
            "canBeInstantiatedOnlyOncePerProcess" can_be_instantiated_only_once_per_process,
            "canGetAndSetFMUState" can_get_and_set_fmu_state,
            "canSerializeFMUState" can_serialize_fmu_state,
            "providesDirectionalDerivatives" provides_directional_derivative,
            "providesAdjointDerivatives" provides_adjoint_derivatives,
            "providesPerElementDependencies" provides_per_element_dependencies,
            "providesEvaluateDiscreteStates" provides_evaluate_discrete_states,
        }
    };
}

fn co_simulation(flags: &CoSimulation) -> String {
    interface(&[
        &[("modelIdentifier", flags.model_identifier.clone())],
        attributes!(CO_SIMULATION_2, show_attributes!(flags)),
        attributes!(COMMON_2, show_attributes!(flags)),
    ])
}

fn model_exchange(flags: &ModelExchange, description: &ModelDescription) -> String {
    let indicators = description.number_of_event_indicators.unwrap_or_default();
    interface(&[
        &[
            ("modelIdentifier", flags.model_identifier.clone()),
            ("continuous states", description.structure.derivatives.len().to_string()),
            ("numberOfEventIndicators", indicators.to_string()),
        ],
        attributes!(MODEL_EXCHANGE_2, show_attributes!(flags)),
        attributes!(COMMON_2, show_attributes!(flags)),
    ])
}

fn co_simulation_3(flags: &CoSimulation) -> String {
    let step = flags.fixed_internal_step_size.map(|step| format!("{step:?} s"));
    interface(&[
        &[("modelIdentifier", flags.model_identifier.clone())],
        show_attributes! { (flags)
            "needsExecutionTool" needs_execution_tool,
            "canHandleVariableCommunicationStepSize" can_handle_variable_communication_step_size,
        },
        &[("fixedInternalStepSize", step.unwrap_or_else(|| "none".to_owned()))],
        show_attributes! { (flags)
            "maxOutputDerivativeOrder" max_output_derivative_order,
            "hasEventMode" has_event_mode,
            "mightReturnEarlyFromDoStep" might_return_early_from_do_step,
            "canReturnEarlyAfterIntermediateUpdate" can_return_early_after_intermediate_update,
            "providesIntermediateUpdate" provides_intermediate_update,
        },
        common_3!(flags),
    ])
}

fn model_exchange_3(flags: &ModelExchange, description: &ModelDescription) -> String {
    let size = |rows: &[Unknown]| {
        let variables = rows.iter().filter_map(|row| description.at(row.index));
        let sizes = variables.map(|variable| variable.size(description));
        sizes.fold(0, usize::saturating_add).to_string()
    };
    interface(&[
        &[
            ("modelIdentifier", flags.model_identifier.clone()),
            ("continuous states", size(&description.structure.derivatives)),
            ("event indicators", size(&description.structure.event_indicators)),
        ],
        show_attributes! { (flags)
            "needsExecutionTool" needs_execution_tool,
            "needsCompletedIntegratorStep" needs_completed_integrator_step,
        },
        common_3!(flags),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::description::sample;
    use quick_xml::events::Event;
    use quick_xml::reader::Reader;

    /// Returns the texts of a page, element by element, read by an XML parser.
    fn texts(page: &str) -> Vec<String> {
        let mut reader = Reader::from_str(page);
        let (mut texts, mut depth) = (vec![String::new()], 0);
        loop {
            match reader.read_event().unwrap() {
                Event::Start(_) => {
                    depth += 1;
                    texts.push(String::new());
                }
                Event::End(_) => {
                    depth -= 1;
                    texts.push(String::new());
                }
                Event::Text(text) => texts.last_mut().unwrap().push_str(&text.xml10_content()),
                Event::GeneralRef(reference) => {
                    let escaped = format!("&{};", reference.xml10_content());
                    let text = quick_xml::escape::unescape(&escaped).unwrap().into_owned();
                    texts.last_mut().unwrap().push_str(&text);
                }
                Event::Eof => break,
                _ => {}
            }
        }
        assert_eq!(depth, 0, "every element is closed");
        texts
    }

    #[test]
    fn the_page_shows_everything_about_every_variable() {
        let description = sample::complete();
        let page = page(&description, "<p id=\"own\">x' = u</p>");
        let texts = texts(&page);
        let shows = |text: &str| texts.iter().any(|shown| shown == text);
        for variable in &description.variables {
            assert!(shows(&variable.name), "{}", variable.name);
        }
        for text in [
            "Sample.<Model> & \"quotes\"",
            "MIT",
            "A. Author",
            "a state",
            "rad",
            "calculatedParameter",
            "tunable",
            "0.25",
            "-3.5",
            "-1 (off)",
            "\"two\nlines <&> \"'\r\t\"",
            "canInterpolateInputs",
            "completedIntegratorStepNotNeeded",
            "sample_me",
            "yes",
            "logStatusError",
            "1e-9",
            "100.0",
        ] {
            assert!(shows(text), "{text:?}");
        }
        assert!(page.contains("<p id=\"own\">x' = u</p>"));
    }

    #[test]
    fn the_page_of_fmi_3_shows_arrays_and_its_own_capabilities() {
        let page = page(&sample::complete_3(), "");
        let texts = texts(&page);
        for text in [
            "Instantiation token",
            "Float64 [value of 1, 2]",
            "0.30000000000000004, -1e-5, 5e-324, 1.7976931348623157e308",
            "UInt64",
            "Int32 [2]",
            "canReturnEarlyAfterIntermediateUpdate",
            "providesAdjointDerivatives",
            "needsCompletedIntegratorStep",
            "00ff1a",
        ] {
            assert!(texts.iter().any(|shown| shown == text), "{text:?}");
        }
        // Two states in an array.
        assert!(page.contains("<td><code>continuous states</code></td><td>2</td>"), "{page}");
    }

    #[test]
    fn text_cannot_become_markup() {
        let evil = "</title><script>alert('x')</script>";
        let mut description = sample::complete();
        description.model_name = evil.into();
        description.license = Some(evil.into());
        description.guid = evil.into();
        description.variables[0].name = evil.into();
        description.variables[1].description = Some(evil.into());
        description.log_categories[0].name = evil.into();
        let page = page(&description, "");
        assert!(!page.contains("<script"), "{page}");
        assert!(texts(&page).iter().filter(|text| *text == evil).count() >= 6);
    }

    #[test]
    fn an_empty_description_gives_a_page_without_empty_sections() {
        let page = page(&ModelDescription::default(), "");
        assert!(!page.contains("<h2>") && !page.contains("<table>"), "{page}");
    }
}
