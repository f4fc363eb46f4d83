//! A tank with a slow pump, a valve and a leak, as an example for linearisation.
#![forbid(unsafe_code)]

use std::path::Path;

use fmu::description::DefaultExperiment;
use fmu::description::DependencyKind::Dependent;
use fmu::{About, At, Failure, Model, ModelExchange, Step, Variable};
use serde::{Deserialize, Serialize};

/// Longest step of the Runge-Kutta method, in s.
const LONGEST: f64 = 0.05;

/// `area level' = flow - drained - leak sqrt(level)`, `drained = size valve sqrt(level)`,
/// `lag flow' = pump - flow`.
#[derive(Clone, Serialize, Deserialize)]
struct DrainedTank {
    pump: f64,
    valve: f64,
    leak: f64,
    /// Level and flow, and their derivatives.
    state: [f64; 2],
    slope: [f64; 2],
    drained: f64,
    area: f64,
    size: f64,
    lag: f64,
    /// Error added to the derivative of level' with respect to the level, for tests.
    lie: f64,
}

impl DrainedTank {
    fn slope(&self, [level, flow]: [f64; 2]) -> [f64; 2] {
        let out = (self.size * self.valve + self.leak) * level.max(0.0).sqrt();
        [(flow - out) / self.area, (self.pump - flow) / self.lag]
    }

    fn runge_kutta_step(&mut self, h: f64) {
        let at = |slope: [f64; 2], h: f64| [0, 1].map(|k| self.state[k] + h * slope[k]);
        let first = self.slope(self.state);
        let second = self.slope(at(first, 0.5 * h));
        let third = self.slope(at(second, 0.5 * h));
        let fourth = self.slope(at(third, h));
        let mean = [0, 1].map(|k| (first[k] + 2.0 * (second[k] + third[k]) + fourth[k]) / 6.0);
        self.state = at(mean, h);
    }
}

impl Model for DrainedTank {
    const IDENTIFIER: &'static str = "DrainedTank";
    const PROVIDES_DIRECTIONAL_DERIVATIVE: bool = true;

    fn about(&self) -> About {
        let default_experiment = DefaultExperiment { step_size: Some(0.05), ..Default::default() };
        let description = "Tank with a slow pump, a valve and a leak".to_owned();
        About { description, default_experiment, ..About::default() }
    }

    fn new(_resources: &Path) -> Result<Self, Failure> {
        let mut new = Self {
            pump: 1.0,
            valve: 0.5,
            leak: 0.0,
            state: [4.0, 1.0],
            slope: [0.0; 2],
            drained: 0.0,
            area: 2.0,
            size: 1.0,
            lag: 0.5,
            lie: 0.0,
        };
        new.update(0.0)?;
        Ok(new)
    }

    fn variables(&self) -> Vec<Variable<Self>> {
        let real = |name, field: fn(&mut Self) -> &mut f64| Variable::real(name, "", field);
        let all = ["level", "flow", "valve", "leak"];
        let initially = ["level", "flow", "valve", "leak", "pump", "area", "size", "lag"];
        vec![
            real("pump", |m| &mut m.pump).unit("m3/s").input(),
            real("valve", |m| &mut m.valve).range(0.0, 1.0).input(),
            real("leak", |m| &mut m.leak).range(0.0, 1.0).input(),
            real("level", |m| &mut m.state[0]).unit("m").range(0.0, 10.0).output(&[]).exact(),
            real("drained", |m| &mut m.drained).output(&["level", "valve"]).initially(initially),
            real("flow", |m| &mut m.state[1]).unit("m3/s").exact(),
            real("der(level)", |m| &mut m.slope[0])
                .derivative_of("level")
                .depends(Dependent, all)
                .initially(initially),
            real("der(flow)", |m| &mut m.slope[1])
                .derivative_of("flow")
                .depends(Dependent, ["flow", "pump"])
                .initially(initially),
            real("area", |m| &mut m.area).range(0.1, 1e3).parameter(),
            real("size", |m| &mut m.size).parameter(),
            real("lag", |m| &mut m.lag).range(1e-3, 1e3).parameter(),
            real("lie", |m| &mut m.lie).parameter(),
        ]
    }

    fn update(&mut self, _time: f64) -> Result<(), Failure> {
        self.slope = self.slope(self.state);
        self.drained = self.size * self.valve * self.state[0].max(0.0).sqrt();
        Ok(())
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        let count = (step.size / LONGEST - 1e-9).ceil().clamp(1.0, 1e6);
        let mut done = 0.0;
        while done < count {
            self.runge_kutta_step(step.size / count);
            done += 1.0;
        }
        self.update(step.end())
    }

    fn model_exchange(&self) -> Option<ModelExchange> {
        Some(ModelExchange { event_indicators: 0 })
    }

    fn differentiate(&self, _at: &At, direction: &mut Self) -> Result<(), Failure> {
        let root = self.state[0].sqrt();
        let [level, flow] = direction.state;
        let opening = self.size * self.valve + self.leak;
        let out =
            opening * 0.5 * level / root + (self.size * direction.valve + direction.leak) * root;
        direction.slope =
            [(flow - out) / self.area + self.lie * level, (direction.pump - flow) / self.lag];
        direction.drained = self.size * (self.valve * 0.5 * level / root + direction.valve * root);
        Ok(())
    }
}

fmu::export!(DrainedTank);
