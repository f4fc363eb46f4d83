//! An FMU in C that sends and receives by clocked variables, described in `tests/c/node3.c`.

use std::path::{Path, PathBuf};

use crate::c_versions::{fmu_3, transceiver};

/// Writes the FMU to `folder`.
///
/// # Panics
///
/// If it cannot be built or written.
#[must_use]
pub fn write(folder: &Path) -> PathBuf {
    let terminal = transceiver("can", ["tx_clock", "tx_data", "rx_clock", "rx_data"]);
    fmu_3(folder, "node3.c", DESCRIPTION, &terminal)
}

const DESCRIPTION: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Node" instantiationToken="node">
<CoSimulation modelIdentifier="node3" hasEventMode="true" canHandleVariableCommunicationStepSize="true"
 canGetAndSetFMUState="true" canSerializeFMUState="true"/>
<ModelVariables>
<Clock name="tx_clock" valueReference="1" causality="output" variability="discrete"
 intervalVariability="triggered"/>
<Int32 name="tx" valueReference="2" causality="output" variability="discrete" clocks="1"/>
<Float64 name="tx_time" valueReference="3" causality="output" variability="discrete" clocks="1"/>
<Binary name="tx_data" valueReference="4" causality="output" variability="discrete" clocks="1"
 mimeType="application/org.fmi-standard.fmi-ls-bus.can; version=&quot;1.0.0&quot;"/>
<Clock name="rx_clock" valueReference="5" causality="input" variability="discrete"
 intervalVariability="triggered"/>
<Int32 name="rx" valueReference="6" causality="input" variability="discrete" start="0" clocks="5"/>
<Float64 name="rx_time" valueReference="7" causality="input" variability="discrete" start="0" clocks="5"/>
<Binary name="rx_data" valueReference="8" causality="input" variability="discrete" clocks="5"
 mimeType="application/org.fmi-standard.fmi-ls-bus.can; version=&quot;1.0.0&quot;"><Dimension start="1"/><Start value=""/></Binary>
<Int32 name="received" valueReference="9" causality="output" variability="discrete"/>
<Int32 name="sum" valueReference="10" causality="output" variability="discrete"/>
<Int32 name="sent" valueReference="11" causality="output" variability="discrete"/>
<Float64 name="latency" valueReference="12" causality="output" variability="discrete"/>
<Int32 name="bytes" valueReference="13" causality="output" variability="discrete"/>
<Int32 name="level" valueReference="14" causality="output" variability="discrete"/>
<Int32 name="level_in" valueReference="15" causality="input" variability="discrete" start="0"/>
<Int32 name="level_out" valueReference="16" causality="output" variability="discrete"/>
<Float64 name="period" valueReference="17" causality="parameter" variability="fixed" start="0"/>
<Int32 name="first" valueReference="18" causality="parameter" variability="fixed" start="0"/>
<Int32 name="limit" valueReference="19" causality="parameter" variability="fixed" start="0"/>
<Int32 name="announces" valueReference="20" causality="parameter" variability="fixed" start="0"/>
<Int32 name="identifier" valueReference="22" causality="parameter" variability="fixed" start="0"/>
<Float64 name="now" valueReference="21" causality="output" variability="discrete"/>
</ModelVariables>
<ModelStructure><Output valueReference="1"/><Output valueReference="2"/><Output valueReference="3"/>
<Output valueReference="4"/><Output valueReference="9"/><Output valueReference="10"/><Output valueReference="11"/>
<Output valueReference="12"/><Output valueReference="13"/><Output valueReference="14"/>
<Output valueReference="16"/><Output valueReference="21"/></ModelStructure>
</fmiModelDescription>
"#;
