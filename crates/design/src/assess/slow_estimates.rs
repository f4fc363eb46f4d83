//! Estimates that are far slower than the loop that uses them.

use control::Error;

use crate::report::number::rounded;
use crate::solve::solution::Solution;
use crate::solve::tracking::decay;
use plant_file::PlantFile;
use plant_file::requirements::{Bandwidth, Requirement};
use plant_file::signals::joined;

/// Decay rate of an estimate, relative to the slowest mode of the feedback or a lower bandwidth of the observer, below
/// which the estimate is too slow.
const SLOW: f64 = 0.05;
/// Number of time constants after which a mode has settled within 2 %.
const SETTLED: f64 = 4.0;

/// Returns a warning if the slowest mode of the observer is much slower than the slowest mode of the feedback, and than
/// the bandwidth of the observer: a combination of states and faults hardly acts on the measurements, acts less than the
/// noise of other commands, or has little noise in W. Only observers by weights or by a bandwidth are examined.
pub(crate) fn warning(file: &PlantFile<'_>, solution: &Solution) -> Result<Option<String>, Error> {
    let requirement = &file.observer.requirement;
    if !matches!(requirement, Requirement::Bandwidth(_) | Requirement::Weights { .. }) {
        return Ok(None);
    }
    let observer = decay(&solution.gains.error_dynamics(&solution.plant), solution.domain)?;
    let feedback = solution.slowest_rate()?;
    let speed = match requirement {
        Requirement::Bandwidth(Bandwidth { rate: Some(rate), .. }) => feedback.min(*rate),
        _ => feedback,
    };
    // An unstable observer fails other checks.
    if observer <= 0.0 || observer >= SLOW * speed {
        return Ok(None);
    }
    let faults = &solution.linear.faults;
    let names = joined(faults.iter().map(|fault| fault.name.as_str()));
    let [cause, remedy] = match requirement {
        Requirement::Weights { .. } => [", or has little noise in W", ", or a larger W"],
        _ if solution.linear.actuators.len() > faults.len() => {
            [", or less than the noise of other commands", ", or a higher `observer.bandwidth`"]
        }
        _ => ["", ", or a higher `observer.bandwidth`"],
    };
    let fewer = if faults.len() > 1 { "fewer faults or " } else { "" };
    Ok(Some(format!(
        "the estimates settle in {} s, the feedback in {} s: a combination of the states and \
         {names} hardly acts on the measurements{cause}; expected {fewer}another \
         measurement{remedy}",
        rounded(SETTLED / observer),
        rounded(SETTLED / feedback)
    )))
}
