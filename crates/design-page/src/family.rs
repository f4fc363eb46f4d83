//! The sections on the members of a family and on the points of a schedule.

use maud::{Markup, html};

use super::matrix::{matrices, square};
use super::number::number;
use super::table::{Cell, Columns, table, table_of, with_unit};
use design_report::Report;
use design_report::family::{FamilyReport, MemberReport};
use design_report::robustness::{LoopPoint, Number, ToleranceResult};
use design_report::schedule::ScheduleReport;

/// Title of the matrix P.
const LYAPUNOV: &str = "Lyapunov matrix";

pub(super) fn family(report: &Report, family: &FamilyReport) -> Markup {
    let members: Vec<_> = family.members.iter().collect();
    html! {
        p {
            "One controller for all members; its observer has the model of the nominal plant. The worst \
             member is judged. A constant member is judged by the eigenvalues of the whole loop; a \
             common P is about a plant that moves between the members, arbitrarily fast."
        }
        (margins("Members of the family", "member", &members))
        (noise(&members))
        @match &family.whole {
            Ok(certificate) => {
                p {
                    "One P serves all members with the whole controller (margin "
                    (number(certificate.margin)) "): the loop is stable while the plant moves between \
                     the members in any way"
                    @if report.sampling.is_some() { " from one sample to the next" }
                    "."
                }
                (lyapunov(report, "family-P", "P", &certificate.p))
            }
            Err(reason) => p {
                strong { "Stability while the plant moves between the members is not proven: " }
                (reason) ". The table is about constant members."
            }
        }
        @if let Some(certificate) = &family.feedback {
            p {
                "One P proves the region of the state feedback for all members (margin "
                (number(certificate.margin)) ")."
            }
            // The states that K = [K_x, K_i] feeds back.
            @let names = [state_names(report), integral_names(report)].concat();
            (square("family-feedback-P", ["P", LYAPUNOV], &names, &certificate.p))
        }
    }
}

pub(super) fn schedule(report: &Report, schedule: &ScheduleReport) -> Markup {
    let unit = schedule.unit.as_deref().unwrap_or("1");
    let members: Vec<_> = schedule.points.iter().map(|point| &point.closed).collect();
    let (instant, figure, unit_of_figure) = match report.sampling {
        Some(_) => ("At each sample", "modulus", ", less 1,"),
        None => ("At each instant", "real part", ", in 1/s,"),
    };
    html! {
        p {
            "The gains depend on " strong { (schedule.variable) } ", "
            @if schedule.measured { "a measurement" } @else { "an input of the controller" }
            ", in " (unit) ". " (instant) " plant model, gains and operating point are interpolated \
             linearly between the points; values outside of them are held at the ends."
        }
        (margins("Points of the schedule", "point", &members))
        (noise(&members))
        (operating(report, schedule))
        p {
            "Between the points: the largest " (figure) " of the eigenvalues of the interpolated loop" (unit_of_figure)
            " is " (number(schedule.worst_instability)) " at " (schedule.variable) " = "
            (number(schedule.worst_at)) ", the worst of " (schedule.checked) " constant values. "
            strong { "This is a check of these values, not a proof." }
        }
        @match (&schedule.any_rate, &schedule.bounded_rate) {
            (Ok(certificate), _) => {
                p {
                    "Proven: one P (margin " (number(certificate.margin)) ") serves all values between \
                     the first and the last point, so that the interpolated loop is stable however \
                     fast the variable changes."
                }
                (lyapunov(report, "schedule-P", "P", &certificate.p))
            }
            (Err(reason), Ok(bounded)) => {
                p {
                    "One P for any rate was not found (" (reason) "). Proven with a P that depends on \
                     the variable (margin " (number(bounded.margin)) "): the interpolated loop is \
                     stable while the variable changes by at most " (number(bounded.rate)) " "
                    (unit) " per s."
                }
                @for (index, (point, p)) in schedule.points.iter().zip(&bounded.p).enumerate() {
                    @let id = format!("schedule-P-{}", index + 1);
                    (lyapunov(report, &id, &format!("P at {}", point.at), p))
                }
            }
            (Err(any), Err(bounded)) => p {
                strong { "Stability while the variable changes is not proven. " }
                "For any rate: " (any) ". For a bounded rate: " (bounded) "."
            }
        }
        @for (index, point) in schedule.points.iter().enumerate() {
            h3 { (point.closed.name) }
            (matrices(&format!("schedule-{}", index + 1), &point.gains))
        }
    }
}

fn margins(caption: &str, kind: &str, members: &[&MemberReport]) -> Markup {
    let columns: Columns<'_, MemberReport, 10> = [
        (kind, |member| (&member.name).into()),
        ("stable", |member| Cell::Holds(member.margins.is_some())),
        ("stability figure", |member| member.instability.into()),
        ("peak of S, commands", |member| point(member, 0).map(|point| point.judged).into()),
        ("peak of S, measurements", |member| point(member, 1).map(|point| point.judged).into()),
        ("disk margin, commands", |member| point(member, 0).map(|at| at.together.alpha).into()),
        ("disk margin, measurements", |member| point(member, 1).map(|at| at.together.alpha).into()),
        ("delay margin (s)", |member| {
            member.margins.as_ref().map(|margins| margins.delay_margin).into()
        }),
        ("stable cases (%)", |member| {
            tolerance(member).and_then(|test| test.stable).map(|part| 100.0 * part).into()
        }),
        ("unstable from (tolerances)", |member| match tolerance(member) {
            // No larger multiple is tried.
            Some(test) if test.first_unstable.is_infinite() => "not up to 16".into(),
            test => test.map(|test| test.first_unstable).into(),
        }),
    ];
    table_of(caption, members.iter().copied(), &columns)
}

fn point(member: &MemberReport, at: usize) -> Option<&LoopPoint> {
    member.margins.as_ref()?.points.get(at)
}

/// The tolerances of a member; none if nothing varies.
fn tolerance(member: &MemberReport) -> Option<&ToleranceResult> {
    member.margins.as_ref()?.tolerance.as_ref().filter(|test| test.is_examined())
}

/// Shows the effect of the measurement noise, with a column for each member with a stable loop; empty without one.
fn noise(members: &[&MemberReport]) -> Markup {
    let stable: Vec<_> = members
        .iter()
        .filter_map(|member| Some((&member.name, member.margins.as_ref()?)))
        .collect();
    let Some((_, first)) = stable.first() else { return html! {} };
    let row = |(at, number): (usize, &Number)| {
        let values = stable.iter().map(|(_, margins)| margins.noise_together[at].value.into());
        std::iter::once(with_unit(&number.name, number.unit.as_ref())).chain(values).collect()
    };
    let rows: Vec<Vec<Cell>> = first.noise_together.iter().enumerate().map(row).collect();
    let heads = std::iter::once("signal").chain(stable.iter().map(|(name, _)| name.as_str()));
    table("Root-mean-square values under the noise of all measurements", heads, &rows)
}

fn operating(report: &Report, schedule: &ScheduleReport) -> Markup {
    let plant = &report.plant;
    let names = [&plant.states, &plant.actuators, &plant.measurements];
    let coupled = "stability figure with the schedule's own feedback";
    let mut rows: Vec<Vec<Cell>> = Vec::new();
    for (group, names) in names.iter().enumerate() {
        for (at, signal) in names.iter().enumerate() {
            let values = schedule.points.iter().map(|point| Cell::from(point.operating[group][at]));
            let name = with_unit(&signal.name, signal.unit.as_ref());
            rows.push(std::iter::once(name).chain(values).collect());
        }
    }
    if schedule.measured {
        let values = schedule.points.iter().map(|point| point.coupled_instability.into());
        rows.push(std::iter::once(coupled.into()).chain(values).collect());
    }
    let heads = std::iter::once("value at the operating point")
        .chain(schedule.points.iter().map(|point| point.closed.name.as_str()));
    html! {
        (table("Operating points", heads, &rows))
        @if schedule.measured {
            p {
                "A measurement schedules: through the interpolated operating points it acts on the \
                 commands in a way that the designs at the points do not know (“hidden coupling”, \
                 Rugh and Shamma 2000). The last row of the table includes it; negative is stable."
            }
        }
    }
}

fn lyapunov(report: &Report, id: &str, name: &str, p: &[Vec<f64>]) -> Markup {
    square(id, [name, LYAPUNOV], &loop_names(report, p), p)
}

fn state_names(report: &Report) -> Vec<String> {
    report.plant.states.iter().map(|signal| signal.name.clone()).collect()
}

/// The names of x_i, the integrals of r - H y: the columns of K_i are the references.
fn integral_names(report: &Report) -> Vec<String> {
    let k_i = report.gains.iter().find(|gain| gain.name == "K_i");
    let names = k_i.iter().flat_map(|gain| &gain.columns);
    names.map(|name| format!("integral of {name}")).collect()
}

/// The names of the states of plant and controller together, the rows of the matrix `p`: states of the plant, filtered
/// measurements, estimates, integrals.
fn loop_names(report: &Report, p: &[Vec<f64>]) -> Vec<String> {
    let states = &report.plant.states;
    let Some(k_x) = report.gains.iter().find(|gain| gain.name == "K_x") else {
        return state_names(report);
    };
    let mut controller = Vec::new();
    let measurements = report.plant.measurements.iter();
    if k_x.columns.len() > states.len() {
        controller.extend(measurements.map(|signal| format!("filter of {}", signal.name)));
    }
    controller.extend(k_x.columns.iter().map(|name| format!("estimate of {name}")));
    let faults = report.gains.iter().find(|gain| gain.name == "L_f");
    controller.extend(
        faults.iter().flat_map(|gain| &gain.rows).map(|name| format!("estimate of {name}")),
    );
    controller.extend(integral_names(report));
    let mut names = judged_names(report, p.len().saturating_sub(controller.len()));
    names.extend(controller);
    names
}

/// The names of the `count` states of the plant in the judged loop, in which a delay has more states than in the
/// observer.
fn judged_names(report: &Report, count: usize) -> Vec<String> {
    let mut names = state_names(report);
    if names.len() == count {
        return names;
    }
    let (actuators, measurements) = (&report.plant.actuators, &report.plant.measurements);
    let commands = actuators.iter().map(|signal| &signal.name);
    let commands = commands.map(|name| (name, format!("delayed {name}")));
    let measured = measurements.iter().map(|signal| &signal.name);
    let measured = measured.map(|name| (name, format!("delay of {name}, 1")));
    // Each delayed signal, and the first state of its delay.
    let mut delays: Vec<_> = commands.chain(measured).collect();
    delays.retain(|(_, first)| names.contains(first));
    let Some(start) = names.iter().position(|name| delays.iter().any(|(_, first)| first == name))
    else {
        return names;
    };
    names.truncate(start);
    let order = count.saturating_sub(start) / delays.len();
    for (name, first) in delays {
        names.push(first);
        names.extend((2..=order).map(|at| format!("delay of {name}, {at}")));
    }
    names
}
