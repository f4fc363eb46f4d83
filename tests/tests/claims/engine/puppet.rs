//! A slave controlled by a test.

use std::sync::{Arc, Mutex};

use fmu_description::Experiment;
use fmu_description::ModelDescription;
use master::{CallError, Slave, StepResult, System};
use tests::linear::{ABLE, Block, Linear};

/// Output over time in s.
type Output = fn(f64) -> f64;
/// The time that a step between two times reaches.
type Way = fn(f64, f64) -> StepResult;
/// The requested steps: start and end in s.
pub(crate) type Asked = Arc<Mutex<Vec<(f64, f64)>>>;

/// A slave with the outputs y, which is connected, and z, which is not: functions of time.
pub(crate) struct Puppet {
    description: ModelDescription,
    time: f64,
    slots: [f64; 3],
    outputs: [Output; 2],
    way: Way,
    asked: Asked,
}

impl Puppet {
    fn boxed(
        description: ModelDescription,
        outputs: [Output; 2],
        way: Way,
        asked: &Asked,
    ) -> Box<Self> {
        let (time, slots, asked) = (0.0, [0.0; 3], Arc::clone(asked));
        Box::new(Self { description, time, slots, outputs, way, asked })
    }
}

pub(crate) fn whole(_: f64, _: f64) -> StepResult {
    StepResult::Whole
}

/// A system of one puppet p with a lag a behind its y, and the steps requested of p.
pub(crate) fn system(outputs: [Output; 2], way: Way) -> (System, Asked) {
    let asked = Asked::default();
    let xml = r#"<fmiModelDescription fmiVersion="2.0" modelName="Puppet" guid="puppet">
        <CoSimulation modelIdentifier="P" canHandleVariableCommunicationStepSize="true"
        canGetAndSetFMUstate="true" canSerializeFMUstate="true"/><ModelVariables>
        <ScalarVariable name="y" valueReference="0" causality="output"><Real/></ScalarVariable>
        <ScalarVariable name="z" valueReference="1" causality="output"><Real/></ScalarVariable>
        </ModelVariables><ModelStructure><Outputs><Unknown index="1" dependencies=""/>
        <Unknown index="2" dependencies=""/></Outputs>
        </ModelStructure></fmiModelDescription>"#;
    let description = ModelDescription::parse(xml).unwrap();
    let mut system = System::default();
    system.add("p", Puppet::boxed(description, outputs, way, &asked)).unwrap();
    let lag = Block::new(&[&[-1.0]], &[&[1.0]], &[&[1.0]], &[&[0.0]], &[0.0]);
    let lag = Linear::boxed(&lag, ABLE, &Arc::default());
    system.add("a", lag).unwrap();
    system.connect("p.y", "a.u0").unwrap();
    (system, asked)
}

/// Adds another puppet, which completes its steps and whose y is the time.
pub(crate) fn add_clock(system: &mut System, name: &str, way: Way) {
    let description = system.slaves[0].1.description().clone();
    let clock = Puppet::boxed(description, [|time| time; 2], way, &Asked::default());
    system.add(name, clock).unwrap();
}

/// The same with a puppet that takes equal steps only.
pub(crate) fn rigid((mut system, asked): (System, Asked)) -> (System, Asked) {
    let mut description = system.slaves[0].1.description().clone();
    let flags = description.co_simulation.as_mut().unwrap();
    flags.can_handle_variable_communication_step_size = false;
    system.slaves[0].1 = Puppet::boxed(description, [f64::sin; 2], whole, &asked);
    (system, asked)
}

impl Slave for Puppet {
    fn description(&self) -> &ModelDescription {
        &self.description
    }
    fn setup_experiment(&mut self, experiment: &Experiment) -> Result<(), CallError> {
        self.time = experiment.start_time;
        Ok(())
    }
    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        for (value, &reference) in values.iter_mut().zip(references) {
            *value = (self.outputs[reference as usize])(self.time);
        }
        Ok(())
    }
    fn set_real(&mut self, _: &[u32], _: &[f64]) -> Result<(), CallError> {
        Ok(())
    }
    fn do_step(&mut self, time: f64, size: f64, _: bool) -> Result<StepResult, CallError> {
        assert!((time - self.time).abs() < 1e-12, "a step begins where the last one ended");
        self.asked.lock().unwrap().push((time, time + size));
        let stepped = (self.way)(time, time + size);
        self.time = match stepped {
            StepResult::Whole => time + size,
            StepResult::Part { reached, .. } | StepResult::Event { reached } => reached,
        };
        Ok(stepped)
    }
    fn save_state(&mut self, slot: usize) -> Result<(), CallError> {
        self.slots[slot] = self.time;
        Ok(())
    }
    fn restore_state(&mut self, slot: usize) -> Result<(), CallError> {
        self.time = self.slots[slot];
        Ok(())
    }
    fn serialize_state(&mut self) -> Result<Vec<u8>, CallError> {
        Ok(self.time.to_le_bytes().to_vec())
    }
    fn deserialize_state(&mut self, bytes: &[u8]) -> Result<(), CallError> {
        self.time = f64::from_le_bytes(bytes.try_into().unwrap());
        Ok(())
    }
}
