//! The Kalman filter FMU: estimates the states and the faults of a plant whose FMU it carries in `resources/plant.fmu`,
//! as `resources/filter.toml` describes.
#![forbid(unsafe_code)]

mod carried;
mod held_mean;
mod variables;

use std::path::Path;
use std::sync::Arc;

use fmu::description::DefaultExperiment;
use fmu::{About, Experiment, Failure, Model, Step, Variable};
use serde::{Deserialize, Serialize};

use aso_controller::clock::Clock;
use aso_controller::kalman::KalmanDesign;
use carried::{Carrier, Estimate};
use control::nonlinear_filter::Transform;
use held_mean::HeldMean;

/// The value `extended` of the parameter `method`.
const EXTENDED: i32 = 1;
/// The value `unscented` of the parameter `method`.
const UNSCENTED: i32 = 2;

/// The filter; fields without a comment have the name of their variable.
#[derive(Clone, Serialize, Deserialize)]
pub struct KalmanFilter {
    /// What follows from the files of the FMU; `None` in a template, which has no files, and after a state was read
    /// from bytes until [`Model::complete`].
    #[serde(skip)]
    carrier: Option<Arc<Carrier>>,
    method: i32,
    integration_steps: i32,
    every: Vec<i32>,
    /// The initial estimates `x_hat_0` and `f_hat_0`, one after the other.
    initial: Vec<f64>,
    /// The estimates `x_hat` and `f_hat`, one after the other, with their covariance.
    estimate: Estimate,
    /// The standard deviations `x_deviation` and `f_deviation`, one after the other.
    deviations: Vec<f64>,
    innovation_squared: f64,
    /// The measurements, and their derivatives with respect to time.
    y: Vec<f64>,
    y_slopes: Vec<f64>,
    /// The measurements of the last sample.
    sampled: Vec<f64>,
    /// The commands, and their mean since the last sample.
    u: Vec<f64>,
    applied: HeldMean,
    clock: Clock,
}

impl KalmanFilter {
    /// The filter with the start values of its design; a template without variables if `carrier` is `None`.
    fn with(carrier: Option<Carrier>) -> Self {
        let design = carrier.as_ref().map(|carrier| &carrier.design);
        let of = |signals: &[aso_controller::design::Signal]| -> Vec<f64> {
            signals.iter().map(|signal| signal.operating.unwrap_or_default()).collect()
        };
        let mut initial = design.map_or(Vec::new(), |design| of(&design.states));
        initial.resize(initial.len() + design.map_or(0, KalmanDesign::fault_states), 0.0);
        let y = design.map_or(Vec::new(), |design| of(&design.measurements));
        let u = design.map_or(Vec::new(), |design| of(&design.commands));
        let mut filter = Self {
            method: EXTENDED,
            integration_steps: design.map_or(1, |design| design.integration_steps),
            estimate: Estimate { mean: initial.clone(), covariance: Vec::new() },
            deviations: vec![0.0; initial.len()],
            innovation_squared: 0.0,
            y_slopes: vec![0.0; y.len()],
            every: vec![1; y.len()],
            sampled: y.clone(),
            applied: HeldMean::of(u.len()),
            clock: Clock::new(design.map_or(1.0, |design| design.sample_time)),
            carrier: carrier.map(Arc::new),
            initial,
            y,
            u,
        };
        filter.reset_estimate();
        filter
    }

    /// Sets the estimate to the initial one, before sample 0. Does nothing in a template.
    fn reset_estimate(&mut self) {
        let Some(carrier) = &self.carrier else { return };
        self.estimate.mean.copy_from_slice(&self.initial);
        self.estimate.covariance.clone_from(&carrier.design.p.values);
        self.set_deviations();
        self.innovation_squared = 0.0;
    }

    /// Sets the standard deviations of the estimates from the covariance.
    fn set_deviations(&mut self) {
        let n = self.deviations.len();
        let variances = self.estimate.covariance.iter().step_by(n + 1);
        for (deviation, variance) in self.deviations.iter_mut().zip(variances) {
            *deviation = variance.clamp(0.0, f64::INFINITY).sqrt();
        }
    }

    /// Design and plant; an error in a template.
    fn carrier(&self) -> Result<Arc<Carrier>, Failure> {
        self.carrier.clone().ok_or_else(|| {
            Failure::Error(
                "this FMU is a template without a plant: `aso-ftc design PLANT.toml --kalman-fmu FILTER.fmu` writes a \
                 Kalman filter that carries one"
                    .to_owned(),
            )
        })
    }

    /// Corrects the estimate by sample `number` at `time`, with the measurements extrapolated by `offset`, both in s.
    fn correct(
        &mut self,
        carrier: &Carrier,
        [number, time, offset]: [f64; 3],
    ) -> Result<(), Failure> {
        for (sampled, (y, slope)) in self.sampled.iter_mut().zip(self.y.iter().zip(&self.y_slopes))
        {
            *sampled = y + slope * offset;
        }
        let transform = self.transform();
        let u = self.applied.mean(&self.u);
        let (y, every) = (&self.sampled, &self.every);
        let sample = carried::Sample { number, time, u, y, every, transform };
        self.innovation_squared = carrier.correct(&mut self.estimate, &sample)?;
        self.set_deviations();
        Ok(())
    }

    fn transform(&self) -> Transform {
        if self.method == UNSCENTED { Transform::Unscented } else { Transform::Extended }
    }
}

impl Model for KalmanFilter {
    const IDENTIFIER: &'static str = "KalmanFilter";

    fn about(&self) -> About {
        let design = self.carrier.as_ref().map(|carrier| &carrier.design);
        About {
            description: design.map_or_else(
                || "Template of Kalman filters that carry their plant".to_owned(),
                |design| design.description.clone(),
            ),
            default_experiment: DefaultExperiment {
                start_time: Some(0.0),
                stop_time: design.map(|design| design.stop_time),
                tolerance: None,
                step_size: design.map(|design| design.sample_time),
            },
            ..fmu::about!()
        }
    }

    fn new(resources: &Path) -> Result<Self, Failure> {
        Ok(Self::with(Carrier::read(resources)?))
    }

    fn variables(&self) -> Vec<Variable<Self>> {
        self.carrier.as_ref().map_or(Vec::new(), |carrier| variables::list(&carrier.design))
    }

    fn complete(&mut self, current: &Self) {
        self.carrier.clone_from(&current.carrier);
    }

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Failure> {
        let carrier = self.carrier()?;
        carrier.start(experiment.start_time)?;
        self.reset_estimate();
        // Sample 0 belongs to the initialisation.
        self.clock.start(experiment.start_time);
        self.clock.tick();
        self.applied.clear();
        self.correct(&carrier, [0.0, experiment.start_time, 0.0])
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        let carrier = self.carrier()?;
        // After an FMU state was set, the plant may be closed, or open for another start time.
        carrier.start(self.clock.first())?;
        let (mut from, transform) = (step.start, self.transform());
        while let Some(instant) = self.clock.next_until(step.end()) {
            self.applied.add(&self.u, instant - from);
            let prediction = carried::Prediction {
                time: self.clock.last_instant(),
                u: self.applied.mean(&self.u),
                steps: self.integration_steps,
                transform,
            };
            carrier.predict(&mut self.estimate, &prediction)?;
            let number = self.clock.number();
            self.correct(&carrier, [number, instant, instant - step.start])?;
            self.applied.clear();
            self.clock.tick();
            from = instant;
        }
        self.applied.add(&self.u, step.end() - from);
        Ok(())
    }
}

fmu::export!(KalmanFilter);

#[cfg(test)]
mod tests;
