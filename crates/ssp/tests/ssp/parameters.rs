//! Parameter bindings: names, precedence, mappings, values.

use crate::bench::{Bench, component, connection, connectors, root, settings, ssv, system};

const VARIABLES: &str = r#"p parameter Real unit="m"
 q parameter Real
 n parameter Integer
 b parameter Boolean
 s parameter String
 g parameter Enumeration declaredType="Gear"
 u input Real unit="m"
 y output Real
 z output Real start="1"
 k constant Real start="9"
 sub.p parameter Real"#;

fn real(name: &str, value: &str) -> String {
    format!(r#"<ssv:Parameter name="{name}"><ssv:Real value="{value}"/></ssv:Parameter>"#)
}

/// A binding with these parameters inline.
fn binding(attributes: &str, parameters: &str, mapping: &str) -> String {
    let mapping = if mapping.is_empty() {
        String::new()
    } else {
        format!(
            r#"<ssd:ParameterMapping><ssm:ParameterMapping version="1.0">{mapping}</ssm:ParameterMapping></ssd:ParameterMapping>"#
        )
    };
    format!(
        r#"<ssd:ParameterBinding {attributes}><ssd:ParameterValues><ssv:ParameterSet version="1.0" name="set"><ssv:Parameters>{parameters}</ssv:Parameters><ssv:Units><ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit><ssc:Unit name="K"><ssc:BaseUnit K="1"/></ssc:Unit></ssv:Units></ssv:ParameterSet></ssd:ParameterValues>{mapping}</ssd:ParameterBinding>"#
    )
}

fn bindings(list: &[String]) -> String {
    format!("<ssd:ParameterBindings>{}</ssd:ParameterBindings>", list.concat())
}

fn bench() -> Bench {
    let bench = Bench::new();
    bench.fmu("a.fmu", VARIABLES);
    bench
}

/// The settings of one component `c` with these bindings.
fn of_component(list: &[String]) -> Result<(Vec<String>, Vec<String>), String> {
    let bench = bench();
    let elements = component("c", "a.fmu", "u input", &bindings(list));
    match bench.open(&root(&elements, ""), "") {
        Ok(opened) => Ok((settings(&opened.assembly), opened.warnings)),
        Err(_) => Err(bench.refusal(&root(&elements, ""), "")),
    }
}

#[test]
fn later_bindings_win_over_earlier_ones_and_outer_ones_over_inner_ones() {
    let bench = bench();
    let inner = component(
        "c",
        "a.fmu",
        "",
        &bindings(&[
            binding("", &(real("p", "1") + &real("q", "1") + &real("u", "1")), ""),
            binding("", &(real("q", "2") + &real("u", "2")), ""),
        ]),
    );
    let middle = system("m", "", &inner, "").replace("<ssd:Connections></ssd:Connections>", "");
    let (head, tail) = middle.split_once("<ssd:Elements>").unwrap();
    let middle =
        format!("{head}{}<ssd:Elements>{tail}", bindings(&[binding("", &real("c.u", "3"), "")]));
    let outer = bindings(&[binding("", &real("m.c.sub.p", "4"), "")]);
    let opened = bench.open(&(outer + &root(&middle, "")), "").unwrap();
    let mut actual = settings(&opened.assembly);
    actual.sort();
    assert_eq!(actual, ["m.c.p = 1.0", "m.c.q = 2.0", "m.c.sub.p = 4.0", "m.c.u = 3.0"]);
    let outermost = bindings(&[binding("", &real("m.c.u", "5"), "")]);
    let opened = bench.open(&(outermost + &root(&middle, "")), "").unwrap();
    assert!(settings(&opened.assembly).contains(&"m.c.u = 5.0".to_owned()));
}

#[test]
fn a_prefix_stands_before_every_name_of_the_source() {
    let bench = bench();
    let elements = component("c", "a.fmu", "", "") + &component("d", "a.fmu", "", "");
    let outer = bindings(&[
        binding(r#"prefix="d.""#, &(real("p", "1") + &real("x", "9")), ""),
        binding(
            r#"prefix="c.""#,
            &real("k", "2"),
            r#"<ssm:MappingEntry source="c.k" target="c.q"/><ssm:MappingEntry source="k" target="c.p"/>"#,
        ),
    ]);
    let opened = bench.open(&(outer + &root(&elements, "")), "").unwrap();
    assert_eq!(settings(&opened.assembly), ["c.q = 2.0", "d.p = 1.0"]);
    assert_eq!(
        opened.warnings,
        [
            "parameter set \"set\": the system has no d.x: ignored",
            "parameter set \"set\": with the prefix \"c.\", it has no k: ignored"
        ]
    );
}

#[test]
fn a_name_that_means_two_variables_sets_both() {
    // `x.c` with variable `p`, and system `x` with component `c`.
    let bench = bench();
    let nested = system("x", "", &component("c", "a.fmu", "", ""), "")
        .replace("<ssd:Connections></ssd:Connections>", "");
    let elements = nested + &component("x.c.sub", "a.fmu", "", "");
    let outer = bindings(&[binding("", &real("x.c.sub.p", "6"), "")]);
    let opened = bench.open(&(outer + &root(&elements, "")), "").unwrap();
    assert_eq!(settings(&opened.assembly), ["x.c.sub.p = 6.0", "x.c.sub.p = 6.0"]);
    let names: Vec<_> =
        opened.assembly.elements.iter().map(|element| element.name.as_str()).collect();
    assert_eq!(names, ["x.c", "x.c.sub"]);
}

#[test]
fn with_a_mapping_only_what_it_maps_is_applied_converted_then_transformed() {
    // 250 mm are 0.25 m; 4 x 0.25 + 1 = 2. Suppressed: 4 x 250 + 1 = 1001.
    let parameters =
        r#"<ssv:Parameter name="length"><ssv:Real value="250" unit="mm"/></ssv:Parameter>"#
            .to_owned()
            + &real("q", "3");
    let linear = r#"<ssc:LinearTransformation factor="4" offset="1"/>"#;
    let entry = |target: &str, attribute: &str, rest: &str| {
        format!(
            r#"<ssm:MappingEntry source="length" target="{target}" {attribute}>{rest}</ssm:MappingEntry>"#
        )
    };
    let mapping = entry("p", "", linear)
        + &entry("u", r#"suppressUnitConversion="true""#, linear)
        + &entry("sub.p", "", "");
    let (actual, warnings) = of_component(&[binding("", &parameters, &mapping)]).unwrap();
    assert_eq!(actual, ["c.p = 2.0", "c.u = 1001.0", "c.sub.p = 250.0"]);
    assert_eq!(warnings, [""; 0]);
}

#[test]
fn values_take_the_type_of_their_variable() {
    let parameter = |name: &str, kind: &str, value: &str| {
        format!(r#"<ssv:Parameter name="{name}"><ssv:{kind} value="{value}"/></ssv:Parameter>"#)
    };
    let all = parameter("p", "Integer", "3")
        + &parameter("n", "Real", "-4.0")
        + &parameter("b", "Boolean", "1")
        + &parameter("s", "String", "a &amp; b")
        + &parameter("g", "Enumeration", "high");
    let (actual, _) = of_component(&[binding("", &all, "")]).unwrap();
    assert_eq!(actual, ["c.p = 3", "c.n = -4", "c.b = true", "c.s = a & b", "c.g = 2"]);
    for (name, kind, value, expected) in [
        ("n", "Real", "4.5", "expected a value of type Integer, found 4.5"),
        ("p", "Boolean", "true", "expected a value of type Real, found true"),
        ("s", "Binary", "00ff", "expected a value of type String, found binary data"),
        ("g", "Enumeration", "middle", "expected an item of low, high, found \"middle\""),
    ] {
        let text = of_component(&[binding("", &parameter(name, kind, value), "")]).unwrap_err();
        assert!(text.ends_with(&format!("parameter {name} for c.{name}: {expected}")), "{text}");
    }
    let kelvin = r#"<ssv:Parameter name="p"><ssv:Real value="1" unit="K"/></ssv:Parameter>"#;
    let text = of_component(&[binding("", kelvin, "")]).unwrap_err();
    assert!(text.ends_with("K and m are units of different quantities"), "{text}");
}

#[test]
fn names_of_items_are_mapped_without_their_numbers() {
    let parameter = r#"<ssv:Parameter name="g"><ssv:Enumeration value="schnell"/></ssv:Parameter>"#;
    let mapping = r#"<ssm:MappingEntry source="g" target="g"><ssc:EnumerationMappingTransformation><ssc:MapEntry source="schnell" target="high"/></ssc:EnumerationMappingTransformation></ssm:MappingEntry>"#;
    let (actual, _) = of_component(&[binding("", parameter, mapping)]).unwrap();
    assert_eq!(actual, ["c.g = 2"]);
}

#[test]
fn variables_without_a_start_value_are_left_alone_with_a_word() {
    let (actual, warnings) = of_component(&[binding(
        "",
        &["y", "z", "w", "k"].map(|name| real(name, "2")).concat(),
        "",
    )])
    .unwrap();
    assert_eq!(actual, ["c.z = 2.0"]);
    assert_eq!(
        warnings,
        [
            "c.y is output and continuous without a start value: its setting is ignored",
            "c.k is a constant: its setting is ignored",
            "parameter set \"set\": c has no w: ignored"
        ]
    );
}

#[test]
fn a_connector_of_a_system_passes_its_value_on_to_what_it_is_connected_to() {
    // In: m -> mm, then doubled. Out: shows 3 z + 1, so 7 means z = 2.
    let bench = bench();
    bench.fmu("mm.fmu", r#"u input Real unit="mm""#);
    let double = r#"<ssc:LinearTransformation factor="2"/>"#;
    let triple = r#"<ssc:LinearTransformation factor="3" offset="1"/>"#;
    let elements =
        component("c", "a.fmu", "u input\nz output", "") + &component("d", "mm.fmu", "u input", "");
    let inner = system(
        "s",
        "in input\nout output",
        &elements,
        &(connection("in", "c.u", "", "")
            + &connection("in", "d.u", double, "")
            + &connection("c.z", "out", triple, "")),
    );
    let parameters =
        r#"<ssv:Parameter name="s.in"><ssv:Real value="500" unit="mm"/></ssv:Parameter>"#
            .to_owned()
            + &real("s.out", "7");
    let outer = bindings(&[binding("", &parameters, "")]);
    let opened = bench.open(&(outer + &root(&inner, "")), "").unwrap();
    let mut actual = settings(&opened.assembly);
    actual.sort();
    // 500 mm are 0.5 m and 500 mm, the latter doubled.
    assert_eq!(actual, ["s.c.u = 0.5", "s.c.z = 2.0", "s.d.u = 1000.0"]);
}

#[test]
fn a_structural_parameter_of_a_system_sets_what_it_is_connected_to() {
    let bench = bench();
    let inner = system(
        "s",
        "size structuralParameter",
        &component("c", "a.fmu", "q parameter", ""),
        &connection("size", "c.q", "", ""),
    );
    let outer = bindings(&[binding("", &real("s.size", "3"), "")]);
    let opened = bench.open(&(outer + &root(&inner, "")), "").unwrap();
    assert_eq!(settings(&opened.assembly), ["s.c.q = 3.0"]);
}

#[test]
fn values_and_mappings_may_stand_in_files_of_their_own_and_inside_the_fmu() {
    let bench = bench();
    bench.file("sets/a%20b.ssv", "");
    bench.file("sets/a b.ssv", ssv(&real("k", "5")));
    bench.file(
        "maps/m.ssm",
        r#"<m:ParameterMapping version="1.0" xmlns:m="http://ssp-standard.org/SSP1/SystemStructureParameterMapping"><m:MappingEntry source="k" target="q"/></m:ParameterMapping>"#,
    );
    let list = bindings(&[
        r#"<ssd:ParameterBinding source="sets/a%20b.ssv"><ssd:ParameterMapping source="maps/m.ssm"/></ssd:ParameterBinding>"#.to_owned(),
        r#"<ssd:ParameterBinding source="resources/inner.ssv" sourceBase="component"/>"#.to_owned(),
    ]);
    let elements = component("c", "a.fmu", "", &list);
    let opened = bench.open(&root(&elements, ""), "").unwrap();
    assert_eq!(settings(&opened.assembly), ["c.q = 5.0", "c.p = 7.0"]);
    let text = bench.refusal(&(list + &root(&component("c", "a.fmu", "", ""), "")), "");
    assert!(text.ends_with("a system has no component that sourceBase could mean"), "{text}");
}

#[test]
fn many_unknown_names_are_one_warning() {
    let many: String = (0..30).map(|k| real(&format!("x{k}"), "1")).collect();
    let (actual, warnings) = of_component(&[binding("", &many, "")]).unwrap();
    assert_eq!(actual, [""; 0]);
    assert_eq!(
        warnings,
        ["parameter set \"set\": c has no x0, x1, x2, x3, x4 and 25 more: ignored"]
    );
}

#[test]
fn a_value_for_a_connector_that_leads_nowhere_changes_nothing() {
    let bench = bench();
    let system = connectors("in input")
        + &bindings(&[binding("", &real("in", "1"), "")])
        + &root(&component("c", "a.fmu", "", ""), "");
    let opened = bench.open(&system, "").unwrap();
    assert_eq!(settings(&opened.assembly), [""; 0]);
}

#[test]
fn a_parameter_set_of_another_namespace_of_ssp_is_read_with_a_warning() {
    let bench = bench();
    let set = ssv(&real("q", "2.5")).replace("SystemStructureParameterValues", "ParameterValues");
    bench.file("q.ssv", set);
    let list = bindings(&[r#"<ssd:ParameterBinding source="q.ssv"/>"#.to_owned()]);
    let opened = bench.open(&root(&component("c", "a.fmu", "", &list), ""), "").unwrap();
    assert_eq!(settings(&opened.assembly), ["c.q = 2.5"]);
    let warnings = opened.warnings.join("\n");
    let expected = "found \"http://ssp-standard.org/SSP1/ParameterValues\"";
    assert!(opened.warnings.len() == 1 && warnings.ends_with(expected), "{warnings}");
}
