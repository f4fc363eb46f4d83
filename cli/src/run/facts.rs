//! Facts about a run for its report: system, algorithm, and changes and faults of the scenario.

use fmu_description::Causality;
use master::{Port, System};
use report::{Connection, Fmu, Mark, MarkKind, Run};
use serde::Serialize;
use study::Plan;
use study::scenario::Scenario;

/// The numbers of entries of a scenario before interventions.
#[derive(Clone, Copy)]
pub(super) struct PlannedEntries {
    settings: usize,
    faults: usize,
}

impl PlannedEntries {
    pub(super) fn of(scenario: &Scenario) -> Self {
        Self { settings: scenario.set.len(), faults: scenario.fault.len() }
    }
}

/// Returns the system, the algorithm and the variables to plot; outcome, marks and messages follow at the end of the
/// run.
pub(super) fn facts(system: &System, plan: &Plan, plotted: &[String]) -> Run {
    let variable = |port: Port| {
        system.slaves[port.slave].1.description().variables[port.variable].name.clone()
    };
    let connections = system.connections.iter().map(|connection| Connection {
        from: connection.from.slave,
        output: variable(connection.from),
        to: connection.to.slave,
        input: variable(connection.to),
    });
    let fmus = system.slaves.iter().map(|(name, slave)| {
        let description = slave.description();
        let model = format!("model {}", description.model_name);
        let version = format!("FMI {}", description.fmi_version);
        let tool = description.generation_tool.as_ref().map(|tool| format!("written by {tool}"));
        Fmu { name: name.clone(), details: [model, version].into_iter().chain(tool).collect() }
    });
    let outputs = system.ports(Causality::Output).into_iter().map(|port| system.name(port));
    Run {
        fmus: fmus.collect(),
        connections: connections.collect(),
        outputs: outputs.collect(),
        plotted: plotted.to_vec(),
        algorithm: plan.explanation(system).lines().map(without_dash).collect(),
        ..Run::default()
    }
}

/// Returns the settings, the steps of signals and the faults of a scenario with their times; settings and faults beyond
/// the numbers in `planned` are interventions. A fault without a time starts at the `start` of the run.
pub(super) fn marks(scenario: &Scenario, planned: PlannedEntries, start: f64) -> Vec<Mark> {
    let kind = |at: usize, planned: usize, kind| {
        if at < planned { kind } else { MarkKind::Intervention }
    };
    let set = scenario.set.iter().enumerate().map(|(at, entry)| {
        let entry = entry.get_ref();
        let text = format!("{} = {}", entry.variable.get_ref(), toml_text(entry.value.get_ref()));
        Mark { kind: kind(at, planned.settings, MarkKind::Change), time: entry.at, end: None, text }
    });
    let steps = scenario.signal.iter().flat_map(|entry| {
        let entry = entry.get_ref();
        let steps = entry.steps.iter().flat_map(toml::Spanned::get_ref);
        steps.map(|(time, value)| {
            let text = format!("{} = {}", entry.variable.get_ref(), toml_text(value.get_ref()));
            Mark { kind: MarkKind::Change, time: *time, end: None, text }
        })
    });
    let faults = scenario.fault.iter().enumerate().map(|(at, entry)| {
        let entry = entry.get_ref();
        // An entry has the connection and a table, whose name is the kind of the fault.
        let table = toml::Table::try_from(entry).unwrap_or_default();
        let body = table.iter().find_map(|(name, body)| Some((name, body.as_table()?)));
        let time = |name: &str| body?.1.get(name)?.as_float();
        let what =
            body.map(|(name, body)| format!("{name} {}", toml_text(body))).unwrap_or_default();
        let text = format!("{}: {what}", entry.connection.get_ref());
        let (time, end) = (time("from").unwrap_or(start), time("until"));
        Mark { kind: kind(at, planned.faults, MarkKind::Fault), time, end, text }
    });
    set.chain(steps).chain(faults).collect()
}

/// Returns the inputs on which a fault of the scenario acts.
pub(super) fn disturbed(scenario: &Scenario) -> Vec<String> {
    let input =
        |connection: &str| connection.rsplit('=').next().unwrap_or_default().trim().to_owned();
    scenario.fault.iter().map(|fault| input(fault.get_ref().connection.get_ref())).collect()
}

/// Formats a value as in a TOML file, in one line; empty if TOML cannot state it.
fn toml_text(value: impl Serialize) -> String {
    toml::Value::try_from(value).map(|value| value.to_string()).unwrap_or_default()
}

fn without_dash(line: &str) -> String {
    line.strip_prefix("- ").unwrap_or(line).to_owned()
}
