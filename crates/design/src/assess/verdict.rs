//! Judges a design by its checks, its margins and its tolerances.

use crate::report::Check;
use crate::report::number::rounded;
use crate::report::robustness::{
    Level, Limits, LoopPoint, Remedy, Robustness, ToleranceResult, Verdict,
};
use plant_file::robustness::RobustnessLimits;

/// Returns the verdict on a design; `further`: reasons besides checks, peaks of S and tolerances.
pub(crate) fn verdict(
    checks: &[Check],
    robustness: Option<&Robustness>,
    limits: &RobustnessLimits,
    further: Vec<(Level, String)>,
    remedies: Vec<Remedy>,
) -> Verdict {
    let RobustnessLimits { amber, red, tolerance, .. } = *limits;
    let limits_of_levels = Limits { amber, red, tolerance };
    let (level, reasons) = (Level::Green, Vec::new());
    let mut verdict = Verdict { level, reasons, remedies, limits: limits_of_levels };
    for check in checks.iter().filter(|check| !check.holds) {
        verdict.add(Level::Red, failed(&check.condition));
    }
    let points = robustness.iter().flat_map(|figures| &figures.points);
    let of_peaks = points.filter_map(|point| peak_reason(point, limits));
    let tolerance = robustness.map(|figures| &figures.tolerance);
    let unstable = tolerance.filter(|test| test.is_unstable());
    let of_tolerances = unstable.map(|test| (Level::Red, instability(test)));
    for (level, reason) in of_peaks.chain(of_tolerances).chain(further) {
        verdict.add(level, reason);
    }
    verdict
}

/// Returns the sentence about a condition that does not hold.
pub(crate) fn failed(condition: &str) -> String {
    format!("does not hold: {condition}")
}

/// Returns the sentence about a peak of S above a limit, with the level of the verdict; None if the peak is within the
/// limits.
pub(crate) fn peak_reason(point: &LoopPoint, limits: &RobustnessLimits) -> Option<(Level, String)> {
    peak_reason_with(point, "", limits)
}

/// Same as [`peak_reason`], with the text `plant` after the place of the peak.
pub(crate) fn peak_reason_with(
    point: &LoopPoint,
    plant: &str,
    limits: &RobustnessLimits,
) -> Option<(Level, String)> {
    let LoopPoint { point: at, judged: peak, .. } = point;
    let (limit, level) = match *peak {
        peak if peak > limits.red => (limits.red, Level::Red),
        peak if peak > limits.amber => (limits.amber, Level::Amber),
        _ => return None,
    };
    let word = level.word();
    Some((level, format!("the peak of S at the {at}{plant} is {peak:.3}, above {limit} ({word})")))
}

/// Returns the sentence about a loop that parameters within their tolerances make unstable.
pub(crate) fn instability(test: &ToleranceResult) -> String {
    let (range, unstable) = (test.range(), unstable_cases(test));
    format!("parameters within their tolerances ({range}) make the loop unstable: {unstable}")
}

/// Returns which random cases are unstable, and from which part of the tolerances on.
pub(crate) fn unstable_cases(test: &ToleranceResult) -> String {
    let (cases, first) = (test.cases, rounded(test.first_unstable));
    let worst = format!("the worst case found, from {first} of the tolerances on");
    match test.stable {
        Some(part) if part < 1.0 => {
            let unstable = rounded(100.0 * (1.0 - part));
            format!("{unstable} % of {cases} random cases, and {worst}")
        }
        Some(_) => format!("none of {cases} random cases, but {worst}"),
        None => worst,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_part_of_the_tolerances_keeps_its_digits() {
        let test = ToleranceResult { first_unstable: 0.00025, ..ToleranceResult::default() };
        let expected = "the worst case found, from 0.00025 of the tolerances on";
        assert_eq!(unstable_cases(&test), expected);
    }
}
