//! The data of a design report about the detection of faults.

use schemars::JsonSchema;
use serde::Serialize;

use crate::Matrix;

/// The detection of faults: tests, false alarms, delays, structure.
#[derive(Serialize, JsonSchema)]
pub struct Detection {
    /// `cusum` or `chi-square`.
    pub method: String,
    /// Time between two tests, in s.
    pub sample_time: f64,
    /// Time from the start of a run to the first test, in s.
    pub from: f64,
    /// Predicted mean time between false alarms of all tests together, in s; if the tests are not
    /// independent, it is longer.
    pub false_alarm_interval: f64,
    /// Noise of each measurement: the root of its spectral density, or its standard deviation in a
    /// sampled design.
    pub noise: Vec<f64>,
    /// How the process noise was found, in a sentence.
    pub process_noise: String,
    /// The tests.
    pub tests: Vec<Test>,
    /// The faults, in the order that `fault_isolated` counts.
    pub faults: Vec<DetectedFault>,
    /// The largest mean of the residuals of each test (rows) after a step of each fault (columns) by its
    /// size, in standard deviations.
    pub structure: Matrix,
    /// Whether each test (rows) reacts to each fault (columns).
    pub reacts: Vec<Vec<bool>>,
    /// Groups of faults that cannot be told apart.
    pub confused: Vec<Vec<String>>,
    /// The random plants by which `model_error` was examined; none without parameters of an FMU.
    pub parameter_cases: Option<ParameterCases>,
}

/// Random parameters of an FMU within their limits.
#[derive(Serialize, JsonSchema)]
pub struct ParameterCases {
    /// Their number.
    pub cases: usize,
    /// The seed of the random numbers.
    pub seed: u32,
    /// With a confidence of 99 %, at most this part of the box of the parameters gives a test a larger mean than
    /// `model_error` before the factor of the plant file: 1 - 0.01^(1 / cases).
    pub uncovered: f64,
}

impl ParameterCases {
    /// Computes `uncovered` for this number of cases, which are uniform and independent: all of them miss a part
    /// `uncovered` of the box with probability (1 - uncovered)^cases = 0.01.
    #[must_use]
    pub fn new(cases: usize, seed: u32) -> Self {
        #[expect(clippy::cast_precision_loss, reason = "a number of cases")]
        let number = cases as f64;
        Self { cases, seed, uncovered: 1.0 - 0.01_f64.powf(1.0 / number) }
    }
}

/// A test of the residuals.
#[derive(Default, Serialize, JsonSchema)]
pub struct Test {
    /// The fault that the test is for, or `all`.
    pub name: String,
    /// Number of residuals.
    pub residuals: usize,
    /// Drift of the cumulative sums, in standard deviations.
    pub drift: Option<f64>,
    /// Number of samples of a window.
    pub window: Option<u32>,
    /// The largest mean of the residuals, in standard deviations, that errors of the model give them without a
    /// fault; 0 if they are not considered. Drift or threshold allow for it.
    pub model_error: f64,
    /// For parameters of an FMU: the relative excess of the largest mean found within their limits over the largest at
    /// the corners, the centre and the centres of the faces. `model_error` includes it.
    pub interior_excess: Option<f64>,
    /// Threshold of the statistic.
    pub threshold: f64,
    /// Predicted mean time between false alarms of this test, in s.
    pub false_alarm_interval: f64,
    /// The disturbances and the other faults from which the test is decoupled.
    pub decoupled: Vec<DecoupledInput>,
}

/// An unknown input from which a test is decoupled: a constant one does not act on its residuals in steady state.
#[derive(Serialize, JsonSchema)]
pub struct DecoupledInput {
    /// Its name.
    pub name: String,
    /// Whether the input does not act on the residuals at all; otherwise a constant one does not act on them in steady
    /// state.
    pub exact: bool,
    /// Size of the step that causes `largest_mean`; none if the file states none, and the size is 1.
    pub size: Option<f64>,
    /// The largest mean of the residuals after this step, in standard deviations.
    pub largest_mean: f64,
}

/// How a fault is detected.
#[derive(Serialize, JsonSchema)]
pub struct DetectedFault {
    /// The fault.
    pub fault: String,
    /// Its unit.
    pub unit: Option<String>,
    /// The size of its step.
    pub size: f64,
    /// The test for this fault.
    pub test: String,
    /// The mean of the residuals long after the step, in standard deviations.
    pub mean: f64,
    /// Predicted mean delay of the detection by this test, in s; none if it is not detected for sure.
    pub delay: Option<f64>,
    /// The delay that 90 % of the detections do not exceed, in s.
    pub delay_90: Option<f64>,
    /// Time in s within which `least` is detected.
    pub within: f64,
    /// The smallest step that is detected within that time with probability 0.95; none if even a
    /// thousandfold one is not.
    pub least: Option<f64>,
}
