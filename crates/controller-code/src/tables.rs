//! The tables of constants of a controller, and the vectors that it stores.

use super::constants::Constants;
use super::controller::Controller;
use super::detection::{self, Detection};
use super::parts::Signal;
use super::symbols::{Kind, Matrix, Vector};

/// The vectors that an instance stores from sample to sample, without the commands.
pub(super) fn stored(controller: &Controller) -> Vec<Vector> {
    let mut all = vec![Vector::StoredXHat, Vector::StoredFHat];
    all.extend(controller.filter.is_some().then_some(Vector::StoredYF));
    all.push(Vector::Measured);
    all.extend((!controller.references.is_empty()).then_some(Vector::Referred));
    all.extend(controller.has(Matrix::H).then_some(Vector::StoredXI));
    all.extend(controller.has(Matrix::D).then_some(Vector::StoredU));
    all.extend(controller.transfer.is_some().then_some(Vector::StoredUT));
    if controller.detection.is_some() {
        all.extend(detection::STORED);
    }
    all
}

/// The limits of the commands: names and meanings of lower and upper limits as deviations, then as values.
const LIMITS: [(&str, &str); 4] = [
    ("u_low", "limits of u"),
    ("u_high", ""),
    ("u_min", "limits of the commands; the largest number stands for no limit"),
    ("u_max", ""),
];

/// Whether the equations have a matrix that is not scheduled.
pub(super) fn has_constant_matrix(controller: &Controller) -> bool {
    Matrix::all_stated(controller).any(|matrix| controller.scheduled(matrix).is_none())
}

/// All constants of a controller.
pub(super) fn tables(controller: &Controller) -> Vec<Constants> {
    let mut all = Vec::new();
    for matrix in Matrix::all_stated(controller) {
        let points = controller.scheduled(matrix).map(|matrices| (Some(Kind::Point), matrices));
        let sets = controller.chosen(matrix).map(|matrices| (Some(Kind::GainSet), matrices));
        let one = || (None, matrix.of(controller).into_iter().collect());
        let (layers, matrices): (_, Vec<_>) = points.or(sets).unwrap_or_else(one);
        all.push(Constants::matrices(matrix.name(), "", matrix.kinds(), layers, matrices));
    }
    all.extend(controller.filter.clone().map(|filter| {
        Constants::vector("filter", "gains of the measurement filter", Kind::Measurement, filter)
    }));
    all.extend(controller.sliding_mode.iter().flat_map(|law| {
        let meaning = "bounds of the estimated faults, and half-widths of the boundary layer";
        let rho = Constants::vector("rho", meaning, Kind::Fault, law.rho.clone());
        [rho, Constants::vector("delta", "", Kind::Fault, law.delta.clone())]
    }));
    all.extend(schedule(controller));
    all.extend(controller.detection.iter().flat_map(Detection::tables));
    let reconfiguration = controller.reconfiguration.iter();
    all.extend(reconfiguration.flat_map(|switches| switches.tables(&controller.actuators)));
    let meanings = if controller.schedule.is_some() {
        ["values at the start", "", "", ""]
    } else {
        ["operating point", "", "", ""]
    };
    for ((start, meaning), signals) in starts(controller).into_iter().zip(meanings).zip([
        &controller.states,
        &controller.actuators,
        &controller.measurements,
        &controller.references,
    ]) {
        if !signals.is_empty() {
            let (name, kind) = start;
            all.push(Constants::vector(name, meaning, kind, Controller::operating(signals)));
        }
    }
    if controller.is_limited() {
        // With a schedule the limits as deviations are no constants.
        let first = if controller.schedule.is_some() { 2 } else { 0 };
        for (position, (name, meaning)) in LIMITS.into_iter().enumerate().skip(first) {
            let limit = |actuator: &Signal| {
                let side = position % 2;
                let none = [f64::NEG_INFINITY, f64::INFINITY][side];
                let operating = if position < 2 { actuator.operating } else { 0.0 };
                actuator.limits.map_or(none, |limits| limits[side] - operating)
            };
            let values = controller.actuators.iter().map(limit).collect();
            all.push(Constants::vector(name, meaning, Kind::Actuator, values));
        }
    }
    if controller.checks_measurements() {
        let meaning = "measurements that are used; the largest number stands for no limit";
        let limit = |side: usize| {
            let none = [f64::NEG_INFINITY, f64::INFINITY][side];
            let limit = |signal: &Signal| signal.limits.map_or(none, |limits| limits[side]);
            controller.measurements.iter().map(limit).collect()
        };
        all.push(Constants::vector("y_min", meaning, Kind::Measurement, limit(0)));
        all.push(Constants::vector("y_max", "", Kind::Measurement, limit(1)));
    }
    all
}

/// The names of the tables with the start values of states, actuators, measurements and references. Without a schedule,
/// the tables of the operating point hold the start values.
pub(super) fn starts(controller: &Controller) -> [(&'static str, Kind); 4] {
    let names = match controller.schedule {
        None => ["x_op", "u_op", "y_op", "r_op"],
        Some(_) => ["x_start", "u_start", "y_start", "r_start"],
    };
    let [x, u, y, r] = names;
    [(x, Kind::State), (u, Kind::Actuator), (y, Kind::Measurement), (r, Kind::Reference)]
}

/// The grid of a schedule, and the operating point at each of its values; empty without a schedule.
fn schedule(controller: &Controller) -> Vec<Constants> {
    let Some(schedule) = &controller.schedule else { return Vec::new() };
    let grid = schedule.points.iter().map(|point| point.at).collect();
    let mut all = vec![Constants::vector(
        "grid",
        "values of the scheduling variable, and the operating points at them",
        Kind::Point,
        grid,
    )];
    for (vector, name) in operating_vectors(controller) {
        all.push(Constants {
            name,
            meaning: "",
            rows: Kind::Point,
            columns: Some(vector.kind()),
            layers: None,
            values: schedule.operating(vector),
        });
    }
    all
}

/// The vectors of the operating point, with the names of their tables in a schedule.
pub(super) fn operating_vectors(controller: &Controller) -> Vec<(Vector, &'static str)> {
    let mut all =
        vec![(Vector::XOp, "x_op_at"), (Vector::UOp, "u_op_at"), (Vector::YOp, "y_op_at")];
    all.extend((!controller.references.is_empty()).then_some((Vector::ROp, "r_op_at")));
    all
}
