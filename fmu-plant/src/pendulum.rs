//! The friction pendulum as a model: initialisation, steps, events and derivatives.

use std::path::Path;

use fmu::{About, At, Event, Experiment, Failure, Model, ModelExchange, Step, Variable};
use num_dual::Dual64;
use serde::{Deserialize, Serialize};

use crate::dynamics::Force;
use crate::functions::Direct;
use crate::motion::exchange::INDICATORS;
use crate::motion::{self, Motion, Tolerance};
use crate::parameters::{Parameters, Refusal};
use crate::response::Response;

mod variables;

/// Inverted pendulum on a cart with Stribeck friction; `u`, `f_a`, `f_fric` and `regime` are variables of the FMU.
#[derive(Clone, Serialize, Deserialize)]
pub struct FrictionPendulum {
    parameters: Parameters,
    /// The initial state `[x_p_0, theta_0, v_p_0, omega_0]`.
    initial: [f64; 4],
    u: f64,
    f_a: f64,
    /// First and second derivative of `u` at the start of the step.
    u_derivatives: [f64; 2],
    /// First and second derivative of `f_a` at the start of the step.
    f_a_derivatives: [f64; 2],
    /// The states and the regime.
    motion: Motion,
    tolerance: Tolerance,
    /// The force `u + f_a` in N at the time of the outputs.
    force: f64,
    /// The derivative of `force` in N/s.
    force_rate: f64,
    f_fric: f64,
    /// The derivative of `f_fric` in N/s, which `friction_rate` computes when it is read.
    f_fric_rate: f64,
    /// The derivative of the states.
    slope: [f64; 4],
    regime: i32,
}

/// The force `u + f_a` as a polynomial of time; the inputs were set at `start` in s.
fn force(model: &FrictionPendulum, start: f64) -> Force {
    let [slope, curvature] =
        [0, 1].map(|order| model.u_derivatives[order] + model.f_a_derivatives[order]);
    Force { value: model.u + model.f_a, slope, curvature, start }
}

fn refused(refusal: &Refusal) -> Failure {
    Failure::Error(refusal.to_string())
}

impl FrictionPendulum {
    /// Computes outputs and derivatives at `time` under `force`.
    fn update_outputs(&mut self, force: &Force, time: f64) {
        (self.force, self.force_rate) = (force.at(time), force.rate_at(time));
        let response = self.motion.response(&self.parameters, self.force);
        (self.f_fric, self.slope) = (response.friction, response.slope);
        self.regime = self.motion.regime().number();
    }

    /// Computes outputs and derivatives where a step has ended: at an event, at a failure, or at its end. Returns the
    /// time of the event, or the failure with the time reached.
    fn end_step(
        &mut self,
        step: &Step,
        force: &Force,
        result: Result<Option<f64>, motion::Failure>,
    ) -> Result<Option<f64>, Failure> {
        let reached = match &result {
            Ok(event) => event.unwrap_or(step.end()).min(step.end()),
            Err(failure) => failure.time(),
        };
        self.update_outputs(force, reached);
        match result {
            Ok(event) => Ok(event.map(|_| reached)),
            Err(failure) => {
                Err(Failure::Incomplete { time: reached, message: failure.to_string() })
            }
        }
    }

    /// The derivative of the friction with respect to time in N/s, along the motion in the present
    /// regime.
    ///
    /// Zero where it is not finite: at the break-away of a cart whose friction has `delta` below one.
    fn friction_rate(&mut self) -> &mut f64 {
        let state = self.motion.state();
        let response = Response::new(
            &Direct,
            &self.parameters.along(None),
            self.motion.regime(),
            &std::array::from_fn(|k| Dual64::new(state[k], self.slope[k])),
            Dual64::new(self.force, self.force_rate),
        );
        let rate = response.friction.eps;
        self.f_fric_rate = if rate.is_finite() { rate } else { 0.0 };
        &mut self.f_fric_rate
    }
}

impl Model for FrictionPendulum {
    const IDENTIFIER: &'static str = "FrictionPendulum";
    const PROVIDES_DIRECTIONAL_DERIVATIVE: bool = true;

    fn about(&self) -> About {
        About {
            description: "Inverted pendulum on a cart with set-valued Stribeck friction".to_owned(),
            ..fmu::about!(start_time: 0.0, stop_time: 10.0, tolerance: 1e-9, step_size: 0.001)
        }
    }

    fn new(_resources: &Path) -> Result<Self, Failure> {
        Ok(Self {
            parameters: Parameters::default(),
            initial: [0.1, -0.1, 0.0, 0.0],
            u: 0.0,
            f_a: 0.0,
            u_derivatives: [0.0; 2],
            f_a_derivatives: [0.0; 2],
            motion: Motion::default(),
            tolerance: Tolerance::default(),
            force: 0.0,
            force_rate: 0.0,
            f_fric: 0.0,
            f_fric_rate: 0.0,
            slope: [0.0; 4],
            regime: 0,
        })
    }

    fn variables(&self) -> Vec<Variable<Self>> {
        variables::all()
    }

    fn check(&self) -> Result<(), Failure> {
        self.parameters.check().map_err(|refusal| refused(&refusal))
    }

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Failure> {
        self.tolerance = match experiment.tolerance {
            Some(relative) => Tolerance::new(relative).map_err(|refusal| refused(&refusal))?,
            None => Tolerance::default(),
        };
        let force = force(self, experiment.start_time);
        let motion = Motion::start(&self.parameters, self.initial, force.value);
        self.motion = motion.map_err(|refusal| refused(&refusal))?;
        self.update_outputs(&force, force.start);
        Ok(())
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        let force = force(self, step.start);
        let Self { motion, parameters, tolerance, .. } = self;
        let result = motion.advance(parameters, &force, step.start, step.size, tolerance);
        self.end_step(step, &force, result.map(|()| None)).map(|_| ())
    }

    fn step_to_event(&mut self, step: &Step) -> Result<Option<f64>, Failure> {
        let force = force(self, step.start);
        let Self { motion, parameters, tolerance, .. } = self;
        let result = motion.advance_to_event(parameters, &force, step.start, step.size, tolerance);
        self.end_step(step, &force, result)
    }

    fn update(&mut self, time: f64) -> Result<(), Failure> {
        self.update_outputs(&force(self, time), time);
        Ok(())
    }

    fn differentiate(&self, at: &At, direction: &mut Self) -> Result<(), Failure> {
        if *at == At::Initialization {
            *direction.motion.state_mut() = direction.initial;
        }
        let (state, change) = (self.motion.state(), direction.motion.state());
        let response = Response::new(
            &Direct,
            &self.parameters.along(Some(&direction.parameters)),
            self.motion.regime(),
            &std::array::from_fn(|k| Dual64::new(state[k], change[k])),
            Dual64::new(self.force, direction.u + direction.f_a),
        );
        direction.f_fric = response.friction.eps;
        direction.slope = response.slope.map(|part| part.eps);
        if direction.slope.iter().chain([&direction.f_fric]).all(|part| part.is_finite()) {
            return Ok(());
        }
        let (delta, velocity) = (self.parameters.stribeck_exponent, state[2]);
        Err(Failure::Error(format!(
            "no derivative at v_p = {velocity} m/s: the friction with delta = {delta} is too steep"
        )))
    }

    fn model_exchange(&self) -> Option<ModelExchange> {
        Some(ModelExchange { event_indicators: INDICATORS })
    }

    fn event_indicators(&self, _time: f64, indicators: &mut [f64]) {
        let margins = self.motion.indicators(&self.parameters, self.force);
        for (indicator, margin) in indicators.iter_mut().zip(margins) {
            *indicator = margin;
        }
    }

    fn event(&mut self, time: f64) -> Result<Event, Failure> {
        let force = force(self, time);
        let values_of_continuous_states_changed = self.motion.settle(&self.parameters, force.value);
        self.update_outputs(&force, time);
        Ok(Event { values_of_continuous_states_changed, ..Event::default() })
    }
}

#[cfg(test)]
mod tests;
