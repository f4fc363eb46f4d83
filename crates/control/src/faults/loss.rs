//! Loss of effectiveness: its estimate, and the loss up to which the loop is stable.

use crate::aso::FaultyPlant;
use crate::controller::closed_loop;
use crate::stability::instability;
use crate::{Error, StateSpace, check};

/// Number of points on a line, between no loss and the largest loss, at which stability is tested.
const POINTS: u32 = 50;
const BISECTIONS: usize = 40;
/// Largest number of points of the grid over several inputs.
const GRID: usize = 1000;
const GRID_PER_INPUT: usize = 11;

/// Estimates the part E of its effect that an input has lost, from the estimate of f = -E u.
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
    /// Loss up to which the loop is stable if all inputs lose the same part.
    pub common: f64,
    /// For each input, the loss up to which the loop is stable if only this input loses.
    pub single: Vec<f64>,
    /// The point of the grid over all combinations where the loop is least stable.
    pub worst: Vec<f64>,
    /// [`instability`] there; negative when the loop is stable at every point of the grid.
    pub worst_instability: f64,
}

/// Computes the constant losses E up to which the loop of the plant x' = A x + B (I - E) u and the
/// controller is stable.
///
/// `plant`: in the time domain of `controller`; `inputs`: which inputs may lose effect, from zero;
/// `largest`: the largest loss of each, in (0, 1]. For a constant E the loop is linear and its
/// eigenvalues decide stability. On each line 50 points are tested and the first loss of stability
/// is located by bisection; an unstable interval between two points is missed. The grid has 11
/// points for each input, fewer if there were more than 1000 combinations, at least the corners.
/// The observer receives the command, not its remaining effect, so that the loss acts on it as a
/// fault.
///
/// # Errors
///
/// Same as [`closed_loop`] and [`instability`]; [`Error::OutOfRange`] for a bad
/// `largest`, an input that does not exist, or more than nine inputs.
pub fn loss_tolerance(
    plant: &FaultyPlant,
    controller: &StateSpace,
    inputs: &[usize],
    largest: f64,
) -> Result<LossTolerance, Error> {
    let losses = Losses { plant, controller, inputs };
    losses.check(largest)?;
    let alone = |at: usize| {
        let mut direction = vec![0.0; inputs.len()];
        direction[at] = 1.0;
        losses.along(&direction, largest)
    };
    let (worst, worst_instability) = losses.worst(largest)?;
    Ok(LossTolerance {
        common: losses.along(&vec![1.0; inputs.len()], largest)?,
        single: (0..inputs.len()).map(alone).collect::<Result<_, _>>()?,
        worst,
        worst_instability,
    })
}

struct Losses<'a> {
    plant: &'a FaultyPlant,
    controller: &'a StateSpace,
    inputs: &'a [usize],
}

impl Losses<'_> {
    fn check(&self, largest: f64) -> Result<(), Error> {
        if !(largest > 0.0 && largest <= 1.0) {
            let rule = "above zero and at most one";
            return Err(Error::OutOfRange { name: "the largest loss", value: largest, rule });
        }
        #[expect(clippy::cast_precision_loss, reason = "a matrix order is far below 2^52")]
        let as_number = |count: usize| count as f64;
        if let Some(&input) = self.inputs.iter().find(|&&input| input >= self.plant.b.ncols()) {
            let (name, rule) = ("the input of a loss", "the index of an input, from zero");
            return Err(Error::OutOfRange { name, value: as_number(input), rule });
        }
        if self.inputs.is_empty() || 1 << self.inputs.len().min(20) > GRID {
            let (name, rule) = ("the number of inputs with a loss", "from one to nine");
            return Err(Error::OutOfRange { name, value: as_number(self.inputs.len()), rule });
        }
        Ok(())
    }

    fn instability(&self, loss: &[f64]) -> Result<f64, Error> {
        let mut effectiveness = vec![1.0; self.plant.b.ncols()];
        for (&input, loss) in self.inputs.iter().zip(loss) {
            effectiveness[input] = 1.0 - loss;
        }
        let dynamics = closed_loop(self.plant, self.controller, &effectiveness)?;
        instability(&dynamics, self.controller.domain)
    }

    /// The largest t, at most `end`, such that the loop is stable from zero to t times `direction`.
    fn along(&self, direction: &[f64], end: f64) -> Result<f64, Error> {
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

    fn worst(&self, largest: f64) -> Result<(Vec<f64>, f64), Error> {
        let count = self.inputs.len();
        let fits = |points: &usize| points.checked_pow(u32::try_from(count).unwrap_or(u32::MAX));
        let finest = (2..=GRID_PER_INPUT).rev().find(|at| fits(at).is_some_and(|all| all <= GRID));
        let points = finest.unwrap_or(2);
        let mut worst = (vec![0.0; count], f64::NEG_INFINITY);
        let mut corner = vec![0; count];
        loop {
            #[expect(clippy::cast_precision_loss, reason = "at most eleven")]
            let part = |at: &usize| largest * *at as f64 / (points - 1) as f64;
            let loss: Vec<f64> = corner.iter().map(part).collect();
            let value = self.instability(&loss)?;
            if value > worst.1 {
                worst = (loss, value);
            }
            let Some(next) = corner.iter().position(|&at| at + 1 < points) else {
                return Ok(worst);
            };
            corner[next] += 1;
            corner[..next].fill(0);
        }
    }
}
