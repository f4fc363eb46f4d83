//! The van der Pol oscillator, x0' = x1, x1' = mu (1 - x0^2) x1 - x0, for both interfaces and with
//! directional derivatives.
#![forbid(unsafe_code)]

use std::path::Path;

use fmu::description::{DefaultExperiment, DependencyKind::Dependent};
use fmu::{About, At, Failure, Model, ModelExchange, Step, Variable};

/// Longest step of the forward Euler method, in s.
const LONGEST: f64 = 0.01;

#[derive(Clone, serde::Serialize, serde::Deserialize)]
struct VanDerPol {
    x: [f64; 2],
    /// x1'
    slope: f64,
    mu: f64,
}

impl Model for VanDerPol {
    const IDENTIFIER: &'static str = "VanDerPol";
    const PROVIDES_DIRECTIONAL_DERIVATIVE: bool = true;

    fn about(&self) -> About {
        let (stop_time, step_size) = (Some(20.0), Some(LONGEST));
        let default_experiment = DefaultExperiment { stop_time, step_size, ..Default::default() };
        About { description: "Van der Pol equation".into(), default_experiment, ..About::default() }
    }

    fn new(_resources: &Path) -> Result<Self, Failure> {
        Ok(Self { x: [2.0, 0.0], slope: 0.0, mu: 1.0 })
    }

    fn variables(&self) -> Vec<Variable<Self>> {
        vec![
            Variable::real("x0", "Position", |m: &mut Self| &mut m.x[0]).output(&[]).exact(),
            Variable::real("x1", "Velocity", |m: &mut Self| &mut m.x[1]).output(&[]).exact(),
            Variable::alias("der(x0)", "Velocity", "x1").derivative_of("x0"),
            Variable::real("der(x1)", "Acceleration", |m: &mut Self| &mut m.slope)
                .derivative_of("x1")
                .depends(Dependent, ["x0", "x1"])
                .initially(["x0", "x1", "mu"]),
            Variable::real("mu", "Damping", |m: &mut Self| &mut m.mu).parameter(),
        ]
    }

    fn update(&mut self, _time: f64) -> Result<(), Failure> {
        let [x0, x1] = self.x;
        self.slope = self.mu * (1.0 - x0 * x0) * x1 - x0;
        Ok(())
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        if step.size > 1e6 {
            return Err(Failure::Discard("expected steps of at most 1e6 s".to_owned()));
        }
        let mut left = step.size;
        while left > 0.0 {
            let h = left.min(LONGEST);
            self.update(step.end())?;
            self.x = [self.x[0] + h * self.x[1], self.x[1] + h * self.slope];
            left -= h;
        }
        self.update(step.end())
    }

    fn model_exchange(&self) -> Option<ModelExchange> {
        Some(ModelExchange { event_indicators: 0 })
    }

    fn differentiate(&self, _at: &At, direction: &mut Self) -> Result<(), Failure> {
        let ([x0, x1], [d0, d1]) = (self.x, direction.x);
        let damping = 1.0 - x0 * x0;
        direction.slope = direction.mu * damping * x1 + self.mu * damping * d1
            - (2.0 * self.mu * x0 * x1 + 1.0) * d0;
        Ok(())
    }
}

fmu::export!(VanDerPol);
#[cfg(test)]
mod tests;
