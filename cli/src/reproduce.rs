//! `aso-ftc reproduce`: the paper's experiment, from the sources to the figures.
#![expect(clippy::print_stdout, reason = "the result of the command")]

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::ValueEnum;
use master::{Probe, System};

use crate::claims::{Claim, Measurement, WATCHED, table};
use crate::run::{Finished, RunOptions, load, simulate};
use crate::scenario::Scenario;
use crate::summary::{Certified, Summary};
use crate::{pack, paper_figures, summary};

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The experiment
    #[arg(long, value_enum, default_value_t = Scenario::Paper)]
    scenario: Scenario,
    /// Folder for the results
    #[arg(long, value_name = "FOLDER", default_value = "results/reproduce")]
    out: PathBuf,
    /// Folder for the FMUs
    #[arg(long, value_name = "FOLDER", default_value = "dist")]
    dist: PathBuf,
    #[command(flatten)]
    run: RunOptions,
}

/// Packs, runs, writes, compares; true where every claim that could be judged holds.
pub(crate) fn reproduce(options: &Options) -> anyhow::Result<bool> {
    pack::pack_into(&pack::workspace()?, &options.dist)?;
    let mut system =
        load(&options.dist.join("FrictionPendulum.fmu"), &options.dist.join("AsoController.fmu"))?;
    system.connect_equal_names()?;
    let settings = settings(options);
    for (name, value) in &settings {
        system.set(name, value)?;
    }
    std::fs::create_dir_all(&options.out)
        .with_context(|| format!("cannot make the folder {}", options.out.display()))?;
    let mut watch = Watch::new(&system)?;
    let mut finished = simulate(system, &options.run, |simulation| watch.add(simulation))?;
    let claims = watch.claims(&finished);
    let t_on = watch.t_on();
    let certified = Certified::of(finished.simulation.system(), watch.fault_bound())?;
    let written = Summary {
        scenario: options.scenario.name(),
        method: name_of(&options.run.method),
        communication_step: options.run.step,
        stop_time: options.run.stop_time,
        reached: finished.simulation.time(),
        lost: finished.lost.as_deref(),
        fell: watch.fell(),
        settings: settings.iter().map(|(name, value)| format!("{name}={value}")).collect(),
        claims: &claims,
        design: &certified,
    };
    write(&options.out, &finished, t_on, &written)?;
    report(options, &written);
    Ok(claims.iter().all(|claim| claim.holds != Some(false)))
}

/// Those of the scenario, then those of the command line.
fn settings(options: &Options) -> Vec<(String, String)> {
    options.scenario.settings().into_iter().chain(options.run.settings.iter().cloned()).collect()
}

fn name_of(value: &impl ValueEnum) -> String {
    value.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
}

fn write(out: &Path, finished: &Finished, t_on: f64, written: &Summary) -> anyhow::Result<()> {
    finished.recording.write(&out.join("results.csv"))?;
    paper_figures::write(&|name| finished.recording.column(name), t_on, out)?;
    summary::write(written, &out.join("summary.json"))
}

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

/// What is watched at every communication point.
struct Watch {
    probe: Probe,
    /// `controller.t_on`, `plant.F_s` and `plant.linearised`, read at the start.
    parameters: Probe,
    parameter_values: [f64; 3],
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

    fn add(&mut self, simulation: &mut master::Simulation) -> Result<(), master::SystemError> {
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

    /// The largest friction, in N.
    fn fault_bound(&self) -> f64 {
        self.parameter_values[1]
    }

    fn claims(&self, finished: &Finished) -> Vec<Claim> {
        let (end, lost) = (finished.simulation.time(), finished.lost.is_some());
        self.measurement.as_ref().map(|measured| measured.claims(end, lost)).unwrap_or_default()
    }
}
