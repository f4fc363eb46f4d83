//! Examines the references of a scheduled controller between the points of its schedule.

use control::tracking::{InterpolatedWindup, interpolated_windup};
use control::{Domain, Error};
use files::PlaceError;
use nalgebra::DMatrix;

use crate::solve::schedule::{Point, Scheduled};
use crate::solve::solution::Solution;
use crate::solve::tracking::REACHED;
use plant_file::PlantFile;
use plant_file::references::References;

/// Number of values of the scheduling variable within each interval at which a feedforward is checked.
const CHECKED: u32 = 19;

/// Examines what the references rely on between the points of a schedule.
///
/// A back-calculation that is not stable while commands are at their limits is an error. The warnings are
/// that this could not be decided, and that references without integral action are exact at the points only.
pub(crate) fn examine(
    file: &PlantFile<'_>,
    scheduled: &Scheduled,
    nominal: &Solution,
) -> Result<Vec<PlaceError>, crate::Error> {
    let Some(references) = &file.references else { return Ok(Vec::new()) };
    let all: Vec<_> = scheduled.points(nominal).collect();
    let mut warnings = Vec::new();
    if references.integral {
        for pair in all.windows(2) {
            warnings.extend(windup(file, scheduled, [pair[0], pair[1]])?);
        }
    } else {
        warnings.extend(feedforward(file, scheduled, references, &all)?);
    }
    Ok(warnings)
}

type DesignAt<'a> = (f64, &'a Solution);

/// Examines the back-calculation between two points: an error if unstable, a warning if stability is not decided.
fn windup(
    file: &PlantFile<'_>,
    scheduled: &Scheduled,
    [(from, first), (to, second)]: [DesignAt<'_>; 2],
) -> Result<Option<PlaceError>, crate::Error> {
    let gains = |design: &Solution| {
        let l_w = design.tracking.as_ref()?.windup()?.clone();
        Some((design.gains.integral.as_ref()?.gain.clone(), l_w))
    };
    let Some(((k_0, l_0), (k_1, l_1))) = gains(first).zip(gains(second)) else { return Ok(None) };
    let actuators = &first.linear.actuators;
    let ranges: Vec<_> =
        actuators.iter().map(|signal| signal.limits.map(|[low, high]| high - low)).collect();
    let at_limits = |limited: &[usize]| {
        let names: Vec<_> = limited.iter().map(|&j| actuators[j].name.as_str()).collect();
        let verb = if limited.len() == 1 { "is" } else { "are" };
        format!("while {} {verb} at the limits", names.join(" and "))
    };
    let variable = &scheduled.variable.name;
    match interpolated_windup([&k_0, &k_1], [&l_0, &l_1], &ranges, first.domain)? {
        InterpolatedWindup::Stable => Ok(None),
        InterpolatedWindup::Unstable { part, limited, instability } => {
            let eigenvalue = match first.domain {
                Domain::Continuous => format!("real part {instability:.3} 1/s"),
                Domain::Sampled { .. } => format!("modulus {:.3}", 1.0 + instability),
            };
            let message = format!(
                "with {variable} = {:.6} the interpolated back-calculation of the integrals is not \
                 stable {} (eigenvalue of {eigenvalue}), because K_i differs too much between \
                 {from} and {to}; expected more points, or another `windup_time`",
                from * (1.0 - part) + to * part,
                at_limits(&limited),
            );
            Err(file.error(&["schedule"], message).into())
        }
        InterpolatedWindup::Undecided { limited } => {
            let message = format!(
                "between {variable} = {from} and {to} it is not proven that the interpolated \
                 back-calculation of the integrals is stable {}; more points may help",
                at_limits(&limited),
            );
            Ok(Some(file.error(&["schedule"], message)))
        }
    }
}

/// Examines the feedforward between the points: a warning if a reference is exact at the points only.
///
/// Between the points H y at rest is G N_r r, G = H C (I - A - B K_x)^-1 B, in continuous time H C (-A - B K_x)^-1 B,
/// with all matrices interpolated.
fn feedforward(
    file: &PlantFile<'_>,
    scheduled: &Scheduled,
    references: &References,
    all: &[DesignAt<'_>],
) -> Result<Option<PlaceError>, crate::Error> {
    let mut worst = (0.0, all[0].0);
    for pair in all.windows(2) {
        let [(from, first), (to, second)] = [pair[0], pair[1]];
        let gains = first.tracking.as_ref().and_then(|tracking| tracking.feedforward());
        let next = second.tracking.as_ref().and_then(|tracking| tracking.feedforward());
        let (Some(n_0), Some(n_1)) = (gains, next) else { continue };
        let ends = [Point::of(first)?, Point::of(second)?];
        for step in 1..=CHECKED {
            let part = f64::from(step) / f64::from(CHECKED + 1);
            let n_r = n_0 * (1.0 - part) + n_1 * part;
            let error = error(&ends[0].between(&ends[1], part), &references.h, &n_r)?;
            if error > worst.0 {
                worst = (error, from * (1.0 - part) + to * part);
            }
        }
    }
    if worst.0 < REACHED {
        return Ok(None);
    }
    let message = format!(
        "without integral action a constant reference is reached at the points of the schedule only: \
         between them the interpolated N_r is not that of the interpolated plant, and misses up to \
         {:.2} % of a step, with {} = {:.6} (of {CHECKED} values in each interval); expected \
         `integral = true`, or more points",
        100.0 * worst.0,
        scheduled.variable.name,
        worst.1,
    );
    Ok(Some(file.error_at(&references.action_places[0], message)))
}

/// Returns the largest relative error at rest of an output after a step of its own reference.
fn error(point: &Point, h: &DMatrix<f64>, n_r: &DMatrix<f64>) -> Result<f64, Error> {
    let plant = &point.physical;
    let n = plant.a.nrows();
    let held = DMatrix::from_diagonal_element(n, n, plant.domain.constant());
    let dynamics = held - &plant.a - &plant.b * point.gains.k_x.columns(0, n);
    let states = dynamics.lu().solve(&(&plant.b * n_r));
    let states = states.ok_or(Error::Overflow { what: "the gain at rest" })?;
    let constant = h * &plant.c * states;
    Ok((0..h.nrows()).map(|k| (constant[(k, k)] - 1.0).abs()).fold(0.0, f64::max))
}
