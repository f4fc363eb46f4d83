//! Designs the fall-back: one feedback for the plant and for every actuator that may fail.
//!
//! The state feedback u = K_x x has one Lyapunov matrix for the intact plant and for the plants in which one
//! actuator has lost the stated fraction of its effect. The observer of the design stays in the loop; it
//! does not know of the loss and takes the commands for the effect of the actuators, so that the eigenvalues
//! of feedback and observer are not those of the loop. Therefore a feedback is accepted only if the loop of
//! plant, observer and feedback decays at the required rate in each case, and for losses in between.
//!
//! Source: J. Jiang, X. Yu, Fault-tolerant control systems: a comparative study between active and passive
//! approaches, Annual Reviews in Control 36 (2012), for the passive design; Bernussou, Peres, Geromel (1989)
//! for the inequalities.

use control::Error;
use control::aso::Gains;
use control::controller::{closed_loop, controller};
use control::lmi::{self, CommonFeedback, Outcome, RegionCertificate, Vertex, certify_common};
use nalgebra::DMatrix;

use crate::plant::rest::unreachable_mode;
use crate::report::number::rounded;
use crate::solve::solution::Solution;
use crate::solve::tracking::decay;
use plant_file::PlantFile;
use plant_file::fallback::FallbackRequest;
use plant_file::requirements::Region;

/// Largest number of states of plant and controller for which linear matrix inequalities are solved.
const LARGEST_ORDER: usize = 30;
/// Required decay rates, relative to that of the intact loop, that are tried in turn if none is stated.
const RATES: [f64; 3] = [0.5, 0.125, 0.03125];
/// Number of losses between 0 and the largest one at which the decay rate is tested.
pub(crate) const LOSSES: u32 = 10;
/// Decay rates below this part of the decay rate of the intact loop count as zero.
const NEGLIGIBLE: f64 = 1e-6;
/// Decay rates of the state feedback, relative to the required one, that are tried in turn: the observer
/// slows the loop.
const FASTER: [f64; 3] = [1.0, 1.5, 2.25];

/// The gains of the fall-back.
#[derive(Clone)]
pub(crate) struct Fallback {
    /// The gain of the state feedback, m x n, for the states of the model in the observer.
    pub(crate) k_x: DMatrix<f64>,
    /// The gain of the compensation, m x q, if the loop with compensation meets the requirement in all cases.
    pub(crate) k_f: Option<DMatrix<f64>>,
    /// The required region, and the proof for the state feedback.
    pub(crate) region: Region,
    pub(crate) certificate: RegionCertificate,
    pub(crate) method: String,
}

/// Designs the fall-back that the plant file requests; None without a request.
///
/// # Errors
///
/// [`crate::Error`] at the entry of the plant file if no fall-back exists, with the actuators that are in conflict.
pub(crate) fn fallback(
    file: &PlantFile<'_>,
    designed: &Solution,
) -> Result<Option<Fallback>, crate::Error> {
    let Some(request) = &file.fallback else { return Ok(None) };
    match (Cases { designed, request }).search()? {
        Ok(design) => Ok(Some(design)),
        Err(reason) => {
            let message = format!("there is no fall-back: {reason}");
            Err(file.error_at(&request.place, message).into())
        }
    }
}

/// The plant with all actuators, and with each actuator that may fail.
pub(crate) struct Cases<'a> {
    pub(crate) designed: &'a Solution,
    pub(crate) request: &'a FallbackRequest,
}

impl Cases<'_> {
    /// Returns the cases: None for the intact plant, then each actuator with the largest loss.
    pub(crate) fn all(&self) -> Vec<Option<usize>> {
        std::iter::once(None).chain(self.request.actuators.iter().copied().map(Some)).collect()
    }

    pub(crate) fn name(&self, case: usize) -> String {
        match self.all()[case] {
            None => "all actuators".to_owned(),
            Some(actuator) => self.described(actuator, self.request.loss),
        }
    }

    pub(crate) fn described(&self, actuator: usize, loss: f64) -> String {
        let name = &self.designed.linear.actuators[actuator].name;
        if loss < 1.0 {
            return format!("{name} with a loss of {}", rounded(loss));
        }
        format!("without {name}")
    }

    /// Returns A and B of the states in each case, in the time domain of the design.
    pub(crate) fn vertices(&self) -> Vec<Vertex> {
        let Solution { plant, extended, .. } = self.designed;
        let n = extended.states;
        let (a, b) = (plant.a.view((0, 0), (n, n)), plant.b.rows(0, n).into_owned());
        let vertex = |case: Option<usize>| Vertex {
            a: a.into_owned(),
            b: remaining(&b, case, self.request.loss),
        };
        self.all().into_iter().map(vertex).collect()
    }

    /// Returns the dynamics of plant, observer and feedback together. `case`: an actuator, and the fraction of its
    /// effect that it has lost; None for the intact plant.
    pub(crate) fn whole(
        &self,
        gains: &Gains,
        case: Option<(usize, f64)>,
    ) -> Result<DMatrix<f64>, Error> {
        let Solution { plant, domain, .. } = self.designed;
        let mut effectiveness = vec![1.0; plant.b.ncols()];
        if let Some((actuator, loss)) = case {
            effectiveness[actuator] = 1.0 - loss;
        }
        closed_loop(plant, &controller(plant, gains, *domain)?, &effectiveness)
    }

    /// Returns the name and the decay rate in 1/s of the case with the slowest loop of plant, observer and fall-back, if
    /// that rate is below the required one; None if all loops are fast enough.
    fn slowest(&self, fallback: &Fallback) -> Result<Option<(String, f64)>, Error> {
        let Self { designed, request } = *self;
        let gains = fallback.gains(designed);
        let rate = |gains: &Gains, case| decay(&self.whole(gains, case)?, designed.domain);
        let intact = rate(&designed.gains, None)?;
        let required = fallback.region.decay.unwrap_or(0.0).max(NEGLIGIBLE * intact);
        let mut slowest = (self.name(0), rate(&gains, None)?);
        for &actuator in &request.actuators {
            for point in 1..=LOSSES {
                let loss = request.loss * f64::from(point) / f64::from(LOSSES);
                let rate = rate(&gains, Some((actuator, loss)))?;
                if rate < slowest.1 {
                    slowest = (self.described(actuator, loss), rate);
                }
            }
        }
        Ok(Some(slowest).filter(|(_, rate)| *rate < required))
    }

    /// Returns the gains, or the reason why there are none.
    fn search(&self) -> Result<Result<Fallback, String>, Error> {
        if let Some(reason) = self.obstacle()? {
            return Ok(Err(reason));
        }
        let Self { designed, request } = *self;
        let intact = decay(&self.whole(&designed.gains, None)?, designed.domain)?;
        if intact <= 0.0 {
            return Ok(Err("the loop of the intact plant is not stable".to_owned()));
        }
        let by_default =
            RATES.map(|part| Region { decay: Some(part * intact), ..Region::default() });
        let regions = request.region.map_or(by_default.to_vec(), |region| vec![region]);
        let mut best = Err(String::new());
        for region in regions {
            best = better(best, self.within(region)?);
            if best.as_ref().is_ok_and(|design| design.k_f.is_some()) {
                break;
            }
        }
        Ok(best)
    }

    /// Returns why no gain can exist, or why none is searched; None if a search makes sense.
    fn obstacle(&self) -> Result<Option<String>, Error> {
        let Self { designed, request } = *self;
        let Solution { linear, whole, .. } = designed;
        let order = whole.plant.a.nrows() + whole.controller.a.nrows();
        if order > LARGEST_ORDER {
            return Ok(Some(format!(
                "linear matrix inequalities are solved for up to {LARGEST_ORDER} states of plant and \
                 controller, found {order}"
            )));
        }
        if request.loss < 1.0 {
            return Ok(None);
        }
        for &actuator in &request.actuators {
            let b = remaining(&linear.b, Some(actuator), 1.0);
            if let Some(mode) = unreachable_mode(linear, &b)? {
                let name = &linear.actuators[actuator].name;
                return Ok(Some(format!(
                    "without {name} the other actuators do not move {mode}; expected `actuators` without \
                     {name}, or a `loss` below 1"
                )));
            }
        }
        Ok(None)
    }

    /// Returns the gains with which all cases meet `region`, with the compensation of the estimated faults if that is
    /// possible, or the reason why none were found.
    fn within(&self, region: Region) -> Result<Result<Fallback, String>, Error> {
        let Solution { extended, gains, domain, .. } = self.designed;
        let n = extended.states;
        let vertices = self.vertices();
        let closed = |gain: &DMatrix<f64>| -> Vec<_> {
            vertices.iter().map(|Vertex { a, b }| a + b * gain).collect()
        };
        let intact = gains.k_x.columns(0, n).into_owned();
        let mut best: Option<Result<Fallback, String>> = None;
        if let Outcome::Optimal(certificate) =
            certify_common(&closed(&intact), &region.stated(), *domain)?
        {
            let method = "The feedback of the intact controller meets the region in all cases.";
            best = Some(self.verified(&intact, region, certificate, method.to_owned())?);
        }
        for factor in FASTER {
            let faster = Region { decay: region.decay.map(|decay| decay * factor), ..region };
            let compensates = matches!(&best, Some(Ok(design)) if design.k_f.is_some());
            if compensates || factor > 1.0 && faster == region {
                break;
            }
            match lmi::common_feedback(&vertices, &faster.stated(), *domain)? {
                Outcome::Optimal(CommonFeedback { gain, certificate, .. }) => {
                    let method = format!(
                        "One gain for the {} cases by linear matrix inequalities, with one P.",
                        vertices.len()
                    );
                    let design = self.verified(&gain, region, certificate, method)?;
                    best = Some(match best {
                        Some(previous) => better(previous, design),
                        None => design,
                    });
                }
                _ if best.is_some() => break,
                Outcome::Infeasible { conflict } => {
                    let names: Vec<_> = conflict.iter().map(|at| self.name(*at)).collect();
                    return Ok(Err(format!(
                        "no gain with one Lyapunov matrix keeps the eigenvalues of these cases in the \
                         region ({}): {}; expected fewer `actuators`, a smaller `loss`, or a larger region",
                        described(region),
                        names.join(", ")
                    )));
                }
                Outcome::Inconclusive(reason) => {
                    return Ok(Err(format!(
                        "no gain for all cases could be verified ({}): {reason}",
                        described(region)
                    )));
                }
            }
        }
        Ok(best.unwrap_or_else(|| Err(String::new())))
    }

    /// Returns the fall-back with the state feedback `gain` if the loops with the observer decay at the required rate,
    /// else why not. It compensates the estimated faults if the loops also decay at this rate with the compensation.
    fn verified(
        &self,
        gain: &DMatrix<f64>,
        region: Region,
        certificate: RegionCertificate,
        method: String,
    ) -> Result<Result<Fallback, String>, Error> {
        let gains = &self.designed.gains;
        let k_x = gain.clone().resize_horizontally(gains.k_x.ncols(), 0.0);
        let mut design = Fallback { k_x, k_f: None, region, certificate, method };
        if let Some((name, rate)) = self.slowest(&design)? {
            let size = rounded(rate.abs());
            let slowest = if rate < 0.0 {
                format!("the loop of the case \"{name}\" is unstable and grows with {size} 1/s")
            } else {
                format!("the slowest eigenvalue of the case \"{name}\" decays with {size} 1/s")
            };
            return Ok(Err(format!(
                "a state feedback meets the region in all cases, but together with the observer, which \
                 does not know of the loss, {slowest}; \
                 expected fewer `actuators`, a smaller `loss`, a smaller decay rate, or a faster observer"
            )));
        }
        design.k_f = Some(gains.k_f.clone());
        if self.slowest(&design)?.is_some() {
            design.k_f = None;
        }
        Ok(Ok(design))
    }
}

/// Returns the first of two results that compensates the estimated faults, else the first that is a fall-back, else the
/// reason of the second.
fn better(
    one: Result<Fallback, String>,
    other: Result<Fallback, String>,
) -> Result<Fallback, String> {
    match (one, other) {
        (Ok(one), Ok(other)) if one.k_f.is_none() && other.k_f.is_some() => Ok(other),
        (Ok(one), _) => Ok(one),
        (Err(_), other) => other,
    }
}

/// Returns B with the column of the actuator `case` reduced by the fraction `loss`.
pub(crate) fn remaining(b: &DMatrix<f64>, case: Option<usize>, loss: f64) -> DMatrix<f64> {
    let mut b = b.clone();
    if let Some(actuator) = case {
        b.column_mut(actuator).scale_mut(1.0 - loss);
    }
    b
}

fn described(region: Region) -> String {
    let Region { decay, disc, sector } = region;
    let decay = decay.map(|rate| format!("decay {} 1/s", rounded(rate)));
    let disc = disc.map(|(center, radius)| {
        format!("disc around {} with radius {}", rounded(center), rounded(radius))
    });
    let sector = sector.map(|angle| format!("sector of {} degrees", rounded(angle)));
    [decay, disc, sector].into_iter().flatten().collect::<Vec<_>>().join(", ")
}

impl Fallback {
    /// Returns the gains of the controller in the fall-back.
    pub(crate) fn gains(&self, designed: &Solution) -> Gains {
        let intact = &designed.gains;
        let k_f = self.k_f.clone().unwrap_or_else(|| &intact.k_f * 0.0);
        Gains { k_x: self.k_x.clone(), k_f, ..intact.clone() }
    }
}
