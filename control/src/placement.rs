//! State feedback with wanted eigenvalues.

mod assignable;
mod conditioning;
mod descent;

use crate::balance::{divide_columns, divide_rows, multiply_rows, unit_columns};
use crate::eigen::eigenvalues;
use crate::rank::require_controllable;
use crate::singular::Singular;
use crate::{Error, check};
use assignable::Assignable;
use nalgebra::{Complex, DMatrix, DVector};

/// Inputs are dependent when a singular value of B with columns of length one is below this.
const DEPENDENT_INPUTS: f64 = 1e-13;
/// Largest relative distance of an eigenvalue reached from the one wanted.
const ALLOWED_POLE_ERROR: f64 = 1e-6;

/// A state feedback u = K x.
#[derive(Debug, Clone, PartialEq)]
pub struct Placement {
    /// K, m x n.
    pub gain: DMatrix<f64>,
    /// How well the eigenvalues are assigned.
    pub quality: Quality,
}

/// How well the eigenvalues of A + B K are assigned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Condition number (2-norm) of the matrix of eigenvectors of length one, in the coordinates of
    /// A: an eigenvalue moves by at most this times the norm of a change of A + B K (Bauer and
    /// Fike).
    pub condition: f64,
    /// The same in coordinates where the eigenvectors have entries of similar size, so without the
    /// part that comes from the units of the states.
    pub scaled_condition: f64,
    /// Largest distance of an eigenvalue of A + B K from the wanted one, relative to the latter
    /// (to the largest one for a wanted eigenvalue of zero).
    pub pole_error: f64,
}

/// Finds K such that the eigenvalues of A + B K are `poles`.
///
/// `a`: n x n; `b`: n x m; `poles`: n real numbers, in the unit of A, in any order, none more often
/// than rank B. Complex ones are not offered. K exists for all of them when (A, B) is controllable.
/// With one independent input it is unique. With more, the eigenvectors are chosen so that the
/// condition number of their matrix is as small as found from several fixed starts: the alternating
/// projections of Kautsky, Nichols and Van Dooren, then a descent on the condition number itself.
/// With dependent inputs the smallest K is taken. Same arguments, same answer.
///
/// Cost: some hundred iterations of a singular value decomposition per start, so some 1e4 n^3
/// multiplications. Tolerance: 1e-6, each eigenvalue relative to itself, verified.
///
/// Source: J. Kautsky, N. K. Nichols and P. Van Dooren, Robust pole assignment in linear state
/// feedback, Int. J. Control 41 (1985), method 0.
///
/// # Example
///
/// ```
/// use nalgebra::DMatrix;
/// let a = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, 0.0]);
/// let b = DMatrix::from_row_slice(2, 1, &[0.0, 1.0]);
/// let placement = control::placement::place(&a, &b, &[-1.0, -2.0])?;
/// assert!((placement.gain - DMatrix::from_row_slice(1, 2, &[-2.0, -3.0])).amax() < 1e-13);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`], [`Error::PoleCount`],
/// [`Error::RepeatedPole`] for bad arguments; [`Error::NotControllable`]; [`Error::PolesMissed`]
/// when rounding spoils the result; [`Error::NotConverged`] when an inner iteration does not end.
pub fn place(a: &DMatrix<f64>, b: &DMatrix<f64>, poles: &[f64]) -> Result<Placement, Error> {
    let n = check::square("A", a)?;
    check::shape("B", b, (n, b.ncols()))?;
    check_poles(poles, n)?;
    require_controllable(a, b)?;
    let basis = input_basis(b)?;
    refuse_repetition(poles, basis.ncols())?;
    let problem = Assignable::new(a, &(b * &basis), poles)?;
    let directions = conditioning::best_directions(&problem)?;
    let eigenvectors = problem.scaled_eigenvectors(&directions);
    let transposed = eigenvectors.transpose().lu();
    let gain = transposed
        .solve(&problem.scaled_responses(&directions).transpose())
        .ok_or(Error::Overflow { what: "K" })?
        .transpose();
    let gain = divide_columns(&multiply_rows(&gain, &problem.response_scale), &problem.scale);
    let gain = check::in_range("K", basis * gain)?;
    let quality = Quality {
        condition: conditioning::condition(&problem, &directions)?,
        scaled_condition: Singular::of(&unit_columns(&eigenvectors).transpose())?.condition(),
        pole_error: pole_error(&(a + b * &gain), poles)?,
    };
    if quality.pole_error > ALLOWED_POLE_ERROR {
        let (relative, allowed) = (quality.pole_error, ALLOWED_POLE_ERROR);
        return Err(Error::PolesMissed { relative, allowed });
    }
    Ok(Placement { gain, quality })
}

fn check_poles(poles: &[f64], n: usize) -> Result<(), Error> {
    if poles.len() != n {
        return Err(Error::PoleCount { expected: n, found: poles.len() });
    }
    check::finite("poles", &DMatrix::from_column_slice(n, 1, poles))
}

fn refuse_repetition(poles: &[f64], inputs: usize) -> Result<(), Error> {
    for &pole in poles {
        let times = poles.iter().filter(|&&other| (other - pole).abs() <= 0.0).count();
        if times > inputs {
            return Err(Error::RepeatedPole { pole, times, inputs });
        }
    }
    Ok(())
}

/// Columns X such that B X has orthonormal columns that span the range of B.
fn input_basis(b: &DMatrix<f64>) -> Result<DMatrix<f64>, Error> {
    let lengths = DVector::from_iterator(b.ncols(), b.column_iter().map(|column| column.norm()));
    let lengths = lengths.map(|length| if length > 0.0 { length } else { 1.0 });
    let unit = Singular::of(&divide_columns(b, &lengths))?;
    Ok(divide_rows(&unit.whitening(unit.rank(DEPENDENT_INPUTS)), &lengths))
}

/// Largest distance between wanted and reached eigenvalues, both in ascending order.
fn pole_error(closed_loop: &DMatrix<f64>, poles: &[f64]) -> Result<f64, Error> {
    let mut wanted = poles.to_vec();
    wanted.sort_by(f64::total_cmp);
    let largest = poles.iter().fold(0.0, |size: f64, pole| size.max(pole.abs()));
    let distance = |(reached, &pole): (Complex<f64>, &f64)| {
        let reference = if pole.abs() > 0.0 { pole.abs() } else { largest };
        let distance = (reached - pole).norm();
        if distance > 0.0 { distance / reference } else { 0.0 }
    };
    Ok(eigenvalues(closed_loop)?.into_iter().zip(&wanted).map(distance).fold(0.0, f64::max))
}
