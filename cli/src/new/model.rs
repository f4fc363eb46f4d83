//! A room that is heated: T' = (T_outside + R power - T) / tau.
#![forbid(unsafe_code)]

use std::path::Path;

use fmu::{About, Experiment, Failure, Model, Step, Variable};
use serde::{Deserialize, Serialize};

/// The model. Every quantity that affects the future is a field: the state of the FMU is a copy of
/// this struct.
#[derive(Clone, Serialize, Deserialize)]
struct NewModel {
    power: f64,
    temperature: f64,
    outside: f64,
    resistance: f64,
    time_constant: f64,
}

impl Model for NewModel {
    /// The name of the FMU and of the library in it.
    const IDENTIFIER: &'static str = "NewModel";

    fn about(&self) -> About {
        About {
            description: "A room that is heated".to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            license: env!("CARGO_PKG_LICENSE").to_owned(),
            ..About::default()
        }
    }

    /// Creates the model; the values here are the start values in the model description.
    fn new(_resources: &Path) -> Result<Self, Failure> {
        Ok(Self {
            power: 0.0,
            temperature: 293.15,
            outside: 273.15,
            resistance: 0.01,
            time_constant: 3600.0,
        })
    }

    /// Lists the variables of the model description, each with its field.
    fn variables(&self) -> Vec<Variable<Self>> {
        vec![
            Variable::real("power", "Heating", |room: &mut Self| &mut room.power)
                .input()
                .unit("W"),
            // An output lists the inputs on which it depends directly, without a step in between:
            // none here.
            Variable::real("T", "Temperature of the room", |room: &mut Self| {
                &mut room.temperature
            })
            .output(&[])
            .exact()
            .unit("K"),
            Variable::real("T_outside", "Temperature outside", |room: &mut Self| {
                &mut room.outside
            })
            .tunable()
            .unit("K"),
            Variable::real("R", "Thermal resistance", |room: &mut Self| {
                &mut room.resistance
            })
            .parameter()
            .range(1e-9, 1e9)
            .unit("K/W"),
            Variable::real("tau", "Time constant", |room: &mut Self| {
                &mut room.time_constant
            })
            .parameter()
            .range(1e-9, 1e9)
            .unit("s"),
        ]
    }

    /// Runs after parameters and inputs are set and before the first step.
    fn initialize(&mut self, _experiment: &Experiment) -> Result<(), Failure> {
        Ok(())
    }

    /// Advances the model from `step.start` by `step.size`; this model has an exact solution.
    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        let rest = self.outside + self.resistance * self.power;
        let decay = (-step.size / self.time_constant).exp();
        self.temperature = rest + (self.temperature - rest) * decay;
        Ok(())
    }
}

fmu::export!(NewModel);

#[cfg(test)]
mod tests {
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
        let mut room = NewModel::new(Path::new("resources")).unwrap();
        room.power = 2000.0;
        room.step(&Step {
            start: 0.0,
            size: 100.0 * room.time_constant,
        })
        .unwrap();
        assert!(
            (room.temperature - 293.15).abs() < 1e-9,
            "{}",
            room.temperature
        );
    }
}
