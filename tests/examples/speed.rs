//! Runs a system as fast as the master can and prints the cost, for `scripts/bench/benchmark-peers`.
//!
//!     speed pack FOLDER PORTS
//!     speed run SYSTEM STEP STEPS [RESULTS]
//!
//! `pack` builds the small FMU of `tests/speed` and prints its path. `run` reads a file with one
//! line for each FMU, value and connection, initialises the system, and makes STEPS steps of STEP s
//! by Jacobi's method with held inputs, as `tests/speed/loop.c` does:
//!
//!     fmu NAME PATH
//!     set NAME.VARIABLE VALUE
//!     connect NAME.OUTPUT NAME.INPUT
//!
//! With RESULTS, it writes every output of every step to that file; the extension selects the
//! format. It prints a JSON object: processor time in ns of the start (from the archives to the end
//! of initialisation) and of one step, wall-clock time of the start, peak memory in KiB, and the
//! sum of all Real outputs at the end.
#![forbid(unsafe_code)]
#![expect(clippy::print_stdout, reason = "the result")]
#![expect(clippy::cast_precision_loss, reason = "figures for a table")]

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, bail};
use fmu_description::Causality;
use fmu_description::Experiment;
use fmu_import::Fmu;
use master::algorithm::{Algorithm, Extrapolation, Method};
use master::{Readout, Simulation, System};
use results::{Column, ColumnKind, Row, create};
use rustix::time::{ClockId, clock_gettime};

#[path = "../speed/lag.rs"]
#[expect(dead_code, reason = "the rings are for the benchmark beside this")]
mod lag;

/// Returns the processor time of this process in ns.
fn cpu() -> f64 {
    let now = clock_gettime(ClockId::ProcessCPUTime);
    now.tv_sec as f64 * 1e9 + now.tv_nsec as f64
}

/// Returns the peak memory in KiB on Linux; 0 elsewhere.
fn peak() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|text| text.split_whitespace().next()?.parse().ok()).unwrap_or(0)
}

/// Builds the system of a file; opens an archive once even if several lines name it.
fn read(path: &Path) -> anyhow::Result<System> {
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    let (mut system, mut opened) = (System::default(), HashMap::<PathBuf, Fmu>::new());
    for line in text.lines() {
        match line.splitn(3, ' ').collect::<Vec<_>>()[..] {
            ["fmu", name, path] => {
                let path = PathBuf::from(path);
                if !opened.contains_key(&path) {
                    opened.insert(path.clone(), Fmu::open(&path)?);
                }
                system.add(name, Box::new(opened[&path].instantiate(name)?))?;
            }
            ["set", variable, value] => system.set(variable, value)?,
            ["connect", from, to] => system.connect(from, to)?,
            _ => bail!("{line:?}: expected fmu NAME PATH, set NAME VALUE or connect FROM TO"),
        }
    }
    Ok(system)
}

fn run(path: &Path, step: f64, steps: u64, results: Option<&Path>) -> anyhow::Result<()> {
    let (start, clock) = (cpu(), Instant::now());
    let system = read(path)?;
    let ports = system.ports(Causality::Output);
    let name = |port| Column {
        name: system.name(port),
        kind: ColumnKind::Real,
        unit: None,
        clocked: false,
    };
    let columns: Vec<Column> = ports.iter().map(|&port| name(port)).collect();
    let mut sink = results.map(|path| create(path, &columns)).transpose()?;
    let mut readout = Readout::new(&system, &ports);
    let experiment = Experiment { start_time: 0.0, stop_time: None, tolerance: None };
    let algorithm = Algorithm {
        method: Method::Jacobi,
        extrapolation: Extrapolation::Hold,
        ..Algorithm::new(step)
    };
    let mut simulation = Simulation::new(system, &algorithm, &experiment)?;
    let (started, wall) = (cpu(), clock.elapsed());
    for _ in 0..steps {
        simulation.step()?;
        if let Some(sink) = &mut sink {
            let time = simulation.time();
            readout.read(simulation.system(), time)?;
            let Readout { reals, integers, booleans, strings, .. } = &readout;
            let row = Row { reals, integers, booleans, strings, ..Row::default() };
            sink.row(time, &row)?;
        }
    }
    if let Some(sink) = sink {
        sink.finish()?;
    }
    let stepped = cpu();
    let time = simulation.time();
    readout.read(simulation.system(), time)?;
    println!(
        "{{\"start_ns\": {}, \"start_wall_ns\": {}, \"step_ns\": {}, \"peak_kib\": {}, \"sum\": {}}}",
        started - start,
        wall.as_nanos(),
        (stepped - started) / steps.max(1) as f64,
        peak(),
        readout.reals.iter().sum::<f64>()
    );
    Ok(())
}

fn main() -> anyhow::Result<()> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["pack", folder, ports] => {
            println!("{}", lag::pack(Path::new(folder), ports.parse()?)?.display());
            Ok(())
        }
        ["run", path, step, steps] => run(Path::new(path), step.parse()?, steps.parse()?, None),
        ["run", path, step, steps, results] => {
            run(Path::new(path), step.parse()?, steps.parse()?, Some(Path::new(results)))
        }
        _ => bail!("expected pack FOLDER PORTS or run SYSTEM STEP STEPS [RESULTS]"),
    }
}
