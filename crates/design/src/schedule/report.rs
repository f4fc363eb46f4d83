//! The part of a design report on a scheduled controller.

use control::lmi::{ScheduleCertificate, certify_schedule, largest_change};
use control::{Domain, Error};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use crate::budget::Budget;
use crate::checks::checks;
use crate::designed::ControllerDesign;
use crate::family::report::{CommonCertificate, MemberReport, common, judge, member};
use crate::matrix::rows;
use crate::report::{Matrix, OrReason, or_reason};
use crate::reporting::gains;
use crate::robustness::limits::RobustnessLimits;
use crate::robustness::report::{Level, Verdict};
use crate::schedule::{Scheduled, ScheduledLoop, coupled};

/// Values of the scheduling variable in each interval, its ends included, at which eigenvalues are
/// computed, less 1.
const CHECKED: u32 = 20;
/// An eigenvalue this near to the stability limit is one on it, with rounding errors.
const NEUTRAL: f64 = 1e-7;

/// A controller whose gains depend on a scheduling variable.
#[derive(Serialize, JsonSchema)]
pub struct ScheduleReport {
    /// The scheduling variable.
    pub variable: String,
    /// Its unit.
    pub unit: Option<String>,
    /// Whether it is a measurement; otherwise it is an input of its own.
    pub measured: bool,
    /// Its largest rate, per s, as stated in the plant file.
    pub rate_bound: Option<f64>,
    /// The points of the grid.
    pub points: Vec<SchedulePointReport>,
    /// The proof of stability for one P, or the reason why there is none: plant and controller,
    /// interpolated linearly, are stable for every value between the first and the last point, while
    /// it changes in any way and arbitrarily fast.
    #[serde(serialize_with = "or_reason")]
    #[schemars(with = "OrReason<CommonCertificate>")]
    pub any_rate: Result<CommonCertificate, String>,
    /// The same with P(variable), for a bounded rate; tried only if no common P was found.
    #[serde(serialize_with = "or_reason")]
    #[schemars(with = "OrReason<RateCertificate>")]
    pub bounded_rate: Result<RateCertificate, String>,
    /// Number of values between the first and the last point at which the eigenvalues of the
    /// interpolated loop were computed, for constant values of the variable.
    pub checked: usize,
    /// The worst of them: largest modulus less 1; of a continuous controller the largest real part, 1/s.
    pub worst_instability: f64,
    /// The value of the variable there.
    pub worst_at: f64,
}

/// A proof with P(variable) piecewise linear over the grid.
#[derive(Serialize, JsonSchema)]
pub struct RateCertificate {
    /// The largest rate of the variable, per s, that is proven.
    pub rate: f64,
    /// P at each point of the grid, row by row.
    pub p: Vec<Vec<Vec<f64>>>,
    /// Margin of the inequalities, relative; larger than the rounding errors.
    pub margin: f64,
}

/// A point of the grid.
#[derive(Serialize, JsonSchema)]
pub struct SchedulePointReport {
    /// The value of the scheduling variable.
    pub at: f64,
    /// Values of states, commands and measurements at its operating point.
    pub operating: [Vec<f64>; 3],
    /// The gains.
    pub gains: Vec<Matrix>,
    /// The loop of the plant and the controller of this point.
    pub closed: MemberReport,
    /// If a measurement schedules: the instability of the loop with the feedback through the
    /// interpolated operating points, which the design at the point does not know.
    pub coupled_instability: Option<f64>,
}

/// Returns the report on the schedule of `designed`, if it has one.
pub(crate) fn schedule(
    designed: &ControllerDesign,
    limits: &RobustnessLimits,
    budget: &Budget,
) -> Result<Option<ScheduleReport>, crate::Error> {
    let Some(own) = &designed.schedule else { return Ok(None) };
    let coupled = coupled(own, designed)?;
    let all: Vec<_> = own.points(designed).collect();
    let variable = &own.variable;
    let one = |(k, (at, point)): (usize, &(f64, &ControllerDesign))| {
        let name = format!("{} = {at}", variable.name);
        let linear = &point.linear;
        let found = member(point, linear, name.clone(), limits);
        let operating = [&linear.states, &linear.actuators, &linear.measurements];
        Ok::<_, crate::Error>(SchedulePointReport {
            at: *at,
            operating: operating
                .map(|all| all.iter().map(|signal| signal.operating.unwrap_or(0.0)).collect()),
            gains: gains(point),
            closed: found.map_err(|error| error.within(format!("schedule with {name}")))?,
            coupled_instability: coupled.as_ref().map(|all| all[k]),
        })
    };
    let points = all.par_iter().enumerate().map(one).collect::<Result<Vec<_>, _>>()?;
    let whole = ScheduledLoop::of(own, designed)?;
    let intervals = whole.intervals()?;
    let (worst_instability, worst_at) = whole.worst(CHECKED, designed.domain)?;
    let vertices: Vec<_> = intervals.iter().flat_map(|own| own.coefficients.clone()).collect();
    let degree = intervals[0].coefficients.len() - 1;
    let named = |vertex: usize| {
        let (k, j) = (vertex / (degree + 1), vertex % (degree + 1));
        match j {
            0 => all[k].0.to_string(),
            j if j == degree => all[k + 1].0.to_string(),
            _ => format!("{} to {}", all[k].0, all[k + 1].0),
        }
    };
    let any_rate = common(&vertices, designed.domain, budget, named)?;
    let bounded_rate = match &any_rate {
        Ok(_) => Err("one P serves any rate".to_owned()),
        Err(_) => bounded(own, &intervals, designed.domain, budget)?,
    };
    Ok(Some(ScheduleReport {
        variable: variable.name.clone(),
        unit: variable.unit.clone(),
        measured: own.measurement.is_some(),
        rate_bound: own.rate_bound,
        checked: intervals.len() * usize::try_from(CHECKED).unwrap_or(usize::MAX) + 1,
        points,
        any_rate,
        bounded_rate,
        worst_instability,
        worst_at,
    }))
}

/// P(variable) for the stated rate, or for the largest one that is found.
fn bounded(
    own: &Scheduled,
    intervals: &[control::lmi::Interval],
    domain: Domain,
    budget: &Budget,
) -> Result<Result<RateCertificate, String>, Error> {
    if budget.is_over() {
        return Ok(Err(format!("it was {}", budget.reason())));
    }
    let shortest = intervals.iter().map(|own| own.length).fold(f64::INFINITY, f64::min);
    // The time in which the variable changes once: a sample, or a second.
    let (time, is_sampled) = match domain {
        Domain::Continuous => (1.0, false),
        Domain::Sampled { period } => (period, true),
    };
    let found = match own.rate_bound {
        Some(rate) if is_sampled && rate * time > shortest => {
            return Ok(Err(format!(
                "at the stated rate the variable passes the shortest interval, {shortest}, in less \
                 than a sample"
            )));
        }
        Some(rate) => certify_schedule(intervals, rate * time, domain)?,
        None => largest_change(intervals, domain)?,
    };
    Ok(match found {
        Some(ScheduleCertificate { change, p, margin, .. }) => {
            let p = p.iter().map(rows).collect();
            Ok(RateCertificate { rate: own.rate_bound.unwrap_or(change / time), p, margin })
        }
        None => Err(match own.rate_bound {
            Some(rate) => format!("no P was found for the stated rate {rate} per s"),
            None => "no P was found, even for slow changes".to_owned(),
        }),
    })
}

/// Judges a scheduled controller.
pub(crate) fn judge_schedule(
    verdict: &mut Verdict,
    designed: &ControllerDesign,
    found: &ScheduleReport,
    limits: &RobustnessLimits,
) {
    let members: Vec<_> = found.points.iter().map(|point| &point.closed).collect();
    judge(verdict, "schedule at", &members, limits);
    let others = designed.schedule.iter().flat_map(Scheduled::others);
    for (at, point) in others {
        for check in checks(point).iter().filter(|check| !check.holds) {
            let text = format!("with {} = {at} does not hold: {}", found.variable, check.condition);
            verdict.add(Level::Red, text);
        }
    }
    if found.worst_instability >= 0.0 {
        verdict.add(
            Level::Red,
            format!(
                "the interpolated loop is not stable with {} = {}",
                found.variable, found.worst_at
            ),
        );
    }
    for point in &found.points {
        if point.coupled_instability.is_some_and(|value| value >= -NEUTRAL) {
            let text = format!(
                "the loop at {} = {} is not stable, because the measurement moves the operating point; \
                 schedule by an input, such as its set point",
                found.variable, point.at
            );
            verdict.add(Level::Red, text);
        }
    }
    if found.any_rate.is_err() && found.bounded_rate.is_err() {
        let text = format!(
            "stability while {} changes is not proven, neither for any rate nor for a bounded one; only \
             constant values were checked",
            found.variable
        );
        verdict.add(Level::Amber, text);
    }
}
