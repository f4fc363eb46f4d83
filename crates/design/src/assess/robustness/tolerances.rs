//! Whether a loop stays stable while the plant varies within its tolerances.

use control::robustness::{
    EntryFamily, ToleranceSearch, ToleranceTest, Tolerances, tolerance_test,
};
use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::assess::robustness::{Physical, names};
use crate::matrix::rows;
use crate::plant::parameters::ParameterFamily;
use crate::plant_file::robustness::RobustnessLimits;
use crate::report::Matrix;
use crate::report::robustness::ToleranceResult;
use crate::solve::solution::Solution;

/// Examines the loop for plants whose matrices have other entries, within the tolerances: the part of the
/// random cases that stays stable, and the worst case found.
pub(crate) fn by_entries(
    designed: &Solution,
    physical: &Physical,
    limits: &RobustnessLimits,
) -> Result<ToleranceResult, crate::Error> {
    let tolerances = Tolerances::of_values(&physical.plant, limits.tolerance);
    let family = EntryFamily::new(&physical.plant, &tolerances)?;
    let search = ToleranceSearch { family: &family, controller: &physical.controller };
    let cases = search.cases(limits.cases, u64::from(limits.seed)).into_par_iter();
    let cases = cases.map(|case| search.evaluate(case));
    let cases = cases.collect::<Result<Vec<_>, _>>()?;
    let climbs = search.starts(&cases)?.into_par_iter().map(|start| search.climb(start));
    let found = search.result(&cases, climbs.collect::<Result<Vec<_>, _>>()?)?;
    let entries = u32::try_from(tolerances.count()).unwrap_or(u32::MAX);
    Ok(ToleranceResult { entries, ..tested(designed, limits, &found) })
}

/// Examines the loop for other parameters of the plant's FMU, as [`by_entries`] does for entries.
pub(super) fn by_parameters(
    designed: &Solution,
    physical: &Physical,
    limits: &RobustnessLimits,
    family: &ParameterFamily<'_>,
    slopes: &[[DMatrix<f64>; 4]],
) -> Result<ToleranceResult, crate::Error> {
    let seed = u64::from(limits.seed);
    let found = tolerance_test(family, &physical.controller, limits.cases, seed)?;
    let parameters = family.report(&found.deviations, slopes);
    Ok(ToleranceResult { parameters, ..tested(designed, limits, &found) })
}

fn tested(
    designed: &Solution,
    limits: &RobustnessLimits,
    found: &ToleranceTest,
) -> ToleranceResult {
    let linear = &designed.linear;
    let (states, actuators) = (names(&linear.states), names(&linear.actuators));
    let matrix = |name: &str, values: &DMatrix<f64>, of: &[String], by: &[String]| Matrix {
        name: name.to_owned(),
        meaning: "worst plant within the tolerances".to_owned(),
        rows: of.to_vec(),
        columns: by.to_vec(),
        values: rows(values),
    };
    let measurements = names(&linear.measurements);
    let mut worst = vec![
        matrix("A", &found.worst.a, &states, &states),
        matrix("B", &found.worst.b, &states, &actuators),
        matrix("C", &found.worst.c, &measurements, &states),
    ];
    if linear.has_feedthrough() {
        worst.push(matrix("D", &found.worst.d, &measurements, &actuators));
    }
    ToleranceResult {
        entries: 0,
        parameters: Vec::new(),
        cases: found.cases,
        seed: limits.seed,
        stable: if found.cases == 0 {
            1.0
        } else {
            f64::from(found.stable) / f64::from(found.cases)
        },
        worst_instability: found.worst_instability,
        first_unstable: found.first_unstable.unwrap_or(f64::INFINITY),
        worst,
    }
}
