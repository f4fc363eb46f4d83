//! The fraction of the tolerances of a plant within which a loop is proven stable.

use super::blocks::Block;
use super::generalised_plant::{Channels, GeneralisedPlant};
use super::held::HeldFamily;
use super::structured_bound;
use crate::robustness::tolerance::EntryFamily;
use crate::robustness::{Loop, held_plant};
use crate::{Domain, Error, StateSpace, check};
use nalgebra::DMatrix;

/// The largest number of channels of the perturbation, and the largest number of states of the loop.
const LARGEST: usize = 100;
/// The search ends if the proven fraction reaches this multiple of the fraction for which the Gauss error was bounded.
const NEAR: f64 = 0.97;
/// The fraction for which the Gauss error is bounded next, relative to the proven fraction.
const FURTHER: f64 = 1.02;
const ROUNDS: usize = 4;

/// The proven stability of a loop whose plant varies.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ProvenTolerance {
    /// The loop is stable for every plant whose deviations are below this fraction of the tolerances.
    pub fraction: f64,
    /// The frequency that determines the fraction, in rad per unit of time.
    pub frequency: f64,
    /// Number of independent deviations.
    pub deviations: usize,
    /// Number of channels of the perturbation: a deviation has one for each dimension of its effect, and for each stage
    /// of the Gauss method in a sampled loop.
    pub channels: usize,
    /// Number of intervals that cover the frequencies.
    pub intervals: usize,
}

/// The reason why nothing is proven.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unproven {
    /// The perturbation has too many channels, or the loop too many states.
    Large {
        /// Number of channels of the perturbation.
        channels: usize,
        /// Number of states of the loop.
        states: usize,
        /// The largest number of channels and of states.
        most: usize,
    },
    /// The sample time is too long, compared with the time constants of the plant.
    LongSampleTime,
    /// `ending` returned true before anything was proven.
    Ended,
}

/// Proves that the loop of `controller` is stable for all plants of `family` within a fraction of the tolerances.
///
/// Each deviation d adds d L R' to [A, B; C, D], so that the loop is M in feedback with the diagonal matrix of the
/// deviations. This is exact, also for products of B, C and the controller's D. The fraction is 1 /
/// [`structured_bound`] of M.
///
/// `most`: the largest fraction to prove, finite and above zero, for example one at which instability was found.
/// `ending`: called at each interval; true ends the search. The inner error is the reason why nothing is proven.
///
/// For a sampled controller and a continuous plant the deviations act on the exponential of [A, B; 0, 0] h, h the
/// sample time. It is the nominal exponential plus the change of a step of the Gauss method, linear fractional in the
/// deviations with 1 to 3 channels each, plus the change of the error of that method. A power series bounds the error
/// entry by entry; the error is one more, full block. It is small if h is short compared with the time constants.
///
/// # Errors
///
/// Same as [`structured_bound`], [`super::super::Loop::new`], [`crate::hold::zero_order_hold`]; [`Error::OutOfRange`]
/// for `most`.
pub fn proven_tolerance(
    family: &EntryFamily<'_>,
    controller: &StateSpace,
    most: f64,
    ending: &dyn Fn() -> bool,
) -> Result<Result<ProvenTolerance, Unproven>, Error> {
    check::positive("most", most)?;
    let changes = family.changes();
    let perturbed = PerturbedLoop { plant: family.plant, changes, controller };
    match (controller.domain, perturbed.plant.domain) {
        (Domain::Sampled { period }, Domain::Continuous) => {
            perturbed.sampled_fraction(period, most, ending)
        }
        (Domain::Sampled { period }, Domain::Sampled { .. }) => {
            let held = held_plant(perturbed.plant, period)?;
            let changes = perturbed.changes.iter().map(|change| held_change(change, &held));
            let changes = changes.collect();
            PerturbedLoop { plant: &held, changes, ..perturbed }.fraction(most, ending)
        }
        (Domain::Continuous, _) => perturbed.fraction(most, ending),
    }
}

/// Converts a change of [A, B; C, D] of a sampled plant to the change of [A, B; C, D] of `held`, the [`held_plant`] of
/// the sampled plant.
fn held_change(change: &DMatrix<f64>, held: &StateSpace) -> DMatrix<f64> {
    let (n, (p, m)) = (held.a.nrows(), held.d.shape());
    let states = change.nrows() - p;
    if states == n {
        return change.clone();
    }
    // The states are [x; v], v the previous command, and D is the part of C for v.
    let mut held_change = DMatrix::zeros(n + p, n + m);
    let mut copy = |to: (usize, usize), from: (usize, usize), size: (usize, usize)| {
        held_change.view_mut(to, size).copy_from(&change.view(from, size));
    };
    copy((0, 0), (0, 0), (states, states));
    copy((0, n), (0, states), (states, m));
    copy((n, 0), (states, 0), (p, states + m));
    held_change
}

/// The loop of a plant whose matrices change with deviations.
struct PerturbedLoop<'a> {
    plant: &'a StateSpace,
    /// The change of [A, B; C, D] for each deviation.
    changes: Vec<DMatrix<f64>>,
    controller: &'a StateSpace,
}

impl PerturbedLoop<'_> {
    /// The proof for M = `system` in feedback with `blocks`.
    fn prove(
        &self,
        system: &StateSpace,
        blocks: &[Block],
        most: f64,
        ending: &dyn Fn() -> bool,
    ) -> Result<Result<ProvenTolerance, Unproven>, Error> {
        let (channels, states) = (system.d.nrows(), system.a.nrows());
        if channels > LARGEST || states > LARGEST {
            return Ok(Err(Unproven::Large { channels, states, most: LARGEST }));
        }
        let deviations = self.changes.len();
        let proven = |fraction: f64, frequency: f64, intervals: usize| {
            Ok(Ok(ProvenTolerance { fraction, frequency, deviations, channels, intervals }))
        };
        if channels == 0 {
            return proven(most, 0.0, 0);
        }
        match structured_bound(system, blocks, 1.0 / most, ending)? {
            Some(bound) => proven(1.0 / bound.upper, bound.frequency, bound.intervals),
            None => Ok(Err(Unproven::Ended)),
        }
    }

    /// The fraction for a plant in the time domain of the controller.
    fn fraction(
        &self,
        most: f64,
        ending: &dyn Fn() -> bool,
    ) -> Result<Result<ProvenTolerance, Unproven>, Error> {
        Loop::new(self.plant.clone(), self.controller.clone())?;
        let StateSpace { a, b, c, d, domain } = self.plant;
        let (n, m, p) = (a.nrows(), b.ncols(), c.nrows());
        let Channels { left, right, ranks } = Channels::of(&self.changes, (n + p, n + m));
        let r = left.ncols();
        let plant = GeneralisedPlant {
            a: a.clone(),
            b: [left.rows(0, n).into(), b.clone()],
            c: [right.rows(0, n).transpose(), c.clone()],
            d: [
                [DMatrix::zeros(r, r), right.rows(n, m).transpose()],
                [left.rows(n, p).into(), d.clone()],
            ],
            domain: *domain,
        };
        let ranks = ranks.into_iter().filter(|rank| *rank > 0);
        let blocks: Vec<_> = ranks.map(Block::Real).collect();
        self.prove(&plant.with_controller(self.controller), &blocks, most, ending)
    }

    /// The largest proven fraction up to the one for which the error of the Gauss method is bounded.
    fn sampled_fraction(
        &self,
        period: f64,
        most: f64,
        ending: &dyn Fn() -> bool,
    ) -> Result<Result<ProvenTolerance, Unproven>, Error> {
        let held = HeldFamily::new(self.plant, &self.changes, self.controller, period)?;
        let mut assumed = most;
        let mut best: Option<ProvenTolerance> = None;
        for _ in 0..ROUNDS {
            let Some(loops) = held.system(assumed)? else { break };
            let bound = match self.prove(&loops.system, &loops.blocks, loops.fraction, ending)? {
                Ok(bound) => bound,
                Err(reason) => return Ok(best.ok_or(reason)),
            };
            let fraction = bound.fraction.min(loops.fraction);
            if best.is_none_or(|best| best.fraction < fraction) {
                best = Some(ProvenTolerance { fraction, ..bound });
            }
            if loops.precise || bound.fraction >= NEAR * loops.fraction {
                break;
            }
            // For a smaller fraction the error is smaller, also relative to the fraction.
            assumed = bound.fraction * FURTHER;
        }
        Ok(best.ok_or(Unproven::LongSampleTime))
    }
}
