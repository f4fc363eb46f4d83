//! Designs the controller that a plant file asks for: for its plant, its family, and along its schedule.

use files::PlaceError;

use crate::solve::family::Family;
use crate::solve::schedule::Scheduled;
use crate::solve::schedule::references::examine;
use crate::solve::solution::{Solution, SolveResult, solve};
use plant_file::PlantFile;
use plant_file::estimation::Law;

/// A designed controller.
pub(crate) struct Designed {
    /// The controller of the plant of the file.
    pub(crate) nominal: Solution,
    /// The family of plants that the same controller serves, if the file states one.
    pub(crate) family: Option<Family>,
    /// The controllers at the points of the schedule, if the file states one.
    pub(crate) schedule: Option<Scheduled>,
    /// Warnings about the plant file, with their places.
    pub(crate) warnings: Vec<PlaceError>,
}

pub(crate) fn design(file: &PlantFile<'_>) -> Result<Designed, crate::Error> {
    design_by(file, &file.estimation.law)
}

/// Designs the controller for `file` with another law for the estimates of the faults.
pub(crate) fn design_by(file: &PlantFile<'_>, law: &Law) -> Result<Designed, crate::Error> {
    let SolveResult { solution: nominal, family, mut warnings } = solve(file, law)?;
    let schedule = Scheduled::of(file, law, &nominal.linear)?;
    if let Some(schedule) = &schedule {
        warnings.extend(examine(file, schedule, &nominal)?);
    }
    Ok(Designed { nominal, family, schedule, warnings })
}
