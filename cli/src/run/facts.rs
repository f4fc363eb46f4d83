//! What the report of a run says about the run itself.

use master::{Port, System};
use report::{Connection, Fmu, Run};
use study::Plan;

/// The system and the algorithm; outcome and messages follow at the end of the run.
pub(super) fn facts(system: &System, plan: &Plan) -> Run {
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
    Run {
        fmus: fmus.collect(),
        connections: connections.collect(),
        algorithm: plan.explanation(system).lines().map(without_dash).collect(),
        ..Run::default()
    }
}

fn without_dash(line: &str) -> String {
    line.strip_prefix("- ").unwrap_or(line).to_owned()
}
