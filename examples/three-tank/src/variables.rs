//! The variables of the three tanks.

use fmu::Variable;
use fmu::description::DependencyKind;

use crate::ThreeTank;
use crate::flows::COUNT;

/// Name, meaning, unit, value and limits.
type Row = (&'static str, &'static str, &'static str, f64, [f64; 2]);

const TIME: [f64; 2] = [-1e9, 1e9];

/// The parameters, in the order in which `flows` takes them.
pub(crate) const PARAMETERS: [Row; COUNT] = [
    ("S", "Cross-section of a tank", "m2", 0.0154, [1e-6, 1e3]),
    ("S_p", "Cross-section of a pipe", "m2", 5e-5, [0.0, 1.0]),
    ("mu_13", "Outflow coefficient from tank 1 to tank 3", "1", 0.5, [0.0, 1.0]),
    ("mu_32", "Outflow coefficient from tank 3 to tank 2", "1", 0.5, [0.0, 1.0]),
    ("mu_20", "Outflow coefficient of the outlet of tank 2", "1", 0.675, [0.0, 1.0]),
    ("g", "Gravity", "m/s2", 9.81, [1e-3, 1e3]),
    ("Q_max", "Largest flow of a pump", "m3/s", 1.2e-4, [0.0, 1.0]),
    ("h_max", "Height of a tank", "m", 0.62, [1e-3, 1e3]),
    ("f_1", "Additive fault of pump 1", "m3/s", 0.0, [-1.0, 1.0]),
    ("f_2", "Additive fault of pump 2", "m3/s", 0.0, [-1.0, 1.0]),
    ("E_1", "Loss of effectiveness of pump 1", "1", 0.0, [0.0, 1.0]),
    ("E_2", "Loss of effectiveness of pump 2", "1", 0.0, [0.0, 1.0]),
    ("t_fault_1", "Time from which on pump 1 is faulty", "s", 0.0, TIME),
    ("t_fault_2", "Time from which on pump 2 is faulty", "s", 0.0, TIME),
    ("t_bias", "Time from which on the sensors are biased", "s", 0.0, TIME),
    ("b_1", "Bias of the sensor of level 1", "m", 0.0, [-1e3, 1e3]),
    ("b_2", "Bias of the sensor of level 2", "m", 0.0, [-1e3, 1e3]),
    ("b_3", "Bias of the sensor of level 3", "m", 0.0, [-1e3, 1e3]),
];

/// The variables that the derivative of each level depends on.
const DEPENDS: [[&str; 3]; 3] =
    [["Q_1", "h_1", "h_3"], ["Q_2", "h_2", "h_3"], ["h_1", "h_2", "h_3"]];

/// All variables, in the order of the description.
pub(crate) fn all() -> Vec<Variable<ThreeTank>> {
    let real = |name: String, text: String, field: fn(&mut ThreeTank) -> &mut [f64], k: usize| {
        Variable::real(name, text, move |m: &mut ThreeTank| &mut field(m)[k])
    };
    let mut all = Vec::new();
    for (k, n) in (1..=2).enumerate() {
        let text = format!("Command of pump {n}");
        let command = real(format!("Q_{n}"), text, |m| &mut m.command, k);
        all.push(command.input().unit("m3/s").nominal(1e-4));
    }
    for (k, n) in (1..=3).enumerate() {
        let (level, slope) = (format!("h_{n}"), format!("der(h_{n})"));
        let state = real(level.clone(), format!("Level of tank {n}"), |m| &mut m.h, k);
        all.push(state.output(&[]).exact().reinit().unit("m").nominal(0.1));
        let slope = real(slope, format!("Rise of level {n}"), |m| &mut m.slope, k).unit("m/s");
        all.push(slope.derivative_of(&level).depends(DependencyKind::Dependent, DEPENDS[k]));
        let measured =
            real(format!("y_{n}"), format!("Measured level {n}"), |m| &mut m.measured, k);
        let measured = measured.output(&[]).depends(DependencyKind::Constant, [level]);
        all.push(measured.unit("m").derivative(move |m| &mut m.slope[k]));
    }
    for (k, n) in (1..=2).enumerate() {
        let text = format!("What pump {n} delivers");
        all.push(real(format!("q_0{n}"), text, |m| &mut m.pumps, k).unit("m3/s"));
    }
    for (k, (i, j)) in [(1, 3), (3, 2), (2, 0)].into_iter().enumerate() {
        let text = if j == 0 { "Outflow".into() } else { format!("Flow from tank {i} to {j}") };
        all.push(real(format!("q_{i}{j}"), text, |m| &mut m.pipes, k).unit("m3/s"));
    }
    let spill = Variable::real("q_over", "What full tanks spill", |m: &mut ThreeTank| &mut m.spill);
    all.push(spill.unit("m3/s"));
    for (k, (name, text, unit, _, [min, max])) in PARAMETERS.into_iter().enumerate() {
        let parameter = real(name.into(), text.into(), |m| &mut m.parameters, k);
        all.push(parameter.unit(unit).range(min, max).parameter());
    }
    all
}
