//! Collects warnings about content that breaks the standard but is read.

use std::cell::RefCell;

use crate::defect::Warning;
use crate::description::Version;
use crate::xml::tree::Element;

/// Maximum number of warnings; a last warning states that there are others.
const MOST: usize = 1000;

/// Collects warnings.
#[derive(Debug)]
pub(super) struct Warnings {
    /// The version of the file.
    pub(super) version: Version,
    list: RefCell<Vec<Warning>>,
}

impl Warnings {
    pub(super) fn new(version: Version) -> Self {
        Self { version, list: RefCell::new(Vec::new()) }
    }

    /// Adds a warning; after [`MOST`] warnings adds only one more, which states that there are others.
    pub(super) fn add(&self, warning: Warning) {
        let mut list = self.list.borrow_mut();
        if list.len() < MOST {
            list.push(warning);
        } else if list.len() == MOST {
            let place = "after this".to_owned();
            let actual = "more".to_owned();
            let expected = format!("at most {MOST} warnings");
            let assumed = "the others are not listed".to_owned();
            list.push(Warning { place, expected, actual, assumed, ..warning });
        }
    }

    /// Returns the warnings, sorted by their positions in the file.
    pub(super) fn finish(self) -> Vec<Warning> {
        let mut list = self.list.into_inner();
        list.sort_by_key(|warning| (warning.at.line, warning.at.column));
        list
    }
}

/// Returns the section of the standard that describes an element.
pub(super) fn section(version: Version, element: &Element<'_>) -> &'static str {
    match version {
        Version::V1 => section_1(element.name),
        Version::V2 => section_2(element.name),
        Version::V3 => section_3(element.name),
    }
}

/// FMI 1.0 for co-simulation: section 4.1 has the elements of co-simulation, section 4.2 the others.
fn section_1(element: &str) -> &'static str {
    match element {
        "Implementation"
        | "CoSimulation_StandAlone"
        | "CoSimulation_Tool"
        | "Capabilities"
        | "Model"
        | "File" => "4.1",
        _ => "4.2",
    }
}

fn section_2(element: &str) -> &'static str {
    match element {
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

fn section_3(element: &str) -> &'static str {
    match element {
        "ModelExchange" => "3.4",
        "CoSimulation" => "4.4",
        "ScheduledExecution" => "5.4",
        "UnitDefinitions" | "Unit" | "BaseUnit" | "DisplayUnit" => "2.4.3",
        "LogCategories" | "Category" => "2.4.5",
        "DefaultExperiment" => "2.4.6",
        "Dimension" => "2.4.7.2",
        "Alias" => "2.4.7.3",
        "ModelStructure"
        | "Output"
        | "ContinuousStateDerivative"
        | "ClockedState"
        | "InitialUnknown"
        | "EventIndicator" => "2.4.8",
        "fmiModelDescription" => "2.4.1",
        "TypeDefinitions" | "Item" => "2.4.4",
        other if other.ends_with("Type") => "2.4.4",
        _ => "2.4.7",
    }
}
