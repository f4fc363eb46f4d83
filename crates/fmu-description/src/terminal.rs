//! Terminals as data.

/// A terminal: variables that are connected together (FMI 3.0.2, section 2.4.9.2).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Terminal {
    /// `name`; for a nested terminal after the name of the outer one and a dot: `outer.inner`.
    pub name: String,
    /// `matchingRule`: `plug`, `bus`, `sequence`, `none`, or one that a layered standard defines; empty if absent.
    pub matching_rule: String,
    /// `terminalKind`.
    pub kind: Option<String>,
    /// The members in order, without the members of nested terminals.
    pub members: Vec<TerminalMember>,
}

/// A variable of a terminal.
#[derive(Clone, Debug, PartialEq)]
pub struct TerminalMember {
    /// `memberName`; if it is absent, the name of the variable.
    pub name: String,
    /// `variableName`.
    pub variable: String,
    /// `variableKind`: `signal`, `inflow` or `outflow`; empty if absent.
    pub kind: String,
}
