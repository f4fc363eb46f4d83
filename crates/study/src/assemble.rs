//! Builds a system of connected FMUs from a configuration.

use crate::error::Error;
use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;

use master::{Slave, System, Transformation};
use ssp::structure::DefaultExperiment;
use ssp::{Element, Link, Opened, Terminal};

use crate::assembly_options::AssemblyOptions;
use crate::config::{ConnectionEntry, LoadedConfig, Solver};
use crate::instances::instantiate;
use crate::link::{link as link_ports, link_others};

/// A connected system before initialisation.
pub struct AssembledSystem {
    /// The FMUs and their connections.
    pub system: System,
    /// Times and base step that the system structure states.
    pub experiment: DefaultExperiment,
    /// FMUs by name, each with the communication step in s that the system structure proposes for it.
    pub steps: Vec<(String, f64)>,
    /// Whether the system structure requests libcosim's fixed-step algorithm.
    pub fixed_step: bool,
    /// The system structure, whose folders contain the unpacked FMUs; keep it as long as the system.
    pub opened: Option<Arc<Opened>>,
    /// FMUs by name that the master integrates by model exchange, with the method.
    pub integrated: Vec<(String, Solver)>,
}

/// Loads the FMUs of the configuration, connects them and applies the settings.
///
/// # Errors
///
/// Returns an error if a file cannot be read, the system has no FMU, an FMU cannot be instantiated, or a
/// connection or a setting does not fit.
pub fn assemble(
    loaded: &LoadedConfig,
    options: &AssemblyOptions<'_>,
) -> Result<AssembledSystem, Error> {
    assemble_with(loaded, options, Vec::new())
}

/// Like [`assemble`], with further `slaves`, by name, that are not FMUs. With slaves, the system needs no FMU.
///
/// # Errors
///
/// Same as [`assemble`]; also if a slave has the name of an FMU or of another slave.
pub fn assemble_with(
    loaded: &LoadedConfig,
    options: &AssemblyOptions<'_>,
    slaves: Vec<(String, Box<dyn Slave>)>,
) -> Result<AssembledSystem, Error> {
    let config = &loaded.config;
    if config.isolation.isolate != Some(true) {
        for library in &config.preload {
            fmu_import::preload(library.as_ref())?;
        }
    }
    let shared = |path: &Path| match options.store {
        Some(store) => store.system(path, || open(path)),
        None => open(path).map(Arc::new),
    };
    let opened = config.system.as_deref().map(shared).transpose()?;
    let (mut assembly, experiment, steps, fixed_step) = match opened.as_deref() {
        Some(opened) => {
            (opened.assembly.clone(), opened.experiment, opened.steps.clone(), opened.fixed_step)
        }
        None => Default::default(),
    };
    for (name, path) in &config.fmus.0 {
        match assembly.elements.iter_mut().find(|element| element.name == *name) {
            Some(element) => (element.fmu, element.shown) = (path.clone(), None),
            None => assembly.elements.push(element(name, path)),
        }
    }
    if assembly.elements.is_empty() && slaves.is_empty() {
        return Err(Error::Invalid(match &config.system {
            Some(path) => {
                format!("{}: the system has no FMU, expected at least one", path.display())
            }
            None => "the system has no FMU, expected `system` or an entry of [fmus]".to_owned(),
        }));
    }
    let (mut system, integrated) = instantiate(&assembly.elements, config, options)?;
    for (name, function) in &assembly.functions {
        system.add(name, Box::new(function.slave()))?;
    }
    for (name, slave) in slaves {
        system.add(&name, slave)?;
    }
    // Structural parameters come first: they determine the elements of arrays.
    apply_settings(&mut system, loaded, &assembly.elements, true)?;
    connect(&mut system, loaded, &assembly.links, options.by_unit)?;
    apply_settings(&mut system, loaded, &assembly.elements, false)?;
    Ok(AssembledSystem { system, experiment, steps, fixed_step, opened, integrated })
}

/// Applies the settings of structural parameters or, if `structural` is false, of all other variables: first the
/// settings of the system structure, then the settings of the configuration, which override the former.
fn apply_settings(
    system: &mut System,
    loaded: &LoadedConfig,
    elements: &[Element],
    structural: bool,
) -> Result<(), Error> {
    for element in elements {
        for setting in &element.settings {
            let name = format!("{}.{}", element.name, setting.variable);
            if system.is_structural(&name) != structural {
                continue;
            }
            match system.terminal(&element.name, &setting.variable) {
                Ok(port) => system.set_port(port, &setting.value)?,
                // A whole array, or an unknown variable.
                Err(_) => system.set(&name, &setting.value)?,
            }
        }
    }
    for (name, value, place) in &loaded.config.settings.0 {
        if system.is_structural(name) == structural {
            let set = system.set(name, &value.to_string());
            set.map_err(|error| loaded.point(place, error))?;
        }
    }
    Ok(())
}

/// Opens the system structure on which the configuration builds, and logs its warnings.
fn open(path: &Path) -> Result<Opened, Error> {
    let opened = ssp::open(path)?;
    for warning in &opened.warnings {
        if names_file(warning, path) {
            tracing::warn!("{warning}");
        } else {
            tracing::warn!("{}: {warning}", path.display());
        }
    }
    Ok(opened)
}

/// Whether a warning about the system structure at `path` starts with the path of a file in the same folder or below.
fn names_file(warning: &str, path: &Path) -> bool {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    folder.is_some_and(|folder| Path::new(warning).starts_with(folder))
}

fn element(name: &str, path: &Path) -> Element {
    Element { name: name.to_owned(), fmu: path.to_owned(), ..Element::default() }
}

/// Makes the connections. A connection of the configuration takes precedence over a connection in `links` to the same
/// input. If the configuration states neither connections nor a system structure, connects variables of equal names
/// and, with `by_unit`, of equal units.
fn connect(
    system: &mut System,
    loaded: &LoadedConfig,
    links: &[Link],
    by_unit: bool,
) -> Result<(), Error> {
    let config = &loaded.config;
    let mut replaced = HashSet::new();
    let mut stated_links = Vec::new();
    for entry in config.connections.iter().flatten() {
        let ConnectionEntry { from, to, factor, offset } = entry.get_ref();
        let pairs = system.pairs(from.get_ref(), to.get_ref()).map_err(|error| {
            let is_known = system.pairs(from.get_ref(), from.get_ref()).is_ok();
            let place = if is_known { to.span() } else { from.span() };
            loaded.point(&place, error)
        })?;
        let terminal = |port: master::Port| Terminal {
            element: system.slaves[port.slave].0.clone(),
            variable: system.variable(port).name.clone(),
        };
        let stated = factor.is_some() || offset.is_some();
        let linear =
            Transformation::Linear { factor: factor.unwrap_or(1.0), offset: offset.unwrap_or(0.0) };
        for (from, to) in pairs {
            replaced.insert(system.holder(to));
            let transformation = if stated { linear.clone() } else { Transformation::Identity };
            let link = Link {
                from: terminal(from),
                to: terminal(to),
                transformation,
                units_settled: stated,
            };
            stated_links.push((entry.span(), link));
        }
    }
    for link in links {
        link_others(system, link, &replaced)?;
    }
    for (place, link) in &stated_links {
        link_ports(system, link).map_err(|error| loaded.point(place, error))?;
    }
    let unstated = config.connections.is_none() && config.system.is_none();
    if unstated && system.slaves.len() > 1 { connect_unstated(system, by_unit) } else { Ok(()) }
}

/// Connects variables of equal names and, with `by_unit`, of equal units; warns about each connection by unit, and if
/// there are no connections.
fn connect_unstated(system: &mut System, by_unit: bool) -> Result<(), Error> {
    let by_name = system.connect_equal_names()?;
    let by_unit = if by_unit { system.connect_equal_units()? } else { Vec::new() };
    for connection in &by_unit {
        let (from, to) = (system.name(connection.from), system.name(connection.to));
        tracing::warn!(
            "{from} and {to} are connected because no other free output and input have their unit; \
             --connect states connections instead"
        );
    }
    if by_name + by_unit.len() == 0 {
        tracing::warn!("nothing is connected: no output has the name of an input of another FMU");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::parse;
    use ssp::Function;

    #[test]
    fn a_connection_of_the_file_replaces_the_elements_of_an_array_that_the_structure_connects() {
        let terminal = |element: &str, variable: &str| Terminal {
            element: element.to_owned(),
            variable: variable.to_owned(),
        };
        let link = Link {
            from: terminal("a", "out"),
            to: terminal("sum", "in"),
            transformation: Transformation::Identity,
            units_settled: true,
        };
        let sources = |from: &str, to: &str| {
            let mut system = System::default();
            for name in ["a", "b"] {
                let vector = Function::VectorSum { inputs: 1, dimension: 2 };
                system.add(name, Box::new(vector.slave())).unwrap();
            }
            system.add("sum", Box::new(Function::Sum { inputs: 2 }.slave())).unwrap();
            let text = format!("[[connections]]\nfrom = '{from}'\nto = '{to}'\n");
            let config = parse(&text, Path::new("system.toml")).unwrap();
            let loaded = LoadedConfig { config, source: None };
            connect(&mut system, &loaded, std::slice::from_ref(&link), false).unwrap();
            ["sum.in[0]", "sum.in[1]"].map(|input| {
                let input = system.port(input).unwrap();
                system.name(system.source(input).unwrap().from)
            })
        };
        assert_eq!(sources("b.out", "sum.in"), ["b.out[0]", "b.out[1]"]);
        assert_eq!(sources("b.out[1]", "sum.in[1]"), ["a.out[0]", "b.out[1]"]);
    }

    #[test]
    fn a_variable_of_an_element_with_the_name_of_the_folder_is_no_file() {
        let system = Path::new("plant/system.ssp");
        assert!(names_file("plant/system.ssp/resources/a.ssv: no content", system));
        assert!(names_file("plant/system.ssp: no content", system));
        assert!(!names_file("plant.u is connected, but is no connector", system));
        assert!(!names_file("a.u is connected, but is no connector", Path::new("system.ssp")));
    }
}
