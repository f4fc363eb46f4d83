//! Loss of effectiveness: its estimate, and the loss up to which the loop is stable.

use super::lossy_loop::{LossyLoop, grid};
use crate::check::as_number;
use crate::faulty_plant::FaultyPlant;
use crate::{Error, StateSpace, check};

/// Largest number of points of the grid over all inputs.
const GRID: usize = 1000;
/// Largest number of points of the grid for one input.
const GRID_PER_INPUT: usize = 11;

/// Estimates the loss of effectiveness E of an input from the estimate of the fault f = -E u.
///
/// ```text
/// E_hat = -u f_hat / (u^2 + u_e^2)
/// ```
///
/// `u`: the command; `f_hat`: the estimate, both in the unit of the input; `excitation`: `u_e`,
/// above zero. A command well below `u_e` carries no information and gives an estimate near zero.
/// This is the regularised least-squares estimate of E; an exact `f_hat` gives E times u^2 / (u^2 +
/// `u_e`^2).
///
/// # Errors
///
/// [`Error::OutOfRange`] when `excitation` is not above zero.
pub fn estimated_loss(u: f64, f_hat: f64, excitation: f64) -> Result<f64, Error> {
    check::positive("u_e", excitation)?;
    let size = u.hypot(excitation);
    Ok(-(u / size) * (f_hat / size))
}

/// The constant losses of effectiveness for which a loop is stable.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct LossTolerance {
    /// The loss up to which the loop is stable if all inputs lose the same part; at most the largest loss.
    pub common: f64,
    /// For each input, the loss up to which the loop is stable if only this input loses effect.
    pub single: Vec<f64>,
    /// The losses, a point of the grid over all combinations, at which the loop is least stable.
    pub worst: Vec<f64>,
    /// [`instability`](crate::stability::instability) at `worst`; negative if the loop is stable at every
    /// point of the grid.
    pub worst_instability: f64,
}

/// Computes the constant losses E up to which the loop of the plant x' = A x + B (I - E) u and the
/// controller is stable.
///
/// `plant`: in the time domain of `controller`; `inputs`: the inputs that may lose effect, indices from zero;
/// `largest`: the largest loss of each, in (0, 1]. For a constant E the loop is linear and its
/// eigenvalues decide stability. For `common` and each entry of `single` 50 losses are tested, and the first
/// loss of stability is located by bisection; an unstable interval between two tested losses is missed. The
/// grid has 11 points for each input, fewer if there were more than 1000 combinations, at least the corners.
/// The observer receives the command without the loss, so that the loss acts on it as a fault.
///
/// # Errors
///
/// Same as [`closed_loop`](crate::controller::closed_loop) and
/// [`instability`](crate::stability::instability); [`Error::OutOfRange`] for a bad
/// `largest`, an input that does not exist, no inputs, or more than nine inputs.
pub fn loss_tolerance(
    plant: &FaultyPlant,
    controller: &StateSpace,
    inputs: &[usize],
    largest: f64,
) -> Result<LossTolerance, Error> {
    let rule = "above zero and at most one";
    check::that(largest > 0.0 && largest <= 1.0, "the largest loss", largest, rule)?;
    let (count, name) = (inputs.len(), "the number of inputs with a loss");
    let holds = count > 0 && 1 << count.min(20) <= GRID;
    check::that(holds, name, as_number(count), "from one to nine")?;
    let lossy = LossyLoop::of_any_number(plant, controller, inputs)?;
    let alone = |at: usize| {
        let mut direction = vec![0.0; count];
        direction[at] = 1.0;
        lossy.stability_limit(&direction, largest)
    };
    let (mut worst, mut worst_instability) = (vec![0.0; count], f64::NEG_INFINITY);
    for loss in grid(&vec![largest; count], points(count)) {
        let instability = lossy.instability(&loss)?;
        if instability > worst_instability {
            (worst, worst_instability) = (loss, instability);
        }
    }
    Ok(LossTolerance {
        common: lossy.stability_limit(&vec![1.0; count], largest)?,
        single: (0..count).map(alone).collect::<Result<_, _>>()?,
        worst,
        worst_instability,
    })
}

/// The number of points for each input, from 2 to 11: the largest whose grid has at most 1000 points.
fn points(inputs: usize) -> usize {
    let inputs = u32::try_from(inputs).unwrap_or(u32::MAX);
    let fits = |points: &usize| points.checked_pow(inputs).is_some_and(|all| all <= GRID);
    (2..=GRID_PER_INPUT).rev().find(fits).unwrap_or(2)
}
