//! The figures by which eigenvectors are chosen: condition number, gain norm and peak of S.

use super::eigenvectors::{Slope, condition};
use super::pole_block::PoleBlock;
use super::subspace::AssignableSubspaces;
use crate::Error;
use crate::balance::multiply_rows;
use crate::blocks::{ComplexMatrix, to_complex};
use crate::svd::{ComplexSvd, norm_2};
use nalgebra::{Complex, ComplexField, DMatrix, DVector};
use std::f64::consts::PI;

/// Number of figures.
pub(crate) const COUNT: usize = 3;
/// Number of frequencies per decade at which S is evaluated, in total at most [`MOST_FREQUENCIES`]: from a tenth of the
/// slowest eigenvalue to ten times the fastest, in sampled time to half of the sample rate.
const PER_DECADE: f64 = 12.0;
const MOST_FREQUENCIES: f64 = 80.0;
/// Exponent of the sum of powers over the frequencies that replaces the maximum in the descent.
const EXPONENT: f64 = 24.0;

/// Maps the logarithms of the figures to an objective and its partial derivatives.
pub(crate) type Weighting<'a> = dyn Fn(&[f64; COUNT]) -> (f64, [f64; COUNT]) + 'a;

/// The feedback u = K x of a plant, as a function of the chosen eigenvectors.
///
/// With the real matrix V of eigenvectors, G = K V and (A + B K) V = V M,
///
/// ```text
/// K = G V^-1,   S(s) = (I - K (s I - A)^-1 B)^-1 = I + G (s I - M)^-1 V^-1 B
/// ```
pub(crate) struct FeedbackLoop<'a> {
    /// The problem whose eigenvectors are chosen.
    pub(crate) problem: &'a AssignableSubspaces,
    /// X, with which the columns of B X are orthonormal; G is X times the responses of `problem`.
    basis: &'a DMatrix<f64>,
    b: &'a DMatrix<f64>,
    /// The points s, or z, of the frequencies; empty if a requested eigenvalue is unstable.
    points: Vec<Complex<f64>>,
}

/// The eigenvectors and responses of chosen directions: V, V^-1, G and V^-1 B.
struct Eigenstructure {
    v: DMatrix<f64>,
    inverse: DMatrix<f64>,
    g: DMatrix<f64>,
    input: DMatrix<f64>,
}

/// The logarithm of a smooth bound of a figure, and its gradients with respect to V and to G.
struct SmoothFigure {
    value: f64,
    of_v: DMatrix<f64>,
    of_g: DMatrix<f64>,
}

impl<'a> FeedbackLoop<'a> {
    pub(crate) fn new(
        problem: &'a AssignableSubspaces,
        basis: &'a DMatrix<f64>,
        b: &'a DMatrix<f64>,
        sampled: bool,
    ) -> Self {
        let poles: Vec<_> = problem.spaces.iter().map(|space| space.poles.pole).collect();
        Self { problem, basis, b, points: points(&poles, sampled) }
    }

    fn blocks(&self) -> impl Iterator<Item = PoleBlock> {
        self.problem.spaces.iter().map(|space| space.poles)
    }

    /// The eigenvectors and responses of `directions`; None if the eigenvectors are dependent.
    fn eigenstructure(&self, directions: &[DVector<f64>]) -> Option<Eigenstructure> {
        let v = self.problem.eigenvectors(directions);
        let inverse = self.problem.inverse(directions)?;
        let responses = self.problem.scaled_responses(directions);
        let g = self.basis * multiply_rows(&responses, &self.problem.response_scale);
        let input = &inverse * self.b;
        Some(Eigenstructure { v, inverse, g, input })
    }

    /// Condition number of the eigenvectors, 2-norm of K, largest singular value of S over the
    /// frequencies, at least 1; None where the eigenvectors are dependent or a figure is not finite.
    pub(crate) fn figures(
        &self,
        directions: &[DVector<f64>],
    ) -> Result<Option<[f64; COUNT]>, Error> {
        let Some(structure) = self.eigenstructure(directions) else {
            return Ok(None);
        };
        let condition = condition(&structure.v)?;
        let gain = norm_2(&(&structure.g * &structure.inverse).transpose())?;
        let mut peak = 1.0_f64;
        for point in &self.points {
            let z = self.resolvent(*point, &to_complex(&structure.input));
            let s = self.sensitivity(&structure, &z);
            peak = peak.max(ComplexSvd::new(&s)?.values()[0]);
        }
        let figures = [condition, gain, peak];
        Ok(figures.iter().copied().all(f64::is_finite).then_some(figures))
    }

    /// The logarithms of smooth bounds of the figures: Schatten norms of order 16 in place of the
    /// 2-norms, a sum of powers over the frequencies in place of the maximum. None where the
    /// eigenvectors are dependent.
    pub(crate) fn smooth(&self, directions: &[DVector<f64>]) -> Option<[f64; COUNT]> {
        let structure = self.eigenstructure(directions)?;
        Some(self.smooth_figures(&structure).map(|figure| figure.value))
    }

    /// The objective that `weighting` computes from the values of [`Self::smooth`], and its gradients with respect to
    /// V and to the responses of the problem; None where it is not finite or the eigenvectors are dependent.
    pub(crate) fn objective(
        &self,
        directions: &[DVector<f64>],
        weighting: &Weighting,
    ) -> Option<Slope> {
        let structure = self.eigenstructure(directions)?;
        let figures = self.smooth_figures(&structure);
        let (value, weights) = weighting(&[0, 1, 2].map(|figure: usize| figures[figure].value));
        let mut of_v = DMatrix::zeros(structure.v.nrows(), structure.v.ncols());
        let mut of_g = DMatrix::zeros(structure.g.nrows(), structure.g.ncols());
        for (figure, weight) in figures.iter().zip(weights) {
            of_v += &figure.of_v * weight;
            of_g += &figure.of_g * weight;
        }
        let finite = of_v.iter().chain(&of_g).copied().all(f64::is_finite);
        let of_g = Some(self.basis.tr_mul(&of_g));
        (value.is_finite() && finite).then_some(Slope { value, of_v, of_g })
    }

    fn smooth_figures(&self, structure: &Eigenstructure) -> [SmoothFigure; COUNT] {
        [structure.condition(), structure.gain(), self.peak(structure)]
    }

    /// Computes (s I - M)^-1 N.
    fn resolvent(&self, s: Complex<f64>, n: &ComplexMatrix) -> ComplexMatrix {
        let mut solved = n.clone();
        let mut row = 0;
        for poles in self.blocks() {
            let pole = poles.pole;
            let diagonal = s - pole.re;
            if poles.count() == 1 {
                solved.row_mut(row).iter_mut().for_each(|entry| *entry /= diagonal);
            } else {
                let determinant = diagonal * diagonal + pole.im * pole.im;
                for column in 0..n.ncols() {
                    let (first, second) = (n[(row, column)], n[(row + 1, column)]);
                    solved[(row, column)] = (diagonal * first + second * pole.im) / determinant;
                    solved[(row + 1, column)] = (diagonal * second - first * pole.im) / determinant;
                }
            }
            row += poles.count();
        }
        solved
    }

    /// S = I + G Z, with Z = (s I - M)^-1 V^-1 B.
    fn sensitivity(&self, structure: &Eigenstructure, z: &ComplexMatrix) -> ComplexMatrix {
        let m = self.b.ncols();
        let (re, im) =
            (&structure.g * z.map(|entry| entry.re), &structure.g * z.map(|entry| entry.im));
        DMatrix::from_fn(m, m, |i, j| {
            Complex::new(re[(i, j)] + if i == j { 1.0 } else { 0.0 }, im[(i, j)])
        })
    }

    /// The smooth peak of S; dS = dG Z - G (s I - M)^-1 V^-1 dV V^-1 B.
    fn peak(&self, structure: &Eigenstructure) -> SmoothFigure {
        let (n, m) = structure.input.shape();
        let mut of_v = DMatrix::zeros(n, n);
        let mut of_g = DMatrix::zeros(m, n);
        let input = to_complex(&structure.input);
        let norms = self.points.iter().map(|&point| {
            let z = self.resolvent(point, &input);
            let (value, gradient) = schatten(&self.sensitivity(structure, &z));
            (point, z, value, gradient)
        });
        let norms: Vec<_> = norms.collect();
        let largest = norms.iter().map(|(_, _, value, _)| *value).fold(f64::NEG_INFINITY, f64::max);
        let weight = |value: f64| (EXPONENT * (value - largest)).exp();
        let total: f64 = norms.iter().map(|(_, _, value, _)| weight(*value)).sum();
        if norms.is_empty() {
            return SmoothFigure { value: 0.0, of_v, of_g };
        }
        let mut back = DMatrix::zeros(n, m);
        let transposed = structure.g.transpose();
        for (point, z, value, gradient) in norms {
            let share = weight(value) / total;
            if share < f64::EPSILON {
                continue;
            }
            let (re, im) = (gradient.map(|entry| entry.re), gradient.map(|entry| entry.im));
            of_g += (&re * z.map(|entry| entry.re).transpose()
                + &im * z.map(|entry| entry.im).transpose())
                * share;
            // The real part of (s I - M)^-H G' D, D = `gradient`, by the resolvent of M' for the conjugate of G' D.
            let (re, im) = (&transposed * re, &transposed * im);
            let d = DMatrix::from_fn(n, m, |i, j| Complex::new(re[(i, j)], -im[(i, j)]));
            back += self.transposed_resolvent(point, &d).map(|entry| entry.re) * share;
        }
        of_v -= structure.inverse.tr_mul(&back) * structure.input.transpose();
        SmoothFigure { value: largest + total.ln() / EXPONENT, of_v, of_g }
    }

    /// (s I - M')^-1 N, by [`Self::resolvent`] with the rows of each pair exchanged.
    fn transposed_resolvent(&self, s: Complex<f64>, n: &ComplexMatrix) -> ComplexMatrix {
        let swapped = |m: &ComplexMatrix| {
            let mut m = m.clone();
            let mut row = 0;
            for poles in self.blocks() {
                if poles.count() == 2 {
                    m.swap_rows(row, row + 1);
                }
                row += poles.count();
            }
            m
        };
        swapped(&self.resolvent(s, &swapped(n)))
    }
}

impl Eigenstructure {
    /// The smooth condition number; d V^-1 = -V^-1 dV V^-1.
    fn condition(&self) -> SmoothFigure {
        let (size, mut of_v) = schatten(&self.v);
        let (of_inverse, gradient) = schatten(&self.inverse);
        of_v -= self.inverse.tr_mul(&gradient) * self.inverse.transpose();
        let of_g = DMatrix::zeros(self.g.nrows(), self.g.ncols());
        SmoothFigure { value: size + of_inverse, of_v, of_g }
    }

    /// The smooth norm of K; dK = dG V^-1 - K dV V^-1.
    fn gain(&self) -> SmoothFigure {
        let k = &self.g * &self.inverse;
        let (value, gradient) = schatten(&k);
        let of_g = gradient * self.inverse.transpose();
        let of_v = -k.tr_mul(&of_g);
        SmoothFigure { value, of_v, of_g }
    }
}

/// The logarithm of the Schatten norm of order 16, (trace (M M*)^8)^(1/16), and its gradient
/// (M M*)^7 M / trace (M M*)^8. The norm is between the 2-norm and k^(1/16) times the 2-norm, k the rank.
/// For M = 0 the norm counts as the smallest positive number, with the gradient 0.
fn schatten<T: ComplexField<RealField = f64>>(m: &DMatrix<T>) -> (f64, DMatrix<T>) {
    if m.nrows() > m.ncols() {
        let (value, gradient) = schatten(&m.adjoint());
        return (value, gradient.adjoint());
    }
    let unit = m.norm();
    if unit <= 0.0 {
        return (f64::MIN_POSITIVE.ln(), m.clone());
    }
    let m = m.unscale(unit);
    let power = &m * m.adjoint();
    let square = &power * &power;
    let fourth = &square * &square;
    let total = fourth.norm_squared();
    let gradient = (fourth * (square * (power * m))).unscale(total * unit);
    (unit.ln() + total.ln() / 16.0, gradient)
}

/// The points of the imaginary axis, or of the unit circle, at which S is evaluated; none if an eigenvalue is not
/// stable.
fn points(poles: &[Complex<f64>], sampled: bool) -> Vec<Complex<f64>> {
    let stable = |pole: &Complex<f64>| if sampled { pole.norm() < 1.0 } else { pole.re < 0.0 };
    if !poles.iter().all(stable) {
        return vec![];
    }
    let modes: Vec<Complex<f64>> = if sampled {
        poles.iter().filter(|pole| pole.norm() > f64::EPSILON).map(|pole| pole.ln()).collect()
    } else {
        poles.to_vec()
    };
    let slowest = modes.iter().map(|mode| mode.norm()).fold(1.0 / f64::EPSILON, f64::min);
    let fastest = modes.iter().map(|mode| mode.norm()).fold(0.0, f64::max);
    let last = if sampled { PI } else { 10.0 * fastest };
    let first = (0.1 * slowest).min(0.1 * last);
    let steps = (PER_DECADE * (last / first).log10()).ceil().clamp(2.0, MOST_FREQUENCIES);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 80")]
    let count = steps as u32;
    let grid = (0..=count).map(|k| (first * (last / first).powf(f64::from(k) / steps)).min(last));
    let resonances = modes.iter().filter(|mode| mode.im > 0.0).map(|mode| mode.im.min(last));
    let frequencies = std::iter::once(0.0).chain(grid).chain(resonances);
    frequencies
        .map(|w| if sampled { Complex::from_polar(1.0, w) } else { Complex::new(0.0, w) })
        .collect()
}
