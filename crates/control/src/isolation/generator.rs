//! Synthesis of one residual with a prescribed pattern.

use super::DisturbedPlant;
use super::decoupled::DecoupledPart;
use super::direction::{Direction, strongest_weakest};
use super::family::{Family, unit_gain};
use super::verification::decoupling_error;
use crate::residual::ResidualGenerator;
use crate::{Domain, Error, StateSpace, check};
use nalgebra::{Complex, DMatrix};

/// A gain below this multiple of the accuracy of the family counts as zero.
const ACCURACIES: f64 = 10.0;
/// A decoupling error up to this comes from rounding of the data; a larger error comes from a coupling that counted as
/// zero, so that smaller tolerances are tried.
const DECOUPLED: f64 = 1e-6;
/// While the decoupling error is above `DECOUPLED`, a tolerance above this is divided by 100, so that every tolerance
/// stays above 1e-14.
const SMALLEST_TOLERANCE: f64 = 1e-12;
/// The largest decoupling error that is accepted.
const ALLOWED: f64 = 1e-3;
/// Fraction of the mean variance that is added to W, so that W is positive definite.
const REGULARISATION: f64 = 1e-12;

/// Requirements of a residual.
#[derive(Debug, Clone, PartialEq)]
pub struct Requirements {
    /// Poles of the generator, real and stable: s < 0, or 1e-3 < z < 1 in sampled time. A generator of
    /// order k has the first k of them; the last one is repeated as often as necessary.
    pub poles: Vec<f64>,
    /// The frequency, at least 0, in rad per unit of time, at which the residual must respond to each fault of its
    /// pattern; 0 for constant faults.
    pub frequency: f64,
    /// The smallest accepted gain of a fault, relative to its largest gain for the same effect of noise, in (0, 1).
    pub quality: f64,
    /// Relative singular values below this count as zero. If the residual then is not decoupled up to
    /// 1e-6 (see [`Residual::decoupling_error`]), smaller values are tried.
    pub tolerance: f64,
    /// Standard deviation of the noise of each measurement, above zero; None means 1 for each.
    pub noise: Option<Vec<f64>>,
}

impl Requirements {
    /// Constant faults, all poles equal to `pole`, quality 1e-3, tolerance 1e-7, equal noise.
    #[must_use]
    pub fn with_pole(pole: f64) -> Self {
        let poles = vec![pole];
        Self { poles, frequency: 0.0, quality: 1e-3, tolerance: 1e-7, noise: None }
    }

    /// The first k poles; the last one is repeated if there are fewer.
    pub(super) fn poles(&self, k: usize) -> Vec<f64> {
        let last = self.poles[self.poles.len() - 1];
        (0..k).map(|at| self.poles.get(at).copied().unwrap_or(last)).collect()
    }

    /// The corner frequency of the fastest pole in rad per unit of time, which is its decay rate.
    pub(super) fn fastest(&self, domain: Domain) -> f64 {
        let rate = |pole: &f64| match domain {
            Domain::Continuous => -pole,
            Domain::Sampled { period } => -pole.ln() / period,
        };
        self.poles.iter().map(rate).fold(0.0, f64::max)
    }

    /// Checks the ranges of all requirements, and the number of entries of the noise.
    pub(super) fn check(&self, measurements: usize, domain: Domain) -> Result<(), Error> {
        let (low, high, rule) = match domain {
            Domain::Continuous => {
                (f64::NEG_INFINITY, 0.0, "finite numbers below zero, at least one")
            }
            Domain::Sampled { .. } => (1e-3, 1.0, "numbers above 1e-3 and below 1, at least one"),
        };
        let bad = |pole: &f64| !(*pole > low && *pole < high);
        let first_bad = self.poles.iter().copied().find(bad);
        if let Some(value) = first_bad.or(self.poles.is_empty().then_some(f64::NAN)) {
            return Err(Error::OutOfRange { name: "poles", value, rule });
        }
        let Self { frequency, quality, .. } = *self;
        let is_frequency = frequency >= 0.0 && frequency.is_finite();
        check::that(is_frequency, "frequency", frequency, "a finite number from 0")?;
        check::positive("tolerance", self.tolerance)?;
        let is_part = quality > 0.0 && quality < 1.0;
        check::that(is_part, "quality", quality, "above 0 and below 1")?;
        if let Some(noise) = &self.noise {
            noise.iter().try_for_each(|&size| check::positive("noise", size))?;
            check::length("noise", noise, measurements)?;
        }
        Ok(())
    }
}

/// A residual with a prescribed pattern.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Residual {
    /// The generator of one residual, of the least order for this pattern.
    pub generator: ResidualGenerator,
    /// The system from the faults f to the residual, with the poles of the generator. The columns of
    /// decoupled faults are zero up to rounding.
    pub from_faults: StateSpace,
    /// The gain of each fault at the required frequency; the largest of the pattern has the modulus 1. The
    /// gain of a single fault of the pattern at frequency 0 is 1.
    pub gains: Vec<Complex<f64>>,
    /// The smallest relative gain of the faults of the pattern. The gain of a fault is relative to the largest gain
    /// that this fault can have for the same effect of noise.
    pub quality: f64,
    /// Number of modes of the plant that no command, disturbance or fault moves. Each is taken as zero; from other
    /// initial values it may appear in the residual.
    pub unreachable: usize,
    /// The smallest relative singular value that counted as nonzero, and the largest that counted
    /// as zero: the wider apart, the more certain the decoupling.
    pub rank_gap: (f64, f64),
    /// The largest response to a command, a disturbance or a decoupled fault, relative to the terms
    /// that cancel in it, evaluated for the given plant at several frequencies.
    pub decoupling_error: f64,
}

/// Computes a residual generator of least order that responds to the faults with `pattern[fault]`
/// and is decoupled from commands, disturbances and all other faults.
///
/// `pattern`: one entry per fault, at least one true. Without noise and without faults of the pattern the residual
/// decays with the prescribed poles for all commands, disturbances and decoupled faults, from all initial states of the
/// reachable part of the plant. Method, cost and sources: see [`crate::isolation`]; about 100 n^3 multiplications for
/// each order that is tried. The order is the least one of a generator with one residual for which every fault of the
/// pattern has a gain at the required frequency and the required quality.
///
/// # Example
///
/// x1' = -x1 + u + f1, x2' = -2 x2 + x1 + d, both measured: f1 is decoupled from d.
///
/// ```
/// use control::Domain;
/// use control::isolation::{DisturbedPlant, Requirements, residual_generator};
/// use nalgebra::DMatrix;
/// let plant = DisturbedPlant {
///     a: DMatrix::from_row_slice(2, 2, &[-1.0, 0.0, 1.0, -2.0]),
///     b_u: DMatrix::from_row_slice(2, 1, &[1.0, 0.0]),
///     b_d: DMatrix::from_row_slice(2, 1, &[0.0, 1.0]),
///     b_f: DMatrix::from_row_slice(2, 1, &[1.0, 0.0]),
///     c: DMatrix::identity(2, 2),
///     d_u: DMatrix::zeros(2, 1),
///     d_d: DMatrix::zeros(2, 1),
///     d_f: DMatrix::zeros(2, 1),
///     domain: Domain::Continuous,
/// };
/// let residual = residual_generator(&plant, &[true], &Requirements::with_pole(-5.0))?;
/// // r = (5 / (s + 5)) ((s + 1) y1 - u), of order 1; a constant fault has the gain 1.
/// assert_eq!(residual.generator.a, DMatrix::from_element(1, 1, -5.0));
/// assert!((residual.generator.d_y[(0, 0)] - 5.0).abs() < 1e-12);
/// assert!((residual.gains[0] - 1.0).norm() < 1e-12);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::FaultNotIsolable`] names a fault of the pattern to which no such residual responds at the
/// required frequency; [`Error::OutOfRange`] for `requirements`, and if no order reaches the quality;
/// [`Error::ResidualTooLarge`] if the decoupling error of the result is above 1e-3 for all tolerances; same
/// as [`DisturbedPlant::check`]; [`Error::Shape`] if `pattern` has not one entry per fault or the noise not
/// one per measurement; [`Error::Empty`] if no entry of `pattern` is true; [`Error::NotPositiveDefinite`],
/// [`Error::NotConverged`], [`Error::Overflow`] if an inner computation fails.
pub fn residual_generator(
    plant: &DisturbedPlant,
    pattern: &[bool],
    requirements: &Requirements,
) -> Result<Residual, Error> {
    plant.check()?;
    requirements.check(plant.c.nrows(), plant.domain)?;
    check::length("pattern", pattern, plant.b_f.ncols())?;
    if !pattern.contains(&true) {
        return Err(Error::Empty { matrix: "pattern", actual: (0, 1) });
    }
    // The tolerance 0 keeps all modes.
    let (balanced, _) = plant.reachable_part(0.0)?;
    let verified = |tolerance: f64| {
        let mut residual = with_tolerance(plant, pattern, requirements, tolerance)?;
        let fastest = requirements.fastest(plant.domain);
        residual.decoupling_error =
            decoupling_error(&balanced, pattern, &residual.generator, fastest);
        Ok(residual)
    };
    let mut best: Residual = verified(requirements.tolerance)?;
    let mut tolerance = requirements.tolerance;
    while best.decoupling_error > DECOUPLED && tolerance > SMALLEST_TOLERANCE {
        tolerance *= 0.01;
        match verified(tolerance) {
            Ok(other) if other.decoupling_error < best.decoupling_error => best = other,
            _ => {}
        }
    }
    if best.decoupling_error <= ALLOWED {
        return Ok(best);
    }
    let (equation, residual) = ("the decoupling", best.decoupling_error);
    Err(Error::ResidualTooLarge { equation, residual, allowed: ALLOWED })
}

/// The generator for which relative singular values below `tolerance` count as zero.
fn with_tolerance(
    plant: &DisturbedPlant,
    pattern: &[bool],
    requirements: &Requirements,
    tolerance: f64,
) -> Result<Residual, Error> {
    let (reachable, unreachable) = plant.reachable_part(tolerance)?;
    let decoupled: Vec<bool> = pattern.iter().map(|responds| !responds).collect();
    let part = DecoupledPart::new(&reachable, &decoupled, tolerance)?;
    let first = pattern.iter().position(|&responds| responds).unwrap_or(0);
    let part = part.ok_or_else(|| not_isolable(pattern, first))?;
    let (family, direction) = least_order(&part, pattern, requirements, plant.domain)?;
    let factors = DMatrix::from_row_slice(1, direction.factors.len(), direction.factors.as_slice());
    let mut residual = realised(&part, family.member(&factors), requirements.frequency);
    residual.quality = direction.quality;
    residual.unreachable = unreachable;
    normalise(&mut residual, pattern);
    Ok(residual)
}

fn not_isolable(pattern: &[bool], fault: usize) -> Error {
    let decoupled = (1..=pattern.len()).filter(|&at| !pattern[at - 1]).collect();
    Error::FaultNotIsolable { fault: fault + 1, decoupled }
}

/// The family of least order in which every fault of the pattern has a gain, and its best member.
fn least_order(
    part: &DecoupledPart,
    pattern: &[bool],
    requirements: &Requirements,
    domain: Domain,
) -> Result<(Family, Direction), Error> {
    let faults: Vec<usize> = (0..pattern.len()).filter(|&fault| pattern[fault]).collect();
    let blocks = &part.blocks;
    let mut best: f64 = 0.0;
    let mut missing = Some(faults[0]);
    for k in 0..=blocks.len() {
        let (before, here) = match k {
            0 => (part.c.nrows(), blocks.first().copied().unwrap_or(0)),
            _ => (blocks[k - 1], blocks.get(k).copied().unwrap_or(0)),
        };
        // This order adds no generator to those of lower orders.
        if before == here {
            continue;
        }
        let family = Family::new(part, &requirements.poles(k), domain)?;
        let gains = dominant_part(&family.fault_gains(part, requirements.frequency));
        let zero = ACCURACIES * family.accuracy;
        let scale = family.fault_scale(part, requirements.frequency);
        let has_gain = |fault: usize| gains.column(fault).norm() > zero * scale[fault];
        missing = faults.iter().copied().find(|&fault| !has_gain(fault));
        if missing.is_some() {
            continue;
        }
        let ones = vec![1.0; part.h.ncols()];
        let sizes = requirements.noise.as_ref().unwrap_or(&ones);
        let mut noise = family.noise(part, sizes, requirements.fastest(domain));
        let mean = noise.trace().max(f64::MIN_POSITIVE);
        noise += DMatrix::identity(noise.nrows(), noise.nrows()) * (REGULARISATION * mean);
        let factor = noise.cholesky().ok_or(Error::NotPositiveDefinite { matrix: "W" })?;
        let direction = strongest_weakest(&gains.select_columns(&faults), &factor);
        if let Some(direction) = direction {
            if direction.quality >= requirements.quality {
                return Ok((family, direction));
            }
            best = best.max(direction.quality);
        }
    }
    if let Some(fault) = missing {
        return Err(not_isolable(pattern, fault));
    }
    let (name, rule) = ("the quality that can be reached", "at least the required one");
    Err(Error::OutOfRange { name, value: best, rule })
}

/// For each column the real or the imaginary part, the larger of the two.
fn dominant_part(gains: &DMatrix<Complex<f64>>) -> DMatrix<f64> {
    let mut parts = gains.map(|gain| gain.re);
    for (mut column, complex) in parts.column_iter_mut().zip(gains.column_iter()) {
        let imaginary = complex.map(|gain| gain.im);
        if imaginary.norm() > column.norm() {
            column.copy_from(&imaginary);
        }
    }
    parts
}

/// The generator of a family of one member.
fn realised(part: &DecoupledPart, family: Family, frequency: f64) -> Residual {
    let (k, domain) = (family.poles.len(), family.domain);
    let all =
        |rows: &[DMatrix<f64>], width: usize| DMatrix::from_fn(k, width, |i, j| rows[i][(0, j)]);
    let (t, l) = (all(&family.t, part.a.nrows()), all(&family.l, part.c.nrows()));
    let w = family.w;
    let mut f = DMatrix::from_diagonal(&nalgebra::DVector::from_column_slice(&family.poles));
    for at in 1..k {
        f[(at, at - 1)] = unit_gain(family.poles[at], domain);
    }
    let c = DMatrix::from_fn(1, k, |_, j| f64::from(u8::from(j + 1 == k)));
    let from_faults = StateSpace {
        a: f.clone(),
        b: &l * &part.d_f - &t * &part.b_f,
        c: c.clone(),
        d: &w * &part.d_f,
        domain,
    };
    Residual {
        gains: gains(&from_faults, frequency),
        from_faults,
        generator: ResidualGenerator {
            b_u: &t * &part.b_u - &l * &part.d_u,
            b_y: &l * &part.h + &t * &part.k,
            d_u: -(&w * &part.d_u),
            d_y: &w * &part.h,
            a: f,
            c,
            domain,
        },
        quality: 0.0,
        unreachable: 0,
        rank_gap: (part.gap.above, part.gap.below),
        decoupling_error: 0.0,
    }
}

/// The response of one residual to the faults at one frequency, through a chain of lags.
pub(super) fn gains(from_faults: &StateSpace, frequency: f64) -> Vec<Complex<f64>> {
    let StateSpace { a, b, c, d, domain } = from_faults;
    let s = domain.point(frequency);
    let gain = |fault: usize| {
        let mut below = Complex::new(0.0, 0.0);
        let mut sum = Complex::new(d[(0, fault)], 0.0);
        for at in 0..a.nrows() {
            let coupling = if at > 0 { a[(at, at - 1)] } else { 0.0 };
            below = (below * coupling + b[(at, fault)]) / (s - a[(at, at)]);
            sum += below * c[(0, at)];
        }
        sum
    };
    (0..b.ncols()).map(gain).collect()
}

/// Scales the residual so that the largest gain of a fault of the pattern has the modulus 1, and the larger
/// part of the first one, real or imaginary, is positive.
fn normalise(residual: &mut Residual, pattern: &[bool]) {
    let both = residual.gains.iter().zip(pattern);
    let responses: Vec<_> =
        both.filter(|(_, responds)| **responds).map(|(gain, _)| *gain).collect();
    let largest = responses.iter().map(|gain| gain.norm()).fold(0.0, f64::max);
    let first = responses[0];
    let sign = if first.re.abs() >= first.im.abs() { first.re } else { first.im };
    let scale = 1.0_f64.copysign(sign) / largest;
    let Residual { generator, from_faults, gains, .. } = residual;
    for m in [&mut generator.d_u, &mut generator.d_y, &mut from_faults.d] {
        *m *= scale;
    }
    // The states are scaled, so that C stays a unit vector.
    for m in [&mut generator.b_u, &mut generator.b_y, &mut from_faults.b] {
        *m *= scale;
    }
    for gain in gains {
        *gain *= scale;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requirements_out_of_range_are_refused_by_name() {
        let refused = |requirements: Requirements| match requirements.check(1, Domain::Continuous) {
            Err(Error::OutOfRange { name, .. }) => name,
            other => panic!("{other:?}"),
        };
        let good = Requirements::with_pole(-1.0);
        assert_eq!(good.check(1, Domain::Continuous), Ok(()));
        for frequency in [f64::NAN, f64::INFINITY, -1.0] {
            assert_eq!(refused(Requirements { frequency, ..good.clone() }), "frequency");
        }
        for quality in [f64::NAN, 0.0, 1.0] {
            assert_eq!(refused(Requirements { quality, ..good.clone() }), "quality");
        }
    }
}
