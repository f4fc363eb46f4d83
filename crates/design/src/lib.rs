//! Designs a fault-tolerant controller from a plant file: gains, checks, report and controller FMU.
//!
//! [`design()`] reads a plant file, which states the plant, its faults and the requirements on the
//! controller. It computes the gains, checks them and analyses the closed loop. [`Design`] holds
//! the controller's `design.toml` and the report (as data and as a page), and creates the
//! controller FMU.
//!
//! The crate `control` has the mathematics; use it directly to design without a plant file.
#![forbid(unsafe_code)]

mod analysis;
mod certificate;
mod checks;
mod controller_fmu;
mod design_file;
mod designed;
mod error;
mod gains;
mod linear_plant;
mod matrix;
mod page;
mod plant_file;
pub mod report;
mod reporting;
mod requirements;
mod signals;
#[cfg(test)]
mod tests;

use std::path::Path;

use files::{Source, Table};

pub use controller_fmu::ControllerFmu;
pub use error::Error;
pub use report::Report;

use controller_fmu::Content;
use designed::ControllerDesign;
use plant_file::PlantFile;

/// A designed controller.
pub struct Design {
    /// The content of the controller's `design.toml`.
    pub file: String,
    /// The numbers of the report.
    pub report: Report,
    /// The plant file.
    plant: String,
}

/// Designs the controller that the plant file at `path` asks for.
///
/// # Errors
///
/// [`Error`]: an entry of the file is wrong, with its line; the plant cannot be controlled, its faults
/// cannot be told apart, or no gain meets the requirements.
pub fn design(path: &Path) -> Result<Design, Error> {
    let source = Source::read(path).map_err(Error::file("read", path))?;
    let parsed = source.parse()?;
    let file = PlantFile::read(&source, &Table::whole(&source, &parsed))?;
    let designed = designed::design(&file)?;
    let description = description(&file, &designed);
    let text = designed.file(&file, &description)?;
    let report = reporting::report(&file, &designed, description).map_err(|error| {
        let what = format!("the design for {} cannot be examined", file.name());
        Error::from(error).within(what)
    })?;
    Ok(Design { file: text, report, plant: source.text().to_owned() })
}

impl Design {
    /// Makes the controller FMU from the packed one at `base`. Its variables become part of the report.
    ///
    /// # Errors
    ///
    /// [`Error`]: `base` is no packed ASO controller, or its library refuses the design.
    pub fn fmu(&mut self, base: &Path) -> Result<ControllerFmu, Error> {
        let content = Content { design: &self.file, plant: &self.plant };
        let made = ControllerFmu::new(base, &content)?;
        self.report.interface = reporting::interface(&made.description);
        Ok(made)
    }

    /// The report as an HTML page that needs no other file.
    #[must_use]
    pub fn page(&self) -> String {
        page::page(&self.report)
    }

    /// Whether all checks hold.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.report.checks.iter().all(|check| check.holds)
    }
}

/// The user's sentence, or one that names the faults.
fn description(file: &PlantFile<'_>, designed: &ControllerDesign) -> String {
    let faults: Vec<_> = designed.linear.faults.iter().map(|fault| fault.name.as_str()).collect();
    file.description.clone().unwrap_or_else(|| {
        format!("Fault-tolerant controller that estimates and compensates {}", faults.join(", "))
    })
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
