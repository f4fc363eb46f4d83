//! `aso-ftc reproduce`: repeats the paper's experiment, from the sources to the figures.

use std::collections::HashMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use master::{Probe, Simulation, System, SystemError};
use results::Table;
use toml::Spanned;

use crate::claims::{Claim, Measurement, WATCHED, table};
use study::{AssemblyOptions, Config, Every, LoadedConfig, PreparedRun, Run, RunEnd};

use crate::run::{AlgorithmOptions, advance, setting};
use crate::scenario::Scenario;
use crate::summary::{ControllerCertificate, Summary};
use crate::{models, pack, paper_figures, summary};

/// Name of the results file.
const RESULTS: &str = "results.csv";
/// Communication step in s.
const STEP: f64 = 0.001;

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The experiment
    ///
    /// paper has the nonlinear plant from x(0) = [0.1, -0.1, 0, 0]; paper-literal the
    /// linearised plant from the paper's x(0) = [1.1, -1.1, 0, 0]; printed-gains the paper's printed L with
    /// two signs corrected, with which the nonlinear plant becomes unstable.
    #[arg(long, value_enum, default_value_t = Scenario::Paper)]
    #[arg(hide_possible_values = true, help_heading = "System")]
    scenario: Scenario,
    /// Set a variable before the run
    ///
    /// For example `plant.F_c=20`; may be repeated.
    #[arg(long = "set", value_name = "FMU.VARIABLE=VALUE", value_parser = setting)]
    #[arg(help_heading = "System")]
    settings: Vec<(String, String)>,
    /// Folder for the FMUs
    ///
    /// They are packed from the clone that the current folder is in. Outside of a clone, the FMUs beside
    /// the command are used; without these, the clone in which the command was built is packed.
    #[arg(long, value_name = "FOLDER", default_value = "dist", help_heading = "System")]
    dist: PathBuf,
    /// Stop time in s
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, default_value_t = 100.0)]
    #[arg(help_heading = "Time")]
    stop_time: f64,
    #[command(flatten)]
    algorithm: AlgorithmOptions,
    /// Results folder
    #[arg(long, value_name = "FOLDER", default_value = "results/reproduce")]
    #[arg(help_heading = "Results")]
    out: PathBuf,
    /// Interval between rows in s
    ///
    /// Or `step`, which records each communication point.
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, default_value = "0.01")]
    #[arg(value_parser = str::parse::<Every>, help_heading = "Results")]
    record_every: Every,
}

/// Packs the FMUs, runs the experiment, writes results and figures, and compares with the claims;
/// returns true if every claim that could be judged holds and every file is written.
pub(crate) fn reproduce(options: &Options) -> anyhow::Result<bool> {
    if options.record_every == Every::Never {
        bail!("--record-every never leaves nothing to draw, expected seconds or `step`");
    }
    let fmus = pack::folder_of_models(&options.dist)?;
    std::fs::create_dir_all(&options.out)
        .with_context(|| format!("cannot make the folder {}", options.out.display()))?;
    let loaded = experiment(options, &fmus, &settings(options));
    let prepared = PreparedRun::new(loaded, &AssemblyOptions::default())?;
    let mut watch = Watch::new(&prepared.system)?;
    let mut run = prepared.start(None)?;
    let ended = advance(&mut run, |run| {
        watch.add(&mut run.simulation)?;
        Ok(ControlFlow::Continue(()))
    });
    conclude(options, &mut run, &watch, ended).or_else(|error| {
        eprintln!("error: {}", files::sentence(error.as_ref()));
        Ok(false)
    })
}

/// Completes the results of a run, writes its figures and its summary, and prints the claims; returns true if every
/// claim that could be judged holds.
fn conclude(
    options: &Options,
    run: &mut Run,
    watch: &Watch,
    ended: RunEnd,
) -> anyhow::Result<bool> {
    run.finish()?;
    let lost = match ended {
        RunEnd::Failed(error) => Some(error.sentence()),
        RunEnd::ByFmu(name) => Some(format!("{name} requested the end of the simulation")),
        RunEnd::AtStop | RunEnd::Interrupted => None,
    };
    let (reached, settings) = (run.simulation.time(), settings(options));
    let claims = watch.claims(reached, lost.is_some());
    let certified = ControllerCertificate::of(run.simulation.system(), watch.fault_bound())?;
    let written = Summary {
        scenario: options.scenario.name(),
        method: run.plan.algorithm.method.name(),
        extrapolation: run.plan.algorithm.extrapolation.name(),
        communication_step: run.plan.algorithm.step,
        stop_time: options.stop_time,
        reached,
        lost: lost.as_deref(),
        fell: watch.fell(),
        settings: settings.iter().map(|(name, value)| format!("{name}={value}")).collect(),
        claims: &claims,
        design: &certified,
    };
    let columns = columns(&options.out.join(RESULTS))?;
    let column = |name: &str| columns.get(name).map(Vec::as_slice);
    paper_figures::write(&column, watch.t_on(), &options.out)?;
    summary::write(&written, &options.out.join("summary.json"))?;
    report(options, &written);
    Ok(claims.iter().all(|claim| claim.holds != Some(false)))
}

/// Returns the configuration of a run of plant and controller in the folder `fmus` with these settings.
fn experiment(options: &Options, fmus: &Path, settings: &[(String, String)]) -> LoadedConfig {
    let mut config = Config::default();
    for (name, file) in models::FMUS {
        config.fmus.put(name.to_owned(), fmus.join(file));
    }
    for (name, value) in settings {
        config.settings.push(name.clone(), value.clone());
    }
    config.algorithm.step = Some(STEP);
    options.algorithm.apply(&mut config.algorithm);
    config.experiment.stop_time = Some(Spanned::new(0..0, options.stop_time));
    config.results.file = Some(options.out.join(RESULTS));
    config.results.every = Some(options.record_every);
    LoadedConfig { config, source: None }
}

/// Returns the settings of the scenario, followed by the settings of the command line.
fn settings(options: &Options) -> Vec<(String, String)> {
    options.scenario.settings().into_iter().chain(options.settings.iter().cloned()).collect()
}

/// Reads the columns that the figures need from a results file, as far as the file has them.
fn columns(path: &Path) -> anyhow::Result<HashMap<String, Vec<f64>>> {
    let table = Table::open(path)?;
    let mut columns = HashMap::new();
    for (position, column) in table.columns().iter().enumerate() {
        if paper_figures::COLUMNS.contains(&column.name.as_str()) {
            columns.insert(column.name.clone(), table.column(position)?);
        }
    }
    Ok(columns)
}

/// Prints the table of claims, when and why the pendulum fell or the run ended early, and the folder of the results.
fn report(options: &Options, written: &Summary) {
    println!("scenario {}", written.scenario);
    println!("{}", table(written.claims));
    if let Some(time) = written.fell {
        println!("the pendulum fell over at t = {time:.3} s");
    }
    if let Some(reason) = written.lost {
        println!("the run ended at t = {:.3} s: {reason}", written.reached);
    }
    if let Some(expectation) = options.scenario.expectation() {
        println!("{expectation}");
    }
    println!("results in {}", options.out.display());
}

/// The variables read at every communication point.
struct Watch {
    probe: Probe,
    /// `controller.t_on`, `plant.F_s` and `plant.linearised`.
    parameters: Probe,
    /// The values of `parameters` at the start; 0 before.
    parameter_values: [f64; 3],
    /// The measurements; `None` before the start.
    measurement: Option<Measurement>,
}

impl Watch {
    fn new(system: &System) -> anyhow::Result<Self> {
        let ports = |names: &[&str]| {
            names.iter().map(|name| system.port(name)).collect::<Result<Vec<_>, _>>()
        };
        let parameters = ["controller.t_on", "plant.F_s", "plant.linearised"];
        Ok(Self {
            probe: Probe::new(system, &ports(&WATCHED)?),
            parameters: Probe::new(system, &ports(&parameters)?),
            parameter_values: [0.0; 3],
            measurement: None,
        })
    }

    /// Adds the values at the present time; the first call reads the parameters.
    fn add(&mut self, simulation: &mut Simulation) -> Result<(), SystemError> {
        let time = simulation.time();
        if self.measurement.is_none() {
            self.parameters.read(simulation.system(), time, &mut self.parameter_values)?;
            self.measurement = Some(Measurement::new(self.t_on(), self.parameter_values[2] != 0.0));
        }
        let mut values = [0.0; WATCHED.len()];
        self.probe.read(simulation.system(), time, &mut values)?;
        if let Some(measurement) = &mut self.measurement {
            measurement.add(time, values);
        }
        Ok(())
    }

    fn fell(&self) -> Option<f64> {
        self.measurement.as_ref().and_then(Measurement::fell)
    }

    fn t_on(&self) -> f64 {
        self.parameter_values[0]
    }

    /// Returns the bound of the fault in N: the static friction `F_s` of the plant.
    fn fault_bound(&self) -> f64 {
        self.parameter_values[1]
    }

    fn claims(&self, end: f64, lost: bool) -> Vec<Claim> {
        self.measurement.as_ref().map(|all| all.claims(end, lost)).unwrap_or_default()
    }
}
