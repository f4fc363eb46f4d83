//! The sampled controller as its design file states it.

use nalgebra::DMatrix;
use serde::Deserialize;

use super::Precision;
use super::detection::{Detection, DetectionFile};
use super::reconfiguration::{CaseFile, CombinationFile, FallbackFile, Plant, Reconfiguration};
use super::schedule::{Schedule, ScheduleFile};
use super::symbols::Matrix;
use crate::Error;

/// The controller of a sampled design: matrices, signals, switches. Shapes as in the design file.
pub(super) struct Controller {
    pub(super) description: String,
    /// T in s.
    pub(super) sample_time: f64,
    pub(super) estimator: Estimator,
    /// Start of the compensation in s, and the first sample at or after it.
    pub(super) t_on: f64,
    pub(super) first_compensated: u32,
    /// Whether the fault is estimated while it is not compensated.
    pub(super) monitor: bool,
    /// The diagonal of W.
    pub(super) filter: Option<Vec<f64>>,
    pub(super) a: DMatrix<f64>,
    pub(super) b: DMatrix<f64>,
    pub(super) c: DMatrix<f64>,
    /// The part of the commands in the measurements, if they contain them.
    pub(super) d: Option<DMatrix<f64>>,
    pub(super) f_a: DMatrix<f64>,
    /// The identity where faults are constant.
    pub(super) a_f: DMatrix<f64>,
    pub(super) constant_faults: bool,
    pub(super) k_x: DMatrix<f64>,
    pub(super) k_f: DMatrix<f64>,
    pub(super) l_x: DMatrix<f64>,
    pub(super) l_f: DMatrix<f64>,
    /// The direct term of the estimated faults, where the law has one.
    pub(super) p_f: Option<DMatrix<f64>>,
    pub(super) sliding_mode: Option<SlidingMode>,
    /// H, `K_i`, `F_i`, `L_w`, `N_r` of the references, where the design states them.
    pub(super) h: Option<DMatrix<f64>>,
    pub(super) k_i: Option<DMatrix<f64>>,
    pub(super) f_i: Option<DMatrix<f64>>,
    pub(super) l_w: Option<DMatrix<f64>>,
    pub(super) n_r: Option<DMatrix<f64>>,
    pub(super) states: Vec<Signal>,
    pub(super) actuators: Vec<Signal>,
    pub(super) measurements: Vec<Signal>,
    pub(super) faults: Vec<Signal>,
    pub(super) references: Vec<Signal>,
    pub(super) losses: Vec<Loss>,
    /// Matrices and operating points that follow a variable, in place of those above.
    pub(super) schedule: Option<Schedule>,
    pub(super) detection: Option<Detection>,
    pub(super) reconfiguration: Option<Reconfiguration>,
}

/// The measurements that the command is computed from.
#[derive(Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Estimator {
    Current,
    Prediction,
}

/// The bounds of a sliding-mode law, f_hat = rho s / (|s| + delta) with s = `L_f` e; a number for each fault.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SlidingMode {
    pub(super) rho: Vec<f64>,
    pub(super) delta: Vec<f64>,
}

/// A state, an actuator, a measurement or a fault.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Signal {
    pub(super) name: String,
    #[serde(default)]
    pub(super) unit: Option<String>,
    #[serde(default)]
    pub(super) description: String,
    /// The value at the operating point.
    #[serde(default)]
    pub(super) operating: f64,
    #[serde(default)]
    pub(super) limits: Option<[f64; 2]>,
    #[serde(default)]
    loss_of: Option<String>,
    #[serde(default)]
    least_command: Option<f64>,
}

impl Signal {
    pub(super) fn new(
        name: String,
        unit: Option<String>,
        description: String,
        operating: f64,
    ) -> Self {
        let (limits, loss_of, least_command) = (None, None, None);
        Self { name, unit, description, operating, limits, loss_of, least_command }
    }
}

/// A fault that is a loss of effectiveness, with its position and that of its actuator.
pub(super) struct Loss {
    pub(super) fault: usize,
    pub(super) actuator: usize,
    /// `u_e`.
    pub(super) least_command: f64,
}

/// The entries of a design file that this module has code for.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    description: String,
    t_on: f64,
    #[serde(default)]
    monitor: bool,
    sample_time: Option<f64>,
    estimator: Option<Estimator>,
    #[serde(default)]
    filter: Option<Vec<f64>>,
    #[serde(rename = "experiment")]
    _experiment: toml::Value,
    states: Vec<Signal>,
    actuators: Vec<Signal>,
    measurements: Vec<Signal>,
    faults: Vec<Signal>,
    #[serde(rename = "A")]
    a: Rows,
    #[serde(rename = "B")]
    b: Rows,
    #[serde(rename = "C")]
    c: Rows,
    #[serde(rename = "D", default)]
    d: Option<Rows>,
    #[serde(rename = "F_a")]
    f_a: Rows,
    #[serde(rename = "A_f", default)]
    a_f: Option<Rows>,
    #[serde(rename = "K_x")]
    k_x: Rows,
    #[serde(rename = "K_f")]
    k_f: Rows,
    #[serde(rename = "L_x")]
    l_x: Rows,
    #[serde(rename = "L_f")]
    l_f: Rows,
    #[serde(rename = "P_f", default)]
    p_f: Option<Rows>,
    #[serde(default)]
    sliding_mode: Option<SlidingMode>,
    #[serde(rename = "H", default)]
    h: Option<Rows>,
    #[serde(rename = "K_i", default)]
    k_i: Option<Rows>,
    #[serde(rename = "F_i", default)]
    f_i: Option<Rows>,
    #[serde(rename = "L_w", default)]
    l_w: Option<Rows>,
    #[serde(rename = "N_r", default)]
    n_r: Option<Rows>,
    #[serde(default)]
    references: Vec<Signal>,
    #[serde(default)]
    schedule: Option<ScheduleFile>,
    #[serde(default)]
    detection: Option<DetectionFile>,
    #[serde(default)]
    reconfigurations: Vec<CaseFile>,
    #[serde(default)]
    combinations: Vec<CombinationFile>,
    #[serde(default)]
    fallback: Option<FallbackFile>,
}

/// A matrix as the design file has it.
#[derive(Deserialize)]
pub(super) struct Rows(Vec<Vec<f64>>);

impl Rows {
    pub(super) fn dense(self) -> DMatrix<f64> {
        let columns = self.0.first().map_or(0, Vec::len);
        DMatrix::from_row_slice(self.0.len(), columns, &self.0.concat())
    }
}

impl Controller {
    /// Reads the design file `text`; the error names what has no code.
    pub(super) fn of(text: &str) -> Result<Self, Error> {
        let file: File = toml::from_str(text).map_err(|error| {
            // `unknown field X, expected one of` all that there are.
            let reason = error.message().split(", expected").next().unwrap_or_default();
            let reason = reason.replace("unknown field", "there is no code for its entry");
            Error::Invalid(format!("only the FMU has this controller: {reason}"))
        })?;
        let (Some(sample_time), Some(estimator)) = (file.sample_time, file.estimator) else {
            return Err(Error::Invalid(
                "there is code for sampled designs only, and this one is continuous; state \
                 `sample_time` in the plant file"
                    .to_owned(),
            ));
        };
        let first_compensated = first_at(file.t_on, sample_time).ok_or_else(|| {
            Error::Invalid(format!(
                "t_on = {} s is more than 2^32 samples of {sample_time} s after the start; a counter of \
                 the code has 32 bits",
                file.t_on
            ))
        })?;
        let faults = file.faults.len();
        let detection = file.detection.map(|own| Detection::of(own, sample_time)).transpose()?;
        let schedule =
            file.schedule.map(|own| Schedule::of(own, &file.measurements)).transpose()?;
        let (k_x, k_f) = (file.k_x.dense(), file.k_f.dense());
        let losses = losses(&file.faults, &file.actuators);
        let plant = Plant {
            sample_time,
            actuators: &file.actuators,
            faults: &file.faults,
            losses: &losses,
            gains: [&k_x, &k_f],
        };
        let reconfiguration =
            Reconfiguration::of(file.reconfigurations, file.combinations, file.fallback, &plant)?;
        Ok(Self {
            reconfiguration,
            schedule,
            detection,
            losses,
            description: file.description,
            sample_time,
            estimator,
            t_on: file.t_on,
            first_compensated,
            monitor: file.monitor,
            filter: file.filter,
            a: file.a.dense(),
            b: file.b.dense(),
            c: file.c.dense(),
            d: file.d.map(Rows::dense),
            f_a: file.f_a.dense(),
            constant_faults: file.a_f.is_none(),
            a_f: file.a_f.map_or_else(|| DMatrix::identity(faults, faults), Rows::dense),
            k_x,
            k_f,
            l_x: file.l_x.dense(),
            l_f: file.l_f.dense(),
            p_f: file.p_f.map(Rows::dense),
            sliding_mode: file.sliding_mode,
            h: file.h.map(Rows::dense),
            k_i: file.k_i.map(Rows::dense),
            f_i: file.f_i.map(Rows::dense),
            l_w: file.l_w.map(Rows::dense),
            n_r: file.n_r.map(Rows::dense),
            references: file.references,
            states: file.states,
            actuators: file.actuators,
            measurements: file.measurements,
            faults: file.faults,
        })
    }

    /// The operating point of some signals.
    pub(super) fn operating(signals: &[Signal]) -> Vec<f64> {
        signals.iter().map(|signal| signal.operating).collect()
    }

    /// The scheduling variable where it is an input of its own; else none.
    pub(super) fn schedule_inputs(&self) -> &[Signal] {
        self.schedule.as_ref().and_then(Schedule::input).map_or(&[], std::slice::from_ref)
    }

    /// A matrix at each point of the schedule; `None` if it is constant.
    pub(super) fn scheduled(&self, matrix: Matrix) -> Option<Vec<&DMatrix<f64>>> {
        self.schedule.as_ref().and_then(|own| own.matrices(matrix))
    }

    /// Whether an instance counts its samples.
    pub(super) fn has_counter(&self) -> bool {
        self.first_compensated > 0 || self.counts_all()
    }

    /// Whether it counts all of them: times of a detection and of a reconfiguration follow from their number.
    pub(super) fn counts_all(&self) -> bool {
        self.detection.is_some() || self.reconfiguration.is_some()
    }

    /// A matrix in each set of gains; `None` if it is the same in all.
    pub(super) fn chosen(&self, matrix: Matrix) -> Option<Vec<&DMatrix<f64>>> {
        self.reconfiguration.as_ref().and_then(|own| own.matrices(matrix))
    }

    /// Whether faults are estimated while compensation is off because the fall-back is in force.
    pub(super) fn estimates_in_fallback(&self) -> bool {
        !self.monitor && self.reconfiguration.as_ref().is_some_and(|own| own.fallback.is_some())
    }

    /// Whether any actuator has limits.
    pub(super) fn is_limited(&self) -> bool {
        self.actuators.iter().any(|actuator| actuator.limits.is_some())
    }

    /// Checks that `precision` can hold every constant.
    pub(super) fn check_range(&self, precision: Precision) -> Result<(), Error> {
        if precision == Precision::Double {
            return Ok(());
        }
        for matrix in Matrix::ALL {
            let largest = matrix.of(self).map_or(0.0, DMatrix::amax);
            if largest > LARGEST_SINGLE {
                return Err(too_large(matrix.name(), largest));
            }
        }
        let signals = [&self.states, &self.actuators, &self.measurements, &self.references];
        for signal in signals.into_iter().flatten() {
            let values = signal.limits.iter().flatten().chain([&signal.operating]);
            let largest = values.fold(0.0, |largest: f64, value| largest.max(value.abs()));
            if largest > LARGEST_SINGLE {
                return Err(too_large(&signal.name, largest));
            }
        }
        let of_tests = self.detection.iter().flat_map(Detection::numbers);
        if let Some(value) = of_tests.into_iter().find(|value| value.abs() > LARGEST_SINGLE) {
            return Err(too_large("[detection]", value));
        }
        let of_gains = self.reconfiguration.iter().flat_map(Reconfiguration::numbers);
        if let Some(value) = of_gains.into_iter().find(|value| value.abs() > LARGEST_SINGLE) {
            return Err(too_large("[reconfiguration]", value));
        }
        if let Some(schedule) = &self.schedule {
            schedule.check_range(precision, LARGEST_SINGLE)?;
        }
        if let Some(SlidingMode { rho, delta }) = &self.sliding_mode {
            let range = SMALLEST_SINGLE..=LARGEST_SINGLE;
            if let Some(value) = rho.iter().chain(delta).find(|value| !range.contains(*value)) {
                return Err(Error::Invalid(format!(
                    "the sliding-mode law has rho or delta = {value:?}; `float` code has them from \
                     {SMALLEST_SINGLE:?} to {LARGEST_SINGLE:?} only"
                )));
            }
        }
        match self.losses.iter().find(|loss| !COMMANDS.contains(&loss.least_command)) {
            None => Ok(()),
            Some(loss) => Err(Error::Invalid(format!(
                "least_command = {:?} of {}: `float` cannot hold its square; expected {:?} to {:?}",
                loss.least_command,
                self.faults[loss.fault].name,
                COMMANDS.start(),
                COMMANDS.end()
            ))),
        }
    }
}

/// The largest constant in single precision: its product with a signal of its own size is finite.
const LARGEST_SINGLE: f64 = 1e18;
/// The smallest bound of a sliding-mode law in single precision: its product with a signal of its own size is a
/// normal number.
const SMALLEST_SINGLE: f64 = 1e-18;
/// The `least_command` whose square is a normal number in single precision.
const COMMANDS: std::ops::RangeInclusive<f64> = SMALLEST_SINGLE..=LARGEST_SINGLE;

fn too_large(name: &str, value: f64) -> Error {
    Error::Invalid(format!(
        "{name} has the number {value:?}; `float` code has constants up to {LARGEST_SINGLE:?} only"
    ))
}

/// The number of the first sample at which the FMU compensates, from a start at time 0; `None` if it
/// does not fit into 32 bits.
pub(super) fn first_at(t_on: f64, period: f64) -> Option<u32> {
    let is_on = |sample: f64| {
        let time = sample * period;
        time >= t_on - 8.0 * f64::EPSILON * time
    };
    let mut sample = ((t_on / period).floor() - 2.0).max(0.0);
    while !is_on(sample) && sample <= f64::from(u32::MAX) {
        sample += 1.0;
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a whole number")]
    (sample <= f64::from(u32::MAX)).then_some(sample as u32)
}

fn losses(faults: &[Signal], actuators: &[Signal]) -> Vec<Loss> {
    let loss = |(fault, own): (usize, &Signal)| {
        let name = own.loss_of.as_ref()?;
        let actuator = actuators.iter().position(|actuator| actuator.name == *name)?;
        Some(Loss { fault, actuator, least_command: own.least_command? })
    };
    faults.iter().enumerate().filter_map(loss).collect()
}

#[cfg(test)]
mod tests {
    use super::{Controller, first_at};

    #[test]
    fn an_entry_without_code_is_named() {
        let error = Controller::of("Q_f = [[1.0]]\n").err().unwrap().to_string();
        assert_eq!(error, "only the FMU has this controller: there is no code for its entry `Q_f`");
    }

    #[test]
    fn the_first_compensated_sample_is_the_first_one_at_t_on() {
        for (t_on, period, expected) in [
            (0.0, 0.1, 0),
            (-3.0, 0.1, 0),
            (0.3, 0.1, 3), // 3 * 0.1 is above 0.3, 0.3 / 0.1 below 3
            (0.31, 0.1, 4),
            (5.0, 1e-3, 5000),
            (0.7, 0.1, 7),
        ] {
            assert_eq!(first_at(t_on, period), Some(expected), "{t_on} {period}");
        }
        assert_eq!(first_at(1e9, 1e-3), None);
    }
}
