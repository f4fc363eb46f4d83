//! `aso-ftc campaign`: passes its arguments to the Python package, which does the runs.

use std::ffi::OsString;
use std::process::{Command, ExitCode};

/// The interpreter that is asked for the package, unless the variable [`VARIABLE`] names another.
const PYTHON: &str = if cfg!(windows) { "python" } else { "python3" };
/// The environment variable that names the interpreter.
const VARIABLE: &str = "ASO_FTC_PYTHON";

#[derive(clap::Args)]
#[command(disable_help_flag = true)]
pub(crate) struct Options {
    /// Arguments for the Python package; --help lists them
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<OsString>,
}

/// Runs `python3 -m aso_ftc campaign` and returns its exit status.
pub(crate) fn campaign(options: &Options) -> ExitCode {
    let python = std::env::var_os(VARIABLE).unwrap_or_else(|| PYTHON.into());
    let shown = python.to_string_lossy().into_owned();
    let found = Command::new(&python)
        .args([
            "-c",
            "import importlib.util as u, sys; sys.exit(0 if u.find_spec('aso_ftc') else 9)",
        ])
        .status();
    let sentence = match found {
        Ok(status) if status.success() => {
            let mut command = Command::new(&python);
            command.args(["-m", "aso_ftc", "campaign"]).args(&options.arguments);
            match replaced(command) {
                Ok(status) => return status,
                Err(error) => format!("cannot start {shown}: {error}"),
            }
        }
        Ok(_) => format!(
            "{shown} has no package aso_ftc, which does campaigns: install the wheel of scripts/wheel with its \
             extra \"campaign\", or name another interpreter in {VARIABLE}"
        ),
        Err(error) => format!("campaigns need Python, and {shown} cannot be started: {error}"),
    };
    eprintln!("error: {sentence}");
    ExitCode::from(2)
}

/// Becomes the other program, so that it gets Ctrl-C alone.
#[cfg(unix)]
fn replaced(mut command: Command) -> std::io::Result<ExitCode> {
    Err(std::os::unix::process::CommandExt::exec(&mut command))
}

/// Runs the other program to its end.
#[cfg(not(unix))]
fn replaced(mut command: Command) -> std::io::Result<ExitCode> {
    let code = command.status()?.code().and_then(|code| u8::try_from(code).ok());
    Ok(ExitCode::from(code.unwrap_or(1)))
}
