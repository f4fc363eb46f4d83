//! `aso-ftc report`: a page with the plots of a results file.

use std::path::{Path, PathBuf};

use anyhow::bail;
use files::check_distinct;
use fmu_description::number::seconds;
use report::{Request, identity};

use crate::outputs::check_own;

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The results file, .csv or .parquet
    ///
    /// Of this program or another one.
    #[arg(value_name = "RESULTS")]
    results: PathBuf,
    /// Subtract a second results file
    #[arg(long, value_name = "RESULTS")]
    against: Option<PathBuf>,
    /// Show the frames of a bus trace
    ///
    /// As `run --bus-trace NAME.log` writes it, in the form of candump.
    #[arg(long, value_name = "FILE")]
    bus_trace: Option<PathBuf>,
    /// Show these variables only
    ///
    /// By name or pattern (`plant.*`); may be repeated.
    #[arg(long, value_name = "PATTERN", value_delimiter = ',')]
    variables: Vec<String>,
    /// The page to write [default: RESULTS, with .html]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Overwrite a page of other results
    ///
    /// Or a file of another program.
    #[arg(long)]
    force: bool,
}

/// Writes the page, and prints the largest difference if there is a second file.
pub(crate) fn report(options: &Options) -> anyhow::Result<()> {
    let out = options.out.clone().unwrap_or_else(|| options.results.with_extension("html"));
    let ending = out.extension().unwrap_or_default().to_ascii_lowercase();
    if ending != "html" && ending != "htm" {
        bail!("{}: a report is an .html file", out.display());
    }
    let mut inputs: Vec<(&str, &Path)> = vec![("the results file", &options.results)];
    inputs.extend(options.against.as_deref().map(|path| ("--against", path)));
    inputs.extend(options.bus_trace.as_deref().map(|path| ("--bus-trace", path)));
    check_distinct(&inputs, &[("--out", &out)])?;
    if !options.force {
        check_own(&out, &identity(&options.results))?;
    }
    let page = report::page(&Request {
        results: &options.results,
        against: options.against.as_deref(),
        variables: &options.variables,
        units: &[],
        bus_trace: options.bus_trace.as_deref(),
        run: None,
    })?;
    if let (Some(largest), Some(other)) = (page.differences.first(), &options.against) {
        if largest.largest > 0.0 {
            println!(
                "largest difference to {}, relative to the range: {}, {:.6e} at t = {} s ({:.3e} of the range)",
                other.display(),
                largest.name,
                largest.largest,
                seconds(largest.at),
                largest.relative
            );
        } else {
            println!("no difference to {}", other.display());
        }
    }
    write(&out, &page.html)
}

/// Writes a page and prints its name.
pub(crate) fn write(out: &Path, html: &str) -> anyhow::Result<()> {
    use anyhow::Context as _;
    let unwritten = || format!("cannot write {}", out.display());
    if let Some(folder) = out.parent() {
        std::fs::create_dir_all(folder).with_context(unwritten)?;
    }
    files::whole::write(out, html.as_bytes()).with_context(unwritten)?;
    println!("{}", out.display());
    Ok(())
}
