//! A bouncing ball: h' = v, v' = g; an impact on the ground turns v into -e v.
#![forbid(unsafe_code)]

use fmu::{Event, Failure, Model, Variables};

#[derive(Clone, Variables, serde::Serialize, serde::Deserialize)]
struct BouncingBall {
    /// Height
    #[fmu(output, reinit, unit = "m", start = 1)]
    h: f64,
    /// Velocity
    #[fmu(output, derivative_of = h, reinit, unit = "m/s", start = 0)]
    v: f64,
    /// Acceleration, zero for a ball that stays down
    #[fmu(derivative_of = v, depends(h, v), unit = "m/s2")]
    a: f64,
    /// Gravity
    #[fmu(parameter, unit = "m/s2", max = -1e-3, start = -9.81)]
    g: f64,
    /// Coefficient of restitution
    #[fmu(tunable, min = 0.5, max = 1, start = 0.7)]
    e: f64,
    /// A ball stays down if it would rise slower
    #[fmu(constant, unit = "m/s", start = 0.1)]
    v_min: f64,
}

#[fmu::model(event_indicators = 1, stop_time = 3, step_size = 0.01)]
impl Model for BouncingBall {
    fn update(&mut self, _time: f64) -> Result<(), Failure> {
        let stays = self.v == 0.0 && self.h <= f64::MIN_POSITIVE;
        self.a = if stays { 0.0 } else { self.g };
        Ok(())
    }

    fn event_indicators(&self, _time: f64, z: &mut [f64]) {
        z[0] = self.h;
    }

    fn event(&mut self, _time: f64) -> Result<Event, Failure> {
        let (up, impact) = (-self.e * self.v, self.h <= 0.0 && self.v < 0.0);
        if impact {
            (self.h, self.v) = (f64::MIN_POSITIVE, if up < self.v_min { 0.0 } else { up });
        }
        Ok(Event { values_of_continuous_states_changed: impact, ..Event::default() })
    }
}

fmu::export!(BouncingBall);
#[cfg(test)]
mod tests;
