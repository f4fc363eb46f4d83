//! SSP 2.0, and what other tools write against the rules.

use std::fs;
use std::io::Write as _;

use fmu_description::Version;
use fmu_description::package::{Package, platforms_of};
use ssp::structure::{ConnectorKind, Dimension, Element, ParameterValue, Type};
use ssp::{open, read_ssd, read_ssv, render_ssd, render_ssv, write};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use crate::bench::{Bench, component, connection, links, root, settings, ssd, ssv};
use crate::writing::entry;

/// The same text as SSP 2.0.
fn newer(text: &str) -> String {
    text.replace("version=\"1.0\"\n", "version=\"2.0\"\n")
        .replace("\"set\" version=\"1.0\"", "\"set\" version=\"2.0\"")
}

fn fmus(bench: &Bench) {
    bench.fmu("a.fmu", "y output Real\nn output Integer\np parameter Real\nq parameter Integer");
    bench.fmu("b.fmu", "u input Real\nn input Integer");
}

#[test]
fn the_types_of_ssp_2_are_those_of_fmi_2_where_both_have_them() {
    let bench = Bench::new();
    fmus(&bench);
    let parameters = r#"<ssv:Parameter name="p"><ssv:Float64 value="2.5"/></ssv:Parameter>
<ssv:Parameter name="q"><ssv:UInt64 value="7"/></ssv:Parameter>"#;
    bench.file("p.ssv", newer(&ssv(parameters)));
    let bindings =
        r#"<ssd:ParameterBindings><ssd:ParameterBinding source="p.ssv"/></ssd:ParameterBindings>"#;
    let one = r#"<ssc:Float64/><ssc:Dimension size="1"/>"#;
    let meta = r#"<ssc:MetaData kind="quality" type="text/plain" source="m.txt"/>
<ssc:Signature role="authenticity" type="x" source="s"/>"#;
    let elements = component(
        "a",
        "a.fmu",
        &format!("y output {one}\nn output <ssc:Int16/>"),
        &(bindings.to_owned() + meta),
    ) + &component("b", "b.fmu", "u unspecified\nn input <ssc:UInt8/>", "");
    let connections = connection("b.u", "a.y", "", "") + &connection("a.n", "b.n", "", "");
    let path = bench.file("System.ssd", newer(&ssd(&root(&elements, &connections), "")));
    let opened = open(&path).unwrap();
    assert_eq!(links(&opened.assembly), ["a.y -> b.u", "a.n -> b.n"]);
    assert_eq!(settings(&opened.assembly), ["a.p = 2.5", "a.q = 7"]);
    let warnings = opened.warnings.join("\n");
    assert!(warnings.contains("the signature of <Component> is not verified"), "{warnings}");
    assert_eq!(opened.warnings.len(), 1, "{warnings}");
}

#[test]
fn what_fmi_2_does_not_have_is_named_and_refused_where_it_is_connected() {
    let bench = Bench::new();
    fmus(&bench);
    let array = r#"<ssc:Real/><ssc:Dimension size="3"/><ssc:Dimension sizeConnector="m"/>"#;
    for (kind, words) in [
        (array, "an array of 3 x m elements"),
        ("<ssc:Clock intervalVariability='constant'/>", "a clock"),
        ("<ssc:Real/><ssd:Clock name='c'/>", "a value of the clock c"),
    ] {
        let elements = component("a", "a.fmu", &format!("y output {kind}"), "")
            + &component("b", "b.fmu", "u input", "");
        let opened = bench.open(&root(&elements, ""), "").unwrap();
        let expected = format!("a.y is {words}, which FMI 2.0 does not have: skipped");
        assert_eq!(opened.warnings, [expected]);
        let text = bench.refusal(&root(&elements, &connection("a.y", "b.u", "", "")), "");
        let expected =
            format!("a.y is {words}, which FMI 2.0 does not have, so it cannot be connected");
        assert!(text.ends_with(&expected), "{text}");
    }
    // Dymola writes Binary for the types of Modelica, such as Modelica.Units.SI.Time: the FMU decides.
    let elements = component("a", "a.fmu", "y output <ssc:Binary/>", "")
        + &component("b", "b.fmu", "u input", "");
    let opened = bench.open(&root(&elements, &connection("a.y", "b.u", "", "")), "").unwrap();
    assert_eq!(links(&opened.assembly), ["a.y -> b.u"]);
    assert_eq!(
        opened.warnings,
        ["a.y is of type Binary in the system structure and Real in the FMU"]
    );
    let elements = component("a", "a.fmu", "", "") + &component("b", "b.fmu", "", "");
    let part = connection("a.y", "b.u", "", "startIndices=\"1\"");
    let text = bench.refusal(&root(&elements, &part), "");
    let expected = "expected a connection of scalars, as FMI 2.0 has no arrays, found the attribute startIndices";
    assert!(text.ends_with(expected), "{text}");
    for (name, value, words) in [
        ("p", r#"<ssv:Real value="1 2 3"/>"#, "Real, found an array of 3 elements"),
        ("q", r#"<ssv:UInt64 value="2147483648"/>"#, "Integer, found 2147483648"),
    ] {
        let parameter = format!(r#"<ssv:Parameter name="{name}">{value}</ssv:Parameter>"#);
        bench.file("p.ssv", ssv(&parameter));
        let bindings = r#"<ssd:ParameterBindings><ssd:ParameterBinding source="p.ssv"/></ssd:ParameterBindings>"#;
        let text = bench.refusal(&root(&component("a", "a.fmu", "", bindings), ""), "");
        assert!(text.ends_with(&format!("expected a value of type {words}")), "{text}");
    }
}

/// An FMU of FMI 3.0 with these variables.
fn fmu_of_fmi_3(bench: &Bench, model: &str, variables: &str, structure: &str) {
    let mut package = Package::new(format!(
        r#"<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="3.0" modelName="{model}" instantiationToken="t"><CoSimulation modelIdentifier="{model}"/><UnitDefinitions><Unit name="m"><BaseUnit m="1"/></Unit><Unit name="mm"><BaseUnit m="1" factor="0.001"/></Unit></UnitDefinitions><ModelVariables><Float64 name="time" valueReference="0" causality="independent"/>{variables}</ModelVariables><ModelStructure>{structure}</ModelStructure></fmiModelDescription>"#
    ))
    .for_version(Version::V3);
    let library = format!("binaries/{}/{model}.so", platforms_of(Version::V3)[0]);
    package.add(library, "not a library");
    package.write(&bench.path(&format!("{model}.fmu"))).unwrap();
}

#[test]
fn numbers_of_every_width_of_fmi_3_have_units_and_transformations() {
    let bench = Bench::new();
    let outputs = r#"<Float32 name="y" valueReference="1" causality="output" unit="mm"/>
<Int8 name="n" valueReference="2" causality="output"/>"#;
    let structure = r#"<Output valueReference="1"/><Output valueReference="2"/>"#;
    fmu_of_fmi_3(&bench, "a", outputs, structure);
    let inputs = r#"<Float32 name="u" valueReference="1" causality="input" unit="m" start="0"/>
<UInt16 name="n" valueReference="2" causality="input" start="0"/>"#;
    fmu_of_fmi_3(&bench, "b", inputs, "");
    let elements = component("a", "a.fmu", "y output <ssc:Float32/>\nn output <ssc:Int8/>", "")
        + &component("b", "b.fmu", "u input\nn input <ssc:UInt16/>", "");
    let mapping = r#"<ssc:IntegerMappingTransformation><ssc:MapEntry source="1" target="2"/></ssc:IntegerMappingTransformation>"#;
    let connections = connection("a.y", "b.u", "", "") + &connection("a.n", "b.n", mapping, "");
    let opened = bench.open(&root(&elements, &connections), "").unwrap();
    let expected = ["a.y -> b.u * 0.001 + 0.0", "a.n -> b.n [(1, 2)]"];
    assert_eq!(links(&opened.assembly), expected);
    assert!(!opened.warnings.join("\n").contains("of type"), "{:?}", opened.warnings);
}

#[test]
fn connectors_of_arrays_are_written_with_their_dimensions() {
    let bench = Bench::new();
    let outputs = r#"<UInt64 name="n" valueReference="2" causality="structuralParameter" variability="fixed" start="2"/>
<Float64 name="y" valueReference="1" causality="output" unit="mm"><Dimension start="3"/><Dimension valueReference="2"/></Float64>"#;
    fmu_of_fmi_3(&bench, "a", outputs, r#"<Output valueReference="1"/>"#);
    let input = r#"<Float64 name="u" valueReference="1" causality="input" unit="m" start="0 0 0 0 0 0"><Dimension start="3"/><Dimension start="2"/></Float64>"#;
    fmu_of_fmi_3(&bench, "b", input, "");
    let elements =
        component("a", "a.fmu", "y output", "") + &component("b", "b.fmu", "u input", "");
    let opened = bench.open(&root(&elements, &connection("a.y", "b.u", "", "")), "").unwrap();
    let path = bench.path("x.ssp");
    write(&opened.assembly, None, &path).unwrap();
    let text = String::from_utf8(entry(&path, "SystemStructure.ssd")).unwrap();
    assert!(text.contains("version=\"2.0\""), "{text}");
    let structure = read_ssd(text.as_bytes()).unwrap().0;
    let written = structure.system.elements.iter();
    let kinds = written.map(|element| element.base().connectors[0].kind_of_value.clone());
    let expected = [Dimension::Open, Dimension::Size(2)]
        .map(|second| Some(Type::Array(vec![Dimension::Size(3), second])));
    assert_eq!(kinds.collect::<Vec<_>>(), expected);
    let again = open(&path).unwrap();
    assert_eq!(links(&again.assembly), ["a.y -> b.u * 0.001 + 0.0"]);
    assert_eq!(again.warnings, [""; 0]);
}

#[test]
fn integers_of_64_bits_are_set_to_the_last_digit() {
    let bench = Bench::new();
    let variable = r#"<Int64 name="n" valueReference="1" causality="parameter" variability="fixed" start="0"/>"#;
    fmu_of_fmi_3(&bench, "a", variable, "");
    // -2^63
    let value =
        r#"<ssv:Parameter name="n"><ssv:Int64 value="-9223372036854775808"/></ssv:Parameter>"#;
    bench.file("p.ssv", newer(&ssv(value)));
    let bindings =
        r#"<ssd:ParameterBindings><ssd:ParameterBinding source="p.ssv"/></ssd:ParameterBindings>"#;
    let opened = bench.open(&root(&component("a", "a.fmu", "", bindings), ""), "").unwrap();
    assert_eq!(settings(&opened.assembly), ["a.n = -9223372036854775808"]);
}

#[test]
fn a_component_without_a_source_is_its_connectors_only() {
    let bench = Bench::new();
    fmus(&bench);
    let idea = r#"<ssd:Component name="idea" type="text/x-modelica"><ssd:Connectors><ssd:Connector name="y" kind="output"/></ssd:Connectors></ssd:Component>"#;
    let elements = idea.to_owned() + &component("b", "b.fmu", "u input", "");
    let opened = bench.open(&root(&elements, &connection("idea.y", "b.u", "", "")), "").unwrap();
    assert!(links(&opened.assembly).is_empty());
    let warnings = opened.warnings.join("\n");
    assert!(
        warnings.contains("idea has no source: it is nothing but its connectors"),
        "{warnings}"
    );
    assert!(warnings.contains("b.u is connected to idea.y, which nothing drives"), "{warnings}");
}

#[test]
fn one_element_with_a_text_states_a_single_value() {
    let values = r#"<ssv:Parameter name="a"><ssv:String><ssv:Value value="x y"/></ssv:String></ssv:Parameter>
<ssv:Parameter name="b"><ssv:Enumeration><ssv:Value value="on"/></ssv:Enumeration></ssv:Parameter>"#;
    let set = read_ssv(newer(&ssv(values)).as_bytes()).unwrap().0;
    assert_eq!(set.parameters[0].value, ParameterValue::String("x y".to_owned()));
    assert_eq!(set.parameters[1].value, ParameterValue::Enumeration("on".to_owned(), None));
}

#[test]
fn what_is_of_ssp_2_is_written_as_ssp_2_and_reads_back() {
    let connectors = "c constant\ns structuralParameter\nl local\nx unspecified\n\
        a output <ssc:Dimension size=\"2\"/><ssc:Dimension/>\nk input <ssc:Clock/>\n\
        t input <ssd:Clock name=\"k\"/>";
    let text = newer(&ssd(&root(&component("a", "a.fmu", connectors, ""), ""), ""));
    let structure = read_ssd(text.as_bytes()).unwrap().0;
    let Element::Component(read) = &structure.system.elements[0] else { panic!("no component") };
    assert_eq!(read.base.connectors[1].kind, ConnectorKind::StructuralParameter);
    let expected = Type::Array(vec![Dimension::Size(2), Dimension::Open]);
    assert_eq!(read.base.connectors[4].kind_of_value, Some(expected));
    let written = render_ssd(&structure);
    assert!(written.contains("version=\"2.0\""), "{written}");
    assert_eq!(read_ssd(written.as_bytes()).unwrap().0, structure);
    let values = r#"<ssv:Parameter name="a"><ssv:Boolean value="true false"/></ssv:Parameter>
<ssv:Parameter name="b"><ssv:String><ssv:Value value="x y"/><ssv:Value value="z"/></ssv:String></ssv:Parameter>
<ssv:Parameter name="c"><ssv:Int64 value="-9000000000"/></ssv:Parameter>
<ssv:Parameter name="d"><ssv:UInt64 value="18446744073709551615"/></ssv:Parameter>"#;
    let set = read_ssv(ssv(values).as_bytes()).unwrap().0;
    assert_eq!(set.parameters[2].value, ParameterValue::Long(-9_000_000_000));
    let words = ["x y".to_owned(), "z".to_owned()];
    assert_eq!(set.parameters[1].value, ParameterValue::Array("String".to_owned(), words.into()));
    let written = render_ssv(&set);
    assert!(written.contains("version=\"2.0\""), "{written}");
    assert!(written.contains("<ssv:UInt64 value=\"18446744073709551615\"/>"), "{written}");
    assert_eq!(read_ssv(written.as_bytes()).unwrap().0, set);
}

#[test]
fn an_undeclared_prefix_and_empty_elements_are_read_with_a_warning() {
    let bench = Bench::new();
    fmus(&bench);
    let step = r#"<ssd:DefaultExperiment><ssd:Annotations><ssc:Annotation type="com.opensimulationplatform"><osp:Algorithm><osp:FixedStepAlgorithm baseStepSize="1e-3"/></osp:Algorithm></ssc:Annotation></ssd:Annotations></ssd:DefaultExperiment>"#;
    let connectors =
        r#"<ssd:Connectors><ssd:Connector name="out" kind="output"/></ssd:Connectors>"#;
    let connections =
        r#"<ssd:Connection startElement="a" startConnector="y" endElement="" endConnector="out"/>"#;
    let system =
        connectors.to_owned() + &root(&component("a", "a.fmu", "y output", ""), connections);
    let text = ssd(&system, step);
    let text =
        text.replace(" xmlns:osp=\"http://opensimulationplatform.com/SSP/OSPAnnotations\"", "");
    let opened = open(&bench.file("System.ssd", text)).unwrap();
    assert_eq!(opened.experiment.step_size, Some(1e-3));
    assert!(opened.fixed_step);
    let warnings = opened.warnings.join("\n");
    assert!(warnings.contains("the prefix osp: is used without xmlns:osp"), "{warnings}");
    assert_eq!(opened.warnings.len(), 1, "{warnings}");
}

#[test]
fn elements_and_attributes_that_the_standard_does_not_have_are_named() {
    let bench = Bench::new();
    fmus(&bench);
    let twice = r#"<ssd:Connectors><ssd:Connector name="n" kind="output"/></ssd:Connectors>"#;
    let extra = twice.to_owned() + "<ssd:Colour/><ssd:Colour/>";
    let elements = component("a", "a.fmu", "y output", &extra)
        .replace("<ssd:Component ", "<ssd:Component colour='red' ");
    let opened = bench.open(&root(&elements, ""), "").unwrap();
    let warnings = opened.warnings.join("\n");
    for expected in [
        "<Component> has the attribute \"colour\", which is skipped",
        "<Component> has the element <Colour>, which is skipped (2 times)",
        "<Component> has a second element <Connectors>: both are read",
    ] {
        assert!(warnings.contains(expected), "{warnings}");
    }
}

#[test]
fn unknown_attributes_in_the_files_of_parameters_are_named() {
    let bench = Bench::new();
    fmus(&bench);
    let value = r#"<ssv:Parameter name="k"><ssv:Real value="1" units="mm"/></ssv:Parameter>"#;
    bench.file("p.ssv", ssv(value));
    bench.file(
        "m.ssm",
        r#"<ssm:ParameterMapping version="1.0" xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping" xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon">
<ssm:MappingEntry source="k" target="p" suppressUnits="true"><ssc:LinearTransformation scale="2"/></ssm:MappingEntry></ssm:ParameterMapping>"#,
    );
    let bindings = r#"<ssd:ParameterBindings><ssd:ParameterBinding source="p.ssv"><ssd:ParameterMapping source="m.ssm"/></ssd:ParameterBinding></ssd:ParameterBindings>"#;
    let opened = bench.open(&root(&component("a", "a.fmu", "", bindings), ""), "").unwrap();
    let warnings = opened.warnings.join("\n");
    for expected in [
        "<Real> has the attribute \"units\", which is skipped",
        "<MappingEntry> has the attribute \"suppressUnits\", which is skipped",
        "<LinearTransformation> has the attribute \"scale\", which is skipped",
    ] {
        assert!(warnings.contains(expected), "{warnings}");
    }
}

#[test]
fn two_values_of_one_parameter_are_named_and_the_last_one_counts() {
    let bench = Bench::new();
    fmus(&bench);
    let value = |value: &str| {
        format!(r#"<ssv:Parameter name="p"><ssv:Real value="{value}"/></ssv:Parameter>"#)
    };
    bench.file("p.ssv", ssv(&(value("1") + &value("2"))));
    let bindings =
        r#"<ssd:ParameterBindings><ssd:ParameterBinding source="p.ssv"/></ssd:ParameterBindings>"#;
    let opened = bench.open(&root(&component("a", "a.fmu", "", bindings), ""), "").unwrap();
    assert_eq!(settings(&opened.assembly), ["a.p = 2.0"]);
    let expected = "parameter set \"set\" has different values for p: the last one counts";
    assert_eq!(opened.warnings, [expected]);
}

#[test]
fn archives_with_backslashes_are_read_and_messages_name_files_by_their_place_in_the_archive() {
    let bench = Bench::new();
    let fmu = fs::read(bench.fmu("a.fmu", "y output Real")).unwrap();
    let path = bench.path("x.ssp");
    let write = |fmu: &[u8]| {
        let mut archive = ZipWriter::new(fs::File::create(&path).unwrap());
        let elements = component("a", "resources/a.fmu", "y output", "");
        for (name, bytes) in [
            ("resources\\a.fmu", fmu),
            ("./SystemStructure.ssd", ssd(&root(&elements, ""), "").as_bytes()),
        ] {
            archive.start_file(name, SimpleFileOptions::default()).unwrap();
            archive.write_all(bytes).unwrap();
        }
        archive.finish().unwrap();
    };
    write(&fmu);
    let opened = open(&path).unwrap();
    let shown = path.join("resources/a.fmu");
    assert_eq!(opened.assembly.elements[0].shown(), shown);
    let expected = "x.ssp: 2 entries have a path with backslashes or . in the archive";
    assert!(opened.warnings[0].contains(expected), "{:?}", opened.warnings);
    write(b"no archive");
    let text = open(&path).unwrap_err().to_string();
    assert_eq!(text, format!("{} is no ZIP archive that can be used", shown.display()));
}
