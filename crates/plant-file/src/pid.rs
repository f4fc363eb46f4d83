//! The entries `structure` and `pairs` of `[loop]`: PI, PID or other controllers of low order in place of a state
//! feedback.

use crate::read::{Result, alone, refuse, whole};
use crate::references::References;
use crate::signals::{Signal, position, position_of};
use files::{Place, Table};
use nalgebra::RowDVector;

/// Entries of the file that are not possible with such controllers: a measurement filter, and entries that need a state
/// feedback.
const OTHERS: [&str; 3] = ["filter", "reconfiguration", "fallback"];

/// The largest order of a controller's filter.
pub const MOST_ORDER: u32 = 6;

/// Controllers of low order, each from one measurement to one command.
///
/// ```text
/// u = K (b r - y_f + 1 / T_i integral of (r - y) dt - T_d y_f') - K_2 y_f'' - ... - K_(n-1) y_f^(n-1)
/// ```
///
/// for each command, with the measurement y, its reference r, the gain K, the weight b of the reference, the times
/// `T_i` and `T_d`, and `y_f`, which is y after a Butterworth filter of order n. The filter is 1 / (1 + s / w) in a PI
/// controller, n = 1, and 1 / (1 + sqrt(2) s / w + s^2 / w^2) in a PID controller, n = 2. A PI controller has no
/// derivative.
///
/// Source: K. J. Astrom and T. Hagglund, Advanced PID control (2006), sections 3.3 and 3.4.
#[derive(Clone, Debug, PartialEq)]
pub struct Pid {
    /// n, the number of states of each filter; derivatives up to order n - 1 are used.
    pub order: usize,
    /// The controllers, in the order of their commands; each command has at most one controller.
    pub pairs: Vec<Pair>,
    /// The corner frequency w of the filters, in rad/s.
    pub corner: f64,
    /// Place of the controllers in the file.
    pub place: Place,
}

/// A controller from a measurement to a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pair {
    /// The position of the command, from 0.
    pub actuator: usize,
    /// The position of the measurement, from 0.
    pub measurement: usize,
}

impl Pid {
    /// Reads `structure` and `pairs` of `[loop]`; `None` if neither is stated. Without `pairs` each actuator has the
    /// measurement at its position; there must be as many actuators as measurements. `corner`: w of the filters, in
    /// rad/s.
    pub(crate) fn read(
        file: &Table<'_>,
        table: &Table<'_>,
        [actuators, measurements]: [&[Signal]; 2],
        corner: f64,
    ) -> Result<Option<Self>> {
        let Some(entry) = table.get("structure") else {
            let message = "it belongs to `structure`, \"PI\" for example";
            return refuse(table, &["pairs"], message).map(|()| None);
        };
        let expected = format!("expected \"PI\", \"PID\" or an order from 1 to {MOST_ORDER}");
        let order = match (entry.text(), entry.number()) {
            (Ok("PI"), _) => 1,
            (Ok("PID"), _) => 2,
            (Ok(other), _) => return Err(entry.error(format!("{expected}, found {other:?}"))),
            (_, Ok(_)) => whole(&entry, 1..=MOST_ORDER)? as usize,
            _ => return Err(entry.error(expected)),
        };
        alone(&entry, file, &OTHERS)?;
        if let Some(estimator) = file.get("estimator")
            && estimator.text()? == "current"
        {
            let message = "a sampled controller of this kind uses the measurements of the sample before: \
                           expected \"prediction\", or no entry";
            return Err(estimator.error(message));
        }
        let mut pairs = Vec::new();
        match table.get("pairs") {
            Some(stated) => {
                for (name, measurement) in stated.table()?.entries() {
                    let actuator = position_of(name, &measurement, actuators, "actuator")?;
                    let measurement = position(&measurement, measurements, "measurement")?;
                    pairs.push(Pair { actuator, measurement });
                }
                if pairs.is_empty() {
                    return Err(stated.error("expected at least one `actuator = \"measurement\"`"));
                }
                pairs.sort_by_key(|pair| pair.actuator);
            }
            None if actuators.len() == measurements.len() => {
                let all = 0..actuators.len();
                pairs.extend(all.map(|at| Pair { actuator: at, measurement: at }));
            }
            None => {
                let message = format!(
                    "there are {} actuators and {} measurements: expected `pairs`, a table from actuators to \
                     measurements, {{ {} = {:?} }} for example",
                    actuators.len(),
                    measurements.len(),
                    actuators[0].name,
                    measurements[0].name
                );
                return Err(entry.error(message));
            }
        }
        Ok(Some(Self { order, pairs, corner, place: entry.place }))
    }

    /// Checks that the references are integrated, that each belongs to one measurement with a controller, and that each
    /// of these measurements has a reference.
    pub(crate) fn check_references(
        &self,
        file: &Table<'_>,
        references: Option<&References>,
        measurements: &[Signal],
    ) -> Result<()> {
        let names =
            self.measurements().into_iter().map(|at| format!("{:?}", measurements[at].name));
        let names: Vec<_> = names.collect();
        let expected = format!("expected `reference.track = [{}]`", names.join(", "));
        let integrals = "the integrals of the controllers are those of references";
        let Some(references) = references else {
            return Err(file.source.error(&self.place, format!("{integrals}: {expected}")));
        };
        if !references.integral {
            let message = format!("{integrals}: expected `integral = true`");
            return Err(file.source.error(&references.action_places[0], message));
        }
        let only_measurement = |row: RowDVector<f64>| {
            let mut terms = row.iter().enumerate().filter(|(_, weight)| **weight != 0.0);
            terms.next().map(|(at, _)| at).filter(|_| terms.next().is_none())
        };
        let mut all = Vec::new();
        for ((signal, row), place) in
            references.signals.iter().zip(references.h.row_iter()).zip(&references.places)
        {
            let at = only_measurement(row.into_owned());
            let Some(at) = at.filter(|at| self.measurements().contains(at)) else {
                let message =
                    format!("no controller has the reference `{}`: {expected}", signal.name);
                return Err(file.source.error(place, message));
            };
            all.push(at);
        }
        match self.measurements().into_iter().find(|at| !all.contains(at)) {
            None => Ok(()),
            Some(at) => {
                let name = &measurements[at].name;
                let message = format!("the controller of `{name}` has no reference: {expected}");
                Err(file.source.error(&self.place, message))
            }
        }
    }

    /// The positions of the measurements with a controller, each once, in ascending order.
    #[must_use]
    pub fn measurements(&self) -> Vec<usize> {
        let mut all: Vec<_> = self.pairs.iter().map(|pair| pair.measurement).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Number of states of all filters.
    #[must_use]
    pub fn states(&self) -> usize {
        self.order * self.measurements().len()
    }
}
