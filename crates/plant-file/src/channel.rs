//! The weights of an H-infinity norm: reads `weights` and `noise` of a plant file.

use control::Domain;
use control::lmi::weight_of_table;
use control::weight::{Weight, bilinear_frequency};
use files::{Entry, Table};

use crate::read::{Result, each, refuse};

/// The entries of a plant file that belong to `h_infinity`.
pub(crate) const CHANNEL: [&str; 2] = ["weights", "noise"];

/// The weights of an H-infinity norm.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Channel {
    /// Weights of the outputs of the norm: for the observer the errors of the fault estimates, for the feedback the
    /// measurements, then the commands. Empty if all are 1.
    pub weights: Vec<ChannelWeight>,
    /// Weight of the noise of each measurement, in the unit of the measurement; empty if noise is no input of the norm.
    pub noise: Vec<ChannelWeight>,
}

/// The weight of a signal.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelWeight {
    /// The signal, in words.
    pub signal: String,
    /// The weight over frequency.
    pub weight: Weight,
    /// The largest factor by which the weight deviates from its table; `None` without a table.
    pub deviation: Option<f64>,
}

/// The signals of the norm of a gain.
pub(crate) struct ChannelSignals<'a> {
    /// Names of the outputs.
    pub(crate) outputs: Vec<&'a str>,
    /// Names of the measurements whose noise can be an input; `None` for a state feedback.
    pub(crate) noises: Option<Vec<&'a str>>,
}

impl ChannelWeight {
    /// The factor of a constant weight; 1 for a weight over frequency, which becomes states of the plant.
    #[must_use]
    pub fn factor(&self) -> f64 {
        self.weight.as_constant().unwrap_or(1.0)
    }
}

impl Channel {
    /// Whether a weight depends on the frequency.
    #[must_use]
    pub fn has_states(&self) -> bool {
        self.all().any(|one| one.weight.as_constant().is_none())
    }

    /// The weights of all signals.
    pub fn all(&self) -> impl Iterator<Item = &ChannelWeight> {
        self.weights.iter().chain(&self.noise)
    }

    /// Reads `weights`, a table from names of outputs to weights (1 if missing), and `noise`, one weight for all
    /// measurements or one for each.
    pub(crate) fn read(
        table: &Table<'_>,
        signals: &ChannelSignals<'_>,
        domain: Domain,
    ) -> Result<Self> {
        let mut channel = Self::default();
        if let Some(entry) = table.get("weights") {
            let one = |name: &&str| ChannelWeight {
                signal: (*name).to_owned(),
                weight: Weight::constant(1.0),
                deviation: None,
            };
            channel.weights = signals.outputs.iter().map(one).collect();
            for (name, value) in entry.table()?.entries() {
                let Some(at) = signals.outputs.iter().position(|output| *output == name) else {
                    let known = signals.outputs.join(", ");
                    return Err(
                        value.error(format!("`{name}` has no weight: expected one of {known}"))
                    );
                };
                channel.weights[at] = weight(&value, name.to_owned(), domain)?;
            }
        }
        if let Some(entry) = table.get("noise") {
            let Some(names) = &signals.noises else {
                return Err(entry.error(
                    "a state feedback has no measurement noise: expected it in `observer`",
                ));
            };
            channel.noise = noises(&entry, names, domain)?;
        }
        Ok(channel)
    }
}

fn noises(entry: &Entry<'_>, names: &[&str], domain: Domain) -> Result<Vec<ChannelWeight>> {
    let one = |entry: &Entry<'_>| weight(entry, String::new(), domain);
    let all = each(entry, names.len(), "numbers, one per measurement", one)?;
    let named = |(name, one)| ChannelWeight { signal: format!("noise of {name}"), ..one };
    Ok(names.iter().zip(all).map(named).collect())
}

/// Reads a weight: a number above 0, `{ low, frequency, high }` or `{ table }`, each table with an optional `order` of
/// 1 or 2.
fn weight(entry: &Entry<'_>, signal: String, domain: Domain) -> Result<ChannelWeight> {
    if !entry.is_table() {
        let weight = Weight::constant(entry.positive()?);
        return Ok(ChannelWeight { signal, weight, deviation: None });
    }
    let table = entry.table()?;
    table.allow(&["low", "frequency", "high", "table", "order"])?;
    let order = |entry: Entry<'_>| match entry.number()? {
        1.0 => Ok(1),
        2.0 => Ok(2),
        other => Err(entry.error(format!("expected 1 or 2, found {other}"))),
    };
    let order = table.get("order").map_or(Ok(1), order)?;
    if let Some(points) = table.get("table") {
        let alone = "a weight is stated by `table` or by `low`, `frequency` and `high`";
        refuse(&table, &["low", "frequency", "high"], alone)?;
        let table_weight = weight_of_table(&read_points(&points, domain)?, order)
            .map_err(|error| points.error(error.to_string()))?;
        let deviation = Some(table_weight.deviation);
        return Ok(ChannelWeight { signal, weight: table_weight.weight, deviation });
    }
    let low = table.require("low", "the magnitude at low frequencies")?.positive()?;
    let meaning = "in rad/s, where the magnitude is the geometric mean of `low` and `high`";
    let frequency = continuous_frequency(&table.require("frequency", meaning)?, domain)?;
    let high = table.require("high", "the magnitude at high frequencies")?.positive()?;
    let weight = Weight::lead_lag(low, frequency, high, order)
        .map_err(|error| entry.error(error.to_string()))?;
    Ok(ChannelWeight { signal, weight, deviation: None })
}

/// Reads at least two pairs of a frequency and a magnitude, in ascending order of the frequency.
fn read_points(entry: &Entry<'_>, domain: Domain) -> Result<Vec<(f64, f64)>> {
    let mut points: Vec<(f64, f64)> = Vec::new();
    for member in entry.list()? {
        let [frequency, magnitude] = &member.list()?[..] else {
            return Err(member.error("expected [frequency in rad/s, magnitude]"));
        };
        let point = (continuous_frequency(frequency, domain)?, magnitude.positive()?);
        if points.last().is_some_and(|last| last.0 >= point.0) {
            return Err(frequency.error("expected frequencies in ascending order"));
        }
        points.push(point);
    }
    if points.len() < 2 {
        return Err(entry.error("expected two or more pairs [frequency in rad/s, magnitude]"));
    }
    Ok(points)
}

/// Reads a frequency in rad/s, below pi / T in a design with sample time T; returns the frequency that the bilinear map
/// needs.
fn continuous_frequency(entry: &Entry<'_>, domain: Domain) -> Result<f64> {
    let stated = entry.positive()?;
    let frequency = bilinear_frequency(stated, domain);
    match domain {
        Domain::Sampled { period } if !frequency.is_finite() => {
            let limit = std::f64::consts::PI / period;
            Err(entry.error(format!(
                "expected a frequency below pi / sample_time = {limit:.4e} rad/s, found {stated}"
            )))
        }
        _ => Ok(frequency),
    }
}
