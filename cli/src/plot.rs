//! `--plot`: draws variables of a results file over time, as SVG or PNG.

use std::path::Path;

use anyhow::ensure;
use results::{ColumnKind, Selection, Table};

use figure::{Figure, INKS, Ink, Panel, Series, rasterise, stairs};

use crate::outputs;

/// Largest number of curves in a picture.
const CURVES: usize = 64;

/// A variable with the points of its curve.
struct Curve {
    label: String,
    unit: Option<String>,
    time: Vec<f64>,
    values: Vec<f64>,
}

/// Draws variables of a results file, selected by name or pattern, over time: one panel for up to seven
/// variables with the same unit. The extension of `out`, `.svg` or `.png`, selects the format. The memory
/// used does not depend on the length of the file. `units` has units by variable for files without units, such as CSV.
///
/// # Errors
///
/// Returns an error for any other extension, if a name is not in the file, if a variable selected by name is a text, if
/// no variable or more than [`CURVES`] are selected, or if a file cannot be read or written.
pub(crate) fn plot_with_units(
    results: &Path,
    variables: &[String],
    units: &[(String, String)],
    out: &Path,
) -> anyhow::Result<()> {
    let is_png = is_png(out)?;
    let curves = curves(results, variables, units)?;
    let title = results.file_name().unwrap_or_default().to_string_lossy();
    let svg = Figure { title: &title, panels: panels(&curves) }.svg()?;
    outputs::write(out, &if is_png { rasterise(&svg)? } else { svg.into_bytes() })
}

/// Returns true for the extension `.png`, false for `.svg`, and an error for any other.
pub(crate) fn is_png(picture: &Path) -> anyhow::Result<bool> {
    let ending = picture.extension().unwrap_or_default().to_ascii_lowercase();
    let shown = picture.display();
    ensure!(ending == "svg" || ending == "png", "{shown}: a plot is a .svg or a .png");
    Ok(ending == "png")
}

/// Checks that a picture can have this number of curves.
pub(crate) fn check_count(count: usize) -> anyhow::Result<()> {
    ensure!(count > 0, "no variable to plot: expected a number, found texts only");
    ensure!(count <= CURVES, "{count} variables to plot, expected at most {CURVES}: choose fewer");
    Ok(())
}

/// Reads the curves of the selected variables.
fn curves(
    results: &Path,
    variables: &[String],
    units: &[(String, String)],
) -> anyhow::Result<Vec<Curve>> {
    let table = Table::open(results)?;
    let selection = Selection { include: variables.to_vec(), exclude: Vec::new() };
    let mut positions = table.choose(&selection)?;
    // A pattern selects only variables that can be drawn, a name selects any variable.
    positions.retain(|position| {
        let column = &table.columns()[*position];
        let drawable = *position != table.time() && column.kind != ColumnKind::String;
        drawable || variables.contains(&column.name)
    });
    check_count(positions.len())?;
    let envelopes = table.envelopes(&positions)?;
    let curve = |(position, envelope): (usize, results::Envelope)| {
        let column = &table.columns()[position];
        let (time, values) = envelope.samples();
        let (time, values) = if column.is_held() { stairs(&time, &values) } else { (time, values) };
        let stated = || units.iter().find(|(name, _)| *name == column.name);
        let unit = column.unit.clone().or_else(|| Some(stated()?.1.clone()));
        let label = unit
            .as_ref()
            .map_or_else(|| column.name.clone(), |unit| format!("{} in {unit}", column.name));
        Curve { label, unit, time, values }
    };
    Ok(positions.into_iter().zip(envelopes).map(curve).collect())
}

/// Groups curves by unit into panels with at most as many curves as there are colours.
fn panels(curves: &[Curve]) -> Vec<Panel<'_>> {
    let mut groups: Vec<Vec<&Curve>> = Vec::new();
    for curve in curves {
        let same =
            |group: &&mut Vec<&Curve>| group[0].unit == curve.unit && group.len() < INKS.len();
        match groups.iter_mut().find(same) {
            Some(group) => group.push(curve),
            None => groups.push(vec![curve]),
        }
    }
    let count = groups.len();
    let frame_height = match count {
        1 => Some(420.0),
        2 => Some(260.0),
        _ => None,
    };
    let numbered = groups.into_iter().enumerate();
    let panels = numbered.map(|(place, group)| Panel {
        x_label: if place + 1 == count { "time in s" } else { "" },
        y_label: group[0].unit.as_deref().unwrap_or_default(),
        frame_height,
        series: group.into_iter().zip(INKS).map(|(curve, ink)| series(curve, ink)).collect(),
        ..Panel::default()
    });
    panels.collect()
}

fn series(curve: &Curve, ink: Ink) -> Series<'_> {
    Series { label: &curve.label, time: &curve.time, values: &curve.values, ink, broad: false }
}

#[cfg(test)]
mod tests;
