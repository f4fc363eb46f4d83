//! Sections and names of the standard in findings about archive, libraries and behaviour.

use fmu_description::{ModelDescription, Version};

use super::finding::Finding;

/// Sections of FMI 2.0.5, each with the section of FMI 3.0.2 that has the same rules.
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

/// Names of FMI 2.0 in findings about behaviour, each with the names of FMI 1.0 and of FMI 3.0.
const NAMES: [(&str, &str, &str); 9] = [
    ("fmi2DeSerializeFMUstate", "fmi2DeSerializeFMUstate", "fmi3DeserializeFMUState"),
    ("fmi2SetFMUstate", "fmi2SetFMUstate", "fmi3SetFMUState"),
    ("fmi2Instantiate", "fmiInstantiateSlave", "fmi3InstantiateCoSimulation"),
    ("fmi2Terminate", "fmiTerminateSlave", "fmi3Terminate"),
    ("fmi2GetReal", "fmiGetReal", "fmi3GetFloat64"),
    ("fmi2DoStep", "fmiDoStep", "fmi3DoStep"),
    ("fmi2Error", "fmiError", "fmi3Error"),
    ("canGetAndSetFMUstate", "canGetAndSetFMUstate", "canGetAndSetFMUState"),
    ("canSerializeFMUstate", "canSerializeFMUstate", "canSerializeFMUState"),
];

/// Replaces names of FMI 2.0 in a text by the names of the version of the FMU and of the interface that a trial uses.
pub(super) fn renamed(text: &str, description: &ModelDescription) -> String {
    let version = description.version();
    let is_scheduled = description.scheduled_execution.is_some();
    let instantiate = match (version, description.co_simulation.is_some()) {
        (Version::V1, false) => "fmiInstantiateModel",
        (Version::V3, false) if is_scheduled => "fmi3InstantiateScheduledExecution",
        (Version::V3, false) => "fmi3InstantiateModelExchange",
        _ => "fmi2Instantiate",
    };
    let text = text.replace("fmi2Instantiate", instantiate);
    NAMES.iter().fold(text, |text, (second, first, third)| match version {
        Version::V1 => text.replace(second, first),
        Version::V2 => text,
        Version::V3 => text.replace(second, third),
    })
}

/// Replaces sections of FMI 2.0.5 in `findings` by sections of `version`. Removes a section that has no counterpart;
/// FMI 1.0 has none.
pub(super) fn renumber(findings: &mut [Finding], version: Version) {
    for finding in findings {
        let pair = PAIRS.iter().find(|(second, _)| finding.section == Some(*second));
        finding.section = match version {
            Version::V1 => None,
            Version::V2 => finding.section,
            Version::V3 => pair.map(|(_, third)| *third),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_name_the_functions_of_the_version_and_interface_of_the_fmu() {
        let text =
            "fmi2SetFMUstate: differs, expected fmi2Error, though canGetAndSetFMUstate is true";
        let third =
            "fmi3SetFMUState: differs, expected fmi3Error, though canGetAndSetFMUState is true";
        let simulation = Some(fmu_description::CoSimulation::default());
        let of = |version: &str, co_simulation| ModelDescription {
            fmi_version: version.to_owned(),
            co_simulation,
            ..ModelDescription::default()
        };
        assert_eq!(renamed(text, &of("2.0", simulation.clone())), text);
        assert_eq!(renamed(text, &of("3.0", simulation.clone())), third);
        assert_eq!(
            renamed("fmi2DoStep after fmi2Terminate", &of("1.0", simulation.clone())),
            "fmiDoStep after fmiTerminateSlave"
        );
        for (version, of_slave, of_model) in [
            ("1.0", "fmiInstantiateSlave", "fmiInstantiateModel"),
            ("2.0", "fmi2Instantiate", "fmi2Instantiate"),
            ("3.0", "fmi3InstantiateCoSimulation", "fmi3InstantiateModelExchange"),
        ] {
            assert_eq!(renamed("fmi2Instantiate", &of(version, simulation.clone())), of_slave);
            assert_eq!(renamed("fmi2Instantiate", &of(version, None)), of_model);
        }
    }
}
