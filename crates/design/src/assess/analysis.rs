//! Computes the gains, norms and bounds of the estimation errors.

use control::response::{
    SampledLoop, energy, error_part, fault_gains, fault_rate_system, fault_system, frequency_grid,
    frequency_response, gains_between_samples, h_infinity,
};
use control::{Domain, Error, StateSpace};
use nalgebra::{DMatrix, RowDVector};
use rayon::prelude::*;

use crate::budget::Budget;
use crate::report::{Bound, Frequency, Norm};
use crate::solve::solution::Solution;
use plant_file::faults::Fault;

/// Relative width of the bracket at which the computation of a peak gain or a norm ends.
const WIDTH: f64 = 1e-3;
/// Number of equal parts of a sample time. A fault is constant over each part; the states are read at its start.
const PARTS: u32 = 16;
/// If the gain of what the commands leave of a fault is at most this part of the gain of the fault, it is a rounding
/// error, and nothing is left.
const NOTHING_LEFT: f64 = 1e-9;
const POINTS_PER_DECADE: u32 = 20;
/// Number of outputs that each thread computes between two checks of the time limit.
const OUTPUTS_AT_ONCE: usize = 64;

/// An output of the loop.
pub(crate) struct Output {
    pub(crate) name: String,
    pub(crate) unit: Option<String>,
    /// Position of the output among the outputs of a system.
    pub(crate) row: usize,
}

/// Returns the outputs of the loop: the states x, and the errors e = x - x_hat and eps = f_hat - f of the estimates.
/// The other rows of [x; e; eps] are states of filters and delays, and rates of faults.
pub(crate) fn outputs(designed: &Solution) -> Vec<Output> {
    let (all, states) = (designed.plant.a.nrows(), designed.linear.plant_states());
    let of_state = |first: usize, prefix: &'static str| {
        states.iter().enumerate().map(move |(at, state)| Output {
            name: format!("{prefix}{}", state.name),
            unit: state.unit.clone(),
            row: first + at,
        })
    };
    let faults = designed.linear.faults.iter().zip(&designed.extended.channels);
    let of_faults = faults.map(|(fault, channel)| Output {
        name: format!("error of {}", fault.name),
        unit: fault.unit.clone(),
        row: 2 * all + channel.estimate,
    });
    of_state(0, "").chain(of_state(all, "error of ")).chain(of_faults).collect()
}

/// Returns the H-infinity norm, and how it was computed. If the level sets do not converge, as with a zero of the whole
/// system at z = 1, the norm is the largest value on a grid of frequencies.
pub(crate) fn largest_gain(system: &StateSpace) -> Result<(f64, &'static str), Error> {
    match h_infinity(system, WIDTH) {
        Ok(norm) => Ok((norm.upper, "largest singular value over all frequencies (level sets)")),
        Err(Error::NotConverged { .. }) => {
            let grid = frequency_grid(system, POINTS_PER_DECADE)?;
            let points = frequency_response(system, &grid)?;
            let largest = points.iter().map(|point| point.singular_values[0]).fold(0.0, f64::max);
            Ok((largest, "largest singular value on a grid of frequencies"))
        }
        Err(error) => Err(error),
    }
}

/// Returns the singular values of `system` at `frequencies`.
pub(crate) fn frequency(
    name: String,
    system: &StateSpace,
    frequencies: Vec<f64>,
) -> Result<Frequency, Error> {
    let points = frequency_response(system, &frequencies)?;
    let values = |k: usize| points.iter().map(|point| point.singular_values[k]).collect();
    let singular_values = (0..system.d.nrows()).map(values).collect();
    Ok(Frequency { name, frequencies, singular_values })
}

/// Peak gains of one output from the faults, from the rates of the faults, and from the part of the faults that the
/// compensation leaves; 1 x q each.
type PeakGains = [RowDVector<f64>; 3];

/// Why an output has no peak gains.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Missing {
    /// The time for certificates and bounds was over.
    Time,
    /// The computation does not converge.
    Numerics,
}

/// Transfer functions to [x; e; eps] from the faults, and from the rates of the faults.
pub(crate) struct Loops<'a> {
    designed: &'a Solution,
    outputs: Vec<Output>,
    of_faults: StateSpace,
    of_rates: StateSpace,
}

impl<'a> Loops<'a> {
    pub(crate) fn of(designed: &'a Solution) -> Result<Self, Error> {
        let Solution { plant, gains, domain, .. } = designed;
        let mut of_rates = fault_rate_system(plant, gains, *domain)?;
        // The change of a fault per sample is its rate times the sample time.
        of_rates.b.columns_mut(0, plant.f_a.ncols()).scale_mut(domain.step());
        let of_faults = fault_system(plant, gains, *domain)?;
        Ok(Self { designed, outputs: outputs(designed), of_faults, of_rates })
    }

    fn faults(&self) -> impl Iterator<Item = (usize, &'a Fault)> + use<'a> {
        let designed = self.designed;
        let channels = designed.extended.channels.iter().map(|channel| channel.estimate);
        channels.zip(&designed.linear.faults)
    }

    /// Returns the peak-to-peak gains of each output. For a sampled loop the gains also bound the outputs between the
    /// samples, if the plant is known in continuous time.
    ///
    /// Order: errors of the faults, errors of the states, states. An output that is not reached within the time of
    /// `budget` is [`Missing::Time`].
    fn peak_gains(&self, budget: &Budget) -> Result<Vec<Result<PeakGains, Missing>>, Error> {
        let positions: Vec<_> = self.outputs.iter().map(|output| output.row).collect();
        let mut peaks = vec![Err(Missing::Time); positions.len()];
        // The errors do not depend on x: their system is smaller.
        let state_count = self.designed.linear.plant_states().len();
        let (of_states, of_errors) = peaks.split_at_mut(state_count);
        let (state_rows, error_rows) = positions.split_at(state_count);
        let mut batches: Vec<_> = [(of_errors, error_rows), (of_states, state_rows)]
            .into_iter()
            .flat_map(|(places, rows)| {
                places.rchunks_mut(OUTPUTS_AT_ONCE).zip(rows.rchunks(OUTPUTS_AT_ONCE))
            })
            .collect();
        for at_once in batches.chunks_mut(rayon::current_num_threads()) {
            if budget.is_over() {
                break;
            }
            at_once.par_iter_mut().try_for_each(|(places, rows)| {
                places.clone_from_slice(&self.gains_of(rows)?);
                Ok::<_, Error>(())
            })?;
        }
        Ok(peaks)
    }

    /// Returns the gains of the outputs at the positions `rows` in [x; e; eps]. If the common computation does not
    /// converge, each output is computed alone; an output that does not converge alone is [`Missing::Numerics`].
    fn gains_of(&self, rows: &[usize]) -> Result<Vec<Result<PeakGains, Missing>>, Error> {
        let Solution { extended, plant, gains, domain, .. } = self.designed;
        let peaks = match (extended.domain, *domain) {
            (Domain::Continuous, Domain::Sampled { period }) => {
                let sampled = SampledLoop { extended, plant, gains, period };
                gains_between_samples(&sampled, PARTS, rows, WIDTH)
            }
            (Domain::Continuous, Domain::Continuous) => {
                fault_gains(plant, gains, *domain, rows, WIDTH)
            }
            // The change of a fault per sample is its rate times the sample time.
            (Domain::Sampled { period }, _) => fault_gains(plant, gains, *domain, rows, WIDTH)
                .map(|[of_faults, of_rates, left]| [of_faults, of_rates * period, left]),
        };
        match peaks {
            Ok(all) => {
                let row = |row| all.each_ref().map(|gains| gains.row(row).into_owned());
                Ok((0..rows.len()).map(|at| Ok(row(at))).collect())
            }
            Err(Error::NotConverged { .. }) if rows.len() == 1 => Ok(vec![Err(Missing::Numerics)]),
            Err(Error::NotConverged { .. }) => {
                let alone = rows.iter().map(|row| self.gains_of(&[*row]));
                Ok(alone.collect::<Result<Vec<_>, _>>()?.concat())
            }
            Err(error) => Err(error),
        }
    }

    /// Returns the peak-to-peak gains from each fault to each output and the resulting bounds, and a warning for
    /// each reason why some outputs have none.
    pub(crate) fn bounds(&self, budget: &Budget) -> Result<(Vec<Bound>, Vec<String>), Error> {
        let gains = self.peak_gains(budget)?;
        let mut bounds = Vec::new();
        for (column, fault) in self.faults() {
            for (output, gains) in self.outputs.iter().zip(&gains) {
                let Ok([from_faults, from_rates, from_rest]) = gains else { continue };
                let of_fault = from_faults[column];
                // If a constant fault leaves a lasting error, the error has no bound by the rate of the fault.
                let leaks = self.designed.law.leaks();
                let of_rate = if leaks { f64::INFINITY } else { from_rates[column] };
                let left = from_rest[column];
                let constant = !leaks && self.designed.extended.plant.a_f.row(column).amax() <= 0.0;
                let by_rate = match (fault.rate_bound, fault.bound) {
                    (Some(rate), Some(bound)) if constant => Some(of_rate * rate + left * bound),
                    (Some(rate), None) if constant && left <= NOTHING_LEFT * of_fault => {
                        Some(of_rate * rate)
                    }
                    _ => None,
                };
                let by_size = fault.bound.map(|bound| of_fault * bound);
                bounds.push(Bound {
                    fault: fault.name.clone(),
                    error: output.name.clone(),
                    unit: output.unit.clone(),
                    gain_of_fault: of_fault,
                    gain_of_rate: of_rate,
                    largest: by_rate.into_iter().chain(by_size).reduce(f64::min),
                });
            }
        }
        let reasons = [
            (Missing::Time, format!("were {}", budget.reason())),
            (
                Missing::Numerics,
                "cannot be computed: the loop hardly contracts beside its fastest modes, or rounding \
                 errors grow in it, as with eigenvectors that are almost parallel"
                    .to_owned(),
            ),
        ];
        let warning = |(missing, reason): (Missing, String)| {
            let count = gains.iter().filter(|gains| gains.as_ref().err() == Some(&missing)).count();
            (count > 0).then(|| format!("the bounds of {count} states and errors {reason}"))
        };
        Ok((bounds, reasons.into_iter().filter_map(warning).collect()))
    }

    /// Returns the part of `system` from its inputs, the faults or their rates, to the errors of their estimates.
    fn to_fault_errors(&self, system: &StateSpace) -> StateSpace {
        let channels = &self.designed.extended.channels;
        let columns: Vec<_> = channels.iter().map(|channel| channel.estimate).collect();
        let all = self.designed.plant.a.nrows();
        let rows: Vec<_> = columns.iter().map(|column| 2 * all + column).collect();
        StateSpace {
            a: system.a.clone(),
            b: system.b.select_columns(&columns),
            c: system.c.select_rows(&rows),
            d: system.d.select_rows(&rows).select_columns(&columns),
            domain: system.domain,
        }
    }

    /// Returns the singular values from the faults to their estimates and to the estimation errors, and from the rates
    /// of the faults to the estimation errors unless a constant fault leaves a lasting error.
    pub(crate) fn frequency(&self) -> Result<Vec<Frequency>, Error> {
        let errors = self.to_fault_errors(&self.of_faults);
        let mut estimates = errors.clone();
        estimates.d += DMatrix::identity(errors.d.nrows(), errors.d.ncols());
        let rates = self.to_fault_errors(&self.of_rates);
        let grid = frequency_grid(&self.of_faults, POINTS_PER_DECADE)?;
        let curve = |name: &str, system| self::frequency(name.to_owned(), system, grid.clone());
        let mut curves = vec![
            curve("faults to their estimates", &estimates)?,
            curve("faults to the errors of their estimates", &errors)?,
        ];
        if !self.designed.law.leaks() {
            curves.push(curve("rates of the faults to the errors of their estimates", &rates)?);
        }
        Ok(curves)
    }

    /// Returns the norms from the rates of the faults to the estimation errors; none if a constant fault leaves a
    /// lasting error.
    pub(crate) fn norms(&self) -> Result<Vec<Norm>, Error> {
        if self.designed.law.leaks() {
            return Ok(Vec::new());
        }
        let rates = error_part(&self.designed.plant, &self.to_fault_errors(&self.of_rates));
        let norm = |name: &str, value: f64, method: &str| Norm {
            name: name.to_owned(),
            from: "rates of the faults".to_owned(),
            to: "errors of their estimates".to_owned(),
            value,
            method: method.to_owned(),
        };
        let (largest, method) = largest_gain(&rates)?;
        let energies = energy(&rates)?;
        // The energy of a rate is an integral over time, that of a sequence the sum over the samples.
        let root = self.designed.domain.step().sqrt();
        let (peak, h2) = (energies.peak / root, energies.h2 / root);
        Ok(vec![
            norm("H-infinity", largest, method),
            norm("generalised H2", peak, "peak for a rate of unit energy (Lyapunov)"),
            norm("H2", h2, "covariance under white noise (Lyapunov)"),
        ])
    }
}
