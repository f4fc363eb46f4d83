//! The controller as a model: fields, initialisation and steps.

use std::path::Path;

use fmi2::description::DefaultExperiment;
use fmi2::{About, Experiment, Failure, Model, Step, Variable};
use serde::{Deserialize, Serialize};

use crate::design::Design;
use crate::observer::{Measurement, Observer};
use crate::variables;

/// A fault-tolerant controller with an augmented state observer; any linear plant, any sizes.
///
/// z = [x_hat; f_hat] is `estimate`; everything else carries the name of its FMI variable.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct AsoController {
    pub(crate) design: Design,
    pub(crate) x_hat_0: Vec<f64>,
    pub(crate) f_hat_0: Vec<f64>,
    pub(crate) measurements: Vec<f64>,
    pub(crate) measurement_slopes: Vec<f64>,
    pub(crate) compensate: bool,
    pub(crate) estimate: Vec<f64>,
    pub(crate) estimate_slopes: Vec<f64>,
    pub(crate) u: Vec<f64>,
    pub(crate) u_slopes: Vec<f64>,
    /// Whether f_hat is part of the command u: decided at the begin and at each end of a step.
    active: bool,
    /// Follows from `design`; made anew where an instance starts or is read from bytes.
    #[serde(skip)]
    observer: Option<Observer>,
}

impl AsoController {
    /// Whether f_hat is part of the command at `time`.
    fn compensating(&self, time: f64) -> bool {
        self.compensate && time >= self.design.t_on - clock_rounding(time)
    }

    /// The limits of each channel; infinite where the design states none.
    fn limits(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        const NONE: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];
        self.design.actuators.iter().map(|actuator| actuator.limits.unwrap_or(NONE))
    }

    /// The observer with the limits of now.
    fn ready_observer(&mut self) -> Observer {
        let mut observer = self
            .observer
            .take()
            .unwrap_or_else(|| Observer::new(&self.design, self.limits().collect()));
        observer.set_limits(self.limits());
        observer
    }

    /// Advances the estimate by the part of a step between `offset` and `offset + size`.
    fn advance(
        &mut self,
        observer: &mut Observer,
        compensating: bool,
        part: (f64, f64),
    ) -> Result<(), Failure> {
        let y = Measurement { value: &self.measurements, slope: &self.measurement_slopes };
        let switches = (compensating, compensating || self.design.monitor);
        observer
            .advance(&mut self.estimate, switches, y, part)
            .map_err(|error| Failure::Error(format!("the observer cannot be stepped: {error}")))
    }

    /// u, u' and z' for the state and time reached, `offset` s after the measurements were set.
    fn evaluate(&mut self, observer: &Observer, offset: f64) {
        let estimating = self.active || self.design.monitor;
        observer.command(&self.estimate, self.active, &mut self.u);
        let mode = observer.mode(&self.estimate, self.active, estimating);
        let y = Measurement { value: &self.measurements, slope: &self.measurement_slopes };
        let slopes = (&mut self.estimate_slopes[..], &mut self.u_slopes[..]);
        observer.slopes(mode, &self.estimate, (y, offset), &self.u, slopes);
    }
}

/// Times closer than this (in s) are the same on an importer's clock.
fn clock_rounding(time: f64) -> f64 {
    8.0 * f64::EPSILON * time.abs()
}

impl Model for AsoController {
    const IDENTIFIER: &'static str = "AsoController";

    fn about(&self) -> About {
        About {
            description: self.design.description.clone(),
            author: String::new(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            license: env!("CARGO_PKG_LICENSE").to_owned(),
            default_experiment: DefaultExperiment {
                start_time: Some(0.0),
                stop_time: Some(self.design.experiment.stop_time),
                tolerance: Some(1e-9),
                step_size: Some(self.design.experiment.step_size),
            },
        }
    }

    fn new(resources: &Path) -> Result<Self, Failure> {
        let design = Design::read(resources).map_err(|error| Failure::Error(error.to_string()))?;
        let (n, q) = (design.states.len(), design.faults.len());
        let (m, p) = (design.actuators.len(), design.measurements.len());
        Ok(Self {
            design,
            x_hat_0: vec![0.0; n],
            f_hat_0: vec![0.0; q],
            measurements: vec![0.0; p],
            measurement_slopes: vec![0.0; p],
            compensate: true,
            estimate: vec![0.0; n + q],
            estimate_slopes: vec![0.0; n + q],
            u: vec![0.0; m],
            u_slopes: vec![0.0; m],
            active: false,
            observer: None,
        })
    }

    fn variables(&self) -> Vec<Variable<Self>> {
        variables::of(self)
    }

    fn check(&self) -> Result<(), Failure> {
        for (j, actuator) in self.design.actuators.iter().enumerate() {
            if let Some([low, high]) = actuator.limits
                && low >= high
            {
                let (low_name, high_name) =
                    (variables::limit_name(self, 0, j), variables::limit_name(self, 1, j));
                return Err(Failure::Error(format!(
                    "{low_name} = {low}, expected less than {high_name} = {high}"
                )));
            }
        }
        Ok(())
    }

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Failure> {
        self.active = self.compensating(experiment.start_time);
        let (x_hat, f_hat) = self.estimate.split_at_mut(self.x_hat_0.len());
        x_hat.copy_from_slice(&self.x_hat_0);
        f_hat.copy_from_slice(&self.f_hat_0);
        self.observer = None;
        self.update(experiment.start_time)
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        let mut observer = self.ready_observer();
        let resolution = clock_rounding(step.end());
        let until_on = self.design.t_on - step.start;
        let inside = self.compensate && until_on > resolution && step.size - until_on > resolution;
        if inside {
            self.advance(&mut observer, false, (0.0, until_on))?;
            self.advance(&mut observer, true, (until_on, step.size - until_on))?;
        } else {
            let compensating = self.compensating(step.start);
            self.advance(&mut observer, compensating, (0.0, step.size))?;
        }
        self.active = self.compensating(step.end());
        self.evaluate(&observer, step.size);
        self.observer = Some(observer);
        Ok(())
    }

    fn update(&mut self, _time: f64) -> Result<(), Failure> {
        let observer = self.ready_observer();
        self.evaluate(&observer, 0.0);
        self.observer = Some(observer);
        Ok(())
    }
}

#[cfg(test)]
mod tests;
