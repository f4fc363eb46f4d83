//! `aso-ftc run`: couples FMUs, and what all runs share.

mod advance;
mod assemble;
mod interrupt;
mod open_inputs;
mod options;
mod plan;
mod progress;
mod record;
mod resume;
mod saved;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, bail};
use fmu_import::CallLog;
use master::Scenario;
use master::{Coupling, Port, Simulation, System, by_direct_dependencies};
use results::Selection;
use study::scenario::Setup;

use crate::config::{Config, Every, Loaded};
use crate::logging;
use crate::plot;
use advance::Saver;
use advance::Tally;
pub(crate) use advance::{Beside, Ended};
pub(crate) use assemble::{Making, assemble};
pub(crate) use interrupt::{STATUS as INTERRUPTED, has_begun};
pub(crate) use options::{AlgorithmOptions, Options, setting};
use plan::{Plan, plan};
pub(crate) use record::{Recorder, keep_results, select};
use saved::Saved;

/// Most connections that are listed.
const LISTED: usize = 20;

/// Couples FMUs and writes what comes out. Exit status: 0 the run came to its end, 1 it was lost on
/// its way, 2 it did not begin, 130 it was interrupted.
pub(crate) fn run(options: &Options) -> ExitCode {
    logging::begin(options.verbose, options.log_json);
    if let Err(error) = interrupt::listen() {
        tracing::warn!("{}", logging::sentence(&error));
    }
    match prepare(options) {
        Ok(None) => ExitCode::SUCCESS,
        Ok(Some(prepared)) => prepared.go(),
        Err(error) => {
            tracing::error!("{}", logging::sentence(&error));
            ExitCode::from(2)
        }
    }
}

/// A run that can begin.
struct Prepared {
    simulation: Simulation,
    recorder: Option<Recorder>,
    saver: Option<Saver>,
    stop: f64,
    resumed: bool,
    config: Config,
    /// The current folder at the begin.
    here: PathBuf,
    /// Units by variable, for the plot.
    units: Vec<(String, String)>,
    /// Outlives the simulation.
    _folders: Option<ssp::Folders>,
}

/// Everything before the first step; nothing where only the configuration was asked for.
fn prepare(options: &Options) -> anyhow::Result<Option<Prepared>> {
    let (mut loaded, saved) = options.load()?;
    // An FMU may change the current folder.
    let here = std::env::current_dir().context("the current folder")?;
    loaded.config.make_absolute().context("the current folder")?;
    let log_calls = options.log_calls.as_deref().map(open_call_log).transpose()?;
    let making = Making {
        logging: options.verbose > 0,
        by_unit: options.names_fmus_by_file(),
        log_calls: log_calls.as_ref(),
    };
    let by_name = loaded.config.connections.is_none() && loaded.config.system.is_none();
    let mut assembled = assemble(&loaded, &making)?;
    let plan = plan(&mut loaded.config, &assembled)?;
    let system = std::mem::take(&mut assembled.system);
    let scenario = scenario(&loaded, &system, &plan)?;
    let config = loaded.config;
    let text = config.render()?;
    if options.print_config {
        print!("{text}");
        return Ok(None);
    }
    let ports = select(&system, &config.results.record, &config.results.exclude)?;
    check_saving(&config, &system)?;
    check_plot(&config, &system, &ports)?;
    describe(options, &system, &plan, by_name);
    let units = units(&system, &ports);
    let file = results_file(&config)?;
    let mut simulation = begin(system, &plan, scenario, saved.as_ref())?;
    if let Some(early) = simulation.early_end() {
        tracing::warn!("{early}");
    }
    let (recorder, resumed) = record(&mut simulation, file, &ports, &plan, saved.as_ref())?;
    Ok(Some(Prepared {
        simulation,
        recorder,
        saver: saver(&config, text, plan.every),
        stop: plan.stop,
        resumed,
        config,
        here,
        units,
        _folders: assembled.folders,
    }))
}

/// Prints what is connected and, where connections are made `by_name`, what is not.
fn describe(options: &Options, system: &System, plan: &Plan, by_name: bool) {
    println!("{}", connections(system));
    let open = if by_name { open_inputs::list(system) } else { String::new() };
    if !open.is_empty() {
        println!("{open}");
    }
    if options.explain {
        println!("{}", plan.explanation(system));
    }
    warn_of_loop(plan, system);
}

fn open_call_log(path: &Path) -> anyhow::Result<CallLog> {
    CallLog::create(path).with_context(|| format!("cannot write {}", path.display()))
}

/// The system initialised, or where the checkpoint left it.
fn begin(
    system: System,
    plan: &Plan,
    scenario: Scenario,
    saved: Option<&Saved>,
) -> anyhow::Result<Simulation> {
    let Plan { algorithm, experiment, .. } = plan;
    let Some(saved) = saved else {
        return Ok(Simulation::with_scenario(system, algorithm, experiment, scenario)?);
    };
    resume::resume(system, plan, scenario, saved.checkpoint())
}

/// The recorder, and whether it goes on with the rows of the checkpoint.
fn record(
    simulation: &mut Simulation,
    file: &Path,
    ports: &[Port],
    plan: &Plan,
    saved: Option<&Saved>,
) -> anyhow::Result<(Option<Recorder>, bool)> {
    let start = plan.experiment.start_time;
    let mut recorder = Recorder::create(file, simulation, ports, plan.every, start)?;
    let due = saved.and_then(|saved| saved.due(plan.every));
    if let (Some(recorder), Some(saved)) = (&mut recorder, saved) {
        recorder.restore(simulation, saved.slow())?;
        if let Some(due) = due {
            recorder.set_due(due);
        }
    }
    Ok((recorder, due.is_some()))
}

/// What is done to the system while it runs.
fn scenario(loaded: &Loaded, system: &System, plan: &Plan) -> anyhow::Result<Scenario> {
    // Its paths already begin beside the file.
    let folder = Path::new("");
    let setup = Setup { folder, start: plan.experiment.start_time, step: plan.algorithm.step };
    let resolved = loaded.config.scenario.resolve(system, &setup);
    let prepared = resolved.map_err(|error| loaded.point(&error.place.clone(), error))?;
    for (file, column) in &prepared.unused {
        tracing::info!("{}: the column {column:?} drives nothing", file.display());
    }
    Ok(prepared.scenario)
}

fn results_file(config: &Config) -> anyhow::Result<&Path> {
    config.results.file.as_deref().context("no file for the results")
}

/// A checkpoint that cannot be saved is better known before the run than after it.
fn check_saving(config: &Config, system: &System) -> anyhow::Result<()> {
    if config.checkpoint.file.is_none() {
        return Ok(());
    }
    let unable = system.slaves.iter().find(|(_, slave)| {
        let flags = slave.description().co_simulation.as_ref();
        !flags.is_some_and(|flags| flags.can_serialize_fmu_state)
    });
    match unable {
        Some((name, _)) => {
            bail!("{name} cannot take part in a checkpoint: its canSerializeFMUstate is false")
        }
        None => Ok(()),
    }
}

/// What cannot be drawn is better known before the run than after it.
fn check_plot(config: &Config, system: &System, ports: &[Port]) -> anyhow::Result<()> {
    let results = &config.results;
    let (false, Some(picture)) = (results.plot.is_empty(), &results.plot_file) else {
        return Ok(());
    };
    let ending = picture.extension().unwrap_or_default().to_ascii_lowercase();
    if ending != "svg" && ending != "png" {
        bail!("{}: a plot is a .svg or a .png", picture.display());
    }
    if results.every == Some(Every::Never) {
        bail!("there is nothing to plot where rows are recorded `never`");
    }
    let names: Vec<_> = ports.iter().map(|&port| system.name(port)).collect();
    let selection = Selection { include: results.plot.clone(), exclude: Vec::new() };
    selection.choose(&names).context("plot").map(|_| ())
}

fn saver(config: &Config, text: String, every: Every) -> Option<Saver> {
    let interval = config.checkpoint.every.as_ref().map(|every| *every.get_ref());
    config.checkpoint.file.clone().map(|path| Saver { path, interval, text, every })
}

/// The connections, the first ones by name.
fn connections(system: &System) -> String {
    let names = system.connections.iter().map(|connection| {
        format!("{} -> {}", system.name(connection.from), system.name(connection.to))
    });
    let mut lines: Vec<_> = names.take(LISTED).collect();
    let more = system.connections.len().saturating_sub(LISTED);
    if more > 0 {
        lines.push(format!("and {more} more connections"));
    }
    if lines.is_empty() {
        lines.push("no connections".to_owned());
    }
    lines.join("\n")
}

fn warn_of_loop(plan: &Plan, system: &System) {
    let looped = by_direct_dependencies(system).looped;
    if plan.algorithm.coupling == Coupling::Once && !looped.is_empty() {
        let names: Vec<_> = looped.iter().map(|&slave| system.slaves[slave].0.as_str()).collect();
        tracing::warn!(
            "direct dependencies form a loop through {}, which is not iterated",
            names.join(", ")
        );
    }
}

/// How far a run came, in how many steps and how fast.
fn summary(tally: Tally, begin: f64, time: f64) -> String {
    let Tally { steps, seconds } = tally;
    let steps = if steps == 1 { "1 step".to_owned() } else { format!("{steps} steps") };
    let factor = (time - begin) / seconds.max(f64::MIN_POSITIVE);
    format!(
        "t = {time} s reached in {steps} and {seconds:.3} s of wall-clock time, {factor:.3} times \
         real time"
    )
}

fn units(system: &System, ports: &[Port]) -> Vec<(String, String)> {
    let unit = |port: &Port| Some((system.name(*port), record::unit(system, *port)?));
    ports.iter().filter_map(unit).collect()
}

impl Prepared {
    fn go(mut self) -> ExitCode {
        let begin = self.simulation.time();
        let mut beside = Beside {
            recorder: self.recorder.as_mut(),
            saver: self.saver.as_ref(),
            stop: self.stop,
            resumed: self.resumed,
            tally: Tally::default(),
        };
        let ended = beside.advance(&mut self.simulation, |_| Ok(()));
        let tally = beside.tally;
        let time = self.simulation.time();
        println!("{}", summary(tally, begin, time));
        self.warn_of_fallbacks(tally);
        let written = self.write(&ended);
        let status = match &ended {
            Ended::AtStop => 0,
            Ended::ByFmu(name) => {
                let asked = self.simulation.ended_at().unwrap_or(time);
                let ending = apart(asked, time);
                tracing::warn!(
                    "{name} asked for the end of the simulation at t = {asked} s{ending}"
                );
                0
            }
            Ended::Interrupted => {
                let more = self.saver.as_ref().map(|saver| resume::hint(&saver.path, &self.here));
                let more = more.unwrap_or_default();
                tracing::error!("the run was interrupted at t = {time} s{more}");
                interrupt::STATUS
            }
            Ended::Lost(error) => {
                let error = logging::sentence(error);
                tracing::error!("the run ended early, after t = {time} s: {error}");
                1
            }
        };
        if let Err(error) = written {
            tracing::error!("{}", logging::sentence(&error));
            return ExitCode::from(status.max(1));
        }
        ExitCode::from(status)
    }

    fn warn_of_fallbacks(&self, tally: Tally) {
        let Some(fallbacks) = self.simulation.fallbacks().filter(|known| known.count > 0) else {
            return;
        };
        tracing::warn!(
            "the iteration failed in {} of {} steps, which were made once instead; the first \
             failure: {}. A smaller --step or a larger --relative-tolerance may help; --coupling once \
             makes every step once",
            fallbacks.count,
            tally.steps,
            fallbacks.first
        );
    }

    /// Ends the results, draws them, and says what was written.
    fn write(&mut self, ended: &Ended) -> anyhow::Result<()> {
        let written = |path: &Path| {
            println!("{}", path.strip_prefix(&self.here).unwrap_or(path).display());
        };
        if let Some(recorder) = self.recorder.take() {
            recorder.finish()?;
            let file = results_file(&self.config)?;
            written(file);
            let results = &self.config.results;
            if let (false, Some(picture)) = (results.plot.is_empty(), &results.plot_file) {
                let unit = |name: &str| {
                    let known = self.units.iter().find(|(known, _)| known == name);
                    known.map(|(_, unit)| unit.clone())
                };
                plot::plot_with_units(file, &results.plot, &unit, picture)?;
                written(picture);
            }
        }
        if let (Some(saver), false) = (&self.saver, matches!(ended, Ended::Lost(_))) {
            written(&saver.path);
        }
        Ok(())
    }
}

/// Where results end before the time at which an FMU asked for the end, all in s.
fn apart(asked: f64, end: f64) -> String {
    if asked <= end {
        return String::new();
    }
    format!(
        "; the results end at t = {end} s, the last time that all FMUs have in common (with \
         --rollback, which needs FMUs that can go back, they end at {asked} s)"
    )
}
