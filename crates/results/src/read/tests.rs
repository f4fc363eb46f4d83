use std::fs;
use std::sync::Arc;

use ::parquet::data_type::{DoubleType, Int32Type, Int64Type};
use ::parquet::file::properties::WriterProperties;
use ::parquet::file::writer::SerializedFileWriter;
use ::parquet::schema::parser::parse_message_type;

use super::super::tests::{give, mixed};
use super::super::{ColumnKind, create};
use super::*;

fn written(folder: &Path, name: &str, text: &str) -> Table {
    let path = folder.join(name);
    fs::write(&path, text).unwrap();
    Table::open(&path).unwrap()
}

#[test]
fn both_formats_give_back_every_number_that_was_written() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.csv", "a.parquet"] {
        let path = folder.path().join(name);
        let mut sink = create(&path, &mixed()).unwrap();
        (0..20_000).for_each(|k| give(sink.as_mut(), k));
        sink.finish().unwrap();
        let table = Table::open(&path).unwrap();
        let names: Vec<&str> = table.columns().iter().map(|one| one.name.as_str()).collect();
        let place = |name: &str| names.iter().position(|known| *known == name).unwrap();
        let positions = ["plant.x_p", "plant.count", "plant.stuck", "ctrl.on"].map(place);
        let mut k = 0;
        let check = &mut |time: f64, row: &[f64]| {
            let number = f64::from(k);
            let expected = [number * 0.1, f64::from(i32::MIN + k), f64::from(k % 2), 1.0];
            assert_eq!((time, row), (number * 1e-3, &expected[..]));
            k += 1;
        };
        table.visit(&positions, check).unwrap();
        assert_eq!(k, 20_000);
        let unit = table.columns()[place("plant.x_p")].unit.as_deref();
        assert_eq!(unit, if name == "a.parquet" { Some("m") } else { None });
        let text = place("ctrl.text");
        let refused = table.column(text).unwrap_err().to_string();
        assert!(refused.contains("ctrl.text") && refused.contains("expected"), "{refused}");
    }
}

#[test]
fn columns_of_csv_are_integers_where_reals_have_a_point() {
    use ColumnKind::{Boolean, Integer, Real};
    let folder = tempfile::tempdir().unwrap();
    let rows = |time: &str| format!("time,n,x,on,e\n{time},0,0,True,\n0.5,-7,0.5,False,3\n");
    for (time, expected) in
        [("0.0", [Real, Integer, Real, Boolean, Integer]), ("0", [Real, Real, Real, Boolean, Real])]
    {
        let table = written(folder.path(), "a.csv", &rows(time));
        let kinds: Vec<ColumnKind> = table.columns().iter().map(|column| column.kind).collect();
        assert_eq!(kinds, expected, "{time}");
        assert_eq!(table.column(1).unwrap(), [0.0, -7.0]);
    }
}

#[test]
fn a_last_line_that_was_cut_is_no_row_and_one_before_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let table = written(folder.path(), "a.csv", "time,x,y\n0,1,2\n1,3,4\n2,5");
    assert_eq!(table.column(1).unwrap(), [1.0, 3.0]);
    let table = written(folder.path(), "b.csv", "time,x,y\n0,1,2\n1,3\n2,5,6\n");
    let refused = table.column(1).unwrap_err().to_string();
    assert!(refused.contains("line 3 has 2 values, expected 3"), "{refused}");
}

#[test]
fn a_last_line_that_was_cut_within_a_number_is_no_row_and_other_texts_are_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let table = written(folder.path(), "a.csv", "time,x\n0,1\n1,3\n2,5e-");
    assert_eq!(table.column(1).unwrap(), [1.0, 3.0]);
    for (text, found) in [
        ("time,x\n0,1\n1,5e-\n", "5e-"),
        ("time,x\n0,1\n1,5e-\n2,3", "5e-"),
        ("time,x\n0,1\n1,open", "open"),
        ("time,x,y\n0,1,2\n1,5e-,3", "5e-"),
    ] {
        let refused = written(folder.path(), "b.csv", text).column(1).unwrap_err().to_string();
        let expected = format!("line 3: x is {found:?}, expected a number");
        assert!(refused.ends_with(&expected), "{refused}");
    }
}

#[test]
fn a_last_line_that_is_ended_and_has_too_few_values_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let table = written(folder.path(), "a.csv", "time,x,y\n0,1,2\n1,3\n");
    let refused = table.column(1).unwrap_err().to_string();
    assert!(refused.contains("line 3 has 2 values, expected 3"), "{refused}");
}

#[test]
fn errors_name_the_line_that_an_editor_shows() {
    let folder = tempfile::tempdir().unwrap();
    for (text, expected) in [
        ("time,x\r\n0,1\r\n1\r\n2,3\r\n", "line 3 has 1 value,"),
        ("time,x\r\n1,1\r\n0,2\r\n", "line 3: time is 0 after 1"),
        ("time,x\r\n0,a\r\n", "line 2: x is"),
        ("\u{feff}time,x\n\n0,1\n\r\n\n1\n2,3\n", "line 6 has 1 value,"),
        ("time,\"x\ny\"\n0,1\n1\n2,3\n", "line 4 has 1 value,"),
    ] {
        let refused = written(folder.path(), "a.csv", text).column(1).unwrap_err().to_string();
        assert!(refused.contains(expected), "{text:?}: {refused}");
    }
}

#[test]
fn layouts_of_other_programs_are_read() {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in [
        ("semicolons.csv", "time;x\n0;1.5\n1;-2e3\n"),
        ("commas.csv", "time;x\r\n0,0;1,5\r\n1,0;-2e3\r\n"),
        ("tabs.csv", "time\tx\n0\t1,5\n1\t-2e3\n"),
        ("bom.csv", "\u{feff}time,x\n0,1.5\n1,-2e3\n"),
        ("closed.csv", "\"time\",\"x\",\n0,1.5,\n1,-2e3,\n"),
        ("units.csv", "time,x\ns,[m]\n0,1.5\n1,-2e3\n"),
        ("capital.csv", "x,Time\n1.5,0\n-2e3,1"),
        ("letter.csv", "x,t\n1.5,0\n-2e3,1\n"),
        ("seconds.csv", "x,time [s]\n1.5,0\n-2e3,1\n"),
    ] {
        let table = written(folder.path(), name, text);
        let place = table.columns().iter().position(|column| column.name == "x").unwrap();
        let mut rows = Vec::new();
        table.visit(&[place], &mut |time, row| rows.push((time, row[0]))).unwrap();
        assert_eq!(rows, [(0.0, 1.5), (1.0, -2e3)], "{name}");
        let unit = table.columns()[place].unit.as_deref();
        assert_eq!(unit, (name == "units.csv").then_some("m"), "{name}");
    }
    for (cell, unit) in [
        ("J/(kg.K)", "J/(kg.K)"),
        ("[J/(kg.K)]", "J/(kg.K)"),
        ("(J/(kg.K))", "J/(kg.K)"),
        ("((m/s)^2)/(rad/s)", "((m/s)^2)/(rad/s)"),
        ("( m )", "m"),
    ] {
        let text = format!("time,x\ns,{cell}\n0,1\n");
        let table = written(folder.path(), "brackets.csv", &text);
        assert_eq!(table.columns()[1].unit.as_deref(), Some(unit), "{cell}");
    }
    for (name, sign) in
        [("little.csv", u16::to_le_bytes as fn(u16) -> [u8; 2]), ("big.csv", u16::to_be_bytes)]
    {
        let text = "\u{feff}time,Δx\n0,1\n1,2\n";
        let path = folder.path().join(name);
        fs::write(&path, text.encode_utf16().flat_map(sign).collect::<Vec<u8>>()).unwrap();
        let table = Table::open(&path).unwrap();
        assert_eq!(
            (table.columns()[1].name.as_str(), table.column(1).unwrap()),
            ("Δx", vec![1.0, 2.0])
        );
    }
}

/// `date -u -d TEXT +%s`.
#[test]
fn dates_in_the_time_column_are_seconds_since_1970() {
    let folder = tempfile::tempdir().unwrap();
    for (first, second, expected) in [
        ("2023-11-14 22:13:20.250", "2023-11-14 22:13:20.500", [1_700_000_000.25, 1_700_000_000.5]),
        ("2023-11-14T22:13:20Z", "2023-11-14T22:13:21Z", [1_700_000_000.0, 1_700_000_001.0]),
        (
            "2023-11-14 23:13:20+01:00",
            "2023-11-14 22:13:21+0000",
            [1_700_000_000.0, 1_700_000_001.0],
        ),
        ("1969-12-31", "1970-01-02", [-86_400.0, 86_400.0]),
    ] {
        let text = format!("time,x\n{first},1\n{second},2\n");
        let table = written(folder.path(), "a.csv", &text);
        assert_eq!(table.column(0).unwrap(), expected, "{first}");
        let refused = written(folder.path(), "b.csv", &format!("time,x\n0,{first}\n"));
        assert!(refused.column(1).unwrap_err().to_string().contains("expected a number"));
    }
    let refused = written(folder.path(), "c.csv", "time,x\n14.11.2023 22:13,1\n").column(1);
    let message = refused.unwrap_err().to_string();
    assert!(
        message.contains("line 2: time is \"14.11.2023 22:13\", expected a time in s or a date")
    );
}

#[test]
fn a_first_column_that_is_the_time_for_want_of_a_name_is_announced() {
    let folder = tempfile::tempdir().unwrap();
    let text = "a,b\n1,2\n0.5,3\n";
    let refused = written(folder.path(), "a.csv", text).column(1).unwrap_err().to_string();
    assert!(
        refused.contains("line 3: a is 0.5 after 1") && refused.contains("first one is the time")
    );
}

#[test]
fn a_tab_or_semicolon_in_a_name_separates_no_values() {
    let folder = tempfile::tempdir().unwrap();
    for (text, name) in [
        ("time,a\tb\n0,1\n", "a\tb"),
        ("time,a;b\n0,1\n", "a;b"),
        ("time;q[1,2]\n0,5;1\n", "q[1,2]"),
    ] {
        let table = written(folder.path(), "a.csv", text);
        assert_eq!(table.columns()[1].name, name);
        assert_eq!(table.column(1).unwrap(), [1.0]);
    }
}

#[test]
fn a_name_of_two_columns_is_an_error_where_it_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let table = written(folder.path(), "a.csv", "time,x,y,x\n0,1,2,3\n");
    assert_eq!(table.column(2).unwrap(), [2.0]);
    for position in [1, 3] {
        let refused = table.column(position).unwrap_err().to_string();
        assert!(refused.contains("a.csv: two columns have the name \"x\""), "{refused}");
    }
}

#[test]
fn times_that_decrease_are_an_error_with_their_place() {
    let folder = tempfile::tempdir().unwrap();
    let table = written(folder.path(), "a.csv", "time,x\n0,1\n2,2\n2,3\n1,4\n");
    let refused = table.column(1).unwrap_err().to_string();
    assert!(refused.contains("a.csv, line 5: time is 1 after 2"), "{refused}");
    let table = written(folder.path(), "b.csv", "time,x\n0,1\n,2\n");
    let refused = table.column(1).unwrap_err().to_string();
    assert!(refused.contains("line 3: time is no number"), "{refused}");
    let table = written(folder.path(), "c.csv", "time,x\n0,1\ninf,2\n");
    let refused = table.column(1).unwrap_err().to_string();
    assert!(refused.contains("line 3: time is infinite, expected a time in s"), "{refused}");
}

#[test]
fn what_is_no_csv_is_refused_with_advice() {
    let folder = tempfile::tempdir().unwrap();
    for (text, part) in [
        ("0,1\n1,2\n", "expected the names of the columns"),
        ("PAR1", "name it .parquet"),
        ("PK\0\0", "save it as CSV or Parquet"),
    ] {
        let path = folder.path().join("a.csv");
        fs::write(&path, text).unwrap();
        let refused = Table::open(&path).unwrap_err().to_string();
        assert!(refused.contains(part), "{refused}");
    }
    let table = written(folder.path(), "b.csv", "time,x\n0,0,1,5\n1,0,2,5\n");
    let refused = table.column(1).unwrap_err().to_string();
    assert!(
        refused.contains("line 2 has 4 values, expected 2") && refused.contains("semicolons"),
        "{refused}"
    );
}

#[test]
fn words_for_truth_are_numbers_and_other_texts_are_named_with_their_place() {
    let folder = tempfile::tempdir().unwrap();
    let table = written(folder.path(), "a.csv", "time,x\n0,True\n1,False\n2,\n3,inf\n");
    let values = table.column(1).unwrap();
    assert_eq!(values[..2], [1.0, 0.0]);
    assert!(values[2].is_nan() && values[3] == f64::INFINITY);
    let table = written(folder.path(), "b.csv", "time,\"a,b\"\n0,1\n1,abc\n");
    let refused = table.column(1).unwrap_err().to_string();
    assert!(refused.ends_with("b.csv, line 3: a,b is \"abc\", expected a number"), "{refused}");
}

#[test]
fn a_file_that_has_no_results_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    for (name, bytes) in [("a.parquet", &b"no parquet"[..]), ("b.parquet", b""), ("c.csv", b"")] {
        fs::write(path(name), bytes).unwrap();
        let refused = Table::open(&path(name)).unwrap_err().to_string();
        assert!(refused.starts_with("cannot read ") && refused.contains(name), "{refused}");
    }
    assert!(matches!(Table::open(&path("none.csv")), Err(ResultsError::Read { .. })));
    assert!(matches!(Table::open(&path("a.xlsx")), Err(ResultsError::Extension { .. })));
    let table = written(folder.path(), "d.csv", "time,speed\n0,1\n");
    let selection = Selection { include: vec!["sped".to_owned()], exclude: vec![] };
    let refused = table.choose(&selection).unwrap_err().to_string();
    assert!(refused.contains("d.csv") && refused.contains("speed"), "{refused}");
}

#[test]
fn a_mat_file_with_a_matrix_without_a_usable_name_is_refused_for_the_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mat");
    for length in [0_u32, 256] {
        fs::write(&path, [[0_u8; 16].as_slice(), &length.to_le_bytes()].concat()).unwrap();
        let message = Table::open(&path).unwrap_err().to_string();
        assert!(message.contains(&format!("name has {length} bytes")), "{message}");
    }
}

/// The bytes of a matrix in a MAT file of version 4; `kind` is 0 for doubles, 20 for `i32`, 51 for texts.
fn matrix(name: &str, kind: u32, [rows, columns]: [u32; 2], content: &[u8]) -> Vec<u8> {
    let length = u32::try_from(name.len()).unwrap() + 1;
    let header = [kind, rows, columns, 0, length].map(u32::to_le_bytes).concat();
    [&header[..], name.as_bytes(), &[0], content].concat()
}

#[test]
fn a_mat_file_with_four_billion_rows_and_no_column_has_no_value() {
    let class = ["Atrajectory", "           ", "           ", "binTrans   "].map(str::as_bytes);
    let class: Vec<u8> = (0..11).flat_map(|at| class.map(|row| row[at])).collect();
    let information = [0_i32, 1, 0, 0].map(i32::to_le_bytes).concat();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mat");
    let matrices = [
        matrix("Aclass", 51, [4, 11], &class),
        matrix("name", 51, [4, 1], b"time"),
        matrix("dataInfo", 20, [4, 1], &information),
        matrix("data_2", 0, [u32::MAX, 0], &[]),
    ];
    fs::write(&path, matrices.concat()).unwrap();
    assert!(Table::open(&path).unwrap().column(0).unwrap().is_empty());
}

#[test]
fn a_damaged_parquet_file_is_an_error_and_no_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.parquet");
    let mut sink = create(&path, &mixed()).unwrap();
    (0..300).for_each(|k| give(sink.as_mut(), k));
    sink.finish().unwrap();
    let whole = fs::read(&path).unwrap();
    let mut refused = 0;
    for place in (0..whole.len()).step_by(23) {
        let mut bytes = whole.clone();
        bytes[place] ^= 0x55;
        fs::write(&path, &bytes).unwrap();
        refused += usize::from(Table::open(&path).and_then(|table| table.column(2)).is_err());
        fs::write(&path, &whole[..place]).unwrap();
        assert!(Table::open(&path).is_err(), "cut at {place}");
    }
    assert!(refused > 0);
}

#[test]
fn nulls_long_integers_and_a_time_of_another_name_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.parquet");
    let schema = "message m { required double t; optional double x; required int64 n; }";
    let schema = Arc::new(parse_message_type(schema).unwrap());
    let file = fs::File::create(&path).unwrap();
    let properties = Arc::new(WriterProperties::builder().build());
    let mut writer = SerializedFileWriter::new(file, schema, properties).unwrap();
    let mut group = writer.next_row_group().unwrap();
    let mut column = group.next_column().unwrap().unwrap();
    column.typed::<DoubleType>().write_batch(&[0.0, 1.0, 2.0], None, None).unwrap();
    column.close().unwrap();
    let mut column = group.next_column().unwrap().unwrap();
    column.typed::<DoubleType>().write_batch(&[5.0, 6.0], Some(&[1, 0, 1]), None).unwrap();
    column.close().unwrap();
    let mut column = group.next_column().unwrap().unwrap();
    column.typed::<Int64Type>().write_batch(&[1, 2, 3], None, None).unwrap();
    column.close().unwrap();
    group.close().unwrap();
    writer.close().unwrap();
    let table = Table::open(&path).unwrap();
    let kinds: Vec<ColumnKind> = table.columns().iter().map(|column| column.kind).collect();
    assert_eq!(kinds, [ColumnKind::Real, ColumnKind::Real, ColumnKind::Integer]);
    let mut rows = Vec::new();
    table.visit(&[1, 2], &mut |time, row| rows.push((time, row[0], row[1]))).unwrap();
    assert_eq!((rows[0], rows[2]), ((0.0, 5.0, 1.0), (2.0, 6.0, 3.0)));
    assert!(rows[1].1.is_nan() && (rows[1].2 - 2.0).abs() < 1e-12);
}

#[test]
fn timestamps_are_read_in_seconds_and_decimals_with_their_point() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.parquet");
    let schema = "message m { required int64 time (TIMESTAMP(MICROS,true)); \
                  required int64 t_n (TIMESTAMP(NANOS,false)); required int32 x (DECIMAL(9,2)); }";
    let schema = Arc::new(parse_message_type(schema).unwrap());
    let file = fs::File::create(&path).unwrap();
    let properties = Arc::new(WriterProperties::builder().build());
    let mut writer = SerializedFileWriter::new(file, schema, properties).unwrap();
    let mut group = writer.next_row_group().unwrap();
    for values in [[1_700_000_000_250_000_i64, 1_700_000_000_500_000], [250_000_000, 500_000_000]] {
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<Int64Type>().write_batch(&values, None, None).unwrap();
        column.close().unwrap();
    }
    let mut column = group.next_column().unwrap().unwrap();
    column.typed::<Int32Type>().write_batch(&[150, -25], None, None).unwrap();
    column.close().unwrap();
    group.close().unwrap();
    writer.close().unwrap();
    let table = Table::open(&path).unwrap();
    assert!(table.columns().iter().all(|column| column.kind == ColumnKind::Real));
    let mut rows = Vec::new();
    table.visit(&[1, 2], &mut |time, row| rows.push([time, row[0], row[1]])).unwrap();
    assert_eq!(rows, [[1_700_000_000.25, 0.25, 1.5], [1_700_000_000.5, 0.5, -0.25]]);
}
