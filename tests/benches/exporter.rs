//! Measures how long a call of an exported model takes, compared with the Reference-FMUs.
//!
//!     cargo bench --package tests --bench exporter
//!     REFERENCE_FMU=Feedthrough.fmu:Dahlquist.fmu cargo bench --package tests --bench exporter
//!
//! `REFERENCE_FMU` lists FMI 2.0 FMUs as `PATH` lists folders; each is compared with our model of
//! the same name in `tests/models`. `COUNT_INSTRUCTIONS=1` also counts instructions, by valgrind.
//! `host.c` makes the calls: see there what each operation does. Needs a C compiler; Unix only.
#![forbid(unsafe_code)]
#![expect(clippy::print_stdout, reason = "the result")]
#![expect(clippy::cast_precision_loss, reason = "figures for a table")]
#![expect(clippy::unwrap_used, reason = "a benchmark that cannot run has to stop")]

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Duration;

use criterion::Criterion;
use fmu_description::package::Unpacked;
use fmu_description::{Causality, Kind, ModelDescription};
use tests::root;

/// The crates in `tests/models`.
const MODELS: [&str; 2] = ["feedthrough", "dahlquist"];
/// An operation of the host: its name, the number of values, its description in the table.
const OPERATIONS: [(&str, u64, &str); 14] = [
    ("load", 0, "dlopen, instantiate, free, dlclose"),
    ("instance", 0, "fmi2Instantiate and fmi2FreeInstance"),
    ("get_real", 1, "fmi2GetReal, 1 value"),
    ("get_real", 10, "fmi2GetReal, 10 values"),
    ("get_real", 100, "fmi2GetReal, 100 values"),
    ("set_real", 1, "fmi2SetReal, 1 value"),
    ("set_real", 10, "fmi2SetReal, 10 values"),
    ("set_real", 100, "fmi2SetReal, 100 values"),
    ("do_step", 0, "fmi2DoStep"),
    ("loop", 1, "fmi2SetReal, fmi2DoStep, fmi2GetReal, 1 value"),
    ("loop", 10, "fmi2SetReal, fmi2DoStep, fmi2GetReal, 10 values"),
    ("state", 0, "fmi2GetFMUstate and fmi2FreeFMUstate"),
    ("rollback", 0, "fmi2GetFMUstate into a state, fmi2SetFMUstate"),
    ("serialization", 0, "state to bytes and back: size, serialize, deserialize"),
];
/// Internal step of both models of the Reference-FMUs in s; each communication step is one.
const STEP: &str = "0.1";

/// The command that runs the host with one library.
struct Subject {
    host: PathBuf,
    arguments: Vec<String>,
}

/// A running host process.
struct Running {
    child: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
}

impl Subject {
    /// Starts the host with `library`, the model description `own`, and the Reals that `names` has
    /// too.
    fn new(
        host: &Path,
        library: &Path,
        description: &ModelDescription,
        names: &ModelDescription,
    ) -> Self {
        let reals = |selects: &dyn Fn(Causality) -> bool| {
            let variables = names
                .variables
                .iter()
                .filter(|variable| matches!(variable.kind, Kind::Real(_)))
                .filter(|variable| selects(variable.causality));
            let references = variables.map(|variable| {
                let same = description.variables.iter().find(|other| other.name == variable.name);
                let same = same.unwrap_or_else(|| panic!("no {} in the other", variable.name));
                same.value_reference.to_string()
            });
            references.collect::<Vec<_>>().join(",")
        };
        let inputs = reals(&|causality| causality == Causality::Input);
        let parameters = reals(&|causality| causality == Causality::Parameter);
        let arguments = vec![
            library.display().to_string(),
            description.guid.clone(),
            "file:///nowhere".to_owned(),
            STEP.to_owned(),
            reals(&|causality| causality != Causality::Independent),
            if inputs.is_empty() { parameters } else { inputs },
        ];
        Self { host: host.to_owned(), arguments }
    }

    /// Size in bytes of the stripped library.
    fn stripped_size(&self) -> f64 {
        let stripped = self.host.with_file_name("stripped");
        let status =
            Command::new("strip").arg("-o").arg(&stripped).arg(&self.arguments[0]).status();
        assert!(status.is_ok_and(|status| status.success()), "strip cannot be started");
        stripped.metadata().unwrap().len() as f64
    }

    fn start(&self) -> Running {
        let mut child = Command::new(&self.host)
            .args(&self.arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let (input, output) = (child.stdin.take(), BufReader::new(child.stdout.take().unwrap()));
        Running { child, input, output }
    }

    /// Instructions of one call: the difference of valgrind's counts with more and fewer calls.
    fn instructions(&self, operation: &str, values: u64) -> f64 {
        let (few, more) = if operation == "load" { (1_u32, 10_u32) } else { (50, 200) };
        (self.counted(operation, values, few + more) - self.counted(operation, values, few))
            / f64::from(more)
    }

    fn counted(&self, operation: &str, values: u64, calls: u32) -> f64 {
        let mut valgrind = Command::new("valgrind")
            .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
            .arg(&self.host)
            .args(&self.arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("valgrind can be started");
        writeln!(valgrind.stdin.take().unwrap(), "{operation} {values} {calls}").unwrap();
        let text = String::from_utf8(valgrind.wait_with_output().unwrap().stderr).unwrap();
        let number = text.split("Collected : ").nth(1).and_then(|rest| rest.lines().next());
        number.and_then(|digits| digits.trim().parse().ok()).unwrap_or_else(|| panic!("{text}"))
    }
}

impl Running {
    fn time(&mut self, operation: &str, values: u64, calls: u64) -> Duration {
        writeln!(self.input.as_ref().unwrap(), "{operation} {values} {calls}").unwrap();
        let mut line = String::new();
        self.output.read_line(&mut line).unwrap();
        Duration::from_nanos(line.trim().parse().expect("the host ended, see above"))
    }
}

impl Drop for Running {
    /// The host ends when its standard input is closed.
    fn drop(&mut self) {
        self.input = None;
        self.child.wait().unwrap();
    }
}

/// Returns the median time of a call in ns for each of the `subjects`; Criterion reports the first,
/// ours.
///
/// The subjects take turns in each sample, so that other load on the machine affects all of them
/// alike. Empty if the command line selects other benchmarks.
fn medians(
    criterion: &mut Criterion,
    id: &str,
    subjects: &[Subject],
    row: (&str, u64),
) -> Vec<f64> {
    let mut running: Vec<_> = subjects.iter().map(Subject::start).collect();
    let mut times = vec![Vec::new(); subjects.len()];
    criterion.bench_function(id, |bencher| {
        bencher.iter_custom(|calls| {
            let turn: Vec<_> =
                running.iter_mut().map(|host| host.time(row.0, row.1, calls)).collect();
            for (times, time) in times.iter_mut().zip(&turn) {
                times.push(time.as_secs_f64() * 1e9 / calls as f64);
            }
            turn[0]
        });
    });
    let median = |mut times: Vec<f64>| {
        times.sort_by(f64::total_cmp);
        times.get(times.len() / 2).copied()
    };
    times.into_iter().filter_map(median).collect()
}

/// A line of the table: ours, the reference's if there is one, and the ratio.
fn line(name: &str, figures: &[f64]) -> String {
    match figures {
        [ours, reference] => {
            format!("| {name} | {ours:.1} | {reference:.1} | {:.2} |", ours / reference)
        }
        [ours] => format!("| {name} | {ours:.1} | | |"),
        _ => String::new(),
    }
}

/// Measures all operations of the `subjects`, ours and possibly the reference; returns the lines of
/// the table.
fn compare(criterion: &mut Criterion, model: &str, subjects: &[Subject]) -> Vec<String> {
    let mut lines = vec![
        format!("\n| {model}, ns | ours | Reference-FMUs | ratio |"),
        "|---|---|---|---|".to_owned(),
    ];
    let mut measured = Vec::new();
    for (operation, values, name) in OPERATIONS {
        let id = format!("{model}/{operation}/{values}");
        let figures = medians(criterion, &id, subjects, (operation, values));
        if !figures.is_empty() {
            lines.push(line(name, &figures));
            measured.push((operation, values, name));
        }
    }
    let sizes: Vec<_> = subjects.iter().map(Subject::stripped_size).collect();
    lines.push(line("stripped library, bytes", &sizes));
    if std::env::var_os("COUNT_INSTRUCTIONS").is_some() {
        lines.push(format!("\n| {model}, instructions | ours | Reference-FMUs | ratio |"));
        lines.push("|---|---|---|---|".to_owned());
        for (operation, values, name) in measured {
            let counts = subjects.iter().map(|subject| subject.instructions(operation, values));
            lines.push(line(name, &counts.collect::<Vec<_>>()));
        }
    }
    lines
}

/// Compiles `host.c` into `folder`.
fn build_host(folder: &Path) -> PathBuf {
    let host = folder.join("host");
    let compiler = std::env::var_os("CC").unwrap_or_else(|| "cc".into());
    let status = Command::new(compiler)
        .args(["-O2", "-o"])
        .args([host.as_path(), &root().join("tests/benches/host.c")])
        .arg("-ldl")
        .status();
    assert!(status.is_ok_and(|status| status.success()), "host.c cannot be compiled");
    host
}

/// Builds the models with the profile of packed FMUs; returns the folder of the libraries.
fn build_models() -> PathBuf {
    let target = root().join("target/libraries");
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command.current_dir(root()).args(["build", "--profile", "fmu", "--locked", "--target-dir"]);
    command.arg(&target).args(MODELS.map(|model| format!("--package={model}")));
    assert!(command.status().is_ok_and(|status| status.success()), "the models cannot be built");
    target.join("fmu")
}

fn main() {
    let folder = tempfile::tempdir().unwrap();
    let (host, libraries) = (build_host(folder.path()), build_models());
    let paths = std::env::var_os("REFERENCE_FMU").unwrap_or_default();
    let references: Vec<_> = std::env::split_paths(&paths)
        .map(|path| Unpacked::open(&path).unwrap_or_else(|error| panic!("{error}")))
        .collect();
    let mut criterion = Criterion::default()
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_secs(1))
        .configure_from_args();
    let mut lines = Vec::new();
    for model in MODELS {
        let (prefix, suffix) = (std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
        let library = libraries.join(format!("{prefix}{model}{suffix}"));
        let xml = fmu_import::describe(&library, Path::new("")).unwrap();
        let description = ModelDescription::parse(xml.as_bytes()).unwrap();
        let mut subjects = vec![Subject::new(&host, &library, &description, &description)];
        for fmu in
            references.iter().filter(|fmu| fmu.description.model_name == description.model_name)
        {
            let library = fmu.library(&description.model_name).unwrap();
            subjects.push(Subject::new(&host, &library, &fmu.description, &description));
        }
        lines.extend(compare(&mut criterion, &description.model_name, &subjects));
    }
    criterion.final_summary();
    println!("{}", lines.join("\n"));
}
