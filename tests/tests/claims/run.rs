//! `aso-ftc run`, run as a process.
#![expect(clippy::unwrap_used, clippy::float_cmp, reason = "tests; numbers as written")]

mod configuration;
mod ends;
mod files;
mod first_minute;
mod library;
mod messages;

#[cfg(unix)]
mod outputs;
#[cfg(unix)]
mod process;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tests::{command, dist, run};

/// A folder for one test.
struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.path(name).display().to_string()
    }

    fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }

    /// Writes a file and returns its path.
    fn write(&self, name: &str, text: &str) -> String {
        fs::write(self.path(name), text).unwrap();
        self.text(name)
    }

    /// Runs `run` with these arguments in the folder.
    fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(command());
        command.current_dir(self.folder.path()).arg("run").args(arguments);
        command
    }

    /// Runs plant and controller with the results in `out`.
    fn coupled(&self, more: &[&str]) -> Output {
        let arguments = coupled(more);
        self.run(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
    }

    /// As [`Bench::coupled`], but must succeed; returns the output.
    fn coupled_well(&self, more: &[&str]) -> String {
        printed(&self.coupled(more))
    }
}

/// The arguments for plant and controller with the results in `out`.
fn coupled(more: &[&str]) -> Vec<String> {
    let (plant, controller) = (fmu("FrictionPendulum"), fmu("AsoController"));
    let common = ["--plant", &plant, "--controller", &controller, "--out", "out"];
    common.into_iter().chain(more.iter().copied()).map(str::to_owned).collect()
}

fn fmu(name: &str) -> String {
    dist().join(format!("{name}.fmu")).display().to_string()
}

/// A `system.toml` of plant and controller.
fn system_toml(more: &str) -> String {
    let (plant, controller) = (fmu("FrictionPendulum"), fmu("AsoController"));
    format!("[fmus]\nplant = '{plant}'\ncontroller = '{controller}'\n{more}")
}

/// Standard output of a command that succeeded.
fn printed(output: &Output) -> String {
    let message = said(output);
    assert_eq!(output.status.code(), Some(0), "{message}");
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// Standard error.
fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Checks the exit status, and that standard error contains all of `parts`.
pub(crate) fn fails(output: &Output, status: i32, parts: &[&str]) {
    let message = said(output);
    assert_eq!(output.status.code(), Some(status), "{message}");
    for part in parts {
        assert!(message.contains(part), "{part:?} is not in {message:?}");
    }
    assert!(!message.contains("panicked"), "{message}");
}

/// The names in the first line of a CSV file.
fn names(path: &Path) -> Vec<String> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    reader.headers().unwrap().iter().map(str::to_owned).collect()
}

/// Checks that every line is complete and has as many cells as the first; returns the number of
/// rows.
fn whole_rows(text: &str) -> usize {
    assert!(text.ends_with('\n'));
    let cells = text.lines().next().unwrap().split(',').count();
    assert!(text.lines().all(|line| line.split(',').count() == cells));
    text.lines().count() - 1
}
