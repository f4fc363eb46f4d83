//! A step that is repeated until what the slaves took for the inputs is what they give.

use super::Simulation;
use super::sweep::Swept;
use crate::algorithm::{Algorithm, Coupling};
use crate::error::SystemError;
use crate::exchange::{Reals, Values, call};
use crate::system::System;
use solve::{Anderson, Newton, Progress, QuasiNewton, Scale, Solver};

use fmu_description::CoSimulation;
use serde::{Deserialize, Serialize};

/// The slot of FMU states that an iteration begins each evaluation with.
const SLOT: usize = 0;
/// Unknowns up to which Anderson's mixing keeps as many iterates.
const DEPTH: usize = 20;
/// Solutions whose iterates an interface quasi-Newton iteration goes on using.
const REUSE: u32 = 5;

/// One of the solvers, with what it has learned.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) enum Iteration {
    Newton(Newton),
    Anderson(Anderson),
    QuasiNewton(QuasiNewton),
}

impl Iteration {
    fn solver(&mut self) -> &mut dyn Solver {
        match self {
            Iteration::Newton(solver) => solver,
            Iteration::Anderson(solver) => solver,
            Iteration::QuasiNewton(solver) => solver,
        }
    }
}

/// The iteration of a simulation.
pub(super) struct Coupled {
    pub(super) iteration: Iteration,
    /// Connected values as the slaves took them, as they gave them, and as to be taken next.
    u: Vec<f64>,
    g: Vec<f64>,
    next: Vec<f64>,
    column: Vec<f64>,
    begin: Values,
    /// All slaves have directional derivatives.
    directional: bool,
    /// A step whose iteration fails is made once.
    falls_back: bool,
    fallbacks: Fallbacks,
}

/// Steps whose iteration failed and that were made once instead.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fallbacks {
    /// How many.
    pub count: u64,
    /// Why the first one failed, with its time; empty where there is none.
    pub first: String,
}

impl Coupled {
    pub(super) fn new(
        system: &System,
        reals: &Reals,
        algorithm: &Algorithm,
        scale: Scale,
    ) -> Option<Self> {
        let (count, limit) = (reals.outputs().len(), algorithm.iterations);
        let iteration = match algorithm.coupling {
            Coupling::Once => return None,
            Coupling::Newton => Iteration::Newton(Newton::new(scale, limit)),
            Coupling::Anderson => {
                Iteration::Anderson(Anderson::new(scale, limit, count.clamp(1, DEPTH)))
            }
            Coupling::QuasiNewton => Iteration::QuasiNewton(QuasiNewton::new(scale, limit, REUSE)),
        };
        let able = |flags: &CoSimulation| flags.provides_directional_derivative;
        let directional = system
            .slaves
            .iter()
            .all(|(_, slave)| slave.description().co_simulation.as_ref().is_some_and(able));
        let zeros = || vec![0.0; count];
        Some(Self {
            iteration,
            u: zeros(),
            g: zeros(),
            next: zeros(),
            column: zeros(),
            begin: Values::default(),
            directional,
            falls_back: algorithm.fallback,
            fallbacks: Fallbacks::default(),
        })
    }
}

impl Simulation {
    /// One step from `time` over `size`: made once, or repeated by the coupling chosen.
    pub(super) fn attempt(
        &mut self,
        time: f64,
        size: f64,
        never_back: bool,
    ) -> Result<Swept, SystemError> {
        let Some(mut coupled) = self.coupled.take() else {
            return self.sweep(time, size, never_back);
        };
        let mut done = self.solve(&mut coupled, time, size);
        if let Err(error) = &done
            && coupled.falls_back
            && is_recoverable(error)
        {
            coupled.fallbacks.add(error);
            done = self.fall_back(&coupled, time, size);
        }
        self.coupled = Some(coupled);
        done
    }

    /// The step made once, from where its iteration started.
    #[cold]
    fn fall_back(&mut self, coupled: &Coupled, time: f64, size: f64) -> Result<Swept, SystemError> {
        self.restore_states(SLOT, time)?;
        self.exchange.restore(&coupled.begin);
        self.sweep(time, size, false)
    }

    /// The steps whose iteration failed and that were made once instead.
    #[must_use]
    pub fn fallbacks(&self) -> Option<&Fallbacks> {
        self.coupled.as_ref().map(|coupled| &coupled.fallbacks)
    }

    fn solve(&mut self, coupled: &mut Coupled, time: f64, size: f64) -> Result<Swept, SystemError> {
        self.save_states(SLOT, time)?;
        self.exchange.save(&mut coupled.begin);
        self.exchange.reals.predictions(size, &mut coupled.u);
        let mut matrices = 0;
        let mut swept = self.evaluate(coupled, time, size, true)?;
        coupled.iteration.solver().begin();
        loop {
            if swept.reached.is_some() || swept.terminated.is_some() {
                return Ok(swept);
            }
            coupled.g.copy_from_slice(self.exchange.reals.outputs());
            let (solver, u, g) = (coupled.iteration.solver(), &coupled.u, &coupled.g);
            let why = match solver.next(u, g, &mut coupled.next) {
                Progress::Converged { .. } => return Ok(swept),
                Progress::Evaluate => {
                    coupled.u.copy_from_slice(&coupled.next);
                    swept = self.evaluate(coupled, time, size, false)?;
                    continue;
                }
                Progress::Matrix => {
                    if coupled.directional && matrices == 0 {
                        self.derive(coupled, time + size)?;
                    } else {
                        self.differentiate(coupled, time, size)?;
                    }
                    self.exchange.reals.outputs_mut().copy_from_slice(&coupled.g);
                    matrices += 1;
                    continue;
                }
                end => described(end),
            };
            return Err(SystemError::Coupling { time, size, why });
        }
    }

    /// `G(u)`: steps all slaves from the begin with the values u at the end.
    fn evaluate(
        &mut self,
        coupled: &Coupled,
        time: f64,
        size: f64,
        first: bool,
    ) -> Result<Swept, SystemError> {
        if !first {
            self.restore_states(SLOT, time)?;
            self.exchange.restore(&coupled.begin);
        }
        self.exchange.reals.assume(Some(&coupled.u));
        let swept = self.sweep(time, size, false);
        self.exchange.reals.assume(None);
        swept
    }

    /// The matrix `dG/du` by the directional derivatives at the end of the step: that of direct
    /// dependencies.
    fn derive(&mut self, coupled: &mut Coupled, time: f64) -> Result<(), SystemError> {
        for column in 0..coupled.u.len() {
            coupled.column.fill(0.0);
            self.exchange
                .reals
                .derivatives_to(&mut self.system, column, &mut coupled.column)
                .map_err(|(slave, source)| call(&self.system.slaves[slave].0, time, source))?;
            coupled.iteration.solver().set_column(column, &coupled.column);
        }
        Ok(())
    }

    /// The matrix `dG/du` by differences of whole steps.
    fn differentiate(
        &mut self,
        coupled: &mut Coupled,
        time: f64,
        size: f64,
    ) -> Result<(), SystemError> {
        for column in 0..coupled.u.len() {
            let here = coupled.u[column];
            let change = coupled.iteration.solver().perturbation(column, &coupled.u);
            coupled.u[column] = here + change;
            self.evaluate(coupled, time, size, false)?;
            coupled.u[column] = here;
            let there = self.exchange.reals.outputs();
            for ((quotient, there), here) in coupled.column.iter_mut().zip(there).zip(&coupled.g) {
                *quotient = (there - here) / change;
            }
            coupled.iteration.solver().set_column(column, &coupled.column);
        }
        Ok(())
    }
}

impl Fallbacks {
    #[cold]
    fn add(&mut self, error: &SystemError) {
        self.count += 1;
        if self.first.is_empty() {
            self.first = error.to_string();
        }
    }
}

/// Whether the slaves can go back after this error and make the step once.
fn is_recoverable(error: &SystemError) -> bool {
    match error {
        SystemError::Coupling { .. } | SystemError::NotFinite { .. } => true,
        SystemError::Call { source, .. } => source.leaves_the_instance_usable(),
        _ => false,
    }
}

/// How an iteration failed.
fn described(end: Progress) -> String {
    match end {
        Progress::NotConverged { iterations, residual } => format!(
            "outputs and inputs differ by {residual:.1e} tolerances after {iterations} iterations"
        ),
        Progress::Diverged { iterations } => {
            format!("the iteration diverges (iteration {iterations})")
        }
        Progress::Singular { condition } => format!(
            "the loop has no solution or many: its matrix is singular (condition {condition:.1e})"
        ),
        Progress::Converged { .. } | Progress::Evaluate | Progress::Matrix => String::new(),
    }
}
