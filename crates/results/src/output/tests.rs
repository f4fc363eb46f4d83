use super::*;
use crate::tests::{give, mixed};
use crate::{Table, create};

/// An action of an FMU on the file, and the start of the error message of the next write.
type Deed = (fn(&Path), &'static str);

fn open(path: &Path) -> File {
    File::options().write(true).open(path).unwrap()
}

fn times(path: &Path) -> usize {
    Table::open(path).unwrap().column(0).unwrap().len()
}

#[test]
fn a_lost_descriptor_loses_no_row() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.txt");
    let mut output = OutputFile::create(&path).unwrap();
    output.verify().unwrap();
    output.append(b"first\n").unwrap();
    output.file = open(Path::new("/dev/null"));
    output.verify().unwrap();
    output.append(b"second\n").unwrap();
    output.verify_path().unwrap();
    assert_eq!(fs::read_to_string(&path).unwrap(), "first\nsecond\n");
}

#[test]
fn a_file_that_others_change_is_an_error_and_keeps_its_rows() {
    let deeds: [Deed; 4] = [
        (|path| open(path).set_len(20).unwrap(), "the file has 20 bytes, expected "),
        (|path| File::options().append(true).open(path).unwrap().write_all(b"word").unwrap(), ""),
        (|path| fs::remove_file(path).unwrap(), "the file was deleted"),
        (
            |path| fs::rename(path, path.with_extension("old")).unwrap(),
            "the file was deleted, moved",
        ),
    ];
    for name in ["a.csv", "a.parquet"] {
        for (deed, reason) in deeds {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join(name);
            let mut sink = create(&path, &mixed()).unwrap();
            (0..3).for_each(|k| give(sink.as_mut(), k));
            sink.flush().unwrap();
            give(sink.as_mut(), 3);
            deed(&path);
            let error = sink.finish().unwrap_err().to_string();
            assert!(error.starts_with(&format!("{}: {reason}", path.display())), "{error}");
            if reason.is_empty() {
                assert!(error.contains("expected") && error.contains("--isolate"), "{error}");
                assert_eq!(times(&path), 4, "{name}");
            }
        }
    }
}

#[test]
fn a_moved_position_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let mut output = OutputFile::create(&folder.path().join("a.txt")).unwrap();
    output.append(b"first\n").unwrap();
    output.file.seek(SeekFrom::Start(0)).unwrap();
    output.file.write_all(b"word").unwrap();
    let error = output.verify().unwrap_err();
    assert!(matches!(error, ResultsError::Overwritten { .. }), "{error}");
}

#[test]
fn a_copy_of_the_process_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let mut output = OutputFile::create(&folder.path().join("a.txt")).unwrap();
    output.process += 1;
    let error = output.verify().unwrap_err();
    assert!(matches!(error, ResultsError::Forked { .. }), "{error}");
}
