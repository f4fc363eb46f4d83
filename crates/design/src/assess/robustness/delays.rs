//! The loop with exact delays.

use control::response::frequency_grid;
use control::robustness::{Loop, Point};

use crate::plant::delays::JUDGED;
use crate::report::number::rounded;
use crate::report::robustness::{ExactDelays, Level, LoopPoint, Robustness};
use crate::solve::solution::Solution;

/// Number of frequencies of the grid in each decade.
const PER_DECADE: u32 = 200;
/// A peak of S that is larger by this factor with exact delays is a reason of the verdict.
const LARGER: f64 = 1.05;

/// Compares `closed`, the stable loop with delays of [`JUDGED`] states each, with the loop with exact delays, at a grid
/// of frequencies and at the peaks of S in `points`; `None` without delays.
pub(super) fn exact(
    designed: &Solution,
    closed: &Loop,
    points: &[LoopPoint],
) -> Result<Option<ExactDelays>, control::Error> {
    let linear = &designed.linear;
    if !linear.delays.any() {
        return Ok(None);
    }
    let mut frequencies = frequency_grid(&closed.sensitivity(Point::Input), PER_DECADE)?;
    let peaks = points.iter().map(|point| point.s_frequency);
    // At zero the plant may have a pole.
    frequencies.extend(peaks.filter(|frequency| frequency.is_finite() && *frequency > 0.0));
    let exact = linear.delays.exact(&linear.undelayed, closed, &frequencies)?;
    let count = |number: usize| u32::try_from(number).unwrap_or(u32::MAX);
    Ok(Some(ExactDelays {
        observer_order: count(linear.delay_order),
        judged_order: count(JUDGED),
        s_peaks: exact.peaks,
        difference: exact.radius,
        frequency: exact.frequency,
        frequencies: count(frequencies.len()),
    }))
}

/// Returns the reasons that exact delays add to the verdict; none without delays.
pub(crate) fn reasons(robustness: &Robustness) -> Vec<(Level, String)> {
    let Some(delays) = &robustness.delays else { return Vec::new() };
    let order = delays.judged_order;
    if delays.difference >= 1.0 {
        let message = format!(
            "the loop is stable with delays of {order} states each, but not shown to be stable with the delays \
             themselves: they differ too much at {} rad/s; expected a slower loop",
            rounded(delays.frequency)
        );
        return vec![(Level::Red, message)];
    }
    let points = robustness.points.iter().zip(delays.s_peaks);
    let larger = points.filter(|(point, peak)| *peak > LARGER * point.s_peak);
    let reason = |(point, peak): (&LoopPoint, f64)| {
        let message = format!(
            "with the delays themselves the peak of S at the {} is {}, in place of {} with delays of {order} states \
             each",
            point.point,
            rounded(peak),
            rounded(point.s_peak)
        );
        (Level::Amber, message)
    };
    larger.map(reason).collect()
}
