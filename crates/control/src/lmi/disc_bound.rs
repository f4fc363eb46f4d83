//! A lower bound of the H-infinity norm for gains whose eigenvalues are in a disc.

use super::noiseless::{ROUNDING, check_observer};
use super::{Disc, Performance};
use crate::check::as_number;
use crate::svd::Svd;
use crate::zeros::{Zeros, zeros};
use crate::{Error, check};
use nalgebra::{Complex, DMatrix, DVector};

/// det H of [`disc_norm_lower_bound`] is evaluated at `POINTS` points s > 0 on each side of 1 / (least Re(-1 / s) of
/// the region), `PER_DECADE` of them per decade.
const POINTS: i32 = 60;
const PER_DECADE: f64 = 20.0;
/// Bisections for the sum of the inverse eigenvalues.
const BISECTIONS: usize = 30;

/// Bounds the H-infinity norm from w to z = E x, x' = (A - L C) x + B w, from below, for every L that places all
/// eigenvalues in a disc of the left half plane, in continuous time.
///
/// `disc`, `decay`: all eigenvalues s have |s - center| <= radius and a real part of at most -`decay` <= 0.
/// So |s| <= R = radius - center, for a center above 0 the root of radius^2 - center^2. `a`: n x n.
/// E B, q x q, must have an inverse; w enters y through the states only (D = 0). With
/// T(s) = E (s I - A + L C)^-1 B, the first bound is
///
/// ```text
/// gamma >= (|det E B| (n - q)^(n - q) q^q / n^n)^(1/q) / R
/// ```
///
/// In det T = det(E B) N(s) / det(s I - A + L C), N has degree n - q and leading coefficient 1. Once the zeros of N are
/// mirrored into the left half plane, |det T| at any s > 0 is at most its maximum on the imaginary axis.
/// s = (n - q) R / q gives the largest bound.
///
/// If C is q x n and E A = 0 (constant faults), H = I - s (E B)^-1 T has H(0) = I. With `v_i` = -1 / `s_i` for the
/// eigenvalues `s_i` of A - L C, det H(s) is the product of (1 - s / `z_j`) over the invariant zeros `z_j` of
/// (A, B, C), divided by the product of (1 + s `v_i`). This gives two bounds, which depend on L through the `v_i` only:
///
/// ```text
/// gamma >= |sum of v_i - zeta| / sum of 1 / sigma_i(E B),     zeta = sum of -1 / z_j           (the trace at s = 0)
/// gamma >= sigma_min(E B) (1 - |det H(s)|^(1/q)) / s                                           at each s > 0
/// ```
///
/// The second bound grows with the sum of Re `v_i`; for a given sum it is least when as many `v_i` as possible are at
/// the ends of their range. The first bound falls as the sum grows to zeta. So for each sum below zeta the smaller of
/// the two holds for every L; the sum is chosen for which it is largest.
///
/// Returns the largest of these bounds, lowered by 1e-6 of itself for rounding errors; None if none is above 0, if E B
/// has no inverse, or if D is not 0. For a plant with slow zeros beside the disc it may be far below the least norm.
/// Source: the derivation above, which is our own.
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix; [`Error::OutOfRange`] for a bound of
/// `performance` that is not above 0, or a disc that does not reach the left half plane; [`Error::NotConverged`];
/// [`Error::Overflow`].
pub fn disc_norm_lower_bound(
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    performance: &Performance,
    disc: Disc,
    decay: f64,
) -> Result<Option<f64>, Error> {
    let (n, k, r) = check_observer(a, c, performance)?;
    let Performance { disturbance: b, output: e, feedthrough, .. } = performance;
    let Disc { center, radius } = disc;
    let reach = radius - center;
    let reach = if center > 0.0 { (reach * (radius + center)).sqrt() } else { reach };
    let reaches = reach > 0.0 && radius > 0.0 && reach.is_finite();
    check::that(reaches, "the radius", radius, "a disc that reaches the left half plane")?;
    let product = e * b;
    let sizes = Svd::new(&product)?.values;
    let size = e.norm() * b.norm();
    let regular = r == k && sizes.iter().all(|value| *value > f64::EPSILON.sqrt() * size);
    if !regular || feedthrough.amax() > 0.0 {
        return Ok(None);
    }
    let (order, inputs) = (as_number(n), as_number(k));
    let power = |base: f64| if base > 0.0 { base * base.ln() } else { 0.0 };
    let shape = power(order - inputs) + power(inputs) - power(order);
    let determinant = sizes.iter().map(|value| value.ln()).sum::<f64>();
    let mut bound = ((determinant + shape) / inputs).exp() / reach;
    let constant = (e * a).norm() <= f64::EPSILON * e.norm() * a.norm();
    if c.nrows() == k && constant {
        let Zeros { finite, rank } = zeros(a, b, c)?;
        let eigenvalues = InverseRange {
            count: order,
            least: slowest_rate(disc, decay),
            largest: 1.0 / (-center - radius).max(decay).max(0.0),
        };
        if rank == k && finite.iter().all(|zero| zero.norm() > 0.0) {
            bound = bound.max(by_zeros(&eigenvalues, &finite, &sizes));
        }
    }
    let bound = bound * (1.0 - ROUNDING);
    Ok((bound > 0.0).then_some(bound))
}

/// The number of eigenvalues s and the range of Re(-1 / s); the upper end may be infinite.
struct InverseRange {
    count: f64,
    least: f64,
    largest: f64,
}

impl InverseRange {
    /// The logarithm of the largest product of 1 / (1 + s v) for `count` numbers v of the range with the sum `sum`.
    fn largest_log(&self, sum: f64, s: f64) -> f64 {
        let free = (sum - self.count * self.least).max(0.0);
        let width = self.largest - self.least;
        let log = |v: f64| -(s * v).ln_1p();
        let at_end = if width.is_finite() && width > 0.0 { (free / width).floor() } else { 0.0 };
        if at_end >= self.count {
            return self.count * log(self.largest);
        }
        let ends = if at_end > 0.0 { at_end * log(self.largest) } else { 0.0 };
        let remainder = if at_end > 0.0 { free - at_end * width } else { free };
        ends + log(self.least + remainder) + (self.count - at_end - 1.0) * log(self.least)
    }
}

/// The lower bound of the norm that the two bounds with H in [`disc_norm_lower_bound`] give together; `sizes`: the q
/// singular values of E B.
fn by_zeros(eigenvalues: &InverseRange, zeros: &[Complex<f64>], sizes: &DVector<f64>) -> f64 {
    let (sigma_min, inverse_sum) = (sizes.min(), sizes.map(f64::recip).sum());
    let inputs = as_number(sizes.len());
    let zeta = zeros.iter().map(|zero| (-1.0 / zero).re).sum::<f64>();
    let by_trace = |sum: f64| (zeta - sum) / inverse_sum;
    let by_points = |sum: f64| {
        let bound_at = |s: f64| {
            let numerator =
                zeros.iter().fold(Complex::new(1.0, 0.0), |all, zero| all * (1.0 - s / zero));
            let log_determinant = numerator.re.max(0.0).ln() + eigenvalues.largest_log(sum, s);
            sigma_min * (1.0 - (log_determinant / inputs).exp()) / s
        };
        let centre = 1.0 / eigenvalues.least.max(f64::MIN_POSITIVE);
        (-POINTS..=POINTS)
            .map(|point| bound_at(centre * 10.0_f64.powf(f64::from(point) / PER_DECADE)))
            .fold(0.0, f64::max)
    };
    let [mut low, mut high] =
        [eigenvalues.least, eigenvalues.largest].map(|end| eigenvalues.count * end);
    if low <= 0.0 {
        return 0.0;
    }
    if low >= zeta {
        return by_points(low).max(-by_trace(low));
    }
    let mut best = if high < zeta { by_trace(high) } else { 0.0 };
    high = high.min(zeta);
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        let (first, second) = (by_trace(middle), by_points(middle));
        best = best.max(first.min(second));
        if second < first { low = middle } else { high = middle }
    }
    best
}

/// The least Re(-1 / s) of all s in the disc with a real part of at most -`decay`.
///
/// On the circle, with a = -Re s, |s|^2 = radius^2 - center^2 - 2 a center, so that the minimum is at an end of the
/// range of a.
fn slowest_rate(disc: Disc, decay: f64) -> f64 {
    let Disc { center, radius } = disc;
    let first = (-center - radius).max(decay).max(0.0);
    let square = radius * radius - center * center - 2.0 * first * center;
    let at_first = if square > 0.0 { first / square } else { 0.0 };
    let at_last = 1.0 / (radius - center);
    if first <= 0.0 { 0.0 } else { at_first.min(at_last) }
}

#[cfg(test)]
mod tests {
    use super::super::noiseless::tests::{filtered_fault, matrix, without_noise};
    use super::*;
    use crate::response::h_infinity;
    use crate::robustness::random_deviations;
    use crate::{Domain, StateSpace};

    /// The gain of Ackermann's formula.
    fn placed(a: &DMatrix<f64>, c: &DMatrix<f64>, poles: &[Complex<f64>]) -> DMatrix<f64> {
        let n = a.nrows();
        let mut polynomial = DMatrix::<f64>::identity(n, n);
        for pole in poles.iter().filter(|pole| pole.im >= 0.0) {
            let factor = if pole.im > 0.0 {
                a * a - a * (2.0 * pole.re) + DMatrix::identity(n, n) * pole.norm_sqr()
            } else {
                a - DMatrix::identity(n, n) * pole.re
            };
            polynomial *= factor;
        }
        let rows: Vec<_> = (0..n)
            .map(|power| (c * a.pow(u32::try_from(power).unwrap())).row(0).into_owned())
            .collect();
        let last = DMatrix::from_fn(n, 1, |row, _| f64::from(u8::from(row + 1 == n)));
        polynomial * DMatrix::from_rows(&rows).lu().solve(&last).unwrap()
    }

    fn norm(a: DMatrix<f64>, performance: &Performance) -> f64 {
        let (b, c) = (performance.disturbance.clone(), performance.output.clone());
        h_infinity(&StateSpace::strictly_proper(a, b, c, Domain::Continuous), 1e-4).unwrap().lower
    }

    /// Random eigenvalues in a disc; the norm nearest to the bound is that of eigenvalues at the far end of the disc.
    #[test]
    fn no_gain_with_its_eigenvalues_in_the_disc_has_a_smaller_norm() {
        let (center, radius) = (-6.0, 4.0);
        let mut cases = random_deviations(4, 300, 7);
        cases.push(vec![1.0, 0.0, 0.999, 0.0]);
        // The near end -2, beside the zeros -2 and -3, and the far end -10.
        cases.push(vec![1.0, 1.0, 1.0, 0.0]);
        // With the zeros -2 and -3, slow beside the disc, the bound is far below the norms.
        for (numerator, gap) in
            [([1.0, 0.0, 0.0], 1.5), ([6.0, 5.0, 1.0], 5.0), ([1.0, -0.5, 0.0], 1.5)]
        {
            let (a, c, performance) = filtered_fault(numerator);
            let disc = Disc { center, radius };
            let least = disc_norm_lower_bound(&a, &c, &performance, disc, 0.0).unwrap().unwrap();
            let mut nearest = f64::INFINITY;
            for case in &cases {
                let pair = |at: usize| {
                    let angle = std::f64::consts::PI * (1.0 - case[at + 1].abs());
                    let size = case[at].abs().sqrt() * radius;
                    let pole = center + Complex::from_polar(size, angle);
                    let is_real = pole.im.abs() < 1e-9;
                    if is_real { [pole.re.into(); 2] } else { [pole, pole.conj()] }
                };
                let poles = [pair(0), pair(2)].concat();
                let norm = norm(&a - placed(&a, &c, &poles) * &c, &performance);
                assert!(norm > least, "{poles:?}: {norm} {least}");
                nearest = nearest.min(norm);
            }
            assert!(nearest < gap * least, "{numerator:?}: {nearest} {least}");
        }
    }

    /// Two measurements show the fault f and its integral: only the bound from the determinant applies.
    #[test]
    fn with_more_measurements_than_faults_the_bound_is_that_of_the_determinant() {
        let a = matrix(2, 2, &[0.0, 1.0, 0.0, 0.0]);
        let fault = [0.0, 1.0];
        let performance = without_noise(matrix(2, 1, &fault), matrix(1, 2, &fault), 2);
        let c = DMatrix::identity(2, 2);
        // The points farthest from 0 are -5, and 1 + 5 e^(1.77 i) near the imaginary axis.
        for (center, radius) in [(-3.0, 2.0), (1.0, 5.0)] {
            let disc = Disc { center, radius };
            let bound = disc_norm_lower_bound(&a, &c, &performance, disc, 0.0).unwrap().unwrap();
            let on_circle = (0..100_000_u32).map(|step| {
                let angle = f64::from(step) * std::f64::consts::TAU / 1e5;
                Complex::new(center, 0.0) + Complex::from_polar(radius, angle)
            });
            let left = on_circle.filter(|s| s.re <= 0.0);
            let farthest = left.map(Complex::norm).fold(0.0, f64::max);
            assert!((bound * farthest / 0.25 - 1.0).abs() < 1e-4, "{center}: {bound}");
            // With A - L C = diag(-4, -4) the norm is 1 / 4.
            assert!(norm(matrix(2, 2, &[-4.0, 0.0, 0.0, -4.0]), &performance) > bound);
        }
    }

    #[test]
    fn the_slowest_rate_is_that_of_a_grid_over_the_region() {
        for (center, radius, decay) in [(-6.0, 4.0, 0.0), (-6.0, 8.0, 1.0), (-6.0, 6.5, 3.0)] {
            let mut least = f64::INFINITY;
            for step in 0..100_000_u32 {
                let angle = f64::from(step) * std::f64::consts::TAU / 1e5;
                let s = Complex::new(center, 0.0) + Complex::from_polar(radius, angle);
                if s.re <= -decay {
                    least = least.min((-1.0 / s).re);
                }
            }
            let rate = slowest_rate(Disc { center, radius }, decay);
            assert!(rate <= least && rate > 0.99 * least, "{center} {radius}: {rate} {least}");
        }
    }
}
