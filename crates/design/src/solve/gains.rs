//! Computes the gains that satisfy the requirements of the plant file.

use control::Domain;
use control::aso::Estimator;
use control::lmi;
use control::placement::{
    Alternatives, Placement, alternatives, alternatives_balanced, alternatives_discrete,
};
use control::rank::{ControllablePart, Mode, controllable_part, uncontrollable_modes};
use control::riccati::{Weights, kalman, lqr};
use control::sampled::{estimator_alternatives, sampled_poles};
use nalgebra::{Complex, DMatrix};

use crate::solve::gain::{
    FeedbackProblem, GainChoice, GainResult, Noise, Refusal, require, synthesised, unique,
};
use crate::solve::norm_gains::{NormRequirement, ObserverProblem};
use plant_file::requirements::Requirement;

const IN_REGION: &str = "Eigenvalues in the region by linear matrix inequalities";
/// Relative distance within which a requested eigenvalue counts as that of a mode that no gain moves. For
/// `sampled_eigenvalues` and a mode within the unit circle the distance is relative to 1.
const SAME: f64 = 1e-4;

/// Computes K of u = K x.
///
/// Modes that the commands do not reach keep their eigenvalues, which the requirement must allow.
pub(crate) fn feedback(
    required: &Requirement,
    problem: &FeedbackProblem<'_>,
    domain: Domain,
) -> Result<GainResult, Refusal> {
    let FeedbackProblem { a, b, .. } = problem;
    match required {
        Requirement::Eigenvalues(_) | Requirement::SampledEigenvalues(_) => {
            let part = controllable_part(a, b)?;
            let Assignment { required, movable } = movable(required, &part.fixed, domain)?;
            let sampled = domain != Domain::Continuous;
            let assign = if sampled { alternatives_discrete } else { alternatives };
            let (a_1, b_1) = part.pair(a, b);
            let gains = assign(a_1, b_1, &movable)?.map(|gain| part.complete(gain));
            Ok(assigned(&gains, &required, &part))
        }
        Requirement::Weights { states, channels } => {
            let weights = Weights { q: states.clone(), r: channels.clone(), n: None };
            let regulator = lqr(a, b, &weights, domain)?;
            Ok(weighted(regulator.gain, "Linear-quadratic regulator", regulator.residual))
        }
        Requirement::Bandwidth(bandwidth) => problem.by_bandwidth(bandwidth, domain),
        Requirement::Region(region) => {
            let part = controllable_part(a, b)?;
            require(*region, &part.fixed, domain)?;
            let (a_1, b_1) = part.pair(a, b);
            let outcome = lmi::state_feedback(a_1, b_1, &region.stated(), None, domain)?;
            Ok(synthesised(outcome, IN_REGION)?.mapped(|gain| part.complete(gain)))
        }
        Requirement::HInfinity { bound, region, channel } => {
            require(*region, &uncontrollable_modes(a, b)?, domain)?;
            problem.by_norm(NormRequirement { bound: *bound, region: *region, channel, domain })
        }
    }
}

/// Computes L of the observer, for a current estimator the gain of the correction.
///
/// Modes that the measurements do not show keep their eigenvalues, which the requirement must allow.
pub(crate) fn observer(
    required: &Requirement,
    problem: &ObserverProblem<'_>,
    domain: Domain,
) -> Result<GainResult, Refusal> {
    let ObserverProblem { a_0, c_0, estimator, .. } = *problem;
    let output = estimator.output_matrix(a_0, c_0);
    let (a_dual, b_dual) = (a_0.transpose(), output.transpose());
    match required {
        Requirement::Eigenvalues(_) | Requirement::SampledEigenvalues(_) => {
            let part = controllable_part(&a_dual, &b_dual)?;
            let Assignment { required, movable } = movable(required, &part.fixed, domain)?;
            let (a_1, b_1) = part.pair(&a_dual, &b_dual);
            let gains = match domain {
                Domain::Continuous => {
                    alternatives_balanced(a_1, b_1, &movable)?.map(|gain| -gain.transpose())
                }
                Domain::Sampled { .. } => {
                    estimator_alternatives(&a_1.transpose(), &b_1.transpose(), &movable)?
                }
            };
            let gains = gains.map(|gain| part.complete(&gain.transpose()).transpose());
            Ok(assigned(&gains, &required, &part))
        }
        Requirement::Weights { states, channels } => {
            let filter = kalman(a_0, c_0, states, channels, domain)?;
            let gain = filter
                .current_gain
                .filter(|_| estimator == Estimator::Current)
                .unwrap_or(filter.gain);
            let noise = Noise {
                process: states.clone(),
                measurements: channels.clone(),
                covariance: filter.covariance,
                is_relative: false,
            };
            let result = weighted(gain, "Kalman filter", filter.residual);
            Ok(GainResult { noise: Some(Box::new(noise)), ..result })
        }
        Requirement::Bandwidth(bandwidth) => problem.by_bandwidth(bandwidth, domain),
        Requirement::Region(region) => {
            let part = controllable_part(&a_dual, &b_dual)?;
            require(*region, &part.fixed, domain)?;
            let (a_1, b_1) = part.pair(&a_dual, &b_dual);
            let (a_1, c_1) = (a_1.transpose(), b_1.transpose());
            let outcome = lmi::observer_gain(&a_1, &c_1, &region.stated(), None, domain)?;
            let complete = |gain: &DMatrix<f64>| part.complete(&gain.transpose()).transpose();
            Ok(synthesised(outcome, IN_REGION)?.mapped(complete))
        }
        Requirement::HInfinity { bound, region, channel } => {
            require(*region, &uncontrollable_modes(&a_dual, &b_dual)?, domain)?;
            problem.by_norm(NormRequirement { bound: *bound, region: *region, channel, domain })
        }
    }
}

/// Required eigenvalues in the plane of the domain.
struct Assignment {
    /// The eigenvalues of the movable part, then the eigenvalues of fixed modes.
    required: Vec<Complex<f64>>,
    /// The eigenvalues of the movable part.
    movable: Vec<Complex<f64>>,
}

/// Divides the required eigenvalues: the one nearest to each fixed mode is that of the mode, the others are assigned to
/// the movable part. Refuses a fixed mode without a required eigenvalue within [`SAME`].
fn movable(required: &Requirement, fixed: &[Mode], domain: Domain) -> Result<Assignment, Refusal> {
    let sampling = match (required, domain) {
        (Requirement::Eigenvalues(_), Domain::Sampled { period }) => Some(period),
        _ => None,
    };
    let mut rest = required.eigenvalues().to_vec();
    let mut fixed_eigenvalues = Vec::new();
    for mode in fixed {
        let stated = sampling.map_or(mode.eigenvalue, |period| mode.eigenvalue.ln() / period);
        let near = |one: &Complex<f64>| match sampling {
            // Only a p whose e^(p T) underflows to 0 has the mode 0.
            Some(period) if !stated.is_finite() => (one * period).exp().norm(),
            _ => (one - stated).norm(),
        };
        let nearest = (0..rest.len()).min_by(|&i, &j| near(&rest[i]).total_cmp(&near(&rest[j])));
        let scale = match required {
            Requirement::SampledEigenvalues(_) => stated.norm().max(1.0),
            _ => stated.norm(),
        };
        let largest = if stated.is_finite() { SAME * scale } else { 0.0 };
        match nearest.filter(|&at| near(&rest[at]) <= largest) {
            Some(at) => drop(rest.swap_remove(at)),
            None => return Err(Refusal::Fixed(mode.clone())),
        }
        fixed_eigenvalues.push(mode.eigenvalue);
    }
    let movable = match sampling {
        Some(period) => sampled_poles(&rest, period)?,
        None => rest,
    };
    Ok(Assignment { required: movable.iter().copied().chain(fixed_eigenvalues).collect(), movable })
}

/// Returns the results of an assignment, without the quality if there are fixed modes: it holds for the movable part
/// alone.
fn assigned(
    alternatives: &Alternatives,
    required: &[Complex<f64>],
    part: &ControllablePart,
) -> GainResult {
    let conditioned = "assigned, with eigenvectors as well-conditioned as was found";
    let is_whole = part.fixed.is_empty();
    let method = if is_whole {
        format!("Eigenvalues {conditioned}.")
    } else {
        let (movable, all) = (part.a.nrows(), part.coordinates.ncols());
        format!("{movable} of {all} eigenvalues {conditioned}; no gain moves the others.")
    };
    let result = |placement: &Placement| GainResult {
        required: required.to_vec(),
        quality: is_whole.then_some(placement.quality),
        ..unique(placement.gain.clone(), method.clone())
    };
    let candidates = alternatives.candidates().map(|gains| gains.into_iter().map(result).collect());
    let standard = alternatives.standard.each_ref();
    let standard = standard.map(|choice| choice.as_ref().map(|placement| placement.gain.clone()));
    GainResult {
        choice: Some(Box::new(GainChoice { candidates, standard })),
        ..result(&alternatives.chosen)
    }
}

fn weighted(gain: DMatrix<f64>, method: &str, residual: f64) -> GainResult {
    let method = format!("{method}; relative residual of the Riccati equation {residual:.1e}.");
    unique(gain, method)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// e^(p T) is 0 for p = -1e4 / s, as it underflows, but for none of the others.
    #[test]
    fn a_fixed_mode_at_zero_takes_only_a_requested_eigenvalue_that_is_zero_in_the_sampled_loop() {
        let a = DMatrix::from_row_slice(2, 2, &[0.5, 0.0, 0.0, 0.0]);
        let b = DMatrix::from_row_slice(2, 1, &[1.0, 0.0]);
        let mut fixed = uncontrollable_modes(&a, &b).unwrap();
        assert_eq!(fixed.len(), 1);
        fixed[0].eigenvalue = Complex::new(0.0, 0.0);
        let real = |values: [f64; 2]| values.map(|value| Complex::new(value, 0.0)).to_vec();
        let domain = Domain::Sampled { period: 0.1 };
        let required = Requirement::Eigenvalues(real([-1.0, -7.0]));
        assert!(matches!(movable(&required, &fixed, domain), Err(Refusal::Fixed(_))));
        let message = crate::solve::refusal::fixed(&required, &fixed[0], domain, |_| "x2".into());
        assert!(message.contains("expected `sampled_eigenvalues` with it"), "{message}");
        for (required, rest) in [
            (Requirement::SampledEigenvalues(real([0.9, 0.0])), 0.9),
            (Requirement::Eigenvalues(real([-1.0, -1e4])), (-0.1_f64).exp()),
        ] {
            let assignment = movable(&required, &fixed, domain).ok().unwrap();
            assert_eq!(assignment.movable, [Complex::new(rest, 0.0)]);
        }
    }

    /// A has the eigenvalue 0.3 with the eigenvector (1, 1, 1), which is B, and twice 0, which is computed with a
    /// rounding error.
    #[test]
    fn a_fixed_mode_at_zero_up_to_rounding_takes_a_requested_sampled_eigenvalue_of_zero() {
        let (a, b) = (DMatrix::from_element(3, 3, 0.1), DMatrix::from_element(3, 1, 1.0));
        let fixed = uncontrollable_modes(&a, &b).unwrap();
        assert_eq!(fixed.len(), 2);
        let real = |values: [f64; 3]| values.map(|value| Complex::new(value, 0.0)).to_vec();
        let movable = |values| {
            let required = Requirement::SampledEigenvalues(real(values));
            movable(&required, &fixed, Domain::Sampled { period: 0.1 }).ok()
        };
        assert_eq!(movable([0.0, 0.2, 0.0]).unwrap().movable, [Complex::new(0.2, 0.0)]);
        assert!(movable([0.0, 0.2, 0.01]).is_none());
    }
}
