//! `--preload`: libraries that FMUs expect in their process, without and with isolation.
#![cfg(target_os = "linux")]
#![expect(clippy::unwrap_used, reason = "tests")]

use std::path::Path;
use std::process::Command;

use tempfile::TempDir;
use tests::c_fmu::CFmu;
use tests::coupled::Run;

/// Number of rows of a complete run.
const ALL: usize = 17;

/// Builds `lib<name>.so` from a line of C in `folder`.
fn library(folder: &Path, name: &str, code: &str) -> String {
    let (source, target) = (folder.join(name).with_extension("c"), folder.join(name));
    let target = target.with_file_name(format!("lib{name}.so"));
    std::fs::write(&source, code).unwrap();
    let mut compiler = Command::new("cc");
    compiler.args(["-shared", "-fPIC", "-o"]).arg(&target).arg(&source);
    assert!(compiler.status().unwrap().success(), "{compiler:?}");
    target.display().to_string()
}

/// An FMU that takes the result of `fmi2GetVersion` from a library that it does not name.
fn needy() -> CFmu {
    CFmu::well_behaved().expecting("provided_version")
}

fn provider(version: &str) -> (TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let code = format!("const char *provided_version = \"{version}\";");
    let path = library(folder.path(), "provider", &code);
    (folder, path)
}

/// Without isolation, and with it.
const WAYS: [&[&str]; 2] = [&[], &["--isolate"]];

#[test]
fn without_its_library_an_fmu_is_refused_with_the_name_of_the_symbol() {
    for way in WAYS {
        let run = Run::pair(&needy(), way);
        assert_eq!(run.status, Some(2), "{way:?}: {}", run.message);
        run.says(&["undefined symbol: provided_version"]);
    }
}

#[test]
fn with_its_library_an_fmu_runs_with_and_without_isolation() {
    let (_folder, path) = provider("2.0");
    for way in WAYS {
        Run::pair(&needy(), &[way, &["--preload", &path]].concat()).expect(0, ALL);
    }
}

#[test]
fn the_symbols_are_those_of_the_library_given() {
    let (_folder, path) = provider("1.0");
    for way in WAYS {
        let run = Run::pair(&needy(), &[way, &["--preload", &path]].concat());
        assert_eq!(run.status, Some(2), "{way:?}: {}", run.message);
        run.says(&["1.0", "2.0"]);
    }
}

#[test]
fn libraries_are_loaded_in_the_order_given() {
    let folder = tempfile::tempdir().unwrap();
    let base = library(folder.path(), "base", "const char *base = \"2.0\";");
    let code = "extern const char *base; const char **borrowed = &base;\n\
                const char *provided_version = \"2.0\";";
    let second = library(folder.path(), "second", code);
    for way in WAYS {
        let right = ["--preload", base.as_str(), "--preload", second.as_str()];
        Run::pair(&needy(), &[way, &right].concat()).expect(0, ALL);
        let wrong = ["--preload", second.as_str(), "--preload", base.as_str()];
        let run = Run::pair(&needy(), &[way, &wrong].concat());
        assert_eq!(run.status, Some(2), "{way:?}: {}", run.message);
        run.says(&["libsecond.so", "undefined symbol: base"]);
    }
}

#[test]
fn a_missing_library_is_refused_by_name_in_both_cases() {
    let [near, far] = WAYS.map(|way| {
        let run = Run::pair(&needy(), &[way, &["--preload", "libnowhere.so.7"]].concat());
        assert_eq!(run.status, Some(2), "{way:?}: {}", run.message);
        run.message
    });
    assert_eq!(near, far);
    assert!(near.contains("libnowhere.so.7"), "{near}");
}

#[test]
fn a_library_that_crashes_ends_only_its_own_process() {
    let folder = tempfile::tempdir().unwrap();
    let code = "#include <stdlib.h>\n__attribute__((constructor)) void f(void) { abort(); }";
    let path = library(folder.path(), "crashing", code);
    let run = Run::pair(&needy(), &["--isolate", "--preload", &path]);
    assert_eq!(run.status, Some(2), "{}", run.message);
    run.says(&["loading the library", "signal 6", "SIGABRT"]);
}

#[test]
fn check_loads_libraries_before_the_fmu_too() {
    let (folder, path) = provider("2.0");
    let fmu = needy().write(folder.path(), "needy").display().to_string();
    let said = |more: &[&str]| {
        let output = tests::run(&[&["check", fmu.as_str()], more].concat());
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let symbol = "undefined symbol: provided_version";
    assert!(said(&[]).contains(symbol), "{}", said(&[]));
    let with = said(&["--preload", &path]);
    assert!(!with.contains(symbol) && !with.contains("fmi2Instantiate"), "{with}");
}
