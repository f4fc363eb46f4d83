//! Pole maps.

use maud::{Markup, html};

use super::chart::{Chart, HORIZONTAL, VERTICAL, legend, line_sample, tenth};
use super::number::{complex, exact};
use super::plane::Plane;
use super::region::boundary;
use design_report::Region;
use figure::axis::Axis;

/// Width and height of the frame.
const WIDE: f64 = HORIZONTAL.1 - HORIZONTAL.0;
const TALL: f64 = VERTICAL.0 - VERTICAL.1;
/// Ratio of the largest to the smallest eigenvalue above which the axes are logarithmic.
const LINEAR_UP_TO: f64 = 30.0;

/// The marker of a group of eigenvalues.
#[derive(Clone, Copy)]
pub(super) enum Sign {
    Cross,
    Ring,
    Diamond,
    Square,
}

impl Sign {
    fn at(self, x: f64, y: f64) -> Markup {
        let path = match self {
            Self::Cross => "m-5 -5 10 10m0 -10-10 10",
            Self::Ring => "m-7 0a7 7 0 1 0 14 0a7 7 0 1 0-14 0",
            Self::Diamond => "m0 -6.5 6.5 6.5-6.5 6.5-6.5-6.5z",
            Self::Square => "m-5 -5h10v10h-10z",
        };
        html! { path.(self.class()) d={ "M" (tenth(x)) " " (tenth(y)) (path) } {} }
    }

    fn class(self) -> &'static str {
        match self {
            Self::Cross => "sign ink-2",
            Self::Ring => "sign ink-1",
            Self::Diamond => "sign ink-3",
            Self::Square => "sign ink-4",
        }
    }
}

/// Eigenvalues with a common marker.
pub(super) struct Group {
    pub(super) name: &'static str,
    pub(super) sign: Sign,
    pub(super) poles: Vec<[f64; 2]>,
}

/// A map of groups of eigenvalues in a plane, with the boundary of a required region.
pub(super) struct Map<'a> {
    pub(super) id: &'a str,
    pub(super) title: &'a str,
    pub(super) plane: Plane,
    pub(super) groups: &'a [Group],
    pub(super) region: Option<&'a Region>,
}

impl Map<'_> {
    pub(super) fn figure(&self) -> Markup {
        let (x, y) = match self.plane {
            Plane::Continuous => self.continuous_view(),
            Plane::Sampled(_) => self.sampled_view(),
        };
        self.draw(x, y)
    }

    fn poles(&self) -> impl Iterator<Item = &[f64; 2]> + Clone {
        self.groups.iter().flat_map(|group| &group.poles)
    }

    /// Returns axes that contain the unit circle and all eigenvalues.
    fn sampled_view(&self) -> (Axis, Axis) {
        let reach = self.poles().flatten().fold(1.0, |most: f64, part| most.max(part.abs()));
        let (x, y) = (1.12 * reach * WIDE / TALL, 1.12 * reach);
        (Axis::exact(-x, x, HORIZONTAL, 5), Axis::exact(-y, y, VERTICAL, 5))
    }

    /// Returns axes of the s-plane: both with the same linear scale, or both logarithmic.
    fn continuous_view(&self) -> (Axis, Axis) {
        let sizes = self.poles().map(|pole| pole[0].hypot(pole[1]));
        let largest = sizes.clone().fold(0.0, f64::max);
        let least = sizes.filter(|size| *size > 1e-9 * largest).fold(largest, f64::min);
        let (mut left, mut right) = ends(self.poles().map(|pole| pole[0]).chain([0.0]));
        let (low, high) = ends(self.poles().map(|pole| pole[1]).chain([0.0]));
        if largest > LINEAR_UP_TO * least {
            let knee = 10_f64.powf(least.log10().floor());
            let beyond = |end: f64| 2.0 * end.abs().max(knee);
            let (x, y) = ((-beyond(left), beyond(right)), (-beyond(low), beyond(high)));
            return (
                Axis::symmetric(x, knee, HORIZONTAL, 9),
                Axis::symmetric(y, knee, VERTICAL, 9),
            );
        }
        if let Some(region) = self.region {
            let disc = region.disc_center.zip(region.disc_radius).unwrap_or_default();
            let marks = [disc.0 - disc.1, disc.0 + disc.1, -region.decay.unwrap_or(0.0)];
            (left, right) = ends(marks.into_iter().chain([left, right]));
        }
        let pixel = (1.24 * (right - left) / WIDE).max(2.4 * high.max(-low) / TALL);
        let (center, reach) = (f64::midpoint(left, right), 0.5 * pixel * WIDE);
        (
            Axis::exact(center - reach, center + reach, HORIZONTAL, 6),
            Axis::exact(-0.5 * pixel * TALL, 0.5 * pixel * TALL, VERTICAL, 6),
        )
    }

    fn draw(&self, x: Axis, y: Axis) -> Markup {
        let (id, title) = (self.id, self.title);
        let (x_label, y_label) = match self.plane {
            Plane::Continuous => ("real part in 1/s", "imaginary part in 1/s"),
            Plane::Sampled(_) => ("real part of z", "imaginary part of z"),
        };
        let sentence = |group: &Group| {
            let poles: Vec<_> = group
                .poles
                .iter()
                .map(|pole| complex(*pole, design_report::number::rounded))
                .collect();
            format!("{}: {}", group.name, poles.join(", "))
        };
        let description = self.groups.iter().map(sentence).collect::<Vec<_>>().join("; ");
        let chart = Chart { id, title, description: &description, x, y, x_label, y_label };
        html! {
            figure {
                figcaption { (title) }
                (chart.draw(&html! {
                    (self.stability(&chart))
                    @if let Some(region) = self.region {
                        @for part in boundary(region, self.plane) {
                            (chart.outline(&part, "region"))
                        }
                    }
                    @for group in self.groups {
                        @for pole in &group.poles {
                            g {
                                title { (group.name) " " (complex(*pole, exact)) }
                                (group.sign.at(chart.x.place(pole[0]), chart.y.place(pole[1])))
                            }
                        }
                    }
                }))
                (self.legend())
            }
        }
    }

    /// Draws the unstable part of the plane and its boundary.
    fn stability(&self, chart: &Chart<'_>) -> Markup {
        let ((left, right), (bottom, top)) = (chart.x.pixels(), chart.y.pixels());
        match self.plane {
            Plane::Continuous => html! {
                rect.unstable x=(tenth(chart.x.place(0.0))) y=(top) height=(bottom - top)
                    width=(tenth((right - chart.x.place(0.0)).max(0.0))) {}
                (chart.upright(0.0, "boundary"))
                (chart.level(0.0, "zero"))
            },
            Plane::Sampled(_) => {
                let (low, high) = chart.x.range();
                let radius = (right - left) / (high - low);
                let (below, above) = chart.y.range();
                let center =
                    (left - low * radius, bottom + below * (bottom - top) / (above - below));
                html! {
                    path.unstable fill-rule="evenodd" d={
                        "M" (left) " " (top) "H" (right) "V" (bottom) "H" (left) "z"
                        "M" (tenth(center.0 - radius)) " " (tenth(center.1))
                        @for way in ["", "-"] {
                            "a" (tenth(radius)) " " (tenth(radius)) " 0 1 0 " (way)
                            (tenth(2.0 * radius)) " 0"
                        }
                    } {}
                    circle.boundary cx=(tenth(center.0)) cy=(tenth(center.1)) r=(tenth(radius)) {}
                    (chart.level(0.0, "zero"))
                }
            }
        }
    }

    fn legend(&self) -> Markup {
        let mut entries: Vec<_> = self
            .groups
            .iter()
            .map(|group| (group.sign.at(15.0, 9.0), group.name.to_owned()))
            .collect();
        if self.region.is_some() {
            entries.push((line_sample("region"), "boundary of the required region".to_owned()));
        }
        let edge = match self.plane {
            Plane::Continuous => "edge of stability",
            Plane::Sampled(_) => "edge of stability, |z| = 1",
        };
        entries.push((line_sample("boundary"), edge.to_owned()));
        legend(&entries)
    }
}

/// The smallest and the largest value.
fn ends(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    })
}
