//! The controller as a model: fields, initialisation, steps, events, derivatives.

use std::path::Path;

use fmi2::description::DefaultExperiment;
use fmi2::{About, At, Event, Experiment, Failure, Model, ModelExchange, Step, Variable};
use serde::{Deserialize, Serialize};

use crate::design::Design;
use crate::equations::{Knowns, Measurement, Mode};
use crate::observer::{Conditions, Observer};
use crate::{names, variables};

/// How far a free command passes a limit before that is an event, as part of the range of the
/// actuator: no event indicator is zero after an event, and rounding repeats none.
const HYSTERESIS: f64 = 1e-9;

/// A fault-tolerant controller with an augmented state observer; any linear plant, any sizes.
///
/// z = [x_hat; f_hat] is `estimate`, z' is `estimate_slopes`; everything else carries the name of
/// its FMI variable.
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
    /// The mode that u and z' are those of. Whether it compensates is decided at the start, at each
    /// end of a step and at events.
    mode: Mode,
    /// Model exchange: a channel reaches or leaves a limit at events only.
    frozen: bool,
    /// Follows from `design`; made anew where an instance starts or is read from bytes.
    #[serde(skip)]
    observer: Option<Observer>,
}

impl AsoController {
    /// Whether f_hat is part of the command at `time`.
    fn compensating(&self, time: f64) -> bool {
        self.compensate && time >= self.design.t_on - clock_rounding(time)
    }

    /// Switches f_hat on or off, in the command and in the observer.
    fn switch(&mut self, time: f64) {
        self.mode.compensating = self.compensating(time);
        self.mode.estimating = self.mode.compensating || self.design.monitor;
    }

    /// Finds the channels at a limit.
    fn limit(&mut self) {
        let Mode { compensating, estimating, .. } = self.mode;
        self.mode = Mode::of(&self.design, &self.estimate, compensating, estimating);
    }

    /// The estimate as it starts.
    fn begin(&mut self) {
        let (x_hat, f_hat) = self.estimate.split_at_mut(self.x_hat_0.len());
        x_hat.copy_from_slice(&self.x_hat_0);
        f_hat.copy_from_slice(&self.f_hat_0);
    }

    /// Advances the estimate by the part of a step between `offset` and `offset + size`.
    fn advance(
        &mut self,
        observer: &mut Observer,
        compensating: bool,
        part: (f64, f64),
    ) -> Result<(), Failure> {
        let conditions = Conditions {
            design: &self.design,
            y: Measurement { value: &self.measurements, slope: &self.measurement_slopes },
            compensating,
            estimating: compensating || self.design.monitor,
        };
        observer
            .advance(&mut self.estimate, conditions, part)
            .map_err(|error| Failure::Error(format!("the observer cannot be stepped: {error}")))
    }

    /// u, u' and z' for the state and time reached, `offset` s after the measurements were set.
    fn evaluate(&mut self, offset: f64) {
        if !self.frozen {
            self.limit();
        }
        self.mode.command(&self.design, &self.estimate, &mut self.u);
        let y = Measurement { value: &self.measurements, slope: &self.measurement_slopes };
        let slopes = (&mut self.estimate_slopes[..], &mut self.u_slopes[..]);
        self.mode.slopes(&self.design, &self.estimate, (y, offset), &self.u, slopes);
    }
}

/// Times closer than this (in s) are the same on an importer's clock.
fn clock_rounding(time: f64) -> f64 {
    8.0 * f64::EPSILON * time.abs()
}

impl Model for AsoController {
    const IDENTIFIER: &'static str = "AsoController";

    const PROVIDES_DIRECTIONAL_DERIVATIVE: bool = true;

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
            mode: Mode::default(),
            frozen: false,
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
                let [low_name, high_name] = [0, 1].map(|side| names::limit(&self.design, side, j));
                return Err(Failure::Error(format!(
                    "{low_name} = {low}, expected less than {high_name} = {high}"
                )));
            }
        }
        Ok(())
    }

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Failure> {
        self.begin();
        self.observer = None;
        self.frozen = false;
        self.switch(experiment.start_time);
        self.update(experiment.start_time)
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        let mut observer = self.observer.take().unwrap_or_else(|| Observer::new(&self.design));
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
        self.observer = Some(observer);
        self.switch(step.end());
        self.evaluate(step.size);
        Ok(())
    }

    fn update(&mut self, _time: f64) -> Result<(), Failure> {
        self.evaluate(0.0);
        Ok(())
    }

    fn differentiate(&self, at: &At, direction: &mut Self) -> Result<(), Failure> {
        if *at == At::Initialization {
            direction.begin();
        }
        let point = Knowns { design: &self.design, z: &self.estimate, y: &self.measurements };
        let along = Knowns {
            design: &direction.design,
            z: &direction.estimate,
            y: &direction.measurements,
        };
        let unknowns = (&mut direction.u[..], &mut direction.estimate_slopes[..]);
        self.mode.differentiate(&point, &self.u, &along, unknowns);
        Ok(())
    }

    fn model_exchange(&self) -> Option<ModelExchange> {
        let limited = self.design.actuators.iter().filter(|actuator| actuator.limits.is_some());
        Some(ModelExchange { event_indicators: 2 * limited.count() })
    }

    fn event_indicators(&self, _time: f64, indicators: &mut [f64]) {
        let mut pairs = indicators.chunks_exact_mut(2);
        for (j, actuator) in self.design.actuators.iter().enumerate() {
            let Some([low, high]) = actuator.limits else { continue };
            let command = self.mode.free_command(&self.design, &self.estimate, j);
            let distances = [command - low, high - command];
            for (side, indicator) in pairs.next().into_iter().flatten().enumerate() {
                let beyond = if self.mode.is_at(side, j) { -HYSTERESIS } else { HYSTERESIS };
                *indicator = distances[side] / (high - low) + beyond;
            }
        }
    }

    fn event(&mut self, time: f64) -> Result<Event, Failure> {
        self.frozen = true;
        self.switch(time);
        self.limit();
        let waiting = self.compensate && !self.mode.compensating;
        Ok(Event { next_event_time: waiting.then_some(self.design.t_on), ..Event::default() })
    }
}

#[cfg(test)]
mod tests;
