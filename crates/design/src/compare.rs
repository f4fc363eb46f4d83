//! Compares the laws that estimate faults on one plant file.

use std::path::Path;

use crate::assess::bandwidths;
use crate::assess::reporting::Assessment;
use crate::budget::TimeLimits;
use crate::error::Error;
use crate::plant::parameters::ParameterFamily;
use crate::progress::Steps;
use crate::report::comparison::{Comparison, LawFigures, LawResult};
use crate::report::identity::identity;
use crate::reporting;
use crate::solve::designed::design_by;
use crate::solve::law::LawProblem;
use crate::solve::solution::Solution;
use files::Source;
use plant_file::PlantFile;
use plant_file::estimation::Law;

/// Designs the controller of the plant file at `path` with each law.
///
/// The law that the file names has the parameters of the file, the others have default parameters. A law that does not
/// exist for the plant, or that another table of the file excludes, has a reason in place of a result. Certificates and
/// bounds are left out.
///
/// # Errors
///
/// Same as [`crate::design()`], for the augmented observer and for each law that exists.
pub fn compare(path: &Path) -> Result<Comparison, Error> {
    let source = Source::read(path).map_err(Error::file("read", path))?;
    let file = PlantFile::read(&source)?;
    let family = ParameterFamily::of(&file)?;
    let file = bandwidths::chosen(&file, &TimeLimits::default().of_gains())?;
    let base = design_by(&file, &Law::Augmented)?;
    let Solution { linear, extended, plant, gains, domain, .. } = &base.nominal;
    let problem = LawProblem { linear, extended, plant, gains, domain: *domain };
    let (mut laws, mut plant_identity) = (Vec::new(), String::new());
    for law in Law::ALL {
        let stated = file.estimation.law.name() == law.name();
        let law = if stated { file.estimation.law.clone() } else { law };
        let mut reason = problem.design(&law).err();
        if let Some(table) = file.excluding(&law) {
            reason = Some(format!("it is not possible with `{table}`"));
        }
        let mut result = None;
        if reason.is_none() {
            match design_by(&file, &law) {
                // The law may exist for the plant of the file, but not at another point of the schedule.
                Err(error) if file.schedule.is_some() => reason = Some(files::sentence(&error)),
                designed => {
                    let (designed, steps) = (designed?, Steps::new(&|_| {}));
                    let assessment = Assessment::new(&file, family.as_ref(), &designed, &steps);
                    let report = reporting::report(assessment)?;
                    plant_identity = identity(&report);
                    result = Some(LawFigures {
                        disk_margin: report.robustness.as_ref().and_then(|robustness| {
                            let points = robustness.points.iter().map(|point| point.together.alpha);
                            points.collect::<Vec<_>>().try_into().ok()
                        }),
                        estimation: report.estimation,
                        verdict: report.verdict,
                    });
                }
            }
        }
        let (name, sources) = (law.name().to_owned(), law.sources().to_owned());
        laws.push(LawResult { law: name, sources, reason, result });
    }
    let model = file.fmu().map(Path::to_owned);
    Ok(Comparison { plant_file: file.name(), laws, identity: plant_identity, model })
}
