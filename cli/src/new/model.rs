//! A room that is heated: T' = (T_outside + R power - T) / tau.
#![forbid(unsafe_code)]

use fmu::{Failure, Model, Variables};
use serde::{Deserialize, Serialize};

/// The model. Every quantity that affects the future is a field: the state of the FMU is a copy of
/// this struct. Each field is a variable, and its comment is the description of the variable.
#[derive(Clone, Variables, Serialize, Deserialize)]
struct NewModel {
    /// Heating
    #[fmu(input, unit = "W", start = 0)]
    power: f64,
    /// Temperature of the room
    #[fmu(output, name = "T", unit = "K", nominal = 300, start = 293.15)]
    temperature: f64,
    /// Rise of the temperature
    #[fmu(derivative_of = temperature, name = "der(T)", unit = "K/s")]
    rise: f64,
    /// Temperature outside
    #[fmu(tunable, name = "T_outside", unit = "K", start = 273.15)]
    outside: f64,
    /// Thermal resistance
    #[fmu(parameter, name = "R", unit = "K/W", min = 1e-9, max = 1e9, start = 0.01)]
    resistance: f64,
    /// Time constant
    #[fmu(parameter, name = "tau", unit = "s", min = 1e-9, max = 1e9, start = 3600)]
    time_constant: f64,
}

/// The name of the FMU is that of the struct; `stop_time` is that of the default experiment, in s.
#[fmu::model(stop_time = 7200)]
impl Model for NewModel {
    /// Computes outputs and derivatives from states, inputs and parameters. The exporter integrates the
    /// derivatives in co-simulation, the importer in model exchange.
    fn update(&mut self, _time: f64) -> Result<(), Failure> {
        let rest = self.outside + self.resistance * self.power;
        self.rise = (rest - self.temperature) / self.time_constant;
        Ok(())
    }
}

fmu::export!(NewModel);

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn the_variables_keep_the_rules_of_the_standard() {
        assert_eq!(
            fmu::problems::<NewModel>(Path::new("resources")),
            Ok(vec![])
        );
    }

    #[test]
    fn a_heated_room_ends_at_the_temperature_outside_plus_resistance_times_power() {
        let mut room = fmu::Simulation::<NewModel>::new(Path::new("resources")).unwrap();
        room.model_mut().power = 2000.0;
        room.step(100.0 * room.model().time_constant).unwrap();
        let temperature = room.model().temperature;
        assert!((temperature - 293.15).abs() < 1e-3, "{temperature}");
    }
}
