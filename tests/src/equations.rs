//! A model-exchange FMU in C, described in `tests/c/equations.c`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use fmu_description::package::{Package, platforms};

use crate::root;

/// Value reference of the input u. The constants up to [`P`] are references of Reals, the further ones of Integers.
pub const U: u32 = 0;
/// The state that decays.
pub const X: u32 = 1;
/// Height of the ball.
pub const H: u32 = 2;
/// Velocity of the ball.
pub const V: u32 = 3;
/// The part of a lap that is done.
pub const P: u32 = 4;
/// The discrete input.
pub const MODE: u32 = 0;
/// The value of the discrete input at the last event.
pub const MODE_OUT: u32 = 1;
/// Number of time events.
pub const TICKS: u32 = 2;
/// Number of step events.
pub const LAPS: u32 = 3;
/// Number of state events.
pub const BOUNCES: u32 = 4;

/// Acceleration of the ball in m/s^2, downwards.
pub const GRAVITY: f64 = 9.81;

/// Writes the FMU to `folder/equations.fmu`.
///
/// # Panics
///
/// If it cannot be built or written.
#[must_use]
pub fn write(folder: &Path) -> PathBuf {
    write_with(folder, &[])
}

/// Writes the FMU to `folder/equations.fmu`, built with these options of the compiler.
///
/// # Panics
///
/// If it cannot be built or written.
#[must_use]
pub fn write_with(folder: &Path, definitions: &[&str]) -> PathBuf {
    let mut package = Package::new(description());
    let suffix = std::env::consts::DLL_SUFFIX;
    package.add(format!("binaries/{}/equations{suffix}", platforms()[0]), library(definitions));
    let path = folder.join("equations.fmu");
    package.write(&path).unwrap_or_else(|error| panic!("{error}"));
    path
}

/// Builds the shared library.
fn library(definitions: &[&str]) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
    let target = folder.path().join("equations");
    let mut compiler = Command::new("cc");
    compiler.current_dir(root().join("tests/c")).args(definitions);
    compiler.args(["-std=c11", "-shared", "-fPIC", "-fvisibility=hidden", "-Wall"]);
    compiler.args(["-Wextra", "-Werror", "-o"]).arg(&target).args(["equations.c", "-lm"]);
    assert!(compiler.status().is_ok_and(|status| status.success()), "{compiler:?} fails");
    fs::read(&target).unwrap_or_else(|error| panic!("{error}"))
}

fn description() -> String {
    let variable = |name: &str, reference: u32, role: &str, kind: &str| {
        format!(
            "<ScalarVariable name=\"{name}\" valueReference=\"{reference}\" {role}>{kind}\
             </ScalarVariable>\n"
        )
    };
    let real = |start: &str| format!("<Real start=\"{start}\"/>");
    let of = |state: u32| format!("<Real derivative=\"{state}\"/>");
    let state = "causality=\"output\" variability=\"continuous\" initial=\"exact\"";
    let local = "causality=\"local\" variability=\"continuous\" initial=\"calculated\"";
    let fixed = "causality=\"parameter\" variability=\"fixed\"";
    let counter = "causality=\"output\" variability=\"discrete\" initial=\"exact\"";
    let integer = "<Integer start=\"0\"/>";
    let variables = [
        variable("u", U, "causality=\"input\"", &real("0")),
        variable("x", X, state, &real("1")),
        variable("h", H, state, &real("1")),
        variable("v", V, state, &real("0")),
        variable("p", P, state, &real("0")),
        variable("der(x)", 5, local, &of(2)),
        variable("der(h)", 6, local, &of(3)),
        variable("der(v)", 7, local, &of(4)),
        variable("der(p)", 8, local, &of(5)),
        variable("k", 9, fixed, &real("1")),
        variable("e", 10, fixed, &real("0.7")),
        variable("period", 11, fixed, &real("0.25")),
        variable("end", 12, fixed, &real("1e9")),
        variable("floor", 13, fixed, &real("-1e9")),
        variable("mode", MODE, "causality=\"input\" variability=\"discrete\"", integer),
        variable("mode_out", MODE_OUT, counter, integer),
        variable("ticks", TICKS, counter, integer),
        variable("laps", LAPS, counter, integer),
        variable("bounces", BOUNCES, counter, integer),
    ];
    let unknowns = |indices: &[u32]| -> String {
        let rows = indices.iter().map(|index| format!("<Unknown index=\"{index}\"/>\n"));
        rows.collect::<Vec<_>>().concat()
    };
    let (outputs, derivatives) = (unknowns(&[2, 3, 4, 5, 16, 17, 18, 19]), unknowns(&[6, 7, 8, 9]));
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <fmiModelDescription fmiVersion=\"2.0\" modelName=\"Equations\" guid=\"equations\" \
         numberOfEventIndicators=\"1\">\n<ModelExchange modelIdentifier=\"equations\" \
         canGetAndSetFMUstate=\"true\" canSerializeFMUstate=\"true\" \
         canNotUseMemoryManagementFunctions=\"true\"/>\n\
         <DefaultExperiment stopTime=\"1\" tolerance=\"1e-8\" stepSize=\"0.1\"/>\n\
         <ModelVariables>\n{}</ModelVariables>\n<ModelStructure><Outputs>\n{outputs}</Outputs>\n\
         <Derivatives>\n{derivatives}</Derivatives>\n<InitialUnknowns>\n{derivatives}\
         </InitialUnknowns></ModelStructure>\n</fmiModelDescription>\n",
        variables.concat()
    )
}
