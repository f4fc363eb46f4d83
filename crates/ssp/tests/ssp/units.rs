//! Units and mappings on connections.

use crate::bench::{Bench, component, connection, links, root, system};

/// One output of the type `from`, one input of the type `to`, connected: links or refusal.
fn connected(from: &str, to: &str, rest: &str, attributes: &str) -> Result<Vec<String>, String> {
    let bench = Bench::new();
    bench.fmu("a.fmu", &format!("y output {from}"));
    bench.fmu("b.fmu", &format!("u input {to}"));
    let elements =
        component("a", "a.fmu", "y output", "") + &component("b", "b.fmu", "u input", "");
    let system = root(&elements, &connection("a.y", "b.u", rest, attributes));
    match bench.open(&system, "") {
        Ok(opened) => Ok([links(&opened.assembly), opened.warnings].concat()),
        Err(_) => Err(bench.refusal(&system, "").split_once(": ").unwrap().1.to_owned()),
    }
}

fn real(unit: &str) -> String {
    format!(r#"Real unit="{unit}""#)
}

#[test]
fn units_of_the_fmus_are_converted() {
    for (from, to, expected) in [
        ("mm", "m", "a.y -> b.u * 0.001 + 0.0"),
        ("m", "mm", "a.y -> b.u * 1000.0 + 0.0"),
        ("degC", "K", "a.y -> b.u * 1.0 + 273.15"),
        ("K", "degC", "a.y -> b.u * 1.0 + -273.15"),
        ("deg", "rad", "a.y -> b.u * 0.017453292519943295 + 0.0"),
        ("m", "m", "a.y -> b.u"),
    ] {
        assert_eq!(connected(&real(from), &real(to), "", "").unwrap(), [expected], "{from} {to}");
    }
    assert_eq!(connected(&real("m"), "Real", "", "").unwrap(), ["a.y -> b.u"]);
}

#[test]
fn the_transformation_comes_after_the_conversion_or_instead_of_it() {
    // 5 (0.001 x) + 1 in m; and 5 x + 1 where the conversion is suppressed.
    let linear = r#"<ssc:LinearTransformation factor="5" offset="1"/>"#;
    let found = connected(&real("mm"), &real("m"), linear, "").unwrap();
    assert_eq!(found, ["a.y -> b.u * 0.005 + 1.0"]);
    let suppressed = r#"suppressUnitConversion="true""#;
    let found = connected(&real("mm"), &real("m"), linear, suppressed).unwrap();
    assert_eq!(found, ["a.y -> b.u * 5.0 + 1.0"]);
    assert_eq!(connected(&real("mm"), &real("m"), "", suppressed).unwrap(), ["a.y -> b.u"]);
    assert_eq!(connected(&real("mm"), &real("K"), "", suppressed).unwrap(), ["a.y -> b.u"]);
}

#[test]
fn units_of_different_quantities_are_refused_and_undefined_ones_are_left_alone_with_a_word() {
    let text = connected(&real("mm"), &real("K"), "", "").unwrap_err();
    assert_eq!(text, "from a.y to b.u: mm and K are units of different quantities");
    assert_eq!(
        connected(&real("bar"), &real("m"), "", "").unwrap(),
        ["a.y -> b.u", "from a.y to b.u: bar is not converted to m: a definition is missing"]
    );
}

#[test]
fn the_unit_that_a_connector_states_is_taken_before_that_of_the_fmu() {
    let bench = Bench::new();
    bench.fmu("a.fmu", &format!("y output {}", real("m")));
    bench.fmu("b.fmu", &format!("u input {}", real("m")));
    let units = r#"<ssd:Units><ssc:Unit name="km"><ssc:BaseUnit m="1" factor="1000"/></ssc:Unit></ssd:Units>"#;
    let elements = component("a", "a.fmu", r#"y output <ssc:Real unit="km"/>"#, "")
        + &component("b", "b.fmu", "u input", "");
    let opened = bench.open(&root(&elements, &connection("a.y", "b.u", "", "")), units).unwrap();
    assert_eq!(links(&opened.assembly), ["a.y -> b.u * 1000.0 + 0.0"]);
    assert_eq!(
        opened.warnings,
        ["a.y: the unit is km in the system structure and m in the FMU: the former is taken"]
    );
}

#[test]
fn a_system_connector_converts_if_it_states_a_unit_and_passes_on_if_not() {
    // 1 mm is 0.1 cm and 0.001 m; by way of cm the offset 2 is 2 cm = 0.02 m.
    let bench = Bench::new();
    bench.fmu("a.fmu", &format!("y output {}", real("mm")));
    bench.fmu("b.fmu", &format!("u input {}\nv input {}", real("m"), real("m")));
    let units = r#"<ssd:Units><ssc:Unit name="cm"><ssc:BaseUnit m="1" factor="0.01"/></ssc:Unit></ssd:Units>"#;
    let linear = r#"<ssc:LinearTransformation offset="2"/>"#;
    let inner = system(
        "inner",
        "cm output <ssc:Real unit=\"cm\"/>\nplain output",
        &component("a", "a.fmu", "y output", ""),
        &(connection("a.y", "cm", linear, "") + &connection("a.y", "plain", linear, "")),
    );
    let elements = inner + &component("b", "b.fmu", "u input\nv input", "");
    let connections =
        connection("inner.cm", "b.u", "", "") + &connection("inner.plain", "b.v", "", "");
    let opened = bench.open(&root(&elements, &connections), units).unwrap();
    let found = links(&opened.assembly);
    assert_eq!(found[0], "inner.a.y -> b.u * 0.001 + 0.02");
    // There the value is still in mm when 2 is added.
    assert_eq!(found[1], "inner.a.y -> b.v * 0.001 + 0.002");
}

/// A mapping with these sources and targets.
fn map(kind: &str, pairs: &[(&str, &str)]) -> String {
    let entry = |(source, target): &(&str, &str)| {
        format!(r#"<ssc:MapEntry source="{source}" target="{target}"/>"#)
    };
    let entries = pairs.iter().map(entry).collect::<Vec<_>>().concat();
    format!("<ssc:{kind}MappingTransformation>{entries}</ssc:{kind}MappingTransformation>")
}

#[test]
fn mappings_keep_what_they_do_not_name() {
    let found = connected("Boolean", "Boolean", &map("Boolean", &[("true", "false")]), "").unwrap();
    assert_eq!(found, ["a.y -> b.u false false"]);
    let swapped = map("Boolean", &[("1", "0"), ("0", "1")]);
    assert_eq!(connected("Boolean", "Boolean", &swapped, "").unwrap(), ["a.y -> b.u true false"]);
    let found = connected("Integer", "Integer", &map("Integer", &[("3", "-4"), ("5", "6")]), "");
    assert_eq!(found.unwrap(), ["a.y -> b.u [(3, -4), (5, 6)]"]);
    let (gear, speed) =
        (r#"Enumeration declaredType="Gear""#, r#"Enumeration declaredType="Speed""#);
    let items = map("Enumeration", &[("low", "slow"), ("high", "fast")]);
    assert_eq!(connected(gear, speed, &items, "").unwrap(), ["a.y -> b.u [(1, 10), (2, 20)]"]);
    let wrong = map("Enumeration", &[("low", "quick")]);
    assert_eq!(
        connected(gear, speed, &wrong, "").unwrap_err(),
        "from a.y to b.u: expected an item of the enumeration slow, fast, found \"quick\""
    );
}

#[test]
fn integer_mappings_in_a_row_are_one() {
    let bench = Bench::new();
    bench.fmu("a.fmu", "y output Integer");
    bench.fmu("b.fmu", "u input Integer");
    // 1 -> 2 -> 3; 2 stays, -> 3; 5 -> 7, stays; 7 stays, stays; 9 -> 1.
    let inner = system(
        "inner",
        "out output",
        &component("a", "a.fmu", "y output", ""),
        &connection("a.y", "out", &map("Integer", &[("1", "2"), ("5", "7")]), ""),
    );
    let elements = inner + &component("b", "b.fmu", "u input", "");
    let connections =
        connection("inner.out", "b.u", &map("Integer", &[("2", "3"), ("9", "1")]), "");
    let opened = bench.open(&root(&elements, &connections), "").unwrap();
    assert_eq!(links(&opened.assembly), ["inner.a.y -> b.u [(1, 3), (2, 3), (5, 7), (9, 1)]"]);
}

#[test]
fn a_transformation_of_another_type_than_its_target_is_refused() {
    let linear = r#"<ssc:LinearTransformation factor="5"/>"#;
    assert_eq!(
        connected("Integer", "Integer", linear, "").unwrap_err(),
        "b.u is of type Integer, the transformation is for Real"
    );
    assert_eq!(connected("Integer", "Real", linear, "").unwrap(), ["a.y -> b.u * 5.0 + 0.0"]);
}
