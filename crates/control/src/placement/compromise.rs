//! The choice among eigenvectors by condition number, gain and peak of S together.

use super::eigenvectors::{Directions, descend};
use super::figures::{COUNT, FeedbackLoop, Weighting};
use crate::Error;
use nalgebra::DVector;

/// The first candidate is kept if its condition number, gain and peak of S exceed their references by at most these
/// factors.
const ACCEPTABLE: Figures = [1.11, 1.11, 1.02];
/// Factor by which condition number and gain may exceed their references in the search for the least peak of S.
const LIMIT: f64 = 1.05;
/// A candidate with a figure below its least value of largest volume lowers the reference, down to this fraction of the
/// least value.
const MARGIN: f64 = 0.9;
/// Sharpness of the smooth maximum over the figures and of the smooth limits.
const SHARPNESS: f64 = 40.0;
/// Weight of the excess over a limit.
const PENALTY: f64 = 10.0;
/// Relative decrease at which a descent ends.
const TOLERANCE: f64 = 1e-3;

/// The factor by which condition number and gain of an alternative may exceed their least values of largest volume.
const ALTERNATIVE: f64 = 1.09;
/// Two sets of directions count as the same if all their figures agree to this relative difference.
const SAME: f64 = 1e-4;
/// Number of descents of the peak of S.
const DESCENTS: usize = 5;

type Figures = [f64; COUNT];

/// The search for directions by three figures: condition number, gain norm, peak of S.
pub(crate) struct Search<'a> {
    feedback: &'a FeedbackLoop<'a>,
    /// The directions of all searches, with their figures.
    results: Vec<(Figures, Directions)>,
    /// The least figures of the directions of largest volume in [`Self::choose`].
    widest: Figures,
}

impl<'a> Search<'a> {
    pub(crate) fn new(feedback: &'a FeedbackLoop<'a>) -> Self {
        Self { feedback, results: vec![], widest: [f64::INFINITY; COUNT] }
    }

    /// Chooses directions.
    ///
    /// `candidates`: directions of least condition number, in the requested coordinates and in those of A;
    /// `widest`: directions of largest volume, which the methods of Kautsky, Nichols and Van Dooren and of
    /// Tits and Yang find. The references of condition number and gain are the least of `widest`, or of
    /// `candidates` if lower, by at most 10 %; the reference of S is the least peak that descents find with
    /// condition number and gain within 5 % of their references, or as near as possible.
    ///
    /// Returns None to keep the first candidate if its condition number and gain are within 11 % and its peak of S
    /// within 2 % of the references, or if `widest` has no figures. Otherwise descents minimise a smooth maximum of the
    /// three relative figures; returns the directions of all searches with the least largest relative figure.
    pub(crate) fn choose(
        &mut self,
        candidates: &[Directions],
        widest: &[Directions],
    ) -> Result<Option<Directions>, Error> {
        let (of_candidates, smooth_of_candidates) = self.add(candidates)?;
        let first = self.results.first().map(|(figures, _)| *figures);
        let (of_widest, smooth_of_widest) = self.add(widest)?;
        self.widest = of_widest;
        if !of_widest.iter().all(|figure| figure.is_normal()) {
            return Ok(None);
        }
        let mut reference = of_widest;
        let mut smooth = smooth_of_widest;
        for figure in 0..COUNT {
            reference[figure] =
                of_candidates[figure].clamp(MARGIN * of_widest[figure], of_widest[figure]);
            let least = smooth_of_widest[figure];
            smooth[figure] = smooth_of_candidates[figure].clamp(least + MARGIN.ln(), least);
        }
        let is_acceptable = |reference: Figures| {
            let limits = std::array::from_fn(|figure| ACCEPTABLE[figure] * reference[figure]);
            first.is_some_and(|first| ratio(first, limits) <= 1.0)
        };
        // No loop has a lower peak than 1.
        if is_acceptable([reference[0], reference[1], 1.0]) {
            return Ok(None);
        }
        let mut starts = self.results.clone();
        starts.sort_by(|x, y| ratio(x.0, reference).total_cmp(&ratio(y.0, reference)));
        for (_, start) in starts.iter().take(DESCENTS) {
            self.descend(start, &|figures| penalised_peak(figures, &smooth))?;
        }
        if let Some((figures, directions)) = self.least_peak(reference) {
            reference[2] = figures[2];
            smooth[2] = self.feedback.smooth(directions).unwrap_or(smooth)[2];
        }
        if is_acceptable(reference) {
            return Ok(None);
        }
        let best = self.best(reference).cloned();
        for start in candidates.first().cloned().into_iter().chain(best) {
            self.descend(&start, &|figures| smooth_maximum(figures, &smooth))?;
        }
        Ok(self.best(reference).cloned())
    }

    /// Returns the directions of all searches, and of `more` (of largest volume), that differ from `chosen` and from
    /// each other, the lowest peak of S first.
    ///
    /// Condition number and gain of each result exceed their least values of largest volume by at most 9 %.
    pub(crate) fn others(
        mut self,
        chosen: &Directions,
        more: &[Directions],
    ) -> Result<Vec<Directions>, Error> {
        let (of_more, _) = self.add(more)?;
        let [condition, gain, _] = least(self.widest, of_more);
        let reference = [condition, gain, f64::INFINITY];
        self.results.retain(|(figures, _)| ratio(*figures, reference) <= ALTERNATIVE);
        self.results.sort_by(|x, y| x.0[2].total_cmp(&y.0[2]));
        let mut known: Vec<Figures> = self.feedback.figures(chosen)?.into_iter().collect();
        self.results.retain(|(figures, _)| {
            let is_new = !known.iter().any(|known| is_same(*known, *figures));
            if is_new {
                known.push(*figures);
            }
            is_new
        });
        Ok(self.results.into_iter().map(|(_, directions)| directions).collect())
    }

    /// Adds directions to the results; returns their least figures and the least logarithms of their smooth figures.
    /// Directions without figures are left out.
    fn add(&mut self, all: &[Directions]) -> Result<(Figures, Figures), Error> {
        let (mut exact, mut smooth) = ([f64::INFINITY; COUNT], [f64::INFINITY; COUNT]);
        for directions in all {
            let values = (self.feedback.figures(directions)?, self.feedback.smooth(directions));
            if let (Some(figures), Some(logarithms)) = values {
                exact = least(exact, figures);
                smooth = least(smooth, logarithms);
                self.results.push((figures, directions.clone()));
            }
        }
        Ok((exact, smooth))
    }

    /// The directions of least peak of S within the limits of condition number and gain; if there are none, the
    /// directions nearest to both references.
    fn least_peak(&self, reference: Figures) -> Option<&(Figures, Directions)> {
        let excess = |figures: Figures| {
            let largest = ratio(figures, [reference[0], reference[1], f64::INFINITY]);
            if largest <= LIMIT { 0.0 } else { largest }
        };
        let order =
            |x: Figures, y: Figures| excess(x).total_cmp(&excess(y)).then(x[2].total_cmp(&y[2]));
        self.results.iter().min_by(|x, y| order(x.0, y.0))
    }

    /// The directions whose largest relative figure is least.
    fn best(&self, reference: Figures) -> Option<&Directions> {
        let worst = |(figures, _): &(Figures, Directions)| ratio(*figures, reference);
        let best = self.results.iter().min_by(|x, y| worst(x).total_cmp(&worst(y)));
        best.map(|(_, directions)| directions)
    }

    /// Adds the end of a descent of an objective from `start`.
    fn descend(&mut self, start: &Directions, weighting: &Weighting) -> Result<(), Error> {
        let slope = |directions: &[DVector<f64>]| self.feedback.objective(directions, weighting);
        let end = descend(self.feedback.problem, start.clone(), &slope, TOLERANCE)?;
        self.add(&[end])?;
        Ok(())
    }
}

fn least(a: Figures, b: Figures) -> Figures {
    std::array::from_fn(|figure| a[figure].min(b[figure]))
}

fn is_same(a: Figures, b: Figures) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= SAME * b)
}

/// The largest ratio of a figure to its reference.
fn ratio(figures: Figures, reference: Figures) -> f64 {
    figures.iter().zip(reference).map(|(figure, reference)| figure / reference).fold(0.0, f64::max)
}

/// A smooth maximum of the differences x between the figures and their references, ln(sum of e^(k x)) / k with k =
/// `SHARPNESS`, and its partial derivatives.
fn smooth_maximum(figures: &Figures, reference: &Figures) -> (f64, Figures) {
    let excess: Figures = std::array::from_fn(|figure| figures[figure] - reference[figure]);
    let largest = excess.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let weights = excess.map(|excess| (SHARPNESS * (excess - largest)).exp());
    let total: f64 = weights.iter().sum();
    (largest + total.ln() / SHARPNESS, weights.map(|weight| weight / total))
}

/// The peak of S with a penalty on condition number and gain above their references, and its partial
/// derivatives.
fn penalised_peak(figures: &Figures, reference: &Figures) -> (f64, Figures) {
    let mut value = figures[COUNT - 1];
    let mut weights = [0.0, 0.0, 1.0];
    for figure in 0..COUNT - 1 {
        let steep = SHARPNESS * (figures[figure] - reference[figure]);
        value += PENALTY * (steep.max(0.0) + (-steep.abs()).exp().ln_1p()) / SHARPNESS;
        weights[figure] = PENALTY / (1.0 + (-steep).exp());
    }
    (value, weights)
}
