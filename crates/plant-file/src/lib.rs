//! Reads a plant file: the plant, its faults and the requirements on the controller.
#![forbid(unsafe_code)]

pub mod channel;
pub mod detection;
pub mod estimation;
pub mod fallback;
pub mod faults;
pub mod loop_shape;
mod matrix;
mod model;
mod names;
pub mod parameters;
pub mod pid;
mod read;
pub mod reconfiguration;
pub mod references;
pub mod requirements;
pub mod robustness;
mod sampled_matrices;
pub mod signals;
pub mod variants;

use std::collections::BTreeMap;
use std::path::Path;

use crate::channel::ChannelSignals;
use crate::detection::{DetectionRequest, Disturbance, disturbances};
use crate::estimation::{EXCLUDING, EstimationRequest, Law};
use crate::fallback::FallbackRequest;
use crate::faults::{EntryPoint, Fault, all_faults};
use crate::loop_shape::LoopShape;
use crate::matrix::matrix;
use crate::model::{read_fmu_plant, read_matrices};
use crate::names::check_names;
use crate::pid::Pid;
use crate::read::{Result, each, is_first, optional, positive, refuse};
use crate::reconfiguration::ReconfigurationRequest;
use crate::references::References;
use crate::requirements::{Request, request};
use crate::robustness::RobustnessLimits;
use crate::signals::{Signal, delay_order, description};
use crate::variants::{Schedule, Variant, check_action};
use control::Domain;
use control::aso::Estimator;
use files::{Entry, Place, PlaceError, Source, Table};

pub use faults::FAULTS;
pub use model::{Model, PlantFmu};

/// A plant file whose entries are valid and consistent.
#[derive(Clone)]
pub struct PlantFile<'a> {
    source: &'a Source,
    /// The places of the entries, for errors that are found later.
    places: BTreeMap<&'static str, Place>,
    /// The description of the controller by the user; `None` for a missing or empty one.
    pub description: Option<String>,
    /// Start time of the compensation, s.
    pub t_on: f64,
    /// Whether the faults are also estimated before their compensation starts.
    pub monitor: bool,
    /// The time constant, s, with which the commands change over to other gains; `None` if the commands jump.
    pub transfer_time: Option<f64>,
    /// The plant.
    pub model: Model,
    /// The commands.
    pub actuators: Vec<Signal>,
    /// The measurements.
    pub measurements: Vec<Signal>,
    /// The faults that are estimated.
    pub faults: Vec<Fault>,
    /// Set points of measurements, if the file states any.
    pub references: Option<References>,
    /// The sampling of the controller; `None` in continuous time.
    pub sampling: Option<Sampling>,
    /// Rates of the measurement filter, 1/s, one per measurement; `None` without a filter.
    pub filter: Option<Vec<f64>>,
    /// Number of states with which the observer approximates each delay.
    pub delay_order: usize,
    /// The requirement on the state feedback.
    pub feedback: Request,
    /// The requirement on the observer.
    pub observer: Request,
    /// The shape of the loop, if the file states it in place of `feedback` and `observer`.
    pub loop_shape: Option<LoopShape>,
    /// The law that estimates the faults.
    pub estimation: EstimationRequest,
    /// End of the default experiment, s.
    pub stop_time: Option<f64>,
    /// Communication step of the default experiment, s.
    pub step_size: Option<f64>,
    /// Limits of the verdict, and the tolerances.
    pub robustness: RobustnessLimits,
    /// Further plants that the gains serve, besides the plant of the file.
    pub family: Vec<Variant>,
    /// The operating points between which gains are interpolated, if the file states a schedule.
    pub schedule: Option<Schedule>,
    /// Whether the plant is a point of the schedule of another file.
    pub is_point: bool,
    /// Unknown inputs that are no faults.
    pub disturbances: Vec<Disturbance>,
    /// The requirements on the detection of faults, if the file states any.
    pub detection: Option<DetectionRequest>,
    /// The requirements on the controllers for actuators that are gone, if there are any.
    pub reconfiguration: Option<ReconfigurationRequest>,
    /// The requirements on the fall-back, one feedback whichever actuator has failed, if there are any.
    pub fallback: Option<FallbackRequest>,
}

/// The sampling of the controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Sample time, s.
    pub period: f64,
    /// Whether the command uses the newest measurement (current estimator), or only earlier measurements.
    pub current: bool,
}

/// The largest number of actuators: the controller has one bit of 64 for each.
const MOST_ACTUATORS: usize = 64;

const KEYS: [&str; 36] = [
    "description",
    "t_on",
    "monitor",
    "transfer_time",
    "plant",
    "operating_point",
    "preload",
    "linearisation_step",
    "matrices",
    "A",
    "B",
    "C",
    "F_a",
    "actuator_faults",
    "states",
    "actuators",
    "measurements",
    "faults",
    "sample_time",
    "estimator",
    "filter",
    "delay_order",
    "feedback",
    "observer",
    "loop",
    "estimation",
    "experiment",
    "robustness",
    "reference",
    "disturbances",
    "detection",
    "reconfiguration",
    "fallback",
    "D",
    "family",
    "schedule",
];

impl<'a> PlantFile<'a> {
    /// Reads and checks the file.
    ///
    /// # Errors
    ///
    /// Returns a [`PlaceError`] at the entry that is wrong or missing.
    pub fn read(source: &'a Source) -> Result<Self> {
        let parsed = source.parse()?;
        let file = &Table::whole(source, &parsed);
        file.allow(&KEYS)?;
        let place = |key: &&'static str| Some((*key, file.get(key)?.place));
        let sampling = sampling(file)?;
        let (model, [actuators, measurements]) = match file.get("plant") {
            Some(plant) => read_fmu_plant(source, file, &plant)?,
            None => read_matrices(file, sampling)?,
        };
        let signals = [&actuators[..], &measurements[..]];
        let faults = all_faults(file, signals)?;
        let references = References::read(file, &measurements)?;
        let domain = match sampling {
            Some(Sampling { period, .. }) => Domain::Sampled { period },
            None => Domain::Continuous,
        };
        let loop_shape = LoopShape::read(file, signals, domain)?;
        let read = |key: &str, weights| {
            let Some(entry) = file.get(key) else { return Ok(Request::open(file.place.clone())) };
            let outputs: Vec<&str> = match key {
                "observer" => faults.iter().map(|fault| fault.name.as_str()).collect(),
                _ => measurements.iter().chain(&actuators).map(|one| one.name.as_str()).collect(),
            };
            let names = || measurements.iter().map(|one| one.name.as_str()).collect();
            let noises = (key == "observer").then(names);
            let signals = ChannelSignals { outputs, noises };
            request(&entry.table()?, weights, &signals, domain)
        };
        let [feedback, observer] = match &loop_shape {
            Some(shape) => shape.starts(domain)[0].clone(),
            None => [read("feedback", ["Q", "R"])?, read("observer", ["W", "V"])?],
        };
        let experiment = optional(file, "experiment", Entry::table)?;
        if let Some(table) = &experiment {
            table.allow(&["stop_time", "step_size"])?;
        }
        let time = |key| experiment.as_ref().map_or(Ok(None), |table| positive(table, key));
        let plant_file = Self {
            source,
            places: KEYS.iter().filter_map(place).collect(),
            description: Some(description(file)?).filter(|text| !text.is_empty()),
            t_on: file.get("t_on").map_or(Ok(0.0), |entry| entry.number())?,
            monitor: file.get("monitor").map_or(Ok(false), |entry| entry.flag())?,
            transfer_time: positive(file, "transfer_time")?,
            filter: filter(file, &measurements, &faults)?,
            delay_order: delay_order(file, signals)?,
            feedback,
            observer,
            loop_shape,
            estimation: EstimationRequest::read(file, faults.len())?,
            stop_time: time("stop_time")?,
            step_size: time("step_size")?,
            robustness: RobustnessLimits::read(file, &model, measurements.len())?,
            family: variants::family(file, &model)?,
            schedule: variants::schedule(file, &model, &measurements)?,
            is_point: false,
            disturbances: disturbances(file, signals, &model)?,
            detection: DetectionRequest::read(file, &actuators, measurements.len(), &faults)?,
            reconfiguration: ReconfigurationRequest::read(file, signals, &faults)?,
            fallback: FallbackRequest::read(file, &actuators, sampling.is_some())?,
            model,
            actuators,
            measurements,
            faults,
            references,
            sampling,
        };
        if let Some(pid) = plant_file.pid() {
            pid.check_references(file, plant_file.references.as_ref(), &plant_file.measurements)?;
        }
        plant_file.check_columns(file)?;
        plant_file.check_count()?;
        check_names(&plant_file)?;
        plant_file.check_holds()?;
        check_action(&plant_file)?;
        Ok(plant_file)
    }

    /// Returns the file name without its folder.
    #[must_use]
    pub fn name(&self) -> String {
        self.source.path.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Returns the path of the plant's FMU, if the plant is one.
    #[must_use]
    pub fn fmu(&self) -> Option<&Path> {
        match &self.model {
            Model::Fmu(fmu) => Some(&fmu.path),
            Model::Matrices { .. } => None,
        }
    }

    /// Returns the states that the file states, the actuators and the measurements.
    pub fn signals(&self) -> impl Iterator<Item = &Signal> {
        let states: &[Signal] = match &self.model {
            Model::Matrices { states, .. } => states,
            Model::Fmu(_) => &[],
        };
        states.iter().chain(&self.actuators).chain(&self.measurements)
    }

    /// The PI, PID or other controllers of low order in place of a state feedback, if the file states them.
    #[must_use]
    pub fn pid(&self) -> Option<&Pid> {
        self.loop_shape.as_ref()?.pid.as_ref()
    }

    /// The estimator of the observer: `Prediction` in continuous time and with controllers of low order.
    #[must_use]
    pub fn estimator(&self) -> Estimator {
        match self.sampling {
            Some(sampling) if sampling.current && self.pid().is_none() => Estimator::Current,
            _ => Estimator::Prediction,
        }
    }

    /// Returns the text of the file.
    #[must_use]
    pub fn text(&self) -> &str {
        self.source.text()
    }

    /// Returns an error at the first of `keys` that the file has, otherwise at the first line of the file.
    pub fn error(&self, keys: &[&str], message: impl Into<String>) -> PlaceError {
        let place = keys.iter().find_map(|key| self.places.get(key)).cloned().unwrap_or(0..0);
        self.source.error(&place, message)
    }

    /// Returns an error at `place`.
    pub fn error_at(&self, place: &Place, message: impl Into<String>) -> PlaceError {
        self.source.error(place, message)
    }

    /// Returns a table of the file that excludes `law`; `None` if there is none.
    #[must_use]
    pub fn excluding(&self, law: &Law) -> Option<&'static str> {
        EXCLUDING.into_iter().find(|key| self.places.contains_key(key) && !law.allows(key))
    }

    /// Whether a measurement has a `range` or a `longest_hold`.
    #[must_use]
    pub fn checks_measurements(&self) -> bool {
        let mut all = self.measurements.iter();
        all.any(|signal| signal.limits.is_some() || signal.longest_hold.is_some())
    }

    /// Refuses more than [`MOST_ACTUATORS`].
    fn check_count(&self) -> Result<()> {
        let count = self.actuators.len();
        if count <= MOST_ACTUATORS {
            return Ok(());
        }
        let message =
            format!("expected at most {MOST_ACTUATORS} actuators of a controller, found {count}");
        Err(self.error(&["actuators", "B"], message))
    }

    /// Refuses `range` and `longest_hold` in a continuous design with a schedule, and a `longest_hold` of too many
    /// samples.
    fn check_holds(&self) -> Result<()> {
        for signal in &self.measurements {
            let [_, range, hold] = &signal.places;
            if self.sampling.is_none()
                && self.schedule.is_some()
                && let Some(place) = range.as_ref().or(hold.as_ref())
            {
                let message = format!(
                    "`{}` has a range or a longest time of a hold, which a continuous controller with a \
                     schedule cannot have; expected `sample_time`, or none of them",
                    signal.name
                );
                return Err(self.error_at(place, message));
            }
            if let (Some(Sampling { period, .. }), Some(longest), Some(place)) =
                (&self.sampling, signal.longest_hold, hold)
                && longest / period >= f64::from(u32::MAX)
            {
                let message = format!(
                    "{longest} s are {:.1e} samples of {period} s; expected fewer than 2^32 samples",
                    longest / period
                );
                return Err(self.error_at(place, message));
            }
        }
        Ok(())
    }

    /// Checks that F_a has one column for each fault that enters through it, is missing without such faults, and that a
    /// fault is an input of an FMU only if the plant is an FMU.
    fn check_columns(&self, file: &Table<'_>) -> Result<()> {
        let is_input = |fault: &&Fault| matches!(fault.entry_point, EntryPoint::Input(_));
        if let (None, Some(fault)) = (self.fmu(), self.faults.iter().find(is_input)) {
            let message = format!(
                "fault `{}`: the plant is no FMU: expected `actuator`, `sensor` or `loss_of` in place of `input`, or a \
                 matrix F_a with a column for it",
                fault.name
            );
            return Err(self.error_at(&fault.place, message));
        }
        let columns = |fault: &&Fault| matches!(fault.entry_point, EntryPoint::Column(_));
        let expected = self.faults.iter().filter(columns).count();
        if let Some(fault) = self.faults.iter().find(columns) {
            let expectation = match &self.model {
                Model::Matrices { f_a: Some(f_a), .. } if f_a.ncols() == expected => return Ok(()),
                Model::Matrices { f_a: Some(_), .. } => None,
                Model::Matrices { f_a: None, .. } => {
                    Some("`sensor` or `loss_of`, or a matrix F_a with a column for it")
                }
                Model::Fmu(_) => Some("`sensor`, `loss_of` or `input`, as the plant is an FMU"),
            };
            if let Some(expectation) = expectation {
                let message = format!("fault `{}`: expected `actuator`, {expectation}", fault.name);
                return Err(self.error_at(&fault.place, message));
            }
        }
        let Some(entry) = file.get("F_a") else { return Ok(()) };
        let columns = matrix(&entry)?.ncols();
        Err(entry.error(format!("expected {expected} columns, one per fault, found {columns}")))
    }
}

/// Reads `sample_time` and `estimator`; `None` in continuous time.
fn sampling(file: &Table<'_>) -> Result<Option<Sampling>> {
    let Some(entry) = file.get("sample_time") else {
        return refuse(file, &["estimator"], "the design has no `sample_time`").map(|()| None);
    };
    let estimator = file.get("estimator");
    let current =
        estimator.map_or(Ok(true), |entry| is_first(&entry, ["current", "prediction"]))?;
    Ok(Some(Sampling { period: entry.positive()?, current }))
}

/// Returns the name of an estimator in the plant file.
#[must_use]
pub fn estimator(estimator: Estimator) -> &'static str {
    match estimator {
        Estimator::Current => "current",
        Estimator::Prediction => "prediction",
    }
}

/// Reads the rates of the measurement filter; `None` without one. Sensor faults require a filter; the design checks
/// whether anything else does.
fn filter(file: &Table<'_>, measurements: &[Signal], faults: &[Fault]) -> Result<Option<Vec<f64>>> {
    let sensor = faults.iter().find(|fault| matches!(fault.entry_point, EntryPoint::Sensor(_)));
    match (file.get("filter"), sensor) {
        (None, None) => Ok(None),
        (None, Some(fault)) => {
            let name = &fault.name;
            let message = format!(
                "sensor fault `{name}` needs `filter`: the rates, in 1/s, of the filter that the \
                 measurements pass"
            );
            Err(file.source.error(&fault.place, message))
        }
        (Some(entry), _) => {
            let what = "rates, one per measurement";
            each(&entry, measurements.len(), what, Entry::positive).map(Some)
        }
    }
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
