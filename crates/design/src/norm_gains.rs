//! Gains by the H-infinity norm: the channel that the plant file weights, and the judgement of the
//! result.

use control::aso::Estimator;
use control::eigen::eigenvalues;
use control::faults::FaultChannel;
use control::lmi::{self, Norm, Outcome, Performance, Synthesis};
use control::response::h_infinity;
use control::riccati::{NormFilterProblem, kalman, norm_filter};
use control::{Domain, Error, StateSpace};
use nalgebra::DMatrix;

use super::gains::{FeedbackProblem, GainResult, Refusal, synthesised};
use super::requirements::{Channel, Region};

/// Relative width of a norm.
const WIDTH: f64 = 1e-4;
/// Largest order for which the norm without the region is computed.
const LARGEST_ORDER: usize = 30;

/// Ratio of the bounds between which the least norm of any filter is searched, and at which the search
/// ends.
const RANGE: f64 = 1e6;
const NARROW: f64 = 1.02;
/// The bound for which a filter is designed, relative to the least one: the gain grows without limit
/// towards that.
const RELAXED: f64 = 1.1;

/// The pair of the augmented observer and what its channel needs.
pub(crate) struct ObserverProblem<'a> {
    /// `A_0`.
    pub(crate) a_0: &'a DMatrix<f64>,
    /// `C_0`.
    pub(crate) c_0: &'a DMatrix<f64>,
    /// The estimates of each fault among the last states.
    pub(crate) channels: &'a [FaultChannel],
    /// Number of states of the fault models, the last states.
    pub(crate) faults: usize,
    /// Coefficients of the measurement filter, whose states come before those of the faults.
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
}

impl ObserverProblem<'_> {
    /// The channel from [rates of the faults; noise] to the weighted errors of the estimates, for the
    /// error dynamics A - L C with C = `C_0`, or `C_0` `A_0` for a current estimator:
    ///
    /// ```text
    /// x' = (A - L C) x + (B - L D_y) [rates; noise],  z = W E x
    /// ```
    ///
    /// Without a measurement filter the noise enters through `D_y`, with one through the filter's
    /// states. A current estimator corrects with the newest measurement: `D_y` then has `C_0` B, too.
    /// In sampled time a rate acts for one period.
    fn performance(&self, required: NormRequirement<'_>, domain: Domain) -> Performance {
        let (order, p, q) = (self.a_0.nrows(), self.c_0.nrows(), self.faults);
        let noises = required.channel.noise.len();
        let mut disturbance = DMatrix::zeros(order, q + noises);
        let period = if let Domain::Sampled { period } = domain { period } else { 1.0 };
        disturbance.view_mut((order - q, 0), (q, q)).fill_diagonal(period);
        let mut feedthrough = DMatrix::zeros(p, q + noises);
        for (at, noise) in required.channel.noise.iter().enumerate() {
            match self.filter {
                Some(filter) => disturbance[(order - q - p + at, q + at)] = filter[at] * noise,
                None => feedthrough[(at, q + at)] = *noise,
            }
        }
        if self.estimator == Estimator::Current {
            feedthrough += self.c_0 * &disturbance;
        }
        let mut output = DMatrix::zeros(q, order);
        output.columns_mut(order - q, q).fill_with_identity();
        for (channel, weight) in self.channels.iter().zip(&required.channel.weights) {
            for row in [Some(channel.estimate), channel.rate].into_iter().flatten() {
                output.row_mut(row).scale_mut(*weight);
            }
        }
        let gamma = required.bound;
        Performance { disturbance, output, feedthrough, norm: Norm::HInfinity, gamma }
    }

    /// Computes the filter for the bound, or for the least bound that any filter reaches; regions do
    /// not matter. Only in continuous time with noise on each unfiltered measurement.
    fn riccati(
        &self,
        required: NormRequirement<'_>,
        domain: Domain,
    ) -> Result<Option<Filter>, Error> {
        let noise = &required.channel.noise;
        let unsuitable =
            noise.is_empty() || self.filter.is_some() || self.a_0.nrows() > LARGEST_ORDER;
        if domain != Domain::Continuous || unsuitable {
            return Ok(None);
        }
        let squares = noise.iter().map(|one| one * one).collect::<Vec<_>>();
        let given = self.performance(required, domain);
        let rates = given.disturbance.columns(0, self.faults).into_owned();
        let problem = NormFilterProblem {
            a: self.a_0,
            c: self.c_0,
            disturbance: &rates,
            noise: &DMatrix::from_diagonal(&squares.into()),
            output: &given.output,
        };
        // A plant with a mode at rest that no fault excites has no such filter.
        let solve = |gamma| norm_filter(&problem, gamma).unwrap_or(None);
        if let Some(bound) = required.bound {
            return Ok(solve(bound).map(|gain| Filter { gain, least: None }));
        }
        let process = &rates * rates.transpose();
        let Ok(kalman) = kalman(self.a_0, self.c_0, &process, problem.noise, domain) else {
            return Ok(None);
        };
        let start = kalman.gain;
        let system = StateSpace {
            a: self.a_0 - &start * self.c_0,
            b: &given.disturbance - &start * &given.feedthrough,
            c: given.output.clone(),
            d: DMatrix::zeros(given.output.nrows(), given.disturbance.ncols()),
            domain,
        };
        let mut high = h_infinity(&system, WIDTH)?.upper * RELAXED;
        let mut low = high / RANGE;
        while high > NARROW * low {
            let middle = (low * high).sqrt();
            match solve(middle) {
                Some(_) => high = middle,
                None => low = middle,
            }
        }
        Ok(solve(RELAXED * high).map(|gain| Filter { gain, least: Some(high) }))
    }

    /// Computes L; for a current estimator the gain of the correction.
    pub(crate) fn by_norm(
        &self,
        required: NormRequirement<'_>,
        domain: Domain,
    ) -> Result<GainResult, Refusal> {
        let seen = self.estimator.output_matrix(self.a_0, self.c_0);
        let plain = NormRequirement { channel: &Channel::default(), ..required };
        let unweighted = self.performance(plain, domain);
        let search = Search {
            synthesise: &|region, performance| {
                lmi::observer_gain(self.a_0, &seen, region, performance, domain)
            },
            system: &|gain, given| StateSpace {
                a: self.a_0 - gain * &seen,
                b: &given.disturbance - gain * &given.feedthrough,
                c: given.output.clone(),
                d: DMatrix::zeros(given.output.nrows(), given.disturbance.ncols()),
                domain,
            },
            performance: self.performance(required, domain),
            unweighted,
            required,
            domain,
            filter: self.riccati(required, domain)?,
        };
        let noise = if required.channel.noise.is_empty() { "" } else { " and measurement noise" };
        search.result(&format!(
            "H-infinity norm from the faults' rates{noise} to the errors of their estimates"
        ))
    }
}

impl FeedbackProblem<'_> {
    /// The channel from the faults to the weighted measurements and commands.
    fn performance(&self, required: NormRequirement<'_>) -> Performance {
        let (m, p) = (self.b.ncols(), self.c.nrows());
        let mut feedthrough = DMatrix::zeros(p + m, m);
        feedthrough.view_mut((p, 0), (m, m)).fill_with_identity();
        let mut output = self.c.clone().resize_vertically(p + m, 0.0);
        for (row, weight) in required.channel.weights.iter().enumerate() {
            output.row_mut(row).scale_mut(*weight);
            feedthrough.row_mut(row).scale_mut(*weight);
        }
        let (disturbance, gamma) = (self.f_a.clone(), required.bound);
        Performance { disturbance, output, feedthrough, norm: Norm::HInfinity, gamma }
    }

    /// Computes K of u = K x.
    pub(crate) fn by_norm(
        &self,
        required: NormRequirement<'_>,
        domain: Domain,
    ) -> Result<GainResult, Refusal> {
        let plain = NormRequirement { channel: &Channel::default(), ..required };
        let search = Search {
            synthesise: &|region, performance| {
                lmi::state_feedback(self.a, self.b, region, performance, domain)
            },
            system: &|gain, given| StateSpace {
                a: self.a + self.b * gain,
                b: given.disturbance.clone(),
                c: &given.output + &given.feedthrough * gain,
                d: DMatrix::zeros(given.output.nrows(), given.disturbance.ncols()),
                domain,
            },
            performance: self.performance(required),
            unweighted: self.performance(plain),
            required,
            domain,
            filter: None,
        };
        search.result("H-infinity norm from the faults to measurements and commands")
    }
}

/// Computes a gain for a region and, if given, a performance.
type Synthesise<'a> =
    dyn Fn(&lmi::Region, Option<&Performance>) -> Result<Outcome<Synthesis>, Error> + 'a;

/// The search for a gain by its norm, the same for observer and feedback.
struct Search<'a> {
    synthesise: &'a Synthesise<'a>,
    /// The closed loop of a gain, from w to z of a performance.
    system: &'a dyn Fn(&DMatrix<f64>, &Performance) -> StateSpace,
    performance: Performance,
    /// The performance without weights and noise.
    unweighted: Performance,
    required: NormRequirement<'a>,
    domain: Domain,
    /// The filter by a Riccati equation.
    filter: Option<Filter>,
}

/// A gain by the Riccati equation of the H-infinity filter.
struct Filter {
    gain: DMatrix<f64>,
    /// The least bound for which a filter was found.
    least: Option<f64>,
}

impl Search<'_> {
    fn norm(&self, gain: &DMatrix<f64>, performance: &Performance) -> Result<f64, Error> {
        Ok(h_infinity(&(self.system)(gain, performance), WIDTH)?.upper)
    }

    /// Returns the gain, with a sentence that compares its norm with the bounds.
    ///
    /// For the least norm the gain for the region alone is computed, too, and the better one is
    /// chosen: one Lyapunov matrix for norm and region is sufficient, not necessary. A filter by the
    /// Riccati equation is used if its eigenvalues are in the region and its norm keeps the bound.
    fn result(&self, name: &str) -> Result<GainResult, Refusal> {
        if let Some(filter) = &self.filter
            && self.usable(&filter.gain)?
        {
            return self.filtered(filter, name);
        }
        let region = self.required.region.stated();
        let mut chosen = synthesised((self.synthesise)(&region, Some(&self.performance))?, name)?;
        let mut norm = self.norm(&chosen.gain, &self.performance)?;
        let mut remarks = Vec::new();
        if self.required.bound.is_none() {
            remarks.push(LEAST.to_owned());
            if let Outcome::Optimal(plain) = (self.synthesise)(&region, None)? {
                let other = self.norm(&plain.gain, &self.performance)?;
                remarks.push(format!(
                    "The inequalities for norm and region gave a norm of {norm:.4e}, those for the region \
                     alone {other:.4e}; the smaller one is used."
                ));
                if other < norm {
                    (chosen.gain, norm) = (plain.gain, other);
                    let margin = plain.region.margin;
                    chosen.method = format!("{name}; region verified with margin {margin:.1e}.");
                }
            }
            remarks.extend(self.without_region()?);
        }
        let figures = self.figures(&chosen.gain, norm)?;
        chosen.method = format!("{} {figures} {}", chosen.method, remarks.join(" "));
        chosen.method.truncate(chosen.method.trim_end().len());
        Ok(chosen)
    }

    /// Whether the eigenvalues with a gain are in the region and its norm keeps the bound.
    fn usable(&self, gain: &DMatrix<f64>) -> Result<bool, Error> {
        let all = eigenvalues(&(self.system)(gain, &self.performance).a)?;
        let inside = |value| self.required.region.contains(value, self.domain);
        let bound = self.required.bound.unwrap_or(f64::INFINITY);
        Ok(all.into_iter().all(inside) && self.norm(gain, &self.performance)? <= bound)
    }

    fn filtered(&self, filter: &Filter, name: &str) -> Result<GainResult, Refusal> {
        let norm = self.norm(&filter.gain, &self.performance)?;
        let figures = self.figures(&filter.gain, norm)?;
        let least = filter.least.map_or(String::new(), |least| {
            let above = 100.0 * (norm / least - 1.0);
            format!(
                " The least norm of any gain is about {least:.4e} (up to 5 % too large); this one is \
                 {above:.0} % above, as gains grow without limit towards the least."
            )
        });
        let method = format!("{name}, by the Riccati equation of the filter. {figures}{least}");
        let gain = filter.gain.clone();
        Ok(GainResult { gain, method, required: Vec::new(), quality: None })
    }

    fn figures(&self, gain: &DMatrix<f64>, norm: f64) -> Result<String, Error> {
        let (plain, size) = (self.plain_norm(gain)?, gain.norm());
        Ok(format!("Norm {norm:.4e}{plain}; Frobenius norm of the gain {size:.4e}."))
    }

    /// Says what the norm is without weights and noise, if there are any.
    fn plain_norm(&self, gain: &DMatrix<f64>) -> Result<String, Error> {
        if self.performance == self.unweighted {
            return Ok(String::new());
        }
        let plain = self.norm(gain, &self.unweighted)?;
        Ok(format!(" with weights and noise, {plain:.4e} without"))
    }

    /// Says what norm a gain reaches that need not keep the region.
    fn without_region(&self) -> Result<Option<String>, Error> {
        let order = self.performance.output.ncols();
        if self.required.region == Region::default() || order > LARGEST_ORDER {
            return Ok(None);
        }
        let gain = if let Some(filter) = &self.filter {
            filter.gain.clone()
        } else {
            let found = (self.synthesise)(&lmi::Region::default(), Some(&self.performance))?;
            let Outcome::Optimal(found) = found else { return Ok(None) };
            found.gain
        };
        let (norm, size) = (self.norm(&gain, &self.performance)?, gain.norm());
        Ok(Some(format!(
            "Without the region, a gain with the norm {norm:.4e} exists; the Frobenius norm of that gain \
             is {size:.4e}."
        )))
    }
}

/// What "least" means: with a region the inequalities are sufficient, not necessary.
const LEAST: &str = "Least certified: the inequalities are solved 5 % above the least bound that one \
                     Lyapunov matrix proves for norm and region together; a gain with a smaller norm in \
                     this region may exist.";
