//! Reads `OspSystemStructure.xml`, the system structure of the Open Simulation Platform (libcosim).

mod document;
mod groups;

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use fmu_description::number::seconds;
use fmu_description::{Causality, ModelDescription, Position};

use super::error::{SspError, semantic_error};
use super::load::check_runnable;
use super::load::files::Files;
use super::source::{Base, Target};
use super::structure::{DefaultExperiment, Implementation};
use super::{Folders, Opened};
use crate::assembly::{Assembly, Element, Link, Origin, Setting, Terminal};
use document::{Connection, Document, End, Kind, Simulator};
use groups::Group;
use slave::Transformation;

/// Name of the file in a folder.
const DEFAULT: &str = "OspSystemStructure.xml";
/// The resolution of time in libcosim in s: steps are multiples of this time.
const TICK: f64 = 1e-9;

/// Returns whether `path` is a folder with an `OspSystemStructure.xml` and without an SSD.
pub(super) fn is_osp_folder(path: &Path) -> bool {
    path.join(DEFAULT).is_file() && !path.join("SystemStructure.ssd").is_file()
}

/// Reads the file at `path`, or the file in the folder `path`, and the FMUs that it refers to.
pub(super) fn open(path: &Path) -> Result<Opened, SspError> {
    let path = if path.is_dir() { path.join(DEFAULT) } else { path.to_owned() };
    let outside = Base { folder: PathBuf::new(), shown: PathBuf::new(), archive: None };
    let target = Target::new(path.clone(), path.clone());
    let mut loader = Loader { base: outside.of_file(&target), ..Loader::default() };
    let document = loader.files.read(&target, document::read)?;
    loader.add(&document).map_err(|error| error.in_file(&path))?;
    let Loader { files: Files { fmus, folders, warnings, .. }, assembly, steps, .. } = loader;
    let experiment = DefaultExperiment {
        start_time: document.start,
        stop_time: document.stop,
        step_size: Some(document.step),
    };
    let folders = Folders { _fmus: fmus, _packages: folders };
    Ok(Opened { assembly, experiment, steps, fixed_step: true, warnings, folders })
}

/// The state of the conversion of a file to an assembly.
#[derive(Default)]
struct Loader {
    base: Base,
    files: Files,
    assembly: Assembly,
    steps: Vec<(String, f64)>,
    /// Index of each simulator's FMU in `files`, and the variable groups of this FMU.
    simulators: HashMap<String, (usize, Vec<Group>)>,
    /// The linear transformations by name.
    linear: Vec<(String, Linear)>,
}

/// A linear transformation with the connections at its input and its output.
#[derive(Default)]
struct Linear {
    factor: f64,
    offset: f64,
    source: Option<Terminal>,
    targets: Vec<Terminal>,
}

impl Loader {
    fn add(&mut self, document: &Document) -> Result<(), SspError> {
        for simulator in &document.simulators {
            self.simulator(simulator, document.step)?;
        }
        let mut names = HashSet::new();
        for function in &document.functions {
            let name = function.name.clone();
            if !names.insert(&function.name) {
                let sentence = format!("two functions are called {name}");
                return Err(semantic_error(function.at, sentence));
            }
            match function.kind.clone() {
                Kind::Sum(sum) => self.assembly.functions.push((name, sum)),
                Kind::Linear { factor, offset } => {
                    self.linear.push((name, Linear { factor, offset, ..Linear::default() }));
                }
            }
        }
        for connection in &document.connections {
            self.connection(connection)
                .map_err(|sentence| semantic_error(connection.at, sentence))?;
        }
        self.finish_functions();
        self.assembly.start_time = document.start;
        self.assembly.stop_time = document.stop;
        Ok(())
    }

    fn simulator(&mut self, simulator: &Simulator, step: f64) -> Result<(), SspError> {
        let Simulator { name, at, .. } = simulator;
        let here = |sentence: String| semantic_error(*at, format!("{name}: {sentence}"));
        let target = self.base.resolve(&simulator.source).map_err(here)?;
        if let Some(warning) = &target.warning {
            self.files.warnings.push(format!("{at}: {name}: {warning}"));
        }
        let mut values = HashMap::new();
        for Setting { variable, value } in &simulator.settings {
            if values.insert(variable, value).is_some_and(|earlier| earlier != value) {
                self.files.warnings.push(format!(
                    "{at}: {name} has different initial values for {variable}: the last one counts"
                ));
            }
        }
        let index = self.files.fmu(&target)?;
        let fmu = &self.files.fmus[index];
        let shown = target.shown.clone();
        check_runnable(fmu).map_err(|why| here(format!("{}: {why}", shown.display())))?;
        self.assembly.elements.push(Element {
            name: name.clone(),
            fmu: fmu.folder().to_owned(),
            shown: Some(shown),
            origin: Origin::of(fmu),
            settings: simulator.settings.clone(),
            implementation: Implementation::Any,
        });
        let model = fmu.description.model_name.clone();
        let groups = self.groups(&target, &model)?;
        if self.simulators.insert(name.clone(), (index, groups)).is_some() {
            return Err(semantic_error(*at, format!("two simulators are called {name}")));
        }
        self.step(simulator, step, *at);
        Ok(())
    }

    /// Adds the step of a simulator that states one. As in libcosim, the step is rounded down to a multiple of the base
    /// step, but is at least one base step; a rounded step gives a warning.
    fn step(&mut self, simulator: &Simulator, base: f64, at: Position) {
        let Some(stated) = simulator.step_size.filter(|stated| *stated > 0.0) else { return };
        let ticks = |time: f64| (time / TICK.min(base)).round();
        let multiple = (ticks(stated) / ticks(base)).floor().max(1.0);
        let step = multiple * base;
        if (ticks(step) - ticks(stated)).abs() >= 1.0 {
            self.files.warnings.push(format!(
                "{at}: {} steps every {} s, a multiple of the base step {base} s, instead of \
                 {stated} s",
                simulator.name,
                seconds(step)
            ));
        }
        self.steps.push((simulator.name.clone(), step));
    }

    /// Returns the variable groups of an FMU, from a file beside the FMU, otherwise beside the system structure; none
    /// if neither exists.
    fn groups(&mut self, fmu: &Target, model: &str) -> Result<Vec<Group>, SspError> {
        let name = format!("{model}_OspModelDescription.xml");
        let beside = [self.base.of_file(fmu), self.base.clone()];
        let files = beside.map(|base| Target::new(base.folder.join(&name), base.shown.join(&name)));
        match files.iter().find(|file| file.path.is_file()) {
            Some(file) => self.files.read(file, groups::read),
            None => Ok(Vec::new()),
        }
    }

    fn connection(&mut self, connection: &Connection) -> Result<(), String> {
        let [first, second] = &connection.ends;
        if !connection.groups {
            return self.join(first, second);
        }
        let ends: Vec<[End; 2]> = match (first.is_signal, second.is_signal) {
            (false, false) => {
                let (here, there) = (self.group(first)?, self.group(second)?);
                let pairs = here.pairs(there)?.into_iter();
                pairs.map(|[a, b]| [first.named(a), second.named(b)]).collect()
            }
            (true, _) => self.signals(first, second)?,
            (false, true) => self.signals(second, first)?,
        };
        ends.iter().try_for_each(|[first, second]| self.join(first, second))
    }

    fn group(&self, end: &End) -> Result<&Group, String> {
        let (index, groups) = self.simulator_entry(&end.owner)?;
        groups::find(groups, &end.name).ok_or_else(|| {
            let model = &self.files.fmus[*index].description.model_name;
            format!(
                "{} has no variable group {:?}, expected one in {model}_OspModelDescription.xml \
                 beside its FMU or beside the system structure",
                end.owner, end.name
            )
        })
    }

    /// Pairs the components of a group of signals, `in[0]` or `out`, with the direct variables of a variable group.
    fn signals(&self, signals: &End, variables: &End) -> Result<Vec<[End; 2]>, String> {
        let group = self.group(variables)?;
        let components = (0..group.variables.len()).map(|k| {
            let name = format!("{}[{k}]", signals.name);
            [signals.named(&name), variables.named(&group.variables[k])]
        });
        Ok(components.collect())
    }

    fn simulator_entry(&self, simulator: &str) -> Result<&(usize, Vec<Group>), String> {
        let entry = self.simulators.get(simulator);
        entry.ok_or_else(|| format!("there is no simulator {simulator:?}"))
    }

    fn description(&self, simulator: &str) -> Result<&ModelDescription, String> {
        self.simulator_entry(simulator).map(|(index, _)| &self.files.fmus[*index].description)
    }

    /// Connects two variables, or a variable and a signal, from output to input. Returns an error sentence if an end
    /// does not exist or is neither output nor input, if both are outputs or both are inputs, or if the input of a
    /// linear transformation already has a source.
    fn join(&mut self, first: &End, second: &End) -> Result<(), String> {
        let (source, target) = match (self.is_source(first)?, self.is_source(second)?) {
            (true, false) => (first, second),
            (false, true) => (second, first),
            (is_source, _) => {
                let role = if is_source { "outputs" } else { "inputs" };
                return Err(format!("{first} and {second} are both {role}"));
            }
        };
        let linear = |end: &End| {
            let of_linear = |(name, _): &(String, Linear)| end.is_signal && *name == end.owner;
            self.linear.iter().position(of_linear)
        };
        match (linear(source), linear(target)) {
            (Some(k), _) => self.linear[k].1.targets.push(target.terminal()),
            (None, Some(k)) => {
                let second = source.terminal();
                if let Some(first) = self.linear[k].1.source.replace(second.clone()) {
                    return Err(format!("{target} is connected twice, to {first} and to {second}"));
                }
            }
            (None, None) => {
                let (from, to) = (source.terminal(), target.terminal());
                self.link(from, to, Transformation::Identity);
            }
        }
        Ok(())
    }

    /// Adds a connection without unit conversion, as in libcosim.
    fn link(&mut self, from: Terminal, to: Terminal, transformation: Transformation) {
        self.assembly.links.push(Link { from, to, transformation, units_settled: true });
    }

    /// Returns whether this end of a connection is the source.
    fn is_source(&self, end: &End) -> Result<bool, String> {
        if end.is_signal {
            return self.signal_is_source(end);
        }
        let variable = self.description(&end.owner)?.variable(&end.name);
        let variable = variable.ok_or_else(|| format!("the FMU has no variable {end}"))?;
        match variable.causality {
            Causality::Output | Causality::CalculatedParameter => Ok(true),
            Causality::Local | Causality::Independent => {
                let causality = variable.causality.as_str();
                Err(format!("{end} is {causality}, expected an output or an input"))
            }
            _ => Ok(false),
        }
    }

    fn signal_is_source(&self, end: &End) -> Result<bool, String> {
        let unknown = |names: &str| format!("{end} is no signal of the function, expected {names}");
        if self.linear.iter().any(|(name, _)| *name == end.owner) {
            return match end.name.as_str() {
                "in" => Ok(false),
                "out" => Ok(true),
                _ => Err(unknown("in or out")),
            };
        }
        let functions = &self.assembly.functions;
        let function = functions.iter().find(|(name, _)| *name == end.owner);
        let (_, function) = function.ok_or_else(|| format!("no function {:?}", end.owner))?;
        let causality = function.signal(&end.name).ok_or_else(|| {
            unknown(&format!("{}, ... or {}", function.input(0, 0), function.output(0)))
        })?;
        Ok(causality == Causality::Output)
    }

    /// Converts linear transformations to connections, and warns about unconnected signals of
    /// functions.
    fn finish_functions(&mut self) {
        for (name, linear) in std::mem::take(&mut self.linear) {
            let Linear { factor, offset, source, targets } = linear;
            match source {
                Some(source) => {
                    for target in targets {
                        let transformation = Transformation::Linear { factor, offset };
                        self.link(source.clone(), target, transformation);
                    }
                }
                None => self.files.warnings.push(format!(
                    "the function {name} has no input, so nothing is connected to its output"
                )),
            }
        }
        let links = &self.assembly.links;
        for (name, function) in &self.assembly.functions {
            let is_driven = |input: &String| {
                links.iter().any(|link| link.to.element == *name && link.to.variable == *input)
            };
            let missing: Vec<String> =
                function.inputs().filter(|input| !is_driven(input)).take(5).collect();
            if !missing.is_empty() {
                self.files.warnings.push(format!(
                    "the function {name}: {} is connected to nothing and counts as 0",
                    missing.join(", ")
                ));
            }
        }
    }
}

impl End {
    /// Returns the variable or signal `name` of the same owner.
    fn named(&self, name: &str) -> End {
        End { name: name.to_owned(), ..self.clone() }
    }

    fn terminal(&self) -> Terminal {
        Terminal { element: self.owner.clone(), variable: self.name.clone() }
    }
}
