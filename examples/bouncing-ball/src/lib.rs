//! A bouncing ball: h' = v, v' = g; at each impact on the ground, v becomes -e v.
#![forbid(unsafe_code)]

use fmu::{About, Failure, Model, Step, Variable};

#[derive(Clone, serde::Serialize, serde::Deserialize)]
struct BouncingBall {
    h: f64,
    v: f64,
    g: f64,
    e: f64,
    v_min: f64,
}

impl Model for BouncingBall {
    const IDENTIFIER: &'static str = "BouncingBall";

    fn about(&self) -> About {
        About { description: "A ball that bounces".to_owned(), ..About::default() }
    }

    fn new(_resources: &std::path::Path) -> Result<Self, Failure> {
        Ok(Self { h: 1.0, v: 0.0, g: -9.81, e: 0.7, v_min: 0.1 })
    }

    fn variables(&self) -> Vec<Variable<Self>> {
        let real = |name, text, field: fn(&mut Self) -> &mut f64| Variable::real(name, text, field);
        vec![
            real("h", "Height", |m| &mut m.h).unit("m").range(0.0, 1e6).output(&[]).exact(),
            real("v", "Velocity", |m| &mut m.v).unit("m/s").output(&[]).exact(),
            real("g", "Gravity", |m| &mut m.g).unit("m/s2").range(-1e3, -1e-3).parameter(),
            real("e", "Coefficient of restitution", |m| &mut m.e).range(0.5, 1.0).tunable(),
            real("v_min", "A slower ball stays down", |m| &mut m.v_min).unit("m/s").constant(),
        ]
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        let long = || Failure::Discard("expected steps of at most 1e4 s".to_owned());
        let mut left = (step.size <= 1e4).then_some(step.size).ok_or_else(long)?;
        while self.h > 0.0 || self.v.abs() > 0.0 {
            let speed = (self.v * self.v - 2.0 * self.g * self.h).sqrt();
            let fall = (self.v + speed) / -self.g;
            if fall > left {
                self.h = (self.h + left * (self.v + 0.5 * self.g * left)).max(f64::MIN_POSITIVE);
                self.v += self.g * left;
                return Ok(());
            }
            let up = self.e * speed;
            (left, self.h, self.v) = (left - fall, 0.0, if up < self.v_min { 0.0 } else { up });
        }
        Ok(())
    }
}

fmu::export!(BouncingBall);
#[cfg(test)]
mod tests;
