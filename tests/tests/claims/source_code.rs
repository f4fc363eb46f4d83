//! `--compile`: FMUs with source code in the place of a library.
#![cfg(target_os = "linux")]
#![expect(clippy::unwrap_used, reason = "tests")]

use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt as _;
use std::path::Path;
use std::process::{Command, Output};

use fmu_description::package::{Package, Unpacked, platforms_of};
use tests::c_fmu::CFmu;

/// Runs the command in `folder`, with a cache in it.
fn run(folder: &Path, compiler: impl AsRef<OsStr>, arguments: &[&str]) -> Output {
    let mut command = Command::new(tests::command());
    command.current_dir(folder).env("XDG_CACHE_HOME", folder.join("cache")).env("CC", compiler);
    command.args(arguments).output().unwrap()
}

fn said(output: &Output) -> String {
    let parts = [&output.stdout, &output.stderr];
    parts.map(|part| String::from_utf8_lossy(part).into_owned()).concat()
}

const RUN: [&str; 6] = ["run", "slave.fmu", "--stop-time", "1", "--step", "0.0625"];

#[test]
fn without_the_option_the_refusal_mentions_it() {
    let folder = tempfile::tempdir().unwrap();
    let _ = CFmu::well_behaved().in_source().write(folder.path(), "slave");
    let output = run(folder.path(), "cc", &RUN);
    let said = said(&output);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("no library") && said.contains("--compile"), "{said}");
}

#[test]
fn a_built_fmu_gives_the_results_of_its_library_and_is_built_once() {
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str| std::fs::read(folder.path().join(name).join("results.csv")).unwrap();
    let _ = CFmu::well_behaved().write(folder.path(), "slave");
    assert!(run(folder.path(), "cc", &[&RUN[..], &["--out", "a"]].concat()).status.success());
    let _ = CFmu::well_behaved().in_source().write(folder.path(), "slave");
    let mut built = Vec::new();
    for more in [&["--out", "b"][..], &["--out", "c", "--isolate"]] {
        let output = run(folder.path(), "cc", &[&RUN[..], &["--compile"], more].concat());
        assert!(output.status.success(), "{}", said(&output));
        assert_eq!(read("a"), read(more[1]));
        let kept = std::fs::read_dir(folder.path().join("cache/aso-ftc/compiled")).unwrap();
        built.push(kept.map(|entry| entry.unwrap().file_name()).collect::<Vec<_>>());
    }
    assert!(built[0].len() == 1 && built[0] == built[1], "{built:?}");
}

/// The model description and a source file are in Latin-1, the name of the compiler is no text at all.
#[test]
fn a_built_fmu_gives_the_results_of_its_library_also_if_it_is_not_in_utf_8() {
    let latin_1 = |text: &str| -> Vec<u8> {
        text.chars().map(|character| u8::try_from(character).unwrap()).collect()
    };
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str| std::fs::read(folder.path().join(name).join("results.csv")).unwrap();
    let _ = CFmu::well_behaved().write(folder.path(), "slave");
    assert!(run(folder.path(), "cc", &[&RUN[..], &["--out", "a"]].concat()).status.success());
    let path = CFmu::well_behaved().in_source().write(folder.path(), "slave");
    let unpacked = Unpacked::open_whole(&path).unwrap();
    let xml = std::fs::read_to_string(unpacked.folder().join("modelDescription.xml")).unwrap();
    let xml = xml.replace("UTF-8", "ISO-8859-1");
    let xml = xml.replace("modelName=", "description=\"Größe\" modelName=");
    let source = unpacked.folder().join("sources/deeds.c");
    let code = std::fs::read_to_string(&source).unwrap();
    std::fs::write(&source, latin_1(&format!("/* Größe */\n{code}"))).unwrap();
    let mut package = Package::new(latin_1(&xml));
    package.add_folder("sources", &unpacked.folder().join("sources")).unwrap();
    package.write(&path).unwrap();
    let known = Command::new("sh").args(["-c", "command -v cc"]).output().unwrap().stdout;
    let compiler = folder.path().join(OsStr::from_bytes(b"c\xe9"));
    std::os::unix::fs::symlink(OsStr::from_bytes(known.trim_ascii()), &compiler).unwrap();
    let output = run(folder.path(), &compiler, &[&RUN[..], &["--compile", "--out", "b"]].concat());
    assert!(output.status.success(), "{}", said(&output));
    assert_eq!(read("a"), read("b"));
    // The error of a compiler that is named by such bytes shows them as far as they are text.
    std::fs::remove_file(&compiler).unwrap();
    let output = run(folder.path(), &compiler, &[&RUN[..], &["--compile"]].concat());
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(said(&output).contains("c\u{fffd}; the variable CC names one"), "{}", said(&output));
}

#[test]
fn a_compiler_may_have_a_relative_path() {
    let folder = tempfile::tempdir().unwrap();
    let _ = CFmu::well_behaved().in_source().write(folder.path(), "slave");
    let known = Command::new("sh").args(["-c", "command -v cc"]).output().unwrap().stdout;
    let known = OsStr::from_bytes(known.trim_ascii());
    std::os::unix::fs::symlink(known, folder.path().join("compiler")).unwrap();
    let output = run(folder.path(), "./compiler", &[&RUN[..], &["--compile"]].concat());
    assert!(output.status.success(), "{}", said(&output));
}

#[test]
fn an_fmu_of_a_system_structure_is_built_too() {
    let folder = tempfile::tempdir().unwrap();
    let _ = CFmu::well_behaved().in_source().write(folder.path(), "slave");
    let structure = r#"<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription" version="1.0" name="s">
  <ssd:System name="s">
    <ssd:Elements>
      <ssd:Component name="a" type="application/x-fmu-sharedlibrary" source="slave.fmu"/>
    </ssd:Elements>
  </ssd:System>
</ssd:SystemStructureDescription>"#;
    std::fs::write(folder.path().join("SystemStructure.ssd"), structure).unwrap();
    let words = ["run", "SystemStructure.ssd", "--stop-time", "1", "--step", "0.0625"];
    let refused = run(folder.path(), "cc", &words);
    assert_eq!(refused.status.code(), Some(2), "{}", said(&refused));
    assert!(said(&refused).contains("--compile"), "{}", said(&refused));
    let done = run(folder.path(), "cc", &[&words[..], &["--compile"]].concat());
    assert!(done.status.success(), "{}", said(&done));
}

/// The FMU has the library for model exchange, beside one that this library could load, and none for co-simulation.
#[test]
fn an_fmu_with_the_library_of_one_interface_gets_that_of_the_other_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = CFmu::well_behaved().in_source().write(folder.path(), "slave");
    let unpacked = Unpacked::open_whole(&path).unwrap();
    let xml = std::fs::read_to_string(unpacked.folder().join("modelDescription.xml")).unwrap();
    let both = "<ModelExchange modelIdentifier=\"other\"/>\n<CoSimulation";
    let mut package = Package::new(xml.replace("<CoSimulation", both));
    package.add_folder("sources", &unpacked.folder().join("sources")).unwrap();
    let platform = platforms_of(unpacked.description.version())[0];
    for name in ["other.so", "libneeded.so"] {
        package.add(format!("binaries/{platform}/{name}"), "not loaded here");
    }
    package.write(&path).unwrap();
    let output = run(folder.path(), "cc", &[&RUN[..], &["--compile"]].concat());
    assert!(output.status.success(), "{}", said(&output));
}

#[test]
fn check_tries_a_built_fmu() {
    let folder = tempfile::tempdir().unwrap();
    let _ = CFmu::well_behaved().in_source().write(folder.path(), "slave");
    let answer = said(&run(folder.path(), "cc", &["check", "slave.fmu"]));
    assert!(answer.contains("runs in this master: no") && answer.contains("--compile"), "{answer}");
    let answer = said(&run(folder.path(), "cc", &["check", "--compile", "slave.fmu"]));
    assert!(answer.contains("runs in this master: yes"), "{answer}");
}

#[test]
fn a_missing_compiler_and_wrong_code_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let _ = CFmu::well_behaved().in_source().write(folder.path(), "slave");
    let compile = [&RUN[..], &["--compile"]].concat();
    let output = run(folder.path(), "no-such-compiler", &compile);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(said(&output).contains("no-such-compiler"), "{}", said(&output));
    assert!(said(&output).contains("the variable CC names one"), "{}", said(&output));
    let output = run(folder.path(), "cc -Dfmi2Component=struct", &compile);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(said(&output).contains("failed") && said(&output).contains("deeds.c"));
    let killed = folder.path().join("killed");
    std::fs::write(&killed, "[ \"$1\" = --version ] || kill -9 $$").unwrap();
    let output = run(folder.path(), format!("sh {}", killed.display()), &compile);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(said(&output).contains("failed: signal: 9"), "{}", said(&output));
}

#[test]
fn a_source_file_that_the_list_lacks_is_named_with_its_functions() {
    let folder = tempfile::tempdir().unwrap();
    let path = CFmu::well_behaved().in_source().write(folder.path(), "slave");
    let unpacked = Unpacked::open_whole(&path).unwrap();
    let xml = std::fs::read_to_string(unpacked.folder().join("modelDescription.xml")).unwrap();
    let shorter = xml.replace("<File name=\"deeds.c\"/>", "");
    assert_ne!(shorter, xml);
    let mut package = Package::new(shorter);
    package.add_folder("sources", &unpacked.folder().join("sources")).unwrap();
    package.write(&path).unwrap();
    let output = run(folder.path(), "cc", &[&RUN[..], &["--compile"]].concat());
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(said(&output).contains("undefined reference to"), "{}", said(&output));
    assert!(
        said(&output).contains("does not name deeds.c, which is in sources"),
        "{}",
        said(&output)
    );
}
