//! The number types of the equations, and views of the structs that store their values.

use num_dual::{Dual64, DualNum};

use aso_controller::Matrix;

/// `f64`, or a dual number `x + x' e` with `e² = 0`, which carries the derivative `x'` in a direction
/// through the same equations (forward differentiation).
///
/// Numbers are stored in the same structs in both cases: values in a `T`, and the derivatives of dual
/// numbers in a second `T` of the same shape. So neither case allocates.
pub(crate) trait Number: DualNum<Primitive = f64> + Copy {
    /// Numbers to read: the `T` with the values, and for dual numbers the one with the derivatives.
    type In<'a, T: ?Sized + 'a>: Copy;

    /// Numbers to read and to write; of dual numbers only the derivatives are written.
    type Out<'a, T: ?Sized + 'a>;

    /// The `T` with the values.
    fn values<T: ?Sized>(numbers: Self::In<'_, T>) -> &T;

    /// A part of the numbers.
    fn part<'a, T: ?Sized, U: ?Sized>(
        numbers: Self::In<'a, T>,
        part: impl Fn(&'a T) -> &'a U,
    ) -> Self::In<'a, U>;

    /// The numbers of a list, in order.
    fn list(numbers: Self::In<'_, [f64]>) -> impl Iterator<Item = Self>;

    /// A view of the present numbers, to read them.
    fn read<'a, T: ?Sized>(numbers: &'a Self::Out<'_, T>) -> Self::In<'a, T>;

    /// Writes one number to the place that `place` borrows; of a dual number only its derivative.
    fn write<T: ?Sized>(
        numbers: &mut Self::Out<'_, T>,
        place: impl FnOnce(&mut T) -> &mut f64,
        number: Self,
    );

    /// The number at `position` of a list.
    fn at(numbers: Self::In<'_, [f64]>, position: usize) -> Self;

    /// Adds a matrix times a vector to the elements of `sums` from `first` on; see
    /// [`Matrix::add_product`].
    fn add_product<const WHOLE: bool>(
        sums: &mut Self::Out<'_, [f64]>,
        first: usize,
        matrix: Self::In<'_, Matrix>,
        vector: Self::In<'_, [f64]>,
    );
}

impl Number for f64 {
    type In<'a, T: ?Sized + 'a> = &'a T;
    type Out<'a, T: ?Sized + 'a> = &'a mut T;

    #[inline]
    fn values<T: ?Sized>(numbers: Self::In<'_, T>) -> &T {
        numbers
    }

    #[inline]
    fn part<'a, T: ?Sized, U: ?Sized>(numbers: &'a T, part: impl Fn(&'a T) -> &'a U) -> &'a U {
        part(numbers)
    }

    #[inline]
    fn list(numbers: Self::In<'_, [f64]>) -> impl Iterator<Item = Self> {
        numbers.iter().copied()
    }

    #[inline]
    fn read<'a, T: ?Sized>(numbers: &'a &mut T) -> &'a T {
        numbers
    }

    #[inline]
    fn write<T: ?Sized>(
        numbers: &mut Self::Out<'_, T>,
        place: impl FnOnce(&mut T) -> &mut f64,
        number: Self,
    ) {
        *place(numbers) = number;
    }

    #[inline]
    fn at(numbers: &[f64], position: usize) -> Self {
        numbers[position]
    }

    #[inline]
    fn add_product<const WHOLE: bool>(
        sums: &mut Self::Out<'_, [f64]>,
        first: usize,
        matrix: &Matrix,
        vector: &[f64],
    ) {
        matrix.add_product::<WHOLE>(vector, &mut sums[first..]);
    }
}

impl Number for Dual64 {
    type In<'a, T: ?Sized + 'a> = [&'a T; 2];
    type Out<'a, T: ?Sized + 'a> = (&'a T, &'a mut T);

    fn values<T: ?Sized>(numbers: Self::In<'_, T>) -> &T {
        numbers[0]
    }

    fn part<'a, T: ?Sized, U: ?Sized>(
        numbers: [&'a T; 2],
        part: impl Fn(&'a T) -> &'a U,
    ) -> [&'a U; 2] {
        numbers.map(part)
    }

    fn list(numbers: Self::In<'_, [f64]>) -> impl Iterator<Item = Self> {
        let [values, derivatives] = numbers;
        values.iter().zip(derivatives).map(|(value, derivative)| Self::new(*value, *derivative))
    }

    fn read<'a, T: ?Sized>((values, derivatives): &'a (&T, &mut T)) -> [&'a T; 2] {
        [values, derivatives]
    }

    fn write<T: ?Sized>(
        (_, derivatives): &mut (&T, &mut T),
        place: impl FnOnce(&mut T) -> &mut f64,
        number: Self,
    ) {
        *place(derivatives) = number.eps;
    }

    fn at([values, derivatives]: [&[f64]; 2], position: usize) -> Self {
        Self::new(values[position], derivatives[position])
    }

    fn add_product<const WHOLE: bool>(
        (_, sums): &mut (&[f64], &mut [f64]),
        first: usize,
        [values, derivatives]: [&Matrix; 2],
        vector: [&[f64]; 2],
    ) {
        for (i, sum) in sums[first..].iter_mut().take(values.rows).enumerate() {
            let row = Self::list([values.row(i), derivatives.row(i)]);
            let products = row.zip(Self::list(vector)).map(|(entry, x)| (entry * x).eps);
            *sum = if WHOLE {
                *sum + products.fold(0.0, |sum, product| sum + product)
            } else {
                products.fold(*sum, |sum, product| sum + product)
            };
        }
    }
}
