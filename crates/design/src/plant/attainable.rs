//! What no controller of a plant can reach: the peak of S that unstable modes, zeros and samples force.

use control::eigen::eigenvalues;
use control::faults::FaultEntry;
use control::zeros::zeros;
use control::{Domain, StateSpace};
use files::PlaceError;
use nalgebra::{Complex, DMatrix};

use crate::Error;
use crate::plant::linear::LinearPlant;
use crate::report::number::rounded;
use plant_file::PlantFile;
use plant_file::loop_shape::{FLOOR, LoopShape};
use plant_file::requirements::Requirement;

/// Real part of a zero or pole, relative to its modulus, above which it counts as positive.
const RIGHT: f64 = 1e-9;
/// Peak of S above which a loop cannot be realised: its gains would be rounding errors.
const NO_LOOP: f64 = 1e6;
/// Largest |S| at frequencies up to the bandwidth, by the definition of the bandwidth.
const AT_BANDWIDTH: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Returns warnings of a peak of S above the limit of a green verdict that no controller avoids, and of a feedback that
/// is too fast for a zero in the right half plane.
///
/// ```text
/// continuous, one command and one measurement, for a zero z:  max |S| >= M = product over unstable p of |z + p*| / |z - p|
///     for a real z and |S| <= s = 1/sqrt(2) up to w:          max |S| >= M^t s^(1 - t),  t = pi / (pi - 2 atan(w / z))
///     with a delay d:                                         max |S| >= max |T| - 1 >= exp(d Re p) - 1
/// with the weight W of S by the shape of a loop:             gamma >= M |W(z)|
/// sampled every h, m commands:                                max |S| >= exp(h sum of Re p / m)
/// ```
///
/// Sources: J. S. Freudenberg, D. P. Looze, Right half plane poles and zeros and design tradeoffs in feedback systems,
/// IEEE Trans. Autom. Control 30 (1985), theorem 2; for samples the sum of log |S| over the unit circle: H.-K. Sung, S.
/// Hara, Int. J. Control 48 (1988).
///
/// # Errors
///
/// A sample time with which every controller has a peak of S above 1e6; eigenvalues or zeros that cannot be computed.
pub(crate) fn warnings(
    file: &PlantFile<'_>,
    linear: &LinearPlant,
) -> Result<Vec<PlaceError>, Error> {
    let poles = rates(&linear.undelayed.a, linear.domain)?;
    let poles: Vec<_> = poles.into_iter().filter(|&value| is_right(value)).collect();
    let limit = file.robustness.amber;
    let mut warnings = Vec::new();
    if let Some(sampling) = file.sampling {
        let sum: f64 = poles.iter().map(|pole| pole.re).sum();
        #[expect(clippy::cast_precision_loss, reason = "a number of commands")]
        let rate = sum / linear.b.ncols() as f64;
        let least = (rate * sampling.period).exp();
        if least > limit {
            let message = format!(
                "no controller has a peak of S below {}: the unstable eigenvalues of the plant grow too much in a sample; \
                 expected at most {} s",
                rounded(least),
                // Within the limit after rounding to five digits.
                rounded(0.9999 * limit.ln() / rate)
            );
            let warning = file.error(&["sample_time"], message);
            if least > NO_LOOP {
                return Err(warning.into());
            }
            warnings.push(warning);
        }
    }
    let StateSpace { a, b, c, d, .. } = &linear.undelayed;
    if b.ncols() == 1 && c.nrows() == 1 {
        let delay = linear.delays.longest();
        let grown = poles.iter().map(|pole| (pole.re * delay).exp()).fold(0.0, f64::max);
        if grown - 1.0 > limit {
            let message = format!(
                "no controller has a peak of S below {}: in the delay of {} s the unstable eigenvalues of the plant \
                 grow to {} times; expected a shorter delay",
                rounded(grown - 1.0),
                rounded(delay),
                rounded(grown)
            );
            warnings.push(file.error(&["actuators", "measurements"], message));
        }
    }
    if b.ncols() == 1 && c.nrows() == 1 && d.amax() <= 0.0 && linear.domain == Domain::Continuous {
        let finite = zeros(a, b, c)?.finite;
        let of_zeros = finite.into_iter().filter(|&zero| is_right(zero) && zero.im >= 0.0);
        // Above the limit the zero that forces the largest peak; otherwise the one that allows the slowest feedback.
        let rank = |zero: &Complex<f64>| match forced(*zero, &poles) {
            least if least > limit => -least,
            least => allowed(*zero, least, limit),
        };
        if let Some(zero) = of_zeros.min_by(|x, y| rank(x).total_cmp(&rank(y))) {
            let mut models = linear.models.iter();
            let integrates = models.any(|model| !matches!(model.entry, FaultEntry::Sensor(_)));
            // Without an estimate that acts as an integral, the bandwidth limits no S.
            let shape = file.loop_shape.as_ref().filter(|_| integrates);
            warnings.extend(of_zero(file, shape, zero, &poles, limit));
        }
    }
    Ok(warnings)
}

/// Returns the eigenvalues of A in 1/s; for a plant in sampled time ln z / T.
pub(crate) fn rates(a: &DMatrix<f64>, domain: Domain) -> Result<Vec<Complex<f64>>, control::Error> {
    let values = eigenvalues(a)?.into_iter();
    Ok(match domain {
        Domain::Continuous => values.collect(),
        Domain::Sampled { period } => values.map(|value| value.ln() / period).collect(),
    })
}

/// Returns the warning of a zero in the right half plane, for the plant, for the shape of the loop or for the requested
/// feedback; None if they allow a peak of S within the limit.
fn of_zero(
    file: &PlantFile<'_>,
    shape: Option<&LoopShape>,
    zero: Complex<f64>,
    poles: &[Complex<f64>],
    limit: f64,
) -> Option<PlaceError> {
    let least = forced(zero, poles);
    let name = if zero.im == 0.0 {
        format!("its zero at {} 1/s", rounded(zero.re))
    } else {
        format!("its zeros at {} \u{b1} {}i 1/s", rounded(zero.re), rounded(zero.im))
    };
    if least > limit {
        let message = format!(
            "no controller has a peak of S below {}: {name} is too near to its unstable eigenvalues; expected another \
             measurement or actuator",
            rounded(least)
        );
        return Some(file.error(&["C", "measurements"], message));
    }
    if let Some(shape) = shape.filter(|_| zero.im == 0.0) {
        return Some(file.error_at(&shape.place, of_shape(shape, zero.re, least, &name)?));
    }
    let speed = requested(file)?;
    let reached = least_peak(zero, least, speed);
    if zero.im != 0.0 || reached <= limit {
        return None;
    }
    let message = format!(
        "a feedback of {} rad/s is too fast for the plant: {name} makes the peak of S {} or more if |S| is at most 0.71 up \
         to this speed; below {} rad/s it can stay below {limit}",
        rounded(speed),
        rounded(reached),
        rounded(allowed(zero, least, limit))
    );
    Some(file.error_at(&file.feedback.place, message))
}

/// Returns the sentence that a real zero, called `name`, allows no gamma up to 1 with the weight
/// W = (s / peak + w) / (s + [`FLOOR`] w), w = `bandwidth`; None if it does. `least`: the result of [`forced`].
fn of_shape(shape: &LoopShape, zero: f64, least: f64, name: &str) -> Option<String> {
    let LoopShape { bandwidth, peak, .. } = *shape;
    let gamma = least * (zero / peak + bandwidth) / (zero + FLOOR * bandwidth);
    // Within the limit after rounding to five digits.
    let allowed = 0.9999 * zero * (1.0 - least / peak) / (least - FLOOR);
    let allowed = if allowed > 0.0 {
        format!("a `bandwidth` of at most {} rad/s", rounded(allowed))
    } else {
        format!("a `peak` above {} only", rounded(least))
    };
    (gamma > 1.0).then(|| {
        format!("no controller has a gamma below {}: {name} allows {allowed}", rounded(gamma))
    })
}

/// Returns the peak of S that a zero forces beside unstable `poles`; 1 without unstable poles.
fn forced(zero: Complex<f64>, poles: &[Complex<f64>]) -> f64 {
    poles.iter().map(|pole| (zero + pole.conj()).norm() / (zero - pole).norm()).product()
}

/// Returns the peak of S that a real zero forces if |S| is at most [`AT_BANDWIDTH`] up to `speed`; `least`: the result
/// of [`forced`].
fn least_peak(zero: Complex<f64>, least: f64, speed: f64) -> f64 {
    let pi = std::f64::consts::PI;
    let t = pi / (pi - 2.0 * (speed / zero.re).atan());
    least.powf(t) * AT_BANDWIDTH.powf(1.0 - t)
}

/// Returns the speed up to which a zero allows a peak of S of `limit`, rad/s; infinite for a zero that is not real.
/// `least`: the result of [`forced`], at most `limit`.
fn allowed(zero: Complex<f64>, least: f64, limit: f64) -> f64 {
    if zero.im != 0.0 {
        return f64::INFINITY;
    }
    // The exponent t for which the bound is the limit, and the speed that gives this t.
    let t = (limit / AT_BANDWIDTH).ln() / (least / AT_BANDWIDTH).ln();
    zero.re * (std::f64::consts::PI * (1.0 - 1.0 / t) / 2.0).tan()
}

/// Returns the modulus of the slowest eigenvalue that the file states for the feedback, rad/s; None for other requirements
/// and if all eigenvalues of a sampled loop are 0, with an infinite rate. The loop gain of a regulator crosses one at its
/// bandwidth, but |S| of the loop with the observer may be near one below it.
fn requested(file: &PlantFile<'_>) -> Option<f64> {
    let slowest = |sizes: &mut dyn Iterator<Item = f64>| sizes.min_by(f64::total_cmp);
    match &file.feedback.requirement {
        Requirement::Eigenvalues(all) => slowest(&mut all.iter().map(|value| value.norm())),
        Requirement::SampledEigenvalues(all) => {
            let period = file.sampling?.period;
            let speed = slowest(&mut all.iter().map(|value| value.ln().norm() / period));
            speed.filter(|speed| speed.is_finite())
        }
        _ => None,
    }
}

fn is_right(value: Complex<f64>) -> bool {
    value.re > RIGHT * value.norm()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::read;

    /// With a rate of 1 1/s the peak is at most 2 up to ln 2 = 0.693147 s, which rounds up to 0.69315 s.
    #[test]
    fn the_advised_sample_time_is_within_the_limit() {
        let warned = |period: &str| {
            let text = format!(
                "A = [[1]]\nB = [[1]]\nC = [[1]]\nsample_time = {period}\nactuator_faults = \"all\"\n\
                 feedback.sampled_eigenvalues = [0.5]\n"
            );
            let all = |file: &PlantFile<'_>| warnings(file, &LinearPlant::of(file).unwrap());
            let all = read(&text, all).unwrap().unwrap();
            all.first().map(|warning| warning.message().to_owned())
        };
        let advice = warned("1").unwrap();
        let (_, time) = advice.rsplit_once("expected at most ").unwrap();
        assert_eq!(warned(time.strip_suffix(" s").unwrap()), None, "{advice}");
        assert!(warned("0.6932").is_some());
    }

    /// The plant (1 - s) / (1 + s)^2. A modulus of 0.5 in 0.1 s is 6.9 rad/s, which the zero at 1 1/s does not allow.
    #[test]
    fn a_feedback_that_is_at_rest_after_the_last_sample_has_no_speed() {
        let count = |eigenvalues: &str| {
            let text = "A = [[0, 1], [-1, -2]]\nB = [[0], [1]]\nC = [[1, -1]]\nsample_time = 0.1\n\
                        actuator_faults = \"all\"\nfeedback.sampled_eigenvalues = ";
            let all = |file: &PlantFile<'_>| warnings(file, &LinearPlant::of(file).unwrap());
            read(&format!("{text}{eigenvalues}\n"), all).unwrap().unwrap().len()
        };
        assert_eq!([count("[0.5, 0.5]"), count("[0, 0]")], [1, 0]);
    }

    /// The plant (2 - s) / (s + 1)^2: (2 / 1.5 + 6) / (2 + 0.06) = 3.5599; 2 (1 - 1 / 1.5) / 0.99 = 0.6734.
    #[test]
    fn a_zero_limits_the_shape_of_a_loop() {
        let warned = |rows: &str| {
            let text = "A = [[0, 1], [-1, -2]]\nB = [[0], [1]]\nC = [[2, -1]]\nactuator_faults = \"all\"\n\
                        [loop]\nbandwidth = ";
            let all = |file: &PlantFile<'_>| warnings(file, &LinearPlant::of(file).unwrap());
            let all = read(&format!("{text}{rows}\n"), all).unwrap().unwrap();
            all.first().map(|warning| warning.message().to_owned())
        };
        let expected = "no controller has a gamma below 3.5599: its zero at 2 1/s allows a `bandwidth` of at most \
                        0.67333 rad/s";
        assert_eq!(warned("6").as_deref(), Some(expected));
        assert_eq!(warned("0.673"), None);
        let expected = "no controller has a gamma below 1.2469: its zero at 2 1/s allows a `peak` above 1 only";
        assert_eq!(warned("0.5\npeak = 1").as_deref(), Some(expected));
    }

    /// The plant (1 - s) (1 - s / 100) / (1 + s)^3: the zero at 100 1/s allows 10 rad/s, the zero at 1 1/s does not.
    #[test]
    fn the_zero_that_allows_the_slowest_feedback_is_stated() {
        let text = "A = [[0, 1, 0], [0, 0, 1], [-1, -3, -3]]\nB = [[0], [0], [1]]\nC = [[1, -1.01, 0.01]]\n\
                    actuator_faults = \"all\"\nfeedback.eigenvalues = [-10, -11, -12]\n";
        let all = |file: &PlantFile<'_>| warnings(file, &LinearPlant::of(file).unwrap());
        let stated = read(text, all).unwrap().unwrap();
        let stated: Vec<_> = stated.iter().map(ToString::to_string).collect();
        assert!(stated.len() == 1 && stated[0].contains("its zero at 1 1/s"), "{stated:?}");
    }
}
