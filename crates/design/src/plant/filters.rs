//! The filters of PI, PID and other controllers of low order: states of the observer's model that are in the
//! controller, not in the plant.
//!
//! ```text
//! z' = F z + g y,   F = -w, g = w                                     PI
//!                   F = [0, 1; -w^2, -sqrt(2) w], g = [0; w^2]        PID: z = [y_f; y_f']
//!                   the last row of F is -w^n [a_0, a_1 / w, ...]     order n: z = [y_f; y_f'; ...]
//! ```
//!
//! with the coefficients `a_k` of the Butterworth polynomial of order n. In sampled time y is held between samples.
//! With the rows of the observer gain that [`gains`] returns, each filter depends on its measurement alone, not on the
//! model.

use control::aso::FaultyPlant;
use control::hold::zero_order_hold;
use control::{Domain, Error, StateSpace};
use nalgebra::DMatrix;
use plant_file::pid::Pid;
use plant_file::signals::Signal;
use std::f64::consts::FRAC_PI_2;

/// Returns F and g of one filter.
fn filter(pid: &Pid, domain: Domain) -> Result<(DMatrix<f64>, DMatrix<f64>), Error> {
    let w = pid.corner;
    let last = pid.order - 1;
    let mut f = DMatrix::zeros(pid.order, pid.order);
    f.view_mut((0, 1), (last, last)).fill_with_identity();
    let mut g = DMatrix::zeros(pid.order, 1);
    // w^n a_0, w^(n-1) a_1, ... from the last to the first.
    let mut power = w;
    for (column, coefficient) in butterworth(pid.order).into_iter().enumerate().rev() {
        f[(last, column)] = -coefficient * power;
        g[last] = power;
        power *= w;
    }
    match domain {
        Domain::Continuous => Ok((f, g)),
        Domain::Sampled { period } => zero_order_hold(&f, &g, period),
    }
}

/// Returns `a_0` to `a_(n-1)` of the Butterworth polynomial 1 + `a_1` s + ... + s^n:
/// `a_k` = `a_(k-1)` cos((k - 1) pi / (2 n)) / sin(k pi / (2 n)).
///
/// Source: S. Butterworth, On the theory of filter amplifiers, Wireless Engineer 7 (1930).
fn butterworth(order: usize) -> Vec<f64> {
    #[expect(clippy::cast_precision_loss, reason = "at most 6")]
    let angle = |k: usize| k as f64 * FRAC_PI_2 / order as f64;
    let next = |(k, a): &(usize, f64)| Some((k + 1, a * angle(*k).cos() / angle(k + 1).sin()));
    let all = std::iter::successors(Some((0, 1.0)), next);
    all.take(order).map(|(_, coefficient)| coefficient).collect()
}

/// Returns the states of the filters, in the order of the measurements.
pub(crate) fn states(pid: &Pid, measurements: &[Signal]) -> Vec<Signal> {
    let mut all = Vec::new();
    for signal in pid.measurements().into_iter().map(|at| &measurements[at]) {
        all.push(Signal {
            unit: signal.unit.clone(),
            operating: signal.operating,
            ..Signal::named(format!("filtered {}", signal.name))
        });
        all.extend((1..pid.order).map(|derivative| {
            let name = match derivative {
                1 => format!("rate of {}", signal.name),
                _ => format!("derivative {derivative} of {}", signal.name),
            };
            Signal { operating: signal.operating.map(|_| 0.0), ..Signal::named(name) }
        }));
    }
    all
}

/// Adds to a plant the filters of its measurements, whose states follow the states of the plant.
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
    set_filters(pid, &mut extended.a, c, plant.domain)?;
    Ok(extended)
}

/// Replaces the filters of a plant that was sampled with them by filters of the samples of its measurements.
///
/// `c`: C of the plant with the filters, p x n.
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
    set_filters(pid, &mut plant.a, &c.columns(0, first).into_owned(), domain)
}

/// Sets the rows of the filters, the last ones of A; `c` has the columns of the plant alone.
fn set_filters(
    pid: &Pid,
    a: &mut DMatrix<f64>,
    c: &DMatrix<f64>,
    domain: Domain,
) -> Result<(), Error> {
    let (f, g) = filter(pid, domain)?;
    let order = pid.order;
    let n = c.ncols();
    for (at, measurement) in pid.measurements().into_iter().enumerate() {
        let first = n + at * order;
        a.rows_mut(first, order).fill(0.0);
        a.view_mut((first, 0), (order, n)).copy_from(&(&g * c.row(measurement)));
        a.view_mut((first, first), (order, order)).copy_from(&f);
    }
    Ok(())
}

/// Returns the rows of the observer gain for the filters, in the order of [`states`]; `p`: the number of measurements.
pub(crate) fn gains(pid: &Pid, p: usize, domain: Domain) -> Result<DMatrix<f64>, Error> {
    let (_, g) = filter(pid, domain)?;
    let order = pid.order;
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

    fn pid(order: usize) -> Pid {
        let pairs = vec![Pair { actuator: 0, measurement: 1 }];
        Pid { order, pairs, corner: 3.0, place: 0..0 }
    }

    /// (1 + sqrt(2) s / w + s^2 / w^2)^-1 and s times it at s = 2, by the resolvent.
    #[test]
    fn the_states_are_the_filtered_measurement_and_its_rate() -> Result<(), Error> {
        let (s, w) = (2.0_f64, 3.0);
        let (f, g) = filter(&pid(2), Domain::Continuous)?;
        let states = (DMatrix::identity(2, 2) * s - f).lu().solve(&g).unwrap_or_default();
        let expected = 1.0 / (1.0 + std::f64::consts::SQRT_2 * s / w + s * s / (w * w));
        assert!((states[0] - expected).abs() < 1e-14, "{states}");
        assert!((states[1] - s * expected).abs() < 1e-14, "{states}");
        Ok(())
    }

    /// |B(j w)|^2 = 1 + w^(2 n) for every order.
    #[test]
    fn a_filter_of_any_order_has_the_magnitude_of_butterworth() -> Result<(), Error> {
        for order in 1..=6 {
            let (f, g) = filter(&pid(order), Domain::Continuous)?;
            let s = nalgebra::Complex::new(0.0, 4.0);
            let [f, g] = [f, g].map(|real| real.map(|entry| nalgebra::Complex::new(entry, 0.0)));
            let states =
                (DMatrix::identity(order, order) * s - f).lu().solve(&g).unwrap_or_default();
            let power = i32::try_from(2 * order).unwrap_or_default();
            let expected = (1.0 + (4.0_f64 / 3.0).powi(power)).sqrt().recip();
            assert!((states[0].norm() / expected - 1.0).abs() < 1e-13, "{order}: {states}");
        }
        Ok(())
    }

    /// A held measurement of 1: the state after one sample is 1 - e^(-w T).
    #[test]
    fn a_sampled_filter_has_the_samples_of_the_continuous_one() -> Result<(), Error> {
        let domain = Domain::Sampled { period: 0.1 };
        let rows = gains(&pid(1), 2, domain)?;
        assert!(rows[(0, 0)].abs() <= 0.0);
        assert!((rows[(0, 1)] - (1.0 - (-0.3_f64).exp())).abs() < 1e-15);
        Ok(())
    }
}
