//! A number of the equations in single precision: its dependence on states and errors, its size, its rounding error.

use std::ops::{Add, Div, Mul, Neg, Sub};

use aso_controller::sample::Number;
use nalgebra::{DMatrix, RowDVector};

/// The relative rounding error of single precision.
pub(super) const UNIT: f64 = 5.960_464_477_539_063e-8;

/// The elements of a vector: their dependence on states and errors, their size, their rounding errors.
#[derive(Clone)]
pub(super) struct Elements {
    /// Elements x (states of the loop, then errors w): the difference from exact arithmetic as a linear form.
    pub(super) form: DMatrix<f64>,
    /// Elements x signals: a bound of the absolute value.
    pub(super) magnitude: DMatrix<f64>,
    /// Elements x signals: a bound of the errors that are not among w.
    pub(super) error: DMatrix<f64>,
}

impl Elements {
    pub(super) fn zero(rows: usize, widths: Widths) -> Self {
        let none = DMatrix::zeros(rows, widths.signals);
        let form = DMatrix::zeros(rows, widths.forms);
        Self { form, magnitude: none.clone(), error: none }
    }

    /// The elements as [`Rounded`] numbers, from which the equations of the controller compute others.
    pub(super) fn numbers(&self) -> Vec<Rounded> {
        let row = |matrix: &DMatrix<f64>, i: usize| matrix.row(i).into_owned();
        let element = |i| Element {
            form: row(&self.form, i),
            magnitude: row(&self.magnitude, i),
            error: row(&self.error, i),
        };
        (0..self.form.nrows()).map(|i| Rounded::Signal(element(i))).collect()
    }

    /// The elements that the equations have computed.
    pub(super) fn of(numbers: &[Rounded], widths: Widths) -> Self {
        let mut elements = Self::zero(numbers.len(), widths);
        for (i, number) in numbers.iter().enumerate() {
            // An element that is a constant is a sum of products with 0, so it is 0.
            let Rounded::Signal(element) = number else { continue };
            elements.form.row_mut(i).copy_from(&element.form);
            elements.magnitude.row_mut(i).copy_from(&element.magnitude);
            elements.error.row_mut(i).copy_from(&element.error);
        }
        elements
    }
}

/// The numbers of columns of forms, and of magnitudes and errors.
#[derive(Clone, Copy)]
pub(super) struct Widths {
    pub(super) forms: usize,
    pub(super) signals: usize,
}

/// A row of [`Elements`].
#[derive(Clone)]
pub(super) struct Element {
    pub(super) form: RowDVector<f64>,
    pub(super) magnitude: RowDVector<f64>,
    pub(super) error: RowDVector<f64>,
}

/// A number of the equations in single precision.
#[derive(Clone)]
pub(super) enum Rounded {
    Constant(f64),
    Signal(Element),
}

impl Element {
    /// The element with an infinite error, of an operation that is not analysed.
    fn unknown(mut self) -> Rounded {
        self.error.fill(f64::INFINITY);
        Rounded::Signal(self)
    }
}

impl Add for Rounded {
    type Output = Self;

    /// A sum with zero has no error.
    fn add(self, other: Self) -> Self {
        match (self, other) {
            (Self::Constant(a), Self::Constant(b)) => Self::Constant(a + b),
            (Self::Signal(a), Self::Constant(b)) | (Self::Constant(b), Self::Signal(a)) => {
                if b == 0.0 { Self::Signal(a) } else { a.unknown() }
            }
            (Self::Signal(mut a), Self::Signal(b)) => {
                let is_exact = a.magnitude.amax() == 0.0 || b.magnitude.amax() == 0.0;
                a.form += b.form;
                a.magnitude += b.magnitude;
                a.error += b.error;
                if !is_exact {
                    a.error += &a.magnitude * UNIT;
                }
                Self::Signal(a)
            }
        }
    }
}

impl Neg for Rounded {
    type Output = Self;

    fn neg(self) -> Self {
        match self {
            Self::Constant(value) => Self::Constant(-value),
            Self::Signal(element) => Self::Signal(Element { form: -element.form, ..element }),
        }
    }
}

impl Sub for Rounded {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Rounded {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        match (self, other) {
            (Self::Constant(a), Self::Constant(b)) => Self::Constant(a * b),
            (Self::Constant(factor), Self::Signal(element))
            | (Self::Signal(element), Self::Constant(factor)) => {
                if factor == 0.0 {
                    return Self::Constant(0.0);
                }
                let Element { form, magnitude, error } = element;
                Self::Signal(Element {
                    form: form * factor,
                    error: error * factor.abs() + &magnitude * product_error(factor),
                    magnitude: magnitude * factor.abs(),
                })
            }
            (Self::Signal(element), Self::Signal(_)) => element.unknown(),
        }
    }
}

impl Div for Rounded {
    type Output = Self;

    /// A quotient with a signal is not analysed here; `Analysis` bounds the quotient of a sliding-mode law.
    fn div(self, other: Self) -> Self {
        match (self, other) {
            (Self::Constant(a), Self::Constant(b)) => Self::Constant(a / b),
            (Self::Signal(element), _) | (_, Self::Signal(element)) => element.unknown(),
        }
    }
}

impl Number for Rounded {
    fn zero() -> Self {
        Self::Constant(0.0)
    }

    fn largest() -> Self {
        Self::Constant(f64::from(f32::MAX))
    }

    fn whole(count: u32) -> Self {
        Self::Constant(f64::from(count))
    }

    fn is_finite(&self) -> bool {
        true
    }

    fn is_below(&self, _: &Self) -> bool {
        false
    }

    fn is_above(&self, _: &Self) -> bool {
        false
    }
}

/// The error of a product with the constant `entry`, relative to the other factor: the rounding of the constant and of
/// the product, which is exact for a power of two.
pub(super) fn product_error(entry: f64) -> f64 {
    let is_power_of_two = entry.to_bits().trailing_zeros() >= 52;
    let product = if is_power_of_two { 0.0 } else { entry.abs() * UNIT };
    product + constant_error(entry)
}

/// The error of a constant in single precision.
#[expect(clippy::cast_possible_truncation, reason = "the error is what is computed")]
pub(super) fn constant_error(value: f64) -> f64 {
    (value - f64::from(value as f32)).abs()
}
