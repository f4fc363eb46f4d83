//! The first plots as one picture, for a reader without JavaScript.

use std::borrow::Cow;

use figure::{Figure, INKS, Panel, Series, stairs};
use results::Column;

use crate::plots::Group;
use crate::samples::Samples;

/// Largest size of the picture in bytes.
const BYTES: usize = 300_000;
/// Largest number of plots in the picture.
const PANELS: usize = 6;

/// Draws the first plots, as many as fit into [`BYTES`]; returns an empty text if none fits.
pub(crate) fn svg(title: &str, groups: &[(&Group, &Samples)], columns: &[Column]) -> String {
    let groups = groups.iter().take(PANELS);
    let groups = groups.map(|(group, samples)| (&group.unit, curves(group, samples, columns)));
    let groups: Vec<_> = groups.collect();
    let mut panels: Vec<_> = groups.iter().map(|(unit, curves)| panel(unit, curves)).collect();
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

/// A variable with the points of its curve.
struct Curve<'a> {
    label: &'a str,
    time: Cow<'a, [f64]>,
    values: Cow<'a, [f64]>,
}

impl<'a> Curve<'a> {
    /// Creates a curve of `values` at the times `time`: stairs for a variable that keeps its value between two rows.
    fn new(column: &'a Column, time: &'a [f64], values: &'a [f64]) -> Self {
        let (time, values) = if column.is_held() {
            let (time, values) = stairs(time, values);
            (Cow::Owned(time), Cow::Owned(values))
        } else {
            (Cow::Borrowed(time), Cow::Borrowed(values))
        };
        Self { label: &column.name, time, values }
    }
}

fn curves<'a>(group: &Group, samples: &'a Samples, columns: &'a [Column]) -> Vec<Curve<'a>> {
    let members = group.members.iter().zip(&samples.columns);
    members.map(|(at, values)| Curve::new(&columns[*at], &samples.time, values)).collect()
}

fn panel<'a>(unit: &'a str, curves: &'a [Curve<'_>]) -> Panel<'a> {
    let series = curves.iter().zip(INKS).map(|(curve, ink)| Series {
        label: curve.label,
        time: &curve.time,
        values: &curve.values,
        ink,
        broad: false,
    });
    Panel { x_label: "time in s", y_label: unit, series: series.collect(), ..Panel::default() }
}

#[cfg(test)]
mod tests {
    use results::ColumnKind;

    use super::*;

    #[test]
    fn a_value_that_is_held_between_two_rows_is_drawn_as_stairs() {
        let rows = [[0.0, 10.0, 20.0], [0.0, 1.0, 0.0]];
        for (kind, time, values) in [
            (ColumnKind::Real, &rows[0][..], &rows[1][..]),
            (
                ColumnKind::Boolean,
                &[0.0, 10.0, 10.0, 20.0, 20.0, 20.0][..],
                &[0.0, 0.0, 1.0, 1.0, 0.0, 0.0][..],
            ),
        ] {
            let column = Column { name: "x".to_owned(), kind, unit: None, clocked: false };
            let curve = Curve::new(&column, &rows[0], &rows[1]);
            assert_eq!((&*curve.time, &*curve.values), (time, values), "{kind:?}");
        }
    }
}
