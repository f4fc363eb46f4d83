//! The van der Pol oscillator: x0' = x1, x1' = mu (1 - x0^2) x1 - x0.
#![forbid(unsafe_code)]

use std::path::Path;

use fmi2::description::DefaultExperiment;
use fmi2::{About, Experiment, Failure, Model, Step, Variable};

/// Longest step of the forward Euler method, in s.
const LONGEST: f64 = 0.01;

#[derive(Clone, serde::Serialize, serde::Deserialize)]
struct VanDerPol {
    x: [f64; 2],
    mu: f64,
}

impl Model for VanDerPol {
    const IDENTIFIER: &'static str = "VanDerPol";

    fn about(&self) -> About {
        let (stop_time, step_size) = (Some(20.0), Some(LONGEST));
        let default_experiment = DefaultExperiment { stop_time, step_size, ..Default::default() };
        About { description: "Van der Pol equation".into(), default_experiment, ..About::default() }
    }

    fn new(_resources: &Path) -> Result<Self, Failure> {
        Ok(Self { x: [2.0, 0.0], mu: 1.0 })
    }

    fn variables(&self) -> Vec<Variable<Self>> {
        vec![
            Variable::real("x0", "Position", |m: &mut Self| &mut m.x[0]).output(&[]).exact(),
            Variable::real("x1", "Velocity", |m: &mut Self| &mut m.x[1]).output(&[]).exact(),
            Variable::real("mu", "Damping", |m: &mut Self| &mut m.mu).parameter(),
        ]
    }

    fn initialize(&mut self, _experiment: &Experiment) -> Result<(), Failure> {
        Ok(())
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        if step.size > 1e6 {
            return Err(Failure::Discard("expected steps of at most 1e6 s".to_owned()));
        }
        let mut left = step.size;
        while left > 0.0 {
            let (h, [x0, x1]) = (left.min(LONGEST), self.x);
            self.x = [x0 + h * x1, x1 + h * (self.mu * (1.0 - x0 * x0) * x1 - x0)];
            left -= h;
        }
        Ok(())
    }
}

fmi2::export!(VanDerPol);
#[cfg(test)]
mod tests;
