//! Blocks in a network, and the solution of the whole network as one system.
#![expect(clippy::unwrap_used, reason = "for tests, which are to fail")]

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use fmu_description::Experiment;
use master::{Algorithm, Port, Readout, Simulation, SlowValues, System, SystemError};
use nalgebra::{DMatrix, DVector};

use crate::linear::{Abilities, Block, Linear, OUTPUTS};

/// Blocks a, b, ..., and their connections.
#[derive(Clone)]
pub struct Network {
    /// The blocks, in the order of their names.
    pub blocks: Vec<Block>,
    /// The connections, from (block, output) to (block, input).
    pub links: Vec<((usize, usize), (usize, usize))>,
}

/// The results of a run.
#[derive(Clone, Copy, Debug)]
pub struct Run {
    /// Largest absolute error of an output, at communication points that end a step of every slave.
    pub error: f64,
    /// [`Run::error`] in the second half of the run, when errors of lower order from the first steps have decayed.
    pub late: f64,
    /// Largest error in the second half of the run, at the other communication points.
    pub between: f64,
    /// Number of communication steps.
    pub points: usize,
    /// Number of `fmi2DoStep` calls of all slaves, repetitions included.
    pub calls: usize,
    /// Smallest and largest step in s.
    pub sizes: (f64, f64),
}

/// Name of the block at that position.
fn name(position: usize) -> String {
    ["a", "b", "c", "d"][position].to_owned()
}

impl Network {
    /// Returns the system of connected slaves; `steps` counts their steps.
    ///
    /// # Panics
    ///
    /// If a connection names an input or output that the blocks do not have.
    #[must_use]
    pub fn system(&self, able: Abilities, steps: &Arc<AtomicUsize>) -> System {
        let mut system = System::default();
        for (position, block) in self.blocks.iter().enumerate() {
            system.add(&name(position), Linear::boxed(block, able, steps)).unwrap();
        }
        for &((from, output), (to, input)) in &self.links {
            let (from, to) = (name(from), name(to));
            system.connect(&format!("{from}.y{output}"), &format!("{to}.u{input}")).unwrap();
        }
        system
    }

    /// Returns M, N and x(0) of the whole network `x' = M x`, `y = N x`, where x and y stack those of all blocks.
    ///
    /// With the connections `u = P y` and the block-diagonal A to D, `N = (I - D P)^-1 C` and `M = A + B P N`.
    fn whole(&self) -> (DMatrix<f64>, DMatrix<f64>, DVector<f64>) {
        let stack = |of: fn(&Block) -> &DMatrix<f64>| {
            let parts: Vec<_> = self.blocks.iter().map(of).collect();
            let rows = parts.iter().map(|part| part.nrows()).sum();
            let columns = parts.iter().map(|part| part.ncols()).sum();
            let mut whole = DMatrix::zeros(rows, columns);
            let mut corner = (0, 0);
            for part in parts {
                whole.view_mut(corner, part.shape()).copy_from(part);
                corner = (corner.0 + part.nrows(), corner.1 + part.ncols());
            }
            whole
        };
        let (a, b) = (stack(|block| &block.a), stack(|block| &block.b));
        let (c, d) = (stack(|block| &block.c), stack(|block| &block.d));
        let first = |block: usize, of: fn(&Block) -> usize| -> usize {
            self.blocks[..block].iter().map(of).sum()
        };
        let mut links = DMatrix::zeros(b.ncols(), c.nrows());
        for &((from, output), (to, input)) in &self.links {
            let row = first(to, |block| block.b.ncols()) + input;
            links[(row, first(from, |block| block.c.nrows()) + output)] = 1.0;
        }
        let loops = DMatrix::identity(c.nrows(), c.nrows()) - &d * &links;
        let outputs = loops.lu().solve(&c).unwrap();
        let starts = self.blocks.iter().flat_map(|block| block.start.iter().copied());
        let start = DVector::from_iterator(a.nrows(), starts);
        (&a + &b * &links * &outputs, outputs, start)
    }

    /// The outputs of a system of these blocks, in their order.
    fn ports(&self, system: &System) -> Vec<Port> {
        let names = self.blocks.iter().enumerate().flat_map(|(position, block)| {
            (0..block.c.nrows()).map(move |output| format!("{}.y{output}", name(position)))
        });
        names.map(|name| system.port(&name).unwrap()).collect()
    }

    /// The values of all outputs of a system of these blocks, in their order.
    ///
    /// # Panics
    ///
    /// If a slave lacks an output.
    pub fn outputs(&self, system: &mut System) -> Vec<f64> {
        let mut all = Vec::new();
        for ((_, slave), block) in system.slaves.iter_mut().zip(&self.blocks) {
            let count = block.c.nrows();
            let references: Vec<u32> = (OUTPUTS..).take(count).collect();
            let mut values = vec![0.0; count];
            slave.get_real(&references, &mut values).unwrap();
            all.extend(values);
        }
        all
    }

    /// Runs from 0 to `stop` s and compares with the matrix exponential of the whole network.
    ///
    /// # Errors
    ///
    /// Same as the simulation.
    ///
    /// # Panics
    ///
    /// If the loops through the blocks have no solution.
    pub fn run(
        &self,
        able: Abilities,
        algorithm: &Algorithm,
        stop: f64,
    ) -> Result<Run, SystemError> {
        let calls = Arc::new(AtomicUsize::new(0));
        let system = self.system(able, &calls);
        let experiment = Experiment { stop_time: Some(stop), ..Experiment::default() };
        let mut simulation = Simulation::new(system, algorithm, &experiment)?;
        let (matrix, outputs, start) = self.whole();
        let common = algorithm.multiples.iter().copied().max().unwrap_or(1) as usize;
        let mut run = Run {
            error: 0.0,
            late: 0.0,
            between: 0.0,
            points: 0,
            calls: 0,
            sizes: (f64::INFINITY, 0.0),
        };
        let mut last = 0.0;
        let ports = self.ports(simulation.system());
        let mut readout = Readout::new(simulation.system(), &ports);
        let mut slow = SlowValues::new(&mut simulation, &ports);
        while !simulation.is_finished() {
            slow.before_step(&mut simulation)?;
            simulation.step()?;
            let time = simulation.time();
            run.sizes = (run.sizes.0.min(time - last), run.sizes.1.max(time - last));
            run.points += 1;
            last = time;
            let exact = &outputs * ((&matrix * time).exp() * &start);
            readout.read(simulation.system(), time)?;
            slow.apply(&simulation, &mut readout);
            let readings = DVector::from_column_slice(&readout.reals);
            let error = largest(&(readings - exact));
            // A slave whose step is a multiple of the communication step is in the middle of its step.
            if !run.points.is_multiple_of(common) {
                run.between = run.between.max(if time > 0.5 * stop { error } else { 0.0 });
                continue;
            }
            run.error = run.error.max(error);
            if time > 0.5 * stop {
                run.late = run.late.max(error);
            }
        }
        run.calls = calls.load(Ordering::Relaxed);
        Ok(run)
    }
}

/// The largest magnitude; infinity if a value is NaN.
fn largest(errors: &DVector<f64>) -> f64 {
    errors.iter().fold(
        0.0,
        |most: f64, part| {
            if part.is_nan() { f64::INFINITY } else { most.max(part.abs()) }
        },
    )
}
