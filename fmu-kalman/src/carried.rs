//! The plant that the filter carries, with its faults as states, in sampled time.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use aso_controller::Matrix;
use aso_controller::kalman::{Entry, KalmanDesign};
use control::nonlinear_filter::{FilterError, NonlinearFilter, SampledPlant, Transform};
use fmu::Failure;
use fmu_import::Fmu;
use linearise::{Linearise, LineariseError, PlantEquations};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// The design and the plant in the files of the FMU, with an instance of the plant and the memory of the filter.
///
/// Copies of the filter, such as FMU states, share the instance, because it is only evaluated as a function of time,
/// states and inputs.
pub(crate) struct Carrier {
    pub(crate) design: KalmanDesign,
    plant: PathBuf,
    engine: Mutex<Option<Engine>>,
}

/// Mean and covariance of z, the covariance column by column.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Estimate {
    pub(crate) mean: Vec<f64>,
    pub(crate) covariance: Vec<f64>,
}

/// A prediction from the sample at `time` in s with the commands `u`, in `steps` integration steps.
pub(crate) struct Prediction<'a> {
    pub(crate) time: f64,
    pub(crate) u: &'a [f64],
    pub(crate) steps: i32,
    pub(crate) transform: Transform,
}

/// Sample `number` at `time` in s: the commands `u` until then, and the measurements. Measurement k is used in every
/// `every[k]`-th sample.
pub(crate) struct Sample<'a> {
    pub(crate) number: f64,
    pub(crate) time: f64,
    pub(crate) u: &'a [f64],
    pub(crate) y: &'a [f64],
    pub(crate) every: &'a [i32],
    pub(crate) transform: Transform,
}

struct Engine {
    filter: NonlinearFilter,
    plant: CarriedPlant,
    start_time: f64,
}

fn failed(error: &FilterError<LineariseError>) -> Failure {
    match error {
        FilterError::Plant(error) => Failure::Error(format!("the plant of the filter: {error}")),
        error => Failure::Error(error.to_string()),
    }
}

fn as_dense(matrix: &Matrix) -> DMatrix<f64> {
    DMatrix::from_row_slice(matrix.rows, matrix.columns, &matrix.values)
}

impl Carrier {
    /// Reads `filter.toml` in `resources`; `None` without this file. The plant is opened by [`Carrier::start`].
    pub(crate) fn read(resources: &Path) -> Result<Option<Self>, Failure> {
        let file = resources.join("filter.toml");
        if !file.exists() {
            return Ok(None);
        }
        let path = file.display().to_string();
        let text = std::fs::read_to_string(&file);
        let text = text.map_err(|error| Failure::Error(format!("{path}: {error}")))?;
        let design = KalmanDesign::parse(&text, &path).map_err(Failure::Error)?;
        let plant = resources.join("plant.fmu");
        Ok(Some(Self { design, plant, engine: Mutex::new(None) }))
    }

    fn engine(&self) -> MutexGuard<'_, Option<Engine>> {
        self.engine.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Opens the plant, unless an instance for this start time is open.
    pub(crate) fn start(&self, start_time: f64) -> Result<(), Failure> {
        let mut engine = self.engine();
        if engine.as_ref().is_some_and(|engine| engine.start_time.to_bits() == start_time.to_bits())
        {
            return Ok(());
        }
        let failed = |error: &dyn std::error::Error| {
            Failure::Error(format!("{}: {error}", self.plant.display()))
        };
        let fmu = Fmu::open_quietly(&self.plant).map_err(|error| failed(&error))?;
        let request = self.request(start_time);
        let equations = PlantEquations::new(&fmu, &request).map_err(|error| failed(&error))?;
        let plant = CarriedPlant::new(&self.design, equations)?;
        let filter = NonlinearFilter::new(as_dense(&self.design.w), as_dense(&self.design.v));
        *engine = Some(Engine { filter, plant, start_time });
        Ok(())
    }

    /// The commands, faults and measurements for which the plant's equations are requested, with the settings of the
    /// plant.
    fn request(&self, start_time: f64) -> Linearise {
        let design = &self.design;
        let names = |signals: &[aso_controller::design::Signal]| {
            signals.iter().map(|signal| signal.name.clone()).collect()
        };
        let inputs = design.faults.iter().filter_map(|fault| match &fault.enters {
            Entry::Input(name) => Some(name.clone()),
            _ => None,
        });
        let at = design.settings.iter().map(|(name, value)| (name.clone(), value.to_string()));
        Linearise {
            inputs: names(&design.commands),
            faults: inputs.collect(),
            outputs: names(&design.measurements),
            at: at.collect(),
            start_time,
            ..Linearise::default()
        }
    }

    /// Updates `estimate` by `call` on the filter; an error of the call leaves `estimate` unchanged.
    fn update<T>(
        &self,
        estimate: &mut Estimate,
        call: impl FnOnce(
            &mut NonlinearFilter,
            &mut CarriedPlant,
        ) -> Result<T, FilterError<LineariseError>>,
    ) -> Result<T, Failure> {
        let mut engine = self.engine();
        let Some(Engine { filter, plant, .. }) = &mut *engine else {
            return Err(Failure::Error("the filter is not initialised".to_owned()));
        };
        filter.mean.copy_from_slice(&estimate.mean);
        filter.covariance.copy_from_slice(&estimate.covariance);
        let result = call(filter, plant).map_err(|error| failed(&error))?;
        estimate.mean.copy_from_slice(filter.mean.as_slice());
        estimate.covariance.copy_from_slice(filter.covariance.as_slice());
        Ok(result)
    }

    /// Advances the estimate by one sample, without the measurements of that sample.
    pub(crate) fn predict(
        &self,
        estimate: &mut Estimate,
        prediction: &Prediction<'_>,
    ) -> Result<(), Failure> {
        let step = self.design.sample_time / f64::from(prediction.steps);
        self.update(estimate, |filter, plant| {
            plant.u.copy_from_slice(prediction.u);
            (plant.time, plant.step, plant.steps) = (prediction.time, step, prediction.steps);
            filter.predict(plant, prediction.transform)
        })
    }

    /// Corrects the estimate by the measurements of a sample. Returns the squared innovation relative to its
    /// covariance.
    pub(crate) fn correct(
        &self,
        estimate: &mut Estimate,
        sample: &Sample<'_>,
    ) -> Result<f64, Failure> {
        self.update(estimate, |filter, plant| {
            plant.u.copy_from_slice(sample.u);
            plant.time = sample.time;
            let is_due = |k: usize| sample.number % f64::from(sample.every[k]) < 0.5;
            filter.correct(plant, sample.y, is_due, sample.transform)
        })
    }
}

/// The plant with z = [x; faults; their rates]: x' = f(t, x, u + faults), y = h(t, x, u + faults) + faults; the
/// derivative of a fault is its rate, or 0 if it has none; the derivative of a rate is 0.
struct CarriedPlant {
    equations: PlantEquations,
    faults: Vec<Channel>,
    /// Number of states of the plant.
    n: usize,
    /// The commands of the sample.
    u: Vec<f64>,
    /// The values, without faults, of the inputs to which faults are added.
    free_inputs: Vec<f64>,
    /// All inputs of the plant with the faults.
    inputs: Vec<f64>,
    /// The time in s of the last sample in a prediction, of the present one in a correction.
    time: f64,
    /// The size in s of the integration steps, and their number in a sample.
    step: f64,
    steps: i32,
    /// z' at the four points of a step.
    slopes: [Vec<f64>; 4],
    /// z at a point of a Runge-Kutta step.
    point: Vec<f64>,
    /// z at the end of a step.
    ahead: Vec<f64>,
    /// The derivatives of `slopes`, `point` and `ahead` with respect to z at the start of the prediction.
    tangents: [DMatrix<f64>; 4],
    tangent: DMatrix<f64>,
    tangent_ahead: DMatrix<f64>,
    /// The derivatives of x' and y of the plant's equations with respect to x and the inputs.
    jacobian: DMatrix<f64>,
    /// The derivative of z' with respect to z.
    dynamics: DMatrix<f64>,
}

/// A fault: the signal to which it is added, and the position of its rate in z, if it has one.
struct Channel {
    signal: Position,
    rate: Option<usize>,
}

/// A position among the inputs of the plant or among the measurements.
#[derive(Clone, Copy)]
enum Position {
    Input(usize),
    Measurement(usize),
}

/// The Runge-Kutta method of order 4 (W. Kutta 1901): the points of a step, as fractions of it, and the weights of
/// their derivatives.
const POINTS: [f64; 4] = [0.0, 0.5, 0.5, 1.0];
const WEIGHTS: [f64; 4] = [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0];
/// Width to which state events are located, as a fraction of an integration step.
const EVENT_WIDTH: f64 = 1e-9;
/// The largest number of state events in an integration step.
const MOST_EVENTS: usize = 1000;

/// Adds `factor` times `source` to `target`.
fn add_scaled(target: &mut DMatrix<f64>, factor: f64, source: &DMatrix<f64>) {
    target.zip_apply(source, |target, source| *target += factor * source);
}

impl CarriedPlant {
    fn new(design: &KalmanDesign, equations: PlantEquations) -> Result<Self, Failure> {
        let (n, m, p) = (design.states.len(), design.commands.len(), design.measurements.len());
        let states = design.states.iter().map(|state| &state.name);
        if !states.eq(equations.states()) {
            return Err(Failure::Error(format!(
                "filter.toml names other states than plant.fmu has: {}",
                equations.states().join(", ")
            )));
        }
        let free_inputs = equations.start_inputs()[m..].to_vec();
        let mut faults_at_inputs = m..;
        let mut faults = Vec::new();
        for fault in &design.faults {
            let signal = match &fault.enters {
                Entry::Actuator(at) => Position::Input(*at),
                Entry::Sensor(at) => Position::Measurement(*at),
                Entry::Input(_) => Position::Input(faults_at_inputs.next().unwrap_or(m)),
            };
            faults.push(Channel { signal, rate: fault.rate.map(|rate| n + rate) });
        }
        let size = n + design.fault_states();
        let square = || DMatrix::zeros(size, size);
        Ok(Self {
            equations,
            faults,
            n,
            u: vec![0.0; m],
            inputs: vec![0.0; m + free_inputs.len()],
            jacobian: DMatrix::zeros(n + p, n + m + free_inputs.len()),
            free_inputs,
            time: 0.0,
            step: 0.0,
            steps: 1,
            slopes: std::array::from_fn(|_| vec![0.0; size]),
            point: vec![0.0; size],
            ahead: vec![0.0; size],
            tangents: std::array::from_fn(|_| square()),
            tangent: square(),
            tangent_ahead: square(),
            dynamics: square(),
        })
    }

    /// Sets the inputs of the plant to the commands and the values without faults, plus the faults in `z`.
    fn set_inputs(&mut self, z: &[f64]) {
        let (commands, others) = self.inputs.split_at_mut(self.u.len());
        commands.copy_from_slice(&self.u);
        others.copy_from_slice(&self.free_inputs);
        for (fault, value) in self.faults.iter().zip(&z[self.n..]) {
            if let Position::Input(at) = fault.signal {
                self.inputs[at] += value;
            }
        }
    }

    /// Sets `slopes[at]` to z' at `time` and z = `point`.
    fn set_slope(&mut self, at: usize, time: f64) -> Result<(), LineariseError> {
        let point = std::mem::take(&mut self.point);
        self.set_inputs(&point);
        let (rates, of_faults) = self.slopes[at].split_at_mut(self.n);
        let done = self.equations.rates(time, &point[..self.n], &self.inputs, rates);
        of_faults.fill(0.0);
        for (slope, fault) in of_faults.iter_mut().zip(&self.faults) {
            *slope = fault.rate.map_or(0.0, |rate| point[rate]);
        }
        self.point = point;
        done
    }

    /// Sets the Jacobian of the plant's equations at `time` and `z`.
    fn set_jacobian(&mut self, time: f64, z: &[f64]) -> Result<(), LineariseError> {
        self.set_inputs(z);
        self.equations.jacobian(time, &z[..self.n], &self.inputs, &mut self.jacobian)
    }

    /// Sets `tangents[at]`, the derivative of `slopes[at]` with respect to z at the start of the prediction, from
    /// `tangent`, the derivative of `point`.
    fn set_tangent(&mut self, at: usize, time: f64) -> Result<(), LineariseError> {
        let point = std::mem::take(&mut self.point);
        let done = self.set_jacobian(time, &point);
        self.point = point;
        done?;
        let n = self.n;
        self.dynamics.fill(0.0);
        self.dynamics.view_mut((0, 0), (n, n)).copy_from(&self.jacobian.view((0, 0), (n, n)));
        for (position, fault) in self.faults.iter().enumerate() {
            if let Position::Input(input) = fault.signal {
                let column = self.jacobian.view((0, n + input), (n, 1));
                self.dynamics.view_mut((0, n + position), (n, 1)).copy_from(&column);
            }
            if let Some(rate) = fault.rate {
                self.dynamics[(n + position, rate)] = 1.0;
            }
        }
        self.tangents[at].gemm(1.0, &self.dynamics, &self.tangent, 0.0);
        Ok(())
    }

    /// Sets `ahead` to z after an integration step of `size` in s from `z` at `start`. With `g`, the derivative of `z`
    /// with respect to the z at which the prediction began, also sets this derivative of `ahead`.
    fn step(
        &mut self,
        z: &[f64],
        [start, size]: [f64; 2],
        g: Option<&DMatrix<f64>>,
    ) -> Result<(), LineariseError> {
        for (at, part) in POINTS.into_iter().enumerate() {
            let time = start + part * size;
            self.point.copy_from_slice(z);
            if at > 0 {
                let slopes = self.point.iter_mut().zip(&self.slopes[at - 1]);
                slopes.for_each(|(z, slope)| *z += part * size * slope);
            }
            self.set_slope(at, time)?;
            if let Some(g) = g {
                self.tangent.copy_from(g);
                if at > 0 {
                    add_scaled(&mut self.tangent, part * size, &self.tangents[at - 1]);
                }
                self.set_tangent(at, time)?;
            }
        }
        self.ahead.copy_from_slice(z);
        for (slope, weight) in self.slopes.iter().zip(WEIGHTS) {
            let ahead = self.ahead.iter_mut().zip(slope);
            ahead.for_each(|(z, slope)| *z += weight * size * slope);
        }
        if let Some(g) = g {
            self.tangent_ahead.copy_from(g);
            for (tangent, weight) in self.tangents.iter().zip(WEIGHTS) {
                add_scaled(&mut self.tangent_ahead, weight * size, tangent);
            }
        }
        Ok(())
    }

    /// Whether an event indicator has another sign at `ahead` and `time` than after the last event or step.
    fn crosses(&mut self, time: f64) -> Result<bool, LineariseError> {
        let ahead = std::mem::take(&mut self.ahead);
        self.set_inputs(&ahead);
        let crosses = self.equations.crosses(time, &ahead[..self.n], &self.inputs);
        self.ahead = ahead;
        crosses
    }

    /// Makes an integration step of at most `size` in s from `z` at `start`, which ends at the first state event;
    /// returns its size.
    fn step_to_event(
        &mut self,
        z: &mut [f64],
        [start, size]: [f64; 2],
        mut g: Option<&mut DMatrix<f64>>,
    ) -> Result<f64, LineariseError> {
        self.step(z, [start, size], g.as_deref())?;
        let mut reached = size;
        if self.crosses(start + size)? {
            let mut before = 0.0;
            while reached - before > EVENT_WIDTH * self.step {
                let middle = 0.5 * (before + reached);
                self.step(z, [start, middle], None)?;
                if self.crosses(start + middle)? {
                    reached = middle;
                } else {
                    before = middle;
                }
            }
            self.step(z, [start, reached], g.as_deref())?;
        }
        z.copy_from_slice(&self.ahead);
        if let Some(g) = &mut g {
            g.copy_from(&self.tangent_ahead);
        }
        self.set_inputs(z);
        self.equations.complete(start + reached, &mut z[..self.n], &self.inputs)?;
        Ok(reached)
    }

    /// Integrates z over a sample, and sets `g`, if there is one, to the derivative of the result with respect to `z`
    /// at the start. An error if an integration step has too many state events.
    fn integrate(
        &mut self,
        z: &mut [f64],
        mut g: Option<&mut DMatrix<f64>>,
    ) -> Result<(), LineariseError> {
        self.set_inputs(z);
        self.equations.begin(self.time, &mut z[..self.n], &self.inputs)?;
        if let Some(g) = &mut g {
            g.fill_with_identity();
        }
        for k in 0..self.steps {
            let start = self.time + f64::from(k) * self.step;
            let mut elapsed = 0.0;
            for events in 0.. {
                let rest = self.step - elapsed;
                if rest <= EVENT_WIDTH * self.step {
                    break;
                }
                if events == MOST_EVENTS {
                    return Err(LineariseError::EndlessEvents { iterations: MOST_EVENTS });
                }
                elapsed += self.step_to_event(z, [start + elapsed, rest], g.as_deref_mut())?;
            }
        }
        Ok(())
    }
}

impl SampledPlant for CarriedPlant {
    type Error = LineariseError;

    fn advance(&mut self, z: &mut [f64]) -> Result<(), LineariseError> {
        self.integrate(z, None)
    }

    fn advance_tangent(
        &mut self,
        z: &mut [f64],
        g: &mut DMatrix<f64>,
    ) -> Result<(), LineariseError> {
        self.integrate(z, Some(g))
    }

    fn measure(&mut self, z: &[f64], y: &mut [f64]) -> Result<(), LineariseError> {
        self.set_inputs(z);
        self.point.copy_from_slice(z);
        let x = &mut self.point[..self.n];
        self.equations.begin(self.time, x, &self.inputs)?;
        self.equations.outputs(self.time, x, &self.inputs, y)?;
        for (fault, value) in self.faults.iter().zip(&z[self.n..]) {
            if let Position::Measurement(at) = fault.signal {
                y[at] += value;
            }
        }
        Ok(())
    }

    fn measure_tangent(
        &mut self,
        z: &[f64],
        y: &mut [f64],
        h: &mut DMatrix<f64>,
    ) -> Result<(), LineariseError> {
        self.measure(z, y)?;
        self.set_jacobian(self.time, z)?;
        let (n, p) = (self.n, y.len());
        h.fill(0.0);
        h.view_mut((0, 0), (p, n)).copy_from(&self.jacobian.view((n, 0), (p, n)));
        for (position, fault) in self.faults.iter().enumerate() {
            match fault.signal {
                Position::Input(input) => {
                    let column = self.jacobian.view((n, n + input), (p, 1));
                    h.view_mut((0, n + position), (p, 1)).copy_from(&column);
                }
                Position::Measurement(at) => h[(at, n + position)] = 1.0,
            }
        }
        Ok(())
    }
}
