//! The dependencies of commands, estimates and derivatives: `ModelStructure` of the controller.
//!
//! All matrices are parameters, so every element is a dependency, also one that is zero in the design. Compensation and
//! estimation are switched at events (in co-simulation: in steps), so at a point in time nothing depends on
//! `compensate` or `time`. A command with limits is not linear in what it depends on.
//!
//! In a continuous controller with a schedule all unknowns except y_f' and u_t' also depend on the scheduling
//! variable, with which the gains change.
//!
//! A sampled controller changes its outputs at samples only (`fmi2DoStep`, `fmi2NewDiscreteStates`),
//! so at a point in time they depend on nothing. Its initial values are the values of sample 0.

use fmu::description::DependencyKind::{self, Constant, Dependent, Discrete, Fixed};

use crate::loss::Loss;
use crate::names;
use aso_controller::Matrix;
use aso_controller::design::{Design, Estimator};
use aso_controller::{channel, channels};

/// Names of variables that an unknown depends on, with the kind of that dependency.
pub(crate) type Group = (DependencyKind, Vec<String>);

fn x_hat(design: &Design) -> Vec<String> {
    channels("x_hat", design.states.len()).collect()
}

/// The names of the fault estimates in z.
fn f_hat(design: &Design) -> Vec<String> {
    names::fault_states(design).collect()
}

fn measurements(design: &Design) -> Vec<String> {
    design.measurements.iter().map(|signal| signal.name.clone()).collect()
}

/// The references that commands depend on: all references with a feedforward, otherwise none.
fn fed_forward(design: &Design) -> Vec<String> {
    let references = if design.n_r.is_some() { &design.references[..] } else { &[] };
    references.iter().map(|signal| signal.name.clone()).collect()
}

/// The signals that the innovation is computed from: filtered measurements, or measurements.
fn observed(design: &Design) -> Vec<String> {
    match design.filter {
        Some(_) => names::filtered(design).collect(),
        None => measurements(design),
    }
}

/// The kinds of dependency of a command, `limited` or not, on x_hat and on f_hat.
fn kinds_of_feedback(design: &Design, limited: bool) -> [DependencyKind; 2] {
    match (limited, !design.is_reconfigurable()) {
        (true, _) => [Dependent, Dependent],
        (false, true) => [Fixed, Discrete],
        (false, false) => [Discrete, Discrete],
    }
}

/// The dependencies of K_x x_hat + K_f f_hat + K_i x_i + N_r r: f_hat is of kind `fault`, the others are of kind
/// `state`. With a direct term P_f, f_hat depends on x_hat and on the signals of the innovation, whose factors then
/// change with the compensation: both are of kind `fault`, too.
fn of_law(design: &Design, [state, fault]: [DependencyKind; 2]) -> Vec<Group> {
    let estimate = if design.p_f.is_some() { fault } else { state };
    let mut groups = vec![(estimate, x_hat(design)), (fault, f_hat(design))];
    groups.extend(direct(design, fault));
    let others = [names::integrals(design).collect(), fed_forward(design)];
    groups.extend(others.into_iter().filter(|names| !names.is_empty()).map(|names| (state, names)));
    groups
}

/// The dependencies of all commands: on the variables of [`of_law`] and on u_t.
fn of_feedback(design: &Design, kinds: [DependencyKind; 2]) -> Vec<Group> {
    let mut groups = of_law(design, kinds);
    groups.extend(transfers(design, true));
    groups.extend(transfers(design, false));
    groups
}

/// The dependencies on u_t of the commands with limits, or of those without; `None` if there is none.
fn transfers(design: &Design, limited: bool) -> Option<Group> {
    let mut names = Vec::new();
    for (j, name) in names::transfers(design).enumerate() {
        if design.actuators[j].limits.is_some() == limited {
            names.push(name);
        }
    }
    (!names.is_empty()).then(|| (kinds_of_feedback(design, limited)[0], names))
}

/// The dependencies of command `j`: on the variables of [`of_law`] and on the u_t of this command.
fn of_feedback_of(design: &Design, j: usize, kinds: [DependencyKind; 2]) -> Vec<Group> {
    let mut groups = of_law(design, kinds);
    let kind = if kinds[0] == Fixed { Constant } else { kinds[0] };
    groups.extend(design.transfer.map(|_| (kind, transfer(design, j))));
    groups
}

/// The dependency by a direct term on the signals of the innovation; `None` without a direct term.
fn direct(design: &Design, kind: DependencyKind) -> Option<Group> {
    design.p_f.as_ref().map(|_| (kind, observed(design)))
}

/// The dependencies of estimated fault `i` of a design with a direct term.
pub(crate) fn of_fault(design: &Design, i: usize) -> Vec<Group> {
    let integral = names::fault_states(design).nth(i).into_iter().collect();
    let groups = [(Discrete, x_hat(design)), (Constant, integral)];
    let groups = groups.into_iter().chain(direct(design, Discrete)).collect();
    groups_by_schedule(design, groups)
}

fn has_limits(design: &Design) -> bool {
    design.actuators.iter().any(|actuator| actuator.limits.is_some())
}

/// The dependencies of command `j`.
pub(crate) fn of_command(design: &Design, j: usize) -> Vec<Group> {
    let kinds = kinds_of_feedback(design, design.actuators[j].limits.is_some());
    groups_by_schedule(design, of_feedback_of(design, j, kinds))
}

/// The dependencies of a loss of effectiveness.
pub(crate) fn of_loss(design: &Design, loss: &Loss) -> Vec<Group> {
    groups_by_schedule(design, of_feedback_of(design, loss.actuator, [Dependent, Dependent]))
}

/// The name of u_t of command `j`, in a list.
fn transfer(design: &Design, j: usize) -> Vec<String> {
    vec![channel("u_t", j, design.transfers())]
}

/// The dependencies of element `i` of z'.
pub(crate) fn of_slope(design: &Design, i: usize) -> Vec<Group> {
    let groups = of_constant_slope(design, i);
    let filtered = design.filtered_at(0)..design.integral_at(0);
    if filtered.contains(&i) || i >= design.transfer_at(0) {
        groups_by_validity(design, groups)
    } else {
        groups_by_schedule(design, groups)
    }
}

/// Returns `groups`. In a controller that checks measurements, constant factors become discrete, because they change
/// when the last value replaces a measurement.
fn groups_by_validity(design: &Design, mut groups: Vec<Group>) -> Vec<Group> {
    if design.checks_measurements() {
        for (kind, _) in &mut groups {
            if matches!(kind, Constant | Fixed) {
                *kind = Discrete;
            }
        }
    }
    groups
}

/// The dependencies of element `i` of z' with constant matrices and every measurement in use.
fn of_constant_slope(design: &Design, i: usize) -> Vec<Group> {
    let (n, q) = (design.states.len(), design.faults.len());
    if i < n {
        // With a direct term, the measurements are among the dependencies of the feedback.
        let measured = design.p_f.is_none().then(|| (Fixed, observed(design)));
        let mut groups: Vec<_> = measured.into_iter().collect();
        groups.extend(of_feedback(design, kinds_of_feedback(design, has_limits(design))));
        groups
    } else if i < n + q {
        let mut groups = vec![(Discrete, observed(design)), (Discrete, x_hat(design))];
        groups.extend(design.a_f.as_ref().map(|_| (Discrete, f_hat(design))));
        groups
    } else if i >= design.transfer_at(0) {
        vec![(Fixed, transfer(design, i - design.transfer_at(0)))]
    } else if i >= design.integral_at(0) {
        of_integral_slope(design, i - design.integral_at(0))
    } else {
        let k = i - n - q;
        let mut observed = vec![design.measurements[k].name.clone()];
        // With D and a direct term, y_f is among the dependencies of the feedback.
        if design.d.is_none() || design.p_f.is_none() {
            observed.extend(names::filtered(design).nth(k));
        }
        let mut groups = vec![(Fixed, observed)];
        if design.d.is_some() {
            groups.extend(of_feedback(design, kinds_of_feedback(design, has_limits(design))));
        }
        groups
    }
}

/// The dependencies of element `k` of x_i'.
fn of_integral_slope(design: &Design, k: usize) -> Vec<Group> {
    let conditioned = design.l_w.is_some() && has_limits(design);
    let read = design.p_f.is_some() && (conditioned || design.f_i.is_some());
    let mut groups = Vec::new();
    if !(read && design.filter.is_none()) {
        groups.push((Fixed, measurements(design)));
    }
    if !(conditioned && design.n_r.is_some()) {
        groups.push((Constant, vec![design.references[k].name.clone()]));
    }
    if design.f_i.is_some() && !conditioned {
        groups.push((Fixed, f_hat(design)));
        groups.extend(design.p_f.as_ref().map(|_| (Discrete, x_hat(design))));
        groups.extend(direct(design, Discrete));
    }
    if conditioned {
        groups.extend(of_law(design, [Dependent, Dependent]));
        groups.extend(transfers(design, true));
    }
    groups
}

/// The names of the elements of one row of a matrix.
fn row<'a>(name: &'a str, matrix: &'a Matrix, row: usize) -> impl Iterator<Item = String> + 'a {
    (0..matrix.columns).map(move |column| matrix.element(name, row * matrix.columns + column))
}

/// The names of all elements of a matrix.
fn whole<'a>(name: &'a str, matrix: &'a Matrix) -> impl Iterator<Item = String> + 'a {
    (0..matrix.values.len()).map(move |k| matrix.element(name, k))
}

/// The names of the variables that decide whether the estimated faults are compensated at the start.
fn switches() -> Vec<String> {
    ["time", "compensate", "t_on"].map(str::to_owned).to_vec()
}

/// The names `x_op`, where the design has an operating point.
fn operating_states(design: &Design) -> impl Iterator<Item = String> {
    names::operating(design, "x_op", design.states.len())
}

/// The name of `u_op` of command `j`, where the design has an operating point.
fn operating_command(design: &Design, j: usize) -> Option<String> {
    names::operating(design, "u_op", design.actuators.len()).nth(j)
}

/// The names `y_op`, where the design has an operating point.
fn operating_measurements(design: &Design) -> impl Iterator<Item = String> {
    names::operating(design, "y_op", design.measurements.len())
}

/// The dependencies of the initial innovations.
fn of_innovations(design: &Design) -> Vec<String> {
    let mut names = measurements(design);
    names.extend(channels("x_hat_0", design.states.len()));
    names.extend(whole("C", &design.c));
    names.extend(operating_states(design));
    names.extend(operating_measurements(design));
    names
}

/// Whether the controller is sampled and its estimator uses the measurements of the same sample.
fn is_current(design: &Design) -> bool {
    design.estimator == Some(Estimator::Current)
}

/// The dependencies of the initial deviation of command `j` from the operating point.
fn of_initial_deviation(design: &Design, j: usize) -> Vec<String> {
    let mut names = switches();
    // A sliding-mode law replaces the initial estimates of the faults.
    let (n, q) = (design.states.len(), design.faults.len());
    let replaced = if design.sliding_mode.is_some() { n..n + q } else { 0..0 };
    let starts = names::starts(design).enumerate().filter(|(k, _)| !replaced.contains(k));
    names.extend(starts.map(|(_, name)| name));
    names.extend(row("K_x", &design.k_x, j));
    names.extend(row("K_f", &design.k_f, j));
    names.extend(operating_states(design));
    names.extend(design.k_i.iter().flat_map(|k_i| row("K_i", k_i, j)));
    if let Some(n_r) = &design.n_r {
        names.extend(row("N_r", n_r, j));
        names.extend(of_references(design));
    }
    if design.actuators[j].limits.is_some() {
        names.extend([0, 1].map(|side| names::limit(design, side, j)));
        names.extend(operating_command(design, j));
    }
    if is_current(design) {
        names.extend(of_innovations(design));
        names.extend(whole("L_x", &design.l_x));
        names.extend(whole("L_f", &design.l_f));
        names.extend(sliding_mode(design));
    } else if design.p_f.is_some() {
        names.extend(of_innovations(design));
    }
    names.extend(design.p_f.iter().flat_map(|p_f| whole("P_f", p_f)));
    names
}

/// The names of rho and delta of a sliding-mode law, if the design has one.
fn sliding_mode(design: &Design) -> impl Iterator<Item = String> {
    let count = design.sliding_mode.as_ref().map_or(0, |law| law.rho.len());
    channels("rho", count).chain(channels("delta", count))
}

/// The dependencies of the initial deviations of the references from the operating point.
fn of_references(design: &Design) -> Vec<String> {
    let references = design.references.iter().map(|signal| signal.name.clone());
    references.chain(names::operating(design, "r_op", design.references.len())).collect()
}

/// The dependencies of the initial value of command `j`.
pub(crate) fn of_initial_command(design: &Design, j: usize) -> Vec<String> {
    let mut names = of_initial_deviation(design, j);
    names.extend(operating_command(design, j));
    if may_start_at_rest(design) {
        names.extend(measurements(design));
    }
    by_schedule(design, names)
}

/// Same as [`groups_by_validity`] without a schedule. With a schedule, a single group of nonlinear dependencies with
/// all names and the scheduling variable.
pub(crate) fn groups_by_schedule(design: &Design, groups: Vec<Group>) -> Vec<Group> {
    if design.schedule.is_none() {
        return groups_by_validity(design, groups);
    }
    let names = groups.into_iter().flat_map(|(_, names)| names).collect();
    vec![(Dependent, by_schedule(design, names))]
}

/// Returns `names`. With a schedule, the scheduling variable replaces the matrices, which are then no parameters.
fn by_schedule(design: &Design, mut names: Vec<String>) -> Vec<String> {
    let Some(schedule) = &design.schedule else { return names };
    let elements =
        |(name, matrix): (&'static str, &Matrix)| whole(name, matrix).collect::<Vec<_>>();
    let elements: Vec<_> = design.matrices().flat_map(elements).collect();
    names.retain(|name| !elements.contains(name) && *name != schedule.variable);
    names.push(schedule.variable.clone());
    names
}

/// The dependencies of the initial value of a loss of effectiveness.
pub(crate) fn of_initial_loss(design: &Design, loss: &Loss) -> Vec<String> {
    let mut names = of_initial_command(design, loss.actuator);
    if design.p_f.is_some() {
        names.extend(of_initial_fault(design, loss.fault));
    } else {
        names.extend(of_initial_estimate(design, design.states.len() + loss.fault));
    }
    names
}

/// The dependencies of the initial value of estimated fault `i` of a design with a direct term.
pub(crate) fn of_initial_fault(design: &Design, i: usize) -> Vec<String> {
    let mut names: Vec<_> =
        names::starts(design).nth(design.states.len() + i).into_iter().collect();
    names.extend(switches());
    names.push("monitor".to_owned());
    names.extend(of_innovations(design));
    names.extend(design.p_f.iter().flat_map(|p_f| row("P_f", p_f, i)));
    if is_current(design) {
        names.extend(whole("L_x", &design.l_x));
        names.extend(row("L_f", &design.l_f, i));
    }
    by_schedule(design, names)
}

/// The dependencies of the initial value of element `i` of z = [x_hat; f_hat; y_f; x_i; u_t].
pub(crate) fn of_initial_estimate(design: &Design, i: usize) -> Vec<String> {
    let (n, q) = (design.states.len(), design.faults.len());
    if i >= design.transfer_at(0) {
        return Vec::new();
    }
    let may_rest = may_start_at_rest(design);
    let mut names = if may_rest { measurements(design) } else { Vec::new() };
    if i >= design.integral_at(0) {
        names.extend(names::starts(design).nth(n + q + i - design.integral_at(0)));
        return names;
    }
    if i >= n + q {
        let k = i - n - q;
        names.push(design.measurements[k].name.clone());
        if design.checks_measurements() {
            // The operating point replaces a measurement that is not used.
            names.extend(operating_measurements(design).nth(k));
        }
        return if may_rest { by_schedule(design, names) } else { names };
    }
    names.extend(names::starts(design).nth(i));
    if may_rest && i < n {
        names.extend(operating_states(design).nth(i));
    }
    if is_current(design) {
        names.extend(of_innovations(design));
        if i < n {
            names.extend(row("L_x", &design.l_x, i));
        } else {
            names.extend(switches());
            names.push("monitor".to_owned());
            names.extend(row("L_f", &design.l_f, i - n));
            // rho and delta of this fault.
            names.extend(sliding_mode(design).skip(i - n).step_by(q));
        }
    }
    if may_rest || is_current(design) { by_schedule(design, names) } else { names }
}

/// Whether the controller may rest at sample 0: some longest hold is shorter than one sample.
fn may_start_at_rest(design: &Design) -> bool {
    let is_lost = |period| design.measurements.iter().any(|y| y.most_held(period) == Some(0));
    design.sample_time.is_some_and(is_lost)
}

/// The dependencies of the initial value of element `i` of z'.
pub(crate) fn of_initial_slope(design: &Design, i: usize) -> Vec<String> {
    let (n, q) = (design.states.len(), design.faults.len());
    let names = if i >= design.transfer_at(0) {
        return Vec::new();
    } else if i < n {
        of_initial_state_slope(design, i)
    } else if i < n + q {
        of_initial_fault_slope(design, i - n)
    } else if i >= design.integral_at(0) {
        of_initial_integral_slope(design, i - design.integral_at(0))
    } else if let Some(d) = &design.d {
        let k = i - n - q;
        let mut names: Vec<_> =
            channels("filter", design.measurements.len()).skip(k).take(1).collect();
        names.extend(row("D", d, k));
        names.extend((0..design.actuators.len()).flat_map(|j| of_initial_deviation(design, j)));
        names
    } else {
        // y_f starts at y, so y_f' is 0.
        return Vec::new();
    };
    by_schedule(design, names)
}

fn of_initial_state_slope(design: &Design, i: usize) -> Vec<String> {
    let mut names = of_innovations(design);
    names.extend((0..design.actuators.len()).flat_map(|j| of_initial_deviation(design, j)));
    for (name, matrix) in
        [("A", &design.a), ("B", &design.b), ("F_a", &design.f_a), ("L_x", &design.l_x)]
    {
        names.extend(row(name, matrix, i));
    }
    names
}

fn of_initial_integral_slope(design: &Design, k: usize) -> Vec<String> {
    let mut names = measurements(design);
    names.extend(operating_measurements(design));
    names.extend(design.h.iter().flat_map(|h| row("H", h, k)));
    let referred = names::operating(design, "r_op", design.references.len());
    names.push(design.references[k].name.clone());
    names.extend(referred.skip(k).take(1));
    if let Some(f_i) = &design.f_i {
        names.extend(row("F_i", f_i, k));
        names.extend(channels("f_hat_0", design.faults.len()));
        if design.p_f.is_some() {
            names.extend((0..design.faults.len()).flat_map(|i| of_initial_fault(design, i)));
        }
    }
    if let Some(l_w) = &design.l_w {
        let limited =
            design.actuators.iter().enumerate().filter(|(_, actuator)| actuator.limits.is_some());
        for (j, _) in limited {
            names.extend(row("L_w", l_w, k).skip(j).take(1));
            names.extend(of_initial_deviation(design, j));
        }
    }
    names
}

fn of_initial_fault_slope(design: &Design, i: usize) -> Vec<String> {
    let mut names = switches();
    names.push("monitor".to_owned());
    names.extend(of_innovations(design));
    names.extend(row("L_f", &design.l_f, i));
    if let Some(a_f) = &design.a_f {
        names.extend(row("A_f", a_f, i));
        names.extend(channels("f_hat_0", design.faults.len()));
    }
    names
}
