//! The friction pendulum as a model: variables, initialisation and steps.

use std::path::Path;

use fmi2::description::DefaultExperiment;
use fmi2::{About, Experiment, Failure, Model, Step, Variable};
use serde::{Deserialize, Serialize};

use crate::dynamics::{Force, RigidBody};
use crate::friction::Regime;
use crate::motion::{Motion, Tolerance};
use crate::parameters::{Parameters, Refusal};

/// Inverted pendulum on a cart with Stribeck friction; fields carry the names of the variables.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct FrictionPendulum {
    parameters: Parameters,
    /// `[x_p_0, theta_0, v_p_0, omega_0]`.
    initial: [f64; 4],
    u: f64,
    f_a: f64,
    /// First and second derivatives of `u` and `f_a` at the begin of the step.
    u_derivatives: [f64; 2],
    f_a_derivatives: [f64; 2],
    /// `[x_p, theta, v_p, omega]` and its derivative.
    state: [f64; 4],
    slope: [f64; 4],
    f_fric: f64,
    regime: i32,
    tolerance: Tolerance,
    /// None before initialisation.
    motion: Option<Motion>,
}

/// The force that `u` and `f_a` exert together, as a function of the time since `start`.
fn force(model: &FrictionPendulum, start: f64) -> Force {
    let [slope, curvature] =
        [0, 1].map(|order| model.u_derivatives[order] + model.f_a_derivatives[order]);
    Force { value: model.u + model.f_a, slope, curvature, start }
}

fn refused(refusal: &Refusal) -> Failure {
    Failure::Error(refusal.to_string())
}

impl FrictionPendulum {
    /// Outputs and their derivatives from the motion, under `force` in N.
    fn show(&mut self, force: f64) {
        let Some(motion) = &self.motion else { return };
        self.state = *motion.state();
        self.f_fric = motion.friction_force(&self.parameters, force);
        self.regime = motion.regime().number();
        let body = RigidBody::new(&self.parameters);
        self.slope = match motion.regime() {
            Regime::Stick => body.stick(&self.state),
            _ => body.slide(&self.state, force - self.f_fric),
        };
    }
}

/// A Real parameter: its name, meaning, unit and place.
type Place = (&'static str, &'static str, &'static str, fn(&mut FrictionPendulum) -> &mut f64);

const FIXED: [Place; 7] = [
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

const TUNABLE: [Place; 4] = [
    ("F_c", "Coulomb friction", "N", |model| &mut model.parameters.coulomb),
    ("F_s", "Static friction", "N", |model| &mut model.parameters.static_friction),
    ("v_s", "Stribeck velocity", "m/s", |model| &mut model.parameters.stribeck_velocity),
    ("delta", "Stribeck exponent", "1", |model| &mut model.parameters.stribeck_exponent),
];

/// Name, meaning and unit of the four states.
const STATES: [(&str, &str, &str); 4] = [
    ("x_p", "Position of the cart", "m"),
    ("theta", "Angle of the pendulum from the upright position", "rad"),
    ("v_p", "Velocity of the cart", "m/s"),
    ("omega", "Angular velocity of the pendulum", "rad/s"),
];

/// What the initial friction force depends on: at rest all but the mass and the damping of the cart,
/// in motion the friction law and the velocity.
const INITIALLY: [&str; 15] = [
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

/// Inputs, outputs and the local variable.
fn signals() -> Vec<Variable<FrictionPendulum>> {
    let mut all = vec![
        Variable::real("u", "Actuator force on the cart", |model: &mut FrictionPendulum| {
            &mut model.u
        })
        .input()
        .unit("N")
        .derivative(|model| &mut model.u_derivatives[0])
        .derivative(|model| &mut model.u_derivatives[1]),
        Variable::real("f_a", "Additive actuator fault", |model: &mut FrictionPendulum| {
            &mut model.f_a
        })
        .input()
        .unit("N")
        .derivative(|model| &mut model.f_a_derivatives[0])
        .derivative(|model| &mut model.f_a_derivatives[1]),
    ];
    for (k, (name, text, unit)) in STATES.into_iter().enumerate() {
        let start = format!("{name}_0");
        all.push(
            Variable::real(name, text, move |model: &mut FrictionPendulum| &mut model.state[k])
                .output(&[])
                .unit(unit)
                .initially([start])
                .derivative(move |model| &mut model.slope[k]),
        );
    }
    all.push(
        Variable::real("f_fric", "Friction force on the cart", |model: &mut FrictionPendulum| {
            &mut model.f_fric
        })
        .output(&["u", "f_a"])
        .unit("N")
        .initially(INITIALLY),
    );
    let text = "Sliding backward (-1), sticking (0), sliding forward (1)";
    all.push(Variable::integer("regime", text, |model: &mut FrictionPendulum| &mut model.regime));
    all
}

fn parameters() -> Vec<Variable<FrictionPendulum>> {
    let mut all = Vec::new();
    for (name, text, unit, place) in FIXED {
        all.push(Variable::real(name, text, place).unit(unit).parameter());
    }
    for (name, text, unit, place) in TUNABLE {
        all.push(Variable::real(name, text, place).unit(unit).tunable());
    }
    for (k, (name, text, unit)) in STATES.into_iter().enumerate() {
        let text = format!("Initial value: {text}");
        all.push(
            Variable::real(format!("{name}_0"), text, move |model: &mut FrictionPendulum| {
                &mut model.initial[k]
            })
            .unit(unit)
            .parameter(),
        );
    }
    let text = "Rigid body linearised about the upright position, friction as it is";
    all.push(
        Variable::boolean("linearised", text, |model: &mut FrictionPendulum| {
            &mut model.parameters.linearised
        })
        .parameter(),
    );
    all
}

impl Model for FrictionPendulum {
    const IDENTIFIER: &'static str = "FrictionPendulum";

    fn about(&self) -> About {
        About {
            description: "Inverted pendulum on a cart with set-valued Stribeck friction".to_owned(),
            author: String::new(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            license: env!("CARGO_PKG_LICENSE").to_owned(),
            default_experiment: DefaultExperiment {
                start_time: Some(0.0),
                stop_time: Some(10.0),
                tolerance: Some(1e-9),
                step_size: Some(0.001),
            },
        }
    }

    fn new(_resources: &Path) -> Result<Self, Failure> {
        Ok(Self {
            parameters: Parameters::default(),
            initial: [0.1, -0.1, 0.0, 0.0],
            u: 0.0,
            f_a: 0.0,
            u_derivatives: [0.0; 2],
            f_a_derivatives: [0.0; 2],
            state: [0.0; 4],
            slope: [0.0; 4],
            f_fric: 0.0,
            regime: 0,
            tolerance: Tolerance::default(),
            motion: None,
        })
    }

    fn variables(&self) -> Vec<Variable<Self>> {
        let mut all = signals();
        all.extend(parameters());
        all
    }

    fn check(&self) -> Result<(), Failure> {
        self.parameters.check().map_err(|refusal| refused(&refusal))
    }

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Failure> {
        self.tolerance = match experiment.tolerance {
            Some(relative) => Tolerance::new(relative).map_err(|refusal| refused(&refusal))?,
            None => Tolerance::default(),
        };
        let force = self.u + self.f_a;
        let motion = Motion::start(&self.parameters, self.initial, force);
        self.motion = Some(motion.map_err(|refusal| refused(&refusal))?);
        self.show(force);
        Ok(())
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        let force = force(self, step.start);
        let Some(motion) = &mut self.motion else {
            return Err(Failure::Error("the model is not initialised".to_owned()));
        };
        let done = motion.advance(&self.parameters, &force, step.start, step.size, &self.tolerance);
        let reached = done.as_ref().map_or_else(crate::motion::Failure::time, |()| step.end());
        self.show(force.at(reached));
        done.map_err(|failure| Failure::Incomplete { time: reached, message: failure.to_string() })
    }

    fn update(&mut self, _time: f64) -> Result<(), Failure> {
        self.show(self.u + self.f_a);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn u_and_f_a_act_alike_derivatives_included() {
        let mut states = [[0; 4]; 2];
        for (which, state) in states.iter_mut().enumerate() {
            let mut model = FrictionPendulum::new(Path::new("")).unwrap();
            model.initialize(&Experiment::default()).unwrap();
            if which == 0 {
                (model.u, model.u_derivatives) = (40.0, [100.0, -3000.0]);
            } else {
                (model.f_a, model.f_a_derivatives) = (40.0, [100.0, -3000.0]);
            }
            model.step(&Step { start: 0.0, size: 0.1 }).unwrap();
            assert!(model.state[2] > 0.0, "the cart moves");
            *state = model.state.map(f64::to_bits);
        }
        assert_eq!(states[0], states[1]);
    }

    #[test]
    fn a_step_allocates_nothing_events_included() {
        let mut model = FrictionPendulum::new(Path::new("")).unwrap();
        model.initialize(&Experiment::default()).unwrap();
        let mut regimes = [false; 3];
        let allocations = allocation_counter::measure(|| {
            for k in 0..2000_u32 {
                let start = f64::from(k) * 1e-3;
                model.u = 45.0 * (9.0 * start).sin();
                model.update(start).unwrap();
                model.step(&Step { start, size: 1e-3 }).unwrap();
                regimes[usize::try_from(model.regime + 1).unwrap()] = true;
            }
        });
        assert_eq!(regimes, [true; 3]);
        assert_eq!(allocations.count_total, 0);
    }
}
