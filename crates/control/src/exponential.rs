//! The matrix exponential.

use crate::balance::Balance;
use crate::logarithm::one_norm;
use crate::{Error, check, product};
use nalgebra::DMatrix;

/// Numerator of the Pade approximant of order 13 (Higham 2005, table 2.3 and equation (2.5)).
const PADE: [f64; 14] = [
    64_764_752_532_480_000.0,
    32_382_376_266_240_000.0,
    7_771_770_303_897_600.0,
    1_187_353_796_428_800.0,
    129_060_195_264_000.0,
    10_559_470_521_600.0,
    670_442_572_800.0,
    33_522_128_640.0,
    1_323_241_920.0,
    40_840_800.0,
    960_960.0,
    16_380.0,
    182.0,
    1.0,
];
/// Up to this 1-norm the approximant is exact to double precision (Higham 2005, table 2.3).
const REACH: f64 = 5.371_920_351_148_152;

/// The matrix exponential e^A.
///
/// `a`: n x n, finite, without a unit (a rate times a time). Method: diagonal balancing, then
/// scaling and squaring with the Pade approximant of order 13; about (7 + s) n^3 multiplications with
/// s = log2(norm of A / 5.4), at least 0. The approximant is exact to rounding; the squarings add errors
/// that are small relative to the largest of the powers squared, in balanced coordinates.
///
/// Source: N. J. Higham, The scaling and squaring method for the matrix exponential revisited,
/// SIAM J. Matrix Anal. Appl. 26 (2005), algorithm 2.3; balancing: R. C. Ward (1977).
///
/// # Example
///
/// ```
/// use nalgebra::DMatrix;
/// let quarter_turn = std::f64::consts::FRAC_PI_2;
/// let a = DMatrix::from_row_slice(2, 2, &[0.0, quarter_turn, -quarter_turn, 0.0]);
/// let e = control::exponential::exponential(&a)?;
/// let expected = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -1.0, 0.0]);
/// assert!((e - expected).amax() < 1e-15);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad `a`; [`Error::Overflow`] when
/// the result leaves the range of double precision.
pub fn exponential(a: &DMatrix<f64>) -> Result<DMatrix<f64>, Error> {
    check::square("A", a)?;
    let balance = Balance::of_exponential(a);
    check::in_range("e^A", balance.restore(&scaling_and_squaring(&balance.matrix)?))
}

/// e^A of a matrix that needs no balancing.
pub(crate) fn scaling_and_squaring(a: &DMatrix<f64>) -> Result<DMatrix<f64>, Error> {
    let mut scaled = check::in_range("e^A", a.clone())?;
    let mut squarings = 0;
    while one_norm(&scaled) > REACH {
        scaled *= 0.5;
        squarings += 1;
    }
    let mut power = approximant(&scaled)?;
    for _ in 0..squarings {
        power = product(&power, &power);
    }
    check::in_range("e^A", power)
}

/// The Pade approximant (V - U)^-1 (V + U) of e^A, with U the odd and V the even part of the numerator.
fn approximant(a: &DMatrix<f64>) -> Result<DMatrix<f64>, Error> {
    let identity = DMatrix::identity(a.nrows(), a.ncols());
    let second = product(a, a);
    let fourth = product(&second, &second);
    let sixth = product(&fourth, &second);
    let part = |at: usize| {
        let high = &sixth * PADE[at + 12] + &fourth * PADE[at + 10] + &second * PADE[at + 8];
        let low = &sixth * PADE[at + 6] + &fourth * PADE[at + 4] + &second * PADE[at + 2];
        product(&sixth, &high) + low + &identity * PADE[at]
    };
    let (even, odd) = (part(0), product(a, &part(1)));
    (&even - &odd).lu().solve(&(even + odd)).ok_or(Error::Overflow { what: "e^A" })
}
