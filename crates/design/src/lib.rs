//! Designs a fault-tolerant controller from a plant file: gains, checks, report and controller FMU.
//!
//! [`design()`] reads a plant file, which states the plant, its faults and the requirements on the
//! controller. It computes the gains, checks them and analyses the closed loop. [`Design`] holds
//! the controller's `design.toml` and the report (as data and as a page), and creates the
//! controller FMU.
//!
//! The crate `control` has the mathematics; use it directly to design without a plant file.
#![forbid(unsafe_code)]

mod assess;
mod budget;
mod code;
mod compare;
mod design_file;
mod designed_fmu;
mod error;
mod feedback_fmu;
mod init;
mod kalman_fmu;
mod matrix;
mod plant;
mod progress;
mod solve;
#[cfg(test)]
mod tests;
mod threads;

use std::fs;
use std::path::{Path, PathBuf};

use control::robustness::Loop;
use files::{PlaceError, Source};

pub use budget::TimeLimits;
pub use compare::compare;
pub use controller_code::{Code, Language, Precision};
pub use design_page::comparison as comparison_page;
pub use design_report as report;
pub use designed_fmu::DesignedFmu;
pub use error::Error;
pub use init::{LogOptions, NewPlantFile, new_plant_file};
pub use progress::{Observer, Progress};
pub use report::Report;
pub use report::comparison::{Comparison, LawFigures, LawResult};
pub use report::robustness::Level;

use assess::reporting::Assessment;
use assess::{bandwidths, detection, reporting, worst_case};
use designed_fmu::Content;
use kalman_fmu::KalmanFilter;
use plant::parameters::ParameterFamily;
use plant_file::PlantFile;
use plant_file::signals::joined;
use progress::{Step, Steps};
use report::identity;
use solve::solution::Solution;
use solve::{designed, fallback, reconfiguration};

/// A designed controller.
pub struct Design {
    /// The content of the controller's `design.toml`.
    pub file: String,
    /// The numbers of the report.
    pub report: Report,
    /// The text that every file of this design contains: the plant file's name and a number from
    /// the names of its signals.
    pub identity: String,
    /// A plant file with the worst plant that was found within the tolerances; None if the loop is not stable, or if a
    /// plant file of matrices cannot state how a fault or a disturbance enters the plant's FMU.
    pub worst_case: Option<String>,
    /// The loop of plant and controller while commands are within their limits, in deviations from the operating point;
    /// sampled if the controller is sampled. In a design for several plants: the loop of the plant of the file.
    pub closed_loop: Loop,
    /// The FMU of the plant, if the plant file names one.
    pub model: Option<PathBuf>,
    /// The text of the plant file.
    pub plant: String,
    /// The Kalman filter with the plant's FMU, or why there is none.
    kalman: Result<KalmanFilter, PlaceError>,
}

/// Designs the controller that the plant file at `path` asks for.
///
/// # Errors
///
/// [`Error`]: an entry of the file is wrong, with its line; the plant cannot be controlled, its faults
/// cannot be told apart, or no gain meets the requirements.
pub fn design(path: &Path) -> Result<Design, Error> {
    design_within(path, &TimeLimits::default(), &|_| {})
}

/// Same as [`design()`] within `limits`. `observer` is called when a step begins.
///
/// # Errors
///
/// Same as [`design()`]; [`Error::Within`] if the gains were not found in time.
pub fn design_within(
    path: &Path,
    limits: &TimeLimits,
    observer: &Observer<'_>,
) -> Result<Design, Error> {
    let source = Source::read(path).map_err(Error::file("read", path))?;
    design_source(&source, limits, &Steps::new(observer))
}

/// Designs the controller that `text`, the content of a plant file, asks for. `path` appears in errors;
/// relative paths of the text start in its folder.
///
/// # Errors
///
/// Same as [`design()`].
pub fn design_text(path: &Path, text: String) -> Result<Design, Error> {
    let source = Source::new(path, text);
    design_source(&source, &TimeLimits::default(), &Steps::new(&|_| {}))
}

fn design_source(source: &Source, limits: &TimeLimits, steps: &Steps<'_>) -> Result<Design, Error> {
    let file = PlantFile::read(source)?;
    let family = ParameterFamily::of(&file)?;
    let budget = limits.of_gains();
    let file = bandwidths::chosen(&file, &budget)?;
    let in_time = |error: Error| {
        if !budget.is_over() {
            return error;
        }
        error.within(format!("{}: no gains: the rest was {}", file.name(), budget.reason()))
    };
    let gains = || budget.run(|| designed::design(&file));
    let mut designed = steps.run(Step::Gains, gains).map_err(in_time)?;
    if budget.is_over() {
        let reason = budget.reason();
        let text = format!("more time may give better gains: a part of the search was {reason}");
        designed.warnings.push(file.error(&["feedback"], text));
    }
    let description = description(&file, &designed.nominal);
    let detection =
        steps.run(Step::Detection, || detection::detection(&file, &designed, family.as_ref()))?;
    let section = detection.as_ref().map(|detection| &detection.section);
    let without = || {
        let solution = &designed.nominal;
        let fallback = fallback::fallback(&file, solution)?;
        Ok::<_, Error>(reconfiguration::reconfigurations(&file, solution, fallback)?)
    };
    let without = || budget.run(without);
    let (reconfigurations, without) = steps.run(Step::Reconfiguration, without).map_err(in_time)?;
    let controller = designed.file(&file, &description, section, &reconfigurations)?;
    let text = controller.to_toml().map_err(|error| Error::Invalid(error.to_string()))?;
    let assessment = Assessment {
        description,
        detection,
        reconfiguration: without,
        fallback: reconfigurations.fallback.as_ref(),
        limits: limits.clone(),
        ..Assessment::new(&file, family.as_ref(), &designed, steps)
    };
    let report = reporting::report(assessment).map_err(|error| {
        error.within(format!("the design for {} cannot be examined", file.name()))
    })?;
    let identity = identity::identity(&report);
    let worst_case = worst_case::plant_file(&file, &designed.nominal, &report)?;
    let text = format!("{}\n{text}", identity::heading(&identity, &report.verdict));
    Ok(Design {
        file: text,
        report,
        identity,
        worst_case,
        closed_loop: assess::robustness::loop_of(&designed.nominal)?,
        plant: source.text().to_owned(),
        kalman: kalman_fmu::kalman_design(&file, &designed, controller.experiment.stop_time),
        model: file.fmu().map(Path::to_owned),
    })
}

impl Design {
    /// Makes the controller FMU from the packed one at `base`. Its variables become part of the report.
    ///
    /// # Errors
    ///
    /// [`Error`]: `base` is no packed ASO controller, or its library refuses the design.
    pub fn fmu(&mut self, base: &Path) -> Result<DesignedFmu, Error> {
        let fmu = self.controller_fmu(base, &self.file)?;
        self.report.interface = reporting::interface(&fmu.description);
        Ok(fmu)
    }

    /// Makes the FMU of the controller that uses the estimates of [`Design::kalman_fmu`] in place of its own, from the
    /// packed controller at `base`.
    ///
    /// # Errors
    ///
    /// [`Error`]: there is no such filter; the controller needs its own observer; `base` is no packed ASO controller,
    /// or its library refuses the design.
    pub fn feedback_fmu(&self, base: &Path) -> Result<DesignedFmu, Error> {
        self.kalman.as_ref().map_err(|refusal| Error::from(refusal.clone()))?;
        let invalid = |text: String| Error::Invalid(text);
        let observed = aso_controller::Design::parse(&self.file, "design.toml")
            .map_err(|error| invalid(error.to_string()))?;
        let feedback = feedback_fmu::without_observer(&observed).map_err(|reason| {
            invalid(format!("no controller for the estimates of the Kalman filter: {reason}"))
        })?;
        let text = feedback.to_toml().map_err(|error| invalid(error.to_string()))?;
        let heading = identity::heading(&self.identity, &self.report.verdict);
        self.controller_fmu(base, &format!("{heading}\n{text}"))
    }

    fn controller_fmu(&self, base: &Path, file: &str) -> Result<DesignedFmu, Error> {
        let resources = [("design.toml", file.as_bytes())];
        let content = Content { model: "AsoController", resources: &resources, plant: &self.plant };
        DesignedFmu::new(base, &content)
    }

    /// Makes the FMU of an extended or unscented Kalman filter, for the noise of the designed observer, that contains
    /// the plant's FMU; from the packed one at `base`.
    ///
    /// # Errors
    ///
    /// [`Error`]: the plant is no FMU, or has something that this filter does not support; the gain of the observer
    /// follows from no noise; the FMU of the plant cannot be read; `base` is no packed Kalman filter, or its library
    /// refuses the design.
    pub fn kalman_fmu(&self, base: &Path) -> Result<DesignedFmu, Error> {
        let (Ok(filter), Some(model)) = (&self.kalman, &self.model) else {
            let refusal = self.kalman.as_ref().err().cloned();
            return Err(refusal.map_or_else(|| Error::Invalid("no plant".to_owned()), Error::from));
        };
        let text = filter.design.to_toml().map_err(|error| Error::Invalid(error.to_string()))?;
        let text = format!("{}\n{text}", identity::heading(&self.identity, &self.report.verdict));
        let plant = fs::read(model).map_err(Error::file("read", model))?;
        let resources = [("filter.toml", text.as_bytes()), ("plant.fmu", &plant)];
        let content = Content { model: "KalmanFilter", resources: &resources, plant: &self.plant };
        DesignedFmu::new(base, &content)
    }

    /// Returns the warning of [`Design::kalman_fmu`], of measurements for which the filter assumes another noise than the
    /// plant file states.
    #[must_use]
    pub fn kalman_warning(&self) -> Option<String> {
        self.kalman.as_ref().ok()?.warning.as_ref().map(ToString::to_string)
    }

    /// Returns the report as an HTML page that needs no other file.
    #[must_use]
    pub fn page(&self) -> String {
        design_page::page(&self.report, &self.identity)
    }

    /// Whether the verdict is not red, for which all checks must hold.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.report.verdict.level != Level::Red
    }
}

/// Returns the description of the plant file, or a sentence that names the faults.
fn description(file: &PlantFile<'_>, solution: &Solution) -> String {
    let faults = joined(solution.linear.faults.iter().map(|fault| fault.name.as_str()));
    let default = || format!("Fault-tolerant controller that estimates and compensates {faults}");
    file.description.clone().unwrap_or_else(default)
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
