//! `aso-ftc check`: finds faults of an FMU that cause problems in importers.

mod answer;
mod archive;
mod behaviour;
pub(crate) mod binaries;
mod description;
mod finding;
mod fold;
mod messages;
mod sections;
#[cfg(test)]
mod tests;
mod values;

use std::collections::HashSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context as _, anyhow, bail};
use fmu_description::ModelDescription;
use fmu_description::package::Unpacked;
use fmu_import::isolate::{self, IsolateError, Isolated, Package};
use fmu_import::{Fmu, Instance};
use master::Slave as _;
use serde::Serialize;

use answer::{Answer, TrialResult};
use finding::Finding;

pub(crate) use finding::Severity;

#[derive(clap::Args)]
#[expect(clippy::struct_excessive_bools, reason = "options of a command")]
pub(crate) struct Options {
    /// The FMU
    fmu: PathBuf,
    /// Print the findings as JSON
    #[arg(long)]
    json: bool,
    /// Check the files only, do not run the FMU
    #[arg(long)]
    no_run: bool,
    /// Run the FMU for the time of its default experiment
    ///
    /// By default, 10 steps are made.
    #[arg(long, conflicts_with = "no_run")]
    thorough: bool,
    /// Time limit of a call of the FMU in s
    #[arg(long, value_name = "SECONDS", default_value_t = 30.0, allow_negative_numbers = true)]
    time_limit: f64,
    /// Load a shared library first
    ///
    /// Its symbols are visible to the FMU. May be repeated.
    #[arg(long, value_name = "LIBRARY")]
    preload: Vec<OsString>,
    /// Build the FMU if it has source code only
    #[arg(long, conflicts_with = "no_run")]
    compile: bool,
}

/// The JSON object of `--json`.
#[derive(Serialize)]
struct Report<'a> {
    fmu: &'a Path,
    #[serde(flatten)]
    answer: &'a Answer,
    errors: usize,
    warnings: usize,
    notes: usize,
    findings: &'a [Finding],
}

/// Prints whether the FMU runs, and the findings; returns true if no finding is an error.
pub(crate) fn check(options: &Options) -> anyhow::Result<bool> {
    if options.fmu.is_dir() {
        bail!(
            "{}: expected the archive of an FMU, found a folder; `zip -r ../NAME.fmu .` in this folder \
             makes one",
            options.fmu.display()
        );
    }
    let unpacked = Unpacked::open_whole(&options.fmu)?;
    let (result, findings) = findings(options, &unpacked)?;
    let answer = Answer::new(result, &unpacked.description, &findings);
    let count = |severity| findings.iter().filter(|finding| finding.severity == severity).count();
    let (errors, warnings) = (count(Severity::Error), count(Severity::Warning));
    let notes = count(Severity::Note);
    let fmu = &options.fmu;
    if options.json {
        let findings = &findings;
        let report = Report { fmu, answer: &answer, errors, warnings, notes, findings };
        println!("{}", serde_json::to_string_pretty(&report)?);
        return Ok(errors == 0);
    }
    println!("{answer}");
    let variables = unpacked.description.variables.iter().map(|variable| variable.name.as_str());
    for line in fold::fold(&findings, &variables.collect::<HashSet<_>>()) {
        println!("{line}");
    }
    let name = fmu.display();
    match (errors, warnings) {
        (0, 0) => println!("{name}: no rule is broken"),
        _ => println!("{name}: errors {errors}, warnings {warnings}, notes {notes}"),
    }
    Ok(errors == 0)
}

/// Returns the result of the trial and all findings, errors first. Within a severity, findings that stop a tool come
/// first.
fn findings(options: &Options, unpacked: &Unpacked) -> anyhow::Result<(TrialResult, Vec<Finding>)> {
    let description = &unpacked.description;
    let mut findings = archive::check(&options.fmu, unpacked)?;
    let read = |path: &str| std::fs::read(unpacked.folder().join(path));
    findings.extend(binaries::check(&read, unpacked.entries(), description));
    sections::renumber(&mut findings, description.version());
    findings.extend(description::check(description, &unpacked.warnings));
    let compiled = options.compile.then(|| fmu_import::compile(&options.fmu)).transpose()?;
    let compiled = compiled.filter(|path| *path != options.fmu);
    let compiled = compiled.map(|path| Unpacked::open(&path)).transpose()?;
    let unpacked = compiled.as_ref().unwrap_or(unpacked);
    let result = if let Some(result) = without_trial(options, unpacked) {
        result
    } else {
        let (mut result, mut trial_findings) = run(options, unpacked)?;
        let folder = format!("{}/", unpacked.folder().display());
        if let TrialResult::No { reason } = &mut result {
            *reason = sections::renamed(&reason.replace(&folder, ""), description);
        }
        for finding in &mut trial_findings {
            finding.what = sections::renamed(&finding.what.replace(&folder, ""), description);
            finding.place = sections::renamed(&finding.place, description);
        }
        sections::renumber(&mut trial_findings, description.version());
        findings.extend(trial_findings);
        result
    };
    findings.sort_by_key(|finding| (finding.severity, finding.stops.is_empty(), finding.part));
    Ok((result, findings))
}

/// Returns the reason not to run the FMU; `None` if a trial is possible and requested.
fn without_trial(options: &Options, unpacked: &Unpacked) -> Option<TrialResult> {
    let not_tried = |reason: String| Some(TrialResult::NotTried { reason });
    if options.no_run {
        return not_tried("--no-run".to_owned());
    }
    let description = &unpacked.description;
    let simulation =
        description.stepped().map(|flags| (flags.model_identifier, flags.needs_execution_tool));
    let exchange = description.model_exchange.as_ref();
    let exchange =
        exchange.map(|flags| (flags.model_identifier.clone(), flags.needs_execution_tool));
    let is_simulation = simulation.is_some();
    let (identifier, needs_tool) = simulation.or(exchange)?;
    if !is_simulation && cfg!(not(target_os = "linux")) {
        return not_tried("it is for model exchange only, which is tried on Linux only".to_owned());
    }
    // PythonFMU sets needsExecutionTool in its FMUs, although they run without a tool.
    let is_python = |tool: &str| tool.starts_with("PythonFMU");
    let is_complete = description.generation_tool.as_deref().is_some_and(is_python);
    if needs_tool && !is_complete && options.preload.is_empty() {
        let tool = unpacked.description.generation_tool.as_deref().unwrap_or("the exporting tool");
        return not_tried(format!("it needs {tool} beside it (needsExecutionTool)"));
    }
    let refused = unpacked.library(&identifier).err()?;
    Some(TrialResult::No { reason: refused.to_string() })
}

/// Runs the FMU; on Linux in separate processes, so that a crash or a hang is a finding. Returns an error if the time
/// limit is not a number above 0.
fn run(options: &Options, unpacked: &Unpacked) -> anyhow::Result<(TrialResult, Vec<Finding>)> {
    let seconds = options.time_limit;
    let limit = Duration::try_from_secs_f64(seconds).ok().filter(|limit| !limit.is_zero());
    let limit = limit.with_context(|| {
        format!("--time-limit is {seconds}, expected a number of seconds above 0")
    })?;
    if cfg!(target_os = "linux") {
        return isolated(options, unpacked, limit);
    }
    options.preload.iter().try_for_each(|library| fmu_import::preload(library))?;
    let mut fmu = None;
    let mut make = |name: &str, former: Option<Instance>| -> anyhow::Result<Instance> {
        drop(former);
        let opened = match fmu.take() {
            Some(opened) => opened,
            None => Fmu::open(unpacked.folder())?,
        };
        let instance = opened.instantiate(name);
        fmu = Some(opened);
        let mut instance = instance?;
        instance.set_time_limit(Some(limit));
        instance.guard_arrays();
        Ok(instance)
    };
    Ok(behaviour::check(&as_stepped(&unpacked.description), options.thorough, &mut make))
}

/// Returns the description; without co-simulation, scheduled execution takes the place of co-simulation.
fn as_stepped(description: &ModelDescription) -> ModelDescription {
    ModelDescription { co_simulation: description.stepped(), ..description.clone() }
}

/// Runs the FMU in separate processes. Returns an error for a failure that is not the FMU's fault.
fn isolated(
    options: &Options,
    unpacked: &Unpacked,
    limit: Duration,
) -> anyhow::Result<(TrialResult, Vec<Finding>)> {
    let package = Package::open(unpacked.folder())?;
    let (preload, thorough) = (options.preload.clone(), options.thorough);
    let stepped = as_stepped(&unpacked.description);
    let exchange = stepped.co_simulation.is_none();
    let integration = exchange.then(|| isolate::Integration {
        options: integrate::Method::default().name().to_owned(),
        describe: integrate::description_of,
    });
    let options = isolate::Options {
        time_limit: Some(limit),
        preload,
        strict_binding: true,
        guard_arrays: true,
        integration,
        ..Default::default()
    };
    let description = if exchange { integrate::description_of(&stepped) } else { stepped };
    let description = &description;
    let flags = description.co_simulation.as_ref();
    let only_once = flags.is_some_and(|flags| flags.can_be_instantiated_only_once_per_process);
    let mut broken = None;
    let mut make = |name: &str, former: Option<Isolated>| -> anyhow::Result<Isolated> {
        let instance = match former.filter(|_| !only_once) {
            Some(mut slave) => slave.renew(name, &options).map(|()| slave),
            None => package.instantiate(name, &options),
        };
        instance.map_err(|error| match error {
            IsolateError::Refused { reason, .. } => anyhow!(reason),
            IsolateError::Call { source, .. } => source.into(),
            other => {
                let error = anyhow!("{other}");
                broken = Some(other);
                error
            }
        })
    };
    let (result, mut findings) = behaviour::check(description, thorough, &mut make);
    if exchange {
        // The other findings are about rules of co-simulation, which the FMU does not have.
        findings.retain(|finding| {
            finding.severity == Severity::Error && matches!(result, TrialResult::No { .. })
        });
    }
    broken.map_or(Ok((result, findings)), |error| Err(error.into()))
}
