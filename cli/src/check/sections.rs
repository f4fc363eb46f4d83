//! Sections and functions of the standard in findings about archive, libraries and behaviour.

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

/// Functions of FMI 2.0 whose name in FMI 3.0 or 1.0 is not that with another prefix.
const FUNCTIONS: [(&str, &str, &str); 6] = [
    ("fmi2GetReal", "fmi3GetFloat64", "fmiGetReal"),
    ("fmi2GetFMUstate", "fmi3GetFMUState", "fmi2GetFMUstate"),
    ("fmi2SetFMUstate", "fmi3SetFMUState", "fmi2SetFMUstate"),
    ("fmi2DeSerializeFMUstate", "fmi3DeserializeFMUState", "fmi2DeSerializeFMUstate"),
    ("fmi2Terminate", "fmi3Terminate", "fmiTerminateSlave"),
    ("fmi2Instantiate", "fmi3InstantiateCoSimulation", "fmiInstantiateSlave"),
];

/// Replaces the names of functions and statuses of FMI 2.0 in findings about the behaviour by those of
/// `version`.
pub(super) fn rename(findings: &mut [Finding], version: Version) {
    let prefix = match version {
        Version::V1 => "fmi",
        Version::V2 => return,
        Version::V3 => "fmi3",
    };
    for text in findings.iter_mut().flat_map(|own| [&mut own.place, &mut own.what]) {
        for (second, third, first) in FUNCTIONS {
            *text = text.replace(second, if version == Version::V3 { third } else { first });
        }
        *text = text.replace("fmi2", prefix);
    }
}
