//! Scripts and style sheets of interactive plots, for HTML pages that are one file.
//!
//! A page includes [`UPLOT_STYLE`], [`COLOURS`] and [`LINKED_STYLE`], then [`UPLOT`] and [`LINKED`]. Its own script
//! makes a `LinkedAxis` for each quantity on a horizontal axis and calls its method `plot` for each plot: a drag
//! zooms all plots of the axis, their cursors move together, and the legends show the values there. Arrow keys move
//! the cursor, plus and minus zoom. On a touch screen two fingers zoom and a double tap shows everything.
//!
//! A page whose data grow includes [`ZOOM`] instead of [`LINKED`], and makes a `GrowingAxis`.

/// The style sheet of the colours, light and dark.
pub const COLOURS: &str = include_str!("interactive/colours.css");
/// The script of the plots: uPlot 1.6.32, Leon Sorokin, MIT licence ([`UPLOT_LICENCE`]).
pub const UPLOT: &str = include_str!("interactive/uPlot.iife.min.js");
/// The style sheet of uPlot.
pub const UPLOT_STYLE: &str = include_str!("interactive/uPlot.min.css");
/// The licence of uPlot.
pub const UPLOT_LICENCE: &str = include_str!("interactive/uPlot-LICENSE");
/// The script that zooms plots: the function `zoomByTouch` and the class `GrowingAxis`.
pub const ZOOM: &str = include_str!("interactive/zoom.js");
/// The script of linked plots, after [`ZOOM`]: the class `LinkedAxis` and the function `redrawOn`.
pub const LINKED: &str =
    concat!(include_str!("interactive/zoom.js"), include_str!("interactive/linked.js"));
/// The style sheet of linked plots.
pub const LINKED_STYLE: &str = include_str!("interactive/linked.css");
