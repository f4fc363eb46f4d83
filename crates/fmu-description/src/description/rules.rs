//! The static rules of the standard that a readable model description can still break. This file has the
//! rules on the root element and on texts; the rules of FMI 3.0 only are in `fmi3`.

mod definitions;
mod fmi3;
mod names;
mod structure;
mod variables;

use std::collections::HashSet;
use std::fmt;

pub use names::{array_element, is_structured_name, misplaced_elements};

use super::{DefaultExperiment, ModelDescription, Version};

/// A rule that a model description breaks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Section of FMI 2.0.5, or of FMI 3.0.2, with the rule.
    pub section: &'static str,
    /// The violation, with the name of the variable or element.
    pub text: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} (section {})", self.text, self.section)
    }
}

/// The section numbers of the rules that FMI 2.0.5 and 3.0.2 have in common.
struct Sections {
    root: &'static str,
    units: &'static str,
    types: &'static str,
    categories: &'static str,
    experiment: &'static str,
    variables: &'static str,
    /// Section with the rules on limits and start values.
    limits: &'static str,
    names: &'static str,
    structure: &'static str,
}

const SECTIONS_OF_2: Sections = Sections {
    root: "2.2.1",
    units: "2.2.2",
    types: "2.2.3",
    categories: "2.2.4",
    experiment: "2.2.5",
    variables: "2.2.7",
    limits: "2.2.7",
    names: "2.2.9",
    structure: "2.2.8",
};
const SECTIONS_OF_3: Sections = Sections {
    root: "2.4.1",
    units: "2.4.3",
    types: "2.4.4",
    categories: "2.4.5",
    experiment: "2.4.6",
    variables: "2.4.7.4",
    limits: "2.4.7.5",
    names: "2.4.7.5.1",
    structure: "2.4.8",
};

/// Collects problems of a description.
struct Problems<'a> {
    description: &'a ModelDescription,
    version: Version,
    sections: &'static Sections,
    list: Vec<Problem>,
}

impl Problems<'_> {
    fn add(&mut self, section: &'static str, text: String) {
        self.list.push(Problem { section, text });
    }

    /// Adds a problem unless the rule `holds`.
    fn demand(&mut self, holds: bool, section: &'static str, text: impl FnOnce() -> String) {
        if !holds {
            self.add(section, text());
        }
    }

    /// Checks that XML allows all characters of the text.
    fn text(&mut self, section: &'static str, what: &str, value: &str) {
        self.demand(value.chars().all(crate::xml::is_character), section, || {
            format!("{what} {value:?} has characters that XML cannot hold")
        });
    }

    /// Checks that the text has one line: the `xs:normalizedString` of the schema.
    fn line(&mut self, section: &'static str, what: &str, value: &str) {
        self.text(section, what, value);
        self.demand(!value.contains(['\t', '\r', '\n']), section, || {
            format!("{what} {value:?} has a line break or a tab")
        });
    }

    /// Checks that a number is finite, if there is one.
    fn finite(&mut self, section: &'static str, what: &str, value: Option<f64>) {
        if let Some(value) = value.filter(|value| !value.is_finite()) {
            self.add(section, format!("{what} is {value:?}, and FMI has finite numbers only"));
        }
    }

    /// Checks that each of `names` occurs once.
    fn unique<'a>(
        &mut self,
        section: &'static str,
        what: &str,
        names: impl Iterator<Item = &'a str>,
    ) {
        let mut earlier = HashSet::new();
        for name in names {
            self.demand(earlier.insert(name), section, || {
                format!("{what} {name:?} is there twice")
            });
        }
    }
}

impl ModelDescription {
    /// Returns the static rules of FMI 2.0.5, or of FMI 3.0.2, that this description breaks. Empty for FMI 1.0,
    /// which this crate only reads.
    ///
    /// Covers the rules on the file itself: identifiers and flags, texts, units, types, log categories, the tables of
    /// causality, variability and initial, start values and limits, names, aliases, clocks, the lists of
    /// `ModelStructure` with their dependencies, the default experiment. The behaviour of the binary is not checked.
    ///
    /// Cost: linear in the size of the description.
    #[must_use]
    pub fn problems(&self) -> Vec<Problem> {
        let version = self.version();
        let (sections, [identity, variables, structure]): (_, [fn(&mut Problems<'_>); 3]) =
            match version {
                Version::V1 => return Vec::new(),
                Version::V2 => {
                    (&SECTIONS_OF_2, [check_identity, variables::check, structure::check])
                }
                Version::V3 => (
                    &SECTIONS_OF_3,
                    [fmi3::check_identity, fmi3::check_variables, fmi3::check_structure],
                ),
            };
        let mut problems = Problems { description: self, version, sections, list: Vec::new() };
        identity(&mut problems);
        check_texts(&mut problems);
        let categories = self.log_categories.iter().map(|category| category.name.as_str());
        problems.unique(sections.categories, "log category", categories);
        if let Some(experiment) = &self.default_experiment {
            check_experiment(experiment, &mut problems);
        }
        definitions::check(&mut problems);
        variables(&mut problems);
        names::check(&mut problems);
        structure(&mut problems);
        problems.list
    }
}

/// Checks version, GUID, date and interfaces by the rules of FMI 2.0.
fn check_identity(problems: &mut Problems<'_>) {
    let description = problems.description;
    let version = &description.fmi_version;
    problems.demand(version == "2.0", "2.2.1", || {
        format!("fmiVersion is {version:?}, it must be \"2.0\" for every 2.0.x")
    });
    problems.demand(!description.guid.is_empty(), "2.2.1", || "guid is empty".to_owned());
    check_date(problems);
    let interfaces: Vec<_> = interfaces(description)
        .filter_map(|interface| Some((interface.section?, interface)))
        .collect();
    for (section, Interface { identifier, .. }) in &interfaces {
        problems.demand(is_c_identifier(identifier), section, || {
            format!("modelIdentifier {identifier:?} is no C identifier")
        });
    }
    problems.demand(!interfaces.is_empty(), "2.2.1", || {
        "neither ModelExchange nor CoSimulation is there".to_owned()
    });
    for (section, Interface { has_state, serializes, .. }) in interfaces {
        problems.demand(has_state || !serializes, section, || {
            "canSerializeFMUstate is true without canGetAndSetFMUstate".to_owned()
        });
    }
}

/// The attributes of an interface that the rules compare.
struct Interface<'a> {
    name: &'static str,
    /// Section of FMI 2.0.5; `None` for scheduled execution, which FMI 2.0 does not have.
    section: Option<&'static str>,
    identifier: &'a str,
    /// `canGetAndSetFMUState`.
    has_state: bool,
    /// `canSerializeFMUState`.
    serializes: bool,
}

/// The interfaces of an FMU.
fn interfaces(description: &ModelDescription) -> impl Iterator<Item = Interface<'_>> {
    macro_rules! interface {
        ($field:ident, $name:literal, $section:expr) => {
            description.$field.as_ref().map(|flags| Interface {
                name: $name,
                section: $section,
                identifier: &flags.model_identifier,
                has_state: flags.can_get_and_set_fmu_state,
                serializes: flags.can_serialize_fmu_state,
            })
        };
    }
    let interfaces = [
        interface!(model_exchange, "ModelExchange", Some("3.3.1")),
        interface!(co_simulation, "CoSimulation", Some("4.3.1")),
        interface!(scheduled_execution, "ScheduledExecution", None),
    ];
    interfaces.into_iter().flatten()
}

fn check_date(problems: &mut Problems<'_>) {
    if let Some(date) = &problems.description.generation_date_and_time {
        problems.demand(is_date_and_time(date), problems.sections.root, || {
            format!("generationDateAndTime is {date:?}, not of the form YYYY-MM-DDThh:mm:ssZ")
        });
    }
}

/// Checks the texts of the root element and of the log categories.
fn check_texts(problems: &mut Problems<'_>) {
    let description = problems.description;
    let Sections { root, categories, .. } = problems.sections;
    problems.text(root, "modelName", &description.model_name);
    let token = if problems.version == Version::V3 { "instantiationToken" } else { "guid" };
    problems.line(root, token, &description.guid);
    for (name, value) in [
        ("description", &description.description),
        ("author", &description.author),
        ("copyright", &description.copyright),
        ("license", &description.license),
    ] {
        problems.text(root, name, value.as_deref().unwrap_or_default());
    }
    for (name, value) in
        [("version", &description.version), ("generationTool", &description.generation_tool)]
    {
        problems.line(root, name, value.as_deref().unwrap_or_default());
    }
    for category in &description.log_categories {
        problems.line(categories, "log category", &category.name);
        let text = category.description.as_deref().unwrap_or_default();
        problems.text(categories, "description of a log category", text);
    }
}

fn check_experiment(experiment: &DefaultExperiment, problems: &mut Problems<'_>) {
    let DefaultExperiment { start_time, stop_time, tolerance, step_size } = *experiment;
    let section = problems.sections.experiment;
    for (name, value) in [
        ("startTime", start_time),
        ("stopTime", stop_time),
        ("tolerance", tolerance),
        ("stepSize", step_size),
    ] {
        problems.finite(section, name, value);
    }
    for (name, value) in [("tolerance", tolerance), ("stepSize", step_size)] {
        if let Some(value) = value {
            problems.demand(value > 0.0, section, || format!("{name} is {value:?}, not positive"));
        }
    }
    let (Some(start), Some(stop)) = (start_time, stop_time) else { return };
    problems.demand(stop > start, section, || {
        format!("stopTime {stop:?} is not after startTime {start:?}")
    });
    if let Some(step) = step_size.filter(|_| problems.version == Version::V2) {
        problems.demand(step < stop - start, section, || {
            format!("stepSize {step:?} is not shorter than the experiment")
        });
    }
}

fn is_c_identifier(text: &str) -> bool {
    let starts = text.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_');
    starts && text.chars().all(|other| other.is_ascii_alphanumeric() || other == '_')
}

/// Whether the text is `YYYY-MM-DDThh:mm:ssZ` with every number in its range.
fn is_date_and_time(text: &str) -> bool {
    let shape = "0000-00-00T00:00:00Z";
    let fits = text.len() == shape.len()
        && text.bytes().zip(shape.bytes()).all(|(character, pattern)| match pattern {
            b'0' => character.is_ascii_digit(),
            _ => character == pattern,
        });
    let inside = |from: usize, low: u32, high: u32| {
        let number = text.get(from..from + 2).and_then(|digits| digits.parse().ok());
        number.is_some_and(|number: u32| (low..=high).contains(&number))
    };
    fits && inside(5, 1, 12)
        && inside(8, 1, 31)
        && inside(11, 0, 23)
        && inside(14, 0, 59)
        && inside(17, 0, 59)
}

#[cfg(test)]
mod tests;
