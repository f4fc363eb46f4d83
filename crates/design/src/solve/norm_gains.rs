//! Gains by the H-infinity norm: the channels of observer and feedback that the plant file weights.

pub(crate) mod search;

use control::aso::Estimator;
use control::faults::FaultChannel;
use control::lmi::{
    self, ChannelWeights, Norm, Performance, disc_norm_lower_bound, feedback_norm_lower_bound,
    noiseless_norm_lower_bound, observer_norm_lower_bound,
};
use control::response::h_infinity;
use control::riccati::{NormFilter, NormFilterProblem};
use control::weight::{Weight, diagonal};
use control::{Domain, Error, StateSpace};
use nalgebra::{DMatrix, DVector};

use crate::report::LowerBoundFor;
use crate::solve::gain::{FeedbackProblem, GainResult, Refusal};
use crate::solve::norm_gains::search::{LARGEST_ORDER, LowerBound, Search, WIDTH};
use plant_file::channel::{Channel, ChannelWeight};
use plant_file::requirements::Region;

/// Ratio of the upper to the lower bound between which the least norm of any filter is searched.
const RANGE: f64 = 1e6;
/// Ratio of the upper to the lower bound of the least norm at which the search ends.
const NARROW: f64 = 1.02;
/// Bound for which a filter is designed, relative to the least bound, near which the gain grows without limit.
const RELAXED: f64 = 1.1;
/// Norm of a filter by the Riccati equation, relative to its bound, above which the filter is not used.
const ROUNDED: f64 = 1.05;

/// The augmented dynamics, and the data of the channel of the observer.
pub(crate) struct ObserverProblem<'a> {
    /// `A_0`, the dynamics of the plant with the models of its faults.
    pub(crate) a_0: &'a DMatrix<f64>,
    /// `C_0`, from the states of this augmented system to the measurements.
    pub(crate) c_0: &'a DMatrix<f64>,
    /// B of the plant with its measurement filter.
    pub(crate) b: &'a DMatrix<f64>,
    /// For each fault, its estimates among the last states.
    pub(crate) channels: &'a [FaultChannel],
    /// Number of states of the fault models, which are the last states.
    pub(crate) faults: usize,
    /// Coefficients of the measurement filter, whose states precede the states of the faults.
    pub(crate) filter: Option<&'a [f64]>,
    pub(crate) estimator: Estimator,
}

/// The requirement `h_infinity`.
#[derive(Clone, Copy)]
pub(crate) struct NormRequirement<'a> {
    /// The bound to keep; None for the least norm.
    pub(crate) bound: Option<f64>,
    pub(crate) region: Region,
    pub(crate) channel: &'a Channel,
    /// The time domain of the controller.
    pub(crate) domain: Domain,
}

impl ObserverProblem<'_> {
    /// Returns the channel from [rates of the faults; noise] to the weighted errors of the estimates, for the
    /// error dynamics A - L C with C = `C_0`, or `C_0` `A_0` for a current estimator:
    ///
    /// ```text
    /// x' = (A - L C) x + (B - L D_y) [rates; noise],  z = W E x
    /// ```
    ///
    /// W are the weights; E selects the states of the fault models. Without a measurement filter the noise enters
    /// through `D_y`, with one through the filter's states. A current estimator corrects with the newest measurement:
    /// `D_y` then has `C_0` B, too. In sampled time a rate acts for one period.
    fn performance(&self, required: NormRequirement<'_>) -> Performance {
        let (order, p, q) = (self.a_0.nrows(), self.c_0.nrows(), self.faults);
        let noises = required.channel.noise.len();
        let mut disturbance = DMatrix::zeros(order, q + noises);
        disturbance.view_mut((order - q, 0), (q, q)).fill_diagonal(required.domain.step());
        let mut feedthrough = DMatrix::zeros(p, q + noises);
        for (at, noise) in required.channel.noise.iter().enumerate() {
            match self.filter {
                Some(filter) => {
                    disturbance[(order - q - p + at, q + at)] = filter[at] * noise.factor();
                }
                None => feedthrough[(at, q + at)] = noise.factor(),
            }
        }
        if self.estimator == Estimator::Current {
            feedthrough += self.c_0 * &disturbance;
        }
        let mut output = DMatrix::zeros(q, order);
        output.columns_mut(order - q, q).fill_with_identity();
        for (channel, weight) in self.channels.iter().zip(&required.channel.weights) {
            for row in [Some(channel.estimate), channel.rate].into_iter().flatten() {
                output.row_mut(row).scale_mut(weight.factor());
            }
        }
        let gamma = required.bound;
        Performance { disturbance, output, feedthrough, norm: Norm::HInfinity, gamma }
    }

    /// Returns the weights over frequency of the channel of `performance`; None if all weights are constant.
    fn weights(&self, required: NormRequirement<'_>) -> Result<Option<ChannelWeights>, Error> {
        let NormRequirement { channel, domain, .. } = required;
        if !channel.has_states() {
            return Ok(None);
        }
        let one = || Weight::constant(1.0);
        let mut inputs = vec![one(); self.faults];
        inputs.extend(channel.noise.iter().map(over_frequency));
        let mut outputs = vec![one(); self.faults];
        for (fault, weight) in self.channels.iter().zip(&channel.weights) {
            for row in [Some(fault.estimate), fault.rate].into_iter().flatten() {
                outputs[row] = over_frequency(weight);
            }
        }
        let (input, output) = (diagonal(&inputs, domain)?, diagonal(&outputs, domain)?);
        Ok(Some(ChannelWeights { input, output }))
    }

    /// Computes the gain by the Riccati equation of the filter, for the bound, or without one for [`RELAXED`] times the
    /// least bound of any filter; the region is not considered.
    ///
    /// None without noise, with weights over frequency, and above [`LARGEST_ORDER`] states; if there is no such filter,
    /// as in continuous time with a measurement filter, after which no noise is left; and if rounding errors raise the
    /// norm above [`ROUNDED`] times its bound.
    fn riccati(&self, required: NormRequirement<'_>) -> Result<Option<DMatrix<f64>>, Error> {
        let NormRequirement { channel, domain, .. } = required;
        let unsuitable = channel.has_states() || channel.noise.is_empty();
        if unsuitable || self.a_0.nrows() > LARGEST_ORDER {
            return Ok(None);
        }
        let performance = self.performance(required);
        let output = self.estimator.output_matrix(self.a_0, self.c_0);
        let problem = NormFilterProblem {
            a: self.a_0,
            c: &output,
            disturbance: &performance.disturbance,
            feedthrough: &performance.feedthrough,
            output: &performance.output,
        };
        // A plant with a mode at rest that no fault excites has no such filter.
        let Ok(filter) = NormFilter::new(&problem, domain) else { return Ok(None) };
        if let Some(bound) = required.bound {
            return filter.gain(bound);
        }
        let norm = |gain: &DMatrix<f64>| -> Result<f64, Error> {
            Ok(h_infinity(&self.closed(gain, &output, &performance, domain), WIDTH)?.upper)
        };
        let mut high = norm(&filter.kalman_gain())? * RELAXED;
        let mut low = high / RANGE;
        while high > NARROW * low {
            let middle = (low * high).sqrt();
            match filter.gain(middle)? {
                Some(_) => high = middle,
                None => low = middle,
            }
        }
        let Some(gain) = filter.gain(RELAXED * high)? else { return Ok(None) };
        // Rounding errors of the equation raise the norm; linear matrix inequalities are then more accurate.
        Ok((norm(&gain)? <= ROUNDED * RELAXED * high).then_some(gain))
    }

    /// Computes a lower bound of the norm for all gains, the largest one that is known: for filters of any order, and
    /// without noise for gains with all eigenvalues in the disc of the region. With noise the bounds without noise hold,
    /// too, as each input can only raise the norm; alone they would say little. None if no bound is known.
    fn lower_bound(&self, required: NormRequirement<'_>) -> Result<Option<LowerBound>, Error> {
        if !required.channel.noise.is_empty() {
            let Some(noisy) = self.noisy_lower_bound(required)? else { return Ok(None) };
            let channel = &Channel { noise: Vec::new(), ..required.channel.clone() };
            let quiet = self.lower_bound(NormRequirement { channel, ..required })?;
            let quiet = quiet.filter(|quiet| quiet.norm > noisy);
            return Ok(Some(quiet.unwrap_or(LowerBound::for_filters(noisy))));
        }
        let (a, c, performance) = self.extended(required)?;
        // If this computation fails, there is no bound; the gain does not depend on it.
        let of_filters =
            noiseless_norm_lower_bound(&a, &c, &performance, required.domain).unwrap_or(None);
        let Region { decay, disc, .. } = required.region;
        let of_disc = match disc.filter(|_| !required.channel.has_states()) {
            Some((center, radius)) => {
                let (disc, decay) = (lmi::Disc { center, radius }, decay.unwrap_or(0.0));
                disc_norm_lower_bound(&a, &c, &performance, disc, decay).unwrap_or(None)
            }
            None => None,
        };
        Ok(match (of_filters, of_disc) {
            (bound, Some(norm)) if bound.is_none_or(|norm_bound| norm_bound < norm) => {
                Some(LowerBound { norm, holds_for: LowerBoundFor::Disc })
            }
            (bound, _) => bound.map(LowerBound::for_filters),
        })
    }

    /// Computes a lower bound of the norm for filters of any order, for the unfiltered measurements with noise; None
    /// above [`LARGEST_ORDER`] states.
    ///
    /// With a measurement filter the newest measurement is that of the sample before, as for a prediction estimator.
    fn noisy_lower_bound(&self, required: NormRequirement<'_>) -> Result<Option<f64>, Error> {
        let order = self.a_0.nrows();
        if order > LARGEST_ORDER {
            return Ok(None);
        }
        let Some(filter) = self.filter else {
            let (a, c, performance) = self.extended(required)?;
            return observer_norm_lower_bound(&a, &c, &performance, required.domain);
        };
        let first = order - self.faults - filter.len();
        let states: Vec<_> =
            (0..order).filter(|at| !(first..first + filter.len()).contains(at)).collect();
        let columns = self.a_0.select_columns(&states);
        let rates = DVector::from_column_slice(filter).map(|rate| 1.0 / rate);
        let unfiltered = ObserverProblem {
            a_0: &columns.select_rows(&states),
            c_0: &(DMatrix::from_diagonal(&rates) * columns.rows(first, filter.len())),
            b: &self.b.rows(0, first).into_owned(),
            channels: self.channels,
            faults: self.faults,
            filter: None,
            estimator: Estimator::Prediction,
        };
        unfiltered.noisy_lower_bound(required)
    }

    /// Returns the error dynamics with a `gain` for `output`, from w to z of a performance.
    fn closed(
        &self,
        gain: &DMatrix<f64>,
        output: &DMatrix<f64>,
        performance: &Performance,
        domain: Domain,
    ) -> StateSpace {
        let a = self.a_0 - gain * output;
        let b = &performance.disturbance - gain * &performance.feedthrough;
        StateSpace::strictly_proper(a, b, performance.output.clone(), domain)
    }

    /// Returns A, C and the performance of [`Self::performance`], extended by the states of the weights, if there are
    /// any.
    fn extended(
        &self,
        required: NormRequirement<'_>,
    ) -> Result<(DMatrix<f64>, DMatrix<f64>, Performance), Error> {
        let output = self.estimator.output_matrix(self.a_0, self.c_0);
        let performance = self.performance(required);
        Ok(match self.weights(required)? {
            None => (self.a_0.clone(), output, performance),
            Some(weights) => weights.extend(self.a_0, &output, &performance),
        })
    }

    /// Computes L; for a current estimator the gain of the correction.
    pub(crate) fn by_norm(&self, required: NormRequirement<'_>) -> Result<GainResult, Refusal> {
        let output = self.estimator.output_matrix(self.a_0, self.c_0);
        let domain = required.domain;
        let plain = NormRequirement { channel: &Channel::default(), ..required };
        let unweighted = self.performance(plain);
        let weights = self.weights(required)?;
        let search = Search {
            synthesise: &|region, performance| match performance.zip(weights.as_ref()) {
                None => lmi::observer_gain(self.a_0, &output, region, performance, domain),
                Some((performance, weights)) => {
                    weights.observer_gain(self.a_0, &output, region, performance, domain)
                }
            },
            weights: weights.as_ref(),
            system: &|gain, performance| self.closed(gain, &output, performance, domain),
            performance: self.performance(required),
            unweighted,
            required,
            filter: self.riccati(required)?,
            lower_bound: self.lower_bound(required)?,
        };
        let noise = if required.channel.noise.is_empty() { "" } else { " and measurement noise" };
        search.result(&format!(
            "H-infinity norm from the faults' rates{noise} to the errors of their estimates"
        ))
    }
}

impl FeedbackProblem<'_> {
    /// Returns the channel from the faults to the measurements, then the commands, with their constant weights.
    fn performance(&self, required: NormRequirement<'_>) -> Performance {
        let (m, p) = (self.b.ncols(), self.c.nrows());
        let mut feedthrough = DMatrix::zeros(p + m, m);
        feedthrough.view_mut((p, 0), (m, m)).fill_with_identity();
        let mut output = self.c.clone().resize_vertically(p + m, 0.0);
        for (row, weight) in required.channel.weights.iter().enumerate() {
            output.row_mut(row).scale_mut(weight.factor());
            feedthrough.row_mut(row).scale_mut(weight.factor());
        }
        let (disturbance, gamma) = (self.f_a.clone(), required.bound);
        Performance { disturbance, output, feedthrough, norm: Norm::HInfinity, gamma }
    }

    /// Returns the weights over frequency of measurements and commands; None if all weights are constant.
    fn weights(&self, required: NormRequirement<'_>) -> Result<Option<ChannelWeights>, Error> {
        let NormRequirement { channel, domain, .. } = required;
        if !channel.has_states() {
            return Ok(None);
        }
        let inputs = vec![Weight::constant(1.0); self.f_a.ncols()];
        let outputs: Vec<_> = channel.weights.iter().map(over_frequency).collect();
        let (input, output) = (diagonal(&inputs, domain)?, diagonal(&outputs, domain)?);
        Ok(Some(ChannelWeights { input, output }))
    }

    /// Computes a lower bound of the norm for all state feedbacks, also for state feedbacks that know the states of the
    /// weights; None if no bound is known, and above [`LARGEST_ORDER`] states.
    fn lower_bound(
        &self,
        performance: &Performance,
        weights: Option<&ChannelWeights>,
        domain: Domain,
    ) -> Result<Option<f64>, Error> {
        if self.a.nrows() > LARGEST_ORDER {
            return Ok(None);
        }
        let Some(weights) = weights else {
            return feedback_norm_lower_bound(self.a, self.b, performance, domain);
        };
        let dual = performance.transposed();
        let pair = (self.a.transpose(), self.b.transpose());
        let (a, c, performance) = weights.transposed().extend(&pair.0, &pair.1, &dual);
        observer_norm_lower_bound(&a, &c, &performance, domain)
    }

    /// Computes K of u = K x.
    pub(crate) fn by_norm(&self, required: NormRequirement<'_>) -> Result<GainResult, Refusal> {
        let domain = required.domain;
        let plain = NormRequirement { channel: &Channel::default(), ..required };
        let performance = self.performance(required);
        let weights = self.weights(required)?;
        let lower_bound = self.lower_bound(&performance, weights.as_ref(), domain)?;
        let search = Search {
            synthesise: &|region, performance| match performance.zip(weights.as_ref()) {
                None => lmi::state_feedback(self.a, self.b, region, performance, domain),
                Some((performance, weights)) => {
                    weights.state_feedback(self.a, self.b, region, performance, domain)
                }
            },
            weights: weights.as_ref(),
            system: &|gain, performance| {
                let a = self.a + self.b * gain;
                let c = &performance.output + &performance.feedthrough * gain;
                StateSpace::strictly_proper(a, performance.disturbance.clone(), c, domain)
            },
            performance,
            unweighted: self.performance(plain),
            required,
            filter: None,
            lower_bound: lower_bound.map(LowerBound::for_filters),
        };
        search.result("H-infinity norm from the faults to measurements and commands")
    }
}

/// Returns the weight if it depends on the frequency, else 1: constant weights are factors of the performance.
fn over_frequency(one: &ChannelWeight) -> Weight {
    match one.weight.as_constant() {
        None => one.weight.clone(),
        Some(_) => Weight::constant(1.0),
    }
}
