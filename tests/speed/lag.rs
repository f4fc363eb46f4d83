//! The tiny FMU with which masters are measured, built from `lag.c`, and rings of it.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use fmu_description::package::{Package, platforms};

/// Builds the FMU with `ports` inputs `u0`, `u1`, ... and as many outputs `y0`, `y1`, ... as
/// `folder/Lag<ports>.fmu`.
///
/// # Errors
///
/// If there is no C compiler (`cc`, or the program that `CC` names), or a file cannot be written.
pub(crate) fn pack(folder: &Path, ports: usize) -> anyhow::Result<PathBuf> {
    let (name, guid) = (format!("Lag{ports}"), format!("{{lag-{ports}}}"));
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("speed/lag.c");
    let built = folder.join(format!("{name}{}", std::env::consts::DLL_SUFFIX));
    let compiler = std::env::var_os("CC").unwrap_or_else(|| "cc".into());
    let status = Command::new(compiler)
        .args(["-O2", "-shared", "-fPIC"])
        .args([format!("-DPORTS={ports}"), format!("-DGUID=\"{guid}\"")])
        .arg("-o")
        .args([&built, &source])
        .arg("-lm")
        .status()?;
    anyhow::ensure!(status.success(), "{} cannot be compiled", source.display());
    let mut package = Package::new(description(&name, &guid, ports));
    let binary = format!("binaries/{}/{name}{}", platforms()[0], std::env::consts::DLL_SUFFIX);
    package.add(binary, std::fs::read(&built)?);
    let path = folder.join(format!("{name}.fmu"));
    package.write(&path)?;
    Ok(path)
}

/// `modelDescription.xml`.
fn description(name: &str, guid: &str, ports: usize) -> String {
    let (mut inputs, mut outputs, mut structure) = (String::new(), String::new(), String::new());
    let mut initial = String::new();
    for port in 0..ports {
        let reference = ports + port;
        let _ = writeln!(
            inputs,
            r#"    <ScalarVariable name="u{port}" valueReference="{port}" causality="input"><Real start="0"/></ScalarVariable>"#
        );
        let _ = writeln!(
            outputs,
            r#"    <ScalarVariable name="y{port}" valueReference="{reference}" causality="output"><Real/></ScalarVariable>"#
        );
        let _ =
            writeln!(structure, r#"      <Unknown index="{}" dependencies=""/>"#, reference + 1);
        let _ = writeln!(initial, r#"      <Unknown index="{}" dependencies=""/>"#, reference + 1);
    }
    let time_constant = 2 * ports;
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="{guid}" numberOfEventIndicators="0">
  <CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true"/>
  <DefaultExperiment startTime="0" stopTime="1" stepSize="0.001"/>
  <ModelVariables>
{inputs}{outputs}    <ScalarVariable name="T" valueReference="{time_constant}" causality="parameter" variability="tunable"><Real start="1"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs>
{structure}    </Outputs>
    <InitialUnknowns>
{initial}    </InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"#
    )
}

/// Returns the connections of `count` FMUs in a ring, as `(from, to, port)`: output `port` of FMU
/// `from` to input `port` of FMU `to`. Each port is used once. Even ports are connected to the FMUs
/// behind (1, 2, ... places), odd ports to those before; a pair is coupled both ways.
pub(crate) fn ring(count: usize, ports: usize) -> impl Iterator<Item = (usize, usize, usize)> {
    (0..count).flat_map(move |from| {
        (0..ports).map(move |port| {
            let distance = 1 + (port / 2) % (count - 1);
            let to = if port % 2 == 0 { from + distance } else { from + count - distance };
            (from, to % count, port)
        })
    })
}
