//! The controller without observer, for the estimates of the Kalman filter that contains the plant's FMU.

use aso_controller::design::{Estimator, Measurement, Signal};
use aso_controller::{Design, Matrix, channel};

/// Returns the controller of `design` that takes the estimates as inputs; the plant has n states, the fault model q.
///
/// ```text
/// y = [x_filter; f_filter; measurements]     the last ones with integral action only
/// A = 0,  B = 0,  F_a = 0,  A_f = 0,  C = [I; 0; 0],  L_x = [I, 0, 0],  L_f = 0,  P_f = [0, I, 0],  H = [0, 0, H]
/// ```
///
/// So `x_hat` = `x_filter` in each sample and, while faults are estimated, `f_hat` = `f_filter` (in the first such sample
/// plus `f_hat_0`, which is 0 by default); commands, limits, references and switches are those of `design`.
///
/// # Errors
///
/// A sentence that says why there is none and what helps: with `[detection]`, `[reconfiguration]` or `[fallback]`, and
/// with direct feedthrough.
pub(crate) fn without_observer(design: &Design) -> Result<Design, &'static str> {
    if design.detection.is_some() || design.is_reconfigurable() {
        return Err(
            "a decision on faults needs the residuals of the observer; a plant file without [detection], [reconfiguration] \
             and [fallback] has one",
        );
    }
    if design.d.is_some() {
        return Err(
            "the measurements contain commands (direct feedthrough), which only the controller with an observer subtracts; \
             expected measurements without commands",
        );
    }
    let (q, m) = (design.faults.len(), design.actuators.len());
    // The states of the measurement filter are the last ones.
    let n = design.states.len() - design.filter.as_ref().map_or(0, Vec::len);
    let states = &design.states[..n];
    // Integrals act on the measurements themselves.
    let measured = if design.h.is_some() { &design.measurements[..] } else { &[] };
    let estimated = |signal: Option<&Signal>, name: &str, at: usize, count: usize| Measurement {
        name: channel(name, at, count),
        unit: signal.map_or_else(|| design.faults[at].unit.clone(), |signal| signal.unit.clone()),
        description: signal.map_or_else(
            || format!("Estimate of {}", design.faults[at].label().meaning),
            |signal| format!("Estimate of {}", signal.label().meaning),
        ),
        operating: signal.and_then(|signal| signal.operating),
        range: None,
        longest_hold: None,
    };
    let of_states = (0..n).map(|at| estimated(Some(&states[at]), "x_filter", at, n));
    let of_faults = (0..q).map(|at| estimated(None, "f_filter", at, q));
    let measurements: Vec<_> = of_states.chain(of_faults).chain(measured.iter().cloned()).collect();
    let count = measurements.len();
    let k_x = filled(m, n, |i, j| design.k_x.row(i)[j]);
    let before = n + q;
    Ok(Design {
        estimator: Some(Estimator::Current),
        filter: None,
        a: filled(n, n, |_, _| 0.0),
        b: filled(n, m, |_, _| 0.0),
        c: filled(count, n, unit),
        f_a: filled(n, q, |_, _| 0.0),
        a_f: Some(filled(q, q, |_, _| 0.0)),
        p_f: Some(filled(q, count, |i, j| unit(n + i, j))),
        sliding_mode: None,
        k_x,
        l_x: filled(n, count, unit),
        l_f: filled(q, count, |_, _| 0.0),
        h: design.h.as_ref().map(|h| {
            filled(h.rows, count, |i, j| if j < before { 0.0 } else { h.row(i)[j - before] })
        }),
        states: states.to_vec(),
        measurements,
        ..design.clone()
    })
}

/// Returns the element (i, j) of the unit matrix.
fn unit(i: usize, j: usize) -> f64 {
    if i == j { 1.0 } else { 0.0 }
}

fn filled(rows: usize, columns: usize, element: impl Fn(usize, usize) -> f64) -> Matrix {
    let positions = (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j)));
    Matrix { rows, columns, values: positions.map(|(i, j)| element(i, j)).collect() }
}
