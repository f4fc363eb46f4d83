//! The figures of singular values over frequency and of responses over time.

use maud::{Markup, html};

use super::chart::{Chart, Size, legend, line_sample};
use super::number::{number, rounded};
use super::table::{Cell, table};
use crate::report::{Curve, Frequency, Report, StepResponse};
use figure::axis::Axis;

const FREQUENCY_SIZE: Size = Size { width: 480.0, height: 310.0 };
const RESPONSE_SIZE: Size = Size { width: 400.0, height: 220.0 };
/// Singular values below this fraction of the largest one are rounding errors.
const SMALLEST: f64 = 1e-16;
/// Number of line styles; further curves repeat them.
const STYLES: usize = 6;

/// Shows the singular values on logarithmic axes.
pub(super) fn frequencies(report: &Report) -> Markup {
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
                (frequency(&format!("frequency-{}", index + 1), response, limit))
            }
        }
    }
}

pub(super) fn frequency(id: &str, response: &Frequency, limit: Option<f64>) -> Markup {
    let xs = &response.frequencies;
    let values = || response.singular_values.iter().flatten().copied();
    let largest = values().fold(0.0, f64::max);
    let least = values().filter(|value| *value > SMALLEST * largest).fold(largest, f64::min);
    let range = ((least / 1.6).min(largest / 20.0), 1.6 * largest);
    let description = describe(response);
    let chart = Chart {
        id,
        title: &response.name,
        description: &description,
        size: FREQUENCY_SIZE,
        x: Axis::logarithmic(positive_ends(xs), FREQUENCY_SIZE.horizontal(), 9),
        y: Axis::logarithmic(range, FREQUENCY_SIZE.vertical(), 9),
        x_label: "frequency in rad/s",
        y_label: "singular value",
    };
    let class = |index: usize| format!("line-{}", index % STYLES + 1);
    let entry = |index: usize| {
        let ordinal = if index == 0 { "largest".to_owned() } else { format!("no. {}", index + 1) };
        (line_sample(&format!("curve {}", class(index))), format!("{ordinal} singular value"))
    };
    let mut entries: Vec<_> = (0..response.singular_values.len()).map(entry).collect();
    let limit = limit.filter(|limit| chart.x.contains(*limit));
    entries.extend(limit.map(|_| (line_sample("mark"), "π/T".to_owned())));
    html! {
        figure {
            figcaption { (response.name) }
            (chart.draw(&html! {
                @if let Some(limit) = limit { (chart.upright(limit, "mark")) }
                @for (index, values) in response.singular_values.iter().enumerate() {
                    (chart.curve(xs, values, &class(index)))
                }
            }))
            (legend(&entries))
            p.said { (description) }
        }
    }
}

/// Describes the largest singular value over frequency in words.
fn describe(response: &Frequency) -> String {
    let (frequencies, all) = (&response.frequencies, &response.singular_values);
    let values =
        all.first().map_or(&[][..], |values| &values[..values.len().min(frequencies.len())]);
    let Some(peak) = (0..values.len()).max_by(|a, b| values[*a].total_cmp(&values[*b])) else {
        return String::new();
    };
    let say = |k: usize| format!("{} at {} rad/s", rounded(values[k]), rounded(frequencies[k]));
    let last = values.len() - 1;
    let largest =
        if [0, last].contains(&peak) { String::new() } else { format!(", largest {}", say(peak)) };
    format!("From {} to {}{largest}.", say(0), say(last))
}

/// Shows the responses to a change of each fault on a logarithmic time axis.
pub(super) fn responses(report: &Report) -> Markup {
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
            (self::response(&format!("step-{}", index + 1), response))
        }
    }
}

fn response(id: &str, response: &StepResponse) -> Markup {
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
    let sized = |curve: &Curve| response.parts.len() == 1 && curve.unit == response.unit;
    if response.curves.iter().any(sized) {
        entries.push((line_sample("size"), "size of the change, in the same unit".to_owned()));
    }
    html! {
        h3 id=(id) { (title) }
        div.figures.small {
            @for (index, curve) in response.curves.iter().enumerate() {
                @let after = format!("a change of {}", response.fault);
                (self::curve(&format!("{id}-{}", index + 1), curve, &after, sized(curve).then_some(response.size)))
            }
        }
        (legend(&entries))
        (peaks(&caption, &response.curves))
    }
}

/// Shows peak and settling time of each curve in a table.
pub(super) fn peaks(caption: &str, curves: &[Curve]) -> Markup {
    let row = |curve: &Curve| {
        vec![
            curve.name.as_str().into(),
            (&curve.unit).into(),
            curve.peak.into(),
            curve.peak_time.into(),
            curve.settling_time.into(),
        ]
    };
    let rows: Vec<Vec<Cell>> = curves.iter().map(row).collect();
    let heads = ["signal", "unit", "largest magnitude", "at time (s)", "settled after (s)"];
    table(caption, &heads, &rows)
}

/// Shows a curve; `after`: what changed; `size`: the size of that change in the unit of the curve.
pub(super) fn curve(id: &str, curve: &Curve, after: &str, size: Option<f64>) -> Markup {
    let unit = curve.unit.as_deref().unwrap_or_default();
    let title = format!("{} after {after}", curve.name);
    let description = format!(
        "Largest magnitude {} {unit} at {} s, settled after {} s.",
        rounded(curve.peak),
        rounded(curve.peak_time),
        rounded(curve.settling_time)
    );
    let values = curve.values.iter().copied().filter(|value| value.is_finite());
    let chart = Chart {
        id,
        title: &title,
        description: &description,
        size: RESPONSE_SIZE,
        x: Axis::logarithmic(positive_ends(&curve.times), RESPONSE_SIZE.horizontal(), 7),
        y: Axis::around(values.chain([0.0]), None, RESPONSE_SIZE.vertical(), 5),
        x_label: "time in s",
        y_label: "",
    };
    html! {
        figure {
            figcaption {
                (curve.name)
                @if !unit.is_empty() { span.shape { " in " (unit) } }
            }
            (chart.draw(&html! {
                (chart.level(0.0, "zero"))
                @if let Some(size) = size { (chart.level(size, "size")) }
                (chart.upright(curve.settling_time, "mark"))
                (chart.curve(&curve.times, &curve.values, "line-1"))
            }))
        }
    }
}

/// Returns the smallest positive value and the largest value.
fn positive_ends(values: &[f64]) -> (f64, f64) {
    let positive = values.iter().copied().filter(|value| *value > 0.0);
    positive.fold((f64::INFINITY, 0.0), |(low, high), value| (value.min(low), value.max(high)))
}
