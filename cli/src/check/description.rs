//! `modelDescription.xml`: what was read with a warning, and the rules on what was read.

use fmi2::description::{ModelDescription, Warning};

use super::finding::Severity::{Error, Note};
use super::finding::{Finding, Findings, Part};

const FILE: &str = "modelDescription.xml";

/// Who stumbles over a broken rule, by the words that the rule begins or ends with.
const WHO: [(&str, &str); 9] = [
    (
        "InitialUnknowns",
        "FMPy's validation and the FMU checker report it; few importers use the list.",
    ),
    ("Outputs", "Importers that order FMUs by their dependencies go wrong."),
    ("which is not defined", "FMPy's validation refuses it."),
    ("needs a start value", "FMPy's validation refuses it; FMI Library assumes zero."),
    (
        "generationDateAndTime",
        "FMPy's schema refuses some of these dates; others show what is there.",
    ),
    ("no C identifier", "FMI Library (libcosim, PyFMI) refuses it."),
    ("cannot be", "FMPy refuses combinations that are not in the table."),
    ("dependenciesKind is not as long", "FMI Library (libcosim, PyFMI) refuses it."),
    ("is there twice", "Which one is meant, importers decide differently."),
];

pub(super) fn check(description: &ModelDescription, warnings: &[Warning]) -> Vec<Finding> {
    let mut findings = Findings::about(Part::Description);
    for warning in warnings {
        let place = format!("{FILE}, {}: {}", warning.at, warning.place);
        let what = format!("expected {}, found {}", warning.expected, warning.found);
        let why = if warning.by_schema {
            "FMPy refuses what the schema does not allow, unless its validation is switched off."
        } else if warning.section == "2.2.8" {
            "FMI Library (libcosim, PyFMI) refuses a ModelStructure with such an error."
        } else {
            ""
        };
        let why =
            format!("{why}{}Here {}.", if why.is_empty() { "" } else { " " }, warning.assumed);
        findings.add(Error, place, what, (&why, warning.section));
    }
    for problem in description.problems() {
        let who = WHO.iter().find(|(words, _)| problem.text.contains(words));
        findings.add(Error, FILE, problem.text, (who.map_or("", |(_, why)| why), problem.section));
    }
    notes(description, &mut findings);
    findings.all
}

/// What the standard leaves open and users stumble over.
fn notes(description: &ModelDescription, findings: &mut Findings) {
    let experiment = description.default_experiment.unwrap_or_default();
    if experiment.stop_time.is_none() || experiment.step_size.is_none() {
        let what = "no stopTime and stepSize in DefaultExperiment";
        let why =
            "FMPy, OMSimulator and fmusim take them where the user states none; others guess.";
        findings.add(Note, FILE, what, (why, "2.2.5"));
    }
    let unnamed = description.variables.iter().filter(|own| own.description.is_none()).count();
    if unnamed > 0 {
        let what =
            format!("{unnamed} of {} variables without description", description.variables.len());
        findings.add(Note, FILE, what, ("Importers show it to the user.", "2.2.7"));
    }
    let simulation = description.co_simulation.as_ref();
    if simulation.is_some_and(|own| own.needs_execution_tool) {
        let what = "needsExecutionTool is true";
        findings.add(Note, FILE, what, ("It runs only beside the tool that made it.", "4.3.1"));
    }
    if simulation.is_some_and(|own| own.can_be_instantiated_only_once_per_process) {
        let what = "canBeInstantiatedOnlyOncePerProcess is true";
        findings.add(Note, FILE, what, ("Two of it need two processes.", "4.3.1"));
    }
}
