//! FMUs in C of FMI 3.0 and 1.0, described in `tests/c/slave3.c` and `tests/c/slave1.c`.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;

use fmu_description::package::{Package, platforms, platforms_of};
use fmu_description::{Version, terminals};

use crate::root;

/// Libraries that this process has built, by their source.
static LIBRARIES: Mutex<BTreeMap<&str, Vec<u8>>> = Mutex::new(BTreeMap::new());

/// Builds the shared library of `source`, once.
pub(crate) fn library(source: &'static str) -> Vec<u8> {
    let mut known = LIBRARIES.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let build = || {
        let folder = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
        let target = folder.path().join("slave");
        let mut compiler = Command::new("cc");
        compiler.current_dir(root().join("tests/c"));
        compiler.args(["-std=c11", "-shared", "-fPIC", "-fvisibility=hidden", "-Wall"]);
        compiler.args(["-Wextra", "-Werror", "-o"]).arg(&target).args([source, "-lm"]);
        assert!(compiler.status().is_ok_and(|status| status.success()), "{compiler:?} fails");
        fs::read(&target).unwrap_or_else(|error| panic!("{error}"))
    };
    known.entry(source).or_insert_with(build).clone()
}

/// Writes `slave3.c` as an FMU of FMI 3.0 for co-simulation to `folder`; `token` selects a misbehaviour.
///
/// # Panics
///
/// If it cannot be built or written.
#[must_use]
pub fn slave_3(folder: &Path, token: &str, has_event_mode: bool) -> PathBuf {
    let event_mode = if has_event_mode { "true" } else { "false" };
    version_3(folder, token, &CO_SIMULATION_3.replace("EVENT_MODE", event_mode), "slave3")
}

/// Writes `slave3.c` as an FMU of FMI 3.0 for model exchange to `folder`; `token` selects a
/// misbehaviour.
///
/// # Panics
///
/// If it cannot be built or written.
#[must_use]
pub fn equations_3(folder: &Path, token: &str) -> PathBuf {
    version_3(folder, token, MODEL_EXCHANGE_3, "equations3")
}

fn version_3(folder: &Path, token: &str, interface: &str, file: &str) -> PathBuf {
    let intermediate = if token == "intermediate" { "true" } else { "false" };
    let xml = DESCRIPTION_3.replace("TOKEN", token).replace("<INTERFACE/>", interface);
    let xml = xml.replace("INTERMEDIATE", intermediate);
    let mut package = Package::new(xml).for_version(Version::V3);
    let name = format!("slave3{}", std::env::consts::DLL_SUFFIX);
    package.add(format!("binaries/{}/{name}", platforms_of(Version::V3)[0]), library("slave3.c"));
    package.add("resources/text.txt", "text");
    written(&package, folder, file)
}

/// The files of an FMU, by path.
type Files = [(&'static str, String)];

/// Writes an FMU of FMI 3.0 with this description and further files to `folder`; builds the C file `source` for it and
/// takes its name from this file.
pub(crate) fn fmu_3(
    folder: &Path,
    source: &'static str,
    description: &str,
    files: &Files,
) -> PathBuf {
    let mut package = Package::new(description.to_owned()).for_version(Version::V3);
    let name = source.trim_end_matches(".c");
    let library_name = format!("{name}{}", std::env::consts::DLL_SUFFIX);
    let platform = platforms_of(Version::V3)[0];
    package.add(format!("binaries/{platform}/{library_name}"), library(source));
    for (path, content) in files {
        package.add(*path, content.as_str());
    }
    written(&package, folder, name)
}

/// Returns the file of terminals, with one network terminal of FMI-LS-BUS of this name. `variables` are the variables
/// for its members `Tx_Clock`, `Tx_Data`, `Rx_Clock` and `Rx_Data`.
pub(crate) fn transceiver(name: &str, variables: [&str; 4]) -> [(&'static str, String); 1] {
    [(terminals::PATH, transceivers(&[(name, variables)]))]
}

pub(crate) fn transceivers(all: &[(&str, [&str; 4])]) -> String {
    let members = ["Tx_Clock", "Tx_Data", "Rx_Clock", "Rx_Data"];
    let member = |(member, variable): (&&str, &&str)| {
        format!(
            "<TerminalMemberVariable variableName=\"{variable}\" memberName=\"{member}\" variableKind=\"signal\"/>"
        )
    };
    let terminal = |(name, variables): &(&str, [&str; 4])| {
        let members: String = members.iter().zip(variables).map(member).collect();
        format!(
            "<Terminal name=\"{name}\" terminalKind=\"org.fmi-ls-bus.network-terminal\" \
             matchingRule=\"org.fmi-ls-bus.transceiver\">{members}</Terminal>"
        )
    };
    let terminals: String = all.iter().map(terminal).collect();
    format!(
        "<fmiTerminalsAndIcons fmiVersion=\"3.0\"><Terminals>{terminals}</Terminals></fmiTerminalsAndIcons>"
    )
}

/// Writes `slave1.c` as an FMU of FMI 1.0 to `folder`; `guid` selects a misbehaviour.
///
/// # Panics
///
/// If it cannot be built or written.
#[must_use]
pub fn slave_1(folder: &Path, guid: &str) -> PathBuf {
    let mut package = Package::new(DESCRIPTION_1.replace("GUID", guid));
    let name = format!("slave1{}", std::env::consts::DLL_SUFFIX);
    package.add(format!("binaries/{}/{name}", platforms()[0]), library("slave1.c"));
    written(&package, folder, "slave1")
}

fn written(package: &Package, folder: &Path, name: &str) -> PathBuf {
    let path = folder.join(name).with_extension("fmu");
    package.write(&path).unwrap_or_else(|error| panic!("{error}"));
    path
}

const CO_SIMULATION_3: &str = r#"<CoSimulation modelIdentifier="slave3"
 canHandleVariableCommunicationStepSize="true" canGetAndSetFMUState="true" canSerializeFMUState="true"
 providesDirectionalDerivatives="true" hasEventMode="EVENT_MODE" mightReturnEarlyFromDoStep="true"
 providesIntermediateUpdate="INTERMEDIATE"/>"#;

const MODEL_EXCHANGE_3: &str = r#"<ModelExchange modelIdentifier="slave3" canGetAndSetFMUState="true"
 canSerializeFMUState="true" providesDirectionalDerivatives="true"
 needsCompletedIntegratorStep="true"/>"#;

const DESCRIPTION_3: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Slave" instantiationToken="TOKEN">
<INTERFACE/>
<ModelVariables>
<Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
<Float64 name="u" valueReference="1" causality="input" start="1" intermediateUpdate="INTERMEDIATE"/>
<Float64 name="y" valueReference="2" causality="output"><Alias name="y_again"/></Float64>
<UInt64 name="n" valueReference="3" causality="structuralParameter" variability="fixed" start="2"/>
<Float64 name="a" valueReference="4" causality="input" start="1 2" intermediateUpdate="INTERMEDIATE">
 <Dimension valueReference="3"/></Float64>
<Float64 name="b" valueReference="5" causality="output"><Dimension valueReference="3"/></Float64>
<Float64 name="M" valueReference="6" causality="parameter" variability="fixed"
 start="1 2 3 4 5 6"><Dimension start="2"/><Dimension start="3"/></Float64>
<Float64 name="sum" valueReference="7" causality="local"/>
<Int32 name="k_in" valueReference="8" causality="input" start="0"/>
<Int32 name="k_out" valueReference="9" causality="output"/>
<Int32 name="events" valueReference="10" causality="output"/>
<Binary name="bytes_in" valueReference="11" causality="input"><Start value="666f6f"/></Binary>
<Binary name="bytes_out" valueReference="12" causality="output"/>
<Float32 name="f" valueReference="13" causality="input" start="0"/>
<Float32 name="g" valueReference="14" causality="output"/>
<UInt64 name="big" valueReference="15" causality="output"/>
<Float64 name="level" valueReference="16" causality="parameter" variability="tunable" start="0.4"/>
<Clock name="tick" valueReference="17" causality="input" intervalVariability="constant"
 intervalDecimal="0.1"/>
<Int32 name="ticks" valueReference="18" causality="output" clocks="17"/>
<Clock name="third" valueReference="19" causality="output" intervalVariability="triggered"
 clocks="17"/>
<Int32 name="weight" valueReference="20" causality="input" start="1" clocks="17"/>
<String name="texts" valueReference="21" causality="input"><Dimension start="2"/>
 <Start value=""/><Start value=""/></String>
<Float64 name="der(y)" valueReference="22" causality="local" derivative="2"/>
</ModelVariables>
<ModelStructure>
<Output valueReference="2" dependencies=""/>
<Output valueReference="5" dependencies="4"/>
<Output valueReference="9" dependencies=""/>
<Output valueReference="10" dependencies=""/>
<Output valueReference="12" dependencies=""/>
<Output valueReference="14" dependencies="13"/>
<Output valueReference="15" dependencies=""/>
<Output valueReference="18" dependencies=""/>
<Output valueReference="19" dependencies="17"/>
<ContinuousStateDerivative valueReference="22" dependencies="1"/>
</ModelStructure>
</fmiModelDescription>
"#;

const DESCRIPTION_1: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="1.0" modelName="Slave" modelIdentifier="slave1" guid="GUID"
 numberOfContinuousStates="0" numberOfEventIndicators="0">
<ModelVariables>
<ScalarVariable name="u" valueReference="0" causality="input"><Real start="1"/></ScalarVariable>
<ScalarVariable name="y" valueReference="1" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="minus_y" valueReference="1" causality="output" alias="negatedAlias"><Real/>
</ScalarVariable>
<ScalarVariable name="gain" valueReference="2" causality="input" variability="parameter">
<Real start="1"/></ScalarVariable>
<ScalarVariable name="twice" valueReference="1" causality="internal"><Real/></ScalarVariable>
<ScalarVariable name="twice" valueReference="2" causality="internal"><Real/></ScalarVariable>
<ScalarVariable name="i_in" valueReference="0" causality="input" variability="discrete">
<Integer start="0"/></ScalarVariable>
<ScalarVariable name="i_out" valueReference="1" causality="output" variability="discrete">
<Integer/></ScalarVariable>
<ScalarVariable name="b_in" valueReference="0" causality="input" variability="discrete">
<Boolean start="false"/></ScalarVariable>
<ScalarVariable name="b_out" valueReference="1" causality="output" variability="discrete">
<Boolean/></ScalarVariable>
<ScalarVariable name="s_in" valueReference="0" causality="input" variability="discrete">
<String start=""/></ScalarVariable>
<ScalarVariable name="s_out" valueReference="1" causality="output" variability="discrete">
<String/></ScalarVariable>
</ModelVariables>
<Implementation><CoSimulation_StandAlone>
<Capabilities canHandleVariableCommunicationStepSize="true" canHandleEvents="true"/>
</CoSimulation_StandAlone></Implementation>
</fmiModelDescription>
"#;
