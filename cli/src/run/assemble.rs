//! From a configuration to a system of connected FMUs.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, bail};
use master::assembly::{Assembly, Element, Link, Terminal};
use master::ssp::structure::DefaultExperiment;
use master::ssp::{self, Folders};
use master::transformation::Transformation;
use master::{CallError, CallLog, Failure, Fmu, Instance, Slave, System, isolate};

use crate::config::{Config, Loaded, Wire};

/// A system, not yet initialised.
pub(crate) struct Assembled {
    pub(crate) system: System,
    /// What an SSP says of times and steps.
    pub(crate) experiment: DefaultExperiment,
    /// FMUs with the step in s that an SSP proposes.
    pub(crate) steps: Vec<(String, f64)>,
    /// What an SSP was unpacked to: is to outlive the system.
    pub(crate) folders: Option<Folders>,
}

/// What the command line adds to the configuration.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Making<'a> {
    /// FMUs log everything.
    pub(crate) logging: bool,
    /// Free outputs and inputs of equal units are connected.
    pub(crate) by_unit: bool,
    /// Where FMI calls are written.
    pub(crate) log_calls: Option<&'a CallLog>,
}

/// Loads and connects what the configuration names, and makes its settings.
pub(crate) fn assemble(loaded: &Loaded, making: &Making<'_>) -> anyhow::Result<Assembled> {
    let config = &loaded.config;
    if config.isolation.isolate != Some(true) {
        for library in &config.preload {
            master::preload(library.as_ref())?;
        }
    }
    let (mut assembly, experiment, steps, folders) = base(config)?;
    for (name, path) in &config.fmus.0 {
        match assembly.elements.iter_mut().find(|element| element.name == *name) {
            Some(element) => element.fmu.clone_from(path),
            None => assembly.elements.push(element(name, path)),
        }
    }
    if assembly.elements.is_empty() {
        bail!("there is no FMU in the system, expected `system` or an entry of [fmus]");
    }
    let mut system = instantiate(&assembly.elements, config, making)?;
    connect(&mut system, loaded, &assembly.links, making.by_unit)?;
    for element in &assembly.elements {
        for setting in &element.settings {
            let (element, variable) = (element.name.clone(), setting.variable.clone());
            let port = system.terminal(&Terminal { element, variable })?;
            system.set_port(port, &setting.value)?;
        }
    }
    for (name, value, place) in &config.settings.0 {
        let set = system.set(name, &value.to_string());
        set.map_err(|error| loaded.point(place, error))?;
    }
    Ok(Assembled { system, experiment, steps, folders })
}

type Base = (Assembly, DefaultExperiment, Vec<(String, f64)>, Option<Folders>);

/// The system that the configuration begins with.
fn base(config: &Config) -> anyhow::Result<Base> {
    let Some(path) = &config.system else {
        return Ok((Assembly::default(), DefaultExperiment::default(), Vec::new(), None));
    };
    let opened = ssp::open(path)?;
    for warning in &opened.warnings {
        tracing::warn!("{}: {warning}", path.display());
    }
    Ok((opened.assembly, opened.experiment, opened.steps, Some(opened.folders)))
}

fn element(name: &str, path: &Path) -> Element {
    Element { name: name.to_owned(), fmu: path.to_owned(), settings: Vec::new() }
}

/// Instantiates the FMUs.
fn instantiate(
    elements: &[Element],
    config: &Config,
    making: &Making<'_>,
) -> anyhow::Result<System> {
    let logging = making.logging;
    let limit = config.isolation.time_limit.as_ref().map(|limit| *limit.get_ref());
    let time_limit = limit.map(Duration::try_from_secs_f64).transpose().context("time-limit")?;
    let preload = config.preload.iter().map(Into::into).collect();
    let memory_limit = config.isolation.memory_limit.map(|memory| memory.0);
    if config.isolation.isolate != Some(true) {
        if memory_limit.is_some() {
            bail!("--memory-limit is for FMUs in processes of their own, expected --isolate");
        }
        if time_limit.is_some() {
            tracing::warn!(
                "--time-limit without --isolate cannot end a call that hangs: it is for answers that \
                 are pending only"
            );
        }
    }
    let isolation =
        isolate::Options { time_limit, memory_limit, preload, logging, executable: None };
    let mut opening = Opening { isolation, opened: HashMap::new(), isolated: HashMap::new() };
    let mut system = System::default();
    for element in elements {
        let slave: Box<dyn Slave> = if config.isolation.isolate == Some(true) {
            Box::new(opening.isolated(element)?)
        } else {
            Box::new(opening.here(element)?)
        };
        let slave = match making.log_calls {
            Some(log) => Box::new(log.listen(&element.name, slave)),
            None => slave,
        };
        system.add(&element.name, slave)?;
    }
    Ok(system)
}

/// FMUs on their way into the system; one that several elements use is unpacked once.
struct Opening<'a> {
    isolation: isolate::Options,
    opened: HashMap<&'a PathBuf, Fmu>,
    isolated: HashMap<&'a PathBuf, isolate::Package>,
}

impl<'a> Opening<'a> {
    /// An instance in a process of its own.
    fn isolated(&mut self, element: &'a Element) -> anyhow::Result<isolate::Isolated> {
        let package = match self.isolated.get(&element.fmu) {
            Some(package) => package.clone(),
            None => isolate::Package::open(&element.fmu).with_context(|| element.name.clone())?,
        };
        let slave = package.instantiate(&element.name, &self.isolation)?;
        self.isolated.insert(&element.fmu, package);
        Ok(slave)
    }

    /// An instance in this process.
    fn here(&mut self, element: &'a Element) -> anyhow::Result<Instance> {
        let fmu = match self.opened.get(&element.fmu) {
            Some(fmu) => fmu.clone(),
            None => Fmu::open(&element.fmu).with_context(|| element.name.clone())?,
        };
        let mut slave = fmu.instantiate(&element.name)?;
        self.opened.insert(&element.fmu, fmu);
        slave.set_time_limit(self.isolation.time_limit);
        if self.isolation.logging {
            switch_logging_on(&element.name, &mut slave);
        }
        Ok(slave)
    }
}

fn switch_logging_on(name: &str, slave: &mut dyn Slave) {
    match slave.set_debug_logging(true) {
        Ok(()) | Err(CallError { failure: Failure::Absent, .. }) => {}
        Err(error) => tracing::warn!("{name}: {error}"),
    }
}

/// Makes the connections: those of the configuration go before `links` to the same inputs.
/// Where none are stated, equal names are connected, and `by_unit` also equal units.
fn connect(
    system: &mut System,
    loaded: &Loaded,
    links: &[Link],
    by_unit: bool,
) -> anyhow::Result<()> {
    let config = &loaded.config;
    let mut taken = HashSet::new();
    let mut own = Vec::new();
    for wire in config.connections.iter().flatten() {
        let Wire { from, to, factor, offset } = wire.get_ref();
        let port = |name: &toml::Spanned<String>| {
            system.port(name.get_ref()).map_err(|error| loaded.point(&name.span(), error))
        };
        let (from, to) = (port(from)?, port(to)?);
        let terminal = |port: master::Port| Terminal {
            element: system.slaves[port.slave].0.clone(),
            variable: system.variable(port).name.clone(),
        };
        let stated = factor.is_some() || offset.is_some();
        let linear =
            Transformation::Linear { factor: factor.unwrap_or(1.0), offset: offset.unwrap_or(0.0) };
        taken.insert(terminal(to));
        own.push((
            wire.span(),
            Link {
                from: terminal(from),
                to: terminal(to),
                transformation: if stated { linear } else { Transformation::Identity },
                units_settled: stated,
            },
        ));
    }
    for link in links.iter().filter(|link| !taken.contains(&link.to)) {
        system.link(link)?;
    }
    for (place, link) in &own {
        system.link(link).map_err(|error| loaded.point(place, error))?;
    }
    let alone = config.connections.is_none() && config.system.is_none();
    if !alone || system.slaves.len() < 2 {
        return Ok(());
    }
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
        tracing::warn!(
            "no output has the name of an input of another FMU, so nothing is connected"
        );
    }
    Ok(())
}
