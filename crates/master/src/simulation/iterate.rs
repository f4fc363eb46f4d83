//! Iterated (implicit) coupling: repeats a step until the input values assumed at its end equal the
//! outputs.

use super::Simulation;
use super::sweep::SweepResult;
use crate::algorithm::{Algorithm, Coupling};
use crate::error::SystemError;
use crate::exchange::{Reals, Values, call};
use crate::system::System;
use solve::{Anderson, Newton, Progress, QuasiNewton, Scale, Solver};

use fmu_description::CoSimulation;
use serde::{Deserialize, Serialize};

/// Slot of the FMU states to which each evaluation returns.
const SLOT: usize = 0;
/// Largest number of iterates that Anderson mixing keeps.
const DEPTH: usize = 20;
/// Number of past steps whose iterates the interface quasi-Newton method reuses.
const REUSE: u32 = 5;

/// The solver of the iteration, with its state.
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
    /// Connected values: assumed by the slaves, returned by the slaves, and next to assume.
    u: Vec<f64>,
    g: Vec<f64>,
    next: Vec<f64>,
    column: Vec<f64>,
    start: Values,
    /// Whether all slaves have directional derivatives.
    directional: bool,
    /// Whether a step whose iteration fails is made once without iteration.
    falls_back: bool,
    fallbacks: Fallbacks,
}

/// Count of the steps whose iteration failed and that were made once without iteration.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fallbacks {
    /// Number of such steps.
    pub count: u64,
    /// Reason and time of the first failure; empty if there is none.
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
            start: Values::default(),
            directional,
            falls_back: algorithm.fallback,
            fallbacks: Fallbacks::default(),
        })
    }
}

impl Simulation {
    /// Makes one step from `time` over `size`: once, or iterated with the selected coupling.
    pub(super) fn attempt(
        &mut self,
        time: f64,
        size: f64,
        never_back: bool,
    ) -> Result<SweepResult, SystemError> {
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

    /// Restores the state before the iteration and makes the step once.
    #[cold]
    fn fall_back(
        &mut self,
        coupled: &Coupled,
        time: f64,
        size: f64,
    ) -> Result<SweepResult, SystemError> {
        self.restore_states(SLOT, time)?;
        self.exchange.restore(&coupled.start);
        self.sweep(time, size, false)
    }

    /// Returns the count of steps whose iteration failed; `None` without iteration.
    #[must_use]
    pub fn fallbacks(&self) -> Option<&Fallbacks> {
        self.coupled.as_ref().map(|coupled| &coupled.fallbacks)
    }

    fn solve(
        &mut self,
        coupled: &mut Coupled,
        time: f64,
        size: f64,
    ) -> Result<SweepResult, SystemError> {
        self.save_states(SLOT, time)?;
        self.exchange.save(&mut coupled.start);
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

    /// Evaluates `G(u)`: restores the start of the step and steps all slaves with the values `u` at
    /// its end.
    fn evaluate(
        &mut self,
        coupled: &Coupled,
        time: f64,
        size: f64,
        first: bool,
    ) -> Result<SweepResult, SystemError> {
        if !first {
            self.restore_states(SLOT, time)?;
            self.exchange.restore(&coupled.start);
        }
        self.exchange.reals.assume(Some(&coupled.u));
        let swept = self.sweep(time, size, false);
        self.exchange.reals.assume(None);
        swept
    }

    /// Computes the Jacobian `dG/du` from the directional derivatives at the end of the step. It
    /// contains direct dependencies only.
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

    /// Computes the Jacobian `dG/du` by finite differences of whole steps.
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

/// Whether the slaves can restore their states after this error.
fn is_recoverable(error: &SystemError) -> bool {
    match error {
        SystemError::Coupling { .. } | SystemError::NotFinite { .. } => true,
        SystemError::Call { source, .. } => source.leaves_the_instance_usable(),
        _ => false,
    }
}

/// Describes the failure of an iteration.
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
