//! System Structure and Parameterization (SSP 1.0.1 and 2.0): SSD, SSV, SSM and SSB files and SSP
//! archives; also `OspSystemStructure.xml` of the Open Simulation Platform.
//!
//! [`open`] loads a system structure as an [`Assembly`]; [`write()`] exports an assembly as an SSP.
//! [`read_ssd`], [`read_ssv`], [`read_ssm`] and [`read_ssb`] parse single files.
#![forbid(unsafe_code)]

mod assembly;
mod conversion;
mod error;
mod flatten;
mod function;
mod load;
mod osp;
mod parameters;
mod read;
mod render;
mod schema;
mod source;
pub mod structure;
mod tree;
mod write;
mod xml;

use std::collections::HashSet;
use std::path::Path;

use fmu_description::Kind;
use fmu_description::package::{TemporaryFolder, Unpacked};

pub use assembly::{Assembly, Element, Link, Origin, Setting, Terminal};
pub use error::SspError;
pub use function::{Function, FunctionSlave};
pub use read::{read_ssb, read_ssd, read_ssm, read_ssv};
pub use render::{render_ssb, render_ssd, render_ssm, render_ssv};
pub use write::write;

use conversion::contradiction;
use flatten::Flow;
use structure::{DefaultExperiment, Type};
use tree::{Content, Tree, Vertex};

/// A loaded system structure with its unpacked FMUs.
#[derive(Debug)]
pub struct Opened {
    /// The FMUs, their settings and their connections. The paths of the FMUs are folders with unpacked FMUs. These
    /// folders, and the unpacked archives of an SSP, exist as long as [`Opened::folders`].
    pub assembly: Assembly,
    /// Start time, stop time and base step that the file states. The base step of an OSP file without one is 0.1 s.
    pub experiment: DefaultExperiment,
    /// Names of elements with the communication step in s that the file proposes for them: the annotation
    /// `osp:StepSizeHint`, or `stepSize` of an OSP file, rounded down to a multiple of the base step.
    pub steps: Vec<(String, f64)>,
    /// Whether the file requests libcosim's fixed-step algorithm: all FMUs step from the same values,
    /// inputs are constant within a step, and no step is repeated. True for every OSP file, and for an SSD
    /// with `osp:FixedStepAlgorithm` unless this program has written it.
    pub fixed_step: bool,
    /// Warnings about the files.
    pub warnings: Vec<String>,
    /// The unpacked files, removed on drop. Unload the libraries of the FMUs before dropping them.
    pub folders: Folders,
}

/// The folders of unpacked archives, removed on drop.
#[derive(Debug)]
pub struct Folders {
    _fmus: Vec<Unpacked>,
    _packages: Vec<TemporaryFolder>,
}

/// Loads the system structure at `path`, unpacks its FMUs and flattens nested systems.
///
/// `path` is an SSP archive, an SSD file, or a folder with a file `SystemStructure.ssd`. A file `.xml`,
/// or a folder with `OspSystemStructure.xml` and without an SSD, is read in the format of libcosim,
/// with its functions and variable groups.
///
/// Elements of nested systems, other SSDs and SSPs become part of the assembly. Their names are joined by dots, without
/// the name of the root system. Along a path of connections, units are converted and transformations applied connection
/// by connection. Parameter bindings of outer systems override those of inner systems, later ones earlier ones.
///
/// # Errors
///
/// [`SspError`] if a file cannot be read or exceeds a limit, if an FMU has no library for this platform,
/// or, with line and column, if the content of a file is invalid, contradictory or not supported.
pub fn open(path: &Path) -> Result<Opened, SspError> {
    let is_xml = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("xml"));
    if is_xml || osp::is_osp_folder(path) {
        return osp::open(path);
    }
    open_variant(path, None)
}

/// Same as [`open`] for an SSP archive or a folder, but loads the SSD called `variant` from it; `None` selects
/// `SystemStructure.ssd`. If `path` is an SSD file, `variant` is ignored. OSP files are not supported.
///
/// # Errors
///
/// Same as [`open`]; also if there is no SSD called `variant`.
pub fn open_variant(path: &Path, variant: Option<&str>) -> Result<Opened, SspError> {
    let (mut tree, document) = load::load(path, variant)?;
    let mut warnings = std::mem::take(&mut tree.warnings);
    check_connectors(&tree, &mut warnings);
    let flow = Flow::new(&tree, &mut warnings)?;
    let mut settings = parameters::settings(&tree, &flow, &mut warnings)?;
    let is_set = |input: &Vertex| {
        let mut of_node = settings.get(&input.node).into_iter().flatten();
        of_node.any(|setting| setting.variable == input.connector)
    };
    let links = flow.links(&tree, is_set, &mut warnings)?;
    let experiment = document.structure.experiment.unwrap_or_default();
    let (mut elements, mut steps, mut names) = (Vec::new(), Vec::new(), HashSet::new());
    for (index, node) in tree.nodes.iter().enumerate() {
        let Content::Fmu(fmu) = node.content else { continue };
        if !names.insert(node.path.as_str()) {
            let sentence = format!("two components have the hierarchical name {}", node.path);
            return Err(error::semantic_error(node.at.0, sentence).in_file(&node.file.shown));
        }
        elements.push(Element {
            name: node.path.clone(),
            fmu: tree.fmus[fmu].folder().to_owned(),
            shown: Some(tree.shown[fmu].clone()),
            origin: Origin::of(&tree.fmus[fmu]),
            settings: settings.remove(&index).unwrap_or_default(),
            implementation: node.implementation,
        });
        steps.extend(node.step_size.map(|size| (node.path.clone(), size)));
    }
    let assembly = Assembly {
        name: Some(document.structure.name.clone()),
        elements,
        links,
        functions: Vec::new(),
        start_time: experiment.start_time,
        stop_time: experiment.stop_time,
    };
    // This program writes the step as libcosim's annotation, without a request for an algorithm.
    let is_own = document.structure.generation_tool.as_deref() == Some(write::TOOL);
    let fixed_step = experiment.step_size.is_some() && !is_own;
    let folders = Folders { _fmus: tree.fmus, _packages: tree.folders };
    Ok(Opened { assembly, experiment, steps, fixed_step, warnings, folders })
}

/// Warns about connectors of components that name no variable of their FMU, have a type that FMI 2.0 does
/// not have, or contradict the unit or type of their variable.
fn check_connectors(tree: &Tree, warnings: &mut Vec<String>) {
    for (index, node) in tree.nodes.iter().enumerate() {
        let Content::Fmu(_) = node.content else { continue };
        let mut missing = Vec::new();
        for connector in &node.connectors {
            let vertex = Vertex { node: index, connector: connector.name.clone() };
            let name = tree.name(&vertex);
            let kind = connector.kind_of_value.as_ref();
            if tree.is_terminal(&vertex) {
                continue;
            }
            if let Some(words) = kind.and_then(Type::beyond_fmi2)
                && tree.is_before_fmi3(vertex.node)
            {
                warnings.push(format!("{name} is {words}, which FMI 2.0 does not have: skipped"));
                continue;
            }
            let Some(variable) = tree.variable(&vertex) else {
                missing.push(connector.name.as_str());
                continue;
            };
            let (stated, declared) = tree.measures(&vertex);
            warnings
                .extend(contradiction(&stated, &declared).map(|text| format!("{name}: {text}")));
            let stated = connector.kind_of_value.as_ref().and_then(element);
            let declared = variable.kind.element();
            // Numbers of every width count as one type, as in `Type`.
            let of_ssp = match &variable.kind {
                Kind::Float32(_) => "Real",
                Kind::Enumeration(_) => "Enumeration",
                kind if kind.as_integer().is_some() => "Integer",
                _ => declared,
            };
            if let Some(stated) = stated.filter(|stated| *stated != of_ssp) {
                warnings.push(format!(
                    "{name} is of type {stated} in the system structure and {declared} in the FMU"
                ));
            }
        }
        if !missing.is_empty() {
            let names = parameters::listed(&missing);
            warnings.push(format!("{}: the FMU has no variable {names}", node.path));
        }
    }
}

/// Returns the XML element of a type that is one element; `None` for clocks and arrays.
fn element(kind: &Type) -> Option<&'static str> {
    match kind {
        Type::Real(_) => Some("Real"),
        Type::Integer => Some("Integer"),
        Type::Boolean => Some("Boolean"),
        Type::String => Some("String"),
        Type::Enumeration(_) => Some("Enumeration"),
        Type::Binary => Some("Binary"),
        Type::Clock | Type::Array(_) | Type::Clocked(_) => None,
    }
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
