//! Steps that a system structure suggests for its elements: `osp:StepSizeHint`.
#![expect(clippy::unwrap_used, reason = "tests; numbers are exact by construction")]

use std::path::{Path, PathBuf};

use tempfile::TempDir;
use tests::Table;
use tests::c_fmu::CFmu;

fn annotation(content: &str) -> String {
    format!(
        "<ssd:Annotations><ssc:Annotation type=\"com.opensimulationplatform\">{content}\
         </ssc:Annotation></ssd:Annotations>"
    )
}

fn component(name: &str, hint: Option<f64>) -> String {
    let hint = hint.map(|hint| annotation(&format!("<osp:StepSizeHint value=\"{hint}\"/>")));
    format!(
        "<ssd:Component name=\"{name}\" type=\"application/x-fmu-sharedlibrary\" \
         source=\"slave.fmu\"><ssd:Connectors>\
         <ssd:Connector name=\"u\" kind=\"input\"><ssc:Real/></ssd:Connector>\
         <ssd:Connector name=\"y\" kind=\"output\"><ssc:Real/></ssd:Connector>\
         </ssd:Connectors>{}</ssd:Component>",
        hint.unwrap_or_default()
    )
}

/// `a`, whose input is 1, before `b` in the system `sub`, with these hints and this base step.
fn structure(hints: [Option<f64>; 2], base: Option<f64>) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let _ = CFmu::well_behaved().write(folder.path(), "slave");
    let base = base.map(|base| {
        let step = format!("<osp:FixedStepAlgorithm baseStepSize=\"{base}\"/>");
        annotation(&format!("<osp:Algorithm>{step}</osp:Algorithm>"))
    });
    let [a, b] = hints;
    let (a, b) = (component("a", a), component("b", b));
    let text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <ssd:SystemStructureDescription name=\"Hints\" version=\"1.0\" \
         xmlns:ssd=\"http://ssp-standard.org/SSP1/SystemStructureDescription\" \
         xmlns:ssc=\"http://ssp-standard.org/SSP1/SystemStructureCommon\" \
         xmlns:osp=\"http://opensimulationplatform.com/SSP/OSPAnnotations\">\
         <ssd:System name=\"Root\"><ssd:Elements>{a}<ssd:System name=\"sub\"><ssd:Connectors>\
         <ssd:Connector name=\"in\" kind=\"input\"><ssc:Real/></ssd:Connector></ssd:Connectors>\
         <ssd:Elements>{b}</ssd:Elements><ssd:Connections><ssd:Connection startConnector=\"in\" \
         endElement=\"b\" endConnector=\"u\"/></ssd:Connections></ssd:System></ssd:Elements>\
         <ssd:Connections><ssd:Connection startElement=\"a\" startConnector=\"y\" \
         endElement=\"sub\" endConnector=\"in\"/></ssd:Connections></ssd:System>\
         <ssd:DefaultExperiment startTime=\"0\" stopTime=\"1\">{}</ssd:DefaultExperiment>\
         </ssd:SystemStructureDescription>\n",
        base.unwrap_or_default()
    );
    let path = folder.path().join("SystemStructure.ssd");
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

/// Runs with held inputs; returns times and outputs of `b`, and the text of `--explain`.
fn run(structure: &Path, more: &[&str]) -> (Vec<f64>, Vec<f64>, String) {
    let out = structure.with_file_name("out");
    let (path, folder) = (structure.display().to_string(), out.display().to_string());
    let fixed = ["run", &path, "--method", "jacobi", "--extrapolation", "hold", "--out", &folder];
    let explained = ["--explain", "--record", "a.y", "--record", "sub.b.y"];
    let output = tests::run(&[&fixed[..], &explained, more].concat());
    let said = [output.stdout, output.stderr].concat();
    let said = String::from_utf8_lossy(&said).into_owned();
    assert!(output.status.success(), "{said}");
    let table = Table::read(&out.join("results.csv"));
    (table.column("time"), table.column("sub.b.y"), said)
}

/// The output of `b` at the multiples of its step: each step adds `step` times the time at its
/// start.
fn expected(step: f64, steps: u32) -> Vec<f64> {
    let mut sum = 0.0;
    let mut all = vec![sum];
    for count in 0..steps {
        sum += step * (f64::from(count) * step);
        all.push(sum);
    }
    all
}

#[test]
fn the_base_step_is_the_communication_step_and_a_hint_gives_an_element_a_multiple_of_it() {
    for (hints, base) in [
        ([None, Some(0.125)], Some(0.0625)),
        ([Some(0.0625), Some(0.125)], Some(0.0625)),
        // Without a base step the smallest hint is the step.
        ([Some(0.0625), Some(0.125)], None),
    ] {
        let (_folder, path) = structure(hints, base);
        let (time, y, said) = run(&path, &[]);
        assert_eq!((time.len(), time[1]), (17, 0.0625), "{said}");
        assert!(said.contains("sub.b steps every 2 communication steps"), "{said}");
        let sampled: Vec<f64> = y.iter().copied().step_by(2).collect();
        assert_eq!(sampled, expected(0.125, 8), "{said}");
    }
}

#[test]
fn settings_of_the_user_override_the_hints() {
    let (_folder, path) = structure([Some(0.0625), Some(0.125)], Some(0.0625));
    let (time, y, said) = run(&path, &["--every", "sub.b=4"]);
    assert_eq!(time.len(), 17);
    assert!(said.contains("sub.b steps every 4 communication steps"), "{said}");
    let sampled: Vec<f64> = y.iter().copied().step_by(4).collect();
    assert_eq!(sampled, expected(0.25, 4));
    let (time, y, said) = run(&path, &["--step", "0.125"]);
    assert_eq!((time.len(), y), (9, expected(0.125, 8)), "{said}");
    assert!(!said.contains("steps every"), "{said}");
}

#[test]
fn a_hint_that_is_no_multiple_of_the_step_changes_nothing() {
    for hint in [0.1, 0.03, 0.0625] {
        let (_folder, path) = structure([None, Some(hint)], Some(0.0625));
        let (_, y, said) = run(&path, &[]);
        assert!(!said.contains("steps every"), "{said}");
        assert_eq!(y, expected(0.0625, 16), "{hint}");
    }
}
