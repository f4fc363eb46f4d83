//! Writes `design.toml`, the input file of the controller FMU.

use aso_controller::Design;
use aso_controller::design::detection::DetectionDesign;
use aso_controller::design::schedule::{Point, Schedule};
use aso_controller::design::{
    Actuator, Combination, Defaults, Estimator, Fallback, Fault, Measurement, Reconfiguration,
    Signal, SlidingMode,
};
use control::aso::{FaultyPlant, Gains};
use fmu_description::unit::Unit;

use crate::matrix::matrix;
use crate::plant::linear::LinearPlant;
use crate::report::number::round;
use crate::solve::designed::Designed;
use crate::solve::names::fault_names;
use crate::solve::reconfiguration::{
    Combination as DesignedCombination, Reconfiguration as DesignedReconfiguration,
    Reconfigurations,
};
use crate::solve::schedule::Scheduled;
use crate::solve::solution::Solution;
use plant_file::PlantFile;
use plant_file::faults::EntryPoint;
use plant_file::signals::Signal as PlantSignal;

impl Designed {
    /// Returns the content of `design.toml`.
    pub(crate) fn file(
        &self,
        file: &PlantFile<'_>,
        description: &str,
        detection: Option<&DetectionDesign>,
        reconfigurations: &Reconfigurations,
    ) -> Result<Design, crate::Error> {
        let Self { nominal, schedule, .. } = self;
        let linear = &nominal.linear;
        let at_origin = nominal.signals().all(|signal| signal.operating.unwrap_or(0.0) == 0.0);
        let operating = |signal: &PlantSignal| signal.operating.filter(|_| !at_origin);
        let signal =
            |stated: &PlantSignal| Signal { operating: operating(stated), ..as_stated(stated) };
        let actuator = |stated: &PlantSignal| {
            let Signal { name, unit, description, operating } = signal(stated);
            Actuator { name, unit, description, operating, limits: stated.limits }
        };
        let measurement = |stated: &PlantSignal| {
            let Signal { name, unit, description, operating } = signal(stated);
            let (range, longest_hold) = (stated.limits, stated.longest_hold);
            Measurement { name, unit, description, operating, range, longest_hold }
        };
        let signals = |all: &[PlantSignal]| all.iter().map(signal).collect::<Vec<_>>();
        let sampled = file.sampling.map(|sampling| sampling.period);
        let mut states = signals(&linear.states);
        if nominal.filter.is_some() {
            states.extend(linear.measurements.iter().map(|measurement| Signal {
                name: format!("filtered {}", measurement.name),
                ..signal(measurement)
            }));
        }
        let FaultyPlant { a, b, c, f_a, a_f } = &nominal.plant;
        let has_fault_model = nominal.law.a_f.is_some() || nominal.extended.plant.a_f.amax() > 0.0;
        let Gains { k_x, k_f, l_x, l_f, p_f, integral, .. } = &nominal.gains;
        let injection = nominal.law.injection.as_ref();
        let tracking = nominal.tracking.as_ref();
        let Reconfigurations { single, combinations, fallback } = reconfigurations;
        Ok(Design {
            description: description.to_owned(),
            t_on: file.t_on,
            monitor: file.monitor,
            sample_time: sampled,
            estimator: sampled.map(|_| estimator(nominal.gains.estimator)),
            filter: nominal.filter.clone(),
            a: matrix(a),
            b: matrix(b),
            c: matrix(c),
            d: linear.has_feedthrough().then(|| matrix(&linear.d)),
            f_a: matrix(f_a),
            a_f: has_fault_model.then(|| matrix(a_f)),
            p_f: p_f.as_ref().map(matrix),
            sliding_mode: injection
                .map(|law| SlidingMode { rho: law.rho.clone(), delta: law.delta.clone() }),
            k_x: matrix(k_x),
            k_f: matrix(k_f),
            l_x: matrix(l_x),
            l_f: matrix(injection.map_or(l_f, |law| &law.f)),
            h: integral.as_ref().map(|action| matrix(&action.h)),
            k_i: integral.as_ref().map(|action| matrix(&action.gain)),
            f_i: integral
                .as_ref()
                .filter(|action| action.faults.amax() > 0.0)
                .map(|action| matrix(&action.faults)),
            l_w: tracking.and_then(|tracking| tracking.windup()).map(matrix),
            n_r: tracking.and_then(|tracking| tracking.feedforward()).map(matrix),
            transfer: file.transfer_time.map(|time| decay(time, sampled)),
            states,
            actuators: linear.actuators.iter().map(actuator).collect(),
            measurements: linear.measurements.iter().map(measurement).collect(),
            faults: nominal.fault_entries(),
            references: tracking.map_or(Vec::new(), |tracking| signals(&tracking.signals)),
            reconfigurations: single.iter().map(|single| nominal.reconfigured(single)).collect(),
            combinations: combinations.iter().map(|several| nominal.combined(several)).collect(),
            fallback: fallback.as_ref().map(|fallback| Fallback {
                k_x: matrix(&fallback.k_x),
                k_f: fallback.k_f.as_ref().map(matrix),
            }),
            experiment: nominal.experiment(file)?,
            schedule: schedule.as_ref().map(|schedule| nominal.scheduled(schedule)),
            detection: detection.cloned(),
        })
    }
}

/// Converts a signal of the plant file to a signal of the design file.
pub(crate) fn as_stated(signal: &PlantSignal) -> Signal {
    Signal {
        name: signal.name.clone(),
        unit: signal.unit.clone(),
        description: signal.description.clone(),
        operating: signal.operating,
    }
}

/// Returns `transfer` of the design file for a time constant in s: the rate in 1/s; in a sampled controller the part of
/// the transition u_t that each sample removes.
fn decay(time: f64, sample_time: Option<f64>) -> f64 {
    sample_time.map_or(1.0 / time, |period| -(-period / time).exp_m1())
}

impl Solution {
    /// Returns the table `[schedule]`: the variable, and matrices and operating point at each of its
    /// values.
    fn scheduled(&self, schedule: &Scheduled) -> Schedule {
        let PlantSignal { name, unit, description, .. } = &schedule.variable;
        let points = schedule.points(self).map(|(at, design)| {
            let LinearPlant { states, actuators, measurements, .. } = &design.linear;
            let filtered = if design.filter.is_some() { &measurements[..] } else { &[] };
            let operating = |signals: &[PlantSignal]| -> Vec<f64> {
                signals.iter().map(|signal| signal.operating.unwrap_or(0.0) + 0.0).collect()
            };
            let tracking = design.tracking.as_ref();
            let FaultyPlant { a, b, c, f_a, .. } = &design.plant;
            let Gains { k_x, k_f, l_x, l_f, p_f, integral, .. } = &design.gains;
            Point {
                at,
                x_op: [operating(states), operating(filtered)].concat(),
                u_op: operating(actuators),
                y_op: operating(measurements),
                a: matrix(a),
                b: matrix(b),
                c: matrix(c),
                f_a: matrix(f_a),
                k_x: matrix(k_x),
                k_f: matrix(k_f),
                l_x: matrix(l_x),
                l_f: matrix(l_f),
                p_f: p_f.as_ref().map(matrix),
                k_i: integral.as_ref().map(|action| matrix(&action.gain)),
                l_w: tracking.and_then(|tracking| tracking.windup()).map(matrix),
                n_r: tracking.and_then(|tracking| tracking.feedforward()).map(matrix),
                r_op: tracking.map_or(Vec::new(), |tracking| operating(&tracking.signals)),
            }
        });
        Schedule {
            variable: name.clone(),
            unit: unit.clone(),
            description: description.clone(),
            points: points.collect(),
        }
    }

    fn reconfigured(&self, single: &DesignedReconfiguration) -> Reconfiguration {
        let names = fault_names(&self.linear, &self.extended);
        let gains = single.gains.as_ref();
        Reconfiguration {
            gone: self.linear.actuators[single.actuator].name.clone(),
            actuator: single.actuator,
            stuck_at: single.stuck_at,
            k_x: gains.map(|gains| matrix(&gains.k_x)),
            k_f: gains.map(|gains| matrix(&gains.k_f)),
            k_s: gains.map(|gains| gains.k_s.iter().map(|entry| entry + 0.0).collect()),
            restart: single.restart.iter().map(|fault| names[*fault].clone()).collect(),
            restarted: single.restart.clone(),
            loss: single.decision.map(|(loss, _)| loss),
            time: single.decision.map(|(_, time)| time),
        }
    }

    fn combined(&self, combination: &DesignedCombination) -> Combination {
        let name = |at: &usize| self.linear.actuators[*at].name.clone();
        Combination {
            gone: combination.gone.iter().map(name).collect(),
            mask: combination.gone.iter().fold(0, |mask, j| mask | 1 << j),
            k_x: matrix(&combination.gains.k_x),
            k_f: matrix(&combination.gains.k_f),
            k_s: matrix(&combination.gains.k_s),
        }
    }

    fn signals(&self) -> impl Iterator<Item = &PlantSignal> {
        let linear = &self.linear;
        linear.states.iter().chain(&linear.actuators).chain(&linear.measurements)
    }

    /// Returns the faults, then the rates of ramps: one entry per column of F_a.
    fn fault_entries(&self) -> Vec<Fault> {
        let named = |name| Fault {
            name,
            unit: None,
            description: String::new(),
            loss_of: None,
            least_command: None,
        };
        let names = fault_names(&self.linear, &self.extended);
        let mut all: Vec<_> = names.into_iter().map(named).collect();
        for (fault, channel) in self.linear.faults.iter().zip(&self.extended.channels) {
            let entry = &mut all[channel.estimate];
            entry.unit.clone_from(&fault.unit);
            entry.description.clone_from(&fault.description);
            if let EntryPoint::Loss { actuator, least_command } = fault.entry_point {
                entry.loss_of = Some(self.linear.actuators[actuator].name.clone());
                entry.least_command = Some(least_command);
            }
            if let Some(rate) = channel.rate {
                all[rate].unit = fault.unit.as_deref().and_then(per_second);
                all[rate].description = format!("rate of {}", fault.name);
            }
        }
        all
    }

    /// Returns the default experiment. Unless it is stated, the stop time is ten time constants of the slowest feedback
    /// eigenvalue, at least ten steps; the step is the sample time or, in continuous time, a 2000th of the stop time.
    fn experiment(&self, file: &PlantFile<'_>) -> Result<Defaults, crate::Error> {
        let slowest = self.slowest_rate()?;
        let sample_time = file.sampling.map(|sampling| sampling.period);
        let steps = [file.step_size, sample_time];
        let shortest = 10.0 * steps.into_iter().flatten().fold(0.0, f64::max);
        let stop_time = file.stop_time.unwrap_or_else(|| round(10.0 / slowest).max(shortest));
        let step_size = file.step_size.or(sample_time);
        let step_size = step_size.unwrap_or_else(|| round(stop_time / 2000.0));
        if stop_time <= step_size {
            let message = format!(
                "expected a `stop_time` above the step size of {step_size} s, found {stop_time} s"
            );
            return Err(file.error(&["experiment"], message).into());
        }
        Ok(Defaults { stop_time, step_size: Some(step_size) })
    }
}

fn estimator(estimator: control::aso::Estimator) -> Estimator {
    match estimator {
        control::aso::Estimator::Current => Estimator::Current,
        control::aso::Estimator::Prediction => Estimator::Prediction,
    }
}

/// Returns the unit divided by seconds; None if FMI has no such unit.
pub(crate) fn per_second(unit: &str) -> Option<String> {
    let slope = format!("{unit}/s");
    Unit::parse(&slope).is_ok().then_some(slope)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::designed::design;
    use crate::tests::read;

    /// The experiment of a loop that settles in one sample of 0.1 s, with `more` in its plant file.
    fn experiment(more: &str) -> Result<Defaults, String> {
        let text = "A = [[-1]]\nB = [[1]]\nC = [[1]]\nactuator_faults = \"all\"\n\
                    sample_time = 0.1\nfeedback.sampled_eigenvalues = [1e-6]\n\
                    observer.sampled_eigenvalues = [0.5, 0.6]\n";
        let experiment = |file: &PlantFile<'_>| design(file)?.nominal.experiment(file);
        read(&(text.to_owned() + more), experiment).unwrap().map_err(|error| error.to_string())
    }

    /// The controller FMU needs more than one step.
    #[test]
    fn an_experiment_is_longer_than_a_step() {
        let expected = Defaults { stop_time: 1.0, step_size: Some(0.1) };
        assert_eq!(experiment(""), Ok(expected));
        let expected = Defaults { stop_time: 20.0, step_size: Some(2.0) };
        assert_eq!(experiment("experiment = { step_size = 2 }\n"), Ok(expected));
        let refused = experiment("experiment = { stop_time = 0.1 }\n").unwrap_err();
        let expected =
            "plant.toml:8:14: expected a `stop_time` above the step size of 0.1 s, found 0.1 s";
        assert!(refused.starts_with(expected), "{refused}");
    }
}
