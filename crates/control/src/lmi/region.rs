//! Regions of the complex plane and the proof that they contain all eigenvalues.

use super::affine::Affine;
use super::coordinates::Coordinates;
use super::definite::margin;
use super::{Outcome, Problem};
use crate::domain::Domain;
use crate::eigen::eigenvalues;
use crate::product::AccurateProduct;
use crate::{Error, check};
use nalgebra::{Complex, DMatrix};
use std::slice::from_ref;

/// Margin of the inequalities in the solver's coordinates, where the data are about one.
pub(super) const MARGIN: f64 = 2e-7;

pub(super) const NO_P: &str = "the region could not be proven in double precision";

/// A disc around a real number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disc {
    /// Centre of the disc, on the real axis.
    pub center: f64,
    /// Radius of the disc, above zero.
    pub radius: f64,
}

/// A region of the complex plane: the intersection of the parts that are given; without any, the region of stability.
///
/// Continuous time: eigenvalues s. Sampled time: eigenvalues z of the sampled system.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Region {
    /// Decay rate alpha above zero in 1/s: Re s < -alpha, or |z| < exp(-alpha period).
    pub decay: Option<f64>,
    /// A disc of the plane of s, or of z in sampled time.
    pub disc: Option<Disc>,
    /// Half angle in rad, above 0 and below pi/2, of the sector |Im s| < tan(angle) (-Re s):
    /// damping above cos(angle). In continuous time only.
    pub sector: Option<f64>,
}

/// A proof that all eigenvalues of A are in a region.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct RegionCertificate {
    /// P, n x n, symmetric positive definite.
    pub p: DMatrix<f64>,
    /// Smallest eigenvalue of all inequalities, each scaled to a diagonal of about one; larger than
    /// the rounding errors.
    pub margin: f64,
}

/// A part of a region.
enum Shape {
    /// Re s < -decay; contains the decay rate.
    HalfPlane(f64),
    Disc(Disc),
    /// |Im s| < tan(angle) (-Re s); contains the half angle in rad.
    Sector(f64),
}

impl Region {
    /// Checks that decay rate and radius are above zero, the centre is finite, and a sector is in its range and in
    /// continuous time; otherwise [`Error::OutOfRange`].
    pub(super) fn check(&self, domain: Domain) -> Result<(), Error> {
        if let Some(decay) = self.decay {
            check::positive("decay", decay)?;
        }
        if let Some(Disc { center, radius }) = self.disc {
            check::positive("disc radius", radius)?;
            check::that(center.is_finite(), "disc center", center, "a finite number")?;
        }
        domain.check()?;
        let Some(angle) = self.sector else { return Ok(()) };
        let rule = match domain {
            Domain::Continuous => "an angle between 0 and pi/2",
            Domain::Sampled { .. } => "no sector in sampled time, but a disc",
        };
        let is_in_range = angle > 0.0 && angle < std::f64::consts::FRAC_PI_2;
        check::that(is_in_range && domain == Domain::Continuous, "sector", angle, rule)
    }

    /// The parts of the region for s or z divided by `unit`, each with its name in reported conflicts.
    fn parts(&self, domain: Domain, unit: f64) -> Vec<(&'static str, Shape)> {
        let disc = |center: f64, radius: f64| {
            Shape::Disc(Disc { center: center / unit, radius: radius / unit })
        };
        let decaying = |decay: f64| match domain {
            Domain::Continuous => Shape::HalfPlane(decay / unit),
            Domain::Sampled { period } => disc(0.0, (-decay * period).exp()),
        };
        let parts = [
            self.decay.map(|decay| ("decay", decaying(decay))),
            self.disc.map(|Disc { center, radius }| ("disc", disc(center, radius))),
            self.sector.map(|angle| ("sector", Shape::Sector(angle))),
        ];
        let parts: Vec<_> = parts.into_iter().flatten().collect();
        if parts.is_empty() { vec![("stability", decaying(0.0))] } else { parts }
    }

    /// The matrices of [`certify_region`] with their names, positive definite if P and the product
    /// P A, `product`, prove that the eigenvalues of A are in the region.
    pub(super) fn inequalities(
        &self,
        p: &Affine,
        product: &Affine,
        domain: Domain,
        unit: f64,
    ) -> Vec<(&'static str, Affine)> {
        let parts = self.parts(domain, unit).into_iter();
        parts.map(|(name, shape)| (name, shape.inequality(p, product))).collect()
    }

    /// Adds the matrices of [`Self::inequalities`] to a program.
    pub(super) fn constrain(
        &self,
        problem: &mut Problem,
        p: &Affine,
        product: &Affine,
        domain: Domain,
        unit: f64,
    ) {
        for (_, matrix) in self.inequalities(p, product, domain, unit) {
            problem.constrain(&matrix, MARGIN);
        }
    }

    /// Whether the parts have a real interval in common.
    pub(super) fn has_real_numbers(&self, domain: Domain) -> bool {
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for (_, shape) in self.parts(domain, 1.0) {
            let (from, to) = match shape {
                Shape::HalfPlane(decay) => (f64::NEG_INFINITY, -decay),
                Shape::Disc(Disc { center, radius }) => (center - radius, center + radius),
                Shape::Sector(_) => (f64::NEG_INFINITY, 0.0),
            };
            (low, high) = (low.max(from), high.min(to));
        }
        low < high
    }

    /// Names of the parts that do not contain all eigenvalues.
    pub(super) fn violated(&self, values: &[Complex<f64>], domain: Domain) -> Vec<&'static str> {
        let outside = |(name, shape): (_, Shape)| {
            values.iter().any(|value| !shape.contains(value)).then_some(name)
        };
        self.parts(domain, 1.0).into_iter().filter_map(outside).collect()
    }
}

impl Shape {
    fn contains(&self, value: &Complex<f64>) -> bool {
        match self {
            Self::HalfPlane(decay) => value.re < -decay,
            Self::Disc(Disc { center, radius }) => (value - center).norm() < *radius,
            Self::Sector(angle) => value.im.abs() < angle.tan() * -value.re,
        }
    }

    /// The matrix that must be positive definite for P and the product P A.
    fn inequality(&self, p: &Affine, product: &Affine) -> Affine {
        let sum = product.plus_transpose();
        match self {
            Self::HalfPlane(decay) => -&(&sum + &(p * (2.0 * decay))),
            Self::Disc(Disc { center, radius }) => {
                let (size, moved) = (p * *radius, product - &(p * *center));
                Affine::blocks(&[&[&size, &moved], &[&moved.transpose(), &size]])
            }
            Self::Sector(angle) => {
                let (s, c) = angle.sin_cos();
                let (even, odd) = (&sum * -s, &(product - &product.transpose()) * -c);
                Affine::blocks(&[&[&even, &odd], &[&odd.transpose(), &even]])
            }
        }
    }
}

/// Proves that all eigenvalues of A are in a region.
///
/// ```text
/// P > 0 and, for each part of the region,
/// Re s < -alpha:         A' P + P A + 2 alpha P < 0
/// |s - c| < r:           [r P, P (A - c I); (A - c I)' P, r P] > 0
/// |Im s| < tan(t) (-Re s): [sin(t) (P A + A' P), cos(t) (P A - A' P);
///                           cos(t) (A' P - P A), sin(t) (P A + A' P)] < 0
/// ```
///
/// `a`: n x n. P exists if and only if the eigenvalues are in the region. Of all P <= I the one farthest inside of all
/// inequalities is computed, in the coordinates in which A is a multiple of the identity plus a matrix whose norm is
/// about the spread of the eigenvalues. An eigenvalue outside of the region gives [`Outcome::Infeasible`] with the
/// names of the parts that it violates; an eigenvalue inside by less than 1e-7 of the size of the spectrum may give
/// [`Outcome::Inconclusive`]. The inequalities are verified in the units of the data, with products in twice the
/// precision.
///
/// Source: M. Chilali and P. Gahinet, H-infinity design with pole placement constraints: an LMI
/// approach, IEEE Trans. Autom. Control 41 (1996), theorem 2.2 and section II.C.
///
/// # Example
///
/// ```
/// use control::Domain;
/// use control::lmi::{Disc, Outcome, Region, certify_region};
/// use nalgebra::DMatrix;
/// let a = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -25.0, -6.0]);
/// let region = |decay| Region { decay: Some(decay), ..Region::default() };
/// assert!(certify_region(&a, &region(2.9), Domain::Continuous)?.optimal().is_some());
/// let Outcome::Infeasible { conflict } = certify_region(&a, &region(3.1), Domain::Continuous)?
/// else { panic!() };
/// assert_eq!(conflict, ["decay"]);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad `a`, [`Error::OutOfRange`]
/// for a bad region; [`Error::NotConverged`].
pub fn certify_region(
    a: &DMatrix<f64>,
    region: &Region,
    domain: Domain,
) -> Result<Outcome<RegionCertificate>, Error> {
    check::square("A", a)?;
    region.check(domain)?;
    let conflict = region.violated(&eigenvalues(a)?, domain);
    if !conflict.is_empty() {
        return Ok(Outcome::Infeasible { conflict });
    }
    match Coordinates::of_dynamics(a)? {
        Some(coordinates) => certify_in(&coordinates, from_ref(a), region, domain),
        None => Ok(Outcome::Inconclusive(NO_P)),
    }
}

/// Computes one P for all `vertices`, with the program solved in given coordinates.
pub(super) fn certify_in(
    coordinates: &Coordinates,
    vertices: &[DMatrix<f64>],
    region: &Region,
    domain: Domain,
) -> Result<Outcome<RegionCertificate>, Error> {
    let n = vertices[0].nrows();
    let mut problem = Problem::new();
    let p = problem.symmetric(n);
    problem.constrain(&p, MARGIN);
    problem.constrain(&(&Affine::identity(n, 1.0) - &p), MARGIN);
    for a in vertices {
        let product = &p * &coordinates.dynamics(a);
        region.constrain(&mut problem, &p, &product, domain, coordinates.unit);
    }
    let Some(solution) = problem.solve()?.optimal() else {
        return Ok(Outcome::Inconclusive(NO_P));
    };
    verify(vertices, region, domain, coordinates.certificate(&solution.value(&p)))
}

/// Verifies the inequalities of all vertices for P in the units of the data.
fn verify(
    vertices: &[DMatrix<f64>],
    region: &Region,
    domain: Domain,
    p: DMatrix<f64>,
) -> Result<Outcome<RegionCertificate>, Error> {
    let matrices = |p: &DMatrix<f64>, product: &DMatrix<f64>| {
        let (p, product) = (Affine::constant(p), Affine::constant(product));
        region.inequalities(&p, &product, domain, 1.0)
    };
    let zero = DMatrix::zeros(p.nrows(), p.nrows());
    let mut smallest = margin(&p)?;
    for a in vertices {
        let product = AccurateProduct::new(&p, a);
        let rounded = matrices(&p, &product.high);
        let corrections = matrices(&zero, &product.low);
        for ((_, matrix), (_, correction)) in rounded.iter().zip(&corrections) {
            smallest = smallest.min(margin(&(&matrix.constant + &correction.constant))?);
        }
    }
    if smallest > 0.0 {
        return Ok(Outcome::Optimal(RegionCertificate { p, margin: smallest }));
    }
    Ok(Outcome::Inconclusive("the certificate of the region is within the rounding errors"))
}
