//! Creates the instances of the FMUs of a system: chooses interface and process, and opens the FMUs.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use fmu_description::ModelDescription;
use fmu_import::{CallLog, Fmu, isolate};
use integrate::Integrated;
use master::{CallError, Failure, Slave, System};
use ssp::Element;
use ssp::structure::Implementation;

use crate::assembly_options::AssemblyOptions;
use crate::config::{Config, Interface, Solver};
use crate::content::Content;
use crate::error::Error;
use crate::store::Store;

/// Instantiates the FMUs; returns the system, and the names of the FMUs that the master integrates, with the method.
/// Returns an error if an option does not fit, or if an FMU cannot be opened or instantiated.
pub(crate) fn instantiate(
    elements: &[Element],
    config: &Config,
    options: &AssemblyOptions<'_>,
) -> Result<(System, Vec<(String, Solver)>), Error> {
    check_names(elements, config)?;
    let logging = options.logging;
    let limit = config.isolation.time_limit.as_ref().map(|limit| *limit.get_ref());
    let time_limit = limit.map(Duration::try_from_secs_f64).transpose();
    let time_limit = time_limit.map_err(|error| Error::Invalid(format!("time-limit: {error}")))?;
    let preload = config.preload.iter().map(Into::into).collect();
    let memory_limit = config.isolation.memory_limit.map(|memory| memory.0);
    if config.isolation.isolate != Some(true) {
        if memory_limit.is_some() {
            return Err(Error::Invalid(
                "--memory-limit applies to FMUs in separate processes, expected --isolate"
                    .to_owned(),
            ));
        }
        if time_limit.is_some() {
            tracing::warn!(
                "--time-limit without --isolate cannot end a call that hangs; it limits pending \
                 answers only"
            );
        }
    }
    let executable = options.worker.map(Into::into);
    let isolation = isolate::Options {
        time_limit,
        memory_limit,
        preload,
        logging,
        guard_arrays: options.log_calls.is_some(),
        executable,
        ..Default::default()
    };
    let (log, store, opened) = (options.log_calls, options.store, HashMap::new());
    let mut opener = FmuOpener { isolation, log, store, opened };
    let (mut system, mut integrated) = (System::default(), Vec::new());
    for element in elements {
        let name = &element.name;
        let stated = stated_interface(element, config);
        let content = opener.open(element, config)?;
        let interface = choose_interface(element, content.description(), config, stated)?;
        let method = (interface == Interface::ModelExchange)
            .then(|| config.solver.get(name).copied().unwrap_or_default());
        integrated.extend(method.map(|method| (name.clone(), method)));
        let slave: Box<dyn Slave> = match (&content, method) {
            (Content::Isolated(package), method) => opener.isolated(element, package, method)?,
            (Content::Loaded(fmu), None) => opener.co_simulation(element, fmu)?,
            (Content::Loaded(fmu), Some(method)) => opener.model_exchange(element, fmu, method)?,
        };
        system.add(name, slave)?;
    }
    let mut solvers = config.solver.0.iter().map(|(name, _)| name);
    if let Some(name) = solvers.find(|name| !integrated.iter().any(|(fmu, _)| fmu == *name)) {
        return Err(Error::Invalid(format!(
            "solver.{name}: {name} runs by co-simulation, with a solver of its own; the interface \
             model-exchange would let the master integrate it"
        )));
    }
    Ok((system, integrated))
}

/// Checks that the tables `interface` and `solver` name FMUs of the system.
fn check_names(elements: &[Element], config: &Config) -> Result<(), Error> {
    let interfaces = config.interface.0.iter().map(|(name, _)| ("interface", name));
    let solvers = config.solver.0.iter().map(|(name, _)| ("solver", name));
    let is_known = |name: &str| elements.iter().any(|element| element.name == name);
    match interfaces.chain(solvers).find(|(_, name)| !is_known(name)) {
        None => Ok(()),
        Some((table, name)) => {
            let known: Vec<_> = elements.iter().map(|element| element.name.as_str()).collect();
            Err(Error::Invalid(format!(
                "{table}.{name}: the system has no FMU {name}, expected one of {}",
                known.join(", ")
            )))
        }
    }
}

/// Returns the interface that the configuration or else the system structure states, if either does.
fn stated_interface(element: &Element, config: &Config) -> Option<Interface> {
    let stated = config.interface.get(&element.name).copied();
    stated.or(match element.implementation {
        Implementation::CoSimulation => Some(Interface::CoSimulation),
        Implementation::ModelExchange => Some(Interface::ModelExchange),
        Implementation::Any | Implementation::ScheduledExecution => None,
    })
}

/// Returns the interface to use: the stated one if the FMU offers it, otherwise co-simulation if offered, otherwise
/// model exchange. Returns an error if the FMU does not offer the interface that the configuration states.
fn choose_interface(
    element: &Element,
    description: &ModelDescription,
    config: &Config,
    stated: Option<Interface>,
) -> Result<Interface, Error> {
    let offers = |interface| match interface {
        Interface::CoSimulation => description.stepped().is_some(),
        Interface::ModelExchange => description.model_exchange.is_some(),
    };
    let default = if offers(Interface::CoSimulation) {
        Interface::CoSimulation
    } else {
        Interface::ModelExchange
    };
    match stated {
        Some(interface) if offers(interface) => Ok(interface),
        // The system structure stated the interface for another FMU, which the configuration has replaced.
        Some(_) if config.interface.get(&element.name).is_none() => Ok(default),
        Some(interface) => Err(Error::Invalid(format!(
            "interface.{}: {} offers {} only, found {}",
            element.name,
            element.shown().display(),
            default.name(),
            interface.name()
        ))),
        None => Ok(default),
    }
}

/// Opens the FMUs; unpacks an FMU only once if several elements use it.
struct FmuOpener<'a> {
    isolation: isolate::Options,
    log: Option<&'a CallLog>,
    store: Option<&'a Store>,
    opened: HashMap<&'a PathBuf, Content>,
}

impl<'a> FmuOpener<'a> {
    /// Returns the FMU of an element: opened before, from the store, or opened now.
    fn open(&mut self, element: &'a Element, config: &Config) -> Result<Content, Error> {
        let isolate = config.isolation.isolate == Some(true);
        if let Some(content) = self.opened.get(&element.fmu) {
            return Ok(content.clone());
        }
        let compiled = config.compile.then(|| compiled(element)).transpose()?;
        let path = compiled.as_ref().unwrap_or(&element.fmu);
        let open = || if isolate { open_package(element, path) } else { open_fmu(element, path) };
        let content = match self.store {
            Some(store) => store.fmu(path, isolate, open)?,
            None => open()?,
        };
        self.opened.insert(&element.fmu, content.clone());
        Ok(content)
    }

    /// Creates an instance in a separate process: with a `method` for model exchange, integrated in that process,
    /// otherwise for co-simulation. Returns an error for model exchange with a log of calls.
    fn isolated(
        &self,
        element: &Element,
        package: &isolate::Package,
        method: Option<Solver>,
    ) -> Result<Box<dyn Slave>, Error> {
        if let (Some(_), Some(_)) = (method, self.log) {
            return Err(Error::Invalid(format!(
                "{}: {} runs by model exchange in a separate process, where --log-calls does not see \
                 its calls: expected a run without --log-calls or without --isolate",
                element.name,
                element.shown().display()
            )));
        }
        let mut options = self.isolation.clone();
        options.integration = method.map(|method| isolate::Integration {
            options: method.name().to_owned(),
            describe: integrate::description_of,
        });
        let slave = package.instantiate(&element.name, &options);
        let slave = slave.map_err(|error| as_shown(error.into(), element))?;
        Ok(self.with_call_log(element, Box::new(slave)))
    }

    /// Creates a co-simulation instance in this process.
    fn co_simulation(&self, element: &Element, fmu: &Fmu) -> Result<Box<dyn Slave>, Error> {
        let slave = fmu.instantiate(&element.name);
        let mut slave = slave.map_err(|error| as_shown(error.into(), element))?;
        slave.set_time_limit(self.isolation.time_limit);
        if self.isolation.logging {
            switch_logging_on(&element.name, &mut slave);
        }
        Ok(self.with_call_log(element, Box::new(slave)))
    }

    /// Creates a model-exchange instance in this process, integrated by `method`.
    fn model_exchange(
        &self,
        element: &Element,
        fmu: &Fmu,
        method: Solver,
    ) -> Result<Box<dyn Slave>, Error> {
        let name = &element.name;
        let equations = fmu.instantiate_equations(name);
        let equations =
            equations.map_err(|error| as_shown(Error::from(error).within(name), element));
        let mut equations = equations?;
        if let Some(log) = self.log {
            equations = Box::new(log.listen_to_equations(name, equations));
        }
        let mut slave = Integrated::new(equations, integrate::Options { method });
        if self.isolation.logging {
            switch_logging_on(name, &mut slave);
        }
        Ok(Box::new(slave))
    }

    fn with_call_log(&self, element: &Element, slave: Box<dyn Slave>) -> Box<dyn Slave> {
        match self.log {
            Some(log) => Box::new(log.listen(&element.name, slave)),
            None => slave,
        }
    }
}

/// Returns the path of the FMU of an element. If the FMU has source code only, builds the library first.
fn compiled(element: &Element) -> Result<PathBuf, Error> {
    let compiled = fmu_import::compile(&element.fmu);
    compiled.map_err(|error| as_shown(Error::from(error).within(&element.name), element))
}

/// Opens the FMU of an element for separate processes. Warnings about an FMU in an SSP were already
/// logged when the SSP was opened.
fn open_package(element: &Element, path: &Path) -> Result<Content, Error> {
    let opened = isolate::Package::open(path);
    let package = opened.map_err(|error| Error::from(error).within(&element.name))?;
    for warning in package.warnings().filter(|_| element.shown.is_none()) {
        tracing::warn!("{}: {warning}", element.fmu.display());
    }
    Ok(Content::Isolated(package))
}

/// Opens the FMU of an element in this process. Warnings about an FMU in an SSP were already logged when the SSP was
/// opened.
fn open_fmu(element: &Element, path: &Path) -> Result<Content, Error> {
    let opened = match &element.shown {
        Some(_) => Fmu::open_quietly(path),
        None => Fmu::open_any(path),
    };
    let opened = opened.map(Content::Loaded);
    opened.map_err(|error| as_shown(Error::from(error).within(&element.name), element))
}

/// Replaces the unpacked path of an FMU in an error by the path that the user knows; the result is then
/// [`Error::Invalid`].
fn as_shown(error: Error, element: &Element) -> Error {
    match &element.shown {
        Some(shown) => {
            let unpacked = element.fmu.display().to_string();
            Error::Invalid(error.sentence().replace(&unpacked, &shown.display().to_string()))
        }
        None => error,
    }
}

fn switch_logging_on(name: &str, slave: &mut dyn Slave) {
    match slave.set_debug_logging(true) {
        Ok(()) | Err(CallError { failure: Failure::Missing, .. }) => {}
        Err(error) => tracing::warn!("{name}: {error}"),
    }
}
