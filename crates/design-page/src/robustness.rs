//! The section on robustness: margins, noise, comparison, tolerances, S and T.

use maud::{Markup, html};

use super::curves::frequency;
use super::matrix::matrices;
use super::number::{number, seconds};
use super::plots::Plots;
use super::table::{Cell, Columns, table, table_of, with_unit};
use design_report::robustness::{
    Compared, Disk, Number, Parameter, PeakSensitivity, Robustness, ToleranceProof, ToleranceResult,
};
use design_report::{Matrix, Report};

/// Largest number of plant entries in the table of the sensitivities.
const SHOWN: usize = 12;

/// Shows the peaks of S and the stability with exact delays; empty for a plant without delays.
fn delays(robustness: &Robustness) -> Markup {
    let Some(delays) = &robustness.delays else { return Markup::default() };
    let [at_commands, at_measurements] = delays.s_peaks;
    html! {
        p {
            "The figures are those of a plant whose delays have " (number(delays.judged_order.into()))
            " states each; the observer has " (number(delays.observer_order.into()))
            ". With the delays themselves, at " (number(delays.frequencies.into()))
            " frequencies, the peak of S is " (number(at_commands)) " at the commands and "
            (number(at_measurements)) " at the measurements. "
            @if delays.difference < 1.0 {
                "The loop is stable with them"
            } @else {
                "Whether the loop is stable with them is not shown"
            }
            ": the difference is " (number(delays.difference)) " of what stability allows, at "
            (number(delays.frequency)) " rad/s."
        }
    }
}

pub(super) fn robustness<'a>(
    report: &Report,
    robustness: &'a Robustness,
    plots: &mut Plots<'a>,
) -> Markup {
    let limit = report.sampling.as_ref();
    let limit = limit.map(|sampled| std::f64::consts::PI / sampled.sample_time);
    html! {
        p {
            "S is the sensitivity of the loop, T = I − S. Where the channels have different units, \
             the peak of S in the units that make it least is judged. The table "
            code { "[robustness]" } " of the plant file changes tolerances, noise and limits."
        }
        (peaks(robustness))
        (channels(robustness))
        (disks(robustness))
        p {
            "Delay margin of all commands together"
            @if robustness.delays.is_some() { ", beyond their delays" }
            ": " (seconds(robustness.delay_margin)) ". "
            @if report.plant.sample_time.is_some() {
                "This is in whole samples."
            } @else if robustness.longest_hold.is_infinite() {
                "No time over which the signals between plant and controller are held made the loop unstable, up to "
                @if report.sampling.is_some() { "1000 sample times." }
                @else { "100 times its longest time constant." }
            } @else if report.sampling.is_some() {
                "With the same matrices of the controller the loop is stable up to a sample time of "
                (number(robustness.longest_hold)) " s."
            } @else {
                "Plant and controller may hold the signals that they exchange for up to "
                (number(robustness.longest_hold)) " s: a longer communication step without extrapolation, \
                 or a longer sample time of the discretised controller, makes the loop unstable."
            }
        }
        (delays(robustness))
        h3 id="s-and-t" { "S and T" }
        div.figures {
            @for (index, curve) in robustness.curves.iter().enumerate() {
                (frequency(format!("sensitivity-{}", index + 1), curve, limit, plots))
            }
        }
        h3 id="noise" { "Measurement noise" }
        (noise(report, robustness))
        h3 id="comparison" { "Comparison" }
        (comparison(robustness))
        h3 id="parameters" { "Sensitivity to the parameters" }
        (parameters(report, robustness))
        h3 id="tolerances" { "Tolerances of the parameters" }
        (tolerances(report, &robustness.tolerance))
        (proof(&robustness.tolerance, &robustness.tolerance_proof))
    }
}

const DISK: [&str; 6] =
    ["disk margin α", "certified α", "at rad/s", "gain from", "gain to", "phase (degrees)"];

fn disk_cells(name: &str, disk: &Disk) -> Vec<Cell> {
    let Disk { alpha, certified, frequency, gain: [low, high], phase } = *disk;
    let numbers = [alpha, certified, frequency, low, high, phase];
    std::iter::once(name.into()).chain(numbers.map(Cell::from)).collect()
}

fn disks(robustness: &Robustness) -> Markup {
    let mut rows = Vec::new();
    for point in &robustness.points {
        rows.push(disk_cells(&format!("all at the {}", point.point), &point.together));
        rows.extend(point.channels.iter().map(|channel| disk_cells(&channel.name, &channel.disk)));
    }
    let heads = std::iter::once("channel").chain(DISK);
    html! {
        p {
            "Each factor of the disk (1 + δα/2) / (1 − δα/2), |δ| < 1, may multiply a channel: gain \
             and phase change together. For all channels the factors are independent of each other."
        }
        (table("Disk margins", heads, &rows))
    }
}

fn peaks(robustness: &Robustness) -> Markup {
    table_of(
        "Peaks of the largest singular value",
        &robustness.points,
        &[
            ("loop opened", |point| (&format!("at the {}", point.point)).into()),
            ("peak of S", |point| point.s_peak.into()),
            ("at rad/s", |point| point.s_frequency.into()),
            ("peak of S in the best units", |point| point.s_peak_scaled.into()),
            ("peak of T", |point| point.t_peak.into()),
            ("at rad/s", |point| point.t_frequency.into()),
            ("judged", |point| point.judged.into()),
            ("at rad/s", |point| point.judged_frequency.into()),
        ],
    )
}

fn channels(robustness: &Robustness) -> Markup {
    table_of(
        "One channel changes, the others are exact",
        robustness.points.iter().flat_map(|point| &point.channels),
        &[
            ("channel", |channel| (&channel.name).into()),
            ("gain from", |channel| channel.gain[0].into()),
            ("gain to", |channel| channel.gain[1].into()),
            ("phase margin (degrees)", |channel| channel.phase.into()),
            ("delay margin (s)", |channel| channel.delay.into()),
        ],
    )
}

fn noise(report: &Report, robustness: &Robustness) -> Markup {
    let columns: Columns<'_, Number, 3> = [
        ("signal", |one| (&one.name).into()),
        ("unit", |one| (&one.unit).into()),
        ("root mean square", |one| one.value.into()),
    ];
    let assumed = robustness.noise.columns.iter().zip(&robustness.noise_of_measurements);
    let assumed: Vec<Vec<Cell>> =
        assumed.map(|(name, noise)| vec![name.into(), (*noise).into()]).collect();
    html! {
        p {
            "Root-mean-square values under independent white noise of the measurements. "
            @if report.sampling.is_some() {
                "The noise of a measurement is stated as the standard deviation of a sample."
            } @else {
                "The noise of a measurement is stated as the root of its spectral density: its unit \
                 times √s."
            }
        }
        (table("Assumed noise", ["measurement", "noise"], &assumed))
        (table_of("Under all noises", &robustness.noise_together, &columns))
        (matrices("noise-each", std::slice::from_ref(&robustness.noise)))
    }
}

fn comparison(robustness: &Robustness) -> Markup {
    let columns: Columns<'_, Compared, 3> = [
        ("quantity", |one| (&one.name).into()),
        ("this design", |one| one.design.into()),
        ("linear-quadratic", |one| one.linear_quadratic.into()),
    ];
    html! {
        p {
            "The linear-quadratic regulator and the Kalman filter whose eigenvalues have the same sum \
             of decay rates show what the required speed costs at least: a design that is many times \
             larger has eigenvalues that the plant resists."
        }
        (table_of("Norms and peaks", &robustness.comparison, &columns))
    }
}

/// Shows the entries of the plant with the largest effect on the peaks of S, at most [`SHOWN`].
fn parameters(report: &Report, robustness: &Robustness) -> Markup {
    let entries = |sensitivity: &PeakSensitivity| -> Vec<(String, f64)> {
        let named = |matrix: &Matrix| -> Vec<(String, f64)> {
            let at = |(i, row): (usize, &Vec<f64>)| -> Vec<(String, f64)> {
                let name = |j: usize| format!("{}[{}, {}]", matrix.name, i + 1, j + 1);
                row.iter().enumerate().map(|(j, value)| (name(j), *value)).collect()
            };
            matrix.values.iter().enumerate().flat_map(at).collect()
        };
        sensitivity.matrices.iter().flat_map(named).collect()
    };
    let all: Vec<_> = robustness.sensitivity.iter().map(entries).collect();
    let Some(first) = all.first() else { return html! {} };
    let size = |at: usize| all.iter().map(|entries| entries[at].1.abs()).fold(0.0, f64::max);
    let mut order: Vec<usize> = (0..first.len()).filter(|&at| size(at) > 0.0).collect();
    order.sort_by(|&i, &j| size(j).total_cmp(&size(i)));
    // With states of delays or filters, the plant has other entries than the sensitivities.
    let states = robustness.sensitivity[0].matrices.first().map_or(0, |a| a.values.len());
    let values: Vec<f64> = ["A", "B", "C", "D"]
        .iter()
        .filter(|_| states == report.plant.states.len())
        .filter_map(|name| report.plant.matrices.iter().find(|matrix| matrix.name == *name))
        .flat_map(|matrix| matrix.values.iter().flatten().copied())
        .collect();
    let row = |&at: &usize| {
        let value = Cell::from(values.get(at).copied());
        let effects = all.iter().map(|entries| Cell::from(0.01 * entries[at].1));
        [first[at].0.as_str().into(), value].into_iter().chain(effects).collect()
    };
    let rows: Vec<Vec<Cell>> = order.iter().take(SHOWN).map(row).collect();
    let changes: Vec<_> = robustness
        .sensitivity
        .iter()
        .map(|sensitivity| format!("change at the {}", sensitivity.point))
        .collect();
    let heads = ["entry", "value"].into_iter().chain(changes.iter().map(String::as_str));
    html! {
        p {
            "The change of the judged peak of S for a change of one entry of the plant by +1 %, to \
             first order; the " (rows.len()) " entries with the largest effect."
        }
        (table("Sensitivity of the peaks of S", heads, &rows))
        @for (index, sensitivity) in robustness.sensitivity.iter().enumerate() {
            p { "At the " (sensitivity.point) ", for a change by 100 %:" }
            (matrices(&format!("sensitivity-of-{}", index + 1), &sensitivity.matrices))
        }
    }
}

fn tolerances(report: &Report, tolerances: &ToleranceResult) -> Markup {
    if !tolerances.is_examined() {
        return html! { p { "Not examined: no entry and no parameter of the plant varies." } };
    }
    let tried = if tolerances.parameters.is_empty() { 16.0 } else { 1.0 };
    html! {
        p {
            @if tolerances.parameters.is_empty() {
                (number(f64::from(tolerances.entries))) " entries vary: " (tolerances.range()) ". Each varies by itself, unless \
                 stated together; zeros and structural rows do not vary; "
            } @else {
                "The parameters of the table vary between their limits, and the FMU is linearised \
                 with each set of them at the same operating point; "
            }
            "the controller does not. "
            @match tolerances.stable {
                Some(part) => {
                    "Of " (number(f64::from(tolerances.cases))) " random cases (seed " (number(f64::from(tolerances.seed))) ") the fraction "
                    (number(part)) " is stable. "
                }
                None => "There are no random cases. "
            }
            "The worst plant found has the stability figure "
            (number(tolerances.worst_instability)) " (negative: stable; "
            @if report.sampling.is_some() { "largest modulus less 1" } @else { "largest real part, 1/s" }
            "). In its direction the loop is stable up to " (number(tolerances.first_unstable.min(tried)))
            " of the tolerances" @if tolerances.first_unstable > tried { ", the most that was tried" }
            "."
        }
        @if !tolerances.parameters.is_empty() { (limits(&tolerances.parameters)) }
        (matrices("worst", &tolerances.worst))
    }
}

/// The proof for the cases that were not tried; empty if nothing varies.
fn proof(tested: &ToleranceResult, proof: &Result<ToleranceProof, String>) -> Markup {
    html! {
        @if tested.is_examined() {
            p {
                @match proof {
                    Ok(proof) => {
                        "Proven by the structured singular value: every plant within "
                        (number(proof.fraction)) " of the tolerances is stable, while it is constant. "
                        @if proof.frequency > 0.0 && proof.fraction < 0.99 * proof.most {
                            "The frequency " (number(proof.frequency)) " rad/s limits it. "
                        }
                        (number(f64::from(proof.deviations))) " independent deviations, "
                        (number(f64::from(proof.intervals))) " intervals of the frequency. "
                        @if proof.fraction < 1.0 { "Between this fraction and the tolerances a case that was not tried may be unstable." }
                    }
                    Err(reason) => {
                        "A case that was not tried may be worse; stability of all of them is " (reason) "."
                    }
                }
            }
        }
    }
}

fn limits(all: &[Parameter]) -> Markup {
    let heads = [
        "parameter",
        "value",
        "lowest",
        "highest",
        "worst",
        "change at the commands",
        "change at the measurements",
    ];
    let row = |parameter: &Parameter| {
        let name = with_unit(&parameter.name, parameter.unit.as_ref());
        let values = [parameter.value, parameter.limits[0], parameter.limits[1], parameter.worst];
        let numbers = values.iter().chain(&parameter.effects).map(|value| Cell::Number(*value));
        std::iter::once(name).chain(numbers).collect()
    };
    let rows: Vec<Vec<Cell>> = all.iter().map(row).collect();
    html! {
        p {
            "The last two columns: change of the judged peak of S while the parameter goes from its \
             value to a limit, to first order."
        }
        (table("Parameters of the FMU", heads, &rows))
    }
}
