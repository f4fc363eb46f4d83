//! A clock of each type (FMI 3.0.2, section 2.2.8), with the number of its ticks.
#![forbid(unsafe_code)]

use fmu::description::IntervalVariability;
use fmu::{About, Event, Failure, Model, ModelExchange, Variable as V};

/// Counts the ticks of each clock.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
struct ClockTypes {
    constant: Ticks,
    fixed: Ticks,
    tunable: Ticks,
    changing: Ticks,
    countdown: Ticks,
    triggered: Ticks,
    /// Ticks with the countdown.
    echo: bool,
    /// Delay of the countdown in s after each third tick of `fixed`.
    delay: f64,
}

/// A clock.
#[derive(Clone, Default, serde::Serialize, serde::Deserialize)]
struct Ticks {
    active: bool,
    count: i32,
    interval: f64,
}

impl Ticks {
    /// Counts a tick; returns whether there is one.
    fn count(&mut self) -> bool {
        self.count += i32::from(self.active);
        self.active
    }
}

impl Model for ClockTypes {
    const IDENTIFIER: &'static str = "ClockTypes";

    fn about(&self) -> About {
        fmu::about!(stop_time: 1.0, step_size: 0.1)
    }

    fn new(_: &std::path::Path) -> Result<Self, Failure> {
        let every = |interval: f64| Ticks { interval, ..Ticks::default() };
        Ok(Self {
            constant: every(0.1),
            fixed: every(0.15),
            tunable: every(0.2),
            changing: every(0.05),
            countdown: every(f64::INFINITY),
            triggered: Ticks::default(),
            echo: false,
            delay: 0.07,
        })
    }

    fn variables(&self) -> Vec<V<Self>> {
        use IntervalVariability::{Changing, Countdown, Fixed, Tunable};
        let count = |name: &str, clock: &str, field: fn(&mut Self) -> &mut i32| {
            let description = format!("Number of ticks of {clock}");
            V::integer(name, description, field).output(&[]).exact().clocked_by(&[clock])
        };
        vec![
            V::periodic_clock("constant", "", 0.1, |model: &mut Self| &mut model.constant.active),
            V::timed_clock(
                "fixed",
                "",
                Fixed,
                |model: &mut Self| &mut model.fixed.active,
                |model: &mut Self| &mut model.fixed.interval,
            ),
            V::timed_clock(
                "tunable",
                "",
                Tunable,
                |model: &mut Self| &mut model.tunable.active,
                |model: &mut Self| &mut model.tunable.interval,
            ),
            V::timed_clock(
                "changing",
                "Each interval is twice the one before",
                Changing,
                |model: &mut Self| &mut model.changing.active,
                |model: &mut Self| &mut model.changing.interval,
            ),
            V::timed_clock(
                "countdown",
                "Ticks after each third tick of fixed",
                Countdown,
                |model: &mut Self| &mut model.countdown.active,
                |model: &mut Self| &mut model.countdown.interval,
            ),
            V::triggered_clock("triggered", "", |model: &mut Self| &mut model.triggered.active)
                .input(),
            V::triggered_clock("echo", "Ticks with countdown", |model: &mut Self| &mut model.echo)
                .output(&[]),
            V::real("period", "Interval of fixed", |model: &mut Self| &mut model.fixed.interval)
                .unit("s")
                .parameter(),
            V::real("beat", "Interval of tunable", |model: &mut Self| &mut model.tunable.interval)
                .unit("s")
                .tunable(),
            V::real("delay", "Delay of countdown", |model: &mut Self| &mut model.delay)
                .unit("s")
                .parameter(),
            count("n_constant", "constant", |model| &mut model.constant.count),
            count("n_fixed", "fixed", |model| &mut model.fixed.count),
            count("n_tunable", "tunable", |model| &mut model.tunable.count),
            count("n_changing", "changing", |model| &mut model.changing.count),
            count("n_countdown", "countdown", |model| &mut model.countdown.count),
            count("n_triggered", "triggered", |model| &mut model.triggered.count),
        ]
    }

    fn tick(&mut self, _time: f64) {
        self.echo = self.countdown.active;
    }

    fn event(&mut self, _time: f64) -> Result<Event, Failure> {
        self.constant.count();
        self.tunable.count();
        self.countdown.count();
        self.triggered.count();
        if self.changing.count() {
            self.changing.interval =
                0.05 * f64::from(2_u32.saturating_pow(self.changing.count.unsigned_abs()));
        }
        if self.fixed.count() && self.fixed.count % 3 == 0 {
            self.countdown.interval = self.delay;
        }
        Ok(Event::default())
    }

    fn model_exchange(&self) -> Option<ModelExchange> {
        Some(ModelExchange::default())
    }
}

fmu::export!(ClockTypes);
