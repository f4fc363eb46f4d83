//! The motion between two events.

use super::Motion;
use crate::dynamics::State;
use crate::friction::Regime;
use crate::functions::Direct;
use crate::plant::Plant;
use fmu::solver::Step;

/// A segment of the motion in one regime, with the state and the slope at its start.
pub(super) struct Segment<'a> {
    pub(super) plant: &'a Plant<'a>,
    pub(super) regime: Regime,
    /// Time in s since the start of the communication step.
    pub(super) elapsed: f64,
    start: State,
    slope: State,
}

impl<'a> Segment<'a> {
    pub(super) fn new(plant: &'a Plant<'a>, motion: &Motion, elapsed: f64) -> Self {
        let Motion { state: start, regime, .. } = *motion;
        let slope = plant.derivative(plant.memory, regime, elapsed, &start);
        Self { plant, regime, elapsed, start, slope }
    }

    /// An integration step of this length in s from the start.
    pub(super) fn step(&self, length: f64) -> Step<State> {
        let Self { plant, regime, .. } = *self;
        let mut step = Step::new(self.start, &self.slope);
        step.take(
            |time, state, slope| *slope = plant.derivative(&Direct, regime, time, state),
            |time, state, slope| *slope = plant.derivative(plant.memory, regime, time, state),
            self.elapsed,
            length,
        );
        step
    }

    /// The margin to the event in this direction at the end of `step`; see [`Plant::margin`].
    pub(super) fn margin(&self, direction: Regime, step: &Step<State>) -> f64 {
        self.plant.margin(self.regime, direction, self.elapsed + step.length(), step.end())
    }

    /// The longest step in s that cannot miss the fall of the friction near zero velocity.
    pub(super) fn resolving_length(&self) -> f64 {
        if self.regime == Regime::Stick {
            return f64::INFINITY;
        }
        self.plant.resolved_change(self.start[2]) / self.slope[2].abs()
    }
}
