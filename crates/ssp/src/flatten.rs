//! The connections of all systems to links between FMUs (SSP 1.0.1, section 5.3.2).

use std::collections::HashMap;

use fmu_description::{Causality, Position};

use super::conversion::{Measure, Way};
use super::error::{SspError, meaning};
use super::structure::{Connection, ConnectorKind, Conversion, End, Type};
use super::tree::{Content, Tree, Vertex};
use crate::assembly::{Link, Terminal};
use slave::Transformation;

/// Every connection in the direction of its values, found by where it leads to.
pub(super) struct Flow {
    pub(super) edges: Vec<Edge>,
    inbound: HashMap<Vertex, usize>,
}

/// A connection in the direction of its values.
pub(super) struct Edge {
    pub(super) from: Vertex,
    pub(super) to: Vertex,
    conversion: Conversion,
    /// The system it stands in, and where.
    system: usize,
    at: Position,
}

/// An end of a connection: its connector, and whether that is one of the system itself.
struct Side {
    vertex: Vertex,
    kind: ConnectorKind,
    of_system: bool,
}

impl Side {
    fn gives(&self) -> bool {
        use ConnectorKind::{Input, Parameter, StructuralParameter, Unspecified};
        match self.kind {
            Unspecified => true,
            Input | Parameter | StructuralParameter => self.of_system,
            _ => !self.of_system,
        }
    }

    fn takes(&self) -> bool {
        use ConnectorKind::{CalculatedParameter, Constant, Local, Output, Unspecified};
        match self.kind {
            Unspecified => true,
            Output | CalculatedParameter | Local | Constant => self.of_system,
            _ => !self.of_system,
        }
    }

    /// How often values at the connector may change: never, before the run, or while it runs.
    fn rate(&self, as_source: bool) -> u32 {
        use ConnectorKind::{
            CalculatedParameter, Constant, Parameter, StructuralParameter, Unspecified,
        };
        match self.kind {
            Unspecified if as_source => 0,
            Constant | StructuralParameter => 0,
            Parameter | CalculatedParameter => 1,
            _ => 2,
        }
    }

    /// The tables of section 5.3.2.1, of SSP 1.0 and 2.0.
    fn leads_to(&self, other: &Side) -> bool {
        let both = (self.kind, other.kind) == (ConnectorKind::Inout, ConnectorKind::Inout);
        self.gives() && other.takes() && !both && self.rate(true) <= other.rate(false)
    }

    fn words(&self) -> String {
        let owner = if self.of_system { "system" } else { "element" };
        format!("{} of the {owner}", self.kind.as_str())
    }
}

impl Flow {
    /// Finds the direction of every connection.
    pub(super) fn new(tree: &Tree, warnings: &mut Vec<String>) -> Result<Self, SspError> {
        let mut flow = Flow { edges: Vec::new(), inbound: HashMap::new() };
        for (system, node) in tree.nodes.iter().enumerate() {
            for connection in &node.connections {
                flow.add(tree, system, connection, warnings)
                    .map_err(|sentence| at(tree, system, connection.at.0, sentence))?;
            }
        }
        Ok(flow)
    }

    fn add(
        &mut self,
        tree: &Tree,
        system: usize,
        connection: &Connection,
        warnings: &mut Vec<String>,
    ) -> Result<(), String> {
        let start = side(tree, system, &connection.start, warnings)?;
        let end = side(tree, system, &connection.end, warnings)?;
        let (source, target) = if start.leads_to(&end) {
            (start, end)
        } else if end.leads_to(&start) {
            (end, start)
        } else {
            return Err(format!(
                "{} and {} cannot be connected: one is {}, the other {}",
                connection.start,
                connection.end,
                start.words(),
                end.words()
            ));
        };
        let edge = Edge {
            from: source.vertex,
            to: target.vertex.clone(),
            conversion: connection.conversion.clone(),
            system,
            at: connection.at.0,
        };
        if let Some(first) = self.inbound.insert(target.vertex, self.edges.len()) {
            let (name, first) = (tree.name(&edge.to), tree.name(&self.edges[first].from));
            let second = tree.name(&edge.from);
            return Err(format!("{name} is connected twice, to {first} and to {second}"));
        }
        self.edges.push(edge);
        Ok(())
    }

    /// The edges from a source without inbound connections to `target`, in that order.
    pub(super) fn upstream(&self, tree: &Tree, target: &Vertex) -> Result<Vec<&Edge>, SspError> {
        let mut path = Vec::new();
        let mut vertex = target;
        while let Some(edge) = self.inbound.get(vertex).map(|index| &self.edges[*index]) {
            if path.len() == self.edges.len() {
                let sentence =
                    format!("{} is connected in a ring without an FMU", tree.name(target));
                return Err(at(tree, edge.system, edge.at, sentence));
            }
            path.push(edge);
            vertex = &edge.from;
            if matches!(tree.nodes[vertex.node].content, Content::Fmu(_)) {
                break;
            }
        }
        path.reverse();
        Ok(path)
    }

    /// What becomes of values over `path`.
    pub(super) fn over(tree: &Tree, path: &[&Edge], start: Measure) -> Result<Way, SspError> {
        let mut way = Way::from(start);
        for edge in path {
            way = way.over(&edge.conversion, tree.measure(&edge.to)).map_err(|sentence| {
                let (from, to) = (tree.name(&edge.from), tree.name(&edge.to));
                at(tree, edge.system, edge.at, format!("from {from} to {to}: {sentence}"))
            })?;
        }
        Ok(way)
    }

    /// The links between FMUs, in the order of the connections that end at one.
    pub(super) fn links(
        &self,
        tree: &Tree,
        warnings: &mut Vec<String>,
    ) -> Result<Vec<Link>, SspError> {
        let mut links = Vec::new();
        for edge in &self.edges {
            if !matches!(tree.nodes[edge.to.node].content, Content::Fmu(_)) {
                continue;
            }
            let path = self.upstream(tree, &edge.to)?;
            let source = path.first().map_or(&edge.from, |first| &first.from);
            if !matches!(tree.nodes[source.node].content, Content::Fmu(_)) {
                let (input, source) = (tree.name(&edge.to), tree.name(source));
                warnings.push(format!("{input} is connected to {source}, which nothing drives"));
                continue;
            }
            let way = Self::over(tree, &path, tree.measure(source))?;
            check(tree, edge, &way.transformation)?;
            let (from, to) = (tree.name(source), tree.name(&edge.to));
            warnings.extend(way.doubts.iter().map(|doubt| format!("from {from} to {to}: {doubt}")));
            links.push(Link {
                from: terminal(tree, source),
                to: terminal(tree, &edge.to),
                transformation: way.transformation,
                units_settled: true,
            });
        }
        Ok(links)
    }
}

/// The error about what stands at a place in the file of a system.
fn at(tree: &Tree, system: usize, at: Position, sentence: impl Into<String>) -> SspError {
    meaning(at, sentence).in_file(&tree.nodes[system].file.shown)
}

fn terminal(tree: &Tree, vertex: &Vertex) -> Terminal {
    let element = tree.nodes[vertex.node].path.clone();
    Terminal { element, variable: vertex.connector.clone() }
}

/// Which transformation suits which type, by the variable at the end.
fn check(tree: &Tree, edge: &Edge, transformation: &Transformation) -> Result<(), SspError> {
    let expected = match transformation {
        Transformation::Identity => return Ok(()),
        Transformation::Linear { .. } => ["Real", "Real"],
        Transformation::Integer(_) => ["Integer", "Enumeration"],
        Transformation::Boolean { .. } => ["Boolean", "Boolean"],
    };
    let found = tree.variable(&edge.to).map_or("unknown", |variable| variable.kind.element());
    if expected.contains(&found) {
        return Ok(());
    }
    let expected = expected[0];
    let sentence =
        format!("{} is of type {found}, the transformation is for {expected}", tree.name(&edge.to));
    Err(at(tree, edge.system, edge.at, sentence))
}

/// The connector at an end of a connection of `system`.
fn side(tree: &Tree, system: usize, end: &End, warnings: &mut Vec<String>) -> Result<Side, String> {
    let node = match &end.element {
        None => system,
        Some(name) => {
            let children = &tree.nodes[system].children;
            let child = children.get(name);
            *child.ok_or_else(|| format!("the system has no element {name:?}"))?
        }
    };
    let vertex = tree.vertex(node, &end.connector);
    let connector = tree.connector(vertex.node, &vertex.connector);
    let kind = connector.and_then(|connector| connector.kind_of_value.as_ref());
    if let Some(words) = kind.and_then(Type::beyond_fmi2) {
        let name = tree.name(&vertex);
        return Err(format!(
            "{name} is {words}, which FMI 2.0 does not have, so it cannot be connected"
        ));
    }
    let stated = tree.connector(node, &end.connector).map(|connector| connector.kind);
    let of_system = end.element.is_none();
    let Some(variable) = tree.variable(&vertex) else {
        if tree.description(node).is_some() {
            return Err(format!("the FMU has no variable {}", tree.name(&vertex)));
        }
        if tree.connector(vertex.node, &vertex.connector).is_none() {
            return Err(format!("the signal dictionary or system has no {}", tree.name(&vertex)));
        }
        let kind = stated.ok_or_else(|| format!("there is no connector {end}"))?;
        return Ok(Side { vertex, kind, of_system });
    };
    let own = kind_of(variable.causality);
    let name = tree.name(&vertex);
    let stated = stated.filter(|kind| *kind != ConnectorKind::Unspecified || own.is_none());
    match (stated, own) {
        (Some(stated), Some(own)) if stated != own => warnings.push(format!(
            "{name} is {} in the system structure and {} in the FMU",
            stated.as_str(),
            own.as_str()
        )),
        (None, _) if connector.is_none() => {
            warnings.push(format!("{name} is connected, but is no connector"));
        }
        _ => {}
    }
    let causality = variable.causality.as_str();
    let kind = stated.or(own).ok_or_else(|| format!("{name} is {causality}, no connector"))?;
    Ok(Side { vertex, kind, of_system })
}

/// The kind of the connector of a variable of FMI 2.0.
pub(super) fn kind_of(causality: Causality) -> Option<ConnectorKind> {
    match causality {
        Causality::Input => Some(ConnectorKind::Input),
        Causality::Output => Some(ConnectorKind::Output),
        Causality::Parameter => Some(ConnectorKind::Parameter),
        Causality::CalculatedParameter => Some(ConnectorKind::CalculatedParameter),
        Causality::Local | Causality::Independent => None,
    }
}
