//! A linear controller and the loop that it closes.

use crate::aso::{Estimator, FaultyPlant, Gains};
use crate::eigen::eigenvalues;
use crate::{Domain, Error, check};
use nalgebra::DMatrix;

/// z' = A z + B y, u = C z + D y; z[k+1] for z' when sampled.
#[derive(Debug, Clone, PartialEq)]
pub struct Controller {
    /// A, k x k.
    pub a: DMatrix<f64>,
    /// B, k x p.
    pub b: DMatrix<f64>,
    /// C, m x k.
    pub c: DMatrix<f64>,
    /// D, m x p.
    pub d: DMatrix<f64>,
}

impl Controller {
    /// The observer and feedback of [`crate::aso`].
    ///
    /// ```text
    /// G = [A + B K_x, F_a + B K_f; 0, A_f],  M = [L_x; L_f],  W = I - M [C, 0]
    /// prediction:  A = G - M [C, 0],  B = M,    C = [K_x, K_f],    D = 0
    /// current:     A = G W,           B = G M,  C = [K_x, K_f] W,  D = [K_x, K_f] M
    /// ```
    ///
    /// z = [`x_hat`; `f_hat`]. A current estimator, for sampled plants, first corrects z by M times the
    /// new residual, then feeds it back, then predicts; its z is the prediction.
    ///
    /// # Errors
    ///
    /// Those of [`Gains::check`].
    pub fn of(plant: &FaultyPlant, gains: &Gains) -> Result<Self, Error> {
        gains.check(plant)?;
        let Model { driven, output, correction, feedback } = Model::of(plant, gains);
        let taken = &correction * output;
        let order = driven.nrows();
        Ok(match gains.estimator {
            Estimator::Prediction => Self {
                a: driven - taken,
                d: DMatrix::zeros(feedback.nrows(), correction.ncols()),
                b: correction,
                c: feedback,
            },
            Estimator::Current => {
                let kept = DMatrix::identity(order, order) - taken;
                Self {
                    a: &driven * &kept,
                    b: driven * &correction,
                    c: &feedback * kept,
                    d: feedback * correction,
                }
            }
        })
    }

    /// The dynamics of [x; z] when input i of the plant acts with the part `effect[i]`:
    ///
    /// ```text
    /// x' = A x + B diag(effect) u,  y = C x
    /// ```
    ///
    /// # Errors
    ///
    /// Those of [`FaultyPlant::check`]; [`Error::Shape`], [`Error::NotFinite`] for a matrix of the
    /// controller or for `effect`.
    pub fn closed_loop(&self, plant: &FaultyPlant, effect: &[f64]) -> Result<DMatrix<f64>, Error> {
        plant.check()?;
        let ((n, m), p, k) = (plant.b.shape(), plant.c.nrows(), self.a.nrows());
        check::shape("the controller's A", &self.a, (k, k))?;
        check::shape("the controller's B", &self.b, (k, p))?;
        check::shape("the controller's C", &self.c, (m, k))?;
        check::shape("the controller's D", &self.d, (m, p))?;
        let effect_column = DMatrix::from_column_slice(effect.len(), 1, effect);
        check::shape("effect", &effect_column, (m, 1))?;
        let b = DMatrix::from_fn(n, m, |i, j| plant.b[(i, j)] * effect[j]);
        let mut whole = DMatrix::zeros(n + k, n + k);
        whole.view_mut((0, 0), (n, n)).copy_from(&(&plant.a + &b * &self.d * &plant.c));
        whole.view_mut((0, n), (n, k)).copy_from(&(&b * &self.c));
        whole.view_mut((n, 0), (k, n)).copy_from(&(&self.b * &plant.c));
        whole.view_mut((n, n), (k, k)).copy_from(&self.a);
        Ok(whole)
    }
}

/// The blocks that both kinds of estimator are made of.
struct Model {
    /// G of [`Controller::of`].
    driven: DMatrix<f64>,
    output: DMatrix<f64>,
    correction: DMatrix<f64>,
    feedback: DMatrix<f64>,
}

impl Model {
    fn of(plant: &FaultyPlant, gains: &Gains) -> Self {
        let (n, q) = plant.f_a.shape();
        let mut driven = plant.augmented_dynamics();
        driven.view_mut((0, 0), (n, n)).copy_from(&gains.controlled_dynamics(plant));
        driven.view_mut((0, n), (n, q)).copy_from(&(&plant.f_a + &plant.b * &gains.k_f));
        let mut correction = gains.l_x.clone().resize_vertically(n + q, 0.0);
        correction.rows_mut(n, q).copy_from(&gains.l_f);
        let mut feedback = gains.k_x.clone().resize_horizontally(n + q, 0.0);
        feedback.columns_mut(n, q).copy_from(&gains.k_f);
        Self { driven, output: plant.augmented_output(), correction, feedback }
    }
}

/// How far a system is from the limit of stability, negative when it is stable: the largest real
/// part of the eigenvalues of A, or when sampled the largest modulus less one.
///
/// `a`: n x n. Method and precision: those of [`eigenvalues`].
///
/// # Errors
///
/// Those of [`eigenvalues`].
pub fn instability(a: &DMatrix<f64>, domain: Domain) -> Result<f64, Error> {
    let size = |value: &nalgebra::Complex<f64>| match domain {
        Domain::Continuous => value.re,
        Domain::Sampled { .. } => value.norm() - 1.0,
    };
    Ok(eigenvalues(a)?.iter().map(size).fold(f64::NEG_INFINITY, f64::max))
}
