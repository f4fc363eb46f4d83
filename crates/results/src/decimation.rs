//! Decimation: the communication points at which a row is recorded.

use serde::{Deserialize, Serialize};

/// A communication point that precedes an instant of the grid by less than this fraction of the interval, plus the
/// rounding of start and time, counts as at the instant.
const TOLERANCE: f64 = 1e-9;

/// The communication points to record.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Decimation {
    /// Every communication point.
    All,
    /// The first communication point at or after each instant `start + k interval`; interval in s, above
    /// zero. A step over several instants gives one row.
    Every(f64),
    /// The first communication point and every n-th one after the first; n above zero.
    Nth(u64),
}

/// Decides for each communication point whether a row is recorded. Serialisable, so that a resumed run records the same
/// points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Due {
    decimation: Decimation,
    /// Start of the grid in s.
    start: f64,
    /// Number of the next instant of the grid, for [`Decimation::Every`].
    next: f64,
    /// Number of communication points so far, for [`Decimation::Nth`].
    points: u64,
}

impl Due {
    /// Creates the schedule of `decimation` for a run that starts at `start` in s.
    #[must_use]
    pub fn new(decimation: Decimation, start: f64) -> Self {
        Self { decimation, start, next: 0.0, points: 0 }
    }

    /// Whether the communication point at `time` in s is recorded. Call it once for each communication point, in the
    /// order of time.
    pub fn at(&mut self, time: f64) -> bool {
        match self.decimation {
            Decimation::All => true,
            Decimation::Nth(count) => {
                let due = self.points.is_multiple_of(count.max(1));
                self.points += 1;
                due
            }
            Decimation::Every(interval) => {
                let rounding = 4.0 * f64::EPSILON * time.abs().max(self.start.abs());
                let passed = (time - self.start + rounding) / interval + TOLERANCE;
                let due = passed >= self.next;
                if due {
                    self.next = passed.floor() + 1.0;
                }
                due
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recorded(decimation: Decimation, start: f64, times: &[f64]) -> Vec<f64> {
        let mut due = Due::new(decimation, start);
        times.iter().copied().filter(|time| due.at(*time)).collect()
    }

    #[test]
    fn the_grid_is_met_though_its_instants_are_rounded() {
        let times: Vec<f64> = (0..=1_000_000).map(|k| 1.5 + f64::from(k) * 1e-3).collect();
        let kept = recorded(Decimation::Every(0.1), 1.5, &times);
        assert_eq!(kept.len(), 10_001);
        for (k, time) in (0_u32..).zip(kept) {
            assert!((time - (1.5 + 0.1 * f64::from(k))).abs() < 1e-9, "{k}: {time}");
        }
    }

    #[test]
    fn the_grid_is_met_at_seconds_since_1970() {
        for start in [1.7e9, -1.7e9] {
            let point = |k: u32| start + f64::from(k) * 1e-3;
            let times: Vec<f64> = (0..=20_000).map(point).collect();
            let expected: Vec<f64> = (0..=2000).map(|row| point(10 * row)).collect();
            assert_eq!(recorded(Decimation::Every(0.01), start, &times), expected);
        }
    }

    #[test]
    fn a_grid_between_the_points_takes_the_first_point_after_each_instant() {
        let times: Vec<f64> = (0..=10).map(f64::from).collect();
        assert_eq!(recorded(Decimation::Every(2.5), 0.0, &times), [0.0, 3.0, 5.0, 8.0, 10.0]);
    }

    #[test]
    fn a_step_over_several_grid_times_gives_one_row_and_an_event_no_further_row() {
        let times = [0.0, 0.0, 3.5, 3.5, 3.9, 4.0];
        assert_eq!(recorded(Decimation::Every(1.0), 0.0, &times), [0.0, 3.5, 4.0]);
        assert_eq!(recorded(Decimation::All, 0.0, &times), times);
    }

    #[test]
    fn every_third_point_starts_with_the_first() {
        let times: Vec<f64> = (0..8).map(f64::from).collect();
        assert_eq!(recorded(Decimation::Nth(3), 0.0, &times), [0.0, 3.0, 6.0]);
    }

    #[test]
    fn a_restored_state_continues_with_the_same_points() {
        let times: Vec<f64> = (0..100).map(|k| f64::from(k) * 0.07).collect();
        for decimation in [Decimation::Every(0.2), Decimation::Nth(7), Decimation::All] {
            let mut due = Due::new(decimation, 0.0);
            let mut kept: Vec<f64> = times[..41].iter().copied().filter(|t| due.at(*t)).collect();
            let text = serde_json::to_string(&due).unwrap();
            let mut resumed: Due = serde_json::from_str(&text).unwrap();
            kept.extend(times[41..].iter().filter(|time| resumed.at(**time)));
            assert_eq!(kept, recorded(decimation, 0.0, &times), "{decimation:?}");
        }
    }
}
