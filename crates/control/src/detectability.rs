//! Which faults can be estimated, and why not the others.

mod hidden;
mod visibility;

pub use hidden::HiddenFault;
pub(crate) use hidden::hidden_faults;
pub use visibility::Visibility;

use crate::aso::FaultyPlant;
use crate::distance::{Distance, from_unobservable};
use crate::rank::{Mode, Rank, observability, unobservable_modes};
use crate::zeros::{Zeros, zeros};
use crate::{Domain, Error};

/// What there is to know about estimating the faults of a plant.
#[derive(Debug, Clone, PartialEq)]
pub struct Detectability {
    /// Rank of (A, C).
    pub observability: Rank,
    /// The modes of A that no measurement shows, and whether each is stable. With stable ones only
    /// (A, C) is detectable: an observer exists, but these eigenvalues stay where they are.
    pub unobservable: Vec<(Mode, bool)>,
    /// The combinations of faults that are hidden by states. None: with (A, C) observable, the
    /// augmented observer exists.
    pub hidden: Vec<HiddenFault>,
    /// Rank of (`A_0`, `C_0`): full if and only if the observer can have any eigenvalues.
    pub augmented: Rank,
    /// Distance of (`A_0`, `C_0`) from the nearest pair that is not observable.
    pub distance: Distance,
    /// Invariant zeros of (A, `F_a`, C). A fault that develops as e^(s t), or s^k when sampled, is
    /// blocked at a zero s.
    pub zeros: Zeros,
    /// What each measurement (outer) shows of each column of `F_a` (inner).
    pub visibility: Vec<Vec<Visibility>>,
}

impl Detectability {
    /// Whether the augmented observer exists and can have any wanted eigenvalues.
    #[must_use]
    pub fn observer_exists(&self) -> bool {
        self.observability.is_full() && self.hidden.is_empty() && self.augmented.is_full()
    }

    /// Whether every mode that no measurement shows is stable.
    #[must_use]
    pub fn is_detectable(&self) -> bool {
        self.unobservable.iter().all(|(_, stable)| *stable)
    }

    /// The columns of `F_a` that no measurement shows, from zero.
    #[must_use]
    pub fn invisible_faults(&self) -> Vec<usize> {
        let faults = self.visibility.first().map_or(0, Vec::len);
        (0..faults).filter(|&fault| self.visibility.iter().all(|row| !row[fault].visible)).collect()
    }
}

/// Examines whether and how the faults of a plant show in its measurements.
///
/// `plant`: in the given `domain`. The augmented observer with any wanted eigenvalues exists when
/// (`A_0`, `C_0`) is observable, see [`FaultyPlant::check_observer_exists`]; this function does not
/// stop at the first condition that fails, but answers all of them. Methods, cost and tolerances:
/// those of [`observability`], [`zeros`], [`from_unobservable`].
///
/// # Example
///
/// x' = v + f, v' = u with x measured: a constant error f of the rate looks like another velocity.
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
/// let found = detectability(&plant, Domain::Continuous)?;
/// assert!(found.visibility[0][0].visible);
/// assert_eq!(found.hidden[0].faults(), [0]);
/// assert_eq!(found.hidden[0].states(), [1]);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// Those of [`FaultyPlant::check`], [`observability`], [`zeros`], [`from_unobservable`].
pub fn detectability(plant: &FaultyPlant, domain: Domain) -> Result<Detectability, Error> {
    plant.check()?;
    let with_stability = |mode: Mode| {
        let stable = domain.excess(mode.eigenvalue) < 0.0;
        (mode, stable)
    };
    let modes = unobservable_modes(&plant.a, &plant.c)?;
    let (a_0, c_0) = (plant.augmented_dynamics(), plant.augmented_output());
    Ok(Detectability {
        observability: observability(&plant.a, &plant.c)?,
        unobservable: modes.into_iter().map(with_stability).collect(),
        hidden: hidden_faults(plant)?,
        augmented: observability(&a_0, &c_0)?,
        distance: from_unobservable(&a_0, &c_0)?,
        zeros: zeros(&plant.a, &plant.f_a, &plant.c)?,
        visibility: visibility::table(plant, domain)?,
    })
}
