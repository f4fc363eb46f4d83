//! An FMU in C that simulates a CAN bus, described in `tests/c/bus3.c`.

use std::path::{Path, PathBuf};

use fmu_description::terminals;

use crate::c_versions::{fmu_3, transceivers};

/// Writes the FMU to `folder`.
///
/// # Panics
///
/// If it cannot be built or written.
#[must_use]
pub fn write(folder: &Path) -> PathBuf {
    let variables = |node: &str, first: u32| {
        let [tx_clock, tx_data, rx_clock, rx_data] = [1, 2, 3, 4].map(|place| first + place);
        format!(
            "<Clock name=\"{node}.tx_clock\" valueReference=\"{tx_clock}\" causality=\"input\" \
             intervalVariability=\"countdown\"/>
<Binary name=\"{node}.tx_data\" valueReference=\"{tx_data}\" causality=\"output\" clocks=\"{tx_clock}\" {MIME}/>
<Clock name=\"{node}.rx_clock\" valueReference=\"{rx_clock}\" causality=\"input\" \
             intervalVariability=\"triggered\"/>
<Binary name=\"{node}.rx_data\" valueReference=\"{rx_data}\" causality=\"input\" clocks=\"{rx_clock}\" {MIME}>\
             <Start value=\"\"/></Binary>
"
        )
    };
    let variables = variables("n1", 0) + &variables("n2", 10);
    let terminals = transceivers(&[
        ("n1", ["n1.tx_clock", "n1.tx_data", "n1.rx_clock", "n1.rx_data"]),
        ("n2", ["n2.tx_clock", "n2.tx_data", "n2.rx_clock", "n2.rx_data"]),
    ]);
    let files = [
        (terminals::PATH, terminals),
        (MANIFEST, "<fmiLayeredStandardManifest isBusSimulationFMU=\"true\"/>".to_owned()),
    ];
    fmu_3(folder, "bus3.c", &DESCRIPTION.replace("VARIABLES", &variables), &files)
}

const MANIFEST: &str = "extra/org.fmi-standard.fmi-ls-bus/fmi-ls-manifest.xml";
const MIME: &str = "variability=\"discrete\" \
    mimeType=\"application/org.fmi-standard.fmi-ls-bus.can; version=&quot;1.0.0&quot;\"";
const DESCRIPTION: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Bus" instantiationToken="bus">
<CoSimulation modelIdentifier="bus3" hasEventMode="true" canHandleVariableCommunicationStepSize="true"/>
<ModelVariables>
VARIABLES</ModelVariables>
<ModelStructure><Output valueReference="2"/><Output valueReference="12"/></ModelStructure>
</fmiModelDescription>
"#;
