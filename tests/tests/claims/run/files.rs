//! Recorded and plotted variables, and the files that are written.

use results::Table as Results;
use tests::Table;
use tests::c_fmu::CFmu;

use super::*;

#[test]
fn everything_but_parameters_is_recorded_unless_names_or_patterns_select_otherwise() {
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
fn rows_are_recorded_at_intervals_at_each_step_or_never() {
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
fn a_long_run_has_ten_thousand_intervals_and_a_short_one_a_row_for_every_step() {
    let bench = Bench::new();
    bench.coupled_well(&["--stop-time", "25", "--record", "plant.x_p"]);
    let time = Table::read(&bench.path("out/results.csv")).column("time");
    assert_eq!((time.len(), time[10_000]), (10_001 - 1_666 + 1_666, 25.0));
    bench.coupled_well(&["--stop-time", "10", "--record", "plant.x_p"]);
    assert_eq!(Table::read(&bench.path("out/results.csv")).column("time").len(), 10_001);
}

/// The output y of `a`, whose input is 1, is the time; its other outputs copy the inputs at each of
/// its steps of 0.25 s.
#[test]
fn rows_within_the_step_of_an_fmu_with_a_multiple_have_the_values_of_their_time() {
    let bench = Bench::new();
    let file = CFmu::well_behaved().write(bench.folder.path(), "slave");
    let [a, b] = ["a", "b"].map(|name| format!("{name}={}", file.display()));
    let fmus = ["--fmu", &a, "--fmu", &b, "--connect", "a.y=b.u", "--connect", "a.i_out=b.i_in"];
    let set = ["--set", "a.i_in=7", "--set", "a.b_in=true", "--set", "a.s_in=word"];
    let times =
        ["--step", "0.0625", "--stop-time", "1", "--every", "a=4", "--extrapolation", "hold"];
    for (method, seen) in [("jacobi", 0.0), ("gauss-seidel", 0.0625)] {
        let more = ["--method", method, "--out", "out"];
        let names = ["a.y", "b.y", "a.i_out", "a.b_out"];
        let record: Vec<_> = names.iter().flat_map(|name| ["--record", name]).collect();
        printed(&bench.run(&[&fmus[..], &set, &times, &more, &record].concat()));
        let table = Table::read(&bench.path("out/results.csv"));
        let time = table.column("time");
        assert_eq!((time.len(), table.column("a.y")), (17, time.clone()), "{method}");
        let held = |from: usize| (0..17).map(move |row| f64::from(u8::from(row >= from)));
        assert_eq!(table.column("a.b_out"), held(4).collect::<Vec<_>>(), "{method}");
        let whole: Vec<_> = held(4).map(|part| 7.0 * part).collect();
        assert_eq!(table.column("a.i_out"), whole, "{method}");
        // b gets the value of a at the start of a's step, or at the end of b's own step.
        let mut sum = 0.0;
        for (row, y) in table.column("b.y").into_iter().enumerate() {
            assert_eq!(y, sum, "{method}: row {row}");
            let begin = if seen > 0.0 { time[row] } else { (4.0 * time[row]).floor() / 4.0 };
            sum += 0.0625 * (begin + seen);
        }
    }
}

#[test]
fn rows_within_the_step_of_an_fmu_are_the_same_after_a_checkpoint_there() {
    let bench = Bench::new();
    let write = |fmu: CFmu, name: &str| {
        format!("{name}={}", fmu.write(bench.folder.path(), name).display())
    };
    let (a, b) = (write(CFmu::well_behaved(), "a"), write(CFmu::that("fail in fmi2DoStep"), "b"));
    let fmus = ["--fmu", &a, "--fmu", &b, "--connect", "a.y=b.u", "--set", "b.t1=0.875"];
    let times = ["--step", "0.0625", "--stop-time", "2", "--every", "a=8", "--out", "out"];
    let saving = ["--checkpoint", "state", "--checkpoint-every", "0.5625"];
    let ended = "the run ended early, after t = 0.875 s";
    fails(&bench.run(&[&fmus[..], &times, &saving].concat()), 1, &[ended]);
    fails(&bench.run(&["--resume", "state"]), 1, &[ended]);
    let (first, second) =
        (bench.read("out/results.csv"), bench.read("out/results-from-0.5625.csv"));
    let (first, second): (Vec<_>, Vec<_>) = (first.lines().collect(), second.lines().collect());
    assert!(second[1].starts_with("0.625,") && second.len() == 6, "{second:?}");
    assert_eq!(&second[1..], &first[first.len() - 5..]);
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
fn a_plot_shows_the_selected_variables_with_their_units() {
    let bench = Bench::new();
    let printed = bench.coupled_well(&["--stop-time", "0.2", "--plot", "plant.x_p,controller.*u"]);
    assert!(printed.ends_with("out/results.csv\nout/plot.svg\n"), "{printed}");
    let svg = bench.read("out/plot.svg");
    assert!(svg.contains("plant.x_p in m") && svg.contains("controller.u in N"), "{svg}");
    bench.coupled_well(&["--stop-time", "0.2", "--plot", "plant.x_p", "--plot-file", "a/x.png"]);
    assert!(fs::read(bench.path("a/x.png")).unwrap().starts_with(b"\x89PNG"));
}

#[test]
fn a_plot_that_cannot_be_drawn_is_refused_before_the_run() {
    let bench = Bench::new();
    let file = CFmu::well_behaved().write(bench.folder.path(), "slave");
    let fmus: Vec<_> = (0..17).map(|k| format!("--fmu=a{k}={}", file.display())).collect();
    let fmus: Vec<_> = fmus.iter().map(String::as_str).collect();
    // Each has u, y, i_in and i_out.
    for (names, part) in [
        ("*.u,*.y,*.i_*", "68 variables to plot, expected at most 64"),
        ("a0.u,a0.s_out", "a0.s_out holds texts, expected numbers"),
        ("*.s_*", "no variable to plot"),
    ] {
        let more = ["--plot", names, "--out", "out", "--stop-time", "0.1"];
        fails(&bench.run(&[&fmus[..], &more].concat()), 2, &[part]);
        assert!(!bench.path("out").exists(), "{names}");
    }
}

#[test]
fn many_connections_are_counted_instead_of_listed() {
    let bench = Bench::new();
    let plant = fmu("FrictionPendulum");
    let fmus: Vec<_> = (0..24).map(|k| format!("--fmu=p{k}={plant}")).collect();
    let wires: Vec<_> = (1..24).map(|k| format!("--connect=p{}.f_fric=p{k}.f_a", k - 1)).collect();
    let arguments: Vec<_> = fmus.iter().chain(&wires).map(String::as_str).collect();
    let more = ["--stop-time", "0.01", "--record", "p23.f_a", "--record", "p22.f_fric"];
    let printed = printed(&bench.run(&[&arguments[..], &more].concat()));
    // The connections, the number of further ones, the time reached, the file.
    assert_eq!(printed.lines().count(), 20 + 1 + 1 + 1, "{printed}");
    assert!(
        printed.contains("p0.f_fric -> p1.f_a\n") && printed.contains("and 3 more connections")
    );
    let results = Table::read(&bench.path("results/run/results.csv"));
    assert_eq!(results.column("p23.f_a")[0], results.column("p22.f_fric")[0]);
}
