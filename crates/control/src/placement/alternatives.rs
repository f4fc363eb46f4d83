//! Feedbacks with the same eigenvalues and different eigenvectors.

use super::{Coordinates, Extent, Placement, PlacementProblem};
use crate::Error;
use crate::svd::norm_2;
use nalgebra::{Complex, DMatrix};

/// The factor by which condition number and gain of a candidate may exceed the lower values of the standard methods;
/// the candidates form pairs of feedback and observer.
const NEAR: f64 = 1.09;

/// Feedbacks that assign the same eigenvalues by different eigenvectors.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Alternatives {
    /// The result of [`super::place`], or of its variant.
    pub chosen: Placement,
    /// The other placements in ascending order of the peak of S: at most 20, above 24 states at most 2. Condition
    /// number and gain of each exceed the least values of eigenvectors of largest volume by at most 9 %.
    pub others: Vec<Placement>,
    /// The results, for up to 24 states, of two standard methods: first of method 0 of Kautsky, Nichols and Van
    /// Dooren, which needs real eigenvalues, then of the method of Tits and Yang, each with start and end as in
    /// scipy's `place_poles`. They are references for a choice; their figures may be above those of `others`.
    /// With one independent input both are `chosen`. None for a method without a result.
    pub standard: [Option<Placement>; 2],
}

impl Alternatives {
    /// The chosen placement, then the others.
    pub fn all(&self) -> impl Iterator<Item = &Placement> {
        std::iter::once(&self.chosen).chain(&self.others)
    }

    /// The candidates for a pair of feedback and observer: first the chosen placement and `others`, second the results
    /// of the standard methods that differ from the chosen placement.
    ///
    /// Both lists have only placements whose condition number and gain are at most 9 % above the lower ones of the
    /// standard methods, if these have results. If only the first list is empty, the second one takes its
    /// place; if both are empty, the first list has the chosen placement and all others.
    #[must_use]
    pub fn candidates(&self) -> [Vec<&Placement>; 2] {
        let figures = |placement: &Placement| {
            [placement.quality.condition, norm_2(&placement.gain).unwrap_or(f64::INFINITY)]
        };
        let least = self.standard.iter().flatten().map(figures);
        let [condition, gain] =
            least.reduce(|x, y| [x[0].min(y[0]), x[1].min(y[1])]).unwrap_or([f64::INFINITY; 2]);
        let is_near = |placement: &&Placement| {
            let [its_condition, its_gain] = figures(placement);
            its_condition <= NEAR * condition && its_gain <= NEAR * gain
        };
        let near: Vec<_> = self.all().filter(is_near).collect();
        let standard = self.standard.iter().flatten().filter(|one| **one != self.chosen);
        let standard: Vec<_> = standard.filter(is_near).collect();
        match (near.is_empty(), standard.is_empty()) {
            (false, _) => [near, standard],
            (true, false) => [standard, vec![]],
            (true, true) => [self.all().collect(), vec![]],
        }
    }

    /// For each standard method, the pair of its results for `self` and `other`; no pair if one of the results is
    /// missing. See [`Self::standard`].
    pub fn standard_pairs<'a>(
        &'a self,
        other: &'a Self,
    ) -> impl Iterator<Item = (&'a Placement, &'a Placement)> {
        let pairs = self.standard.iter().zip(&other.standard);
        pairs.filter_map(|(feedback, observer)| feedback.as_ref().zip(observer.as_ref()))
    }

    /// Replaces each gain K by `map`(K).
    #[must_use]
    pub fn map(mut self, map: impl Fn(&DMatrix<f64>) -> DMatrix<f64>) -> Self {
        let Self { chosen, others, standard } = &mut self;
        let standard = standard.iter_mut().flatten();
        for placement in std::iter::once(chosen).chain(others).chain(standard) {
            placement.gain = map(&placement.gain);
        }
        self
    }
}

/// Computes the gain of [`super::place`] and alternatives to it.
///
/// The alternatives are further results of the search of [`super::place`] and, for up to 24 states, of
/// six further starts of its step 1. With one independent input there are none.
/// Which gain is best depends on the loop in which it is used: see
/// [`crate::robustness::least_sensitive`].
///
/// # Errors
///
/// Same as [`super::place`]. An alternative that rounding spoils, with an eigenvalue error above 1e-9
/// and ten times that of the chosen gain, is left out.
pub fn alternatives(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    poles: &[Complex<f64>],
) -> Result<Alternatives, Error> {
    let problem = PlacementProblem { a, b, poles, sampled: false };
    problem.alternatives(&Coordinates::Given, Extent::Alternatives)
}

/// Computes the gain of [`super::place_balanced`] and alternatives to it, see [`alternatives`].
///
/// # Errors
///
/// Same as [`alternatives`].
pub fn alternatives_balanced(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    poles: &[Complex<f64>],
) -> Result<Alternatives, Error> {
    let problem = PlacementProblem { a, b, poles, sampled: false };
    problem.alternatives(&Coordinates::Balanced, Extent::Alternatives)
}

/// Computes the gain of [`super::place_discrete`] and alternatives to it, see [`alternatives`].
///
/// # Errors
///
/// Same as [`alternatives`].
pub fn alternatives_discrete(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    poles: &[Complex<f64>],
) -> Result<Alternatives, Error> {
    let problem = PlacementProblem { a, b, poles, sampled: true };
    problem.alternatives(&Coordinates::Balanced, Extent::Alternatives)
}
