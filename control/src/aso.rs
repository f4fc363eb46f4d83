//! The augmented state observer: estimates actuator faults and lets the controller compensate them.
//!
//! R. J. Patton and S. Klinkhieo, An adaptive approach to active fault-tolerant control (2009); (n)
//! are its equations. With the measurement y = C x the controller is
//!
//! ```text
//! x_hat' = A x_hat + B u + F_a f_hat + L_x (y - C x_hat)      general form of (4)
//! f_hat' = L_f (y - C x_hat)                                  (5); the dot is missing in print
//! u      = K_x x_hat + K_f f_hat                              (2)
//! ```
//!
//! The general form holds for any u that the actuator really applies. With (2) in full and B `K_f`
//! = -`F_a` the two terms with `f_hat` cancel and (4) is left as printed. The estimation error e =
//! x - `x_hat` obeys (9) to (11) in both cases, because `F_a` takes the place of -B `K_f`:
//!
//! ```text
//! [e; f_hat]' = (A_0 - L C_0) [e; f_hat] - F_0 f_a
//! A_0 = [A, -F_a; 0, 0],  C_0 = [C, 0],  L = [L_x; -L_f],  F_0 = [-F_a; 0]
//! ```

use crate::balance::unit_columns;
use crate::placement::{Quality, place, place_balanced, real};
use crate::rank::require_observable;
use crate::singular::Singular;
use crate::{Error, check};
use nalgebra::DMatrix;

/// Singular values below this part of the largest count as zero in [A, `F_a`; C, 0] and in B.
const TOLERANCE: f64 = 1e-12;

/// x' = A x + B u + `F_a` `f_a`, y = C x: the plant with actuator faults (1).
#[derive(Debug, Clone, PartialEq)]
pub struct FaultyPlant {
    /// A, n x n.
    pub a: DMatrix<f64>,
    /// B, n x m.
    pub b: DMatrix<f64>,
    /// C, p x n.
    pub c: DMatrix<f64>,
    /// `F_a`, n x q: how the faults act. A force against the actuator has `F_a` = -B.
    pub f_a: DMatrix<f64>,
}

/// The gains of the controller.
#[derive(Debug, Clone, PartialEq)]
pub struct Gains {
    /// `K_x`, m x n.
    pub k_x: DMatrix<f64>,
    /// `K_f`, m x q.
    pub k_f: DMatrix<f64>,
    /// `L_x`, n x p.
    pub l_x: DMatrix<f64>,
    /// `L_f`, q x p.
    pub l_f: DMatrix<f64>,
}

/// A designed controller and how well it is designed.
#[derive(Debug, Clone, PartialEq)]
pub struct AsoDesign {
    /// The gains.
    pub gains: Gains,
    /// Norm of B `K_f` + `F_a` relative to that of `F_a` (Frobenius): the part of the fault's
    /// effect that the compensation cannot cancel. Zero when `F_a` lies in the range of B.
    pub cancellation_residual: f64,
    /// Quality of the eigenvalues of A + B `K_x`.
    pub controller: Quality,
    /// Quality of the eigenvalues of `A_0` - L `C_0`, for its transpose.
    pub observer: Quality,
}

impl FaultyPlant {
    /// Shapes and finiteness of the four matrices.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`], naming the matrix.
    pub fn check(&self) -> Result<(), Error> {
        let n = check::square("A", &self.a)?;
        check::shape("B", &self.b, (n, self.b.ncols()))?;
        check::shape("C", &self.c, (self.c.nrows(), n))?;
        check::shape("F_a", &self.f_a, (n, self.f_a.ncols()))
    }

    /// `A_0` = [A, -`F_a`; 0, 0], (n + q) x (n + q); with B `K_f` = -`F_a` that of (10).
    #[must_use]
    pub fn augmented_dynamics(&self) -> DMatrix<f64> {
        let (n, q) = self.f_a.shape();
        let mut a_0 = DMatrix::zeros(n + q, n + q);
        a_0.view_mut((0, 0), (n, n)).copy_from(&self.a);
        a_0.view_mut((0, n), (n, q)).copy_from(&-&self.f_a);
        a_0
    }

    /// `C_0` = [C, 0], p x (n + q).
    #[must_use]
    pub fn augmented_output(&self) -> DMatrix<f64> {
        let (n, q) = self.f_a.shape();
        self.c.clone().resize_horizontally(n + q, 0.0)
    }

    /// `F_0` = [-`F_a`; 0], (n + q) x q: the fault enters (11) as -`F_0` `f_a`.
    #[must_use]
    pub fn augmented_fault(&self) -> DMatrix<f64> {
        let (n, q) = self.f_a.shape();
        (-&self.f_a).resize_vertically(n + q, 0.0)
    }

    /// Whether an augmented observer with any wanted eigenvalues exists.
    ///
    /// It does when (`A_0`, `C_0`) is observable. That is: (A, C) is observable, and the matrix [A,
    /// `F_a`; C, 0] has rank n + q, so that no constant fault is hidden by a constant state. The
    /// latter needs at least as many measurements as fault channels. Singular values below 1e-12 of
    /// the largest count as zero, rows and columns of the matrix scaled to length one.
    ///
    /// # Errors
    ///
    /// [`Error::NotObservable`], [`Error::TooManyFaults`], [`Error::HiddenFault`] with the
    /// condition that fails; those of [`FaultyPlant::check`].
    pub fn check_observer_exists(&self) -> Result<(), Error> {
        self.check()?;
        require_observable(&self.a, &self.c)?;
        let ((n, q), p) = (self.f_a.shape(), self.c.nrows());
        if q > p {
            return Err(Error::TooManyFaults { faults: q, measurements: p });
        }
        let mut both = DMatrix::zeros(n + p, n + q);
        both.view_mut((0, 0), (n, n)).copy_from(&self.a);
        both.view_mut((0, n), (n, q)).copy_from(&self.f_a);
        both.view_mut((n, 0), (p, n)).copy_from(&self.c);
        let rank = Singular::of(&level(&both))?.rank(TOLERANCE);
        if rank < n + q {
            return Err(Error::HiddenFault { rank, expected: n + q });
        }
        require_observable(&self.augmented_dynamics(), &self.augmented_output())?;
        Ok(())
    }

    /// `K_f` with the least norm of B `K_f` + `F_a`, m x q; the smallest one if there are several.
    ///
    /// It always exists; full compensation needs `F_a` in the range of B, which
    /// [`AsoDesign::cancellation_residual`] tells. Singular values of B below 1e-12 of the largest
    /// count as zero.
    ///
    /// # Errors
    ///
    /// Those of [`FaultyPlant::check`]; [`Error::NotConverged`].
    pub fn compensation_gain(&self) -> Result<DMatrix<f64>, Error> {
        self.check()?;
        let b = Singular::of(&self.b)?;
        let rank = b.rank(TOLERANCE);
        let gain = b.least_squares(&-&self.f_a, rank);
        let correction = b.least_squares(&(&self.b * &gain + &self.f_a), rank);
        Ok(gain - correction)
    }
}

impl Gains {
    /// L = [`L_x`; -`L_f`], (n + q) x p, as in (10).
    #[must_use]
    pub fn observer_gain(&self) -> DMatrix<f64> {
        let (n, q) = (self.l_x.nrows(), self.l_f.nrows());
        let mut l = self.l_x.clone().resize_vertically(n + q, 0.0);
        l.rows_mut(n, q).copy_from(&-&self.l_f);
        l
    }

    /// A + B `K_x`, n x n: the plant under exact state feedback.
    #[must_use]
    pub fn controlled_dynamics(&self, plant: &FaultyPlant) -> DMatrix<f64> {
        &plant.a + &plant.b * &self.k_x
    }

    /// `A_0` - L `C_0`, (n + q) x (n + q): the dynamics of the estimation error (11).
    #[must_use]
    pub fn error_dynamics(&self, plant: &FaultyPlant) -> DMatrix<f64> {
        plant.augmented_dynamics() - self.observer_gain() * plant.augmented_output()
    }

    /// Shapes and finiteness of the gains for a plant.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`], naming the matrix; those of
    /// [`FaultyPlant::check`].
    pub fn check(&self, plant: &FaultyPlant) -> Result<(), Error> {
        plant.check()?;
        let ((n, m), p, q) = (plant.b.shape(), plant.c.nrows(), plant.f_a.ncols());
        check::shape("K_x", &self.k_x, (m, n))?;
        check::shape("K_f", &self.k_f, (m, q))?;
        check::shape("L_x", &self.l_x, (n, p))?;
        check::shape("L_f", &self.l_f, (q, p))
    }
}

/// Designs the controller: A + B `K_x` and `A_0` - L `C_0` get the wanted eigenvalues.
///
/// `controller_poles`: n, `observer_poles`: n + q, real, negative for a stable loop, in the unit of
/// A; `k_f`: m x q, or None for [`FaultyPlant::compensation_gain`]. The design exists when (A, B)
/// is controllable and [`FaultyPlant::check_observer_exists`] holds. Method, cost and tolerance:
/// those of [`place`] on (A, B) and of [`place_balanced`] on (`A_0`', `C_0`').
///
/// # Example
///
/// A mass pushed by a force, against an unknown constant force, with its position measured:
///
/// ```
/// use control::aso::{FaultyPlant, design};
/// use nalgebra::DMatrix;
/// let plant = FaultyPlant {
///     a: DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, 0.0]),
///     b: DMatrix::from_row_slice(2, 1, &[0.0, 1.0]),
///     c: DMatrix::from_row_slice(1, 2, &[1.0, 0.0]),
///     f_a: DMatrix::from_row_slice(2, 1, &[0.0, -1.0]),
/// };
/// let gains = design(&plant, &[-1.0, -2.0], &[-10.0, -11.0, -12.0], None)?.gains;
/// // (s + 10) (s + 11) (s + 12) = s^3 + 33 s^2 + 362 s + 1320
/// assert!((gains.l_x - DMatrix::from_row_slice(2, 1, &[33.0, 362.0])).amax() < 1e-9);
/// assert!((gains.l_f[(0, 0)] + 1320.0).abs() < 1e-8);
/// assert!((gains.k_f[(0, 0)] - 1.0).abs() < 1e-15);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// Those of [`place`], of [`FaultyPlant::check_observer_exists`] and of
/// [`FaultyPlant::compensation_gain`]; [`Error::Shape`], [`Error::NotFinite`] for a bad `k_f`.
pub fn design(
    plant: &FaultyPlant,
    controller_poles: &[f64],
    observer_poles: &[f64],
    k_f: Option<&DMatrix<f64>>,
) -> Result<AsoDesign, Error> {
    plant.check_observer_exists()?;
    let k_f = match k_f {
        Some(given) => given.clone(),
        None => plant.compensation_gain()?,
    };
    let ((n, q), m) = (plant.f_a.shape(), plant.b.ncols());
    check::shape("K_f", &k_f, (m, q))?;
    let controller = place(&plant.a, &plant.b, &real(controller_poles))?;
    let (a_0, c_0) = (plant.augmented_dynamics(), plant.augmented_output());
    let observer = place_balanced(&a_0.transpose(), &c_0.transpose(), &real(observer_poles))?;
    let l = -observer.gain.transpose();
    let cancellation_residual = (&plant.b * &k_f + &plant.f_a).norm() / plant.f_a.norm();
    Ok(AsoDesign {
        gains: Gains { k_x: controller.gain, k_f, l_x: l.rows(0, n).into(), l_f: -l.rows(n, q) },
        cancellation_residual,
        controller: controller.quality,
        observer: observer.quality,
    })
}

/// Rows, then columns scaled to length one, so that units do not decide a rank.
fn level(m: &DMatrix<f64>) -> DMatrix<f64> {
    unit_columns(&unit_columns(&m.transpose()).transpose())
}
