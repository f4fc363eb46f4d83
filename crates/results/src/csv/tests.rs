use std::fs;

use super::super::tests::{column, give, mixed};
use super::*;

/// Returns doubles at which writers and readers of decimals have failed: powers of two and ten, halfway
/// cases, the limits of the normal and the subnormal numbers.
fn extremes() -> Vec<f64> {
    let mut values = vec![0.0, 0.1, 1.0 / 3.0, 5e-324];
    let texts = ["2.2250738585072011e-308", "9007199254740993", "6.631236871469758276e-316"];
    values.extend(texts.map(|text| text.parse::<f64>().unwrap()));
    values.extend([1e22, 1e23, 123_456_789_012_345_680.0]);
    values.extend([f64::MAX, f64::MIN_POSITIVE, f64::EPSILON, f64::from_bits(1 << 52) / 2.0]);
    values.extend((-1074..1024).map(|power| 2.0_f64.powi(power)));
    values.extend((-323..309).map(|power| format!("1e{power}").parse::<f64>().unwrap()));
    // Bits of a linear congruential generator (Knuth's MMIX).
    let mut bits = 1_u64;
    for _ in 0..20_000 {
        bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        values.push(f64::from_bits(bits));
    }
    values.retain(|value| value.is_finite());
    let negative: Vec<f64> = values.iter().map(|value| -value).collect();
    [values, negative].concat()
}

#[test]
fn every_double_is_read_back_with_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("extremes.csv");
    let mut sink = Box::new(CsvSink::create(&path, &[column("x", ColumnKind::Real)]).unwrap());
    let values = extremes();
    for value in &values {
        sink.row(1.0, &Row { reals: &[*value], ..Row::default() }).unwrap();
    }
    sink.finish().unwrap();
    let text = fs::read_to_string(&path).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("\"time\",\"x\""));
    for value in values {
        let cell = lines.next().unwrap().strip_prefix("1.0,").unwrap();
        assert_eq!(cell.parse::<f64>().unwrap().to_bits(), value.to_bits(), "{cell}");
        // The standard library formats by another algorithm (Grisu with Dragon) to as many digits.
        let digits = |text: &str| {
            let mantissa = text.split('e').next().unwrap();
            let all: String = mantissa.chars().filter(char::is_ascii_digit).collect();
            all.trim_start_matches('0').trim_end_matches('0').len()
        };
        assert_eq!(digits(cell), digits(&format!("{value:e}")), "{cell}");
        assert!(cell.contains(['.', 'e']), "{cell} may be taken for an integer");
    }
    assert_eq!(lines.next(), None);
}

#[test]
fn nan_and_infinity_are_spelt_as_numpy_pandas_and_polars_read_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    let mut sink = Box::new(CsvSink::create(&path, &[column("x", ColumnKind::Real)]).unwrap());
    for value in [f64::NAN, -f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.0] {
        sink.row(0.0, &Row { reals: &[value], ..Row::default() }).unwrap();
    }
    sink.finish().unwrap();
    let cells = "\"time\",\"x\"\n0.0,NaN\n0.0,NaN\n0.0,inf\n0.0,-inf\n0.0,-0.0\n";
    assert_eq!(fs::read_to_string(&path).unwrap(), cells);
}

#[test]
fn all_kinds_are_written_in_order_and_texts_escaped_for_other_readers() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    let mut sink = Box::new(CsvSink::create(&path, &mixed()).unwrap());
    (0..3).for_each(|k| give(sink.as_mut(), k));
    sink.finish().unwrap();
    let mut reader = ::csv::Reader::from_path(&path).unwrap();
    let names: Vec<String> = reader.headers().unwrap().iter().map(str::to_owned).collect();
    let expected = mixed().into_iter().map(|column| column.name);
    assert_eq!(names, std::iter::once("time".to_owned()).chain(expected).collect::<Vec<_>>());
    let rows: Vec<::csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 3);
    let text = "say \"yes\", then";
    let second = ["0.001", "1", "0.1", "line\n1", "1", "-1.0", "-2147483647", "1", text];
    assert_eq!(rows[1].iter().collect::<Vec<_>>(), second);
}

#[test]
fn a_flush_and_a_drop_leave_whole_lines_only() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    let lines = || fs::read_to_string(&path).unwrap().lines().count();
    let columns: Vec<Column> =
        (0..40).map(|k| column(&format!("x{k}"), ColumnKind::Real)).collect();
    let mut sink = CsvSink::create(&path, &columns).unwrap();
    assert_eq!(lines(), 1);
    let mut rows = 0_u32;
    while fs::metadata(&path).unwrap().len() < 3 * BUFFER as u64 {
        sink.row(f64::from(rows) / 3.0, &Row { reals: &[1.0 / 7.0; 40], ..Row::default() })
            .unwrap();
        rows += 1;
        assert!(rows < 100_000, "the file does not grow as the run goes");
    }
    // The automatic writes of the full buffer are complete lines, too.
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.ends_with('\n') && text.lines().all(|line| line.split(',').count() == 41));
    sink.row(9.0, &Row { reals: &[0.0; 40], ..Row::default() }).unwrap();
    sink.flush().unwrap();
    let rows = usize::try_from(rows).unwrap();
    assert_eq!(lines(), 1 + rows + 1);
    sink.row(9.0, &Row { reals: &[0.0; 40], ..Row::default() }).unwrap();
    drop(sink);
    assert_eq!(lines(), 1 + rows + 2);
}

#[test]
fn a_row_waits_no_longer_than_the_interval_while_rows_keep_coming() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    let mut sink = CsvSink::create(&path, &[column("x", ColumnKind::Real)]).unwrap();
    for time in [0.0, 1.0, 2.0] {
        sink.row(time, &Row { reals: &[0.5], ..Row::default() }).unwrap();
        std::thread::sleep(INTERVAL + Duration::from_millis(20));
    }
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.starts_with("\"time\",\"x\"\n0.0,0.5\n1.0,0.5\n"), "{text}");
}

#[test]
fn a_row_of_any_kind_allocates_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let mut sink = CsvSink::create(&folder.path().join("a.csv"), &mixed()).unwrap();
    let texts = ["a \"b\"".to_owned(), String::new()];
    let measured = allocation_counter::measure(|| {
        for k in 0..50_000_i32 {
            let row = Row {
                reals: &[f64::from(k) / 3.0, f64::NAN],
                integers: &[k.into(), (-k).into()],
                booleans: &[0, 1],
                strings: &texts,
                ..Row::default()
            };
            sink.row(f64::from(k), &row).unwrap();
        }
    });
    assert_eq!(measured.count_total, 0);
    assert!(fs::metadata(folder.path().join("a.csv")).unwrap().len() > 1_000_000);
}
