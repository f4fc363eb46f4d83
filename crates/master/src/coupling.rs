//! The coupling of a step: a single sweep, or iterated (implicit) coupling: the sweep is repeated until the input
//! values assumed at the end of the step equal the outputs.

use crate::algorithm::{Algorithm, Coupling};
use crate::engine::{Engine, SavedState, Swept};
use crate::error::{SystemError, call};
use solve::{Anderson, Newton, Progress, QuasiNewton, Scale, Solver};

use serde::{Deserialize, Serialize};

/// Slot of the FMU states from which each evaluation starts.
const SLOT: usize = 0;
/// Largest number of iterates that Anderson mixing keeps.
const DEPTH: usize = 20;
/// Number of past steps whose iterates the interface quasi-Newton method reuses.
const REUSE: u32 = 5;

/// The solver of the iteration, with its state.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) enum Iteration {
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

/// Makes a step with the selected coupling: a single sweep, or the sweeps of an iteration.
pub(crate) struct Coupler {
    pub(crate) iterated: Option<Iterated>,
}

/// Iterated coupling: solves `u = G(u)`. u are the connected values assumed at the end of a step, G(u) the values that
/// the slaves compute at this end from inputs that end at u.
pub(crate) struct Iterated {
    pub(crate) iteration: Iteration,
    /// Connected values that the slaves assume at the end of the step.
    u: Vec<f64>,
    /// Connected values that the slaves compute at the end of the step.
    g: Vec<f64>,
    /// Connected values of the next evaluation.
    next: Vec<f64>,
    /// A column of the Jacobian `dG/du`.
    column: Vec<f64>,
    start: SavedState,
    /// Whether all slaves have directional derivatives.
    directional: bool,
    /// Whether a step whose iteration fails is made once without iteration.
    falls_back: bool,
    pub(crate) fallbacks: Fallbacks,
    /// Start in s of the communication step in which the iteration failed last; NaN without such a step, and after a
    /// return to an earlier state.
    pub(crate) failed_at: f64,
}

/// Count of the communication steps that were made once without iteration, because the iteration failed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fallbacks {
    /// Number of communication steps whose iteration failed. A step that step control or an event repeats counts once.
    pub count: u64,
    /// Reason and time of the first failure; empty without a failure.
    pub first: String,
}

impl Coupler {
    /// Makes one step from `time` over `size`.
    pub(crate) fn step(
        &mut self,
        engine: &mut Engine,
        time: f64,
        size: f64,
    ) -> Result<Swept, SystemError> {
        match &mut self.iterated {
            None => engine.sweep(time, size),
            Some(iterated) => iterated.step(engine, time, size),
        }
    }
}

impl Iterated {
    /// Returns `None` for coupling without iteration.
    pub(crate) fn new(engine: &Engine, algorithm: &Algorithm, scale: Scale) -> Option<Self> {
        let (count, limit) = (engine.exchange.reals.outputs().len(), algorithm.iterations);
        let iteration = match algorithm.coupling {
            Coupling::Once => return None,
            Coupling::Newton => Iteration::Newton(Newton::new(scale, limit)),
            Coupling::Anderson => {
                Iteration::Anderson(Anderson::new(scale, limit, count.clamp(1, DEPTH)))
            }
            Coupling::QuasiNewton => Iteration::QuasiNewton(QuasiNewton::new(scale, limit, REUSE)),
        };
        let unable = engine.system.first_without(|flags| flags.provides_directional_derivative);
        let zeros = || vec![0.0; count];
        Some(Self {
            iteration,
            u: zeros(),
            g: zeros(),
            next: zeros(),
            column: zeros(),
            start: SavedState::new(SLOT),
            directional: unable.is_none(),
            falls_back: algorithm.fallback,
            fallbacks: Fallbacks::default(),
            failed_at: f64::NAN,
        })
    }

    /// Makes one step from `time` over `size`. If the iteration fails and a fallback is allowed,
    /// makes the step once, from the same state.
    fn step(&mut self, engine: &mut Engine, time: f64, size: f64) -> Result<Swept, SystemError> {
        match self.solve(engine, time, size) {
            Err(error) if self.falls_back && is_recoverable(&error) => {
                let start = engine.grid.time;
                if start.total_cmp(&self.failed_at).is_ne() {
                    self.failed_at = start;
                    self.fallbacks.add(&error);
                }
                engine.restore(&self.start)?;
                engine.sweep(time, size)
            }
            done => done,
        }
    }

    /// Solves `u = G(u)` for the step from `time` over `size`. Returns without a solution if a slave
    /// ends the step early.
    fn solve(&mut self, engine: &mut Engine, time: f64, size: f64) -> Result<Swept, SystemError> {
        engine.save(time, &mut self.start)?;
        engine.exchange.reals.predictions(size, &mut self.u);
        let mut matrices = 0;
        let mut swept = self.evaluate(engine, time, size)?;
        self.iteration.solver().begin();
        loop {
            if swept != Swept::Whole {
                return Ok(swept);
            }
            self.g.copy_from_slice(engine.exchange.reals.outputs());
            let why = match self.iteration.solver().next(&self.u, &self.g, &mut self.next) {
                Progress::Converged { .. } => return Ok(swept),
                Progress::Evaluate => {
                    self.u.copy_from_slice(&self.next);
                    engine.restore(&self.start)?;
                    swept = self.evaluate(engine, time, size)?;
                    continue;
                }
                Progress::Matrix => {
                    if self.directional && matrices == 0 {
                        self.derive(engine, time + size)?;
                    } else {
                        self.differentiate(engine, time, size)?;
                    }
                    engine.exchange.reals.outputs_mut().copy_from_slice(&self.g);
                    matrices += 1;
                    continue;
                }
                end => failure_text(end),
            };
            return Err(SystemError::Coupling { time, size, why });
        }
    }

    /// Evaluates `G(u)`: steps all slaves with the values `u` at the end of the step.
    fn evaluate(
        &mut self,
        engine: &mut Engine,
        time: f64,
        size: f64,
    ) -> Result<Swept, SystemError> {
        engine.exchange.reals.assume(Some(&self.u));
        let swept = engine.sweep(time, size);
        engine.exchange.reals.assume(None);
        swept
    }

    /// Computes the Jacobian `dG/du` from the directional derivatives at the end of the step. This matrix contains
    /// direct dependencies only.
    fn derive(&mut self, engine: &mut Engine, time: f64) -> Result<(), SystemError> {
        for column in 0..self.u.len() {
            self.column.fill(0.0);
            engine
                .exchange
                .reals
                .derivatives_to(&mut engine.system, column, &mut self.column)
                .map_err(|(slave, source)| call(&engine.system.slaves[slave].0, time, source))?;
            self.iteration.solver().set_column(column, &self.column);
        }
        Ok(())
    }

    /// Computes the Jacobian `dG/du` by finite differences of whole steps. If a step with a perturbed value ends
    /// early, its outputs belong to another time: the value is perturbed to the other side. If that step ends early
    /// too, the column is 0. A wrong column costs iterations only, because convergence is tested with whole steps.
    fn differentiate(
        &mut self,
        engine: &mut Engine,
        time: f64,
        size: f64,
    ) -> Result<(), SystemError> {
        for column in 0..self.u.len() {
            let here = self.u[column];
            let perturbation = self.iteration.solver().perturbation(column, &self.u);
            self.column.fill(0.0);
            for change in [perturbation, -perturbation] {
                self.u[column] = here + change;
                engine.restore(&self.start)?;
                if self.evaluate(engine, time, size)? == Swept::Whole {
                    let quotients = self.column.iter_mut().zip(engine.exchange.reals.outputs());
                    for ((quotient, there), here) in quotients.zip(&self.g) {
                        *quotient = (there - here) / change;
                    }
                    break;
                }
            }
            self.u[column] = here;
            self.iteration.solver().set_column(column, &self.column);
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

/// Whether the slaves can restore their states after `error`.
fn is_recoverable(error: &SystemError) -> bool {
    match error {
        SystemError::Coupling { .. } | SystemError::NotFinite { .. } => true,
        SystemError::Call { source, .. } => source.leaves_the_instance_usable(),
        _ => false,
    }
}

/// Describes the failure of an iteration; empty for any other progress.
fn failure_text(end: Progress) -> String {
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
