//! The filters of PI and PID controllers: states of the observer's model that only the controller has.
//!
//! ```text
//! z' = F z + g y,   F = -w, g = w                                     PI
//!                   F = [0, 1; -w^2, -sqrt(2) w], g = [0; w^2]        PID: z = [y_f; y_f']
//! ```
//!
//! In sampled time y is held between samples. With the rows of the observer gain that [`gains`] returns, each filter
//! follows its measurement and nothing else, whatever the model.

use control::aso::FaultyPlant;
use control::hold::zero_order_hold;
use control::{Domain, Error, StateSpace};
use nalgebra::DMatrix;
use plant_file::pid::Pid;
use plant_file::signals::Signal;

/// F and g of one filter.
fn filter(pid: &Pid, domain: Domain) -> Result<(DMatrix<f64>, DMatrix<f64>), Error> {
    let w = pid.corner;
    let (f, g) = if pid.derivative {
        let f = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -w * w, -std::f64::consts::SQRT_2 * w]);
        (f, DMatrix::from_column_slice(2, 1, &[0.0, w * w]))
    } else {
        (DMatrix::from_element(1, 1, -w), DMatrix::from_element(1, 1, w))
    };
    match domain {
        Domain::Continuous => Ok((f, g)),
        Domain::Sampled { period } => zero_order_hold(&f, &g, period),
    }
}

/// The states of the filters, in the order of the measurements.
pub(crate) fn states(pid: &Pid, measurements: &[Signal]) -> Vec<Signal> {
    let mut all = Vec::new();
    for signal in pid.measurements().into_iter().map(|at| &measurements[at]) {
        all.push(Signal {
            unit: signal.unit.clone(),
            operating: signal.operating,
            ..Signal::named(format!("filtered {}", signal.name))
        });
        if pid.derivative {
            all.push(Signal {
                operating: signal.operating.map(|_| 0.0),
                ..Signal::named(format!("rate of {}", signal.name))
            });
        }
    }
    all
}

/// A plant in continuous time with the filters of its measurements, whose states follow its own.
pub(crate) fn with_filters(pid: &Pid, plant: &StateSpace) -> Result<StateSpace, Error> {
    let StateSpace { a, b, c, d, .. } = plant;
    let n = a.nrows();
    let all = n + pid.states();
    let mut extended = StateSpace {
        a: a.clone().resize(all, all, 0.0),
        b: b.clone().resize_vertically(all, 0.0),
        c: c.clone().resize_horizontally(all, 0.0),
        d: d.clone(),
        domain: plant.domain,
    };
    enter(pid, &mut extended.a, c, plant.domain)?;
    Ok(extended)
}

/// Gives a plant that was sampled as a whole the filters of the controllers, which take samples of its measurements.
///
/// `c`: of the plant with the filters, p x n.
pub(crate) fn sample(
    pid: &Pid,
    plant: &mut FaultyPlant,
    c: &DMatrix<f64>,
    domain: Domain,
) -> Result<(), Error> {
    let count = pid.states();
    let first = plant.a.nrows() - count;
    plant.b.rows_mut(first, count).fill(0.0);
    plant.f_a.rows_mut(first, count).fill(0.0);
    enter(pid, &mut plant.a, &c.columns(0, first).into_owned(), domain)
}

/// Sets the rows of the filters, the last ones of A; `c` has the columns of the plant alone.
fn enter(pid: &Pid, a: &mut DMatrix<f64>, c: &DMatrix<f64>, domain: Domain) -> Result<(), Error> {
    let (f, g) = filter(pid, domain)?;
    let order = pid.order();
    let n = c.ncols();
    for (at, measurement) in pid.measurements().into_iter().enumerate() {
        let first = n + at * order;
        a.rows_mut(first, order).fill(0.0);
        a.view_mut((first, 0), (order, n)).copy_from(&(&g * c.row(measurement)));
        a.view_mut((first, first), (order, order)).copy_from(&f);
    }
    Ok(())
}

/// The rows of the observer gain for the filters, in the order of [`states`].
pub(crate) fn gains(pid: &Pid, p: usize, domain: Domain) -> Result<DMatrix<f64>, Error> {
    let (_, g) = filter(pid, domain)?;
    let order = pid.order();
    let measurements = pid.measurements();
    let mut rows = DMatrix::zeros(order * measurements.len(), p);
    for (at, measurement) in measurements.into_iter().enumerate() {
        rows.view_mut((at * order, measurement), (order, 1)).copy_from(&g);
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use plant_file::pid::Pair;

    fn pid(derivative: bool) -> Pid {
        let pairs = vec![Pair { actuator: 0, measurement: 1 }];
        Pid { derivative, pairs, corner: 3.0, place: 0..0 }
    }

    /// (1 + sqrt(2) s / w + s^2 / w^2)^-1 and s times it at s = 2, by the resolvent.
    #[test]
    fn the_states_are_the_filtered_measurement_and_its_rate() -> Result<(), Error> {
        let (s, w) = (2.0_f64, 3.0);
        let (f, g) = filter(&pid(true), Domain::Continuous)?;
        let states = (DMatrix::identity(2, 2) * s - f).lu().solve(&g).unwrap_or_default();
        let expected = 1.0 / (1.0 + std::f64::consts::SQRT_2 * s / w + s * s / (w * w));
        assert!((states[0] - expected).abs() < 1e-14, "{states}");
        assert!((states[1] - s * expected).abs() < 1e-14, "{states}");
        Ok(())
    }

    /// A held measurement of 1: the state after one sample is 1 - e^(-w T).
    #[test]
    fn a_sampled_filter_has_the_samples_of_the_continuous_one() -> Result<(), Error> {
        let domain = Domain::Sampled { period: 0.1 };
        let rows = gains(&pid(false), 2, domain)?;
        assert!(rows[(0, 0)].abs() <= 0.0);
        assert!((rows[(0, 1)] - (1.0 - (-0.3_f64).exp())).abs() < 1e-15);
        Ok(())
    }
}
