//! FMI 1.0, co-simulation (stand-alone).

use master::{Failure, Slave, StepResult};
use tests::c_versions;

use super::Loaded;

#[test]
fn values_of_all_types_of_fmi_1_pass_unchanged() {
    let mut loaded = Loaded::first("plain").initialised();
    loaded.set_real("u", 0.5);
    loaded.set_integer("i_in", -7);
    let (boolean, text) = (loaded.reference("b_in"), loaded.reference("s_in"));
    loaded.slave.set_boolean(&[boolean], &[1]).unwrap();
    loaded.slave.set_string(&[text], &["Grüße".to_owned()]).unwrap();
    assert_eq!(loaded.step(0.0, 2.0), Ok(StepResult::Whole));
    assert_eq!((loaded.real("y"), loaded.integer("i_out")), (1.0, -7));
    assert!(loaded.boolean("b_out"));
    let (out, mut texts) = (loaded.reference("s_out"), [String::new()]);
    loaded.slave.get_string(&[out], &mut texts).unwrap();
    assert_eq!(texts[0], "Grüße");
}

#[test]
fn a_negated_alias_has_the_opposite_sign() {
    let mut loaded = Loaded::first("plain").initialised();
    assert_eq!(loaded.step(0.0, 2.0), Ok(StepResult::Whole));
    assert_eq!((loaded.real("y"), loaded.real("minus_y")), (2.0, -2.0));
}

#[test]
fn a_parameter_is_set_before_the_initialization() {
    let mut loaded = Loaded::first("plain");
    loaded.set_real("gain", 3.0);
    let mut loaded = loaded.initialised();
    assert_eq!(loaded.step(0.0, 1.0), Ok(StepResult::Whole));
    assert_eq!(loaded.real("y"), 3.0);
}

#[test]
fn a_discarded_step_of_fmi_1_reports_the_time_it_reached() {
    let mut loaded = Loaded::first("discard").initialised();
    let part = StepResult::Part { reached: 0.25, terminated: false };
    assert_eq!(loaded.step(0.0, 1.0), Ok(part));
    assert_eq!(loaded.step(0.25, 0.75), Ok(StepResult::Whole));
    assert_eq!(loaded.real("y"), 1.0);
}

#[test]
fn a_pending_step_of_fmi_1_is_waited_for() {
    let mut loaded = Loaded::first("pending").initialised();
    assert_eq!(loaded.step(0.0, 1.0), Ok(StepResult::Whole));
    assert_eq!(loaded.real("y"), 1.0);
}

#[test]
fn an_fmu_of_fmi_1_that_does_not_instantiate_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let path = c_versions::slave_1(folder.path(), "refuse");
    let fmu = fmu_import::Fmu::open(&path).unwrap();
    let error = fmu.instantiate("pump").err().unwrap().to_string();
    assert!(error.contains("pump has no licence for 3 days"), "{error}");
}

#[test]
fn fmi_1_has_no_states() {
    let mut loaded = Loaded::first("plain").initialised();
    let error = loaded.slave.save_state(0).unwrap_err();
    assert_eq!(error.failure, Failure::Missing);
}
