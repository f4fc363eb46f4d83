//! The controller at the present value of its scheduling variable.

use num_dual::Dual64;

use super::AsoController;
use crate::equations::Equations;
use crate::signals::{Signals, Values};
use aso_controller::Design;
use aso_controller::design::schedule::Schedule;

impl AsoController {
    /// Computes u', and f_hat' with a direct term, of a controller with a schedule, whose gains and operating point
    /// change with the scheduling variable. Does nothing without a schedule.
    pub(super) fn set_scheduled_slopes(&mut self) {
        let Self {
            design, current, values, deviations, z_slopes, f_slopes, u_slopes, mode, ..
        } = self;
        let (Some(schedule), Some(current)) = (&design.schedule, current) else { return };
        let space = || Box::new(((**current).clone(), Signals::zero(current)));
        let (design_rates, signal_rates) = &mut **self.rates.get_or_insert_with(space);
        let slope = match schedule.measurement(design) {
            Some(k) => values.y_slopes[k],
            None => self.schedule_slope,
        };
        schedule.differentiate(self.schedule_value, slope, design_rates);
        signal_rates.set_rates(z_slopes, values, design_rates);
        let equations = Equations::<Dual64>::new([current, design_rates], *mode);
        let (z, inputs) = (
            equations.estimate([&deviations.z, &signal_rates.z]),
            [[&deviations.y[..], &signal_rates.y], [&deviations.r[..], &signal_rates.r]],
        );
        for (j, slope) in u_slopes.iter_mut().enumerate().filter(|(j, _)| !mode.is_limited(*j)) {
            let point_rate = design_rates.actuators[j].operating.unwrap_or_default();
            *slope = point_rate + equations.free_command(j, z, inputs, Dual64::from_re(-0.0)).eps;
        }
        for (i, slope) in f_slopes.iter_mut().enumerate() {
            *slope = equations.fault(i, z, inputs[0]).eps;
        }
    }

    /// Sets matrices and operating point of a scheduled controller for `time`, `offset` s after the
    /// measurements were given. Warns once if the scheduling variable is outside of the schedule.
    pub(super) fn interpolate(&mut self, offset: f64, time: f64) {
        let input = self.schedule_input + self.schedule_slope * offset;
        let Self { design, current, values, operating_point, .. } = self;
        let (Some(schedule), Some(current)) = (&design.schedule, current) else { return };
        let value = scheduling_variable(schedule, design, values, input, offset);
        self.schedule_value = value;
        self.schedule_at = schedule.interpolate(value, current);
        current.take_parameters(design);
        operating_point.read(current);
        let [first, last] = schedule.range();
        let inside = (first..=last).contains(&value);
        if !inside && !self.outside_reported {
            self.outside_reported = true;
            self.log.warn(format!(
                "{} = {value} at {time} s is outside of the schedule from {first} to {last}; the \
                 controller uses {} (reported once)",
                schedule.variable, self.schedule_at
            ));
        }
    }

    /// Sets the derivatives of matrices and operating point of a scheduled controller in the direction
    /// of `direction`, at the value of the scheduling variable for which they were interpolated.
    pub(super) fn differentiate_schedule(&self, direction: &mut Self) {
        let Self { design, current, values, schedule_input, .. } = direction;
        let (Some(schedule), Some(current)) = (&self.design.schedule, current) else { return };
        let value = self.schedule_value;
        let slope = scheduling_variable(schedule, &self.design, values, *schedule_input, 0.0);
        direction.schedule_at = schedule.differentiate(value, slope, current);
        current.take_parameters(design);
    }

    /// The design at the scheduling variable of the last sample or of the present time; without a schedule the design
    /// itself.
    pub(super) fn design_in_force(&self) -> &Design {
        self.current.as_deref().unwrap_or(&self.design)
    }
}

/// The scheduling variable `offset` s after the measurements were given: one of the measurements, or a separate input.
fn scheduling_variable(
    schedule: &Schedule,
    design: &Design,
    values: &Values,
    input: f64,
    offset: f64,
) -> f64 {
    match schedule.measurement(design) {
        Some(k) => values.y[k] + values.y_slopes[k] * offset,
        None => input,
    }
}
