//! y = 2 u, and a panic on request.

use std::path::Path;

use fmu::{About, Experiment, Failure, Model, Step, Variable};
use serde::{Deserialize, Serialize};

#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct HostileNames {
    u: f64,
    y: f64,
    panics: bool,
    steps: i32,
}

impl Model for HostileNames {
    const IDENTIFIER: &'static str = "HostileNames";

    fn about(&self) -> About {
        About { description: "Names that others have, too".to_owned(), ..About::default() }
    }

    fn new(_resources: &Path) -> Result<Self, Failure> {
        Ok(Self { u: 0.0, y: 0.0, panics: false, steps: 0 })
    }

    fn variables(&self) -> Vec<Variable<Self>> {
        vec![
            Variable::real("u", "Input", |model: &mut Self| &mut model.u).input(),
            Variable::real("y", "Twice the input", |model: &mut Self| &mut model.y).output(&["u"]),
            Variable::boolean("panics", "A step panics", |model: &mut Self| &mut model.panics)
                .input(),
            Variable::integer("steps", "Steps done", |model: &mut Self| &mut model.steps)
                .output(&[]),
        ]
    }

    fn initialize(&mut self, _experiment: &Experiment) -> Result<(), Failure> {
        HostileNames::step(self);
        Ok(())
    }

    fn update(&mut self, _time: f64) -> Result<(), Failure> {
        HostileNames::step(self);
        Ok(())
    }

    fn step(&mut self, _step: &Step) -> Result<(), Failure> {
        assert!(!self.panics, "it panics, as it was told");
        self.steps += 1;
        HostileNames::step(self);
        Ok(())
    }
}

/// Functions with the names of the trait's and the C interface's functions, with other arguments.
impl HostileNames {
    fn step(&mut self) {
        self.y = HostileNames::reset(self.u);
    }

    fn reset(u: f64) -> f64 {
        2.0 * u
    }
}
