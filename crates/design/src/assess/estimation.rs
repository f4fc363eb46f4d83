//! The part of the report on the law that estimates the faults.

use control::estimation::mean_rate;
use control::response::{
    error_part, fault_rate_system, fault_system, frequency_response, peak_gain, settled_output,
    step_response,
};
use control::{Domain, Error, StateSpace};
use rayon::prelude::*;

use crate::assess::robustness::noise_peaks;
use crate::report::robustness::Robustness;
use crate::report::{Estimation, EstimationErrors};
use crate::solve::solution::Solution;
use plant_file::robustness::RobustnessLimits;

/// Relative width of the bracket at which the computation of a peak gain ends.
const WIDTH: f64 = 1e-3;
/// Relative band of the settling time.
const SETTLED: f64 = 0.02;
/// The frequency of the sinusoidal fault relative to the mean rate of the observer.
const SLOW: f64 = 0.1;

/// Returns the law of the estimates, its equations, parameters and conditions, with the errors of the estimates.
pub(crate) fn estimation(designed: &Solution, errors: Vec<EstimationErrors>) -> Estimation {
    let law = &designed.law;
    let sampled = designed.domain != Domain::Continuous;
    Estimation {
        law: law.law.name().to_owned(),
        sources: law.law.sources().to_owned(),
        equations: law.law.equations(sampled).iter().map(|&line| line.to_owned()).collect(),
        parameters: law.parameters.clone(),
        conditions: law.conditions.clone(),
        errors,
    }
}

/// Returns the errors of the estimate of each fault. The effect of noise is left out for a loop that is not stable,
/// where `robustness` is None.
pub(crate) fn errors(
    designed: &Solution,
    robustness: Option<&Robustness>,
    limits: &RobustnessLimits,
) -> Result<Vec<EstimationErrors>, Error> {
    let peaks = robustness.map(|_| noise_peaks(designed, &limits.noise)).transpose()?;
    let noise = robustness.map(|figures| {
        let commands = designed.linear.actuators.len();
        figures.noise_together[commands..].iter().map(|number| number.value).collect::<Vec<_>>()
    });
    let estimation = Errors::of(designed)?;
    let of = |list: &Option<Vec<f64>>, at: usize| list.as_ref().map(|list| list[at]);
    let faults = (0..designed.linear.faults.len()).into_par_iter();
    faults.map(|at| estimation.of_fault(at, of(&noise, at), of(&peaks, at))).collect()
}

/// The error dynamics, from the faults to the errors of their estimates.
struct Errors<'a> {
    designed: &'a Solution,
    of_faults: StateSpace,
    /// The error dynamics from the rates f' of the faults, per second.
    of_rates: StateSpace,
    frequency: f64,
}

impl<'a> Errors<'a> {
    fn of(designed: &'a Solution) -> Result<Self, Error> {
        let Solution { plant, gains, domain, .. } = designed;
        let mut of_rates = fault_rate_system(plant, gains, *domain)?;
        of_rates.b.scale_mut(domain.step());
        Ok(Self {
            of_faults: error_part(plant, &fault_system(plant, gains, *domain)?),
            of_rates: error_part(plant, &of_rates),
            frequency: SLOW * mean_rate(&designed.required_error_dynamics, *domain)?,
            designed,
        })
    }

    fn of_fault(
        &self,
        at: usize,
        noise: Option<f64>,
        noise_peak: Option<f64>,
    ) -> Result<EstimationErrors, Error> {
        let Solution { plant, extended, law, linear, .. } = self.designed;
        let (fault, channel) = (&linear.faults[at], extended.channels[at]);
        let row = 2 * plant.a.nrows() + channel.estimate;
        let of_fault = self.of_faults.path(row, channel.estimate);
        let step = step_response(&of_fault, 0)?;
        let transient = step.transient(0, SETTLED);
        // A ramp of f is a constant f', which a ramp model follows without lag.
        let ramp = match (law.leaks(), channel.rate) {
            (true, _) => None,
            (false, Some(_)) => Some(0.0),
            (false, None) => {
                Some(settled_output(&self.of_rates.path(row, channel.estimate), 0)?[0].abs())
            }
        };
        let point = frequency_response(&of_fault, &[self.frequency])?;
        let gain = peak_gain(&of_fault, WIDTH)?;
        Ok(EstimationErrors {
            fault: fault.name.clone(),
            unit: fault.unit.clone(),
            constant: step.final_value[0].abs(),
            step_settling: transient.settling_time,
            step_peak: transient.peak.abs(),
            ramp,
            sine: point[0].singular_values[0],
            sine_frequency: self.frequency,
            peak_gain: gain.upper[0],
            noise,
            noise_peak,
        })
    }
}
