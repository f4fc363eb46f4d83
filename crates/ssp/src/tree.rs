//! The loaded system structure: all elements of all files and the FMUs to which these refer.

use std::collections::HashMap;
use std::path::PathBuf;
use std::rc::Rc;

use fmu_description::package::{TemporaryFolder, Unpacked};
use fmu_description::{ModelDescription, Position, ScalarVariable, Version};

use super::conversion::Measure;
use super::source::Base;
use super::structure::{
    Connection, Connector, Definitions, Implementation, ParameterMapping, ParameterSet, Place,
    SystemStructure,
};

/// All elements of all files. The root system is first; every system precedes its elements.
#[derive(Debug, Default)]
pub(super) struct Tree {
    pub(super) nodes: Vec<Node>,
    /// The FMUs; components of the same FMU share one entry.
    pub(super) fmus: Vec<Unpacked>,
    /// Positions of the variables of each FMU by name.
    pub(super) variables: Vec<HashMap<String, usize>>,
    /// Names of the FMUs for messages.
    pub(super) shown: Vec<PathBuf>,
    /// Folders of the unpacked SSPs.
    pub(super) folders: Vec<TemporaryFolder>,
    /// Warnings about the files.
    pub(super) warnings: Vec<String>,
}

/// A system, a component, a signal dictionary, or a reference to a signal dictionary.
#[derive(Debug, Default)]
pub(super) struct Node {
    /// Hierarchical name without the root system, joined by dots; empty for the root.
    pub(super) path: String,
    /// The parent system.
    pub(super) parent: Option<usize>,
    /// Elements of a system by name, as indices into [`Tree::nodes`].
    pub(super) children: HashMap<String, usize>,
    /// Signal dictionaries of a system by name, as indices into [`Tree::nodes`].
    pub(super) dictionaries: HashMap<String, usize>,
    /// The file that declares the connectors and connections.
    pub(super) file: Rc<File>,
    /// Position of the element in the file of its system.
    pub(super) at: Place,
    pub(super) connectors: Vec<Connector>,
    /// Positions of the connectors by name.
    pub(super) connector_positions: HashMap<String, usize>,
    /// The connectors of the component that refers to this system, and the file that contains these connectors.
    pub(super) outside: Option<(Vec<Connector>, Rc<File>)>,
    pub(super) connections: Vec<Connection>,
    pub(super) bindings: Vec<Binding>,
    /// Step in s that an annotation proposes.
    pub(super) step_size: Option<f64>,
    /// `implementation` if the FMU offers this interface, otherwise [`Implementation::Any`].
    pub(super) implementation: Implementation,
    pub(super) content: Content,
}

/// The kind of a node.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Content {
    #[default]
    System,
    /// An index into [`Tree::fmus`].
    Fmu(usize),
    /// A signal dictionary, whose entries are its connectors.
    Dictionary,
    /// A reference to the signal dictionary at this index of [`Tree::nodes`].
    Reference(usize),
}

/// The data of a file that the elements of the file and other files need.
#[derive(Debug, Default)]
pub(super) struct File {
    /// Name of the file for messages.
    pub(super) shown: PathBuf,
    /// The folder at which relative URIs in the file start.
    pub(super) base: Base,
    pub(super) definitions: Definitions,
}

/// A parsed SSD file.
#[derive(Debug)]
pub(super) struct Document {
    pub(super) structure: SystemStructure,
    pub(super) file: Rc<File>,
}

/// A parameter binding with the contents of its files.
#[derive(Clone, Debug)]
pub(super) struct Binding {
    pub(super) prefix: String,
    pub(super) values: Rc<ParameterSet>,
    pub(super) mapping: Option<Rc<ParameterMapping>>,
    /// The file that contains the binding.
    pub(super) file: Rc<File>,
    pub(super) at: Position,
}

/// A connector of a node: a vertex of the connection graph.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct Vertex {
    pub(super) node: usize,
    pub(super) connector: String,
}

impl Tree {
    /// Returns the vertex of the connector `name` of `node`; follows a reference to its signal
    /// dictionary.
    pub(super) fn vertex(&self, node: usize, name: &str) -> Vertex {
        let node = match self.nodes[node].content {
            Content::Reference(dictionary) => dictionary,
            _ => node,
        };
        Vertex { node, connector: name.to_owned() }
    }

    /// Returns the description of the node's FMU; `None` if the node is not an FMU.
    pub(super) fn description(&self, node: usize) -> Option<&ModelDescription> {
        match self.nodes[node].content {
            Content::Fmu(index) => Some(&self.fmus[index].description),
            _ => None,
        }
    }

    /// Returns the FMU variable of a connector; `None` if the node is not an FMU or has no such variable.
    pub(super) fn variable(&self, vertex: &Vertex) -> Option<&ScalarVariable> {
        let Content::Fmu(fmu) = self.nodes[vertex.node].content else { return None };
        let position = *self.variables[fmu].get(&vertex.connector)?;
        self.fmus[fmu].description.variables.get(position)
    }

    /// Returns whether the node is an FMU of FMI 1.0 or 2.0, which do not have the types of FMI 3.0.
    pub(super) fn is_before_fmi3(&self, node: usize) -> bool {
        self.description(node).is_some_and(|description| description.version() != Version::V3)
    }

    /// Returns whether a connector is a terminal of an FMU, so that a connection to it connects all members.
    pub(super) fn is_terminal(&self, vertex: &Vertex) -> bool {
        let terminals =
            self.description(vertex.node).map(|description| description.terminals.iter());
        terminals.is_some_and(|mut all| all.any(|terminal| terminal.name == vertex.connector))
    }

    /// Returns the declaration of a connector in its file; `None` if the file does not declare the connector.
    pub(super) fn connector(&self, node: usize, name: &str) -> Option<&Connector> {
        let node = &self.nodes[node];
        node.connector_positions.get(name).map(|&position| &node.connectors[position])
    }

    /// Returns two measures of a connector: the measure in the file, and the measure in the FMU.
    pub(super) fn measures(&self, vertex: &Vertex) -> (Measure, Measure) {
        let node = &self.nodes[vertex.node];
        let connector = self.connector(vertex.node, &vertex.connector);
        let kind = connector.and_then(|connector| connector.kind_of_value.as_ref());
        let stated = Measure::stated(kind, &[&node.file.definitions]);
        let declared = self.variable(vertex).zip(self.description(vertex.node));
        let declared = declared.map(|(variable, fmu)| Measure::of_variable(variable, fmu));
        (stated, declared.unwrap_or_default())
    }

    /// Returns the unit or enumeration that the file states for a connector; missing parts are taken from the FMU.
    pub(super) fn measure(&self, vertex: &Vertex) -> Measure {
        let (stated, declared) = self.measures(vertex);
        stated.or(declared)
    }

    /// Returns the unit or enumeration that the component whose source is this system states for the connector; `None`
    /// without such a component, or if the component lacks the connector.
    pub(super) fn measure_outside(&self, vertex: &Vertex) -> Option<Measure> {
        let (connectors, file) = self.nodes[vertex.node].outside.as_ref()?;
        let connector = connectors.iter().find(|connector| connector.name == vertex.connector)?;
        Some(Measure::stated(connector.kind_of_value.as_ref(), &[&file.definitions]))
    }

    /// Returns the name of a connector for messages.
    pub(super) fn name(&self, vertex: &Vertex) -> String {
        match self.nodes[vertex.node].path.as_str() {
            "" => vertex.connector.clone(),
            path => format!("{path}.{}", vertex.connector),
        }
    }
}
