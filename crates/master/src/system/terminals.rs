//! Terminals of FMI 3.0: a connection of two terminals connects their members.

use fmu_description::terminals::{Terminal, TerminalMember};
use fmu_description::{Causality, IntervalVariability, Kind};

use super::{Port, System};
use crate::error::SystemError;

/// The matching rule of the layered standard for networks: `Tx` of one side with `Rx` of the other (FMI-LS-BUS 1.0,
/// section "Bus Terminal").
const TRANSCEIVER: &str = fmu_description::can::MATCHING_RULE;
const RULES: &str = "plug, bus, sequence or org.fmi-ls-bus.transceiver";

#[derive(Clone, Copy)]
struct SlaveTerminal<'a> {
    slave: usize,
    terminal: &'a Terminal,
}

/// A member of a terminal of a slave.
#[derive(Clone, Copy)]
struct SlaveMember<'a> {
    slave: usize,
    member: &'a TerminalMember,
}

impl System {
    /// Returns the terminal called `slave.terminal`.
    fn terminal_called(&self, name: &str) -> Option<SlaveTerminal<'_>> {
        name.match_indices('.').rev().find_map(|(at, _)| {
            let slave = *self.names.get(&name[..at])?;
            let terminals = &self.slaves[slave].1.description().terminals;
            let terminal = terminals.iter().find(|terminal| terminal.name == name[at + 1..])?;
            Some(SlaveTerminal { slave, terminal })
        })
    }

    /// Returns the pairs of output and input of two terminals (FMI 3.0.2, section 2.4.9.2); `None` if no terminal has
    /// one of the names. A member without a partner is a warning for the matching rule `bus`, otherwise an error.
    pub(super) fn pairs_of_terminals(
        &self,
        from: &str,
        to: &str,
    ) -> Result<Option<Vec<(Port, Port)>>, SystemError> {
        let wrong = |why: String| SystemError::Terminals { from: from.into(), to: to.into(), why };
        let (one, other) = match (self.terminal_called(from), self.terminal_called(to)) {
            (None, None) => return Ok(None),
            (Some(one), Some(other)) => (one, other),
            (None, Some(_)) => return Err(wrong(format!("{from} is no terminal"))),
            (Some(_), None) => return Err(wrong(format!("{to} is no terminal"))),
        };
        let mut pairs = Vec::new();
        self.match_members(one, other, &mut pairs).map_err(wrong)?;
        // Nested terminals of equal names are connected, too.
        let inner = |outer: SlaveTerminal<'_>| {
            let prefix = format!("{}.", outer.terminal.name);
            let all = self.slaves[outer.slave].1.description().terminals.iter();
            let nested = all.filter_map(move |terminal| {
                let name = terminal.name.strip_prefix(&prefix)?.to_owned();
                Some((name, SlaveTerminal { slave: outer.slave, terminal }))
            });
            nested.collect::<Vec<_>>()
        };
        let others = inner(other);
        for (name, terminal) in inner(one) {
            if let Some((_, partner)) = others.iter().find(|(other, _)| *other == name) {
                self.match_members(terminal, *partner, &mut pairs).map_err(wrong)?;
            }
        }
        if pairs.is_empty() {
            return Err(wrong("no member of one has a partner in the other".to_owned()));
        }
        Ok(Some(pairs))
    }

    /// Adds the connections between the members of two terminals to `pairs`.
    fn match_members(
        &self,
        from: SlaveTerminal<'_>,
        to: SlaveTerminal<'_>,
        pairs: &mut Vec<(Port, Port)>,
    ) -> Result<(), String> {
        let (one, other) = (from.terminal, to.terminal);
        let rule = one.matching_rule.as_str();
        if rule != other.matching_rule {
            let other = &other.matching_rule;
            return Err(format!("their matchingRule differ, {rule} and {other}"));
        }
        if let (Some(one), Some(other)) = (&one.kind, &other.kind)
            && one != other
        {
            return Err(format!("their terminalKind differ, {one} and {other}"));
        }
        let partner_of: &dyn Fn(usize, &TerminalMember) -> Option<usize> = match rule {
            "plug" | "bus" => {
                &|_, member| other.members.iter().position(|partner| partner.name == member.name)
            }
            TRANSCEIVER => &|_, member| {
                let crossed = crossed(&member.name)?;
                other.members.iter().position(|partner| partner.name == crossed)
            },
            "sequence" => &|position, _| Some(position).filter(|at| *at < other.members.len()),
            "none" if one.members.is_empty() && other.members.is_empty() => &|_, _| None,
            _ => return Err(format!("matchingRule is {rule:?}, expected {RULES}")),
        };
        let mut free = vec![true; other.members.len()];
        let mut unmatched = Vec::new();
        for (position, member) in one.members.iter().enumerate() {
            let Some(at) = partner_of(position, member) else {
                let owner = &self.slaves[from.slave].0;
                unmatched.push(format!("{owner}.{}.{}", one.name, member.name));
                continue;
            };
            free[at] = false;
            let partner = SlaveMember { slave: to.slave, member: &other.members[at] };
            self.add_pairs(SlaveMember { slave: from.slave, member }, partner, pairs)?;
        }
        let rest = other.members.iter().zip(free).filter(|(_, free)| *free);
        let owner = &self.slaves[to.slave].0;
        unmatched.extend(rest.map(|(member, _)| format!("{owner}.{}.{}", other.name, member.name)));
        if unmatched.is_empty() {
            return Ok(());
        }
        let unmatched = unmatched.join(", ");
        if rule != "bus" {
            return Err(format!("no partner for {unmatched}, as the matchingRule {rule} wants"));
        }
        tracing::warn!("{unmatched} of the terminal has no partner in the other one");
        Ok(())
    }

    /// Adds the connections between two members to `pairs`: output and input; none for two parameters.
    fn add_pairs(
        &self,
        from: SlaveMember<'_>,
        to: SlaveMember<'_>,
        pairs: &mut Vec<(Port, Port)>,
    ) -> Result<(), String> {
        for member in [from.member, to.member] {
            if member.kind != "signal" {
                let (name, kind) = (&member.name, &member.kind);
                return Err(format!(
                    "the member {name} has the variableKind {kind:?}, expected signal: flows need an equation \
                     of balance"
                ));
            }
        }
        let name =
            |end: SlaveMember<'_>| format!("{}.{}", self.slaves[end.slave].0, end.member.variable);
        let elements = self.pairs(&name(from), &name(to)).map_err(|error| error.to_string())?;
        for (first, second) in elements {
            if self.is_source(first, second) {
                pairs.push((first, second));
            } else if self.is_source(second, first) {
                pairs.push((second, first));
            } else if !(self.is_parameter(first) && self.is_parameter(second)) {
                let role = |port| self.variable(port).causality.as_str();
                return Err(format!(
                    "{} is {} and {} is {}, expected an output and an input",
                    self.name(first),
                    role(first),
                    self.name(second),
                    role(second)
                ));
            }
        }
        Ok(())
    }

    /// Whether the user sets the variable: of two connected members of this kind, neither gives the other a value.
    fn is_parameter(&self, port: Port) -> bool {
        let causality = self.variable(port).causality;
        matches!(causality, Causality::Parameter | Causality::StructuralParameter)
    }

    /// Whether a connection can lead from one variable to the other.
    fn is_source(&self, from: Port, to: Port) -> bool {
        let (source, target) = (self.variable(from).causality, self.variable(to).causality);
        match (source, target) {
            (Causality::Output, Causality::Input | Causality::Parameter)
            | (Causality::CalculatedParameter, Causality::Parameter) => true,
            _ => self.is_clock_of_time(from, to),
        }
    }

    /// Whether `from` is an input clock that ticks at times, and `to` a triggered input clock: they have one source,
    /// the master, and tick together (FMI-LS-BUS 1.0, section "Time-based Tx Clocks").
    pub(super) fn is_clock_of_time(&self, from: Port, to: Port) -> bool {
        let (source, target) = (self.variable(from), self.variable(to));
        let inputs = source.causality == Causality::Input && target.causality == Causality::Input;
        let (Kind::Clock(first), Kind::Clock(second)) = (&source.kind, &target.kind) else {
            return false;
        };
        let triggered = IntervalVariability::Triggered;
        inputs
            && first.interval_variability != triggered
            && second.interval_variability == triggered
    }
}

/// Returns the name of the partner of the member `name`, with `Tx_` and `Rx_` exchanged; `None` if `name` starts with
/// neither of them.
fn crossed(name: &str) -> Option<String> {
    let (direction, rest) = name.split_once('_')?;
    match direction {
        "Tx" => Some(format!("Rx_{rest}")),
        "Rx" => Some(format!("Tx_{rest}")),
        _ => None,
    }
}
