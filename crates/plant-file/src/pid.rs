//! The entries `structure` and `pairs` of `[loop]`: PI, PID or other controllers of low order in place of a state
//! feedback.

use crate::read::{alone, refuse, whole};
use crate::references::References;
use crate::signals::{Signal, position, position_of};
use files::{Place, PlaceError, Table};
use nalgebra::RowDVector;

/// Entries of the file that need a state feedback, or have a filter beside that of the controllers.
const OTHERS: [&str; 3] = ["filter", "reconfiguration", "fallback"];

/// The largest order of a controller's filter.
pub const MOST_ORDER: u32 = 6;

/// Controllers of low order, each from one measurement to one command.
///
/// ```text
/// u = K (b r - y_f + 1 / T_i integral of (r - y) dt - T_d y_f') - K_2 y_f'' - ... - K_(n-1) y_f^(n-1)
/// ```
///
/// for each command, with the measurement y, its reference r, and the measurement `y_f` behind a Butterworth filter of
/// order n: 1 / (1 + s / w) of a PI controller, n = 1, and 1 / (1 + sqrt(2) s / w + s^2 / w^2) of a PID controller, n = 2.
///
/// Source: K. J. Astrom and T. Hagglund, Advanced PID control (2006), sections 3.3 and 3.4.
#[derive(Clone, Debug, PartialEq)]
pub struct Pid {
    /// n, the number of states of each filter; derivatives up to that of order n - 1 are used.
    pub order: usize,
    /// The controllers.
    pub pairs: Vec<Pair>,
    /// w, in rad/s.
    pub corner: f64,
    /// Where the file states them.
    pub place: Place,
}

/// The positions, from 0, of a command and of the measurement that it follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pair {
    /// Of the command.
    pub actuator: usize,
    /// Of the measurement.
    pub measurement: usize,
}

impl Pid {
    /// Reads `structure` and `pairs` of `[loop]`; `None` if neither is stated. `corner`: w of the filters, in rad/s.
    pub(crate) fn read(
        file: &Table<'_>,
        table: &Table<'_>,
        [actuators, measurements]: [&[Signal]; 2],
        corner: f64,
    ) -> Result<Option<Self>, PlaceError> {
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

    /// Checks that the references are those of the measurements that commands follow, and integrated.
    pub(crate) fn check_references(
        &self,
        file: &Table<'_>,
        references: Option<&References>,
        measurements: &[Signal],
    ) -> Result<(), PlaceError> {
        let names =
            self.measurements().into_iter().map(|at| format!("{:?}", measurements[at].name));
        let names: Vec<_> = names.collect();
        let expected = format!("expected `reference.track = [{}]`", names.join(", "));
        let Some(references) = references.filter(|references| references.integral) else {
            let message =
                format!("the integrals of the controllers are those of references: {expected}");
            return Err(file.source.error(&self.place, message));
        };
        let followed = |row: RowDVector<f64>| {
            let mut used = row.iter().enumerate().filter(|(_, weight)| **weight != 0.0);
            used.next().map(|(at, _)| at).filter(|_| used.next().is_none())
        };
        let mut all = Vec::new();
        for ((signal, row), place) in
            references.signals.iter().zip(references.h.row_iter()).zip(&references.places)
        {
            let at = followed(row.into_owned());
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

    /// The filtered measurements: their positions, each once, in order.
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
