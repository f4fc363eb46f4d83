//! Line plots of time series as SVG and PNG, and the common scripts and styles of pages with [`interactive`]
//! plots.
//!
//! This crate writes the SVG without a plotting library, because a panel needs a legend of many
//! long names outside of its frame, and a curve of millions of samples that keeps every spike. The
//! report of a design draws further diagrams with the same [`axis`]. The PNG is
//! rasterised from the SVG with an embedded font, so that a figure looks the same on a machine without
//! fonts.

pub mod axis;
mod canvas;
pub mod interactive;
mod legend;
mod outline;
mod trace;

use std::io;
use std::path::{Path, PathBuf};

use axis::Axis;
use canvas::{Anchor, Canvas};
use legend::Entry;

pub use canvas::rasterise;

/// Width of a figure in SVG units; the PNG has twice as many pixels.
const WIDTH: f64 = 1000.0;

/// Minimum width of the left margin, for the axis label and the tick labels.
const LEFT: f64 = 100.0;
const RIGHT: f64 = 22.0;
const TITLE_HEIGHT: f64 = 40.0;
const LEGEND_HEIGHT: f64 = 32.0;
const PLOT_HEIGHT: f64 = 168.0;
const TICK_HEIGHT: f64 = 26.0;
const LABEL_HEIGHT: f64 = 24.0;
const GAP: f64 = 12.0;

const TITLE_SIZE: f64 = 20.0;
const TEXT_SIZE: f64 = 16.0;

const TEXT: &str = "#222222";
const FRAME: &str = "#444444";
const GRID: &str = "#e2e2e2";

const LIMIT_DASH: &str = "7 4";
const MARK_DASH: &str = "4 3";

/// A figure: a title and panels below each other.
#[derive(Debug)]
pub struct Figure<'a> {
    /// The title.
    pub title: &'a str,
    /// The panels, from top to bottom.
    pub panels: Vec<Panel<'a>>,
}

/// A panel: one pair of axes. Labels include the unit, as in "time in s".
#[derive(Debug, Default)]
pub struct Panel<'a> {
    /// Label of the horizontal axis; an empty label takes no space.
    pub x_label: &'a str,
    /// Label of the vertical axis.
    pub y_label: &'a str,
    /// Range of the time axis; `None`: all finite times.
    pub x_range: Option<(f64, f64)>,
    /// Largest magnitude in the automatic range of the vertical axis. Larger values are outside of the frame, which a
    /// remark beside the legend states.
    pub y_cap: Option<f64>,
    /// The curves; later curves cover earlier ones.
    pub series: Vec<Series<'a>>,
    /// Times marked by a vertical dashed line, and their texts in the legend. Times outside of the axis are skipped.
    pub marks: Vec<(f64, &'a str)>,
    /// Height of the frame in SVG units; default: 168.
    pub frame_height: Option<f64>,
    /// A bound of the magnitude, drawn as thin lines at plus and minus the bound, and its name in the legend.
    pub limit: Option<(f64, &'a str)>,
}

/// A curve. Values that are not finite leave a gap.
#[derive(Debug)]
pub struct Series<'a> {
    /// Name in the legend.
    pub label: &'a str,
    /// The times in s.
    pub time: &'a [f64],
    /// The values, one per time.
    pub values: &'a [f64],
    /// The colour.
    pub ink: Ink,
    /// Whether the curve is broad, so that it stays visible below a later curve.
    pub broad: bool,
}

/// Converts samples to a staircase: each value is held until the time of the next one; the last one is a point.
#[must_use]
pub fn stairs(time: &[f64], values: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let ends = time.iter().skip(1).chain(time.last());
    let steps = time.iter().zip(ends).zip(values);
    steps.flat_map(|((start, end), value)| [(*start, *value), (*end, *value)]).unzip()
}

/// Line colours that colour-blind readers can distinguish (Okabe and Ito, 2008).
#[derive(Debug, Clone, Copy)]
#[expect(missing_docs, reason = "the names of the colours")]
pub enum Ink {
    Blue,
    Sky,
    Vermilion,
    Green,
    Orange,
    Purple,
    Black,
}

/// All colours, in the order of the curves of a plot.
pub const INKS: [Ink; 7] =
    [Ink::Blue, Ink::Vermilion, Ink::Green, Ink::Purple, Ink::Sky, Ink::Orange, Ink::Black];

impl Ink {
    fn code(self) -> &'static str {
        match self {
            Self::Blue => "#0072b2",
            Self::Sky => "#56b4e9",
            Self::Vermilion => "#d55e00",
            Self::Green => "#009e73",
            Self::Orange => "#e69f00",
            Self::Purple => "#cc79a7",
            Self::Black => "#000000",
        }
    }
}

impl Series<'_> {
    fn width(&self) -> &'static str {
        if self.broad { "5" } else { "1.8" }
    }
}

/// The reason why a figure could not be drawn or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum FigureError {
    /// A curve has different numbers of times and values.
    #[error("curve {label:?}: {times} times, but {values} values")]
    Lengths { label: String, times: usize, values: usize },
    /// The file cannot be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The drawing cannot be rasterised.
    #[error("cannot turn the drawing into pixels: {0}")]
    Pixels(String),
}

impl Figure<'_> {
    /// Writes `stem`.svg and `stem`.png, each atomically; creates their folder. Equal figures give equal bytes.
    ///
    /// # Errors
    ///
    /// [`FigureError`] if a curve has different numbers of times and values, if the drawing cannot
    /// be rasterised, or if a file cannot be written.
    pub fn write(&self, stem: &Path) -> Result<(), FigureError> {
        let svg = self.svg()?;
        let png = rasterise(&svg)?;
        write_whole(&with_ending(stem, ".svg"), svg.as_bytes())?;
        write_whole(&with_ending(stem, ".png"), &png)
    }

    /// Returns the drawing as SVG text.
    ///
    /// # Errors
    ///
    /// [`FigureError::Lengths`] if a curve has different numbers of times and values.
    pub fn svg(&self) -> Result<String, FigureError> {
        for series in self.panels.iter().flat_map(|panel| &panel.series) {
            if series.time.len() != series.values.len() {
                return Err(FigureError::Lengths {
                    label: series.label.to_owned(),
                    times: series.time.len(),
                    values: series.values.len(),
                });
            }
        }
        // All panels use the same left margin, so that equal times are aligned.
        let left = self.panels.iter().map(Panel::left).fold(LEFT, f64::max);
        let heights: Vec<f64> = self.panels.iter().map(|panel| panel.height(left)).collect();
        let height = TITLE_HEIGHT + heights.iter().sum::<f64>();
        let mut canvas = Canvas::new(WIDTH, height, self.title);
        canvas.text((WIDTH / 2.0, 30.0), Anchor::Middle, TITLE_SIZE, TEXT, self.title);
        let mut top = TITLE_HEIGHT;
        for (panel, height) in self.panels.iter().zip(heights) {
            panel.draw(&mut canvas, left, top);
            top += height;
        }
        Ok(canvas.finish())
    }
}

impl Panel<'_> {
    fn height(&self, left: f64) -> f64 {
        let label = if self.x_label.is_empty() { 0.0 } else { LABEL_HEIGHT };
        self.legend_height(left) + self.frame_height() + TICK_HEIGHT + label + GAP
    }

    fn frame_height(&self) -> f64 {
        self.frame_height.unwrap_or(PLOT_HEIGHT)
    }

    fn legend_height(&self, left: f64) -> f64 {
        LEGEND_HEIGHT + legend::height(&self.legend(&self.horizontal(left)), left)
    }

    /// Returns the left margin that the vertical axis needs for its label and the labels of its ticks.
    fn left(&self) -> f64 {
        let vertical = self.vertical(&self.horizontal(LEFT), (PLOT_HEIGHT, 0.0));
        let width = |(_, label): (f64, String)| canvas::digits_width(&label, TEXT_SIZE);
        36.0 + vertical.ticks().into_iter().map(width).fold(0.0, f64::max)
    }

    fn horizontal(&self, left: f64) -> Axis {
        let (start, end) = self.x_range.unwrap_or_else(|| self.times());
        let axis = |ticks| Axis::exact(start, end, (left, WIDTH - RIGHT), ticks);
        // Labels, each a centre and half a width, must be apart: seconds since 1970 leave room for fewer ticks.
        let fits = |axis: &Axis| {
            let labels: Vec<_> = axis.ticks().iter().map(|tick| label_span(axis, tick)).collect();
            labels.windows(2).all(|pair| pair[0].0 + pair[0].1 < pair[1].0 - pair[1].1)
        };
        (4..=10).rev().map(axis).find(fits).unwrap_or_else(|| axis(3))
    }

    /// Returns the vertical axis for the values in the range of `horizontal` and for the limits; `pixels` are the page
    /// coordinates of the lowest and highest value of the axis.
    fn vertical(&self, horizontal: &Axis, pixels: (f64, f64)) -> Axis {
        let (start, end) = horizontal.range();
        let limit = self.limit.into_iter().flat_map(|(size, _)| [size, -size]);
        Axis::around(self.values_between(start, end).chain(limit), self.y_cap, pixels, 7)
    }

    fn draw(&self, canvas: &mut Canvas, left: f64, top: f64) {
        let top = top + self.legend_height(left);
        let (right, bottom) = (WIDTH - RIGHT, top + self.frame_height());
        let horizontal = self.horizontal(left);
        let (start, end) = horizontal.range();
        let visible = self.values_between(start, end);
        let vertical = self.vertical(&horizontal, (bottom, top));

        self.draw_grid(canvas, &horizontal, &vertical);
        if let Some((size, _)) = self.limit {
            for level in [size, -size] {
                let y = vertical.place(level);
                canvas.line((left, y), (right, y), FRAME, "1.2", LIMIT_DASH);
            }
        }
        let window = canvas.window((left, top), (right, bottom));
        for series in &self.series {
            let path = trace::path(series.time, series.values, &horizontal, &vertical);
            canvas.curve(window, &path, series.ink.code(), series.width());
        }
        for (at, _) in self.visible_marks(&horizontal) {
            let x = horizontal.place(*at);
            canvas.line((x, top), (x, bottom), TEXT, "1.5", MARK_DASH);
        }
        canvas.frame((left, top), (right, bottom), FRAME);
        let outside = visible.clone().any(|value| !vertical.contains(value));
        legend::draw(canvas, &self.legend(&horizontal), left, top - 10.0);
        if outside {
            let end = (right, top - 10.0);
            canvas.text(end, Anchor::End, TEXT_SIZE, TEXT, "a curve leaves the frame");
        }
        if visible.count() == 0 {
            let middle = (f64::midpoint(left, right), f64::midpoint(top, bottom) - 20.0);
            canvas.text(middle, Anchor::Middle, TEXT_SIZE, TEXT, "no finite data");
        }
    }

    /// Returns the range of the finite times of all curves; a reversed range if there are none.
    fn times(&self) -> (f64, f64) {
        let times =
            self.series.iter().flat_map(|series| series.time).filter(|time| time.is_finite());
        times.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &time| {
            (low.min(time), high.max(time))
        })
    }

    /// Returns the finite values of all curves within a time range.
    fn values_between(&self, start: f64, end: f64) -> impl Iterator<Item = f64> + Clone {
        self.series
            .iter()
            .flat_map(|series| series.time.iter().zip(series.values))
            .filter(move |(time, value)| (start..=end).contains(*time) && value.is_finite())
            .map(|(_, value)| *value)
    }

    fn draw_grid(&self, canvas: &mut Canvas, horizontal: &Axis, vertical: &Axis) {
        let ((left, right), (bottom, top)) = (horizontal.pixels(), vertical.pixels());
        for tick in horizontal.ticks() {
            let x = horizontal.place(tick.0);
            canvas.line((x, top), (x, bottom), GRID, "1", "none");
            let place = (label_span(horizontal, &tick).0, bottom + 20.0);
            canvas.text(place, Anchor::Middle, TEXT_SIZE, TEXT, &tick.1);
        }
        for (at, label) in vertical.ticks() {
            let y = vertical.place(at);
            canvas.line((left, y), (right, y), GRID, "1", "none");
            canvas.text((left - 8.0, y + 5.5), Anchor::End, TEXT_SIZE, TEXT, &label);
        }
        let below = (f64::midpoint(left, right), bottom + TICK_HEIGHT + LABEL_HEIGHT - 8.0);
        canvas.text(below, Anchor::Middle, TEXT_SIZE, TEXT, self.x_label);
        canvas.upward_text((20.0, f64::midpoint(top, bottom)), TEXT_SIZE, TEXT, self.y_label);
    }

    fn visible_marks(&self, horizontal: &Axis) -> impl Iterator<Item = &(f64, &str)> {
        self.marks.iter().filter(|(at, _)| horizontal.contains(*at))
    }

    fn legend(&self, horizontal: &Axis) -> Vec<Entry<'_>> {
        let entry = |colour, width, dash, label| Entry { colour, width, dash, label };
        let curves = self
            .series
            .iter()
            .map(|series| entry(series.ink.code(), series.width(), "none", series.label));
        let limit = self.limit.map(|(_, label)| entry(FRAME, "1.2", LIMIT_DASH, label));
        let marks =
            self.visible_marks(horizontal).map(|(_, label)| entry(TEXT, "1.5", MARK_DASH, label));
        curves.chain(limit).chain(marks).collect()
    }
}

/// Returns the centre of the label of a tick on the horizontal axis, moved so that it stays on the page, and half of
/// its width.
fn label_span(horizontal: &Axis, (at, label): &(f64, String)) -> (f64, f64) {
    let half = 0.5 * canvas::digits_width(label, TEXT_SIZE);
    (horizontal.place(*at).min(WIDTH - half), half)
}

fn with_ending(stem: &Path, ending: &str) -> PathBuf {
    let mut name = stem.as_os_str().to_owned();
    name.push(ending);
    PathBuf::from(name)
}

fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), FigureError> {
    files::whole::write(path, bytes)
        .map_err(|source| FigureError::Write { path: path.to_owned(), source })
}

#[cfg(test)]
mod tests;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
