use std::fs::{self, File};
use std::io::{Seek as _, SeekFrom, Write as _};

use ::parquet::file::reader::{FileReader, SerializedFileReader};
use ::parquet::record::Field;

use super::super::output::Change;
use super::super::tests::{column, give, mixed};
use super::*;

type Cells = Vec<(String, Field)>;

/// Reads all rows of a file by the record reader of the crate `parquet`.
fn rows(path: &Path) -> Vec<Cells> {
    let reader = SerializedFileReader::new(File::open(path).unwrap()).unwrap();
    let rows = reader.get_row_iter(None).unwrap();
    rows.map(|row| row.unwrap().into_columns()).collect()
}

fn times(path: &Path) -> Vec<f64> {
    rows(path)
        .iter()
        .map(|row| if let Field::Double(time) = row[0].1 { time } else { f64::NAN })
        .collect()
}

fn groups(path: &Path) -> Vec<i64> {
    let reader = SerializedFileReader::new(File::open(path).unwrap()).unwrap();
    reader.metadata().row_groups().iter().map(RowGroupMetaData::num_rows).collect()
}

#[test]
fn all_kinds_are_read_back_with_type_and_order() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.parquet");
    let mut sink = Box::new(ParquetSink::create(&path, &mixed()).unwrap());
    (0..5).for_each(|k| give(sink.as_mut(), k));
    sink.finish().unwrap();
    let read = rows(&path);
    assert_eq!(read.len(), 5);
    for (k, row) in (0..).zip(read) {
        let named: Vec<&str> = row.iter().map(|cell| cell.0.as_str()).collect();
        let columns = mixed();
        let names = columns.iter().map(|column| column.name.as_str());
        assert_eq!(named, std::iter::once("time").chain(names).collect::<Vec<_>>());
        let expected = [
            Field::Double(f64::from(k) * 1e-3),
            Field::Int(k),
            Field::Double(f64::from(k) * 0.1),
            Field::Str(format!("line\n{k}")),
            Field::Bool(k % 2 == 1),
            Field::Double(-f64::from(k)),
            Field::Int(i32::MIN + k),
            Field::Bool(true),
            Field::Str("say \"yes\", then".to_owned()),
        ];
        assert_eq!(row.into_iter().map(|cell| cell.1).collect::<Vec<_>>(), expected);
    }
}

#[test]
fn a_file_is_readable_from_the_first_moment_and_after_every_flush_and_drop() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.parquet");
    let mut sink = ParquetSink::create(&path, &mixed()).unwrap();
    assert_eq!(rows(&path).len(), 0);
    let mut given = 0;
    for flush in 1..20 {
        for _ in 0..flush {
            give(&mut sink, given);
            given += 1;
        }
        sink.flush().unwrap();
        sink.flush().unwrap();
        let expected: Vec<f64> = (0..given).map(|k| f64::from(k) * 1e-3).collect();
        assert_eq!(times(&path), expected, "after flush {flush}");
    }
    assert_eq!(groups(&path), [i64::from(given)], "flushes do not leave row groups of their own");
    give(&mut sink, given);
    drop(sink);
    assert_eq!(times(&path).len(), usize::try_from(given).unwrap() + 1);
}

#[test]
fn row_groups_are_bounded_and_contiguous_with_any_flushes_in_between() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.parquet");
    let columns: Vec<Column> =
        (0..4000).map(|k| column(&format!("x[{k}]"), ColumnKind::Real)).collect();
    let mut sink = Box::new(ParquetSink::create(&path, &columns).unwrap());
    let mut values = vec![0.0; 4000];
    for k in 0..1300 {
        for (place, value) in (0_u32..).zip(&mut values) {
            *value = f64::from(k) * 0.1 + f64::from(place);
        }
        sink.row(f64::from(k), &Row { reals: &values, ..Row::default() }).unwrap();
        if k % 397 == 0 {
            sink.flush().unwrap();
        }
    }
    sink.finish().unwrap();
    let sizes = groups(&path);
    let room = i64::try_from(block::Block::new(&columns).room).unwrap();
    assert_eq!(sizes, [room, room, 1300 - 2 * room]);
    let table = super::super::Table::open(&path).unwrap();
    let mut expected = 0..1300;
    let check = &mut |time: f64, row: &[f64]| {
        let k = f64::from(expected.next().unwrap());
        assert_eq!((time, row), (k, &[k * 0.1, k * 0.1 + 3999.0][..]));
    };
    table.visit(&[1, 4000], check).unwrap();
    assert_eq!(expected.next(), None);
}

#[test]
fn long_texts_end_a_row_group_before_its_rows_do() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.parquet");
    let mut sink =
        Box::new(ParquetSink::create(&path, &[column("s", ColumnKind::String)]).unwrap());
    let text = ["x".repeat(5 << 20)];
    for k in 0..6 {
        sink.row(f64::from(k), &Row { strings: &text, ..Row::default() }).unwrap();
    }
    sink.finish().unwrap();
    assert_eq!(groups(&path), [4, 2]);
    assert_eq!(times(&path), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
}

#[test]
fn a_killed_run_leaves_the_rows_up_to_its_last_write() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.parquet");
    let mut sink = ParquetSink::create(&path, &mixed()).unwrap();
    (0..10).for_each(|k| give(&mut sink, k));
    sink.flush().unwrap();
    (10..20).for_each(|k| give(&mut sink, k));
    // A killed process runs no destructor.
    std::mem::forget(sink);
    assert_eq!(times(&path).len(), 10);
}

/// A kill can split a write only at a boundary between two memory pages.
#[test]
fn a_run_that_is_killed_during_a_write_leaves_a_file_with_the_rows_of_the_write_before() {
    const MEMORY_PAGE: u64 = 4096;
    let folder = tempfile::tempdir().unwrap();
    // Few flushes, so that full row groups follow each other, and many, which replace a partial one.
    for (count, interval) in [(300_000, 90_000), (9000, 700)] {
        let path = folder.path().join("a.parquet");
        let mut sink = ParquetSink::create(&path, &[column("x", ColumnKind::Real)]).unwrap();
        sink.tail.file.changes = Some(Vec::new());
        let killed = folder.path().join("killed.parquet");
        fs::copy(&path, &killed).unwrap();
        for k in 0..count {
            sink.row(f64::from(k), &Row { reals: &[0.5], ..Row::default() }).unwrap();
            if k % interval == 0 {
                sink.flush().unwrap();
            }
        }
        sink.write_rows(true).unwrap();
        let file = File::options().write(true).open(&killed).unwrap();
        let mut present = 0;
        let mut states = 0;
        let mut check = |is_read: bool| {
            let reader = SerializedFileReader::new(File::open(&killed).unwrap()).unwrap();
            let rows = reader.metadata().file_metadata().num_rows();
            assert!(rows >= present, "{rows} rows after {present}");
            if rows > present || is_read {
                let times = super::super::Table::open(&killed).unwrap().column(0).unwrap();
                let expected = (0..i32::try_from(rows).unwrap()).map(f64::from);
                assert!(times.into_iter().eq(expected), "{rows} rows");
            }
            present = rows;
            states += 1;
        };
        for change in sink.tail.file.changes.iter().flatten() {
            match change {
                Change::Length(length) => file.set_len(*length).unwrap(),
                Change::Bytes(offset, bytes) => {
                    let mut done = 0;
                    while done < bytes.len() {
                        let at = offset + done as u64;
                        let room = usize::try_from(MEMORY_PAGE - at % MEMORY_PAGE).unwrap();
                        let end = bytes.len().min(done + room);
                        write_at(&file, at, &bytes[done..end]);
                        done = end;
                        check(false);
                    }
                }
            }
            check(true);
        }
        assert_eq!((present, states > 100), (count.into(), true), "{states} states");
        assert_eq!(fs::read(&path).unwrap(), fs::read(&killed).unwrap());
    }
}

fn write_at(mut file: &File, offset: u64, bytes: &[u8]) {
    file.seek(SeekFrom::Start(offset)).unwrap();
    file.write_all(bytes).unwrap();
}

#[test]
fn the_footer_states_the_units_for_readers_and_for_pandas() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.parquet");
    Box::new(ParquetSink::create(&path, &mixed()).unwrap()).finish().unwrap();
    let reader = SerializedFileReader::new(fs::File::open(&path).unwrap()).unwrap();
    let entries = reader.metadata().file_metadata().key_value_metadata().unwrap().clone();
    let value = |key: &str| {
        let entry = entries.iter().find(|entry| entry.key == key).unwrap();
        serde_json::from_str::<serde_json::Value>(entry.value.as_ref().unwrap()).unwrap()
    };
    let units = serde_json::json!({ "time": "s", "plant.x_p": "m" });
    assert_eq!(value("units"), units);
    assert_eq!(value("PANDAS_ATTRS"), serde_json::json!({ "units": units }));
}
