//! Sections of the standard in findings about archive, libraries and behaviour.

use fmu_description::Version;

use super::finding::Finding;

/// Sections of FMI 2.0.5, and the sections of FMI 3.0.2 with the same rules.
const PAIRS: [(&str, &str); 15] = [
    ("2.1", "2.2.2"),
    ("2.1.1", "2.2.2"),
    ("2.1.2", "2.2.3"),
    ("2.1.3", "2.2.4"),
    ("2.1.5", "2.3.1"),
    ("2.1.6", "2.3"),
    ("2.1.7", "2.2.7.2"),
    ("2.1.8", "2.2.7.4"),
    ("2.2.4", "2.4.5"),
    ("2.2.5", "2.4.6"),
    ("2.2.7", "2.4.7.5"),
    ("2.3", "2.5.1"),
    ("2.3.1", "2.5.1.6"),
    ("4.2.2", "4.2.1"),
    ("4.2.4", "4.2"),
];

/// Replaces sections of FMI 2.0.5 by those of `version`; a section that has no counterpart is left out.
pub(super) fn renumber(findings: &mut [Finding], version: Version) {
    for finding in findings {
        let own = PAIRS.iter().find(|(second, _)| finding.section == Some(*second));
        finding.section = match version {
            Version::V1 => None,
            Version::V2 => finding.section,
            Version::V3 => own.map(|(_, third)| *third),
        };
    }
}
