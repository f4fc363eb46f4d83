//! Tests which measurement shows which fault.

use crate::faulty_plant::FaultyPlant;
use crate::rank::Staircase;
use crate::svd::Svd;
use crate::{Domain, Error, StateSpace};
use nalgebra::DMatrix;

/// An output row restricted to the reached states counts as zero below this fraction of the norm of the row; a singular
/// value counts as zero below this fraction of the largest.
const TOLERANCE: f64 = 1e-12;

/// The effect of one fault on one measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Visibility {
    /// Whether a fault that develops by its model changes the measurement at some time. For a
    /// constant fault: whether the transfer function from its column of `F_a` is not identically zero.
    pub visible: bool,
    /// The transfer function from the column of `F_a` to the measurement at s = 0, or z = 1 in sampled time. None for a
    /// pole at this point: the measurement then grows without bound. Zero for the rate of a ramp, whose column of `F_a`
    /// is zero.
    pub dc_gain: Option<f64>,
}

/// The effects of all faults (inner index) on all measurements (outer index).
pub(super) fn table(plant: &FaultyPlant, domain: Domain) -> Result<Vec<Vec<Visibility>>, Error> {
    let ((n, q), p) = (plant.f_a.shape(), plant.c.nrows());
    let (a_0, outputs) = (plant.augmented_dynamics(), plant.augmented_output().transpose());
    let reach = |fault: usize| {
        let start = DMatrix::from_fn(n + q, 1, |i, _| f64::from(u8::from(i == n + fault)));
        let column = plant.f_a.columns(fault, 1).into_owned();
        let controllable = Staircase::new(&plant.a, &column)?;
        Ok(Reach { by_model: Staircase::new(&a_0, &start)?, controllable, column })
    };
    let faults: Vec<_> = (0..q).map(reach).collect::<Result<_, Error>>()?;
    let entry = |measurement: usize, fault: &Reach| {
        let part = fault.minimal_part(&plant.c.rows(measurement, 1).transpose(), domain)?;
        let dc_gain = part.map_or(Ok(Some(0.0)), |part| dc_gain(&part))?;
        let output = outputs.columns(measurement, 1).into();
        let visible = reached_output(&fault.by_model, &output).is_some();
        Ok(Visibility { visible, dc_gain })
    };
    let row = |measurement| faults.iter().map(|fault| entry(measurement, fault)).collect();
    (0..p).map(row).collect()
}

/// The states that a fault reaches.
struct Reach {
    /// The states of plant and fault model that the fault moves while it develops by its model.
    by_model: Staircase,
    /// The states of the plant that `column` reaches.
    controllable: Staircase,
    /// The column of `F_a`, n x 1.
    column: DMatrix<f64>,
}

/// Restricts `c`, a transposed output row, to the reached states; None if the result is zero up to rounding.
fn reached_output(reached: &Staircase, c: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let (c, norm) = reached.reached_output(c);
    (c.norm() > TOLERANCE * norm).then_some(c)
}

impl Reach {
    /// The controllable and observable part of the system {a, b, c', 0}, with b = `column`; None when its
    /// transfer function is identically zero.
    ///
    /// `c`: n x 1.
    fn minimal_part(&self, c: &DMatrix<f64>, domain: Domain) -> Result<Option<StateSpace>, Error> {
        let Some(c) = reached_output(&self.controllable, c) else {
            return Ok(None);
        };
        let b = self.controllable.reached_input(&self.column);
        let dynamics = self.controllable.reached_dynamics().transpose();
        let observable = Staircase::new(&dynamics, &c)?;
        let (b, _) = observable.reached_output(&b);
        let a = observable.reached_dynamics().transpose();
        let c = observable.reached_input(&c).transpose();
        Ok(Some(StateSpace::strictly_proper(a, b, c, domain)))
    }
}

/// C (s I - A)^-1 B at s = 0, or z = 1 in sampled time; None at a pole.
fn dc_gain(system: &StateSpace) -> Result<Option<f64>, Error> {
    let n = system.a.nrows();
    let svd = Svd::new(&system.dc_matrix())?;
    let regular = svd.rank(TOLERANCE) == n && svd.values[0] > TOLERANCE * system.a.norm();
    Ok(regular.then(|| system.c.transpose().dot(&svd.least_squares(&system.b, n))))
}
