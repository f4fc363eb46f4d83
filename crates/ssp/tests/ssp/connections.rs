//! Connections through systems.

use crate::bench::{Bench, component, connection, links, root, system};

const SOURCE: &str = "y output Real
 n output Integer
 k calculatedParameter Real";
const SINK: &str = "u input Real
 v input Real
 n input Integer
 p parameter Real";

fn bench() -> Bench {
    let bench = Bench::new();
    bench.fmu("a.fmu", SOURCE);
    bench.fmu("b.fmu", SINK);
    bench
}

fn pair() -> String {
    component("a", "a.fmu", "y output\nn output\nk calculatedParameter", "")
        + &component("b", "b.fmu", "u input\nv input\nn input\np parameter", "")
}

#[test]
fn the_kinds_of_the_connectors_and_not_start_and_end_say_where_a_value_goes() {
    let connections = connection("b.u", "a.y", "", "") + &connection("a.n", "b.n", "", "");
    let opened = bench().open(&root(&pair(), &connections), "").unwrap();
    assert_eq!(links(&opened.assembly), ["a.y -> b.u", "a.n -> b.n"]);
    assert_eq!(opened.warnings, [""; 0]);
}

#[test]
fn a_connection_is_traced_through_systems_and_its_transformations_are_composed() {
    // Inner: 2 x + 1. Out of it: 10 x. Into the other system: x + 3. There: -1 x.
    let linear = |factor: &str, offset: &str| {
        format!(r#"<ssc:LinearTransformation factor="{factor}" offset="{offset}"/>"#)
    };
    let inner = system(
        "inner",
        "out output",
        &component("a", "a.fmu", "y output", ""),
        &connection("a.y", "out", &linear("2", "1"), ""),
    );
    let outer = system(
        "outer",
        "out output",
        &inner,
        &connection("inner.out", "out", &linear("10", "0"), ""),
    );
    let other = system(
        "other",
        "in input",
        &component("b", "b.fmu", "u input\nv input", ""),
        &(connection("in", "b.u", &linear("-1", "0"), "") + &connection("in", "b.v", "", "")),
    );
    let connections = connection("outer.out", "other.in", &linear("1", "3"), "");
    let opened = bench().open(&root(&(outer + &other), &connections), "").unwrap();
    let names: Vec<_> =
        opened.assembly.elements.iter().map(|element| element.name.as_str()).collect();
    assert_eq!(names, ["outer.inner.a", "other.b"]);
    // 10 (2 x + 1) + 3 = 20 x + 13.
    assert_eq!(
        links(&opened.assembly),
        [
            "outer.inner.a.y -> other.b.u * -20.0 + -13.0",
            "outer.inner.a.y -> other.b.v * 20.0 + 13.0"
        ]
    );
}

#[test]
fn an_input_of_a_system_may_be_its_output() {
    let through = system("through", "in input\nout output", "", &connection("in", "out", "", ""))
        .replace("<ssd:Elements></ssd:Elements>", "");
    let connections =
        connection("a.y", "through.in", "", "") + &connection("through.out", "b.u", "", "");
    let opened = bench().open(&root(&(pair() + &through), &connections), "").unwrap();
    assert_eq!(links(&opened.assembly), ["a.y -> b.u"]);
}

#[test]
fn calculated_parameters_lead_to_parameters_and_inputs() {
    let connections = connection("a.k", "b.p", "", "") + &connection("a.k", "b.u", "", "");
    let opened = bench().open(&root(&pair(), &connections), "").unwrap();
    assert_eq!(links(&opened.assembly), ["a.k -> b.p", "a.k -> b.u"]);
}

#[test]
fn signals_of_one_dictionary_meet_wherever_it_is_referred_to() {
    let dictionaries = r#"<ssd:SignalDictionaries><ssd:SignalDictionary name="bus"><ssb:SignalDictionary version="1.0">
<ssb:DictionaryEntry name="s"><ssc:Real/></ssb:DictionaryEntry></ssb:SignalDictionary></ssd:SignalDictionary></ssd:SignalDictionaries>"#;
    let reference = |name: &str| {
        format!(
            r#"<ssd:SignalDictionaryReference name="{name}" dictionary="bus"><ssd:Connectors><ssd:Connector name="s" kind="inout"/></ssd:Connectors></ssd:SignalDictionaryReference>"#
        )
    };
    let inner = system(
        "inner",
        "",
        &(component("b", "b.fmu", "u input", "") + &reference("there")),
        &connection("there.s", "b.u", "", ""),
    );
    let elements = component("a", "a.fmu", "y output", "") + &reference("here") + &inner;
    let connections = connection("a.y", "here.s", "", "");
    let opened = bench().open(&(root(&elements, &connections) + dictionaries), "").unwrap();
    assert_eq!(links(&opened.assembly), ["a.y -> inner.b.u"]);
    let text = bench().refusal(&root(&elements, &connections), "");
    assert!(text.ends_with("no signal dictionary \"bus\""), "{text}");
}

#[test]
fn what_nothing_drives_is_said_and_left_to_the_fmu() {
    let elements = component("b", "b.fmu", "u input", "");
    let system =
        crate::bench::connectors("in input") + &root(&elements, &connection("in", "b.u", "", ""));
    let opened = bench().open(&system, "").unwrap();
    assert_eq!(links(&opened.assembly), [""; 0]);
    assert_eq!(opened.warnings, ["b.u is connected to in, which nothing drives"]);
}

#[test]
fn connectors_without_a_variable_are_one_warning_for_each_fmu() {
    let connectors = "y output\nk1 parameter\nk2 parameter\nk3 parameter\nk4 parameter\nk5 parameter\nk6 parameter";
    let elements =
        component("a", "a.fmu", connectors, "") + &component("b", "b.fmu", "w input", "");
    let opened = bench().open(&root(&elements, ""), "").unwrap();
    assert_eq!(
        opened.warnings,
        [
            "a: the FMU has no variable k1, k2, k3, k4, k5 and 1 more",
            "b: the FMU has no variable w"
        ]
    );
}

#[test]
fn a_connected_variable_without_a_connector_is_accepted_and_said() {
    let elements = component("a", "a.fmu", "", "") + &component("b", "b.fmu", "u output", "");
    let opened = bench().open(&root(&elements, &connection("a.y", "b.v", "", "")), "").unwrap();
    assert_eq!(links(&opened.assembly), ["a.y -> b.v"]);
    assert_eq!(
        opened.warnings,
        ["a.y is connected, but is no connector", "b.v is connected, but is no connector"]
    );
}

#[test]
fn connections_that_the_standard_forbids_are_refused_with_their_place() {
    let ring = |name: &str| {
        system(name, "in input\nout output", "", &connection("in", "out", "", ""))
            .replace("<ssd:Elements></ssd:Elements>", "")
    };
    let rings = ring("r") + &ring("s") + &component("b", "b.fmu", "u input", "");
    let round = connection("r.out", "s.in", "", "")
        + &connection("s.out", "r.in", "", "")
        + &connection("b.u", "o", "", "");
    for (elements, connections, expected) in [
        (
            pair(),
            connection("a.y", "a.n", "", ""),
            "a.y and a.n cannot be connected: one is output of the element, the other output of the element",
        ),
        (
            pair(),
            connection("a.y", "b.p", "", ""),
            "a.y and b.p cannot be connected: one is output of the element, the other parameter of the element",
        ),
        (
            pair(),
            connection("a.y", "b.u", "", "") + &connection("a.k", "b.u", "", ""),
            "b.u is connected twice, to a.y and to a.k",
        ),
        (pair(), connection("c.y", "b.u", "", ""), "the system has no element \"c\""),
        (pair(), connection("a.z", "b.u", "", ""), "the FMU has no variable a.z"),
        (pair(), connection("a.y", "out", "", ""), "the signal dictionary or system has no out"),
        (rings, round, "the signal dictionary or system has no o"),
    ] {
        let text = bench().refusal(&root(&elements, &connections), "");
        let (place, sentence) = text.split_once(": ").unwrap();
        assert!(place.starts_with("line ") && place.contains(", column "), "{text}");
        assert_eq!(sentence, expected);
    }
}

#[test]
fn a_ring_of_systems_without_an_fmu_is_refused() {
    let ring = |name: &str, outputs: &str, inside: &str| {
        system(name, outputs, &component("b", "b.fmu", "u input", ""), inside)
    };
    let r = ring(
        "r",
        "in input\nout output",
        &(connection("in", "out", "", "") + &connection("in", "b.u", "", "")),
    );
    let s = ring("s", "in input\nout output", &connection("in", "out", "", ""));
    let round = connection("r.out", "s.in", "", "") + &connection("s.out", "r.in", "", "");
    let text = bench().refusal(&root(&(r + &s), &round), "");
    assert!(text.ends_with("r.b.u is connected in a ring without an FMU"), "{text}");
}
