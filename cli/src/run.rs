//! `aso-ftc run`: couples FMUs.

mod facts;
mod interrupt;
mod live;
mod open_inputs;
mod options;
mod progress;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use fmu_description::{Kind, number};
use fmu_import::CallLog;
use master::{CallError, Coupling, Failure, Port, System, by_direct_dependencies};
use results::{STANDARD_OUTPUT, Selection, is_stream};
use study::{
    AssemblyOptions, Config, Error, Every, LoadedConfig, Plan, PreparedRun, RealTime, Run, RunEnd,
    RunStatistics,
};

use crate::{logging, outputs, plot};
use facts::PlannedEntries;
pub(crate) use interrupt::status as interrupted;
use live::Live;
pub(crate) use options::{AlgorithmOptions, Options, setting, split_names};
use progress::Progress;

/// Largest number of connections that the command lists.
const LISTED: usize = 20;

/// Couples FMUs and writes the results. Exit status: 0 if the run reached its stop time, or an FMU or the live view
/// ended it, or `--print-config` is stated; 1 if it failed after its start, or an output is not complete; 2 if it could
/// not start; 128 and the number of the signal that ended it.
pub(crate) fn run(options: &Options) -> u8 {
    options.start_logging();
    if options.results.report {
        logging::collect();
    }
    if let Err(error) = interrupt::listen() {
        tracing::warn!("{}", files::sentence(error.as_ref()));
    }
    match prepare(options) {
        Ok(None) => 0,
        Ok(Some(active)) => {
            let log = active.log_calls.clone();
            let status = active.go();
            // Checked here because the last calls to log, which free the instances, are in `go`.
            match log.map(|(log, path)| (log.check(), path)) {
                Some((Err(error), path)) => {
                    tracing::error!("{}: calls are missing: {error}", path.display());
                    status.max(1)
                }
                _ => status,
            }
        }
        Err(error) => {
            tracing::error!("{}", explained(error.as_ref()));
            2
        }
    }
}

/// Returns the sentence of an error, and how to see the messages of an FMU if it failed without one and its messages are
/// not switched on.
fn explained(error: &(dyn std::error::Error + 'static)) -> String {
    let is_silent = |cause: &(dyn std::error::Error + 'static)| {
        cause.downcast_ref::<CallError>().is_some_and(|call| {
            matches!(call.failure, Failure::Status(_)) && call.messages.is_empty()
        })
    };
    let mut causes = std::iter::successors(Some(error), |cause| cause.source());
    let mut sentence = files::sentence(error);
    if causes.any(is_silent) && !tracing::enabled!(target: logging::FMU, tracing::Level::INFO) {
        sentence += "; with -v the FMU may state the reason";
    }
    sentence
}

/// A started run, with the data needed at its end.
struct ActiveRun {
    run: Run,
    /// The current folder at the start of the run.
    folder: PathBuf,
    /// Units by variable, for the plot.
    units: Vec<(String, String)>,
    /// The properties of the run for the report, if a report is requested.
    report: Option<report::Run>,
    /// Number of entries of the scenario at the start; further entries are interventions.
    planned: PlannedEntries,
    /// The trace of the buses that the report can show.
    bus_trace: Option<PathBuf>,
    /// The pacing of the run by the wall clock, if requested.
    pace: Option<RealTime>,
    /// The live view, if one is requested.
    live: Option<Live>,
    /// The log of calls and its path, if a log is requested.
    log_calls: Option<(CallLog, PathBuf)>,
}

/// Prepares and starts the run; with `--print-config`, prints the configuration and returns `None`.
fn prepare(options: &Options) -> anyhow::Result<Option<ActiveRun>> {
    let (loaded, saved) = options.load()?;
    check_outputs(options, &loaded)?;
    // An FMU may change the current folder.
    let folder = std::env::current_dir().context("the current folder")?;
    let log_calls = options.watching.log_calls.as_deref().map(open_call_log).transpose()?;
    let assembly = AssemblyOptions {
        logging: options.watching.verbose > 0,
        by_unit: options.names_fmus_by_file(),
        log_calls: log_calls.as_ref(),
        ..Default::default()
    };
    let by_name = loaded.config.connections.is_none() && loaded.config.system.is_none();
    let prepared = PreparedRun::new(loaded, &assembly)?;
    if options.watching.print_config {
        print!("{}", prepared.config.render()?);
        return Ok(None);
    }
    let PreparedRun { config, system, plan, ports, .. } = &prepared;
    check_plot(config, system, ports)?;
    if options.results.report && config.results.every == Some(Every::Never) {
        bail!("--report: there is nothing to report where rows are recorded `never`");
    }
    describe(options, &prepared, by_name);
    let units = units(system, ports);
    let report = options.results.report.then(|| facts::facts(system, plan, &config.results.plot));
    let planned = PlannedEntries::of(&config.scenario);
    let is_shown = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "log");
    let bus_trace = config.results.bus_trace.clone().filter(is_shown);
    let ports = prepared.ports.clone();
    let mut run = prepared.start(saved.as_ref())?;
    let pace = options.time.real_time.map(RealTime::new);
    let factor = pace.as_ref().map(|pace| pace.overruns().factor);
    let open = |start| Live::open(&mut run, &ports, factor, start, &folder);
    let live = options.watching.live.map(open).transpose()?;
    let log_calls = log_calls.zip(options.watching.log_calls.clone());
    Ok(Some(ActiveRun { run, folder, units, report, planned, bus_trace, pace, live, log_calls }))
}

/// Checks that no output file is also an input, and that no report or plot reads results back from a stream. Reserves
/// standard output for the results if the results go there.
fn check_outputs(options: &Options, loaded: &LoadedConfig) -> anyhow::Result<()> {
    let config = &loaded.config;
    let results = config.results.file.as_deref();
    let page = results.filter(|_| options.results.report).map(|file| file.with_extension("html"));
    // A resumed run writes another file, but reads no configuration that the file could overwrite.
    let beside = results.filter(|file| !is_stream(file)).unwrap_or(Path::new(live::FILE));
    let repetition = options.watching.live.map(|_| beside.with_file_name(live::FILE));
    let outputs = [
        ("--log-calls", options.watching.log_calls.as_deref()),
        ("the report", page.as_deref()),
        ("the file of --live,", repetition.as_deref()),
    ];
    let outputs = outputs.iter().filter_map(|(role, path)| Some((*role, (*path)?)));
    let source = loaded.source.as_ref().map(|source| ("the configuration", &*source.path));
    config.check_outputs(source.as_slice(), &outputs.collect::<Vec<_>>())?;
    let Some(results) = results.filter(|file| is_stream(file)) else { return Ok(()) };
    for (option, is_stated) in
        [("--report", options.results.report), ("--plot", !config.results.plot.is_empty())]
    {
        if is_stated {
            bail!("{option} reads the results again, and {} is no file", results.display());
        }
    }
    if results == Path::new(STANDARD_OUTPUT) && !options.watching.print_config {
        #[cfg(unix)]
        results::reserve_standard_output().context("standard output")?;
        #[cfg(not(unix))]
        bail!("--results - needs a Unix system");
    }
    Ok(())
}

/// Prints the connections, the inputs that keep their start values if variables are connected `by_name`, and the
/// algorithm with `--explain`; warns of loops that are not iterated.
fn describe(options: &Options, prepared: &PreparedRun, by_name: bool) {
    let PreparedRun { system, plan, .. } = prepared;
    println!("{}", connections(system));
    let open = if by_name { open_inputs::list(prepared) } else { String::new() };
    if !open.is_empty() {
        println!("{open}");
    }
    if options.watching.explain {
        println!("{}", plan.explanation(system));
    }
    warn_of_loop(plan, system);
}

fn open_call_log(path: &Path) -> anyhow::Result<CallLog> {
    CallLog::create(path).with_context(|| format!("cannot write {}", path.display()))
}

/// Advances `run` to its end, or to the step at which a signal arrives, with a progress bar. Calls
/// `watch` at the start and after every step; `watch` can end the run.
pub(crate) fn advance(
    run: &mut Run,
    mut watch: impl FnMut(&mut Run) -> Result<ControlFlow<()>, Error>,
) -> RunEnd {
    fmu_import::crash::begin_steps();
    let mut progress = Progress::new(run.simulation.time(), run.plan.stop);
    let ended = run.advance_open(|run| {
        let flow = watch(run)?;
        progress.show(run.simulation.time());
        #[cfg(unix)]
        fmu_import::crash::end_copy();
        let raised = interrupt::is_raised();
        if raised || run.simulation.is_finished() {
            interrupt::notice();
        }
        Ok(if raised { ControlFlow::Break(()) } else { flow })
    });
    interrupt::notice();
    ended
}

/// Checks before the run that the plot, if one is requested, can be drawn.
fn check_plot(config: &Config, system: &System, ports: &[Port]) -> anyhow::Result<()> {
    let results = &config.results;
    let (false, Some(picture)) = (results.plot.is_empty(), &results.plot_file) else {
        return Ok(());
    };
    plot::is_png(picture)?;
    if results.every == Some(Every::Never) {
        bail!("there is nothing to plot where rows are recorded `never`");
    }
    let names: Vec<_> = ports.iter().map(|&port| system.name(port)).collect();
    let selection = Selection { include: results.plot.clone(), exclude: Vec::new() };
    let chosen = selection.choose(&names).context("plot")?;
    let is_text = |position: &usize| {
        let kind = &system.variable(ports[*position]).kind;
        matches!(kind, Kind::String(_) | Kind::Binary(_))
    };
    let (texts, numbers): (Vec<_>, Vec<_>) = chosen.into_iter().partition(is_text);
    // A pattern selects only variables that can be drawn, a name selects any variable.
    if let Some(text) = texts.into_iter().find(|text| results.plot.contains(&names[*text])) {
        bail!("--plot: {} holds texts, expected numbers", names[text]);
    }
    plot::check_count(numbers.len()).context("--plot")
}

/// Lists the first [`LISTED`] connections and the number of further connections.
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

/// Warns if direct dependencies form a loop and steps are not iterated.
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

/// Formats the time reached, the number of steps and the speed.
fn summary(tally: RunStatistics, start: f64, time: f64) -> String {
    let RunStatistics { steps, seconds } = tally;
    let steps = if steps == 1 { "1 step".to_owned() } else { format!("{steps} steps") };
    let factor = (time - start) / seconds.max(f64::MIN_POSITIVE);
    format!(
        "t = {} s reached in {steps} and {seconds:.3} s of wall-clock time, {} times real time",
        number::seconds(time),
        number::rounded(factor, 3)
    )
}

/// Returns name and unit of each variable that has a unit.
fn units(system: &System, ports: &[Port]) -> Vec<(String, String)> {
    let unit = |port: &Port| Some((system.name(*port), study::unit(system, *port)?));
    ports.iter().filter_map(unit).collect()
}

impl ActiveRun {
    /// Runs to the end, completes the outputs, and returns the exit status.
    fn go(mut self) -> u8 {
        let start = self.run.simulation.time();
        let ended = match (&mut self.pace, &mut self.live) {
            (None, None) => advance(&mut self.run, |_| Ok(ControlFlow::Continue(()))),
            (pace, live) => advance(&mut self.run, |run| {
                if let Some(pace) = pace {
                    pace.wait(run.simulation.time(), interrupt::is_raised);
                }
                let go_on = ControlFlow::Continue(());
                Ok(live.as_mut().map_or(go_on, |live| live.attend(run, pace.as_mut())))
            }),
        };
        if let (Some(live), false) = (&mut self.live, matches!(ended, RunEnd::Failed(_))) {
            live.sample(&mut self.run, self.pace.as_ref());
        }
        let tally = self.run.tally();
        let time = self.run.simulation.time();
        let shown = number::seconds(time);
        let mut outcome = summary(tally, start, time);
        if let Some(pace) = &self.pace {
            outcome = format!("{outcome}; {}", pace.overruns());
        }
        if let Some(live) = &self.live {
            outcome.push_str(&live.summary());
        }
        println!("{outcome}");
        self.warn_of_fallbacks(tally);
        let written = self.write(&ended);
        // The message at the end of the live view.
        let mut message = outcome.clone();
        let status = match &ended {
            RunEnd::AtStop => 0,
            RunEnd::ByFmu(name) => {
                let requested = self.run.simulation.ended_at().unwrap_or(time);
                let note = early_end(requested, time);
                let requested = number::seconds(requested);
                tracing::warn!(
                    "{name} requested the end of the simulation at t = {requested} s{note}"
                );
                0
            }
            RunEnd::Interrupted if self.is_stopped() => {
                message = format!("the run was stopped in the live view at t = {shown} s");
                println!("{message}");
                0
            }
            RunEnd::Interrupted => {
                let more = self.run.checkpoint_file().map(|path| relative(path, &self.folder));
                let more =
                    more.map(|path| format!("; to go on: {}", run_command("--resume ", &path)));
                let more = more.unwrap_or_default();
                message = format!("the run was interrupted at t = {shown} s{more}");
                tracing::error!("{message}");
                interrupt::status()
            }
            RunEnd::Failed(error) => {
                let error = explained(error);
                let end = if self.run.simulation.is_finished() {
                    format!("the run made all steps, up to t = {shown} s, and failed at its end")
                } else {
                    format!("the run ended early, after t = {shown} s")
                };
                message = format!("{end}: {error}");
                tracing::error!("{message}");
                1
            }
        };
        if let Some(live) = self.live.take() {
            live.end(&message, &self.folder);
        }
        let traced = self.run.finish_trace().map_err(anyhow::Error::from);
        let mut outputs = vec![traced];
        match written {
            Ok(Some(file)) => {
                outputs.push(self.draw(&file));
                outputs.push(self.report(&file, outcome, status != 0));
            }
            Ok(None) => {}
            Err(error) => outputs.push(Err(error)),
        }
        let mut status = status;
        for error in outputs.into_iter().filter_map(Result::err) {
            let sentence = files::sentence(error.as_ref());
            // The run may have ended with this error.
            if !message.contains(&sentence) {
                tracing::error!("{sentence}");
            }
            status = status.max(1);
        }
        status
    }

    /// Whether the live view, and no signal, has stopped the run.
    fn is_stopped(&self) -> bool {
        let by_page = self.live.as_ref().is_some_and(|live| live.stopped);
        by_page && !interrupt::is_raised()
    }

    /// Writes the report, if requested, and prints its name.
    fn report(&mut self, file: &Path, outcome: String, failed: bool) -> anyhow::Result<()> {
        let Some(run) = self.report.take() else { return Ok(()) };
        let scenario = &self.run.config.scenario;
        let start = self.run.plan.experiment.start_time;
        let marks = facts::marks(scenario, self.planned, start);
        let disturbed = facts::disturbed(scenario);
        let messages = logging::collected();
        let run = report::Run { outcome, failed, disturbed, marks, messages, ..run };
        let page = report::page(&report::Request {
            results: file,
            against: None,
            variables: &[],
            units: &self.units,
            range: (f64::NEG_INFINITY, f64::INFINITY),
            bus_trace: self.bus_trace.as_deref(),
            run: Some(&run),
        })?;
        let out = file.with_extension("html");
        outputs::write(&out, page.html.as_bytes())?;
        self.show(&out);
        Ok(())
    }

    /// Warns if the iteration failed in some steps.
    fn warn_of_fallbacks(&self, tally: RunStatistics) {
        let Some(fallbacks) = self.run.simulation.fallbacks().filter(|known| known.count > 0)
        else {
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

    /// Completes the results, and prints the names of their file and, unless the run failed, of the checkpoint. Returns
    /// the results file; `None` if none is written.
    fn write(&mut self, ended: &RunEnd) -> anyhow::Result<Option<PathBuf>> {
        let file = self.run.finish()?.map(Path::to_owned);
        if let Some(file) = file.as_deref().filter(|file| !is_stream(file)) {
            self.show(file);
        }
        if let (Some(file), false) =
            (self.run.checkpoint_file(), matches!(ended, RunEnd::Failed(_)))
        {
            self.show(file);
        }
        Ok(file)
    }

    /// Prints the name of a file that was written.
    fn show(&self, path: &Path) {
        println!("{}", relative(path, &self.folder));
    }

    /// Draws the plot of the results in `file`, if requested, and prints its name.
    fn draw(&self, file: &Path) -> anyhow::Result<()> {
        let results = &self.run.config.results;
        let Some(picture) = results.plot_file.as_deref().filter(|_| !results.plot.is_empty())
        else {
            return Ok(());
        };
        plot::plot_with_units(file, &results.plot, &self.units, picture)?;
        self.show(picture);
        Ok(())
    }
}

/// Returns a note if the results end before the time `requested` by an FMU, otherwise an empty text; both times in s.
fn early_end(requested: f64, end: f64) -> String {
    if requested <= end {
        return String::new();
    }
    let [requested, end] = [requested, end].map(number::seconds);
    format!(
        "; the results end at t = {end} s, the last time that all FMUs have in common (with \
         --rollback, which needs FMUs that can go back, they end at {requested} s)"
    )
}

/// Returns `path` relative to `folder` if it is in this folder, otherwise unchanged.
fn relative(path: &Path, folder: &Path) -> String {
    path.strip_prefix(folder).unwrap_or(path).display().to_string()
}

/// Returns the command line of a run of `file`, with `option` before `file`.
fn run_command(option: &str, file: &str) -> String {
    let command = std::env::args().next().unwrap_or_else(|| "aso-ftc".to_owned());
    format!("{} run {option}{}", quoted(&command), quoted(file))
}

/// Quotes an argument for a shell if it has characters that are unusual in paths.
fn quoted(argument: &str) -> String {
    let plain = |letter: char| letter.is_alphanumeric() || "-_./:+@%=,".contains(letter);
    if !argument.is_empty() && argument.chars().all(plain) {
        argument.to_owned()
    } else if cfg!(windows) {
        format!("\"{argument}\"")
    } else {
        format!("'{}'", argument.replace('\'', "'\\''"))
    }
}
