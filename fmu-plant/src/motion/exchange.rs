//! The motion as an importer integrates it: event indicators, and what an event changes.
//!
//! An importer finds an event to within its own accuracy: at the event the velocity is small, but of
//! either sign and rarely zero. Where the velocity of the cart decays exponentially, as in a closed
//! loop whose feedback balances the friction, only rounding changes its sign, if anything does. So the
//! regime is decided by the stored regime, a threshold on the velocity and the sign of the
//! acceleration, never by the sign of the velocity alone.

use super::Motion;
use crate::dynamics::Force;
use crate::friction::Regime;
use crate::parameters::Parameters;
use crate::plant::Plant;

/// Number of event indicators.
pub(crate) const INDICATORS: usize = 3;

/// The nominal value of the velocity in m/s.
pub(crate) const NOMINAL_VELOCITY: f64 = 0.1;

/// The nominal value of the acceleration in m/s².
const NOMINAL_ACCELERATION: f64 = 1.0;

/// A cart that slides at most this fast, in m/s, and becomes slower has stopped.
const REST: f64 = 1e-8 * NOMINAL_VELOCITY;

/// In event mode, a cart that slides at most this fast, in m/s, may have stopped: faster than [`REST`], because the
/// importer may locate the stop a little too early.
const LANDING: f64 = 10.0 * REST;

/// The excess of the force on a held cart over the static friction at its break-away, as a fraction of the static
/// friction: more than an importer's integration errors, which would free the cart at once.
const EXCESS: f64 = 1e-6;

/// The excess in N without static friction, so that a force of zero is no event.
const FREE: f64 = 1e-10;

/// The plant at an instant as an importer sees it.
struct Instant<'a> {
    plant: Plant<'a>,
    motion: &'a Motion,
    /// The nominal value of the force in N.
    nominal: f64,
    /// How far in N the force on a held cart exceeds the static friction when the cart breaks away. With static
    /// friction this is more than the damping of a cart at the velocity [`LANDING`], so that a stopped cart is held.
    excess: f64,
    /// Whether there is static friction, so that a cart can be held.
    holds: bool,
}

impl<'a> Instant<'a> {
    fn new(motion: &'a Motion, parameters: &Parameters, force: f64) -> Self {
        let limit = parameters.static_friction;
        let holds = limit > 0.0;
        let nominal = if holds { limit } else { 1.0 };
        let excess = EXCESS * nominal + 2.0 * LANDING * parameters.cart_damping;
        Self {
            plant: Plant::new(parameters, Force::constant(force), &motion.memory),
            motion,
            nominal,
            excess: if holds { excess } else { FREE },
            holds,
        }
    }

    /// Velocity in m/s and acceleration in m/s² of a sliding cart in its direction.
    fn sliding(&self) -> [f64; 2] {
        let Motion { state, regime, .. } = self.motion;
        let slope = self.plant.derivative(self.plant.memory, *regime, 0.0, state);
        [state[2], slope[2]].map(|part| regime.sign() * part)
    }

    /// The friction in N that is left before a cart at rest breaks away in this direction.
    fn held(&self, direction: Regime) -> f64 {
        self.plant.margin(Regime::Stick, direction, 0.0, &self.motion.state)
    }

    /// The regime of a cart at rest. The cart moves if the force exceeds the static friction by half of the
    /// excess at which the indicators break it away, so that a break-away located a little too early happens.
    fn regime_at_rest(&self) -> Regime {
        let leaves = |direction: &Regime| self.held(*direction) < -0.5 * self.excess;
        [Regime::Forward, Regime::Backward].into_iter().find(leaves).unwrap_or(Regime::Stick)
    }

    /// Whether a sliding cart has stopped, decided in event mode: it is slow, and from rest it would not
    /// start in this direction.
    ///
    /// The acceleration does not decide: at an event it may have either sign.
    fn has_stopped(&self) -> bool {
        let [velocity, _] = self.sliding();
        let rests = || self.regime_at_rest() != self.motion.regime;
        velocity <= -REST || (self.holds && velocity <= LANDING && rests())
    }
}

impl Motion {
    /// The event indicators in the present regime; indicators not in use are one.
    ///
    /// The first is for the stop of a sliding cart: `max(v - r, min(a, v + r))` with `r` = 1e-8 and with its velocity
    /// `v` and acceleration `a` in its direction, relative to their nominal values; without static friction `v + r`. It
    /// is not positive if `v <= r` and `a <= 0`, or if `v <= -r`. A cart that has just broken away has `v = 0` and
    /// `a > 0`. The other two are for a held cart: the friction that is left before it breaks away forward or backward,
    /// plus the excess at a break-away, relative to the static friction.
    ///
    /// After [`Motion::settle`] under the same force, all indicators are positive.
    pub(crate) fn indicators(&self, parameters: &Parameters, force: f64) -> [f64; INDICATORS] {
        let now = Instant::new(self, parameters, force);
        if self.regime == Regime::Stick {
            let left = |direction| (now.held(direction) + now.excess) / now.nominal;
            return [1.0, left(Regime::Forward), left(Regime::Backward)];
        }
        let [velocity, acceleration] = now.sliding();
        let [falls, turned] = [-REST, REST].map(|shift| (velocity + shift) / NOMINAL_VELOCITY);
        let stop = if now.holds {
            falls.max(turned.min(acceleration / NOMINAL_ACCELERATION))
        } else {
            turned
        };
        [stop, 1.0, 1.0]
    }

    /// Decides the regime at an event; returns whether that changed the state. Does nothing if
    /// [`Motion::advance`] integrates the motion, because it decides the regime itself.
    ///
    /// A sliding cart that has stopped gets the velocity zero; the balancing force then decides whether it is held,
    /// continues or reverses. A held cart to which the importer has given a velocity slides in its direction.
    pub(crate) fn settle(&mut self, parameters: &Parameters, force: f64) -> bool {
        if self.advances {
            return false;
        }
        let now = Instant::new(self, parameters, force);
        let velocity = self.state[2];
        if self.regime == Regime::Stick {
            if velocity.abs() > REST {
                self.regime = now.plant.regime(0.0, &self.state);
                return false;
            }
        } else if !now.has_stopped() {
            return false;
        }
        self.regime = now.regime_at_rest();
        let moved = velocity != 0.0;
        if moved {
            self.state[2] = 0.0;
        }
        moved
    }
}
