//! An FMU in C for scheduled execution, described in `tests/c/scheduled3.c`.

use std::path::{Path, PathBuf};

use crate::c_versions::fmu_3;

/// Writes the FMU to `folder`.
///
/// # Panics
///
/// If it cannot be built or written.
#[must_use]
pub fn write(folder: &Path) -> PathBuf {
    write_with(folder, "", "")
}

/// Same as [`write()`], with `to` in place of `from` in the model description.
///
/// # Panics
///
/// Same as [`write()`]; also if the description does not contain `from`.
#[must_use]
pub fn write_with(folder: &Path, from: &str, to: &str) -> PathBuf {
    assert!(DESCRIPTION.contains(from), "{from}");
    fmu_3(folder, "scheduled3.c", &DESCRIPTION.replacen(from, to, 1), &[])
}

const DESCRIPTION: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Tasks" instantiationToken="tasks">
<ScheduledExecution modelIdentifier="scheduled3"/>
<ModelVariables>
<Clock name="fast" valueReference="1" causality="input" intervalVariability="constant" intervalDecimal="0.5" priority="1"/>
<Clock name="asked" valueReference="2" causality="input" intervalVariability="triggered" priority="0"/>
<Clock name="later" valueReference="3" causality="input" intervalVariability="countdown" priority="2"/>
<Clock name="done" valueReference="4" causality="output" intervalVariability="triggered" clocks="3"/>
<Int32 name="order" valueReference="5" causality="output" clocks="1 2 3"/>
<Int32 name="u" valueReference="6" causality="input" start="0"/>
<Int32 name="sum" valueReference="7" causality="output" clocks="2"/>
</ModelVariables>
<ModelStructure><Output valueReference="4"/><Output valueReference="5"/><Output valueReference="7"/></ModelStructure>
</fmiModelDescription>
"#;
