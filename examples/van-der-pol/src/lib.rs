//! The van der Pol oscillator, x0' = x1, x1' = mu (1 - x0^2) x1 - x0, for both interfaces and with
//! directional derivatives.
#![forbid(unsafe_code)]

use fmu::{At, Failure, Model, Variables};

#[derive(Clone, Variables, serde::Serialize, serde::Deserialize)]
struct VanDerPol {
    /// Position
    #[fmu(output, start = 2)]
    x0: f64,
    /// Velocity
    #[fmu(output, derivative_of = x0, start = 0)]
    x1: f64,
    /// Acceleration
    #[fmu(derivative_of = x1, name = "der(x1)", depends(x0, x1), initially(x0, x1, mu))]
    slope: f64,
    /// Damping
    #[fmu(parameter, start = 1)]
    mu: f64,
}

#[fmu::model(stop_time = 20, step_size = 0.01)]
impl Model for VanDerPol {
    const PROVIDES_DIRECTIONAL_DERIVATIVE: bool = true;

    fn update(&mut self, _time: f64) -> Result<(), Failure> {
        self.slope = self.mu * (1.0 - self.x0 * self.x0) * self.x1 - self.x0;
        Ok(())
    }

    fn differentiate(&self, _at: &At, direction: &mut Self) -> Result<(), Failure> {
        let damping = 1.0 - self.x0 * self.x0;
        direction.slope = direction.mu * damping * self.x1 + self.mu * damping * direction.x1
            - (2.0 * self.mu * self.x0 * self.x1 + 1.0) * direction.x0;
        Ok(())
    }
}

fmu::export!(VanDerPol);
#[cfg(test)]
mod tests;
