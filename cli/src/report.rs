//! `aso-ftc report`: a page with the plots of a results file.

use std::path::{Path, PathBuf};

use anyhow::bail;
use files::check_distinct;
use fmu_description::number::seconds;
use report::{Comparison, Request, identity};

use crate::outputs::{self, check_identity};
use crate::run::split_names;

/// Largest number of variables that a line about variables without comparison names.
const LISTED: usize = 20;

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The results file: .csv, .parquet or .mat
    ///
    /// Of this program or another one; .mat of Dymola or OpenModelica.
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
    /// By name or pattern (`plant.*`), separated by commas; may be repeated.
    #[arg(long, value_name = "PATTERN")]
    variables: Vec<String>,
    /// Read the rows from this time on, in s
    #[arg(long, value_name = "TIME", default_value_t = f64::NEG_INFINITY, hide_default_value = true, allow_negative_numbers = true)]
    from: f64,
    /// Read the rows up to this time, in s
    #[arg(long, value_name = "TIME", default_value_t = f64::INFINITY, hide_default_value = true, allow_negative_numbers = true)]
    to: f64,
    /// The page to write [default: RESULTS, with .html]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Overwrite a page of other results
    ///
    /// Or a file of another program.
    #[arg(long)]
    force: bool,
}

/// Writes the page and prints its name; with a second file, also prints the largest difference.
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
        check_identity(&out, &identity(&options.results))?;
    }
    let page = report::page(&Request {
        results: &options.results,
        against: options.against.as_deref(),
        variables: &split_names(&options.variables),
        range: (options.from, options.to),
        units: &[],
        bus_trace: options.bus_trace.as_deref(),
        run: None,
    })?;
    if let (Some(comparison), Some(other)) = (&page.comparison, &options.against) {
        print_comparison(comparison, &options.results, other);
    }
    outputs::write(&out, page.html.as_bytes())?;
    println!("{}", out.display());
    Ok(())
}

/// Prints the largest difference relative to the range, or why there is none, and lists the variables not compared.
fn print_comparison(comparison: &Comparison, results: &Path, other: &Path) {
    let (here, there) = (results.display().to_string(), other.display().to_string());
    if comparison.rows == 0 {
        println!("nothing was compared with {there}: the two runs have no time in common");
    } else if let Some(largest) = comparison.differences.first().filter(|_| !comparison.is_equal())
    {
        println!(
            "largest difference to {there}, relative to the range: {}, {:.6e} at t = {} s ({:.3e} of the range)",
            largest.name,
            largest.largest,
            seconds(largest.at),
            largest.relative
        );
    } else {
        let rows = counted(comparison.rows, "row");
        let variables = counted(comparison.differences.len() as u64, "variable");
        println!("no difference to {there} in {rows} of {variables}");
    }
    for sentence in comparison.uncompared(&here, &there, LISTED) {
        println!("not compared: {sentence}");
    }
}

/// Formats a number of things, with an `s` for the plural.
fn counted(count: u64, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}
