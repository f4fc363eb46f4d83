//! The effect of measurement noise in a loop.

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
    let of =
        |output: &StateSpace| noise_or_infinite(closed_loop.from_noise(output)?, &limits.noise);
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

/// Returns [`noise_gains`], each column times the `noise` of its measurement; infinite where a direct term passes white
/// noise of continuous time.
fn noise_or_infinite(mut system: StateSpace, noise: &[f64]) -> Result<DMatrix<f64>, Error> {
    let direct = system.d.clone();
    let is_continuous = system.domain == Domain::Continuous;
    if is_continuous {
        system.d.fill(0.0);
    }
    Ok(noise_gains(&system)?.map_with_location(|row, column, gain| {
        let is_passed = is_continuous && direct[(row, column)] != 0.0 && noise[column] > 0.0;
        if is_passed { f64::INFINITY } else { gain * noise[column] }
    }))
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

#[cfg(test)]
mod tests {
    use super::*;

    /// x' = -x + w and x[k+1] = 0.5 x[k] + w[k], with the variances 1/2 and 4/3 of x under unit noise.
    #[test]
    fn a_direct_term_passes_no_noise_of_a_measurement_without_noise() {
        let sampled = Domain::Sampled { period: 0.1 };
        for (domain, a, noise, expected) in [
            (Domain::Continuous, -1.0, [0.0, 2.0], [0.0, 2.0_f64.sqrt()]),
            (Domain::Continuous, -1.0, [0.1, 0.0], [f64::INFINITY, 0.0]),
            (sampled, 0.5, [0.0, 2.0], [0.0, 2.0 * (4.0_f64 / 3.0).sqrt()]),
            (sampled, 0.5, [3.0, 0.0], [3.0 * (7.0_f64 / 3.0).sqrt(), 0.0]),
        ] {
            let system = StateSpace {
                a: DMatrix::from_element(1, 1, a),
                b: DMatrix::from_element(1, 2, 1.0),
                c: DMatrix::from_element(1, 1, 1.0),
                d: DMatrix::from_row_slice(1, 2, &[1.0, 0.0]),
                domain,
            };
            let values = noise_or_infinite(system, &noise).unwrap();
            for (value, expected) in values.iter().zip(expected) {
                let agrees = value.total_cmp(&expected).is_eq() || (value - expected).abs() < 1e-13;
                assert!(agrees, "{domain:?} {noise:?}: {values}");
            }
        }
    }
}
