//! `aso-ftc`: exports the fault-tolerant controller and the friction pendulum as FMUs, couples
//! FMUs, and repeats the experiment of Patton and Klinkhieo (2009).
//!
//! Exit status: 0 success; 1 a claim does not hold or a run failed; 2 wrong usage or bad input; 130
//! a run was interrupted.
#![forbid(unsafe_code)]

#[macro_use]
mod output;

mod campaign;
mod check;
mod claims;
mod crash;
mod design;
mod logging;
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
mod summary;
mod worker;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Fault-tolerant control with an augmented state observer, as FMUs.
#[derive(Parser)]
#[command(version = env!("ASO_FTC_VERSION"))]
struct Arguments {
    #[command(subcommand)]
    verb: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Build and pack both FMUs, run the paper's experiment, compare with its claims
    Reproduce(reproduce::Options),
    /// Build crates that use the crate fmu, or the models of this workspace, and pack them into
    /// FMUs
    Pack(pack::Options),
    /// Write a crate with a small model as a starting point
    New(new::Options),
    /// Couple FMUs: from an SSP, an SSD or a system.toml, or named on the command line
    Run(Box<run::Options>),
    /// Design observer and feedback for the plant of a plant file
    Design(design::Options),
    /// Do many runs of a system: sweeps, Monte Carlo, fault campaigns, sensitivity; needs the Python
    /// package aso-ftc
    Campaign(campaign::Options),
    /// Write a page with interactive plots of a results file, and its difference to a second one
    Report(report::Options),
    /// Check an FMU against the rules of its version of FMI, and try it
    Check(check::Options),
}

fn main() -> ExitCode {
    if let Some(status) = worker::worker() {
        return status;
    }
    let verb = Arguments::parse().verb;
    if !matches!(verb, Command::Run(_)) {
        logging::start(0, false);
    }
    crash::watch();
    let status = perform(verb);
    fmu_import::crash::done();
    status
}

fn perform(verb: Command) -> ExitCode {
    let done = match verb {
        Command::Reproduce(options) => reproduce::reproduce(&options),
        Command::Pack(options) => pack::pack(&options),
        Command::New(options) => new::new(&options),
        Command::Run(options) => return run::run(&options),
        Command::Campaign(options) => return campaign::campaign(&options),
        Command::Design(options) => design::design(&options),
        Command::Report(options) => report::report(&options).map(|()| true),
        Command::Check(options) => check::check(&options),
    };
    match done {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(error) => {
            eprintln!("error: {}", files::sentence(error.as_ref()));
            ExitCode::from(2)
        }
    }
}
