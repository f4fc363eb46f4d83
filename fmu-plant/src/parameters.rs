//! The parameters of the friction pendulum and the rules they must obey.

use num_dual::Dual64;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// All parameters of the plant, in SI units, as numbers `D`.
///
/// The defaults are the parameters that reproduce the printed `A` and `B` of R. J. Patton and
/// S. Klinkhieo, "An Adaptive Approach to Active Fault-Tolerant Control" (2009), section 4.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameters<D = f64> {
    /// Mass of the cart, `M` in kg.
    pub cart_mass: D,
    /// Mass of the pendulum, `m` in kg.
    pub pendulum_mass: D,
    /// Moment of inertia of the pendulum about its pivot, `J` in kg m².
    pub inertia: D,
    /// Distance from the pivot to the centre of mass of the pendulum, `l` in m.
    pub length: D,
    /// Viscous damping of the cart, `F_x` in kg/s.
    pub cart_damping: D,
    /// Viscous damping of the pivot, `F_theta` in kg m²/s.
    pub pendulum_damping: D,
    /// Gravity, `g` in m/s²; a negative value makes `theta = 0` the hanging position.
    pub gravity: D,
    /// Coulomb friction of the cart, `F_c` in N.
    pub coulomb: D,
    /// Static friction of the cart, `F_s` in N.
    pub static_friction: D,
    /// Stribeck velocity, `v_s` in m/s.
    pub stribeck_velocity: D,
    /// Exponent of the Stribeck law, `delta`.
    pub stribeck_exponent: D,
    /// Whether the rigid body is linearised about `theta = 0`; the friction is not.
    pub linearised: bool,
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
pub struct Refusal {
    /// Name of the variable in the model description.
    pub name: &'static str,
    /// The refused value.
    pub value: f64,
    /// The rule for accepted values.
    pub rule: &'static str,
}

impl Parameters {
    /// Checks every rule.
    ///
    /// The rules make the mass matrix positive definite in every position
    /// (`(M + m) J > (m l)²`) and the friction law not negative and, from `F_s` to `F_c`, not
    /// increasing with speed.
    ///
    /// # Errors
    /// The name, value and rule of the first parameter out of range.
    pub fn check(&self) -> Result<(), Refusal> {
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

    type Change = fn(&mut Parameters);

    #[test]
    fn the_parameters_of_the_paper_are_accepted() {
        assert_eq!(Parameters::default().check(), Ok(()));
    }

    #[test]
    fn each_parameter_out_of_range_is_refused_by_its_name() {
        let cases: [(&str, f64, Change); 12] = [
            ("M", 0.0, |p| p.cart_mass = 0.0),
            ("m", -1.0, |p| p.pendulum_mass = -1.0),
            ("l", -0.1, |p| p.length = -0.1),
            ("J", 0.01, |p| p.inertia = 0.01),
            ("F_x", -1.0, |p| p.cart_damping = -1.0),
            ("F_theta", -1.0, |p| p.pendulum_damping = -1.0),
            ("g", f64::INFINITY, |p| p.gravity = f64::INFINITY),
            ("F_c", -1.0, |p| p.coulomb = -1.0),
            ("F_s", 24.0, |p| p.static_friction = 24.0),
            ("v_s", 0.0, |p| p.stribeck_velocity = 0.0),
            ("delta", 0.0, |p| p.stribeck_exponent = 0.0),
            ("M", f64::INFINITY, |p| p.cart_mass = f64::INFINITY),
        ];
        for (name, value, change) in cases {
            let mut parameters = Parameters::default();
            change(&mut parameters);
            let refusal = parameters.check().unwrap_err();
            assert_eq!((refusal.name, refusal.value), (name, value));
        }
    }

    #[test]
    fn a_parameter_that_is_not_a_number_is_refused() {
        let changes: [(&str, Change); 11] = [
            ("M", |p| p.cart_mass = f64::NAN),
            ("m", |p| p.pendulum_mass = f64::NAN),
            ("l", |p| p.length = f64::NAN),
            ("J", |p| p.inertia = f64::NAN),
            ("F_x", |p| p.cart_damping = f64::NAN),
            ("F_theta", |p| p.pendulum_damping = f64::NAN),
            ("g", |p| p.gravity = f64::NAN),
            ("F_c", |p| p.coulomb = f64::NAN),
            ("F_s", |p| p.static_friction = f64::NAN),
            ("v_s", |p| p.stribeck_velocity = f64::NAN),
            ("delta", |p| p.stribeck_exponent = f64::NAN),
        ];
        for (name, change) in changes {
            let mut parameters = Parameters::default();
            change(&mut parameters);
            assert_eq!(parameters.check().unwrap_err().name, name);
        }
    }

    #[test]
    fn a_refusal_says_name_value_and_rule() {
        let parameters = Parameters { stribeck_velocity: -0.5, ..Parameters::default() };
        let message = parameters.check().unwrap_err().to_string();
        assert_eq!(message, "v_s = -0.5: must be finite and > 0");
    }
}
