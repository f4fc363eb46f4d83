//! Tests of the author's view: the examples, `aso-ftc new`, `aso-ftc pack PATH`.
#![expect(clippy::unwrap_used, reason = "tests")]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use fmu_description::ModelDescription;
use fmu_description::package::Unpacked;
use tests::{command, root};

use crate::run::fails;

const EXAMPLES: [&str; 4] = ["van-der-pol", "bouncing-ball", "pid", "lookup-table"];

/// Runs the command in `folder`. All tests share the folder of built dependencies, so no two tests
/// may use the same crate name.
fn run_in(folder: &Path, arguments: &[&str]) -> Output {
    let libraries = root().join("target/author");
    let mut command = Command::new(command());
    command.current_dir(folder).env("CARGO_TARGET_DIR", libraries).args(arguments).output().unwrap()
}

fn message(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Checks that the command refuses with status 2 and a message that has all of `parts`.
fn refuses(folder: &Path, arguments: &[&str], parts: &[&str]) {
    fails(&run_in(folder, arguments), 2, parts);
}

/// Makes the crate `name` in `folder`, with the dependency versions of this workspace, so that
/// nothing is downloaded.
fn new_crate(folder: &Path, name: &str) {
    let output = run_in(folder, &["new", name]);
    assert!(output.status.success(), "{}", message(&output));
    fs::copy(root().join("Cargo.lock"), folder.join(name).join("Cargo.lock")).unwrap();
}

/// Replaces `old` in the file; panics if it is missing.
fn edit(path: &Path, old: &str, new: &str) {
    let text = fs::read_to_string(path).unwrap();
    assert!(text.contains(old), "{old:?} is not in {}", path.display());
    fs::write(path, text.replace(old, new)).unwrap();
}

#[test]
fn a_model_is_one_file_of_fewer_than_60_lines_and_a_ball_for_both_interfaces_of_40() {
    for example in EXAMPLES {
        let path = root().join("examples").join(example).join("src/lib.rs");
        let text = fs::read_to_string(&path).unwrap();
        let export = text.lines().position(|line| line.starts_with("fmu::export!")).unwrap();
        assert!(export + 1 < 60, "{example}: the export line is line {}", export + 1);
        assert!(text.contains("#![forbid(unsafe_code)]"), "{example}");
        let code = |line: &&str| !line.trim().is_empty() && !line.trim().starts_with("//");
        let lines = text.lines().take(export + 1).filter(code).count();
        assert!(example != "bouncing-ball" || lines <= 40, "{lines} lines of code");
    }
}

/// All files below `folder`, by their paths in it.
fn content(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let (mut files, mut open) = (BTreeMap::new(), vec![folder.to_owned()]);
    while let Some(next) = open.pop() {
        for path in fs::read_dir(next).unwrap().map(|item| item.unwrap().path()) {
            if path.is_dir() {
                open.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().to_owned();
                files.insert(name, fs::read(&path).unwrap());
            }
        }
    }
    files
}

fn contains(library: &[u8], path: &Path) -> bool {
    let path = path.display().to_string();
    library.windows(path.len()).any(|bytes| bytes == path.as_bytes())
}

/// The message of its panic names the file. Without `fmu` it is not a model, which the packer finds after the library is built.
#[test]
fn code_of_a_build_script_leaves_no_local_path_in_the_library() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().canonicalize().unwrap();
    fs::create_dir_all(place.join("src")).unwrap();
    let script = "fn main() {
    let path = std::path::Path::new(&std::env::var(\"OUT_DIR\").unwrap()).join(\"table.rs\");
    std::fs::write(path, \"pub fn entry(at: usize) -> f64 { [1.0, 2.0][at] }\").unwrap();
}
";
    let code = "include!(concat!(env!(\"OUT_DIR\"), \"/table.rs\"));
#[used]
static USED: fn(usize) -> f64 = entry;
";
    let manifest = "[package]
name = \"generated\"
version = \"0.1.0\"
edition = \"2024\"
[lib]
crate-type = [\"cdylib\"]
[workspace]
";
    for (file, text) in [("build.rs", script), ("src/lib.rs", code), ("Cargo.toml", manifest)] {
        fs::write(place.join(file), text).unwrap();
    }
    for _ in 0..2 {
        let mut command = Command::new(command());
        command.current_dir(&place).env_remove("CARGO_TARGET_DIR").args(["pack", "."]);
        let output = command.output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{}", message(&output));
        let library = fs::read(place.join("target/libraries/fmu/libgenerated.so")).unwrap();
        assert!(contains(&library, Path::new("table.rs")));
        assert!(!contains(&library, &place), "{}", place.display());
    }
}

#[test]
fn a_new_crate_with_the_files_of_its_author_is_packed_to_the_same_bytes_in_any_folder() {
    let folders = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let [one, other] = folders.each_ref().map(|folder| {
        new_crate(folder.path(), "heat-pump");
        fs::write(folder.path().join("heat-pump/LICENSE"), "To be used by nobody.").unwrap();
        let output = run_in(folder.path(), &["pack", "heat-pump", "--out", "."]);
        assert!(output.status.success(), "{}", message(&output));
        fs::read(folder.path().join("HeatPump.fmu")).unwrap()
    });
    let [fmu, second] = folders
        .each_ref()
        .map(|folder| Unpacked::open_whole(&folder.path().join("HeatPump.fmu")).unwrap());
    let (first, second) = (content(fmu.folder()), content(second.folder()));
    let differs = |path: &&PathBuf| first.get(*path) != second.get(*path);
    let different: BTreeSet<_> = first.keys().chain(second.keys()).filter(differs).collect();
    assert!(one == other, "files that differ: {different:?}");
    let library = fs::read(fmu.library("HeatPump").unwrap()).unwrap();
    let home = std::env::var("HOME").unwrap_or_default();
    for path in [folders[0].path(), &root(), Path::new(&home)] {
        assert!(!contains(&library, path), "the library contains {}", path.display());
    }
    let licenses = fmu.folder().join("documentation/licenses");
    let entry = fs::read_to_string(licenses.join("license.txt")).unwrap();
    assert!(entry.starts_with("heat-pump 0.1.0: no licence is stated\n\nTo be used by nobody."));
    assert!(fs::read_dir(&licenses).unwrap().count() > 5);
    let page = fs::read_to_string(fmu.folder().join("documentation/index.html")).unwrap();
    assert!(page.contains("T_outside"));
    assert!(!fmu.folder().join("model.png").exists());
    packs_the_files_of_the_author(folders[1].path());
}

/// Packs files of the author unchanged, with the library that is already built.
fn packs_the_files_of_the_author(place: &Path) {
    let folder_of_fmu = place.join("heat-pump");
    let files = [
        "resources/maps/a.csv",
        "documentation/index.html",
        "documentation/pictures/b.svg",
        "extra/org.example/c.xml",
    ];
    for path in files {
        fs::create_dir_all(folder_of_fmu.join(path).parent().unwrap()).unwrap();
        fs::write(folder_of_fmu.join(path), path).unwrap();
    }
    let picture = b"\x89PNG\r\n\x1a\n and more";
    fs::write(folder_of_fmu.join("model.png"), picture).unwrap();
    let output = run_in(&folder_of_fmu, &["pack", "."]);
    assert!(output.status.success(), "{}", message(&output));
    let fmu = Unpacked::open_whole(&folder_of_fmu.join("dist/HeatPump.fmu")).unwrap();
    for path in files {
        assert_eq!(fs::read_to_string(fmu.folder().join(path)).unwrap(), path);
    }
    assert_eq!(fs::read(fmu.folder().join("model.png")).unwrap(), picture);
    fs::write(folder_of_fmu.join("model.png"), "GIF89a").unwrap();
    refuses(&folder_of_fmu, &["pack", "."], &["model.png", "expected a PNG file"]);
    fs::write(folder_of_fmu.join("model.png"), picture).unwrap();
    states_the_terminals_of_the_author(&folder_of_fmu);
}

/// In FMI 3.0 the terminals are those of the author, whose members are variables.
fn states_the_terminals_of_the_author(folder: &Path) {
    let file = "terminalsAndIcons/terminalsAndIcons.xml";
    fs::create_dir_all(folder.join("terminalsAndIcons")).unwrap();
    let terminals = |variable: &str| {
        format!(
            "<fmiTerminalsAndIcons fmiVersion=\"3.0\"><Terminals><Terminal name=\"air\" \
             matchingRule=\"plug\"><TerminalMemberVariable variableName=\"{variable}\" \
             memberName=\"T\" variableKind=\"signal\"/></Terminal></Terminals>\
             </fmiTerminalsAndIcons>"
        )
    };
    fs::write(folder.join(file), terminals("T_outside")).unwrap();
    let output = run_in(folder, &["pack", ".", "--fmi", "3"]);
    assert!(output.status.success(), "{}", message(&output));
    let fmu = Unpacked::open_whole(&folder.join("dist/HeatPump.fmi3.fmu")).unwrap();
    assert_eq!(fs::read_to_string(fmu.folder().join(file)).unwrap(), terminals("T_outside"));
    fs::write(folder.join(file), terminals("T_inside")).unwrap();
    refuses(folder, &["pack", ".", "--fmi", "3"], &[file, "terminal air", "`T_inside`"]);
}

#[test]
fn two_crates_with_a_model_of_one_name_do_not_write_one_file() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display().to_string();
    let table = "examples/lookup-table";
    let output = tests::run(&["pack", table, table, "--out", &out]);
    assert_eq!(output.status.code(), Some(2), "{}", message(&output));
    assert!(message(&output).contains("LookupTable.fmu is the FMU of another of these crates"));
}

#[test]
fn another_table_gives_the_same_library_other_variables() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display().to_string();
    let output = tests::run(&["pack", "examples/lookup-table", "--out", &out]);
    assert!(output.status.success(), "{}", message(&output));
    let fmu = Unpacked::open(&folder.path().join("LookupTable.fmu")).unwrap();
    let library = fmu.library("LookupTable").unwrap();
    let names = |table: &str| {
        fs::write(folder.path().join("table.csv"), table).unwrap();
        let xml =
            fmu_import::describe(&library, folder.path()).map_err(|error| error.to_string())?;
        let description = ModelDescription::parse(xml.as_bytes()).unwrap();
        let names = description.variables.iter().skip(1).map(|variable| variable.name.clone());
        Ok(names.collect::<Vec<_>>())
    };
    assert_eq!(names("alpha,lift\n0,0\n1,2\n"), Ok(vec!["alpha".to_owned(), "lift".to_owned()]));
    for table in
        ["", "x,y\n", "x,y\n0,0\n", "x,y\n1,0\n1,1\n", "x,y\n0,0\n1,inf\n", "x,y\n0,a\n1,0\n"]
    {
        let refusal: String = names(table).unwrap_err();
        assert!(refusal.contains("table.csv"), "{refusal}");
    }
}

#[test]
fn rules_that_the_variables_break_are_named_with_their_section_by_the_first_test_and_by_the_packer()
{
    let folder = tempfile::tempdir().unwrap();
    new_crate(folder.path(), "broken-table");
    let model = folder.path().join("broken-table/src/lib.rs");
    // The macro sees expressions, not their values.
    edit(&model, "min = 1e-9", "max = 1e-9 / 2.0");
    let parts = ["2.2.7", "max"];
    refuses(folder.path(), &["pack", "broken-table"], &parts);
    let output = Command::new("cargo")
        .current_dir(folder.path().join("broken-table"))
        .env("CARGO_TARGET_DIR", root().join("target/author"))
        .env("CARGO_PROFILE_DEV_DEBUG", "false")
        .args(["test", "--quiet"])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned() + &message(&output);
    assert!(!output.status.success());
    for part in parts {
        assert!(said.contains(part) || said.contains(&part.replace('"', "\\\"")), "{said}");
    }
    assert!(!folder.path().join("dist").exists());
}

#[test]
fn mistakes_in_the_variables_are_errors_of_the_compiler_at_their_lines() {
    let folder = tempfile::tempdir().unwrap();
    new_crate(folder.path(), "broken-struct");
    let model = folder.path().join("broken-struct/src/lib.rs");
    edit(&model, "name = \"T_outside\"", "name = \"T\"");
    edit(&model, "derivative_of = temperature", "derivative_of = temprature");
    let parts = [
        "two variables have the name \"T\" (FMI 2.0.5, section 2.2.7)",
        "`temprature` is no variable of this struct",
        "lib.rs:18:27",
        "could not build",
    ];
    refuses(folder.path(), &["pack", "broken-struct"], &parts);
}

#[test]
fn warnings_of_a_model_reach_the_user_of_its_fmu() {
    let folder = tempfile::tempdir().unwrap();
    new_crate(folder.path(), "talking-room");
    let model = folder.path().join("talking-room/src/lib.rs");
    edit(&model, "    time_constant: f64,\n}", "    time_constant: f64,\n    log: fmu::Log,\n}");
    let check = "if self.power < 0.0 {\n            self.log.warn(format!(\"{} W, 100 %\", self.power));\n        }\n        let rest =";
    edit(&model, "let rest =", check);
    let output = run_in(folder.path(), &["pack", "talking-room", "--out", "."]);
    assert!(output.status.success(), "{}", message(&output));
    let run = ["run", "TalkingRoom.fmu", "--stop-time", "1", "--step", "0.5"];
    let quiet = run_in(folder.path(), &run);
    assert!(quiet.status.success() && !message(&quiet).contains(" W, 100 %"));
    let loud = run_in(folder.path(), &[&run[..], &["--set", "TalkingRoom.power=-5"]].concat());
    assert!(loud.status.success() && message(&loud).contains("logStatusWarning: -5 W, 100 %"));
}

#[test]
fn folders_without_a_crate_with_a_model_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refuses = |parts: &[&str]| refuses(folder.path(), &["pack", "own"], parts);
    let crate_path = folder.path().join("own");
    fs::create_dir_all(crate_path.join("src")).unwrap();
    refuses(&["own", "there is no", "Cargo.toml"]);
    fs::write(crate_path.join("Cargo.toml"), "[workspace]\nmembers = []\n").unwrap();
    refuses(&["own", "no members"]);
    fs::create_dir_all(crate_path.join("member/src")).unwrap();
    fs::write(crate_path.join("member/Cargo.toml"), "[package]\nname = \"member\"\n").unwrap();
    fs::write(crate_path.join("member/src/lib.rs"), "").unwrap();
    fs::write(crate_path.join("Cargo.toml"), "[workspace]\nmembers = [\"member\"]\n").unwrap();
    refuses(&["Cargo.toml is a workspace", "one of its crates"]);
    let manifest = "[package]\nname = \"own\"\nedition = \"2024\"\n[workspace]\n[lib]\n";
    fs::write(crate_path.join("Cargo.toml"), manifest).unwrap();
    fs::write(crate_path.join("src/lib.rs"), "pub fn nothing() {}\n").unwrap();
    refuses(&["Cargo.toml", "crate-type = [\"cdylib\"]"]);
    fs::write(crate_path.join("Cargo.toml"), format!("{manifest}crate-type = [\"cdylib\"]\n"))
        .unwrap();
    refuses(&["does not describe itself", "fmuDescribe"]);
    fs::write(crate_path.join("src/lib.rs"), "pub fn nothing() {\n").unwrap();
    refuses(&["unclosed delimiter", "could not build"]);
    fs::write(crate_path.join("Cargo.toml"), "[package\n").unwrap();
    refuses(&["cannot pack own", "Cargo.toml"]);
    assert!(!folder.path().join("dist").exists());
}

#[test]
fn bad_names_and_existing_folders_are_refused_and_no_files_are_left() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path();
    for name in ["", "2nd", "Heat", "heat pump", "heat--pump", "wärme", "heat/pump", "-", "../up"]
    {
        refuses(place, &["new", "--", name], &["gives no identifier", "heat-pump"]);
    }
    for name in ["serde", "fmu", "self", "con", "model"] {
        refuses(place, &["new", name], &[name, "taken"]);
    }
    refuses(place, &["new", &"long".repeat(20)], &["80 characters", "at most 64"]);
    refuses(place, &["new", "pump", "--fmu", "nowhere"], &["nowhere", "crate fmu"]);
    assert_eq!(fs::read_dir(place).unwrap().count(), 0);
    fs::create_dir(place.join("pump")).unwrap();
    fs::write(place.join("file"), "mine").unwrap();
    refuses(place, &["new", "pump"], &["pump exists already"]);
    refuses(place, &["new", "pump", "--path", "file"], &["file exists already"]);
    refuses(place, &["new", "pump", "--path", "file/pump"], &["cannot write", "file"]);
    assert_eq!(fs::read_dir(place.join("pump")).unwrap().count(), 0);
    assert_eq!(fs::read_dir(place).unwrap().count(), 2);
}

#[test]
fn a_new_crate_depends_on_the_stated_version_of_fmu() {
    let folder = tempfile::tempdir().unwrap();
    let crate_path = root().join("crates/fmu").display().to_string();
    let url = "https://example.org/fmu.git";
    let kinds = [("a", None, "path", crate_path.as_str()), ("b", Some(url), "git", url)];
    let mut files = BTreeSet::new();
    for (name, source, key, expected) in kinds {
        let mut arguments = vec!["new", name, "--path"];
        let target = format!("deep/down/{name}");
        arguments.push(&target);
        arguments.extend(source.iter().flat_map(|source| ["--fmu", source]));
        let output = run_in(folder.path(), &arguments);
        assert!(output.status.success(), "{}", message(&output));
        let manifest = fs::read_to_string(folder.path().join(&target).join("Cargo.toml")).unwrap();
        let manifest: toml::Table = manifest.parse().unwrap();
        assert_eq!(manifest["dependencies"]["fmu"][key].as_str(), Some(expected));
        files.extend(
            fs::read_dir(folder.path().join(&target))
                .unwrap()
                .map(|item| item.unwrap().file_name().into_string().unwrap()),
        );
    }
    let expected = [".gitignore", "Cargo.toml", "README.md", "src"].map(str::to_owned);
    assert_eq!(files, BTreeSet::from(expected));
}
