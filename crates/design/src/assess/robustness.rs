//! Analyses the robustness of a design and judges it.

mod delays;
mod noise;
mod proof;
mod tolerances;

pub(crate) use delays::reasons as delay_reasons;
pub(crate) use noise::noise_peaks;
pub(crate) use tolerances::by_entries;

use control::aso::Gains;
use control::controller::CompleteController;
use control::response::{frequency_grid, h_infinity};
use control::robustness::{
    DiskMargin, Loop, OpenedLoop, Point, SensitivityPeak, Tolerances, longest_hold, longest_period,
    peak_derivatives, regulator_of_same_speed, sampled_channel_delay,
};
use control::tracking::IntegralAction;
use control::{Domain, Error, StateSpace};
use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::assess::analysis::frequency;
use crate::assess::matrices::of_plant;
use crate::budget::{Budget, TimeLimits};
use crate::plant::linear::LinearPlant;
use crate::plant::parameters::ParameterFamily;
use crate::progress::{Step, Steps};
use crate::report::number::rounded;
use crate::report::robustness::{
    Channel, Compared, Disk, Level, LoopPoint, Number, PeakSensitivity, Robustness,
};
use crate::report::{Frequency, Matrix};
use crate::solve::solution::{Solution, looped};
use plant_file::robustness::RobustnessLimits;
use plant_file::signals::{Signal, same_unit};

const WIDTH: f64 = 1e-4;
const POINTS_PER_DECADE: u32 = 20;
const POINTS: [(Point, &str); 2] = [(Point::Input, "input"), (Point::Output, "output")];

/// A longest hold below this part of the delay margin is a reason of the verdict.
const SHORT_HOLD: f64 = 0.01;

/// Returns the loop of a design: the plant, and the controller with its filter and its integrals.
pub(crate) fn loop_of(designed: &Solution) -> Result<Loop, Error> {
    let physical = Physical::of(designed)?;
    physical.closed(&physical.controller)
}

/// Returns the robustness of a design, None if the loop is not stable, and the time for certificates, whose clock
/// starts with the proof for the tolerances. `family`: the FMU whose parameters vary; None if the entries of the
/// matrices vary.
pub(crate) fn robustness(
    designed: &Solution,
    limits: &RobustnessLimits,
    family: Option<&ParameterFamily<'_>>,
    time: &TimeLimits,
    steps: &Steps<'_>,
) -> Result<(Option<Robustness>, Budget), crate::Error> {
    if designed.instability >= 0.0 {
        return Ok((None, time.of_certificates()));
    }
    let physical = Physical::of(designed)?;
    let closed_loop = physical.closed(&physical.controller)?;
    let Margins { points, delay, hold, noise, noise_together } =
        steps.run(Step::Margins, || margins(designed, &physical, &closed_loop, limits))?;
    let slopes = slopes(&designed.linear, &physical, &points)?;
    let ((comparison, curves), tolerance) = rayon::join(
        || {
            let comparison = || comparison(designed, &physical, &points);
            rayon::join(|| steps.run(Step::Comparison, comparison), || curves(&closed_loop))
        },
        || {
            steps.run(Step::Tolerances, || match family {
                None => by_entries(&designed.linear, &physical, limits),
                Some(family) => {
                    tolerances::by_parameters(designed, &physical, limits, family, &slopes)
                }
            })
        },
    );
    let (comparison, curves, tolerance) = (comparison?, curves?, tolerance?);
    let budget = time.of_certificates();
    let tolerance_proof =
        proof::of_entries(&designed.linear, &physical, limits, &tolerance, &budget);
    let robustness = Robustness {
        delays: delays::exact(designed, &closed_loop, &points)?,
        comparison,
        tolerance,
        tolerance_proof,
        curves,
        sensitivity: sensitivity(designed, &slopes),
        points,
        delay_margin: delay,
        longest_hold: hold,
        noise_of_measurements: limits.noise.clone(),
        noise,
        noise_together,
    };
    Ok((Some(robustness), budget))
}

/// Returns the reason that a short hold adds to the verdict on a continuous design: the delay margin does not see what
/// held signals do to the fast modes of a controller.
pub(crate) fn hold_reason(designed: &Solution, robustness: &Robustness) -> Option<(Level, String)> {
    let Robustness { longest_hold: hold, delay_margin: delay, .. } = *robustness;
    let is_short = designed.domain == Domain::Continuous && hold < SHORT_HOLD * delay;
    (is_short && delay.is_finite()).then(|| {
        let (hold, delay) = (rounded(hold), rounded(delay));
        let help = "a slower observer, a lower loop.effort or a sample_time helps";
        let text = format!(
            "plant and controller may hold their signals for {hold} s at most, although the delay margin is {delay} s: \
             the controller is much faster than its loop (amber); {help}"
        );
        (Level::Amber, text)
    })
}

/// The margins of a loop, and the effect of measurement noise in it.
pub(crate) struct Margins {
    pub(crate) points: Vec<LoopPoint>,
    /// Delay margin and longest hold, s; the longest hold is NaN for a plant that is known in its samples only.
    pub(crate) delay: f64,
    pub(crate) hold: f64,
    pub(crate) noise: Matrix,
    pub(crate) noise_together: Vec<Number>,
}

/// Returns the margins of `closed_loop`, the stable loop of the controller and `physical`.
pub(crate) fn margins(
    designed: &Solution,
    physical: &Physical,
    closed_loop: &Loop,
    limits: &RobustnessLimits,
) -> Result<Margins, crate::Error> {
    let opened = POINTS.into_par_iter().map(|(at, _)| OpenedLoop::new(closed_loop, at));
    let opened = opened.collect::<Result<Vec<_>, Error>>()?;
    let LinearPlant { actuators, measurements, .. } = &designed.linear;
    let point = |(opened, (at, name)): (&OpenedLoop, (Point, &str))| {
        point(opened, name, signals_at(at, actuators, measurements))
    };
    let Physical { plant, controller, .. } = physical;
    let at_input = &opened[0];
    let (points, (delay, hold)) = rayon::join(
        || opened.par_iter().zip(POINTS).map(point).collect::<Result<Vec<_>, Error>>(),
        || match designed.domain {
            Domain::Continuous => {
                rayon::join(|| at_input.delay_margin(), || longest_hold(closed_loop))
            }
            Domain::Sampled { .. } => rayon::join(
                || at_input.sampled_delay_margin(plant, controller),
                || match plant.domain {
                    Domain::Continuous => longest_period(plant, controller),
                    Domain::Sampled { .. } => Ok(f64::NAN),
                },
            ),
        },
    );
    let (mut points, delay, hold) = (points?, delay?, hold?);
    refine_delays(&mut points, plant, controller)?;
    let (noise, noise_together) = noise::noise(designed, closed_loop, &physical.estimates, limits)?;
    Ok(Margins { points, delay, hold, noise, noise_together })
}

/// Returns the margins of a loop opened at its `inputs` and at its `outputs`.
pub(crate) fn loop_points(
    closed_loop: &Loop,
    inputs: &[Signal],
    outputs: &[Signal],
) -> Result<Vec<LoopPoint>, Error> {
    let point = |(at, name): (Point, &str)| {
        point(&OpenedLoop::new(closed_loop, at)?, name, signals_at(at, inputs, outputs))
    };
    POINTS.into_par_iter().map(point).collect()
}

/// Replaces the delay margins of the channels of a sampled loop, which are those of whole samples, by those of all
/// delays.
pub(crate) fn refine_delays(
    points: &mut [LoopPoint],
    plant: &StateSpace,
    controller: &StateSpace,
) -> Result<(), Error> {
    if controller.domain == Domain::Continuous {
        return Ok(());
    }
    points.par_iter_mut().zip(POINTS).try_for_each(|(point, (at, _))| {
        point.channels.par_iter_mut().enumerate().try_for_each(|(index, channel)| {
            channel.delay = sampled_channel_delay(plant, controller, (at, index), channel.delay)?;
            Ok::<_, Error>(())
        })
    })
}

/// Returns the signals at a point of the loop.
fn signals_at<'a>(at: Point, inputs: &'a [Signal], outputs: &'a [Signal]) -> &'a [Signal] {
    match at {
        Point::Input => inputs,
        Point::Output => outputs,
    }
}

/// The plant without filters, and the controller with its filters and integrals.
pub(crate) struct Physical {
    pub(crate) plant: StateSpace,
    pub(crate) controller: StateSpace,
    /// The controller with the estimated faults as its output.
    estimates: StateSpace,
}

impl Physical {
    pub(crate) fn of(designed: &Solution) -> Result<Self, Error> {
        Self::of_gains(designed, &designed.linear, &designed.gains)
    }

    /// Returns the plant `linear` and the controller of `designed` with `gains` in place of its own gains.
    pub(crate) fn of_gains(
        designed: &Solution,
        linear: &LinearPlant,
        gains: &Gains,
    ) -> Result<Self, Error> {
        let plant = linear.judged()?;
        let CompleteController { commands, estimates } = designed.complete(gains)?;
        let channels: Vec<_> =
            designed.extended.channels.iter().map(|channel| channel.estimate).collect();
        let estimates = StateSpace {
            c: estimates.c.select_rows(&channels),
            d: estimates.d.select_rows(&channels),
            ..estimates
        };
        Ok(Self { plant, controller: commands, estimates })
    }

    /// The loop of the plant and `controller`, in the time domain of the controller.
    pub(crate) fn closed(&self, controller: &StateSpace) -> Result<Loop, Error> {
        looped(&self.plant, controller)
    }
}

fn point(opened: &OpenedLoop, name: &str, signals: &[Signal]) -> Result<LoopPoint, Error> {
    let channel = |(index, signal): (usize, &Signal)| {
        let margins = || opened.channel_margins(index);
        let (result, disk) = rayon::join(margins, || opened.disk_margin(Some(index)));
        let margins = result?;
        Ok(Channel {
            name: signal.name.clone(),
            gain: margins.gain,
            phase: margins.phase.to_degrees(),
            delay: margins.delay,
            disk: self::disk(&disk?),
        })
    };
    let s = opened.sensitivity_peak();
    let ((t, scaled), (together, channels)) = rayon::join(
        || rayon::join(|| opened.complementary_peak(), || opened.scaled_peak()),
        || {
            let channels = || signals.par_iter().enumerate().map(channel).collect();
            rayon::join(|| opened.disk_margin(None), channels)
        },
    );
    let (t, scaled) = (t?, scaled?);
    let channels: Result<Vec<_>, Error> = channels;
    let same_unit = same_unit(signals);
    Ok(LoopPoint {
        point: name.to_owned(),
        s_peak: s.lower,
        s_frequency: s.frequency,
        t_peak: t.lower,
        t_frequency: t.frequency,
        s_peak_scaled: scaled.value,
        judged: if same_unit { s.lower } else { scaled.value },
        judged_frequency: if same_unit { s.frequency } else { scaled.frequency },
        together: disk(&together?),
        channels: channels?,
    })
}

/// Returns for each point of the loop the derivatives of its judged peak with respect to the entries of A, B, C and D.
fn slopes(
    linear: &LinearPlant,
    physical: &Physical,
    points: &[LoopPoint],
) -> Result<Vec<[DMatrix<f64>; 4]>, Error> {
    let one = |((point, _), loop_point): ((Point, &str), &LoopPoint)| {
        let signals = signals_at(point, &linear.actuators, &linear.measurements);
        let frequency = loop_point.judged_frequency;
        let peak = SensitivityPeak { point, frequency, scaled: !same_unit(signals) };
        let slopes = peak_derivatives(&physical.plant, &physical.controller, &peak)?;
        Ok([slopes.a, slopes.b, slopes.c, slopes.d])
    };
    POINTS.into_iter().zip(points).map(one).collect()
}

/// Returns how the judged peaks depend on the entries of the plant.
fn sensitivity(designed: &Solution, slopes: &[[DMatrix<f64>; 4]]) -> Vec<PeakSensitivity> {
    let linear = &designed.linear;
    let plant = &linear.undelayed;
    let one = |((_, name), slopes): ((Point, &str), &[DMatrix<f64>; 4])| {
        let [to_a, to_b, to_c, to_d] = &linear.of_plant(slopes);
        // 1 for the entries that are not structural, 0 for the others.
        let [in_a, in_b, in_c, in_d] = Tolerances::unless_structural(plant, [1.0; 4]).of;
        let meaning = "entry times derivative of the peak of S";
        let times = |varied: DMatrix<f64>, values: &DMatrix<f64>, slopes: &DMatrix<f64>| {
            varied.component_mul(values).component_mul(slopes)
        };
        let effects = [
            times(in_a, &plant.a, to_a),
            times(in_b, &plant.b, to_b),
            times(in_c, &plant.c, to_c),
            times(in_d, &plant.d, to_d),
        ];
        PeakSensitivity { point: name.to_owned(), matrices: of_plant(linear, meaning, &effects) }
    };
    POINTS.into_iter().zip(slopes).map(one).collect()
}

fn disk(margin: &DiskMargin) -> Disk {
    Disk {
        alpha: margin.alpha,
        certified: margin.certified,
        frequency: margin.frequency,
        gain: margin.gains(),
        phase: margin.phase().to_degrees(),
    }
}

/// Returns the norms of the gains, and the peaks of S, beside the values of a linear-quadratic design of the same
/// speed, if there is one.
fn comparison(
    designed: &Solution,
    physical: &Physical,
    points: &[LoopPoint],
) -> Result<Vec<Compared>, Error> {
    let Solution { plant, gains, domain, extended, .. } = designed;
    let n = extended.states;
    let ((a, b), k) = (&designed.feedback_pair, &designed.feedback.gain);
    let a_0 = plant.augmented_dynamics();
    let output = gains.estimator.output_matrix(&a_0, &plant.augmented_output());
    let l = gains.observer_gain();
    let dual = (-&l).transpose();
    // A law with its own model of the fault has no Kalman filter of the same kind.
    let observer = || match designed.law.a_f {
        None => regulator_of_same_speed(&a_0.transpose(), &output.transpose(), &dual, *domain),
        Some(_) => Ok(None),
    };
    let (feedback, observer) = rayon::join(|| regulator_of_same_speed(a, b, k, *domain), observer);
    let (feedback, observer) = (feedback?, observer?.map(|gain| -gain.transpose()));
    let mut alternatives = vec![
        Compared {
            name: match gains.integral {
                None => "norm of K_x".to_owned(),
                Some(_) => "norm of [K_x, K_i]".to_owned(),
            },
            design: norm(k),
            linear_quadratic: feedback.as_ref().map(norm),
        },
        Compared {
            name: "norm of L".to_owned(),
            design: norm(&l),
            linear_quadratic: observer.as_ref().map(norm),
        },
    ];
    let other = match (feedback, observer) {
        (Some(feedback), Some(observer)) => {
            let all = plant.a.nrows();
            let other = Gains {
                k_x: feedback.columns(0, n).into_owned().resize_horizontally(all, 0.0),
                integral: gains.integral.clone().map(|action| IntegralAction {
                    gain: feedback.columns(n, action.gain.ncols()).into(),
                    ..action
                }),
                l_x: observer.rows(0, all).into(),
                l_f: -observer.rows(all, plant.f_a.ncols()),
                p_f: None,
                ..gains.clone()
            };
            Some(physical.closed(&designed.complete(&other)?.commands)?)
        }
        _ => None,
    };
    let peaks = points.par_iter().zip(POINTS).map(|(point, (at, name))| {
        let peak = |other: &Loop| h_infinity(&other.sensitivity(at), WIDTH).ok();
        Compared {
            name: format!("peak of S at the {name}"),
            design: point.s_peak,
            linear_quadratic: other.as_ref().and_then(peak).map(|norm| norm.lower),
        }
    });
    alternatives.par_extend(peaks);
    Ok(alternatives)
}

/// Returns the 2-norm.
fn norm(m: &DMatrix<f64>) -> f64 {
    (m * m.transpose()).symmetric_eigenvalues().max().max(0.0).sqrt()
}

/// Returns the singular values of S and T at both points.
fn curves(closed_loop: &Loop) -> Result<Vec<Frequency>, Error> {
    let systems = POINTS.into_iter().flat_map(|(at, name)| {
        [("S", closed_loop.sensitivity(at), name), ("T", closed_loop.complementary(at), name)]
    });
    let systems: Vec<_> = systems.collect();
    // The rank of T, a product of plant and controller; its other singular values are rounding errors.
    let rank = systems.iter().map(|(_, system, _)| system.d.nrows()).min().unwrap_or(0);
    let one = |(symbol, system, name): &(&str, StateSpace, &str)| {
        let grid = frequency_grid(system, POINTS_PER_DECADE)?;
        let mut curves = frequency(format!("{symbol} at the {name}"), system, grid);
        if let (Ok(curves), "T") = (&mut curves, *symbol) {
            curves.singular_values.truncate(rank);
        }
        curves
    };
    systems.par_iter().map(one).collect()
}
