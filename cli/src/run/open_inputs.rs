//! Lists the inputs that keep their start values, with options that set or connect them.

use fmu_description::Kind;
use master::{Port, System};
use study::PreparedRun;

use super::quoted;

/// Largest number of inputs that are listed.
const INPUTS: usize = 20;
/// Largest number of outputs that are proposed for an input.
const OUTPUTS: usize = 3;

/// Returns a heading, a line for each of the first [`INPUTS`] inputs without a connection, a setting and a signal, and
/// the number of further inputs; empty for a single FMU or without such inputs. Leaves out clocks.
pub(super) fn list(prepared: &PreparedRun) -> String {
    let system = &prepared.system;
    let mut open = if system.slaves.len() > 1 { system.free_inputs() } else { Vec::new() };
    let is_clock = |port: Port| matches!(system.variable(port).kind, Kind::Clock(_));
    open.retain(|input| !is_clock(*input) && !prepared.sets(*input));
    let mut lines: Vec<_> = open.iter().take(INPUTS).map(|&input| line(system, input)).collect();
    if open.len() > INPUTS {
        lines.push(format!("  and {} more", open.len() - INPUTS));
    }
    if !lines.is_empty() {
        lines.insert(0, "inputs that are not connected keep their start values:".to_owned());
    }
    lines.join("\n")
}

/// Returns the line of an input: options that connect it to outputs that fit, or the option that sets it.
fn line(system: &System, input: Port) -> String {
    let name = system.name(input);
    let outputs = system.candidates(input);
    if outputs.is_empty() {
        return format!("  {name}: set it by --set {}", quoted(&format!("{name}=VALUE")));
    }
    let connection = |output: &Port| quoted(&format!("{}={name}", system.name(*output)));
    let option = |output: &Port| format!("--connect {}", connection(output));
    let options: Vec<_> = outputs.iter().take(OUTPUTS).map(option).collect();
    let more = outputs.len().saturating_sub(OUTPUTS);
    let more = if more > 0 { format!(" ({more} more outputs fit)") } else { String::new() };
    format!("  {name}: {}{more}", options.join(" or "))
}
