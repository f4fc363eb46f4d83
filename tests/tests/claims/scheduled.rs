//! Scheduled execution of FMI 3.0 (section 5). The FMU is `tests/c/scheduled3.c`, which is strict about its calls.

use std::collections::BTreeSet;
use std::process::Command;

use fmu_description::package::Unpacked;
use serde_json::Value;
use tests::{Table, root, scheduled};

/// The digits of the partitions, by hand. At 0.5 s the scenario asks a for partition 2, which comes before 1 because
/// its priority is higher. At 1.2 s the countdowns of both end; that of a makes b's partition 2 run at the same instant.
#[test]
fn model_partitions_run_at_the_ticks_of_their_clocks_by_priority() {
    let folder = tempfile::tempdir().unwrap();
    let fmu = scheduled::write(folder.path());
    std::fs::write(folder.path().join("in.csv"), "time,asked,u\n0,0,7\n0.5,1,7\n0.7,0,7\n")
        .unwrap();
    let system = format!(
        "[fmus]\na = {fmu:?}\nb = {fmu:?}\n\
         [[connections]]\nfrom = \"a.done\"\nto = \"b.asked\"\n\
         [[connections]]\nfrom = \"a.sum\"\nto = \"b.u\"\n\
         [[scenario.table]]\ncsv = \"in.csv\"\nelement = \"a\"\n"
    );
    let file = folder.path().join("system.toml");
    std::fs::write(&file, system).unwrap();
    for (number, more) in
        [&[][..], &["--method", "jacobi", "--jobs", "2"], &["--isolate"]].into_iter().enumerate()
    {
        let out = folder.path().join(number.to_string());
        let (file, out) = (file.to_str().unwrap(), out.to_str().unwrap());
        let run = ["run", file, "--stop-time", "1.5", "--step", "0.4", "--out", out];
        let output = tests::run(&[&run, more].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let rows = Table::read(&std::path::Path::new(out).join("results.csv"));
        let changes = |name: &str| {
            let (times, values) = (rows.column("time"), rows.column(name));
            let rounded = |time: f64| (1e9 * time).round() / 1e9;
            let mut actual: Vec<(f64, f64)> = times.into_iter().map(rounded).zip(values).collect();
            actual.retain(|(_, value)| !value.is_nan());
            actual.dedup_by_key(|(_, value)| *value);
            actual
        };
        let order = [(0.0, 1.0), (0.5, 121.0), (1.0, 1211.0), (1.2, 12_113.0), (1.5, 121_131.0)];
        assert_eq!(changes("a.order"), order);
        let order = [(0.0, 1.0), (0.5, 11.0), (1.0, 111.0), (1.2, 11_132.0), (1.5, 111_321.0)];
        assert_eq!(changes("b.order"), order);
        assert_eq!(changes("a.sum"), [(0.0, 0.0), (0.5, 7.0)]);
        assert_eq!(changes("b.sum"), [(0.0, 0.0), (1.2, 7.0)]);
    }
}

/// The functions are those of the header of the standard, without what nm lists.
#[test]
fn check_names_the_functions_that_the_library_lacks() {
    let folder = tempfile::tempdir().unwrap();
    let fmu = scheduled::write(folder.path());
    let output = tests::run(&["check", "--json", "--no-run", fmu.to_str().unwrap()]);
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let findings = report["findings"].as_array().unwrap().iter();
    let mut findings = findings.filter(|finding| finding["part"] == "binaries");
    let lacking = findings.find_map(|finding| finding["what"].as_str()?.strip_prefix("lacks "));
    let lacking: BTreeSet<&str> = lacking.unwrap().split(", ").collect();
    let header = root().join("crates/fmu-import/headers/fmi3Functions.h");
    let header = std::fs::read_to_string(header).unwrap();
    let declared = header.lines().filter_map(|line| {
        line.strip_prefix("FMI3_Export ")?.split_whitespace().nth(1)?.strip_suffix(';')
    });
    let unpacked = Unpacked::open(&fmu).unwrap();
    let library = unpacked.library("scheduled3").unwrap();
    let listed = Command::new("nm").args(["-D", "--defined-only"]).arg(library).output().unwrap();
    let listed = String::from_utf8(listed.stdout).unwrap();
    let exported: BTreeSet<&str> = listed.split_whitespace().collect();
    assert!(exported.contains("fmi3ActivateModelPartition"), "{listed}");
    let expected: BTreeSet<&str> = declared.filter(|name| !exported.contains(name)).collect();
    assert!(expected.contains("fmi3DoStep") && lacking == expected, "{lacking:?}");
    assert_eq!(output.status.code(), Some(1));
}

/// The FMU is not asked for an interval that its description states.
#[test]
fn an_error_of_a_stated_interval_names_the_description() {
    let folder = tempfile::tempdir().unwrap();
    let (from, to) = (r#"intervalDecimal="0.5""#, r#"intervalDecimal="0""#);
    let fmu = format!("a={}", scheduled::write_with(folder.path(), from, to).display());
    for more in [&[][..], &["--isolate"]] {
        let run = ["run", "--fmu", &fmu, "--stop-time", "1", "--step", "0.5", "--out"];
        let out = folder.path().display().to_string();
        let output = tests::run(&[&run[..], &[out.as_str()], more].concat());
        let message = String::from_utf8_lossy(&output.stderr);
        let expected =
            "modelDescription.xml gives the clock with the value reference 1 the interval 0 s";
        assert!(!output.status.success() && message.contains(expected), "{message}");
    }
}

#[test]
fn a_negative_interval_of_a_clock_is_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let fmu = format!("a={}", scheduled::write(folder.path()).display());
    let out = folder.path().display().to_string();
    let run = ["run", "--fmu", &fmu, "--set", "a.u=-1", "--stop-time", "1.5", "--step", "0.4"];
    let output = tests::run(&[&run[..], &["--out", &out]].concat());
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{message}");
    let warning = "a: fmi3GetIntervalDecimal gives the clock with the value reference 3 the interval -0.2 s at t = 1 s";
    assert_eq!(message.matches(warning).count(), 1, "{message}");
}
