//! The fraction of the tolerances for which stability is proven.

use control::robustness::{EntryFamily, ProvenTolerance, Unproven, proven_tolerance};

use crate::assess::robustness::Physical;
use crate::budget::Budget;
use crate::plant::delays::JUDGED;
use crate::plant::entries::tolerances;
use crate::plant::linear::LinearPlant;
use crate::report::robustness::{ToleranceProof, ToleranceResult};
use plant_file::robustness::RobustnessLimits;

/// Largest multiple of the tolerances that the proof examines, as for the worst case.
const MOST: f64 = 16.0;
/// Part of the time for certificates and bounds that the proof may take.
const PART: f64 = 0.25;

/// Returns the fraction of the tolerances of the entries within which every plant is stable, or why none is proven.
/// `test`: what the search for the worst plant found.
pub(super) fn of_entries(
    linear: &LinearPlant,
    physical: &Physical,
    limits: &RobustnessLimits,
    test: &ToleranceResult,
    budget: &Budget,
) -> Result<ToleranceProof, String> {
    if !test.parameters.is_empty() {
        return Err(
            "not examined: the parameters of an FMU enter its matrices nonlinearly".to_owned()
        );
    }
    if !test.is_examined() {
        return Err("not examined: no entry of the plant varies".to_owned());
    }
    let budget = budget.part(PART, "the proof for the tolerances");
    if budget.is_over() {
        return Err(budget.reason());
    }
    let largest = test.first_unstable.min(MOST);
    let tolerances = tolerances(linear, JUDGED, limits).placed;
    let family =
        EntryFamily::new(&physical.plant, &tolerances).map_err(|error| error.to_string())?;
    let proof = proven_tolerance(&family, &physical.controller, largest, &|| budget.is_over());
    match proof.map_err(|error| format!("not proven: {error}"))? {
        Ok(proof) => Ok(reported(&proof, largest)),
        Err(Unproven::Ended) => Err(budget.reason()),
        Err(Unproven::LongSampleTime) => {
            Err("not proven: the sample time is too long against the time constants of the plant"
                .to_owned())
        }
        Err(Unproven::Large { channels, states, most }) => Err(format!(
            "not examined: the entries act through {channels} channels on a loop of {states} states; up to \
             {most} of each are examined"
        )),
        Err(_) => Err("not proven".to_owned()),
    }
}

fn reported(proof: &ProvenTolerance, most: f64) -> ToleranceProof {
    let count = |number: usize| u32::try_from(number).unwrap_or(u32::MAX);
    ToleranceProof {
        fraction: proof.fraction,
        most,
        frequency: proof.frequency,
        deviations: count(proof.deviations),
        channels: count(proof.channels),
        intervals: count(proof.intervals),
    }
}
