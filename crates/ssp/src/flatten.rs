//! Flattens the connections of all systems to links between FMUs (SSP 1.0.1, section 5.3.2).

use std::collections::HashMap;

use fmu_description::{Causality, Kind, Position};

use super::conversion::{ConversionChain, Measure};
use super::error::{SspError, semantic_error};
use super::structure::{Connection, ConnectorKind, Conversion, End, Type};
use super::tree::{Content, Tree, Vertex};
use crate::assembly::{Link, Terminal};
use slave::Transformation;

/// The graph of all connections, directed from source to target; each target has at most one.
pub(super) struct Flow {
    pub(super) edges: Vec<Edge>,
    inbound: HashMap<Vertex, usize>,
}

/// A connection, directed from source to target.
pub(super) struct Edge {
    pub(super) from: Vertex,
    pub(super) to: Vertex,
    conversion: Conversion,
    /// The system that contains the connection.
    system: usize,
    /// Position of the connection in the file of that system.
    at: Position,
}

impl Edge {
    /// Appends the conversion of the connection to `chain`. If an end is a component whose source is another system
    /// structure, also converts between the unit that the component states and the unit inside.
    fn convert(&self, tree: &Tree, chain: ConversionChain) -> Result<ConversionChain, String> {
        let outside = |vertex: &Vertex| {
            let stated = (self.system != vertex.node).then(|| tree.measure_outside(vertex));
            stated.flatten()
        };
        let boundary = Conversion::default();
        let chain = match outside(&self.from) {
            Some(stated) => chain.append(&boundary, stated)?,
            None => chain,
        };
        let inside = tree.measure(&self.to);
        match outside(&self.to) {
            Some(stated) => {
                chain.append(&self.conversion, stated.or(inside.clone()))?.append(&boundary, inside)
            }
            None => chain.append(&self.conversion, inside),
        }
    }
}

/// An end of a connection: its connector, and whether the connector belongs to the system itself.
struct Side {
    vertex: Vertex,
    kind: ConnectorKind,
    of_system: bool,
}

impl Side {
    /// Returns whether the connector can be the source of a connection in the system.
    fn is_source(&self) -> bool {
        use ConnectorKind::{Input, Parameter, StructuralParameter, Unspecified};
        match self.kind {
            Unspecified => true,
            Input | Parameter | StructuralParameter => self.of_system,
            _ => !self.of_system,
        }
    }

    /// Returns whether the connector can be the target of a connection in the system.
    fn is_target(&self) -> bool {
        use ConnectorKind::{CalculatedParameter, Constant, Local, Output, Unspecified};
        match self.kind {
            Unspecified => true,
            Output | CalculatedParameter | Local | Constant => self.of_system,
            _ => !self.of_system,
        }
    }

    /// Returns when values at the connector may change: 0 never, 1 before the run, 2 during the run. A connector of
    /// unspecified kind counts as 0 as a source and as 2 as a target, so that it can be connected to every kind.
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

    /// Returns whether this connector may be the source of `other` (tables of section 5.3.2.1, SSP 1.0
    /// and 2.0).
    fn can_drive(&self, other: &Side) -> bool {
        let both = (self.kind, other.kind) == (ConnectorKind::Inout, ConnectorKind::Inout);
        self.is_source() && other.is_target() && !both && self.rate(true) <= other.rate(false)
    }

    /// Describes the connector for messages.
    fn describe(&self) -> String {
        let owner = if self.of_system { "system" } else { "element" };
        format!("{} of the {owner}", self.kind.as_str())
    }
}

impl Flow {
    /// Determines the direction of every connection and builds the graph. Returns an error if an end of a connection
    /// does not exist, the ends do not fit, or a connector has two sources; warns about ends that contradict their FMU.
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
        let (source, target) = if start.can_drive(&end) {
            (start, end)
        } else if end.can_drive(&start) {
            (end, start)
        } else {
            return Err(format!(
                "{} and {} cannot be connected: one is {}, the other {}",
                connection.start,
                connection.end,
                start.describe(),
                end.describe()
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

    /// Returns the edges on the path to `target` from the nearest FMU or, without one, from the first connector; empty
    /// if no connection ends at `target`. A ring of connections without an FMU is an error.
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

    /// Composes the conversions along `path`.
    pub(super) fn convert_along(
        tree: &Tree,
        path: &[&Edge],
        start: Measure,
    ) -> Result<ConversionChain, SspError> {
        let mut chain = ConversionChain::from(start);
        for edge in path {
            chain = edge.convert(tree, chain).map_err(|sentence| {
                let (from, to) = (tree.name(&edge.from), tree.name(&edge.to));
                at(tree, edge.system, edge.at, format!("from {from} to {to}: {sentence}"))
            })?;
        }
        Ok(chain)
    }

    /// Returns the links between FMUs, in the order of the connections that end at an FMU. Warns about units that are
    /// not converted, and about an input that no FMU drives unless `is_set` returns true for it. Returns an error for a
    /// ring of connections or a conversion that is not possible.
    pub(super) fn links(
        &self,
        tree: &Tree,
        is_set: impl Fn(&Vertex) -> bool,
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
                if !is_set(&edge.to) {
                    let (input, source) = (tree.name(&edge.to), tree.name(source));
                    warnings
                        .push(format!("{input} is connected to {source}, which nothing drives"));
                }
                continue;
            }
            let chain = Self::convert_along(tree, &path, tree.measure(source))?;
            check(tree, edge, &chain.transformation)?;
            let (from, to) = (tree.name(source), tree.name(&edge.to));
            warnings
                .extend(chain.warnings.iter().map(|text| format!("from {from} to {to}: {text}")));
            links.push(Link {
                from: terminal(tree, source),
                to: terminal(tree, &edge.to),
                transformation: chain.transformation,
                units_settled: true,
            });
        }
        Ok(links)
    }
}

/// Returns an error at a position in the file of a system.
fn at(tree: &Tree, system: usize, at: Position, sentence: impl Into<String>) -> SspError {
    semantic_error(at, sentence).in_file(&tree.nodes[system].file.shown)
}

fn terminal(tree: &Tree, vertex: &Vertex) -> Terminal {
    let element = tree.nodes[vertex.node].path.clone();
    Terminal { element, variable: vertex.connector.clone() }
}

/// Checks that the transformation suits the type of the target variable.
fn check(tree: &Tree, edge: &Edge, transformation: &Transformation) -> Result<(), SspError> {
    let kind = tree.variable(&edge.to).map(|variable| &variable.kind);
    let (fits, expected) = match transformation {
        Transformation::Identity => return Ok(()),
        Transformation::Linear { .. } => (kind.and_then(Kind::as_real).is_some(), "Real"),
        Transformation::Integer(_) => (kind.and_then(Kind::as_integer).is_some(), "Integer"),
        Transformation::Boolean { .. } => (matches!(kind, Some(Kind::Boolean(_))), "Boolean"),
    };
    if fits {
        return Ok(());
    }
    let kind = kind.map_or("unknown", Kind::element);
    let sentence =
        format!("{} is of type {kind}, the transformation is for {expected}", tree.name(&edge.to));
    Err(at(tree, edge.system, edge.at, sentence))
}

/// Resolves an end of a connection in `system`; warns if the end contradicts its FMU. Returns an error sentence if the
/// element, the connector or the variable does not exist or cannot be connected.
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
    if let Some(words) = kind.and_then(Type::beyond_fmi2)
        && tree.is_before_fmi3(vertex.node)
    {
        let name = tree.name(&vertex);
        return Err(format!(
            "{name} is {words}, which FMI 2.0 does not have, so it cannot be connected"
        ));
    }
    let stated = tree.connector(node, &end.connector).map(|connector| connector.kind);
    let of_system = end.element.is_none();
    if tree.is_terminal(&vertex) {
        return Ok(Side { vertex, kind: ConnectorKind::Unspecified, of_system });
    }
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
    let declared = kind_of(variable.causality);
    let name = tree.name(&vertex);
    let stated = stated.filter(|kind| *kind != ConnectorKind::Unspecified || declared.is_none());
    match (stated, declared) {
        (Some(stated), Some(declared)) if stated != declared => warnings.push(format!(
            "{name} is {} in the system structure and {} in the FMU",
            stated.as_str(),
            declared.as_str()
        )),
        (None, _) if connector.is_none() => {
            warnings.push(format!("{name} is connected, but is no connector"));
        }
        _ => {}
    }
    let causality = variable.causality.as_str();
    let kind = stated.or(declared).ok_or_else(|| format!("{name} is {causality}, no connector"))?;
    Ok(Side { vertex, kind, of_system })
}

/// Returns the connector kind of a causality; `None` for local variables and the independent variable.
pub(super) fn kind_of(causality: Causality) -> Option<ConnectorKind> {
    match causality {
        Causality::Input => Some(ConnectorKind::Input),
        Causality::Output => Some(ConnectorKind::Output),
        Causality::Parameter => Some(ConnectorKind::Parameter),
        Causality::StructuralParameter => Some(ConnectorKind::StructuralParameter),
        Causality::CalculatedParameter => Some(ConnectorKind::CalculatedParameter),
        Causality::Local | Causality::Independent => None,
    }
}
