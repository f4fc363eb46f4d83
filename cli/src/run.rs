//! `aso-ftc run`: couples a plant FMU and a controller FMU, and what all runs share.
#![expect(clippy::print_stdout, reason = "the result of the command")]

use std::ffi::OsString;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use fmi2::Experiment;
use indicatif::{ProgressBar, ProgressStyle};
use master::{Algorithm, Course, Fmu, Simulation, Sweep, System, by_direct_dependencies};

use crate::recording::Recording;

/// Name of a master algorithm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum MethodName {
    /// One FMU after the other; inputs follow lines through known values and output derivatives
    GaussSeidel,
    /// One FMU after the other; inputs are held
    GaussSeidelHold,
    /// All FMUs from the same values, held over the step
    Jacobi,
}

impl MethodName {
    fn algorithm(self, step: f64) -> Algorithm {
        let (sweep, course) = match self {
            MethodName::GaussSeidel => (Sweep::GaussSeidel, Course::Limited),
            MethodName::GaussSeidelHold => (Sweep::GaussSeidel, Course::Hold),
            MethodName::Jacobi => (Sweep::Jacobi, Course::Hold),
        };
        Algorithm::fixed(sweep, course, step)
    }
}

/// What every run can be told.
#[derive(clap::Args)]
pub(crate) struct RunOptions {
    /// Communication step in s
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, default_value_t = 0.001)]
    pub(crate) step: f64,
    /// Stop time in s
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, default_value_t = 100.0)]
    pub(crate) stop_time: f64,
    /// Master algorithm
    #[arg(long, value_enum, default_value_t = MethodName::GaussSeidel)]
    pub(crate) method: MethodName,
    /// Interval between the rows of results.csv in s
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, default_value_t = 0.01)]
    pub(crate) record_every: f64,
    /// Set a variable before the run, for example `plant.F_c=20`; may be repeated
    #[arg(long = "set", value_name = "FMU.VARIABLE=VALUE", value_parser = setting)]
    pub(crate) settings: Vec<(String, String)>,
}

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The plant
    #[arg(long, value_name = "FMU", default_value = "dist/FrictionPendulum.fmu")]
    plant: PathBuf,
    /// The controller
    #[arg(long, value_name = "FMU", default_value = "dist/AsoController.fmu")]
    controller: PathBuf,
    /// Connect an output to an input; without this, equal names are connected; may be repeated
    #[arg(long = "connect", value_name = "FROM=TO", value_parser = setting)]
    connections: Vec<(String, String)>,
    /// Load a shared library first, its symbols visible to the FMUs; may be repeated
    #[arg(long, value_name = "LIBRARY")]
    preload: Vec<OsString>,
    /// Folder for results.csv
    #[arg(long, value_name = "FOLDER", default_value = "results/run")]
    out: PathBuf,
    #[command(flatten)]
    run: RunOptions,
}

/// Splits `name=value`.
fn setting(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.is_empty() => Ok((name.to_owned(), value.to_owned())),
        _ => Err("expected the form NAME=VALUE".to_owned()),
    }
}

/// Couples two FMUs and writes what came out.
pub(crate) fn run(options: &Options) -> anyhow::Result<bool> {
    for library in &options.preload {
        master::preload(library)?;
    }
    let mut system = load(&options.plant, &options.controller)?;
    if options.connections.is_empty() {
        if system.connect_equal_names()? == 0 {
            bail!("no output has the name of an input of the other FMU; connect them by --connect");
        }
    } else {
        for (from, to) in &options.connections {
            system.connect(from, to)?;
        }
    }
    let names: Vec<_> = system
        .connections
        .iter()
        .map(|connection| {
            format!("{} -> {}", system.name(connection.from), system.name(connection.to))
        })
        .collect();
    println!("{}", names.join("\n"));
    std::fs::create_dir_all(&options.out)
        .with_context(|| format!("cannot make the folder {}", options.out.display()))?;
    for (name, value) in &options.run.settings {
        system.set(name, value)?;
    }
    let order = by_direct_dependencies(&system);
    if !order.looped.is_empty() {
        let names: Vec<_> =
            order.looped.iter().map(|slave| system.slaves[*slave].0.as_str()).collect();
        eprintln!("note: direct dependencies form a loop through {}", names.join(", "));
    }
    let finished = simulate(system, &options.run, |_| Ok(()))?;
    let results = options.out.join("results.csv");
    finished.recording.write(&results)?;
    println!("{}", results.display());
    match finished.lost {
        None => Ok(true),
        Some(reason) => bail!("the run ended early: {reason}"),
    }
}

/// The two FMUs, instantiated as `plant` and `controller`, not yet connected.
pub(crate) fn load(plant: &Path, controller: &Path) -> anyhow::Result<System> {
    let mut system = System::default();
    for (name, path) in [("plant", plant), ("controller", controller)] {
        system.add(name, Box::new(Fmu::open(path)?.instantiate(name)?))?;
    }
    Ok(system)
}

/// A run that came to its end, planned or not.
pub(crate) struct Finished {
    pub(crate) recording: Recording,
    pub(crate) simulation: Simulation,
    /// Why it ended before the stop time.
    pub(crate) lost: Option<String>,
}

/// Initialises `system` and advances it to the stop time; `watch` sees the start and every step.
///
/// An FMU that fails on the way ends the run: what was recorded until then is kept.
pub(crate) fn simulate(
    system: System,
    options: &RunOptions,
    mut watch: impl FnMut(&mut Simulation) -> Result<(), master::SystemError>,
) -> anyhow::Result<Finished> {
    if !(options.record_every > 0.0 && options.record_every.is_finite()) {
        bail!("--record-every is {} s, expected more than 0", options.record_every);
    }
    let stop_time = Some(options.stop_time);
    let experiment = Experiment { start_time: 0.0, stop_time, tolerance: None };
    let mut recording = Recording::new(&system, 0.0, options.record_every);
    let mut simulation =
        Simulation::new(system, &options.method.algorithm(options.step), &experiment)?;
    let bar = progress(options.stop_time);
    let mut advance = || {
        watch(&mut simulation)?;
        recording.sample(&mut simulation)?;
        while !simulation.is_finished() {
            simulation.step()?;
            watch(&mut simulation)?;
            recording.sample(&mut simulation)?;
            show(&bar, simulation.time());
        }
        simulation.terminate()
    };
    let lost = advance().err().map(|error: master::SystemError| error.to_string());
    bar.finish_and_clear();
    Ok(Finished { recording, simulation, lost })
}

/// A bar of simulated time; hidden where the output is no terminal.
fn progress(stop_time: f64) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{bar:40} {pos} of {len} s simulated")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(whole_seconds(stop_time)).with_style(style)
}

fn show(bar: &ProgressBar, time: f64) {
    let seconds = whole_seconds(time);
    if seconds != bar.position() {
        bar.set_position(seconds);
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a display")]
fn whole_seconds(time: f64) -> u64 {
    time.max(0.0) as u64
}
