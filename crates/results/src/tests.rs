use std::fs;

use super::*;

/// Returns a column without a unit.
pub(super) fn column(name: &str, kind: ColumnKind) -> Column {
    Column { name: name.to_owned(), kind, unit: None, clocked: false }
}

/// Returns two columns of each type, mixed.
pub(super) fn mixed() -> Vec<Column> {
    let mut columns = vec![
        column("ctrl.mode", ColumnKind::Integer),
        column("plant.x_p", ColumnKind::Real),
        column("plant.label \"a\", b", ColumnKind::String),
        column("plant.stuck", ColumnKind::Boolean),
        column("plant.x_hat[1,2]", ColumnKind::Real),
        column("plant.count", ColumnKind::Integer),
        column("ctrl.on", ColumnKind::Boolean),
        column("ctrl.text", ColumnKind::String),
    ];
    columns[1].unit = Some("m".to_owned());
    columns
}

/// Writes row `k` of a table with the columns of [`mixed`].
pub(super) fn give(sink: &mut dyn Sink, k: i32) {
    let texts = [format!("line\n{k}"), "say \"yes\", then".to_owned()];
    let row = Row {
        reals: &[f64::from(k) * 0.1, -f64::from(k)],
        integers: &[k.into(), i64::from(i32::MIN + k)],
        booleans: &[k % 2, 7],
        strings: &texts,
        ..Row::default()
    };
    sink.row(f64::from(k) * 1e-3, &row).unwrap();
}

#[test]
fn the_ending_chooses_the_format_and_the_folder_is_made() {
    let folder = tempfile::tempdir().unwrap();
    for (name, head) in [("a/one.CSV", &b"\"time\""[..]), ("a/b/two.parquet", &b"PAR1"[..])] {
        let path = folder.path().join(name);
        create(&path, &mixed()).unwrap().finish().unwrap();
        assert!(fs::read(&path).unwrap().starts_with(head), "{name}");
    }
    for name in ["results", "results.txt", "results.csv.gz"] {
        let refused = create(&folder.path().join(name), &mixed()).err().unwrap().to_string();
        assert!(refused.contains(name) && refused.contains(".csv or .parquet"), "{refused}");
    }
}

#[test]
fn columns_of_one_name_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["x", "time"] {
        let columns = [column("x", ColumnKind::Real), column(name, ColumnKind::Boolean)];
        for file in ["a.csv", "a.parquet"] {
            let path = folder.path().join(file);
            let refused = create(&path, &columns).err().unwrap();
            assert!(refused.to_string().contains(&format!("{name:?}")), "{refused}");
            assert!(!path.exists());
        }
    }
}

#[test]
fn a_row_that_does_not_fit_the_columns_is_refused_and_not_written() {
    let folder = tempfile::tempdir().unwrap();
    for file in ["a.csv", "a.parquet"] {
        let path = folder.path().join(file);
        let mut sink = create(&path, &[column("x", ColumnKind::Real)]).unwrap();
        let short = sink.row(0.0, &Row::default()).unwrap_err();
        assert_eq!(short.to_string(), "a row has 0 values of type Real, expected 1");
        let other = Row { reals: &[1.0], booleans: &[1], ..Row::default() };
        let message = sink.row(0.0, &other).unwrap_err().to_string();
        assert_eq!(message, "a row has 1 values of type Boolean, expected 0");
        sink.row(2.0, &Row { reals: &[3.0], ..Row::default() }).unwrap();
        sink.finish().unwrap();
        assert_eq!(Table::open(&path).unwrap().column(0).unwrap(), [2.0]);
    }
}

#[test]
fn a_file_that_cannot_be_made_is_named() {
    let folder = tempfile::tempdir().unwrap();
    for file in ["taken.csv", "taken.parquet"] {
        let path = folder.path().join(file);
        fs::create_dir(&path).unwrap();
        let refused = create(&path, &mixed()).err().unwrap().to_string();
        assert!(refused.starts_with(&format!("cannot write {}", path.display())), "{refused}");
    }
}

#[test]
fn a_full_disk_is_an_error_with_the_name_of_the_file() {
    // Only Linux has a device that is always full.
    let full = Path::new("/dev/full");
    if !full.exists() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for ending in ["csv", "parquet"] {
        let path = folder.path().join(format!("full.{ending}"));
        #[cfg(unix)]
        std::os::unix::fs::symlink(full, &path).unwrap();
        let error = create(&path, &mixed()).err().unwrap();
        assert!(matches!(&error, ResultsError::Write { path: named, .. } if *named == path));
    }
}

#[test]
fn a_file_that_is_being_written_is_refused_to_others_and_free_after_its_end() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.csv", "a.parquet"] {
        let path = folder.path().join(name);
        let mut first = create(&path, &mixed()).unwrap();
        (0..3).for_each(|k| give(first.as_mut(), k));
        first.flush().unwrap();
        let before = fs::read(&path).unwrap();
        let Err(error) = create(&path, &mixed()) else { panic!("{name} is written twice") };
        assert!(matches!(error, ResultsError::InUse { .. }) && error.to_string().contains(name));
        assert_eq!(fs::read(&path).unwrap(), before, "{name} is as it was");
        first.finish().unwrap();
        create(&path, &mixed()).unwrap().finish().unwrap();
        assert!(fs::read(&path).unwrap().len() < before.len(), "{name} is replaced");
    }
}
