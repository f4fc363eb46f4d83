//! Which measurement shows which fault.

use crate::aso::FaultyPlant;
use crate::rank::Staircase;
use crate::singular::Singular;
use crate::{Domain, Error};
use nalgebra::DMatrix;

/// An output of the reachable states below this part of the output's norm counts as zero, as does
/// a singular value below this part of the largest.
const TOLERANCE: f64 = 1e-12;

/// What one measurement shows of one fault.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Visibility {
    /// Whether the fault, developing by its model, ever moves the measurement: for a constant fault
    /// whether the transfer function from its column of `F_a` is not identically zero.
    pub seen: bool,
    /// That transfer function at s = 0, or z = 1 when sampled; None where it has a pole there, so
    /// that the measurement grows without bound. Zero for the rate of a ramp, which has no column.
    pub dc_gain: Option<f64>,
}

/// One row per measurement, one entry per fault.
pub(super) fn table(plant: &FaultyPlant, domain: Domain) -> Result<Vec<Vec<Visibility>>, Error> {
    let ((n, q), p) = (plant.f_a.shape(), plant.c.nrows());
    let (a_0, outputs) = (plant.augmented_dynamics(), plant.augmented_output().transpose());
    let entry = |measurement: usize, fault: usize| {
        let start = DMatrix::from_fn(n + q, 1, |i, _| f64::from(u8::from(i == n + fault)));
        let seen = minimal(&a_0, &start, &outputs.columns(measurement, 1).into())?.is_some();
        let output = plant.c.rows(measurement, 1).transpose();
        let part = minimal(&plant.a, &plant.f_a.columns(fault, 1).into(), &output)?;
        let dc_gain = part.map_or(Ok(Some(0.0)), |part| part.dc_gain(domain))?;
        Ok(Visibility { seen, dc_gain })
    };
    (0..p).map(|measurement| (0..q).map(|fault| entry(measurement, fault)).collect()).collect()
}

/// The part of a system with one input and one output that is reached and seen.
struct Minimal {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
}

/// `b`, `c`: columns. None when the transfer function is identically zero.
fn minimal(a: &DMatrix<f64>, b: &DMatrix<f64>, c: &DMatrix<f64>) -> Result<Option<Minimal>, Error> {
    let reached = Staircase::of(a, b)?;
    let (c, whole) = reached.reached_output(c);
    if c.norm() <= TOLERANCE * whole {
        return Ok(None);
    }
    let b = reached.reached_input(b);
    let seen = Staircase::of(&reached.reached_dynamics().transpose(), &c)?;
    let (b, _) = seen.reached_output(&b);
    Ok(Some(Minimal { a: seen.reached_dynamics().transpose(), b, c: seen.reached_input(&c) }))
}

impl Minimal {
    fn dc_gain(&self, domain: Domain) -> Result<Option<f64>, Error> {
        let n = self.a.nrows();
        let still = match domain {
            Domain::Continuous => -&self.a,
            Domain::Sampled { .. } => DMatrix::identity(n, n) - &self.a,
        };
        let inverse = Singular::of(&still)?;
        let regular = inverse.rank(TOLERANCE) == n && inverse.values[0] > TOLERANCE * self.size();
        Ok(regular.then(|| self.c.dot(&inverse.least_squares(&self.b, n))))
    }

    fn size(&self) -> f64 {
        self.a.norm()
    }
}
