//! What a linear system makes of its input: gains, norms, step and frequency responses, and what a
//! fault does to the closed loop.
//!
//! ```text
//! x' = A x + B w,  z = C x + D w             continuous
//! x[k+1] = A x[k] + B w[k],  z[k] = C x[k] + D w[k]      sampled
//! ```
//!
//! | question | answer |
//! |---|---|
//! | largest z for w up to one in size | [`peak_gain`] |
//! | largest z for w of unit energy, energy of z for an impulse or white noise | [`energy`] |
//! | largest amplification of energy | [`h_infinity`] |
//! | amplification at one frequency | [`frequency_response`] |
//! | z for a step or a ramp of w | [`step_response`], [`ramp_response`] |
//! | errors and states of the loop of [`crate::aso`] under bounded faults | [`fault_bounds`] |
//! | the same when friction turns round | [`reversal`] |

mod energy;
mod fault;
mod fault_loop;
mod frequency;
mod h_infinity;
mod interval;
mod peak_gain;
mod trace;
mod transient;

pub use energy::{Energy, energy};
pub use fault::{FaultBounds, Reversal, fault_bounds, reversal};
pub use fault_loop::{fault_rate_system, fault_system};
pub use frequency::{FrequencyPoint, frequency_grid, frequency_response};
pub use h_infinity::{HInfinity, h_infinity};
pub use peak_gain::{Bracket, peak_gain};
pub use trace::{Trace, ramp_response, step_response};
pub use transient::Transient;

use crate::{Domain, Error, check, stability};
use nalgebra::{Complex, DMatrix};

/// A linear system with n states, m inputs w and p outputs z.
#[derive(Debug, Clone, PartialEq)]
pub struct System {
    /// A, n x n.
    pub a: DMatrix<f64>,
    /// B, n x m.
    pub b: DMatrix<f64>,
    /// C, p x n.
    pub c: DMatrix<f64>,
    /// D, p x m.
    pub d: DMatrix<f64>,
    /// Continuous or sampled time.
    pub domain: Domain,
}

impl System {
    /// Shapes and finiteness of the four matrices, and the period.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`], naming the matrix;
    /// [`Error::OutOfRange`] for the period.
    pub fn check(&self) -> Result<(), Error> {
        let n = check::square("A", &self.a)?;
        check::shape("B", &self.b, (n, self.b.ncols()))?;
        check::shape("C", &self.c, (self.c.nrows(), n))?;
        check::shape("D", &self.d, (self.c.nrows(), self.b.ncols()))?;
        match self.domain {
            Domain::Continuous => Ok(()),
            Domain::Sampled { period } => check::positive("period", period),
        }
    }

    /// The eigenvalues of A, all stable.
    fn stable_eigenvalues(&self) -> Result<Vec<Complex<f64>>, Error> {
        self.check()?;
        stability::require("A", &self.a, self.domain)
    }
}
