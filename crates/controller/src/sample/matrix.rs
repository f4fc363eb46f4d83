//! The matrices of the equations, and their products with vectors.

use super::number::Number;

/// A matrix, row by row. Between two points of a schedule it is the weighted sum of the matrices at both points.
#[derive(Clone, Copy)]
pub struct Matrix<'a, N> {
    pub(super) entries: &'a [N],
    next: Option<(&'a [N], &'a [N; 2])>,
}

impl<'a, N> Matrix<'a, N> {
    /// A matrix that a design does not state.
    pub const NONE: Self = Self::new(&[]);

    /// The matrix with these entries, row by row.
    #[inline(always)]
    pub const fn new(entries: &'a [N]) -> Self {
        Self { entries, next: None }
    }

    /// The sum of this matrix and another one with the entries `next`, with the weights of both.
    #[must_use]
    #[inline(always)]
    pub const fn towards(self, next: &'a [N], weights: &'a [N; 2]) -> Self {
        Self { next: Some((next, weights)), ..self }
    }

    /// Whether the design states it.
    #[must_use]
    #[inline(always)]
    pub const fn is_stated(&self) -> bool {
        !self.entries.is_empty()
    }
}

impl<N: Number> Matrix<'_, N> {
    /// `target[i]` = row i times the vector.
    #[inline(always)]
    pub fn set_product(&self, vector: &[N], target: &mut [N]) {
        self.for_each_row(vector, target, |_| -N::zero(), |_, product| product);
    }

    /// `target[i]` = `target[i]` + (row i times the vector).
    #[inline(always)]
    pub fn add_product(&self, vector: &[N], target: &mut [N]) {
        self.for_each_row(vector, target, |_| -N::zero(), |sum, product| sum + product);
    }

    /// `target[i]` = `target[i]` - (row i times the vector).
    #[inline(always)]
    pub fn subtract_product(&self, vector: &[N], target: &mut [N]) {
        self.for_each_row(vector, target, |_| -N::zero(), |sum, product| sum - product);
    }

    /// Adds the products of row i and the vector to `target[i]`, one after the other.
    #[inline(always)]
    pub fn accumulate(&self, vector: &[N], target: &mut [N]) {
        self.for_each_row(vector, target, N::clone, |_, sum| sum);
    }

    /// `target[i]` = `end(target[i], sum)`, where `sum` starts with `start(target[i])` and adds the products of row i
    /// and the vector. Changes nothing if the design does not state the matrix. A row is as long as the vector. The
    /// sums start with -0, because -0 + x has the bits of x.
    #[inline(always)]
    fn for_each_row(
        &self,
        vector: &[N],
        target: &mut [N],
        start: impl Fn(&N) -> N,
        end: impl Fn(N, N) -> N,
    ) {
        let mut entries = self.entries.iter();
        let targets = target.iter_mut().filter(|_| self.is_stated());
        match self.next {
            None => {
                for target in targets {
                    let terms = vector.iter().zip(&mut entries);
                    let sum = terms.fold(start(target), |sum, (element, entry)| {
                        sum + entry.clone() * element.clone()
                    });
                    *target = end(target.clone(), sum);
                }
            }
            Some((next, [before, after])) => {
                let mut entries = entries.zip(next);
                for target in targets {
                    let terms = vector.iter().zip(&mut entries);
                    let sum = terms.fold(start(target), |sum, (element, (low, high))| {
                        let entry = low.clone() * before.clone() + high.clone() * after.clone();
                        sum + entry * element.clone()
                    });
                    *target = end(target.clone(), sum);
                }
            }
        }
    }
}
