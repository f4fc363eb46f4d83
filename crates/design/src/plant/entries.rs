//! The tolerances of the entries of a plant's matrices.

use control::StateSpace;
use control::robustness::{PlantEntry, Tolerances};

use plant_file::robustness::RobustnessLimits;

/// Returns the tolerances that a plant file states: those of whole matrices for the entries that are not
/// structural, and those of named entries.
pub(crate) fn tolerances(plant: &StateSpace, limits: &RobustnessLimits) -> Tolerances {
    let mut tolerances = Tolerances::unless_structural(plant, limits.tolerance);
    for named in &limits.entries {
        for &PlantEntry { matrix, row, column } in &named.entries {
            tolerances.of[matrix][(row, column)] = named.relative;
        }
        tolerances.common.push(named.entries.clone());
    }
    tolerances
}
