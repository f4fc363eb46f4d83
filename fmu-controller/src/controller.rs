//! The controller as a model: fields, initialisation, steps, events, derivatives.

use std::path::Path;

use fmu::description::DefaultExperiment;
use fmu::{About, At, Event, Experiment, Failure, Model, ModelExchange, Step, Variable};
use serde::{Deserialize, Serialize};

use crate::design::Design;
use crate::equations::{Knowns, Mode};
use crate::loss::Loss;
use crate::observer::{Conditions, Observer};
use crate::sampled::{Sample, Sampler};
use crate::signals::Signals;
use crate::{names, variables};

/// How far a free command passes a limit before that is an event, as part of the range of the
/// actuator: no event indicator is zero after an event, and rounding repeats none.
const HYSTERESIS: f64 = 1e-9;

/// A fault-tolerant controller with an augmented state observer; any linear plant, any sizes.
///
/// Everything but what is said here carries the name of its FMI variable.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct AsoController {
    pub(crate) design: Design,
    pub(crate) x_hat_0: Vec<f64>,
    pub(crate) f_hat_0: Vec<f64>,
    /// Estimates, measurements, commands.
    pub(crate) values: Signals,
    /// y' as the importer gives it; z' and u'.
    pub(crate) y_slopes: Vec<f64>,
    pub(crate) z_slopes: Vec<f64>,
    pub(crate) u_slopes: Vec<f64>,
    pub(crate) compensate: bool,
    /// E_hat with its derivative.
    pub(crate) losses: Vec<Loss>,
    /// What the equations take in place of `values`, in a design with an operating point.
    deviations: Option<Signals>,
    /// The mode that u and z' are those of. Whether it compensates is decided at the start, at each
    /// end of a step and at events; in a sampled controller at each sample.
    mode: Mode,
    /// Model exchange: a channel reaches or leaves a limit at events only.
    frozen: bool,
    /// Of a sampled controller.
    sampler: Option<Sampler>,
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

    /// Finds the deviations of estimates and measurements.
    fn deviate(&mut self) {
        if let Some(deviations) = &mut self.deviations {
            deviations.deviate(&self.design, &self.values);
        }
    }

    /// What the equations take.
    fn signals(&self) -> &Signals {
        self.deviations.as_ref().unwrap_or(&self.values)
    }

    /// Finds the channels at a limit.
    fn limit(&mut self) {
        let Mode { compensating, estimating, .. } = self.mode;
        self.mode = Mode::of(&self.design, &self.signals().z, compensating, estimating);
    }

    /// The estimate as it starts.
    fn begin(&mut self) {
        let [x_hat, f_hat, y_f] = self.design.parts_mut(&mut self.values.z);
        x_hat.copy_from_slice(&self.x_hat_0);
        f_hat.copy_from_slice(&self.f_hat_0);
        y_f.iter_mut().zip(&self.values.y).for_each(|(y_f, y)| *y_f = *y);
    }

    /// Advances the estimate by the part of a step between `offset` and `offset + size`.
    fn advance(&mut self, compensating: bool, part: (f64, f64)) -> Result<(), Failure> {
        let Self { design, values, deviations, y_slopes, observer, .. } = self;
        let Signals { z, y, .. } = deviations.as_mut().unwrap_or(values);
        let estimating = compensating || design.monitor;
        let conditions = Conditions { design, y: [y, y_slopes], compensating, estimating };
        observer
            .get_or_insert_with(|| Observer::new(design))
            .advance(z, conditions, part)
            .map_err(|error| Failure::Error(format!("the observer cannot be stepped: {error}")))
    }

    /// A step of the observer that is integrated.
    fn integrate(&mut self, step: &Step) -> Result<(), Failure> {
        let resolution = clock_rounding(step.end());
        let until_on = self.design.t_on - step.start;
        let inside = self.compensate && until_on > resolution && step.size - until_on > resolution;
        self.deviate();
        if inside {
            self.advance(false, (0.0, until_on))?;
            self.advance(true, (until_on, step.size - until_on))?;
        } else {
            self.advance(self.compensating(step.start), (0.0, step.size))?;
        }
        if let Some(deviations) = &self.deviations {
            deviations.state_into(&self.design, &mut self.values.z);
        }
        self.switch(step.end());
        self.evaluate(step.size);
        Ok(())
    }

    /// u, u' and z' for the state and time reached, `offset` s after the measurements were set.
    fn evaluate(&mut self, offset: f64) {
        self.deviate();
        if !self.frozen {
            self.limit();
        }
        let Self { design, mode, z_slopes, u_slopes, .. } = self;
        let own = self.deviations.as_mut().unwrap_or(&mut self.values);
        mode.command(design, &own.z, &mut own.u);
        let point = Knowns { design, signals: own };
        mode.slopes(point, (&self.y_slopes, offset), (&mut *z_slopes, u_slopes));
        if let Some(deviations) = &self.deviations {
            deviations.command_into(design, *mode, &mut self.values.u);
        }
        for loss in &mut self.losses {
            let [_, f_hat, _] = design.parts(&self.values.z);
            let [_, f_slopes, _] = design.parts(z_slopes);
            loss.estimate = loss.at(&self.values.u, f_hat);
            loss.slope = loss.along([&self.values.u, u_slopes], [f_hat, f_slopes]);
        }
    }

    /// Takes the samples that are due until `end`, with the measurements given at `begin`, in s.
    fn sample(&mut self, begin: f64, end: f64) -> Result<(), Failure> {
        let Some(mut sampler) = self.sampler.take_if(|sampler| !sampler.is_flooded(end)) else {
            return Err(Failure::Error(format!(
                "too many samples are due from {begin} to {end} s"
            )));
        };
        while let Some(offset) = sampler.due(begin, end) {
            self.switch(sampler.next_instant());
            let sample = Sample {
                design: &self.design,
                slopes: (&self.y_slopes, offset),
                compensating: self.mode.compensating,
                estimating: self.mode.estimating,
            };
            self.mode = sampler.sample(sample, &mut self.values, &mut self.deviations);
        }
        let [_, f_hat, _] = self.design.parts(&self.values.z);
        for loss in &mut self.losses {
            loss.estimate = loss.at(&self.values.u, f_hat);
        }
        self.sampler = Some(sampler);
        Ok(())
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
                step_size: Some(self.design.step_size()),
            },
        }
    }

    fn new(resources: &Path) -> Result<Self, Failure> {
        let design = Design::read(resources).map_err(|error| Failure::Error(error.to_string()))?;
        let operating = design.states.iter().map(|state| state.operating.unwrap_or_default());
        let values = Signals::zero(&design);
        Ok(Self {
            x_hat_0: operating.collect(),
            f_hat_0: vec![0.0; design.faults.len()],
            y_slopes: vec![0.0; values.y.len()],
            z_slopes: vec![0.0; values.z.len()],
            u_slopes: vec![0.0; values.u.len()],
            compensate: true,
            losses: Loss::all(&design),
            deviations: design.has_operating_point().then(|| values.clone()),
            mode: Mode::default(),
            frozen: false,
            sampler: Sampler::of(&design),
            observer: None,
            values,
            design,
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
        match self.design.refused_filter() {
            Some((name, value, rule)) => {
                Err(Failure::Error(format!("{name} = {value}, expected {rule}")))
            }
            None => Ok(()),
        }
    }

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Failure> {
        let time = experiment.start_time;
        self.begin();
        self.observer = None;
        self.frozen = false;
        if let Some(sampler) = &mut self.sampler {
            sampler.begin(time, &self.values.z);
            return self.sample(time, time);
        }
        self.switch(time);
        self.evaluate(0.0);
        Ok(())
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        if self.sampler.is_some() {
            return self.sample(step.start, step.end());
        }
        self.integrate(step)
    }

    fn update(&mut self, _time: f64) -> Result<(), Failure> {
        if self.sampler.is_none() {
            self.evaluate(0.0);
        }
        Ok(())
    }

    fn differentiate(&self, at: &At, direction: &mut Self) -> Result<(), Failure> {
        let starts = *at == At::Initialization;
        if !starts && self.sampler.is_some() {
            // Between samples nothing changes.
            return Ok(());
        }
        if starts {
            direction.begin();
        }
        direction.deviate();
        let point = Knowns { design: &self.design, signals: self.signals() };
        let Self { design, values, deviations, z_slopes, .. } = direction;
        let along = deviations.as_mut().unwrap_or(values);
        if let (Some(own), Some(sampler)) = (&self.sampler, &mut direction.sampler) {
            own.first_sample_along(self.mode, point, design, (along, sampler.changes()));
        } else {
            self.mode.command_along(point, design, along);
            self.mode.slopes_along(point, Knowns { design, signals: along }, z_slopes);
        }
        if let Some(deviations) = deviations {
            deviations.state_into(design, &mut values.z);
            deviations.command_into(design, self.mode, &mut values.u);
        }
        let [_, f_hat, _] = design.parts(&self.values.z);
        let [_, df_hat, _] = design.parts(&values.z);
        for (loss, own) in direction.losses.iter_mut().zip(&self.losses) {
            loss.estimate = own.along([&self.values.u, &values.u], [f_hat, df_hat]);
        }
        Ok(())
    }

    fn model_exchange(&self) -> Option<ModelExchange> {
        let limited = self.design.actuators.iter().filter(|actuator| actuator.limits.is_some());
        let event_indicators = if self.sampler.is_some() { 0 } else { 2 * limited.count() };
        Some(ModelExchange { event_indicators })
    }

    fn event_indicators(&self, _time: f64, indicators: &mut [f64]) {
        let mut pairs = indicators.chunks_exact_mut(2);
        for (j, actuator) in self.design.actuators.iter().enumerate() {
            let Some([low, high]) = actuator.range() else { continue };
            let command = self.mode.free_command(&self.design, &self.signals().z, j);
            let distances = [command - low, high - command];
            for (side, indicator) in pairs.next().into_iter().flatten().enumerate() {
                let beyond = if self.mode.is_at(side, j) { -HYSTERESIS } else { HYSTERESIS };
                *indicator = distances[side] / (high - low) + beyond;
            }
        }
    }

    fn event(&mut self, time: f64) -> Result<Event, Failure> {
        if self.sampler.is_some() {
            self.sample(time, time)?;
            let next_event_time = self.sampler.as_ref().map(Sampler::next_instant);
            return Ok(Event { next_event_time, ..Event::default() });
        }
        self.frozen = true;
        self.switch(time);
        self.deviate();
        self.limit();
        let waiting = self.compensate && !self.mode.compensating;
        Ok(Event { next_event_time: waiting.then_some(self.design.t_on), ..Event::default() })
    }
}

#[cfg(test)]
mod tests;
