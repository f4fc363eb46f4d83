//! The set of wanted eigenvalues.

use super::reached::distance;
use crate::Error;
use nalgebra::{Complex, DMatrix};

/// A real eigenvalue, or a pair of conjugates p and conj p that is treated as one.
///
/// A pair has the real matrix V = sqrt 2 [Re v, Im v] for its eigenvectors [v, conj v], which V
/// times a unitary matrix gives. All condition numbers and angles are therefore those of V.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Wanted {
    /// p, its imaginary part not below zero.
    pole: Complex<f64>,
}

impl Wanted {
    /// Number of eigenvalues: 1 or 2.
    pub(crate) fn count(self) -> usize {
        if self.pole.im > 0.0 { 2 } else { 1 }
    }

    /// The real matrix M of order `count` with (A + B K) V = V M.
    pub(crate) fn block(self) -> DMatrix<f64> {
        let Complex { re, im } = self.pole;
        DMatrix::from_fn(self.count(), self.count(), |i, j| match (i, j) {
            (0, 1) => im,
            (1, 0) => -im,
            _ => re,
        })
    }
}

/// One entry per real eigenvalue and per pair, the largest real part first: the order in which the
/// user states them must not decide which of several local optima is found.
///
/// Refuses an eigenvalue without its conjugate and one that comes more than `inputs` times. Both
/// are decided on exact equality.
pub(crate) fn wanted(poles: &[Complex<f64>], inputs: usize) -> Result<Vec<Wanted>, Error> {
    let occurrences = |pole| poles.iter().filter(|&&other| distance(other, pole) <= 0.0).count();
    for &pole in poles {
        let times = occurrences(pole);
        if times > occurrences(pole.conj()) {
            return Err(Error::UnpairedPole { pole });
        }
        if times > inputs {
            return Err(Error::RepeatedPole { pole, times, inputs });
        }
    }
    let upper = poles.iter().filter(|pole| pole.im >= 0.0);
    let mut all: Vec<_> = upper.map(|&pole| Wanted { pole }).collect();
    let order =
        |x: &Complex<f64>, y: &Complex<f64>| y.re.total_cmp(&x.re).then(x.im.total_cmp(&y.im));
    all.sort_by(|x, y| order(&x.pole, &y.pole));
    Ok(all)
}
