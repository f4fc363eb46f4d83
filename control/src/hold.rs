//! Exact discretisation of a linear system whose input is a straight line over the step.

use crate::balance::{Balance, divide_rows, power_of_two};
use crate::exponential::scaling_and_squaring;
use crate::{Error, check};
use nalgebra::{DMatrix, DVector};

/// x(h) = Phi x0 + `Gamma_0` w0 + `Gamma_1` w1, the exact solution of x' = A x + B (w0 + w1 t).
///
/// Phi = e^(A h), `Gamma_0` = integral of e^(A s) B, `Gamma_1` = integral of e^(A s) (h - s) B,
/// both over s from 0 to h. With w1 = 0 the input is held constant. No step size makes a stable
/// system unstable.
#[derive(Debug, Clone, PartialEq)]
pub struct FirstOrderHold {
    /// Phi, n x n.
    pub phi: DMatrix<f64>,
    /// `Gamma_0`, n x m, times the input at the start of the step.
    pub gamma_0: DMatrix<f64>,
    /// `Gamma_1`, n x m, times the slope of the input.
    pub gamma_1: DMatrix<f64>,
}

impl FirstOrderHold {
    /// Discretises x' = A x + B w over a step.
    ///
    /// `a`: n x n; `b`: n x m; `h`: the step in the unit of time of A, above zero. The solution
    /// always exists. Method: states balanced, inputs scaled, then one exponential of the block
    /// matrix [A h, B h, 0; 0, 0, I; 0, 0, 0] of order n + 2 m, whose first row of blocks is [Phi,
    /// `Gamma_0`, `Gamma_1` / h]; about (6 + s) 2 (n + 2 m)^3 multiplications, s = log2(norm of A
    /// h). The error is that of the exponential, relative to each column's norm in balanced
    /// coordinates.
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
    /// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix,
    /// [`Error::OutOfRange`] for a bad `h`, [`Error::Overflow`] when the result leaves the range of
    /// double precision.
    pub fn new(a: &DMatrix<f64>, b: &DMatrix<f64>, h: f64) -> Result<Self, Error> {
        let n = check::square("A", a)?;
        check::shape("B", b, (n, b.ncols()))?;
        check::positive("h", h)?;
        let m = b.ncols();
        let balance = Balance::of(a);
        let inputs = check::in_range("B h", divide_rows(b, &balance.scale) * h)?;
        let units = DVector::from_iterator(m, inputs.column_iter().map(|c| unit(c.norm())));
        let mut block = DMatrix::zeros(n + 2 * m, n + 2 * m);
        let scaled_a = check::in_range("A h", &balance.matrix * h)?;
        block.view_mut((0, 0), (n, n)).copy_from(&scaled_a);
        for (input, unit) in units.iter().enumerate() {
            block.view_mut((0, n + input), (n, 1)).copy_from(&(inputs.column(input) / *unit));
            block[(n + input, n + m + input)] = 1.0;
        }
        let e = scaling_and_squaring(&block)?;
        let gamma = |from: usize, factor: f64| {
            DMatrix::from_fn(n, m, |i, j| e[(i, from + j)] * balance.scale[i] * units[j] * factor)
        };
        Ok(Self {
            phi: check::in_range("Phi", balance.restore(&e.view((0, 0), (n, n)).into()))?,
            gamma_0: check::in_range("Gamma_0", gamma(n, 1.0))?,
            gamma_1: check::in_range("Gamma_1", gamma(n + m, h))?,
        })
    }

    /// out = Phi x + `Gamma_0` w0 + `Gamma_1` w1, without allocation.
    ///
    /// `x`, `out`: n; `w0`, `w1`: m, the input at the start of the step and its slope. Not finite
    /// numbers pass through, as in any sum.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`] when a length is wrong; `out` is then untouched.
    pub fn step_into(
        &self,
        x: &[f64],
        w0: &[f64],
        w1: &[f64],
        out: &mut [f64],
    ) -> Result<(), Error> {
        let (n, m) = self.gamma_0.shape();
        length("x", x, n)?;
        length("w0", w0, m)?;
        length("w1", w1, m)?;
        length("out", out, n)?;
        out.fill(0.0);
        add_product(&self.phi, x, out);
        add_product(&self.gamma_0, w0, out);
        add_product(&self.gamma_1, w1, out);
        Ok(())
    }
}

/// A power of two near the size of an input's column; one for an input without effect.
fn unit(norm: f64) -> f64 {
    let power = power_of_two(norm);
    if power.is_normal() { power } else { 1.0 }
}

fn length(name: &'static str, vector: &[f64], expected: usize) -> Result<(), Error> {
    if vector.len() == expected {
        return Ok(());
    }
    Err(Error::Shape { matrix: name, expected: (expected, 1), found: (vector.len(), 1) })
}

/// out += M v, column by column.
fn add_product(m: &DMatrix<f64>, v: &[f64], out: &mut [f64]) {
    for (column, factor) in m.as_slice().chunks_exact(out.len().max(1)).zip(v) {
        for (sum, entry) in out.iter_mut().zip(column) {
            *sum += entry * factor;
        }
    }
}
