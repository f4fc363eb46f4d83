//! The figures of singular values over frequency and of responses over time.

use maud::{Markup, html};

use super::chart::{legend, line_sample};
use super::number::number;
use super::plots::{Line, Mark, Plot, Plots, Quantity};
use super::table::table_of;
use design_report::number::{rounded, settled};
use design_report::{Curve, Frequency, Report, StepResponse};

/// Shows the singular values on logarithmic axes.
pub(super) fn frequencies<'a>(report: &'a Report, plots: &mut Plots<'a>) -> Markup {
    let limit = report.sampling.as_ref();
    let limit = limit.map(|sampled| std::f64::consts::PI / sampled.sample_time);
    html! {
        p {
            "The gain from what is named first to what is named second, for sinusoids, by \
             frequency: the largest singular value is that of the worst direction."
            @if let Some(limit) = limit {
                " The sampled loop knows frequencies up to π/T = " (number(limit)) " rad/s."
            }
        }
        div.figures {
            @for (index, response) in report.frequency.iter().enumerate() {
                (frequency(format!("frequency-{}", index + 1), response, limit, plots))
            }
        }
    }
}

/// Shows singular values; `limit`: the largest frequency of a sampled loop, which is marked if the plot reaches it.
pub(super) fn frequency<'a>(
    id: String,
    response: &'a Frequency,
    limit: Option<f64>,
    plots: &mut Plots<'a>,
) -> Markup {
    let description = describe(response);
    let name = |index: usize| match index {
        0 => "largest".to_owned(),
        _ => format!("no. {}", index + 1),
    };
    let lines = response.singular_values.iter().enumerate();
    let limit =
        limit.filter(|limit| response.frequencies.iter().any(|frequency| frequency >= limit));
    let place = plots.add(Plot {
        id,
        quantity: Quantity::Frequency,
        logarithmic: true,
        label: "singular value",
        title: format!("{}, singular values. {description}", response.name),
        places: &response.frequencies,
        lines: lines.map(|(index, values)| Line { name: name(index), values }).collect(),
        marks: limit.map(Mark::At).into_iter().collect(),
    });
    html! {
        figure {
            figcaption { (response.name) }
            (place)
            @if limit.is_some() { (legend(&[(line_sample("mark"), "π/T".to_owned())])) }
            p.said { (description) }
        }
    }
}

/// Describes the largest singular value over frequency in words; empty without values.
fn describe(response: &Frequency) -> String {
    let (frequencies, all) = (&response.frequencies, &response.singular_values);
    let values =
        all.first().map_or(&[][..], |values| &values[..values.len().min(frequencies.len())]);
    let Some(peak) = (0..values.len()).max_by(|a, b| values[*a].total_cmp(&values[*b])) else {
        return String::new();
    };
    let at = |k: usize| format!("{} at {} rad/s", rounded(values[k]), rounded(frequencies[k]));
    let last = values.len() - 1;
    let largest =
        if [0, last].contains(&peak) { String::new() } else { format!(", largest {}", at(peak)) };
    format!("From {} to {}{largest}.", at(0), at(last))
}

/// Shows the responses to a change of each fault on a logarithmic time axis.
pub(super) fn responses<'a>(report: &'a Report, plots: &mut Plots<'a>) -> Markup {
    html! {
        p {
            "The fault changes at time 0 by the size stated and then stays; the loop was at rest. \
             States and commands are deviations from the operating point; the command of a sampled \
             controller is constant between samples. \
             The time axes show decades, so that the fast part of the observer and the slow part \
             of the feedback loop both have room. Each curve has its own scale. Where a fault turns \
             round again and again, as dry friction does, the largest magnitude of a state predicts \
             the amplitude (half of peak to peak) of the motion that is left."
        }
        @for (index, response) in report.steps.iter().enumerate() {
            (self::response(&format!("step-{}", index + 1), response, plots))
        }
    }
}

fn response<'a>(id: &str, response: &'a StepResponse, plots: &mut Plots<'a>) -> Markup {
    let unit = response.unit.as_deref().unwrap_or_default();
    let title = html! {
        @if response.parts.len() > 1 {
            "All faults together: "
            @for (index, part) in response.parts.iter().enumerate() {
                @if index > 0 { ", " }
                (part.name) " by " (number(part.value)) " " (part.unit.as_deref().unwrap_or_default())
            }
            " at once"
        } @else {
            "A change of " (response.fault) " by " (number(response.size)) " " (unit) " "
            @match response.rate {
                None => "at once",
                Some(rate) => { "at " (number(rate)) " " (unit) " per s" }
            }
        }
    };
    let caption = format!("Peaks and settling after a change of {}", response.fault);
    let mut entries = vec![(line_sample("mark"), "settled, within 2 %".to_owned())];
    // Signals whose units are not stated may have different ones.
    let has_unit_of_change = |curve: &Curve| {
        response.parts.len() == 1 && response.unit.is_some() && curve.unit == response.unit
    };
    if response.curves.iter().any(has_unit_of_change) {
        entries.push((line_sample("size"), "size of the change, in the same unit".to_owned()));
    }
    html! {
        h3 id=(id) { (title) }
        div.figures.small {
            @for (index, curve) in response.curves.iter().enumerate() {
                @let after = format!("a change of {}", response.fault);
                @let size = has_unit_of_change(curve).then_some(response.size);
                (self::curve(format!("{id}-{}", index + 1), curve, &after, size, plots))
            }
        }
        (legend(&entries))
        (peaks(&caption, &response.curves))
    }
}

/// Shows peak and settling time of each curve in a table.
pub(super) fn peaks(caption: &str, curves: &[Curve]) -> Markup {
    table_of(
        caption,
        curves,
        &[
            ("signal", |curve| (&curve.name).into()),
            ("unit", |curve| (&curve.unit).into()),
            ("largest magnitude", |curve| curve.peak.into()),
            ("at time (s)", |curve| curve.peak_time.into()),
            ("settled after (s)", |curve| curve.settling_time.into()),
        ],
    )
}

/// Shows a curve; `after`: what changed; `size`: the size of this change in the unit of the curve.
pub(super) fn curve<'a>(
    id: String,
    curve: &'a Curve,
    after: &str,
    size: Option<f64>,
    plots: &mut Plots<'a>,
) -> Markup {
    let unit = curve.unit.as_deref().unwrap_or_default();
    let name =
        if unit.is_empty() { curve.name.clone() } else { format!("{} in {unit}", curve.name) };
    let title = format!(
        "{} after {after}. Largest magnitude {} {unit} at {} s, {}.",
        curve.name,
        rounded(curve.peak),
        rounded(curve.peak_time),
        settled(curve.settling_time, rounded)
    );
    let settling = Some(curve.settling_time).filter(|time| time.is_finite()).map(Mark::At);
    let place = plots.add(Plot {
        id,
        quantity: Quantity::Time,
        logarithmic: false,
        label: "",
        title,
        places: &curve.times,
        lines: vec![Line { name, values: &curve.values }],
        marks: size.map(Mark::Size).into_iter().chain(settling).collect(),
    });
    html! {
        figure {
            figcaption {
                (curve.name)
                @if !unit.is_empty() { span.shape { " in " (unit) } }
            }
            (place)
        }
    }
}
