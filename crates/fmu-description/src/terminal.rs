//! Terminals as data.

/// A terminal: variables that are connected together (FMI 3.0.2, section 2.4.9.2).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Terminal {
    /// `name`; that of a nested terminal follows after a dot: `outer.inner`.
    pub name: String,
    /// `matchingRule`: `plug`, `bus`, `sequence`, `none`, or one that a layered standard defines.
    pub matching_rule: String,
    /// `terminalKind`.
    pub kind: Option<String>,
    /// The members, in order; those of nested terminals are not among them.
    pub members: Vec<TerminalMember>,
}

/// A variable of a terminal.
#[derive(Clone, Debug, PartialEq)]
pub struct TerminalMember {
    /// `memberName`; without it, that of the variable.
    pub name: String,
    /// `variableName`.
    pub variable: String,
    /// `variableKind`: `signal`, `inflow` or `outflow`.
    pub kind: String,
}
