//! The live view of a run: publishes samples and performs the requests of the page between steps.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Context;
use fmu_description::number::seconds;
use fmu_description::{Causality, Kind, ScalarVariable, Variability};
use live::{Action, Facts, Phase, Request, Sample, Source, Subject, Variable, View};
use master::{Port, Probe, Readout, System};
use results::is_stream;
use study::config::CheckpointSettings;
use study::{Error, RealTime, Run};

use super::{interrupt, relative, run_command};
use crate::logging;

/// Name of the file that repeats the run, unless the run is resumed.
pub(super) const FILE: &str = "live.toml";
/// Largest number of signals on the page.
const SIGNALS: usize = 500;
/// Largest number of variables that can be set on the page.
const SETTINGS: usize = 5000;
/// Interval between checks for a signal of the operating system while the run is paused.
const LOOK: Duration = Duration::from_millis(50);
/// Longest time that the command waits at its end for an open page to show the outcome.
const PATIENCE: Duration = Duration::from_secs(2);

/// State of the run at its start, as `--live` gives it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum LiveStart {
    /// The run starts at once
    Running,
    /// The run waits for the page
    Paused,
}

/// The live view of a run.
pub(super) struct Live {
    view: View,
    probe: Probe,
    /// Whether the signals of the page can be read; false after the first error.
    readable: bool,
    phase: Phase,
    /// Whether the run pauses again after its next step.
    pauses_again: bool,
    start: Instant,
    /// Total duration of pauses and requests, left out of the wall-clock time of the run.
    paused: Duration,
    /// Comment lines of the file that repeats the run: its purpose, the interventions, and the stop.
    remarks: Vec<String>,
    /// The file that repeats the run, in the folder of the results. The file of a resumed run has another name, so that
    /// it does not replace the file of the run before the checkpoint.
    file: PathBuf,
    /// The message at the first write of the file if the file of an earlier run is replaced.
    replacement: Option<String>,
    /// Whether the page has stopped the run.
    pub(super) stopped: bool,
}

impl Live {
    /// Starts the view of a run whose recorded variables are `ports`, and prints its address. `pace` is the factor of
    /// `--real-time`, `folder` the current folder.
    pub(super) fn open(
        run: &mut Run,
        ports: &[Port],
        pace: Option<f64>,
        start: LiveStart,
        folder: &Path,
    ) -> anyhow::Result<Self> {
        // Beside a pipe or a device there is no folder for the file.
        let results = run.config.results.file.clone().filter(|file| !is_stream(file));
        let (start_time, stop) = (run.simulation.time(), run.plan.stop);
        let is_resumed = start_time > run.plan.experiment.start_time;
        let first =
            "A run with --live, with its interventions. `aso-ftc run` with this file repeats it";
        let (file, first) = if is_resumed {
            let time = seconds(start_time);
            let name = format!("live-from-{time}.toml");
            (name, format!("{first} from its start, not from the checkpoint at t = {time} s."))
        } else {
            (FILE.to_owned(), format!("{first}."))
        };
        let file = match results {
            Some(results) => results.with_file_name(file),
            None => folder.join(file),
        };
        let shown = relative(&file, folder);
        let replacement =
            file.exists().then(|| format!("{shown}: replaces the changes of an earlier run"));
        let repeat = run_command("", &shown);
        let settable = settable(run.simulation.system());
        let unrecorded = settable.iter().filter(|port| !ports.contains(port));
        let probe = probe(run, &ports.iter().chain(unrecorded).copied().collect::<Vec<_>>())?;
        let system = run.simulation.system();
        let names: Vec<_> = system.slaves.iter().map(|(name, _)| name.as_str()).collect();
        let facts = Facts {
            subject: Subject::Run,
            system: names.join(", "),
            start: start_time,
            stop,
            pace,
            signals: probe.names().iter().filter_map(|name| named(system, name)).collect(),
            settings: settable.iter().map(|port| variable(system, *port)).collect(),
            inputs: inputs(system),
            file: shown,
            repeat,
        };
        let phase = match start {
            LiveStart::Running => Phase::Running,
            LiveStart::Paused => Phase::Paused,
        };
        let view = View::open(&facts, phase).context("--live: the page cannot be served")?;
        logging::forward(view.messages());
        println!("live view: {}", view.address());
        Ok(Self {
            view,
            probe,
            readable: true,
            phase,
            pauses_again: false,
            start: Instant::now(),
            paused: Duration::ZERO,
            remarks: vec![first],
            file,
            replacement,
            stopped: false,
        })
    }

    /// Performs the requests of the page, at a communication point of the run; breaks if the page stops the run.
    /// Without a request, this is one atomic load.
    #[inline]
    pub(super) fn attend(&mut self, run: &mut Run, pace: Option<&mut RealTime>) -> ControlFlow<()> {
        if self.view.is_called() { self.perform_all(run, pace) } else { ControlFlow::Continue(()) }
    }

    /// Publishes a sample if one is due, and performs all requests, during a pause until the pause ends.
    #[cold]
    fn perform_all(&mut self, run: &mut Run, pace: Option<&mut RealTime>) -> ControlFlow<()> {
        let due = self.view.take_calls();
        if std::mem::take(&mut self.pauses_again) {
            self.set_phase(Phase::Paused);
        }
        if due || self.phase == Phase::Paused {
            self.sample(run, pace.as_deref());
        }
        let start = Instant::now();
        loop {
            let wait = (self.phase == Phase::Paused).then_some(LOOK);
            while let Some(request) = self.view.request(wait) {
                self.perform(run, request);
                if self.stopped || wait.is_some() {
                    break;
                }
            }
            let holds = self.phase == Phase::Paused && !run.simulation.is_finished();
            if !holds || self.stopped || interrupt::is_raised() {
                break;
            }
            if self.view.take_calls() {
                self.sample(run, pace.as_deref());
            }
        }
        let held = start.elapsed();
        self.paused += held;
        if let Some(pace) = pace {
            pace.shift(held);
        }
        if self.stopped { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    fn set_phase(&mut self, phase: Phase) {
        self.phase = phase;
        self.view.set_phase(phase);
    }

    fn perform(&mut self, run: &mut Run, request: Request) {
        let time = seconds(run.simulation.time());
        if run.simulation.is_finished() {
            return request.answer(Err(format!("the run has reached its end, t = {time} s")));
        }
        let answer = match &request.action {
            Action::Pause => {
                self.set_phase(Phase::Paused);
                Ok(format!("The run is paused at t = {time} s."))
            }
            Action::Continue => {
                self.set_phase(Phase::Running);
                Ok(format!("The run goes on from t = {time} s."))
            }
            Action::Step => {
                self.set_phase(Phase::Running);
                self.pauses_again = true;
                self.view.call_again();
                Ok(format!("The run makes one step from t = {time} s."))
            }
            Action::Stop => {
                self.stopped = true;
                self.remarks.push(format!(
                    "The run was stopped at t = {time} s; a repetition goes on to the stop time."
                ));
                self.write(run).map(|()| format!("The run is stopped at t = {time} s."))
            }
            Action::Intervene(text) => self.intervene(run, text),
        };
        request.answer(answer);
    }

    fn intervene(&mut self, run: &mut Run, text: &str) -> Result<String, String> {
        let done = run.intervene(text).map_err(|error| error.sentence())?;
        let [time, from] = [done.time, done.from].map(seconds);
        let line = format!("At t = {time} s, to take effect at t = {from} s or later:");
        self.view.intervened(done.time, format!("{line}\n{}", done.text));
        let entries = done.text.lines().map(|line| format!("  {line}"));
        self.remarks.extend(std::iter::once(line).chain(entries));
        self.write(run)?;
        Ok(format!("Accepted: it takes effect at t = {from} s, or at the later time of an entry."))
    }

    /// Writes the file that repeats the run, and logs if it replaces the file of an earlier run; also logs an error.
    fn write(&mut self, run: &Run) -> Result<(), String> {
        let text = self.repetition(run).map_err(|error| error.sentence())?;
        if let Some(replacement) = self.replacement.take() {
            tracing::info!(target: logging::RESULTS_FILE, "{replacement}");
        }
        files::whole::write(&self.file, text.as_bytes()).map_err(|error| {
            let message = format!("done, but {} cannot be written: {error}", self.file.display());
            tracing::error!("{message}");
            message
        })
    }

    /// Returns the complete configuration of the run with all interventions. Its results, its plot and its bus trace
    /// have other names than in the run, and there is no checkpoint.
    fn repetition(&self, run: &Run) -> Result<String, Error> {
        let mut config = run.config.clone();
        let results = &mut config.results;
        for (path, name) in [
            (&mut results.file, "repeat"),
            (&mut results.plot_file, "repeat-plot"),
            (&mut results.bus_trace, "repeat-bus"),
        ] {
            if let Some(path) = path.as_mut().filter(|path| !is_stream(path)) {
                let ending = path.extension().unwrap_or_default().to_string_lossy().into_owned();
                *path = path.with_file_name(format!("{name}.{ending}"));
            }
        }
        config.checkpoint = CheckpointSettings::default();
        let remarks = self.remarks.iter().map(String::as_str);
        let remarks: String = remarks.flat_map(|line| ["# ", line, "\n"]).collect();
        Ok(remarks + &config.render()?)
    }

    /// Publishes the values of the signals, NaN for values that cannot be read; the first error is a warning.
    pub(super) fn sample(&mut self, run: &mut Run, pace: Option<&RealTime>) {
        let start = Instant::now();
        let time = run.simulation.time();
        let mut values = vec![f64::NAN; self.probe.names().len()];
        if self.readable
            && let Err(error) = self.probe.read(run.simulation.system(), time, &mut values)
        {
            self.readable = false;
            tracing::warn!(
                "--live: the signals are not shown any more: {}",
                files::sentence(&error)
            );
        }
        let seconds = self.start.elapsed().saturating_sub(self.paused).as_secs_f64();
        self.view.publish(Sample {
            time,
            values,
            steps: run.tally().steps,
            seconds,
            fallbacks: run.simulation.fallbacks().map(|known| known.count),
            late: pace.map(|pace| pace.overruns().count),
        });
        self.view.set_cost(start.elapsed());
    }

    /// Returns the part of the run's summary on pauses; empty below 1 ms.
    pub(super) fn summary(&self) -> String {
        let paused = self.paused.as_secs_f64();
        if paused < 0.001 {
            return String::new();
        }
        format!("; {paused:.3} s of it paused by the live view")
    }

    /// Prints the command that repeats the run if the page changed it, shows `outcome` on the page, and closes the
    /// page. `folder` is the current folder.
    pub(super) fn end(self, outcome: &str, folder: &Path) {
        if self.remarks.len() > 1 {
            println!("to repeat it: {}", run_command("", &relative(&self.file, folder)));
        }
        self.view.end(outcome, PATIENCE);
    }
}

/// Returns a probe of the first [`SIGNALS`] of `ports` that can be read.
fn probe(run: &mut Run, ports: &[Port]) -> anyhow::Result<Probe> {
    let time = run.simulation.time();
    let system = run.simulation.system();
    let refused = Readout::new(system, ports).unreadable(system, ports, time)?;
    let readable =
        ports.iter().copied().filter(|port| refused.iter().all(|(known, _)| known != port));
    let readable: Vec<Port> = readable.take(SIGNALS).collect();
    Ok(Probe::new(system, &readable))
}

/// Returns the variable with this name; `None` if the system has none.
fn named(system: &System, name: &str) -> Option<Variable> {
    system.port(name).ok().map(|port| variable(system, port))
}

fn variable(system: &System, port: Port) -> Variable {
    let ScalarVariable { kind, description, .. } = system.variable(port);
    let kind = if kind.as_real().is_some() { "Real" } else { kind.element() };
    Variable {
        name: system.name(port),
        unit: study::unit(system, port).unwrap_or_default(),
        kind: kind.to_owned(),
        description: description.clone().unwrap_or_default(),
    }
}

/// Returns the first [`SETTINGS`] of the inputs without a connection and the tunable parameters.
fn settable(system: &System) -> Vec<Port> {
    let inputs = system.ports(Causality::Input).into_iter();
    let free = inputs.filter(|port| system.source(*port).is_none());
    let parameters = system.ports(Causality::Parameter).into_iter();
    let is_tunable = |port: &Port| system.variable(*port).variability == Variability::Tunable;
    free.chain(parameters.filter(is_tunable)).take(SETTINGS).collect()
}

/// Returns the connected inputs on which a fault can act: real numbers, integers and Booleans, each with its output.
fn inputs(system: &System) -> Vec<Source> {
    let fits = |port: Port| {
        !matches!(system.variable(port).kind, Kind::String(_) | Kind::Binary(_) | Kind::Clock(_))
    };
    let connections = system.connections.iter().filter(|connection| fits(connection.to));
    let source = |connection: &master::Connection| Source {
        input: variable(system, connection.to),
        output: system.name(connection.from),
    };
    connections.map(source).collect()
}
