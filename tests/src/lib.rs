//! Shared parts of the tests: the packed FMUs, the command, the coupled system; FMUs that
//! misbehave; linear slaves, networks of them and their exact solution.
#![forbid(unsafe_code)]

pub mod bus;
pub mod c_fmu;
pub mod c_versions;
pub mod coupled;
pub mod equations;
pub mod isolated;
pub mod linear;
pub mod network;
pub mod node;
pub mod problems;
pub mod scheduled;
mod troubles;

pub use troubles::{Trouble, troubles};

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use fmu_description::Experiment;
use fmu_import::Fmu;
use master::{Algorithm, Probe, Simulation, System};

/// The folder of the workspace.
#[must_use]
pub fn root() -> PathBuf {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR"));
    tests.parent().unwrap_or(tests).to_owned()
}

/// The program of the package `name`, from the folder in the environment variable `BUILT_PROGRAMS`; built if it is not
/// set. `scripts/test` sets it, because cargo may choose other features for a package built alone, and would compile
/// the shared crates again.
///
/// # Panics
///
/// If it cannot be built.
#[must_use]
pub fn program(name: &str) -> PathBuf {
    let file = format!("{name}{}", std::env::consts::EXE_SUFFIX);
    if let Some(folder) = std::env::var_os("BUILT_PROGRAMS") {
        return Path::new(&folder).join(file);
    }
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let status = Command::new(cargo)
        .current_dir(root())
        .env_remove("CARGO_TARGET_DIR")
        .args(["build", "--release", "--package", name, "--locked"])
        .status();
    assert!(status.is_ok_and(|status| status.success()), "{name} cannot be built");
    root().join("target/release").join(file)
}

/// The command `aso-ftc`, see [`program`].
#[must_use]
pub fn command() -> &'static Path {
    static COMMAND: OnceLock<PathBuf> = OnceLock::new();
    COMMAND.get_or_init(|| program("aso-ftc"))
}

/// Runs the command in the workspace; returns its status and output.
///
/// # Panics
///
/// If it cannot be started.
#[must_use]
pub fn run(arguments: &[&str]) -> Output {
    let output = Command::new(command()).current_dir(root()).args(arguments).output();
    output.unwrap_or_else(|error| panic!("aso-ftc cannot be started: {error}"))
}

/// The folder with the packed FMUs; packs them once.
///
/// # Panics
///
/// If they cannot be packed.
#[must_use]
pub fn dist() -> &'static Path {
    static DIST: OnceLock<PathBuf> = OnceLock::new();
    DIST.get_or_init(|| {
        let folder = root().join("target/test-fmus").join(std::process::id().to_string());
        let output = run(&["pack", "--fmi", "both", "--out", &folder.display().to_string()]);
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "aso-ftc pack failed: {message}");
        folder
    })
}

/// The plant and the controller, connected, with these `settings` (`slave.variable`, value).
///
/// # Panics
///
/// If an FMU cannot be instantiated or refuses a setting.
#[must_use]
pub fn closed_loop(settings: &[(&str, &str)]) -> System {
    closed_loop_of("FrictionPendulum.fmu", "AsoController.fmu", settings)
}

/// Same as [`closed_loop`], with the FMUs in these files in [`dist`].
///
/// # Panics
///
/// If an FMU cannot be instantiated or refuses a setting.
#[must_use]
pub fn closed_loop_of(plant: &str, controller: &str, settings: &[(&str, &str)]) -> System {
    let mut system = System::default();
    for (name, file) in [("plant", plant), ("controller", controller)] {
        let instance = Fmu::open(&dist().join(file)).and_then(|fmu| fmu.instantiate(name));
        let slave = Box::new(instance.unwrap_or_else(|error| panic!("{error}")));
        system.add(name, slave).unwrap_or_else(|error| panic!("{error}"));
    }
    let connected = system.connect_equal_names();
    assert_eq!(connected.ok(), Some(3), "x_p, theta and u are connected");
    for (name, value) in settings {
        system.set(name, value).unwrap_or_else(|error| panic!("{error}"));
    }
    system
}

/// Returns a simulation of `system` from 0 s, and a probe for `names`.
///
/// # Panics
///
/// If the system cannot be initialised or a name does not exist.
#[must_use]
pub fn simulation(system: System, algorithm: &Algorithm, names: &[&str]) -> (Simulation, Probe) {
    let port = |name: &&str| system.port(name).unwrap_or_else(|error| panic!("{error}"));
    let ports: Vec<_> = names.iter().map(port).collect();
    let probe = Probe::new(&system, &ports);
    let simulation = Simulation::new(system, algorithm, &Experiment::default());
    (simulation.unwrap_or_else(|error| panic!("{error}")), probe)
}

/// A table of numbers with named columns, read from CSV; an empty cell is NaN. Lines that start with `#` are skipped.
pub struct Table {
    names: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl Table {
    /// Reads the file at `path`.
    ///
    /// # Panics
    ///
    /// If it cannot be read or an entry is no number.
    #[must_use]
    pub fn read(path: &Path) -> Self {
        let text = std::fs::read_to_string(path)
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(text.as_bytes());
        let names = reader.headers().map(|names| names.iter().map(str::to_owned).collect());
        let numbers = |record: Result<csv::StringRecord, csv::Error>| {
            let record = record.unwrap_or_else(|error| panic!("{error}"));
            let number = |entry: &str| {
                let entry = if entry.is_empty() { "NaN" } else { entry.trim() };
                entry.parse().unwrap_or_else(|_| panic!("{entry:?} is no number"))
            };
            record.iter().map(number).collect()
        };
        Self { names: names.unwrap_or_default(), rows: reader.records().map(numbers).collect() }
    }

    /// The values of a column.
    ///
    /// # Panics
    ///
    /// If there is no such column.
    #[must_use]
    pub fn column(&self, name: &str) -> Vec<f64> {
        let position = self.names.iter().position(|known| known == name);
        let position = position.unwrap_or_else(|| panic!("no column {name}"));
        self.rows.iter().map(|row| row[position]).collect()
    }
}
