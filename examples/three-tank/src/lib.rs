//! The three-tank benchmark (DTS200): two pumps, three levels, faults of pumps and sensors.
#![forbid(unsafe_code)]

mod flows;
mod levels;
mod variables;

use std::array::from_fn;
use std::path::Path;

use fmu::description::DefaultExperiment;
use fmu::{About, At, Event, Experiment, Failure, Model, ModelExchange, Step, Variable};
use num_dual::Dual64;

use flows::{BIAS, COUNT, H_MAX, ONSET, Q_MAX, Tanks};
use variables::PARAMETERS;

/// Offset of an event indicator from its margin, so that a margin of zero is no event.
const SHIFT: f64 = 1e-10;

/// The model; fields without a comment have the name of their variable.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
pub struct ThreeTank {
    h: [f64; 3],
    command: [f64; 2],
    parameters: [f64; COUNT],
    /// Whether the faults of pump 1, pump 2 and the sensors have started.
    begun: [bool; 3],
    /// The tanks that spill.
    full: [bool; 3],
    /// Length of the next integration step in s.
    trial: f64,
    slope: [f64; 3],
    measured: [f64; 3],
    pumps: [f64; 2],
    pipes: [f64; 3],
    spill: f64,
}

impl ThreeTank {
    fn tanks(&self) -> Tanks<f64> {
        let faulty = [self.begun[0], self.begun[1]];
        Tanks { command: self.command, parameters: self.parameters, faulty }
    }

    /// Returns `t_fault_1`, `t_fault_2` and `t_bias` in s.
    fn onsets(&self) -> [f64; 3] {
        from_fn(|k| self.parameters[ONSET + k])
    }

    /// Returns the first onset after `time`; `None` after the last one.
    fn next_onset(&self, time: f64) -> Option<f64> {
        self.onsets().into_iter().filter(|onset| *onset > time).reduce(f64::min)
    }

    /// Limits the levels to the brim and updates the conditions that change at events only; returns whether a level was
    /// above the brim.
    fn settle(&mut self, time: f64) -> bool {
        let above = self.h.iter().any(|level| *level > self.parameters[H_MAX]);
        self.begun = self.onsets().map(|onset| time >= onset);
        self.full = self.tanks().settle(&mut self.h);
        above
    }
}

impl Model for ThreeTank {
    const IDENTIFIER: &'static str = "ThreeTank";
    const PROVIDES_DIRECTIONAL_DERIVATIVE: bool = true;

    fn about(&self) -> About {
        let description = "Three-tank benchmark with faults of pumps and sensors".to_owned();
        let (stop_time, step_size) = (Some(2000.0), Some(1.0));
        let default_experiment = DefaultExperiment { stop_time, step_size, ..Default::default() };
        About { description, default_experiment, ..About::default() }
    }

    fn new(_resources: &Path) -> Result<Self, Failure> {
        Ok(Self {
            h: [0.4, 0.2, 0.3],
            // The equilibrium of these levels.
            command: [3.501_785_258_978_627e-5, 3.183_782_218_805_143e-5],
            parameters: PARAMETERS.map(|(.., value, _)| value),
            begun: [false; 3],
            full: [false; 3],
            trial: 1.0,
            slope: [0.0; 3],
            measured: [0.0; 3],
            pumps: [0.0; 2],
            pipes: [0.0; 3],
            spill: 0.0,
        })
    }

    fn variables(&self) -> Vec<Variable<Self>> {
        variables::all()
    }

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Failure> {
        let highest = self.parameters[H_MAX];
        for (k, level) in self.h.into_iter().enumerate() {
            if !(0.0..=highest).contains(&level) {
                let name = format!("h_{} = {level}", k + 1);
                return Err(Failure::Error(format!("{name}: expected 0 to h_max = {highest} m")));
            }
        }
        self.settle(experiment.start_time);
        self.update(experiment.start_time)
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        let mut time = step.start;
        while time < step.end() {
            self.settle(time);
            let end = self.next_onset(time).map_or(step.end(), |onset| onset.min(step.end()));
            let elapsed = self.tanks().advance(&mut self.h, &mut self.trial, end - time);
            if elapsed < end - time {
                let message = "too many integration steps in one communication step".to_owned();
                return Err(Failure::Incomplete { time: time + elapsed, message });
            }
            time = end;
        }
        self.settle(time);
        self.update(time)
    }

    fn update(&mut self, _time: f64) -> Result<(), Failure> {
        let tanks = self.tanks();
        let now = tanks.flows(&self.h);
        self.slope = tanks.slope(&self.h, self.full);
        self.spill = (0..3).map(|i| if self.full[i] { now.net[i] } else { 0.0 }).sum();
        let biased = f64::from(u8::from(self.begun[2]));
        self.measured = from_fn(|i| self.h[i] + biased * self.parameters[BIAS + i]);
        (self.pumps, self.pipes) = (now.pumps, now.pipes);
        Ok(())
    }

    fn model_exchange(&self) -> Option<ModelExchange> {
        Some(ModelExchange { event_indicators: 3 })
    }

    fn event_indicators(&self, _time: f64, indicators: &mut [f64]) {
        let (brim, largest) = (self.parameters[H_MAX], self.parameters[Q_MAX].max(1e-6));
        let net = self.tanks().flows(&self.h).net;
        for (i, indicator) in indicators.iter_mut().enumerate() {
            let margin = if self.full[i] { net[i] / largest } else { brim - self.h[i] };
            *indicator = margin + SHIFT;
        }
    }

    fn event(&mut self, time: f64) -> Result<Event, Failure> {
        let values_of_continuous_states_changed = self.settle(time);
        self.update(time)?;
        let next_event_time = self.next_onset(time);
        Ok(Event { values_of_continuous_states_changed, next_event_time, ..Event::default() })
    }

    fn differentiate(&self, _at: &At, direction: &mut Self) -> Result<(), Failure> {
        let tanks = Tanks {
            command: from_fn(|i| Dual64::new(self.command[i], direction.command[i])),
            parameters: from_fn(|i| Dual64::new(self.parameters[i], direction.parameters[i])),
            faulty: self.tanks().faulty,
        };
        let h = from_fn(|i| Dual64::new(self.h[i], direction.h[i]));
        direction.slope = tanks.slope(&h, self.full).map(|part| part.eps);
        let biased = f64::from(u8::from(self.begun[2]));
        direction.measured = from_fn(|i| direction.h[i] + biased * direction.parameters[BIAS + i]);
        if direction.slope.iter().all(|part| part.is_finite()) {
            return Ok(());
        }
        let message = "no derivative where two joined levels are equal or tank 2 is empty: the flow \
                       has a vertical tangent there";
        Err(Failure::Error(message.to_owned()))
    }
}

#[cfg(feature = "export")]
fmu::export!(ThreeTank);
#[cfg(test)]
mod tests;
