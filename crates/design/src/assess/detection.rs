//! The detection of a design: filters of the residuals, tests, predictions, the section of the design
//! file.

mod decoupling;
mod file;
mod model_error;
mod prediction;
mod problem;

use aso_controller::design::detection::DetectionDesign;
use control::detection::{Cusum, WindowTest};
use nalgebra::DMatrix;

use crate::assess::matrices::matrix;
use crate::plant::parameters::ParameterFamily;
use crate::report::detection::{
    DecoupledInput, DetectedFault, Detection as Report, ParameterCases, Test,
};
use crate::report::number::rounded;
use crate::solve::designed::Designed;
use decoupling::Decoupling;
use model_error::{LargestMean, ModelErrors};
use plant_file::PlantFile;
use plant_file::detection::{DetectionRequest, Method};
use prediction::{Prediction, TestKind};
use problem::Problem;

/// A test counts as insensitive to a fault that moves the means of the residuals by less than this part of the motion
/// that the tested fault causes.
const INSENSITIVE: f64 = 1e-6;
/// Number of time constants of the slowest filter after which the initial error of this filter is a thousandth.
const SETTLING: f64 = 7.0;
/// Threshold for a warning: relative excess of the largest mean inside the limits of parameters over that at the
/// corners. The brackets of the means have a relative width of 0.01.
const NOTICEABLE: f64 = 0.02;
/// Largest drift of a CUSUM test: a fault of four standard deviations is then mostly found in its first sample.
const LARGEST_DRIFT: f64 = 2.0;

/// The detection, for the design file and for the report.
pub(crate) struct Detection {
    pub(crate) section: DetectionDesign,
    pub(crate) report: Report,
    pub(crate) warnings: Vec<String>,
}

/// A filter with the tests of its residuals.
struct Part<'a> {
    decoupling: Decoupling<'a>,
    tests: Vec<PlannedTest>,
}

/// A test of combinations of the residuals of a filter.
struct PlannedTest {
    name: String,
    /// One combination in each row; rows x residuals of the filter.
    rows: DMatrix<f64>,
    kind: TestKind,
    /// The largest norm of the mean of the residuals that model errors cause, in standard deviations.
    bias: f64,
    /// Relative excess of `bias` inside the limits of parameters over its value at the corners; None unless parameters
    /// of an FMU vary.
    interior_excess: Option<f64>,
    /// Whether the test reacts to each fault.
    reacts: Vec<bool>,
}

/// Designs the fault detection that the plant file requests; None without a request.
pub(crate) fn detection(
    file: &PlantFile<'_>,
    designed: &Designed,
    family: Option<&ParameterFamily<'_>>,
) -> Result<Option<Detection>, crate::Error> {
    let Some(request) = &file.detection else { return Ok(None) };
    check_plants(file, request)?;
    let problem = Problem::new(file, request, &designed.nominal)?;
    let refuse = |error: control::Error| file.error_at(&request.place, error.to_string());
    let errors =
        request.model_error.as_ref().map(|bounds| ModelErrors::new(file, bounds, designed, family));
    let errors = errors.transpose()?;
    let planner = Planner { file, request, problem: &problem, errors: errors.as_ref() };
    let parts = planner.parts()?;
    let mut warnings = Vec::new();
    let cases = errors.as_ref().and_then(ModelErrors::random_cases);
    let cases = cases.map(|cases| ParameterCases::new(cases, file.robustness.seed));
    let report = report(request, &problem, &parts, cases, &mut warnings).map_err(refuse)?;
    let section = file::section(&problem, &parts, report.from, &designed.nominal);
    Ok(Some(Detection { section, report, warnings }))
}

/// Refuses schedules, families of an FMU, and families without `model_error`.
fn check_plants(file: &PlantFile<'_>, request: &DetectionRequest) -> Result<(), crate::Error> {
    let message = if file.schedule.is_some() {
        "the thresholds rely on residuals that are white with variance 1, which interpolated filters give at the \
         points of the schedule only: between them false alarms and delays would not be those stated; \
         expected no [schedule] with [detection]"
    } else if file.family.is_empty() || (request.model_error.is_some() && file.fmu().is_none()) {
        return Ok(());
    } else if file.fmu().is_some() {
        "the residuals are those of one operating point: expected no [[family]] of an FMU with [detection]; \
         tolerances of its `parameters` in [robustness], with `model_error`, allow for other plants"
    } else {
        "the other plants of [[family]] would give false alarms: expected `model_error`, so that the tests \
         allow for them"
    };
    Err(file.error_at(&request.place, message).into())
}

/// Plans the filters and their tests.
struct Planner<'a> {
    file: &'a PlantFile<'a>,
    request: &'a DetectionRequest,
    problem: &'a Problem,
    errors: Option<&'a ModelErrors<'a>>,
}

impl<'a> Planner<'a> {
    /// Plans one filter and test for each fault with isolation. Without isolation there is one filter, with a CUSUM
    /// test for each fault or one chi-square test for all.
    fn parts(&self) -> Result<Vec<Part<'a>>, crate::Error> {
        let Self { file, request, problem, .. } = *self;
        let q = problem.faults.len();
        let base = problem.base(file)?;
        let shifts = base.shifts(file)?;
        let refuse = |error: control::Error| file.error_at(&request.place, error.to_string());
        if request.isolation {
            let part = |fault: usize| {
                let others: Vec<usize> = (1..q).map(|k| (fault + k) % q).collect();
                let decoupling = base.isolating(fault, &others, shifts[fault]);
                let decoupling = decoupling.map_err(refuse)?;
                let test = self.plan(&decoupling, &[fault], q)?;
                let reacts = reacting(&decoupling, &test, fault).map_err(refuse)?;
                Ok(Part { decoupling, tests: vec![PlannedTest { reacts, ..test }] })
            };
            return (0..q).map(part).collect();
        }
        let groups: Vec<Vec<usize>> = match request.method {
            Method::Cusum => (0..q).map(|fault| vec![fault]).collect(),
            Method::ChiSquare { .. } => vec![(0..q).collect()],
        };
        let count = groups.len();
        let tests = groups.iter().map(|group| self.plan(&base, group, count));
        let tests = tests.collect::<Result<_, crate::Error>>()?;
        Ok(vec![Part { decoupling: base, tests }])
    }

    /// Plans the test for some faults, one of `count` tests that share the rate of false alarms.
    fn plan(
        &self,
        decoupling: &Decoupling<'_>,
        faults: &[usize],
        count: usize,
    ) -> Result<PlannedTest, crate::Error> {
        let Self { file, request, problem, errors } = *self;
        let bias = |rows: &DMatrix<f64>| match errors {
            Some(errors) => errors.largest_mean(decoupling, rows),
            None => Ok(LargestMean { mean: 0.0, interior_excess: None }),
        };
        #[expect(clippy::cast_precision_loss, reason = "a number of faults")]
        let samples = request.false_alarm_interval * count as f64 / problem.period;
        let refuse = |error: control::Error| {
            let message = match error {
                control::Error::OutOfRange { value, rule, .. }
                    if value.to_bits() == samples.to_bits() =>
                {
                    format!(
                        "`false_alarm_interval` or `false_alarms_per_hour`: a false alarm every {} s is one every {} \
                         samples of each test, expected {rule}",
                        rounded(request.false_alarm_interval),
                        rounded(samples),
                    )
                }
                error => error.to_string(),
            };
            file.error_at(&request.place, message)
        };
        let name = match faults {
            [fault] => problem.names[problem.fault_at(*fault)].clone(),
            _ => "all".to_owned(),
        };
        let reacts = vec![true; problem.faults.len()];
        let rows = decoupling.filter.generator.c.nrows();
        match request.method {
            Method::Cusum => {
                let mean = decoupling.steady_mean(problem.fault_at(faults[0]));
                let mean = mean.map_err(refuse)?;
                let drift = (0.5 * mean.norm()).min(LARGEST_DRIFT);
                let mut test = Cusum::with_false_alarms(drift, samples).map_err(refuse)?;
                let direction = mean.normalize().transpose();
                let rows = DMatrix::from_row_slice(1, direction.len(), direction.as_slice());
                let LargestMean { mean: bias, interior_excess } = bias(&rows)?;
                // With this drift, a mean of up to the bias does not make false alarms more frequent.
                test.drift += bias;
                let kind = TestKind::Cusum(test);
                Ok(PlannedTest { name, rows, kind, bias, interior_excess, reacts })
            }
            Method::ChiSquare { window } => {
                let means = |&fault: &usize| decoupling.means(problem.fault_at(fault));
                let means: Result<Vec<_>, _> = faults.iter().map(means).collect();
                let means = means.map_err(refuse)?;
                let count = u32::try_from(rows).unwrap_or(u32::MAX);
                let rows = DMatrix::identity(rows, rows);
                let LargestMean { mean: bias, interior_excess } = bias(&rows)?;
                let test = match window {
                    Some(window) => {
                        let samples_of_window = prediction::whole(window / problem.period).max(1);
                        WindowTest::with_false_alarms(count, samples_of_window, samples, bias)
                    }
                    None => prediction::best_window(count, samples, bias, &means),
                };
                let kind = TestKind::Window(test.map_err(refuse)?);
                Ok(PlannedTest { name, rows, kind, bias, interior_excess, reacts })
            }
        }
    }
}

/// Returns for each fault whether the test for the fault `tested` reacts to this fault.
fn reacting(
    decoupling: &Decoupling<'_>,
    test: &PlannedTest,
    tested: usize,
) -> Result<Vec<bool>, control::Error> {
    let problem = decoupling.problem;
    let peak = |fault: usize| {
        let means = decoupling.means(problem.fault_at(fault))?;
        Ok(largest(&(&test.rows * means)))
    };
    let least = INSENSITIVE * peak(tested)?;
    (0..problem.faults.len())
        .map(|fault| {
            Ok(!decoupling.has(problem.fault_at(fault))
                && (fault == tested || peak(fault)? > least))
        })
        .collect()
}

/// Returns the largest norm of a column.
fn largest(means: &DMatrix<f64>) -> f64 {
    means.column_iter().map(|column| column.norm()).fold(0.0, f64::max)
}

/// Returns all tests, each with the residual filter that feeds it.
fn tests<'a>(parts: &'a [Part<'a>]) -> impl Iterator<Item = (&'a Decoupling<'a>, &'a PlannedTest)> {
    parts.iter().flat_map(|part| part.tests.iter().map(|test| (&part.decoupling, test)))
}

fn report(
    request: &DetectionRequest,
    problem: &Problem,
    parts: &[Part<'_>],
    parameter_cases: Option<ParameterCases>,
    warnings: &mut Vec<String>,
) -> Result<Report, control::Error> {
    let q = problem.faults.len();
    let mut structure = DMatrix::zeros(tests(parts).count(), q);
    for (at, (decoupling, test)) in tests(parts).enumerate() {
        for fault in 0..q {
            let means = decoupling.means(problem.fault_at(fault))?;
            structure[(at, fault)] = largest(&(&test.rows * means));
        }
    }
    let reported = tests(parts).map(|(decoupling, test)| test_report(decoupling, test));
    let reported = reported.collect::<Result<Vec<_>, _>>()?;
    let within = request.delay.unwrap_or(10.0 / problem.rate);
    let faults = (0..q).map(|fault| fault_report(problem, parts, fault, within));
    let reacts: Vec<Vec<bool>> = tests(parts).map(|(_, test)| test.reacts.clone()).collect();
    let confused = if request.isolation { confused(&reacts, problem) } else { Vec::new() };
    let faults = faults.collect::<Result<Vec<_>, _>>()?;
    warn(&reported, &confused, warnings);
    warn_of_hidden(&reported, &faults, warnings);
    let rate: f64 = reported.iter().map(|test| 1.0 / test.false_alarm_interval).sum();
    Ok(Report {
        method: match request.method {
            Method::Cusum => "cusum",
            Method::ChiSquare { .. } => "chi-square",
        }
        .to_owned(),
        sample_time: problem.period,
        from: if let Some(from) = request.from {
            from
        } else {
            let decays = parts.iter().map(|part| part.decoupling.decay());
            SETTLING
                / decays.collect::<Result<Vec<_>, _>>()?.into_iter().fold(f64::INFINITY, f64::min)
        },
        false_alarm_interval: 1.0 / rate,
        noise: request.noise.clone(),
        process_noise: problem.origin_of_process_noise.clone(),
        structure: matrix(
            "structure",
            "largest mean of the residuals, in standard deviations",
            &structure,
            &reported.iter().map(|test| test.name.clone()).collect::<Vec<_>>(),
            &problem.names[problem.fault_at(0)..],
        ),
        tests: reported,
        faults,
        reacts,
        confused,
        parameter_cases,
    })
}

fn test_report(decoupling: &Decoupling<'_>, test: &PlannedTest) -> Result<Test, control::Error> {
    let problem = decoupling.problem;
    let decoupled = |&(input, exact): &(usize, bool)| {
        let means = decoupling.means(input)?;
        Ok(DecoupledInput {
            name: problem.names[input].clone(),
            exact,
            size: problem.sizes[input],
            largest_mean: largest(&(&test.rows * means)),
        })
    };
    Ok(Test {
        name: test.name.clone(),
        residuals: test.rows.nrows(),
        drift: test.kind.drift(),
        window: test.kind.window(),
        model_error: test.bias,
        interior_excess: test.interior_excess,
        threshold: test.kind.threshold(),
        false_alarm_interval: test.kind.between_false_alarms(test.bias) * problem.period,
        decoupled: decoupling.inputs.iter().map(decoupled).collect::<Result<_, _>>()?,
    })
}

/// Predicts the detection of a fault by its own test, or by the only test if there is one for all faults.
fn fault_report(
    problem: &Problem,
    parts: &[Part<'_>],
    fault: usize,
    within: f64,
) -> Result<DetectedFault, control::Error> {
    let (input, period) = (problem.fault_at(fault), problem.period);
    let name = &problem.names[input];
    let tests: Vec<_> = tests(parts).collect();
    let (decoupling, test) = tests[if tests.len() == 1 { 0 } else { fault }];
    let means = &test.rows * decoupling.means(input)?;
    let prediction = Prediction { kind: &test.kind, means: &means, period };
    let delay = prediction.delay(1.0);
    let size = problem.sizes[input].unwrap_or(1.0);
    Ok(DetectedFault {
        fault: name.clone(),
        unit: problem.units[fault].clone(),
        size,
        test: test.name.clone(),
        mean: (&test.rows * decoupling.steady_mean(input)?).norm(),
        // On average a fault starts half a sample before the first sample that shows it.
        delay: delay.mean().map(|samples| (samples - 0.5) * period),
        #[expect(clippy::cast_precision_loss, reason = "numbers of samples")]
        delay_90: delay.quantile(0.9).map(|samples| samples as f64 * period),
        within,
        least: prediction.least(within).map(|factor| factor * size),
    })
}

/// Warns of faults that no test tells apart, of parameters whose worst values are inside their limits, and of
/// disturbances that are decoupled only while they are constant.
fn warn(tests: &[Test], confused: &[Vec<String>], warnings: &mut Vec<String>) {
    for group in confused {
        warnings.push(format!(
            "the residuals cannot tell the faults {} apart; `fault_isolated` is -1 for them",
            group.join(", ")
        ));
    }
    for test in tests {
        if let Some(excess) = test.interior_excess.filter(|excess| *excess > NOTICEABLE) {
            let allowance = if test.drift.is_some() { "drift" } else { "threshold" };
            warnings.push(format!(
                "parameters within their limits give the test {} means that are up to {:.1} % larger than at the \
                 corners of the limits; its {allowance} allows for the largest that was found",
                test.name,
                100.0 * excess
            ));
        }
        for input in test.decoupled.iter().filter(|input| !input.exact) {
            warnings.push(format!(
                "{} acts on the residual of the test {} while it changes: its step of {} moves the mean by \
                 up to {:.3} standard deviations; a constant one does not",
                input.name,
                test.name,
                input.size.unwrap_or(1.0),
                input.largest_mean
            ));
        }
    }
}

/// Warns of faults that model errors may hide at their stated size.
fn warn_of_hidden(tests: &[Test], faults: &[DetectedFault], warnings: &mut Vec<String>) {
    for fault in faults.iter().filter(|fault| fault.delay.is_none()) {
        let hides = |test: &&Test| test.name == fault.test && test.model_error > 0.0;
        if let Some(test) = tests.iter().find(hides) {
            warnings.push(format!(
                "{} of {} moves the mean of its residuals by {:.3} standard deviations, errors of the model by \
                 up to {:.3}: it may stay undetected; smaller tolerances in [robustness] or smaller `commands` \
                 help",
                fault.fault, fault.size, fault.mean, test.model_error
            ));
        }
    }
}

/// Returns the groups of two or more faults to which the same tests react.
fn confused(reacts: &[Vec<bool>], problem: &Problem) -> Vec<Vec<String>> {
    let signature = |fault: usize| reacts.iter().map(|test| test[fault]).collect::<Vec<_>>();
    let q = problem.faults.len();
    let mut groups = Vec::new();
    for fault in 0..q {
        let same: Vec<usize> =
            (0..q).filter(|&other| signature(other) == signature(fault)).collect();
        if same.len() > 1 && same[0] == fault {
            let name = |&fault: &usize| problem.names[problem.fault_at(fault)].clone();
            groups.push(same.iter().map(name).collect());
        }
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A CUSUM test has a drift, a test of windows has none.
    #[test]
    fn a_warning_names_what_allows_for_errors_of_the_model() {
        for (drift, window, part) in [
            (Some(1.5), None, "; its drift allows for the largest"),
            (None, Some(8), "; its threshold allows for the largest"),
        ] {
            let test = Test { drift, window, interior_excess: Some(0.1), ..Test::default() };
            let mut warnings = Vec::new();
            warn(&[test], &[], &mut warnings);
            assert!(warnings.len() == 1 && warnings[0].contains(part), "{warnings:?}");
        }
    }
}
