//! `aso-ftc design`: designs a controller from a plant file; writes its report and its FMU.

mod interrupt;
mod progress;
mod terminal;

use std::ffi::{OsStr, OsString};
use std::fs;
use std::iter;
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::models;
use crate::outputs::{Outputs, check_identity};
use anyhow::Context;
use design::{Design, Language, LogOptions, Precision, TimeLimits};
use files::check_distinct;
use progress::Reporter;
use serde::Serialize;

#[derive(clap::Args)]
#[command(group(clap::ArgGroup::new("code").multiple(true)))]
#[command(group(clap::ArgGroup::new("controller").multiple(true)))]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub(crate) struct Options {
    /// The plant file
    ///
    /// It states plant, faults and requirements on the controller.
    plant: PathBuf,
    /// Write a plant file, no design
    ///
    /// PLANT is then an FMU, a MAT file with the variables A, B, C and D, a CSV table of them with the names of
    /// rows and columns, or a log of the plant's signals over time, from which the plant is identified.
    /// Writes --out [default: NAME.toml], with the bandwidths that were chosen for the plant.
    #[arg(long)]
    #[arg(conflicts_with_all = ["report", "fmu", "kalman_fmu", "feedback_fmu", "worst_case", "json", "code", "compare"])]
    #[arg(conflicts_with = "certificate_time")]
    init: bool,
    /// Further logs of the same plant, with --init
    #[arg(requires = "init", value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// Columns of the log that are commands
    ///
    /// Names with commas between them [default: `u`, `u1`, `u2` and so on].
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    #[arg(requires = "init", help_heading = "Logs")]
    inputs: Vec<String>,
    /// Columns of the log that are measurements
    ///
    /// [default: `y`, `y1`, `y2` and so on; beside --inputs all other columns]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    #[arg(requires = "init", help_heading = "Logs")]
    outputs: Vec<String>,
    /// Number of states of the identified plant
    ///
    /// The default is the order that predicts the last quarter of the log best.
    #[arg(long, value_name = "N", requires = "init", help_heading = "Logs")]
    order: Option<usize>,
    /// The design file [default: NAME-design.toml]
    ///
    /// NAME is that of the plant file, NAME.toml. The report goes into the same folder.
    #[arg(long, value_name = "FILE", help_heading = "Results")]
    out: Option<PathBuf>,
    /// The report [default: NAME-report.html]
    ///
    /// In the folder of the design file.
    #[arg(long, value_name = "FILE", help_heading = "Results")]
    report: Option<PathBuf>,
    /// Also make the controller FMU
    #[arg(long, value_name = "FMU", group = "controller", help_heading = "Results")]
    fmu: Option<PathBuf>,
    /// The FMU from which --fmu makes it
    ///
    /// And --feedback-fmu; a packed controller FMU [default: dist/AsoController.fmu, or the one beside the command].
    #[arg(long, value_name = "FMU", requires = "controller", help_heading = "Results")]
    from: Option<PathBuf>,
    /// Also make a Kalman filter with the plant inside
    ///
    /// An FMU that estimates states and faults by the plant's own FMU, extended or unscented, for the noise of the
    /// observer. Made from the packed dist/KalmanFilter.fmu, or the one beside the command.
    #[arg(long, value_name = "FMU", help_heading = "Results")]
    kalman_fmu: Option<PathBuf>,
    /// Also make the controller for this filter
    ///
    /// An FMU that takes the estimates of the Kalman filter in place of measurements. Made from the same packed FMU as --fmu (see --from).
    #[arg(
        long,
        value_name = "FMU",
        requires = "kalman_fmu",
        group = "controller",
        help_heading = "Results"
    )]
    feedback_fmu: Option<PathBuf>,
    /// Also write the worst plant within tolerances
    ///
    /// As a plant file.
    #[arg(long, value_name = "FILE", help_heading = "Results")]
    worst_case: Option<PathBuf>,
    /// Overwrite files of another design
    ///
    /// Or of another program.
    #[arg(long, help_heading = "Results")]
    force: bool,
    /// Print the numbers of the report as JSON
    #[arg(long, help_heading = "Results")]
    json: bool,
    /// Also write the controller as C99
    ///
    /// Needs a sampled design; the files are NAME.h, NAME.c and `aso_controller.h` in this folder.
    #[arg(long, value_name = "FOLDER", group = "code", help_heading = "Source code")]
    c_code: Option<PathBuf>,
    /// Also write it as a Rust crate without std
    #[arg(long, value_name = "FOLDER", group = "code", help_heading = "Source code")]
    no_std: Option<PathBuf>,
    /// Single precision in the code
    ///
    /// With a bound of the difference; the default is double precision.
    #[arg(long, requires = "code", help_heading = "Source code")]
    float: bool,
    /// Compare all laws that estimate faults
    ///
    /// Writes one page, NAME-comparison.html or --report, and no design.
    #[arg(long, conflicts_with_all = ["out", "fmu", "kalman_fmu", "feedback_fmu", "worst_case", "c_code", "no_std"])]
    #[arg(conflicts_with_all = ["certificate_time", "gain_time"], help_heading = "Computation")]
    compare: bool,
    /// Time for proofs in s
    ///
    /// The time that certificates and bounds of large plants may take before the rest of them is left out;
    /// 0 leaves all out.
    #[arg(long, value_name = "SECONDS", default_value = "30", value_parser = seconds)]
    #[arg(allow_negative_numbers = true, help_heading = "Computation")]
    certificate_time: Duration,
    /// Time for gains in s
    ///
    /// The time that the search for gains by linear matrix inequalities may take before the design is refused.
    #[arg(long, value_name = "SECONDS", default_value = "300", value_parser = seconds)]
    #[arg(allow_negative_numbers = true, help_heading = "Computation")]
    gain_time: Duration,
    /// Load a shared library first
    ///
    /// Its symbols are visible to the plant's FMU. May be repeated.
    #[arg(long, value_name = "LIBRARY", help_heading = "Computation")]
    preload: Vec<OsString>,
}

/// Designs the controller and writes the requested files, all or none; returns whether all checks
/// hold and the verdict is not red. With `--init` and `--compare`, returns true.
pub(crate) fn design(options: &Options) -> anyhow::Result<bool> {
    if options.init {
        return init(options).map(|()| true);
    }
    let extension = options.plant.extension().and_then(OsStr::to_str).unwrap_or_default();
    anyhow::ensure!(
        !matches!(extension.to_ascii_lowercase().as_str(), "fmu" | "mat" | "csv" | "parquet"),
        "{0} is no plant file; `aso-ftc design --init {0}` writes one for it",
        options.plant.display()
    );
    if options.compare {
        return compare(options).map(|()| true);
    }
    let (out, report) = output_paths(options);
    let from = options.from()?;
    let mut outputs: Vec<(&str, &Path)> = vec![("--out", &out), ("--report", &report)];
    outputs.extend(options.fmu.as_deref().map(|path| ("--fmu", path)));
    outputs.extend(options.kalman_fmu.as_deref().map(|path| ("--kalman-fmu", path)));
    outputs.extend(options.feedback_fmu.as_deref().map(|path| ("--feedback-fmu", path)));
    outputs.extend(options.worst_case.as_deref().map(|path| ("--worst-case", path)));
    let filter = options.kalman_fmu.as_ref().map(|_| models::default_fmu(models::FILTER));
    let filter = filter.transpose()?;
    let mut inputs: Vec<(&str, &Path)> = vec![("the plant file", &options.plant)];
    inputs.extend(from.as_deref().map(|path| ("--from", path)));
    inputs.extend(filter.as_deref().map(|path| ("the packed Kalman filter", path)));
    check_distinct(&inputs, &outputs)?;
    options.preload.iter().try_for_each(|library| fmu_import::preload(library))?;
    let mut design = {
        let progress = Reporter::new();
        let limits = TimeLimits {
            gains: options.gain_time,
            certificates: options.certificate_time,
            interrupted: interrupt::listen()?,
        };
        design::design_within(&options.plant, &limits, &|step| progress.show(step))?
    };
    let code = code(options, &design)?;
    outputs.extend(code.files.iter().map(|file| (file.option, file.path.as_path())));
    inputs.extend(design.model.as_deref().map(|path| ("the plant's FMU", path)));
    check_distinct(&inputs, &outputs)?;
    if !options.force {
        for (_, path) in outputs.iter().filter(|(_, path)| !code.is_runtime(path, &design.identity))
        {
            check_identity(path, &design.identity)?;
        }
    }
    let mut fmus = Vec::new();
    if let (Some(path), Some(from)) = (&options.fmu, &from) {
        fmus.push((path, design.fmu(from)?));
    }
    if let (Some(path), Some(base)) = (&options.kalman_fmu, &filter) {
        fmus.push((path, design.kalman_fmu(base)?));
    }
    if let (Some(path), Some(from)) = (&options.feedback_fmu, &from) {
        fmus.push((path, design.feedback_fmu(from)?));
    }
    let page = design.page();
    let mut staged = Outputs::default();
    staged.stage(&out, |path| fs::write(path, &design.file))?;
    staged.stage(&report, |path| fs::write(path, &page))?;
    for (path, fmu) in fmus {
        staged.stage(path, |path| fmu.write(path, &page))?;
    }
    for file in &code.files {
        staged.stage(&file.path, |path| fs::write(path, &file.text))?;
    }
    if let Some(path) = &options.worst_case {
        let text = design.worst_case.as_ref();
        let text = text.context(
            "no worst case can be written: the loop is not stable, or a fault or a disturbance enters measurements or \
             delayed signals by an input of the plant's FMU",
        )?;
        staged.stage(path, |path| fs::write(path, text))?;
    }
    staged.commit()?;
    let of_filter = options.kalman_fmu.as_ref().and_then(|_| design.kalman_warning());
    for warning in code.warnings.iter().chain(&of_filter) {
        eprintln!("warning: {warning}");
    }
    if options.json {
        print_json(&design.report, "the report")?;
    } else {
        terminal::summarise(&design.report);
        for (_, path) in outputs {
            println!("{}", path.display());
        }
    }
    Ok(design.holds())
}

/// The source code of the controller.
#[derive(Default)]
struct CodeFiles {
    files: Vec<CodeFile>,
    warnings: Vec<String>,
}

struct CodeFile {
    /// The option that requests the file.
    option: &'static str,
    path: PathBuf,
    text: String,
}

impl CodeFiles {
    /// Whether the existing file at `path` is a runtime file, which is the same for every design and therefore does not
    /// contain an `identity`. A runtime file is recognised by the first line of the file to be written at `path`.
    fn is_runtime(&self, path: &Path, identity: &str) -> bool {
        let text = self.files.iter().find(|file| file.path == path).map(|file| &file.text);
        let start =
            text.filter(|text| !text.contains(identity)).and_then(|text| text.lines().next());
        start
            .is_some_and(|start| fs::read_to_string(path).is_ok_and(|text| text.starts_with(start)))
    }
}

/// Returns the source code in the requested languages; no files if none is requested.
fn code(options: &Options, design: &Design) -> anyhow::Result<CodeFiles> {
    let precision = if options.float { Precision::Single } else { Precision::Double };
    let mut all = CodeFiles::default();
    for (option, folder, language) in
        [("--c-code", &options.c_code, Language::C), ("--no-std", &options.no_std, Language::Rust)]
    {
        let Some(folder) = folder else { continue };
        let code = design
            .code(language, precision)
            .with_context(|| format!("{option}: no code for {}", options.plant.display()))?;
        let file = |(path, text)| CodeFile { option, path: folder.join(path), text };
        all.files.extend(code.files.into_iter().map(file));
        all.warnings = code.warnings;
    }
    Ok(all)
}

/// Writes a plant file for an FMU, for matrices or for logs; prints its warnings and its path.
fn init(options: &Options) -> anyhow::Result<()> {
    let stem = options.plant.file_stem().unwrap_or_default().to_string_lossy();
    let out = options.out.clone().unwrap_or_else(|| format!("{stem}.toml").into());
    let sources: Vec<_> = iter::once(&options.plant).chain(&options.logs).cloned().collect();
    let inputs: Vec<_> = sources.iter().map(|path| ("the plant", path.as_path())).collect();
    check_distinct(&inputs, &[("--out", &out)])?;
    anyhow::ensure!(
        options.force || !out.exists(),
        "{} exists; --out names another file, --force overwrites it",
        out.display()
    );
    options.preload.iter().try_for_each(|library| fmu_import::preload(library))?;
    let limits = TimeLimits {
        gains: options.gain_time,
        interrupted: interrupt::listen()?,
        ..TimeLimits::default()
    };
    let log = LogOptions {
        inputs: options.inputs.clone(),
        outputs: options.outputs.clone(),
        order: options.order,
    };
    let file = {
        let progress = Reporter::new();
        design::new_plant_file(&sources, &log, &out, &limits, &|step| progress.show(step))?
    };
    let mut staged = Outputs::default();
    staged.stage(&out, |path| fs::write(path, &file.text))?;
    staged.commit()?;
    for warning in &file.warnings {
        eprintln!("warning: {warning}");
    }
    if let Some(refusal) = file.refusal {
        eprintln!("warning: no controller was found for this plant yet: {refusal}");
    }
    println!("{}", out.display());
    Ok(())
}

/// Compares the estimation laws; writes one page.
fn compare(options: &Options) -> anyhow::Result<()> {
    let stem = options.plant.file_stem().unwrap_or_default().to_string_lossy();
    let page = || PathBuf::from(format!("{stem}-comparison.html"));
    let path = options.report.clone().unwrap_or_else(page);
    let outputs = [("--report", path.as_path())];
    let mut inputs: Vec<(&str, &Path)> = vec![("the plant file", &options.plant)];
    check_distinct(&inputs, &outputs)?;
    options.preload.iter().try_for_each(|library| fmu_import::preload(library))?;
    let comparison = design::compare(&options.plant)?;
    inputs.extend(comparison.model.as_deref().map(|path| ("the plant's FMU", path)));
    check_distinct(&inputs, &outputs)?;
    if !options.force {
        check_identity(&path, &comparison.identity)?;
    }
    let text = design::comparison_page(&comparison);
    let mut staged = Outputs::default();
    staged.stage(&path, |path| fs::write(path, &text))?;
    staged.commit()?;
    if options.json {
        print_json(&comparison, "the comparison")?;
    } else {
        terminal::compare(&comparison);
        println!("{}", path.display());
    }
    Ok(())
}

/// Prints `value` as JSON; an error calls the value `what`.
fn print_json(value: &impl Serialize, what: &str) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(value);
    println!("{}", text.with_context(|| format!("cannot print {what}"))?);
    Ok(())
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    seconds.ok_or_else(|| format!("expected a time in s, 0 or more, found {text}"))
}

/// Returns the paths of design file and report.
fn output_paths(options: &Options) -> (PathBuf, PathBuf) {
    let stem = options.plant.file_stem().unwrap_or_default().to_string_lossy();
    let out = options.out.clone().unwrap_or_else(|| format!("{stem}-design.toml").into());
    let beside = || out.parent().unwrap_or(Path::new("")).join(format!("{stem}-report.html"));
    let report = options.report.clone().unwrap_or_else(beside);
    (out, report)
}

impl Options {
    /// Returns the FMU from which the controller FMUs are made; `None` if no controller FMU is requested.
    fn from(&self) -> anyhow::Result<Option<PathBuf>> {
        let default = || models::default_fmu(models::FMUS[1].1);
        let path = || self.from.clone().map_or_else(default, Ok);
        self.fmu.as_ref().or(self.feedback_fmu.as_ref()).map(|_| path()).transpose()
    }
}
