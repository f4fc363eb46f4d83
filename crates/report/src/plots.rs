//! The plots of a page: variables grouped by unit and size, and the rows that each plot has.

use results::Column;
use serde::Serialize;

use crate::columns::Columns;
use crate::frames::Message;
use crate::samples::{Collector, Samples};
use crate::statistics::Statistics;

/// Largest number of curves in a plot: the number of colours.
const CURVES: usize = 7;
/// Largest number of values of the plots of a page that vary, 16 MB; in the file they have at most 21 MB.
const VALUES: usize = 2_000_000;
/// Least number of blocks of rows of a plot.
const BLOCKS: usize = 300;
/// Largest ratio of the sizes of two curves in a plot: more, and the smaller one is a line.
const RATIO: f64 = 30.0;

/// Variables with the same unit and similar size, which share a plot.
pub(crate) struct Group {
    unit: String,
    /// Their positions among the columns.
    pub(crate) members: Vec<usize>,
    /// The largest absolute value of the first one.
    size: f64,
    /// Number of rows of which the extremes remain; 1 if all rows remain.
    pub(crate) block: usize,
}

impl Group {
    fn takes(&self, unit: &str, size: f64) -> bool {
        let ratio = size.max(self.size) / size.min(self.size);
        self.unit == unit && self.members.len() < CURVES && (ratio <= RATIO || ratio.is_nan())
    }
}

/// Groups the columns, and decides how many of the `rows` each plot has. `is_paired`: there is a second run.
pub(crate) fn groups(
    columns: &[Column],
    statistics: &[Statistics],
    rows: usize,
    is_paired: bool,
) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for (at, (column, statistics)) in columns.iter().zip(statistics).enumerate() {
        let unit = column.unit.clone().unwrap_or_default();
        let size = statistics.smallest.0.abs().max(statistics.largest.0.abs());
        match groups.iter_mut().find(|group| group.takes(&unit, size)) {
            Some(group) => group.members.push(at),
            None => groups.push(Group { unit, members: vec![at], size, block: 1 }),
        }
    }
    let runs = if is_paired { 2 } else { 1 };
    let is_flat = |one: &Statistics| one.smallest.0 >= one.largest.0 && one.not_finite == 0;
    let flat = statistics.iter().filter(|one| is_flat(one)).count();
    // Columns that do not vary need memory in the browser only.
    let share = VALUES / (runs * (statistics.len() - flat) + flat / 32).max(1);
    if rows > share {
        for group in &mut groups {
            let has_gaps = group.members.iter().any(|at| statistics[*at].not_finite > 0);
            let remaining = Collector::remaining(runs * group.members.len(), is_paired, has_gaps);
            group.block = rows.div_ceil((share / remaining).max(BLOCKS)).max(2);
        }
    }
    groups
}

/// The data of all plots.
#[derive(Default, Serialize)]
pub(crate) struct Plots {
    /// The times of the rows that plots have.
    grids: Vec<Grid>,
    #[serde(rename = "plots")]
    all: Vec<Plot>,
    columns: Columns,
}

/// The rows of plots.
#[derive(Serialize, PartialEq, Eq)]
struct Grid {
    /// Column of the times in s.
    time: usize,
    rows: usize,
    /// The number of rows of which these are some.
    total: usize,
}

#[derive(Serialize)]
struct Plot {
    unit: String,
    grid: usize,
    curves: Vec<Curve>,
}

/// A variable in a plot; values are numbers of columns.
#[derive(Serialize)]
struct Curve {
    name: String,
    /// Whether the value is held between two rows.
    holds: bool,
    /// Whether the points are not connected.
    dots: bool,
    values: usize,
    /// The values of the other run at the same times, if it has the variable.
    other: Option<usize>,
}

impl Plots {
    /// Adds the plot of a group. `samples` has the columns of this run, then those of the other one;
    /// `is_compared` says which variables the other one has.
    pub(crate) fn add(
        &mut self,
        group: &Group,
        samples: &Samples,
        columns: &[Column],
        is_compared: &[bool],
    ) {
        let grid = self.grid(samples);
        let count = group.members.len();
        let curves = group.members.iter().enumerate().map(|(place, at)| {
            let other = is_compared.get(*at).is_some_and(|is_compared| *is_compared);
            let other = samples.columns.get(count + place).filter(|_| other);
            Curve {
                name: columns[*at].name.clone(),
                holds: crate::holds(&columns[*at]),
                dots: false,
                values: self.columns.add(&samples.columns[place]),
                other: other.map(|values| self.columns.add(values)),
            }
        });
        let curves = curves.collect();
        self.all.push(Plot { unit: group.unit.clone(), grid, curves });
    }

    /// Adds the plots of the times between the frames of each message.
    pub(crate) fn add_frames(&mut self, messages: &[Message]) {
        let share = VALUES / messages.len().max(1);
        for group in messages.chunks(CURVES) {
            let samples = together(group, share);
            let grid = self.grid(&samples);
            let curves = group.iter().zip(&samples.columns).map(|(message, values)| Curve {
                name: message.name.clone(),
                holds: false,
                dots: true,
                values: self.columns.add(values),
                other: None,
            });
            let curves = curves.collect();
            self.all.push(Plot { unit: "ms since the frame before".to_owned(), grid, curves });
        }
    }

    fn grid(&mut self, samples: &Samples) -> usize {
        let time = self.columns.add(&samples.time);
        let grid = Grid { time, rows: samples.time.len(), total: samples.total };
        self.grids.iter().position(|other| *other == grid).unwrap_or_else(|| {
            self.grids.push(grid);
            self.grids.len() - 1
        })
    }
}

/// The frames of several messages in the order of their times: a row has the value of one message.
fn together(messages: &[Message], share: usize) -> Samples {
    let frames = messages.iter().enumerate().flat_map(|(at, message)| {
        message.intervals.iter().map(move |(time, interval)| (*time, at, *interval))
    });
    let mut frames: Vec<_> = frames.collect();
    frames.sort_by(|one, other| one.0.total_cmp(&other.0));
    let block = if frames.len() > share {
        let remaining = Collector::remaining(messages.len(), false, true);
        frames.len().div_ceil((share / remaining).max(BLOCKS)).max(2)
    } else {
        1
    };
    let mut collector = Collector::new(messages.len(), block, false);
    for (time, message, interval) in frames {
        let values = (0..messages.len()).map(|at| if at == message { interval } else { f64::NAN });
        collector.push(time, values);
    }
    collector.finish()
}
