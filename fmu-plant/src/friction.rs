//! Set-valued Stribeck friction between cart and rail, without regularisation.

use crate::functions::Functions;
use crate::number::Number;
use crate::parameters::Parameters;
use serde::{Deserialize, Serialize};

/// The motion of the cart on its rail: stick or slip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Regime {
    /// The cart slides in the negative direction.
    Backward = -1,
    /// The cart is held at rest.
    Stick = 0,
    /// The cart slides in the positive direction.
    Forward = 1,
}

impl Regime {
    /// -1, 0, +1: sliding backward, sticking, sliding forward.
    pub(crate) fn number(self) -> i32 {
        self as i32
    }

    /// The number [`Regime::number`] as `f64`.
    pub(crate) fn sign(self) -> f64 {
        f64::from(self.number())
    }
}

/// Equation (21) with the cart velocity `v`, letters as in [`Parameters`]:
/// `f = g(v) Sign(v)`, `g(v) = F_c + (F_s - F_c) exp(-(|v| / v_s)^delta)`,
/// and `Sign(0) = [-F_s, F_s] / F_s`: at rest the friction balances the other forces.
///
/// Source: Patton and Klinkhieo (2009), equation (21), with corrected exponent and velocity.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct StribeckLaw<D = f64> {
    coulomb: D,
    excess: D,
    inverse_velocity: D,
    exponent: D,
}

impl<D: Number> StribeckLaw<D> {
    /// Creates the law from checked parameters.
    pub(crate) fn new(parameters: &Parameters<D>) -> Self {
        Self {
            coulomb: parameters.coulomb,
            excess: parameters.static_friction - parameters.coulomb,
            inverse_velocity: parameters.stribeck_velocity.recip(),
            exponent: parameters.stribeck_exponent,
        }
    }

    /// `g(v)` in N for a velocity in m/s of either sign; at zero its derivative is the one from
    /// the right.
    #[inline]
    pub(crate) fn magnitude(&self, functions: &impl Functions<D>, velocity: D) -> D {
        let power = (velocity.absolute() * self.inverse_velocity).power(self.exponent);
        self.coulomb + self.excess * functions.exponential(-power)
    }

    /// The friction in N of a cart that slides in this direction, forward or backward, at this velocity in m/s.
    #[inline]
    pub(crate) fn sliding(
        &self,
        functions: &impl Functions<D>,
        direction: Regime,
        velocity: D,
    ) -> D {
        let (speed, sign) = match direction {
            Regime::Backward => (-velocity, -1.0),
            _ => (velocity, 1.0),
        };
        self.magnitude(functions, speed) * sign
    }

    /// The friction in N of a cart at rest: the balancing force, kept between `-F_s` and `F_s`.
    ///
    /// The derivative is that of the balancing force within these limits, and that of the limit beyond them.
    pub(crate) fn holding(&self, balancing: D) -> D {
        let limit = self.limit();
        if balancing > limit {
            limit
        } else if balancing >= -limit {
            balancing
        } else {
            -limit
        }
    }

    /// Whether there is static friction, so that a cart can be held.
    pub(crate) fn holds(&self) -> bool {
        self.limit() > D::zero()
    }

    /// The largest friction at rest in N: `F_s`, rounded exactly as `magnitude(0.0)` is.
    ///
    /// As both are the same number, rounding never moves a cart against the force that breaks it away.
    pub(crate) fn limit(&self) -> D {
        self.coulomb + self.excess
    }
}

impl StribeckLaw {
    /// The velocity in m/s over which the friction falls: `v_s`, or infinity if `F_s = F_c`.
    pub(crate) fn width(&self) -> f64 {
        if self.excess > 0.0 { 1.0 / self.inverse_velocity } else { f64::INFINITY }
    }

    /// The regime of a cart at velocity zero, where `balancing` in N is the friction that would hold it.
    pub(crate) fn regime_at_rest(&self, balancing: f64) -> Regime {
        if balancing > self.limit() {
            Regime::Forward
        } else if balancing < -self.limit() {
            Regime::Backward
        } else {
            Regime::Stick
        }
    }
}

#[cfg(test)]
mod tests {
    use num_dual::Dual64;

    use super::*;
    use crate::functions::Direct;

    fn law(change: impl Fn(&mut Parameters)) -> StribeckLaw {
        let mut parameters = Parameters::default();
        change(&mut parameters);
        StribeckLaw::new(&parameters)
    }

    #[test]
    fn friction_falls_from_static_at_rest_to_coulomb_at_speed() {
        let law = law(|_| ());
        assert_eq!(law.magnitude(&Direct, 0.0).to_bits(), 30.0_f64.to_bits());
        assert_eq!(law.magnitude(&Direct, -5.0).to_bits(), 25.0_f64.to_bits());
        let at_stribeck_velocity = 25.0 + 5.0 / std::f64::consts::E;
        assert!((law.magnitude(&Direct, 0.15) - at_stribeck_velocity).abs() < 1e-13);
        assert!((law.magnitude(&Direct, -0.15) - at_stribeck_velocity).abs() < 1e-13);
    }

    #[test]
    fn the_exponent_shapes_the_fall() {
        let linear = law(|p| p.stribeck_exponent = 1.0);
        let cubic = law(|p| p.stribeck_exponent = 3.0);
        assert!((linear.magnitude(&Direct, 0.3) - (25.0 + 5.0 * (-2.0_f64).exp())).abs() < 1e-13);
        assert!((cubic.magnitude(&Direct, 0.3) - (25.0 + 5.0 * (-8.0_f64).exp())).abs() < 1e-13);
    }

    /// `(v / v_s)^(delta - 1)` is beyond the range of the numbers there, and the friction is that of Coulomb.
    #[test]
    fn far_above_the_stribeck_velocity_the_friction_has_no_slope() {
        let parameters = Parameters { stribeck_exponent: 200.0, ..Parameters::default() };
        let law = StribeckLaw::new(&parameters.along(None));
        let friction = law.magnitude(&Direct, Dual64::new(20.0, 1.0));
        assert_eq!([friction.re, friction.eps].map(f64::to_bits), [25.0, 0.0].map(f64::to_bits));
    }

    #[test]
    fn the_limit_is_the_magnitude_at_rest_to_the_last_bit() {
        for coulomb in [0.1, 0.3, 7.7, 24.999_999_999] {
            let law = law(|p| p.coulomb = coulomb);
            assert_eq!(law.limit().to_bits(), law.magnitude(&Direct, 0.0).to_bits());
        }
    }

    #[test]
    fn a_cart_at_rest_is_held_up_to_the_static_friction() {
        let law = law(|_| ());
        assert_eq!(law.regime_at_rest(30.0), Regime::Stick);
        assert_eq!(law.regime_at_rest(-30.0), Regime::Stick);
        assert_eq!(law.regime_at_rest(30.000_000_1), Regime::Forward);
        assert_eq!(law.regime_at_rest(-30.000_000_1), Regime::Backward);
    }

    #[test]
    fn the_regime_number_is_the_sign_of_the_sliding_direction() {
        let numbers = [Regime::Backward, Regime::Stick, Regime::Forward].map(Regime::number);
        assert_eq!(numbers, [-1, 0, 1]);
    }
}
