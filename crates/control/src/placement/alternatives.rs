//! Feedbacks with the same eigenvalues and different eigenvectors.

use super::eigenvectors::LARGEST_DESCENT;
use super::{CONTINUOUS, Coordinates, DISCRETE, Placement, Wanted, alternatives_in};
use crate::Error;
use nalgebra::{Complex, DMatrix};

/// Largest number of alternatives above the order `LARGEST_DESCENT`.
const MOST_OF_LARGE: usize = 2;

/// Feedbacks that assign the same eigenvalues by different eigenvectors.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Alternatives {
    /// The one that the placement chooses.
    pub chosen: Placement,
    /// Others, the lowest peak of S first, at most 21, above 24 states at most 2. Condition number
    /// and gain of each are at most 9 % above the least ones of eigenvectors of largest volume.
    pub others: Vec<Placement>,
}

impl Alternatives {
    /// The chosen one, then the others.
    pub fn all(&self) -> impl Iterator<Item = &Placement> {
        std::iter::once(&self.chosen).chain(&self.others)
    }

    /// All pairs with those of `other`, the two chosen ones first.
    pub fn pairs<'a>(
        &'a self,
        other: &'a Self,
    ) -> impl Iterator<Item = (&'a Placement, &'a Placement)> {
        self.all().flat_map(|own| other.all().map(move |other| (own, other)))
    }

    /// Replaces each gain by `map` of it.
    #[must_use]
    pub fn map(mut self, map: impl Fn(&DMatrix<f64>) -> DMatrix<f64>) -> Self {
        for placement in std::iter::once(&mut self.chosen).chain(&mut self.others) {
            placement.gain = map(&placement.gain);
        }
        self
    }
}

/// Computes the gain of [`super::place`] and alternatives to it.
///
/// The alternatives are what the search of [`super::place`] finds beside its result, and up to 24
/// states what six further starts of its step 1 lead to. With one independent input there are none.
/// Which of them is best depends on the loop that the gain is for: see
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
    alternatives_in(&Coordinates::Given, (a, b), poles, &CONTINUOUS, Wanted::Alternatives)
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
    alternatives_in(&Coordinates::Balanced, (a, b), poles, &CONTINUOUS, Wanted::Alternatives)
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
    alternatives_in(&Coordinates::Balanced, (a, b), poles, &DISCRETE, Wanted::Alternatives)
}

/// The largest number of alternatives for `n` states.
pub(super) fn most_alternatives(n: usize) -> usize {
    if n <= LARGEST_DESCENT { usize::MAX } else { MOST_OF_LARGE }
}
