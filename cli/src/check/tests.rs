//! Findings about slaves with a single fault.

use fmu_description::Experiment;
use fmu_description::ModelDescription;
use fmu_description::abi::Status;
use master::{CallError, Failure, Slave, StepResult};

use super::answer::{Answer, TrialResult};
use super::finding::{Finding, Severity};
use super::{behaviour, description};

const XML: &str = r#"<fmiModelDescription fmiVersion="2.0" modelName="Sum" guid="g">
<CoSimulation modelIdentifier="Sum" canGetAndSetFMUstate="true" canSerializeFMUstate="true"/>
<DefaultExperiment startTime="0" stopTime="1" tolerance="1e-5" stepSize="0.125"/>
<ModelVariables>
<ScalarVariable name="u" valueReference="1" causality="input"><Real start="2"/></ScalarVariable>
<ScalarVariable name="y" valueReference="2" causality="output"><Real/></ScalarVariable>
</ModelVariables><ModelStructure><Outputs><Unknown index="2"/></Outputs></ModelStructure>
</fmiModelDescription>"#;

/// The model of [`XML`] in FMI 3.0.
const XML_3: &str = r#"<fmiModelDescription fmiVersion="3.0" modelName="Sum" instantiationToken="t">
<CoSimulation modelIdentifier="Sum"/>
<LogCategories/>
<DefaultExperiment startTime="0" stopTime="1" tolerance="1e-5" stepSize="0.125"/>
<ModelVariables>
<Float64 name="time" valueReference="0" causality="independent"/>
<Float64 name="u" valueReference="1" causality="input" start="2"/>
<Float64 name="y" valueReference="2" causality="output"/>
</ModelVariables><ModelStructure><Output valueReference="2"/></ModelStructure>
</fmiModelDescription>"#;

/// The fault of a slave.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    Nothing,
    StartValue,
    UnknownReference,
    Silent,
    NoEnd,
    Nan,
    InstancesDiffer,
    SecondEndsEarlier,
    LostState,
    RoundedState,
    NoState,
    /// No fault: the slave discards saved states at a step with `noSetFMUStatePriorToCurrentPoint`.
    DiscardsStates,
    ReadAfterTheEnd,
    Step,
    SilentStep,
}

/// A slave whose output is the integral of its input.
struct Sum {
    description: ModelDescription,
    fault: Fault,
    number: u32,
    u: f64,
    y: f64,
    end: f64,
    saved: f64,
    terminated: bool,
}

fn refused(function: &'static str, words: &str) -> CallError {
    let messages = if words.is_empty() { vec![] } else { vec![words.to_owned()] };
    CallError { function, failure: Failure::Status(Status::Error), messages }
}

impl Slave for Sum {
    fn description(&self) -> &ModelDescription {
        &self.description
    }

    fn setup_experiment(&mut self, experiment: &Experiment) -> Result<(), CallError> {
        self.end = experiment.stop_time.unwrap_or(f64::INFINITY);
        Ok(())
    }

    fn terminate(&mut self) -> Result<(), CallError> {
        self.terminated = true;
        Ok(())
    }

    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        if self.terminated && self.fault == Fault::ReadAfterTheEnd {
            return Err(refused("fmi2GetReal", "it is over"));
        }
        values[0] = match references[0] {
            1 => self.u,
            2 => self.y,
            _ if self.fault == Fault::UnknownReference => 0.0,
            _ => {
                let words = if self.fault == Fault::Silent { "" } else { "no such variable" };
                return Err(refused("fmi2GetReal", words));
            }
        };
        Ok(())
    }

    fn set_real(&mut self, _: &[u32], values: &[f64]) -> Result<(), CallError> {
        self.u = values[0];
        Ok(())
    }

    fn do_step(&mut self, time: f64, size: f64, never_back: bool) -> Result<StepResult, CallError> {
        if self.fault == Fault::DiscardsStates && never_back {
            self.saved = f64::NAN;
        }
        if self.fault == Fault::Step && time > 0.5 {
            return Err(refused("fmi2DoStep", "tired"));
        }
        if self.fault == Fault::SilentStep {
            return Err(refused("fmi2DoStep", ""));
        }
        if self.fault == Fault::SecondEndsEarlier && self.number == 2 && time >= 0.5 {
            return Ok(StepResult::Part { reached: time, terminated: false });
        }
        if time + size > self.end && self.fault != Fault::NoEnd {
            return Err(refused("fmi2DoStep", "past the end"));
        }
        self.y += self.u * size;
        if self.fault == Fault::InstancesDiffer {
            self.y += f64::from(self.number);
        }
        if self.fault == Fault::Nan {
            self.y = f64::NAN;
        }
        Ok(StepResult::Whole)
    }

    fn save_state(&mut self, _: usize) -> Result<(), CallError> {
        if self.fault == Fault::NoState {
            return Err(refused("fmi2GetFMUstate", "not today"));
        }
        self.saved = self.y;
        Ok(())
    }

    fn restore_state(&mut self, _: usize) -> Result<(), CallError> {
        match self.fault {
            Fault::LostState => {}
            Fault::RoundedState => self.y = self.saved * (1.0 + 1e-9),
            _ => self.y = self.saved,
        }
        Ok(())
    }

    fn serialize_state(&mut self) -> Result<Vec<u8>, CallError> {
        Ok(self.y.to_le_bytes().to_vec())
    }

    fn deserialize_state(&mut self, bytes: &[u8]) -> Result<(), CallError> {
        if self.fault != Fault::LostState {
            self.y = f64::from_le_bytes(bytes.try_into().unwrap());
        }
        Ok(())
    }
}

fn findings(fault: Fault) -> Vec<Finding> {
    tried(fault).1
}

fn tried(fault: Fault) -> (TrialResult, Vec<Finding>) {
    tried_as(XML, fault)
}

/// Returns the slave number `number` of a trial.
fn sum(description: &ModelDescription, fault: Fault, number: u32) -> Sum {
    let description = description.clone();
    let u = if fault == Fault::StartValue { 3.0 } else { 2.0 };
    Sum { description, fault, number, u, y: 0.0, end: 0.0, saved: 0.0, terminated: false }
}

/// Returns the result and the findings of a slave with this description.
fn tried_as(xml: &str, fault: Fault) -> (TrialResult, Vec<Finding>) {
    let description = ModelDescription::parse(xml).unwrap();
    let mut number = 0;
    let mut make = |_: &str, _: Option<Sum>| -> anyhow::Result<Sum> {
        number += 1;
        Ok(sum(&description, fault, number))
    };
    behaviour::check(&description, false, &mut make)
}

#[test]
fn a_correct_slave_has_no_findings() {
    assert_eq!(findings(Fault::Nothing), []);
}

#[test]
fn states_are_tried_in_steps_before_which_they_may_be_restored() {
    assert_eq!(findings(Fault::DiscardsStates), []);
}

#[test]
fn each_fault_is_found_with_its_section() {
    use Severity::{Error, Warning};
    for (fault, severity, place, words, section) in [
        (Fault::StartValue, Error, "variable u", "starts with 3.0, the XML says 2.0", "2.2.7"),
        (Fault::UnknownReference, Error, "fmi2GetReal", "accepts a value reference", "2.1.2"),
        (Fault::Silent, Warning, "fmi2GetReal", "without a message", "2.1.3"),
        (Fault::NoEnd, Warning, "fmi2DoStep", "past a stopTime", "2.1.6"),
        (Fault::Nan, Warning, "variable y", "no finite number after 1 steps", "2.2.7"),
        (Fault::InstancesDiffer, Warning, "fmi2DoStep", "has other outputs, from step 1: y", "2.1"),
        (Fault::SecondEndsEarlier, Warning, "fmi2DoStep", "other outputs, from step 5", "2.1"),
        (Fault::LostState, Error, "fmi2SetFMUstate", "differ from those before", "2.1.8"),
        (Fault::LostState, Error, "fmi2DeSerializeFMUstate", "differ", "2.1.8"),
        (Fault::RoundedState, Warning, "fmi2SetFMUstate", "by 5.0e-10 of their size: y", "2.1.8"),
        (Fault::NoState, Error, "fmi2GetFMUstate", "canGetAndSetFMUstate is true", "2.1.8"),
        (Fault::ReadAfterTheEnd, Warning, "fmi2GetReal", "after fmi2Terminate", "4.2.4"),
        (Fault::Step, Error, "fmi2DoStep", "at t = 0.625 s", "4.2.2"),
    ] {
        let all = findings(fault);
        let actual =
            all.iter().find(|finding| finding.place == place && finding.what.contains(words));
        let actual = actual.unwrap_or_else(|| panic!("{fault:?}: {all:#?}"));
        assert_eq!((actual.severity, actual.section), (severity, Some(section)), "{actual}");
    }
}

/// FMI 3.0.2, section 2.3.1: with logging off, only messages of categories that are switched on may be sent.
#[test]
fn an_error_without_a_message_is_a_warning_unless_no_category_allows_one() {
    let category = r#"<LogCategories><Category name="logStatusError"/></LogCategories>"#;
    let stated = XML_3.replace("<LogCategories/>", category);
    let unstated = XML_3.replace("<LogCategories/>", "");
    for (xml, is_warning) in [(XML, true), (stated.as_str(), true), (unstated.as_str(), false)] {
        let (_, all) = tried_as(xml, Fault::SilentStep);
        assert!(all.iter().any(|finding| finding.severity == Severity::Error), "{all:#?}");
        let is_silent = |finding: &Finding| finding.what == "fails without a message";
        assert_eq!(all.iter().any(is_silent), is_warning, "{xml}");
    }
}

#[test]
fn a_finding_has_text_place_effect_and_section() {
    let all = findings(Fault::UnknownReference);
    assert_eq!(
        all[0].to_string(),
        "error: fmi2GetReal: accepts a value reference that no variable has, expected fmi2Error \
         (section 2.1.2)\n    A wrong connection goes unnoticed."
    );
}

#[test]
fn the_answer_states_the_trial_or_the_reason_of_its_failure() {
    let (here, _) = tried(Fault::Nothing);
    let expected =
        "yes, 10 steps of 0.125 s from t = 0 s with tolerance 1e-5 and its own start values";
    assert_eq!(here.to_string(), expected);
    let (steps, step, start, tolerance, but) = (10, 0.125, 0.0, None, None);
    let without = TrialResult::Yes { steps, step, start, tolerance, but }.to_string();
    assert!(without.ends_with(" without a tolerance, with its own start values"), "{without}");
    let (here, all) = tried(Fault::Step);
    assert_eq!(here.to_string(), "no: fmi2DoStep: returned fmi2Error at t = 0.625 s");
    let answer = Answer::new(here, &ModelDescription::default(), &all).to_string();
    assert!(answer.ends_with("no other tool is known to refuse it"), "{answer}");
}

#[test]
fn a_crash_in_the_freeing_of_the_former_instance_is_one_after_its_end() {
    let description = ModelDescription::parse(XML_3.replace("<LogCategories/>", "")).unwrap();
    let mut made = 0;
    let mut make = |_: &str, former: Option<Sum>| -> anyhow::Result<Sum> {
        made += 1;
        if former.is_some() {
            let failure = Failure::Killed(11, "SIGSEGV");
            let function = "fmi3FreeInstance";
            return Err(CallError { function, failure, messages: Vec::new() }.into());
        }
        Ok(sum(&description, Fault::Nothing, made))
    };
    let (_, all) = behaviour::check(&description, false, &mut make);
    let freed = all.iter().find(|finding| finding.place == "fmi3FreeInstance").unwrap();
    assert!(freed.what.ends_with("after fmi2Terminate"), "{freed}");
    assert_eq!(freed.section, Some("4.2.4"));
}

/// `DefaultExperiment` has a `stepSize` since FMI 2.0.
#[test]
fn a_missing_step_size_is_a_note_except_in_fmi_1() {
    let xml_1 = r#"<fmiModelDescription fmiVersion="1.0" modelName="S" modelIdentifier="S" guid="g"
numberOfContinuousStates="0" numberOfEventIndicators="0"></fmiModelDescription>"#;
    let xml_2 = XML.replace(r#" stopTime="1" tolerance="1e-5" stepSize="0.125""#, "");
    for (xml, expected) in [
        (xml_1, "no stopTime in DefaultExperiment"),
        (xml_2.as_str(), "no stopTime and no stepSize in DefaultExperiment"),
    ] {
        let description = ModelDescription::parse(xml).unwrap();
        let all = description::check(&description, &[]);
        let notes = all.iter().filter(|finding| finding.what.ends_with("in DefaultExperiment"));
        assert_eq!(notes.map(|finding| finding.what.as_str()).collect::<Vec<_>>(), [expected]);
    }
}

/// FMI 3.0.2, section 2.4.9.2: `variableName` is the name of a variable in `ModelVariables`.
#[test]
fn a_member_of_a_terminal_that_is_no_variable_is_an_error() {
    let mut description = ModelDescription::parse(XML_3.replace("<LogCategories/>", "")).unwrap();
    let xml = br#"<fmiTerminalsAndIcons fmiVersion="3.0"><Terminals><Terminal name="plug">
<TerminalMemberVariable variableName="u"/><TerminalMemberVariable variableName="v"/>
</Terminal></Terminals></fmiTerminalsAndIcons>"#;
    description.terminals = fmu_description::terminals::read(xml).unwrap();
    let all = description::check(&description, &[]);
    let members = all.iter().filter(|finding| finding.what.starts_with("terminal"));
    let members: Vec<_> = members.map(|member| (member.severity, member.what.as_str())).collect();
    assert_eq!(members, [(Severity::Error, "terminal plug: no variable is called \"v\"")]);
}

#[test]
fn a_failed_instantiation_is_one_finding() {
    let description = ModelDescription::parse(XML).unwrap();
    let mut make = |_: &str, _: Option<Sum>| -> anyhow::Result<Sum> { anyhow::bail!("no licence") };
    let (here, all) = behaviour::check(&description, false, &mut make);
    assert_eq!(here, TrialResult::No { reason: "fmi2Instantiate: no licence".to_owned() });
    assert!(
        all.iter()
            .all(|finding| finding.place == "fmi2Instantiate" && finding.what == "no licence")
    );
    assert_eq!(all.len(), 1, "{all:#?}");
}
