//! Mistakes in a plant file that no numerical method would name: limits that exclude the operating point,
//! faults that no measurement can tell apart.

use files::PlaceError;
use nalgebra::{DMatrix, DVector};

use crate::plant::linear::{INACCURATE, LinearPlant};
use crate::report::number::rounded;
use control::faults::ExtendedPlant;
use plant_file::signals::{joined, signal_names};
use plant_file::{FAULTS, PlantFile};

/// Largest part orthogonal to other columns with which a column of length one counts as a combination of them.
const DEPENDENT: f64 = 1e-10;
/// Coefficients of a combination below this, relative to the largest, count as zero.
const NEGLIGIBLE: f64 = 1e-6;

/// Returns a warning if the plant is an FMU whose matrices are not accurate; None otherwise.
pub(crate) fn inaccurate(file: &PlantFile<'_>, linear: &LinearPlant) -> Option<PlaceError> {
    let error = linear.inaccuracy.filter(|error| *error > INACCURATE && error.is_finite())?;
    let message = format!(
        "entries of the linearised FMU have errors of up to {} % of the largest entry in their row, as at the edge of \
         friction, of a limit or of play; expected another operating point, parameters without these, or for an FMU \
         that is linearised by steps another `linearisation_step`",
        rounded(100.0 * error)
    );
    Some(file.error(&["operating_point", "plant"], message))
}

/// Checks that the limits of each actuator and the range of each measurement contain its operating point; returns a
/// warning for each actuator at a limit.
pub(crate) fn check_limits(
    file: &PlantFile<'_>,
    linear: &LinearPlant,
) -> Result<Vec<PlaceError>, PlaceError> {
    let mut warnings = Vec::new();
    let actuators = linear.actuators.iter().map(|signal| ("actuator", signal));
    let measurements = linear.measurements.iter().map(|signal| ("measurement", signal));
    for (what, signal) in actuators.chain(measurements) {
        let (Some([low, high]), [_, Some(place), _]) = (signal.limits, &signal.places) else {
            continue;
        };
        let value = signal.operating.unwrap_or(0.0);
        let unit = signal.unit.as_ref().map_or(String::new(), |unit| format!(" {unit}"));
        let point = format!("the operating point of the {what} `{}`, {value}{unit}", signal.name);
        let is_actuator = what == "actuator";
        if !(low..=high).contains(&value) {
            let (limits, expected) = if is_actuator {
                (format!("limits {low} and {high}"), "limits around it")
            } else {
                (format!("range from {low} to {high}"), "a range that contains it")
            };
            let message = format!(
                "{point}, is outside of its {limits}; expected {expected}, or another `operating` or `operating_point`"
            );
            return Err(file.error_at(place, message));
        }
        if is_actuator && (value <= low || value >= high) {
            let effect = "is at a limit, so that the controller acts in one direction only";
            warnings.push(file.error_at(place, format!("{point}, {effect}")));
        }
    }
    Ok(warnings)
}

/// Checks that each fault acts on the plant in a direction of its own and that there are as many
/// independent measurements as faults.
///
/// Both follow from the condition for an observer, rank [A - s I, F; C, 0] = n + q at s = 0, which
/// needs rank F = q and rank C >= q.
pub(crate) fn check_faults(
    file: &PlantFile<'_>,
    linear: &LinearPlant,
    extended: &ExtendedPlant,
) -> Result<(), PlaceError> {
    let estimates: Vec<_> = extended.channels.iter().map(|channel| channel.estimate).collect();
    let effects = extended.plant.f_a.select_columns(&estimates);
    let faults = &linear.faults;
    if let Some(Dependence { column, of }) = dependences(&effects).into_iter().next() {
        let name = &faults[column].name;
        let others: Vec<_> = of.iter().map(|&at| format!("`{}`", faults[at].name)).collect();
        let message = match others.as_slice() {
            [] => format!("fault `{name}` has no effect on the plant: its column of F_a is zero"),
            [other] => format!(
                "the faults {other} and `{name}` act on the plant in the same direction (their \
                 columns of F_a are parallel), so that no measurement tells one from the other; \
                 expected one fault in place of both"
            ),
            others => format!(
                "fault `{name}` acts on the plant as a combination of {} does (their columns of F_a \
                 are linearly dependent), so that no measurement tells them apart; expected fewer \
                 faults",
                others.join(", ")
            ),
        };
        return Err(file.error_at(&faults[column].place, message));
    }
    let dependent = match &extended.filter {
        // The filter makes the measurements independent.
        Some(_) => Vec::new(),
        None => dependences(&linear.c.transpose()),
    };
    let independent = linear.measurements.len() - dependent.len();
    if faults.len() <= independent {
        return Ok(());
    }
    let kind = if dependent.is_empty() { "" } else { "independent " };
    let message = format!(
        "{} faults ({}) cannot be estimated from {independent} {kind}measurement{} ({}): expected at \
         least as many independent measurements as faults",
        faults.len(),
        joined(faults.iter().map(|fault| fault.name.as_str())),
        if independent == 1 { "" } else { "s" },
        signal_names(&linear.measurements),
    );
    let place = faults.get(independent).map(|fault| &fault.place);
    Err(place.map_or_else(|| file.error(&FAULTS, &message), |at| file.error_at(at, &message)))
}

/// A column that is a combination of earlier ones.
#[derive(Debug, PartialEq)]
struct Dependence {
    column: usize,
    /// The earlier columns with a coefficient that is not negligible; none for a zero column.
    of: Vec<usize>,
}

/// Returns all columns of M that are combinations of earlier ones.
///
/// Method: rows are divided by their largest entries, then columns by their lengths; Gram-Schmidt, each column twice.
fn dependences(m: &DMatrix<f64>) -> Vec<Dependence> {
    let unit = |length: f64| if length > 0.0 { length } else { 1.0 };
    let mut scaled = m.clone();
    scaled.row_iter_mut().for_each(|mut row| row /= unit(row.amax()));
    scaled.column_iter_mut().for_each(|mut column| column /= unit(column.norm()));
    let (mut dependences, mut independent) = (Vec::new(), Vec::new());
    // Columns of the orthonormal basis, and of R with M = Q R.
    let (mut basis, mut r) = (Vec::<DVector<f64>>::new(), Vec::<DVector<f64>>::new());
    for column in 0..m.ncols() {
        let mut rest: DVector<f64> = scaled.column(column).into();
        let mut parts = DVector::zeros(basis.len() + 1);
        for _ in 0..2 {
            for (at, direction) in basis.iter().enumerate() {
                let part = direction.dot(&rest);
                parts[at] += part;
                rest.axpy(-part, direction, 1.0);
            }
        }
        let length = rest.norm();
        if length > DEPENDENT {
            let last = basis.len();
            parts[last] = length;
            basis.push(rest / length);
            r.push(parts);
            independent.push(column);
            continue;
        }
        let order = basis.len();
        let upper = DMatrix::from_fn(order, order, |i, j| if i <= j { r[j][i] } else { 0.0 });
        let parts = parts.rows(0, order).into_owned();
        let coefficients = upper.solve_upper_triangular(&parts).unwrap_or(parts);
        let least = NEGLIGIBLE * coefficients.amax();
        let others = (0..order).filter(|&at| coefficients[at].abs() > least);
        dependences.push(Dependence { column, of: others.map(|at| independent[at]).collect() });
    }
    dependences
}

/// Returns `plant.toml:3:5: message` for a warning.
pub(crate) fn line(file: &PlantFile<'_>, warning: &PlaceError) -> String {
    format!("{}:{}:{}: {}", file.name(), warning.line(), warning.column(), warning.message())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::read;

    /// The relative error of a row of zeros is infinite, but only rounding.
    #[test]
    fn errors_of_a_linearisation_above_one_percent_are_a_warning() {
        let text = "A = [[-1]]\nB = [[1]]\nC = [[1]]\nactuator_faults = \"all\"\n";
        let warning = |error: f64| {
            let warning = read(text, |file| {
                let plant = LinearPlant::of(file).unwrap();
                inaccurate(file, &LinearPlant { inaccuracy: Some(error), ..plant })
            });
            warning.unwrap().map(|warning| warning.message().to_owned())
        };
        assert!(warning(0.02).unwrap().contains("errors of up to 2 % of the largest entry"));
        assert_eq!([warning(0.009), warning(f64::INFINITY)], [None, None]);
    }

    fn columns(rows: usize, values: &[f64]) -> DMatrix<f64> {
        DMatrix::from_row_slice(rows, values.len() / rows, values)
    }

    #[test]
    fn a_dependent_column_is_returned_with_the_columns_that_it_depends_on() {
        let none: [Dependence; 0] = [];
        assert_eq!(dependences(&columns(2, &[1.0, 0.0, 1e-12, 1.0])), none);
        // The units of the rows do not matter.
        assert_eq!(dependences(&columns(2, &[1e9, 2e9, 1e-9, -2e-9])), none);
        let parallel = columns(3, &[0.0, 0.0, 3.0, -9.0, 0.1, -0.3]);
        assert_eq!(dependences(&parallel), [Dependence { column: 1, of: vec![0] }]);
        let sum = columns(3, &[1.0, 0.0, 0.5, 2.0, 0.0, 1.0, 0.5, -3.0, 1.0, 1.0, 0.0, -1.0]);
        assert_eq!(dependences(&sum), [Dependence { column: 3, of: vec![0, 1] }]);
        let zero = columns(2, &[0.0, 1.0, 0.0, 0.0]);
        assert_eq!(dependences(&zero), [Dependence { column: 0, of: Vec::new() }]);
    }
}
