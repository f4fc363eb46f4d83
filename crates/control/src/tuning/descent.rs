//! The search for the parameters.

use super::minimax::{Cut, direction, update};
use super::objective::{Grid, Place};
use super::{Tuned, Tuning, WeightedPeak};
use crate::check::{self, as_number};
use crate::stability::instability;
use crate::{Error, StateSpace};
use nalgebra::{DMatrix, DVector};

/// Largest numbers of steps of a leg, and of verifications.
const STEPS: usize = 150;
const ROUNDS: usize = 12;
/// A step uses only the places with values above this fraction of the largest value, at most [`MOST_ACTIVE`] places.
const ACTIVE: f64 = 0.95;
const MOST_ACTIVE: usize = 15;
/// The metric uses every third frequency.
const METRIC_STEP: usize = 3;
/// The first step changes the transfer functions by about this fraction of the largest value.
const FIRST: f64 = 0.3;
/// Parts of the metric that are the same for all parameters, relative to its average for a parameter.
const RIDGES: [f64; 2] = [1e-6, 1e-2];
/// The largest number of metrics from which a search starts again.
const LEGS: usize = 12;
/// The instability counts as a value if the largest allowed one is at least this fraction of it, and its relative changes
/// this many times as much as those of gamma.
const NEAR: f64 = 0.5;
const STIFFNESS: f64 = 10.0;
/// Step of the differences, relative to the size of a parameter.
const DIFFERENCE: f64 = 1e-3;
/// The largest number of step lengths that are tried, and the part of the predicted decrease that a step must reach.
const HALVINGS: usize = 14;
const SUFFICIENT: f64 = 1e-2;
/// A leg of the search ends when a step has decreased gamma by less than this fraction.
const FLAT: f64 = 1e-5;
/// Legs that decrease gamma by less than this fraction are the last ones, one for each metric. So is a round, if the peak
/// is on the grid, see [`BETWEEN`].
const PROGRESS: f64 = 1e-3;
/// A norm that exceeds the largest value of the grid by at most this fraction counts as on the grid.
const BETWEEN: f64 = 2e-3;

impl Tuning<'_> {
    /// Tunes the parameters from `start`; `scales`: the size of each parameter.
    ///
    /// Method: steps of sequential quadratic programming for the maximum over the local maxima of a grid of
    /// frequencies, with a BFGS approximation of the Hessian of the Lagrangian that starts from the squares of the
    /// gradients. After each of these searches the frequency of the verified peak is added to the grid. The result is a
    /// local minimum at best; gamma is verified.
    ///
    /// With delays the search also counts the norm of S K (G - `G_a`) / 0.1, G with the delays themselves, `G_a` the
    /// plant of the search, and S with `G_a` at the commands. Without this, it finds gains that are good for the
    /// approximation only. Where the value is v, S with G is at most 1 / (1 - 0.1 v) times as large as S with `G_a`.
    ///
    /// Source: P. Apkarian and D. Noll, Nonsmooth H-infinity synthesis, IEEE Trans. Autom. Control 51
    /// (2006); J. V. Burke, D. Henrion, A. S. Lewis and M. L. Overton, HIFOO (2006).
    ///
    /// # Errors
    ///
    /// Same as [`Tuning::peak`]; [`Error::Shape`] for `scales` of another length;
    /// [`Error::OutOfRange`] for a [`Tuning::rate`] that is not above zero.
    pub fn tuned(&self, start: &DVector<f64>, scales: &DVector<f64>) -> Result<Tuned, Error> {
        check::positive("the rate", self.rate)?;
        check::length("scales", scales.as_slice(), start.len())?;
        let peak = self.peak(start)?;
        let mut search = Search { grid: Grid::new(self)?, scales, at: start.clone() };
        search.grid.add(peak.frequency)?;
        let largest = search.iterate(start).map_or(f64::INFINITY, |iterate| iterate.largest());
        let largest = largest.max(peak.gamma);
        let mut best = Tuned { parameters: start.clone(), peak, largest, limits: vec![peak] };
        for _ in 0..ROUNDS {
            let value = search.descend();
            let peak = self.peak(&search.at)?;
            let (before, largest) = (best.largest, value.max(peak.gamma));
            if largest < before {
                best = Tuned { parameters: search.at.clone(), peak, largest, limits: vec![peak] };
            }
            let is_on_grid = peak.gamma <= (1.0 + BETWEEN) * value;
            let is_flat = largest >= (1.0 - PROGRESS) * before;
            if (is_on_grid && is_flat) || (self.is_over)() {
                break;
            }
            search.grid.add(peak.frequency)?;
        }
        if let Some(iterate) = search.iterate(&best.parameters) {
            let places = active(&iterate.values, ACTIVE * iterate.largest());
            let places = places.into_iter().filter(|place| place.term < self.terms.len());
            best.limits.extend(places.map(|Place { term, node }| WeightedPeak {
                gamma: iterate.values[term][node],
                term,
                frequency: search.grid.frequency(node),
            }));
        }
        Ok(best)
    }
}

/// The search for parameters with the frequencies of a fixed grid.
struct Search<'a> {
    grid: Grid<'a>,
    scales: &'a DVector<f64>,
    /// The present parameters.
    at: DVector<f64>,
}

/// A controller, and the weighted singular values of its loop on the grid, term by term.
struct Iterate {
    controller: StateSpace,
    values: Vec<Vec<f64>>,
    /// The instability of the loop.
    instability: f64,
}

impl Iterate {
    fn largest(&self) -> f64 {
        self.values.iter().flatten().copied().fold(0.0, f64::max)
    }
}

impl Search<'_> {
    /// Steps until the largest value on the grid does not decrease any more; returns that value.
    fn descend(&mut self) -> f64 {
        let Some(mut iterate) = self.iterate(&self.at) else { return f64::INFINITY };
        let mut idle = 0;
        for ridge in RIDGES.iter().cycle().take(LEGS) {
            let before = iterate.largest();
            iterate = self.leg(iterate, *ridge);
            let is_idle = iterate.largest() >= (1.0 - PROGRESS) * before;
            idle = if is_idle { idle + 1 } else { 0 };
            if idle == RIDGES.len() || (self.grid.tuning.is_over)() {
                break;
            }
        }
        iterate.largest()
    }

    /// Steps from `iterate` with one BFGS approximation, until a step is flat or none decreases the largest value.
    fn leg(&mut self, mut iterate: Iterate, ridge: f64) -> Iterate {
        let mut inverse = None;
        for _ in 0..STEPS {
            let value = iterate.largest();
            let mut places = active(&iterate.values, ACTIVE * value);
            places.truncate(MOST_ACTIVE);
            let cuts = self.cuts(&iterate, &self.at, &places);
            let Some(mut cuts) = cuts.filter(|cuts| !cuts.is_empty()) else { break };
            cuts.extend(self.stability(&iterate, value));
            let start = || self.inverse_metric(&iterate, &cuts, ridge);
            let Some(mut metric) = inverse.take().or_else(start) else { break };
            let descent = direction(&cuts, &metric);
            let next = self.line_search(&descent.step, value, descent.decrease);
            let Some((parameters, next)) = next else { break };
            let change = self.cuts(&next, &parameters, &places).map(|after| {
                let each = after.iter().zip(&cuts).zip(&descent.multipliers);
                each.fold(DVector::zeros(self.at.len()), |sum, ((new, old), part)| {
                    sum + (&new.gradient - &old.gradient) * *part
                })
            });
            if let Some(change) = change {
                let step = (&parameters - &self.at).component_div(self.scales);
                update(&mut metric, &step, &change);
            }
            inverse = Some(metric);
            let decrease = value - next.largest();
            (self.at, iterate) = (parameters, next);
            if decrease <= FLAT * value || (self.grid.tuning.is_over)() {
                break;
            }
        }
        iterate
    }

    /// The matrix from which a BFGS approximation starts: the inverse of the sum of g g' for the gradients g at every
    /// third frequency, with `ridge` on its diagonal, scaled for the first step along `cuts`.
    ///
    /// With a small `ridge` the steps do not depend on the coordinates of the gains. Where the gain of a plant depends
    /// on the direction, they would else be small along the combinations of gains that decouple it.
    fn inverse_metric(&self, iterate: &Iterate, cuts: &[Cut], ridge: f64) -> Option<DMatrix<f64>> {
        let count = self.at.len();
        let mut metric = DMatrix::zeros(count, count);
        for Cut { gradient, .. } in &self.cuts(iterate, &self.at, &self.grid.places(METRIC_STEP))? {
            metric.ger(1.0, gradient, gradient, 1.0);
        }
        let ridge = ridge * metric.trace() / as_number(count);
        metric += DMatrix::identity(count, count) * ridge;
        let inverse = metric.cholesky()?.inverse();
        let square = |cut: &Cut| cut.gradient.dot(&(&inverse * &cut.gradient));
        let largest = cuts.iter().map(square).fold(0.0, f64::max);
        let first = FIRST * iterate.largest() / largest.sqrt().max(f64::MIN_POSITIVE);
        Some(inverse * first)
    }

    /// The cut that keeps the steps from ending at the largest allowed instability; None if the loop is far from it.
    /// At that limit it is equal to `value`, and it falls by [`STIFFNESS`] times the relative distance from the limit.
    fn stability(&self, iterate: &Iterate, value: f64) -> Option<Cut> {
        let limit = self.grid.tuning.instability;
        let part = |instability: f64| STIFFNESS * value * (limit / instability - 1.0);
        if limit / iterate.instability < NEAR {
            return None;
        }
        let slope = |index: usize| {
            let moved = |sign: f64| self.instability(&self.moved(&self.at, index, sign)).map(part);
            Some((moved(1.0)? - moved(-1.0)?) / (2.0 * DIFFERENCE))
        };
        let gradient: Option<Vec<_>> = (0..self.at.len()).map(slope).collect();
        Some(Cut { value: value + part(iterate.instability), gradient: gradient?.into() })
    }

    /// The instability of the loop at `parameters`.
    fn instability(&self, parameters: &DVector<f64>) -> Option<f64> {
        let tuning = self.grid.tuning;
        instability(&tuning.dynamics(parameters).ok()?, tuning.plant.domain).ok()
    }

    /// The controller and its values at `parameters`; None if the parameters are not allowed, or the loop is not stable
    /// enough.
    fn iterate(&self, parameters: &DVector<f64>) -> Option<Iterate> {
        if !(self.grid.tuning.is_allowed)(parameters) {
            return None;
        }
        let instability = self.instability(parameters)?;
        if instability > self.grid.tuning.instability {
            return None;
        }
        let controller = (self.grid.tuning.controller)(parameters).ok()?;
        let values = self.grid.values(&controller)?;
        Some(Iterate { controller, values, instability })
    }

    /// The parameters and values after the longest of the halved steps with enough decrease; None if none has enough.
    fn line_search(
        &self,
        step: &DVector<f64>,
        value: f64,
        predicted: f64,
    ) -> Option<(DVector<f64>, Iterate)> {
        let mut part = 1.0;
        for _ in 0..HALVINGS {
            let parameters = &self.at + self.scales.component_mul(step) * part;
            let next = self.iterate(&parameters);
            let enough = value - SUFFICIENT * part * predicted;
            if let Some(next) = next.filter(|next| next.largest() < enough) {
                return Some((parameters, next));
            }
            part *= 0.5;
        }
        None
    }

    /// Values of `iterate` at `places`, see [`Grid::cuts`], and their gradients with respect to `parameters` in units of
    /// `scales`.
    fn cuts(
        &self,
        iterate: &Iterate,
        parameters: &DVector<f64>,
        places: &[Place],
    ) -> Option<Vec<Cut>> {
        let differences = self.differences(parameters)?;
        let cuts = |place: &Place| self.grid.cuts(&iterate.controller, &differences, *place);
        let cuts: Option<Vec<_>> = places.iter().map(cuts).collect();
        Some(cuts?.into_iter().flatten().collect())
    }

    /// The parameters of which one is moved by `sign` steps of the differences.
    fn moved(&self, at: &DVector<f64>, index: usize, sign: f64) -> DVector<f64> {
        let mut parameters = at.clone();
        parameters[index] += sign * DIFFERENCE * self.scales[index];
        parameters
    }

    /// The derivatives of the controller's matrices with respect to each parameter, in units of `scales`.
    fn differences(&self, at: &DVector<f64>) -> Option<Vec<StateSpace>> {
        let one = |index: usize| {
            let moved =
                |sign: f64| (self.grid.tuning.controller)(&self.moved(at, index, sign)).ok();
            let (above, below) = (moved(1.0)?, moved(-1.0)?);
            let slope =
                |above: DMatrix<f64>, below: DMatrix<f64>| (above - below) / (2.0 * DIFFERENCE);
            Some(StateSpace {
                a: slope(above.a, below.a),
                b: slope(above.b, below.b),
                c: slope(above.c, below.c),
                d: slope(above.d, below.d),
                domain: above.domain,
            })
        };
        (0..at.len()).map(one).collect()
    }
}

/// The places with values from `least` on at local maxima and at every third frequency, in descending order.
fn active(values: &[Vec<f64>], least: f64) -> Vec<Place> {
    let mut places = Vec::new();
    for (term, values) in values.iter().enumerate() {
        for (node, &value) in values.iter().enumerate() {
            let before = node.checked_sub(1).map_or(0.0, |at| values[at]);
            let after = values.get(node + 1).copied().unwrap_or(0.0);
            let is_maximum = value >= before && value >= after;
            if value >= least && (is_maximum || node % 3 == 0) {
                places.push((value, Place { term, node }));
            }
        }
    }
    places.sort_by(|(one, _), (other, _)| other.total_cmp(one));
    places.into_iter().map(|(_, place)| place).collect()
}
