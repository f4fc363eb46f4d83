//! The motion between two events.

use super::Motion;
use crate::dormand_prince::Step;
use crate::dynamics::State;
use crate::friction::Regime;
use crate::plant::Plant;

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
        let slope = plant.derivative_at_end(regime, elapsed, &start);
        Self { plant, regime, elapsed, start, slope }
    }

    pub(super) fn step(&self, length: f64) -> Step {
        let Self { plant, regime, .. } = *self;
        let derivative = |time: f64, state: &State| plant.derivative(regime, time, state);
        let at_end = |time: f64, state: &State| plant.derivative_at_end(regime, time, state);
        Step::take(derivative, at_end, self.elapsed, &self.start, &self.slope, length)
    }

    pub(super) fn margin(&self, direction: Regime, step: &Step) -> f64 {
        self.plant.margin(self.regime, direction, self.elapsed + step.length, &step.end)
    }

    /// The longest step in s that cannot miss the fall of the friction near zero velocity.
    pub(super) fn resolving_length(&self) -> f64 {
        if self.regime == Regime::Stick {
            return f64::INFINITY;
        }
        self.plant.resolved_change(self.start[2]) / self.slope[2].abs()
    }
}
