//! FMUs of three versions of FMI in one system.

use std::fs;
use std::path::Path;

use tests::c_fmu::CFmu;
use tests::{c_versions, run};

const CONNECTIONS: [(&str, &str); 9] = [
    ("one.y", "two.u"),
    ("two.y", "three.u"),
    ("three.b", "four.a"),
    ("three.ticks", "one.i_in"),
    ("one.i_out", "two.i_in"),
    ("two.i_out", "four.k_in"),
    ("two.y", "four.f"),
    ("three.bytes_out", "four.bytes_in"),
    ("four.third", "two.b_in"),
];

/// Writes one FMU of FMI 1.0, one of 2.0 and two of 3.0, and a system of them.
fn write(folder: &Path, connections: &[(&str, &str)]) -> String {
    let one = c_versions::slave_1(folder, "plain").display().to_string();
    let two = CFmu::well_behaved().write(folder, "slave2").display().to_string();
    let three = c_versions::slave_3(folder, "plain", true).display().to_string();
    let mut text =
        format!("[fmus]\none = {one:?}\ntwo = {two:?}\nthree = {three:?}\nfour = {three:?}\n");
    for (from, to) in connections {
        for part in ["[[connections]]\nfrom = \"", from, "\"\nto = \"", to, "\"\n"] {
            text += part;
        }
    }
    text += "[settings]\nthree.level = 9\nfour.level = 9\nthree.a = \"3 4\"\n[algorithm]\nmethod = \
             \"jacobi\"\nextrapolation = \"hold\"\ncoupling = \"once\"\nstep = 0.125\n[experiment]\nstop-time \
             = 1\n";
    let path = folder.join("system.toml");
    fs::write(&path, text).unwrap();
    path.display().to_string()
}

/// Runs a system; returns exit status, messages, and the last row by name.
fn outcome(
    system: &str,
    folder: &Path,
    more: &[&str],
) -> (Option<i32>, String, impl Fn(&str) -> f64 + use<>) {
    let out = folder.join("out").display().to_string();
    let mut arguments = vec!["run", system, "--out", &out];
    arguments.extend(more);
    let output = run(&arguments);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    let results = fs::read_to_string(folder.join("out/results.csv")).unwrap_or_default();
    let mut reader = csv::Reader::from_reader(results.as_bytes());
    let names = reader.headers().cloned().unwrap_or_default();
    let last = reader.records().last().and_then(Result::ok).unwrap_or_default();
    let at = move |name: &str| {
        let column = names.iter().position(|column_name| column_name == name);
        let text = &last[column.unwrap_or_else(|| panic!("{name} in {names:?}"))];
        text.parse().unwrap_or_else(|_| panic!("{name} is {text:?}"))
    };
    (output.status.code(), errors, at)
}

#[test]
fn fmus_of_three_versions_exchange_values_of_all_types() {
    for more in [&[][..], &["--isolate"]] {
        let folder = tempfile::tempdir().unwrap();
        let system = write(folder.path(), &CONNECTIONS);
        let (status, errors, at) = outcome(&system, folder.path(), more);
        assert_eq!(status, Some(0), "{errors}");
        // y' = u, held over steps, which end every 0.125 s and at the ticks of `three` and `four`, every 0.1 s.
        let mut points: Vec<f64> = (0..=8).map(|k| 0.125 * f64::from(k)).collect();
        points.extend((1..10).filter(|k| *k != 5).map(|k| 0.1 * f64::from(k)));
        points.sort_by(f64::total_cmp);
        let (mut two, mut three, mut two_before) = (0.0, 0.0, 0.0);
        for step in points.windows(2) {
            let size = step[1] - step[0];
            three += size * two;
            two_before = two;
            two += size * step[0];
        }
        assert!((at("one.y") - 1.0).abs() < 1e-12);
        // Two local variables have this name; it stands for the first one, y.
        assert!((at("one.twice") - 1.0).abs() < 1e-12);
        assert!(errors.contains("a name that is used once"), "{errors}");
        assert!((at("two.y") - two).abs() < 1e-12);
        assert!((at("three.y") - three).abs() < 1e-12);
        assert_eq!((at("three.b[1]"), at("three.b[2]")), (6.0, 8.0));
        assert_eq!((at("four.b[1]"), at("four.b[2]")), (12.0, 16.0));
        // Ticks at 0 s, 0.1 s, ..., 1 s. `one` and `two` have no event mode: they pass the count on with the next
        // step, and those before 1 s start at 0.9 s and 0.875 s. `four` gets it at the instant at which it changes.
        assert_eq!(at("three.ticks"), 11.0);
        assert_eq!(at("one.i_out"), 10.0);
        assert_eq!(at("two.i_out"), 9.0);
        assert_eq!(at("four.k_out"), 9.0);
        // As a Float32, from the start of the last step.
        assert!((at("four.g") - two_before).abs() < 1e-7);
    }
}

#[test]
fn connections_that_types_or_sizes_forbid_are_refused_by_name() {
    for (pair, expected) in [
        (("one.y", "three.k_in"), "Int32"),
        (("three.k_out", "one.b_in"), "Boolean"),
        (("three.b", "four.u"), "an array of size [2]"),
        (("one.y", "four.a"), "are connected by element, such as four.a[1]"),
        (("three.bytes_out", "one.s_in"), "String"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let system = write(folder.path(), &[pair]);
        let (status, errors, _) = outcome(&system, folder.path(), &[]);
        assert_eq!(status, Some(2), "{errors}");
        assert!(errors.contains(pair.1) && errors.contains(expected), "{errors}");
    }
}

#[test]
fn a_structural_parameter_of_one_fmu_fits_its_arrays_to_those_of_another() {
    let folder = tempfile::tempdir().unwrap();
    let system = write(folder.path(), &[("three.b", "four.a")]);
    let three = ["--set", "three.n=4", "--set", "three.a=1 2 3 4"];
    let (status, errors, _) = outcome(&system, folder.path(), &three);
    assert_eq!(status, Some(2), "{errors}");
    assert!(errors.contains("[4]") && errors.contains("[2]"), "{errors}");
    let both = [&three[..], &["--set", "four.n=4"]].concat();
    let (status, errors, at) = outcome(&system, folder.path(), &both);
    assert_eq!(status, Some(0), "{errors}");
    assert_eq!(at("four.b[4]"), 16.0);
}

#[test]
fn an_fmu_of_fmi_1_cannot_take_part_in_a_checkpoint_and_the_message_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let system = write(folder.path(), &CONNECTIONS);
    let checkpoint = folder.path().join("checkpoint").display().to_string();
    let (status, errors, _) = outcome(&system, folder.path(), &["--checkpoint", &checkpoint]);
    assert_eq!(status, Some(2), "{errors}");
    assert!(
        errors.contains("one cannot take part in a checkpoint: FMI 1.0 has no functions"),
        "{errors}"
    );
}
