//! The responses of the loop to steps of the references, within the limits of the commands.

use control::response::{TimeResponse, step_response};
use control::tracking::{Action, reference_system};
use control::{Domain, Error, StateSpace};
use nalgebra::DMatrix;

use crate::assess::responses::{PARTS, SETTLED, add_outputs, points};
use crate::report::number::rounded;
use crate::report::robustness::Number;
use crate::report::{Check, CommandPeak, Curve, ReferenceStep};
use crate::solve::solution::Solution;
use crate::solve::tracking::{REACHED, Tracking, TrackingAction};
use plant_file::signals::Signal;

/// The parts of a step between which the rise time is measured.
const RISE: [f64; 2] = [0.1, 0.9];

/// Returns the response to a step of each reference.
pub(crate) fn reference_steps(designed: &Solution) -> Result<Vec<ReferenceStep>, Error> {
    let Some(tracking) = &designed.tracking else { return Ok(Vec::new()) };
    let reference_loop = ReferenceLoop::of(designed, tracking)?;
    (0..tracking.signals.len()).map(|at| reference_loop.step(at)).collect()
}

/// Returns the condition that constant references are reached; None without references.
pub(crate) fn reached(steps: &[ReferenceStep]) -> Option<Check> {
    let error = steps.iter().map(|step| step.steady_state_error.abs()).reduce(f64::max)?;
    Some(Check {
        condition: "constant references are reached without error".to_owned(),
        holds: error < REACHED,
        value: Some(error),
        explanation: "what is left of a step of a reference, as a part of it".to_owned(),
    })
}

/// Returns a warning if the commands of a step that the plant file states are beyond their limits.
pub(crate) fn beyond_limits(step: &ReferenceStep) -> Option<String> {
    let [low, high] = step.largest_step;
    // The message rounds the limit to five digits: a step of this size is within the limits.
    let margin = 1e-4 * step.size.abs();
    if !step.stated || (low - margin..=high + margin).contains(&step.size) {
        return None;
    }
    let beyond = |one: &&CommandPeak| {
        one.limits.is_some_and(|limits| one.range[0] < limits[0] || one.range[1] > limits[1])
    };
    let names: Vec<_> = step.commands.iter().filter(beyond).map(|one| one.name.as_str()).collect();
    let unit = step.unit.as_ref().map_or(String::new(), |unit| format!(" {unit}"));
    Some(format!(
        "a step of {} by {}{unit} takes {} to a limit; steps from {}{unit} to {}{unit} stay within the \
         limits, larger ones respond more slowly than the report shows",
        step.reference,
        step.size,
        names.join(" and "),
        rounded(low),
        rounded(high),
    ))
}

/// The loop from the references to the signals that the responses show.
struct ReferenceLoop<'a> {
    designed: &'a Solution,
    tracking: &'a Tracking,
    /// The measurements, then the combinations of measurements that references set.
    outputs: Vec<Signal>,
    /// For each reference, the position of the output that follows the reference.
    tracked: Vec<usize>,
    /// Outputs, commands, and for a sampled loop the outputs at each time between samples.
    system: StateSpace,
}

impl<'a> ReferenceLoop<'a> {
    fn of(designed: &'a Solution, tracking: &'a Tracking) -> Result<Self, Error> {
        let linear = &designed.linear;
        let mut outputs = linear.measurements.clone();
        let mut rows = linear.c.clone();
        let mut tracked = Vec::new();
        for (at, reference) in tracking.signals.iter().enumerate() {
            let row = tracking.h.row(at);
            let single = row.iter().filter(|weight| **weight != 0.0).count() == 1;
            let measured = row.iter().position(|weight| single && (weight - 1.0).abs() == 0.0);
            tracked.push(measured.unwrap_or(outputs.len()));
            if measured.is_none() {
                let count = rows.nrows();
                rows = rows.insert_row(count, 0.0);
                rows.row_mut(count).copy_from(&tracking.output.row(at));
                let name = format!("output of {}", reference.name);
                outputs.push(Signal { name, ..reference.clone() });
            }
        }
        Ok(Self {
            designed,
            tracking,
            outputs,
            tracked,
            system: system(designed, tracking, &rows)?,
        })
    }

    /// Returns the points of an output, each a time and a value; for a sampled loop also between samples.
    fn points(&self, trace: &TimeResponse, output: usize) -> Vec<(f64, f64)> {
        let first = self.outputs.len() + self.designed.plant.b.ncols();
        let between = |part: usize| first + part * self.outputs.len() + output;
        points(self.designed, trace, |k, part| {
            Some(trace.output[(part.map_or(output, between), k)])
        })
    }

    /// Returns the response to a step of reference `at`.
    fn step(&self, at: usize) -> Result<ReferenceStep, Error> {
        let trace = step_response(&self.system, at)?;
        let stated = self.tracking.steps[at];
        let size = stated.unwrap_or(1.0);
        let tracked = self.tracked[at];
        let mut points = self.points(&trace, tracked);
        points.extend(trace.extrema(tracked));
        points.sort_by(|x, y| x.0.total_cmp(&y.0));
        let peak = points.iter().map(|point| point.1).fold(0.0, f64::max);
        let mut curves = Vec::new();
        let mut others = Vec::new();
        for (row, output) in self.outputs.iter().enumerate() {
            let curve = self.curve(&trace, row, size, output);
            if row != tracked {
                let (name, unit) = (output.name.clone(), output.unit.clone());
                others.push(Number { name, unit, value: curve.peak.abs() });
            }
            curves.push(curve);
        }
        curves[..=tracked].rotate_right(1);
        let linear = &self.designed.linear;
        let mut commands = Vec::new();
        for (k, actuator) in linear.actuators.iter().enumerate() {
            let row = self.outputs.len() + k;
            let name = format!("command {}", actuator.name);
            let curve = self.curve(&trace, row, size, &Signal { name, ..actuator.clone() });
            let values = curve.values.iter().chain([&curve.peak]);
            let range =
                values.fold([0.0_f64; 2], |[low, high], value| [low.min(*value), high.max(*value)]);
            let operating = actuator.operating.unwrap_or(0.0);
            commands.push(CommandPeak {
                name: actuator.name.clone(),
                unit: actuator.unit.clone(),
                range,
                limits: actuator.limits.map(|limits| limits.map(|limit| limit - operating)),
                final_value: size * trace.final_value[row],
            });
            curves.push(curve);
        }
        Ok(ReferenceStep {
            reference: self.tracking.signals[at].name.clone(),
            unit: self.tracking.signals[at].unit.clone(),
            size,
            stated: stated.is_some(),
            rise_time: rise_time(&points),
            overshoot: (peak - 1.0).max(0.0),
            settling_time: settled(&points),
            steady_state_error: 1.0 - trace.final_value[tracked],
            largest_step: largest_step(&commands, size),
            commands,
            others,
            curves,
        })
    }

    /// Returns the response to a step of `size` from `trace`, the response to a step of 1. `row`: a row of `system`, an
    /// output (of a sampled loop also between samples) or a command. `output`: its name and unit.
    fn curve(&self, trace: &TimeResponse, row: usize, size: f64, output: &Signal) -> Curve {
        let points = if row < self.outputs.len() {
            self.points(trace, row)
        } else {
            trace.time.iter().zip(trace.output.row(row).iter()).map(|(t, z)| (*t, *z)).collect()
        };
        let transient = trace.transient(row, SETTLED);
        let largest = points.iter().fold((transient.peak_time, transient.peak), |best, point| {
            if point.1.abs() > best.1.abs() { *point } else { best }
        });
        Curve {
            name: output.name.clone(),
            unit: output.unit.clone(),
            peak: size * largest.1,
            peak_time: largest.0,
            settling_time: transient.settling_time,
            times: points.iter().map(|point| point.0).collect(),
            values: points.iter().map(|point| size * point.1).collect(),
        }
    }
}

/// Returns the loop from the references to `rows` times the states, then the commands, then for a sampled loop `rows`
/// times the states at each time between samples.
fn system(
    designed: &Solution,
    tracking: &Tracking,
    rows: &DMatrix<f64>,
) -> Result<StateSpace, Error> {
    let (n, m) = designed.linear.b.shape();
    let a = designed.plant.a.view((0, 0), (n, n)).into_owned();
    let b = designed.plant.b.rows(0, n).into_owned();
    let k_x = designed.gains.k_x.columns(0, n).into_owned();
    let action = match (&designed.gains.integral, &tracking.action) {
        (Some(integral), _) => Action::Integral {
            output: &tracking.output,
            gain: &integral.gain,
            feedforward: tracking.feedforward(),
        },
        (None, TrackingAction::Feedforward(n_r)) => Action::Feedforward(n_r),
        (None, TrackingAction::Integral { .. }) => {
            return Err(Error::Empty { matrix: "K_i", actual: (0, 0) });
        }
    };
    let whole = reference_system(&a, &b, &k_x, &action, designed.domain)?;
    let (states, commands) = (whole.c.rows(0, n).into_owned(), whole.c.rows(n, m).into_owned());
    let direct = whole.d.rows(n, m).into_owned();
    let mut system =
        StateSpace { c: rows * &states, d: DMatrix::zeros(rows.nrows(), direct.ncols()), ..whole };
    add_outputs(&mut system, &commands, &direct);
    if let Domain::Sampled { period } = designed.domain {
        let linear = &designed.linear;
        for time in linear.times_between(period, PARTS) {
            let (phi, gamma) = linear.held(&linear.b, time)?;
            let later = rows * (phi * &states + &gamma * &commands);
            add_outputs(&mut system, &later, &(rows * gamma * &direct));
        }
    }
    Ok(system)
}

/// Returns the time from 10 % to 90 % of the step; None if 90 % is not reached.
fn rise_time(points: &[(f64, f64)]) -> Option<f64> {
    let [from, to] = RISE.map(|level| reaches(points, level));
    Some(to? - from?)
}

/// Returns the first time at which a value reaches `level`, by linear interpolation; None if `level` is not reached.
fn reaches(points: &[(f64, f64)], level: f64) -> Option<f64> {
    let at = points.iter().position(|point| point.1 >= level)?;
    let (time, value) = points[at];
    let Some((before, low)) = at.checked_sub(1).map(|at| points[at]) else { return Some(time) };
    Some(before + (level - low) / (value - low) * (time - before))
}

/// Returns the time after which the points stay within the band around one; infinite if the last point is outside.
fn settled(points: &[(f64, f64)]) -> f64 {
    let outside = |point: &(f64, f64)| (point.1 - 1.0).abs() > SETTLED;
    let Some(last) = points.iter().rposition(outside) else { return 0.0 };
    let (time, value) = points[last];
    let Some((after, inside)) = points.get(last + 1) else { return f64::INFINITY };
    let edge = if value > 1.0 { 1.0 + SETTLED } else { 1.0 - SETTLED };
    time + ((edge - value) / (inside - value)).clamp(0.0, 1.0) * (after - time)
}

/// Returns the largest negative and positive step within the limits, infinite without limits, from the commands of a
/// step of `size`.
fn largest_step(commands: &[CommandPeak], size: f64) -> [f64; 2] {
    let mut sizes = [f64::NEG_INFINITY, f64::INFINITY];
    for command in commands {
        let Some([low, high]) = command.limits else { continue };
        for extreme in command.range.into_iter().map(|value| value / size).filter(|x| *x != 0.0) {
            let ends = if extreme > 0.0 { [low, high] } else { [high, low] };
            sizes[0] = sizes[0].max(ends[0] / extreme);
            sizes[1] = sizes[1].min(ends[1] / extreme);
        }
    }
    sizes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_steps_take_the_first_command_to_its_limit() {
        let command = |range, limits| CommandPeak { range, limits, ..CommandPeak::default() };
        let limits = |command, size| largest_step(&[command], size).map(|limit| format!("{limit}"));
        let free = command([-9.0, 9.0], None);
        assert_eq!(limits(free, 2.0), ["-inf", "inf"]);
        // A step of 2 moves u from -1 to 4; per unit -0.5 to 2.
        let one = command([-1.0, 4.0], Some([-3.0, 8.0]));
        assert_eq!(limits(one, 2.0), ["-1.5", "4"]);
        // A step of -2 moves u from -4 to 1; per unit -0.5 to 2, too.
        let one = command([-4.0, 1.0], Some([-3.0, 8.0]));
        assert_eq!(limits(one, -2.0), ["-1.5", "4"]);
    }

    #[test]
    fn the_warning_of_a_step_beyond_small_limits_has_their_digits() {
        let step = ReferenceStep {
            reference: "r".to_owned(),
            unit: Some("m".to_owned()),
            size: 2.5e-5,
            stated: true,
            largest_step: [-1.25e-5, 1.25e-5],
            ..ReferenceStep::default()
        };
        let warning = beyond_limits(&step).unwrap();
        assert!(warning.contains("steps from -1.25e-5 m to 1.25e-5 m stay"), "{warning}");
    }

    #[test]
    fn a_step_of_the_size_that_the_warning_states_is_within_the_limits() {
        let step = |size| {
            let largest_step = [-0.395_175_2, 0.395_175_2];
            ReferenceStep { size, stated: true, largest_step, ..ReferenceStep::default() }
        };
        let warning = beyond_limits(&step(0.5)).unwrap();
        assert!(warning.contains("steps from -0.39518 to 0.39518 stay"), "{warning}");
        assert_eq!(beyond_limits(&step(0.39518)), None);
        assert!(beyond_limits(&step(-0.3953)).is_some());
    }

    #[test]
    fn rise_and_settling_times_are_interpolated() {
        let points = [(0.0, 0.0), (1.0, 0.5), (2.0, 1.1), (3.0, 1.01), (4.0, 1.0)];
        let rise = rise_time(&points).unwrap();
        assert!((rise - (1.0 + 0.4 / 0.6 - 0.2)).abs() < 1e-12, "{rise}");
        assert!((settled(&points) - (2.0 + 0.08 / 0.09)).abs() < 1e-12);
        assert_eq!(rise_time(&points[..2]), None);
        assert!(settled(&points[..3]).is_infinite());
    }
}
