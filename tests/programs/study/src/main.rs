//! Runs a system.toml and prints the file of its results.
use std::ops::ControlFlow;

use study::{AssemblyOptions, LoadedConfig, PreparedRun, RunEnd};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("expected a system.toml")?;
    let mut run =
        PreparedRun::new(LoadedConfig::read(path.as_ref())?, &AssemblyOptions::default())?
            .start(None)?;
    if let RunEnd::Failed(error) = run.advance(|_| Ok(ControlFlow::Continue(()))) {
        return Err(error.into());
    }
    println!("{}", run.finish()?.ok_or("nothing was recorded")?.display());
    Ok(())
}
