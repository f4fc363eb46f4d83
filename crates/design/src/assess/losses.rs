//! Losses of effectiveness up to stated fractions: proofs of stability, and the limits of constant losses.

use control::aso::{FaultyPlant, Gains};
use control::controller::controller;
use control::faults::FaultEntry;
use control::lmi::{Outcome, Region, common_reachable_set};
use control::losses::LossyLoop;
use control::{Error, StateSpace};
use nalgebra::{DMatrix, DVector};

use crate::budget::Budget;
use crate::matrix::rows;
use crate::report::losses::{
    CertifiedLoss, ConstantLoss, LossLoop, LossPeak, LossProof, LossReport, described,
};
use crate::report::robustness::{Level, Number};
use crate::solve::solution::Solution;
use crate::solve::tracking::DesignLoop;
use plant_file::faults::EntryPoint;

/// Largest number of states of plant and controller for which linear matrix inequalities are solved.
const LARGEST_ORDER: usize = 30;
/// Rates of the reachable sets to try, relative to twice the proven decay rate.
const RATES: [f64; 3] = [0.2, 0.5, 0.8];

/// An actuator that may lose effectiveness up to a stated fraction.
struct StatedLoss {
    name: String,
    actuator: usize,
    up_to: f64,
    /// The command of the actuator at the operating point.
    operating: f64,
}

/// Returns the stated losses.
fn stated(designed: &Solution) -> Vec<StatedLoss> {
    let linear = &designed.linear;
    let one = |fault: &plant_file::faults::Fault| match (&fault.entry_point, fault.up_to) {
        (EntryPoint::Loss { actuator, .. }, Some(up_to)) => Some(StatedLoss {
            name: linear.actuators[*actuator].name.clone(),
            actuator: *actuator,
            up_to,
            operating: linear.actuators[*actuator].operating.unwrap_or(0.0),
        }),
        _ => None,
    };
    linear.faults.iter().filter_map(one).collect()
}

/// Returns what is proven about the stated losses; None if the plant file states none.
pub(crate) fn losses(designed: &Solution, budget: &Budget) -> Result<Option<LossReport>, Error> {
    let stated = stated(designed);
    if stated.is_empty() {
        return Ok(None);
    }
    let inputs: Vec<_> = stated.iter().map(|loss| loss.actuator).collect();
    let loops = controllers(designed)?
        .into_iter()
        .map(|variant| {
            let lossy = LossyLoop::new(&variant.closed.plant, &variant.closed.controller, &inputs)?;
            Examination { designed, stated: &stated, lossy, budget }.report(&variant)
        })
        .collect::<Result<_, Error>>()?;
    Ok(Some(LossReport { stated: numbers(&stated, |loss| loss.up_to), loops }))
}

fn numbers(stated: &[StatedLoss], value: impl Fn(&StatedLoss) -> f64) -> Vec<Number> {
    stated.iter().map(|loss| number(&loss.name, value(loss))).collect()
}

fn number(name: &str, value: f64) -> Number {
    Number { name: name.to_owned(), unit: None, value }
}

/// Returns the reasons that the losses add to the verdict.
pub(crate) fn reasons(report: &LossReport) -> Vec<(Level, String)> {
    report.loops.iter().filter_map(|lossy| reason(lossy, &report.stated)).collect()
}

/// Returns the reason that a loop adds to the verdict: red if constant losses within the stated range make it unstable,
/// amber if nothing is proven. With the compensation off, which may never happen, instability is amber and a missing
/// proof no reason.
fn reason(report: &LossLoop, stated: &[Number]) -> Option<(Level, String)> {
    let on = report.name == ON;
    let limit = &report.constant[0];
    if !limit.stable && limit.factor <= 1.0 {
        let level = if on { Level::Red } else { Level::Amber };
        let reason = format!(
            "constant losses of effectiveness within the stated range make the loop unstable, \
             {}: from {} on ({})",
            report.name,
            described(&limit.losses),
            level.word()
        );
        return Some((level, reason));
    }
    let reason = report.proof.as_ref().err().filter(|_| on)?;
    let losses = described(stated);
    Some((
        Level::Amber,
        format!("losses of effectiveness up to {losses} are not proven: {reason} (amber)"),
    ))
}

/// The name of the loop with the compensation on.
const ON: &str = "compensation on";

/// The closed loop of the design with the compensation of faults on or off.
struct Variant {
    name: &'static str,
    meaning: &'static str,
    closed: DesignLoop,
}

/// Returns the controllers with compensation on and off.
fn controllers(designed: &Solution) -> Result<Vec<Variant>, Error> {
    let Solution { plant, gains, .. } = designed;
    let uncompensated = Gains { k_f: &gains.k_f * 0.0, ..gains.clone() };
    let (meaning, closed) = if designed.monitor {
        let closed = designed.model().design_loop(&uncompensated)?;
        ("u = K_x x_hat; the faults are estimated, but not compensated", closed)
    } else {
        let controller = without_estimates(plant, &uncompensated, designed)?;
        let closed = DesignLoop { plant: plant.clone(), controller };
        ("u = K_x x_hat; the estimates of the faults are held", closed)
    };
    let off = Variant { name: "compensation off", meaning, closed };
    let on = Variant {
        name: ON,
        meaning: "u = K_x x_hat + K_f f_hat, with the estimates f_hat that the observer computes",
        closed: designed.whole.clone(),
    };
    // No controller holds the estimates while integrals act: then there is no loop with compensation off.
    let held_integrals = gains.integral.is_some() && !designed.monitor;
    Ok(if held_integrals { vec![on] } else { vec![on, off] })
}

/// Returns the controller whose estimates of the faults are held: an observer of the states only.
fn without_estimates(
    plant: &FaultyPlant,
    gains: &Gains,
    designed: &Solution,
) -> Result<StateSpace, Error> {
    let held = Gains { l_f: &gains.l_f * 0.0, ..gains.clone() };
    let StateSpace { a, b, c, d, domain } = controller(plant, &held, designed.domain)?;
    let n = plant.a.nrows();
    Ok(StateSpace {
        a: a.view((0, 0), (n, n)).into(),
        b: b.rows(0, n).into(),
        c: c.columns(0, n).into(),
        d,
        domain,
    })
}

/// One loop under the stated losses.
struct Examination<'a> {
    designed: &'a Solution,
    stated: &'a [StatedLoss],
    lossy: LossyLoop,
    budget: &'a Budget,
}

impl Examination<'_> {
    fn report(&self, variant: &Variant) -> Result<LossLoop, Error> {
        let boxes = self.boxes();
        let constant = boxes.iter().map(|losses| self.constant(losses));
        let constant = constant.collect::<Result<Vec<_>, _>>()?;
        let proof = match self.obstacle(&constant[0]) {
            Some(reason) => Err(reason),
            None => self.proof(variant.name == ON)?,
        };
        let certified = match &proof {
            Err(_) if self.is_too_large() => Vec::new(),
            _ => self.certified(&constant)?,
        };
        let (name, meaning) = (variant.name.to_owned(), variant.meaning.to_owned());
        Ok(LossLoop { name, meaning, constant, proof, certified })
    }

    fn largest(&self) -> Vec<f64> {
        self.stated.iter().map(|loss| loss.up_to).collect()
    }

    /// Returns the stated losses of all actuators together; with several actuators, also of each actuator alone.
    fn boxes(&self) -> Vec<Vec<f64>> {
        let all = self.largest();
        let alone = |at: usize| {
            (0..all.len()).map(|k| if k == at { all[k] } else { 0.0 }).collect::<Vec<_>>()
        };
        let single: Vec<_> = (0..all.len()).map(alone).collect();
        if all.len() == 1 { vec![all] } else { [vec![all], single].concat() }
    }

    fn is_too_large(&self) -> bool {
        self.lossy.intact.nrows() > LARGEST_ORDER
    }

    /// Returns why no proof is searched; None if nothing prevents the search.
    fn obstacle(&self, constant: &ConstantLoss) -> Option<String> {
        if !constant.stable && constant.factor <= 1.0 {
            let losses = described(&constant.losses);
            return Some(format!("the loop is unstable from the constant losses {losses} on"));
        }
        self.is_too_large().then(|| {
            format!(
                "linear matrix inequalities are solved for up to {LARGEST_ORDER} states of plant and \
                 controller, found {}",
                self.lossy.intact.nrows()
            )
        })
    }

    /// Returns the first constant losses that make the loop unstable, on rays within multiples of the box `largest` up
    /// to a loss of 1; if none do, the tested losses nearest to instability.
    fn constant(&self, largest: &[f64]) -> Result<ConstantLoss, Error> {
        let most = 1.0 / largest.iter().copied().fold(0.0, f64::max);
        let limit = self.lossy.constant_limit(largest, most)?;
        let losses = self.stated.iter().zip(&limit.loss);
        let losses = losses.map(|(stated, loss)| number(&stated.name, *loss));
        Ok(ConstantLoss {
            // The losses of 0 are the limit of a loop that is unstable without losses.
            losses: losses.filter(|loss| loss.value > 0.0 || limit.factor <= 0.0).collect(),
            stable: limit.factor >= most,
            factor: limit.factor,
        })
    }

    /// Returns the proof for the stated losses, or why there is none; with decay rate and bounds of the states if
    /// `bounded` and the time allows.
    fn proof(&self, bounded: bool) -> Result<Result<LossProof, String>, Error> {
        let largest = self.largest();
        let certificate = match self.lossy.certificate(&largest, &Region::default())? {
            Outcome::Optimal(certificate) => certificate,
            Outcome::Infeasible { .. } => {
                return Ok(Err(
                    "no common Lyapunov matrix exists for all these losses; losses that vary with \
                     time may make the loop unstable"
                        .to_owned(),
                ));
            }
            Outcome::Inconclusive(reason) => return Ok(Err(reason.to_owned())),
        };
        let searched = bounded && !self.budget.is_over();
        let decay = || self.lossy.decay(&largest);
        let decay = if searched { self.budget.run(decay)? } else { None };
        Ok(Ok(LossProof {
            margin: certificate.margin,
            p: rows(&certificate.p),
            decay,
            peaks: decay.map_or(Ok(Vec::new()), |decay| self.peaks(decay))?,
        }))
    }

    /// Returns the largest losses with a proof, for each of [`Self::boxes`] as far as the time allows. `constant`: the
    /// limits of constant losses, one for each box.
    fn certified(&self, constant: &[ConstantLoss]) -> Result<Vec<CertifiedLoss>, Error> {
        let mut all = Vec::new();
        for (largest, limit) in self.boxes().iter().zip(constant) {
            if self.budget.is_over() {
                break;
            }
            let bound = self.budget.run(|| self.lossy.certified(largest, limit.factor))?;
            if self.budget.is_over() {
                break;
            }
            let losses = self.stated.iter().zip(largest).filter(|(_, largest)| **largest > 0.0);
            let losses = losses.map(|(loss, largest)| number(&loss.name, largest * bound.factor));
            all.push(CertifiedLoss { losses: losses.collect(), factor: bound.factor });
        }
        Ok(all)
    }

    /// Returns the bounds of the states for each disturbance of known size; disturbances without a proof, or without
    /// time for it, are left out. `decay`: the proven decay rate.
    fn peaks(&self, decay: f64) -> Result<Vec<LossPeak>, Error> {
        let linear = &self.designed.linear;
        let corners = self.lossy.corners(&self.largest());
        let (n, order) = (linear.states.len(), self.lossy.intact.nrows());
        let outputs = DMatrix::identity(n, order);
        let mut peaks = Vec::new();
        for Disturbance { name, size, column } in self.disturbances() {
            let column = column.resize_vertically(order, 0.0);
            let mut smallest = vec![f64::INFINITY; n];
            for rate in RATES {
                if self.budget.is_over() {
                    break;
                }
                let (rate, domain) = (2.0 * decay * rate, self.lossy.domain);
                let set = || common_reachable_set(&corners, &column, &outputs, rate, domain);
                let set = self.budget.run(set)?;
                let Outcome::Optimal(set) = set else { continue };
                for (state, smallest) in smallest.iter_mut().enumerate() {
                    let peak = set.peak(&outputs.row(state).transpose());
                    *smallest = smallest.min(peak * size);
                }
            }
            let states = linear.states.iter().zip(smallest);
            peaks.extend(states.filter(|(_, largest)| largest.is_finite()).map(
                |(state, largest)| LossPeak {
                    disturbance: name.clone(),
                    size,
                    state: state.name.clone(),
                    unit: state.unit.clone(),
                    largest,
                },
            ));
        }
        Ok(peaks)
    }

    /// Returns the disturbances of known size: the lost part of each command at the operating point, and each fault
    /// with a bound that is no loss of effectiveness. A fault that enters a measurement counts only if the plant has
    /// the filter.
    fn disturbances(&self) -> Vec<Disturbance> {
        let Solution { linear, extended, whole, .. } = self.designed;
        let plant = &whole.plant;
        let lost =
            self.stated.iter().filter(|loss| loss.operating != 0.0).map(|loss| Disturbance {
                name: format!("lost part of {} at the operating point", loss.name),
                size: loss.up_to * loss.operating.abs(),
                column: plant.b.column(loss.actuator).into_owned(),
            });
        let models = linear.models.iter().zip(&extended.channels);
        let faults = linear.faults.iter().zip(models).filter_map(|(fault, (model, channel))| {
            // A fault on a measurement acts through the filter, which with integral action is part of the controller.
            let additive = match model.entry {
                FaultEntry::LossOfEffectiveness(_) => false,
                _ => !model.entry.is_measured() || plant.a.nrows() > linear.states.len(),
            };
            Some(Disturbance {
                name: fault.name.clone(),
                size: fault.bound.filter(|_| additive)?,
                column: plant.f_a.column(channel.estimate).into_owned(),
            })
        });
        lost.chain(faults).collect()
    }
}

struct Disturbance {
    name: String,
    size: f64,
    /// The column through which the disturbance acts on the states of the plant.
    column: DVector<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::TimeLimits;
    use crate::solve::designed::design;
    use crate::tests::read;

    /// The fault `bias` of u2 enters y2 by D. With integrals the filter is a part of the controller, so that no column
    /// of the plant has the effect on y2.
    #[test]
    fn a_fault_of_an_actuator_that_enters_a_measurement_has_no_bound_beside_integrals() {
        let names = |integral: bool| {
            let (eigenvalues, reference) = if integral {
                ("[-1, -1.2, -1.5]", "reference.track = [\"y1\"]")
            } else {
                ("[-1, -1.5]", "")
            };
            let text = format!(
                "A = [[-1, 0.5], [0, -2]]\nB = [[1, 0], [0, 1]]\nC = [[1, 0], [0, 1]]\n\
                 D = [[0, 0], [0, 0.5]]\nfilter = 20\nfeedback.eigenvalues = {eigenvalues}\n\
                 observer.eigenvalues = [-3, -4, -5, -6, -20, -22]\n{reference}\n\
                 [[faults]]\nname = \"loss\"\nloss_of = \"u1\"\nleast_command = 0.5\nup_to = 0.3\n\
                 [[faults]]\nname = \"bias\"\nactuator = \"u2\"\nbound = 0.1\n"
            );
            let disturbances = read(&text, |file| {
                let designed = design(file).unwrap().nominal;
                let DesignLoop { plant, controller } = &designed.whole;
                let lossy = LossyLoop::new(plant, controller, &[0]).unwrap();
                let (stated, budget) = (stated(&designed), TimeLimits::default().of_certificates());
                let examination =
                    Examination { designed: &designed, stated: &stated, lossy, budget: &budget };
                examination.disturbances()
            });
            disturbances.unwrap().into_iter().map(|one| one.name).collect::<Vec<_>>()
        };
        assert!(names(true).is_empty());
        assert_eq!(names(false), ["bias"]);
    }
}
