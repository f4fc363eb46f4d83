//! The first plots as one picture, for a reader without JavaScript.

use figure::{Figure, Ink, Panel, Series};
use results::Column;

use crate::plots::Group;
use crate::samples::Samples;

/// Largest size of the picture in bytes.
const BYTES: usize = 300_000;
/// Largest number of plots in it.
const PANELS: usize = 6;
/// The colours of the curves, in their order.
const INKS: [Ink; 7] =
    [Ink::Blue, Ink::Vermilion, Ink::Green, Ink::Purple, Ink::Sky, Ink::Orange, Ink::Black];

/// Draws the first plots, as many as fit into [`BYTES`]; returns an empty text if none fits.
pub(crate) fn svg(title: &str, groups: &[(&Group, &Samples)], columns: &[Column]) -> String {
    let mut panels: Vec<_> =
        groups.iter().take(PANELS).map(|(group, samples)| panel(group, samples, columns)).collect();
    while !panels.is_empty() {
        let figure = Figure { title, panels };
        let svg = figure.svg().unwrap_or_default();
        if svg.len() <= BYTES {
            return svg;
        }
        panels = figure.panels;
        let count = panels.len() * BYTES / svg.len();
        panels.truncate(count.min(panels.len() - 1));
    }
    String::new()
}

fn panel<'a>(group: &'a Group, samples: &'a Samples, columns: &'a [Column]) -> Panel<'a> {
    let curves = group.members.iter().zip(&samples.columns).zip(INKS);
    let series = curves.map(|((at, values), ink)| Series {
        label: &columns[*at].name,
        time: &samples.time,
        values,
        ink,
        broad: false,
    });
    Panel {
        x_label: "time in s",
        y_label: &group.unit,
        series: series.collect(),
        ..Panel::default()
    }
}
