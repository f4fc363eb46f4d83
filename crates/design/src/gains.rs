//! Computes the gains that satisfy the requirements of the plant file.

use control::aso::Estimator;
use control::lmi::{self, Norm, Outcome, Performance, Synthesis};
use control::placement::{Placement, Quality, place, place_balanced, place_discrete};
use control::riccati::{Weights, kalman, lqr};
use control::sampled::{place_estimator, sampled_poles};
use control::{Domain, Error};
use nalgebra::{Complex, DMatrix};

use super::requirements::{Region, Requirement};

/// A gain and the method that found it.
pub(crate) struct GainResult {
    pub(crate) gain: DMatrix<f64>,
    /// The method, in a sentence.
    pub(crate) method: String,
    /// The required eigenvalues, if any, in the plane of the domain.
    pub(crate) required: Vec<Complex<f64>>,
    /// The quality of an eigenvalue assignment.
    pub(crate) quality: Option<Quality>,
}

/// Why no gain was found.
pub(crate) enum Refusal {
    /// A numerical method failed or rejected its data.
    Control(Error),
    /// The requirements contradict each other, or no result could be verified.
    Conflict(String),
}

impl From<Error> for Refusal {
    fn from(error: Error) -> Self {
        Self::Control(error)
    }
}

/// The system for the state feedback, and its faults.
pub(crate) struct FeedbackProblem<'a> {
    pub(crate) a: &'a DMatrix<f64>,
    pub(crate) b: &'a DMatrix<f64>,
    pub(crate) c: &'a DMatrix<f64>,
    pub(crate) f_a: &'a DMatrix<f64>,
}

/// Computes K of u = K x.
pub(crate) fn feedback(
    required: &Requirement,
    problem: &FeedbackProblem<'_>,
    domain: Domain,
) -> Result<GainResult, Refusal> {
    let FeedbackProblem { a, b, c, f_a } = problem;
    match required {
        Requirement::Eigenvalues(continuous) => {
            let (required, sampled) = in_domain(continuous, domain)?;
            let found =
                if sampled { place_discrete(a, b, &required) } else { place(a, b, &required) };
            Ok(assigned(found?, required))
        }
        Requirement::SampledEigenvalues(required) => {
            Ok(assigned(place_discrete(a, b, required)?, required.clone()))
        }
        Requirement::Weights { states, channels } => {
            let weights = Weights { q: states.clone(), r: channels.clone(), n: None };
            let found = lqr(a, b, &weights, domain)?;
            Ok(weighted(found.gain, "Linear-quadratic regulator", found.residual))
        }
        Requirement::Region(region) => {
            let found = lmi::state_feedback(a, b, &region.stated(), None, domain)?;
            synthesised(found, "Eigenvalues in the region by linear matrix inequalities")
        }
        Requirement::HInfinity { bound, region } => {
            let (m, p) = (b.ncols(), c.nrows());
            let mut feedthrough = DMatrix::zeros(p + m, m);
            feedthrough.view_mut((p, 0), (m, m)).fill_with_identity();
            let performance = Performance {
                disturbance: (*f_a).clone(),
                output: (*c).clone().resize_vertically(p + m, 0.0),
                feedthrough,
                norm: Norm::HInfinity,
                gamma: *bound,
            };
            let region = region.stated();
            let found = lmi::state_feedback(a, b, &region, Some(&performance), domain)?;
            let method = "H-infinity norm from the faults to measurements and commands";
            synthesised(found, &least_certified(method, *bound))
        }
    }
}

/// Computes L of the observer for the pair (`a_0`, `c_0`), whose last `faults` states are the
/// states of the fault model. For a current estimator it is the gain of the correction.
pub(crate) fn observer(
    required: &Requirement,
    (a_0, c_0, faults): (&DMatrix<f64>, &DMatrix<f64>, usize),
    domain: Domain,
    estimator: Estimator,
) -> Result<GainResult, Refusal> {
    let seen = estimator.output_matrix(a_0, c_0);
    match required {
        Requirement::Eigenvalues(continuous) => {
            let (required, sampled) = in_domain(continuous, domain)?;
            if sampled {
                return estimated(a_0, &seen, required);
            }
            let placed = place_balanced(&a_0.transpose(), &seen.transpose(), &required)?;
            let gain = -placed.gain.transpose();
            Ok(assigned(Placement { gain, ..placed }, required))
        }
        Requirement::SampledEigenvalues(required) => estimated(a_0, &seen, required.clone()),
        Requirement::Weights { states, channels } => {
            let found = kalman(a_0, c_0, states, channels, domain)?;
            let gain = found
                .current_gain
                .filter(|_| estimator == Estimator::Current)
                .unwrap_or(found.gain);
            Ok(weighted(gain, "Kalman filter", found.residual))
        }
        Requirement::Region(region) => {
            let found = lmi::observer_gain(a_0, &seen, &region.stated(), None, domain)?;
            synthesised(found, "Eigenvalues in the region by linear matrix inequalities")
        }
        Requirement::HInfinity { bound, region } => {
            let performance = rate_to_error((a_0.nrows(), c_0.nrows(), faults), *bound);
            let region = region.stated();
            let found = lmi::observer_gain(a_0, &seen, &region, Some(&performance), domain)?;
            let method = "H-infinity norm from the faults' rates to the errors of their estimates";
            synthesised(found, &least_certified(method, *bound))
        }
    }
}

/// Returns the performance channel from the rates of the faults, the last states of the observer,
/// to the fault estimation errors.
fn rate_to_error(
    (order, measurements, faults): (usize, usize, usize),
    gamma: Option<f64>,
) -> Performance {
    let mut rate = DMatrix::zeros(order, faults);
    rate.rows_mut(order - faults, faults).fill_with_identity();
    let (output, feedthrough) = (rate.transpose(), DMatrix::zeros(measurements, faults));
    Performance { disturbance: rate, output, feedthrough, norm: Norm::HInfinity, gamma }
}

/// Returns the eigenvalues in the plane of the domain, and whether that is the z-plane.
fn in_domain(
    continuous: &[Complex<f64>],
    domain: Domain,
) -> Result<(Vec<Complex<f64>>, bool), Error> {
    match domain {
        Domain::Continuous => Ok((continuous.to_vec(), false)),
        Domain::Sampled { period } => Ok((sampled_poles(continuous, period)?, true)),
    }
}

/// Computes the estimator gain of a sampled loop.
fn estimated(
    a_0: &DMatrix<f64>,
    seen: &DMatrix<f64>,
    required: Vec<Complex<f64>>,
) -> Result<GainResult, Refusal> {
    let (gain, quality) = place_estimator(a_0, seen, &required)?;
    Ok(assigned(Placement { gain, quality }, required))
}

fn assigned(found: Placement, required: Vec<Complex<f64>>) -> GainResult {
    let method = "Eigenvalues assigned, with well-conditioned eigenvectors.".to_owned();
    GainResult { gain: found.gain, method, required, quality: Some(found.quality) }
}

fn weighted(gain: DMatrix<f64>, method: &str, residual: f64) -> GainResult {
    let method = format!("{method}; relative residual of the Riccati equation {residual:.1e}.");
    GainResult { gain, method, required: Vec::new(), quality: None }
}

/// Says what "least" means: with a region the inequalities are sufficient, not necessary.
fn least_certified(method: &str, bound: Option<f64>) -> String {
    if bound.is_some() {
        return method.to_owned();
    }
    format!(
        "{method}, least certified: designed 5 % above the least bound that one Lyapunov matrix proves for \
         norm and region together; a gain with a smaller norm in this region may exist"
    )
}

fn synthesised(found: Outcome<Synthesis>, method: &str) -> Result<GainResult, Refusal> {
    match found {
        Outcome::Optimal(found) => {
            let bound = found.bound.as_ref();
            let bound = bound.map_or(String::new(), |bound| {
                format!("; bound {:.4e}, verified with margin {:.1e}", bound.gamma, bound.margin)
            });
            let margin = found.region.margin;
            let method = format!("{method}; region verified with margin {margin:.1e}{bound}.");
            Ok(GainResult { gain: found.gain, method, required: Vec::new(), quality: None })
        }
        Outcome::Infeasible { conflict } => Err(Refusal::Conflict(contradiction(&conflict))),
        Outcome::Inconclusive(reason) => Err(Refusal::Conflict(format!(
            "no answer could be verified: {reason}; other requirements, or units nearer to the size of \
             the signals may help"
        ))),
    }
}

/// Names the conflicting requirements as in the plant file.
fn contradiction(conflict: &[&str]) -> String {
    let name = |requirement: &&str| match *requirement {
        "gain" => "h_infinity".to_owned(),
        other => other.to_owned(),
    };
    match conflict {
        [one] => format!("this cannot be met, even without the other requirements: {}", name(one)),
        several => {
            let names: Vec<_> = several.iter().map(name).collect();
            format!("these requirements contradict each other: {}", names.join(", "))
        }
    }
}

impl Region {
    /// Converts the region for the linear matrix inequalities; angles in rad.
    fn stated(self) -> lmi::Region {
        lmi::Region {
            decay: self.decay,
            disc: self.disc.map(|(center, radius)| lmi::Disc { center, radius }),
            sector: self.sector.map(f64::to_radians),
        }
    }
}
