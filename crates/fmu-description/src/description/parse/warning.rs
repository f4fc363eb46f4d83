//! What was wrong and could still be read.

use std::cell::RefCell;
use std::fmt;

use super::Position;
use super::xml::Element;

/// Most warnings that are kept; one more says that there were others.
const KEPT: usize = 1000;

/// Something that breaks the standard and leaves no doubt, or does no harm, in a simulation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// Where the element begins.
    pub at: Position,
    /// What it is about: an element, or one of its attributes.
    pub place: String,
    /// What the standard wants.
    pub expected: String,
    /// What the file has.
    pub found: String,
    /// What the reader made of it.
    pub assumed: String,
    /// Section of FMI 2.0.5.
    pub section: &'static str,
    /// Whether validation against the schema of the standard finds it too.
    pub by_schema: bool,
}

impl fmt::Display for Warning {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Warning { at, place, expected, found, assumed, section, .. } = self;
        write!(
            formatter,
            "{at}: {place}: expected {expected}, found {found}; {assumed} (section {section})"
        )
    }
}

/// The warnings so far.
#[derive(Debug, Default)]
pub(super) struct Warnings {
    kept: RefCell<Vec<Warning>>,
}

impl Warnings {
    pub(super) fn add(&self, warning: Warning) {
        let mut kept = self.kept.borrow_mut();
        if kept.len() < KEPT {
            kept.push(warning);
        } else if kept.len() == KEPT {
            let place = "after this".to_owned();
            let found = "more".to_owned();
            let expected = format!("at most {KEPT} warnings");
            let assumed = "the others are not listed".to_owned();
            kept.push(Warning { place, expected, found, assumed, ..warning });
        }
    }

    /// All of them, by their place in the file.
    pub(super) fn finish(self) -> Vec<Warning> {
        let mut kept = self.kept.into_inner();
        kept.sort_by_key(|warning| (warning.at.line, warning.at.column));
        kept
    }
}

/// Section of FMI 2.0.5 that describes an element.
pub(super) fn section(element: &Element<'_>) -> &'static str {
    match element.name {
        "ModelExchange" => "3.3.1",
        "CoSimulation" | "SourceFiles" | "File" => "4.3.1",
        "UnitDefinitions" | "Unit" | "BaseUnit" | "DisplayUnit" => "2.2.2",
        "TypeDefinitions" | "SimpleType" | "Item" => "2.2.3",
        "LogCategories" | "Category" => "2.2.4",
        "DefaultExperiment" => "2.2.5",
        "VendorAnnotations" | "Annotations" | "Tool" => "2.2.6",
        "ModelVariables" | "ScalarVariable" | "Real" | "Integer" | "Boolean" | "String"
        | "Enumeration" => "2.2.7",
        "ModelStructure" | "Outputs" | "Derivatives" | "InitialUnknowns" | "Unknown" => "2.2.8",
        _ => "2.2.1",
    }
}
