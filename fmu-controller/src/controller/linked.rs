//! The controller in a program that links it, without files.

use fmu::Failure;
use nalgebra::DMatrix;

use super::AsoController;
use crate::dense::dense;
use aso_controller::Design;

impl AsoController {
    /// The design in `text`, the content of `design.toml`. A program can contain it as a value and needs no
    /// code that reads TOML.
    ///
    /// # Errors
    ///
    /// [`Failure::Error`] if the design is refused.
    pub fn parse_design(text: &str) -> Result<Design, Failure> {
        Design::parse(text, "design.toml".to_owned())
            .map_err(|error| Failure::Error(error.to_string()))
    }

    /// The controller of a design that [`AsoController::parse_design`] has accepted.
    #[must_use]
    pub fn of_design(design: Design) -> Self {
        Self::with(design)
    }

    /// A, B, C and `F_a` of the design: the plant and the columns by which faults enter it.
    pub fn plant(&self) -> [DMatrix<f64>; 4] {
        [&self.design.a, &self.design.b, &self.design.c, &self.design.f_a].map(dense)
    }
}
