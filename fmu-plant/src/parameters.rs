//! The parameters of the friction pendulum and the rules they must obey.

use num_dual::Dual64;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// All parameters of the plant, in SI units, as numbers `D`.
///
/// The defaults are the parameters that reproduce the printed `A` and `B` of R. J. Patton and
/// S. Klinkhieo, "An Adaptive Approach to Active Fault-Tolerant Control" (2009), section 4.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Parameters<D = f64> {
    /// Mass of the cart, `M` in kg.
    pub(crate) cart_mass: D,
    /// Mass of the pendulum, `m` in kg.
    pub(crate) pendulum_mass: D,
    /// Moment of inertia of the pendulum about its pivot, `J` in kg m².
    pub(crate) inertia: D,
    /// Distance from the pivot to the centre of mass of the pendulum, `l` in m.
    pub(crate) length: D,
    /// Viscous damping of the cart, `F_x` in kg/s.
    pub(crate) cart_damping: D,
    /// Viscous damping of the pivot, `F_theta` in kg m²/s.
    pub(crate) pendulum_damping: D,
    /// Gravity, `g` in m/s²; a negative value makes `theta = 0` the hanging position.
    pub(crate) gravity: D,
    /// Coulomb friction of the cart, `F_c` in N.
    pub(crate) coulomb: D,
    /// Static friction of the cart, `F_s` in N.
    pub(crate) static_friction: D,
    /// Stribeck velocity, `v_s` in m/s.
    pub(crate) stribeck_velocity: D,
    /// Exponent of the Stribeck law, `delta`.
    pub(crate) stribeck_exponent: D,
    /// Whether the rigid body is linearised about `theta = 0`; the friction is not.
    pub(crate) linearised: bool,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            cart_mass: 3.2,
            pendulum_mass: 0.535,
            inertia: 0.062,
            length: 0.365,
            cart_damping: 6.2,
            pendulum_damping: 0.009,
            gravity: 9.807,
            coulomb: 25.0,
            static_friction: 30.0,
            stribeck_velocity: 0.15,
            stribeck_exponent: 2.0,
            linearised: false,
        }
    }
}

/// A parameter whose value breaks a rule.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{name} = {value}: must be {rule}")]
pub(crate) struct Refusal {
    /// Name of the variable in the model description.
    pub(crate) name: &'static str,
    /// The refused value.
    pub(crate) value: f64,
    /// The rule for accepted values.
    pub(crate) rule: &'static str,
}

impl Parameters {
    /// Checks every rule; an error for the first parameter out of range.
    ///
    /// The rules make the mass matrix positive definite in every position
    /// (`(M + m) J > (m l)²`) and the friction law not negative and, from `F_s` to `F_c`, not
    /// increasing with speed.
    pub(crate) fn check(&self) -> Result<(), Refusal> {
        let p = self;
        let not_negative = "finite and >= 0";
        let positive = "finite and > 0";
        require("M", p.cart_mass, p.cart_mass > 0.0, positive)?;
        require("m", p.pendulum_mass, p.pendulum_mass >= 0.0, not_negative)?;
        require("l", p.length, p.length >= 0.0, not_negative)?;
        let moment = p.pendulum_mass * p.length;
        let definite = (p.cart_mass + p.pendulum_mass) * p.inertia > moment * moment;
        require("J", p.inertia, definite, "finite and such that (M + m) J > (m l)^2")?;
        require("F_x", p.cart_damping, p.cart_damping >= 0.0, not_negative)?;
        require("F_theta", p.pendulum_damping, p.pendulum_damping >= 0.0, not_negative)?;
        require("g", p.gravity, true, "finite")?;
        require("F_c", p.coulomb, p.coulomb >= 0.0, not_negative)?;
        let falling = p.static_friction >= p.coulomb;
        require("F_s", p.static_friction, falling, "finite and >= F_c")?;
        require("v_s", p.stribeck_velocity, p.stribeck_velocity > 0.0, positive)?;
        require("delta", p.stribeck_exponent, p.stribeck_exponent > 0.0, positive)
    }

    /// The parameters as dual numbers with the components of a direction; all of them are 0 without a direction.
    pub(crate) fn along(&self, direction: Option<&Self>) -> Parameters<Dual64> {
        let dual = |part: fn(&Self) -> f64| Dual64::new(part(self), direction.map_or(0.0, part));
        Parameters {
            cart_mass: dual(|p| p.cart_mass),
            pendulum_mass: dual(|p| p.pendulum_mass),
            inertia: dual(|p| p.inertia),
            length: dual(|p| p.length),
            cart_damping: dual(|p| p.cart_damping),
            pendulum_damping: dual(|p| p.pendulum_damping),
            gravity: dual(|p| p.gravity),
            coulomb: dual(|p| p.coulomb),
            static_friction: dual(|p| p.static_friction),
            stribeck_velocity: dual(|p| p.stribeck_velocity),
            stribeck_exponent: dual(|p| p.stribeck_exponent),
            linearised: self.linearised,
        }
    }
}

/// Returns a refusal unless the value is finite and its rule `holds`.
pub(crate) fn require(
    name: &'static str,
    value: f64,
    holds: bool,
    rule: &'static str,
) -> Result<(), Refusal> {
    if holds && value.is_finite() { Ok(()) } else { Err(Refusal { name, value, rule }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Place = fn(&mut Parameters) -> &mut f64;

    #[test]
    fn the_parameters_of_the_paper_are_accepted() {
        assert_eq!(Parameters::default().check(), Ok(()));
    }

    #[test]
    fn each_parameter_out_of_range_or_not_a_number_is_refused_by_its_name() {
        let cases: [(&str, f64, Place); 12] = [
            ("M", 0.0, |p| &mut p.cart_mass),
            ("m", -1.0, |p| &mut p.pendulum_mass),
            ("l", -0.1, |p| &mut p.length),
            ("J", 0.01, |p| &mut p.inertia),
            ("F_x", -1.0, |p| &mut p.cart_damping),
            ("F_theta", -1.0, |p| &mut p.pendulum_damping),
            ("g", f64::INFINITY, |p| &mut p.gravity),
            ("F_c", -1.0, |p| &mut p.coulomb),
            ("F_s", 24.0, |p| &mut p.static_friction),
            ("v_s", 0.0, |p| &mut p.stribeck_velocity),
            ("delta", 0.0, |p| &mut p.stribeck_exponent),
            ("M", f64::INFINITY, |p| &mut p.cart_mass),
        ];
        for (name, value, place) in cases {
            for refused in [value, f64::NAN] {
                let mut parameters = Parameters::default();
                *place(&mut parameters) = refused;
                let refusal = parameters.check().unwrap_err();
                assert_eq!((refusal.name, refusal.value.to_bits()), (name, refused.to_bits()));
            }
        }
    }

    #[test]
    fn a_refusal_says_name_value_and_rule() {
        let parameters = Parameters { stribeck_velocity: -0.5, ..Parameters::default() };
        let message = parameters.check().unwrap_err().to_string();
        assert_eq!(message, "v_s = -0.5: must be finite and > 0");
    }
}
