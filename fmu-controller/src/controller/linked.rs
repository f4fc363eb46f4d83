//! The controller in a program that links it, without files.

use fmu::Failure;
use nalgebra::DMatrix;

use super::AsoController;
use crate::dense::dense;
use aso_controller::Design;

impl AsoController {
    /// The bytes of the design in `text`, the content of `design.toml`, for [`AsoController::from_bytes`]: a
    /// program that contains its design needs no code that reads TOML.
    ///
    /// # Errors
    ///
    /// [`Failure::Error`] if the design is refused.
    pub fn bytes_of_design(text: &str) -> Result<Vec<u8>, Failure> {
        let refused = |error: &dyn std::fmt::Display| Failure::Error(error.to_string());
        let design =
            Design::parse(text, "design.toml".to_owned()).map_err(|error| refused(&error))?;
        postcard::to_allocvec(&design).map_err(|error| refused(&error))
    }

    /// The controller of a design that [`AsoController::bytes_of_design`] has accepted.
    ///
    /// # Errors
    ///
    /// [`Failure::Error`] if the bytes are no design.
    pub fn from_bytes(design: &[u8]) -> Result<Self, Failure> {
        postcard::from_bytes(design)
            .map(Self::with)
            .map_err(|error| Failure::Error(format!("the bytes are no design: {error}")))
    }

    /// A, B, C and `F_a` of the design: the plant and the columns by which faults enter it.
    pub fn plant(&self) -> [DMatrix<f64>; 4] {
        [&self.design.a, &self.design.b, &self.design.c, &self.design.f_a].map(dense)
    }
}
