//! Semidefinite programs: problems with linear matrix inequalities.

use super::affine::Affine;
use super::definite::smallest_eigenvalue;
use super::limit;
use super::solver::{End, minimise};
use super::{Outcome, Solution};
use crate::Error;
use crate::balance::power_of_two_or_one;
use nalgebra::{DMatrix, DVector};

/// A requirement violated by less than this, relative to its largest entry, counts as neither met nor in conflict.
const UNDECIDED: f64 = 1e-7;

/// A semidefinite program: unknown matrices, requirements on them, and an objective.
///
/// ```text
/// minimise c(x) such that S_i(x) - m_i I is positive semidefinite for every i
/// ```
///
/// Method: the interior point method of Clarabel (Goulart and Chen, 2024) on data in which the largest entry of each
/// requirement is about one. The result is accepted only if the eigenvalues of every `S_i`(x) show that at least half
/// of the margin `m_i` is kept. Otherwise the largest t such that every `S_i`(x) - `m_i` I - t I is positive
/// semidefinite is computed, which always exists. If t < 0 the requirements contradict each other. Requirements without
/// which the others still contradict each other are then removed, in the order in which they were stated; each of the
/// remaining ones is necessary for the contradiction.
///
/// Cost: some 20 iterations of about u^3 + u^2 k^2 multiplications, u unknowns, k the order of the
/// largest requirement; a conflict costs that once more for each named requirement.
///
/// # Example
///
/// The smallest x with [x, 1; 1, x] positive definite:
///
/// ```
/// use control::lmi::{Affine, Outcome, Problem};
/// use nalgebra::DMatrix;
/// let mut problem = Problem::new();
/// let x = problem.scalar();
/// let one = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 1.0, 0.0]);
/// let matrix = &x.times(&DMatrix::identity(2, 2)) + &Affine::constant(&one);
/// problem.require("definite", &matrix, 1e-7);
/// problem.minimise(&x);
/// let Outcome::Optimal(solution) = problem.solve()? else { panic!() };
/// assert!((solution.value(&x)[(0, 0)] - 1.0).abs() < 1e-6);
/// # Ok::<(), control::Error>(())
/// ```
#[derive(Debug, Clone, Default)]
pub struct Problem {
    unknowns: usize,
    requirements: Vec<Requirement>,
    objective: Option<Affine>,
}

#[derive(Debug, Clone)]
struct Requirement {
    /// The name by which a conflict reports the constraint; None for a constraint that is never part of a conflict.
    name: Option<&'static str>,
    matrix: Affine,
    margin: f64,
}

impl Requirement {
    /// (S(x) - m I) / size - slack I; size is a power of two near the largest entry of S, or 1 for S = 0.
    fn semidefinite(&self, slack: Option<&Affine>) -> Affine {
        let size = power_of_two_or_one(self.matrix.largest_entry());
        let order = self.matrix.shape().0;
        let scaled = &self.matrix * (1.0 / size);
        let margin = Affine::identity(order, self.margin / size);
        let matrix = &scaled - &margin;
        match slack {
            None => matrix,
            Some(slack) => &matrix - &slack.times(&DMatrix::identity(order, order)),
        }
    }
}

impl Problem {
    /// Creates a program without unknowns and requirements.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds an unknown symmetric matrix.
    pub fn symmetric(&mut self, order: usize) -> Affine {
        let mut matrix = Affine::zeros(order, order);
        for col in 0..order {
            for row in 0..=col {
                let mut unit = DMatrix::zeros(order, order);
                (unit[(row, col)], unit[(col, row)]) = (1.0, 1.0);
                matrix.terms.insert(self.unknown(), unit);
            }
        }
        matrix
    }

    /// Adds an unknown matrix.
    pub fn rectangular(&mut self, rows: usize, cols: usize) -> Affine {
        let mut matrix = Affine::zeros(rows, cols);
        for at in 0..rows * cols {
            let mut unit = DMatrix::zeros(rows, cols);
            unit[at] = 1.0;
            matrix.terms.insert(self.unknown(), unit);
        }
        matrix
    }

    /// Adds an unknown number, as a matrix of one row and column.
    pub fn scalar(&mut self) -> Affine {
        self.rectangular(1, 1)
    }

    /// Adds an unknown number; returns its index.
    fn unknown(&mut self) -> usize {
        self.unknowns += 1;
        self.unknowns - 1
    }

    /// Requires that `matrix` - `margin` I is positive semidefinite. A conflict reports it by
    /// `name`; requirements of the same name are treated as one.
    ///
    /// # Panics
    ///
    /// When the matrix is not square.
    pub fn require(&mut self, name: &'static str, matrix: &Affine, margin: f64) {
        self.push(Some(name), matrix, margin);
    }

    /// Like [`Problem::require`], for a constraint that is part of the formulation, such as P > 0,
    /// and never reported in a conflict.
    ///
    /// # Panics
    ///
    /// When the matrix is not square.
    pub fn constrain(&mut self, matrix: &Affine, margin: f64) {
        self.push(None, matrix, margin);
    }

    fn push(&mut self, name: Option<&'static str>, matrix: &Affine, margin: f64) {
        let (rows, cols) = matrix.shape();
        assert_eq!(rows, cols, "a requirement is a square matrix");
        // A matrix without entries is positive definite.
        if rows > 0 {
            self.requirements.push(Requirement { name, matrix: matrix.clone(), margin });
        }
    }

    /// Sets the objective to minimise: an expression of one row and column.
    pub fn minimise(&mut self, objective: &Affine) {
        self.objective = Some(objective.clone());
    }

    /// The given number as a 1 x 1 matrix; for None a new unknown, which is minimised.
    pub(crate) fn level(&mut self, value: Option<f64>) -> Affine {
        if let Some(value) = value {
            return Affine::identity(1, value);
        }
        let unknown = self.scalar();
        self.minimise(&unknown);
        unknown
    }

    /// Solves the program; without an objective, computes the x with the largest margin in all
    /// requirements, each margin at most about the largest entry of the requirement.
    ///
    /// # Errors
    ///
    /// [`Error::NotConverged`] when eigenvalues are not found.
    pub fn solve(&self) -> Result<Outcome<Solution>, Error> {
        if self.objective.is_some()
            && let Some(solution) = self.verified(self.minimum().map(|(_, unknowns)| unknowns))?
        {
            return Ok(Outcome::Optimal(solution));
        }
        let Some((slack, unknowns)) = self.largest_slack(&self.requirements) else {
            return Ok(Outcome::Inconclusive(if limit::is_over() {
                "its time was over"
            } else {
                "the interior point method did not end"
            }));
        };
        if slack < -UNDECIDED {
            return Ok(Outcome::Infeasible { conflict: self.conflict() });
        }
        Ok(match self.verified(Some(unknowns))? {
            None => Outcome::Inconclusive("the requirements are met or missed by a rounding error"),
            Some(_) if self.objective.is_some() => Outcome::Inconclusive(
                "the requirements can be met, but the smallest value is not found",
            ),
            Some(solution) => Outcome::Optimal(solution),
        })
    }

    /// The smallest value of the objective and the unknowns there, as computed by the solver and
    /// not verified; None without an objective, or if the solver has no result.
    pub(crate) fn minimum(&self) -> Option<(f64, DVector<f64>)> {
        let objective = self.objective.as_ref()?;
        let mut costs = DVector::zeros(self.unknowns);
        for (at, cost) in &objective.terms {
            costs[*at] = cost[(0, 0)];
        }
        let matrices: Vec<_> =
            self.requirements.iter().map(|each| each.semidefinite(None)).collect();
        let (unknowns, _) = minimise(&costs, &matrices)?;
        Some((objective.evaluate(&unknowns)[(0, 0)], unknowns))
    }

    /// The unknowns as far inside of all requirements as possible, or as little outside, not
    /// verified; None if the solver fails.
    pub(super) fn most_interior(&self) -> Option<DVector<f64>> {
        Some(self.largest_slack(&self.requirements)?.1)
    }

    /// The largest common slack, at most one, and the unknowns there; None if the solver fails.
    fn largest_slack<'a>(
        &self,
        requirements: impl IntoIterator<Item = &'a Requirement>,
    ) -> Option<(f64, DVector<f64>)> {
        // The slack is the unknown after all others.
        let mut extended = Self { unknowns: self.unknowns, ..Self::default() };
        let slack = extended.scalar();
        let mut matrices: Vec<_> =
            requirements.into_iter().map(|each| each.semidefinite(Some(&slack))).collect();
        matrices.push(&Affine::identity(1, 1.0) - &slack);
        let mut costs = DVector::zeros(self.unknowns + 1);
        costs[self.unknowns] = -1.0;
        let (unknowns, end) = minimise(&costs, &matrices)?;
        (end == End::Solved)
            .then(|| (unknowns[self.unknowns], unknowns.rows(0, self.unknowns).into_owned()))
    }

    /// Names of requirements that contradict each other, each of them necessary for the contradiction.
    fn conflict(&self) -> Vec<&'static str> {
        let mut names: Vec<&'static str> = Vec::new();
        for name in self.requirements.iter().filter_map(|each| each.name) {
            if !names.contains(&name) {
                names.push(name);
            }
        }
        for candidate in names.clone() {
            let rest: Vec<_> = names.iter().copied().filter(|name| *name != candidate).collect();
            let remains = |each: &&Requirement| each.name.is_none_or(|name| rest.contains(&name));
            let others = self.requirements.iter().filter(remains);
            if self.largest_slack(others).is_some_and(|(slack, _)| slack < -UNDECIDED) {
                names = rest;
            }
        }
        names
    }

    /// The solution with the given unknowns; None without unknowns, or if a requirement keeps less than half of its
    /// margin.
    fn verified(&self, unknowns: Option<DVector<f64>>) -> Result<Option<Solution>, Error> {
        let Some(unknowns) = unknowns else { return Ok(None) };
        let mut margins = Vec::with_capacity(self.requirements.len());
        for each in &self.requirements {
            let matrix = each.matrix.evaluate(&unknowns);
            let half =
                DMatrix::from_diagonal_element(matrix.nrows(), matrix.nrows(), each.margin * 0.5);
            let Some(above) = smallest_eigenvalue(&(matrix - half))? else { return Ok(None) };
            margins.push((each.name, above + 0.5 * each.margin));
        }
        Ok(Some(Solution { unknowns, margins }))
    }
}
