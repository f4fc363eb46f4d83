//! FMUs in C coupled by the command `aso-ftc run`, and the outcome of the run.

use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

use crate::c_fmu::CFmu;
use crate::command;

/// Communication step of the runs in s, a power of two, so that its multiples are exact.
pub const STEP: f64 = 1.0 / 16.0;

/// Number of rows of a complete run.
pub const ALL: usize = 17;
/// Number of rows of a run whose last successful step ends at t1.
pub const TO_T1: usize = 9;
/// Values of `behaviour` that are unusual but harmless.
pub const UNUSUAL: [&str; 15] = [
    "as it should",
    "pend",
    "warn everywhere",
    "step of one size",
    "no category in fmi2DoStep",
    "no message in fmi2DoStep",
    "no name in fmi2DoStep",
    "specifiers in fmi2DoStep",
    "no environment in fmi2DoStep",
    "another environment in fmi2DoStep",
    "names in fmi2DoStep",
    "long message in fmi2DoStep",
    "print in fmi2DoStep",
    "fork in fmi2DoStep",
    "leak in fmi2DoStep",
];

/// Time after which a run counts as hung.
const PATIENCE: Duration = Duration::from_secs(300);

/// A run of `aso-ftc run` that has ended.
pub struct Run {
    folder: TempDir,
    /// Exit status; `None` if a signal ended the command.
    pub status: Option<i32>,
    /// Standard error.
    pub message: String,
}

impl Run {
    /// Runs `fmus` (names and FMUs) with steps of [`STEP`] to 1 s; `more` has further options, which may change step
    /// and stop time. Equal FMUs share one file.
    ///
    /// # Panics
    ///
    /// If the FMUs cannot be built, or the command cannot be started or does not end.
    #[must_use]
    pub fn of(fmus: &[(&str, &CFmu)], more: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
        let mut arguments: Vec<String> = Vec::new();
        let same = |one: &CFmu, other: &CFmu| format!("{one:?}") == format!("{other:?}");
        for (name, fmu) in fmus {
            let file =
                fmus.iter().find(|(_, known)| same(known, fmu)).map_or(*name, |(name, _)| name);
            let path = folder.path().join(file).with_extension("fmu");
            if !path.exists() {
                let _ = fmu.write(folder.path(), file);
            }
            arguments.extend(["--fmu".to_owned(), format!("{name}={}", path.display())]);
        }
        let step = STEP.to_string();
        let mut fixed = vec!["--method", "jacobi", "--extrapolation", "hold"];
        if !more.contains(&"--step") {
            fixed.extend(["--step", &step]);
        }
        if !more.contains(&"--stop-time") {
            fixed.extend(["--stop-time", "1"]);
        }
        let all = ["run"].into_iter().chain(arguments.iter().map(String::as_str));
        let all = all.chain(fixed).chain(["--out", "out"]).chain(more.iter().copied());
        let (status, message) = end(folder.path(), &all.collect::<Vec<_>>());
        Self { folder, status, message }
    }

    /// Runs `a`, and a well-behaved `b` whose input is the output of `a`.
    #[must_use]
    pub fn pair(a: &CFmu, more: &[&str]) -> Self {
        let connected = ["--connect", "a.y=b.u"].iter().chain(more).copied();
        let recorded = connected.chain(["--record", "a.y", "--record", "b.y"]);
        Self::of(&[("a", a), ("b", &CFmu::well_behaved())], &recorded.collect::<Vec<_>>())
    }

    /// The values of a column of `results.csv`; empty if there is no such file.
    ///
    /// # Panics
    ///
    /// If a line is incomplete, or there is no such column.
    #[must_use]
    pub fn column(&self, name: &str) -> Vec<String> {
        let Ok(text) = fs::read_to_string(self.folder.path().join("out/results.csv")) else {
            return Vec::new();
        };
        assert!(text.is_empty() || text.ends_with('\n'), "the last line is not whole");
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let names = reader.headers().unwrap_or_else(|error| panic!("{error}")).clone();
        let position = names.iter().position(|known| known == name);
        let position = position.unwrap_or_else(|| panic!("{name} is not one of {names:?}"));
        let value = |line: csv::StringRecord| line[position].to_owned();
        reader.records().map(|line| value(line.unwrap_or_else(|error| panic!("{error}")))).collect()
    }

    /// The numbers of a column.
    ///
    /// # Panics
    ///
    /// Same as [`Run::column`], and if an entry is no number.
    #[must_use]
    pub fn numbers(&self, name: &str) -> Vec<f64> {
        let number = |entry: &String| {
            entry.parse().unwrap_or_else(|_| panic!("{entry:?} of {name} is no number"))
        };
        self.column(name).iter().map(number).collect()
    }

    /// Checks that a [`Run::pair`] ended with `status` and that its first `count` rows are right: a.y is the time, b.y
    /// the sum of [`STEP`] times a.y over the steps before.
    ///
    /// # Panics
    ///
    /// If a check fails.
    pub fn expect(&self, status: i32, count: usize) {
        assert_eq!(self.status, Some(status), "{}", self.message);
        assert!(!self.message.contains("panicked"), "{}", self.message);
        let columns = ["time", "a.y", "b.y"].map(|name| self.numbers(name));
        assert!(columns[0].len() >= count, "{} rows: {}", columns[0].len(), self.message);
        let (mut time, mut sum) = (0.0, 0.0);
        for row in 0..count {
            let bits = columns.each_ref().map(|column| column[row].to_bits());
            assert_eq!(bits, [time, time, sum].map(f64::to_bits), "row {row}");
            sum += STEP * time;
            time += STEP;
        }
    }

    /// Checks that the messages of the command contain each of `parts`.
    ///
    /// # Panics
    ///
    /// If one of them is missing.
    pub fn says(&self, parts: &[&str]) {
        for part in parts {
            assert!(self.message.contains(part), "{part:?} is not in {:?}", self.message);
        }
    }
}

/// Runs the command in `folder`; returns the exit status and the text on standard error.
fn end(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let file = |name: &str| File::create(folder.join(name)).map(Stdio::from);
    let streams = file("stdout").and_then(|out| Ok((out, file("stderr")?)));
    let (out, err) = streams.unwrap_or_else(|error| panic!("{error}"));
    let mut started = Command::new(command());
    started.current_dir(folder).args(arguments).stdin(Stdio::null()).stdout(out).stderr(err);
    let mut child = started.spawn().unwrap_or_else(|error| panic!("aso-ftc: {error}"));
    let begin = Instant::now();
    let status = loop {
        match child.try_wait() {
            Ok(Some(status)) => break status,
            Ok(None) if begin.elapsed() < PATIENCE => {
                std::thread::sleep(Duration::from_millis(5));
            }
            other => {
                let _ = child.kill().and_then(|()| child.wait());
                panic!("aso-ftc {arguments:?} does not end: {other:?}");
            }
        }
    };
    let message = fs::read(folder.join("stderr")).unwrap_or_default();
    (status.code(), String::from_utf8_lossy(&message).into_owned())
}
