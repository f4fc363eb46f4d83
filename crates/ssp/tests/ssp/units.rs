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
    let actual = connected(&real("mm"), &real("m"), linear, "").unwrap();
    assert_eq!(actual, ["a.y -> b.u * 0.005 + 1.0"]);
    let suppressed = r#"suppressUnitConversion="true""#;
    let actual = connected(&real("mm"), &real("m"), linear, suppressed).unwrap();
    assert_eq!(actual, ["a.y -> b.u * 5.0 + 1.0"]);
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

/// A Real that is a difference.
fn difference(unit: &str) -> String {
    format!(r#"{} relativeQuantity="true""#, real(unit))
}

/// 5 K are 5 degC, and 5 mm are 0.005 m.
#[test]
fn differences_are_converted_without_offset_on_the_way_too() {
    for (unit, other, expected) in [
        ("K", "degC", "a.y -> b.u"),
        ("degC", "K", "a.y -> b.u"),
        ("mm", "m", "a.y -> b.u * 0.001 + 0.0"),
    ] {
        let actual = connected(&difference(unit), &difference(other), "", "");
        assert_eq!(actual.unwrap(), [expected], "{unit} {other}");
    }
    let bench = Bench::new();
    bench.fmu("a.fmu", &format!("y output {}", difference("K")));
    bench.fmu("b.fmu", &format!("u input {}", difference("K")));
    let units = r#"<ssd:Units><ssc:Unit name="degC"><ssc:BaseUnit K="1" offset="273.15"/></ssc:Unit></ssd:Units>"#;
    let inner = system(
        "inner",
        "out output <ssc:Real unit=\"degC\"/>",
        &component("a", "a.fmu", "y output", ""),
        &connection("a.y", "out", "", ""),
    );
    let elements = inner + &component("b", "b.fmu", "u input", "");
    let opened =
        bench.open(&root(&elements, &connection("inner.out", "b.u", "", "")), units).unwrap();
    assert_eq!(links(&opened.assembly), ["inner.a.y -> b.u"]);
    assert_eq!(opened.warnings, [""; 0]);
}

#[test]
fn a_difference_is_connected_to_another_value_if_no_offset_separates_their_units() {
    for (from, to) in [(difference("K"), real("degC")), (real("degC"), difference("K"))] {
        assert_eq!(
            connected(&from, &to, "", "").unwrap_err(),
            "from a.y to b.u: the value in K is a difference (relativeQuantity) and the one in \
             degC is not: state suppressUnitConversion and a LinearTransformation"
        );
    }
    let linear = r#"<ssc:LinearTransformation offset="20"/>"#;
    let suppressed = r#"suppressUnitConversion="true""#;
    let actual = connected(&difference("K"), &real("degC"), linear, suppressed).unwrap();
    assert_eq!(actual, ["a.y -> b.u * 1.0 + 20.0"]);
    let actual = connected(&difference("mm"), &real("m"), "", "").unwrap();
    assert_eq!(actual, ["a.y -> b.u * 0.001 + 0.0"]);
    // The number of K is that of degC at the connector of the system, and 0 degC are 273.15 K.
    let bench = Bench::new();
    bench.fmu("a.fmu", &format!("y output {}", difference("K")));
    bench.fmu("b.fmu", &format!("u input {}", real("K")));
    let inner = system(
        "inner",
        "out output <ssc:Real unit=\"degC\"/>",
        &component("a", "a.fmu", "y output", ""),
        &connection("a.y", "out", "", suppressed),
    );
    let elements = inner + &component("b", "b.fmu", "u input", "");
    let units = r#"<ssd:Units><ssc:Unit name="degC"><ssc:BaseUnit K="1" offset="273.15"/></ssc:Unit></ssd:Units>"#;
    let opened =
        bench.open(&root(&elements, &connection("inner.out", "b.u", "", "")), units).unwrap();
    assert_eq!(links(&opened.assembly), ["inner.a.y -> b.u * 1.0 + 273.15"]);
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
    let actual = links(&opened.assembly);
    assert_eq!(actual[0], "inner.a.y -> b.u * 0.001 + 0.02");
    // There the value is still in mm when 2 is added.
    assert_eq!(actual[1], "inner.a.y -> b.v * 0.001 + 0.002");
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
    let actual =
        connected("Boolean", "Boolean", &map("Boolean", &[("true", "false")]), "").unwrap();
    assert_eq!(actual, ["a.y -> b.u false false"]);
    let swapped = map("Boolean", &[("1", "0"), ("0", "1")]);
    assert_eq!(connected("Boolean", "Boolean", &swapped, "").unwrap(), ["a.y -> b.u true false"]);
    let actual = connected("Integer", "Integer", &map("Integer", &[("3", "-4"), ("5", "6")]), "");
    assert_eq!(actual.unwrap(), ["a.y -> b.u [(3, -4), (5, 6)]"]);
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

/// A binding of one parameter of the set, which defines nothing itself.
fn set(name: &str, value: &str) -> String {
    format!(
        r#"<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version="1.0" name="set"><ssv:Parameters><ssv:Parameter name="{name}">{value}</ssv:Parameter></ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>"#
    )
}

const DEG: &str = r#"<ssd:Units><ssc:Unit name="deg"><ssc:BaseUnit rad="1" factor="0.017453292519943295"/></ssc:Unit></ssd:Units>"#;
const DEGREES: &str = r#"<ssv:Real value="18" unit="deg"/>"#;
const EIGHTEEN_DEG: f64 = std::f64::consts::PI / 10.0;

/// The value of the first setting and the warnings.
fn first_setting(opened: &ssp::Opened) -> (f64, &[String]) {
    (opened.assembly.elements[0].settings[0].value.parse().unwrap(), &opened.warnings)
}

#[test]
fn an_inline_parameter_set_uses_the_definitions_of_the_enclosing_file() {
    let bench = Bench::new();
    bench.fmu("a.fmu", &format!("p parameter {}\ng parameter Integer", real("rad")));
    let component = component("c", "a.fmu", "", &set("p", DEGREES));
    let opened = bench.open(&root(&component, ""), DEG).unwrap();
    assert_eq!(first_setting(&opened), (EIGHTEEN_DEG, &[][..]));
    // The binding of the system around it.
    let binding = set("c.p", DEGREES);
    let system = binding + &root(&crate::bench::component("c", "a.fmu", "", ""), "");
    assert_eq!(first_setting(&bench.open(&system, DEG).unwrap()), (EIGHTEEN_DEG, &[][..]));
    // A parameter set in a file of its own that lacks the definition.
    let parameter = format!(r#"<ssv:Parameter name="p">{DEGREES}</ssv:Parameter>"#);
    bench.file("p.ssv", crate::bench::ssv(&parameter));
    let binding =
        r#"<ssd:ParameterBindings><ssd:ParameterBinding source="p.ssv"/></ssd:ParameterBindings>"#;
    let component = crate::bench::component("c", "a.fmu", "", binding);
    let opened = bench.open(&root(&component, ""), DEG).unwrap();
    assert_eq!(first_setting(&opened), (EIGHTEEN_DEG, &[][..]));
    // An enumeration, whose item becomes its number.
    let enumerations = r#"<ssd:Enumerations><ssc:Enumeration name="Mode"><ssc:Item name="fast" value="7"/></ssc:Enumeration></ssd:Enumerations>"#;
    let item = set("g", r#"<ssv:Enumeration name="Mode" value="fast"/>"#);
    let component = crate::bench::component("c", "a.fmu", "", &item);
    let opened = bench.open(&root(&component, ""), enumerations).unwrap();
    assert_eq!(first_setting(&opened), (7.0, &[][..]));
}

#[test]
fn an_inline_signal_dictionary_uses_the_units_of_the_enclosing_file() {
    let bench = Bench::new();
    bench.fmu("a.fmu", &format!("y output {}", real("m")));
    bench.fmu("b.fmu", "u input Real");
    let elements = component("a", "a.fmu", "y output", "")
        + &component("b", "b.fmu", "u input", "")
        + r#"<ssd:SignalDictionaryReference name="r" dictionary="bus"><ssd:Connectors><ssd:Connector name="s" kind="inout"/></ssd:Connectors></ssd:SignalDictionaryReference>"#;
    let connections = connection("a.y", "r.s", "", "") + &connection("r.s", "b.u", "", "");
    let dictionaries = r#"<ssd:SignalDictionaries><ssd:SignalDictionary name="bus"><ssb:SignalDictionary version="1.0">
<ssb:DictionaryEntry name="s"><ssc:Real unit="km"/></ssb:DictionaryEntry></ssb:SignalDictionary></ssd:SignalDictionary></ssd:SignalDictionaries>"#;
    let units = r#"<ssd:Units><ssc:Unit name="km"><ssc:BaseUnit m="1" factor="1000"/></ssc:Unit></ssd:Units>"#;
    let opened = bench.open(&(root(&elements, &connections) + dictionaries), units).unwrap();
    assert_eq!(links(&opened.assembly), ["a.y -> b.u * 0.001 + 0.0"]);
    assert_eq!(opened.warnings, [""; 0]);
}

#[test]
fn a_parameter_of_5_kelvin_sets_a_difference_of_5_degrees_celsius() {
    let bench = Bench::new();
    bench.fmu("a.fmu", &format!("p parameter {}", difference("degC")));
    let component = component("c", "a.fmu", "", &set("p", r#"<ssv:Real value="5" unit="K"/>"#));
    let units = r#"<ssd:Units><ssc:Unit name="K"><ssc:BaseUnit K="1"/></ssc:Unit></ssd:Units>"#;
    let opened = bench.open(&root(&component, ""), units).unwrap();
    assert_eq!(first_setting(&opened), (5.0, &[][..]));
}

#[test]
fn each_file_of_nested_structures_has_its_own_units() {
    let bench = Bench::new();
    bench.fmu("a.fmu", &format!("p parameter {}", real("rad")));
    let inner = component("c", "a.fmu", "", &set("p", DEGREES));
    bench.file("inner.ssd", crate::bench::ssd(&root(&inner, ""), DEG));
    // Outside, a unit of the same name is another one.
    let other = DEG.replace("0.017453292519943295", "100");
    let nested = |binding: &str| {
        root(
            &format!(
                r#"<ssd:Component name="s" source="inner.ssd" type="application/x-ssp-definition">{binding}</ssd:Component>"#
            ),
            "",
        )
    };
    let opened = bench.open(&nested(""), &other).unwrap();
    assert_eq!(first_setting(&opened), (EIGHTEEN_DEG, &[][..]));
    let opened = bench.open(&nested(&set("c.p", DEGREES)), &other).unwrap();
    assert_eq!(first_setting(&opened), (1800.0, &[][..]));
}

#[test]
fn a_connector_of_a_nested_file_has_the_units_of_both_files() {
    // Outside, the connectors are in deg; inside, nothing is stated, so the FMU's rad.
    let bench = Bench::new();
    bench.fmu("a.fmu", "y output Real");
    bench.fmu("b.fmu", &format!("u input {}\nx output {}", real("rad"), real("rad")));
    let inner = component("b", "b.fmu", "u input\nx output", "");
    let connections = connection("u", "b.u", "", "") + &connection("b.x", "x", "", "");
    let inner = crate::bench::connectors("u input\nx output <ssc:Real unit=\"rad\"/>")
        + &root(&inner, &connections);
    let radian =
        r#"<ssd:Units><ssc:Unit name="rad"><ssc:BaseUnit rad="1"/></ssc:Unit></ssd:Units>"#;
    bench.file("inner.ssd", crate::bench::ssd(&inner, radian));
    let lines = "u input <ssc:Real unit=\"deg\"/>\nx output <ssc:Real unit=\"deg\"/>";
    let nested = component("s", "inner.ssd", lines, "")
        .replace("<ssd:Component ", r#"<ssd:Component type="application/x-ssp-definition" "#);
    bench.fmu("c.fmu", "u input Real");
    let elements =
        component("a", "a.fmu", "y output", "") + &nested + &component("c", "c.fmu", "u input", "");
    let connections = connection("a.y", "s.u", "", "") + &connection("s.x", "c.u", "", "");
    let opened = bench.open(&root(&elements, &connections), DEG).unwrap();
    let actual = links(&opened.assembly);
    assert_eq!(
        actual,
        ["s.b.x -> c.u * 57.29577951308232 + 0.0", "a.y -> s.b.u * 0.017453292519943295 + 0.0"]
    );
    assert_eq!(opened.warnings, [""; 0]);
}

#[test]
fn a_connector_that_a_parameter_binding_sets_is_driven() {
    let bench = Bench::new();
    bench.fmu("a.fmu", &format!("p parameter {}", real("m")));
    let component = component("c", "a.fmu", "p parameter", "");
    let units = r#"<ssd:Units><ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit></ssd:Units>"#;
    let system = |binding: &str| {
        crate::bench::connectors("P parameter <ssc:Real unit=\"mm\"/>")
            + binding
            + &root(&component, &connection("P", "c.p", "", ""))
    };
    let opened = bench.open(&system(&set("P", r#"<ssv:Real value="250"/>"#)), units).unwrap();
    assert_eq!(first_setting(&opened), (0.25, &[][..]));
    let opened = bench.open(&system(""), units).unwrap();
    assert_eq!(opened.warnings, ["c.p is connected to P, which nothing drives"]);
}
