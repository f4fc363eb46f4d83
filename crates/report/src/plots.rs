//! The curves of the plots, grouped by unit.

use results::Column;
use serde::Serialize;

use crate::difference::Compared;
use crate::frames::Message;
use crate::statistics::Statistics;
use crate::trace::{MOST, Trace};

/// Largest number of curves in a plot: the number of colours.
const CURVES: usize = 7;
/// Number of points of all curves together, and the least for one of them.
const POINTS: usize = 160_000;
const LEAST: usize = 600;

/// Largest ratio of the sizes of two curves in a plot: more, and the smaller one is a line.
const RATIO: f64 = 30.0;

/// A plot of variables with the same unit and similar size.
#[derive(Serialize)]
pub(crate) struct Plot {
    unit: String,
    curves: Vec<Curve>,
    /// The largest absolute value of the first curve.
    #[serde(skip)]
    size: f64,
}

impl Plot {
    fn takes(&self, unit: &str, size: f64) -> bool {
        let ratio = size.max(self.size) / size.min(self.size);
        self.unit == unit && self.curves.len() < CURVES && (ratio <= RATIO || ratio.is_nan())
    }
}

/// A variable in a plot.
#[derive(Serialize)]
pub(crate) struct Curve {
    name: String,
    /// Whether the value is held between two points.
    holds: bool,
    /// Whether the points are not connected.
    dots: bool,
    #[serde(rename = "own")]
    this_run: Points,
    other: Option<Points>,
    difference: Option<Points>,
}

/// The points of a curve: times in s and values, None for a value that is not finite.
#[derive(Serialize)]
pub(crate) struct Points(Vec<f64>, Vec<Option<f64>>);

pub(crate) fn plots(
    columns: &[Column],
    statistics: &[Statistics],
    traces: &[Trace],
    compared: Option<&Compared>,
) -> Vec<Plot> {
    let curves = if compared.is_some() { 3 } else { 1 };
    let limit = (POINTS / (curves * columns.len())).clamp(LEAST, MOST);
    let mut plots: Vec<Plot> = Vec::new();
    for (at, (column, trace)) in columns.iter().zip(traces).enumerate() {
        let pair = compared.and_then(|compared| compared.curves[at].as_ref());
        let curve = Curve {
            name: column.name.clone(),
            holds: crate::holds(column),
            dots: false,
            this_run: points(trace, limit),
            other: pair.map(|(other, _)| points(other, limit)),
            difference: pair.map(|(_, difference)| points(difference, limit)),
        };
        let unit = column.unit.clone().unwrap_or_default();
        let size = statistics[at].smallest.0.abs().max(statistics[at].largest.0.abs());
        match plots.iter_mut().find(|plot| plot.takes(&unit, size)) {
            Some(plot) => plot.curves.push(curve),
            None => plots.push(Plot { unit, curves: vec![curve], size }),
        }
    }
    plots
}

/// The times between the frames of each message; the messages follow each other.
pub(crate) fn of_frames(messages: &[Message]) -> Vec<Plot> {
    let limit = (POINTS / messages.len().max(1)).clamp(LEAST, MOST);
    let curve = |message: &Message| Curve {
        name: message.name.clone(),
        holds: false,
        dots: true,
        this_run: points(&message.intervals, limit),
        other: None,
        difference: None,
    };
    let unit = "ms since the frame before";
    let plot = |group: &[Message]| {
        let curves = group.iter().map(curve).collect();
        Plot { unit: unit.to_owned(), curves, size: 0.0 }
    };
    messages.chunks(CURVES).map(plot).collect()
}

/// All rows of a trace, if they are at most `limit`; otherwise the lowest and the highest of each group of
/// neighbours.
fn points(trace: &Trace, limit: usize) -> Points {
    let samples: Vec<(f64, f64)> = if trace.count <= limit {
        trace.rows.clone()
    } else {
        let (times, values) = trace.envelope.samples();
        let samples: Vec<_> = times.into_iter().zip(values).collect();
        let group = (2 * samples.len()).div_ceil(limit).max(2);
        samples.chunks(group).flat_map(extremes).chain(samples.last().copied()).collect()
    };
    let value = |value: f64| value.is_finite().then(|| seven_digits(value));
    let (times, values) = samples.into_iter().map(|(time, height)| (time, value(height))).unzip();
    Points(times, values)
}

/// The lowest and the highest sample in their order, and a gap if there is one.
fn extremes(samples: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let finite = || samples.iter().filter(|sample| sample.1.is_finite());
    let lowest = finite().min_by(|a, b| a.1.total_cmp(&b.1));
    let highest = finite().max_by(|a, b| a.1.total_cmp(&b.1));
    let gap = samples.iter().find(|sample| !sample.1.is_finite());
    let mut points: Vec<_> = [lowest, highest, gap].into_iter().flatten().copied().collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    points.dedup();
    points
}

/// The value rounded to seven significant digits, which a plot does not show.
fn seven_digits(value: f64) -> f64 {
    format!("{value:.6e}").parse().unwrap_or(value)
}
