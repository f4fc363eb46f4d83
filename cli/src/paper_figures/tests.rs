use std::collections::BTreeMap;
use std::fs;

use super::*;

const NAMES: [&str; 5] = ["time", "plant.x_p", "plant.theta", "plant.f_fric", "controller.f_hat"];

type Columns = BTreeMap<&'static str, Vec<f64>>;

/// A square-wave limit cycle until 40 s, a thousandth of it afterwards.
fn columns(end: f64) -> Columns {
    let time: Vec<f64> =
        (0..=10_000).map(|i| f64::from(i) * 0.01).take_while(|time| *time <= end).collect();
    let of_time = |law: &dyn Fn(f64) -> f64| time.iter().map(|time| law(*time)).collect();
    let wave = |time: f64| {
        if time < 40.0 { (0.25 * time).sin() } else { (5.0 * time).sin() }
    };
    let size = |time: f64| if time < 40.0 { 1.0 } else { 3e-3 };
    let values: [Vec<f64>; 5] = [
        time.clone(),
        of_time(&|time| 0.17 * size(time) * wave(time).signum()),
        of_time(&|time| 0.11 * size(time) * wave(time)),
        of_time(&|time| 30.0 * wave(time).signum()),
        of_time(&|time| {
            if time < 40.0 { 0.0 } else { 30.0 * wave(time - 1e-3).signum() }
        }),
    ];
    NAMES.into_iter().zip(values).collect()
}

fn drawn(columns: &Columns) -> anyhow::Result<[String; 2]> {
    let run = Run::new(&|name| columns.get(name).map(Vec::as_slice), 40.0)?;
    Ok([run.motion().svg()?, run.friction().svg()?])
}

fn panels(svg: &str) -> usize {
    svg.matches("<clipPath").count()
}

#[test]
fn both_figures_are_written_as_svg_and_png() {
    let columns = columns(100.0);
    let folder = tempfile::tempdir().unwrap();
    write(&|name| columns.get(name).map(Vec::as_slice), 40.0, folder.path()).unwrap();
    let written = ["figure5", "figure6"].map(|name| {
        assert!(folder.path().join(name).with_extension("png").is_file());
        fs::read_to_string(folder.path().join(name).with_extension("svg")).unwrap()
    });
    assert_eq!(written, drawn(&columns).unwrap());
}

#[test]
fn figure_5_shows_the_run_and_the_claims_after_compensation() {
    let [motion, _] = drawn(&columns(100.0)).unwrap();
    for text in [
        ">x_p in m<",
        ">theta in rad<",
        ">x_p in mm<",
        ">theta in mrad<",
        ">time in s<",
        ">compensation starts, t_on = 40 s<",
        ">claim: within ±1 mm<",
        ">claim: within ±2 mrad<",
    ] {
        assert!(motion.contains(text), "{text}");
    }
    assert_eq!(panels(&motion), 4);
}

#[test]
fn figure_6_shows_force_estimate_and_difference() {
    let [_, friction] = drawn(&columns(100.0)).unwrap();
    for text in [">force in N<", ">difference in N<", ">f_fric<", ">f_hat<", ">f_fric − f_hat<"] {
        assert!(friction.contains(text), "{text}");
    }
    assert_eq!(panels(&friction), 3);
    assert!(friction.contains(">66<"), "the close-up is 60 to 66 s");
}

#[test]
fn a_run_without_a_settled_part_is_drawn_without_close_ups() {
    let lost = |value: f64| {
        let mut columns = columns(100.0);
        columns.get_mut("plant.x_p").unwrap()[4100..].fill(value);
        columns.get_mut("controller.f_hat").unwrap()[4100..].fill(value);
        columns
    };
    let empty: Columns = NAMES.into_iter().map(|name| (name, Vec::new())).collect();
    for columns in [columns(30.0), columns(40.0), lost(1e300), lost(-f64::MAX), empty] {
        let [motion, friction] = drawn(&columns).unwrap();
        assert_eq!((panels(&motion), panels(&friction)), (2, 2));
    }
}

#[test]
fn a_run_that_ends_soon_after_the_activation_is_shown_closely_from_halfway() {
    let [motion, _] = drawn(&columns(48.0)).unwrap();
    assert_eq!(panels(&motion), 4);
    assert!(motion.contains(">44.0<") && motion.contains(">47.5<"));
}

#[test]
fn a_lost_estimate_does_not_flatten_the_friction() {
    let mut columns = columns(100.0);
    columns.get_mut("controller.f_hat").unwrap()[9000] = -1e300;
    let [_, friction] = drawn(&columns).unwrap();
    assert!(friction.contains(">−100<"), "the axis reaches four times the friction");
    assert!(friction.contains(">a curve leaves the frame<"));
}

#[test]
fn a_column_that_is_missing_is_named() {
    for name in NAMES {
        let mut columns = columns(10.0);
        columns.remove(name);
        let message = drawn(&columns).unwrap_err().to_string();
        assert_eq!(message, format!("the results have no column {name:?}, which the figures need"));
    }
}

#[test]
fn a_column_of_another_length_is_named_with_both_lengths() {
    let mut columns = columns(10.0);
    columns.get_mut("plant.theta").unwrap().truncate(7);
    let message = drawn(&columns).unwrap_err().to_string();
    assert_eq!(message, "column \"plant.theta\" has 7 values, column \"time\" has 1001");
}
