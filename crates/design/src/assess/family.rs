//! Examines the members of a family of plants with the controller, and judges them.

use control::lmi::{self, Outcome, RegionCertificate, certify_common};
use control::stability::instability;
use control::{Domain, Error};
use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::assess::robustness::{Margins, Physical, by_entries, margins};
use crate::assess::verdict::{peak_reason_with, unstable_cases};
use crate::budget::Budget;
use crate::matrix::rows;
use crate::plant::linear::LinearPlant;
use crate::report::family::{CommonCertificate, FamilyReport, MemberMargins, MemberReport};
use crate::report::robustness::{Level, Verdict};
use crate::solve::designed::Designed;
use crate::solve::family::{NOMINAL, name};
use crate::solve::solution::Solution;
use plant_file::robustness::RobustnessLimits;

/// Returns the report on the family of `designed`; None without a family.
pub(crate) fn family(
    designed: &Designed,
    limits: &RobustnessLimits,
    budget: &Budget,
) -> Result<Option<FamilyReport>, crate::Error> {
    let Designed { nominal: solution, family: Some(family), .. } = designed else {
        return Ok(None);
    };
    let nominal = (NOMINAL.to_owned(), &solution.linear);
    let others = family.members.iter().map(|member| (member.name.clone(), &member.linear));
    let all: Vec<_> = std::iter::once(nominal).chain(others).collect();
    let one = |(name, linear): &(String, &LinearPlant)| {
        let point = member(solution, linear, name.clone(), limits);
        point.map_err(|error| error.within(format!("member `{name}` of the family")))
    };
    let members = all.par_iter().map(one).collect::<Result<Vec<_>, _>>()?;
    let closed = |(_, linear): &(String, &LinearPlant)| {
        let physical = Physical::of_gains(solution, linear, &solution.gains)?;
        Ok(physical.closed(&physical.controller)?.dynamics())
    };
    let loops = all.iter().map(closed).collect::<Result<Vec<_>, Error>>()?;
    let named = |at: usize| name(&family.members, at).to_owned();
    Ok(Some(FamilyReport {
        members,
        feedback: family.feedback.as_ref().map(reported),
        whole: common(&loops, solution.domain, budget, named)?,
    }))
}

/// Returns margins, noise and tolerances of `linear` with the controller of `designed`; no margins if the loop is not
/// stable, no tolerances if parameters of an FMU vary.
pub(crate) fn member(
    designed: &Solution,
    linear: &LinearPlant,
    name: String,
    limits: &RobustnessLimits,
) -> Result<MemberReport, crate::Error> {
    let physical = Physical::of_gains(designed, linear, &designed.gains)?;
    let closed_loop = physical.closed(&physical.controller)?;
    let instability = instability(&closed_loop.dynamics(), designed.domain)?;
    if instability >= 0.0 {
        return Ok(MemberReport { name, instability, margins: None });
    }
    let Margins { points, delay, hold, noise_together, .. } =
        margins(designed, &physical, &closed_loop, limits)?;
    let tolerance = limits.parameters.is_empty().then(|| by_entries(linear, &physical, limits));
    let margins = MemberMargins {
        points,
        delay_margin: delay,
        longest_hold: hold,
        noise_together,
        tolerance: tolerance.transpose()?,
    };
    Ok(MemberReport { name, instability, margins: Some(margins) })
}

/// Returns one P for all loops, or the reason why there is none. `name` returns the name of the loop at a position.
pub(crate) fn common(
    loops: &[DMatrix<f64>],
    domain: Domain,
    budget: &Budget,
    name: impl Fn(usize) -> String,
) -> Result<Result<CommonCertificate, String>, Error> {
    if budget.is_over() {
        return Ok(Err(format!("it was {}", budget.reason())));
    }
    let outcome = budget.run(|| certify_common(loops, &lmi::Region::default(), domain))?;
    if !matches!(outcome, Outcome::Optimal(_)) && budget.is_over() {
        return Ok(Err(format!("it was {}", budget.reason())));
    }
    Ok(match outcome {
        Outcome::Optimal(certificate) => Ok(reported(&certificate)),
        Outcome::Infeasible { conflict } => {
            let mut names: Vec<_> = conflict.into_iter().map(name).collect();
            names.dedup();
            Err(format!("no P serves these together: {}", names.join(", ")))
        }
        Outcome::Inconclusive(reason) => Err(reason.to_owned()),
    })
}

/// Converts a certificate for the report.
pub(crate) fn reported(certificate: &RegionCertificate) -> CommonCertificate {
    CommonCertificate { p: rows(&certificate.p), margin: certificate.margin }
}

/// Judges the plants of a family, and whether stability between them is proven.
pub(crate) fn judge_family(
    verdict: &mut Verdict,
    report: &FamilyReport,
    limits: &RobustnessLimits,
) {
    let members: Vec<_> = report.members.iter().skip(1).collect();
    judge(verdict, "member", &members, limits);
    if report.whole.is_err() {
        let text = "stability of plants between the members of the family, and while the plant moves between \
                    them, is not proven; only the members themselves were checked";
        verdict.add(Level::Amber, text.to_owned());
    }
}

/// Judges the worst of several plants with the controller; `kind` names them in the reasons.
pub(crate) fn judge(
    verdict: &mut Verdict,
    kind: &str,
    members: &[&MemberReport],
    limits: &RobustnessLimits,
) {
    let unstable = members.iter().filter(|member| member.margins.is_none());
    let unstable: Vec<_> = unstable.map(|member| member.name.as_str()).collect();
    if !unstable.is_empty() {
        let names = unstable.join(", ");
        verdict.add(Level::Red, format!("the loop is not stable with the {kind} {names}"));
    }
    let stable =
        || members.iter().filter_map(|member| Some((&member.name, member.margins.as_ref()?)));
    let peaks =
        stable().flat_map(|(name, margins)| margins.points.iter().map(move |point| (name, point)));
    if let Some((name, point)) = peaks.max_by(|x, y| x.1.judged.total_cmp(&y.1.judged)) {
        let reason = peak_reason_with(point, &format!(" with the {kind} {name}"), limits);
        if let Some((level, text)) = reason {
            verdict.add(level, text);
        }
    }
    let tolerances =
        stable().filter_map(|(name, margins)| Some((name, margins.tolerance.as_ref()?)));
    let worst = tolerances
        .filter(|(_, tolerance)| tolerance.is_unstable())
        .min_by(|x, y| x.1.first_unstable.total_cmp(&y.1.first_unstable));
    if let Some((name, tolerance)) = worst {
        let text = format!(
            "parameters within their tolerances ({}) make the loop with the {kind} {name} unstable: {}",
            tolerance.range(),
            unstable_cases(tolerance)
        );
        verdict.add(Level::Red, text);
    }
}
