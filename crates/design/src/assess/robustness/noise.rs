//! What the noise of the measurements does in a loop.

use control::robustness::{Loop, noise_gains};
use control::{Domain, Error, StateSpace};
use nalgebra::DMatrix;

use crate::assess::analysis::largest_gain;
use crate::assess::matrices::{matrix, names};
use crate::assess::robustness::Physical;
use crate::report::Matrix;
use crate::report::robustness::Number;
use crate::solve::solution::Solution;
use control::blocks::stacked;
use plant_file::robustness::RobustnessLimits;

/// Returns the root-mean-square values of commands and estimated faults under the noise of each measurement, and under
/// all noise together.
pub(super) fn noise(
    designed: &Solution,
    closed_loop: &Loop,
    estimates: &StateSpace,
    limits: &RobustnessLimits,
) -> Result<(Matrix, Vec<Number>), Error> {
    let of = |output: &StateSpace| {
        let mut gains = noise_or_infinite(closed_loop.from_noise(output)?)?;
        for (mut column, noise) in gains.column_iter_mut().zip(&limits.noise) {
            column *= *noise;
        }
        Ok::<_, Error>(gains)
    };
    let (commands, faults) = (of(closed_loop.controller())?, of(estimates)?);
    let linear = &designed.linear;
    let named = linear.actuators.iter().map(|signal| (signal.name.clone(), signal.unit.clone()));
    let estimated = linear.faults.iter();
    let estimated =
        estimated.map(|fault| (format!("estimate of {}", fault.name), fault.unit.clone()));
    let rows = commands.row_iter().chain(faults.row_iter());
    let together: Vec<_> = named
        .chain(estimated)
        .zip(rows)
        .map(|((name, unit), row)| Number { name, unit, value: row.norm() })
        .collect();
    let affected: Vec<_> = together.iter().map(|number| number.name.clone()).collect();
    let meaning = "root-mean-square values under the noise of each measurement";
    let (values, measurements) = (stacked(&commands, &faults), names(&linear.measurements));
    Ok((matrix("noise", meaning, &values, &affected, &measurements), together))
}

/// Returns [`noise_gains`], infinite where a direct term passes white noise of continuous time.
fn noise_or_infinite(mut system: StateSpace) -> Result<DMatrix<f64>, Error> {
    let direct = system.d.clone();
    if system.domain != Domain::Continuous {
        return noise_gains(&system);
    }
    system.d.fill(0.0);
    let passed = |gain: f64, direct: f64| if direct == 0.0 { gain } else { f64::INFINITY };
    Ok(noise_gains(&system)?.zip_map(&direct, passed))
}

/// Returns for each fault the largest amplification of a sinusoidal error of the measurements to its
/// estimate, all measurements together, in the units of `noise`.
pub(crate) fn noise_peaks(designed: &Solution, noise: &[f64]) -> Result<Vec<f64>, Error> {
    let physical = Physical::of(designed)?;
    let closed_loop = physical.closed(&physical.controller)?;
    let mut system = closed_loop.from_noise(&physical.estimates)?;
    for (k, noise) in noise.iter().enumerate() {
        system.b.column_mut(k).scale_mut(*noise);
        system.d.column_mut(k).scale_mut(*noise);
    }
    let peak = |row: usize| {
        let one = StateSpace {
            c: system.c.rows(row, 1).into(),
            d: system.d.rows(row, 1).into(),
            ..system.clone()
        };
        Ok(largest_gain(&one)?.0)
    };
    (0..system.c.nrows()).map(peak).collect()
}
