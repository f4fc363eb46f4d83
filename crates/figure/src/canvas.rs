//! The page of a figure: writes SVG elements and rasterises them.

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree};

use super::FigureError;
use super::outline::outline_texts;

/// Pixels of the PNG per SVG unit.
const SCALE: f32 = 2.0;
const FONTS: &str = "DejaVu Sans, Verdana, Helvetica, Arial, sans-serif";

/// A point on the page in SVG units: x to the right, y down.
type Place = (f64, f64);

/// The part of a text (start, middle or end) that is at the given position.
#[derive(Debug, Clone, Copy)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

impl Anchor {
    fn code(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Middle => "middle",
            Self::End => "end",
        }
    }
}

/// A page under construction, initially white.
#[derive(Debug)]
pub(super) struct Canvas {
    elements: Vec<String>,
    windows: usize,
}

/// A clipping rectangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Window(usize);

impl Canvas {
    pub(super) fn new(width: f64, height: f64, title: &str) -> Self {
        let elements = vec![
            format!(
                r#"<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" font-family="{FONTS}" role="img">"#
            ),
            format!("<title>{}</title>", escape(title)),
            format!(r##"<rect width="{width}" height="{height}" fill="#ffffff"/>"##),
        ];
        Self { elements, windows: 0 }
    }

    pub(super) fn finish(mut self) -> String {
        self.elements.push("</svg>\n".to_owned());
        self.elements.join("\n")
    }

    pub(super) fn line(&mut self, from: Place, to: Place, colour: &str, width: &str, dash: &str) {
        let ((x1, y1), (x2, y2)) = (from, to);
        self.elements.push(format!(
            r#"<line x1="{x1:.1}" y1="{y1:.1}" x2="{x2:.1}" y2="{y2:.1}" stroke="{colour}" stroke-width="{width}" stroke-dasharray="{dash}"/>"#
        ));
    }

    pub(super) fn frame(&mut self, from: Place, to: Place, colour: &str) {
        let ((x, y), (width, height)) = (from, (to.0 - from.0, to.1 - from.1));
        self.elements.push(format!(
            r#"<rect x="{x:.1}" y="{y:.1}" width="{width:.1}" height="{height:.1}" fill="none" stroke="{colour}" stroke-width="1.2"/>"#
        ));
    }

    pub(super) fn window(&mut self, from: Place, to: Place) -> Window {
        self.windows += 1;
        let ((x, y), (width, height)) = (from, (to.0 - from.0, to.1 - from.1));
        self.elements.push(format!(
            r#"<clipPath id="window{}"><rect x="{x:.1}" y="{y:.1}" width="{width:.1}" height="{height:.1}"/></clipPath>"#,
            self.windows
        ));
        Window(self.windows)
    }

    pub(super) fn curve(&mut self, window: Window, path: &str, colour: &str, width: &str) {
        if path.is_empty() {
            return;
        }
        self.elements.push(format!(
            r#"<path clip-path="url(#window{})" d="{path}" fill="none" stroke="{colour}" stroke-width="{width}" stroke-linejoin="round" stroke-linecap="round"/>"#,
            window.0
        ));
    }

    pub(super) fn text(&mut self, at: Place, anchor: Anchor, size: f64, colour: &str, text: &str) {
        self.put_text(at, anchor, size, colour, text, "");
    }

    /// Draws a text rotated by 90 degrees, from bottom to top.
    pub(super) fn upward_text(&mut self, (x, y): Place, size: f64, colour: &str, text: &str) {
        let rotation = format!(r#" transform="rotate(-90 {x:.1} {y:.1})""#);
        self.put_text((x, y), Anchor::Middle, size, colour, text, &rotation);
    }

    fn put_text(
        &mut self,
        (x, y): Place,
        anchor: Anchor,
        size: f64,
        colour: &str,
        text: &str,
        attributes: &str,
    ) {
        if text.is_empty() {
            return;
        }
        self.elements.push(format!(
            r#"<text x="{x:.1}" y="{y:.1}" text-anchor="{}" font-size="{size}" fill="{colour}"{attributes}>{}</text>"#,
            anchor.code(),
            escape(text)
        ));
    }
}

/// Returns a generous estimate of the width of a text, because the SVG viewer chooses the font.
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    text.chars().map(|_| 0.58 * size).sum()
}

/// Returns the width of a number in the embedded font, whose digits are wider than its letters on average.
pub(super) fn digits_width(text: &str, size: f64) -> f64 {
    text.chars().map(|_| 0.64 * size).sum()
}

/// Escapes a text for the content of an XML element; control characters become spaces.
fn escape(text: &str) -> String {
    text.chars()
        .map(|letter| match letter {
            '&' => "&amp;".to_owned(),
            '<' => "&lt;".to_owned(),
            '>' => "&gt;".to_owned(),
            control if control.is_control() => " ".to_owned(),
            plain => plain.to_string(),
        })
        .collect()
}

/// Returns the PNG of an SVG, two pixels per SVG unit. All text uses the embedded font.
///
/// # Errors
///
/// [`FigureError::Pixels`] if `svg` is not an SVG, has no area or is too large, or if a text is not plain: the text
/// contains elements, has several positions, or its position or size is not a number.
pub fn rasterise(svg: &str) -> Result<Vec<u8>, FigureError> {
    let failed = |reason: &dyn std::fmt::Display| FigureError::Pixels(reason.to_string());
    let outlined = outline_texts(svg).map_err(|reason| failed(&reason))?;
    let tree = Tree::from_str(&outlined, &Options::default()).map_err(|reason| failed(&reason))?;
    let size =
        tree.size().to_int_size().scale_by(SCALE).ok_or_else(|| failed(&"the page has no area"))?;
    let mut pixels =
        Pixmap::new(size.width(), size.height()).ok_or_else(|| failed(&"the page is too large"))?;
    resvg::render(&tree, Transform::from_scale(SCALE, SCALE), &mut pixels.as_mut());
    pixels.encode_png().map_err(|reason| failed(&reason))
}
