//! Whether a loop stays stable while the plant varies within its tolerances.

use control::StateSpace;
use control::robustness::{
    EntryFamily, PlantEntry, ToleranceSearch, ToleranceTest, Tolerances, tolerance_test,
};
use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::assess::matrices::of_plant;
use crate::assess::robustness::Physical;
use crate::plant::delays::JUDGED;
use crate::plant::entries::{EntryTolerances, tolerances};
use crate::plant::linear::LinearPlant;
use crate::plant::parameters::ParameterFamily;
use crate::report::robustness::{ToleranceResult, VaryingEntries};
use crate::solve::solution::Solution;
use plant_file::robustness::{MATRICES, RobustnessLimits};

/// Examines the loop for plants whose matrices differ from those of `linear`, the plant of the loop, within the
/// tolerances. Returns the part of the random cases that is stable, none if no entry varies, and the worst case found.
pub(crate) fn by_entries(
    linear: &LinearPlant,
    physical: &Physical,
    limits: &RobustnessLimits,
) -> Result<ToleranceResult, crate::Error> {
    let EntryTolerances { stated, placed } = tolerances(linear, JUDGED, limits);
    let family = EntryFamily::new(&physical.plant, &placed)?;
    let search = ToleranceSearch { family: &family, controller: &physical.controller };
    let cases = search.cases(limits.cases, u64::from(limits.seed)).into_par_iter();
    let cases = cases.map(|case| search.evaluate(case));
    let cases = cases.collect::<Result<Vec<_>, _>>()?;
    let climbs = search.starts(&cases)?.into_par_iter().map(|start| search.climb(start));
    let test = search.result(&cases, climbs.collect::<Result<Vec<_>, _>>()?)?;
    let entries = u32::try_from(stated.entries().count()).unwrap_or(u32::MAX);
    let stable = stable(&test).filter(|_| entries > 0);
    let varying = varying(&stated);
    Ok(ToleranceResult { entries, varying, stable, ..tolerance_result(linear, limits, &test) })
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
    let test = tolerance_test(family, &physical.controller, limits.cases, seed)?;
    let parameters = family.report(&test.deviations, slopes);
    Ok(ToleranceResult { parameters, ..tolerance_result(&designed.linear, limits, &test) })
}

/// Returns the entries that vary: one item for each entry, and for each group with a common factor.
fn varying(tolerances: &Tolerances) -> Vec<VaryingEntries> {
    let name = |place: &PlantEntry| {
        format!("{}[{}][{}]", MATRICES[place.matrix], place.row + 1, place.column + 1)
    };
    let item = |entries: &[PlantEntry]| {
        let PlantEntry { matrix, row, column } = entries[0];
        let tolerance = tolerances.of[matrix][(row, column)];
        VaryingEntries { entries: entries.iter().map(name).collect(), tolerance }
    };
    let common = |place: &PlantEntry| tolerances.common.iter().any(|group| group.contains(place));
    let single = tolerances.entries().filter(|place| !common(place)).map(|place| item(&[place]));
    let varies = |group: &&Vec<PlantEntry>| {
        group
            .first()
            .is_some_and(|place| tolerances.of[place.matrix][(place.row, place.column)] > 0.0)
    };
    single.chain(tolerances.common.iter().filter(varies).map(|group| item(group))).collect()
}

/// Returns the part of the random cases that is stable; none without cases.
fn stable(test: &ToleranceTest) -> Option<f64> {
    (test.cases > 0).then(|| f64::from(test.stable) / f64::from(test.cases))
}

fn tolerance_result(
    linear: &LinearPlant,
    limits: &RobustnessLimits,
    test: &ToleranceTest,
) -> ToleranceResult {
    let StateSpace { a, b, c, d, .. } = test.worst.clone();
    let worst = linear.of_plant(&[a, b, c, d]);
    ToleranceResult {
        cases: test.cases,
        seed: limits.seed,
        stable: stable(test),
        worst_instability: test.worst_instability,
        first_unstable: test.first_unstable.unwrap_or(f64::INFINITY),
        worst: of_plant(linear, "worst plant within the tolerances", &worst),
        ..ToleranceResult::default()
    }
}
