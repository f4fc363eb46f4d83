//! Estimates that are far slower than the loop that uses them.

use control::eigen::eigenvalues;
use control::{Domain, Error};
use nalgebra::Complex;

use crate::report::number::rounded;
use crate::solve::solution::Solution;
use plant_file::PlantFile;
use plant_file::requirements::Requirement;
use plant_file::signals::joined;

/// An estimate that decays slower than this part of the slowest mode of the feedback is too slow for it.
const SLOW: f64 = 0.05;
/// A mode has settled within 2 % after this many time constants.
const SETTLED: f64 = 4.0;

/// Returns a warning if the slowest mode of the observer is much slower than that of the feedback: a combination of
/// faults hardly acts on the measurements. Only observers by weights or by a bandwidth are examined.
pub(crate) fn warning(file: &PlantFile<'_>, solution: &Solution) -> Result<Option<String>, Error> {
    let requirement = &file.observer.requirement;
    if !matches!(requirement, Requirement::Bandwidth(_) | Requirement::Weights { .. }) {
        return Ok(None);
    }
    let errors = solution.gains.error_dynamics(&solution.plant);
    let observer = slowest(&eigenvalues(&errors)?, solution.domain);
    let feedback = slowest(&eigenvalues(&solution.feedback_dynamics())?, solution.domain);
    // An unstable loop has other reasons.
    if observer <= 0.0 || observer >= SLOW * feedback {
        return Ok(None);
    }
    let faults = &solution.linear.faults;
    let names = joined(faults.iter().map(|fault| fault.name.as_str()));
    let cause = match faults.len() {
        1 => format!("{names} hardly acts on the measurements if it is constant"),
        _ => format!("a constant combination of {names} hardly acts on the measurements"),
    };
    Ok(Some(format!(
        "the estimates settle in {} s, the feedback in {} s: {cause}; expected fewer faults or another measurement",
        rounded(SETTLED / observer),
        rounded(SETTLED / feedback)
    )))
}

/// Returns the decay rate of the slowest mode, 1/s; of a sampled system -ln |z| / h.
fn slowest(eigenvalues: &[Complex<f64>], domain: Domain) -> f64 {
    let rate = |value: &Complex<f64>| match domain {
        Domain::Continuous => -value.re,
        Domain::Sampled { period } => -value.norm().ln() / period,
    };
    eigenvalues.iter().map(rate).fold(f64::INFINITY, f64::min)
}
