//! FMUs in C under `aso-ftc run`, in its own process, that reach for the results file:
//! no row is missing or wrong in silence.
#![cfg(target_os = "linux")]

use tests::c_fmu::CFmu;
use tests::coupled::{ALL, Run, TO_T1};

/// Does it in each step from 0.5 s on.
fn run(deed: &str, more: &[&str]) -> Run {
    Run::pair(&CFmu::that(&format!("{deed} in fmi2DoStep")), more)
}

#[test]
fn small_descriptors_are_not_those_of_the_results() {
    for deed in ["null over", "write to", "truncate", "rewind", "overwrite", "close"] {
        run(&format!("{deed} descriptors"), &[]).expect(0, ALL);
    }
}

#[test]
fn a_descriptor_of_the_results_that_is_closed_or_replaced_loses_no_row() {
    for deed in ["null over results", "close results"] {
        let run = run(deed, &[]);
        run.expect(0, ALL);
        run.says(&["warning", "out/results.csv: an FMU has closed or replaced", "--isolate"]);
    }
}

#[test]
fn results_that_an_fmu_changes_or_moves_end_the_run_with_a_sentence() {
    for (deed, part) in [
        ("truncate results", "has 20 bytes, expected "),
        ("write to results", " bytes, expected "),
        ("rewind results", "may have overwritten rows"),
        ("overwrite results", "may have overwritten rows"),
        ("delete the output", "deleted, moved or replaced during the run"),
        ("replace the output", "deleted, moved or replaced during the run"),
    ] {
        let run = run(deed, &[]);
        assert_eq!(run.status, Some(1), "{deed}: {}", run.message);
        run.says(&["error", "out/results.csv: ", part]);
        if deed == "write to results" {
            run.expect(1, TO_T1);
        }
    }
}

#[test]
fn isolated_fmus_do_not_reach_the_results() {
    for deed in ["null over results", "truncate results", "overwrite results"] {
        Run::pair(&CFmu::that(&format!("{deed} in fmi2DoStep")), &["--isolate"]).expect(0, ALL);
    }
}
