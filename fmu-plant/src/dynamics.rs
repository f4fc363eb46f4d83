//! The rigid body of equation (20) and the force on the cart.

use crate::functions::Functions;
use crate::number::Number;
use crate::parameters::Parameters;

/// The state `[x_p, theta, v_p, omega]` in m, rad, m/s, rad/s: position of the cart, angle of the pendulum, and their
/// velocities; also the derivative of the state.
pub(crate) type State<D = f64> = [D; 4];

/// The force on the cart without friction, `u + f_a`, as a polynomial of time:
/// `value + slope (t - start) + curvature (t - start)² / 2`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Force {
    /// Force at `start`, in N.
    pub(crate) value: f64,
    /// First derivative of the force at `start`, in N/s.
    pub(crate) slope: f64,
    /// Second derivative of the force, in N/s².
    pub(crate) curvature: f64,
    /// The time in s to which `value` and `slope` belong.
    pub(crate) start: f64,
}

impl Force {
    /// A force that does not change.
    pub(crate) fn constant(value: f64) -> Self {
        Self { value, slope: 0.0, curvature: 0.0, start: 0.0 }
    }

    /// The force at a time in s, in N.
    pub(crate) fn at(&self, time: f64) -> f64 {
        let elapsed = time - self.start;
        self.value + elapsed * (self.slope + 0.5 * elapsed * self.curvature)
    }

    /// The derivative of the force at a time in s, in N/s.
    pub(crate) fn rate_at(&self, time: f64) -> f64 {
        self.slope + (time - self.start) * self.curvature
    }

    /// Whether the force does not change.
    pub(crate) fn is_constant(&self) -> bool {
        self.slope == 0.0 && self.curvature == 0.0
    }

    /// Whether all coefficients are finite.
    pub(crate) fn is_finite(&self) -> bool {
        [self.value, self.slope, self.curvature, self.start].iter().all(|part| part.is_finite())
    }

    /// The force as a polynomial of the time elapsed since `origin`.
    pub(crate) fn seen_from(&self, origin: f64) -> Self {
        Self {
            value: self.at(origin),
            slope: self.rate_at(origin),
            curvature: self.curvature,
            start: 0.0,
        }
    }
}

/// Cart and pendulum, equation (20) with the missing `l` and dot restored, letters as in [`Parameters`]:
///
/// `(M + m) x_p'' + F_x x_p' + m l (theta'' cos theta - theta'² sin theta) = u - f`
///
/// `J theta'' + F_theta theta' - m l g sin theta + m l x_p'' cos theta = 0`
///
/// The linearised body has `sin theta -> theta`, `cos theta -> 1`, `theta'² sin theta -> 0`; its
/// state matrices are the paper's `A` and `B`.
///
/// Method: the 2 x 2 mass matrix is inverted in closed form; its determinant `(M + m) J - (m l cos theta)²` is positive
/// for checked parameters. Source: Patton and Klinkhieo (2009), equation (20).
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RigidBody<D = f64> {
    total_mass: D,
    coupling: D,
    inertia: D,
    inverse_inertia: D,
    weight: D,
    cart_damping: D,
    pendulum_damping: D,
    linearised: bool,
}

/// Sine, cosine and centrifugal term of an angle; in a linearised body their linear parts.
struct Position<D> {
    sine: D,
    cosine: D,
    centrifugal: D,
}

impl<D: Number> RigidBody<D> {
    /// Creates the body from checked parameters.
    pub(crate) fn new(parameters: &Parameters<D>) -> Self {
        let coupling = parameters.pendulum_mass * parameters.length;
        Self {
            total_mass: parameters.cart_mass + parameters.pendulum_mass,
            coupling,
            inertia: parameters.inertia,
            inverse_inertia: parameters.inertia.recip(),
            weight: coupling * parameters.gravity,
            cart_damping: parameters.cart_damping,
            pendulum_damping: parameters.pendulum_damping,
            linearised: parameters.linearised,
        }
    }

    /// The terms of `angle` and its `rate` in the equations.
    #[inline]
    fn position(&self, functions: &impl Functions<D>, angle: D, rate: D) -> Position<D> {
        if self.linearised {
            return Position { sine: angle, cosine: D::one(), centrifugal: D::zero() };
        }
        let (sine, cosine) = functions.sine_and_cosine(angle);
        Position { sine, cosine, centrifugal: rate * rate * sine }
    }

    /// Derivative of the state of a sliding cart under `net_force`, the force less the friction
    /// in N.
    #[inline]
    pub(crate) fn slide(
        &self,
        functions: &impl Functions<D>,
        state: &State<D>,
        net_force: D,
    ) -> State<D> {
        let [_, angle, velocity, rate] = *state;
        let at = self.position(functions, angle, rate);
        let push = net_force - self.cart_damping * velocity + self.coupling * at.centrifugal;
        let torque = self.weight * at.sine - self.pendulum_damping * rate;
        let lever = self.coupling * at.cosine;
        let inverse = (self.total_mass * self.inertia - lever * lever).recip();
        let acceleration = (self.inertia * push - lever * torque) * inverse;
        let turn = (self.total_mass * torque - lever * push) * inverse;
        [velocity, rate, acceleration, turn]
    }

    /// Derivative of the state of a cart held at rest: `J theta'' = m l g sin theta - F_theta theta'`.
    #[inline]
    pub(crate) fn stick(&self, functions: &impl Functions<D>, state: &State<D>) -> State<D> {
        let [_, angle, _, rate] = *state;
        let sine = if self.linearised { angle } else { functions.sine(angle) };
        let torque = self.weight * sine - self.pendulum_damping * rate;
        [D::zero(), rate, D::zero(), torque * self.inverse_inertia]
    }

    /// The friction in N that keeps a cart at rest: (20) with `x_p' = x_p'' = 0`, solved for `f`,
    ///
    /// `f = u + m l theta'² sin theta - (m l / J) cos theta (m l g sin theta - F_theta theta')`.
    #[inline]
    pub(crate) fn balancing_force(
        &self,
        functions: &impl Functions<D>,
        state: &State<D>,
        force: D,
    ) -> D {
        let [_, angle, _, rate] = *state;
        let at = self.position(functions, angle, rate);
        let torque = self.weight * at.sine - self.pendulum_damping * rate;
        force + self.coupling * (at.centrifugal - at.cosine * torque * self.inverse_inertia)
    }
}

impl RigidBody {
    /// The balancing force in N, and its time derivative in N/s while the cart is held and the force
    /// changes at `force_rate` in N/s.
    #[inline]
    pub(crate) fn balancing(
        &self,
        functions: &impl Functions<f64>,
        state: &State,
        force: f64,
        force_rate: f64,
    ) -> (f64, f64) {
        let [_, angle, _, rate] = *state;
        let at = self.position(functions, angle, rate);
        let torque = self.weight * at.sine - self.pendulum_damping * rate;
        let lever = at.cosine * torque;
        let balance = force + self.coupling * (at.centrifugal - lever * self.inverse_inertia);
        let turn = torque * self.inverse_inertia;
        let sine_rate = at.cosine * rate;
        let (cosine_rate, centrifugal_rate) = if self.linearised {
            (0.0, 0.0)
        } else {
            (-at.sine * rate, 2.0 * rate * turn * at.sine + rate * rate * sine_rate)
        };
        let torque_rate = self.weight * sine_rate - self.pendulum_damping * turn;
        let lever_rate = cosine_rate * torque + at.cosine * torque_rate;
        let change = centrifugal_rate - lever_rate * self.inverse_inertia;
        (balance, force_rate + self.coupling * change)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::functions::Direct;

    const STATES: [State; 3] =
        [[0.2, 0.4, 0.7, -1.3], [0.0, -2.5, -1.1, 4.0], [1.0, 7.0, 0.0, 0.3]];

    fn bodies() -> [RigidBody; 2] {
        let nonlinear = Parameters::default();
        let linearised = Parameters { linearised: true, ..Parameters::default() };
        [RigidBody::new(&nonlinear), RigidBody::new(&linearised)]
    }

    #[test]
    fn the_accelerations_of_the_sliding_body_satisfy_equation_20() {
        let p = Parameters::default();
        let moment = p.pendulum_mass * p.length;
        for state in STATES {
            let [_, angle, v, rate] = state;
            let [_, _, a, turn] = bodies()[0].slide(&Direct, &state, 12.0);
            let cart = (p.cart_mass + p.pendulum_mass) * a
                + p.cart_damping * v
                + moment * (turn * angle.cos() - rate * rate * angle.sin())
                - 12.0;
            let pendulum = p.inertia * turn + p.pendulum_damping * rate
                - moment * p.gravity * angle.sin()
                + moment * a * angle.cos();
            assert!(cart.abs() < 1e-12 && pendulum.abs() < 1e-13, "{cart} {pendulum}");
        }
    }

    #[test]
    fn the_linearised_body_has_the_printed_matrices() {
        let printed = [
            ([0.0, 0.0, 0.0, 0.0], 0.0, [0.0, 0.0, 0.3205, -1.0095]),
            ([1.0, 0.0, 0.0, 0.0], 1.0, [0.0, 0.0, 0.0, 0.0]),
            ([0.0, 1.0, 0.0, 0.0], 1.0, [0.0, 0.0, -1.9333, 36.9771]),
            ([0.0, 0.0, 1.0, 0.0], 1.0, [1.0, 0.0, -1.9872, 6.2589]),
            ([0.0, 0.0, 0.0, 1.0], 1.0, [0.0, 1.0, 0.0091, -0.1738]),
        ];
        let body = &bodies()[1];
        for (state, factor, column) in printed {
            let derivative = body.slide(&Direct, &state, 1.0 - factor);
            for (computed, printed) in derivative.iter().zip(column) {
                assert!((computed - printed).abs() < 6e-5, "{computed} {printed}");
            }
        }
    }

    #[test]
    fn the_linearised_body_is_the_tangent_of_the_nonlinear_one() {
        let [nonlinear, linearised] = bodies();
        let small = [0.0, 1e-4, 2e-4, -3e-4];
        let difference = |i: usize| {
            nonlinear.slide(&Direct, &small, 1e-3)[i] - linearised.slide(&Direct, &small, 1e-3)[i]
        };
        assert!(difference(2).abs() < 1e-10 && difference(3).abs() < 1e-10);
    }

    #[test]
    fn the_balancing_force_leaves_the_cart_without_acceleration() {
        for body in bodies() {
            for mut state in STATES {
                state[2] = 0.0;
                let friction = body.balancing_force(&Direct, &state, 12.0);
                let [_, _, acceleration, turn] = body.slide(&Direct, &state, 12.0 - friction);
                assert!(acceleration.abs() < 1e-12, "{acceleration}");
                assert!((turn - body.stick(&Direct, &state)[3]).abs() < 1e-10);
            }
        }
    }

    #[test]
    fn the_balancing_rate_is_the_derivative_along_the_held_motion() {
        for body in bodies() {
            for mut state in STATES {
                state[2] = 0.0;
                let slope = body.stick(&Direct, &state);
                let along = |t: f64| {
                    let turn_rate =
                        (body.stick(&Direct, &offset(&state, &slope, 1e-6))[3] - slope[3]) / 1e-6;
                    let mut moved = offset(&state, &slope, t);
                    moved[1] += 0.5 * t * t * slope[3];
                    moved[3] += 0.5 * t * t * turn_rate;
                    body.balancing_force(&Direct, &moved, 5.0 + 3.0 * t)
                };
                let numeric = (along(1e-5) - along(-1e-5)) / 2e-5;
                let (force, rate) = body.balancing(&Direct, &state, 5.0, 3.0);
                assert_eq!(force.to_bits(), body.balancing_force(&Direct, &state, 5.0).to_bits());
                assert!((numeric - rate).abs() < 1e-6 * rate.abs().max(1.0), "{numeric} {rate}");
            }
        }
    }

    fn offset(state: &State, slope: &State, time: f64) -> State {
        std::array::from_fn(|i| state[i] + time * slope[i])
    }

    #[test]
    fn a_force_seen_from_another_origin_is_the_same_force() {
        let force = Force { value: 3.0, slope: -2.0, curvature: 8.0, start: 1.5 };
        let seen = force.seen_from(2.0);
        assert_eq!(force.at(1.5).to_bits(), 3.0_f64.to_bits());
        assert!((force.at(2.5) - (3.0 - 2.0 + 4.0)).abs() < 1e-14);
        assert!((seen.at(0.5) - force.at(2.5)).abs() < 1e-14);
        assert!((seen.rate_at(0.5) - 6.0).abs() < 1e-14);
    }
}
