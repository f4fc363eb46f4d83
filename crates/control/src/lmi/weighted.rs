//! Observer and feedback gains for an H-infinity norm with frequency-dependent weights.

use super::descent::GainNorm;
use super::observer::{Candidate, ObserverRequirements, WeightedDynamics};
use super::region::{Region, certify_region};
use super::synthesis::prove;
use super::{Outcome, Performance, Synthesis, certify_gain, observer_gain};
use crate::blocks::{grid, symmetric_part};
use crate::riccati::kalman;
use crate::{Domain, Error, StateSpace, check};
use nalgebra::DMatrix;

/// A proven bound is returned only if it is at most this factor above the norm.
const LOOSE: f64 = 1.01;

/// Of the gains with a norm up to this factor above the least one, the smallest gain is chosen.
const NEARLY_LEAST: f64 = 1.05;

/// Weights of a norm from w to z: the weighted norm of a system G is the norm of `output` G `input`.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelWeights {
    /// From the weighted disturbance to w, k x k.
    pub input: StateSpace,
    /// From z to the weighted output, r x r.
    pub output: StateSpace,
}

impl ChannelWeights {
    /// The system with weights. States: first of `system`, then of `input`, then of `output`.
    ///
    /// # Panics
    ///
    /// If the numbers of signals do not fit.
    #[must_use]
    pub fn around(&self, system: &StateSpace) -> StateSpace {
        let Self { input, output } = self;
        let none = |rows: usize, cols: usize| DMatrix::zeros(rows, cols);
        let [n, i, o] = [system.a.nrows(), input.a.nrows(), output.a.nrows()];
        let driven = &output.b * &system.d;
        let through = &output.d * &system.d;
        StateSpace {
            a: grid(&[
                &[&system.a, &(&system.b * &input.c), &none(n, o)],
                &[&none(i, n), &input.a, &none(i, o)],
                &[&(&output.b * &system.c), &(&driven * &input.c), &output.a],
            ]),
            b: grid(&[&[&(&system.b * &input.d)], &[&input.b], &[&(&driven * &input.d)]]),
            c: grid(&[&[&(&output.d * &system.c), &(&through * &input.c), &output.c]]),
            d: &through * &input.d,
            domain: system.domain,
        }
    }

    /// The pair (A, C) and the performance of the error dynamics with the states of the weights. A gain L
    /// for the original pair becomes [L; 0] for this pair.
    ///
    /// `a`: n x n; `c`: p x n; `performance`: as for [`super::observer_gain`].
    ///
    /// # Panics
    ///
    /// If the numbers of states or signals do not fit.
    #[must_use]
    pub fn extend(
        &self,
        a: &DMatrix<f64>,
        c: &DMatrix<f64>,
        performance: &Performance,
    ) -> (DMatrix<f64>, DMatrix<f64>, Performance) {
        let Performance { disturbance, output, feedthrough, .. } = performance;
        let (b, e) = (disturbance.clone(), output.clone());
        let plain = StateSpace::strictly_proper(a.clone(), b, e, self.input.domain);
        let StateSpace { a, b, c: e, .. } = self.around(&plain);
        let measured = grid(&[&[
            c,
            &(feedthrough * &self.input.c),
            &DMatrix::zeros(c.nrows(), self.output.a.nrows()),
        ]]);
        let performance = Performance {
            disturbance: b,
            output: e,
            feedthrough: feedthrough * &self.input.d,
            ..performance.clone()
        };
        (a, measured, performance)
    }

    /// The weights of the transposed system.
    #[must_use]
    pub fn transposed(&self) -> Self {
        Self { input: self.output.dual(), output: self.input.dual() }
    }

    /// An observer gain L as by [`super::observer_gain`], for an H-infinity norm with weights.
    ///
    /// `performance`: as for [`super::observer_gain`], with [`super::Norm::HInfinity`].
    ///
    /// The gain does not act on the states of the weights: the extended error dynamics have the gain [L; 0], and the
    /// set of these gains with a norm below a bound is not convex. So descents start from up to three gains. Linear
    /// matrix inequalities give one for the region alone and one for region and norm (with P = diag(`P_1`, `P_2`), Z =
    /// `P_1` L makes the inequalities of the norm linear). The third is the Kalman gain for disturbances of unit
    /// intensity, without its rows for the states of the weights. Each descent lowers the norm within the region as far
    /// as possible, by its derivatives with respect to the entries of L. Of the results with a norm up to 5 % above the
    /// least one, or below a given bound, the one with the smallest Frobenius norm of L is chosen. The result is a
    /// local minimum; [`super::observer_norm_lower_bound`] for [`Self::extend`] bounds the norm of the best observer.
    /// [`Outcome::Inconclusive`] if no result keeps the given bound.
    ///
    /// The region is proven as in [`super::observer_gain`]. `bound` of the result is the bound of the weighted
    /// system, with P for the states of [`Self::around`], or None if it could not be proven to 1 %;
    /// [`crate::response::h_infinity`] computes the norm in any case.
    ///
    /// # Errors
    ///
    /// Same as [`super::observer_gain`].
    pub fn observer_gain(
        &self,
        a: &DMatrix<f64>,
        c: &DMatrix<f64>,
        region: &Region,
        performance: &Performance,
        domain: Domain,
    ) -> Result<Outcome<Synthesis>, Error> {
        let n = check::with_outputs(a, c)?;
        region.check(domain)?;
        performance.check(n, (c.nrows(), performance.disturbance.ncols()))?;
        let free = Performance { gamma: None, ..performance.clone() };
        let (wide_a, wide_c, wide) = self.extend(a, c, &free);
        let disturbance_states = self.input.a.nrows();
        let weighted = Some(WeightedDynamics { a: &wide_a, c: &wide_c, disturbance_states });
        let requirements = ObserverRequirements {
            a,
            c,
            region: *region,
            performance: Some(&wide),
            domain,
            weighted,
        };
        let proven = |candidate: Candidate| {
            let dynamics = a - &candidate.gain * c;
            prove(candidate, &dynamics, region, None, domain)
        };
        let by_norm = requirements.search(proven)?;
        let plain = observer_gain(a, c, region, None, domain)?;
        let Performance { disturbance: b, feedthrough: d, output: e, .. } = &wide;
        let norm = GainNorm { a: &wide_a, b, c: &wide_c, d, e, region, domain };
        let inequalities = [plain, by_norm];
        let starts = inequalities.iter().filter_map(|one| Some(one.clone().optimal()?.gain));
        let mut candidates = Vec::new();
        for start in starts.chain(kalman_gain(&norm, n)) {
            let lower = norm.descend(&start);
            let Some((value, _)) = norm.value(&lower) else { continue };
            if let Some(region) = certify_region(&(a - &lower * c), region, domain)?.optimal() {
                candidates.push((value, Synthesis { gain: lower, region, bound: None }));
            }
        }
        let least = candidates.iter().map(|(value, _)| *value).fold(f64::INFINITY, f64::min);
        let most = performance.gamma.map_or(NEARLY_LEAST * least, |gamma| gamma.max(least));
        let good = candidates.into_iter().filter(|(value, _)| *value <= most);
        let smallest = good.min_by(|one, other| one.1.gain.norm().total_cmp(&other.1.gain.norm()));
        let Some((reached, synthesis)) = smallest else {
            let [_, by_norm] = inequalities;
            return Ok(by_norm);
        };
        if performance.gamma.is_some_and(|gamma| reached > gamma) {
            return Ok(Outcome::Inconclusive("no gain that keeps the bound was found"));
        }
        let b = &performance.disturbance - &synthesis.gain * &performance.feedthrough;
        let (a, c) = (a - &synthesis.gain * c, performance.output.clone());
        let closed = StateSpace::strictly_proper(a, b, c, domain);
        let bound = certify_gain(&self.around(&closed), performance.norm)?.optimal();
        let bound = bound.filter(|bound| bound.gamma <= LOOSE * reached);
        Ok(Outcome::Optimal(Synthesis { bound, ..synthesis }))
    }

    /// A state feedback as by [`super::state_feedback`], for an H-infinity norm with weights; u = K x does not depend
    /// on the states of the weights. K is the transposed [`Self::observer_gain`] of the transposed system; `bound` and
    /// `region` are certificates of the transposed loop.
    ///
    /// # Errors
    ///
    /// Same as [`super::state_feedback`].
    pub fn state_feedback(
        &self,
        a: &DMatrix<f64>,
        b: &DMatrix<f64>,
        region: &Region,
        performance: &Performance,
        domain: Domain,
    ) -> Result<Outcome<Synthesis>, Error> {
        let n = check::with_inputs(a, b)?;
        performance.check(n, (performance.output.nrows(), b.ncols()))?;
        let (a, c, dual) = (a.transpose(), b.transpose(), performance.transposed());
        let outcome = self.transposed().observer_gain(&a, &c, region, &dual, domain)?;
        outcome.then(|synthesis| {
            let gain = -synthesis.gain.transpose();
            Ok(Outcome::Optimal(Synthesis { gain, ..synthesis }))
        })
    }
}

/// The first n rows of the gain L of the Kalman filter; None if there is no such filter.
///
/// The noises of states and measurements are correlated: S = B D', V = D D', L = `L_1` + S V^-1 with the gain
/// `L_1` for A - S V^-1 C and the process noise intensity B B' - S V^-1 S'.
fn kalman_gain(norm: &GainNorm<'_>, n: usize) -> Option<DMatrix<f64>> {
    let GainNorm { a, b, c, d, domain, .. } = *norm;
    let noise = symmetric_part(&(d * d.transpose()));
    let correlated = noise.clone().cholesky()?.solve(&(d * b.transpose())).transpose();
    let process = b * b.transpose() - &correlated * d * b.transpose();
    let filter =
        kalman(&(a - &correlated * c), c, &symmetric_part(&process), &noise, domain).ok()?;
    Some((filter.gain + correlated).rows(0, n).into_owned())
}

#[cfg(test)]
mod tests {
    use super::super::lower_bound::tests::{row, scalar_error};
    use super::*;
    use crate::lmi::observer_norm_lower_bound;
    use crate::response::h_infinity;
    use crate::weight::{Weight, diagonal};

    /// x' = step w, y = x + v: a fault seen through noise.
    fn fault_through_noise(step: f64) -> Performance {
        scalar_error(&[step, 0.0], &[0.0, 1.0])
    }

    fn weights(noise: &Weight, output: &Weight, domain: Domain) -> ChannelWeights {
        let input = diagonal(&[Weight::constant(1.0), noise.clone()], domain).unwrap();
        ChannelWeights { input, output: output.system(domain).unwrap() }
    }

    /// The norm of the scalar loop for every gain on a grid: the search is near the least one.
    #[test]
    fn the_weighted_gain_of_a_scalar_observer_is_near_the_best_of_a_search_over_all_gains() {
        for (domain, a, step) in
            [(Domain::Continuous, 0.0, 1.0), (Domain::Sampled { period: 0.1 }, 1.0, 0.1)]
        {
            let noise = Weight::lead_lag(0.1, 3.0, 10.0, 1).unwrap();
            let error = Weight::lead_lag(20.0, 0.3, 0.2, 2).unwrap();
            let weights = weights(&noise, &error, domain);
            let performance = fault_through_noise(step);
            let (a, c) = (row(&[a]), row(&[1.0]));
            let norm = |gain: f64| {
                let b = &performance.disturbance - &performance.feedthrough * gain;
                let closed = StateSpace::strictly_proper(&a - row(&[gain]), b, row(&[1.0]), domain);
                h_infinity(&weights.around(&closed), 1e-4).map_or(f64::INFINITY, |norm| norm.upper)
            };
            let best = (0..400).map(|k| norm(1e-3 * 1.03_f64.powi(k))).fold(f64::MAX, f64::min);
            let region = Region::default();
            let outcome = weights.observer_gain(&a, &c, &region, &performance, domain);
            let Outcome::Optimal(synthesis) = outcome.unwrap() else { panic!() };
            let reached = norm(synthesis.gain[(0, 0)]);
            assert!(reached < 1.1 * best, "{domain:?}: {reached}, {best}");
            assert!(synthesis.bound.is_none_or(|bound| bound.gamma >= 0.999 * reached));
            let (wide_a, wide_c, wide) = weights.extend(&a, &c, &performance);
            let least =
                observer_norm_lower_bound(&wide_a, &wide_c, &wide, domain).unwrap().unwrap();
            assert!(least <= best, "{domain:?}: {least}, {best}");
        }
    }

    /// x' = -L x + w - L v, v twice and z three times as large: the norm is 3 sqrt(1 / L^2 + 4).
    #[test]
    fn weights_without_states_are_factors_of_the_norm() {
        let domain = Domain::Continuous;
        let weights = weights(&Weight::constant(2.0), &Weight::constant(3.0), domain);
        let performance = Performance { gamma: Some(9.0), ..fault_through_noise(1.0) };
        let region = Region { decay: Some(1.0), ..Region::default() };
        let (a, c) = (row(&[0.0]), row(&[1.0]));
        let outcome = weights.observer_gain(&a, &c, &region, &performance, domain);
        let Outcome::Optimal(Synthesis { gain, .. }) = outcome.unwrap() else { panic!() };
        let expected = 3.0 * (gain[0].powi(-2) + 4.0).sqrt();
        let b = &performance.disturbance - &gain * &performance.feedthrough;
        let closed = StateSpace::strictly_proper(-&gain, b, row(&[1.0]), domain);
        let norm = h_infinity(&weights.around(&closed), 1e-6).unwrap().upper;
        assert!((norm / expected - 1.0).abs() < 1e-5 && gain[0] > 1.0, "{norm} {expected}");
    }
}
