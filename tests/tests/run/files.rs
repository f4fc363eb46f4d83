//! What is recorded and drawn, and where it goes.

use master::results::Table as Results;
use tests::Table;

use super::*;

#[test]
fn everything_but_parameters_is_recorded_unless_names_or_patterns_say_otherwise() {
    let bench = Bench::new();
    let results = bench.path("out/results.csv");
    bench.coupled_well(&["--stop-time", "0.01"]);
    let all = names(&results);
    assert_eq!(all[..3], ["time", "plant.u", "plant.f_a"]);
    assert!(
        all.contains(&"controller.x_hat[4]".to_owned()) && !all.contains(&"plant.M".to_owned())
    );
    let record = ["--record", "controller.u", "--record", "plant.*_?", "--record", "plant.F_c"];
    bench.coupled_well(&[&["--stop-time", "0.01", "--exclude", "*.f_*"][..], &record].concat());
    assert_eq!(names(&results), ["time", "controller.u", "plant.x_p", "plant.v_p", "plant.F_c"]);
    assert!(Table::read(&results).column("plant.F_c").iter().all(|value| *value == 25.0));
}

#[test]
fn rows_come_at_their_interval_at_each_step_or_never() {
    let bench = Bench::new();
    let times = |every: &str| {
        bench.coupled_well(&["--stop-time", "0.1", "--step", "0.002", "--record-every", every]);
        Table::read(&bench.path("out/results.csv")).column("time")
    };
    assert_eq!(times("0.02"), [0.0, 0.02, 0.04, 0.06, 0.08, 0.1]);
    assert_eq!(times("step").len(), 51);
    let other = Bench::new();
    other.coupled_well(&["--stop-time", "0.1", "--record-every", "never"]);
    assert!(!other.path("out").exists());
}

#[test]
fn a_long_run_has_ten_thousand_intervals_and_a_short_one_every_step() {
    let bench = Bench::new();
    bench.coupled_well(&["--stop-time", "25", "--record", "plant.x_p"]);
    let time = Table::read(&bench.path("out/results.csv")).column("time");
    assert_eq!((time.len(), time[10_000]), (10_001 - 1_666 + 1_666, 25.0));
    bench.coupled_well(&["--stop-time", "10", "--record", "plant.x_p"]);
    assert_eq!(Table::read(&bench.path("out/results.csv")).column("time").len(), 10_001);
}

#[test]
fn parquet_has_the_numbers_of_csv() {
    let bench = Bench::new();
    bench.coupled_well(&["--stop-time", "0.2"]);
    let printed = bench.coupled_well(&["--stop-time", "0.2", "--format", "parquet"]);
    assert_eq!(printed.lines().last(), Some("out/results.parquet"));
    bench.coupled_well(&["--stop-time", "0.2", "--results", "a/b.parquet"]);
    let same = fs::read(bench.path("a/b.parquet")).unwrap();
    assert_eq!(same, fs::read(bench.path("out/results.parquet")).unwrap());
    let csv = Table::read(&bench.path("out/results.csv"));
    let parquet = Results::open(&bench.path("out/results.parquet")).unwrap();
    for (position, column) in parquet.columns().iter().enumerate() {
        assert_eq!(parquet.column(position).unwrap(), csv.column(&column.name), "{}", column.name);
    }
    assert_eq!(parquet.columns()[3].unit.as_deref(), Some("m"));
}

#[test]
fn a_plot_shows_its_variables_with_their_units() {
    let bench = Bench::new();
    let printed = bench.coupled_well(&["--stop-time", "0.2", "--plot", "plant.x_p,controller.*u"]);
    assert!(printed.ends_with("out/results.csv\nout/plot.svg\n"), "{printed}");
    let svg = bench.read("out/plot.svg");
    assert!(svg.contains("plant.x_p in m") && svg.contains("controller.u in N"), "{svg}");
    bench.coupled_well(&["--stop-time", "0.2", "--plot", "plant.x_p", "--plot-file", "a/x.png"]);
    assert!(fs::read(bench.path("a/x.png")).unwrap().starts_with(b"\x89PNG"));
}

#[test]
fn many_connections_are_counted_rather_than_listed() {
    let bench = Bench::new();
    let plant = fmu("FrictionPendulum");
    let fmus: Vec<_> = (0..24).map(|k| format!("--fmu=p{k}={plant}")).collect();
    let wires: Vec<_> = (1..24).map(|k| format!("--connect=p{}.f_fric=p{k}.f_a", k - 1)).collect();
    let arguments: Vec<_> = fmus.iter().chain(&wires).map(String::as_str).collect();
    let more = ["--stop-time", "0.01", "--record", "p23.f_a", "--record", "p22.f_fric"];
    let printed = printed(&bench.run(&[&arguments[..], &more].concat()));
    assert_eq!(printed.lines().count(), 20 + 1 + 1, "{printed}");
    assert!(
        printed.contains("p0.f_fric -> p1.f_a\n") && printed.contains("and 3 more connections")
    );
    let results = Table::read(&bench.path("results/run/results.csv"));
    assert_eq!(results.column("p23.f_a")[0], results.column("p22.f_fric")[0]);
}
