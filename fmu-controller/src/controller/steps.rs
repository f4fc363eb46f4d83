//! The steps of the controller: measurements, estimate, commands.

use fmu::{Failure, Step};
use num_dual::Dual64;

use super::AsoController;
use crate::detection::{Detector, Stretch};
use crate::equations::Equations;
use crate::mode::Mode;
use crate::observer::{Conditions, Observer, Part};
use crate::reconfiguration::Reconfigurator;
use crate::sampled::Sampler;
use crate::signals::{Signals, Values};
use crate::validity::MeasurementCheck;
use aso_controller::clock::clock_rounding;
use aso_controller::design::detection::DetectionDesign;

impl AsoController {
    /// Whether f_hat is part of the command at `time`.
    pub(super) fn is_compensating(&self, time: f64) -> bool {
        self.compensate && time >= self.design.t_on - clock_rounding(time)
    }

    /// The mode with no channel at a limit, without the actuators that are gone now.
    pub(super) fn free_mode(&self, compensating: bool) -> Mode {
        let Reconfigurator { gone, fallen_back, .. } = self.reconfigurator;
        Mode::free(compensating, compensating || self.design.monitor, gone, fallen_back)
    }

    /// Decides at `time` which actuators are gone. The fault estimates of actuators that are gone or back since the
    /// last decision restart at 0, also in the prediction of `sampler`. Returns whether an estimate has restarted.
    pub(super) fn reconfigure(&mut self, time: f64, mut sampler: Option<&mut Sampler>) -> bool {
        let Self { design, values, deviations, reconfigurator, losses, .. } = self;
        let changed = reconfigurator.decide(design, losses, time);
        let affected = design.reconfigurations.iter();
        let affected = affected.filter(|case| changed & (1 << case.actuator) != 0);
        let mut restarted = false;
        for fault in affected.flat_map(|case| &case.restarted) {
            let position = design.states.len() + fault;
            (values.z[position], deviations.z[position]) = (0.0, 0.0);
            if let Some(sampler) = &mut sampler {
                sampler.set_prediction(position, 0.0);
            }
            restarted = true;
        }
        restarted
    }

    /// Sets u_t if `mode` has another law than the last commands, and returns whether u_t was set; see
    /// [`Values::transfer`].
    pub(super) fn transfer(&mut self, mode: Mode) -> bool {
        let Self { design, current, values, operating_point, deviations, .. } = self;
        let design = current.as_deref().unwrap_or(design);
        values.transfer(design, mode, operating_point, deviations)
    }

    /// Sets u_t where compensation starts or ends within a step, at `time`, `offset` s after its start, so that the
    /// commands continue the old law at the deviations z.
    fn transfer_at(&mut self, compensating: bool, time: f64, offset: f64) {
        let after = self.free_mode(compensating);
        if self.design.transfer.is_none() || self.values.law == Some(after.law(&self.design)) {
            return;
        }
        self.values.set_estimate(&self.deviations.z, &self.operating_point);
        self.mode = self.free_mode(!compensating);
        self.evaluate(time, offset);
        self.transfer(after);
        self.deviations.set_inputs(&self.values, &self.operating_point, 0.0);
    }

    /// Sets the estimate to its initial value, y_f to the measurements, and the operating point to that of the design.
    pub(super) fn start(&mut self) {
        let [x_hat, f_hat, y_f, x_i, u_t] = self.design.parts_mut(&mut self.values.z);
        x_hat.copy_from_slice(&self.x_hat_0);
        f_hat.copy_from_slice(&self.f_hat_0);
        y_f.iter_mut().zip(&self.values.y).for_each(|(y_f, y)| *y_f = *y);
        x_i.copy_from_slice(&self.x_i_0);
        u_t.fill(0.0);
        self.values.law = None;
        self.deviations.u.fill(0.0);
        self.operating_point.read(&self.design);
    }

    /// Advances the deviations of the estimate, and the detection, over a part of the step that starts at `start`.
    fn advance(&mut self, compensating: bool, start: f64, part: Part) -> Result<(), Failure> {
        let mode = self.free_mode(compensating);
        let Self { design, values, deviations, observer, detector, .. } = self;
        let Signals { z, y, r, .. } = deviations;
        let (y, r) = ([&y[..], &values.y_slopes], [&r[..], &values.r_slopes]);
        let conditions = Conditions { design, y, r, mode };
        let follow = &mut |z: &[f64], mode, Part { offset, size }| {
            let (Some(detector), Some(detection)) = (&mut *detector, &design.detection) else {
                return Ok(());
            };
            let stretch = Stretch { z, mode, y, r, start, offset, size };
            detector.follow(design, detection, &stretch)
        };
        observer
            .get_or_insert_with(|| Observer::new(design))
            .advance(z, conditions, part, follow)
            .map_err(|error| Failure::Error(format!("the observer cannot be stepped: {error}")))
    }

    /// The detector; an empty one without a detection.
    pub(crate) fn detector_mut(&mut self) -> &mut Detector {
        self.detector.get_or_insert_default()
    }

    /// The check of the measurements; an empty one without ranges and longest holds.
    pub(crate) fn measurement_check_mut(&mut self) -> &mut MeasurementCheck {
        self.measurement_check.get_or_insert_default()
    }

    /// Whether the controller rests, because the last value replaces a measurement for too long.
    pub(super) fn is_resting(&self) -> bool {
        self.measurement_check.as_ref().is_some_and(|check| check.is_lost)
    }

    /// Sets the measurements by `take`. Returns whether they end a rest: the detection has then restarted at `time` in
    /// s, and the caller must start y_f from them.
    fn take_measurements(
        &mut self,
        time: f64,
        take: impl FnOnce(&mut MeasurementCheck, &mut Values),
    ) -> bool {
        let rested = self.is_resting();
        if let Some(check) = &mut self.measurement_check {
            take(check, &mut self.values);
        }
        let resumes = rested && !self.is_resting();
        if let Some(detector) = self.detector.as_mut().filter(|_| resumes) {
            detector.rest(time);
        }
        resumes
    }

    /// Rests at `time`, in s: commands and estimates are those of the operating point; an actuator that is gone has its
    /// stuck command.
    pub(super) fn rest(&mut self, time: f64) {
        self.mode = self.free_mode(self.is_compensating(time));
        let Self { design, current, values, operating_point, deviations, mode, .. } = self;
        let design = current.as_deref().unwrap_or(design);
        deviations.z.fill(0.0);
        deviations.f_hat.fill(0.0);
        deviations.u.fill(0.0);
        mode.set_limited(design, &mut deviations.u);
        values.rest(operating_point);
        values.set_commands(&deviations.u, design, *mode, operating_point);
        if let Some(detector) = &mut self.detector {
            detector.rest(time);
        }
        self.set_losses();
        self.has_slopes = false;
    }

    /// The detection of the design; an empty one if the design has none.
    pub(crate) fn detection_mut(&mut self) -> &mut DetectionDesign {
        self.design.detection.get_or_insert_default()
    }

    /// Starts the detection, if there is one, at `time` from the initial estimate.
    pub(super) fn start_detection(&mut self, time: f64) {
        let Self { design, values, operating_point, deviations, detector, .. } = self;
        if let (Some(detector), Some(detection)) = (detector, &design.detection) {
            deviations.set(values, operating_point, 0.0);
            detector.start(detection, time, &deviations.z[..design.states.len()]);
        }
    }

    /// Makes a step of a continuous controller without a schedule. An error if too many samples of the detection are
    /// due, or if the observer cannot be stepped.
    pub(super) fn integrate(&mut self, step: &Step) -> Result<(), Failure> {
        if let (Some(detector), Some(detection)) = (&self.detector, &self.design.detection)
            && detector.has_too_many_samples(detection, step.end())
        {
            let (start, end) = (step.start, step.end());
            let message = format!("too many samples are due from {start} to {end} s");
            return Err(Failure::Error(message));
        }
        // An event before the step froze the limits, as events of model exchange do.
        self.frozen = false;
        let resolution = clock_rounding(step.end());
        let until_on = self.design.t_on - step.start;
        let inside = self.compensate && until_on > resolution && step.size - until_on > resolution;
        self.reconfigure(step.start, None);
        let resumes = self.take_measurements(step.start, |check, values| {
            check.take_step(values, step.start, step.size);
        });
        if self.is_resting() {
            self.rest(step.end());
            return Ok(());
        }
        if resumes {
            let Self { design, values, operating_point, deviations, .. } = self;
            for k in 0..design.filter.as_ref().map_or(0, Vec::len) {
                let at = design.filtered_at(k);
                values.z[at] = values.y[k];
                deviations.z[at] = values.z[at] - operating_point.z[at];
            }
        }
        // The deviations z are still those of the end of the previous step, or of the start of the run.
        self.deviations.set_inputs(&self.values, &self.operating_point, 0.0);
        self.transfer(self.free_mode(!inside && self.is_compensating(step.start)));
        if inside {
            self.advance(false, step.start, Part { offset: 0.0, size: until_on })?;
            self.transfer_at(true, step.start + until_on, until_on);
            let rest = Part { offset: until_on, size: step.size - until_on };
            self.advance(true, step.start, rest)?;
        } else {
            let whole = Part { offset: 0.0, size: step.size };
            self.advance(self.is_compensating(step.start), step.start, whole)?;
        }
        let is_compensating = self.is_compensating(step.end());
        self.transfer_at(is_compensating, step.end(), step.size);
        self.values.set_estimate(&self.deviations.z, &self.operating_point);
        self.mode = self.free_mode(is_compensating);
        self.evaluate(step.end(), step.size);
        Ok(())
    }

    /// Computes e, u and E_hat at the state reached and at `time`, `offset` s after the inputs were set. Does nothing
    /// while the controller rests.
    pub(super) fn evaluate(&mut self, time: f64, offset: f64) {
        if self.is_resting() {
            return;
        }
        self.interpolate(offset, time);
        let Self { design, current, values, operating_point, deviations, mode, .. } = self;
        let design = current.as_deref().unwrap_or(design);
        deviations.set(values, operating_point, offset);
        if !self.frozen {
            *mode = mode.limited(design, &deviations.z, [&deviations.y, &deviations.r]);
        }
        mode.set_limited(design, &mut deviations.u);
        Equations::<f64>::new(design, *mode).set_signals(&mut &mut *deviations);
        values.set_commands(&deviations.u, design, *mode, operating_point);
        self.set_losses();
        self.has_slopes = false;
    }

    /// Computes z', f_hat', u' and E_hat' unless they are up to date; returns the controller. The derivatives are zero
    /// if the controller is sampled or rests.
    pub(crate) fn with_slopes(&mut self) -> &mut Self {
        if !self.has_slopes && self.sampler.is_none() {
            if self.is_resting() {
                for slopes in [&mut self.z_slopes, &mut self.f_slopes, &mut self.u_slopes] {
                    slopes.fill(0.0);
                }
                self.losses.iter_mut().for_each(|loss| loss.slope = 0.0);
            } else {
                self.set_slopes();
            }
            self.has_slopes = true;
        }
        self
    }

    /// Computes the derivatives z', f_hat', u' and E_hat'.
    fn set_slopes(&mut self) {
        let Self { current, values, deviations, z_slopes, f_slopes, u_slopes, mode, .. } = self;
        let design = current.as_deref().unwrap_or(&*self.design);
        let input_slopes = [&values.y_slopes[..], &values.r_slopes];
        let equations = Equations::<f64>::new(design, *mode);
        equations.set_slopes(equations.knowns(&deviations), &mut &mut z_slopes[..]);
        for (j, slope) in u_slopes.iter_mut().enumerate() {
            let rates = equations.estimate(z_slopes);
            let free = equations.free_command(j, rates, input_slopes, -0.0);
            *slope = if mode.is_limited(j) { 0.0 } else { free };
        }
        for (i, slope) in f_slopes.iter_mut().enumerate() {
            *slope = equations.fault(i, equations.estimate(z_slopes), input_slopes[0]);
        }
        self.set_scheduled_slopes();
        let Self { design, values, deviations, z_slopes, f_slopes, u_slopes, .. } = self;
        let n = design.states.len();
        for loss in &mut self.losses {
            let u = Dual64::new(values.u[loss.actuator], u_slopes[loss.actuator]);
            let f_hat = loss.fault_of(&deviations.f_hat, &values.z, n);
            let f_hat = Dual64::new(f_hat, loss.fault_of(f_slopes, z_slopes, n));
            loss.slope = loss.effectiveness_lost(u, f_hat).eps;
        }
    }

    /// Computes the estimated losses E_hat.
    fn set_losses(&mut self) {
        let n = self.design.states.len();
        for loss in &mut self.losses {
            let f_hat = loss.fault_of(&self.deviations.f_hat, &self.values.z, n);
            loss.estimate = loss.effectiveness_lost(self.values.u[loss.actuator], f_hat);
        }
    }

    /// Takes the samples that are due until `end`, with the measurements given at `start`, in s. Does nothing in a
    /// continuous controller.
    pub(super) fn sample(&mut self, start: f64, end: f64) {
        let Some(mut sampler) = self.sampler.take() else { return };
        while let Some(offset) = sampler.time_to_sample(start, end) {
            let instant = sampler.clock.next_instant();
            let mut resumes = false;
            // Before sample 0, initialization has taken the measurements, and no actuator is gone.
            if !sampler.is_at_start() {
                self.reconfigure(instant, Some(&mut sampler));
                resumes = self.take_measurements(instant, |check, values| {
                    check.take_sample(values, offset);
                });
            }
            let mode = self.free_mode(self.is_compensating(instant));
            self.interpolate(offset, instant);
            if self.is_resting() {
                self.rest(instant);
                sampler.rest(&self.values.z);
                continue;
            }
            if resumes {
                let Self { design, values, .. } = self;
                for k in 0..design.filter.as_ref().map_or(0, Vec::len) {
                    let y = values.y[k] + values.y_slopes[k] * offset;
                    sampler.set_prediction(design.filtered_at(k), y);
                }
            }
            let Self { design, current, values, operating_point, deviations, detector, .. } = self;
            let whole = &**design;
            let design = current.as_deref().unwrap_or(whole);
            self.mode = sampler.sample(design, mode, values, operating_point, deviations, offset);
            if let (Some(detector), Some(detection)) = (detector, &whole.detection) {
                detector.sample(detection, &deviations.u, &deviations.y, instant);
            }
            self.set_losses();
        }
        self.sampler = Some(sampler);
    }
}
