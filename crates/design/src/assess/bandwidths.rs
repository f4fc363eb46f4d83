//! Chooses the bandwidths that a plant file leaves open.

use files::PlaceError;
use nalgebra::{Complex, DMatrix};
use rayon::prelude::*;

use crate::Error;
use crate::assess::judged::Judged;
use crate::budget::Budget;
use crate::plant::attainable;
use crate::plant::linear::LinearPlant;
use crate::solve::designed::design;
use plant_file::requirements::{Bandwidth, Request, Requirement};
use plant_file::{PlantFile, Sampling};

/// Pairs to try, in this order: bandwidth of the feedback relative to the speed of the plant, bandwidth of the observer
/// relative to that of the feedback.
const CANDIDATES: [(f64, f64); 18] = [
    (1.0, 4.0),
    (0.5, 4.0),
    (0.25, 4.0),
    (1.0, 8.0),
    (2.0, 8.0),
    (2.0, 4.0),
    (0.5, 8.0),
    (4.0, 8.0),
    (0.25, 8.0),
    (4.0, 4.0),
    (0.1, 4.0),
    (1.0, 16.0),
    (2.0, 16.0),
    (4.0, 16.0),
    (8.0, 8.0),
    (0.1, 1.0),
    (0.05, 4.0),
    (0.02, 4.0),
];
/// Number of states from which only the first [`OF_LARGE`] candidates are examined, without the tolerances.
const LARGE: usize = 24;
/// Number of candidates for a plant with at least [`LARGE`] states.
const OF_LARGE: usize = 3;
/// Number of candidates that are examined in parallel; fixed, so that the result is the same on every machine.
const TOGETHER: usize = 3;
/// Eigenvalues smaller than this part of the largest one do not count for the speed of the plant.
const NO_SPEED: f64 = 1e-9;
/// Relative change of the entries of A that tests an eigenvalue for the speed of the plant. An eigenvalue whose modulus
/// changes by half or more is a rounding error of 0, as of integrators in other coordinates, and does not count.
const LAST_DIGITS: f64 = 1e-9;
/// Largest bandwidth of the feedback in rad per sample.
const PER_SAMPLE: f64 = 0.2;
/// Largest bandwidth of the observer in rad per sample.
const OBSERVER_PER_SAMPLE: f64 = 1.5;
/// The bandwidth for a plant without a speed of its own, rad/s.
const WITHOUT_SPEED: f64 = 1.0;

/// Returns `file` with the bandwidths that it leaves open: those of the first candidate with a green verdict, otherwise
/// those of the best stable one, see [`Judged::is_better`]. If the peaks of S of all candidates are red, or they have no
/// gains, candidates relative to the slowest eigenvalue follow, if that is slower than all of them: a measurement far
/// from the command, as in diffusion, does not see the speed of most eigenvalues.
///
/// Candidates that are left when the time of `budget` is over are not tried.
///
/// # Errors
///
/// The gains of the first candidates cannot be computed, or no candidate has a stable loop: the error also says what no
/// controller of the plant can reach. The plant cannot be read.
pub(crate) fn chosen<'a>(file: &PlantFile<'a>, budget: &Budget) -> Result<PlantFile<'a>, Error> {
    if !file.feedback.is_open() && !file.observer.is_open() {
        return Ok(file.clone());
    }
    let plant = LinearPlant::of(file)?;
    let [speed, slowest] = speeds(file, &plant)?;
    let large = plant.a.nrows() >= LARGE;
    let candidates = &CANDIDATES[..if large { OF_LARGE } else { CANDIDATES.len() }];
    let least = candidates.iter().map(|candidate| candidate.0).fold(f64::INFINITY, f64::min);
    let slower = (slowest < least * speed).then_some(slowest);
    let mut best: Option<(PlantFile<'a>, Judged)> = None;
    let mut refusal: Option<Error> = None;
    for speed in std::iter::once(speed).chain(slower) {
        let examine = |&(of_feedback, of_observer): &(f64, f64)| {
            let feedback = of_feedback * speed;
            let other = with(file, feedback, of_observer * feedback);
            let judged = judged(&other, !large);
            (other, judged)
        };
        for candidates in candidates.chunks(TOGETHER) {
            let examined: Vec<_> = candidates.par_iter().map(examine).collect();
            for (other, judged) in examined {
                match judged {
                    Ok(Some(judged)) if judged.is_green(&file.robustness) => return Ok(other),
                    Ok(Some(judged)) => {
                        let better = |(_, earlier): &(_, Judged)| {
                            judged.is_better(earlier, &file.robustness)
                        };
                        if best.as_ref().is_none_or(better) {
                            best = Some((other, judged));
                        }
                    }
                    Ok(None) => {}
                    Err(error) => refusal = refusal.or(Some(error)),
                }
            }
            // If the first candidates are refused, the reason is the plant, not these bandwidths.
            if budget.is_over() || (best.is_none() && refusal.is_some()) {
                break;
            }
        }
        let is_low = |(_, judged): &(_, Judged)| {
            judged.peak_of_choice(&file.robustness) <= file.robustness.red
        };
        if budget.is_over() || best.as_ref().is_some_and(is_low) {
            break;
        }
    }
    match (best, refusal) {
        (Some((other, _)), _) => Ok(other),
        (None, Some(error)) => {
            let limit = attainable::warnings(file, &plant)?.into_iter().next();
            Err(match (error, limit) {
                (Error::Entry(error), Some(limit)) if is_at_request(file, &error) => {
                    limit.after(error.message()).into()
                }
                (error, _) => error,
            })
        }
        (None, None) => {
            let cause = "no bandwidth was found whose loop is stable";
            let help = "expected a requirement, `feedback.eigenvalues` and `observer.eigenvalues` for \
                        example";
            let error = attainable::warnings(file, &plant)?.into_iter().next().map_or_else(
                || file.error(&["feedback", "observer"], format!("{cause}; {help}")),
                |limit| limit.after(cause),
            );
            Err(error.into())
        }
    }
}

/// Examines the loop of a file, with its tolerances if `varies` and its peak is within the limit; None if it is not
/// stable.
fn judged(file: &PlantFile<'_>, varies: bool) -> Result<Option<Judged>, Error> {
    let nominal = design(file)?.nominal;
    let judged = Judged::of(&nominal, None)?;
    let limits = &file.robustness;
    let is_low = |judged: &Judged| judged.peak_of_choice(limits) <= limits.amber;
    let varies = varies && judged.as_ref().is_some_and(is_low);
    if varies { Judged::of(&nominal, Some(&file.robustness)) } else { Ok(judged) }
}

/// Returns `file` with these bandwidths in rad/s where `file` states none, at most [`OBSERVER_PER_SAMPLE`] per sample.
fn with<'a>(file: &PlantFile<'a>, feedback: f64, observer: f64) -> PlantFile<'a> {
    let most =
        file.sampling.map_or(f64::INFINITY, |sampling| OBSERVER_PER_SAMPLE / sampling.period);
    let set = |request: &mut Request, rate: f64| {
        if request.is_open() {
            // Two digits, as a user would write.
            let rate = format!("{:.1e}", rate.min(most)).parse().ok();
            request.requirement = Requirement::Bandwidth(Bandwidth { rate, is_stated: false });
        }
    };
    let mut other = file.clone();
    set(&mut other.feedback, feedback);
    set(&mut other.observer, observer);
    other
}

/// Returns the speeds of the plant in rad/s, to which the bandwidths are relative: a stated bandwidth of the feedback,
/// else the median and the least of the moduli of the eigenvalues that are stated for the feedback, else of those of the
/// plant.
///
/// Eigenvalues that are 0 up to rounding errors do not count; if no other ones exist, both speeds are [`WITHOUT_SPEED`].
/// Each is at least twice the largest real part of an eigenvalue, and at most what sample time and delays permit.
fn speeds(file: &PlantFile<'_>, plant: &LinearPlant) -> Result<[f64; 2], Error> {
    let stated: Vec<Complex<f64>> = match (&file.feedback.requirement, file.sampling) {
        (Requirement::Eigenvalues(all), _) => all.clone(),
        (Requirement::SampledEigenvalues(all), Some(Sampling { period, .. })) => {
            all.iter().map(|value| value.ln() / period).collect()
        }
        (Requirement::Bandwidth(Bandwidth { rate: Some(rate), .. }), _) => return Ok([*rate; 2]),
        _ => Vec::new(),
    };
    let a = &plant.undelayed.a;
    let (all, changed) = if stated.is_empty() {
        let of = |a: &DMatrix<f64>| attainable::rates(a, plant.domain);
        (of(a)?, of(&with_other_digits(a))?)
    } else {
        (stated.clone(), stated)
    };
    let (sizes, changed) = (moduli(&all), moduli(&changed));
    let largest = sizes.last().copied().unwrap_or_default();
    let speeds = sizes.into_iter().zip(changed);
    let speeds = speeds.filter(|&(size, changed)| {
        size > NO_SPEED * largest && (changed - size).abs() < 0.5 * size
    });
    let sizes: Vec<_> = speeds.map(|(size, _)| size).collect();
    let of = |at: usize| sizes.get(at).copied().unwrap_or(WITHOUT_SPEED);
    let unstable = all.iter().map(|value| value.re).fold(0.0, f64::max);
    let of_samples = file.sampling.map_or(f64::INFINITY, |sampling| PER_SAMPLE / sampling.period);
    // A loop with a delay is hardly faster than 1 rad in the time of the delay.
    let most = of_samples.min(1.0 / plant.delays.longest());
    Ok([of(sizes.len() / 2), of(0)].map(|speed| speed.max(2.0 * unstable).min(most)))
}

/// Whether `error` is at the place of a requirement that the file leaves open.
fn is_at_request(file: &PlantFile<'_>, error: &PlaceError) -> bool {
    let place = |error: &PlaceError| (error.line(), error.column());
    let requests = [&file.feedback, &file.observer].into_iter().filter(|request| request.is_open());
    let mut errors = requests.map(|request| file.error_at(&request.place, ""));
    errors.any(|other| place(&other) == place(error))
}

/// Returns A with each entry changed by [`LAST_DIGITS`], up or down in a fixed pattern.
fn with_other_digits(a: &DMatrix<f64>) -> DMatrix<f64> {
    a.map_with_location(|row, column, entry| {
        let sign = if (row * row + 3 * column + row * column) % 4 < 2 { 1.0 } else { -1.0 };
        entry * (1.0 + sign * LAST_DIGITS)
    })
}

/// Returns the finite moduli in ascending order. The rate of a sampled eigenvalue of 0 is infinite and left out.
fn moduli(eigenvalues: &[Complex<f64>]) -> Vec<f64> {
    let sizes = eigenvalues.iter().map(|value| value.norm());
    let mut sizes: Vec<_> = sizes.filter(|size| size.is_finite()).collect();
    sizes.sort_by(f64::total_cmp);
    sizes
}
