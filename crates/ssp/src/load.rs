//! Loads a system structure from files into a [`Tree`].

pub(super) mod files;

use std::path::Path;
use std::rc::Rc;

use fmu_description::limits::{HELP, exceeds};
use fmu_description::package::Unpacked;

use super::error::{SspError, semantic_error};
use super::read::{read_ssm, read_ssv};
use super::source::{Base, Target};
use super::structure::{
    Component, Connector, ConnectorKind, Content as Kind, DictionaryReference, DictionarySource,
    Element, ElementBase, Implementation, ParameterBinding, System,
};
use super::tree::{Binding, Content, Document, File, Node, Tree};
use files::Files;

/// Maximum nesting of systems over all files.
const DEPTH: usize = 64;
/// Maximum number of elements of all systems.
const ELEMENTS: usize = 100_000;
/// Maximum number of elements, connectors, connections and parameters of all instances.
const PARTS: usize = 2_000_000;

/// The position of a new node in the tree.
struct Place<'a> {
    parent: Option<usize>,
    path: String,
    depth: usize,
    /// The component that refers to the system, and the file that contains this component.
    outer: Option<(&'a ElementBase, &'a Rc<File>)>,
}

/// Reads the SSD or the SSP at `path` and all files to which it refers.
pub(super) fn load(path: &Path, variant: Option<&str>) -> Result<(Tree, Rc<Document>), SspError> {
    let mut loader = Loader::default();
    let document = loader.files.document(&Target {
        path: path.to_owned(),
        shown: path.to_owned(),
        fragment: variant.map(str::to_owned),
        warning: None,
    })?;
    let place = Place { parent: None, path: String::new(), depth: 0, outer: None };
    loader.system(&document.structure.system, &document, place)?;
    let Loader { tree, files: Files { fmus, shown, folders, warnings, .. }, .. } = loader;
    let variables = fmus.iter().map(|fmu| {
        // Reversed, so that the first of several variables with the same name remains in the map.
        let all = fmu.description.variables.iter().enumerate().rev();
        all.map(|(position, variable)| (variable.name.clone(), position)).collect()
    });
    let variables = variables.collect();
    Ok((Tree { fmus, variables, shown, folders, warnings, ..tree }, document))
}

#[derive(Default)]
struct Loader {
    tree: Tree,
    files: Files,
    parts: usize,
}

impl Loader {
    fn count(&mut self, parts: usize) -> Result<(), SspError> {
        self.parts = self.parts.saturating_add(parts).saturating_add(1);
        for (count, limit, what) in [
            (self.tree.nodes.len(), ELEMENTS, "elements"),
            (self.parts, PARTS, "connectors and parameters"),
        ] {
            if exceeds(count, limit) {
                return Err(SspError::Limit { limit, what, help: HELP });
            }
        }
        Ok(())
    }

    fn add(
        &mut self,
        base: &ElementBase,
        place: Place<'_>,
        file: &Rc<File>,
    ) -> Result<usize, SspError> {
        self.count(base.connectors.len())?;
        let positions = base.connectors.iter().enumerate().rev();
        let positions =
            positions.map(|(position, connector)| (connector.name.clone(), position)).collect();
        self.tree.nodes.push(Node {
            path: place.path,
            parent: place.parent,
            file: file.clone(),
            at: base.at,
            connectors: base.connectors.clone(),
            connector_positions: positions,
            ..Node::default()
        });
        Ok(self.tree.nodes.len() - 1)
    }

    fn system(
        &mut self,
        system: &System,
        document: &Rc<Document>,
        place: Place<'_>,
    ) -> Result<usize, SspError> {
        let (file, at) = (&document.file, system.base.at.0);
        let (depth, outer) = (place.depth, place.outer);
        if depth == DEPTH {
            let sentence = format!("systems are nested in each other {DEPTH} times");
            return Err(semantic_error(at, sentence).in_file(&file.shown));
        }
        let path = place.path.clone();
        let node = self.add(&system.base, place, file)?;
        self.count(system.connections.len())?;
        self.tree.nodes[node].connections.clone_from(&system.connections);
        let mut bindings = self.bindings(&system.base.bindings, file, None)?;
        if let Some((outer, outer_file)) = outer {
            self.tree.nodes[node].outside = Some((outer.connectors.clone(), outer_file.clone()));
            bindings.extend(self.bindings(&outer.bindings, outer_file, Some(&file.base))?);
        }
        self.tree.nodes[node].bindings = bindings;
        for dictionary in &system.dictionaries {
            let index = self.dictionary(dictionary, file, node)?;
            self.tree.nodes[node].dictionaries.insert(dictionary.name.clone(), index);
        }
        for element in &system.elements {
            let name = &element.base().name;
            let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
            let place = Place { parent: Some(node), path, depth: depth + 1, outer: None };
            let index = match element {
                Element::System(system) => self.system(system, document, place)?,
                Element::Component(component) => self.component(component, document, place)?,
                Element::Dictionary(reference) => self.reference(reference, file, place)?,
            };
            self.tree.nodes[node].children.insert(name.clone(), index);
        }
        Ok(node)
    }

    fn component(
        &mut self,
        component: &Component,
        document: &Rc<Document>,
        place: Place<'_>,
    ) -> Result<usize, SspError> {
        let (file, at) = (&document.file, component.base.at.0);
        let here = |sentence: String| semantic_error(at, sentence).in_file(&file.shown);
        let place = Place { outer: Some((&component.base, file)), ..place };
        if let Some(id) = component.source.strip_prefix('#') {
            let system = with_id(&document.structure.system, id);
            let system = system.ok_or_else(|| here(format!("no system has the id {id:?}")))?;
            return self.system(system, document, place);
        }
        if component.source.is_empty() {
            let name = &place.path;
            let sentence = format!("{name} has no source: it is nothing but its connectors");
            self.files.warnings.push(here(sentence).to_string());
            return self.add(&component.base, place, file);
        }
        let target = file.base.resolve(&component.source).map_err(here)?;
        if let Some(warning) = &target.warning {
            self.files.warnings.push(here(format!("{}: {warning}", place.path)).to_string());
        }
        if component.content == Kind::Fmu {
            return self.fmu(component, &target, file, place);
        }
        if component.content == Kind::Definition && target.fragment.is_some() {
            return Err(here(format!("expected a file, found {:?}", component.source)));
        }
        let archive = component.content == Kind::Package;
        let inner = self.files.referred(&target, &file.base, archive);
        let inner = inner.map_err(|error| error.in_file(&target.shown))?;
        self.system(&inner.structure.system, &inner, place)
    }

    fn fmu(
        &mut self,
        component: &Component,
        target: &Target,
        file: &Rc<File>,
        place: Place<'_>,
    ) -> Result<usize, SspError> {
        let here = |sentence: &str| {
            let sentence = format!("{}: {sentence}", component.base.name);
            semantic_error(component.base.at.0, sentence).in_file(&file.shown)
        };
        let index = self.files.fmu(target)?;
        let fmu = &self.files.fmus[index];
        check_runnable(fmu).map_err(|why| here(&format!("{}: {why}", target.shown.display())))?;
        let (stated, description) = (component.implementation, &fmu.description);
        let missing = match stated {
            Implementation::Any => None,
            Implementation::CoSimulation => {
                description.co_simulation.is_none().then_some("co-simulation")
            }
            Implementation::ModelExchange => {
                description.model_exchange.is_none().then_some("model exchange")
            }
            Implementation::ScheduledExecution => Some("scheduled execution"),
        };
        if let Some(missing) = missing {
            let has_steps = description.co_simulation.is_some();
            let other = if has_steps { "co-simulation" } else { "model exchange" };
            let sentence = format!(
                "the system structure asks for {missing}, which cannot be run with this FMU: its \
                 {other} is used"
            );
            self.files.warnings.push(here(&sentence).to_string());
        }
        let inside = Base::archive(self.files.fmus[index].folder(), &target.shown);
        let node = self.add(&component.base, place, file)?;
        let bindings = self.bindings(&component.base.bindings, file, Some(&inside))?;
        let added = &mut self.tree.nodes[node];
        added.content = Content::Fmu(index);
        (added.bindings, added.step_size) = (bindings, component.step_size);
        added.implementation = if missing.is_some() { Implementation::Any } else { stated };
        Ok(node)
    }

    fn dictionary(
        &mut self,
        source: &DictionarySource,
        file: &Rc<File>,
        system: usize,
    ) -> Result<usize, SspError> {
        let here = |sentence| semantic_error(source.at.0, sentence).in_file(&file.shown);
        let (dictionary, shown) =
            self.files.dictionary(&source.content, file).map_err(|error| error.or(here))?;
        let connectors = dictionary.entries.iter().map(|(name, kind)| Connector {
            name: name.clone(),
            kind: ConnectorKind::Inout,
            kind_of_value: Some(kind.clone()),
        });
        let base = ElementBase {
            name: source.name.clone(),
            connectors: connectors.collect(),
            at: source.at,
            ..ElementBase::default()
        };
        // As for parameter sets: what the dictionary does not define is looked up in the file around it.
        let mut definitions = dictionary.definitions;
        definitions.units.extend_from_slice(&file.definitions.units);
        definitions.enumerations.extend_from_slice(&file.definitions.enumerations);
        let definition = File { shown, base: file.base.clone(), definitions };
        let path = format!("{}.{}", self.tree.nodes[system].path, source.name);
        let path = path.trim_start_matches('.').to_owned();
        let place = Place { parent: Some(system), path, depth: 0, outer: None };
        let node = self.add(&base, place, &Rc::new(definition))?;
        self.tree.nodes[node].content = Content::Dictionary;
        Ok(node)
    }

    /// Adds a reference to a signal dictionary, which is searched in the parent system, then in the systems around it.
    /// Returns an error if the dictionary is not found.
    fn reference(
        &mut self,
        reference: &DictionaryReference,
        file: &Rc<File>,
        place: Place<'_>,
    ) -> Result<usize, SspError> {
        let mut system = place.parent;
        let dictionary = loop {
            let Some(index) = system else {
                let sentence = format!("no signal dictionary {:?}", reference.dictionary);
                return Err(semantic_error(reference.base.at.0, sentence).in_file(&file.shown));
            };
            let node = &self.tree.nodes[index];
            if let Some(node) = node.dictionaries.get(&reference.dictionary) {
                break *node;
            }
            system = node.parent;
        };
        let node = self.add(&reference.base, place, file)?;
        self.tree.nodes[node].content = Content::Reference(dictionary);
        Ok(node)
    }

    /// Loads the files of the bindings. `component` is the base of URIs relative to the component; without `component`,
    /// a binding with such a URI is an error.
    fn bindings(
        &mut self,
        bindings: &[ParameterBinding],
        file: &Rc<File>,
        component: Option<&Base>,
    ) -> Result<Vec<Binding>, SspError> {
        let mut loaded = Vec::new();
        for binding in bindings {
            let here =
                |sentence: String| semantic_error(binding.at.0, sentence).in_file(&file.shown);
            let files = &mut self.files;
            let values =
                files.content(&binding.values, file, component, |all| &mut all.values, read_ssv);
            let values = values.map_err(|error| error.or(here))?;
            let mapping = binding.mapping.as_ref().map(|mapping| {
                files.content(mapping, file, component, |all| &mut all.mappings, read_ssm)
            });
            let mapping = mapping.transpose().map_err(|error| error.or(here))?;
            self.count(values.parameters.len())?;
            self.count(mapping.as_ref().map_or(0, |mapping| mapping.entries.len()))?;
            let (prefix, at) = (binding.prefix.clone(), binding.at.0);
            loaded.push(Binding { prefix, values, mapping, file: file.clone(), at });
        }
        Ok(loaded)
    }
}

/// Returns an error sentence if the FMU has neither source code nor a library for this platform, or no interface
/// that a system can use. Loads no library.
pub(super) fn check_runnable(fmu: &Unpacked) -> Result<(), String> {
    // A library may be built from source code when the FMU is opened.
    if fmu.has_sources() && identifier(fmu).is_some() { Ok(()) } else { check_library(fmu) }
}

/// Returns an error sentence if the FMU has no library for this platform or no interface that a system can use.
fn check_library(fmu: &Unpacked) -> Result<(), String> {
    let identifier = identifier(fmu).ok_or_else(|| {
        "the FMU lacks an interface, expected the element CoSimulation or ModelExchange".to_owned()
    })?;
    fmu.library(identifier).map(|_| ()).map_err(|error| error.to_string())
}

/// Returns the name of the library for co-simulation, otherwise for model exchange; `None` if the FMU has neither.
fn identifier(fmu: &Unpacked) -> Option<&str> {
    let (simulation, exchange) = (&fmu.description.co_simulation, &fmu.description.model_exchange);
    let exchange = || exchange.as_ref().map(|flags| flags.model_identifier.as_str());
    simulation.as_ref().map(|flags| flags.model_identifier.as_str()).or_else(exchange)
}

/// Returns the first system with the identifier `id`, which is `system` or nested in it at any depth, if there is one.
fn with_id<'a>(system: &'a System, id: &str) -> Option<&'a System> {
    if system.base.id.as_deref() == Some(id) {
        return Some(system);
    }
    system.elements.iter().find_map(|element| match element {
        Element::System(inner) => with_id(inner, id),
        _ => None,
    })
}
