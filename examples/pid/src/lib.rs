//! A sampled PID controller as an FMU: the law of `law.rs` with a mode, a clock and a status.
#![forbid(unsafe_code)]

mod law;
use fmu::{About, Enumeration, Experiment, Failure, Model, Step, Variable as V};

#[derive(Clone, serde::Serialize, serde::Deserialize)]
struct Pid {
    law: law::Law,
    samples: i32,
    status: String,
    next: f64, // time of the next sample in s
}

impl Model for Pid {
    const IDENTIFIER: &'static str = "Pid";

    fn about(&self) -> About {
        About { description: "Sampled PID controller".to_owned(), ..About::default() }
    }

    fn new(_resources: &std::path::Path) -> Result<Self, Failure> {
        Ok(Self { law: law::Law::new(), samples: 0, status: String::new(), next: 0.0 })
    }

    fn variables(&self) -> Vec<V<Self>> {
        let modes = Enumeration::new("Mode", [("off", 0), ("manual", 1), ("automatic", 2)]);
        let real = |(name, text, unit, [min, max], field): law::Real| {
            V::real(name, text, move |m: &mut Self| field(&mut m.law)).unit(unit).range(min, max)
        };
        let mut all = law::INPUTS.map(|row| real(row).input()).into_iter().collect::<Vec<_>>();
        all.extend(law::PARAMETERS.map(|row| real(row).tunable()));
        all.extend([
            V::enumeration("mode", "What u is", modes, |m: &mut Self| &mut m.law.mode).input(),
            V::boolean("anti_windup", "Hold at limits", |m: &mut Self| &mut m.law.hold).parameter(),
            V::real("u", "Command", |m: &mut Self| &mut m.law.u).discrete().output(&[]),
            V::integer("samples", "Samples taken", |m: &mut Self| &mut m.samples).output(&[]),
            V::string("status", "Mode and limit", |m: &mut Self| &mut m.status).output(&[]),
        ]);
        all
    }

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Failure> {
        (self.status, self.samples, self.next) = (self.law.start(), 0, experiment.start_time);
        Ok(())
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        let failure = || Failure::Discard("expected at most 1e8 samples in a step".to_owned());
        (step.size <= 1e8 * self.law.sample_time).then_some(()).ok_or_else(failure)?;
        while self.next < step.end() - 1e-6 * self.law.sample_time {
            (self.status, self.samples) = (self.law.sample(), self.samples.saturating_add(1));
            self.next += self.law.sample_time;
        }
        Ok(())
    }
}

fmu::export!(Pid);
#[cfg(test)]
mod tests;
