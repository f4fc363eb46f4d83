//! Matrices that are affine functions of unknowns.

use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;
use std::ops::{Add, Mul, Neg, Sub};

/// A matrix that is an affine function of unknown numbers x: `M_0` + `x_1` `M_1` + `x_2` `M_2` + ...
///
/// Unknowns come from [`super::Problem`]; constants from [`Affine::constant`]. Sums, differences
/// and products with known matrices and numbers are written with operators on references. Like the
/// operators of nalgebra they panic if the shapes do not fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Affine {
    pub(super) constant: DMatrix<f64>,
    pub(super) terms: BTreeMap<usize, DMatrix<f64>>,
}

impl Affine {
    /// The expression of a known matrix, without unknowns.
    #[must_use]
    pub fn constant(m: &DMatrix<f64>) -> Self {
        Self { constant: m.clone(), terms: BTreeMap::new() }
    }

    /// The zero matrix.
    #[must_use]
    pub fn zeros(rows: usize, cols: usize) -> Self {
        Self::constant(&DMatrix::zeros(rows, cols))
    }

    /// The identity times a number.
    #[must_use]
    pub fn identity(order: usize, factor: f64) -> Self {
        Self::constant(&DMatrix::from_diagonal_element(order, order, factor))
    }

    /// The numbers of rows and columns.
    #[must_use]
    pub fn shape(&self) -> (usize, usize) {
        self.constant.shape()
    }

    /// The transpose.
    #[must_use]
    pub fn transpose(&self) -> Self {
        self.map(DMatrix::transpose)
    }

    /// The matrix plus its transpose, X + X'.
    #[must_use]
    pub fn plus_transpose(&self) -> Self {
        self.map(|m| m + m.transpose())
    }

    /// The expression x, of one row and column, times a known matrix.
    #[must_use]
    pub fn times(&self, m: &DMatrix<f64>) -> Self {
        self.map(|factor| m * factor[(0, 0)])
    }

    /// The matrix with the given blocks, row by row.
    ///
    /// # Panics
    ///
    /// When the blocks of a row differ in height, the rows differ in length, or there is no block.
    #[must_use]
    pub fn blocks(rows: &[&[&Self]]) -> Self {
        let height = rows.iter().map(|row| row[0].shape().0).sum();
        let width = rows[0].iter().map(|block| block.shape().1).sum();
        let mut whole = Self::zeros(height, width);
        let mut top = 0;
        for row in rows {
            let (mut left, row_height) = (0, row[0].shape().0);
            for block in *row {
                let size = (row_height, block.shape().1);
                whole.constant.view_mut((top, left), size).copy_from(&block.constant);
                for (unknown, m) in &block.terms {
                    let term = whole.terms.entry(*unknown);
                    let target = term.or_insert_with(|| DMatrix::zeros(height, width));
                    target.view_mut((top, left), size).copy_from(m);
                }
                left += size.1;
            }
            assert_eq!(left, width, "the rows of blocks differ in length");
            top += row_height;
        }
        whole
    }

    /// The matrix at given values of the unknowns.
    #[must_use]
    pub fn evaluate(&self, unknowns: &DVector<f64>) -> DMatrix<f64> {
        self.terms.iter().fold(self.constant.clone(), |sum, (at, m)| sum + m * unknowns[*at])
    }

    /// The largest modulus of an entry of `M_0`, `M_1`, ...
    pub(super) fn largest_entry(&self) -> f64 {
        self.terms.values().fold(self.constant.amax(), |size, m| size.max(m.amax()))
    }

    /// Applies a linear function to all matrices.
    fn map(&self, rule: impl Fn(&DMatrix<f64>) -> DMatrix<f64>) -> Self {
        let terms = self.terms.iter().map(|(at, m)| (*at, rule(m))).collect();
        Self { constant: rule(&self.constant), terms }
    }
}

impl Add for &Affine {
    type Output = Affine;

    fn add(self, other: Self) -> Affine {
        let mut sum = self.clone();
        sum.constant += &other.constant;
        for (at, m) in &other.terms {
            let (rows, cols) = m.shape();
            *sum.terms.entry(*at).or_insert_with(|| DMatrix::zeros(rows, cols)) += m;
        }
        sum
    }
}

impl Neg for &Affine {
    type Output = Affine;

    fn neg(self) -> Affine {
        self.map(|m| -m)
    }
}

impl Sub for &Affine {
    type Output = Affine;

    fn sub(self, other: Self) -> Affine {
        self + &-other
    }
}

impl Mul<f64> for &Affine {
    type Output = Affine;

    fn mul(self, factor: f64) -> Affine {
        self.map(|m| m * factor)
    }
}

impl Mul<&DMatrix<f64>> for &Affine {
    type Output = Affine;

    fn mul(self, right: &DMatrix<f64>) -> Affine {
        self.map(|m| m * right)
    }
}

impl Mul<&Affine> for &DMatrix<f64> {
    type Output = Affine;

    fn mul(self, right: &Affine) -> Affine {
        right.map(|m| self * m)
    }
}
