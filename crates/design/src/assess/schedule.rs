//! Examines a scheduled controller at and between the points of its schedule, and judges it.

use control::lmi::{ScheduleCertificate, certify_schedule, largest_change};
use control::{Domain, Error};
use rayon::prelude::*;

use crate::assess::checks::checks;
use crate::assess::family::{common, judge, member};
use crate::assess::matrices::gains;
use crate::budget::Budget;
use crate::matrix::rows;
use crate::report::number::rounded;
use crate::report::robustness::{Level, Verdict};
use crate::report::schedule::{RateCertificate, SchedulePointReport, ScheduleReport};
use crate::solve::designed::Designed;
use crate::solve::schedule::{Scheduled, ScheduledLoop, coupled};
use crate::solve::solution::Solution;
use plant_file::robustness::RobustnessLimits;

/// Number of equal parts of each interval between points of the schedule; eigenvalues are computed at their ends.
const CHECKED: u32 = 20;
/// Distance from the stability limit within which an eigenvalue counts as on the limit, because of rounding errors.
const NEUTRAL: f64 = 1e-7;

/// Returns the report on the schedule of `designed`; None without a schedule.
pub(crate) fn schedule(
    designed: &Designed,
    limits: &RobustnessLimits,
    budget: &Budget,
) -> Result<Option<ScheduleReport>, crate::Error> {
    let Designed { nominal, schedule: Some(scheduled), .. } = designed else { return Ok(None) };
    let coupled = coupled(scheduled, nominal)?;
    let solutions: Vec<_> = scheduled.points(nominal).collect();
    let variable = &scheduled.variable;
    let report_of = |(k, (at, point)): (usize, &(f64, &Solution))| {
        let name = format!("{} = {at}", variable.name);
        let linear = &point.linear;
        let report = member(point, linear, name.clone(), limits);
        let operating = [&linear.states, &linear.actuators, &linear.measurements];
        Ok::<_, crate::Error>(SchedulePointReport {
            at: *at,
            operating: operating
                .map(|all| all.iter().map(|signal| signal.operating.unwrap_or(0.0)).collect()),
            gains: gains(point),
            closed: report.map_err(|error| error.within(format!("schedule with {name}")))?,
            coupled_instability: coupled.as_ref().map(|values| values[k]),
        })
    };
    let points = solutions.par_iter().enumerate().map(report_of).collect::<Result<Vec<_>, _>>()?;
    let whole = ScheduledLoop::of(scheduled, nominal)?;
    let intervals = whole.intervals()?;
    let (worst_instability, worst_at) = whole.worst(CHECKED, nominal.domain)?;
    let vertices: Vec<_> =
        intervals.iter().flat_map(|interval| interval.coefficients.clone()).collect();
    let degree = intervals[0].coefficients.len() - 1;
    let named = |vertex: usize| {
        let (k, j) = (vertex / (degree + 1), vertex % (degree + 1));
        match j {
            0 => solutions[k].0.to_string(),
            j if j == degree => solutions[k + 1].0.to_string(),
            _ => format!("{} to {}", solutions[k].0, solutions[k + 1].0),
        }
    };
    let any_rate = common(&vertices, nominal.domain, budget, named)?;
    let bounded_rate = match &any_rate {
        Ok(_) => Err("one P serves any rate".to_owned()),
        Err(_) => bounded(scheduled, &intervals, nominal.domain, budget)?,
    };
    Ok(Some(ScheduleReport {
        variable: variable.name.clone(),
        unit: variable.unit.clone(),
        measured: scheduled.measurement.is_some(),
        rate_bound: scheduled.rate_bound,
        checked: intervals.len() * usize::try_from(CHECKED).unwrap_or(usize::MAX) + 1,
        points,
        any_rate,
        bounded_rate,
        worst_instability,
        worst_at,
    }))
}

/// Returns P as a function of the variable, for the stated rate or else for the largest one that is found, or why there
/// is none.
fn bounded(
    scheduled: &Scheduled,
    intervals: &[control::lmi::Interval],
    domain: Domain,
    budget: &Budget,
) -> Result<Result<RateCertificate, String>, Error> {
    if budget.is_over() {
        return Ok(Err(format!("it was {}", budget.reason())));
    }
    let shortest = intervals.iter().map(|interval| interval.length).fold(f64::INFINITY, f64::min);
    // The time over which a change of the variable counts: a sample, or a second.
    let time = domain.step();
    let certificate = match scheduled.rate_bound {
        Some(rate) if domain != Domain::Continuous && rate * time > shortest => {
            return Ok(Err(format!(
                "at the stated rate the variable passes the shortest interval, {shortest}, in less \
                 than a sample"
            )));
        }
        Some(rate) => budget.run(|| certify_schedule(intervals, rate * time, domain))?,
        None => budget.run(|| largest_change(intervals, domain))?,
    };
    if certificate.is_none() && budget.is_over() {
        return Ok(Err(format!("it was {}", budget.reason())));
    }
    Ok(match certificate {
        Some(ScheduleCertificate { change, p, margin, .. }) => {
            let p = p.iter().map(rows).collect();
            Ok(RateCertificate { rate: scheduled.rate_bound.unwrap_or(change / time), p, margin })
        }
        None => Err(match scheduled.rate_bound {
            Some(rate) => format!("no P was found for the stated rate {rate} per s"),
            None => "no P was found, even for slow changes".to_owned(),
        }),
    })
}

/// Judges a scheduled controller.
pub(crate) fn judge_schedule(
    verdict: &mut Verdict,
    designed: &Designed,
    report: &ScheduleReport,
    limits: &RobustnessLimits,
) {
    let members: Vec<_> = report.points.iter().map(|point| &point.closed).collect();
    judge(verdict, "schedule at", &members, limits);
    let others = designed.schedule.iter().flat_map(Scheduled::others);
    for (at, point) in others {
        for check in checks(point).iter().filter(|check| !check.holds) {
            let text =
                format!("with {} = {at} does not hold: {}", report.variable, check.condition);
            verdict.add(Level::Red, text);
        }
    }
    if report.worst_instability >= 0.0 {
        let (variable, at) = (&report.variable, rounded(report.worst_at));
        let text = format!("the interpolated loop is not stable with {variable} = {at}");
        verdict.add(Level::Red, text);
    }
    for point in &report.points {
        if point.coupled_instability.is_some_and(|value| value >= -NEUTRAL) {
            let text = format!(
                "the loop at {} = {} is not stable, because the measurement moves the operating point; \
                 schedule by an input, such as its set point",
                report.variable, point.at
            );
            verdict.add(Level::Red, text);
        }
    }
    if report.any_rate.is_err() && report.bounded_rate.is_err() {
        let text = format!(
            "stability while {} changes is not proven, neither for any rate nor for a bounded one; only \
             constant values were checked",
            report.variable
        );
        verdict.add(Level::Amber, text);
    }
}
