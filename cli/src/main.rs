//! `aso-ftc`: exports the fault-tolerant controller and the friction pendulum as FMUs, couples
//! FMUs, and repeats the experiment of Patton and Klinkhieo (2009).
//!
//! Exit status: 0 success; 1 a claim, a check or a design does not hold, a run failed, or output is lost; 2 wrong usage
//! or bad input; 128 and the number of the signal if one ended a run or a design.
#![forbid(unsafe_code)]

#[macro_use]
mod output;

mod campaign;
mod check;
mod claims;
mod crash;
mod design;
mod examples;
mod logging;
mod manual;
mod models;
mod new;
mod outputs;
mod pack;
mod paper_figures;
mod plot;
mod report;
mod reproduce;
mod run;
mod scenario;
mod signals;
mod summary;
#[cfg(target_os = "linux")]
mod supervise;
#[cfg(test)]
mod tests;
mod worker;

use std::process::ExitCode;

use clap::{CommandFactory as _, Parser, Subcommand};

/// Fault-tolerant control with an augmented state observer, as FMUs
#[derive(Parser)]
#[command(version = env!("ASO_FTC_VERSION"), after_long_help = examples::text(&examples::COMMAND))]
struct Arguments {
    #[command(subcommand)]
    verb: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Repeat the paper's experiment, compare with its claims
    ///
    /// Builds and packs both FMUs, runs the experiment, and compares with the claims of the paper.
    #[command(after_long_help = examples::text(&examples::REPRODUCE))]
    Reproduce(reproduce::Options),
    /// Couple FMUs and record their variables
    ///
    /// The FMUs come from an SSP, an SSD or a system.toml, or are named on the command line.
    #[command(after_long_help = examples::text(&examples::RUN))]
    Run(Box<run::Options>),
    /// Design a fault-tolerant controller for a plant
    ///
    /// Designs observer and feedback for the plant of a plant file (docs/reference/plant-file.md); writes
    /// the design, a report, a controller FMU and source code.
    #[command(after_long_help = examples::text(&examples::DESIGN))]
    Design(design::Options),
    /// Do many runs: sweeps, Monte Carlo, faults, sensitivity
    ///
    /// Needs Python and the package aso-ftc. In a clone of this project, this command installs it:
    ///
    /// python -m pip install './python[campaign]'
    ///
    /// The variable `ASO_FTC_PYTHON` names another interpreter than the one in PATH.
    #[command(after_long_help = examples::text(&examples::CAMPAIGN))]
    Campaign(campaign::Options),
    /// Write a page with plots of a results file
    ///
    /// The plots are interactive; with a second results file, the page shows the difference.
    #[command(after_long_help = examples::text(&examples::REPORT))]
    Report(report::Options),
    /// Check an FMU by the rules of its standard, and try it
    #[command(after_long_help = examples::text(&examples::CHECK))]
    Check(check::Options),
    /// Build crates and pack them into FMUs
    ///
    /// The crates use the crate fmu; without one, the models of this project are packed.
    #[command(after_long_help = examples::text(&examples::PACK))]
    Pack(pack::Options),
    /// Write a crate with a small model to start from
    #[command(after_long_help = examples::text(&examples::NEW))]
    New(new::Options),
    /// Print completions for a shell
    #[command(hide = true)]
    Completions(manual::CompletionOptions),
    /// Write the manual pages
    #[command(hide = true)]
    Man(manual::ManOptions),
}

fn main() -> ExitCode {
    if let Some(status) = worker::worker() {
        return status;
    }
    let verb = match output::parse::<Arguments>() {
        Ok(Arguments { verb }) => verb,
        Err(status) => return ExitCode::from(status),
    };
    #[cfg(target_os = "linux")]
    if let Command::Run(options) = &verb
        && let Some(status) = supervise::supervise(options)
    {
        return status;
    }
    if !matches!(verb, Command::Run(_)) {
        logging::start(0, false);
    }
    crash::watch();
    let status = perform(verb);
    let status = output::finish(status);
    fmu_import::crash::done(status);
    ExitCode::from(status)
}

/// Performs a verb and returns the exit status; prints an error that the verb returns.
fn perform(verb: Command) -> u8 {
    let outcome = match verb {
        Command::Reproduce(options) => reproduce::reproduce(&options),
        Command::Pack(options) => pack::pack(&options).map(|()| true),
        Command::New(options) => new::new(&options).map(|()| true),
        Command::Run(options) => return run::run(&options),
        Command::Campaign(options) => return campaign::campaign(&options),
        Command::Design(options) => design::design(&options),
        Command::Report(options) => report::report(&options).map(|()| true),
        Command::Check(options) => check::check(&options),
        Command::Completions(options) => {
            manual::completions(&options, Arguments::command());
            Ok(true)
        }
        Command::Man(options) => manual::man(&options, Arguments::command()).map(|()| true),
    };
    match outcome {
        Ok(true) => 0,
        Ok(false) => 1,
        Err(error) => {
            eprintln!("error: {}", files::sentence(error.as_ref()));
            2
        }
    }
}
