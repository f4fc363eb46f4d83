//! The page shows every text, number and matrix of a report.

use std::collections::BTreeSet;

use resvg::usvg::roxmltree::Node;
use serde_json::Value;

use super::{elements, text, with_pages};
use design_report::{Matrix, Report};

/// The values of a report that are not points of curves, as JSON sees them.
fn values(report: &Report) -> Vec<Value> {
    fn collect(value: Value, plain_values: &mut Vec<Value>) {
        match value {
            Value::Array(members) => {
                for member in members {
                    collect(member, plain_values);
                }
            }
            Value::Object(members) => {
                for (_, member) in members {
                    collect(member, plain_values);
                }
            }
            plain => plain_values.push(plain),
        }
    }
    let mut all = serde_json::to_value(report).unwrap();
    for response in all["frequency"].as_array_mut().unwrap() {
        response["frequencies"].take();
        response["singular_values"].take();
    }
    for curve in all["robustness"]["curves"].as_array_mut().into_iter().flatten() {
        curve["frequencies"].take();
        curve["singular_values"].take();
    }
    let [steps, references] = ["steps", "references"].map(|key| all[key].take());
    let responses = [steps, references].map(|list| list.as_array().unwrap().clone()).concat();
    all["responses"] = responses.into();
    for response in all["responses"].as_array_mut().unwrap() {
        for curve in response["curves"].as_array_mut().unwrap() {
            curve["times"].take();
            curve["values"].take();
        }
    }
    let mut all_values = Vec::new();
    collect(all, &mut all_values);
    all_values
}

#[test]
fn every_text_appears_unchanged() {
    with_pages(|report, document| {
        let page = text(document.root());
        let texts = values(report).into_iter().filter_map(|value| match value {
            Value::String(text) => Some(text),
            _ => None,
        });
        assert!(texts.clone().count() > 10);
        for expected in texts {
            let expected = expected.replace(char::is_control, " ");
            assert!(page.contains(&expected), "{expected:?} is missing");
        }
    });
}

#[test]
fn every_number_appears_with_all_its_digits() {
    with_pages(|report, document| {
        let titles = document.descendants().filter_map(|node| node.attribute("title"));
        let literals = elements(document, "pre").map(text);
        let all = titles.map(str::to_owned).chain(literals).collect::<Vec<_>>().join(" ");
        let shown: BTreeSet<u64> = all
            .split(|sign: char| sign.is_whitespace() || ",;[]()".contains(sign))
            .filter_map(|word| word.trim_end_matches('i').parse::<f64>().ok())
            .map(|number| number.abs().to_bits())
            .collect();
        for value in values(report) {
            if let Some(number) = value.as_f64() {
                assert!(shown.contains(&number.abs().to_bits()), "{number:?} is missing");
            }
        }
    });
}

/// The named matrices in a text of one language, by reading each as a TOML array.
fn read(form: &str, literal: &str) -> Vec<(String, Vec<Vec<f64>>)> {
    let bare = |name: &str| name.trim().to_owned();
    let rows = |text: &str| -> Vec<Vec<f64>> {
        let table: toml::Table = format!("rows = {text}").parse().expect(text);
        table["rows"].clone().try_into().unwrap()
    };
    match form {
        "TOML" => {
            let table: toml::Table = literal.parse().expect(literal);
            let entries = table.into_iter();
            entries.map(|(name, value)| (name, value.try_into().unwrap())).collect()
        }
        "numpy" => literal
            .split_terminator(")\n")
            .map(|one| one.split_once(" = np.array(").unwrap())
            .map(|(name, array)| (bare(name), rows(array)))
            .collect(),
        "MATLAB" => literal
            .split_terminator("];\n")
            .map(|one| one.split_once(" = [\n").unwrap())
            .map(|(name, body)| (bare(name), rows(&format!("[[{}]]", body.replace(';', "], [")))))
            .collect(),
        other => panic!("{other}"),
    }
}

fn bits(rows: &[Vec<f64>]) -> Vec<Vec<u64>> {
    rows.iter().map(|row| row.iter().map(|value| value.to_bits()).collect()).collect()
}

/// The literal in `form` of the `index`th matrix of a section.
fn literal(document_root: Node<'_, '_>, id: &str, form: &str) -> String {
    let id = format!("{id}-{}", form.to_lowercase());
    let node = document_root.descendants().find(|node| node.attribute("id") == Some(&id));
    text(node.unwrap_or_else(|| panic!("no {id}")))
}

#[test]
fn matrices_read_back_bit_by_bit_in_each_language() {
    with_pages(|report, document| {
        let check = |id: &str, matrix: &Matrix| {
            for form in ["TOML", "numpy", "MATLAB"] {
                let matrices = read(form, &literal(document.root(), id, form));
                let [(name, rows)] = &matrices[..] else {
                    panic!("{id}: {} matrices", matrices.len())
                };
                assert_eq!(bits(rows), bits(&matrix.values), "{id} in {form}");
                if form == "TOML" {
                    assert_eq!(*name, matrix.name);
                } else {
                    assert!(name.starts_with(|first: char| first.is_ascii_alphabetic()), "{name}");
                    let plain = |sign: char| sign.is_ascii_alphanumeric() || sign == '_';
                    assert!(name.chars().all(plain), "{name}");
                }
            }
        };
        for (index, matrix) in report.plant.matrices.iter().enumerate() {
            check(&format!("plant-{}", index + 1), matrix);
        }
        for (index, matrix) in report.gains.iter().enumerate() {
            check(&format!("gains-{}", index + 1), matrix);
        }
        if !report.gains.is_empty() {
            let together = read("numpy", &literal(document.root(), "all", "numpy"));
            let matrices = report.plant.matrices.iter().chain(&report.gains);
            let expected: Vec<_> = matrices.map(|matrix| bits(&matrix.values)).collect();
            let matrices: Vec<_> = together.iter().map(|(_, rows)| bits(rows)).collect();
            assert_eq!(matrices, expected);
        }
        for (id, p) in [
            ("p-printed", report.certificate.printed.as_ref().ok().map(|theorem| &theorem.p)),
            ("p-free", report.certificate.free.as_ref().ok().map(|free| &free.p)),
        ] {
            if let Some(p) = p {
                let matrices = read("MATLAB", &literal(document.root(), id, "MATLAB"));
                assert_eq!(bits(&matrices[0].1), bits(p), "{id}");
            }
        }
    });
}
