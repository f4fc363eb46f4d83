//! Lists the inputs without a connection, with options that would set or connect them.

use master::{Port, System};

/// Largest number of inputs listed, and of outputs proposed for one.
const INPUTS: usize = 20;
const OUTPUTS: usize = 3;

/// Returns a line for each input without a connection, which keeps its start value; empty if every
/// input has a source.
pub(super) fn list(system: &System) -> String {
    let open = if system.slaves.len() > 1 { system.free_inputs() } else { Vec::new() };
    let mut lines: Vec<_> = open.iter().take(INPUTS).map(|&input| line(system, input)).collect();
    if open.len() > INPUTS {
        lines.push(format!("  and {} more", open.len() - INPUTS));
    }
    if !lines.is_empty() {
        lines.insert(0, "inputs that are not connected keep their start values:".to_owned());
    }
    lines.join("\n")
}

fn line(system: &System, input: Port) -> String {
    let name = system.name(input);
    let outputs = system.candidates(input);
    if outputs.is_empty() {
        return format!("  {name}: set it by --set {name}=VALUE");
    }
    let typed = |output: &Port| format!("--connect {}={name}", system.name(*output));
    let proposed: Vec<_> = outputs.iter().take(OUTPUTS).map(typed).collect();
    let more = outputs.len().saturating_sub(OUTPUTS);
    let more = if more > 0 { format!(" ({more} more outputs fit)") } else { String::new() };
    format!("  {name}: {}{more}", proposed.join(" or "))
}
