//! What commands and derivatives depend on: `ModelStructure` of the controller.
//!
//! All matrices are parameters, so an element that is zero in the design counts like any other.
//! Whether the fault is compensated, and whether it is estimated, changes at events (in
//! co-simulation: in steps); so `compensate` and `time` are on none of the lists for a point in
//! time. A channel that reaches a limit switches by its own value: no linear relationship.

use fmi2::description::DependencyKind::{self, Dependent, Discrete, Fixed};

use crate::design::Design;
use crate::matrix::Matrix;
use crate::names;

/// Knowns that enter with the same kind of factor.
type Group = (DependencyKind, Vec<String>);

fn x_hat(design: &Design) -> Vec<String> {
    names::channels("x_hat", design.states.len()).collect()
}

fn f_hat(design: &Design) -> Vec<String> {
    names::channels("f_hat", design.faults.len()).collect()
}

fn measurements(design: &Design) -> Vec<String> {
    design.measurements.iter().map(|signal| signal.name.clone()).collect()
}

/// The kinds of K_x and of K_f while it compensates: factors of u, where no limit cuts it off.
fn kinds_of_feedback(limited: bool) -> [DependencyKind; 2] {
    if limited { [Dependent, Dependent] } else { [Fixed, Discrete] }
}

/// Of command `j`.
pub(crate) fn of_command(design: &Design, j: usize) -> [Group; 2] {
    let [state, fault] = kinds_of_feedback(design.actuators[j].limits.is_some());
    [(state, x_hat(design)), (fault, f_hat(design))]
}

/// Of each element of x_hat'.
pub(crate) fn of_state_slope(design: &Design) -> [Group; 3] {
    let limited = design.actuators.iter().any(|actuator| actuator.limits.is_some());
    let [state, fault] = kinds_of_feedback(limited);
    [(Fixed, measurements(design)), (state, x_hat(design)), (fault, f_hat(design))]
}

/// Of each element of f_hat'.
pub(crate) fn of_fault_slope(design: &Design) -> [Group; 2] {
    [(Discrete, measurements(design)), (Discrete, x_hat(design))]
}

fn row<'a>(name: &'a str, matrix: &'a Matrix, row: usize) -> impl Iterator<Item = String> + 'a {
    (0..matrix.columns).map(move |column| matrix.element(name, row * matrix.columns + column))
}

fn whole<'a>(name: &'a str, matrix: &'a Matrix) -> impl Iterator<Item = String> + 'a {
    (0..matrix.values.len()).map(move |k| matrix.element(name, k))
}

fn switches() -> Vec<String> {
    ["time", "compensate", "t_on"].map(str::to_owned).to_vec()
}

/// Of the initial value of command `j`.
pub(crate) fn of_initial_command(design: &Design, j: usize) -> Vec<String> {
    let mut names = switches();
    names.extend(names::starts(design));
    names.extend(row("K_x", &design.k_x, j));
    names.extend(row("K_f", &design.k_f, j));
    if design.actuators[j].limits.is_some() {
        names.extend([0, 1].map(|side| names::limit(design, side, j)));
    }
    names
}

/// Of the initial value of element `i` of x_hat'.
pub(crate) fn of_initial_state_slope(design: &Design, i: usize) -> Vec<String> {
    let mut names = measurements(design);
    names.extend((0..design.actuators.len()).flat_map(|j| of_initial_command(design, j)));
    for (name, matrix) in
        [("A", &design.a), ("B", &design.b), ("F_a", &design.f_a), ("L_x", &design.l_x)]
    {
        names.extend(row(name, matrix, i));
    }
    names.extend(whole("C", &design.c));
    names
}

/// Of the initial value of element `i` of f_hat'.
pub(crate) fn of_initial_fault_slope(design: &Design, i: usize) -> Vec<String> {
    let mut names = switches();
    names.push("monitor".to_owned());
    names.extend(measurements(design));
    names.extend(names::channels("x_hat_0", design.states.len()));
    names.extend(row("L_f", &design.l_f, i));
    names.extend(whole("C", &design.c));
    names
}
