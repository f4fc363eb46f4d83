//! FMUs of FMI 3.0 and 1.0 through our own loader. The FMUs are `tests/c/slave3.c` and
//! `tests/c/slave1.c`, which end the process at a call that the standard forbids.
#![expect(clippy::unwrap_used, clippy::float_cmp, reason = "tests; exact by construction")]

mod coupled;
mod exchange;
mod first;
mod third;

use fmu_description::Experiment;
use fmu_import::{Fmu, Instance};
use master::{CallError, Slave, StepResult};
use tempfile::TempDir;
use tests::c_versions;

/// An instance and the folder of its FMU.
struct Loaded {
    slave: Instance,
    _folder: TempDir,
}

impl Loaded {
    fn third(token: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = c_versions::slave_3(folder.path(), token, true);
        let slave = Fmu::open(&path).unwrap().instantiate("slave").unwrap();
        Self { slave, _folder: folder }
    }

    fn first(guid: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = c_versions::slave_1(folder.path(), guid);
        let slave = Fmu::open(&path).unwrap().instantiate("slave").unwrap();
        Self { slave, _folder: folder }
    }

    fn initialised(mut self) -> Self {
        self.slave.setup_experiment(&Experiment::default()).unwrap();
        self.slave.enter_initialization_mode().unwrap();
        self.slave.exit_initialization_mode().unwrap();
        self
    }

    /// Returns the value reference of a variable or of an element of an array.
    fn reference(&self, name: &str) -> u32 {
        let variables = &self.slave.description().variables;
        let variable = variables.iter().find(|variable| variable.name == name);
        variable.unwrap_or_else(|| panic!("no variable {name}")).value_reference
    }

    fn real(&mut self, name: &str) -> f64 {
        let (reference, mut value) = (self.reference(name), [f64::NAN]);
        self.slave.get_real(&[reference], &mut value).unwrap();
        value[0]
    }

    fn set_real(&mut self, name: &str, value: f64) {
        let reference = self.reference(name);
        self.slave.set_real(&[reference], &[value]).unwrap();
    }

    fn integer(&mut self, name: &str) -> i64 {
        let (reference, mut value) = (self.reference(name), [0]);
        self.slave.get_integer(&[reference], &mut value).unwrap();
        value[0]
    }

    fn set_integer(&mut self, name: &str, value: i64) {
        let reference = self.reference(name);
        self.slave.set_integer(&[reference], &[value]).unwrap();
    }

    fn boolean(&mut self, name: &str) -> bool {
        let (reference, mut value) = (self.reference(name), [7]);
        self.slave.get_boolean(&[reference], &mut value).unwrap();
        value[0] != 0
    }

    fn step(&mut self, time: f64, size: f64) -> Result<StepResult, CallError> {
        self.slave.do_step(time, size, true)
    }
}
