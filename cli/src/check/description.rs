//! Checks of `modelDescription.xml` and of the terminals: warnings of the parser, and rules of the standard.

use fmu_description::{ModelDescription, Version, Warning, terminals};

use super::finding::Severity::Note;
use super::finding::{Finding, Findings, Part, Severity, Tool};

const FILE: &str = "modelDescription.xml";

/// A rule of the standard: the effect of breaking it on importers, and the tools that refuse the FMU then.
struct Rule {
    /// Words in the text of a problem by which the rule is recognised; the first rule that fits counts.
    words: &'static str,
    why: &'static str,
    stops: &'static [Tool],
}

const fn rule(words: &'static str, why: &'static str, stops: &'static [Tool]) -> Rule {
    Rule { words, why, stops }
}

const RULES: [Rule; 23] = {
    use Tool::{FmiLibrary, Fmpy, FmpyValidation};
    let dates = "FMPy's schema refuses some of these dates; others show what is there.";
    let validation = "fmpy.validation.validate_fmu reports it; few importers use the list.";
    let refused = "FMPy's validation refuses it.";
    let in_variables = "FMPy's validation refuses it in a variable.";
    let by_both = "FMI Library refuses it; FMPy's validation does so in a variable.";
    let zero = "FMPy's validation refuses it; FMI Library assumes zero.";
    let unstated = "Importers that order FMUs by their dependencies may go wrong.";
    let combinations = "FMPy refuses combinations that are not in the table.";
    let order = "Importers that order FMUs by their dependencies go wrong.";
    [
        rule("must be \"2.0\"", "FMPy reads 2.0 only.", &[Fmpy]),
        rule("generationDateAndTime", dates, &[]),
        rule("no C identifier", "Tools that build from the sources make C names of it.", &[]),
        rule("which is not defined", refused, &[FmpyValidation]),
        rule("which its unit does not list", in_variables, &[FmpyValidation]),
        rule("which no unit lists", by_both, &[FmpyValidation, FmiLibrary]),
        rule(", and no unit", in_variables, &[FmpyValidation]),
        rule("needs a start value", zero, &[FmpyValidation]),
        rule("has a start value, which", refused, &[FmpyValidation]),
        // FMPy treats `exact` as the default.
        rule("initial exact is not allowed for discrete input", "", &[]),
        rule("initial exact is not allowed for continuous input", "", &[]),
        rule("is not allowed for", refused, &[FmpyValidation]),
        rule("cannot be stated", unstated, &[]),
        rule("cannot be", combinations, &[FmpyValidation]),
        // FMI 3.0.
        rule("only for a float", "", &[]),
        rule("dependenciesKind", "FMI Library refuses some of these lists.", &[]),
        rule("InitialUnknown", validation, &[]),
        rule("Outputs", order, &[]),
        rule("Output lacks", order, &[]),
        rule("Output has", order, &[]),
        rule("are independent", refused, &[FmpyValidation]),
        rule("have the value reference", refused, &[FmpyValidation]),
        rule("is there twice", "Which one is meant, importers decide differently.", &[]),
    ]
};

/// Returns the tools that a warning of the parser stops, and the reason; both are empty for other warnings.
fn stops(warning: &Warning) -> (&'static [Tool], &'static str) {
    if warning.place.contains("fmiVersion") && warning.expected.starts_with("2.0") {
        return (&[Tool::Fmpy], "FMPy reads 2.0 only.");
    }
    if warning.by_schema {
        let why =
            "FMPy refuses what the schema does not allow, unless its validation is switched off.";
        return (&[Tool::FmpyValidation], why);
    }
    if warning.expected.contains("than continuous") {
        return (&[Tool::FmpyValidation], "FMPy's validation refuses it.");
    }
    (&[], "")
}

pub(super) fn check(description: &ModelDescription, warnings: &[Warning]) -> Vec<Finding> {
    let mut findings = Findings::about(Part::Description);
    for warning in warnings {
        let place = format!("{FILE}, {}: {}", warning.at, warning.place);
        let what = format!("expected {}, found {}", warning.expected, warning.actual);
        let (tools, why) = stops(warning);
        let why =
            format!("{why}{}Here {}.", if why.is_empty() { "" } else { " " }, warning.assumed);
        findings.add(Severity::Error, place, what, &why, warning.section);
        findings.stopping(tools);
    }
    for problem in description.problems() {
        let rule = RULES.iter().find(|rule| problem.text.contains(rule.words));
        // FMPy does not read the display units of types.
        let of_type = problem.text.starts_with("type ") && problem.text.contains("display unit");
        let stops = rule.map_or(&[][..], |rule| rule.stops).iter().copied();
        let stops: Vec<_> =
            stops.filter(|tool| !of_type || *tool != Tool::FmpyValidation).collect();
        // The standard says "should be".
        let advice = problem.text.starts_with("generationDateAndTime");
        let severity = if advice { Severity::Warning } else { Severity::Error };
        let why = rule.map_or("", |rule| rule.why);
        findings.add(severity, FILE, problem.text, why, problem.section);
        findings.stopping(&stops);
    }
    for terminal in &description.terminals {
        for member in &terminal.members {
            if description.variable(&member.variable).is_none() {
                let (name, variable) = (&terminal.name, &member.variable);
                let what = format!("terminal {name}: no variable is called {variable:?}");
                let why = "Importers cannot connect this member.";
                findings.add(Severity::Error, terminals::PATH, what, why, "2.4.9.2");
            }
        }
    }
    notes(description, &mut findings);
    findings.all
}

/// Adds notes on things that the standard allows but that surprise users.
fn notes(description: &ModelDescription, findings: &mut Findings) {
    let [experiment_section, variables, flags] = match description.version() {
        Version::V1 => ["", "", ""],
        Version::V2 => ["2.2.5", "2.2.7", "4.3.1"],
        Version::V3 => ["2.4.6", "2.4.7.4", "2.4.2"],
    };
    let experiment = description.default_experiment.unwrap_or_default();
    let stated = [("stopTime", experiment.stop_time), ("stepSize", experiment.step_size)];
    // FMI 1.0 has no stepSize.
    let count = if description.version() == Version::V1 { 1 } else { 2 };
    let absent = stated.iter().take(count).filter(|(_, value)| value.is_none());
    let absent: Vec<_> = absent.map(|(name, _)| *name).collect();
    if !absent.is_empty() {
        let what = format!("no {} in DefaultExperiment", absent.join(" and no "));
        let why =
            "FMPy, OMSimulator and fmusim take them where the user states none; others guess.";
        findings.add(Note, FILE, what, why, experiment_section);
    }
    let unnamed =
        description.variables.iter().filter(|variable| variable.description.is_none()).count();
    if unnamed > 0 {
        let what =
            format!("{unnamed} of {} variables without description", description.variables.len());
        findings.add(Note, FILE, what, "Importers show it to the user.", variables);
    }
    let simulation = description.co_simulation.as_ref();
    if simulation.is_some_and(|flags| flags.needs_execution_tool) {
        let what = "needsExecutionTool is true";
        findings.add(Note, FILE, what, "It runs only beside the tool that made it.", flags);
    }
    if simulation.is_some_and(|flags| flags.can_be_instantiated_only_once_per_process) {
        let what = "canBeInstantiatedOnlyOncePerProcess is true";
        findings.add(Note, FILE, what, "Two of it need two processes.", flags);
    }
}
