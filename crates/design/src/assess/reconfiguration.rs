//! Judges the controllers for actuators that are gone.

use crate::report::reconfiguration::{ReconfigurationReport, Reconfigured};
use crate::report::robustness::Level;

/// Returns the reasons that actuators which are gone add to the verdict; none where a fall-back gives a stable loop.
pub(crate) fn reasons(report: &ReconfigurationReport) -> Vec<(Level, String)> {
    let single = report.without.iter().map(|case| (vec![case.actuator.clone()], &case.outcome));
    let several = report.several.iter().map(|case| (case.actuators.clone(), &case.outcome));
    let amber = |(actuators, outcome): (Vec<String>, &Result<Reconfigured, String>)| {
        let name = actuators.join(", ");
        let mut served = report.by_fallback.iter().filter(|case| case.stable);
        let text = match outcome {
            Err(_) if served.any(|case| case.actuators == actuators) => return None,
            Err(reason) => format!("without {name} there is no controller: {reason} (amber)"),
            Ok(rest) if !rest.beyond_limits.is_empty() => format!(
                "without {name} the operating point needs commands beyond the limits of {} (amber)",
                rest.beyond_limits.join(", ")
            ),
            Ok(_) => return None,
        };
        Some((Level::Amber, text))
    };
    single.chain(several).filter_map(amber).collect()
}
