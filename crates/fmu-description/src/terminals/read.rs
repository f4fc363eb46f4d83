//! Reads terminals.

use super::{Terminal, TerminalMember};
use crate::description::ParseError;
use crate::xml::{self, Element};

/// Reads the terminals of a file, each followed by its nested terminals. Skips members without `variableName`.
///
/// ```
/// let xml = br#"<fmiTerminalsAndIcons fmiVersion="3.0"><Terminals>
///     <Terminal name="a" matchingRule="bus"><TerminalMemberVariable variableName="x" variableKind="signal"/>
///         <Terminal name="b" matchingRule="plug"/>
///     </Terminal>
/// </Terminals></fmiTerminalsAndIcons>"#;
/// let terminals = fmu_description::terminals::read(xml).expect("well-formed");
/// assert_eq!(terminals[1].name, "a.b");
/// assert_eq!(terminals[0].members[0].name, "x");
/// ```
///
/// # Errors
///
/// Same as [`xml::read`].
pub fn read(bytes: &[u8]) -> Result<Vec<Terminal>, ParseError> {
    let root = xml::read(bytes)?;
    let mut all = Vec::new();
    for list in named(&root, "Terminals") {
        add(list, "", &mut all);
    }
    Ok(all)
}

fn named<'a>(element: &'a Element, name: &'a str) -> impl Iterator<Item = &'a Element> {
    element.children.iter().filter(move |child| child.name == name)
}

/// Adds the terminals in `element` to `all`, with `prefix` before their names.
fn add(element: &Element, prefix: &str, all: &mut Vec<Terminal>) {
    for terminal in named(element, "Terminal") {
        let name = format!("{prefix}{}", text(terminal, "name").unwrap_or_default());
        let member = |member_element: &Element| {
            let variable = text(member_element, "variableName")?;
            Some(TerminalMember {
                name: text(member_element, "memberName").unwrap_or_else(|| variable.clone()),
                variable,
                kind: text(member_element, "variableKind").unwrap_or_default(),
            })
        };
        let prefix = format!("{name}.");
        all.push(Terminal {
            name,
            matching_rule: text(terminal, "matchingRule").unwrap_or_default(),
            kind: text(terminal, "terminalKind"),
            members: named(terminal, "TerminalMemberVariable").filter_map(member).collect(),
        });
        add(terminal, &prefix, all);
    }
}

fn text(element: &Element, name: &str) -> Option<String> {
    let attribute = element.attributes.iter().find(|(known, _)| known == name);
    attribute.map(|(_, value)| value.clone())
}
