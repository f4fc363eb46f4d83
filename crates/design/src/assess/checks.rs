//! The conditions that a design must satisfy.

use control::distance::Distance;

use crate::plant::linear::AT_REST;
use crate::report::Check;
use crate::solve::law::measure;
use crate::solve::solution::Solution;

/// The condition of a design whose loop is stable.
pub(crate) const STABLE: &str = "plant and controller are stable together";
/// Relative size of the remaining fault effect below which the compensation counts as complete.
const CANCELLED: f64 = 1e-9;

/// Returns all conditions of the design, each with its numerical value if there is one.
pub(crate) fn checks(designed: &Solution) -> Vec<Check> {
    let mut all = Vec::from(existence(designed));
    let extended = &designed.extended;
    // Faults of sensors leave nothing to cancel.
    if extended.plant.f_a.rows(0, extended.states).amax() > 0.0 {
        all.push(check(
            "the compensation cancels the faults of the actuators",
            designed.cancellation_residual < CANCELLED,
            Some(designed.cancellation_residual),
            "norm of B K_f + F_a relative to F_a; what is left acts on the plant".to_owned(),
        ));
    }
    let margin = measure(designed.domain);
    all.push(check(
        STABLE,
        designed.instability < 0.0,
        Some(designed.instability),
        margin.to_owned(),
    ));
    all.extend(designed.instability_before.map(|value| {
        check(
            "the observer is stable before t_on, while it does not estimate the faults",
            value < 0.0,
            Some(value),
            format!("{margin}, of the states' error; `monitor = true` estimates from the start"),
        )
    }));
    all.extend(designed.linear.residual.map(|residual| {
        check(
            "the operating point is an equilibrium",
            residual < AT_REST,
            Some(residual),
            "derivatives of the states relative to what typical changes contribute".to_owned(),
        )
    }));
    all
}

/// Returns the conditions for the existence of feedback and observer. All hold, because other plants are refused
/// earlier.
fn existence(designed: &Solution) -> [Check; 3] {
    let Solution { controllability, distance, detectability, .. } = designed;
    // For a large system no lower bound is searched.
    let proven = |distance: &Distance| Some(distance.lower).filter(|lower| *lower > 0.0);
    let with_distance = |what: &str, distance: &Distance| match proven(distance) {
        Some(lower) => format!("{what}; distance from losing it, relative: {lower:.2e}"),
        None => format!(
            "{what}; distance from losing it, relative: at most {:.2e}, no lower bound is known",
            distance.upper
        ),
    };
    let observability = &detectability.observability;
    let controllable = format!("rank {} of {}", controllability.rank, controllability.n);
    let observable = format!("rank {} of {}", observability.rank, observability.n);
    let fixed = "; the other modes are stable and keep their eigenvalues";
    [
        if controllability.is_full() {
            let explanation = with_distance(&controllable, distance);
            check("(A, B) is controllable", true, proven(distance), explanation)
        } else {
            check("(A, B) is stabilisable", true, None, controllable + fixed)
        },
        if observability.is_full() {
            check("(A, C) is observable", true, None, observable)
        } else {
            check("(A, C) is detectable", detectability.is_detectable(), None, observable + fixed)
        },
        check(
            "the augmented observer exists",
            detectability.hidden.is_empty() && detectability.is_detectable(),
            proven(&detectability.distance),
            with_distance(
                "no invariant zero of (A, F_a, C) at an eigenvalue of the fault model",
                &detectability.distance,
            ),
        ),
    ]
}

fn check(condition: &str, holds: bool, value: Option<f64>, explanation: String) -> Check {
    Check { condition: condition.to_owned(), holds, value, explanation }
}
