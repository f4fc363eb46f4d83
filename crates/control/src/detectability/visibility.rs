//! Tests which measurement shows which fault.

use crate::faulty_plant::FaultyPlant;
use crate::rank::Staircase;
use crate::svd::Svd;
use crate::{Domain, Error, StateSpace};
use nalgebra::DMatrix;

/// An output of the controllable states counts as zero below this fraction of the norm of the
/// output, a singular value below this fraction of the largest.
const TOLERANCE: f64 = 1e-12;

/// The effect of one fault on one measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Visibility {
    /// Whether a fault that develops by its model changes the measurement at some time. For a
    /// constant fault: whether the transfer function from its column of `F_a` to the measurement is
    /// not identically zero.
    pub visible: bool,
    /// That transfer function at s = 0, or z = 1 in sampled time. None if it has a pole there: the
    /// measurement then grows without bound. Zero for the rate of a ramp, which has no column in
    /// `F_a`.
    pub dc_gain: Option<f64>,
}

/// The effects of all faults (inner index) on all measurements (outer index).
pub(super) fn table(plant: &FaultyPlant, domain: Domain) -> Result<Vec<Vec<Visibility>>, Error> {
    let ((n, q), p) = (plant.f_a.shape(), plant.c.nrows());
    let (a_0, outputs) = (plant.augmented_dynamics(), plant.augmented_output().transpose());
    let of_fault = |fault: usize| {
        let start = DMatrix::from_fn(n + q, 1, |i, _| f64::from(u8::from(i == n + fault)));
        let column = plant.f_a.columns(fault, 1).into_owned();
        let reached = Staircase::new(&plant.a, &column)?;
        Ok((Staircase::new(&a_0, &start)?, reached, column))
    };
    let faults: Vec<_> = (0..q).map(of_fault).collect::<Result<_, Error>>()?;
    let entry = |measurement: usize, (moved, reached, column): &Reached| {
        let output = plant.c.rows(measurement, 1).transpose();
        let part = minimal_part((reached, column), &output, domain)?;
        let dc_gain = part.map_or(Ok(Some(0.0)), |part| dc_gain(&part))?;
        let visible = seen(moved, &outputs.columns(measurement, 1).into()).is_some();
        Ok(Visibility { visible, dc_gain })
    };
    (0..p)
        .map(|measurement| faults.iter().map(|fault| entry(measurement, fault)).collect())
        .collect()
}

/// The states that a fault moves by its model, the states that its column b reaches, and b.
type Reached = (Staircase, Staircase, DMatrix<f64>);

/// The output c, n x 1, of the reached states; None if it is zero.
fn seen(reached: &Staircase, c: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let (c, norm) = reached.reached_output(c);
    (c.norm() > TOLERANCE * norm).then_some(c)
}

/// The controllable and observable part of the system {a, b, c', 0}; None when its transfer
/// function is identically zero.
///
/// `controllable`: the states that b reaches; `b`, `c`: n x 1.
fn minimal_part(
    (controllable, b): (&Staircase, &DMatrix<f64>),
    c: &DMatrix<f64>,
    domain: Domain,
) -> Result<Option<StateSpace>, Error> {
    let Some(c) = seen(controllable, c) else {
        return Ok(None);
    };
    let b = controllable.reached_input(b);
    let observable = Staircase::new(&controllable.reached_dynamics().transpose(), &c)?;
    let (b, _) = observable.reached_output(&b);
    Ok(Some(StateSpace {
        a: observable.reached_dynamics().transpose(),
        b,
        c: observable.reached_input(&c).transpose(),
        d: DMatrix::zeros(1, 1),
        domain,
    }))
}

/// C (s I - A)^-1 B at s = 0, or z = 1 in sampled time; None at a pole.
fn dc_gain(system: &StateSpace) -> Result<Option<f64>, Error> {
    let n = system.a.nrows();
    let svd = Svd::new(&system.dc_matrix())?;
    let regular = svd.rank(TOLERANCE) == n && svd.norm() > TOLERANCE * system.a.norm();
    Ok(regular.then(|| system.c.transpose().dot(&svd.least_squares(&system.b, n))))
}
