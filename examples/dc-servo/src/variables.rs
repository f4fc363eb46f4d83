//! The variables of the servo.

use fmu::Variable;
use fmu::description::DependencyKind;

use crate::DcServo;
use crate::motor::COUNT;

/// Name, meaning, unit, value and limits.
type Row = (&'static str, &'static str, &'static str, f64, [f64; 2]);

const TIME: [f64; 2] = [-1e9, 1e9];

/// The parameters, in the order in which the equations take them.
pub(crate) const PARAMETERS: [Row; COUNT] = [
    ("R", "Armature resistance", "Ohm", 4.0, [1e-6, 1e6]),
    ("k", "Torque per current, back-EMF per velocity", "N.m/A", 0.0274, [1e-6, 1e6]),
    ("J", "Moment of inertia of rotor and load", "kg.m2", 3.2284e-6, [1e-12, 1e6]),
    ("F_v", "Viscous friction", "N.m.s/rad", 3.5077e-6, [0.0, 1e6]),
    ("T_c", "Coulomb friction", "N.m", 0.006, [0.0, 1e6]),
    ("T_s", "Static friction", "N.m", 0.008, [0.0, 1e6]),
    ("E", "Loss of effectiveness of the drive", "1", 0.0, [0.0, 1.0]),
    ("f_u", "Additive fault of the drive", "V", 0.0, [-1e6, 1e6]),
    ("r_u", "Rise of the additive fault", "V/s", 0.0, [-1e6, 1e6]),
    ("t_fault", "Time from which on the drive is faulty", "s", 0.0, TIME),
    ("t_bias", "Time from which on the sensor is biased", "s", 0.0, TIME),
    ("b_theta", "Bias of the sensor of the angle", "rad", 0.0, [-1e6, 1e6]),
];

/// The variables that acceleration and friction depend on.
const DEPENDS: [&str; 3] = ["u", "omega", "time"];

/// All variables, in the order of the description.
pub(crate) fn all() -> Vec<Variable<DcServo>> {
    let real = |name, text, unit, field: fn(&mut DcServo) -> &mut f64| {
        Variable::real(name, text, field).unit(unit)
    };
    let regime = "Sliding backward (-1), held (0), sliding forward or without friction (1)";
    let mut all = vec![
        real("u", "Voltage", "V", |m| &mut m.u).input().derivative(|m| &mut m.u_slope),
        real("theta", "Angle", "rad", |m| &mut m.state[0])
            .output(&[])
            .exact()
            .derivative(|m| &mut m.state[1]),
        real("omega", "Angular velocity", "rad/s", |m| &mut m.state[1])
            .output(&[])
            .exact()
            .reinit()
            .nominal(10.0)
            .derivative(|m| &mut m.acceleration),
        Variable::alias("der(theta)", "Angular velocity", "omega").derivative_of("theta"),
        real("der(omega)", "Angular acceleration", "rad/s2", |m| &mut m.acceleration)
            .derivative_of("omega")
            .depends(DependencyKind::Dependent, DEPENDS),
        real("theta_m", "Measured angle", "rad", |m| &mut m.measured)
            .output(&[])
            .depends(DependencyKind::Constant, ["theta"])
            .derivative(|m| &mut m.state[1]),
        real("T_f", "Dry friction", "N.m", |m| &mut m.dry_friction).output(&DEPENDS),
        real("i", "Current", "A", |m| &mut m.current),
        Variable::integer("regime", regime, |m: &mut DcServo| &mut m.regime),
        Variable::boolean("friction", "Whether there is dry friction", |m: &mut DcServo| {
            &mut m.friction
        })
        .parameter(),
    ];
    for (k, (name, text, unit, _, [min, max])) in PARAMETERS.into_iter().enumerate() {
        let parameter = Variable::real(name, text, move |m: &mut DcServo| &mut m.parameters[k]);
        all.push(parameter.unit(unit).range(min, max).parameter());
    }
    all
}
