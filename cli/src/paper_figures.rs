//! Draws Figures 5 and 6 of Patton and Klinkhieo (2009) from the columns of a run.

use std::path::Path;

use anyhow::{Context as _, ensure};
use figure::{Figure, Ink, Panel, Series};

/// Length in s of the transient after the start of the compensation.
const SETTLING: f64 = 20.0;
/// Length in s of the close-up in Figure 6 that shows single stick-slip transitions.
const CLOSE_UP: f64 = 6.0;
/// Limits up to which a diverging run is drawn: cart position in m, angle in rad, and force as a
/// multiple of the largest friction.
const FARTHEST: f64 = 5.0;
const STEEPEST: f64 = 6.3;
const STRONGEST: f64 = 4.0;

/// The columns used by the figures.
pub(crate) const COLUMNS: [&str; 5] =
    ["time", "plant.x_p", "plant.theta", "plant.f_fric", "controller.f_hat"];

/// Writes `figure5.svg`, `figure5.png`, `figure6.svg` and `figure6.png` into the folder `out`.
///
/// `columns` returns the values of a column: `time` in s, `plant.x_p` in m, `plant.theta` in rad, `plant.f_fric` and
/// `controller.f_hat` in N. `activation` is the time in s at which the compensation starts. A run that ends before
/// `activation`, or that diverges, is drawn as far as possible. Returns an error if a column is missing or has the
/// wrong length, or if a file cannot be written.
pub(crate) fn write<'a>(
    columns: &dyn Fn(&str) -> Option<&'a [f64]>,
    activation: f64,
    out: &Path,
) -> anyhow::Result<()> {
    let run = Run::new(columns, activation)?;
    run.motion().write(&out.join("figure5"))?;
    run.friction().write(&out.join("figure6"))?;
    Ok(())
}

/// The columns of a run, of equal length, and quantities derived from them.
struct Run<'a> {
    time: &'a [f64],
    x_p: &'a [f64],
    theta: &'a [f64],
    f_fric: &'a [f64],
    f_hat: &'a [f64],
    millimetres: Vec<f64>,
    milliradians: Vec<f64>,
    difference: Vec<f64>,
    /// Time in s at which the compensation starts, and the text of the mark at this time.
    activation: f64,
    activation_text: String,
}

impl<'a> Run<'a> {
    fn new(columns: &dyn Fn(&str) -> Option<&'a [f64]>, activation: f64) -> anyhow::Result<Self> {
        let any = |name: &str| {
            let missing = || format!("the results have no column {name:?}, which the figures need");
            columns(name).with_context(missing)
        };
        let time = any("time")?;
        let column = |name: &str| {
            let values = any(name)?;
            let (expected, actual) = (time.len(), values.len());
            ensure!(
                expected == actual,
                "column {name:?} has {actual} values, column \"time\" has {expected}"
            );
            anyhow::Ok(values)
        };
        let (x_p, theta) = (column("plant.x_p")?, column("plant.theta")?);
        let (f_fric, f_hat) = (column("plant.f_fric")?, column("controller.f_hat")?);
        Ok(Self {
            time,
            x_p,
            theta,
            f_fric,
            f_hat,
            millimetres: x_p.iter().map(|position| 1000.0 * position).collect(),
            milliradians: theta.iter().map(|angle| 1000.0 * angle).collect(),
            difference: f_fric.iter().zip(f_hat).map(|(force, guess)| force - guess).collect(),
            activation,
            activation_text: format!("compensation starts, t_on = {activation} s"),
        })
    }

    /// Draws Figure 5: cart position and pendulum angle, and close-ups of their settled part, if there is one.
    fn motion(&self) -> Figure<'_> {
        let panel = |y_label, y_cap, curve| Panel {
            y_label,
            y_cap: Some(y_cap),
            series: vec![curve],
            marks: vec![(self.activation, &self.activation_text)],
            ..Panel::default()
        };
        let position = |values| self.curve("x_p, cart position", values, Ink::Blue);
        let angle = |values| self.curve("theta, pendulum angle", values, Ink::Vermilion);
        let mut panels = vec![
            panel("x_p in m", FARTHEST, position(self.x_p)),
            panel("theta in rad", STEEPEST, angle(self.theta)),
        ];
        if let Some(range) = self.settled() {
            panels.push(Panel {
                x_range: Some(range),
                limit: Some((1.0, "claim: within ±1 mm")),
                ..panel("x_p in mm", 1000.0 * FARTHEST, position(&self.millimetres))
            });
            panels.push(Panel {
                x_range: Some(range),
                limit: Some((2.0, "claim: within ±2 mrad")),
                ..panel("theta in mrad", 1000.0 * STEEPEST, angle(&self.milliradians))
            });
        }
        name_time_axes(&mut panels);
        Figure { title: "Cart position and pendulum angle, before and after compensation", panels }
    }

    /// Draws Figure 6: friction and its estimate, and their difference, from a close-up of the settled part, if there
    /// is one.
    fn friction(&self) -> Figure<'_> {
        let strongest = self.f_fric.iter().filter(|force| force.is_finite());
        let cap = STRONGEST * strongest.fold(1.0, |most: f64, force| most.max(force.abs()));
        let forces = |x_range| Panel {
            y_label: "force in N",
            x_range,
            y_cap: Some(cap),
            series: vec![
                Series { broad: true, ..self.curve("f_fric", self.f_fric, Ink::Sky) },
                self.curve("f_hat", self.f_hat, Ink::Vermilion),
            ],
            marks: vec![(self.activation, &self.activation_text)],
            ..Panel::default()
        };
        let close_up = self.settled().map(|(start, end)| (start, end.min(start + CLOSE_UP)));
        let mut panels = vec![forces(None)];
        panels.extend(close_up.map(|range| forces(Some(range))));
        panels.push(Panel {
            y_label: "difference in N",
            series: vec![self.curve("f_fric − f_hat", &self.difference, Ink::Green)],
            ..forces(close_up)
        });
        name_time_axes(&mut panels);
        Figure { title: "Friction force f_fric and its estimate f_hat", panels }
    }

    fn curve<'b>(&'b self, label: &'b str, values: &'b [f64], ink: Ink) -> Series<'b> {
        Series { label, time: self.time, values, ink, broad: false }
    }

    /// Returns the settled part of the run: from the end of the transient, but at most halfway
    /// through the time after the activation, to the end. `None` if the run ends before the
    /// activation or diverges in this part.
    fn settled(&self) -> Option<(f64, f64)> {
        let motion = || self.time.iter().zip(self.x_p.iter().zip(self.theta));
        let known = motion().filter(|(t, (x, a))| t.is_finite() && x.is_finite() && a.is_finite());
        let end = known.map(|(time, _)| *time).fold(f64::NEG_INFINITY, f64::max);
        let start = self.activation + SETTLING.min(0.5 * (end - self.activation));
        let lost = motion().any(|(time, (position, angle))| {
            (start..=end).contains(time) && (position.abs() > FARTHEST || angle.abs() > STEEPEST)
        });
        (start > self.activation && end > start && !lost).then_some((start, end))
    }
}

/// Labels the time axis of the last of consecutive panels with the same time range.
fn name_time_axes(panels: &mut [Panel]) {
    for index in 0..panels.len() {
        let next = panels.get(index + 1).map(|panel| panel.x_range);
        if next != Some(panels[index].x_range) {
            panels[index].x_label = "time in s";
        }
    }
}

#[cfg(test)]
mod tests;
