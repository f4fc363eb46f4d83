//! Writes `filter.toml` of the Kalman filter that contains the plant's FMU.

use aso_controller::kalman::{CarriedFault, Entry, KalmanDesign};
use control::Domain;
use control::eigen::eigenvalues;
use files::PlaceError;
use linearise::PlantEquations;
use nalgebra::DMatrix;

use crate::design_file::as_stated;
use crate::matrix::matrix;
use crate::plant::linear::{LinearPlant, request};
use crate::report::number::rounded;
use crate::solve::designed::Designed;
use crate::solve::gain::Noise;
use crate::solve::solution::Solution;
use plant_file::PlantFile;
use plant_file::faults::EntryPoint;
use plant_file::signals::Signal as PlantSignal;
use plant_file::signals::joined;

/// Largest modulus of an eigenvalue of A times the integration step: Runge-Kutta's method of order 4 has then an error
/// of some 1e-6 a step.
const RESOLUTION: f64 = 0.2;
/// Largest number of integration steps of the filter in one sample.
const MOST_STEPS: f64 = 1e4;
/// Ratio of the assumed and the stated noise of a measurement above which it is a warning.
const NOTICEABLE: f64 = 2.0;

/// The Kalman filter of a design.
pub(crate) struct KalmanFilter {
    pub(crate) design: KalmanDesign,
    /// Why the filter assumes another noise than the file states, if it does.
    pub(crate) warning: Option<PlaceError>,
}

/// Returns the Kalman filter for the plant of `file`, for the noise of the designed observer; `stop_time`: of its
/// default experiment, in s.
///
/// # Errors
///
/// The file asks for something that this filter does not have, or the plant's FMU cannot be part of a filter; the
/// message has the line, and what helps.
pub(crate) fn kalman_design(
    file: &PlantFile<'_>,
    designed: &Designed,
    stop_time: f64,
) -> Result<KalmanFilter, PlaceError> {
    let Solution { linear, extended, domain, observer, .. } = &designed.nominal;
    let refuse = |keys: &[&'static str], text: &str| {
        Err(file.error(keys, format!("no Kalman filter with the plant's FMU: {text}")))
    };
    let plant_file::Model::Fmu(fmu) = &file.model else {
        return refuse(&["A"], "the plant is a matrix; `plant = \"NAME.fmu\"` states an FMU");
    };
    let &Domain::Sampled { period } = domain else {
        return refuse(&["plant"], "it needs a `sample_time`");
    };
    if designed.schedule.is_some() {
        return refuse(&["schedule"], "it has no schedule, which its plant does not need");
    }
    if linear.delays.any() || !linear.filter_states(file).is_empty() {
        return refuse(
            &["loop", "plant"],
            "it has no `delay` and no `structure`; a plant file without them designs the filter",
        );
    }
    let Some(noise) = &observer.noise else {
        return refuse(
            &["observer", "loop"],
            "the gain of the observer follows from no noise; `observer.bandwidth`, or `observer.W` and `observer.V`, does",
        );
    };
    let equations = fmu_import::Fmu::open_quietly(&fmu.path)
        .map_err(linearise::LineariseError::from)
        .and_then(|opened| PlantEquations::new(&opened, &request(file, fmu)));
    if let Err(error) = equations {
        return refuse(&["plant"], &error.to_string());
    }
    let Some(scale) = scale(file, noise) else {
        return refuse(
            &["observer", "plant"],
            "`observer.bandwidth` gives covariances up to a common factor; expected `robustness.noise`, the standard \
             deviation of each measurement, above 0",
        );
    };
    let n = linear.states.len();
    let (of_observer, q) = (extended.plant.a.nrows(), extended.plant.f_a.ncols());
    // Without the states of the measurement filter.
    let positions: Vec<usize> = (0..n).chain(of_observer..of_observer + q).collect();
    // The faults have the opposite sign in the error dynamics of the observer.
    let sign = |at: usize| if at < n { 1.0 } else { -1.0 };
    let part = |m: &DMatrix<f64>| {
        let block = m.select_rows(&positions).select_columns(&positions);
        matrix(&DMatrix::from_fn(n + q, n + q, |i, j| block[(i, j)] * (scale * sign(i) * sign(j))))
    };
    let faults = file.faults.iter().zip(&linear.faults).zip(&extended.channels);
    let faults = faults.map(|((stated, fault), channel)| CarriedFault {
        name: fault.name.clone(),
        unit: fault.unit.clone(),
        description: fault.description.clone(),
        enters: match &stated.entry_point {
            EntryPoint::Actuator(at)
            | EntryPoint::Loss { actuator: at, .. }
            | EntryPoint::Column(at) => Entry::Actuator(*at),
            EntryPoint::Sensor(at) => Entry::Sensor(*at),
            EntryPoint::Input(name) => Entry::Input(name.clone()),
        },
        rate: channel.rate,
    });
    let signals = |signals: &[PlantSignal]| signals.iter().map(as_stated).collect::<Vec<_>>();
    let states = signals(&linear.states);
    let is_state = |name: &String| states.iter().any(|state| state.name == *name);
    let settings = fmu.operating_point.iter().filter(|(name, _)| !is_state(name));
    let fastest =
        eigenvalues(&linear.a).map_or(0.0, |all| all.iter().map(|p| p.norm()).fold(0.0, f64::max));
    let steps = (period * fastest / RESOLUTION).ceil();
    #[expect(clippy::cast_possible_truncation, reason = "from 1 to MOST_STEPS")]
    let integration_steps = steps.clamp(1.0, MOST_STEPS) as i32;
    let covariance = &noise.measurements * scale;
    let design = KalmanDesign {
        description: description(linear, &covariance),
        sample_time: period,
        integration_steps,
        stop_time,
        w: part(&noise.process),
        v: matrix(&covariance),
        p: part(&noise.covariance),
        settings: settings.cloned().collect(),
        commands: signals(&linear.actuators),
        measurements: signals(&linear.measurements),
        faults: faults.collect(),
        states,
    };
    let warning = noise_warning(file, &linear.measurements, noise, &covariance);
    Ok(KalmanFilter { design, warning })
}

/// Returns the warning of measurements whose assumed standard deviation and stated noise differ by more than a factor
/// of [`NOTICEABLE`]; None if there are none, or if the file states the covariances.
fn noise_warning(
    file: &PlantFile<'_>,
    measurements: &[PlantSignal],
    noise: &Noise,
    covariance: &DMatrix<f64>,
) -> Option<PlaceError> {
    let variances = covariance.diagonal();
    let pairs = variances.iter().map(|variance| variance.sqrt()).zip(&file.robustness.noise);
    let differs = |assumed: f64, stated: f64| {
        let ratio = assumed / stated;
        noise.is_relative && ratio.max(1.0 / ratio) > NOTICEABLE
    };
    let differing = measurements.iter().zip(pairs).filter_map(|(signal, (assumed, &stated))| {
        let text = || format!("{} in place of {}", deviation(signal, assumed), rounded(stated));
        differs(assumed, stated).then(text)
    });
    let differing: Vec<_> = differing.collect();
    let message = || {
        format!(
            "the Kalman filter assumes other standard deviations than `robustness.noise`, {}, because a bandwidth sets their \
             ratios: its `x_deviation`, `f_deviation` and `innovation_squared` are for these; `observer.W` and \
             `observer.V` state the noise of each sensor",
            differing.join(", ")
        )
    };
    (!differing.is_empty()).then(|| file.error(&["observer"], message()))
}

/// Returns the description of the filter of the plant `linear`, with the noise of the measurements that it assumes.
fn description(linear: &LinearPlant, covariance: &DMatrix<f64>) -> String {
    let faults = joined(linear.faults.iter().map(|fault| fault.name.as_str()));
    let variances = covariance.diagonal();
    let deviations = linear.measurements.iter().zip(&variances);
    let deviations: Vec<_> =
        deviations.map(|(signal, variance)| deviation(signal, variance.sqrt())).collect();
    format!(
        "Kalman filter that estimates the states of its plant and {faults}; assumed standard deviations: {}",
        deviations.join(", ")
    )
}

/// Returns name, standard deviation and unit of a measurement.
fn deviation(signal: &PlantSignal, deviation: f64) -> String {
    let unit = signal.unit.as_deref().map(|unit| format!(" {unit}")).unwrap_or_default();
    format!("{} {}{unit}", signal.name, rounded(deviation))
}

/// Returns the factor of the covariances with which the variances of the measurements agree with the variances in the
/// file, in the geometric mean; None if the file states no variances, or one is 0.
fn scale(file: &PlantFile<'_>, noise: &Noise) -> Option<f64> {
    if !noise.is_relative {
        return Some(1.0);
    }
    let limits = &file.robustness;
    let variances = noise.measurements.diagonal();
    let logarithms = limits.noise.iter().zip(&variances).map(|(noise, v)| (noise * noise / v).ln());
    #[expect(clippy::cast_precision_loss, reason = "a number of measurements")]
    let count = variances.len() as f64;
    let factor = limits.noise_is_stated.then(|| (logarithms.sum::<f64>() / count).exp());
    factor.filter(|factor| *factor > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::read;
    use nalgebra::DVector;

    /// The factor for a measurement with this noise, of the relative variance 4.
    fn factor(stated: &str) -> Option<f64> {
        let text =
            "A = [[-1]]\nB = [[1]]\nC = [[1]]\nactuator_faults = \"all\"\nrobustness.noise = ";
        let [one, four] = [1.0, 4.0].map(|value| DMatrix::from_element(1, 1, value));
        let noise =
            Noise { process: one.clone(), measurements: four, covariance: one, is_relative: true };
        read(&format!("{text}{stated}\n"), |file| scale(file, &noise)).unwrap()
    }

    #[test]
    fn an_assumed_noise_of_more_than_twice_the_stated_one_is_a_warning() {
        let text = "A = [[-1]]\nB = [[1]]\nC = [[1], [1]]\nactuator_faults = \"all\"\nobserver.bandwidth = 1\n\
                    robustness.noise = [2, 2]\n";
        let measurements = ["y1", "y2"].map(|name| PlantSignal::named(name.to_owned()));
        let warning = |variances: [f64; 2], is_relative| {
            let one = DMatrix::from_element(1, 1, 1.0);
            let covariance = DMatrix::from_diagonal(&DVector::from_row_slice(&variances));
            let (process, measured) = (one.clone(), covariance.clone());
            let noise = Noise { process, measurements: measured, covariance: one, is_relative };
            let warning = read(text, |file| {
                noise_warning(file, &measurements, &noise, &covariance)
                    .map(|warning| warning.to_string())
            });
            warning.unwrap().unwrap_or_default()
        };
        assert!(warning([4.0, 0.25], true).contains("`robustness.noise`, y2 0.5 in place of 2,"));
        assert!(warning([25.0, 4.0], true).contains("`robustness.noise`, y1 5 in place of 2,"));
        assert_eq!(warning([9.0, 2.0], true), "");
        assert_eq!(warning([25.0, 0.25], false), "");
    }

    #[test]
    fn covariances_are_those_of_a_noise_above_zero() {
        assert!((factor("6").unwrap() - 36.0 / 4.0).abs() < 1e-12);
        assert_eq!(factor("0"), None);
    }
}
