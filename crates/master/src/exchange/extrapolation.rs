//! Polynomials of an input over a step, from known values and derivatives of its source.

use crate::algorithm::Extrapolation;

/// The polynomial `value + slope s + curvature s^2 / 2`, with the time s since the start of the
/// step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Polynomial {
    pub(super) value: f64,
    pub(super) slope: f64,
    pub(super) curvature: f64,
}

/// Known values of an output: at the start of its last step and of the two steps before, and at the end of the last
/// step. Derivatives at the start, if the FMU provides them.
#[derive(Clone, Copy, Debug)]
pub(super) struct OutputHistory {
    pub(super) earlier: f64,
    pub(super) before: f64,
    pub(super) start: f64,
    pub(super) end: f64,
    pub(super) slope: Option<f64>,
    pub(super) curvature: Option<f64>,
    /// Whether the output jumps at communication points, so that its past values do not determine its slope.
    pub(super) jumps: bool,
    /// Sizes of the last three steps in s.
    pub(super) earlier_size: f64,
    pub(super) last_size: f64,
    pub(super) size: f64,
}

impl Polynomial {
    pub(super) fn held(value: f64) -> Self {
        Self { value, slope: 0.0, curvature: 0.0 }
    }

    /// Returns the same polynomial with its origin moved by `lead` s.
    pub(super) fn later(self, lead: f64) -> Self {
        if lead == 0.0 {
            return self;
        }
        Self {
            value: self.value + lead * (self.slope + 0.5 * lead * self.curvature),
            slope: self.slope + lead * self.curvature,
            curvature: self.curvature,
        }
    }

    /// Returns the value after `size` s.
    pub(super) fn end(self, size: f64) -> f64 {
        self.later(size).value
    }

    /// Returns the mean over `size` s.
    pub(super) fn mean(self, size: f64) -> f64 {
        self.value + size * (self.slope / 2.0 + size * self.curvature / 6.0)
    }
}

impl OutputHistory {
    /// Returns the polynomial over a step whose end values are not known yet. Constant if a
    /// derivative of the output is NaN or infinite, as some FMUs return it at the start time.
    pub(super) fn extrapolated(&self, extrapolation: Extrapolation) -> Polynomial {
        let finite = |derivative: Option<f64>| derivative.is_none_or(f64::is_finite);
        if !(finite(self.slope) && finite(self.curvature)) {
            return Polynomial::held(self.start);
        }
        let quotient = (self.start - self.before) / self.last_size;
        let (slope, curvature) = match extrapolation {
            Extrapolation::Hold => (0.0, 0.0),
            Extrapolation::Quadratic if self.jumps => {
                (self.slope.unwrap_or(0.0), self.curvature.unwrap_or(0.0))
            }
            _ if self.jumps => (self.slope.unwrap_or(0.0), 0.0),
            Extrapolation::Limited => (self.limited(quotient), 0.0),
            Extrapolation::Linear => (self.slope.unwrap_or(quotient), 0.0),
            Extrapolation::Quadratic => self.parabola(quotient),
        };
        Polynomial { value: self.start, slope, curvature }
    }

    /// Minmod limiter: returns the smaller of derivative and difference quotient by magnitude, or 0 if
    /// their signs differ; without a derivative, the difference quotient.
    fn limited(&self, quotient: f64) -> f64 {
        let Some(slope) = self.slope else { return quotient };
        if slope * quotient <= 0.0 {
            0.0
        } else if slope.abs() < quotient.abs() {
            slope
        } else {
            quotient
        }
    }

    /// Returns slope and curvature at the start: the output derivatives if both are known; otherwise of the parabola
    /// with the known slope through the value before, or of the parabola through the last three values.
    fn parabola(&self, quotient: f64) -> (f64, f64) {
        match (self.slope, self.curvature) {
            (Some(slope), Some(curvature)) => (slope, curvature),
            (Some(slope), None) => (slope, 2.0 * (slope - quotient) / self.last_size),
            (None, _) => {
                let earlier = (self.before - self.earlier) / self.earlier_size;
                let curvature = 2.0 * (quotient - earlier) / (self.last_size + self.earlier_size);
                (quotient + 0.5 * curvature * self.last_size, curvature)
            }
        }
    }

    /// Returns the polynomial over a step whose end values are known. A signal that jumps is constant, because no
    /// values between the values before and after the jump occur.
    pub(super) fn interpolated(&self, extrapolation: Extrapolation) -> Polynomial {
        let slope = (self.end - self.start) / self.size;
        match extrapolation {
            _ if self.jumps => Polynomial::held(self.end),
            Extrapolation::Hold => Polynomial::held(self.end),
            Extrapolation::Limited | Extrapolation::Linear => {
                Polynomial { value: self.start, slope, curvature: 0.0 }
            }
            Extrapolation::Quadratic => {
                let quotient = (self.start - self.before) / self.last_size;
                // Newton's divided difference if the derivative at the start is missing.
                let curvature = match self.slope.filter(|slope| slope.is_finite()) {
                    Some(derivative) => 2.0 * (slope - derivative) / self.size,
                    None => 2.0 * (slope - quotient) / (self.size + self.last_size),
                };
                let slope = slope - 0.5 * curvature * self.size;
                Polynomial { value: self.start, slope, curvature }
            }
        }
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact by construction")]
mod tests;
