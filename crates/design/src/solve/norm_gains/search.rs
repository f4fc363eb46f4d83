//! The search for a gain by its H-infinity norm, and the judgement of the result.

use control::eigen::eigenvalues;
use control::lmi::{self, ChannelWeights, Norm, Outcome, Performance, Synthesis, certify_gain};
use control::response::h_infinity;
use control::{Domain, Error, StateSpace};
use nalgebra::DMatrix;

use crate::report::{LowerBoundFor, NormReport, NormWeight};
use crate::solve::gain::{GainResult, Refusal, synthesised, unique};
use crate::solve::norm_gains::NormRequirement;
use plant_file::channel::{Channel, ChannelWeight};
use plant_file::requirements::Region;

/// Relative accuracy with which the H-infinity norm of a loop is computed.
pub(crate) const WIDTH: f64 = 1e-4;
/// Largest number of states for which bounds are proven and the norm without the region is computed.
pub(crate) const LARGEST_ORDER: usize = 30;
/// A bound that is larger than the norm by more than this factor is not stated.
const LOOSE: f64 = 1.01;

/// Computes a gain for a region and, if given, a performance.
pub(crate) type Synthesise<'a> =
    dyn Fn(&lmi::Region, Option<&Performance>) -> Result<Outcome<Synthesis>, Error> + 'a;

/// The search for a gain by its norm, the same for observer and feedback.
pub(crate) struct Search<'a> {
    pub(crate) synthesise: &'a Synthesise<'a>,
    /// Returns the closed loop with a gain, from the inputs w to the outputs z of a performance.
    pub(crate) system: &'a dyn Fn(&DMatrix<f64>, &Performance) -> StateSpace,
    pub(crate) performance: Performance,
    /// The weights over frequency.
    pub(crate) weights: Option<&'a ChannelWeights>,
    /// The performance without weights and noise.
    pub(crate) unweighted: Performance,
    pub(crate) required: NormRequirement<'a>,
    /// The gain by the Riccati equation of the filter, if there is one.
    pub(crate) filter: Option<DMatrix<f64>>,
    /// A lower bound of the norm for all gains.
    pub(crate) lower_bound: Option<LowerBound>,
}

/// A proven lower bound of the norm.
#[derive(Clone, Copy)]
pub(crate) struct LowerBound {
    pub(crate) norm: f64,
    pub(crate) holds_for: LowerBoundFor,
}

impl LowerBound {
    pub(crate) fn for_filters(norm: f64) -> Self {
        Self { norm, holds_for: LowerBoundFor::Filters }
    }
}

impl Search<'_> {
    /// Returns the closed loop of a gain with weights.
    fn weighted(&self, gain: &DMatrix<f64>) -> StateSpace {
        let system = (self.system)(gain, &self.performance);
        self.weights.map_or_else(|| system.clone(), |weights| weights.around(&system))
    }

    fn weighted_norm(&self, gain: &DMatrix<f64>) -> Result<f64, Error> {
        Ok(h_infinity(&self.weighted(gain), WIDTH)?.upper)
    }

    /// Returns the gain with its norm and bounds of it.
    ///
    /// A filter by the Riccati equation is used if its eigenvalues are in the region and its norm keeps the bound,
    /// otherwise a gain by linear matrix inequalities.
    ///
    /// # Errors
    ///
    /// The required bound is below the lower bound; the requirements contradict each other; a numerical method failed.
    pub(crate) fn result(&self, channel: &str) -> Result<GainResult, Refusal> {
        if let (Some(bound), Some(least)) = (self.required.bound, self.lower_bound)
            && least.norm > bound
        {
            let which = match least.holds_for {
                LowerBoundFor::Filters => {
                    "no gain keeps this bound, nor does a filter of any order"
                }
                LowerBoundFor::Disc => "no gain with all eigenvalues in the disc keeps this bound",
            };
            return Err(Refusal::Conflict(format!(
                "{which}: expected a bound above {:.4e}, which is a proven lower bound of the {channel}",
                least.norm
            )));
        }
        let mut chosen = match &self.filter {
            Some(gain) if self.is_usable(gain)? => {
                let method = format!("{channel}, by the Riccati equation of the filter.");
                unique(gain.clone(), method)
            }
            _ => self.by_inequalities(channel)?,
        };
        let report = self.report(&chosen.gain, channel)?;
        chosen.method = format!("{} {}", chosen.method, sentence(&report));
        chosen.norm = Some(report);
        Ok(chosen)
    }

    /// Computes the gain by linear matrix inequalities.
    ///
    /// For the least norm with constant weights the gain for the region alone is computed, too, and the one with the
    /// smaller norm is used: one Lyapunov matrix for norm and region is sufficient, not necessary.
    fn by_inequalities(&self, channel: &str) -> Result<GainResult, Refusal> {
        let region = self.required.region.stated();
        let outcome = (self.synthesise)(&region, Some(&self.performance))?;
        let mut chosen = synthesised(outcome, channel)?;
        if self.required.bound.is_some() {
            return Ok(chosen);
        }
        if self.weights.is_some() {
            chosen.method = format!("{} {LOCAL}", chosen.method);
            return Ok(chosen);
        }
        let mut remarks = Vec::new();
        if let Outcome::Optimal(plain) = (self.synthesise)(&region, None)? {
            let norm = self.weighted_norm(&chosen.gain)?;
            let other = self.weighted_norm(&plain.gain)?;
            remarks.push(format!(
                "The inequalities for norm and region gave a norm of {norm:.4e}, those for the region \
                 alone {other:.4e}; the smaller one is used."
            ));
            if other < norm {
                let margin = plain.region.margin;
                chosen.gain = plain.gain;
                chosen.method = format!("{channel}; region verified with margin {margin:.1e}.");
            }
        }
        remarks.extend(self.without_region()?);
        chosen.method = format!("{} {LEAST} {}", chosen.method, remarks.join(" "));
        chosen.method.truncate(chosen.method.trim_end().len());
        Ok(chosen)
    }

    /// Whether the loop of a gain has all eigenvalues in the region and a norm of at most the required bound.
    fn is_usable(&self, gain: &DMatrix<f64>) -> Result<bool, Error> {
        let all = eigenvalues(&(self.system)(gain, &self.performance).a)?;
        let inside = |value| self.required.region.contains(value, self.required.domain);
        let bound = self.required.bound.unwrap_or(f64::INFINITY);
        Ok(all.into_iter().all(inside) && self.weighted_norm(gain)? <= bound)
    }

    /// Computes the norm of the loop with a gain, and bounds of it.
    fn report(&self, gain: &DMatrix<f64>, channel: &str) -> Result<NormReport, Error> {
        let system = self.weighted(gain);
        let norm = h_infinity(&system, WIDTH)?.upper;
        let certified = if system.a.nrows() > LARGEST_ORDER {
            None
        } else {
            let bound = certify_gain(&system, Norm::HInfinity)?.optimal();
            bound.map(|bound| bound.gamma).filter(|gamma| *gamma <= LOOSE * norm)
        };
        let plain = self.weights.is_none() && self.performance == self.unweighted;
        let unweighted = || {
            let system = (self.system)(gain, &self.unweighted);
            Ok::<_, Error>(h_infinity(&system, WIDTH)?.upper)
        };
        let positive = self.lower_bound.filter(|least| least.norm > 0.0);
        Ok(NormReport {
            channel: channel.to_owned(),
            norm,
            certified,
            lower_bound: self.lower_bound.map(|least| least.norm),
            lower_bound_for: self.lower_bound.map(|least| least.holds_for),
            gap: positive.map(|least| norm / least.norm - 1.0),
            unweighted: if plain { None } else { Some(unweighted()?) },
            gain: gain.norm(),
            weights: weights_over_frequency(self.required.channel, self.required.domain),
        })
    }

    /// Returns a sentence about the norm of a gain that ignores the region; None without a region, above
    /// [`LARGEST_ORDER`] states, and if no gain is found.
    fn without_region(&self) -> Result<Option<String>, Error> {
        let order = self.performance.output.ncols();
        if self.required.region == Region::default() || order > LARGEST_ORDER {
            return Ok(None);
        }
        let gain = if let Some(filter) = &self.filter {
            filter.clone()
        } else {
            let outcome = (self.synthesise)(&lmi::Region::default(), Some(&self.performance))?;
            let Outcome::Optimal(synthesis) = outcome else { return Ok(None) };
            synthesis.gain
        };
        let (norm, size) = (self.weighted_norm(&gain)?, gain.norm());
        Ok(Some(format!(
            "Without the region, a gain with the norm {norm:.4e} exists; the Frobenius norm of that gain \
             is {size:.4e}."
        )))
    }
}

/// Returns the weights over frequency, for the report.
fn weights_over_frequency(channel: &Channel, domain: Domain) -> Vec<NormWeight> {
    let over_frequency = channel.all().filter(|one| one.weight.as_constant().is_none());
    let reported = |ChannelWeight { signal, weight, deviation }: &ChannelWeight| {
        let (numerator, denominator) = weight.polynomials(domain);
        let (signal, table_deviation) = (signal.clone(), *deviation);
        NormWeight { signal, numerator, denominator, table_deviation }
    };
    over_frequency.map(reported).collect()
}

/// Returns the norm and its bounds in words.
fn sentence(report: &NormReport) -> String {
    let NormReport { norm, unweighted, gain, lower_bound, lower_bound_for, gap, .. } = report;
    let plain = unweighted
        .map_or(String::new(), |plain| format!(" with weights and noise, {plain:.4e} without"));
    let which = match lower_bound_for {
        Some(LowerBoundFor::Disc) => "No gain with all eigenvalues in the disc",
        _ => "No gain and no filter of any order",
    };
    let bound = match (lower_bound, gap) {
        (Some(least), Some(gap)) => {
            let percent = 100.0 * gap;
            format!("{which} has a norm below {least:.4e}: the gap is {percent:.2} %.")
        }
        (Some(_), None) => {
            "The measurements have no noise, and there is no lower bound above 0: ever \
                            larger gains lower the norm without end."
                .to_owned()
        }
        (None, _) => "A lower bound is not known.".to_owned(),
    };
    let fit = |NormWeight { signal, table_deviation, .. }: &NormWeight| {
        let decibels = 20.0 * table_deviation.as_ref()?.log10();
        Some(format!(" The weight of {signal} is within {decibels:.2} dB of its table."))
    };
    let fits: String = report.weights.iter().filter_map(fit).collect();
    format!("Norm {norm:.4e}{plain}; Frobenius norm of the gain {gain:.4e}. {bound}{fits}")
}

/// Meaning of "least" for constant weights: with a region the inequalities are sufficient, not necessary.
const LEAST: &str = "Least certified: the inequalities are solved 5 % above the least bound that one \
                     Lyapunov matrix proves for norm and region together; a gain with a smaller norm in \
                     this region may exist.";

/// Meaning of "least" for weights over frequency.
const LOCAL: &str = "Least found: from gains by linear matrix inequalities and by the Kalman filter on, the \
                     norm was lowered over the entries of the gain to a local minimum; a gain with a \
                     smaller norm in this region may exist.";
