//! The identity of a design: the text by which a file names the plant for which it was written.

use crate::Report;
use crate::robustness::Verdict;

/// Returns `aso-ftc design for NAME (NUMBER)`: the name of the plant file and a number from the
/// names of states, actuators and measurements. Designs of the same plant with other requirements or
/// numbers have the same identity.
#[must_use]
pub fn identity(report: &Report) -> String {
    let plant = &report.plant;
    let kinds = [&plant.states, &plant.actuators, &plant.measurements];
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut add = |byte: u8| hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    for kind in kinds {
        for signal in kind {
            signal.name.bytes().for_each(&mut add);
            add(0);
        }
        add(1);
    }
    format!("aso-ftc design for {} ({hash:016x})", printable(&report.plant_file))
}

/// Returns the comment at the start of a design file: identity, verdict and its reasons.
#[must_use]
pub fn heading(identity: &str, verdict: &Verdict) -> String {
    let mut text = format!("# Written by {identity}.\n# Verdict: {}.\n", verdict.level.word());
    for reason in &verdict.reasons {
        text.extend(["# - ", &printable(reason), "\n"]);
    }
    text
}

/// Replaces control characters, which a comment may not contain, by spaces.
fn printable(text: &str) -> String {
    text.replace(|sign: char| sign.is_control(), " ")
}
