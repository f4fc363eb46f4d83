//! Design files that cannot be used, each with its message.

use super::*;

/// The message about the small design in which `from` is replaced.
fn message(limits: &str, from: &str, to: &str) -> String {
    let text = small(limits);
    assert!(text.contains(from), "{from}");
    let failure = with_design(&text.replacen(from, to, 1)).err();
    let message = failure.unwrap_or_else(|| panic!("{to:?} is accepted")).to_string();
    assert!(message.contains("design.toml"), "{message}");
    message
}

#[test]
fn a_design_that_does_not_fit_is_refused_by_matrix_and_shape() {
    let wrong = [
        ("L_f = [[-12.0]]", "L_f = [[-12.0, 1.0]]", "L_f is 1 x 2, expected 1 x 1"),
        ("B = [[0.0], [2.0]]", "B = [[0.0]]", "B is 1 x 1, expected 2 x 1"),
        ("A = [[0.0, 1.0], [0.0, -0.2]]", "A = [[0.0, 1.0], [0.0]]", "row 2 has 1 entries"),
        ("K_f = [[1.0]]", "K_f = [[nan]]", "K_f[1,1] = NaN"),
        ("K_f = [[1.0]]", "", "K_f"),
        ("t_on = 0.35", "t_on = 0.35\nt_off = 2.0", "t_off"),
        ("t_on = 0.35", "t_on = inf", "t_on = inf"),
        ("step_size = 0.01", "step_size = 0.0", "step_size = 0"),
        ("step_size = 0.01", "", "step_size is missing"),
        (
            "stop_time = 10.0",
            "stop_time = 0.001",
            "stop_time = 0.001, expected more than step_size",
        ),
        ("[[faults]]\nname = \"f\"", "", "faults"),
        ("A = [[", "A = [", "TOML"),
    ];
    for (from, to, expected) in wrong {
        let message = message("", from, to);
        assert!(message.contains(expected), "{message:?} has no {expected:?}");
    }
    let message = message("limits = [2.0, 1.0]", "u", "u");
    assert!(message.contains("limits"), "{message}");
}

#[test]
fn each_optional_entry_is_refused_where_it_does_not_fit() {
    let first = "t_on = 0.35";
    let wrong = [
        (first, "A_f = [[0.0, 1.0]]", "A_f is 1 x 2, expected 1 x 1 (faults x faults)"),
        (first, "A_f = [[inf]]", "A_f[1,1] = inf, expected a finite number"),
        (first, "filter = [1.0, 2.0]", "filter is 2 numbers, expected 1 numbers (measurements)"),
        (first, "filter = [0.0]", "filter = 0, expected more than 0 1/s"),
        (first, "filter = [nan]", "filter = NaN"),
        (first, "filter = [inf]", "filter = inf"),
        (first, "sample_time = 0.1", "estimator is not"),
        (first, "estimator = \"current\"", "sample_time is not"),
        (first, "sample_time = 0.1\nestimator = \"fast\"", "fast"),
        (first, "sample_time = 0.0\nestimator = \"current\"", "sample_time = 0, expected more"),
        (first, "sample_time = inf\nestimator = \"current\"", "sample_time = inf"),
        (first, "sample_time = 1e-9\nestimator = \"current\"", "at most 1e6 times sample_time"),
        (
            first,
            "sample_time = 0.1\nestimator = \"current\"\nfilter = [1.5]",
            "filter = 1.5, expected more than 0 and at most 1",
        ),
        ("name = \"v\"", "operating = nan", "operating of v = NaN, expected a finite number"),
        ("name = \"f\"", "operating = 1.0", "operating"),
        ("name = \"f\"", "loss_of = \"u\"", "fault f: loss_of is stated and least_command is not"),
        (
            "name = \"f\"",
            "least_command = 1.0",
            "fault f: least_command is stated and loss_of is not",
        ),
        (
            "name = \"f\"",
            "loss_of = \"w\"\nleast_command = 1.0",
            "\"w\" is the name of 0 actuators",
        ),
        ("name = \"f\"", "loss_of = \"u\"\nleast_command = 0.0", "least_command of f = 0"),
        ("name = \"f\"", "loss_of = \"u\"\nleast_command = -1.0", "least_command of f = -1"),
        ("name = \"v\"", "loss_of = \"u\"", "loss_of"),
        (first, "H = [[1.0]]", "H and K_i belong together"),
        (first, "K_i = [[1.0]]", "H and K_i belong together"),
        (first, "L_w = [[1.0]]", "F_i and L_w belong to K_i"),
        (first, "N_r = [[1.0]]", "references belong to K_i or N_r"),
        (first, "references = [{ name = \"r\" }]", "references belong to K_i or N_r"),
        (
            first,
            "H = [[1.0, 2.0]]\nK_i = [[1.0]]\nreferences = [{ name = \"r\" }]",
            "H is 1 x 2, expected 1 x 1 (references x measurements)",
        ),
        (
            first,
            "N_r = [[1.0, 2.0]]\nreferences = [{ name = \"r\" }]",
            "N_r is 1 x 2, expected 1 x 1 (actuators x references)",
        ),
    ];
    for (after, entry, expected) in wrong {
        let message = message("", after, &format!("{after}\n{entry}"));
        assert!(message.contains(expected), "{message:?} has no {expected:?}");
    }
    let measured = "[[measurements]]\nname = \"x\"";
    let wrong = [
        ("range = [1.0, 1.0]", "range of x from 1 to = 1, expected two finite numbers"),
        ("range = [-1.0, inf]", "range of x from -1 to = inf, expected two finite numbers"),
        ("range = [1.0, 2.0]", "operating of x = 0, expected a value within its range"),
        ("longest_hold = 0.0", "longest_hold of x = 0, expected a time above 0 s"),
        ("longest_hold = inf", "longest_hold of x = inf, expected a time above 0 s"),
    ];
    for (entry, expected) in wrong {
        let message = message("", measured, &format!("{measured}\n{entry}"));
        assert!(message.contains(expected), "{message:?} has no {expected:?}");
    }
    let sampled = "sample_time = 0.001\nestimator = \"current\"\n";
    let text = sampled.to_owned()
        + &small("").replace(measured, &format!("{measured}\nlongest_hold = 1e9"));
    let actual = with_design(&text).err().unwrap().to_string();
    assert!(
        actual.contains("longest_hold of x = 1000000000, expected fewer than 2^32 samples"),
        "{actual}"
    );
    let limits = "limits = [1.0, 2.0]";
    let message = message(limits, "name = \"v\"", "name = \"v\"\noperating = 1.0");
    assert!(
        message.contains("operating of u = 0, expected a command within its limits"),
        "{message}"
    );
}

#[test]
fn the_communication_step_of_a_sampled_design_is_its_sample_time_unless_stated() {
    let sampled = "t_on = 0.35\nsample_time = 0.02\nestimator = \"prediction\"";
    let text = small("").replace("t_on = 0.35", sampled);
    let step_size = |text: &str| with_design(text).unwrap().about().default_experiment.step_size;
    assert_eq!(step_size(&text), Some(0.01));
    assert_eq!(step_size(&text.replace("step_size = 0.01", "")), Some(0.02));
}

#[test]
fn a_reconfiguration_that_does_not_fit_is_refused_by_its_actuator() {
    let wrong = [
        ("gone = \"v\"", "without v: there is no actuator of this name"),
        ("K_s = [0.0]", "without u: expected K_x of actuators x states"),
        ("K_s = [inf]", "without u: a number is not finite"),
        ("restart = [\"g\"]", "without u: `restart` names a fault that does not exist"),
        ("loss = 0.9", "without u: loss and time belong together"),
        ("loss = 0.9\ntime = 1.0", "and to a fault with loss_of"),
    ];
    for (entry, expected) in wrong {
        let mut entries = vec!["gone = \"u\"", "K_s = [0.0]", "K_x = [[0.0, 0.0]]"];
        let key = entry.split(' ').next().unwrap();
        entries.retain(|entry| !entry.starts_with(key));
        entries.push(entry);
        if expected.contains("expected K_x") {
            entries.retain(|entry| !entry.starts_with("K_x"));
            entries.push("K_x = [[0.0]]");
        }
        let fault = "[[faults]]\nname = \"f\"";
        let text = entries.join("\n");
        let to = format!("[[reconfigurations]]\nstuck_at = 0.0\nK_f = [[0.0]]\n{text}\n\n{fault}");
        let message = message("", fault, &to);
        assert!(message.contains(expected), "{message:?} has no {expected:?}");
    }
}

#[test]
fn a_fall_back_or_a_combination_that_does_not_fit_is_refused() {
    let wrong = [
        ("[fallback]\nK_x = [[0.0]]", "fallback: expected K_x of actuators x states"),
        ("[fallback]\nK_x = [[0.0, inf]]", "fallback: a number is not finite"),
        ("[fallback]\nK_x = [[0.0, 0.0]]\nK_f = [[0.0, 0.0]]", "K_f of actuators x faults"),
        (
            "[[reconfigurations]]\ngone = \"u\"\nstuck_at = 0.0",
            "without u: expected K_x of actuators x states, K_f of actuators x faults, K_s with one \
             number for each actuator; or none of them together with [fallback]",
        ),
        (
            "[[combinations]]\ngone = [\"u\", \"v\"]\nK_x = [[0.0, 0.0]]\nK_f = [[0.0]]\nK_s = [[0.0, 0.0]]",
            "combination without u, v: expected at least two actuators, each with an entry",
        ),
    ];
    let fault = "[[faults]]\nname = \"f\"";
    for (entry, expected) in wrong {
        let message = message("", fault, &format!("{entry}\n\n{fault}"));
        assert!(message.contains(expected), "{message:?} has no {expected:?}");
    }
    let fits = small("").replace(
        fault,
        &format!("[[reconfigurations]]\ngone = \"u\"\nstuck_at = 0.0\n\n[fallback]\nK_x = [[0.0, 0.0]]\n\n{fault}"),
    );
    assert!(with_design(&fits).is_ok());
}
