//! The table `[fallback]` of a plant file: one feedback for the plant and for every actuator that may fail.

use crate::read::{Result, alone, optional, positive_within};
use crate::requirements::{Region, stated_region};
use crate::signals::{Signal, positions};
use files::{Place, Table};

/// The failures that one feedback must serve without knowledge of the failure that has occurred.
#[derive(Clone, Debug, PartialEq)]
pub struct FallbackRequest {
    /// The actuators that may fail, from 0, one at a time.
    pub actuators: Vec<usize>,
    /// The largest fraction of its effect that the failed actuator may lose; 1 if it may be gone.
    pub loss: f64,
    /// The region of the eigenvalues in all cases; `None` if the file states none.
    pub region: Option<Region>,
    /// Place of the request in the file.
    pub place: Place,
}

const KEYS: [&str; 3] = ["actuators", "loss", "region"];

impl FallbackRequest {
    /// Reads the table, if there is one.
    pub(crate) fn read(
        file: &Table<'_>,
        actuators: &[Signal],
        sampled: bool,
    ) -> Result<Option<Self>> {
        let Some(entry) = file.get("fallback") else { return Ok(None) };
        alone(&entry, file, &["reference", "schedule", "family"])?;
        let table = entry.table()?;
        table.allow(&KEYS)?;
        let meaning = "the names of the actuators that may fail, or \"all\"";
        let used = positions(&table.require("actuators", meaning)?, actuators, "actuator")?;
        let rule = "expected a fraction above 0 and at most 1";
        let loss = optional(&table, "loss", |entry| positive_within(entry, ..=1.0, rule))?;
        let loss = loss.unwrap_or(1.0);
        if actuators.len() < 2 && loss >= 1.0 {
            let message =
                "without its only actuator a plant is not controlled; expected a `loss` below 1";
            return Err(entry.error(message));
        }
        let region = optional(&table, "region", |entry| stated_region(entry, sampled))?;
        Ok(Some(Self { actuators: used, loss, region, place: entry.place }))
    }
}
