//! The variables of the friction pendulum.

use fmu::description::DependencyKind;

use super::FrictionPendulum;
use crate::motion::exchange::NOMINAL_VELOCITY;

type Variable = fmu::Variable<FrictionPendulum>;

/// A Real parameter: its name, meaning, unit and the function that borrows its field.
pub(super) type Place =
    (&'static str, &'static str, &'static str, fn(&mut FrictionPendulum) -> &mut f64);

/// The parameters that are fixed after initialization.
pub(super) const FIXED: [Place; 7] = [
    ("M", "Mass of the cart", "kg", |model| &mut model.parameters.cart_mass),
    ("m", "Mass of the pendulum", "kg", |model| &mut model.parameters.pendulum_mass),
    ("J", "Moment of inertia about the pivot", "kg.m2", |model| &mut model.parameters.inertia),
    ("l", "Distance from pivot to centre of mass", "m", |model| &mut model.parameters.length),
    ("F_x", "Viscous damping of the cart", "kg/s", |model| &mut model.parameters.cart_damping),
    ("F_theta", "Viscous damping of the pivot", "kg.m2/s", |model| {
        &mut model.parameters.pendulum_damping
    }),
    ("g", "Gravity", "m/s2", |model| &mut model.parameters.gravity),
];

/// The parameters of the friction, which may change during the run.
pub(super) const TUNABLE: [Place; 4] = [
    ("F_c", "Coulomb friction", "N", |model| &mut model.parameters.coulomb),
    ("F_s", "Static friction", "N", |model| &mut model.parameters.static_friction),
    ("v_s", "Stribeck velocity", "m/s", |model| &mut model.parameters.stribeck_velocity),
    ("delta", "Stribeck exponent", "1", |model| &mut model.parameters.stribeck_exponent),
];

/// Name, meaning, unit and nominal value of the four states.
pub(super) const STATES: [(&str, &str, &str, f64); 4] = [
    ("x_p", "Position of the cart", "m", 0.1),
    ("theta", "Angle of the pendulum from the upright position", "rad", 0.1),
    ("v_p", "Velocity of the cart", "m/s", NOMINAL_VELOCITY),
    ("omega", "Angular velocity of the pendulum", "rad/s", 1.0),
];

/// The dependencies of friction and accelerations between events: the friction depends at rest on the forces and
/// the pendulum, in motion on the velocity; the accelerations depend on the friction.
pub(super) const DEPENDS: [&str; 5] = ["u", "f_a", "theta", "v_p", "omega"];

/// The dependencies of the initial friction: at rest, all except position, mass and damping of the cart; in motion, the
/// friction law and the velocity.
pub(super) const FRICTION_INITIALLY: [&str; 15] = [
    "u",
    "f_a",
    "m",
    "J",
    "l",
    "F_theta",
    "g",
    "F_c",
    "F_s",
    "v_s",
    "delta",
    "theta_0",
    "v_p_0",
    "omega_0",
    "linearised",
];

/// Mass and damping of the cart: the initial accelerations depend on them in addition to [`FRICTION_INITIALLY`], thus on
/// all except the position.
pub(super) const CART: [&str; 2] = ["M", "F_x"];

/// All variables, in the order of the description.
pub(super) fn all() -> Vec<Variable> {
    let mut all = Vec::from(inputs());
    all.extend(outputs());
    all.extend(derivatives());
    all.extend(parameters());
    all
}

fn inputs() -> [Variable; 2] {
    [
        Variable::real("u", "Actuator force on the cart", |model| &mut model.u)
            .input()
            .unit("N")
            .derivative(|model| &mut model.u_derivatives[0])
            .derivative(|model| &mut model.u_derivatives[1]),
        Variable::real("f_a", "Additive actuator fault", |model| &mut model.f_a)
            .input()
            .unit("N")
            .derivative(|model| &mut model.f_a_derivatives[0])
            .derivative(|model| &mut model.f_a_derivatives[1]),
    ]
}

/// States, friction and regime.
fn outputs() -> Vec<Variable> {
    let mut all = Vec::new();
    for (k, (name, text, unit, nominal)) in STATES.into_iter().enumerate() {
        let state = Variable::real(name, text, move |model| &mut model.motion.state_mut()[k])
            .output(&[])
            .unit(unit)
            .nominal(nominal)
            .initially([format!("{name}_0")])
            .derivative(move |model| &mut model.slope[k]);
        all.push(if name == "v_p" { state.reinit() } else { state });
    }
    all.push(
        Variable::real("f_fric", "Friction force on the cart", |model| &mut model.f_fric)
            .output(&DEPENDS)
            .unit("N")
            .initially(FRICTION_INITIALLY)
            .derivative(FrictionPendulum::friction_rate),
    );
    let text = "Sliding backward (-1), sticking (0), sliding forward (1)";
    all.push(Variable::integer("regime", text, |model| &mut model.regime));
    all
}

/// The derivatives of the states.
fn derivatives() -> [Variable; 4] {
    let rate = |text: &str, state: &str, of: &str| {
        Variable::alias(format!("der({state})"), text, of)
            .derivative_of(state)
            .initially([format!("{of}_0")])
    };
    let acceleration = |text: &str, state: &str, unit: &str, k: usize| {
        Variable::real(format!("der({state})"), text, move |model| &mut model.slope[k])
            .unit(unit)
            .derivative_of(state)
            .depends(DependencyKind::Dependent, DEPENDS)
            .initially(FRICTION_INITIALLY.into_iter().chain(CART))
    };
    [
        rate("Derivative of x_p: v_p", "x_p", "v_p"),
        rate("Derivative of theta: omega", "theta", "omega"),
        acceleration("Acceleration of the cart", "v_p", "m/s2", 2),
        acceleration("Angular acceleration of the pendulum", "omega", "rad/s2", 3),
    ]
}

fn parameters() -> Vec<Variable> {
    let mut all = Vec::new();
    for (name, text, unit, place) in FIXED {
        all.push(Variable::real(name, text, place).unit(unit).parameter());
    }
    for (name, text, unit, place) in TUNABLE {
        all.push(Variable::real(name, text, place).unit(unit).tunable());
    }
    for (k, (name, text, unit, _)) in STATES.into_iter().enumerate() {
        let text = format!("Initial value: {text}");
        all.push(
            Variable::real(format!("{name}_0"), text, move |model| &mut model.initial[k])
                .unit(unit)
                .parameter(),
        );
    }
    let text = "Rigid body linearised about the upright position, friction as it is";
    all.push(
        Variable::boolean("linearised", text, |model| &mut model.parameters.linearised).parameter(),
    );
    all
}
