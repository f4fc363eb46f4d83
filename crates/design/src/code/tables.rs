//! The constants and the variables of a controller.

use nalgebra::DMatrix;

use super::controller::{Controller, Signal};
use super::recursion::{Operation, Recursion, Term};
use super::symbols::{Kind, Matrix, Vector};

/// The vectors that are kept from sample to sample.
pub(super) fn stored(controller: &Controller) -> Vec<Vector> {
    let mut all = vec![Vector::StoredXHat, Vector::StoredFHat];
    all.extend(controller.filter.is_some().then_some(Vector::StoredYF));
    all.push(Vector::Measured);
    all.extend((!controller.references.is_empty()).then_some(Vector::Referred));
    all.extend(controller.h.is_some().then_some(Vector::StoredXI));
    all
}

/// What is computed for the next sample, and where it is stored.
pub(super) fn kept(controller: &Controller) -> Vec<(Vector, Vector)> {
    let mut all =
        vec![(Vector::NextXHat, Vector::StoredXHat), (Vector::NextFHat, Vector::StoredFHat)];
    let filtered = (Vector::NextYF, Vector::StoredYF);
    all.extend(controller.filter.is_some().then_some(filtered));
    all.extend(controller.h.is_some().then_some((Vector::NextXI, Vector::StoredXI)));
    all
}

/// The estimates as a user sees them, and the stored ones, which they are after an overflow.
pub(super) fn shown(controller: &Controller) -> Vec<(Vector, Vector)> {
    let mut all = vec![(Vector::XValue, Vector::StoredXHat), (Vector::FValue, Vector::StoredFHat)];
    all.extend(controller.h.is_some().then_some((Vector::XIValue, Vector::StoredXI)));
    all
}

/// The vectors that the statements compute, in order.
pub(super) fn locals(recursion: &Recursion) -> Vec<Vector> {
    let mut all = Vec::new();
    for statement in recursion.statements() {
        if !all.contains(&statement.target) {
            all.push(statement.target);
        }
    }
    all
}

/// A constant: its name in the design file and its rows; one row for a vector.
pub(super) struct Constants {
    pub(super) name: &'static str,
    pub(super) meaning: &'static str,
    /// The signals of the rows and, of a matrix, of the columns.
    pub(super) rows: Kind,
    pub(super) columns: Option<Kind>,
    pub(super) values: Vec<Vec<f64>>,
}

impl Constants {
    pub(super) fn count(&self) -> usize {
        self.values.iter().map(Vec::len).sum()
    }

    fn vector(name: &'static str, meaning: &'static str, rows: Kind, values: Vec<f64>) -> Self {
        Self { name, meaning, rows, columns: None, values: vec![values] }
    }
}

/// The limits of the commands: names and meaning, as deviations and as values, lower and upper.
pub(super) const LIMITS: [(&str, &str); 4] = [
    ("u_low", "limits of u"),
    ("u_high", ""),
    ("u_min", "limits of the commands; the largest number stands for no limit"),
    ("u_max", ""),
];

/// All constants of a controller.
pub(super) fn tables(controller: &Controller, recursion: &Recursion) -> Vec<Constants> {
    let mut all = Vec::new();
    for (matrix, vector, rows) in matrices(recursion) {
        let values = matrix.of(controller).into_iter().flat_map(DMatrix::row_iter);
        all.push(Constants {
            name: matrix.name(),
            meaning: "",
            rows,
            columns: Some(vector.kind()),
            values: values.map(|row| row.iter().copied().collect()).collect(),
        });
    }
    all.extend(controller.filter.clone().map(|filter| {
        Constants::vector("filter", "gains of the measurement filter", Kind::Measurement, filter)
    }));
    for (name, meaning, kind, signals) in [
        ("x_op", "operating point", Kind::State, &controller.states),
        ("u_op", "", Kind::Actuator, &controller.actuators),
        ("y_op", "", Kind::Measurement, &controller.measurements),
        ("r_op", "", Kind::Reference, &controller.references),
    ] {
        if signals.is_empty() {
            continue;
        }
        all.push(Constants::vector(name, meaning, kind, Controller::operating(signals)));
    }
    if controller.is_limited() {
        for (position, (name, meaning)) in LIMITS.into_iter().enumerate() {
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
    all
}

/// The matrices that the statements use, with the vector that each is multiplied with and the kind of
/// its rows.
fn matrices(recursion: &Recursion) -> Vec<(Matrix, Vector, Kind)> {
    let mut all: Vec<(Matrix, Vector, Kind)> = Vec::new();
    for statement in recursion.statements() {
        let rows = statement.target.kind();
        let operations = statement.operations.iter().filter_map(|operation| match *operation {
            Operation::Add(Term::Product(matrix, vector))
            | Operation::Subtract(Term::Product(matrix, vector))
            | Operation::Accumulate(matrix, vector) => Some((matrix, vector)),
            _ => None,
        });
        let start = match statement.start {
            Term::Product(matrix, vector) => Some((matrix, vector)),
            _ => None,
        };
        for (matrix, vector) in start.into_iter().chain(operations) {
            if !all.iter().any(|(other, ..)| *other == matrix) {
                all.push((matrix, vector, rows));
            }
        }
    }
    Matrix::ALL
        .iter()
        .filter_map(|matrix| all.iter().find(|own| own.0 == *matrix))
        .copied()
        .collect()
}
