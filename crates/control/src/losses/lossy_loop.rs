//! A loop whose actuators lose effectiveness: stability for constant losses, proofs for losses that vary.

#[cfg(feature = "lmi")]
mod certified;

#[cfg(feature = "lmi")]
pub use certified::CertifiedLoss;

use crate::check::as_number;
use crate::controller::closed_loop;
use crate::faulty_plant::FaultyPlant;
use crate::stability::instability;
use crate::{Domain, Error, StateSpace, check};
use nalgebra::DMatrix;

/// Largest number of inputs with a loss, as a box over k inputs has 2^k corners.
const MOST_INPUTS: usize = 6;
/// Number of points between no loss and the largest loss at which stability is tested.
const POINTS: u32 = 50;
const BISECTIONS: usize = 40;
/// Largest number of tested rays from zero loss.
const DIRECTIONS: usize = 70;

/// The loop of a plant and a controller as a function of the losses E of its actuators.
///
/// ```text
/// x' = A x + B (I - E) u + F_a f,  [x; z]' = A(E) [x; z]
/// A(E) = A(0) - sum over j of E_j D_j,  0 <= E_j <= largest_j
/// ```
///
/// z are the states of the controller. A(E) is affine in E, so that a box of losses is the convex hull of its corners.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct LossyLoop {
    /// A(0), the dynamics of the loop without losses.
    pub intact: DMatrix<f64>,
    /// `D_j` for each input: the change of A(E) by a full loss of the input.
    pub effects: Vec<DMatrix<f64>>,
    /// Continuous or sampled time. In sampled time a loss changes at samples only.
    pub domain: Domain,
}

/// The limit of constant losses up to which a loop is stable.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ConstantLimit {
    /// The factor by which the box of losses may be scaled while the loop is stable: the argument `most` if the loop is
    /// stable in the whole box, 0 if the loop is unstable without losses.
    pub factor: f64,
    /// The losses at which the loop becomes unstable; the least stable of the tested losses on the far faces
    /// of the box if the loop is stable in the whole box.
    pub loss: Vec<f64>,
}

impl LossyLoop {
    /// The loop of `plant` and `controller` in which the inputs `inputs` may lose effect.
    ///
    /// `plant`: in the time domain of `controller`; `inputs`: indices from zero, at least one, at most six.
    ///
    /// # Errors
    ///
    /// Same as [`closed_loop`]; [`Error::OutOfRange`] for an input that does not exist or a bad number of inputs.
    pub fn new(
        plant: &FaultyPlant,
        controller: &StateSpace,
        inputs: &[usize],
    ) -> Result<Self, Error> {
        let (count, name) = (inputs.len(), "the number of inputs with a loss");
        let holds = (1..=MOST_INPUTS).contains(&count);
        check::that(holds, name, as_number(count), "from one to six")?;
        Self::of_any_number(plant, controller, inputs)
    }

    /// Same as [`Self::new`], for any number of inputs.
    pub(super) fn of_any_number(
        plant: &FaultyPlant,
        controller: &StateSpace,
        inputs: &[usize],
    ) -> Result<Self, Error> {
        let m = plant.b.ncols();
        let (name, rule) = ("the input of a loss", "the index of an input, from zero");
        inputs.iter().try_for_each(|&at| check::that(at < m, name, as_number(at), rule))?;
        let intact = closed_loop(plant, controller, &vec![1.0; m])?;
        let effect = |&input: &usize| {
            let mut effectiveness = vec![1.0; m];
            effectiveness[input] = 0.0;
            Ok(&intact - closed_loop(plant, controller, &effectiveness)?)
        };
        let effects = inputs.iter().map(effect).collect::<Result<_, Error>>()?;
        Ok(Self { effects, intact, domain: controller.domain })
    }

    /// The dynamics A(E) for the losses E = `loss`, one number for each input.
    #[must_use]
    pub fn at(&self, loss: &[f64]) -> DMatrix<f64> {
        let parts = self.effects.iter().zip(loss);
        parts.fold(self.intact.clone(), |sum, (effect, loss)| sum - effect * *loss)
    }

    /// A(E) at the corners of the box from 0 to `largest`; an input whose largest loss is 0 adds no corner.
    #[must_use]
    pub fn corners(&self, largest: &[f64]) -> Vec<DMatrix<f64>> {
        grid(largest, 2).iter().map(|loss| self.at(loss)).collect()
    }

    /// Computes the factor t up to which the loop is stable for every constant loss in the box from 0 to t
    /// times `largest`, by eigenvalues.
    ///
    /// `largest`: one number for each input, from zero to one, above zero for at least one; `most`: the
    /// largest t. On each ray from no loss to a point on a far face of the box, the corners among them, 50
    /// losses are tested, and the first loss of stability is located by bisection. For one input the result is
    /// the limit itself, unless an unstable interval lies between two tested losses; for several inputs a
    /// result below `most` is an upper bound of the limit: there are unstable losses in every larger box.
    ///
    /// # Errors
    ///
    /// Same as [`instability`]; [`Error::Shape`] or [`Error::NotFinite`] for a bad `largest`;
    /// [`Error::OutOfRange`] for a bad `largest` or `most`.
    pub fn constant_limit(&self, largest: &[f64], most: f64) -> Result<ConstantLimit, Error> {
        self.check(largest)?;
        check::positive("the largest factor", most)?;
        let mut limit = ConstantLimit { factor: most, loss: Vec::new() };
        let mut least_stable = f64::NEG_INFINITY;
        for direction in directions(largest) {
            let factor = self.stability_limit(&direction, limit.factor)?;
            let loss: Vec<f64> = direction.iter().map(|part| part * factor).collect();
            if factor < limit.factor {
                limit = ConstantLimit { factor, loss };
            } else if limit.factor >= most {
                let instability = self.instability(&loss)?;
                if instability > least_stable {
                    (least_stable, limit.loss) = (instability, loss);
                }
            }
        }
        Ok(limit)
    }

    /// The largest t, at most `end`, such that the loop is stable at the tested losses up to t times `direction`; 0 if
    /// the loop is unstable without losses.
    pub(super) fn stability_limit(&self, direction: &[f64], end: f64) -> Result<f64, Error> {
        let stable = |t: f64| {
            let loss: Vec<f64> = direction.iter().map(|part| part * t).collect();
            Ok::<_, Error>(self.instability(&loss)? < 0.0)
        };
        if !stable(0.0)? {
            return Ok(0.0);
        }
        let mut good = 0.0;
        for point in 1..=POINTS {
            let t = end * f64::from(point) / f64::from(POINTS);
            if stable(t)? {
                good = t;
                continue;
            }
            let mut bad = t;
            for _ in 0..BISECTIONS {
                let middle = 0.5 * (good + bad);
                *(if stable(middle)? { &mut good } else { &mut bad }) = middle;
            }
            break;
        }
        Ok(good)
    }

    /// The [`instability`] of A(E) at the losses E = `loss`.
    pub(super) fn instability(&self, loss: &[f64]) -> Result<f64, Error> {
        instability(&self.at(loss), self.domain)
    }

    /// Checks the largest losses: one for each input, from zero to one, not all zero.
    fn check(&self, largest: &[f64]) -> Result<(), Error> {
        check::column("the largest losses", largest, self.effects.len())?;
        let rule = "from zero to one, above zero for at least one input";
        for &loss in largest {
            check::that((0.0..=1.0).contains(&loss), "the largest loss", loss, rule)?;
        }
        check::that(largest.iter().any(|loss| *loss > 0.0), "the largest loss", 0.0, rule)
    }
}

/// All combinations of `points` losses from 0 to the largest of each input; an input whose largest loss is 0
/// has this loss only.
pub(super) fn grid(largest: &[f64], points: usize) -> Vec<Vec<f64>> {
    largest.iter().fold(vec![Vec::new()], |all, largest| {
        let values = if *largest > 0.0 { points } else { 1 };
        let value = |at: usize| largest * as_number(at) / as_number(points - 1);
        let extended = |prefix: &Vec<f64>| -> Vec<_> {
            (0..values).map(|at| [prefix.as_slice(), &[value(at)]].concat()).collect()
        };
        all.iter().flat_map(extended).collect()
    })
}

/// The points of a grid on the far faces of the box, where at least one input has its largest loss. The grid has at
/// most 11 points for each input, fewer if the faces would have more than 70 points.
fn directions(largest: &[f64]) -> Vec<Vec<f64>> {
    let lossy = largest.iter().filter(|loss| **loss > 0.0).count();
    let power = |base: usize| base.pow(u32::try_from(lossy).unwrap_or(u32::MAX));
    let fits = |points: &usize| power(*points) - power(points - 1) <= DIRECTIONS;
    let points = (2..=11).rev().find(fits).unwrap_or(2);
    let all = grid(largest, points);
    // The far corner, which may differ from `largest` by rounding.
    let corner = all.last().cloned().unwrap_or_default();
    let on_a_face = |loss: &Vec<f64>| {
        loss.iter().zip(&corner).any(|(loss, farthest)| *farthest > 0.0 && loss >= farthest)
    };
    all.into_iter().filter(on_a_face).collect()
}

#[cfg(test)]
mod tests {
    use super::directions;

    /// 0.91 * 10 / 10 is below 0.91.
    #[test]
    fn a_grid_that_rounds_the_largest_loss_has_its_faces() {
        assert_eq!(directions(&[0.91]).len(), 1);
        assert_eq!(directions(&[0.91, 0.0]).len(), 1);
        assert_eq!(directions(&[0.91, 0.5]).len(), 21);
    }
}
