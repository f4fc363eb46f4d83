//! The search for the parameters.

use super::minimax::{Cut, direction, update};
use super::objective::{Grid, Place};
use super::{Tuned, Tuning};
use crate::{Error, StateSpace, check};
use nalgebra::{DMatrix, DVector};

/// Largest numbers of steps between two verifications, and of verifications.
const STEPS: usize = 150;
const ROUNDS: usize = 12;
/// A step uses only the values above this fraction of the largest value, and at most [`MOST_ACTIVE`] values.
const ACTIVE: f64 = 0.85;
const MOST_ACTIVE: usize = 40;
/// Step of the differences, relative to the size of a parameter.
const DIFFERENCE: f64 = 1e-3;
/// The largest number of step lengths that are tried, and the part of the predicted decrease that a step must reach.
const HALVINGS: usize = 14;
const SUFFICIENT: f64 = 1e-2;
/// A search ends when two steps have decreased gamma by less than this fraction.
const FLAT: f64 = 1e-5;
/// A round that decreases gamma by less than this fraction is the last one if the peak is on the grid, see `BETWEEN`.
const PROGRESS: f64 = 1e-3;
/// A norm that exceeds the largest value of the grid by at most this fraction counts as on the grid.
const BETWEEN: f64 = 2e-3;

impl Tuning<'_> {
    /// Tunes the parameters from `start`; `scales`: the size of each parameter.
    ///
    /// Method: steps of sequential quadratic programming for the maximum over the local maxima of a grid of
    /// frequencies, with a BFGS approximation of the Hessian of the Lagrangian. After each of these searches the
    /// frequency of the verified peak is added to the grid. The result is a local minimum at best; gamma is verified.
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
        let mut best = Tuned { parameters: start.clone(), peak: self.peak(start)? };
        let mut search = Search { grid: Grid::new(self)?, scales, at: start.clone() };
        search.grid.add(best.peak.frequency)?;
        for _ in 0..ROUNDS {
            let value = search.descend();
            let peak = self.peak(&search.at)?;
            let before = best.peak.gamma;
            if peak.gamma < before {
                best = Tuned { parameters: search.at.clone(), peak };
            }
            let is_on_grid = peak.gamma <= (1.0 + BETWEEN) * value;
            let is_flat = peak.gamma >= (1.0 - PROGRESS) * before;
            if (is_on_grid && is_flat) || (self.is_over)() {
                break;
            }
            search.grid.add(peak.frequency)?;
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
}

impl Iterate {
    fn largest(&self) -> f64 {
        self.values.iter().flatten().copied().fold(0.0, f64::max)
    }
}

impl Search<'_> {
    /// Steps until the largest value on the grid does not decrease any more; returns that value.
    fn descend(&mut self) -> f64 {
        let count = self.at.len();
        let Some(mut iterate) = self.iterate(&self.at) else { return f64::INFINITY };
        let mut inverse = DMatrix::identity(count, count);
        let (mut is_fresh, mut was_flat) = (true, false);
        for _ in 0..STEPS {
            let value = iterate.largest();
            let places = active(&iterate.values, ACTIVE * value);
            let cuts = self.cuts(&iterate, &self.at, &places);
            let Some(cuts) = cuts.filter(|cuts| !cuts.is_empty()) else { break };
            if is_fresh {
                // The first step changes the parameters by a twentieth of their sizes.
                let size = cuts.iter().map(|cut| cut.gradient.norm()).fold(0.0, f64::max);
                inverse = DMatrix::identity(count, count) * (0.05 / size.max(f64::MIN_POSITIVE));
            }
            let descent = direction(&cuts, &inverse);
            let next = self.line_search(&descent.step, value, descent.decrease);
            let Some((parameters, next)) = next else {
                if is_fresh || (self.grid.tuning.is_over)() {
                    break;
                }
                is_fresh = true;
                continue;
            };
            is_fresh = false;
            let change = self.cuts(&next, &parameters, &places).map(|after| {
                let each = after.iter().zip(&cuts).zip(&descent.multipliers);
                each.fold(DVector::zeros(count), |sum, ((new, old), part)| {
                    sum + (&new.gradient - &old.gradient) * *part
                })
            });
            if let Some(change) = change {
                let step = (&parameters - &self.at).component_div(self.scales);
                update(&mut inverse, &step, &change);
            }
            let decrease = value - next.largest();
            (self.at, iterate) = (parameters, next);
            if (self.grid.tuning.is_over)() {
                break;
            }
            // After the first flat step the BFGS matrix starts again; the second flat step is the last one.
            if decrease <= FLAT * value {
                if was_flat {
                    break;
                }
                (is_fresh, was_flat) = (true, true);
            }
        }
        iterate.largest()
    }

    /// The controller and its values at `parameters`; None if the parameters are not allowed, or the loop is not stable
    /// enough.
    fn iterate(&self, parameters: &DVector<f64>) -> Option<Iterate> {
        if !(self.grid.tuning.is_allowed)(parameters) {
            return None;
        }
        let controller = (self.grid.tuning.controller)(parameters).ok()?;
        let values = self.grid.values(&controller)?;
        Some(Iterate { controller, values })
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

    /// Weighted singular values of `iterate` at `places`, and their gradients with respect to `parameters` in units of
    /// `scales`.
    fn cuts(
        &self,
        iterate: &Iterate,
        parameters: &DVector<f64>,
        places: &[Place],
    ) -> Option<Vec<Cut>> {
        let differences = self.differences(parameters)?;
        let cut = |place: &Place| self.grid.gradient(&iterate.controller, &differences, *place);
        places.iter().map(cut).collect()
    }

    /// The derivatives of the controller's matrices with respect to each parameter, in units of `scales`.
    fn differences(&self, at: &DVector<f64>) -> Option<Vec<StateSpace>> {
        let one = |index: usize| {
            let moved = |sign: f64| {
                let mut parameters = at.clone();
                parameters[index] += sign * DIFFERENCE * self.scales[index];
                (self.grid.tuning.controller)(&parameters).ok()
            };
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

/// The places with values from `least` on at local maxima and at every third frequency: the largest 40, in descending
/// order.
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
    places.truncate(MOST_ACTIVE);
    places.into_iter().map(|(_, place)| place).collect()
}
