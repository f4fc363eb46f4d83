use std::path::Path;

use super::*;

const WHOLE: &str = r#"
system = "car.ssp"
preload = ["libpython3.11.so.1.0"]

[fmus]
zebra = "Z.fmu"
ape = "/opt/A.fmu"

[[connections]]
from = "zebra.y"
to = "ape.u"
factor = 2
offset = -1.5

[settings]
"zebra.k[1,2]" = 3.5
zebra.on = true
ape = { mode = "fast", count = 7, inner.gain = 1e-3 }

[algorithm]
method = "jacobi"
extrapolation = "hold"
step = 0.01
every = { ape = 5 }

[experiment]
start-time = -1
stop-time = 2.5

[results]
file = "out/a.parquet"
record = ["zebra.*"]
exclude = ["*.x"]
every = 0.1
plot = ["zebra.y"]
plot-file = "a.png"

[isolation]
isolate = true
time-limit = 3
memory-limit = "1536 MiB"

[checkpoint]
file = "state"
every = 1

[[scenario.table]]
csv = "inputs.csv"
"#;

fn parsed(text: &str) -> Config {
    parse(text, Path::new("/models/system.toml")).unwrap()
}

/// Returns the error message for `text`.
fn refused(text: &str) -> String {
    parse(text, Path::new("system.toml")).unwrap_err().to_string()
}

#[test]
fn relative_paths_start_at_the_folder_of_the_file() {
    let config = parsed(WHOLE);
    assert_eq!(config.system.as_deref(), Some(Path::new("/models/car.ssp")));
    assert_eq!(config.fmus.0[0].1, Path::new("/models/Z.fmu"));
    assert_eq!(config.fmus.0[1].1, Path::new("/opt/A.fmu"));
    assert_eq!(config.results.file.as_deref(), Some(Path::new("/models/out/a.parquet")));
    assert_eq!(config.checkpoint.file.as_deref(), Some(Path::new("/models/state")));
    assert_eq!(config.scenario.table[0].get_ref().csv.get_ref(), "/models/inputs.csv");
}

#[test]
fn fmus_and_settings_keep_the_order_of_the_file() {
    let config = parsed(WHOLE);
    let fmus: Vec<_> = config.fmus.0.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(fmus, ["zebra", "ape"]);
    let settings: Vec<_> =
        config.settings.0.iter().map(|(name, value, _)| format!("{name}={value}")).collect();
    let expected = [
        "zebra.k[1,2]=3.5",
        "zebra.on=true",
        "ape.mode=fast",
        "ape.count=7",
        "ape.inner.gain=0.001",
    ];
    assert_eq!(settings, expected);
}

#[test]
fn a_rendered_configuration_reads_back_as_equal() {
    let mut config = parsed(WHOLE);
    config.settings.push("ape.mode".to_owned(), "a \"quoted\" text\n".to_owned());
    let text = config.render().unwrap();
    let again = parse(&text, Path::new("elsewhere/system.toml")).unwrap();
    let plain = |config: &Config| {
        let settings: Vec<_> = config
            .settings
            .0
            .iter()
            .map(|(name, value, _)| (name.clone(), value.clone()))
            .collect();
        (settings, Config { settings: Settings::default(), ..config.clone() })
    };
    assert_eq!(plain(&again), plain(&config), "{text}");
    assert_eq!(again.render().unwrap(), text);
    assert_eq!(parsed(&parsed("").render().unwrap()), Config::default());
}

#[test]
fn every_interval_reads_back_as_the_same() {
    for every in [Every::Seconds(0.1), Every::Seconds(1e-300), Every::Step, Every::Never] {
        assert_eq!(every.to_string().parse(), Ok(every));
        let config =
            Config { results: Results { every: Some(every), ..Results::default() }, ..parsed("") };
        assert_eq!(parsed(&config.render().unwrap()).results.every, Some(every));
    }
}

#[test]
fn errors_state_line_column_and_expectation() {
    for (text, parts) in [
        ("sytem = 'a.ssp'", ["system.toml:1:1", "sytem", "`system`"]),
        ("A = [[0]]\nB = [[1]]", ["system.toml:1:1", "plant file", "`aso-ftc design`"]),
        ("\n[algorithm]\nstpe = 1", ["system.toml:3:1", "stpe", "`step`"]),
        ("[algorithm]\nmethod = 'jakobi'", ["system.toml:2:10", "jakobi", "gauss-seidel"]),
        ("[experiment]\nstop-time = inf", ["system.toml:2:13", "stop-time", "finite"]),
        ("[experiment]\nstop-time = 'now'", ["system.toml:2:13", "string", "f64"]),
        ("[results]\nevery = 0", ["system.toml:2:9", "found 0", "above 0"]),
        ("[results]\nevery = 'often'", ["system.toml:2:9", "often", "\"step\""]),
        ("[isolation]\ntime-limit = -1", ["system.toml:2:14", "time-limit", "above 0"]),
        ("[isolation]\nmemory-limit = '2 gigs'", ["system.toml:2:16", "2 gigs", "2GiB"]),
        ("[checkpoint]\nevery = 1", ["system.toml:2:9", "every", "file"]),
        ("[[connections]]\nfrom = 'a.y'", ["system.toml:1:1", "missing field", "to"]),
        ("[fmus]\na = 1", ["system.toml:2:5", "integer", "path"]),
        ("[settings]\na.b = [1]", ["system.toml:2:7", "sequence", "a number, true"]),
        ("[settings]\na.b = 1\n'a.b' = 2", ["system.toml:1:1", "a.b", "twice"]),
        ("a = [", ["system.toml:1:", "a = [", "array"]),
    ] {
        let message = refused(text);
        for part in parts {
            assert!(message.contains(part), "{part:?} is not in {message}");
        }
    }
}

#[test]
fn hostile_text_ends_in_an_error() {
    let deep = format!("[settings]\na = {}1{}", "{ b = ".repeat(20_000), " }".repeat(20_000));
    refused(&deep);
    refused(&format!("a = {}", "[".repeat(100_000)));
    refused("[settings]\na = 99999999999999999999");
}

#[test]
fn the_documented_example_has_every_entry_of_the_algorithm() {
    let document = include_str!("../../../../docs/reference/system-toml.md");
    let section = document.split("## A complete example\n\n```toml\n").nth(1).unwrap();
    let example = section.split("```").next().unwrap();
    let config = parsed(example);
    assert_eq!((config.fmus.0.len(), config.settings.0.len()), (1, 3));
    // The error about an unknown entry lists the known entries.
    let message = refused("[algorithm]\nx = 1");
    let known: Vec<_> = message.lines().next().unwrap().split('`').skip(3).step_by(2).collect();
    assert!(known.len() >= 17, "{message}");
    let stated = example.parse::<toml::Table>().unwrap();
    for name in known {
        assert!(stated["algorithm"].get(name).is_some(), "{name} is not in the example");
    }
}
