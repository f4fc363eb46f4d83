//! The delays of a plant: the states that approximate them, in the observer and for the verdict.

use control::StateSpace;
use control::delay::{Delays, pade};
use control::eigen::eigenvalues;
use control::robustness::Tolerances;
use files::PlaceError;
use nalgebra::DMatrix;

use crate::plant::filters::{self, with_filters};
use crate::report::number::rounded;
use control::blocks::beside;
use plant_file::PlantFile;
use plant_file::signals::Signal;

/// Number of states for each delay in the plant for the verdict: the error of the approximation is below 2e-7 up to the
/// frequency with 7 rad in the time of the delay.
pub(crate) const JUDGED: usize = 10;

/// Smallest ratio of a delay to the plant's fastest time constant that is allowed, and inverse of the largest one:
/// beyond, rounding errors hide the delay or the plant.
const PART: f64 = 1e-9;

/// Refuses delays that are much too short or too long beside the fastest time constant of the plant.
pub(crate) fn check(
    file: &PlantFile<'_>,
    delays: &Delays,
    plant: &StateSpace,
) -> Result<(), crate::Error> {
    if !delays.any() {
        return Ok(());
    }
    let fastest = eigenvalues(&plant.a)?.iter().map(|value| value.norm()).fold(0.0, f64::max);
    let beyond = |delay: f64| delay > 0.0 && !(PART..=1.0 / PART).contains(&(delay * fastest));
    let signals = [("actuators", &delays.inputs), ("measurements", &delays.outputs)];
    for (key, all) in signals.into_iter().filter(|_| fastest > 0.0) {
        let Some(delay) = all.iter().copied().find(|&delay| beyond(delay)) else { continue };
        let time = 1.0 / fastest;
        let (relation, advice) =
            if delay < time { ("short", "the file without it") } else { ("long", "a shorter one") };
        let message = format!(
            "a delay of {} s is too {relation} beside the fastest time constant of the plant, {} s; expected {advice}",
            rounded(delay),
            rounded(time)
        );
        return Err(file.error(&[key], message).into());
    }
    Ok(())
}

/// Returns the delays that the plant file states.
pub(crate) fn of(file: &PlantFile<'_>) -> Delays {
    let all = |signals: &[Signal]| signals.iter().map(|signal| signal.delay).collect();
    Delays { inputs: all(&file.actuators), outputs: all(&file.measurements) }
}

/// The matrices of a plant with the states of its delays and filters; F and G are the columns of the fault inputs,
/// which are not delayed.
pub(crate) struct DelayedPlant {
    pub(crate) a: DMatrix<f64>,
    pub(crate) b: DMatrix<f64>,
    pub(crate) c: DMatrix<f64>,
    pub(crate) d: DMatrix<f64>,
    pub(crate) f: DMatrix<f64>,
    pub(crate) g: DMatrix<f64>,
}

/// Adds to a plant the states with which the observer approximates the plant's delays and, for a PI, PID or other
/// controller of low order, the filters of its measurements. `f`, `g`: the columns by which faults enter x' and y.
pub(crate) fn delayed(
    file: &PlantFile<'_>,
    plant: &StateSpace,
    [f, g]: [&DMatrix<f64>; 2],
) -> Result<DelayedPlant, PlaceError> {
    let (m, q) = (plant.b.ncols(), f.ncols());
    let StateSpace { a, b, c, d, .. } = with_delays(file, plant, [f, g])?;
    let part = |both: &DMatrix<f64>| (both.columns(0, m).into_owned(), both.columns(m, q).into());
    let ((b, f), (d, g)) = (part(&b), part(&d));
    Ok(DelayedPlant { a, b, c, d, f, g })
}

/// Same as [`delayed`], as one system with the fault inputs after the commands.
pub(crate) fn with_delays(
    file: &PlantFile<'_>,
    plant: &StateSpace,
    [f, g]: [&DMatrix<f64>; 2],
) -> Result<StateSpace, PlaceError> {
    let (m, q) = (plant.b.ncols(), f.ncols());
    let inputs = StateSpace { b: beside(&plant.b, f), d: beside(&plant.d, g), ..plant.clone() };
    let mut delays = of(file);
    delays.inputs.resize(m + q, 0.0);
    let approximated = delays.approximated(&inputs, file.delay_order);
    let filtered = approximated.and_then(|plant| match file.pid() {
        Some(pid) => with_filters(pid, &plant),
        None => Ok(plant),
    });
    filtered.map_err(|error| file.error(&["actuators", "measurements"], error.to_string()))
}

/// Converts the tolerances of a plant without its delays to tolerances of the plant with delays of `order` states each.
pub(crate) fn placed(delays: &Delays, order: usize, tolerances: Tolerances) -> Tolerances {
    if !delays.any() {
        return tolerances;
    }
    let Tolerances { of: [a, b, c, d], common } = &tolerances;
    let (n, (p, m)) = (a.nrows(), d.shape());
    let all = n + delays.states(order);
    let zeros = DMatrix::zeros;
    let mut of = [zeros(all, all), zeros(all, m), zeros(p, all), zeros(p, m)];
    for entry in tolerances.entries() {
        let to = delays.entry(n, order, entry);
        of[to.matrix][(to.row, to.column)] = [a, b, c, d][entry.matrix][(entry.row, entry.column)];
    }
    let placed =
        |group: &Vec<_>| group.iter().map(|entry| delays.entry(n, order, *entry)).collect();
    Tolerances { of, common: common.iter().map(placed).collect() }
}

/// Returns the states of the plant, then those of its delays with their values at the operating point, then those of
/// the filters of controllers of low order.
///
/// A constant command u leads to z = [u, 0, ...], a constant measurement y to z = -d A'^-1 `e_1` y, see
/// [`Delays::approximated`].
pub(crate) fn states(
    file: &PlantFile<'_>,
    plant: &[Signal],
    [actuators, measurements]: [&[Signal]; 2],
) -> Vec<Signal> {
    let order = file.delay_order;
    let mut all = plant.to_vec();
    for actuator in actuators.iter().filter(|actuator| actuator.delay > 0.0) {
        all.push(Signal {
            unit: actuator.unit.clone(),
            operating: actuator.operating,
            ..Signal::named(format!("delayed {}", actuator.name))
        });
        all.extend((2..=order).map(|at| Signal {
            operating: actuator.operating.map(|_| 0.0),
            ..Signal::named(format!("delay of {}, {at}", actuator.name))
        }));
    }
    let inverse = pade(order).0.try_inverse();
    let inverse = inverse.unwrap_or_else(|| DMatrix::zeros(order, order));
    for measurement in measurements.iter().filter(|measurement| measurement.delay > 0.0) {
        all.extend((0..order).map(|at| {
            let of_unit = -measurement.delay * inverse[(0, at)];
            Signal {
                operating: measurement.operating.map(|value| value * of_unit),
                ..Signal::named(format!("delay of {}, {}", measurement.name, at + 1))
            }
        }));
    }
    all.extend(file.pid().into_iter().flat_map(|pid| filters::states(pid, measurements)));
    all
}
