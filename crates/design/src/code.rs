//! The controller of a design as source code.

use std::path::Path;

use controller_code::{Code, Language, Precision, Request};

use crate::{Design, Error};

impl Design {
    /// Writes the controller of a sampled design as source code.
    ///
    /// In double precision its results equal those of the controller FMU of this design, bit by bit.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] for a continuous design, for an entry of the design that has no code, and for a number beyond
    /// the range of the precision.
    pub fn code(&self, language: Language, precision: Precision) -> Result<Code, Error> {
        let invalid = |error: &dyn std::error::Error| Error::Invalid(error.to_string());
        let design = aso_controller::Design::parse(&self.file, "design.toml");
        let stem = Path::new(&self.report.plant_file).file_stem().unwrap_or_default();
        let request = Request {
            prefix: controller_code::prefix(&stem.to_string_lossy()),
            identity: &self.identity,
            verdict: self.report.verdict.level.word(),
            delay_margin: self.report.robustness.as_ref().map(|figures| figures.delay_margin),
            language,
            precision,
        };
        let design = design.map_err(|error| invalid(&error))?;
        controller_code::write(design, &request).map_err(|error| invalid(&error))
    }
}
