//! The options of `aso-ftc run`, which take precedence over a `system.toml`.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::{Context, bail};
use fmu_description::number::seconds;
use master::{AlgorithmRequest, Coupling, Extrapolation, Method, StepControl};
use results::{STANDARD_OUTPUT, is_stream};
use toml::Spanned;

use study::{
    Config, ConnectionEntry, Every, Interface, LoadedConfig, Memory, RealTimeFactor, SavedRun,
    Solver,
};

use super::live::LiveStart;
use crate::{logging, models};

/// Default folder of the results.
const OUT: &str = "results/run";

/// Options of the algorithm. Options that are not stated are chosen for the FMUs.
#[derive(clap::Args)]
#[command(next_help_heading = "Algorithm")]
pub(crate) struct AlgorithmOptions {
    /// Communication step in s
    ///
    /// It is the first one if the step control varies it.
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub(crate) step: Option<f64>,
    /// Order of stepping: gauss-seidel or jacobi
    ///
    /// gauss-seidel steps one FMU after the other, each with the newest values; jacobi steps all from the
    /// same values.
    #[arg(long, value_parser = method)]
    pub(crate) method: Option<Method>,
    /// Inputs in a step: hold, limited, linear, ...
    ///
    /// Extrapolation of inputs during a step: hold, limited, linear or quadratic.
    #[arg(long, value_name = "KIND", value_parser = str::parse::<Extrapolation>)]
    pub(crate) extrapolation: Option<Extrapolation>,
    /// Iteration of a step: once, newton, ...
    ///
    /// Iteration of a step until inputs and outputs agree: once, newton, anderson or quasi-newton.
    #[arg(long, value_name = "KIND", value_parser = str::parse::<Coupling>)]
    pub(crate) coupling: Option<Coupling>,
    /// Step size: fixed, doubling, embedded, ...
    ///
    /// Choice of the step size: fixed, doubling, embedded, increment or energy.
    #[arg(long, value_name = "KIND", value_parser = str::parse::<StepControl>)]
    pub(crate) step_control: Option<StepControl>,
    /// Relative tolerance of the master
    ///
    /// It is for iteration and step control in the master; --tolerance is for the solvers inside the
    /// FMUs.
    #[arg(long, value_name = "TOL", allow_negative_numbers = true)]
    pub(crate) relative_tolerance: Option<f64>,
    /// Absolute tolerance of the master
    ///
    /// It is for iteration and step control, as a fraction of nominal values.
    #[arg(long, value_name = "TOL", allow_negative_numbers = true)]
    pub(crate) absolute_tolerance: Option<f64>,
    /// Repeat a step that an FMU ended early
    ///
    /// All FMUs then repeat a step that one FMU completed only in part; all must support saved states.
    #[arg(long)]
    pub(crate) rollback: bool,
    /// Let an FMU step every N communication steps
    ///
    /// May be repeated.
    #[arg(long, value_name = "FMU=N", value_parser = multiple)]
    pub(crate) every: Vec<(String, u32)>,
    /// Number of threads; 0: number of processors
    ///
    /// They step FMUs in parallel if this is faster.
    #[arg(long, value_name = "N")]
    pub(crate) jobs: Option<usize>,
    /// Allow NaN and infinity on connections
    #[arg(long)]
    pub(crate) allow_nan: bool,
}

#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    system: SystemOptions,
    #[command(flatten)]
    pub(super) time: TimeOptions,
    #[command(flatten)]
    algorithm: AlgorithmOptions,
    /// Relative tolerance of the solvers in the FMUs
    ///
    /// It is also for the integration of model-exchange FMUs [default: from the default experiment of each
    /// FMU]; the tolerance of the coupling is --relative-tolerance.
    #[arg(long, value_name = "TOL", allow_negative_numbers = true, help_heading = "Algorithm")]
    tolerance: Option<f64>,
    #[command(flatten)]
    pub(super) results: ResultsOptions,
    #[command(flatten)]
    safety: SafetyOptions,
    #[command(flatten)]
    pub(super) watching: WatchingOptions,
}

#[derive(clap::Args)]
#[command(next_help_heading = "System")]
struct SystemOptions {
    /// A system (.ssp, .ssd, .xml or .toml), or FMUs
    ///
    /// An SSP archive, an SSD or OspSystemStructure.xml next to its FMUs, or a system.toml; or FMUs, which
    /// get the names of their files.
    #[arg(value_name = "SYSTEM|FMU", help_heading = None, conflicts_with_all = ["plant", "controller", "resume"])]
    inputs: Vec<PathBuf>,
    /// Add an FMU, or replace one of the system
    ///
    /// May be repeated.
    #[arg(long = "fmu", value_name = "NAME=FMU", value_parser = setting)]
    #[arg(conflicts_with_all = ["plant", "controller"])]
    fmus: Vec<(String, String)>,
    /// The FMU called plant of the default system
    ///
    /// Without it, and without a system, it is dist/FrictionPendulum.fmu, or the one beside the command.
    #[arg(long, value_name = "FMU", conflicts_with = "resume")]
    plant: Option<PathBuf>,
    /// The FMU called controller of that system
    ///
    /// Without it, and without a system, it is dist/AsoController.fmu, or the one beside the command.
    #[arg(long, value_name = "FMU", conflicts_with = "resume")]
    controller: Option<PathBuf>,
    /// Use co-simulation or model-exchange
    ///
    /// For an FMU that offers both; the default is co-simulation. May be repeated.
    #[arg(long = "interface", value_name = "FMU=INTERFACE", value_parser = named::<Interface>)]
    interfaces: Vec<(String, Interface)>,
    /// Method for a model-exchange FMU
    ///
    /// Integrate it by this method: automatic (the default), explicit or stiff. May be repeated.
    #[arg(long = "solver", value_name = "FMU=METHOD", value_parser = named::<Solver>)]
    solvers: Vec<(String, Solver)>,
    /// Connect an output to an input
    ///
    /// For example `plant.y=controller.y`; may be repeated. Without this, FMUs given here are connected
    /// where names are equal, and those given without `--fmu` also where one free output and one free input
    /// have the same unit.
    #[arg(long = "connect", value_name = "FROM=TO", value_parser = connection)]
    connections: Vec<(String, String)>,
    /// Set a variable before the run
    ///
    /// For example `plant.F_c=20`; may be repeated.
    #[arg(long = "set", value_name = "FMU.VARIABLE=VALUE", value_parser = setting)]
    #[arg(conflicts_with = "resume")]
    settings: Vec<(String, String)>,
    /// Load a shared library before the FMUs
    ///
    /// Its symbols are visible to the FMUs. May be repeated.
    #[arg(long, value_name = "LIBRARY")]
    preload: Vec<String>,
    /// Build FMUs that have source code only
    ///
    /// A C compiler builds what has no library for this platform; the result is kept in the cache folder.
    #[arg(long)]
    compile: bool,
}

#[derive(clap::Args)]
#[command(next_help_heading = "Time")]
#[expect(clippy::struct_field_names, reason = "the names of the options")]
pub(super) struct TimeOptions {
    /// Start time in s
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    start_time: Option<f64>,
    /// Stop time in s
    ///
    /// [default: the stop time of the system, or the latest of the FMUs, or 1 s after the start]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    stop_time: Option<f64>,
    /// Pace the run by the clock
    ///
    /// FACTOR seconds of simulated time take one second [default without a value: 1]. Steps that end late
    /// are counted.
    #[arg(long, value_name = "FACTOR", num_args = 0..=1, default_missing_value = "1")]
    #[arg(allow_negative_numbers = true, value_parser = str::parse::<RealTimeFactor>)]
    pub(super) real_time: Option<RealTimeFactor>,
}

#[derive(clap::Args)]
#[command(next_help_heading = "Results")]
pub(super) struct ResultsOptions {
    /// Folder for all files [default: results/run]
    ///
    /// Files that a system.toml names keep their names in it, but for the checkpoint, which is not moved.
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Results, .csv or .parquet; -: CSV on stdout
    ///
    /// [default: that of the system.toml, or results.csv in the folder of --out]
    #[arg(long, value_name = "FILE")]
    results: Option<PathBuf>,
    /// Format of the results: csv or parquet
    #[arg(long, value_parser = ["csv", "parquet"], hide_possible_values = true)]
    format: Option<String>,
    /// Record these variables only
    ///
    /// By name or pattern (`plant.*`), instead of all inputs, outputs and locals; may be repeated.
    #[arg(long, value_name = "PATTERN")]
    record: Vec<String>,
    /// Do not record these variables
    ///
    /// May be repeated.
    #[arg(long, value_name = "PATTERN")]
    exclude: Vec<String>,
    /// Interval between rows in s, step or never
    ///
    /// `step` records each communication point.
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    #[arg(value_parser = str::parse::<Every>)]
    record_every: Option<Every>,
    /// Plot these variables
    ///
    /// By name or pattern, separated by commas; may be repeated.
    #[arg(long, value_name = "NAMES")]
    plot: Vec<String>,
    /// File of the plot, .svg or .png
    ///
    /// [default: that of the system.toml, or plot.svg in the folder of --out]
    #[arg(long, value_name = "FILE")]
    plot_file: Option<PathBuf>,
    /// Write the frames of the CAN buses to this file
    ///
    /// By FMI-LS-BUS; .log (candump), .asc or .pcapng, which Wireshark reads.
    #[arg(long, value_name = "FILE")]
    bus_trace: Option<PathBuf>,
    /// Also write a page with interactive plots
    ///
    /// It has statistics, the system and all warnings, too. Its name is that of the results file, with
    /// .html.
    #[arg(long)]
    pub(super) report: bool,
}

#[derive(clap::Args)]
#[command(next_help_heading = "Faults and safety")]
struct SafetyOptions {
    /// Run each FMU in a separate process
    #[arg(long)]
    isolate: bool,
    /// Time limit of a call of an FMU in s
    ///
    /// Needs --isolate; without it, only a pending answer has a limit, and a call that hangs does not end.
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    time_limit: Option<f64>,
    /// Memory limit of an FMU, with --isolate
    ///
    /// Address space of the process of each FMU, in bytes or as in 512MiB, 2GiB.
    #[arg(long, value_name = "BYTES", value_parser = str::parse::<Memory>)]
    memory_limit: Option<Memory>,
    /// Run in this process alone, for debuggers
    ///
    /// By default a small process supervises the run: it passes signals on, and says which FMU was last if one
    /// ends the process of the run.
    #[arg(long)]
    pub(super) in_process: bool,
    /// Save the state of the run to this file
    ///
    /// At the end of the run, and when it is interrupted.
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,
    /// Interval between checkpoints in s
    ///
    /// In s of simulated time.
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    checkpoint_every: Option<f64>,
    /// Resume a run from a checkpoint
    ///
    /// The checkpoint contains the system.
    #[arg(long, value_name = "FILE")]
    resume: Option<PathBuf>,
}

#[derive(clap::Args)]
#[command(next_help_heading = "Watching")]
pub(super) struct WatchingOptions {
    /// Show the run on a page that can change it
    ///
    /// The page is on this machine; it can pause, change and stop the run. --live=paused waits for the page
    /// at the start.
    #[arg(long, value_name = "START", num_args = 0..=1, require_equals = true)]
    #[arg(default_missing_value = "running", hide_possible_values = true)]
    pub(super) live: Option<LiveStart>,
    /// Print the algorithm and the reasons for it
    #[arg(long)]
    pub(super) explain: bool,
    /// Print the configuration, and do not run
    ///
    /// The complete configuration is a system.toml.
    #[arg(long)]
    pub(super) print_config: bool,
    /// Write every FMI call to this file
    ///
    /// With its arguments, results and status.
    #[arg(long, value_name = "FILE")]
    pub(super) log_calls: Option<PathBuf>,
    /// Log more, including messages of FMUs; -vv: all
    #[arg(short, long, action = clap::ArgAction::Count)]
    pub(super) verbose: u8,
    /// Write messages as JSON, one object on a line
    #[arg(long)]
    pub(super) log_json: bool,
}

/// Splits `name=value`; the name must not be empty.
pub(crate) fn setting(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.is_empty() => Ok((name.to_owned(), value.to_owned())),
        _ => Err("expected the form NAME=VALUE".to_owned()),
    }
}

/// Splits lists of names at their commas, except within brackets, where commas belong to names such as `A[1,2]`.
pub(crate) fn split_names(lists: &[String]) -> Vec<String> {
    let mut names = Vec::new();
    for list in lists {
        let mut depth = 0_i32;
        names.extend(list.split(|letter: char| {
            depth += i32::from(letter == '[') - i32::from(letter == ']');
            depth <= 0 && letter == ','
        }));
    }
    names.into_iter().map(str::to_owned).collect()
}

/// Whether `name` is an element of the array `whole`, such as `b.u[1]` of `b.u`.
fn is_element(name: &str, whole: &str) -> bool {
    name.strip_prefix(whole).is_some_and(|index| index.starts_with('['))
}

/// Splits `from=to`; the error for another sign between the names proposes the right form.
fn connection(text: &str) -> Result<(String, String), String> {
    let split =
        |sign| text.split_once(sign).filter(|(from, to)| !from.is_empty() && !to.is_empty());
    if let Some((from, to)) = split("=") {
        return Ok((from.to_owned(), to.to_owned()));
    }
    let meant = ["->", ":", ","].into_iter().find_map(split);
    let (from, to) = meant.unwrap_or(("plant.y", "controller.y"));
    let word = if meant.is_some() { "write" } else { "for example" };
    Err(format!("expected OUTPUT=INPUT, {word} --connect {}={}", from.trim(), to.trim()))
}

/// Splits `name=count` and parses the count, which is above 0.
fn multiple(text: &str) -> Result<(String, u32), String> {
    let (name, value) = setting(text)?;
    match value.parse() {
        Ok(count) if count > 0 => Ok((name, count)),
        _ => Err(format!("expected a whole number above 0, found {value:?}")),
    }
}

/// Splits `name=value` and parses the value.
fn named<T: FromStr<Err = String>>(text: &str) -> Result<(String, T), String> {
    let (name, value) = setting(text)?;
    value.parse().map(|value| (name, value))
}

fn method(text: &str) -> Result<Method, String> {
    if text == "gauss-seidel-hold" {
        return Err("use `--method gauss-seidel --extrapolation hold`".to_owned());
    }
    text.parse()
}

impl AlgorithmOptions {
    /// Overwrites the settings in `request` with the options stated, and adds the settings of `--every`.
    pub(crate) fn apply(&self, request: &mut AlgorithmRequest) {
        put(&mut request.step, self.step);
        put(&mut request.method, self.method);
        put(&mut request.extrapolation, self.extrapolation);
        put(&mut request.coupling, self.coupling);
        put(&mut request.step_control, self.step_control);
        put(&mut request.relative_tolerance, self.relative_tolerance);
        put(&mut request.absolute_tolerance, self.absolute_tolerance);
        put(&mut request.jobs, self.jobs);
        put(&mut request.rollback, self.rollback.then_some(true));
        put(&mut request.allow_nan, self.allow_nan.then_some(true));
        request.every.extend(self.every.iter().cloned());
    }
}

/// Replaces `value` by `over`, if `over` is stated.
fn put<T>(value: &mut Option<T>, over: Option<T>) {
    if over.is_some() {
        *value = over;
    }
}

impl Options {
    /// Whether the run shall have no supervising process.
    #[cfg(target_os = "linux")]
    pub(crate) fn is_in_process(&self) -> bool {
        self.safety.in_process
    }

    /// Starts logging as the options say.
    pub(crate) fn start_logging(&self) {
        logging::start(self.watching.verbose, self.watching.log_json);
    }

    /// Returns the configuration of the file or the checkpoint, with the options of the command
    /// line, and the checkpoint of a resumed run.
    pub(super) fn load(&self) -> anyhow::Result<(LoadedConfig, Option<SavedRun>)> {
        let (mut loaded, saved) = self.base()?;
        let config = &mut loaded.config;
        self.put_system(config)?;
        self.algorithm.apply(&mut config.algorithm);
        let placed = |value: Option<f64>| value.map(|value| Spanned::new(0..0, value));
        put(&mut config.experiment.start_time, placed(self.time.start_time));
        put(&mut config.experiment.stop_time, placed(self.time.stop_time));
        put(&mut config.experiment.tolerance, placed(self.tolerance));
        put(&mut config.isolation.isolate, self.safety.isolate.then_some(true));
        put(&mut config.isolation.time_limit, placed(self.safety.time_limit));
        put(&mut config.isolation.memory_limit, self.safety.memory_limit);
        put(&mut config.checkpoint.file, self.safety.checkpoint.clone());
        put(&mut config.checkpoint.every, placed(self.safety.checkpoint_every));
        self.put_results(config, saved.as_ref())?;
        check_numbers(config)?;
        Ok((loaded, saved))
    }

    /// Returns the configuration of the checkpoint, of the system or of the FMUs stated, without further options;
    /// without any of these, the configuration of the default system.
    fn base(&self) -> anyhow::Result<(LoadedConfig, Option<SavedRun>)> {
        if let Some(path) = &self.safety.resume {
            let saved = SavedRun::read(path)?;
            let (config, source) = (saved.config(path)?, None);
            return Ok((LoadedConfig { config, source }, Some(saved)));
        }
        let mut config = Config::default();
        match self.system.inputs.as_slice() {
            fmus if !fmus.is_empty() && fmus.iter().all(|path| is_fmu(path)) => {
                for path in fmus {
                    let name = free_name(path, &config);
                    config.fmus.put(name, path.clone());
                }
            }
            [path] if has_ending(path, "toml") => return Ok((LoadedConfig::read(path)?, None)),
            [path] if is_system(path) => config.system = Some(path.clone()),
            paths @ [_, ..] => {
                if let Some(path) = paths.iter().find(|path| !is_fmu(path) && !is_system(path)) {
                    bail!(
                        "{}: expected a system, that is an .ssp, an .ssd, an OspSystemStructure.xml or a .toml, \
                         or an .fmu",
                        path.display()
                    );
                }
                let paths: Vec<_> = paths.iter().map(|path| path.display().to_string()).collect();
                bail!(
                    "expected one system or any number of FMUs, found {}; --fmu NAME=FMU adds an FMU to a system",
                    paths.join(", ")
                )
            }
            [] if self.system.fmus.is_empty() => {
                let stated = [&self.system.plant, &self.system.controller];
                for ((name, file), stated) in models::FMUS.into_iter().zip(stated) {
                    let path = stated.clone().map_or_else(|| models::default_fmu(file), Ok)?;
                    config.fmus.put(name.to_owned(), path);
                }
            }
            [] => {}
        }
        Ok((LoadedConfig { config, source: None }, None))
    }

    /// Adds FMUs, interfaces, solvers, connections, settings and libraries of the command line. Two sources of an input
    /// are an error.
    fn put_system(&self, config: &mut Config) -> anyhow::Result<()> {
        for (name, path) in &self.system.fmus {
            config.fmus.put(name.clone(), path.into());
        }
        for (name, interface) in &self.system.interfaces {
            config.interface.put(name.clone(), *interface);
        }
        for (name, solver) in &self.system.solvers {
            config.solver.put(name.clone(), *solver);
        }
        for (position, (from, to)) in self.system.connections.iter().enumerate() {
            let earlier = &self.system.connections[..position];
            let overlaps =
                |known: &str| known == to || is_element(known, to) || is_element(to, known);
            if let Some((first, _)) = earlier.iter().find(|(_, known)| overlaps(known)) {
                bail!(
                    "{to} has two sources, {first} and {from}, expected one --connect for an input"
                );
            }
            let connections = config.connections.get_or_insert_default();
            connections.retain(|entry| {
                let known = entry.get_ref().to.get_ref();
                known != to && !is_element(known, to)
            });
            let mut inputs = connections.iter().map(|entry| entry.get_ref().to.get_ref());
            if let Some(whole) = inputs.find(|known| is_element(to, known)) {
                bail!(
                    "--connect {from}={to}: the file connects all of {whole}, expected the same here, or a connection \
                     of each element in the file"
                );
            }
            connections.push(ConnectionEntry::new(from.clone(), to.clone()));
        }
        for (name, value) in &self.system.settings {
            config.settings.push(name.clone(), value.clone());
        }
        config.preload.extend(self.system.preload.iter().cloned());
        config.compile |= self.system.compile;
        Ok(())
    }

    /// Whether the command line states FMUs by their paths instead of a system file.
    pub(super) fn names_fmus_by_file(&self) -> bool {
        self.system.inputs.first().is_some_and(|path| is_fmu(path))
    }

    /// Adds the options of the results, and fills in the names of all files.
    fn put_results(&self, config: &mut Config, saved: Option<&SavedRun>) -> anyhow::Result<()> {
        let results = &mut config.results;
        if !self.results.record.is_empty() {
            results.record.clone_from(&self.results.record);
        }
        if !self.results.exclude.is_empty() {
            results.exclude.clone_from(&self.results.exclude);
        }
        if !self.results.plot.is_empty() {
            results.plot = split_names(&self.results.plot);
        }
        put(&mut results.every, self.results.record_every);
        let out = self.results.out.as_deref();
        let format = self.results.format.as_deref();
        // A resumed run must not overwrite the files of the run before the checkpoint.
        let next_path = |path: PathBuf| match saved {
            Some(saved) => resumed_path(&path, saved.time()),
            None => path,
        };
        let place = |stated: &Option<PathBuf>, known: &Option<PathBuf>, name: &str| {
            if let Some(path) = stated {
                return path.clone();
            }
            next_path(match (out, known) {
                (None, Some(known)) => known.clone(),
                (out, known) => {
                    let known = known.as_deref().filter(|known| !is_stream(known));
                    let name = known.and_then(Path::file_name).unwrap_or(name.as_ref());
                    out.unwrap_or(Path::new(OUT)).join(name)
                }
            })
        };
        let mut file = place(&self.results.results, &results.file, "results.csv");
        if file == Path::new("-") {
            file = PathBuf::from(STANDARD_OUTPUT);
        }
        match format {
            Some("parquet") if is_stream(&file) => {
                bail!("--format parquet: {} is no file, expected csv", file.display())
            }
            Some(format) if !is_stream(&file) => file = with_format(file, format),
            _ => {}
        }
        results.file = Some(file);
        if self.results.plot_file.is_some() && results.plot.is_empty() {
            bail!("--plot-file needs --plot NAMES");
        }
        results.plot_file = Some(place(&self.results.plot_file, &results.plot_file, "plot.svg"));
        let trace = &self.results.bus_trace;
        if trace.is_some() || results.bus_trace.is_some() {
            results.bus_trace = Some(place(trace, &results.bus_trace, "trace.log"));
        }
        Ok(())
    }
}

/// Returns `path` with the extension of a format. This extension replaces `.csv` and `.parquet`, and is appended to any
/// other name, where the last point may belong to a number, as in `k=1.5`.
fn with_format(path: PathBuf, format: &str) -> PathBuf {
    if ["csv", "parquet"].iter().any(|ending| has_ending(&path, ending)) {
        return path.with_extension(format);
    }
    let mut name = path.into_os_string();
    name.push(format!(".{format}"));
    name.into()
}

/// Returns the path of a file that a run resumed at `time` writes, in the folder of `path`, the file of the original
/// run. A pipe or device keeps its path.
fn resumed_path(path: &Path, time: f64) -> PathBuf {
    if is_stream(path) {
        return path.to_owned();
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    // Numbers such as 1.5 and 1.5e-5 are a part of the name.
    let is_ending = |text: &str| text.starts_with(|letter: char| !letter.is_ascii_digit());
    let (name, ending) = match name.rsplit_once('.') {
        Some((name, ending)) if !name.is_empty() && is_ending(ending) => {
            (name, format!(".{ending}"))
        }
        _ => (&*name, String::new()),
    };
    // The file may belong to a run that was itself resumed.
    let stem = match name.rsplit_once("-from-") {
        Some((stem, time)) if time.parse::<f64>().is_ok() => stem,
        _ => name,
    };
    path.with_file_name(format!("{stem}-from-{}{ending}", seconds(time)))
}

/// Whether `path` has the extension of an FMU, or is the folder of an unpacked one.
fn is_fmu(path: &Path) -> bool {
    has_ending(path, "fmu") || path.join("modelDescription.xml").is_file()
}

/// Whether `path` is a folder, or has the extension of a system.
fn is_system(path: &Path) -> bool {
    path.is_dir() || ["ssp", "ssd", "xml", "toml"].iter().any(|ending| has_ending(path, ending))
}

/// Returns the name of the file without extension, with a number if the configuration already has an FMU of this
/// name.
fn free_name(path: &Path, config: &Config) -> String {
    let stem = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let is_used = |name: &String| config.fmus.0.iter().any(|(known, _)| known == name);
    let numbered = (2..).map(|number| format!("{stem}_{number}"));
    std::iter::once(stem.clone()).chain(numbered).find(|name| !is_used(name)).unwrap_or(stem)
}

/// Whether `path` has this extension, in upper or lower case.
fn has_ending(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(ending))
}

/// Checks the numbers of the command line, and that checkpoints at intervals have a file; numbers of a file were
/// checked when it was read.
fn check_numbers(config: &Config) -> anyhow::Result<()> {
    let above = [
        ("--tolerance", &config.experiment.tolerance),
        ("--time-limit", &config.isolation.time_limit),
        ("--checkpoint-every", &config.checkpoint.every),
    ];
    for (name, value) in above {
        if let Some(value) = value.as_ref().map(Spanned::get_ref)
            && !(*value > 0.0 && value.is_finite())
        {
            bail!("{name} is {value}, expected a finite number above 0");
        }
    }
    if config.checkpoint.every.is_some() {
        config.checkpoint.file.as_ref().context("--checkpoint-every needs --checkpoint FILE")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commas_within_brackets_belong_to_names() {
        let lists = ["plant.A[1,2],plant.x", "ctrl.K[*,1]", "a,,b"].map(str::to_owned);
        let expected = ["plant.A[1,2]", "plant.x", "ctrl.K[*,1]", "a", "", "b"];
        assert_eq!(split_names(&lists), expected);
    }

    #[test]
    fn a_format_replaces_the_ending_of_another_format_only() {
        for (path, format, expected) in [
            ("out/k=1.5", "csv", "out/k=1.5.csv"),
            ("out/k=1.5.csv", "csv", "out/k=1.5.csv"),
            ("results.CSV", "parquet", "results.parquet"),
            ("results", "parquet", "results.parquet"),
        ] {
            assert_eq!(with_format(PathBuf::from(path), format), Path::new(expected));
        }
    }

    #[test]
    fn a_resumed_run_replaces_only_the_time_of_a_former_one_and_writes_to_the_same_pipe() {
        for (path, expected) in [
            ("a/results.csv", "a/results-from-2.5.csv"),
            ("a/results-from-1.csv", "a/results-from-2.5.csv"),
            ("log-from-lab.csv", "log-from-lab-from-2.5.csv"),
            ("a/trace", "a/trace-from-2.5"),
            ("trace-from-1.5", "trace-from-2.5"),
            ("trace-from-1.5e-5", "trace-from-2.5"),
            ("k=1.5.csv", "k=1.5-from-2.5.csv"),
            (STANDARD_OUTPUT, STANDARD_OUTPUT),
        ] {
            assert_eq!(resumed_path(Path::new(path), 2.5), Path::new(expected));
        }
    }
}
