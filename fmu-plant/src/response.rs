//! The friction and the derivative of the state as functions of state, force and regime.

use crate::dynamics::{RigidBody, State};
use crate::friction::{Regime, StribeckLaw};
use crate::functions::Functions;
use crate::number::Number;
use crate::parameters::Parameters;

/// Friction and motion at one instant, as numbers `D`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Response<D = f64> {
    /// The friction on the cart in N.
    pub(crate) friction: D,
    /// The derivative of the state.
    pub(crate) slope: State<D>,
}

impl<D: Number> Response<D> {
    /// The response of checked parameters in a regime, under the force `u + f_a` in N: friction
    /// `g(v) sign(v)` of a sliding cart, the balancing force of a held one.
    ///
    /// A force that has just jumped can exceed the largest friction; the friction is then `F_s`.
    /// Where there is no static friction, nothing holds the cart: its derivatives with respect to
    /// state and force are those of a cart without friction.
    pub(crate) fn new(
        functions: &impl Functions<D>,
        parameters: &Parameters<D>,
        regime: Regime,
        state: &State<D>,
        force: D,
    ) -> Self {
        let body = RigidBody::new(parameters);
        let law = StribeckLaw::new(parameters);
        if regime == Regime::Stick && !law.holds() {
            return Self { friction: D::zero(), slope: body.slide(functions, state, force) };
        }
        if regime == Regime::Stick {
            let friction = law.holding(body.balancing_force(functions, state, force));
            return Self { friction, slope: body.stick(functions, state) };
        }
        let friction = law.sliding(functions, regime, state[2]);
        Self { friction, slope: body.slide(functions, state, force - friction) }
    }
}
