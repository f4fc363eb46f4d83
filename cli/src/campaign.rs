//! `aso-ftc campaign`: passes its arguments to the Python package, which does the runs.

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::Command;

/// The command of the Python interpreter, unless the environment variable [`VARIABLE`] names another interpreter.
const PYTHON: &str = if cfg!(windows) { "python" } else { "python3" };
/// The environment variable with the command of the Python interpreter.
const VARIABLE: &str = "ASO_FTC_PYTHON";

/// The options of the Python package.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// A campaign.toml, or a folder of results
    ///
    /// With --report or --show, it is the folder of the results.
    campaign: PathBuf,
    /// Folder of the results [default: results/NAME]
    ///
    /// An interrupted campaign continues in its folder.
    #[arg(long, value_name = "FOLDER", help_heading = "Results")]
    out: Option<PathBuf>,
    /// Only print the system.toml of this run
    ///
    /// It is for `aso-ftc run`.
    #[arg(long, value_name = "RUN", help_heading = "Results")]
    #[arg(conflicts_with_all = ["report", "out", "workers", "scheduler", "live", "check"])]
    show: Option<u64>,
    /// Only write the page of the results
    #[arg(long, value_name = "FILE", help_heading = "Results")]
    #[arg(conflicts_with_all = ["out", "workers", "scheduler", "live", "check"])]
    report: Option<PathBuf>,
    /// Number of local processes [default: all processors]
    #[arg(long, value_name = "N", help_heading = "Runs")]
    workers: Option<usize>,
    /// Address of a Dask scheduler
    ///
    /// For example `tcp://host:8786`.
    #[arg(long, value_name = "ADDRESS", help_heading = "Runs")]
    scheduler: Option<OsString>,
    /// Show the runs on a page while they are done
    ///
    /// The page is on this machine.
    #[arg(long, help_heading = "Runs")]
    live: bool,
    /// Find what is wrong, and do not run
    #[arg(long, help_heading = "Runs")]
    check: bool,
}

impl Options {
    /// Returns the arguments for the Python package.
    fn arguments(&self) -> Vec<OsString> {
        let mut all = Vec::new();
        let mut put = |name: &str, value: Option<OsString>| {
            all.extend(value.map(|value| {
                let mut word = OsString::from(name);
                word.push(value);
                word
            }));
        };
        put("--out=", self.out.clone().map(Into::into));
        put("--show=", self.show.map(|run| run.to_string().into()));
        put("--report=", self.report.clone().map(Into::into));
        put("--workers=", self.workers.map(|count| count.to_string().into()));
        put("--scheduler=", self.scheduler.clone());
        put("--live", self.live.then(OsString::new));
        put("--check", self.check.then(OsString::new));
        all.extend(["--".into(), self.campaign.clone().into()]);
        all
    }
}

/// Runs `python3 -m aso_ftc campaign`, on Unix in place of this process, and returns its exit status. If Python or the
/// package is missing, prints an error and returns 2.
pub(crate) fn campaign(options: &Options) -> u8 {
    let python = std::env::var_os(VARIABLE).unwrap_or_else(|| PYTHON.into());
    let shown = python.to_string_lossy().into_owned();
    let status = Command::new(&python)
        .args([
            "-c",
            "import importlib.util as u, sys; sys.exit(0 if u.find_spec('aso_ftc') else 9)",
        ])
        .status();
    let sentence = match status {
        Ok(status) if status.success() => {
            let mut command = Command::new(&python);
            command.args(["-m", "aso_ftc", "campaign"]).args(options.arguments());
            match run_in_place(command) {
                Ok(status) => return status,
                Err(error) => format!("cannot start {shown}: {error}"),
            }
        }
        Ok(_) => format!(
            "{shown} has no package aso_ftc, which does campaigns: install it, in a clone of this project by \
             `{shown} -m pip install './python[campaign]'`, or name another interpreter in {VARIABLE}"
        ),
        Err(error) => format!(
            "campaigns need Python, and {shown} cannot be started: {error}; {VARIABLE} names another interpreter"
        ),
    };
    eprintln!("error: {sentence}");
    2
}

/// Replaces this process by the program, which then gets Ctrl-C alone; returns only after an error.
#[cfg(unix)]
fn run_in_place(mut command: Command) -> std::io::Result<u8> {
    Err(std::os::unix::process::CommandExt::exec(&mut command))
}

/// Runs the program to its end and returns its exit status; 1 for a program without a status from 0 to 255.
#[cfg(not(unix))]
fn run_in_place(mut command: Command) -> std::io::Result<u8> {
    let code = command.status()?.code().and_then(|code| u8::try_from(code).ok());
    Ok(code.unwrap_or(1))
}
