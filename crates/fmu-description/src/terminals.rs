//! `terminalsAndIcons/terminalsAndIcons.xml` of an FMU of FMI 3.0 (section 2.4.9).

mod read;

use crate::description::{Causality, Kind, ModelDescription, Output, Tag};
pub use crate::terminal::{Terminal, TerminalMember};
pub use read::read;

/// The path of the terminals in the archive of an FMU.
pub const PATH: &str = "terminalsAndIcons/terminalsAndIcons.xml";

/// Renders the terminals of a model: one bus, `signals`, with its inputs and outputs, except clocks, as members;
/// no terminal without such variables. A member has the name of its variable, so that tools connect the inputs
/// and outputs with equal names of two FMUs (section 2.4.9.2, `matchingRule = bus`).
///
/// The icon is in the square from (-100, -100) to (100, 100).
///
/// ```
/// use fmu_description::{Causality, ModelDescription, ScalarVariable, terminals};
/// let name = "force".to_owned();
/// let force = ScalarVariable { name, causality: Causality::Input, ..Default::default() };
/// let xml = terminals::render(&ModelDescription { variables: vec![force], ..Default::default() });
/// assert!(xml.contains(r#"<TerminalMemberVariable variableName="force" memberName="force""#));
/// ```
#[must_use]
pub fn render(description: &ModelDescription) -> String {
    Output::file(|output| {
        output.around(Tag::new("fmiTerminalsAndIcons").with("fmiVersion", "3.0"), |output| {
            output.around(Tag::new("GraphicalRepresentation"), |output| {
                let system = square(Tag::new("CoordinateSystem"));
                output.empty(system.with("suggestedScalingFactorTo_mm", "0.1"));
                output.empty(square(Tag::new("Icon")));
            });
            signals(output, description);
        });
    })
}

/// Adds the corners of the square.
fn square(tag: Tag<'_>) -> Tag<'_> {
    tag.with("x1", "-100").with("y1", "-100").with("x2", "100").with("y2", "100")
}

/// Writes the terminal with all inputs and outputs; nothing if there are none.
fn signals(output: &mut Output, description: &ModelDescription) {
    let is_signal = |causality| matches!(causality, Causality::Input | Causality::Output);
    let signals: Vec<_> = description
        .variables
        .iter()
        .filter(|variable| {
            is_signal(variable.causality) && !matches!(variable.kind, Kind::Clock(_))
        })
        .collect();
    if signals.is_empty() {
        return;
    }
    let terminal = Tag::new("Terminal")
        .with("name", "signals")
        .with("matchingRule", "bus")
        .with("description", "Inputs and outputs, connected by name");
    output.around(Tag::new("Terminals"), |output| {
        output.around(terminal, |output| {
            for signal in signals {
                output.empty(
                    Tag::new("TerminalMemberVariable")
                        .with("variableName", &signal.name)
                        .with("memberName", &signal.name)
                        .with("variableKind", "signal"),
                );
            }
        });
    });
}
