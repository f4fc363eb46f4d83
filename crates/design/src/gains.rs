//! The gain that the plant file wants.

use control::aso::Estimator;
use control::lmi::{self, Norm, Outcome, Performance, Synthesis};
use control::placement::{Placement, Quality, place, place_balanced, place_discrete};
use control::riccati::{Weights, kalman, lqr};
use control::sampled::{place_estimator, sampled_poles};
use control::{Domain, Error};
use nalgebra::{Complex, DMatrix};

use super::wanted::{Region, Wanted};

/// A gain, and how it was found.
pub(crate) struct Found {
    pub(crate) gain: DMatrix<f64>,
    /// In a sentence.
    pub(crate) method: String,
    /// The eigenvalues asked for, where there are any, in the plane of the domain.
    pub(crate) wanted: Vec<Complex<f64>>,
    /// Of an assignment of eigenvalues.
    pub(crate) quality: Option<Quality>,
}

/// Why there is no gain.
pub(crate) enum Refusal {
    /// The mathematics refuses the data.
    Control(Error),
    /// The requirements contradict each other, or no answer could be verified.
    Conflict(String),
}

impl From<Error> for Refusal {
    fn from(error: Error) -> Self {
        Self::Control(error)
    }
}

/// A system whose state feedback is wanted, and the faults that it is to withstand.
pub(crate) struct FeedbackProblem<'a> {
    pub(crate) a: &'a DMatrix<f64>,
    pub(crate) b: &'a DMatrix<f64>,
    pub(crate) c: &'a DMatrix<f64>,
    pub(crate) f_a: &'a DMatrix<f64>,
}

/// K of u = K x.
pub(crate) fn feedback(
    wanted: &Wanted,
    problem: &FeedbackProblem<'_>,
    domain: Domain,
) -> Result<Found, Refusal> {
    let FeedbackProblem { a, b, c, f_a } = problem;
    match wanted {
        Wanted::Eigenvalues(continuous) => {
            let (wanted, sampled) = in_domain(continuous, domain)?;
            let found = if sampled { place_discrete(a, b, &wanted) } else { place(a, b, &wanted) };
            Ok(assigned(found?, wanted))
        }
        Wanted::SampledEigenvalues(wanted) => {
            Ok(assigned(place_discrete(a, b, wanted)?, wanted.clone()))
        }
        Wanted::Weights { states, channels } => {
            let weights = Weights { q: states.clone(), r: channels.clone(), n: None };
            let found = lqr(a, b, &weights, domain)?;
            Ok(weighted(found.gain, "Linear-quadratic regulator", found.residual))
        }
        Wanted::Region(region) => {
            let found = lmi::state_feedback(a, b, &region.stated(), None, domain)?;
            synthesised(found, "Eigenvalues in the region by linear matrix inequalities")
        }
        Wanted::HInfinity { bound, region } => {
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
            synthesised(found, "H-infinity norm from the faults to measurements and commands")
        }
    }
}

/// L of the observer for the pair (`a_0`, `c_0`), whose last `faults` states are those of the fault
/// model; of a current estimator the gain of the correction.
pub(crate) fn observer(
    wanted: &Wanted,
    (a_0, c_0, faults): (&DMatrix<f64>, &DMatrix<f64>, usize),
    domain: Domain,
    estimator: Estimator,
) -> Result<Found, Refusal> {
    let seen = estimator.output_matrix(a_0, c_0);
    match wanted {
        Wanted::Eigenvalues(continuous) => {
            let (wanted, sampled) = in_domain(continuous, domain)?;
            if sampled {
                return estimated(a_0, &seen, wanted);
            }
            let placed = place_balanced(&a_0.transpose(), &seen.transpose(), &wanted)?;
            let gain = -placed.gain.transpose();
            Ok(assigned(Placement { gain, ..placed }, wanted))
        }
        Wanted::SampledEigenvalues(wanted) => estimated(a_0, &seen, wanted.clone()),
        Wanted::Weights { states, channels } => {
            let found = kalman(a_0, c_0, states, channels, domain)?;
            let gain = found
                .current_gain
                .filter(|_| estimator == Estimator::Current)
                .unwrap_or(found.gain);
            Ok(weighted(gain, "Kalman filter", found.residual))
        }
        Wanted::Region(region) => {
            let found = lmi::observer_gain(a_0, &seen, &region.stated(), None, domain)?;
            synthesised(found, "Eigenvalues in the region by linear matrix inequalities")
        }
        Wanted::HInfinity { bound, region } => {
            let performance = rate_to_error((a_0.nrows(), c_0.nrows(), faults), *bound);
            let region = region.stated();
            let found = lmi::observer_gain(a_0, &seen, &region, Some(&performance), domain)?;
            let method = "H-infinity norm from the faults' rates to the errors of their estimates";
            synthesised(found, method)
        }
    }
}

/// From the rates of the faults, the last states of the observer, to the errors of their estimates.
fn rate_to_error(
    (order, measurements, faults): (usize, usize, usize),
    gamma: Option<f64>,
) -> Performance {
    let mut rate = DMatrix::zeros(order, faults);
    rate.rows_mut(order - faults, faults).fill_with_identity();
    let (output, feedthrough) = (rate.transpose(), DMatrix::zeros(measurements, faults));
    Performance { disturbance: rate, output, feedthrough, norm: Norm::HInfinity, gamma }
}

/// The eigenvalues in the plane of the domain, and whether that is the z plane.
fn in_domain(
    continuous: &[Complex<f64>],
    domain: Domain,
) -> Result<(Vec<Complex<f64>>, bool), Error> {
    match domain {
        Domain::Continuous => Ok((continuous.to_vec(), false)),
        Domain::Sampled { period } => Ok((sampled_poles(continuous, period)?, true)),
    }
}

/// The estimator of a sampled loop.
fn estimated(
    a_0: &DMatrix<f64>,
    seen: &DMatrix<f64>,
    wanted: Vec<Complex<f64>>,
) -> Result<Found, Refusal> {
    let (gain, quality) = place_estimator(a_0, seen, &wanted)?;
    Ok(assigned(Placement { gain, quality }, wanted))
}

fn assigned(found: Placement, wanted: Vec<Complex<f64>>) -> Found {
    let method = "Eigenvalues assigned, with well-conditioned eigenvectors.".to_owned();
    Found { gain: found.gain, method, wanted, quality: Some(found.quality) }
}

fn weighted(gain: DMatrix<f64>, method: &str, residual: f64) -> Found {
    let method = format!("{method}; relative residual of the Riccati equation {residual:.1e}.");
    Found { gain, method, wanted: Vec::new(), quality: None }
}

fn synthesised(found: Outcome<Synthesis>, method: &str) -> Result<Found, Refusal> {
    match found {
        Outcome::Optimal(found) => {
            let bound = found.bound.as_ref();
            let bound = bound.map_or(String::new(), |bound| {
                format!("; bound {:.4e}, verified with margin {:.1e}", bound.gamma, bound.margin)
            });
            let margin = found.region.margin;
            let method = format!("{method}; region verified with margin {margin:.1e}{bound}.");
            Ok(Found { gain: found.gain, method, wanted: Vec::new(), quality: None })
        }
        Outcome::Infeasible { conflict } => Err(Refusal::Conflict(contradiction(&conflict))),
        Outcome::Inconclusive(reason) => Err(Refusal::Conflict(format!(
            "no answer could be verified: {reason}; other wanted values or units nearer to the size of \
             the signals may help"
        ))),
    }
}

/// The requirements as the plant file names them.
fn contradiction(conflict: &[&str]) -> String {
    let name = |requirement: &&str| match *requirement {
        "gain" => "h_infinity".to_owned(),
        other => other.to_owned(),
    };
    match conflict {
        [one] => format!("this cannot be met, whatever else is wanted: {}", name(one)),
        several => {
            let names: Vec<_> = several.iter().map(name).collect();
            format!("these requirements contradict each other: {}", names.join(", "))
        }
    }
}

impl Region {
    /// The region for the inequalities, angles in rad.
    fn stated(self) -> lmi::Region {
        lmi::Region {
            decay: self.decay,
            disc: self.disc.map(|(center, radius)| lmi::Disc { center, radius }),
            sector: self.sector.map(f64::to_radians),
        }
    }
}
