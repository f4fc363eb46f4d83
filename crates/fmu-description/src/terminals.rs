//! `terminalsAndIcons/terminalsAndIcons.xml` of an FMU of FMI 3.0 (section 2.4.9).

mod read;

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, Event};

use crate::description::{Causality, Kind, ModelDescription};
pub use crate::terminal::{Terminal, TerminalMember};
pub use read::read;

/// The path in the archive.
pub const PATH: &str = "terminalsAndIcons/terminalsAndIcons.xml";

/// Renders the terminals of a model: one bus, `signals`, with its inputs and outputs as members. A member
/// has the name of its variable, so that tools connect the inputs and outputs with equal names of two FMUs
/// (section 2.4.9.2, `matchingRule = bus`).
///
/// The icon fills the square from (-100, -100) to (100, 100).
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
    let mut output = Output(Writer::new_with_indent(Vec::new(), b' ', 2));
    output.event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)));
    output.within("fmiTerminalsAndIcons", &[("fmiVersion", "3.0")], |output| {
        let square = [("x1", "-100"), ("y1", "-100"), ("x2", "100"), ("y2", "100")];
        output.within("GraphicalRepresentation", &[], |output| {
            let scale = [("suggestedScalingFactorTo_mm", "0.1")];
            output.empty("CoordinateSystem", &[&square[..], &scale[..]].concat());
            output.empty("Icon", &square);
        });
        output.signals(description);
    });
    let mut bytes = output.0.into_inner();
    bytes.push(b'\n');
    String::from_utf8_lossy(&bytes).into_owned()
}

struct Output(Writer<Vec<u8>>);

impl Output {
    fn event(&mut self, event: Event<'_>) {
        self.0.write_event(event).expect("a vector takes all bytes");
    }

    fn empty(&mut self, name: &str, attributes: &[(&str, &str)]) {
        let element = BytesStart::new(name).with_attributes(attributes.iter().copied());
        self.event(Event::Empty(element));
    }

    fn within(&mut self, name: &str, attributes: &[(&str, &str)], body: impl FnOnce(&mut Self)) {
        let element = BytesStart::new(name).with_attributes(attributes.iter().copied());
        self.event(Event::Start(element));
        body(self);
        self.event(Event::End(BytesEnd::new(name)));
    }

    /// The terminal with all inputs and outputs; none if there are none.
    fn signals(&mut self, description: &ModelDescription) {
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
        let text = "Inputs and outputs, connected by name";
        let terminal = [("name", "signals"), ("matchingRule", "bus"), ("description", text)];
        self.within("Terminals", &[], |output| {
            output.within("Terminal", &terminal, |output| {
                for signal in &signals {
                    output.empty(
                        "TerminalMemberVariable",
                        &[
                            ("variableName", &signal.name),
                            ("memberName", &signal.name),
                            ("variableKind", "signal"),
                        ],
                    );
                }
            });
        });
    }
}
