//! The engine: initialization, step control, events, incomplete steps, threads, checkpoints,
//! scenarios.
#![expect(clippy::unwrap_used, clippy::float_cmp, reason = "tests; exact by construction")]

mod ahead;
mod aliases;
mod background;
mod breaks;
mod changes;
mod checkpoints;
mod control;
mod events;
mod fallback;
mod initial;
mod last_step;
mod memory;
mod multirate;
mod parts;
mod puppet;
mod scenario;
mod stepping;
mod typed;
mod units;

use fmu_description::Experiment;

/// From 0 to `stop` s.
fn until(stop: f64) -> Experiment {
    Experiment { stop_time: Some(stop), ..Experiment::default() }
}
