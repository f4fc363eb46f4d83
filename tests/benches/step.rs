//! The cost of a communication step: through `Simulation`, and by the same FMI calls without it.
//!
//!     cargo bench --package cosim-master --bench step
//!
//! The FMUs are those of `tests/speed`: systems of 2, 20 and 1000 in a ring. For comparison, each
//! system is also run by a loop that makes the same calls on the same instances and copies the
//! connected values. `scripts/bench/benchmark-peers` compares with a loop in C. Needs a C compiler.
#![forbid(unsafe_code)]

use std::path::Path;

use anyhow::Context;
use criterion::{BenchmarkId, Criterion};
use fmu_description::Experiment;
use fmu_import::Fmu;
use master::algorithm::{Algorithm, Extrapolation, Method};
use master::{Simulation, Slave, System};

#[path = "../speed/lag.rs"]
mod lag;

/// Communication step in s.
const STEP: f64 = 1.0 / 512.0;
const EXPERIMENT: Experiment = Experiment { start_time: 0.0, stop_time: None, tolerance: None };
/// Number of FMUs, and of ports of each FMU.
const SIZES: [(usize, usize); 3] = [(2, 2), (20, 2), (1000, 10)];

fn simulation(fmu: &Fmu, count: usize, ports: usize) -> anyhow::Result<Simulation> {
    let mut system = System::default();
    for slave in 0..count {
        let name = format!("f{slave}");
        system.add(&name, Box::new(fmu.instantiate(&name)?))?;
    }
    for (from, to, port) in lag::ring(count, ports) {
        system.connect(&format!("f{from}.y{port}"), &format!("f{to}.u{port}"))?;
    }
    let algorithm = Algorithm {
        method: Method::Jacobi,
        extrapolation: Extrapolation::Hold,
        ..Algorithm::new(STEP)
    };
    Ok(Simulation::new(system, &algorithm, &EXPERIMENT)?)
}

/// The FMU instances and the arrays of connected values.
struct Calls {
    slaves: Vec<Box<dyn Slave>>,
    inputs: Vec<u32>,
    outputs: Vec<u32>,
    /// For each input of each slave the position of its output among the values.
    sources: Vec<usize>,
    set: Vec<f64>,
    values: Vec<f64>,
    steps: u32,
}

impl Calls {
    fn new(fmu: &Fmu, count: usize, ports: usize) -> anyhow::Result<Self> {
        let mut slaves = Vec::new();
        for slave in 0..count {
            let mut slave: Box<dyn Slave> = Box::new(fmu.instantiate(&format!("f{slave}"))?);
            slave.setup_experiment(&EXPERIMENT)?;
            slave.enter_initialization_mode()?;
            slave.exit_initialization_mode()?;
            slaves.push(slave);
        }
        let mut sources = vec![0; count * ports];
        for (from, to, port) in lag::ring(count, ports) {
            sources[to * ports + port] = from * ports + port;
        }
        let inputs: Vec<_> = (0..u32::try_from(ports)?).collect();
        let outputs =
            inputs.iter().map(|input| input + u32::try_from(ports).unwrap_or(0)).collect();
        let values = vec![0.0; count * ports];
        Ok(Self { slaves, inputs, outputs, sources, set: values.clone(), values, steps: 0 })
    }

    fn step(&mut self) -> anyhow::Result<()> {
        let (time, ports) = (f64::from(self.steps) * STEP, self.inputs.len());
        for (value, &source) in self.set.iter_mut().zip(&self.sources) {
            *value = self.values[source];
        }
        let values = self.set.chunks(ports).zip(self.values.chunks_mut(ports));
        for (slave, (set, got)) in self.slaves.iter_mut().zip(values) {
            slave.set_real(&self.inputs, set)?;
            slave.do_step(time, STEP, true)?;
            slave.get_real(&self.outputs, got)?;
        }
        self.steps += 1;
        Ok(())
    }
}

fn compare(criterion: &mut Criterion, folder: &Path) -> anyhow::Result<()> {
    let mut group = criterion.benchmark_group("step");
    for (count, ports) in SIZES {
        let fmu = Fmu::open(&lag::pack(folder, ports)?)?;
        let mut failed = Ok(());
        let mut simulation = simulation(&fmu, count, ports)?;
        group.bench_function(BenchmarkId::new("simulation", count), |bencher| {
            bencher.iter(|| {
                failed = std::mem::replace(&mut failed, Ok(())).and_then(|()| simulation.step());
            });
        });
        failed.context("the simulation fails")?;
        let mut failed = Ok(());
        let mut calls = Calls::new(&fmu, count, ports)?;
        group.bench_function(BenchmarkId::new("calls", count), |bencher| {
            bencher.iter(|| {
                failed = std::mem::replace(&mut failed, Ok(())).and_then(|()| calls.step());
            });
        });
        failed.context("a call fails")?;
    }
    group.finish();
    Ok(())
}

fn main() -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let mut criterion = Criterion::default().configure_from_args();
    compare(&mut criterion, folder.path())?;
    criterion.final_summary();
    Ok(())
}
