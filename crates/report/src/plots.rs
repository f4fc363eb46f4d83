//! The plots of a page: groups variables by FMU, unit and size, and selects the rows of each plot.

use results::Column;
use serde::Serialize;

use crate::columns::Columns;
use crate::frames::Message;
use crate::samples::{Collector, Samples};
use crate::signals::{Rank, Signals};
use crate::statistics::Statistics;

/// Largest number of curves in a plot: the number of colours.
const CURVES: usize = 7;
/// Largest number of values in the plots of a page, without constant variables: 16 MB, at most 21 MB in the file.
const VALUES: usize = 2_000_000;
/// Least number of blocks of rows of a plot.
const BLOCKS: usize = 300;
/// Largest ratio of the sizes of two curves in a plot; with a larger one, the smaller curve looks like a straight line.
const RATIO: f64 = 30.0;
/// Largest number of plots that are not folded.
const SHOWN: usize = 6;

/// Variables of an FMU with the same unit and similar size, which share a plot.
pub(crate) struct Group {
    /// The rank of the group's most important variable, and the position of its FMU.
    key: (Rank, usize),
    /// Whether no variable changes.
    pub(crate) is_flat: bool,
    pub(crate) unit: String,
    /// The positions of the group's variables among the columns.
    pub(crate) members: Vec<usize>,
    /// The largest absolute value of the group's first variable.
    size: f64,
    /// Number of rows of a block of the [`Collector`]; 1 if all rows remain.
    pub(crate) block: usize,
}

impl Group {
    /// Whether the group is shown first: the configuration plots its variables, or these are connected or outputs.
    fn is_first(&self) -> bool {
        self.key.0 < Rank::Other
    }

    /// Whether this group has room for a variable of the group `other`.
    fn has_room_for(&self, other: &Self) -> bool {
        let ratio = other.size.max(self.size) / other.size.min(self.size);
        (self.is_first(), self.key.1) == (other.is_first(), other.key.1)
            && self.is_flat == other.is_flat
            && self.unit == other.unit
            && self.members.len() < CURVES
            && (ratio <= RATIO || ratio.is_nan())
    }
}

/// Groups the columns in the order in which they are shown, and decides how many of the `rows` each plot keeps.
/// `is_paired` is whether there is a second run.
pub(crate) fn groups(
    columns: &[Column],
    statistics: &[Statistics],
    signals: &Signals,
    rows: usize,
    is_paired: bool,
) -> Vec<Group> {
    let is_flat = |one: &Statistics| one.smallest.0 >= one.largest.0 && one.not_finite == 0;
    let mut groups: Vec<Group> = Vec::new();
    for (at, (column, statistics)) in columns.iter().zip(statistics).enumerate() {
        let single = Group {
            key: (signals.ranks[at], signals.fmu_positions[at]),
            is_flat: is_flat(statistics),
            unit: column.unit.clone().unwrap_or_default(),
            members: vec![at],
            size: statistics.smallest.0.abs().max(statistics.largest.0.abs()),
            block: 1,
        };
        match groups.iter_mut().find(|group| group.has_room_for(&single)) {
            Some(group) => {
                group.key = group.key.min(single.key);
                group.members.push(at);
            }
            None => groups.push(single),
        }
    }
    groups.sort_by_key(|group| group.key);
    let runs = if is_paired { 2 } else { 1 };
    let flat = statistics.iter().filter(|one| is_flat(one)).count();
    // A column that does not change takes memory in the browser but almost none in the file.
    let share = VALUES / (runs * (statistics.len() - flat) + flat / 32).max(1);
    if rows > share {
        for group in &mut groups {
            let has_gaps = group.members.iter().any(|at| statistics[*at].not_finite > 0);
            let max_rows = Collector::max_rows(runs * group.members.len(), is_paired, has_gaps);
            group.block = rows.div_ceil((share / max_rows).max(BLOCKS)).max(2);
        }
    }
    groups
}

/// The data of all plots.
#[derive(Default, Serialize)]
pub(crate) struct Plots {
    /// The times of the rows of the plots.
    grids: Vec<Grid>,
    #[serde(rename = "plots")]
    all: Vec<Plot>,
    columns: Columns,
}

/// The times of the rows of one or more plots.
#[derive(Serialize, PartialEq, Eq)]
struct Grid {
    /// Column of the times in s.
    time: usize,
    rows: usize,
    /// Number of all rows of the run; the plots may have fewer.
    total: usize,
}

#[derive(Serialize)]
struct Plot {
    /// The FMU of the variables; empty for variables of no FMU.
    fmu: String,
    unit: String,
    /// Whether the plot is not folded.
    shown: bool,
    grid: usize,
    curves: Vec<Curve>,
}

/// A variable in a plot; values are numbers of columns.
#[derive(Serialize)]
struct Curve {
    name: String,
    /// Whether the value is held between two rows.
    holds: bool,
    /// Whether the points are shown as dots, without lines between them.
    dots: bool,
    values: usize,
    /// The values of the other run at the same times, if the other run has the variable.
    other: Option<usize>,
}

impl Plots {
    /// Adds the plots of the groups. The samples of a group have the columns of this run, then those of the other run;
    /// `is_compared` says which variables the other run has. Of the first [`SHOWN`] plots, those with
    /// [`Group::is_first`] are not folded; if no group has this property, no plot is folded.
    pub(crate) fn add_all(
        &mut self,
        groups: &[(&Group, &Samples)],
        columns: &[Column],
        fmus: &[String],
        is_compared: &[bool],
    ) {
        let has_first = groups.iter().any(|(group, _)| group.is_first());
        for (group, samples) in groups {
            let curves = self.curves(group, samples, columns, is_compared);
            let grid = self.grid(samples);
            let shown = self.all.len() < SHOWN && (group.is_first() || !has_first);
            let (fmu, unit) = (fmus[group.key.1].clone(), group.unit.clone());
            self.all.push(Plot { fmu, unit, shown, grid, curves });
        }
    }

    fn curves(
        &mut self,
        group: &Group,
        samples: &Samples,
        columns: &[Column],
        is_compared: &[bool],
    ) -> Vec<Curve> {
        let count = group.members.len();
        let curves = group.members.iter().enumerate().map(|(place, at)| {
            let other = is_compared.get(*at).is_some_and(|is_compared| *is_compared);
            let other = samples.columns.get(count + place).filter(|_| other);
            Curve {
                name: columns[*at].name.clone(),
                holds: columns[*at].is_held(),
                dots: false,
                values: self.columns.add(&samples.columns[place]),
                other: other.map(|values| self.columns.add(values)),
            }
        });
        curves.collect()
    }

    /// Adds the plots of the times between the frames of each message.
    pub(crate) fn add_frames(&mut self, messages: &[Message]) {
        let share = VALUES / messages.len().max(1);
        for group in messages.chunks(CURVES) {
            let samples = merge_frames(group, share);
            let grid = self.grid(&samples);
            let curves = group.iter().zip(&samples.columns).map(|(message, values)| Curve {
                name: message.name.clone(),
                holds: false,
                dots: true,
                values: self.columns.add(values),
                other: None,
            });
            let curves = curves.collect();
            let unit = "ms since the frame before".to_owned();
            let shown = self.all.len() < SHOWN + 1;
            self.all.push(Plot { fmu: "Frames on the bus".to_owned(), unit, shown, grid, curves });
        }
    }

    /// Adds the times of the samples, unless there is an equal grid; returns the number of the grid.
    fn grid(&mut self, samples: &Samples) -> usize {
        let time = self.columns.add(&samples.time);
        let grid = Grid { time, rows: samples.time.len(), total: samples.total };
        self.grids.iter().position(|other| *other == grid).unwrap_or_else(|| {
            self.grids.push(grid);
            self.grids.len() - 1
        })
    }
}

/// Returns the frames of several messages in the order of their times: each row has the value of one message and NaN
/// for the others. Beyond `share` rows, only the extremes of blocks remain.
fn merge_frames(messages: &[Message], share: usize) -> Samples {
    let frames = messages.iter().enumerate().flat_map(|(at, message)| {
        message.intervals.iter().map(move |(time, interval)| (*time, at, *interval))
    });
    let mut frames: Vec<_> = frames.collect();
    frames.sort_by(|one, other| one.0.total_cmp(&other.0));
    let block = if frames.len() > share {
        let max_rows = Collector::max_rows(messages.len(), false, true);
        frames.len().div_ceil((share / max_rows).max(BLOCKS)).max(2)
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
