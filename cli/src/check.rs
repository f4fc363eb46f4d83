//! `aso-ftc check`: what in a model description breaks a rule.
#![expect(clippy::print_stdout, reason = "the result of the command")]

use std::path::PathBuf;

use fmi2::package::Unpacked;

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The FMU
    fmu: PathBuf,
}

/// Prints each broken rule; true where there is none.
pub(crate) fn check(options: &Options) -> anyhow::Result<bool> {
    let unpacked = Unpacked::open(&options.fmu)?;
    let problems = unpacked.description.problems();
    for problem in &problems {
        println!("{problem}");
    }
    if problems.is_empty() {
        println!("{}: no rule is broken", options.fmu.display());
    }
    Ok(problems.is_empty())
}
