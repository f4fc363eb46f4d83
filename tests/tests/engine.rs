//! The engine: initialization, step control, events, steps in part, threads, checkpoints, scenarios.
#![expect(clippy::unwrap_used, clippy::float_cmp, reason = "tests; exact by construction")]

#[path = "engine/ahead.rs"]
mod ahead;
#[path = "engine/background.rs"]
mod background;
#[path = "engine/breaks.rs"]
mod breaks;
#[path = "engine/checkpoints.rs"]
mod checkpoints;
#[path = "engine/control.rs"]
mod control;
#[path = "engine/events.rs"]
mod events;
#[path = "engine/fallback.rs"]
mod fallback;
#[path = "engine/initial.rs"]
mod initial;
#[path = "engine/last_step.rs"]
mod last_step;
#[path = "engine/multirate.rs"]
mod multirate;
#[path = "engine/parts.rs"]
mod parts;
#[path = "engine/puppet.rs"]
mod puppet;
#[path = "engine/scenario.rs"]
mod scenario;
#[path = "engine/stepping.rs"]
mod stepping;
#[path = "engine/typed.rs"]
mod typed;

use fmu_description::Experiment;

/// From 0 to `stop` s.
fn until(stop: f64) -> Experiment {
    Experiment { stop_time: Some(stop), ..Experiment::default() }
}
