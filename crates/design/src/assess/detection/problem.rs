//! The plant with noise and unknown inputs that the residuals are designed for.

use control::detection::{NoisyPlant, UnknownInput, detection_filter};
use control::eigen::eigenvalues;
use control::faults::{Fault, FaultEntry};
use control::{Domain, Error};
use nalgebra::{DMatrix, DVector};

use crate::report::number::{round, rounded};
use crate::solve::solution::Solution;
use plant_file::PlantFile;
use plant_file::detection::DetectionRequest;

/// Part of the required decay rate with which a filter counts as fast enough.
const NEARLY: f64 = 0.99;

/// The plant of the residuals, in the time domain of the controller.
pub(super) struct Problem {
    pub(super) plant: NoisyPlant,
    /// The unknown inputs: disturbances, then faults.
    pub(super) inputs: Vec<UnknownInput>,
    pub(super) names: Vec<String>,
    /// The sizes of the inputs; None for a disturbance without a bound.
    pub(super) sizes: Vec<Option<f64>>,
    disturbances: usize,
    /// The positions of the faults in `inputs`, counted from 0.
    pub(super) faults: std::ops::Range<usize>,
    /// The units of the faults.
    pub(super) units: Vec<Option<String>>,
    /// Time between two tests, s.
    pub(super) period: f64,
    /// Decay rate of the slowest eigenvalue under state feedback, 1/s, which the filter should reach.
    pub(super) rate: f64,
    pub(super) origin_of_process_noise: String,
}

impl Problem {
    pub(super) fn new(
        file: &PlantFile<'_>,
        request: &DetectionRequest,
        designed: &Solution,
    ) -> Result<Self, crate::Error> {
        let linear = &designed.linear;
        let refuse = |error: Error| file.error_at(&request.place, error.to_string());
        let n = linear.a.nrows();
        let of_fault = |model| unknown_input(model, &linear.b, &linear.c);
        let mut inputs = linear.disturbances.clone();
        inputs.extend(linear.models.iter().map(of_fault));
        let (mut a, mut b) = (linear.a.clone(), linear.b.clone());
        if let Domain::Sampled { period } = designed.domain {
            let columns: Vec<DVector<f64>> = b
                .column_iter()
                .map(DVector::from)
                .chain(inputs.iter().map(|input| input.on_states.clone()))
                .collect();
            let (phi, gamma) =
                linear.held(&DMatrix::from_columns(&columns), period).map_err(refuse)?;
            let m = b.ncols();
            (a, b) = (phi, gamma.columns(0, m).into_owned());
            for (input, column) in inputs.iter_mut().zip(gamma.column_iter().skip(m)) {
                input.on_states = column.into_owned();
            }
        }
        let rate = designed.slowest_rate().map_err(refuse)?;
        let period = match designed.domain {
            Domain::Sampled { period } => period,
            Domain::Continuous => request.sample_time.unwrap_or_else(|| round(0.1 / rate)),
        };
        let noise = DVector::from_column_slice(&request.noise);
        let disturbances = linear.disturbances.len();
        let bounds = file.disturbances.iter().map(|disturbance| disturbance.bound);
        let names = file.disturbances.iter().map(|disturbance| disturbance.name.clone());
        let mut problem = Self {
            plant: NoisyPlant {
                a,
                b,
                c: linear.c.clone(),
                w: DMatrix::zeros(n, n),
                v: DMatrix::from_diagonal(&noise.component_mul(&noise)),
                domain: designed.domain,
            },
            inputs,
            names: names.chain(linear.faults.iter().map(|fault| fault.name.clone())).collect(),
            sizes: bounds.chain(request.sizes.iter().copied().map(Some)).collect(),
            disturbances,
            faults: 0..linear.faults.len(),
            units: linear.faults.iter().map(|fault| fault.unit.clone()).collect(),
            period,
            rate,
            origin_of_process_noise: String::new(),
        };
        problem.set_process_noise(file, request)?;
        Ok(problem)
    }

    /// Returns the position of a fault among the inputs.
    pub(super) fn fault_at(&self, fault: usize) -> usize {
        self.disturbances + fault
    }

    /// Sets the stated process noise, or else the least one with which the filter without unknown inputs is as fast as
    /// the loop. Refuses a wrong number of stated values, and a plant for which no noise gives a filter.
    fn set_process_noise(
        &mut self,
        file: &PlantFile<'_>,
        request: &DetectionRequest,
    ) -> Result<(), crate::Error> {
        let n = self.plant.a.nrows();
        if let Some(stated) = &request.process_noise {
            let values = match stated.values.as_slice() {
                [one] if !stated.is_list => vec![*one; n],
                values if values.len() == n => values.to_vec(),
                values => {
                    let count = values.len();
                    let message = format!("expected {n} numbers, one per state, found {count}");
                    return Err(file.error_at(&stated.place, message).into());
                }
            };
            let noise = DVector::from_vec(values);
            self.plant.w = DMatrix::from_diagonal(&noise.component_mul(&noise));
            "The plant file states it.".clone_into(&mut self.origin_of_process_noise);
            return Ok(());
        }
        let least_noise = self.unit_process_noises().into_iter().find_map(|(source, unit)| {
            let factor = self.least_factor(&unit)?;
            Some((source, factor, unit * factor))
        });
        let Some((source, factor, noise)) = least_noise else {
            let message = "no process noise was found with which a filter exists: expected `process_noise`, \
                           one number for each state";
            return Err(file.error_at(&request.place, message).into());
        };
        self.plant.w = noise;
        self.origin_of_process_noise = if factor > 0.0 {
            format!(
                "The plant file states none. {source} that vary as noise, with {} times the variance of \
                 their sizes within one time constant of the loop, make the filter as fast as the loop. \
                 False alarms and delays are those under this noise; with less in the plant there are \
                 fewer false alarms, and with cumulative sums the mean delays are longer.",
                rounded(factor)
            )
        } else {
            "None: the filter is fast enough without.".to_owned()
        };
        Ok(())
    }

    /// Returns the least factor of `unit`, 0 or a power of 4, with which the filter without unknown inputs is as fast
    /// as the loop; if no factor suffices, the least factor with which it is nearly as fast as with any factor. None if
    /// no factor gives a filter.
    fn least_factor(&self, unit: &DMatrix<f64>) -> Option<f64> {
        let decay = |factor: f64| {
            let plant = NoisyPlant { w: unit * factor, ..self.plant.clone() };
            let filter = detection_filter(&plant, &[]).ok().flatten()?;
            self.decay(&filter.generator.a).ok()
        };
        let mut slower = Vec::new();
        for factor in std::iter::once(0.0).chain((-16..=12).map(|power| 4f64.powi(power))) {
            let Some(decay_rate) = decay(factor) else { continue };
            if decay_rate >= NEARLY * self.rate {
                return Some(factor);
            }
            slower.push((factor, decay_rate));
        }
        // More noise does not always make a filter faster: in sampled time its eigenvalues approach the zeros of the
        // plant.
        let fastest = slower.iter().map(|(_, decay_rate)| *decay_rate).fold(0.0, f64::max);
        let (factor, _) =
            slower.into_iter().find(|(_, decay_rate)| *decay_rate >= NEARLY * fastest)?;
        Some(factor)
    }

    /// Returns three process noises to try in turn, with their sources in words. Within a time constant of the loop
    /// they vary
    ///
    /// 1. each fault that acts on the states by its size;
    /// 2. also each command by one, as there may be no fault on the states, or a mode that does not decay gets no
    ///    noise;
    /// 3. also all states by the mean of these.
    fn unit_process_noises(&self) -> [(&'static str, DMatrix<f64>); 3] {
        let n = self.plant.a.nrows();
        let mut faults = DMatrix::zeros(n, n);
        for fault in self.faults.clone() {
            let at = self.fault_at(fault);
            let column = &self.inputs[at].on_states * self.sizes[at].unwrap_or(1.0);
            faults += &column * column.transpose();
        }
        let commands = &faults + &self.plant.b * self.plant.b.transpose();
        #[expect(clippy::cast_precision_loss, reason = "a matrix order is far below 2^52")]
        let mean = commands.trace() / n as f64;
        let states = &commands + DMatrix::from_diagonal_element(n, n, mean);
        let time = self.rate * self.plant.domain.step();
        [
            ("Faults", faults / time),
            ("Faults, and commands by one,", commands / time),
            ("Faults, commands by one, and all states by the mean of both,", states / time),
        ]
    }

    /// Returns the decay rate in 1/s of the slowest eigenvalue of a filter.
    pub(super) fn decay(&self, a: &DMatrix<f64>) -> Result<f64, Error> {
        let excess = eigenvalues(a)?.into_iter().map(|value| match self.plant.domain {
            Domain::Continuous => value.re,
            Domain::Sampled { period } => value.norm().max(f64::MIN_POSITIVE).ln() / period,
        });
        Ok(-excess.fold(f64::NEG_INFINITY, f64::max))
    }
}

/// Returns how a fault acts on the plant; a loss of effectiveness acts by the column of its command.
fn unknown_input(model: &Fault, b: &DMatrix<f64>, c: &DMatrix<f64>) -> UnknownInput {
    let (n, p) = (b.nrows(), c.nrows());
    let (mut on_states, mut on_measurements) = (DVector::zeros(n), DVector::zeros(p));
    match &model.entry {
        FaultEntry::Actuator(column) => on_states.copy_from(column),
        FaultEntry::Sensor(column) => on_measurements.copy_from(column),
        FaultEntry::Both { states, measurements } => {
            on_states.copy_from(states);
            on_measurements.copy_from(measurements);
        }
        FaultEntry::LossOfEffectiveness(at) => on_states.copy_from(&b.column(*at)),
        _ => {}
    }
    UnknownInput { on_states, on_measurements }
}
