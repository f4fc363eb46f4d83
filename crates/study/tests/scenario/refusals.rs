//! Error messages of invalid scenarios, with their location in the file.

use std::path::Path;

use super::{Document, scenario, setup, system};

/// Returns the error message and the text at its location.
fn refused(text: &str, folder: &Path) -> (String, String) {
    let error = scenario(text).resolve(&system().0, &setup(folder)).unwrap_err();
    (error.to_string(), text[error.place].to_owned())
}

fn expect(text: &str, message: &str) {
    let (refusal, _) = refused(text, Path::new("."));
    assert_eq!(refusal, message, "{text}");
}

fn set(rest: &str) -> String {
    format!("scenario.set = [{{ {rest} }}]")
}

fn signal(rest: &str) -> String {
    format!("scenario.signal = [{{ {rest} }}]")
}

fn fault(rest: &str) -> String {
    format!("scenario.fault = [{{ {rest} }}]")
}

#[test]
fn variables_that_are_missing_or_cannot_be_set_are_refused() {
    let value = |name: &str| set(&format!("variable = \"{name}\", at = 1, value = 1"));
    for (name, message) in [
        ("plant.forc", "plant.forc: Listener has no variable \"forc\", it has force, F_c"),
        ("pump.x", "pump.x: there is no FMU of the name \"pump\", expected one of plant, ctrl"),
        ("force", "\"force\" names no variable, expected the form FMU.VARIABLE"),
        ("plant.y", "plant.y is a continuous output, expected an input or a tunable parameter"),
        ("plant.mass", "plant.mass is a fixed parameter, expected an input or a tunable parameter"),
        (
            "ctrl.force",
            "ctrl.force is connected to plant.y and gets its values from there; a fault on this \
             connection can hold another one: stuck = { value = .. }",
        ),
    ] {
        expect(&value(name), &format!("scenario.set[1]: {message}"));
    }
}

#[test]
fn values_that_do_not_fit_the_type_are_refused() {
    for (name, value, expected) in [
        ("force", "true", "true: expected a finite number"),
        ("force", "inf", "inf: expected a finite number"),
        ("force", "\"1\"", "\"1\": expected a finite number"),
        ("count", "1.5", "1.5: expected an Integer of 32 bits"),
        ("count", "2147483648", "2147483648: expected an Integer of 32 bits"),
        (
            "gear",
            "\"third\"",
            "\"third\": expected a whole number or one of reverse, first, second",
        ),
        ("on", "1", "1: expected true or false"),
        ("mode", "1", "1: expected a text in quotes"),
        (
            "mode",
            "\"a\\u0000b\"",
            "\"a\\0b\": expected a text without the character NUL, which ends the Strings of FMI",
        ),
    ] {
        let text = set(&format!("variable = \"plant.{name}\", at = 1, value = {value}"));
        expect(&text, &format!("scenario.set[1]: plant.{name} = {expected}"));
    }
}

#[test]
fn units_that_do_not_fit_are_refused() {
    for (name, unit, message) in [
        ("force", "m", "plant.force is in \"N\", to which \"m\" cannot be converted"),
        (
            "level",
            "m",
            "plant.level has no unit, expected a value without one, found the unit \"m\"",
        ),
        (
            "count",
            "m",
            "plant.count has no unit, expected a value without one, found the unit \"m\"",
        ),
        (
            "force",
            "frog",
            "unit \"frog\", column 1: expected a unit such as kg, m, s, rad, N, J, W, Pa, degC or %, \
             with or without an SI prefix, found \"frog\"",
        ),
    ] {
        let text =
            set(&format!("variable = \"plant.{name}\", at = 1, value = 1, unit = \"{unit}\""));
        expect(&text, &format!("scenario.set[1]: {message}"));
    }
}

#[test]
fn invalid_signals_are_refused() {
    for (rest, message) in [
        ("", "found none, expected exactly one of constant, steps, points, ramp, sine, csv"),
        (
            ", constant = 1, points = [[0, 1]]",
            "found constant and points, expected exactly one of constant, steps, points, ramp, \
             sine, csv",
        ),
        (
            ", ramp = { from = 2, until = 1, begin = 0, end = 1 }",
            "until is 1, expected a time after from",
        ),
        (", sine = { amplitude = 1, frequency = 0 }", "frequency is 0, expected a number above 0"),
        (
            ", sine = { amplitude = nan, frequency = 1 }",
            "amplitude is NaN, expected a finite number",
        ),
        (", points = []", "there are no points, expected at least one"),
        (
            ", points = [[1, 0], [0, 0]]",
            "point 2: the time 0 s comes after 1 s, expected ascending times",
        ),
        (", steps = [[1, 0], [1, 2]]", "steps: expected each time once"),
    ] {
        let text = signal(&format!("variable = \"plant.force\"{rest}"));
        expect(&text, &format!("scenario.signal[1]: {message}"));
    }
    let text = signal("variable = \"plant.on\", points = [[0, 1]]");
    let message =
        "points does not fit plant.on, which is of type Boolean; expected constant, steps or csv";
    expect(&text, &format!("scenario.signal[1]: {message}"));
    let twice = "scenario.signal = [{ variable = \"plant.force\", constant = 1 }]\n\
                 scenario.set = [{ variable = \"plant.force\", at = 0, value = 1 }]";
    let message = "scenario.signal[1]: plant.force is driven twice, also by scenario.set[1]";
    expect(twice, message);
}

#[test]
fn files_that_do_not_fit_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("a.csv", "time,u,count\n0,1,1.5\n");
    write("bad.csv", "time,u\n0,x\n");
    let path = |name: &str| folder.path().join(name).display().to_string();
    for (text, message) in [
        (
            signal("variable = \"plant.force\", csv = { file = \"a.csv\" }"),
            format!(
                "scenario.signal[1]: {}: there is no column \"force\", it has u, count",
                path("a.csv")
            ),
        ),
        (
            signal("variable = \"plant.count\", csv = { file = \"a.csv\" }"),
            format!(
                "scenario.signal[1]: plant.count = 1.5 in row 1 of {}: expected an Integer of 32 bits",
                path("a.csv")
            ),
        ),
        (
            signal("variable = \"plant.force\", csv = { file = \"bad.csv\", column = \"u\" }"),
            format!(
                "scenario.signal[1]: {}: line 2, column \"u\": expected a finite number, found \"x\"",
                path("bad.csv")
            ),
        ),
        (
            "scenario.table = [{ csv = \"a.csv\" }]".to_owned(),
            format!(
                "scenario.table[1]: {}: no column is called as FMU.VARIABLE of a free input, it \
                 has u, count",
                path("a.csv")
            ),
        ),
        (
            "scenario.table = [{ csv = \"a.csv\", element = \"pump\" }]".to_owned(),
            "scenario.table[1]: pump.u: there is no FMU of the name \"pump\", expected one of plant, \
             ctrl"
                .to_owned(),
        ),
    ] {
        assert_eq!(refused(&text, folder.path()).0, message);
    }
    let (actual, _) = refused("scenario.table = [{ csv = \"none.csv\" }]", folder.path());
    assert!(actual.starts_with(&format!("scenario.table[1]: {}: ", path("none.csv"))), "{actual}");
}

/// Checks that a fault on the connection is refused with the message.
fn expect_of_fault(connection: &str, body: &str, message: &str) {
    let text = fault(&format!("connection = \"{connection}\", {body}"));
    expect(&text, &format!("scenario.fault[1]: {message}"));
}

#[test]
fn faults_with_numbers_that_make_no_sense_are_refused() {
    for (body, message) in [
        ("bias = { value = inf }", "value is inf, expected a finite number"),
        ("stuck = { from = nan }", "from is NaN, expected a finite number"),
        ("stuck = { from = 2, until = 2 }", "until is 2, expected a time after from"),
        (
            "dropout = { period = 1, lost = 1 }",
            "lost is 1, expected a time above 0 and below the period",
        ),
        ("dropout = { probability = 2 }", "probability is 2, expected a number from 0 to 1"),
        ("dropout = { probability = 0.5, every = 0 }", "every is 0, expected a number above 0"),
        ("delay = { seconds = 0 }", "seconds is 0, expected a number above 0"),
        (
            "delay = { seconds = 1e9 }",
            "a delay of 1000000000 s is 2000000000 communication steps of 0.5 s, expected at most \
             250000",
        ),
        ("quantisation = { step = -1 }", "step is -1, expected a number above 0"),
        ("saturation = { min = 2, max = 1 }", "max is 1, expected a number not below min"),
        ("noise = { deviation = 0 }", "deviation is 0, expected a number above 0"),
    ] {
        expect_of_fault("ctrl.force", body, message);
    }
}

#[test]
fn faults_that_say_too_little_or_too_much_are_refused() {
    for (body, message) in [
        (
            "dropout = { period = 1 }",
            "dropout: expected period and lost, or probability, or none of them",
        ),
        ("dropout = { seed = 1 }", "dropout: expected every and seed only with probability"),
        ("saturation = {}", "saturation: expected min or max or both"),
        ("noise = {}", "noise: expected deviation (normal) or amplitude (uniform)"),
        (
            "bias = { value = 1 }, gain = { factor = 2 }",
            "found bias and gain, expected exactly one of bias, gain, drift, stuck, dropout, delay, \
             quantisation, saturation, noise, inversion",
        ),
    ] {
        expect_of_fault("ctrl.force", body, message);
    }
    // Twice 20 degC is 40 degC, but twice the same temperature in K is 313 degC.
    let signal = signal("variable = \"plant.temperature\", constant = 20");
    let gain = fault("connection = \"plant.temperature\", unit = \"K\", gain = { factor = 2 }");
    expect(
        &format!("{signal}\n{gain}"),
        "scenario.fault[1]: gain: expected no unit with an offset, as the factor acts in the unit of \
         the input",
    );
}

#[test]
fn faults_that_do_not_fit_their_connection_are_refused() {
    let no_source = "expected a connected input, or one that a signal drives";
    for (connection, body, message) in [
        (
            "ctrl.force",
            "inversion = {}",
            "inversion does not fit ctrl.force, which is of type Real; expected any kind but \
             inversion",
        ),
        (
            "ctrl.count",
            "gain = { factor = 2 }",
            "gain does not fit ctrl.count, which is of type Integer; expected bias, stuck, dropout, \
             delay or saturation",
        ),
        (
            "ctrl.count",
            "bias = { value = 0.5 }",
            "value is 0.5, expected a whole number, as the input is an Integer",
        ),
        (
            "ctrl.count",
            "bias = { value = 9007199254740992 }",
            "value is 9007199254740992, expected a magnitude below 2^53, as larger integers \
             are rounded",
        ),
        (
            "ctrl.level",
            "stuck = {}",
            &format!("ctrl.level is an input without a source, {no_source}"),
        ),
        ("plant.y", "stuck = {}", &format!("plant.y is an output, {no_source}")),
        ("ctrl.y=ctrl.force", "stuck = {}", "ctrl.force is connected to plant.y, expected ctrl.y"),
    ] {
        expect_of_fault(connection, body, message);
    }
}

#[test]
fn an_error_points_at_its_place_in_the_file() {
    let text = "[[scenario.set]]\nvariable = \"plant.force\"\nat = 1\nvalue = 1\n\n\
                [[scenario.set]]\nvariable = \"plant.forc\"\nat = 1\nvalue = 1\n";
    let (message, place) = refused(text, Path::new("."));
    assert!(message.starts_with("scenario.set[2]: "), "{message}");
    assert_eq!(place, "\"plant.forc\"");
    let (_, place) = refused(&set("variable = \"plant.on\", at = 1, value = 7"), Path::new("."));
    assert_eq!(place, "7");
    let text = "[[scenario.fault]]\nconnection = \"ctrl.force\"\nnoise = {}\n";
    let (_, place) = refused(text, Path::new("."));
    assert!(place.contains("[[scenario.fault]]"), "{place:?}");
    let text = "[[scenario.fault]]\nconnection = \"ctrl.force\"\nbias = { value = 1 }\n\n\
                [[scenario.fault]]\nconnection = \"ctrl.force\"\ndelay = { seconds = 1e9 }\n";
    let (message, _) = refused(text, Path::new("."));
    assert!(message.starts_with("scenario.fault[2]: a delay of"), "{message}");
}

#[test]
fn words_that_the_file_does_not_know_are_refused_with_those_it_knows() {
    for (text, part) in [
        ("scenario.fault = [{ connection = \"a.b\", stock = {} }]", "unknown field `stock`"),
        (
            "scenario.fault = [{ connection = \"a.b\", stuck = { form = 1 } }]",
            "unknown field `form`",
        ),
        ("scenario.set = [{ variable = \"a.b\", value = 1 }]", "missing field `at`"),
        ("scenario.sets = []", "unknown field `sets`"),
        (
            "scenario.set = [{ variable = \"a.b\", at = 1, value = [1] }]",
            "expected a number, true, false or a text in quotes",
        ),
    ] {
        let error = toml::from_str::<Document>(text).err().unwrap();
        assert!(error.to_string().contains(part), "{error}");
        assert!(error.span().is_some(), "{error}");
    }
}
