//! A pendulum with a stop, for model exchange and directional derivatives, with an alias, an
//! enumeration and every kind of start value: angle' = speed,
//! speed' = gain torque - sin angle - damping speed.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::Experiment;
use crate::callbacks::Callbacks;
use crate::instance::Instance;
use crate::interface::Interface;
use crate::model::{About, At, Event, Failure, Model, ModelExchange, Step};
use crate::variable::{Enumeration, Variable};
use fmu_description::DependencyKind;
use fmu_description::call_order::InterfaceType;

#[derive(Clone, Serialize, Deserialize)]
pub(super) struct Pendulum {
    angle: f64,
    speed: f64,
    acceleration: f64,
    torque: f64,
    height: f64,
    damping: f64,
    gain: f64,
    pub(super) side: i32,
    guess: f64,
    half: f64,
}

impl Model for Pendulum {
    const IDENTIFIER: &'static str = "Pendulum";
    const PROVIDES_DIRECTIONAL_DERIVATIVE: bool = true;

    fn about(&self) -> About {
        About::default()
    }

    fn new(_: &Path) -> Result<Self, Failure> {
        Ok(Self {
            angle: 0.5,
            speed: 0.0,
            acceleration: 0.0,
            torque: 0.0,
            height: 0.0,
            damping: 0.1,
            gain: 2.0,
            side: 2,
            guess: 0.75,
            half: 0.0,
        })
    }

    fn variables(&self) -> Vec<Variable<Self>> {
        let sides = Enumeration::new("Side", [("left", 1), ("right", 2)]);
        vec![
            Variable::real("torque", "", |model: &mut Self| &mut model.torque).input().unit("N.m"),
            Variable::real("angle", "", |model: &mut Self| &mut model.angle)
                .output(&[])
                .exact()
                .unit("rad")
                .nominal(0.25),
            Variable::alias("speed", "der(angle) by another name", "der(angle)").output(&[]),
            Variable::real("der(angle)", "", |model: &mut Self| &mut model.speed)
                .derivative_of("angle")
                .exact()
                .reinit(),
            Variable::real("der(speed)", "", |model: &mut Self| &mut model.acceleration)
                .derivative_of("der(angle)")
                .depends(DependencyKind::Fixed, ["torque"])
                .depends(DependencyKind::Dependent, ["angle"])
                .depends(DependencyKind::Tunable, ["der(angle)"])
                .initially(["torque", "angle", "der(angle)", "damping", "gain"]),
            Variable::real("height", "", |model: &mut Self| &mut model.height).output(&["angle"]),
            Variable::real("damping", "", |model: &mut Self| &mut model.damping).tunable(),
            Variable::real("gain", "", |model: &mut Self| &mut model.gain).parameter(),
            Variable::enumeration("side", "", sides, |model: &mut Self| &mut model.side).tunable(),
            Variable::real("guess", "", |model: &mut Self| &mut model.guess).approximate(),
            Variable::real("half", "half of gain", |model: &mut Self| &mut model.half)
                .calculated_parameter()
                .initially(["gain"]),
        ]
    }

    fn initialize(&mut self, _: &Experiment) -> Result<(), Failure> {
        self.half = 0.5 * self.gain;
        self.update(0.0)
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        if self.angle > 1.0 {
            let message = "over the top".to_owned();
            return Err(Failure::Terminated { time: step.start, message });
        }
        self.angle += step.size * self.speed;
        self.update(step.end())
    }

    fn update(&mut self, _time: f64) -> Result<(), Failure> {
        if self.angle.abs() > 100.0 {
            return Err(Failure::Discard("angle out of this world".to_owned()));
        }
        self.acceleration = self.gain * self.torque - self.angle.sin() - self.damping * self.speed;
        self.height = -self.angle.cos();
        Ok(())
    }

    fn differentiate(&self, at: &At, direction: &mut Self) -> Result<(), Failure> {
        let parameters = match at {
            At::Initialization => self.torque * direction.gain - self.speed * direction.damping,
            At::Point { .. } => 0.0,
        };
        direction.half = 0.5 * direction.gain;
        direction.acceleration = self.gain * direction.torque
            - self.angle.cos() * direction.angle
            - self.damping * direction.speed
            + parameters;
        direction.height = self.angle.sin() * direction.angle;
        Ok(())
    }

    fn model_exchange(&self) -> Option<ModelExchange> {
        Some(ModelExchange { event_indicators: 1 })
    }

    fn event_indicators(&self, _time: f64, indicators: &mut [f64]) {
        indicators[0] = 1.0 - self.angle;
    }

    fn event(&mut self, time: f64) -> Result<Event, Failure> {
        let stopped = self.angle >= 1.0 && self.speed > 0.0;
        if stopped {
            self.speed = -self.speed;
        }
        Ok(Event {
            values_of_continuous_states_changed: stopped,
            next_event_time: (time < 3.0).then_some(3.0),
            terminate_simulation: (time > 9.0).then(|| "late".to_owned()),
            ..Event::default()
        })
    }
}

pub(super) const TORQUE: u32 = 1;
pub(super) const ANGLE: u32 = 2;
pub(super) const SPEED: u32 = 3;
pub(super) const ACCELERATION: u32 = 4;
pub(super) const HEIGHT: u32 = 5;
pub(super) const DAMPING: u32 = 6;
pub(super) const GAIN: u32 = 7;
pub(super) const HALF: u32 = 9;

pub(super) fn pendulum(interface: InterfaceType) -> Instance<Pendulum> {
    let none = Path::new("");
    let (_, description) = Interface::new(&mut Pendulum::new(none).unwrap()).unwrap();
    Instance::new(interface, none, &description.guid, Callbacks::silent()).unwrap()
}
