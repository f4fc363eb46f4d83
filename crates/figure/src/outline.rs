//! Replaces each `<text>` of an SVG by the outlines of its letters in the embedded font, without kerning.
//!
//! The rasteriser then needs no text stack, which would take longer to compile than anything else in the
//! command.

use std::fmt::Write as _;

use resvg::usvg::roxmltree::{Document, Node};
use ttf_parser::{Face, GlyphId, OutlineBuilder};

/// Size of a text without `font-size`, in SVG units.
const DEFAULT_SIZE: f32 = 16.0;
/// Attributes of a `<text>` that its path does not need, because the outlines include their effect.
const TEXT_ATTRIBUTES: [&str; 7] =
    ["x", "y", "text-anchor", "font-size", "font-family", "font-weight", "font-style"];

/// Returns `svg` with a path instead of each text.
///
/// # Errors
///
/// Returns the reason if `svg` is not XML, or if a text is not plain: the text contains elements, has several
/// positions, or its position or size is not a number.
pub(super) fn outline_texts(svg: &str) -> Result<String, String> {
    let document = Document::parse(svg).map_err(|error| error.to_string())?;
    let face = Face::parse(dejavu::sans::regular(), 0).map_err(|error| error.to_string())?;
    let (mut outlined, mut copied) = (String::with_capacity(svg.len()), 0);
    for node in document.descendants().filter(|node| node.has_tag_name("text")) {
        let range = node.range();
        outlined.push_str(&svg[copied..range.start]);
        let path = path(node, &face).map_err(|reason| {
            let place = document.text_pos_at(range.start);
            format!("line {}, column {}: <text>: {reason}", place.row, place.col)
        })?;
        outlined.push_str(&path);
        copied = range.end;
    }
    outlined.push_str(&svg[copied..]);
    Ok(outlined)
}

/// Returns the `<path>` with the outlines of a `<text>`.
fn path(node: Node<'_, '_>, face: &Face<'_>) -> Result<String, String> {
    if node.children().any(|child| !child.is_text()) {
        return Err("expected plain text, found an element in it".to_owned());
    }
    let size = inherited(node, "font-size").map_or(Ok(DEFAULT_SIZE), number)?;
    let coordinate = |name| node.attribute(name).map_or(Ok(0.0), number);
    let (x, y) = (coordinate("x")?, coordinate("y")?);
    let words: Vec<&str> = node.text().unwrap_or_default().split_whitespace().collect();
    let text = words.join(" ");
    let scale = size / f32::from(face.units_per_em());
    let glyphs = text.chars().map(|letter| face.glyph_index(letter).unwrap_or(GlyphId(0)));
    let advance = |glyph| scale * f32::from(face.glyph_hor_advance(glyph).unwrap_or(0));
    let width: f32 = glyphs.clone().map(advance).sum();
    let shift = match inherited(node, "text-anchor") {
        Some("middle") => 0.5 * width,
        Some("end") => width,
        _ => 0.0,
    };
    let mut pen = Pen { data: String::new(), x: x - shift, y, scale };
    for glyph in glyphs {
        face.outline_glyph(glyph, &mut pen);
        pen.x += advance(glyph);
    }
    let mut path = format!("<path d=\"{}\"", pen.data);
    for attribute in node.attributes() {
        let name = attribute.name();
        if attribute.namespace().is_none() && !TEXT_ATTRIBUTES.contains(&name) {
            let value = attribute.value().replace('&', "&amp;").replace('<', "&lt;");
            let _ = write!(path, " {name}=\"{}\"", value.replace('"', "&quot;"));
        }
    }
    path.push_str("/>");
    Ok(path)
}

/// Returns an attribute of the element or of the nearest element around it, if any has it.
fn inherited<'a>(node: Node<'a, '_>, name: &str) -> Option<&'a str> {
    node.ancestors().find_map(|node| node.attribute(name))
}

fn number(text: &str) -> Result<f32, String> {
    let digits = text.trim().trim_end_matches("px");
    digits.parse().map_err(|_| format!("expected one number, found {text:?}"))
}

/// Writes outlines as path data; font units point upwards, SVG units downwards.
struct Pen {
    data: String,
    x: f32,
    y: f32,
    scale: f32,
}

impl Pen {
    fn write(&mut self, command: char, points: &[(f32, f32)]) {
        self.data.push(command);
        for (x, y) in points {
            let (x, y) = (self.x + self.scale * x, self.y - self.scale * y);
            let _ = write!(self.data, "{x:.3} {y:.3} ");
        }
    }
}

impl OutlineBuilder for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        self.write('M', &[(x, y)]);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.write('L', &[(x, y)]);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.write('Q', &[(x1, y1), (x, y)]);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.write('C', &[(x1, y1), (x2, y2), (x, y)]);
    }

    fn close(&mut self) {
        self.data.push('Z');
    }
}
