//! The table `[reconfiguration]` of a plant file: the requirements on the controllers for actuators that are gone.

use crate::faults::{EntryPoint, Fault};
use crate::read::{Result, alone, positive_within};
use crate::signals::{Signal, positions};
use files::{Place, Table};

/// The requirements on the controllers for actuators that are gone.
#[derive(Clone, Debug, PartialEq)]
pub struct ReconfigurationRequest {
    /// The actuators that may be gone, from 0.
    pub actuators: Vec<usize>,
    /// The largest number of actuators that are gone together.
    pub together: usize,
    /// For each of `actuators`, the command at which it is stuck, in the unit of the command.
    stuck_at: Vec<f64>,
    /// The measurements to keep at the operating point, from 0; all measurements if the file states none.
    pub keep: Vec<usize>,
    /// Threshold of the estimated loss, and the time in s above it after which an actuator counts as gone; `None` if
    /// only an input of the FMU reports an actuator as gone.
    pub decision: Option<(f64, f64)>,
    /// Place of the requirements in the file.
    pub place: Place,
}

const KEYS: [&str; 6] = ["actuators", "together", "stuck_at", "keep", "loss", "time"];
/// Largest number of sets of actuators that are gone together.
const MOST_SETS: usize = 200;

impl ReconfigurationRequest {
    /// Reads the table, if there is one.
    pub(crate) fn read(
        file: &Table<'_>,
        [actuators, measurements]: [&[Signal]; 2],
        faults: &[Fault],
    ) -> Result<Option<Self>> {
        let Some(entry) = file.get("reconfiguration") else { return Ok(None) };
        alone(&entry, file, &["reference", "schedule"])?;
        if actuators.len() < 2 {
            return Err(entry.error("without its only actuator a plant is not controlled"));
        }
        let table = entry.table()?;
        table.allow(&KEYS)?;
        let meaning = "the names of the actuators that may be gone, or \"all\"";
        let used = positions(&table.require("actuators", meaning)?, actuators, "actuator")?;
        let keep = match table.get("keep") {
            Some(entry) => positions(&entry, measurements, "measurement")?,
            None => (0..measurements.len()).collect(),
        };
        Ok(Some(Self {
            together: together(&table, used.len(), actuators.len())?,
            stuck_at: stuck(&table, actuators, &used)?,
            decision: decision(&table, &used, faults)?,
            actuators: used,
            keep,
            place: entry.place,
        }))
    }

    /// The command at which an actuator is stuck; 0 for an actuator that cannot be gone.
    #[must_use]
    pub fn stuck_at(&self, actuator: usize) -> f64 {
        let position = self.actuators.iter().position(|used| *used == actuator);
        position.map_or(0.0, |at| self.stuck_at[at])
    }

    /// The sets of actuators that may be gone together: first each actuator alone, then larger sets. The actuators of
    /// a set are in ascending order.
    #[must_use]
    pub fn cases(&self) -> Vec<Vec<usize>> {
        let alone = self.actuators.iter().map(|actuator| vec![*actuator]);
        alone.chain((2..=self.together).flat_map(|size| self.sets(size))).collect()
    }

    /// The sets of `size` actuators that may be gone together, each in ascending order.
    #[must_use]
    pub fn sets(&self, size: usize) -> Vec<Vec<usize>> {
        let mut ordered = self.actuators.clone();
        ordered.sort_unstable();
        let extend = |sets: Vec<Vec<usize>>, _| {
            let with_one_more = |set: &Vec<usize>| {
                let later = ordered.iter().filter(|at| set.last().is_none_or(|last| *at > last));
                let longer = later.map(|at| set.iter().copied().chain([*at]).collect::<Vec<_>>());
                longer.collect::<Vec<_>>()
            };
            sets.iter().flat_map(with_one_more).collect()
        };
        (0..size).fold(vec![Vec::new()], extend)
    }
}

/// Reads `together`, how many actuators may be gone together; 1 without this entry. `used` of `all` actuators may be
/// gone. An error for more than [`MOST_SETS`] sets of them.
fn together(table: &Table<'_>, used: usize, all: usize) -> Result<usize> {
    let Some(entry) = table.get("together") else { return Ok(1) };
    let most = used.min(all - 1);
    let number = entry.number()?;
    let most_together = (1..=most)
        .find(|count| f64::from(u32::try_from(*count).unwrap_or(0)).total_cmp(&number).is_eq());
    let Some(most_together) = most_together else {
        return Err(entry.error(format!(
            "expected how many actuators may be gone together, from 1 to {most}, found {number}"
        )));
    };
    let mut sets = 0;
    let mut of_size = 1;
    for size in 1..=most_together {
        of_size = of_size * (used + 1 - size) / size;
        sets += of_size;
        if sets > MOST_SETS {
            return Err(entry.error(format!(
                "these are more than {MOST_SETS} sets of actuators; expected fewer `actuators`, or a \
                 smaller number"
            )));
        }
    }
    Ok(most_together)
}

/// Reads `stuck_at`, a table from actuators to commands; 0 for actuators that the table does not name.
fn stuck(table: &Table<'_>, actuators: &[Signal], used: &[usize]) -> Result<Vec<f64>> {
    let mut commands = vec![0.0; used.len()];
    let Some(entry) = table.get("stuck_at") else { return Ok(commands) };
    for (name, value) in entry.table()?.entries() {
        let Some(at) = used.iter().position(|at| actuators[*at].name == name) else {
            let names: Vec<_> = used.iter().map(|at| actuators[*at].name.as_str()).collect();
            let known = names.join(", ");
            return Err(
                value.error(format!("expected one of `actuators`: {known}, found `{name}`"))
            );
        };
        commands[at] = value.number()?;
    }
    Ok(commands)
}

/// Reads `loss` and `time`, which belong together and require a fault with `loss_of`; `None` without both.
fn decision(table: &Table<'_>, used: &[usize], faults: &[Fault]) -> Result<Option<(f64, f64)>> {
    let (loss, time) = match (table.get("loss"), table.get("time")) {
        (None, None) => return Ok(None),
        (Some(loss), Some(time)) => (loss, time),
        (Some(entry), None) => {
            return Err(entry.error("expected `time` beside it: how long, in s, the loss is above"));
        }
        (None, Some(entry)) => {
            return Err(entry.error("expected `loss` beside it: the fraction that is exceeded"));
        }
    };
    let fraction = positive_within(&loss, ..1.0, "expected a fraction above 0 and below 1")?;
    let estimated = |fault: &Fault| match fault.entry_point {
        EntryPoint::Loss { actuator, .. } => used.contains(&actuator),
        _ => false,
    };
    if !faults.iter().any(estimated) {
        return Err(loss.error("expected a fault with `loss_of` one of `actuators`, found none"));
    }
    Ok(Some((fraction, time.positive()?)))
}
