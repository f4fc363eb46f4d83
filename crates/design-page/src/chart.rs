//! The frame of a figure: axes, grid and labels. Colours and text sizes follow the page.

use maud::{Markup, PreEscaped, html};

use figure::axis::Axis;

const LEFT: f64 = 66.0;
const RIGHT: f64 = 14.0;
const TOP: f64 = 10.0;
const BOTTOM: f64 = 48.0;

/// Outer width of a figure in units of its SVG.
const WIDTH: f64 = 440.0;
const HEIGHT: f64 = 370.0;
/// Positions of the ends of the horizontal axis.
pub(super) const HORIZONTAL: (f64, f64) = (LEFT, WIDTH - RIGHT);
/// Positions of the ends of the vertical axis, from bottom to top.
pub(super) const VERTICAL: (f64, f64) = (HEIGHT - BOTTOM, TOP);

/// A pair of axes.
pub(super) struct Chart<'a> {
    /// Identifier of the figure on the page.
    pub(super) id: &'a str,
    pub(super) title: &'a str,
    /// A description of the figure for screen readers.
    pub(super) description: &'a str,
    pub(super) x: Axis,
    pub(super) y: Axis,
    pub(super) x_label: &'a str,
    pub(super) y_label: &'a str,
}

impl Chart<'_> {
    /// Draws the figure; `content` is clipped to the frame.
    pub(super) fn draw(&self, content: &Markup) -> Markup {
        let (title, description) = (format!("{}-title", self.id), format!("{}-what", self.id));
        let window = format!("{}-window", self.id);
        let ((left, right), (bottom, top)) = (self.x.pixels(), self.y.pixels());
        html! {
            svg viewBox={ "0 0 " (WIDTH) " " (HEIGHT) } role="img"
                aria-labelledby={ (title) " " (description) } {
                title id=(title) { (self.title) }
                desc id=(description) { (self.description) }
                clipPath id=(window) {
                    rect x=(left) y=(top) width=(right - left) height=(bottom - top) {}
                }
                (self.grid())
                g clip-path={ "url(#" (window) ")" } { (content) }
                rect.frame x=(left) y=(top) width=(right - left) height=(bottom - top) {}
                (self.labels())
            }
        }
    }

    fn grid(&self) -> Markup {
        let ((left, right), (bottom, top)) = (self.x.pixels(), self.y.pixels());
        html! {
            @for (at, label) in self.x.ticks() {
                (line([self.x.place(at), top], [self.x.place(at), bottom], "grid"))
                text.tick.middle x=(tenth(self.x.place(at))) y=(bottom + 16.0) { (label) }
            }
            @for (at, label) in self.y.ticks() {
                (line([left, self.y.place(at)], [right, self.y.place(at)], "grid"))
                text.tick.end x=(left - 6.0) y=(tenth(self.y.place(at) + 4.0)) { (label) }
            }
        }
    }

    fn labels(&self) -> Markup {
        let ((left, right), (bottom, top)) = (self.x.pixels(), self.y.pixels());
        let (center, middle) = (f64::midpoint(left, right), f64::midpoint(top, bottom));
        html! {
            text.label.middle x=(center) y=(bottom + 37.0) { (self.x_label) }
            text.label.middle x="13" y=(middle) transform={ "rotate(-90 13 " (middle) ")" } {
                (self.y_label)
            }
        }
    }

    /// Draws a line through points in any order; a point whose first coordinate is NaN interrupts it.
    pub(super) fn outline(&self, points: &[(f64, f64)], class: &str) -> Markup {
        let place =
            |(x, y): &(f64, f64)| format!("{:.1} {:.1}", self.x.place(*x), self.y.place(*y));
        let strokes = points.split(|point| point.0.is_nan()).filter(|part| !part.is_empty());
        let stroke = |part: &[(f64, f64)]| {
            let mut places: Vec<_> = part.iter().map(place).collect();
            places.dedup();
            format!("M{}", places.join(" "))
        };
        html! { path.(class) d=(strokes.map(stroke).collect::<String>()) {} }
    }

    /// Draws a vertical line; nothing outside of the range of the axis.
    pub(super) fn upright(&self, at: f64, class: &str) -> Markup {
        let ((bottom, top), x) = (self.y.pixels(), self.x.place(at));
        html! { @if self.x.contains(at) { (line([x, top], [x, bottom], class)) } }
    }

    /// Draws a horizontal line; nothing outside of the range of the axis.
    pub(super) fn level(&self, at: f64, class: &str) -> Markup {
        let ((left, right), y) = (self.x.pixels(), self.y.place(at));
        html! { @if self.y.contains(at) { (line([left, y], [right, y], class)) } }
    }
}

/// Draws a line between two points `[x, y]`.
pub(super) fn line([x1, y1]: [f64; 2], [x2, y2]: [f64; 2], class: &str) -> Markup {
    html! { line.(class) x1=(tenth(x1)) y1=(tenth(y1)) x2=(tenth(x2)) y2=(tenth(y2)) {} }
}

/// Formats a coordinate in a figure, with one decimal.
pub(super) fn tenth(value: f64) -> PreEscaped<String> {
    PreEscaped(format!("{value:.1}"))
}

/// Draws the legend: a sample of each line or marker and its name.
pub(super) fn legend(entries: &[(Markup, String)]) -> Markup {
    html! {
        ul.legend {
            @for (sample, name) in entries {
                li { svg.sample viewBox="0 0 30 18" aria-hidden="true" { (sample) } " " (name) }
            }
        }
    }
}

/// Draws a sample line for a legend.
pub(super) fn line_sample(class: &str) -> Markup {
    line([1.0, 9.0], [29.0, 9.0], class)
}
