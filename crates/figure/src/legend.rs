//! The legend of a panel: entries side by side, on as many lines as needed.

use super::canvas::{Anchor, Canvas, text_width};
use super::{RIGHT, TEXT, TEXT_SIZE, WIDTH};

/// An entry of the legend: a sample of the line and the label of the line.
#[derive(Debug)]
pub(super) struct Entry<'a> {
    pub(super) colour: &'static str,
    pub(super) width: &'static str,
    pub(super) dash: &'static str,
    pub(super) label: &'a str,
}

/// Length of the sample of a line.
const STROKE: f64 = 30.0;
/// Distance from the start of an entry to its label.
const TEXT_AFTER: f64 = 38.0;
/// Distance between two entries.
const SPACE: f64 = 26.0;
const LINE_HEIGHT: f64 = 22.0;

/// The position of an entry in the legend.
#[derive(Debug)]
struct Place {
    x: f64,
    /// Number of the line, from 0.
    line: usize,
    /// The label, shortened to the width of the page.
    label: String,
}

/// Returns the positions of the entries, side by side from `left` on as many lines as they need.
fn places(entries: &[Entry<'_>], left: f64) -> Vec<Place> {
    let end = WIDTH - RIGHT;
    let (mut x, mut line) = (left, 0);
    let place = |entry: &Entry<'_>| {
        let label = shortened(entry.label, end - left - TEXT_AFTER);
        let width = TEXT_AFTER + text_width(&label, TEXT_SIZE);
        if x > left && x + width > end {
            (x, line) = (left, line + 1);
        }
        let place = Place { x, line, label };
        x += width + SPACE;
        place
    };
    entries.iter().map(place).collect()
}

/// Returns the label, shortened to `room` by an ellipsis in the middle: start and end distinguish a label best.
fn shortened(label: &str, room: f64) -> String {
    let letters: Vec<char> = label.chars().collect();
    let fits = |count: usize| text_width(&"x".repeat(count), TEXT_SIZE) <= room;
    let most = (0..=letters.len()).rev().find(|count| fits(*count)).unwrap_or(0);
    if most == letters.len() {
        return label.to_owned();
    }
    let half = most.saturating_sub(1) / 2;
    let part = |letters: &[char]| letters.iter().collect::<String>();
    format!("{}\u{2026}{}", part(&letters[..half]), part(&letters[letters.len() - half..]))
}

/// Returns the height of all lines after the first.
pub(super) fn height(entries: &[Entry<'_>], left: f64) -> f64 {
    let last = places(entries, left).last().map_or(0, |place| place.line);
    LINE_HEIGHT * f64::from(u32::try_from(last).unwrap_or(u32::MAX))
}

/// Draws the entries; the baseline of the last line is at `baseline`.
pub(super) fn draw(canvas: &mut Canvas, entries: &[Entry<'_>], left: f64, baseline: f64) {
    let top = baseline - height(entries, left);
    for (entry, Place { x, line, label }) in entries.iter().zip(places(entries, left)) {
        let baseline = top + LINE_HEIGHT * f64::from(u32::try_from(line).unwrap_or(u32::MAX));
        let y = baseline - 5.5;
        canvas.line((x, y), (x + STROKE, y), entry.colour, entry.width, entry.dash);
        canvas.text((x + TEXT_AFTER, baseline), Anchor::Start, TEXT_SIZE, TEXT, &label);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEFT: f64 = 150.0;

    fn entries<'a>(labels: &[&'a str]) -> Vec<Entry<'a>> {
        let entry = |label: &&'a str| Entry { colour: TEXT, width: "1", dash: "none", label };
        labels.iter().map(entry).collect()
    }

    #[test]
    fn entries_stay_on_the_page_in_as_many_lines_as_they_need() {
        let labels = ["controller.x_hat[1] in m", "b", "plant.position_of_the_cart in m"].repeat(4);
        let entries = entries(&labels);
        let places = places(&entries, LEFT);
        let last = places[places.len() - 1].line;
        assert!((2..=5).contains(&last), "{places:?}");
        let lines = f64::from(u8::try_from(last).unwrap());
        assert!((height(&entries, LEFT) - 22.0 * lines).abs() < 1e-9);
        for Place { x, label, .. } in &places {
            assert!(x + TEXT_AFTER + text_width(label, TEXT_SIZE) <= WIDTH - RIGHT, "{label}");
        }
        for pair in places.windows(2) {
            let [first, second] = pair else { unreachable!() };
            let end = first.x + TEXT_AFTER + text_width(&first.label, TEXT_SIZE);
            let is_beside = second.line == first.line;
            assert!(if is_beside { second.x > end } else { second.x == LEFT }, "{pair:?}");
        }
    }

    #[test]
    fn a_label_longer_than_the_page_keeps_its_start_and_its_end() {
        let long = format!("plant.{}.x_p in m", "deeply_nested.".repeat(20));
        let places = places(&entries(&["a", &long, "b"]), LEFT);
        let label = &places[1].label;
        assert!(label.starts_with("plant.deeply") && label.ends_with(".x_p in m"), "{label}");
        assert!(label.contains('\u{2026}'));
        assert!(LEFT + TEXT_AFTER + text_width(label, TEXT_SIZE) <= WIDTH - RIGHT);
    }
}
