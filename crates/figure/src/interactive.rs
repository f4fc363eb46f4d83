//! Scripts and style sheets of interactive plots, for HTML pages that are one file.
//!
//! A page includes [`UPLOT_STYLE`], [`COLOURS`], [`BASE_STYLE`] and [`LINKED_STYLE`], then [`UPLOT`] and [`LINKED`].
//! The script of the page creates a `LinkedAxis` for each quantity on a horizontal axis and calls its method `plot` for
//! each plot. A horizontal drag zooms all plots of the axis, a vertical drag zooms the vertical axis of one plot. The
//! cursors of the plots move together; the legends show the values at the cursor and their differences to the values at
//! a second cursor. The plots can be operated by keyboard and on a touch screen. [`USAGE`] explains this to the reader.
//!
//! A page with elements `details` includes [`FOLD`].

/// The style sheet of the colours, light and dark.
pub const COLOURS: &str = include_str!("interactive/colours.css");
/// The style sheet of texts, tables, controls and paper, after [`COLOURS`].
pub const BASE_STYLE: &str = include_str!("interactive/base.css");
/// The script of the plots: uPlot 1.6.32, Leon Sorokin, MIT licence ([`UPLOT_LICENCE`]).
pub const UPLOT: &str = include_str!("interactive/uPlot.iife.min.js");
/// The style sheet of uPlot.
pub const UPLOT_STYLE: &str = include_str!("interactive/uPlot.min.css");
/// The licence of uPlot.
pub const UPLOT_LICENCE: &str = include_str!("interactive/uPlot-LICENSE");
/// The script of linked plots: the class `LinkedAxis` and the function `redrawOn`.
pub const LINKED: &str =
    concat!(include_str!("interactive/zoom.js"), include_str!("interactive/linked.js"));
/// The script that opens elements `details` for printing, and when a link leads into one.
pub const FOLD: &str = include_str!("interactive/fold.js");
/// Instructions for the reader of linked plots.
pub const USAGE: [&str; 3] = [
    "Mouse: drag along the axis to zoom all plots, up or down to zoom the vertical axis of one, or turn the wheel with \
     Shift; double-click to show all. A click puts a second cursor: the values at the cursor are then followed by \
     their differences (Δ) to those there; a click on it removes it. A click on a name hides its curve.",
    "Keyboard, in a plot (Tab goes there): ← and → move the cursor, with Shift ten times as far; + and − zoom; ↑ and ↓ \
     zoom the vertical axis, with Shift they move it; 0 shows all; the space bar puts the second cursor, Escape \
     removes it.",
    "Touch screen: two fingers zoom, a double tap shows all.",
];
/// The style sheet of linked plots.
pub const LINKED_STYLE: &str = include_str!("interactive/linked.css");
