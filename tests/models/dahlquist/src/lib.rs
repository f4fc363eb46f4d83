//! The model Dahlquist of the Reference-FMUs, for the benchmark against it.
#![forbid(unsafe_code)]

use std::path::Path;

use fmu::{About, Experiment, Failure, Model, Step, Variable};
use serde::{Deserialize, Serialize};

/// `x' = -k x`, `x(0) = 1`, one step of Euler's method in each communication step.
#[derive(Clone, Serialize, Deserialize)]
struct Dahlquist {
    x: f64,
    derivative: f64,
    k: f64,
}

impl Model for Dahlquist {
    const IDENTIFIER: &'static str = "Dahlquist";

    fn about(&self) -> About {
        About { description: "The test equation of Dahlquist".to_owned(), ..About::default() }
    }

    fn new(_resources: &Path) -> Result<Self, Failure> {
        Ok(Self { x: 1.0, derivative: -1.0, k: 1.0 })
    }

    fn variables(&self) -> Vec<Variable<Self>> {
        vec![
            Variable::real("x", "The state", |model: &mut Self| &mut model.x).output(&[]),
            Variable::real("der(x)", "Its slope", |model: &mut Self| &mut model.derivative),
            Variable::real("k", "The rate", |model: &mut Self| &mut model.k).tunable(),
        ]
    }

    fn initialize(&mut self, _experiment: &Experiment) -> Result<(), Failure> {
        self.x = 1.0;
        self.derivative = -self.k * self.x;
        Ok(())
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        self.x += step.size * self.derivative;
        self.derivative = -self.k * self.x;
        Ok(())
    }

    fn update(&mut self, _time: f64) -> Result<(), Failure> {
        self.derivative = -self.k * self.x;
        Ok(())
    }
}

fmu::export!(Dahlquist);
