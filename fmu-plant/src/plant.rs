//! Body, friction law and force during one communication step.

use crate::dynamics::{Force, RigidBody, State};
use crate::friction::{Regime, StribeckLaw};
use crate::functions::{Direct, Functions, Memory};
use crate::parameters::Parameters;
use fmu::solver::{Quartic, Step};

/// Body, friction law and force.
pub(crate) struct Plant<'a> {
    body: RigidBody,
    law: StribeckLaw,
    /// The force as a polynomial of the time elapsed in the communication step.
    force: Force,
    /// Remembered values of functions at the start and the end of the last steps.
    pub(crate) memory: &'a Memory,
}

/// The first event inside an integration step, estimated by the continuous extension.
pub(crate) struct Crossing {
    /// The fraction of the step after which the event has happened.
    pub(crate) fraction: f64,
    /// The direction of sliding before a stop or after a break-away.
    pub(crate) direction: Regime,
}

impl<'a> Plant<'a> {
    pub(crate) fn new(parameters: &Parameters, force: Force, memory: &'a Memory) -> Self {
        Self { body: RigidBody::new(parameters), law: StribeckLaw::new(parameters), force, memory }
    }

    /// The derivative of the state. `functions`: [`Plant::memory`] at the start or the end of a step, [`Direct`] inside
    /// it.
    #[inline]
    pub(crate) fn derivative(
        &self,
        functions: &impl Functions<f64>,
        regime: Regime,
        elapsed: f64,
        state: &State,
    ) -> State {
        if regime == Regime::Stick {
            return self.body.stick(functions, state);
        }
        let friction = self.law.sliding(functions, regime, state[2]);
        self.body.slide(functions, state, self.force.at(elapsed) - friction)
    }

    /// The change of velocity in m/s that a step may make without missing a change of friction.
    ///
    /// The fall from static to Coulomb friction is `v_s` wide and starts at velocity zero.
    pub(crate) fn resolved_change(&self, velocity: f64) -> f64 {
        velocity.abs() + self.law.width()
    }

    /// The regime of a cart in this state, decided at rest by the balancing force.
    pub(crate) fn regime(&self, elapsed: f64, state: &State) -> Regime {
        let velocity = state[2];
        if velocity > 0.0 {
            Regime::Forward
        } else if velocity < 0.0 {
            Regime::Backward
        } else {
            self.law.regime_at_rest(self.balancing_force(elapsed, state))
        }
    }

    /// The margin to the event: for a cart that slides in this direction its velocity in m/s, for a held
    /// cart the friction in N that is left before it breaks away in this direction.
    pub(crate) fn margin(
        &self,
        regime: Regime,
        direction: Regime,
        elapsed: f64,
        state: &State,
    ) -> f64 {
        if regime == Regime::Stick {
            self.law.limit() - direction.sign() * self.balancing_force(elapsed, state)
        } else {
            direction.sign() * state[2]
        }
    }

    /// The first event inside a step; `None` if there is none.
    pub(crate) fn first_crossing(
        &self,
        regime: Regime,
        elapsed: f64,
        step: &Step<State>,
    ) -> Result<Option<Crossing>, NotFinite> {
        if regime == Regime::Stick {
            self.first_break_away(elapsed, step)
        } else {
            first_stop(regime, step)
        }
    }

    /// The first break-away of a held cart inside a step.
    fn first_break_away(
        &self,
        elapsed: f64,
        step: &Step<State>,
    ) -> Result<Option<Crossing>, NotFinite> {
        let (length, end) = (step.length(), elapsed + step.length());
        let force = self.force.at(elapsed + 0.5 * length);
        let middle = std::array::from_fn(|i| step.middle(i));
        let middle = self.body.balancing_force(&Direct, &middle, force);
        let balancing = Quartic::new(
            self.balancing(elapsed, step.start(), length),
            middle,
            self.balancing(end, step.end(), length),
        );
        if !balancing.is_finite() {
            return Err(NotFinite);
        }
        let crossing = |direction: Regime| {
            let margin = balancing.affine(self.law.limit(), -direction.sign());
            margin.first_negative().map(|fraction| Crossing { fraction, direction })
        };
        let (forward, backward) = (crossing(Regime::Forward), crossing(Regime::Backward));
        Ok(match (forward, backward) {
            (Some(one), Some(other)) if one.fraction > other.fraction => Some(other),
            (None, other) => other,
            (one, _) => one,
        })
    }

    /// The balancing force in N, and its rise in N over `length` s at its present rate.
    fn balancing(&self, elapsed: f64, state: &State, length: f64) -> (f64, f64) {
        let (force, force_rate) = (self.force.at(elapsed), self.force.rate_at(elapsed));
        let (balance, rate) = self.body.balancing(self.memory, state, force, force_rate);
        (balance, length * rate)
    }

    /// The friction in N that holds the cart in this state.
    fn balancing_force(&self, elapsed: f64, state: &State) -> f64 {
        self.body.balancing_force(self.memory, state, self.force.at(elapsed))
    }
}

/// The error of a margin to an event that is not finite.
pub(crate) struct NotFinite;

/// The first stop inside a step of a cart that slides in this direction.
fn first_stop(direction: Regime, step: &Step<State>) -> Result<Option<Crossing>, NotFinite> {
    let velocity = step.extension(2);
    if !velocity.is_finite() {
        return Err(NotFinite);
    }
    let margin = velocity.affine(0.0, direction.sign());
    Ok(margin.first_negative().map(|fraction| Crossing { fraction, direction }))
}
