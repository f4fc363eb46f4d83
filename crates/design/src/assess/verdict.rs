//! Judges a design by its checks, its margins and its tolerances.

use crate::plant_file::robustness::RobustnessLimits;
use crate::report::Check;
use crate::report::number::rounded;
use crate::report::robustness::{Level, Limits, Parameter, Robustness, ToleranceResult, Verdict};

/// Judges a design.
pub(crate) fn verdict(
    checks: &[Check],
    robustness: Option<&Robustness>,
    limits: &RobustnessLimits,
    further: Vec<(Level, String)>,
) -> Verdict {
    let RobustnessLimits { amber, red, tolerance, .. } = *limits;
    let stated = Limits { amber, red, tolerance };
    let mut level = Level::Green;
    let mut reasons = Vec::new();
    for check in checks.iter().filter(|check| !check.holds) {
        level = Level::Red;
        reasons.push(format!("does not hold: {}", check.condition));
    }
    for point in robustness.iter().flat_map(|found| &found.points) {
        let peak = point.judged;
        let (limit, reached) = match peak {
            peak if peak > limits.red => (limits.red, Level::Red),
            peak if peak > limits.amber => (limits.amber, Level::Amber),
            _ => continue,
        };
        if level != Level::Red {
            level = reached;
        }
        reasons.push(format!(
            "the peak of S at the {} is {peak:.3}, above {limit} ({})",
            point.point,
            reached.word()
        ));
    }
    if let Some(found) = robustness.map(|found| &found.tolerance) {
        let unstable = found.stable < 1.0 || found.worst_instability >= 0.0;
        if unstable {
            level = Level::Red;
            reasons.push(instability(found, &stated));
        }
    }
    for (reached, reason) in further {
        level = level.max(reached);
        reasons.push(reason);
    }
    Verdict { level, reasons, limits: stated }
}

/// The sentence about a loop that parameters within their tolerances make unstable.
fn instability(found: &ToleranceResult, limits: &Limits) -> String {
    let range = if found.parameters.is_empty() {
        format!("parameters within {}", limits.stated_tolerances(&found.worst))
    } else {
        let limits = |own: &Parameter| {
            let [low, high] = own.limits.map(rounded);
            format!("{} from {low} to {high}", own.name)
        };
        found.parameters.iter().map(limits).collect::<Vec<_>>().join(", ")
    };
    let worst =
        format!("the worst case found, from {:.3} of the tolerances on", found.first_unstable);
    let cases = found.cases;
    if found.stable < 1.0 {
        let unstable = 100.0 * (1.0 - found.stable);
        format!(
            "{range} make the loop unstable: {unstable:.1} % of {cases} random cases, and {worst}"
        )
    } else if cases > 0 {
        format!("{range} make the loop unstable: none of {cases} random cases, but {worst}")
    } else {
        format!("{range} make the loop unstable: {worst}")
    }
}
