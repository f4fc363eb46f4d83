//! The data of the interactive plots: each curve once, all numbers in one compressed block.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{Markup, html};
use miniz_oxide::deflate::compress_to_vec_zlib;
use serde::{Serialize, Serializer};

/// Largest number of values of a page in double precision. More are in single precision, so that the page of a plant
/// with 100 states, a million values, has less than 10 MB.
const DOUBLE: usize = 200_000;
/// Level of the compression, of 0 to 10.
const LEVEL: u8 = 6;

/// A horizontal axis. Plots with the same axis are zoomed together and share the cursor.
#[derive(Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Quantity {
    Time,
    Frequency,
}

/// A line across a plot, which the legend below the plot explains.
#[derive(Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Mark {
    /// A vertical line: at the time from which the signal has settled, or at the largest frequency of a sampled loop.
    At(f64),
    /// A horizontal line at the size of a change.
    Size(f64),
}

/// A curve: its name, and a value at each of the `places` of its plot.
#[derive(Serialize)]
#[serde(transparent)]
pub(super) struct Line<'a> {
    pub(super) name: String,
    #[serde(skip)]
    pub(super) values: &'a [f64],
}

/// A plot. The JSON of a plot has no numbers.
#[derive(Serialize)]
pub(super) struct Plot<'a> {
    /// Identifier of the element of the page that shows the plot.
    pub(super) id: String,
    #[serde(rename = "axis")]
    pub(super) quantity: Quantity,
    /// Whether the vertical axis is logarithmic.
    pub(super) logarithmic: bool,
    /// Label of the vertical axis.
    pub(super) label: &'a str,
    /// Description of the plot for screen readers.
    pub(super) title: String,
    /// Times in s or frequencies in rad/s; in the JSON the number of points of each curve.
    #[serde(rename = "points", serialize_with = "count")]
    pub(super) places: &'a [f64],
    #[serde(rename = "curves")]
    pub(super) lines: Vec<Line<'a>>,
    pub(super) marks: Vec<Mark>,
}

/// All plots of a page.
#[derive(Default)]
pub(super) struct Plots<'a>(Vec<Plot<'a>>);

impl<'a> Plots<'a> {
    /// Adds a plot and returns the element of the page that shows it.
    pub(super) fn add(&mut self, plot: Plot<'a>) -> Markup {
        let place = html! { div.plot id=(plot.id) {} };
        self.0.push(plot);
        place
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns the data as JSON without the signs `<` and `&`, for a script element: names and sizes, and the block
    /// of all numbers, compressed (zlib), in base64.
    ///
    /// All plots of an axis are on one grid, the sorted list of all their times or frequencies, since most plots have
    /// the same times or frequencies. The block has four lists: the grid of the times and the grid of the frequencies
    /// (64 bits); plot after plot, for each point its position in the grid minus the position of the point before, or
    /// minus 0 (32 bits, signed); the values of each curve (64 bits, 32 if there are more than [`DOUBLE`]). A list is
    /// stored as all first bytes, little endian, then all second bytes and so on, since neighbours differ little in
    /// most bytes. Points that an axis with decades cannot show are left out.
    pub(super) fn json(&self) -> String {
        let grids = [Quantity::Time, Quantity::Frequency].map(|quantity| self.grid(quantity));
        let mut steps = Vec::new();
        let mut values = Vec::new();
        for plot in &self.0 {
            let grid = &grids[plot.quantity as usize];
            let mut before = 0;
            for at in plot.shown(plot.places) {
                let index = grid.partition_point(|other| *other < at);
                let index = u32::try_from(index).unwrap_or(u32::MAX);
                steps.push(index.wrapping_sub(before));
                before = index;
            }
            values.extend(plot.lines.iter().flat_map(|line| plot.shown(line.values)));
        }
        let bits = if values.len() > DOUBLE { 32 } else { 64 };
        #[expect(clippy::cast_possible_truncation, reason = "a picture needs seven digits")]
        let single = |value: &f64| (*value as f32).to_le_bytes();
        let double = |list: &[f64]| planes(list.iter().map(|value| value.to_le_bytes()));
        let block = [
            double(&grids[0]),
            double(&grids[1]),
            planes(steps.iter().map(|step| step.to_le_bytes())),
            if bits == 64 { double(&values) } else { planes(values.iter().map(single)) },
        ]
        .concat();
        let data = Data {
            grids: grids.map(|grid| grid.len()),
            bits,
            plots: &self.0,
            block: STANDARD.encode(compress_to_vec_zlib(&block, LEVEL)),
        };
        let text = serde_json::to_string(&data).unwrap_or_default();
        text.replace('<', "\\u003c").replace('&', "\\u0026")
    }

    /// Returns all places on an axis, each once, in ascending order.
    fn grid(&self, quantity: Quantity) -> Vec<f64> {
        let plots = self.0.iter().filter(|plot| plot.quantity == quantity);
        let mut grid: Vec<f64> = plots.flat_map(|plot| plot.shown(plot.places)).collect();
        grid.sort_by(f64::total_cmp);
        grid.dedup();
        grid
    }
}

impl Plot<'_> {
    /// Returns the members of a list at the places that an axis with decades can show.
    fn shown(&self, list: &[f64]) -> impl Iterator<Item = f64> {
        let members = self.places.iter().zip(list).filter(|(at, _)| is_shown(**at));
        members.map(|(_, member)| *member)
    }
}

/// Whether an axis with decades can show a place: one that is finite and above 0.
fn is_shown(at: f64) -> bool {
    at > 0.0 && at.is_finite()
}

fn count<S: Serializer>(places: &&[f64], serializer: S) -> Result<S::Ok, S::Error> {
    places.iter().filter(|at| is_shown(**at)).count().serialize(serializer)
}

/// The JSON of all plots.
#[derive(Serialize)]
struct Data<'a> {
    /// The lengths of the grids of times and of frequencies.
    grids: [usize; 2],
    /// Number of bits of each value of a curve: 64 or 32.
    bits: u8,
    plots: &'a [Plot<'a>],
    block: String,
}

/// Returns the first bytes of all numbers, then the second bytes and so on.
fn planes<const N: usize>(numbers: impl Iterator<Item = [u8; N]>) -> Vec<u8> {
    let numbers: Vec<[u8; N]> = numbers.collect();
    (0..N).flat_map(|byte| numbers.iter().map(move |number| number[byte])).collect()
}
