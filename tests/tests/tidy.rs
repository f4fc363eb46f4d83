//! The invariants of ARCHITECTURE.md.
#![forbid(unsafe_code)]
#![expect(clippy::unwrap_used, reason = "tests")]

use std::fs;
use std::path::{Path, PathBuf};

use tests::root;

/// Files that may be longer than 400 lines: name and reason.
const LONG_FILES: [(&str, &str); 0] = [];
/// Functions that may be longer than 50 lines: file, name and reason.
const LONG_FUNCTIONS: [(&str, &str, &str); 0] = [];
const MAX_FILE: usize = 400;
const MAX_FUNCTION: usize = 50;

/// All files below `folder` with that extension, without what is built.
fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for item in fs::read_dir(folder).unwrap() {
        let path = item.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() && !["target", "dist", "results"].contains(&name.as_str()) {
            if !name.starts_with('.') && !path.join("pyvenv.cfg").exists() {
                found.extend(files(&path, extension));
            }
        } else if path.extension().is_some_and(|found| found == extension) {
            found.push(path);
        }
    }
    found.sort();
    found
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

#[test]
fn nothing_uses_the_models_and_nothing_uses_the_command() {
    for member in
        ["crates/control", "crates/lapack", "crates/fmi2", "crates/master", "cli", "tests"]
    {
        let manifest: toml::Table =
            fs::read_to_string(root().join(member).join("Cargo.toml")).unwrap().parse().unwrap();
        for section in ["dependencies", "dev-dependencies", "build-dependencies"] {
            let Some(dependencies) = manifest.get(section).and_then(toml::Value::as_table) else {
                continue;
            };
            for forbidden in ["fmu-plant", "fmu-controller", "aso-ftc"] {
                assert!(!dependencies.contains_key(forbidden), "{member} uses {forbidden}");
            }
        }
    }
}

#[test]
fn unsafe_code_stands_at_the_boundaries_only() {
    let allowed = [
        "crates/fmi2/src/ffi.rs",
        "crates/fmi2/src/ffi/entry.rs",
        "crates/fmi2/src/ffi/exports.rs",
        "crates/master/src/library.rs",
        // Signal handlers, and what they read.
        "crates/master/src/crash/place.rs",
        "crates/master/src/crash/signals.rs",
        "crates/master/src/isolate/memory.rs",
        // A mapping of shared memory becomes a slice of atomics.
        "crates/master/src/isolate/region.rs",
        // The C side of BLAS and LAPACK, and its tests.
        "crates/lapack/src/memory.rs",
        "crates/lapack/src/products.rs",
        "crates/lapack/src/routines.rs",
        "crates/lapack/src/symbols.rs",
        "crates/lapack/tests/definitions/products.rs",
        "crates/lapack/tests/definitions/singular.rs",
        "crates/lapack/tests/definitions/solvers.rs",
        "crates/lapack/tests/definitions/spectrum.rs",
        "crates/master/src/library/calls.rs",
        "crates/master/src/library/foreign.rs",
        "crates/master/src/library/functions.rs",
        "crates/master/src/library/log.rs",
        "crates/master/src/library/states.rs",
        "crates/master/src/library/step.rs",
        // Importers of their own, to call the C functions as no safe one would.
        "crates/fmi2/tests/robustness/importer.rs",
        "crates/fmi2/tests/robustness/uninitialised.rs",
        "fuzz/src/design.rs",
    ];
    for file in files(&root(), "rs") {
        let path = name(&file);
        if allowed.contains(&path.as_str()) || path == "tests/tests/tidy.rs" {
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

#[test]
fn the_models_forbid_unsafe_code() {
    for model in [
        "fmu-plant",
        "fmu-controller",
        "crates/control",
        "cli",
        "examples/van-der-pol",
        "examples/bouncing-ball",
        "examples/pid",
        "examples/lookup-table",
        "examples/three-tank",
        "examples/dc-servo",
    ] {
        let entry = if model == "cli" { "src/main.rs" } else { "src/lib.rs" };
        let text = fs::read_to_string(root().join(model).join(entry)).unwrap();
        assert!(text.contains("#![forbid(unsafe_code)]"), "{model}");
    }
}

#[test]
fn no_file_is_longer_than_400_lines() {
    for extension in ["rs", "py"] {
        for file in files(&root(), extension) {
            let lines = fs::read_to_string(&file).unwrap().lines().count();
            let path = name(&file);
            let excused = LONG_FILES.iter().any(|(known, _)| *known == path);
            assert!(lines <= MAX_FILE || excused, "{path} has {lines} lines");
        }
    }
}

#[test]
fn no_function_is_longer_than_50_lines() {
    for file in files(&root(), "rs") {
        let text = fs::read_to_string(&file).unwrap();
        for (function, length) in functions(&text) {
            let path = name(&file);
            let excused =
                LONG_FUNCTIONS.iter().any(|(known, name, _)| *known == path && *name == function);
            let limit = MAX_FUNCTION;
            assert!(length <= limit || excused, "{path}: {function} has {length} lines");
        }
    }
}

/// Name and length of each function: from `fn` to the closing brace of the same indentation, which
/// in a macro may be followed by something.
fn functions(text: &str) -> Vec<(String, usize)> {
    let lines: Vec<_> = text.lines().collect();
    let mut found = Vec::new();
    for (start, line) in lines.iter().enumerate() {
        let code = line.trim_start();
        let indentation = &line[..line.len() - code.len()];
        let words = ["pub ", "pub(crate) ", "pub(super) ", "const ", "unsafe ", "extern \"C\" "];
        let mut rest = code;
        while let Some(shorter) = words.iter().find_map(|word| rest.strip_prefix(word)) {
            rest = shorter;
        }
        let Some(signature) = rest.strip_prefix("fn ") else { continue };
        let function = signature.split(['(', '<']).next().unwrap_or_default().to_owned();
        let end = format!("{indentation}}}");
        let length = lines[start..].iter().take_while(|line| !line.starts_with(&end)).count() + 1;
        if !line.ends_with(';') && !line.ends_with('}') {
            found.push((function, length));
        }
    }
    found
}

#[test]
fn lengths_of_functions_are_counted_right() {
    let text = "fn one() {\n    a;\n}\n\nimpl X {\n    pub(crate) fn two<T>(\n        a: T,\n    ) {\n    }\n}\n";
    assert_eq!(functions(text), [("one".to_owned(), 3), ("two".to_owned(), 4)]);
}

#[test]
fn there_are_no_marks_of_unfinished_work() {
    let marks = ["todo!(", "unimplemented!(", "FIXME", "#[ignore"];
    for file in files(&root(), "rs").into_iter().chain(files(&root(), "py")) {
        if name(&file) == "tests/tests/tidy.rs" {
            continue;
        }
        let text = fs::read_to_string(&file).unwrap();
        for mark in marks {
            assert!(!text.contains(mark), "{} has {mark}", name(&file));
        }
    }
}
