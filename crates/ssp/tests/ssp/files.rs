//! Archives, variants, systems in other files, and what is refused.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use ssp::{open, open_variant};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use crate::bench::{Bench, component, connection, links, root, settings, ssd, ssv};

/// An archive of these files.
fn archive(target: &Path, entries: &[(&str, Vec<u8>)]) -> PathBuf {
    let mut archive = ZipWriter::new(fs::File::create(target).unwrap());
    for (name, bytes) in entries {
        archive.start_file(*name, SimpleFileOptions::default()).unwrap();
        archive.write_all(bytes).unwrap();
    }
    archive.finish().unwrap();
    target.to_owned()
}

fn fmus(bench: &Bench) -> [Vec<u8>; 2] {
    [
        fs::read(bench.fmu("a.fmu", "y output Real")).unwrap(),
        fs::read(bench.fmu("b.fmu", "u input Real\np parameter Real")).unwrap(),
    ]
}

fn pair(a: &str, b: &str) -> String {
    let elements = component("a", a, "y output", "") + &component("b", b, "u input", "");
    root(&elements, &connection("a.y", "b.u", "", ""))
}

#[test]
fn an_ssp_is_opened_with_its_default_or_another_variant() {
    let bench = Bench::new();
    let [a, b] = fmus(&bench);
    let system = pair("resources/my%20a.fmu", "./resources/b.fmu").replace(
        "</ssd:Connectors></ssd:Component><ssd:Component",
        r#"</ssd:Connectors><ssd:Annotations><ssc:Annotation type="com.opensimulationplatform"><osp:StepSizeHint value="0.25"/></ssc:Annotation></ssd:Annotations></ssd:Component><ssd:Component"#,
    );
    let experiment = r#"<ssd:DefaultExperiment startTime="1" stopTime="2.5"><ssd:Annotations><ssc:Annotation type="com.opensimulationplatform"><osp:Algorithm><osp:FixedStepAlgorithm baseStepSize="1e-3"/></osp:Algorithm></ssc:Annotation></ssd:Annotations></ssd:DefaultExperiment>"#;
    let lone = component("lone", "resources/b.fmu", "", "");
    let path = archive(
        &bench.path("x.ssp"),
        &[
            ("resources/my a.fmu", a),
            ("resources/b.fmu", b),
            ("SystemStructure.ssd", ssd(&system, experiment).into()),
            ("Other.ssd", ssd(&root(&lone, ""), "").into()),
        ],
    );
    let opened = open(&path).unwrap();
    let assembly = &opened.assembly;
    assert_eq!(links(assembly), ["a.y -> b.u"]);
    assert_eq!((assembly.start_time, assembly.stop_time), (Some(1.0), Some(2.5)));
    assert_eq!(assembly.name.as_deref(), Some("Test"));
    assert_eq!(opened.experiment.step_size, Some(1e-3));
    assert_eq!(opened.steps, [("a".to_owned(), 0.25)]);
    for element in &assembly.elements {
        assert!(element.fmu.join("modelDescription.xml").is_file());
    }
    let folder = assembly.elements[0].fmu.clone();
    drop(opened);
    assert!(!folder.exists());
    let other = open_variant(&path, Some("Other.ssd")).unwrap();
    assert_eq!(other.assembly.elements[0].name, "lone");
    let text = open_variant(&path, Some("None.ssd")).unwrap_err().to_string();
    assert!(text.ends_with("expected None.ssd at its root, found Other.ssd, SystemStructure.ssd"));
}

#[test]
fn an_archive_of_the_folder_of_an_ssp_is_refused_with_the_folder() {
    let bench = Bench::new();
    let path = archive(&bench.path("a.ssp"), &[("a/SystemStructure.ssd", b"<a/>".into())]);
    let text = open(&path).unwrap_err().to_string();
    assert!(text.ends_with(" found a/SystemStructure.ssd, which is in a folder"), "{text}");
}

#[test]
fn systems_of_other_files_become_part_of_the_system_with_the_components_bindings_last() {
    let bench = Bench::new();
    fmus(&bench);
    let parameters = |value: &str| {
        format!(
            r#"<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version="1.0" name="set"><ssv:Parameters><ssv:Parameter name="b.p"><ssv:Real value="{value}"/></ssv:Parameter></ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>"#
        )
    };
    let inner = r#"<ssd:Connectors><ssd:Connector name="in" kind="input"/></ssd:Connectors>"#
        .to_owned()
        + &parameters("1")
        + &root(&component("b", "../b.fmu", "u input", ""), &connection("in", "b.u", "", ""));
    bench.file("inner/Inner.ssd", ssd(&inner, ""));
    let from = |name: &str, rest: &str| {
        format!(
            r#"<ssd:Component name="{name}" type="application/x-ssp-definition" source="inner/Inner.ssd">{rest}</ssd:Component>"#
        )
    };
    let elements =
        component("a", "a.fmu", "y output", "") + &from("s", "") + &from("t", &parameters("2"));
    let connections = connection("a.y", "s.in", "", "") + &connection("a.y", "t.in", "", "");
    let opened = bench.open(&root(&elements, &connections), "").unwrap();
    assert_eq!(links(&opened.assembly), ["a.y -> s.b.u", "a.y -> t.b.u"]);
    assert_eq!(settings(&opened.assembly), ["s.b.p = 1.0", "t.b.p = 2.0"]);
    assert_eq!(opened.assembly.elements[1].fmu, opened.assembly.elements[2].fmu);
}

#[test]
fn an_ssp_in_an_ssp_is_opened_and_stays_inside_itself() {
    let bench = Bench::new();
    let [a, b] = fmus(&bench);
    let inner = |source: &str| {
        let system = r#"<ssd:Connectors><ssd:Connector name="in" kind="input"/></ssd:Connectors>"#
            .to_owned()
            + &root(&component("b", source, "u input", ""), &connection("in", "b.u", "", ""));
        ssd(&system, "").into_bytes()
    };
    let package = archive(
        &bench.path("inner.ssp"),
        &[
            ("SystemStructure.ssd", b"not read".to_vec()),
            ("Good.ssd", inner("resources/b.fmu")),
            ("Bad.ssd", inner("../a.fmu")),
            ("resources/b.fmu", b),
        ],
    );
    let package = fs::read(package).unwrap();
    let outer = |variant: &str| {
        let component_xml = format!(
            r#"<ssd:Component name="s" type="application/x-ssp-package" source="resources/inner.ssp#{variant}.ssd"/>"#
        );
        let elements = component("a", "resources/a.fmu", "y output", "") + &component_xml;
        let system = root(&elements, &connection("a.y", "s.in", "", ""));
        archive(
            &bench.path("outer.ssp"),
            &[
                ("SystemStructure.ssd", ssd(&system, "").into()),
                ("resources/a.fmu", a.clone()),
                ("resources/inner.ssp", package.clone()),
            ],
        )
    };
    assert_eq!(links(&open(&outer("Good")).unwrap().assembly), ["a.y -> s.b.u"]);
    let text = open(&outer("Bad")).unwrap_err().to_string();
    assert!(text.contains("outer.ssp/resources/inner.ssp/Bad.ssd: line "), "{text}");
    assert!(text.ends_with("\"../a.fmu\" leads out of the archive"), "{text}");
}

#[test]
fn one_system_is_used_twice_by_its_id() {
    let bench = Bench::new();
    fmus(&bench);
    let first = format!(
        r#"<ssd:System name="first" id="it">{}</ssd:System>"#,
        root(&component("b", "b.fmu", "", ""), "")
    );
    let second =
        r##"<ssd:Component name="second" type="application/x-ssp-definition" source="#it"/>"##;
    let opened = bench.open(&root(&(first.clone() + second), ""), "").unwrap();
    let names: Vec<_> =
        opened.assembly.elements.iter().map(|element| element.name.as_str()).collect();
    assert_eq!(names, ["first.b", "second.b"]);
    let text = bench.refusal(&root(&(first + &second.replace("#it", "#that")), ""), "");
    assert!(text.ends_with("no system has the id \"that\""), "{text}");
}

#[test]
fn systems_that_contain_themselves_are_refused_soon() {
    let bench = Bench::new();
    let body = r##"<ssd:System name="s" id="it"><ssd:Elements><ssd:Component name="a" source="#it"/><ssd:Component name="b" source="#it"/></ssd:Elements></ssd:System>"##;
    let text = bench.refusal(&root(body, ""), "");
    assert!(text.ends_with("systems are nested in each other 64 times"), "{text}");
    // 2 x 2 x ... 2 systems, 40 levels.
    let level = |k: usize| {
        let next = k + 1;
        format!(
            r##"<ssd:System name="s{k}" id="i{k}"><ssd:Elements><ssd:Component name="a" source="#i{next}"/><ssd:Component name="b" source="#i{next}"/></ssd:Elements></ssd:System>"##
        )
    };
    let levels: String = (0..40).map(level).collect();
    let last = r#"<ssd:System name="s40" id="i40"/>"#;
    let text = bench.refusal(&root(&(levels + last), ""), "");
    assert!(text.starts_with("expected at most 100000 elements, found more; this limit"), "{text}");
}

#[test]
fn what_cannot_be_found_or_run_is_said_with_its_place() {
    let bench = Bench::new();
    fmus(&bench);
    bench.file("half.fmu", "PK");
    let web = component("a", "https://x.org/a.fmu", "", "");
    for (elements, expected) in [
        (component("a", "none.fmu", "", ""), "none.fmu"),
        (component("a", "half.fmu", "", ""), "is no ZIP archive that can be used"),
        (web, "has the scheme https, expected a relative path or file:"),
        (
            "<ssd:Oops/>".to_owned(),
            "expected Component, System and SignalDictionaryReference, found Oops at line ",
        ),
    ] {
        let text = bench.refusal(&root(&elements, ""), "");
        assert!(text.contains(expected), "{text}");
    }
    let exchange = r#"<ssd:Component name="a" source="a.fmu" implementation="ModelExchange"/>"#;
    let warnings = bench.open(&root(exchange, ""), "").unwrap().warnings.join("\n");
    let expected = "a: the system structure asks for model exchange, which cannot be run with this \
                    FMU: its co-simulation is used";
    assert!(warnings.contains(expected), "{warnings}");
    let missing = bench.path("Nothing.ssd");
    assert!(open(&missing).unwrap_err().to_string().starts_with("cannot read"));
}

#[test]
fn two_components_of_one_hierarchical_name_are_refused() {
    let bench = Bench::new();
    fmus(&bench);
    let inner = format!(
        r#"<ssd:System name="x">{}</ssd:System>"#,
        root(&component("a", "a.fmu", "", ""), "")
    );
    let text = bench.refusal(&root(&(inner + &component("x.a", "a.fmu", "", "")), ""), "");
    assert!(text.ends_with("two components have the hierarchical name x.a"), "{text}");
}

#[test]
fn errors_in_referred_files_name_that_file() {
    let bench = Bench::new();
    fmus(&bench);
    let bindings = |source: &str| {
        format!(
            r#"<ssd:ParameterBindings><ssd:ParameterBinding source="{source}"/></ssd:ParameterBindings>"#
        )
    };
    let file = bench.file(
        "p.ssv",
        ssv("<ssv:Parameter name=\"x\">\n <ssv:Real value=\"1,5\"/></ssv:Parameter>"),
    );
    let elements = component("a", "a.fmu", "", &bindings("p.ssv"));
    let text = bench.refusal(&root(&elements, ""), "");
    let expected = format!(
        "{}: line 5, column 2: <Real>: expected a finite number in the attribute value, found \"1,5\"",
        file.display()
    );
    assert_eq!(text, expected);
}

#[test]
fn a_folder_is_opened_by_its_default_ssd() {
    let bench = Bench::new();
    fmus(&bench);
    bench.file("SystemStructure.ssd", ssd(&pair("a.fmu", "b.fmu"), ""));
    let folder = bench.path("");
    assert_eq!(links(&open(&folder).unwrap().assembly), ["a.y -> b.u"]);
}
