//! Theorem 1 for a design: as printed, and with P from linear matrix inequalities.

use control::Domain;
use control::lmi::Outcome;
use control::theorem1::{certify, largest_decay, smallest_radius, ultimate_bound};

use crate::budget::Budget;
use crate::matrix::rows;
use crate::report::{Certificate, FreeP, Norm, Theorem1, Ultimate};
use crate::solve::solution::Solution;
use plant_file::estimation::Law;

/// The design parameter alpha of (12) of Patton and Klinkhieo (2009); alpha cancels in delta.
const ALPHA: f64 = 1.0;

/// Largest number of observer states for which linear matrix inequalities are solved: their cost grows
/// with the sixth power.
const LARGEST_ORDER: usize = 30;

/// Returns all certificates for `designed`, with `norms` among them.
pub(crate) fn certificate(designed: &Solution, norms: Vec<Norm>, budget: &Budget) -> Certificate {
    Certificate {
        printed: printed(designed),
        free: in_time(budget, || with_p_from_inequalities(designed)),
        ultimate: in_time(budget, || ultimate(designed)),
        norms,
    }
}

/// Returns the outcome of `solve`. If the time of `budget` is over before, or when `solve` fails, the error says so.
fn in_time<T>(budget: &Budget, solve: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    if budget.is_over() {
        return Err(budget.reason());
    }
    let outcome = budget.run(solve);
    if outcome.is_err() && budget.is_over() { Err(budget.reason()) } else { outcome }
}

/// Returns the largest norm of a vector whose entries have the absolute values `bounds`; None if a bound is missing.
fn largest(bounds: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    let squares = bounds.map(|bound| bound.map(|bound| bound * bound));
    squares.sum::<Option<f64>>().map(f64::sqrt)
}

fn fault_bound(designed: &Solution) -> Result<f64, String> {
    let bounds = designed.linear.faults.iter().map(|fault| fault.bound);
    largest(bounds).ok_or_else(|| "it needs `bound` for every fault".to_owned())
}

/// Checks that the theorem applies: an augmented observer of constant faults in continuous time.
fn applies(designed: &Solution) -> Result<(), String> {
    let subject = if designed.law.law != Law::Augmented {
        "the augmented observer"
    } else if designed.domain != Domain::Continuous {
        "a controller in continuous time"
    } else if designed.plant.a_f.amax() > 0.0 {
        "constant faults"
    } else {
        return Ok(());
    };
    Err(format!("the theorem is about {subject}"))
}

/// Checks that the theorem applies, and that the observer is small enough for linear matrix inequalities.
fn solvable(designed: &Solution) -> Result<(), String> {
    applies(designed)?;
    let order = designed.plant.a.nrows() + designed.plant.f_a.ncols();
    if order > LARGEST_ORDER {
        return Err(format!(
            "linear matrix inequalities are solved for up to {LARGEST_ORDER} states of the observer, \
             found {order}"
        ));
    }
    Ok(())
}

fn printed(designed: &Solution) -> Result<Theorem1, String> {
    applies(designed)?;
    let beta = fault_bound(designed)?;
    let certificate = certify(&designed.plant, &designed.gains, ALPHA, beta);
    let certificate = certificate.map_err(|error| error.to_string())?;
    Ok(Theorem1 {
        alpha: certificate.alpha,
        beta: certificate.beta,
        p: rows(&certificate.p),
        smallest_eigenvalue: certificate.p_range.0,
        largest_eigenvalue: certificate.p_range.1,
        residual: certificate.residual,
        delta: certificate.delta,
    })
}

fn verified<T>(outcome: Result<Outcome<T>, control::Error>) -> Result<T, String> {
    match outcome {
        Ok(Outcome::Optimal(certificate)) => Ok(certificate),
        Ok(Outcome::Infeasible { conflict }) => Err(format!("infeasible: {}", conflict.join("; "))),
        Ok(Outcome::Inconclusive(reason)) => Err(format!("not proven: {reason}")),
        Err(error) => Err(error.to_string()),
    }
}

fn with_p_from_inequalities(designed: &Solution) -> Result<FreeP, String> {
    solvable(designed)?;
    let dynamics = designed.gains.error_dynamics(&designed.plant);
    let decay = verified(largest_decay(&dynamics))?;
    let beta = fault_bound(designed)?;
    let region = verified(smallest_radius(&dynamics, &designed.plant.augmented_fault(), beta))?;
    Ok(FreeP {
        decay: decay.alpha,
        decay_margin: decay.certificate.margin,
        delta: region.delta,
        p: rows(&region.p),
        margin: region.margin,
    })
}

/// Returns the ball that the error converges to for bounded rates of the faults, or why there is none.
fn ultimate(designed: &Solution) -> Result<Ultimate, String> {
    solvable(designed)?;
    let rates = designed.linear.faults.iter().map(|fault| fault.rate_bound);
    let rate = largest(rates).ok_or_else(|| "it needs `rate_bound` for every fault".to_owned())?;
    let dynamics = designed.gains.error_dynamics(&designed.plant);
    let (order, q) = (dynamics.nrows(), designed.plant.f_a.ncols());
    let mut rate_input = nalgebra::DMatrix::zeros(order, q);
    rate_input.view_mut((order - q, 0), (q, q)).fill_with_identity();
    let bound = verified(ultimate_bound(&dynamics, &rate_input, rate))?;
    let peaks = bound.peaks.iter().copied().collect();
    Ok(Ultimate { rate, radius: bound.radius, peaks, margin: bound.margin })
}
