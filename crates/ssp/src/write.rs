//! Exports an assembly as an SSP archive.

mod archive;

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};

use fmu_description::package::Unpacked;
use fmu_description::unit::BaseUnit;
use fmu_description::{Causality, Dimension as Extent, Kind, ModelDescription, ScalarVariable};

use super::conversion::{Measure, items_of};
use super::error::{SspError, missing};
use super::flatten::kind_of;
use super::render::{render_ssd, render_ssv};
use super::structure::{
    Component, Connection, Connector, Conversion, DefaultExperiment, Definitions, Dimension,
    Element, ElementBase, End, Enumeration, Parameter, ParameterBinding, ParameterSet,
    ParameterValue, Source, System, SystemStructure, Transformation as Stated, Type, Unit,
};
use crate::assembly::{Assembly, Link, Setting, Terminal};
use archive::Archive;
use slave::Transformation;

/// Name of every parameter set. Ecos applies parameter sets by name.
const SETTINGS: &str = "settings";
/// `generationTool` of exported files.
pub(super) const TOOL: &str = "aso-ftc";

/// Writes `assembly` as the SSP archive `target`; creates the folder of `target`.
///
/// The FMUs go into `resources`, each with all its files. An archive is copied, including an archive from which
/// [`crate::open`] has unpacked an FMU; any other folder is packed. The settings of each element go into a parameter
/// set `settings` in a separate file, bound to the component. Connectors are the connected variables and the outputs of
/// type Real, Integer and Boolean, with the types and units of the FMUs; connectors of arrays have dimensions (SSP
/// 2.0). `step_size` in s goes into the annotation that libcosim reads. Equal assemblies and FMUs give equal bytes.
///
/// # Errors
///
/// [`SspError`] if the assembly has a function, if two elements have the same name, if an element or
/// variable does not exist, if a connected variable is local or the independent variable, if a setting does
/// not have the type of its variable or this type is not one of SSP 1.0, if the archive would exceed 2 GiB, or
/// if a file cannot be read or written.
pub fn write(assembly: &Assembly, step_size: Option<f64>, target: &Path) -> Result<(), SspError> {
    if let Some((name, _)) = assembly.functions.first() {
        return Err(missing(name, "an FMU", "a function, which SSP does not have"));
    }
    let mut writer = Exporter::default();
    let ends = assembly.links.iter().flat_map(|link| [&link.from, &link.to]);
    let linked = ends.map(|end| (end.element.as_str(), end.variable.as_str())).collect();
    for element in &assembly.elements {
        writer.element(element, &linked)?;
    }
    let connections = assembly.links.iter().map(|link| writer.connection(link));
    let connections = connections.collect::<Result<_, SspError>>()?;
    let name = assembly.name.clone().unwrap_or_else(|| "System".to_owned());
    let base = ElementBase { name: name.clone(), ..ElementBase::default() };
    let structure = SystemStructure {
        name,
        system: System { base, elements: writer.elements, connections, dictionaries: Vec::new() },
        definitions: writer.definitions,
        experiment: Some(DefaultExperiment {
            start_time: assembly.start_time,
            stop_time: assembly.stop_time,
            step_size,
        }),
        generation_tool: Some(TOOL.to_owned()),
    };
    writer.archive.write(&render_ssd(&structure), target)
}

/// Pairs of element and variable that are connected.
type Linked<'a> = HashSet<(&'a str, &'a str)>;

/// The data collected during an export.
#[derive(Default)]
struct Exporter {
    archive: Archive,
    elements: Vec<Element>,
    definitions: Definitions,
    descriptions: HashMap<String, ModelDescription>,
    /// Path of each FMU in the archive.
    fmus: BTreeMap<PathBuf, String>,
}

impl Exporter {
    fn element(
        &mut self,
        element: &crate::assembly::Element,
        linked: &Linked<'_>,
    ) -> Result<(), SspError> {
        let path = element.complete();
        let fmu = if path.is_dir() { Unpacked::in_folder(path)? } else { Unpacked::open(path)? };
        let source = if let Some(known) = self.fmus.get(path) {
            known.clone()
        } else {
            let added = self.archive.add_fmu(path, &fmu)?;
            self.fmus.insert(path.to_owned(), added.clone());
            added
        };
        let description = fmu.description.clone();
        let connectors = self.connectors(&element.name, &description, linked)?;
        let bindings = self.bindings(&element.name, &element.settings, &description)?;
        let (name, base) = (element.name.clone(), ElementBase::default());
        if self.descriptions.insert(name.clone(), description).is_some() {
            return Err(missing(&name, "a name that no other element has", "a second one"));
        }
        let base = ElementBase { name, connectors, bindings, ..base };
        let implementation = element.implementation;
        let component = Component { base, source, implementation, ..Component::default() };
        self.elements.push(Element::Component(component));
        Ok(())
    }

    fn connectors(
        &mut self,
        element: &str,
        description: &ModelDescription,
        linked: &Linked<'_>,
    ) -> Result<Vec<Connector>, SspError> {
        let mut connectors = Vec::new();
        for variable in &description.variables {
            let is_shown = variable.causality == Causality::Output
                && matches!(variable.kind, Kind::Real(_) | Kind::Integer(_) | Kind::Boolean(_));
            if !is_shown && !linked.contains(&(element, variable.name.as_str())) {
                continue;
            }
            let kind = kind_of(variable.causality).ok_or_else(|| {
                let causality = variable.causality.as_str();
                missing(format!("{element}.{}", variable.name), "an input or an output", causality)
            })?;
            connectors.push(Connector {
                name: variable.name.clone(),
                kind,
                kind_of_value: self.value_type(variable, description),
            });
        }
        Ok(connectors)
    }

    /// Returns the type of a variable and adds its unit or enumeration to the definitions. For an array, states only
    /// the dimensions: importers take type and unit from the FMU. Leaves out a unit that the FMU does not define, or
    /// that another FMU defines differently. Returns `None` for a type that SSP 1.0 does not have, and for an
    /// enumeration that is unknown or that another FMU defines differently.
    fn value_type(
        &mut self,
        variable: &ScalarVariable,
        description: &ModelDescription,
    ) -> Option<Type> {
        if !variable.dimensions.is_empty() {
            let size = |extent: &Extent| match extent {
                Extent::Fixed(size) => Dimension::Size(*size),
                // The size is a structural parameter: it has no connector to refer to, and a setting may change its
                // value.
                Extent::Variable(_) => Dimension::Open,
            };
            return Some(Type::Array(variable.dimensions.iter().map(size).collect()));
        }
        match &variable.kind {
            Kind::Real(real) => {
                let unit = real.unit.as_ref().and_then(|name| {
                    let unit = description.units.iter().find(|unit| unit.name == *name)?;
                    let base = unit.base?;
                    let units = &mut self.definitions.units;
                    match units.iter().find(|known| known.name == *name) {
                        Some(known) if known.base != base => return None,
                        Some(_) => {}
                        None => units.push(Unit { name: name.clone(), base }),
                    }
                    Some(name.clone())
                });
                Some(Type::Real(unit))
            }
            Kind::Integer(_) => Some(Type::Integer),
            Kind::Boolean(_) => Some(Type::Boolean),
            Kind::String(_) => Some(Type::String),
            Kind::Enumeration(kind) => {
                let name = kind.declared_type.as_ref()?;
                let declared = description.types.iter().find(|declared| declared.name == *name)?;
                let enumeration = Enumeration { name: name.clone(), items: items_of(declared) };
                let known = &mut self.definitions.enumerations;
                match known.iter().find(|enumeration| enumeration.name == *name) {
                    Some(other) if *other != enumeration => return None,
                    Some(_) => {}
                    None => known.push(enumeration),
                }
                Some(Type::Enumeration(name.clone()))
            }
            // SSP 1.0 has no other types.
            _ => None,
        }
    }

    fn bindings(
        &mut self,
        element: &str,
        settings: &[Setting],
        description: &ModelDescription,
    ) -> Result<Vec<ParameterBinding>, SspError> {
        let mut parameters: Vec<Parameter> = Vec::new();
        for setting in settings {
            let name = setting.variable.clone();
            let parameter = Parameter { value: value(element, setting, description)?, name };
            match parameters.iter_mut().find(|known| known.name == parameter.name) {
                Some(known) => *known = parameter,
                None => parameters.push(parameter),
            }
        }
        if parameters.is_empty() {
            return Ok(Vec::new());
        }
        let definitions = Definitions::default();
        let set = ParameterSet { name: SETTINGS.to_owned(), parameters, definitions };
        let uri = self.archive.add(&format!("{element}.ssv"), render_ssv(&set).into_bytes());
        let values = Source::File { uri, in_component: false };
        let at = ElementBase::default().at;
        Ok(vec![ParameterBinding { prefix: String::new(), values, mapping: None, at }])
    }

    fn connection(&self, link: &Link) -> Result<Connection, SspError> {
        let from = self.unit(&link.from)?;
        let to = self.unit(&link.to)?;
        let transformation = match &link.transformation {
            Transformation::Identity => None,
            Transformation::Linear { factor, offset } => {
                Some(Stated::Linear { factor: *factor, offset: *offset })
            }
            Transformation::Integer(pairs) => Some(Stated::Integer(pairs.clone())),
            Transformation::Boolean { from_false, from_true } => {
                Some(Stated::Boolean(vec![(false, *from_false), (true, *from_true)]))
            }
        };
        let end = |terminal: &Terminal| End {
            element: Some(terminal.element.clone()),
            connector: terminal.variable.clone(),
        };
        Ok(Connection {
            start: end(&link.from),
            end: end(&link.to),
            conversion: Conversion {
                transformation,
                suppress_units: link.units_settled && from != to,
            },
            ..Connection::default()
        })
    }

    /// Returns name and definition of the unit of a variable, if it has a unit; an error for a missing variable.
    fn unit(&self, terminal: &Terminal) -> Result<Option<(String, Option<BaseUnit>)>, SspError> {
        let known = self.descriptions.get(&terminal.element);
        let description = known.ok_or_else(|| {
            missing(terminal.to_string(), "an element of the assembly", &terminal.element)
        })?;
        let variable = description.variable(&terminal.variable).ok_or_else(|| {
            let expected = format!("a variable of {}", description.model_name);
            missing(terminal.to_string(), expected, "none of that name")
        })?;
        Ok(Measure::of_variable(variable, description).unit)
    }
}

/// Converts a setting to a value of the type of its variable. Returns an error if the variable does not exist, if SSP
/// 1.0 does not have its type, or if the value is not one of this type.
fn value(
    element: &str,
    setting: &Setting,
    description: &ModelDescription,
) -> Result<ParameterValue, SspError> {
    let (name, text) = (format!("{element}.{}", setting.variable), setting.value.trim());
    let wrong = |expected: &str| missing(&name, expected, format!("{:?}", setting.value));
    let variable = description.variable(&setting.variable).ok_or_else(|| {
        missing(&name, format!("a variable of {}", description.model_name), "none of that name")
    })?;
    Ok(match &variable.kind {
        Kind::Real(_) => {
            let value = text.parse().ok().filter(|value: &f64| value.is_finite());
            ParameterValue::Real(value.ok_or_else(|| wrong("a finite number"))?, None)
        }
        Kind::Integer(_) => ParameterValue::Integer(text.parse().map_err(|_| wrong("an integer"))?),
        Kind::Boolean(_) => ParameterValue::Boolean(match text {
            "true" | "1" => true,
            "false" | "0" => false,
            _ => return Err(wrong("true or false")),
        }),
        Kind::String(_) => ParameterValue::String(setting.value.clone()),
        Kind::Enumeration(kind) => {
            let declared = description
                .types
                .iter()
                .find(|declared| Some(&declared.name) == kind.declared_type.as_ref());
            let items = declared.map(|declared| declared.items.as_slice()).unwrap_or_default();
            let number = text.parse::<i64>().ok();
            let item = items.iter().find(|(name, value)| name == text || Some(*value) == number);
            let (item, _) = item.ok_or_else(|| wrong("an item of its enumeration"))?;
            ParameterValue::Enumeration(item.clone(), None)
        }
        _ => return Err(wrong("a variable of a type of SSP 1.0")),
    })
}
