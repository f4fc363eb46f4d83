//! The gains of the controller.

use crate::blocks::stacked;
use crate::faulty_plant::FaultyPlant;
use crate::tracking::IntegralAction;
use crate::{Error, check};
use nalgebra::DMatrix;

/// The way in which the observer uses the newest measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Estimator {
    /// The measurement corrects the derivative of the estimate, in sampled time the next estimate.
    /// The computation of u may take the whole sampling interval; u acts one sample late.
    Prediction,
    /// Sampled time only: `y[k]` corrects `x_hat[k]` before `u[k]` is formed. The computation must
    /// be short compared with the sampling interval.
    Current,
}

/// The gains of the controller.
///
/// With a direct term `P_f` the observer's state is [`x_hat`; `f_hat_i`], with `f_hat_i` in place of `f_hat` in the
/// equations of [`crate::aso`], and the estimate of the faults, which the feedback uses, is
///
/// ```text
/// f_hat = f_hat_i + P_f (y - C x_hat)
/// ```
///
/// where `x_hat` and `f_hat_i` are the corrected ones if the estimator is [`Estimator::Current`]. The direct term does
/// not change the error dynamics.
#[derive(Debug, Clone, PartialEq)]
pub struct Gains {
    /// The way in which the observer uses the newest measurement.
    pub estimator: Estimator,
    /// `K_x`, m x n: the feedback of the estimated states.
    pub k_x: DMatrix<f64>,
    /// `K_f`, m x q: the compensation of the estimated faults.
    pub k_f: DMatrix<f64>,
    /// `L_x`, n x p: the observer gain of the states.
    pub l_x: DMatrix<f64>,
    /// `L_f`, q x p: the observer gain of the faults.
    pub l_f: DMatrix<f64>,
    /// `P_f`, q x p; None without a direct term.
    pub p_f: Option<DMatrix<f64>>,
    /// The integral action for references, if any.
    pub integral: Option<IntegralAction>,
}

impl Estimator {
    /// The output matrix of the error dynamics: `C_0`, or `C_0` `A_0` for a current estimator,
    /// which uses the measurement after the step of `A_0`.
    #[must_use]
    pub fn output_matrix(self, a_0: &DMatrix<f64>, c_0: &DMatrix<f64>) -> DMatrix<f64> {
        match self {
            Self::Prediction => c_0.clone(),
            Self::Current => c_0 * a_0,
        }
    }
}

impl Gains {
    /// The number of integrator states.
    #[must_use]
    pub fn integrals(&self) -> usize {
        self.integral.as_ref().map_or(0, |integral| integral.gain.ncols())
    }

    /// L = [`L_x`; -`L_f`], (n + q) x p, as in (10) of [`crate::aso`].
    #[must_use]
    pub fn observer_gain(&self) -> DMatrix<f64> {
        stacked(&self.l_x, &-&self.l_f)
    }

    /// A + B `K_x`, n x n: the plant under exact state feedback.
    #[must_use]
    pub fn controlled_dynamics(&self, plant: &FaultyPlant) -> DMatrix<f64> {
        &plant.a + &plant.b * &self.k_x
    }

    /// `A_0` - L `C_0`, (n + q) x (n + q): the dynamics of the estimation error, (11) of [`crate::aso`]. For a current
    /// estimator, `A_0` - L `C_0` `A_0`: the dynamics of the error after the correction.
    #[must_use]
    pub fn error_dynamics(&self, plant: &FaultyPlant) -> DMatrix<f64> {
        let a_0 = plant.augmented_dynamics();
        &a_0 - self.observer_gain() * self.estimator.output_matrix(&a_0, &plant.augmented_output())
    }

    /// A - `L_x` C, n x n, or A - `L_x` C A for a current estimator: the dynamics of the state error while the fault
    /// estimates are constant. Its eigenvalues are not assigned; they must be stable for a loop that starts without
    /// fault estimation.
    #[must_use]
    pub fn state_error_dynamics(&self, plant: &FaultyPlant) -> DMatrix<f64> {
        &plant.a - &self.l_x * self.estimator.output_matrix(&plant.a, &plant.c)
    }

    /// Checks shapes and finiteness of the plant and of the gains for it.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`], naming the matrix of plant or gains.
    pub fn check(&self, plant: &FaultyPlant) -> Result<(), Error> {
        plant.check()?;
        let ((n, m), p, q) = (plant.b.shape(), plant.c.nrows(), plant.f_a.ncols());
        check::shape("K_x", &self.k_x, (m, n))?;
        check::shape("K_f", &self.k_f, (m, q))?;
        check::shape("L_x", &self.l_x, (n, p))?;
        check::shape("L_f", &self.l_f, (q, p))?;
        self.p_f.as_ref().map_or(Ok(()), |p_f| check::shape("P_f", p_f, (q, p)))?;
        let Some(IntegralAction { h, output, faults, gain }) = &self.integral else {
            return Ok(());
        };
        let t = gain.ncols();
        check::shape("K_i", gain, (m, t))?;
        check::shape("H", h, (t, p))?;
        check::shape("H C", output, (t, n))?;
        check::shape("H F_s", faults, (t, q))
    }

    /// `P_f` C, q x n: the direct term adds this matrix times x - `x_hat` to `f_hat`; None without a direct term.
    pub(crate) fn direct(&self, plant: &FaultyPlant) -> Option<DMatrix<f64>> {
        self.p_f.as_ref().map(|p_f| p_f * &plant.c)
    }
}
