//! Step size control: the size of the next step from the error of the last one.

use serde::{Deserialize, Serialize};

/// Ratio of the chosen step to the largest step that meets the tolerance.
const SAFETY: f64 = 0.9;
/// Smallest and largest ratio of two consecutive steps.
const SHRINK: f64 = 0.2;
const GROW: f64 = 5.0;
/// Lower bound of errors, so that one error of zero does not cause a very large step.
const ERROR_FLOOR: f64 = 1e-10;
/// Ratio of the actual to the requested size below which a step counts as shortened, not as rounded.
const SHORTENED: f64 = 1.0 - 1e-9;

/// Smallest and largest step in s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SizeBounds {
    /// The smallest step.
    pub smallest: f64,
    /// The largest step.
    pub largest: f64,
}

impl SizeBounds {
    /// The nearest size within the bounds; the smallest step if the bounds are reversed.
    fn clamp(self, size: f64) -> f64 {
        size.min(self.largest).max(self.smallest)
    }
}

/// The control law of all controllers, for a step of size H with an error e proportional to `H^q`:
///
/// `H_next / H = (e / e_0)^(-0.7/q) (e_before / e_0)^(0.4/q)`, `e_0 = 0.9^q`,
///
/// a PI controller in log H and log e, with the error `e_before` of the previous step. Its steady state is `e = e_0`,
/// 0.9 times the step with `e = 1`. Gustafsson 1991, "Control theoretic techniques for stepsize selection in explicit
/// Runge-Kutta methods"; exponents: Hairer and Wanner 1996, section IV.2.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Law {
    /// The exponent q of an error proportional to `H^q`.
    exponent: f64,
    /// The previous error relative to the target error, `e_before / e_0`; 1 without a previous error.
    before: f64,
}

impl Law {
    fn new(exponent: f64) -> Self {
        Self { exponent, before: 1.0 }
    }

    /// Returns `H_next / H`, from 0.2 to 5, and keeps the error for the next step.
    fn factor(&mut self, error: f64) -> f64 {
        let now = error.max(ERROR_FLOOR) / SAFETY.powf(self.exponent);
        let (proportional, integral) = (0.4 / self.exponent, 0.3 / self.exponent);
        let factor = now.powf(-integral - proportional) * self.before.powf(proportional);
        self.before = now;
        factor.clamp(SHRINK, GROW)
    }

    /// Returns 0.9 times the step for which the error is 1, given the error of a step of `size`.
    fn tolerable_size(&self, size: f64, error: f64) -> f64 {
        size * SAFETY * error.max(ERROR_FLOOR).powf(-1.0 / self.exponent)
    }

    /// Clears the previous error, which does not predict the next one after a shortened step or an event.
    fn forget(&mut self) {
        self.before = 1.0;
    }
}

/// The result of the error test of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// The step is accepted.
    Accepted {
        /// Size of the next step in s.
        next: f64,
    },
    /// The step must be repeated from its start.
    Rejected {
        /// Size of the repeated step in s: at most half of the rejected one, but at least the smallest step.
        retry: f64,
    },
    /// The smallest step does not meet the tolerance.
    Stuck,
}

/// Step size control by an error estimate; a step with too large an error is repeated.
///
/// A step is accepted if its error relative to the tolerance ([`super::Scale::distance`]) is at most 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ErrorControl {
    bounds: SizeBounds,
    law: Law,
    /// The last size that the controller returned.
    requested: f64,
    rejected: bool,
}

impl ErrorControl {
    /// Creates a controller for an estimate `e = O(H^q)` with q = `exponent`, at least 1. For the local
    /// error of a method q is the order of the method plus 1.
    #[must_use]
    pub fn new(bounds: SizeBounds, exponent: f64) -> Self {
        let law = Law::new(exponent.max(1.0));
        Self { bounds, law, requested: bounds.smallest, rejected: false }
    }

    /// Accepts or rejects a step of `size` s with this error; NaN counts as infinite.
    ///
    /// The step after a repeated step is not larger than the repeated one. A step that was shortened to end at an
    /// event or a stop time does not shorten the following steps.
    pub fn judge(&mut self, size: f64, error: f64) -> Verdict {
        if error.is_nan() || error > 1.0 {
            return self.reject(size, error);
        }
        let mut next = size * self.law.factor(error);
        if self.rejected {
            next = next.min(size);
        }
        if size < SHORTENED * self.requested {
            next = next.max(self.requested.min(self.law.tolerable_size(size, error)));
            self.law.forget();
        }
        self.rejected = false;
        self.requested = self.bounds.clamp(next);
        Verdict::Accepted { next: self.requested }
    }

    /// Rejects a step; [`Verdict::Stuck`] for the smallest one.
    fn reject(&mut self, size: f64, error: f64) -> Verdict {
        if size <= self.bounds.smallest {
            return Verdict::Stuck;
        }
        let fit = SAFETY * error.powf(-1.0 / self.law.exponent);
        let factor = if fit.is_finite() { fit.clamp(SHRINK, 0.5) } else { SHRINK };
        self.rejected = true;
        self.requested = self.bounds.clamp(size * factor);
        Verdict::Rejected { retry: self.requested }
    }

    /// Clears the previous error, for example after an event.
    pub fn forget(&mut self) {
        self.law.forget();
    }
}

/// Step size control without repeated steps, by a measure proportional to `H^q`: the increment of the
/// connected signals (q = 1) or the energy residual.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ForwardControl {
    bounds: SizeBounds,
    law: Law,
    /// The last size that the controller returned.
    requested: f64,
}

impl ForwardControl {
    /// Creates a controller for a measure proportional to `H^q` with q = `exponent`, at least 1.
    #[must_use]
    pub fn new(bounds: SizeBounds, exponent: f64) -> Self {
        Self { bounds, law: Law::new(exponent.max(1.0)), requested: bounds.smallest }
    }

    /// Returns the size of the next step in s after a step of `size` s with this `measure`. The target of the measure
    /// is at most 1; NaN counts as infinite.
    ///
    /// A step that was shortened to end at an event or a stop time does not shorten the following steps.
    pub fn next(&mut self, size: f64, measure: f64) -> f64 {
        let measure = if measure.is_nan() { f64::INFINITY } else { measure };
        let measure = measure.min(1.0 / ERROR_FLOOR);
        let mut next = size * self.law.factor(measure);
        if size < SHORTENED * self.requested {
            next = next.max(self.requested.min(self.law.tolerable_size(size, measure)));
            self.law.forget();
        }
        self.requested = self.bounds.clamp(next);
        self.requested
    }

    /// Clears the previous measure, for example after an event.
    pub fn forget(&mut self) {
        self.law.forget();
    }
}

/// A power bond at the end of a step: two signals whose product is a power, each as extrapolated for
/// the receiving FMU and as computed by the sending FMU, in the unit of the sending end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bond {
    /// The first signal at the end of the step: extrapolated and computed value.
    pub first: (f64, f64),
    /// The second signal at the end of the step: extrapolated and computed value.
    pub second: (f64, f64),
}

impl Bond {
    /// Returns the power residual `first_extrapolated second_computed - first_computed
    /// second_extrapolated`: power that one FMU sent and the other did not receive; zero for exact extrapolations.
    #[must_use]
    pub fn residual(&self) -> f64 {
        self.first.0 * self.second.1 - self.first.1 * self.second.0
    }

    /// Returns the transferred power `|first_computed second_computed|`.
    #[must_use]
    pub fn power(&self) -> f64 {
        (self.first.1 * self.second.1).abs()
    }
}

/// Energy-conservation-based step size control (ECCO), without repeated steps.
///
/// The measure is `e = sqrt(1/n sum_k (dP_k / (absolute N_k + relative P_k))^2)` with the power
/// residual `dP_k` of [`Bond::residual`], the largest power `P_k` of bond k so far, and the product
/// `N_k` of the nominals of its signals. The energy error of a bond from t0 to t is then about
/// `relative P_k (t - t0)`. Sadjina, Kyllingstad, Skjong and Pedersen 2017, "Energy conservation and
/// power bonds in co-simulations: non-iterative adaptive step size control and error estimation",
/// relate the energy `dP_k H` to an energy given by the user; here the largest power replaces it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EnergyControl {
    control: ForwardControl,
    relative: f64,
    /// The absolute error bound of the power of each bond, `absolute N_k`, above zero.
    floors: Vec<f64>,
    /// The largest power `P_k` of each bond so far.
    largest: Vec<f64>,
}

impl EnergyControl {
    /// Creates a controller. `exponent` is the exponent q of the power residual, the order of the
    /// extrapolation plus 1: 1 for constant, 2 for linear extrapolation. `nominals` are the `N_k`.
    #[must_use]
    pub fn new(
        bounds: SizeBounds,
        exponent: f64,
        relative: f64,
        absolute: f64,
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

    /// Returns the measure e of a step from the bonds at the end of the step, one for each nominal; 0 without bonds.
    /// Updates the largest powers.
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

    /// Returns the size of the next step in s from the `size` of the last step in s and the bonds at its end.
    pub fn next(&mut self, size: f64, bonds: &[Bond]) -> f64 {
        let measure = self.measure(bonds);
        self.control.next(size, measure)
    }

    /// Clears the previous measure, for example after an event. The largest powers are kept.
    pub fn forget(&mut self) {
        self.control.forget();
    }
}

#[cfg(test)]
#[path = "control/tests.rs"]
mod tests;
