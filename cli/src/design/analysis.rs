//! What is known of a design: the numbers of the report.

use control::aso::{FaultyPlant, Gains};
use control::eigen::eigenvalues;
use control::faults::{Entry, loss_tolerance};
use control::response::{
    self, Reversal, System, Transient, energy, fault_rate_system, fault_system, frequency_grid,
    frequency_response, h_infinity, peak_gain, reversal,
};
use control::sampled::Estimator;
use control::{Domain, Error};
use nalgebra::DMatrix;

use super::designed::{Designed, fault_names};
use super::plant_file::PlantFile;
use super::report::{Bound, Curve, Effectiveness, Frequency, Loop, Matrix, Norm, StepResponse};
use super::report::{pairs, rows};
use super::signals::Fault;

/// Relative width of the brackets of peak gains and norms.
const WIDTH: f64 = 1e-3;
/// A response has settled when it stays within this part of its largest distance.
const SETTLED: f64 = 0.02;
const POINTS_PER_DECADE: u32 = 20;

/// The outputs of the loop: states, errors of their estimates, errors of the faults' estimates.
pub(crate) struct Outputs {
    pub(crate) names: Vec<String>,
    pub(crate) units: Vec<Option<String>>,
    /// Positions in [x; e; eps] of those that the plant and the user know: no filters, no rates.
    positions: Vec<usize>,
}

impl Outputs {
    pub(crate) fn of(designed: &Designed) -> Self {
        let (all, states) = (designed.plant.a.nrows(), &designed.linear.states);
        let (mut names, mut units, mut positions) = (Vec::new(), Vec::new(), Vec::new());
        for (offset, prefix) in [(0, ""), (all, "error of ")] {
            for (at, state) in states.iter().enumerate() {
                names.push(format!("{prefix}{}", state.name));
                units.push(state.unit.clone());
                positions.push(offset + at);
            }
        }
        for (fault, channel) in designed.linear.faults.iter().zip(&designed.extended.channels) {
            names.push(format!("error of {}", fault.name));
            units.push(fault.unit.clone());
            positions.push(2 * all + channel.estimate);
        }
        Self { names, units, positions }
    }
}

/// The loop from the faults, and from their rates, to [x; e; eps].
pub(crate) struct Loops<'a> {
    designed: &'a Designed,
    outputs: Outputs,
    of_faults: System,
    of_rates: System,
}

impl<'a> Loops<'a> {
    pub(crate) fn of(designed: &'a Designed) -> Result<Self, Error> {
        let Designed { plant, gains, domain, estimator, .. } = designed;
        Ok(Self {
            designed,
            outputs: Outputs::of(designed),
            of_faults: fault_system(plant, gains, *domain, *estimator)?,
            of_rates: fault_rate_system(plant, gains, *domain, *estimator)?,
        })
    }

    fn faults(&self) -> impl Iterator<Item = (usize, &'a Fault)> + use<'a> {
        let designed = self.designed;
        let channels = designed.extended.channels.iter().map(|channel| channel.estimate);
        channels.zip(&designed.linear.faults)
    }

    /// Peak-to-peak gains from each fault to each output, and what follows from the stated bounds.
    pub(crate) fn bounds(&self) -> Result<Vec<Bound>, Error> {
        let jumping = peak_gain(&self.of_faults, WIDTH)?.upper;
        let gliding = peak_gain(&self.of_rates, WIDTH)?.upper;
        let q = self.designed.plant.f_a.ncols();
        let mut found = Vec::new();
        for (column, fault) in self.faults() {
            for (at, &row) in self.outputs.positions.iter().enumerate() {
                let (of_fault, of_rate) = (jumping[(row, column)], gliding[(row, column)]);
                let left = gliding[(row, q + column)];
                let constant = self.designed.extended.plant.a_f.row(column).amax() <= 0.0;
                let by_rate = match (fault.rate_bound, fault.bound) {
                    (Some(rate), Some(bound)) if constant => Some(of_rate * rate + left * bound),
                    _ => None,
                };
                let by_size = fault.bound.map(|bound| of_fault * bound);
                found.push(Bound {
                    fault: fault.name.clone(),
                    error: self.outputs.names[at].clone(),
                    unit: self.outputs.units[at].clone(),
                    gain_of_fault: of_fault,
                    gain_of_rate: of_rate,
                    bound: by_rate.into_iter().chain(by_size).reduce(f64::min),
                });
            }
        }
        Ok(found)
    }

    /// The responses to a sudden change of each fault.
    pub(crate) fn steps(&self) -> Result<Vec<StepResponse>, Error> {
        let response = |(column, fault): (usize, &Fault)| {
            let size = fault.step.or(fault.bound).unwrap_or(1.0);
            let mut curves = Vec::new();
            let trace = step_response(&self.of_faults, column)?;
            for (at, &row) in self.outputs.positions.iter().enumerate() {
                let Transient { peak, peak_time, settling_time, .. } =
                    trace.transient(row, SETTLED);
                curves.push(Curve {
                    name: self.outputs.names[at].clone(),
                    unit: self.outputs.units[at].clone(),
                    peak: size * peak,
                    peak_time,
                    settling_time,
                    times: trace.time.clone(),
                    values: trace.output.row(row).iter().map(|value| size * value).collect(),
                });
            }
            let (fault, unit) = (fault.name.clone(), fault.unit.clone());
            Ok(StepResponse { fault, unit, size, curves })
        };
        self.faults().map(response).collect()
    }

    /// Singular values from the faults to their estimates and to the errors.
    pub(crate) fn frequency(&self) -> Result<Vec<Frequency>, Error> {
        let q = self.designed.plant.f_a.ncols();
        let columns: Vec<_> = self.faults().map(|(column, _)| column).collect();
        let errors = self.outputs.of(&self.of_faults, &columns, self.designed);
        let mut estimates = errors.clone();
        // f_hat = eps + f.
        estimates.d += DMatrix::identity(columns.len(), columns.len());
        let rates = self.outputs.of(&self.of_rates, &columns, self.designed);
        debug_assert!(q >= columns.len());
        let grid = frequency_grid(&self.of_faults, POINTS_PER_DECADE)?;
        let curve = |name: &str, system: &System| {
            let points = frequency_response(system, &grid)?;
            let values = |k: usize| points.iter().map(|point| point.singular_values[k]).collect();
            Ok(Frequency {
                name: name.to_owned(),
                frequencies: grid.clone(),
                singular_values: (0..columns.len()).map(values).collect(),
            })
        };
        [
            curve("faults to their estimates", &estimates),
            curve("faults to the errors of their estimates", &errors),
            curve("rates of the faults to the errors of their estimates", &rates),
        ]
        .into_iter()
        .collect()
    }
}
