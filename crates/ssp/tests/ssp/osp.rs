//! `OspSystemStructure.xml`: simulators, functions, variable groups, and what is refused.

use ssp::Function;
use ssp::open;

use crate::bench::{Bench, links, settings};

const GROUPS: &str = r#"<OspModelDescription version="1.0"><VariableGroups>
<Generic name="both"><Variable ref="y"/><Variable ref="n"/></Generic>
<LinearMechanicalPort name="port"><Force name="force"><Variable ref="y"/></Force>
<LinearVelocity name="velocity"><Variable ref="v"/></LinearVelocity></LinearMechanicalPort>
<Generic name="outer"><Generic name="inner"><Variable ref="y"/></Generic></Generic>
</VariableGroups></OspModelDescription>"#;

fn osp(simulators: &str, functions: &str, connections: &str) -> String {
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<OspSystemStructure xmlns="http://opensimulationplatform.com/MSMI/OSPSystemStructure" version="0.1">
<StartTime>0.5</StartTime><EndTime>2</EndTime><BaseStepSize> 1e-3 </BaseStepSize>
<Algorithm>fixedStep</Algorithm>
<Simulators>{simulators}</Simulators>
<Functions>{functions}</Functions>
<Connections>{connections}</Connections>
</OspSystemStructure>"#
    )
}

/// Two FMUs `a.fmu` (two outputs, one input) and `my b.fmu` (the other way round).
fn bench() -> Bench {
    let bench = Bench::new();
    bench.fmu(
        "fmus/a.fmu",
        "y output Real\nn output Real\nv input Real\np parameter Real\nl local Real",
    );
    bench.fmu("fmus/b.fmu", "y input Real\nn input Real\nv output Real\nk parameter Boolean");
    bench
}

const PAIR: &str = r#"<Simulator name="a" source="fmus/a.fmu" stepSize="2.03e-3"><InitialValues>
<InitialValue variable="p"><Real value="2.5"/></InitialValue></InitialValues></Simulator>
<Simulator name="b" source="proxyfmu://localhost?file=fmus/b.fmu"/>"#;

fn variable(simulator: &str, name: &str) -> String {
    format!(r#"<Variable simulator="{simulator}" name="{name}"/>"#)
}

fn signal(function: &str, name: &str) -> String {
    format!(r#"<Signal function="{function}" name="{name}"/>"#)
}

fn connection(kind: &str, ends: &[String; 2]) -> String {
    format!("<{kind}Connection>{}</{kind}Connection>", ends.concat())
}

#[test]
fn simulators_initial_values_and_times_are_read_and_connections_run_from_outputs_to_inputs() {
    let bench = bench();
    let connections = connection("Variable", &[variable("a", "y"), variable("b", "y")])
        + &connection("Variable", &[variable("a", "v"), variable("b", "v")]);
    let path = bench.file("OspSystemStructure.xml", osp(PAIR, "", &connections));
    for path in [path, bench.path("")] {
        let opened = open(&path).unwrap();
        assert_eq!(links(&opened.assembly), ["a.y -> b.y", "b.v -> a.v"]);
        assert_eq!(settings(&opened.assembly), ["a.p = 2.5"]);
        assert_eq!((opened.assembly.start_time, opened.assembly.stop_time), (Some(0.5), Some(2.0)));
        assert_eq!(opened.experiment.step_size, Some(1e-3));
        assert_eq!(opened.steps, [("a".to_owned(), 2e-3)]);
        assert!(opened.fixed_step);
        let warnings = opened.warnings.join("\n");
        assert!(warnings.contains("a steps every 0.002 s"), "{warnings}");
        assert!(warnings.contains("fmus/b.fmu, which runs here without proxyfmu"), "{warnings}");
    }
}

/// 3 * 0.1 is 0.30000000000000004.
#[test]
fn a_step_in_a_warning_has_no_rounding_error() {
    let bench = bench();
    let text = osp(&PAIR.replace("2.03e-3", "0.35"), "", "").replace("1e-3", "0.1");
    let warnings = open(&bench.file("System.xml", text)).unwrap().warnings.join("\n");
    let expected = "a steps every 0.3 s, a multiple of the base step 0.1 s, instead of 0.35 s";
    assert!(warnings.contains(expected), "{warnings}");
}

/// libcosim counts nanoseconds, of which this base step is a quarter.
#[test]
fn a_step_is_a_multiple_also_of_a_base_step_below_a_nanosecond() {
    let bench = bench();
    let text = osp(&PAIR.replace("2.03e-3", "1e-9"), "", "").replace("1e-3", "2.5e-10");
    let opened = open(&bench.file("System.xml", text)).unwrap();
    assert_eq!(opened.steps, [("a".to_owned(), 1e-9)]);
    assert!(!opened.warnings.join("\n").contains("steps every"), "{:?}", opened.warnings);
}

#[test]
fn two_initial_values_of_one_variable_are_named_and_the_last_one_counts() {
    let bench = bench();
    let second = r#"<InitialValue variable="p"><Real value="3.5"/></InitialValue></InitialValues>"#;
    let pair = PAIR.replace("</InitialValues>", second);
    let path = bench.file("System.xml", osp(&pair, "", ""));
    let warnings = open(&path).unwrap().warnings.join("\n");
    let expected = "a has different initial values for p: the last one counts";
    assert!(warnings.contains(expected), "{warnings}");
}

#[test]
fn functions_are_linear_connections_and_sums() {
    let functions = r#"<LinearTransformation name="f" factor="0.1" offset="2"/>
<Sum name="s" inputCount="2"/>"#;
    let connections = connection("Signal", &[variable("a", "y"), signal("f", "in")])
        + &connection("Signal", &[signal("f", "out"), variable("b", "y")])
        + &connection("Signal", &[variable("a", "y"), signal("s", "in[1]")])
        + &connection("Signal", &[variable("b", "n"), signal("s", "out")]);
    let bench = bench();
    let path = bench.file("System.xml", osp(PAIR, functions, &connections));
    let opened = open(&path).unwrap();
    let expected = ["a.y -> s.in[1]", "s.out -> b.n", "a.y -> b.y * 0.1 + 2.0"];
    assert_eq!(links(&opened.assembly), expected);
    assert_eq!(opened.assembly.functions, [("s".to_owned(), Function::Sum { inputs: 2 })]);
    let warnings = opened.warnings.join("\n");
    assert!(warnings.contains("s: in[0] is connected to nothing and counts as 0"), "{warnings}");
}

#[test]
fn groups_beside_the_fmu_or_the_structure_are_connected_in_their_order_at_any_depth() {
    let bench = bench();
    bench.file("fmus/a_OspModelDescription.xml", GROUPS);
    bench.file("b_OspModelDescription.xml", GROUPS);
    let group = |simulator: &str, name: &str| {
        format!(r#"<VariableGroup simulator="{simulator}" name="{name}"/>"#)
    };
    let port = connection("VariableGroup", &[group("b", "port"), group("a", "port")]);
    let inner = connection("VariableGroup", &[group("a", "inner"), group("b", "inner")]);
    for (connections, expected) in
        [(&port, &["a.y -> b.y", "b.v -> a.v"][..]), (&inner, &["a.y -> b.y"])]
    {
        let path = bench.file("System.xml", osp(PAIR, "", connections));
        assert_eq!(links(&open(&path).unwrap().assembly), expected);
    }
    let signals = |name: &str| format!(r#"<SignalGroup function="s" name="{name}"/>"#);
    let connections = connection("SignalGroup", &[group("a", "both"), signals("in[0]")])
        + &connection("SignalGroup", &[signals("out"), group("b", "both")]);
    let functions = r#"<VectorSum name="s" inputCount="1" dimension="2"/>"#;
    let path = bench.file("System.xml", osp(PAIR, functions, &connections));
    let expected = ["a.y -> s.in[0][0]", "a.n -> s.in[0][1]", "s.out[0] -> b.y", "s.out[1] -> b.n"];
    assert_eq!(links(&open(&path).unwrap().assembly), expected);
}

#[test]
fn what_cannot_be_followed_is_refused_with_its_place() {
    let bench = bench();
    let group = |simulator: &str| format!(r#"<VariableGroup simulator="{simulator}" name="g"/>"#);
    let sum = r#"<Sum name="s" inputCount="2"/>"#;
    let variables =
        |a: &str, b: &str| connection("Variable", &[variable("a", a), variable("b", b)]);
    let on = |function: &str, name: &str| {
        connection("Signal", &[variable("a", "y"), signal(function, name)])
    };
    for (functions, connections, expected) in [
        ("", variables("y", "none"), "line 9, column 14: the FMU has no variable b.none"),
        (
            "",
            variables("l", "y"),
            "line 9, column 14: a.l is local, expected an output or an input",
        ),
        ("", variables("v", "y"), "line 9, column 14: a.v and b.y are both inputs"),
        ("", variables("y", "v"), "line 9, column 14: a.y and b.v are both outputs"),
        ("", on("s", "in[0]"), "line 9, column 14: no function \"s\""),
        (
            sum,
            on("s", "in[2]"),
            "line 9, column 14: s.in[2] is no signal of the function, expected in[0], ... or out",
        ),
        (
            r#"<LinearTransformation name="f"/>"#,
            on("f", "in") + "\n" + &on("f", "in"),
            "line 10, column 1: f.in is connected twice, to a.y and to a.y",
        ),
        (
            "",
            connection("VariableGroup", &[group("a"), group("b")]),
            "line 9, column 14: a has no variable group \"g\", expected one in a_OspModelDescription.xml beside its FMU or beside the system structure",
        ),
        (
            "<Sum name=\"s\" inputCount=\"0\"/>",
            String::new(),
            "line 8, column 12: <Sum>: expected a whole number from 1 to 100000 in the attribute inputCount, found \"0\"",
        ),
        (
            "<Sum name=\"s\" inputCount=\"1\"/>\n<LinearTransformation name=\"s\"/>",
            String::new(),
            "line 9, column 1: two functions are called s",
        ),
        (
            "",
            "</Connections>\n<Connections>".to_owned(),
            "line 10, column 1: <Connections>: expected one element Connections, found another one",
        ),
        (
            "<Product name=\"s\"/>",
            String::new(),
            "line 8, column 12: <Product>: expected LinearTransformation, Sum or VectorSum, found the function Product",
        ),
    ] {
        let path = bench.file("System.xml", osp(PAIR, functions, &connections));
        let text = open(&path).unwrap_err().to_string();
        assert_eq!(text, format!("{}: {expected}", path.display()));
    }
}
