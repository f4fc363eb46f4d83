//! The invariants of ARCHITECTURE.md.
#![expect(clippy::unwrap_used, reason = "tests")]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use tests::root;

/// All files below `folder` with this extension, without build results.
fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut paths = Vec::new();
    for item in fs::read_dir(folder).unwrap() {
        let path = item.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() && !["target", "dist", "results"].contains(&name.as_str()) {
            if !name.starts_with('.') && !path.join("pyvenv.cfg").exists() {
                paths.extend(files(&path, extension));
            }
        } else if path.extension().is_some_and(|ending| ending == extension) {
            paths.push(path);
        }
    }
    paths.sort();
    paths
}

fn name(path: &Path) -> String {
    path.strip_prefix(root()).unwrap().to_string_lossy().replace('\\', "/")
}

#[test]
fn the_mathematics_depends_on_neither_fmi_nor_files() {
    let manifest: toml::Table =
        fs::read_to_string(root().join("crates/control/Cargo.toml")).unwrap().parse().unwrap();
    let dependencies: Vec<_> = manifest["dependencies"].as_table().unwrap().keys().collect();
    assert_eq!(dependencies, ["aso-lapack", "clarabel", "libm", "nalgebra", "thiserror"]);
    for file in files(&root().join("crates/control/src"), "rs") {
        let text = fs::read_to_string(&file).unwrap();
        for word in ["std::fs", "std::io", "std::net", "std::env", "println!", "eprintln!"] {
            assert!(!text.contains(word), "{} uses {word}", name(&file));
        }
    }
}

/// The folders of our libraries, each with the libraries that it may use.
const ARROWS: [(&str, &[&str]); 24] = [
    ("lapack", &[]),
    ("controller", &[]),
    ("control", &["aso-lapack"]),
    ("fmu-description", &[]),
    ("fmu-derive", &[]),
    ("fmu", &["fmu-derive", "fmu-description"]),
    ("slave", &["fmu-description"]),
    ("fmu-import", &["fmu-description", "slave"]),
    ("linearise", &["control", "fmu-description", "fmu-import", "slave"]),
    ("ssp", &["fmu-description", "slave"]),
    ("results", &[]),
    ("report", &["figure", "results"]),
    ("live", &["figure"]),
    ("solve", &[]),
    ("integrate", &["fmu-description", "slave", "solve"]),
    ("master", &["fmu-description", "slave", "solve"]),
    ("files", &[]),
    ("figure", &["files"]),
    (
        "study",
        &[
            "files",
            "fmu-description",
            "fmu-import",
            "integrate",
            "master",
            "results",
            "slave",
            "ssp",
        ],
    ),
    (
        "design",
        &[
            "aso-controller",
            "control",
            "controller-code",
            "design-page",
            "design-report",
            "files",
            "fmu-description",
            "fmu-import",
            "linearise",
            "plant-file",
            "results",
        ],
    ),
    ("controller-code", &["aso-controller", "control"]),
    ("design-page", &["design-report", "figure"]),
    ("design-report", &[]),
    ("plant-file", &["control", "files", "fmu-description"]),
];

fn manifest(folder: &Path) -> toml::Table {
    fs::read_to_string(folder.join("Cargo.toml")).unwrap().parse().unwrap()
}

#[test]
fn the_libraries_use_only_those_that_architecture_md_allows() {
    let mut folders: Vec<String> = fs::read_dir(root().join("crates"))
        .unwrap()
        .map(|item| item.unwrap().file_name().into_string().unwrap())
        .collect();
    folders.sort();
    let mut known: Vec<&str> = ARROWS.iter().map(|(folder, _)| *folder).collect();
    known.sort_unstable();
    assert_eq!(folders, known);
    for (folder, allowed) in ARROWS {
        let manifest = manifest(&root().join("crates").join(folder));
        let dependencies = manifest["dependencies"].as_table().unwrap().keys();
        let is_ours = |name: &&String| known.contains(&name.trim_start_matches("aso-"));
        for ours in dependencies.filter(is_ours) {
            assert!(allowed.contains(&ours.as_str()), "crates/{folder} uses {ours}");
        }
    }
}

#[test]
fn a_model_is_built_once_more_with_the_dependencies_that_it_has() {
    let dependencies = |folder: &str| -> BTreeSet<String> {
        let manifest = manifest(&root().join(folder));
        manifest["dependencies"].as_table().unwrap().keys().cloned().collect()
    };
    for (folder, model) in [
        ("web/controller", "fmu-controller"),
        ("fuzz/controller", "fmu-controller"),
        ("web/tanks/plant", "examples/three-tank"),
    ] {
        assert_eq!(dependencies(folder), dependencies(model), "{folder}");
    }
}

#[test]
fn only_tests_use_a_model_or_the_command() {
    let folders = ARROWS.iter().map(|(folder, _)| root().join("crates").join(folder));
    for folder in folders.chain([root().join("cli"), root().join("python"), root().join("tests")]) {
        let manifest = manifest(&folder);
        for section in ["dependencies", "dev-dependencies", "build-dependencies"] {
            let Some(dependencies) = manifest.get(section).and_then(toml::Value::as_table) else {
                continue;
            };
            for forbidden in
                ["fmu-plant", "fmu-controller", "fmu-kalman", "aso-ftc", "aso-ftc-python", "web"]
            {
                assert!(
                    !dependencies.contains_key(forbidden),
                    "{} uses {forbidden}",
                    name(&folder)
                );
            }
        }
    }
}

#[test]
fn unsafe_code_is_at_foreign_boundaries_only() {
    // The C functions of exported models and of imported libraries.
    let folders = ["crates/fmu/src/ffi/", "crates/fmu-import/src/library/"];
    let allowed = [
        "crates/fmu/src/callbacks.rs",
        "crates/fmu/src/ffi.rs",
        "crates/fmu/src/room.rs",
        "crates/fmu-import/src/library.rs",
        // Signal handlers, and the data that they read.
        "crates/fmu-import/src/crash/place.rs",
        "crates/fmu-import/src/crash/signals.rs",
        "crates/fmu-import/src/isolate/memory.rs",
        // The second process, which waits for the first.
        "crates/fmu-import/src/supervise.rs",
        // Shared memory viewed as a slice of atomics.
        "crates/fmu-import/src/isolate/region.rs",
        // The C side of BLAS and LAPACK, and its tests.
        "crates/lapack/src/memory.rs",
        "crates/lapack/src/products.rs",
        "crates/lapack/src/routines.rs",
        "crates/lapack/src/symbols.rs",
        "crates/lapack/tests/definitions/products.rs",
        "crates/lapack/tests/definitions/singular.rs",
        "crates/lapack/tests/definitions/solvers.rs",
        "crates/lapack/tests/definitions/spectrum.rs",
        // Importers for tests, which call the C functions in ways that safe code cannot.
        "tests/robustness/src/importer.rs",
        "tests/robustness/src/sequence3.rs",
        "tests/robustness/tests/robustness/uninitialised.rs",
        "fuzz/src/design.rs",
        // The functions of the WebAssembly modules.
        "web/observer/src/lib.rs",
        "web/src/exports.rs",
        "web/src/text.rs",
    ];
    for file in files(&root(), "rs") {
        let path = name(&file);
        let is_allowed = allowed.contains(&path.as_str())
            || folders.iter().any(|folder| path.starts_with(folder));
        if is_allowed || path == "tests/tests/claims/tidy.rs" {
            continue;
        }
        for (number, line) in fs::read_to_string(&file).unwrap().lines().enumerate() {
            let code = line.split("//").next().unwrap_or_default();
            let opens = ["unsafe {", "unsafe fn", "unsafe impl", "unsafe(", "unsafe trait"]
                .iter()
                .any(|form| code.contains(form));
            assert!(!opens, "{path}:{} has unsafe code", number + 1);
        }
    }
}

/// Whether the allowed licences satisfy a licence expression: one alternative of each part joined
/// by AND.
fn is_allowed(expression: &str, allowed: &[&str]) -> bool {
    let plain = expression.replace(['(', ')'], " ").replace('/', " OR ");
    let known = |name: &str| allowed.contains(&name.trim().split(" WITH ").next().unwrap_or(""));
    plain.split(" AND ").all(|part| part.split(" OR ").any(known))
}

#[test]
fn deny_toml_allows_the_licence_of_every_dependency() {
    let deny: toml::Table = fs::read_to_string(root().join("deny.toml")).unwrap().parse().unwrap();
    let allowed = deny["licenses"]["allow"].as_array().unwrap();
    let allowed: Vec<&str> = allowed.iter().map(|entry| entry.as_str().unwrap()).collect();
    let mut cargo =
        std::process::Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.current_dir(root()).args(["metadata", "--format-version", "1", "--all-features"]);
    let output = cargo.arg("--locked").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    for package in metadata["packages"].as_array().unwrap() {
        let license = package["license"].as_str().unwrap_or("none");
        assert!(is_allowed(license, &allowed), "{}: {license}", package["name"]);
    }
}

#[test]
fn the_models_forbid_unsafe_code() {
    for model in [
        "fmu-plant",
        "fmu-controller",
        "fmu-kalman",
        "crates/control",
        "cli",
        "examples/van-der-pol",
        "examples/bouncing-ball",
        "examples/pid",
        "examples/lookup-table",
        "examples/three-tank",
        "examples/dc-servo",
        "examples/state-space",
        "examples/wind-turbine",
        "examples/wind-turbine-monitor",
        "examples/can-node",
        "examples/can-bus",
    ] {
        let entry = if model == "cli" { "src/main.rs" } else { "src/lib.rs" };
        let text = fs::read_to_string(root().join(model).join(entry)).unwrap();
        assert!(text.contains("#![forbid(unsafe_code)]"), "{model}");
    }
}

#[test]
fn the_python_package_has_the_licences_of_the_project() {
    for file in ["LICENSE-APACHE", "LICENSE-MIT"] {
        let [ours, copy] =
            [root(), root().join("python")].map(|folder| fs::read(folder.join(file)));
        assert_eq!(ours.unwrap(), copy.unwrap(), "{file}");
    }
}

#[test]
fn there_are_no_marks_of_unfinished_work() {
    let marks = ["todo!(", "unimplemented!(", "FIXME", "#[ignore"];
    for file in files(&root(), "rs").into_iter().chain(files(&root(), "py")) {
        if name(&file) == "tests/tests/claims/tidy.rs" {
            continue;
        }
        let text = fs::read_to_string(&file).unwrap();
        for mark in marks {
            assert!(!text.contains(mark), "{} has {mark}", name(&file));
        }
    }
}

/// The features with which cargo builds each package of a selection.
fn features(selection: &[&str]) -> BTreeMap<String, BTreeSet<String>> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let options = ["tree", "--locked", "--prefix", "none", "--format", "{p}|{f}"];
    let output =
        Command::new(cargo).current_dir(root()).args(options).args(selection).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut packages: BTreeMap<_, BTreeSet<_>> = BTreeMap::new();
    for line in String::from_utf8(output.stdout).unwrap().lines() {
        let Some((package, features)) = line.split_once('|') else { continue };
        let package = package.split(" (").next().unwrap().to_owned();
        packages.entry(package).or_default().insert(features.trim_end_matches(" (*)").to_owned());
    }
    packages
}

/// Cargo compiles a package again for each set of its features, and all that use it.
#[test]
fn one_build_serves_the_command_the_python_package_and_the_tests() {
    let edges = "normal,build";
    let alone = features(&["--edges", edges, "--package", "aso-ftc"]);
    let python = ["--edges", edges, "--package", "aso-ftc", "--package", "aso-ftc-python"];
    let tests = ["--edges", "normal,build,dev", "--workspace", "--exclude", "importers"];
    for selection in [&python[..], &tests] {
        let others = features(selection);
        for (package, features) in &alone {
            assert_eq!(features, &others[package], "{package}: see the end of cli/Cargo.toml");
        }
    }
}
