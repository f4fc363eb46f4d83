//! The effect of measurement noise.

use crate::response::energy;
use crate::{Error, StateSpace};
use nalgebra::DMatrix;

/// Computes the root-mean-square value of each output under white noise at each input, p x m: H2 norms.
///
/// In continuous time the noise has the spectral density 1 (a variance of one unit
/// squared times the unit of time), in sampled time each sample has the variance 1. The squares of
/// independent noises add up. Method: a Lyapunov equation for each input, or for each output if there are
/// fewer outputs (the transposed system has the same norms), see [`energy`].
///
/// # Errors
///
/// Same as [`energy`].
pub fn noise_gains(system: &StateSpace) -> Result<DMatrix<f64>, Error> {
    if system.c.nrows() < system.b.ncols() {
        return Ok(noise_gains(&system.dual())?.transpose());
    }
    let mut gains = DMatrix::zeros(system.c.nrows(), system.b.ncols());
    for input in 0..system.b.ncols() {
        let one = StateSpace {
            b: system.b.columns(input, 1).into(),
            d: system.d.columns(input, 1).into(),
            ..system.clone()
        };
        gains.column_mut(input).copy_from_slice(&energy(&one)?.peaks);
    }
    Ok(gains)
}
