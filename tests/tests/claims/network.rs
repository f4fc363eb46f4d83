//! Networks by FMI-LS-BUS 1.0: terminals, CAN frames, traces. The FMUs are `tests/c/node3.c` and `tests/c/bus3.c`, which are
//! strict about their calls.
#![expect(clippy::unwrap_used, reason = "tests")]

use std::path::Path;

use tests::c_fmu::CFmu;
use tests::{Table, bus, node};

/// Duration of a frame with one byte in s: 52 bits at 100 kbit/s.
const FRAME: f64 = 52e-5;

/// Runs a system.toml in `folder`; returns standard error.
fn run(folder: &Path, system: &str, more: &[&str]) -> String {
    let file = folder.join("system.toml");
    std::fs::write(&file, system).unwrap();
    let (file, out) = (file.display().to_string(), folder.join("out").display().to_string());
    let run = ["run", &file, "--stop-time", "0.01", "--step", "0.001", "--out", &out];
    let output = tests::run(&[&run[..], &["--record", "*.received"], more].concat());
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{message}");
    message
}

/// The times at which a counter in the results increases.
fn increases(folder: &Path, name: &str) -> Vec<f64> {
    let rows = Table::read(&folder.join("out/results.csv"));
    let (times, values) = (rows.column("time"), rows.column(name));
    let increases = |at: &usize| values[*at] > values[*at - 1];
    (1..values.len()).filter(increases).map(|at| times[at]).collect()
}

fn near(actual: &[f64], expected: &[f64]) {
    let close = actual.len() == expected.len()
        && actual.iter().zip(expected).all(|(value, expected)| (value - expected).abs() < 1e-9);
    assert!(close, "{actual:?}, expected {expected:?}");
}

#[test]
fn two_terminals_connect_their_members_and_a_frame_arrives_when_it_is_sent() {
    let folder = tempfile::tempdir().unwrap();
    let fmu = node::write(folder.path());
    let system = format!(
        "[fmus]\na = {fmu:?}\nb = {fmu:?}\n[[connections]]\nfrom = \"a.can\"\nto = \"b.can\"\n\
         [settings]\na.identifier = 1\na.period = 0.003\nb.identifier = 2\n"
    );
    for isolate in [&[][..], &["--isolate"]] {
        let trace = folder.path().join("trace.log").display().to_string();
        run(folder.path(), &system, &[&["--bus-trace", &trace, "--report"], isolate].concat());
        near(&increases(folder.path(), "b.received"), &[0.003, 0.006, 0.009]);
        near(&increases(folder.path(), "a.received"), &[]);
        let frames = "(0.003000) can0 001#01\n(0.006000) can0 001#02\n(0.009000) can0 001#03\n";
        assert_eq!(std::fs::read_to_string(&trace).unwrap(), frames);
        let page = std::fs::read_to_string(folder.path().join("out/results.html")).unwrap();
        assert!(page.contains("Frames on the bus") && page.contains("can0 001"));
    }
}

#[test]
fn the_trace_of_the_file_goes_into_the_folder_of_the_command_line() {
    let folder = tempfile::tempdir().unwrap();
    let fmu = node::write(folder.path());
    let trace = "[results]\nbus-trace = \"elsewhere/frames.asc\"\n";
    run(folder.path(), &format!("[fmus]\na = {fmu:?}\nb = {fmu:?}\n{trace}"), &[]);
    assert!(folder.path().join("out/frames.asc").is_file());
    assert!(!folder.path().join("elsewhere").exists());
}

#[test]
fn a_run_that_fails_in_its_initialisation_keeps_an_earlier_trace() {
    let folder = tempfile::tempdir().unwrap();
    let bad = CFmu::that("fail in fmi2ExitInitializationMode").write(folder.path(), "bad");
    let (bad, node) = (format!("bad={}", bad.display()), node::write(folder.path()));
    let node = format!("a={}", node.display());
    let trace = folder.path().join("trace.log");
    let earlier = "(0.003000) can0 001#01\n";
    std::fs::write(&trace, earlier).unwrap();
    let path = trace.display().to_string();
    let times = ["--stop-time", "0.01", "--step", "0.001"];
    let run = ["run", "--fmu", &node, "--fmu", &bad, "--bus-trace", &path];
    let output = tests::run(&[&run[..], &times].concat());
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("fmi2ExitInitializationMode"), "{message}");
    assert_eq!(std::fs::read_to_string(&trace).unwrap(), earlier);
}

/// A system structure connects terminals by their names, or the clocks and binaries that are their members.
#[test]
fn a_system_structure_connects_terminals_and_clocked_binaries() {
    let folder = tempfile::tempdir().unwrap();
    let fmu = node::write(folder.path());
    let source = fmu.file_name().unwrap().to_str().unwrap().to_owned();
    let members = [
        ("a", "tx_clock", "rx_clock"),
        ("a", "tx_data", "rx_data"),
        ("b", "tx_clock", "rx_clock"),
        ("b", "tx_data", "rx_data"),
    ];
    let by_member = |&(from, output, input): &(&str, &str, &str)| {
        let to = if from == "a" { "b" } else { "a" };
        connection(from, output, to, input)
    };
    let by_member: String = members.iter().map(by_member).collect();
    for connections in [connection("a", "can", "b", "can"), by_member] {
        let component = |name: &str| {
            format!(
                "<ssd:Component name=\"{name}\" source=\"{source}\"><ssd:Connectors>\
                 <ssd:Connector name=\"tx_data\" kind=\"output\"><ssc:Binary/></ssd:Connector>\
                 <ssd:Connector name=\"rx_data\" kind=\"input\"><ssc:Binary/></ssd:Connector>\
                 <ssd:Connector name=\"tx_clock\" kind=\"output\"/><ssd:Connector name=\"rx_clock\" kind=\"input\"/>\
                 <ssd:Connector name=\"can\" kind=\"inout\"/></ssd:Connectors></ssd:Component>"
            )
        };
        let structure = format!(
            "<ssd:SystemStructureDescription \
             xmlns:ssd=\"http://ssp-standard.org/SSP1/SystemStructureDescription\" \
             xmlns:ssc=\"http://ssp-standard.org/SSP1/SystemStructureCommon\" name=\"s\" version=\"1.0\">\
             <ssd:System name=\"root\"><ssd:Elements>{}{}</ssd:Elements>\
             <ssd:Connections>{connections}</ssd:Connections></ssd:System></ssd:SystemStructureDescription>",
            component("a"),
            component("b")
        );
        std::fs::write(folder.path().join("SystemStructure.ssd"), structure).unwrap();
        let system = "system = \"SystemStructure.ssd\"\n[settings]\na.identifier = 1\na.period = 0.003\nb.identifier = 2\n";
        let message = run(folder.path(), system, &[]);
        assert!(!message.contains("warning"), "{message}");
        near(&increases(folder.path(), "b.received"), &[0.003, 0.006, 0.009]);
    }
}

fn connection(from: &str, output: &str, to: &str, input: &str) -> String {
    format!(
        "<ssd:Connection startElement=\"{from}\" startConnector=\"{output}\" endElement=\"{to}\" \
         endConnector=\"{input}\"/>"
    )
}

/// Both nodes send at 3 ms. Identifier 1 wins; 2 follows when the bus is free.
#[test]
fn of_two_nodes_that_start_at_once_one_loses_the_arbitration() {
    let folder = tempfile::tempdir().unwrap();
    let (fmu, bus) = (node::write(folder.path()), bus::write(folder.path()));
    let system = format!(
        "[fmus]\na = {fmu:?}\nbus = {bus:?}\nb = {fmu:?}\n\
         [[connections]]\nfrom = \"a.can\"\nto = \"bus.n1\"\n\
         [[connections]]\nfrom = \"bus.n2\"\nto = \"b.can\"\n\
         [settings]\na.identifier = 2\na.period = 0.003\nb.identifier = 1\nb.period = 0.003\n"
    );
    let traces = ["log", "asc", "pcapng"].map(|end| folder.path().join(format!("trace.{end}")));
    for trace in &traces {
        run(folder.path(), &system, &["--bus-trace", &trace.display().to_string()]);
    }
    let (first, second) = ([0.003, 0.006, 0.009].map(|time| time + FRAME), 2.0 * FRAME);
    near(&increases(folder.path(), "a.received"), &first);
    let second = [0.003, 0.006].map(|time| time + second);
    near(&increases(folder.path(), "b.received"), &second);
    let log = std::fs::read_to_string(&traces[0]).unwrap();
    let frames: Vec<&str> = log.lines().collect();
    assert_eq!(frames[..2], ["(0.003520) can0 001#01", "(0.004040) can0 002#01"]);
    assert_eq!(frames.len(), 5, "{log}");
    let asc = std::fs::read_to_string(&traces[1]).unwrap();
    assert!(asc.contains("   0.003520 1  1         Rx   d 1 01\n"), "{asc}");
    // Five packets of 9 bytes after the blocks of section and interface; the first one at 3,520,000 ns.
    let bytes = std::fs::read(&traces[2]).unwrap();
    let packets = bytes.len() - 28 - 40;
    assert_eq!(packets, 5 * (32 + 12), "{}", bytes.len());
    let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    assert_eq!((number(28), number(68), number(68 + 16)), (1, 6, 3_520_000));
    assert_eq!(bytes[68 + 28..68 + 28 + 9], [0, 0, 0, 1, 1, 0, 0, 0, 1]);
}

#[test]
fn a_member_without_a_partner_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let fmu = node::write(folder.path()).display().to_string();
    let connect = ["--connect", "a.can=b.tx", "--stop-time", "0.01"];
    let (a, b) = (format!("a={fmu}"), format!("b={fmu}"));
    let output = tests::run(&[&["run", "--fmu", &a, "--fmu", &b], &connect[..]].concat());
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(
        message.contains("a.can cannot be connected to b.tx: b.tx is no terminal"),
        "{message}"
    );
}
