use std::fs;
use std::path::PathBuf;

use results::{Column, Row, create};
use resvg::tiny_skia::Pixmap;
use resvg::usvg::roxmltree::Document;

use super::*;

fn column(name: &str, kind: ColumnKind, unit: Option<&str>) -> Column {
    Column { name: name.to_owned(), kind, unit: unit.map(str::to_owned), clocked: false }
}

/// A run of 10 s: two positions in m, a force in N, a switch, a text; one sample of `plant.F` is
/// a spike.
fn written(folder: &Path, name: &str, rows: u32) -> PathBuf {
    let path = folder.join(name);
    let columns = [
        column("plant.x_p", ColumnKind::Real, Some("m")),
        column("plant.F", ColumnKind::Real, Some("N")),
        column("ctrl.x_hat[1]", ColumnKind::Real, Some("m")),
        column("ctrl.on", ColumnKind::Boolean, None),
        column("ctrl.mode", ColumnKind::String, None),
    ];
    let mut sink = create(&path, &columns).unwrap();
    for k in 0..rows {
        let time = 10.0 * f64::from(k) / f64::from(rows - 1);
        let force = if k == rows / 2 { 80.0 } else { 5.0 * (40.0 * time).cos() };
        let row = Row {
            reals: &[0.2 * time.sin(), force, 0.19 * time.sin()],
            integers: &[],
            booleans: &[i32::from(time > 4.0 && time < 7.0)],
            strings: &["idle".to_owned()],
            ..Row::default()
        };
        sink.row(time, &row).unwrap();
    }
    sink.finish().unwrap();
    path
}

fn names(texts: &[&str]) -> Vec<String> {
    texts.iter().map(|text| (*text).to_owned()).collect()
}

fn svg(results: &Path, variables: &[&str]) -> String {
    let out = results.with_extension("svg");
    plot(results, &names(variables), &out).unwrap();
    fs::read_to_string(out).unwrap()
}

fn texts(svg: &str) -> Vec<String> {
    let document = Document::parse(svg).expect("well-formed XML");
    let texts = document.descendants().filter(|node| node.has_tag_name("text"));
    texts.filter_map(|node| node.text()).map(str::to_owned).collect()
}

/// Returns the points of each curve in pixels: to the right, and down.
fn curves(svg: &str) -> Vec<Vec<(f64, f64)>> {
    let document = Document::parse(svg).unwrap();
    let paths = document.descendants().filter(|node| node.has_tag_name("path"));
    let points = |path: &str| {
        let numbers: Vec<f64> = path
            .split(['M', ' '])
            .filter(|text| !text.is_empty())
            .map(|text| text.parse().unwrap())
            .collect();
        numbers.chunks(2).map(|pair| (pair[0], pair[1])).collect()
    };
    paths.map(|path| points(path.attribute("d").unwrap())).collect()
}

#[test]
fn variables_of_one_unit_share_a_panel_and_the_legend_has_names_and_units() {
    let folder = tempfile::tempdir().unwrap();
    let results = written(folder.path(), "run.parquet", 1001);
    let svg = svg(&results, &["plant.*", "ctrl.x_hat[1]", "ctrl.on"]);
    let texts = texts(&svg);
    for label in [
        "run.parquet",
        "plant.x_p in m",
        "plant.F in N",
        "ctrl.x_hat[1] in m",
        "ctrl.on",
        "time in s",
    ] {
        assert_eq!(texts.iter().filter(|text| *text == label).count(), 1, "{label} in {texts:?}");
    }
    let document = Document::parse(&svg).unwrap();
    let windows = document.descendants().filter(|node| node.has_tag_name("clipPath")).count();
    assert_eq!(windows, 3, "m, N, no unit");
    assert_eq!(curves(&svg).len(), 4);
}

#[test]
fn a_csv_file_is_drawn_in_one_panel_or_with_the_units_that_are_known_elsewhere() {
    let folder = tempfile::tempdir().unwrap();
    let results = written(folder.path(), "run.csv", 1001);
    let count = |svg: &str| svg.matches("<clipPath").count();
    assert_eq!(count(&svg(&results, &["plant.x_p", "plant.F"])), 1);
    let out = folder.path().join("out.svg");
    let units = [("plant.F".to_owned(), "N".to_owned())];
    plot_with_units(&results, &names(&["plant.x_p", "plant.F"]), &units, &out).unwrap();
    let svg = fs::read_to_string(&out).unwrap();
    assert_eq!(count(&svg), 2);
    assert!(texts(&svg).contains(&"plant.F in N".to_owned()));
}

#[test]
fn the_spike_of_one_sample_in_a_long_file_is_seen_at_its_place() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["run.parquet", "run.csv"] {
        let results = written(folder.path(), name, 300_001);
        let curve = curves(&svg(&results, &["plant.F"])).remove(0);
        let top = curve.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        // The axis goes from 100 to 978 for 0 to 10 s; the spike is at half of the time.
        assert!((top.0 - 539.0).abs() < 0.2, "{name}: {top:?}");
        let others = curve.iter().filter(|point| (point.0 - top.0).abs() > 1.0);
        let next = others.map(|point| point.1).fold(f64::INFINITY, f64::min);
        // The spike is 80, other values are at most 5, and the axis of 420 units is from -5 to 80.
        assert!(next - top.1 > 0.7 * 420.0, "{name}: {next} below {top:?}");
        assert!(curve.len() < 4000, "{name}: {} points", curve.len());
    }
}

#[test]
fn a_switch_is_drawn_as_stairs() {
    let (time, values) = stairs(&[0.0, 1.0, 3.0], &[0.0, 1.0, 0.0]);
    assert_eq!(time, [0.0, 1.0, 1.0, 3.0, 3.0, 3.0]);
    assert_eq!(values, [0.0, 0.0, 1.0, 1.0, 0.0, 0.0]);
    for kind in [ColumnKind::Integer, ColumnKind::Long, ColumnKind::Boolean] {
        assert!(column("ctrl.count", kind, None).is_held(), "{kind:?}");
    }
    let folder = tempfile::tempdir().unwrap();
    let results = written(folder.path(), "run.parquet", 11);
    let curve = curves(&svg(&results, &["ctrl.on"])).remove(0);
    // The switch is on from 5 s to 7 s; the axis has 87.8 units per second.
    let (low, high) = (curve[0].1, curve.iter().map(|point| point.1).fold(f64::MAX, f64::min));
    let on: Vec<f64> =
        curve.iter().filter(|point| point.1 < high + 0.1).map(|point| point.0).collect();
    assert!(low > high + 100.0);
    assert!((on[0] - 539.0).abs() < 0.11 && (on[on.len() - 1] - 714.6).abs() < 0.11, "{on:?}");
    assert!(curve.iter().all(|point| (point.1 - low).abs() < 0.1 || (point.1 - high).abs() < 0.1));
}

#[test]
fn the_ending_png_gives_pixels_with_every_colour_of_the_curves() {
    let folder = tempfile::tempdir().unwrap();
    let results = written(folder.path(), "run.parquet", 1001);
    let out = folder.path().join("new").join("plot.PNG");
    plot(&results, &names(&["plant.x_p", "ctrl.x_hat[1]"]), &out).unwrap();
    let pixels = Pixmap::decode_png(&fs::read(&out).unwrap()).unwrap();
    assert_eq!(pixels.width(), 2000);
    for colour in [[0x00, 0x72, 0xb2], [0xd5, 0x5e, 0x00]] {
        let same = |pixel: &&resvg::tiny_skia::PremultipliedColorU8| {
            [pixel.red(), pixel.green(), pixel.blue()] == colour
        };
        assert!(pixels.pixels().iter().filter(same).count() > 300, "{colour:?}");
    }
}

#[test]
fn variables_that_cannot_be_drawn_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let results = written(folder.path(), "run.parquet", 11);
    let refused = |variables: &[&str], out: &str| {
        let out = folder.path().join(out);
        let message = format!("{:#}", plot(&results, &names(variables), &out).unwrap_err());
        assert!(!out.exists());
        message
    };
    assert!(refused(&["plant.x_p"], "a.pdf").ends_with("a.pdf: a plot is a .svg or a .png"));
    assert!(refused(&["plant.x_q"], "a.svg").contains("plant.x_p"));
    assert!(refused(&["ctrl.mode"], "a.svg").contains("ctrl.mode holds texts"));
    let missing = folder.path().join("none.csv");
    let message = plot(&missing, &names(&["a"]), &folder.path().join("a.svg")).unwrap_err();
    assert!(message.to_string().contains("none.csv"), "{message}");
    let many: Vec<Column> =
        (0..65).map(|k| column(&format!("x{k}"), ColumnKind::Real, None)).collect();
    let wide = folder.path().join("wide.csv");
    create(&wide, &many).unwrap().finish().unwrap();
    let message = plot(&wide, &names(&["*"]), &folder.path().join("a.svg")).unwrap_err();
    assert!(message.to_string().contains("65 variables to plot, expected at most 64"), "{message}");
}

#[test]
fn eight_curves_of_one_unit_are_two_panels_so_that_no_colour_has_two_meanings() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("wide.csv");
    let columns: Vec<Column> =
        (0..8).map(|k| column(&format!("x{k}"), ColumnKind::Real, None)).collect();
    let mut sink = create(&path, &columns).unwrap();
    for time in [0.0, 1.0] {
        sink.row(time, &Row { reals: &[time; 8], ..Row::default() }).unwrap();
    }
    sink.finish().unwrap();
    let svg = svg(&path, &["*"]);
    assert_eq!((svg.matches("<clipPath").count(), curves(&svg).len()), (2, 8));
}

/// Plots variables of a file that states no units.
fn plot(results: &Path, variables: &[String], out: &Path) -> anyhow::Result<()> {
    plot_with_units(results, variables, &[], out)
}
