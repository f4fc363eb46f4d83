//! A counter with a periodic clock, a triggered output clock and a triggered input clock.
#![forbid(unsafe_code)]

use fmu::{About, Event, Failure, Model, ModelExchange, Variable as V};

/// Counts ticks.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
struct Counter {
    /// Ticks every 0.1 s.
    sample: bool,
    /// Ticks with every third count.
    third: bool,
    /// Makes the counter start again.
    restart: bool,
    count: i32,
    restarts: i32,
}

impl Model for Counter {
    const IDENTIFIER: &'static str = "Counter";

    fn about(&self) -> About {
        fmu::about!(stop_time: 1.0, step_size: 0.05)
    }

    fn new(_: &std::path::Path) -> Result<Self, Failure> {
        Ok(Self { sample: false, third: false, restart: false, count: 0, restarts: 0 })
    }

    fn variables(&self) -> Vec<V<Self>> {
        vec![
            V::periodic_clock("sample", "", 0.1, |model: &mut Self| &mut model.sample),
            V::triggered_clock("third", "Every third count", |model: &mut Self| &mut model.third)
                .output(&[]),
            V::triggered_clock("restart", "", |model: &mut Self| &mut model.restart).input(),
            V::integer("count", "Counts since the restart", |model: &mut Self| &mut model.count)
                .output(&[])
                .exact()
                .clocked_by(&["sample", "restart"]),
            V::integer("restarts", "Number of restarts", |model: &mut Self| &mut model.restarts)
                .output(&[])
                .exact()
                .clocked_by(&["restart"]),
        ]
    }

    fn tick(&mut self, _time: f64) {
        self.third = self.sample && self.count % 3 == 2;
    }

    fn event(&mut self, _time: f64) -> Result<Event, Failure> {
        if self.restart {
            (self.count, self.restarts) = (0, self.restarts + 1);
        }
        self.count += i32::from(self.sample);
        Ok(Event::default())
    }

    fn model_exchange(&self) -> Option<ModelExchange> {
        Some(ModelExchange::default())
    }
}

fmu::export!(Counter);
