//! The responses of the compensated loop to changes of the faults.

use control::response::{TimeResponse, fault_system, ramp_response, step_response};
use control::{Domain, Error, StateSpace};
use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::assess::analysis::{Output, outputs};
use crate::report::robustness::Number;
use crate::report::{Curve, StepResponse};
use crate::solve::solution::Solution;
use control::blocks::{beside, stacked};
use plant_file::faults::Fault;

/// Relative band of the settling time: a response has settled when its distance from the final value stays within this
/// fraction of the largest one.
pub(crate) const SETTLED: f64 = 0.02;
/// Number of parts of a sample time, between which points are shown besides the samples.
pub(crate) const PARTS: u32 = 5;
/// Number of parts of the logarithmic time axis; in each part a curve has at most four points. The second number is for
/// loops with at least [`LARGE`] states.
const MOST: [usize; 2] = [1000, 250];
const LARGE: usize = 48;

/// Returns the responses to a change of each fault, as a step and, if its rate has a bound, as a ramp of this rate; and
/// with several faults to steps of all together.
pub(crate) fn responses(designed: &Solution) -> Result<Vec<StepResponse>, Error> {
    let shown = ShownLoop::of(designed)?;
    let faults = &designed.linear.faults;
    let changes = faults.iter().zip(&designed.extended.channels).flat_map(|(fault, channel)| {
        let rates = std::iter::once(None).chain(fault.rate_bound.map(Some));
        rates.map(move |rate| (fault, channel.estimate, rate))
    });
    let changes: Vec<_> = changes.collect();
    let one = |&(fault, input, rate): &(&Fault, usize, Option<f64>)| {
        let size = size(fault);
        let trace = match rate {
            None => step_response(&shown.system, input)?,
            Some(rate) => ramp_response(&shown.system, input, size / rate)?,
        };
        Ok(StepResponse {
            fault: fault.name.clone(),
            unit: fault.unit.clone(),
            size,
            rate,
            parts: vec![part(fault)],
            curves: shown.curves(&trace, size),
        })
    };
    let together = || {
        let names: Vec<_> = faults.iter().map(|fault| fault.name.as_str()).collect();
        Ok::<_, Error>(StepResponse {
            fault: names.join(" and "),
            unit: None,
            size: 1.0,
            rate: None,
            parts: faults.iter().map(part).collect(),
            curves: shown.curves(&step_response(&shown.together(), 0)?, 1.0),
        })
    };
    let (all, last) = rayon::join(
        || changes.par_iter().map(one).collect::<Result<Vec<_>, Error>>(),
        || (faults.len() > 1).then(together).transpose(),
    );
    let mut all = all?;
    all.extend(last?);
    Ok(all)
}

/// Returns the size of the change of a fault: the stated step, or its bound, or 1.
fn size(fault: &Fault) -> f64 {
    fault.step.or(fault.bound).unwrap_or(1.0)
}

fn part(fault: &Fault) -> Number {
    Number { name: fault.name.clone(), unit: fault.unit.clone(), value: size(fault) }
}

/// The loop from the faults to the signals of the responses.
struct ShownLoop<'a> {
    designed: &'a Solution,
    outputs: Vec<Output>,
    /// Outputs: [x; e; eps], the commands, and for a sampled loop the states at each time between
    /// samples.
    system: StateSpace,
}

impl<'a> ShownLoop<'a> {
    fn of(designed: &'a Solution) -> Result<Self, Error> {
        let Solution { plant, gains, domain, .. } = designed;
        let mut system = fault_system(plant, gains, *domain)?;
        let (m, order) = (plant.b.ncols(), system.a.nrows());
        let (all, q) = plant.f_a.shape();
        // u = K_x (x - e) + K_f f_hat + K_i x_i, with a direct term f_hat = f_hat_i + P_f C e.
        let mut commands = DMatrix::zeros(m, order);
        commands.columns_mut(0, all).copy_from(&gains.k_x);
        commands.columns_mut(all, all).copy_from(&-&gains.k_x);
        commands.columns_mut(2 * all, q).copy_from(&gains.k_f);
        if let Some(p_f) = &gains.p_f {
            let mut of_error = commands.columns_mut(all, all);
            of_error += &gains.k_f * p_f * &plant.c;
        }
        if let Some(integral) = &gains.integral {
            commands.columns_mut(2 * all + q, gains.integrals()).copy_from(&integral.gain);
        }
        add_outputs(&mut system, &commands, &DMatrix::zeros(m, q));
        if let Domain::Sampled { period } = *domain {
            let n = designed.extended.states;
            let model = &designed.extended.plant;
            let b = beside(&model.b.rows(0, n).into(), &model.f_a.rows(0, n).into());
            for time in designed.linear.times_between(period, PARTS) {
                // x(t_k + time) from x(t_k), with command and fault constant since t_k.
                let (phi, gamma) = designed.linear.held(&b, time)?;
                let mut states = gamma.columns(0, m) * &commands;
                let mut of_states = states.columns_mut(0, n);
                of_states += phi;
                add_outputs(&mut system, &states, &gamma.columns(m, q).into_owned());
            }
        }
        Ok(Self { designed, outputs: outputs(designed), system })
    }

    /// Returns the loop with one input that changes all faults by their sizes.
    fn together(&self) -> StateSpace {
        let mut sizes = DMatrix::zeros(self.system.b.ncols(), 1);
        let designed = self.designed;
        for (fault, channel) in designed.linear.faults.iter().zip(&designed.extended.channels) {
            sizes[channel.estimate] = size(fault);
        }
        let StateSpace { b, d, .. } = &self.system;
        StateSpace { b: b * &sizes, d: d * &sizes, ..self.system.clone() }
    }

    /// Returns the curves of a response that is `factor` times as large.
    fn curves(&self, trace: &TimeResponse, factor: f64) -> Vec<Curve> {
        let Solution { plant, linear, extended, .. } = self.designed;
        let first_command = 2 * plant.a.nrows() + plant.f_a.ncols();
        let first_between = first_command + plant.b.ncols();
        let mut curves = Vec::new();
        for (at, output) in self.outputs.iter().enumerate() {
            let between = |part: usize| first_between + part * extended.states + at;
            let is_state = at < linear.plant_states().len();
            let times = points(self.designed, trace, |k, part| match part {
                None => Some(trace.output[(output.row, k)]),
                Some(part) if is_state => Some(trace.output[(between(part), k)]),
                Some(_) => None,
            });
            curves.push(self.curve(output, trace, factor, &times));
        }
        for (at, actuator) in linear.actuators.iter().enumerate() {
            let row = first_command + at;
            let times = points(self.designed, trace, |k, _| Some(trace.output[(row, k)]));
            let name = format!("command {}", actuator.name);
            let output = Output { name, unit: actuator.unit.clone(), row };
            curves.push(self.curve(&output, trace, factor, &times));
        }
        curves
    }

    fn curve(
        &self,
        output: &Output,
        trace: &TimeResponse,
        factor: f64,
        points: &[(f64, f64)],
    ) -> Curve {
        let row = output.row;
        let at_points = trace.transient(row, SETTLED);
        let (peak, peak_time, settling_time) = match self.designed.domain {
            Domain::Continuous => (at_points.peak, at_points.peak_time, at_points.settling_time),
            Domain::Sampled { .. } => transient(points, trace.final_value[row]),
        };
        let shown = thinned(points, MOST[usize::from(self.system.a.nrows() >= LARGE)]);
        Curve {
            name: output.name.clone(),
            unit: output.unit.clone(),
            peak: factor * peak,
            peak_time,
            settling_time,
            times: shown.iter().map(|point| point.0).collect(),
            values: shown.iter().map(|point| factor * point.1).collect(),
        }
    }
}

/// Returns the points of a curve, each a time and a value.
///
/// `value(k, None)` is the value at point k of the trace, `value(k, Some(i))` the one at the i-th time after it;
/// without a value there is no point. Times between samples are added where the trace has neighbouring samples.
pub(crate) fn points(
    designed: &Solution,
    trace: &TimeResponse,
    value: impl Fn(usize, Option<usize>) -> Option<f64>,
) -> Vec<(f64, f64)> {
    let mut points = Vec::with_capacity(trace.time.len());
    let period = match designed.domain {
        Domain::Continuous => 0.0,
        Domain::Sampled { period } => period,
    };
    let between = designed.linear.times_between(period, PARTS);
    for (k, &time) in trace.time.iter().enumerate() {
        points.extend(value(k, None).map(|value| (time, value)));
        let next = trace.time.get(k + 1).filter(|next| **next - time < 1.5 * period);
        if next.is_none() {
            continue;
        }
        for (part, later) in between.iter().enumerate() {
            points.extend(value(k, Some(part)).map(|value| (time + later, value)));
        }
    }
    points
}

/// Returns the points at times up to 0, then the first, the lowest, the highest and the last point of each of `parts`
/// parts of the logarithmic time axis; all points if there are at most four for each part.
fn thinned(points: &[(f64, f64)], parts: usize) -> Vec<(f64, f64)> {
    if points.len() <= 4 * parts {
        return points.to_vec();
    }
    let (before, rest) = points.split_at(points.partition_point(|point| point.0 <= 0.0));
    #[expect(clippy::cast_precision_loss, reason = "at most 1000")]
    let width = (rest[rest.len() - 1].0 / rest[0].0).ln() / parts as f64;
    let part = |point: &(f64, f64)| ((point.0 / rest[0].0).ln() / width).floor();
    let shown = |part: &[(f64, f64)]| {
        let by_height = |i: &usize, j: &usize| part[*i].1.total_cmp(&part[*j].1);
        let (lowest, highest) =
            ((0..part.len()).min_by(by_height), (0..part.len()).max_by(by_height));
        let mut places: Vec<usize> = lowest.into_iter().chain(highest).collect();
        places.extend([0, part.len() - 1]);
        places.sort_unstable();
        places.dedup();
        places.into_iter().map(|at| part[at]).collect::<Vec<_>>()
    };
    let parts = rest.chunk_by(|one, next| part(one).total_cmp(&part(next)).is_eq());
    before.iter().copied().chain(parts.flat_map(shown)).collect()
}

/// Appends outputs to a system.
pub(crate) fn add_outputs(system: &mut StateSpace, c: &DMatrix<f64>, d: &DMatrix<f64>) {
    (system.c, system.d) = (stacked(&system.c, c), stacked(&system.d, d));
}

/// Returns the value with the largest modulus, its time, and the time from which the points stay
/// within the band around the final value, infinite if the last point is outside.
fn transient(points: &[(f64, f64)], final_value: f64) -> (f64, f64, f64) {
    let largest = |best: (f64, f64), point: &(f64, f64)| {
        if point.1.abs() > best.1.abs() { *point } else { best }
    };
    let (peak_time, peak) = points.iter().fold((0.0, 0.0), largest);
    let distance = |point: &(f64, f64)| (point.1 - final_value).abs();
    let band = SETTLED * points.iter().map(distance).fold(0.0, f64::max);
    let outside = points.iter().rposition(|point| distance(point) > band);
    let inside = |at: usize| points.get(at + 1).map_or(f64::INFINITY, |point| point.0);
    (peak, peak_time, outside.map_or(0.0, inside))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thinned_curve_keeps_ends_peaks_and_order() {
        let point =
            |k: u32| (f64::from(k), if k == 12_345 { 9.0 } else { (0.1 * f64::from(k)).sin() });
        let all: Vec<_> = (0..50_000).map(point).collect();
        let thin = thinned(&all, 250);
        assert!(thin.len() <= 1005 && thin.is_sorted_by(|x, y| x.0 < y.0), "{}", thin.len());
        assert_eq!((thin[0], thin[thin.len() - 1]), (all[0], all[49_999]));
        assert!(thin.contains(&(12_345.0, 9.0)));
        assert_eq!(thinned(&all[..1000], 250), all[..1000]);
        // Thinned by index, the decade to 10^4 would have a fifth of the points.
        let shown = thin.iter().filter(|point| (1e3..1e4).contains(&point.0)).count();
        assert!((150..=220).contains(&shown), "{shown}");
    }

    #[test]
    fn a_thinned_curve_drawn_over_the_logarithm_of_time_is_the_curve_in_every_decade() {
        // Two modes, 1e-2 s and 10 s.
        let value = |time: f64| 2.0 - (-100.0 * time).exp() - (-0.1 * time).exp();
        let all: Vec<_> = (0..50_000).map(|k| 1e-3 * f64::from(k)).map(|t| (t, value(t))).collect();
        let thin = thinned(&all, 250);
        for (time, exact) in &all[1..] {
            let next = thin.partition_point(|point| point.0 < *time);
            let ((from, low), (to, high)) = (thin[next.max(2) - 1], thin[next.max(2)]);
            let share = (time / from).ln() / (to / from).ln();
            let drawn = low + share * (high - low);
            assert!((drawn - exact).abs() < 2e-3, "{time}: {drawn}, expected {exact}");
        }
    }
}
