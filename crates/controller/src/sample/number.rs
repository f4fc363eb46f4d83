//! The numbers of the equations.

use core::ops::{Add, Div, Mul, Neg, Sub};

/// A number of the equations: `f64`, `f32`, or a type that also bounds rounding errors or counts operations.
pub trait Number:
    Clone
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// 0.
    fn zero() -> Self;

    /// The largest finite number.
    fn largest() -> Self;

    /// `count` as a number of this type.
    fn whole(count: u32) -> Self;

    /// Whether it is neither infinite nor NaN.
    fn is_finite(&self) -> bool;

    /// Whether it is below another one.
    fn is_below(&self, other: &Self) -> bool;

    /// Whether it is above another one.
    fn is_above(&self, other: &Self) -> bool;
}

macro_rules! number {
    ($($real:ident: $whole:expr),*) => {
        $(impl Number for $real {
            fn zero() -> Self {
                0.0
            }

            fn largest() -> Self {
                Self::MAX
            }

            fn whole(count: u32) -> Self {
                $whole(count)
            }

            fn is_finite(&self) -> bool {
                $real::is_finite(*self)
            }

            fn is_below(&self, other: &Self) -> bool {
                self < other
            }

            fn is_above(&self, other: &Self) -> bool {
                self > other
            }
        })*
    };
}

number!(f64: f64::from, f32: nearest);

/// The `f32` nearest to a whole number: both halves are exact, and their sum is rounded once.
fn nearest(count: u32) -> f32 {
    let [a, b, c, d] = count.to_be_bytes();
    f32::from(u16::from_be_bytes([a, b])) * 65_536.0 + f32::from(u16::from_be_bytes([c, d]))
}

/// Whether all numbers are finite.
pub fn all_finite<N: Number>(vector: &[N]) -> bool {
    vector.iter().all(N::is_finite)
}
