//! The motion as an importer integrates it: event indicators, and what an event changes.

use super::Motion;
use crate::dynamics::Force;
use crate::friction::Regime;
use crate::parameters::Parameters;
use crate::plant::Plant;

/// Number of event indicators.
pub(crate) const INDICATORS: usize = 3;

/// The velocity in m/s that is of the order of one: its nominal value.
pub(crate) const NOMINAL_VELOCITY: f64 = 0.1;

/// How far an indicator lies above its margin, so that a margin of zero is no event.
const SHIFT: f64 = 1e-10;

impl Motion {
    /// The margins to the next event in the present regime, each relative to its nominal value and
    /// shifted by 1e-10: of a sliding cart the velocity in its direction before it stops, of a held
    /// one the friction that is left before it breaks away forward and backward. Those not in use
    /// are one.
    ///
    /// After [`Motion::settle`] under the same force all are positive.
    #[must_use]
    pub fn indicators(&self, parameters: &Parameters, force: f64) -> [f64; INDICATORS] {
        let plant = Plant::new(parameters, Force::constant(force));
        let shifted = |direction, nominal: f64| {
            plant.margin(self.regime, direction, 0.0, &self.state) / nominal + SHIFT
        };
        if self.regime != Regime::Stick {
            return [shifted(self.regime, NOMINAL_VELOCITY), 1.0, 1.0];
        }
        let limit = parameters.static_friction;
        let nominal = if limit > 0.0 { limit } else { 1.0 };
        [1.0, shifted(Regime::Forward, nominal), shifted(Regime::Backward, nominal)]
    }

    /// Decides the regime at an event; true if that changed the state.
    ///
    /// A sliding cart whose velocity has changed its sign has stopped: the velocity becomes zero.
    /// At rest the balancing force decides whether the cart is held.
    pub fn settle(&mut self, parameters: &Parameters, force: f64) -> bool {
        let stops = self.regime.sign() * self.state[2] < 0.0;
        if stops {
            self.state[2] = 0.0;
        }
        self.regime = Plant::new(parameters, Force::constant(force)).regime(0.0, &self.state);
        stops
    }
}
