//! The controller in a program that links it, without files.

use nalgebra::DMatrix;

use super::AsoController;
use crate::dense::dense;
use aso_controller::Design;

impl AsoController {
    /// The controller of a design that [`Design::parse`] has accepted.
    #[must_use]
    pub fn of_design(design: Design) -> Self {
        Self::with(design)
    }

    /// A, B, C and `F_a` of the design: the plant and the columns by which faults enter it.
    pub fn plant(&self) -> [DMatrix<f64>; 4] {
        [&self.design.a, &self.design.b, &self.design.c, &self.design.f_a].map(dense)
    }
}
