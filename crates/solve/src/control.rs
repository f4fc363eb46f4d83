//! The next step from the error of the last.

use serde::{Deserialize, Serialize};

/// Part of the step that would just meet the tolerance.
const SAFETY: f64 = 0.9;
/// Limits of one change of the step.
const SHRINK: f64 = 0.2;
const GROW: f64 = 5.0;
/// Errors below this count as this much, so that one error of zero is no reason for a leap.
const LEAST: f64 = 1e-10;
/// Part of the size asked for below which a step was cut short, and not by the rounding of times.
const CUT: f64 = 1.0 - 1e-9;

/// Smallest and largest step in s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SizeBounds {
    /// The smallest step that is tried.
    pub smallest: f64,
    /// The largest step.
    pub largest: f64,
}

impl SizeBounds {
    fn clamp(self, size: f64) -> f64 {
        size.min(self.largest).max(self.smallest)
    }
}

/// The law of both controllers, for an error that goes as `H^q`:
///
/// `H_next / H = (e / e_0)^(-0.7/q) (e_before / e_0)^(0.4/q)`, `e_0 = 0.9^q`,
///
/// proportional and integral in log H and log e; it settles where `e = e_0`, at 0.9 times the step for
/// which `e = 1`. Gustafsson 1991, "Control theoretic techniques for stepsize selection in explicit
/// Runge-Kutta methods"; exponents: Hairer and Wanner 1996, section IV.2.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Law {
    exponent: f64,
    /// `e_before / e_0`; 1 where there is none.
    before: f64,
}

impl Law {
    fn new(exponent: f64) -> Self {
        Self { exponent, before: 1.0 }
    }

    fn factor(&mut self, error: f64) -> f64 {
        let now = error.max(LEAST) / SAFETY.powf(self.exponent);
        let (proportional, integral) = (0.4 / self.exponent, 0.3 / self.exponent);
        let factor = now.powf(-integral - proportional) * self.before.powf(proportional);
        self.before = now;
        factor.clamp(SHRINK, GROW)
    }

    /// 0.9 times the step with an error of 1, by one of `size` with that error.
    fn tolerable(&self, size: f64, error: f64) -> f64 {
        size * SAFETY * error.max(LEAST).powf(-1.0 / self.exponent)
    }

    /// Errors of a step cut short, or before an event, are no measure for those to come.
    fn forget(&mut self) {
        self.before = 1.0;
    }
}

/// What becomes of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// It stands.
    Accepted {
        /// Size of the next one in s.
        next: f64,
    },
    /// To be repeated from its begin.
    Rejected {
        /// With this size in s: half of it at most.
        retry: f64,
    },
    /// Even the smallest step does not meet the tolerance.
    Stuck,
}

/// Steps by an estimate of their error, to be repeated where it is too large.
///
/// The error e is relative to the tolerance: up to 1 the step stands ([`super::Scale::distance`]).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ErrorControl {
    bounds: SizeBounds,
    law: Law,
    /// The size asked for last.
    wanted: f64,
    rejected: bool,
}

impl ErrorControl {
    /// `exponent`: q of the estimate, `e = O(H^q)`; one more than the order of the method where
    /// it estimates the error of one step. At least 1 is taken.
    #[must_use]
    pub fn new(bounds: SizeBounds, exponent: f64) -> Self {
        let law = Law::new(exponent.max(1.0));
        Self { bounds, law, wanted: bounds.smallest, rejected: false }
    }

    /// Judges a step of `size` s with that error; not a number counts as infinite.
    ///
    /// A step that was shorter than asked for, to end at an event or a stop time, does not make the
    /// following ones short.
    pub fn judge(&mut self, size: f64, error: f64) -> Verdict {
        if error.is_nan() || error > 1.0 {
            return self.reject(size, error);
        }
        let mut next = size * self.law.factor(error);
        if self.rejected {
            next = next.min(size);
        }
        if size < CUT * self.wanted {
            next = next.max(self.wanted.min(self.law.tolerable(size, error)));
            self.law.forget();
        }
        self.rejected = false;
        self.wanted = self.bounds.clamp(next);
        Verdict::Accepted { next: self.wanted }
    }

    fn reject(&mut self, size: f64, error: f64) -> Verdict {
        if size <= self.bounds.smallest {
            return Verdict::Stuck;
        }
        let fit = SAFETY * error.powf(-1.0 / self.law.exponent);
        let factor = if fit.is_finite() { fit.clamp(SHRINK, 0.5) } else { SHRINK };
        self.rejected = true;
        self.wanted = self.bounds.clamp(size * factor);
        Verdict::Rejected { retry: self.wanted }
    }

    /// Forgets the last error, as after an event.
    pub fn forget(&mut self) {
        self.law.forget();
    }
}

/// Steps by a measure that goes as `H^q`, nothing repeated: the increment of the connected signals
/// (q = 1), or the residual of energy.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ForwardControl {
    bounds: SizeBounds,
    law: Law,
    /// The size asked for last.
    wanted: f64,
}

impl ForwardControl {
    /// `exponent`: q of the measure. At least 1 is taken.
    #[must_use]
    pub fn new(bounds: SizeBounds, exponent: f64) -> Self {
        Self { bounds, law: Law::new(exponent.max(1.0)), wanted: bounds.smallest }
    }

    /// The next step in s after one of `size` s, which was to have a measure of at most 1; not a
    /// number counts as infinite.
    ///
    /// A step that was shorter than asked for does not make the following ones short.
    pub fn next(&mut self, size: f64, measure: f64) -> f64 {
        let measure = if measure.is_nan() { f64::INFINITY } else { measure };
        let measure = measure.min(1.0 / LEAST);
        let mut next = size * self.law.factor(measure);
        if size < CUT * self.wanted {
            next = next.max(self.wanted.min(self.law.tolerable(size, measure)));
            self.law.forget();
        }
        self.wanted = self.bounds.clamp(next);
        self.wanted
    }

    /// Forgets the last measure, as after an event.
    pub fn forget(&mut self) {
        self.law.forget();
    }
}

/// A power bond at the end of a step: two signals whose product is a power, as the receiving FMUs
/// took them to be and as the sending ones then found them. Both in the unit of the sending end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bond {
    /// The first signal: its extrapolation at the end of the step, its value there.
    pub first: (f64, f64),
    /// The second signal, likewise.
    pub second: (f64, f64),
}

impl Bond {
    /// `first_taken second_found - first_found second_taken`: power that one FMU gave and the
    /// other did not get. Zero where both extrapolations are right.
    #[must_use]
    pub fn residual(&self) -> f64 {
        self.first.0 * self.second.1 - self.first.1 * self.second.0
    }

    /// `|first_found second_found|`.
    #[must_use]
    pub fn power(&self) -> f64 {
        (self.first.1 * self.second.1).abs()
    }
}

/// Steps by the energy that power bonds lost or made, nothing repeated (ECCO).
///
/// `e = sqrt(1/n sum_k (dP_k / (absolute N_k + relative P_k))^2)` with the power residual `dP_k` of
/// [`Bond::residual`], `P_k` the largest power that bond k has had so far, `N_k` the product of the nominals of its
/// signals. What a bond loses until t is then about `relative P_k (t - t0)`.
/// Sadjina, Kyllingstad, Skjong and Pedersen 2017, "Energy conservation and power bonds in
/// co-simulations: non-iterative adaptive step size control and error estimation", weigh the energy
/// `dP_k H` by an energy that has to be stated; the power so far takes its place here.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EnergyControl {
    control: ForwardControl,
    relative: f64,
    floors: Vec<f64>,
    largest: Vec<f64>,
}

impl EnergyControl {
    /// `exponent`: that of the power residual, the order of the extrapolation and one: 1 for held
    /// inputs, 2 for lines. `nominals`: `N_k`.
    #[must_use]
    pub fn new(
        bounds: SizeBounds,
        exponent: f64,
        (relative, absolute): (f64, f64),
        nominals: &[f64],
    ) -> Self {
        let least = |value: f64| if value > 0.0 { value } else { f64::MIN_POSITIVE };
        Self {
            control: ForwardControl::new(bounds, exponent),
            relative,
            floors: nominals.iter().map(|nominal| least(absolute * nominal)).collect(),
            largest: vec![0.0; nominals.len()],
        }
    }

    /// The measure e of a step after which the bonds are as given.
    pub fn measure(&mut self, bonds: &[Bond]) -> f64 {
        if bonds.is_empty() {
            return 0.0;
        }
        let (mut sum, mut count) = (0.0, 0.0);
        for ((bond, floor), largest) in bonds.iter().zip(&self.floors).zip(&mut self.largest) {
            *largest = largest.max(bond.power());
            sum += (bond.residual() / (floor + self.relative * *largest)).powi(2);
            count += 1.0;
        }
        f64::sqrt(sum / count)
    }

    /// The next step in s after one of `size` s, after which the bonds are as given.
    pub fn next(&mut self, size: f64, bonds: &[Bond]) -> f64 {
        let measure = self.measure(bonds);
        self.control.next(size, measure)
    }

    /// Forgets the last measure, as after an event.
    pub fn forget(&mut self) {
        self.control.forget();
    }
}

#[cfg(test)]
#[path = "control/tests.rs"]
mod tests;
