//! Tests which faults can be estimated from the measurements.

mod hidden;
mod visibility;

pub use hidden::HiddenFault;
use hidden::hidden_faults;
pub use visibility::Visibility;

use crate::distance::{Distance, from_unobservable};
use crate::faulty_plant::FaultyPlant;
use crate::rank::{Mode, Rank, observability, require_observable, unobservable_modes};
use crate::stability::is_clearly_stable;
use crate::zeros::{Zeros, zeros};
use crate::{Domain, Error};

/// The conditions for estimating the faults of a plant.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Detectability {
    /// Rank of (A, C).
    pub observability: Rank,
    /// The unobservable modes of A; the flag says whether the mode is stable. If all are stable, (A, C) is detectable:
    /// an observer exists, but its gain does not move these eigenvalues.
    pub unobservable: Vec<(Mode, bool)>,
    /// The combinations of faults that the measurements cannot tell from motions of the states. If
    /// there are none and (A, C) is observable, the augmented observer exists.
    pub hidden: Vec<HiddenFault>,
    /// Rank of (`A_0`, `C_0`): full if and only if the observer's eigenvalues can be assigned arbitrarily.
    pub augmented: Rank,
    /// Distance of (`A_0`, `C_0`) from the nearest unobservable pair.
    pub distance: Distance,
    /// Invariant zeros of (A, `F_a`, C): each blocks a fault that develops as e^(s t), or s^k when sampled.
    pub zeros: Zeros,
    /// The effect of each column of `F_a` (inner index) on each measurement (outer index).
    pub visibility: Vec<Vec<Visibility>>,
}

impl Detectability {
    /// Whether the augmented observer exists and its eigenvalues can be assigned arbitrarily.
    #[must_use]
    pub fn observer_exists(&self) -> bool {
        self.observability.is_full() && self.hidden.is_empty() && self.augmented.is_full()
    }

    /// Whether every unobservable mode is stable.
    #[must_use]
    pub fn is_detectable(&self) -> bool {
        self.unobservable.iter().all(|(_, stable)| *stable)
    }

    /// Indices, from zero, of the columns of `F_a` that no measurement shows.
    #[must_use]
    pub fn invisible_faults(&self) -> Vec<usize> {
        let faults = self.visibility.first().map_or(0, Vec::len);
        (0..faults).filter(|&fault| self.visibility.iter().all(|row| !row[fault].visible)).collect()
    }
}

/// Tests whether and how the faults of a plant appear in its measurements.
///
/// `plant`: in the given `domain`. An augmented observer with arbitrary eigenvalues exists when (`A_0`, `C_0`) is
/// observable. [`FaultyPlant::check_observer_exists`] stops at the first condition that fails; this function tests all
/// conditions. Methods, cost and tolerances: see [`observability`], [`zeros`], [`from_unobservable`].
///
/// # Example
///
/// x' = v + f, v' = u with x measured: a constant f cannot be told from a change of the velocity v.
///
/// ```
/// use control::{Domain, aso::FaultyPlant, detectability::detectability};
/// use nalgebra::DMatrix;
/// let plant = FaultyPlant::with_constant_faults(
///     DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, 0.0]),
///     DMatrix::from_row_slice(2, 1, &[0.0, 1.0]),
///     DMatrix::from_row_slice(1, 2, &[1.0, 0.0]),
///     DMatrix::from_row_slice(2, 1, &[1.0, 0.0]),
/// );
/// let result = detectability(&plant, Domain::Continuous)?;
/// assert!(result.visibility[0][0].visible);
/// assert_eq!(result.hidden[0].faults(), [0]);
/// assert_eq!(result.hidden[0].states(), [1]);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix of the plant;
/// [`Error::OutOfRange`] for a bad period, if (A, C) has unobservable modes; [`Error::NotConverged`] when an
/// inner iteration does not end; [`Error::Overflow`].
pub fn detectability(plant: &FaultyPlant, domain: Domain) -> Result<Detectability, Error> {
    plant.check()?;
    let with_stability = |mode: Mode| {
        let stable = is_clearly_stable(mode.eigenvalue, &plant.a, domain)?;
        Ok((mode, stable))
    };
    let modes = unobservable_modes(&plant.a, &plant.c)?;
    let modes = modes.into_iter().map(with_stability).collect::<Result<_, Error>>()?;
    let (a_0, c_0) = (plant.augmented_dynamics(), plant.augmented_output());
    Ok(Detectability {
        observability: observability(&plant.a, &plant.c)?,
        unobservable: modes,
        hidden: hidden_faults(plant)?,
        augmented: observability(&a_0, &c_0)?,
        distance: from_unobservable(&a_0, &c_0)?,
        zeros: zeros(&plant.a, &plant.f_a, &plant.c)?,
        visibility: visibility::table(plant, domain)?,
    })
}

impl FaultyPlant {
    /// Checks that (`A_0`, `C_0`) is observable: an augmented observer with arbitrary eigenvalues exists.
    ///
    /// Equivalent conditions: (A, C) is observable, and at every eigenvalue s of `A_f`, with eigenvectors in the
    /// columns of N, the matrix [A - s I, `F_a` N; C, 0] has full column rank. The measurements then distinguish a
    /// fault that develops as e^(s t) from every motion of the states. For constant and ramp faults s = 0, or 1 in
    /// sampled time. There must be at least as many measurements as N has columns. Singular values below 1e-12 of the
    /// largest count as zero, rows and columns scaled to length one. [`detectability`] returns the hidden faults.
    ///
    /// # Errors
    ///
    /// [`Error::NotObservable`], [`Error::TooManyFaults`], [`Error::HiddenFault`] with the
    /// condition that fails; same as [`FaultyPlant::check`] otherwise; [`Error::NotConverged`].
    pub fn check_observer_exists(&self) -> Result<(), Error> {
        self.check()?;
        require_observable(&self.a, &self.c)?;
        require_shown(self)?;
        require_observable(&self.augmented_dynamics(), &self.augmented_output())
    }

    /// Checks that an augmented observer exists whose error decays: (`A_0`, `C_0`) is detectable.
    /// Returns the unobservable modes of (`A_0`, `C_0`), whose eigenvalues no observer moves.
    ///
    /// The conditions are the same as in [`FaultyPlant::check_observer_exists`], but (A, C) need only be detectable.
    ///
    /// # Errors
    ///
    /// [`Error::NotDetectable`], [`Error::TooManyFaults`], [`Error::HiddenFault`] with the condition
    /// that fails; same as [`FaultyPlant::check`] otherwise; [`Error::OutOfRange`] for a bad period, if
    /// there are unobservable modes; [`Error::NotConverged`].
    pub fn check_detectable(&self, domain: Domain) -> Result<Vec<Mode>, Error> {
        self.check()?;
        require_shown(self)?;
        let (a_0, c_0) = (self.augmented_dynamics(), self.augmented_output());
        let modes = unobservable_modes(&a_0, &c_0)?;
        for Mode { eigenvalue, .. } in &modes {
            if !is_clearly_stable(*eigenvalue, &a_0, domain)? {
                return Err(Error::NotDetectable { eigenvalue: *eigenvalue });
            }
        }
        Ok(modes)
    }
}

/// Checks that the measurements tell all faults from motions of the states.
fn require_shown(plant: &FaultyPlant) -> Result<(), Error> {
    let (all, measurements) = (hidden_faults(plant)?, plant.c.nrows());
    let Some(hidden) = all.first() else { return Ok(()) };
    let HiddenFault { at, channels, rank, expected, .. } = *hidden;
    if channels > measurements {
        return Err(Error::TooManyFaults { faults: channels, measurements });
    }
    let faults = hidden.faults().iter().map(|fault| fault + 1).collect();
    Err(Error::HiddenFault { at, rank, expected, faults })
}
