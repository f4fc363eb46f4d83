//! The frequency axis, covered by intervals in which scales bound the structured singular value.

use super::blocks::{Block, balancing_exponents, scaled};
use super::interval::{Interval, Response};
use super::scales::Scales;
use crate::eigen::eigenvalues;
use crate::response::grid;
use crate::svd::ComplexSvd;
use crate::{Error, StateSpace};

/// Frequencies for each decade at which scales are searched first.
const PER_DECADE: u32 = 6;
/// The relative increase of the bound at frequencies where no scales prove it, or only on a short interval.
const RAISE: f64 = 5e-3;
/// Relative width of an interval below which the bound is raised.
const SHORT: f64 = 1e-3;
/// If the gap from zero ends below this fraction of the slowest frequency, scales for zero itself are searched.
const NEAR_ZERO: f64 = 1e-4;
const ROUNDS: usize = 3000;

/// The bound so far, and the intervals of frequency in which it is not proven yet.
pub(super) struct Cover<'a> {
    response: Response,
    blocks: &'a [Block],
    pub(super) bound: f64,
    /// The frequency at which the bound was raised last.
    pub(super) frequency: f64,
    pub(super) intervals: usize,
    gaps: Vec<Interval>,
    /// Frequencies at which scales are searched next, the last one first.
    candidates: Vec<f64>,
    /// The slowest and the fastest frequency between which the response changes most.
    slowest: f64,
    fastest: f64,
}

impl<'a> Cover<'a> {
    /// Starts with the bound `enough` and no covered interval. `system` is stable and in continuous time.
    pub(super) fn new(
        system: &StateSpace,
        blocks: &'a [Block],
        enough: f64,
    ) -> Result<Self, Error> {
        let response = Response::new(system);
        let modes = eigenvalues(&system.a)?;
        let fastest = modes.iter().map(|mode| mode.norm()).fold(0.0, f64::max);
        let mut all = grid(system, &modes, PER_DECADE);
        all.extend(modes.iter().flat_map(|mode| [mode.im.abs(), mode.norm()]));
        all.retain(|frequency| *frequency > 0.0);
        let slowest = all.iter().copied().fold(fastest, f64::min);
        let mut candidates = Vec::with_capacity(all.len());
        for frequency in all {
            let m = response.at(frequency)?;
            let balanced = scaled(&m, &balancing_exponents(&m, blocks));
            candidates.push((ComplexSvd::new(&balanced)?.values()[0], frequency));
        }
        candidates.sort_by(|x, y| x.0.total_cmp(&y.0));
        Ok(Self {
            response,
            blocks,
            bound: enough,
            frequency: 0.0,
            intervals: 0,
            gaps: vec![Interval { from: 0.0, to: f64::INFINITY }],
            candidates: candidates.into_iter().map(|(_, frequency)| frequency).collect(),
            slowest,
            fastest,
        })
    }

    /// Covers the whole frequency axis; false if `ending` returned true before.
    pub(super) fn complete(&mut self, ending: &dyn Fn() -> bool) -> Result<bool, Error> {
        for _ in 0..ROUNDS {
            let Some(frequency) = self.next_frequency() else { return Ok(true) };
            if ending() {
                return Ok(false);
            }
            self.cover(frequency)?;
        }
        Err(Error::NotConverged { what: "the structured singular value", iterations: ROUNDS })
    }

    /// The next frequency that is not covered; None if all are covered.
    fn next_frequency(&mut self) -> Option<f64> {
        let gap = *self.gaps.last()?;
        while let Some(frequency) = self.candidates.pop() {
            let inside = |gap: &Interval| (gap.from..=gap.to).contains(&frequency);
            if self.gaps.iter().any(inside) {
                return Some(frequency);
            }
        }
        Some(match (gap.from, gap.to) {
            // At zero M is real, and a part of it is often zero, so that scales for zero hold nowhere else.
            (0.0, to) if to > NEAR_ZERO * self.slowest => (0.1 * to).min(self.slowest),
            (0.0, _) => 0.0,
            (from, f64::INFINITY) if from < 1e9 * self.fastest => 10.0 * from.max(self.fastest),
            (_, f64::INFINITY) => f64::INFINITY,
            (from, to) => (from * to).sqrt().clamp(from, to),
        })
    }

    /// Proves the bound, raised if necessary, on an interval about `frequency`, which is removed from the gaps.
    fn cover(&mut self, frequency: f64) -> Result<(), Error> {
        let m = self.response.at(frequency)?;
        let shortest = SHORT * frequency.min(f64::MAX).max(SHORT * SHORT * self.fastest);
        let mut raise = RAISE;
        loop {
            let mut scales = Scales::search(&m, self.blocks, self.bound)?;
            if scales.bound > self.bound {
                // The scales hold for every larger bound too.
                scales.bound *= 1.0 + RAISE;
                self.raise(scales.bound, frequency)?;
            }
            let interval = self.response.interval(&scales, frequency)?;
            let long = |interval: &Interval| {
                frequency.is_infinite() || interval.to - interval.from > shortest
            };
            if let Some(interval) = interval.filter(long) {
                self.intervals += 1;
                self.remove(interval);
                return Ok(());
            }
            self.raise(self.bound * (1.0 + raise), frequency)?;
            raise *= 2.0;
        }
    }

    /// Sets a larger bound; an infinite one is an error.
    fn raise(&mut self, bound: f64, frequency: f64) -> Result<(), Error> {
        (self.bound, self.frequency) = (bound, frequency);
        if bound.is_finite() {
            return Ok(());
        }
        Err(Error::Overflow { what: "the structured singular value" })
    }

    fn remove(&mut self, covered: Interval) {
        let rest = |gap: &Interval| {
            if covered.to <= gap.from || covered.from >= gap.to {
                // An open interval does not contain its ends.
                return vec![*gap];
            }
            let before = Interval { from: gap.from, to: covered.from };
            let after = Interval { from: covered.to, to: gap.to };
            let ends_inside = covered.to <= gap.to && covered.to.is_finite();
            let before = (covered.from >= gap.from).then_some(before);
            before.into_iter().chain(ends_inside.then_some(after)).collect()
        };
        self.gaps = self.gaps.iter().flat_map(rest).collect();
    }
}
