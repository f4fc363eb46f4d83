//! The sampled controller as its design file states it.

use aso_controller::Design;
use aso_controller::design::{Estimator, Loss, SlidingMode};
use nalgebra::DMatrix;

use super::Precision;
use super::detection::{self, Detection};
use super::matrices::Matrices;
use super::parts::{Signal, first_at};
use super::reconfiguration::Reconfiguration;
use super::schedule::Schedule;
use super::symbols::Matrix;
use crate::Error;

/// The controller of a sampled design: matrices, signals, switches. The shapes are those of the design file.
pub(super) struct Controller {
    pub(super) description: String,
    /// The sample time T in s.
    pub(super) sample_time: f64,
    pub(super) estimator: Estimator,
    /// Start of the compensation in s, and the first sample at or after it.
    pub(super) t_on: f64,
    pub(super) first_compensated: u32,
    /// Whether faults are also estimated while they are not compensated.
    pub(super) monitor: bool,
    /// The diagonal of W, the weights of the filter of the measurements.
    pub(super) filter: Option<Vec<f64>>,
    /// The matrices that the design states; without `A_f` the faults are constant.
    pub(super) matrices: Matrices,
    pub(super) sliding_mode: Option<SlidingMode>,
    /// The fraction of `u_t` that decays in one sample.
    pub(super) transfer: Option<f64>,
    pub(super) states: Vec<Signal>,
    pub(super) actuators: Vec<Signal>,
    pub(super) measurements: Vec<Signal>,
    /// For each measurement, the most samples for which its last value may replace it; `None` without a limit.
    pub(super) most_held: Vec<Option<u32>>,
    pub(super) faults: Vec<Signal>,
    pub(super) references: Vec<Signal>,
    pub(super) losses: Vec<Loss>,
    /// Matrices and operating points that depend on a scheduling variable, in place of the constant ones.
    pub(super) schedule: Option<Schedule>,
    pub(super) detection: Option<Detection>,
    pub(super) reconfiguration: Option<Reconfiguration>,
}

impl Controller {
    /// The controller of a design file. The error says why there is no code: the design is continuous, a time is beyond
    /// 2^32 samples, or tests of both methods are stated.
    pub(super) fn of(file: Design) -> Result<Self, Error> {
        let (Some(sample_time), Some(estimator)) = (file.sample_time, file.estimator) else {
            let text = "there is code for sampled designs only, and this one is continuous; state `sample_time` in \
                        the plant file";
            return Err(Error(text.to_owned()));
        };
        let losses = file.losses();
        let reconfiguration = Reconfiguration::of(&file, &losses, sample_time);
        let of_detection = file.detection.iter().flat_map(detection::matrices);
        let matrices = Matrices::of(file.matrices().chain(of_detection));
        // Each entry of a design file is read here or above, or has the reason why it needs no code.
        let Design {
            description,
            t_on,
            monitor,
            sample_time: _,
            estimator: _,
            filter,
            a: _,
            b: _,
            c: _,
            d: _,
            f_a: _,
            a_f: _,
            p_f: _,
            sliding_mode,
            k_x: _,
            k_f: _,
            l_x: _,
            l_f: _,
            h: _,
            k_i: _,
            f_i: _,
            l_w: _,
            n_r: _,
            transfer,
            states,
            actuators,
            measurements,
            faults,
            references,
            reconfigurations: _,
            combinations: _,
            fallback: _,
            // For importers of the FMU.
            experiment: _,
            schedule,
            detection,
        } = file;
        let first_compensated = first_at("t_on", t_on, sample_time)?;
        let detection =
            detection.map(|detection| Detection::of(detection, sample_time)).transpose()?;
        let schedule = schedule.map(|schedule| Schedule::of(schedule, &measurements));
        let signals =
            |all: Vec<aso_controller::design::Signal>| all.into_iter().map(Signal::from).collect();
        Ok(Self {
            reconfiguration: reconfiguration?,
            schedule,
            detection,
            losses,
            description,
            sample_time,
            estimator,
            t_on,
            first_compensated,
            monitor,
            filter,
            matrices,
            sliding_mode,
            transfer,
            references: signals(references),
            states: signals(states),
            actuators: actuators.into_iter().map(Signal::from).collect(),
            most_held: measurements.iter().map(|signal| signal.most_held(sample_time)).collect(),
            measurements: measurements.into_iter().map(Signal::from).collect(),
            faults: faults.into_iter().map(Signal::from).collect(),
        })
    }

    /// The operating point of some signals.
    pub(super) fn operating(signals: &[Signal]) -> Vec<f64> {
        signals.iter().map(|signal| signal.operating).collect()
    }

    /// The scheduling variable if it is a separate input; otherwise an empty list.
    pub(super) fn schedule_inputs(&self) -> &[Signal] {
        self.schedule.as_ref().and_then(Schedule::input).map_or(&[], std::slice::from_ref)
    }

    /// Whether the design states a matrix.
    pub(super) fn has(&self, matrix: Matrix) -> bool {
        matrix.of(self).is_some()
    }

    /// A matrix at each point of the schedule; `None` if the matrix does not depend on the scheduling variable.
    pub(super) fn scheduled(&self, matrix: Matrix) -> Option<Vec<&DMatrix<f64>>> {
        self.schedule.as_ref().and_then(|schedule| schedule.matrices(matrix))
    }

    /// Whether an instance counts its samples.
    pub(super) fn has_counter(&self) -> bool {
        self.first_compensated > 0 || self.counts_all()
    }

    /// Whether an instance counts all of its samples, because the times of a detection and of a reconfiguration follow
    /// from the count.
    pub(super) fn counts_all(&self) -> bool {
        self.detection.is_some() || self.reconfiguration.is_some()
    }

    /// A matrix in each set of gains; `None` if all sets have the same matrix.
    pub(super) fn chosen(&self, matrix: Matrix) -> Option<Vec<&DMatrix<f64>>> {
        self.reconfiguration.as_ref().and_then(|reconfiguration| reconfiguration.matrices(matrix))
    }

    /// Whether a measurement has a range or a longest hold.
    pub(super) fn checks_measurements(&self) -> bool {
        self.measurements.iter().any(|signal| signal.limits.is_some()) || self.limits_holds()
    }

    /// Whether a measurement has a longest hold.
    pub(super) fn limits_holds(&self) -> bool {
        self.most_held.iter().any(Option::is_some)
    }

    /// Whether the detection counts the samples since the controller last rested, in addition to those since the start.
    pub(super) fn counts_since_rest(&self) -> bool {
        self.limits_holds() && self.detection.is_some()
    }

    /// Whether any actuator has limits.
    pub(super) fn is_limited(&self) -> bool {
        self.actuators.iter().any(|actuator| actuator.limits.is_some())
    }

    /// Checks that `precision` can hold every constant. In single precision the error names the first one that is too
    /// large, or a bound of a sliding-mode law or a `least_command` that is too small, or values of the scheduling
    /// variable that become equal.
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
        let of_gains = self.reconfiguration.iter().flat_map(Reconfiguration::numbers);
        let of_tests = of_tests.map(|value| ("[detection]", value));
        let mut all = of_tests.chain(of_gains.map(|value| ("[reconfiguration]", value)));
        if let Some((name, value)) = all.find(|(_, value)| value.abs() > LARGEST_SINGLE) {
            return Err(too_large(name, value));
        }
        if let Some(schedule) = &self.schedule {
            schedule.check_range(precision, LARGEST_SINGLE)?;
        }
        if let Some(SlidingMode { rho, delta }) = &self.sliding_mode {
            let range = SMALLEST_SINGLE..=LARGEST_SINGLE;
            if let Some(value) = rho.iter().chain(delta).find(|value| !range.contains(*value)) {
                return Err(Error(format!(
                    "the sliding-mode law has rho or delta = {value:?}; `float` code has them from \
                     {SMALLEST_SINGLE:?} to {LARGEST_SINGLE:?} only"
                )));
            }
        }
        match self.losses.iter().find(|loss| !COMMANDS.contains(&loss.least_command)) {
            None => Ok(()),
            Some(loss) => Err(Error(format!(
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
    Error(format!(
        "{name} has the number {value:?}; `float` code has constants up to {LARGEST_SINGLE:?} only"
    ))
}
