//! `aso-ftc design`: designs a controller from a plant file; writes its report and its FMU.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Context;
use design::Report;
use files::whole::Pending;

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The plant file: plant, faults and requirements on the controller
    /// (docs/reference/plant-file.md)
    plant: PathBuf,
    /// The design file to write; the report goes into the same folder
    #[arg(long, value_name = "FILE", default_value = "design.toml")]
    out: PathBuf,
    /// The report to write [default: report.html in the folder of the design file]
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Also make the controller FMU
    #[arg(long, value_name = "FMU")]
    fmu: Option<PathBuf>,
    /// The packed controller FMU from which it is made
    #[arg(long, value_name = "FMU", default_value = "dist/AsoController.fmu", requires = "fmu")]
    from: PathBuf,
    /// Print the numbers of the report as JSON
    #[arg(long)]
    json: bool,
}

/// Designs the controller and writes the requested files; returns whether all checks hold.
pub(crate) fn design(options: &Options) -> anyhow::Result<bool> {
    let mut made = design::design(&options.plant)?;
    let fmu = options.fmu.is_some().then(|| made.fmu(&options.from)).transpose()?;
    let page = made.page();
    let beside = options.out.parent().unwrap_or(Path::new("")).join("report.html");
    let page_path = options.report.clone().unwrap_or(beside);
    let mut written = vec![&options.out, &page_path];
    let files = [(&options.out, &made.file), (&page_path, &page)];
    let pending = files
        .into_iter()
        .map(|(path, text)| Pending::new(path, text.as_bytes()).with_context(|| unwritten(path)))
        .collect::<anyhow::Result<Vec<_>>>()?;
    if let (Some(fmu), Some(path)) = (fmu, &options.fmu) {
        fmu.write(path, &page)?;
        written.push(path);
    }
    for (file, (path, _)) in pending.into_iter().zip(files) {
        file.commit().with_context(|| unwritten(path))?;
    }
    if options.json {
        let mut output = std::io::stdout().lock();
        serde_json::to_writer_pretty(&mut output, &made.report)
            .context("cannot print the report")?;
        writeln!(output)?;
    } else {
        summarise(&made.report);
        for path in written {
            println!("{}", path.display());
        }
    }
    Ok(made.holds())
}

fn unwritten(path: &Path) -> String {
    format!("cannot write {}", path.display())
}

/// Prints the main results.
fn summarise(report: &Report) {
    for own in [&report.feedback, &report.observer] {
        println!("{}: {}", own.matrix, own.method);
        if let Some(condition) = own.condition {
            println!("    condition of the eigenvectors {condition:.3e}");
        }
    }
    for check in report.checks.iter().filter(|check| !check.holds) {
        println!("does not hold: {} ({})", check.condition, check.explanation);
    }
}
