//! The data of the plots, decoded as the script on the page does.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use miniz_oxide::inflate::decompress_to_vec_zlib;
use serde_json::Value;

use super::super::plots::{Line, Plot, Plots, Quantity};
use super::{elements, text, with_pages};
use design_report::Report;

/// The next list of a block: numbers of `N` bytes, all first bytes before all second bytes.
fn list<const N: usize>(block: &mut &[u8], count: usize) -> Vec<[u8; N]> {
    let (first, rest) = block.split_at(N * count);
    *block = rest;
    (0..count).map(|k| std::array::from_fn(|byte| first[byte * count + k])).collect()
}

fn size(value: &Value) -> usize {
    usize::try_from(value.as_u64().unwrap()).unwrap()
}

fn unpacked(data: &Value) -> Vec<u8> {
    decompress_to_vec_zlib(&STANDARD.decode(data["block"].as_str().unwrap()).unwrap()).unwrap()
}

/// The points of each curve of the report in the order of the page: places and values.
fn curves(report: &Report) -> Vec<(&[f64], Vec<&[f64]>)> {
    let robustness = report.robustness.iter().flat_map(|section| &section.curves);
    let gains = robustness.chain(&report.frequency).map(|curve| {
        (&curve.frequencies[..], curve.singular_values.iter().map(Vec::as_slice).collect())
    });
    let references = report.references.iter().flat_map(|reference| &reference.curves);
    let responses = references.chain(report.steps.iter().flat_map(|step| &step.curves));
    gains.chain(responses.map(|curve| (&curve.times[..], vec![&curve.values[..]]))).collect()
}

fn positive(places: &[f64], values: &[f64]) -> Vec<(u64, u64)> {
    let points = places.iter().zip(values).filter(|(at, _)| **at > 0.0);
    points.map(|(at, value)| (at.to_bits(), value.to_bits())).collect()
}

#[test]
fn every_point_of_every_curve_is_on_the_page_bit_by_bit() {
    with_pages(|report, document| {
        let expected = curves(report);
        let script =
            elements(document, "script").find(|node| node.attribute("id") == Some("curves"));
        let Some(script) = script else { return assert!(expected.is_empty()) };
        let data: Value = serde_json::from_str(&text(script)).unwrap();
        let block = unpacked(&data);
        let mut block = &block[..];
        let grids = [0, 1].map(|axis| list::<8>(&mut block, size(&data["grids"][axis])));
        let plots = data["plots"].as_array().unwrap();
        assert_eq!(plots.len(), expected.len());
        let points = plots.iter().map(|plot| size(&plot["points"]));
        let mut steps = list::<4>(&mut block, points.sum()).into_iter();
        assert_eq!(data["bits"], 64);
        let count = block.len() / 8;
        let mut values = list::<8>(&mut block, count).into_iter();
        for (plot, (at, lines)) in plots.iter().zip(&expected) {
            let id = plot["id"].as_str();
            assert!(elements(document, "div").any(|node| node.attribute("id") == id), "{id:?}");
            let grid = &grids[usize::from(plot["axis"] == "frequency")];
            let mut index = 0;
            let places = steps.by_ref().take(size(&plot["points"])).map(|step| {
                index += usize::try_from(u32::from_le_bytes(step)).unwrap();
                f64::from_le_bytes(grid[index])
            });
            let places: Vec<f64> = places.collect();
            assert_eq!(plot["curves"].as_array().unwrap().len(), lines.len());
            for line in lines {
                let numbers = values.by_ref().take(places.len()).map(f64::from_le_bytes);
                let numbers: Vec<f64> = numbers.collect();
                assert_eq!(positive(&places, &numbers), positive(at, line), "{id:?}");
            }
        }
        assert!(steps.next().is_none() && values.next().is_none());
    });
}

#[test]
fn many_values_are_rounded_to_single_precision() {
    let places: Vec<f64> = (1..=200_001).map(f64::from).collect();
    let values: Vec<f64> = places.iter().map(|at| (at / 7.0).sin()).collect();
    let mut plots = Plots::default();
    let _ = plots.add(Plot {
        id: "one".to_owned(),
        quantity: Quantity::Time,
        logarithmic: false,
        label: "",
        title: String::new(),
        places: &places,
        lines: vec![Line { name: String::new(), values: &values }],
        marks: Vec::new(),
    });
    let data: Value = serde_json::from_str(&plots.json()).unwrap();
    assert_eq!(data["bits"], 32);
    let block = unpacked(&data);
    let count = places.len();
    let mut rest = &block[(8 + 4) * count..];
    for (bytes, value) in list::<4>(&mut rest, count).into_iter().zip(&values) {
        let rounded = f64::from(f32::from_le_bytes(bytes));
        assert!((rounded - value).abs() <= 6e-8 * value.abs(), "{rounded} is not {value}");
    }
    assert!(rest.is_empty());
}
