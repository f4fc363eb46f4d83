//! A DC servo whose load has Coulomb and static friction, with faults of drive and sensor.
#![forbid(unsafe_code)]

mod motion;
mod motor;
mod variables;

use std::array::from_fn;
use std::path::Path;

use fmu::description::DefaultExperiment;
use fmu::{About, At, Event, Experiment, Failure, Model, ModelExchange, Step, Variable};
use num_dual::Dual64;

use motion::Motion;
use motor::{BIAS, COUNT, Motor, ONSET};
use variables::PARAMETERS;

/// Offset of the event indicator from its margin, so that a margin of zero is no event.
const SHIFT: f64 = 1e-10;

/// The model; fields without a comment have the name of their variable.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
struct DcServo {
    u: f64,
    u_slope: f64,
    /// `theta`, `omega`
    state: [f64; 2],
    parameters: [f64; COUNT],
    friction: bool,
    regime: i32,
    /// Whether the faults of drive and sensor have started.
    begun: [bool; 2],
    /// The time of the fields below.
    time: f64,
    acceleration: f64,
    measured: f64,
    dry_friction: f64,
    current: f64,
}

impl DcServo {
    fn motor(&self) -> Motor<f64> {
        Motor { parameters: self.parameters, faulty: self.begun[0], friction: self.friction }
    }

    /// The motion from `time` on, under the input `u` and its derivative at that time.
    fn motion(&self, u: f64, time: f64) -> Motion {
        let motor = self.motor();
        Motion::new(&motor, [motor.voltage(u, time), motor.voltage_rise(self.u_slope)])
    }

    /// Returns `t_fault` and `t_bias` in s.
    fn onsets(&self) -> [f64; 2] {
        from_fn(|k| self.parameters[ONSET + k])
    }

    /// Returns the first onset after `time`; `None` after the last one.
    fn next_onset(&self, time: f64) -> Option<f64> {
        self.onsets().into_iter().filter(|onset| *onset > time).reduce(f64::min)
    }

    fn begin_faults(&mut self, time: f64) {
        self.begun = self.onsets().map(|onset| time >= onset);
    }

    /// Computes all outputs and derivatives from the state and the input `u` at this time.
    fn evaluate(&mut self, u: f64, time: f64) {
        let motor = self.motor();
        let now = motor.response(self.regime, self.state[1], motor.voltage(u, time));
        (self.acceleration, self.dry_friction) = (now.acceleration, now.friction);
        (self.current, self.time) = (now.current, time);
        let bias = if self.begun[1] { self.parameters[BIAS] } else { 0.0 };
        self.measured = self.state[0] + bias;
    }
}

impl Model for DcServo {
    const IDENTIFIER: &'static str = "DcServo";
    const PROVIDES_DIRECTIONAL_DERIVATIVE: bool = true;

    fn about(&self) -> About {
        let description = "DC servo with dry friction and faults of drive and sensor".to_owned();
        let (stop_time, step_size) = (Some(1.0), Some(0.001));
        let default_experiment = DefaultExperiment { stop_time, step_size, ..Default::default() };
        About { description, default_experiment, ..About::default() }
    }

    fn new(_resources: &Path) -> Result<Self, Failure> {
        Ok(Self {
            u: 0.0,
            u_slope: 0.0,
            state: [0.0; 2],
            parameters: PARAMETERS.map(|(.., value, _)| value),
            friction: true,
            regime: 0,
            begun: [false; 2],
            time: 0.0,
            acceleration: 0.0,
            measured: 0.0,
            dry_friction: 0.0,
            current: 0.0,
        })
    }

    fn variables(&self) -> Vec<Variable<Self>> {
        variables::all()
    }

    fn check(&self) -> Result<(), Failure> {
        let [.., coulomb, holding, _, _, _, _, _, _] = self.parameters;
        if holding >= coulomb {
            return Ok(());
        }
        Err(Failure::Error(format!("T_s = {holding}: must be at least T_c = {coulomb} N m")))
    }

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Failure> {
        let time = experiment.start_time;
        self.begin_faults(time);
        self.regime = self.motion(self.u, time).regime(self.state[1], 0.0);
        self.update(time)
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        let input = |model: &Self, time: f64| model.u + model.u_slope * (time - step.start);
        let (mut state, mut time) = (self.state, step.start);
        while time < step.end() {
            self.begin_faults(time);
            let end = self.next_onset(time).map_or(step.end(), |onset| onset.min(step.end()));
            let next = self.motion(input(self, time), time).advance(state, end - time);
            let failure =
                || Failure::Discard(format!("voltage or state not finite at t = {time} s"));
            (state, time) = (next.ok_or_else(failure)?, end);
        }
        self.state = state;
        self.begin_faults(time);
        let u = input(self, time);
        self.regime = self.motion(u, time).regime(state[1], 0.0);
        self.evaluate(u, time);
        Ok(())
    }

    fn update(&mut self, time: f64) -> Result<(), Failure> {
        self.evaluate(self.u, time);
        Ok(())
    }

    fn model_exchange(&self) -> Option<ModelExchange> {
        Some(ModelExchange { event_indicators: 1 })
    }

    fn event_indicators(&self, _time: f64, indicators: &mut [f64]) {
        let holding = self.parameters[5];
        let margin = match self.regime {
            _ if !self.friction => 1.0,
            0 => (holding - (self.parameters[1] * self.current).abs()) / holding.max(1e-9),
            direction => f64::from(direction) * self.state[1],
        };
        indicators.fill(margin + SHIFT);
    }

    fn event(&mut self, time: f64) -> Result<Event, Failure> {
        self.begin_faults(time);
        let stops = self.friction && f64::from(self.regime) * self.state[1] < 0.0;
        if stops {
            self.state[1] = 0.0;
        }
        self.regime = self.motion(self.u, time).regime(self.state[1], 0.0);
        self.update(time)?;
        let next_event_time = self.next_onset(time);
        Ok(Event {
            values_of_continuous_states_changed: stops,
            next_event_time,
            ..Event::default()
        })
    }

    fn differentiate(&self, at: &At, direction: &mut Self) -> Result<(), Failure> {
        let delta_time = match at {
            At::Point { delta_time, .. } => *delta_time,
            At::Initialization => 0.0,
        };
        let motor = Motor {
            parameters: from_fn(|k| Dual64::new(self.parameters[k], direction.parameters[k])),
            faulty: self.begun[0],
            friction: self.friction,
        };
        let time = Dual64::new(self.time, delta_time);
        let voltage = motor.voltage(Dual64::new(self.u, direction.u), time);
        let omega = Dual64::new(self.state[1], direction.state[1]);
        let now = motor.response(self.regime, omega, voltage);
        (direction.acceleration, direction.dry_friction) = (now.acceleration.eps, now.friction.eps);
        let bias = if self.begun[1] { direction.parameters[BIAS] } else { 0.0 };
        direction.measured = direction.state[0] + bias;
        Ok(())
    }
}

fmu::export!(DcServo);
#[cfg(test)]
mod tests;
