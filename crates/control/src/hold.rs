//! Exact discretisation of a linear system whose input is constant or linear over the step, and its inverse.

use crate::balance::{
    Balance, divide_columns, divide_rows, multiply_columns, multiply_rows, power_of_two_or_one,
};
use crate::blocks::beside;
use crate::exponential::scaling_and_squaring;
use crate::logarithm::logarithm_of_one_plus;
use crate::{Error, check};
use nalgebra::{DMatrix, DVector};

/// The exact solution of x' = A x + B (w0 + w1 t) after a step h: Phi x0 + `Gamma_0` w0 + `Gamma_1` w1.
///
/// Phi = e^(A h), `Gamma_0` = integral of e^(A s) B, `Gamma_1` = integral of e^(A s) (h - s) B,
/// both over s from 0 to h. With w1 = 0 the input is held constant; [`zero_order_hold`] computes
/// only this case. A stable system stays stable for every step size.
#[derive(Debug, Clone, PartialEq)]
pub struct FirstOrderHold {
    /// Phi, n x n: the effect of the state at the start of the step.
    pub phi: DMatrix<f64>,
    /// `Gamma_0`, n x m: the effect of the input at the start of the step.
    pub gamma_0: DMatrix<f64>,
    /// `Gamma_1`, n x m: the effect of the slope of the input.
    pub gamma_1: DMatrix<f64>,
}

impl FirstOrderHold {
    /// Discretises x' = A x + B w over a step.
    ///
    /// `a`: n x n; `b`: n x m; `h`: the step in the unit of time of A, above zero. Method: states
    /// balanced, inputs scaled, then one exponential of the block matrix [A h, B h, 0; 0, 0, I; 0,
    /// 0, 0] of order n + 2 m, whose first row of blocks is [Phi, `Gamma_0`, `Gamma_1` / h]; about
    /// (7 + s) (n + 2 m)^3 multiplications, s = log2(norm of the block matrix / 5.4), at least 0. The
    /// error is the error of the exponential, relative to the norm of each column in balanced coordinates.
    ///
    /// Source: C. F. Van Loan, Computing integrals involving the matrix exponential, IEEE Trans.
    /// Autom. Control 23 (1978), theorem 1.
    ///
    /// # Example
    ///
    /// ```
    /// use control::hold::FirstOrderHold;
    /// use nalgebra::DMatrix;
    /// let (a, b) = (DMatrix::zeros(1, 1), DMatrix::from_element(1, 1, 1.0));
    /// let integrator = FirstOrderHold::new(&a, &b, 0.5)?;
    /// let mut x = [0.0];
    /// integrator.step_into(&[1.0], &[2.0], &[4.0], &mut x)?;
    /// assert!((x[0] - (1.0 + 2.0 * 0.5 + 4.0 * 0.125)).abs() < 1e-15);
    /// # Ok::<(), control::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix, [`Error::OutOfRange`] for a bad `h`,
    /// [`Error::Overflow`] when the result leaves the range of double precision.
    pub fn new(a: &DMatrix<f64>, b: &DMatrix<f64>, h: f64) -> Result<Self, Error> {
        let [phi, gamma_0, gamma_1] = integrals(a, b, h, b.ncols())?;
        Ok(Self { phi, gamma_0, gamma_1 })
    }

    /// Computes out = Phi x + `Gamma_0` w0 + `Gamma_1` w1, without allocation.
    ///
    /// `x`, `out`: n; `w0`, `w1`: m, the input at the start and its slope. NaN and infinities propagate.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`] when a length is wrong; `out` is not changed then.
    pub fn step_into(
        &self,
        x: &[f64],
        w0: &[f64],
        w1: &[f64],
        out: &mut [f64],
    ) -> Result<(), Error> {
        let (n, m) = self.gamma_0.shape();
        check::length("x", x, n)?;
        check::length("w0", w0, m)?;
        check::length("w1", w1, m)?;
        check::length("out", out, n)?;
        out.fill(0.0);
        add_product(&self.phi, x, out);
        add_product(&self.gamma_0, w0, out);
        add_product(&self.gamma_1, w1, out);
        Ok(())
    }
}

/// Discretises x' = A x + B w with w constant over the step: x(h) = Phi x0 + Gamma w, exactly.
///
/// `a`: n x n; `b`: n x m; `h`: the step in the unit of time of A, above zero. Returns (Phi,
/// Gamma), n x n and n x m: Phi = e^(A h), Gamma = integral of e^(A s) B over s from 0 to h. This
/// is the plant for a sampled controller that holds its output between samples. Method, source,
/// cost and tolerance as in [`FirstOrderHold::new`], with a block matrix of order n + m.
///
/// # Example
///
/// ```
/// use control::hold::zero_order_hold;
/// use nalgebra::DMatrix;
/// let a = DMatrix::from_element(1, 1, -2.0);
/// let (phi, gamma) = zero_order_hold(&a, &DMatrix::from_element(1, 1, 4.0), 0.5)?;
/// assert!((phi[(0, 0)] - (-1.0_f64).exp()).abs() < 1e-15);
/// assert!((gamma[(0, 0)] - 2.0 * (1.0 - (-1.0_f64).exp())).abs() < 1e-15);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// Same as [`FirstOrderHold::new`].
pub fn zero_order_hold(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    h: f64,
) -> Result<(DMatrix<f64>, DMatrix<f64>), Error> {
    let [phi, gamma, _] = integrals(a, b, h, 0)?;
    Ok((phi, gamma))
}

/// Computes A and B of the plant x' = A x + B u whose samples have Phi and Gamma: inverts [`zero_order_hold`].
///
/// `phi`: n x n; `gamma`: n x m; `h`: the sample time, above 0. Of all such plants, the result is the one whose
/// eigenvalues have imaginary parts between -pi/h and pi/h. It exists if no eigenvalue of `phi` is zero or negative.
/// Method: states balanced, inputs scaled to the size of phi - I, then the logarithm of [phi, gamma; 0, I],
/// [`logarithm_of_one_plus`].
///
/// # Example
///
/// ```
/// use control::hold::{continuous, zero_order_hold};
/// use nalgebra::DMatrix;
/// let (phi, gamma) = (DMatrix::from_element(1, 1, 0.5), DMatrix::from_element(1, 1, 1.0));
/// let (a, b) = continuous(&phi, &gamma, 0.1)?;
/// assert!((a[(0, 0)] - 0.5_f64.ln() / 0.1).abs() < 1e-13);
/// assert!((zero_order_hold(&a, &b, 0.1)?.1 - gamma).amax() < 1e-14);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad `phi`, called A, or `gamma`, called B;
/// [`Error::OutOfRange`] for a bad `h`; [`Error::NoContinuousPlant`], also if rounding prevents the logarithm.
pub fn continuous(
    phi: &DMatrix<f64>,
    gamma: &DMatrix<f64>,
    h: f64,
) -> Result<(DMatrix<f64>, DMatrix<f64>), Error> {
    let (n, m) = (check::with_inputs(phi, gamma)?, gamma.ncols());
    check::positive("h", h)?;
    let balance = Balance::new(phi);
    let less_one = &balance.matrix - DMatrix::identity(n, n);
    let inputs = divide_rows(gamma, &balance.scale);
    let relative = inputs.column_iter().map(|c| power_of_two_or_one(c.norm() / less_one.norm()));
    let units = DVector::from_iterator(m, relative);
    let whole = beside(&less_one, &divide_columns(&inputs, &units));
    let whole = whole.resize_vertically(n + m, 0.0);
    let all = logarithm_of_one_plus(&whole).ok_or(Error::NoContinuousPlant)? / h;
    let input = multiply_columns(&all.view((0, n), (n, m)).into(), &units);
    let a = balance.restore(&all.view((0, 0), (n, n)).into());
    Ok((a, multiply_rows(&input, &balance.scale)))
}

/// Computes Phi, `Gamma_0`, and `Gamma_1` of the first `slopes` inputs, n x `slopes`.
fn integrals(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    h: f64,
    slopes: usize,
) -> Result<[DMatrix<f64>; 3], Error> {
    let (n, m) = (check::with_inputs(a, b)?, b.ncols());
    check::positive("h", h)?;
    let balance = Balance::of_exponential(a);
    let inputs = check::in_range("B h", divide_rows(b, &balance.scale) * h)?;
    let units =
        DVector::from_iterator(m, inputs.column_iter().map(|c| power_of_two_or_one(c.norm())));
    let mut block = DMatrix::zeros(n + m + slopes, n + m + slopes);
    let scaled_a = check::in_range("A h", &balance.matrix * h)?;
    block.view_mut((0, 0), (n, n)).copy_from(&scaled_a);
    block.view_mut((0, n), (n, m)).copy_from(&divide_columns(&inputs, &units));
    block.view_mut((n, n + m), (slopes, slopes)).fill_with_identity();
    let e = scaling_and_squaring(&block)?;
    let gamma = |from: usize, columns: usize, factor: f64| {
        let entry = |i: usize, j: usize| e[(i, from + j)] * balance.scale[i] * units[j] * factor;
        DMatrix::from_fn(n, columns, entry)
    };
    Ok([
        check::in_range("Phi", balance.restore(&e.view((0, 0), (n, n)).into()))?,
        check::in_range("Gamma_0", gamma(n, m, 1.0))?,
        check::in_range("Gamma_1", gamma(n + m, slopes, h))?,
    ])
}

/// Selects a specialised loop for up to eight states, whose columns fit into registers.
macro_rules! fixed_sizes {
    ($m:expr, $v:expr, $out:expr; $($n:literal)*) => {
        match $out.len() {
            $($n => add_columns::<$n>($m.as_slice().as_chunks().0, $v, $out),)*
            n => {
                for (column, factor) in $m.as_slice().chunks_exact(n.max(1)).zip($v) {
                    add_scaled(column, *factor, $out);
                }
            }
        }
    };
}

/// Adds M v to `out`, column by column, so that the order of the sums does not depend on the size.
fn add_product(m: &DMatrix<f64>, v: &[f64], out: &mut [f64]) {
    fixed_sizes!(m, v, out; 1 2 3 4 5 6 7 8);
}

/// out += M v for a matrix of N rows.
fn add_columns<const N: usize>(columns: &[[f64; N]], v: &[f64], out: &mut [f64]) {
    let Some(out) = out.first_chunk_mut::<N>() else { return };
    let mut sums = *out;
    for (column, factor) in columns.iter().zip(v) {
        add_scaled(column, *factor, &mut sums);
    }
    *out = sums;
}

fn add_scaled(column: &[f64], factor: f64, sums: &mut [f64]) {
    for (sum, entry) in sums.iter_mut().zip(column) {
        *sum += entry * factor;
    }
}
