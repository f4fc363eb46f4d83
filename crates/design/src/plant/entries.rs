//! The tolerances of the entries of a plant's matrices.

use control::robustness::{PlantEntry, Tolerances};

use crate::plant::delays::placed;
use crate::plant::linear::LinearPlant;
use plant_file::robustness::RobustnessLimits;

/// The tolerances of a plant file.
pub(crate) struct EntryTolerances {
    /// Tolerances of the plant without its delays.
    pub(crate) stated: Tolerances,
    /// Tolerances of the plant whose delays have `order` states each.
    pub(crate) placed: Tolerances,
}

/// Returns the tolerances that a plant file states, of whole matrices for the entries that are not structural, and of
/// named entries. `order`: the number of states of each delay.
pub(crate) fn tolerances(
    linear: &LinearPlant,
    order: usize,
    limits: &RobustnessLimits,
) -> EntryTolerances {
    let mut stated = Tolerances::unless_structural(&linear.undelayed, limits.tolerance);
    for named in &limits.entries {
        for &PlantEntry { matrix, row, column } in &named.entries {
            stated.of[matrix][(row, column)] = named.relative;
        }
        stated.common.push(named.entries.clone());
    }
    let placed = placed(&linear.delays, order, stated.clone());
    EntryTolerances { stated, placed }
}
