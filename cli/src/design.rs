//! `aso-ftc design`: from a plant file to a designed controller, its report and its FMU.

mod analysis;
mod certificate;
mod checks;
mod controller_fmu;
mod design_file;
mod designed;
pub(crate) mod document;
mod gains;
mod linear_plant;
mod page;
mod plant_file;
mod report;
mod reporting;
mod signals;
#[cfg(test)]
mod tests;
mod wanted;

use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Context;

use crate::whole_file::Pending;
use controller_fmu::{Content, ControllerFmu};
use designed::Designed;
use document::{Source, Table};
use plant_file::PlantFile;
use report::Report;

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The plant file: plant, faults and what is wanted of the controller (docs/reference/plant-file.md)
    plant: PathBuf,
    /// The design file to write; the report goes beside it
    #[arg(long, value_name = "FILE", default_value = "design.toml")]
    out: PathBuf,
    /// The report to write [default: report.html beside the design file]
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Also make the controller FMU
    #[arg(long, value_name = "FMU")]
    fmu: Option<PathBuf>,
    /// The packed controller FMU that it is made from
    #[arg(long, value_name = "FMU", default_value = "dist/AsoController.fmu", requires = "fmu")]
    from: PathBuf,
    /// Print the numbers of the report as JSON
    #[arg(long)]
    json: bool,
}

/// Designs the controller and writes what was asked for; whether all checks hold.
pub(crate) fn design(options: &Options) -> anyhow::Result<bool> {
    let source = Source::read(&options.plant)?;
    let parsed = source.parse()?;
    let file = PlantFile::read(&source, &Table::whole(&source, &parsed))?;
    let designed = designed::design(&file)?;
    let description = description(&file, &designed);
    let design = designed.file(&file, &description)?;
    let mut report = reporting::report(&file, &designed, description)
        .with_context(|| format!("the design for {} cannot be examined", file.name()))?;
    let mut fmu = None;
    if options.fmu.is_some() {
        let content = Content { design: &design, plant: source.text() };
        let made = ControllerFmu::new(&options.from, &content)?;
        report.interface = reporting::interface(&made.description);
        fmu = Some(made);
    }
    let page = page::page(&report);
    let beside = options.out.parent().unwrap_or(Path::new("")).join("report.html");
    let page_path = options.report.clone().unwrap_or(beside);
    let mut written = vec![&options.out, &page_path];
    let files = [(&options.out, &design), (&page_path, &page)];
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
        serde_json::to_writer_pretty(&mut output, &report).context("cannot print the report")?;
        writeln!(output)?;
    } else {
        summarise(&report);
        for path in written {
            println!("{}", path.display());
        }
    }
    Ok(report.checks.iter().all(|check| check.holds))
}

fn unwritten(path: &Path) -> String {
    format!("cannot write {}", path.display())
}

/// The user's sentence, or one that names the plant.
fn description(file: &PlantFile<'_>, designed: &Designed) -> String {
    let faults: Vec<_> = designed.linear.faults.iter().map(|fault| fault.name.as_str()).collect();
    file.description.clone().unwrap_or_else(|| {
        format!("Fault-tolerant controller that estimates and compensates {}", faults.join(", "))
    })
}

/// What a reader wants to know first.
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
