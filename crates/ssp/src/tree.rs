//! A system structure with everything that it refers to: what the loader makes of files.

use std::collections::HashMap;
use std::path::PathBuf;
use std::rc::Rc;

use fmu_description::package::{TemporaryFolder, Unpacked};
use fmu_description::{ModelDescription, Position, ScalarVariable};

use super::conversion::Measure;
use super::source::Base;
use super::structure::{
    Connection, Connector, Definitions, ParameterMapping, ParameterSet, SystemStructure,
};

/// All elements of all files, the root system first, every element after the system around it.
#[derive(Debug, Default)]
pub(super) struct Tree {
    pub(super) nodes: Vec<Node>,
    /// Each FMU once, however many components it has.
    pub(super) fmus: Vec<Unpacked>,
    /// Their names for the user.
    pub(super) shown: Vec<PathBuf>,
    /// Unpacked SSPs.
    pub(super) folders: Vec<TemporaryFolder>,
    /// What is odd about the files.
    pub(super) warnings: Vec<String>,
}

/// A system, a component, a signal dictionary, or a reference to one.
#[derive(Debug)]
pub(super) struct Node {
    /// Names from the root system's elements down, joined by dots; empty for the root.
    pub(super) path: String,
    /// The system around it.
    pub(super) parent: Option<usize>,
    /// Elements of a system by name; an index into [`Tree::nodes`].
    pub(super) children: HashMap<String, usize>,
    /// Signal dictionaries of a system by name.
    pub(super) dictionaries: HashMap<String, usize>,
    /// The file that its connectors and connections stand in.
    pub(super) file: Rc<File>,
    /// Where it begins there.
    pub(super) at: Position,
    pub(super) connectors: Vec<Connector>,
    pub(super) connections: Vec<Connection>,
    pub(super) bindings: Vec<Binding>,
    /// Step in s that an annotation proposes.
    pub(super) step_size: Option<f64>,
    pub(super) content: Content,
}

/// What a node is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Content {
    System,
    /// An index into [`Tree::fmus`].
    Fmu(usize),
    /// A signal dictionary; its connectors are its entries.
    Dictionary,
    /// A reference to the signal dictionary at this index of [`Tree::nodes`].
    Reference(usize),
}

/// A file, as far as what it defines matters elsewhere.
#[derive(Debug)]
pub(super) struct File {
    /// Its name for the user.
    pub(super) shown: PathBuf,
    /// Where its URIs start.
    pub(super) base: Base,
    pub(super) definitions: Definitions,
}

/// An SSD file.
#[derive(Debug)]
pub(super) struct Document {
    pub(super) structure: SystemStructure,
    pub(super) file: Rc<File>,
}

/// A parameter binding with its contents.
#[derive(Clone, Debug)]
pub(super) struct Binding {
    pub(super) prefix: String,
    pub(super) values: Rc<ParameterSet>,
    pub(super) mapping: Option<Rc<ParameterMapping>>,
    /// Where the binding stands.
    pub(super) file: Rc<File>,
    pub(super) at: Position,
}

/// A connector of a node.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct Vertex {
    pub(super) node: usize,
    pub(super) connector: String,
}

impl Tree {
    /// The connector called `name` of the node; that of the dictionary for a reference to one.
    pub(super) fn vertex(&self, node: usize, name: &str) -> Vertex {
        let node = match self.nodes[node].content {
            Content::Reference(dictionary) => dictionary,
            _ => node,
        };
        Vertex { node, connector: name.to_owned() }
    }

    /// The description of the FMU that the node is.
    pub(super) fn description(&self, node: usize) -> Option<&ModelDescription> {
        match self.nodes[node].content {
            Content::Fmu(index) => Some(&self.fmus[index].description),
            _ => None,
        }
    }

    /// The variable behind a connector of an FMU.
    pub(super) fn variable(&self, vertex: &Vertex) -> Option<&ScalarVariable> {
        self.description(vertex.node)?.variable(&vertex.connector)
    }

    /// The connector as its file states it.
    pub(super) fn connector(&self, node: usize, name: &str) -> Option<&Connector> {
        self.nodes[node].connectors.iter().find(|connector| connector.name == name)
    }

    /// What the file states of the values at a connector, and what the FMU says.
    pub(super) fn measures(&self, vertex: &Vertex) -> (Measure, Measure) {
        let node = &self.nodes[vertex.node];
        let connector = self.connector(vertex.node, &vertex.connector);
        let kind = connector.and_then(|connector| connector.kind_of_value.as_ref());
        let stated = Measure::stated(kind, &node.file.definitions);
        let own = self.variable(vertex).zip(self.description(vertex.node));
        let own = own.map(|(variable, fmu)| Measure::of_variable(variable, fmu));
        (stated, own.unwrap_or_default())
    }

    /// What is known of the values at a connector: what is stated, else what the FMU says.
    pub(super) fn measure(&self, vertex: &Vertex) -> Measure {
        let (stated, own) = self.measures(vertex);
        stated.or(own)
    }

    /// Name of a connector for messages.
    pub(super) fn name(&self, vertex: &Vertex) -> String {
        match self.nodes[vertex.node].path.as_str() {
            "" => vertex.connector.clone(),
            path => format!("{path}.{}", vertex.connector),
        }
    }
}
