//! Valid tables, and error messages for invalid ones.

use proptest::prelude::*;

use super::*;

fn refused(text: &str) -> String {
    parse(text.as_bytes()).unwrap_err().to_string()
}

#[test]
fn a_table_is_read_completely() {
    let text = "\"time\",\"u\",plain,\"a[1,2]\"\n0,1,-2.5,1e3\n 0.5 , +1,.5,5.\r\n0.5,2,0,0\n";
    let table = parse(text.as_bytes()).unwrap();
    assert_eq!(table.names, ["u", "plain", "a[1,2]"]);
    assert_eq!(*table.times, [0.0, 0.5, 0.5]);
    assert_eq!(**table.column("u").unwrap(), [1.0, 1.0, 2.0]);
    assert_eq!(**table.column("plain").unwrap(), [-2.5, 0.5, 0.0]);
    assert_eq!(**table.column("a[1,2]").unwrap(), [1000.0, 5.0, 0.0]);
    assert_eq!(table.column("time"), None);
}

#[test]
fn a_byte_order_mark_empty_lines_and_a_missing_last_newline_do_no_harm() {
    let table = parse(b"\xef\xbb\xbftime,u\r\n\r\n0,1\r\n\n1,2").unwrap();
    assert_eq!(*table.times, [0.0, 1.0]);
}

/// `date -u -d TEXT +%s`.
#[test]
fn dates_in_the_column_of_the_time_are_seconds_since_1970() {
    let text = "time,u\n2023-11-14 22:13:20.250,1\n2023-11-14T23:13:21+01:00,2\n2023-11-15,3\n";
    let table = parse(text.as_bytes()).unwrap();
    assert_eq!(*table.times, [1_700_000_000.25, 1_700_000_001.0, 1_700_006_400.0]);
}

#[test]
fn numbers_are_read_to_the_last_bit() {
    let table =
        parse(b"time,u\n0,0.1\n1,2.2250738585072011e-308\n2,1.7976931348623157e308").unwrap();
    let values = table.column("u").unwrap();
    assert_eq!(values[0].to_bits(), 0x3fb9_9999_9999_999a);
    assert_eq!(values[1].to_bits(), 0x000f_ffff_ffff_ffff);
    assert_eq!(values[2].to_bits(), f64::MAX.to_bits());
}

#[test]
fn an_invalid_table_is_refused_with_its_line() {
    for (text, expected) in [
        ("", "the file is empty, expected a header such as \"time\",\"u\" and rows of numbers"),
        ("\n\n", "the file is empty, expected a header such as \"time\",\"u\" and rows of numbers"),
        ("u,time\n0,1", "line 1: the first column is \"u\", expected \"time\""),
        (
            "time;u\n0;1",
            "line 1: the first column is \"time;u\", expected \"time\"; entries are separated by \
             commas",
        ),
        ("0,1\n1,2", "line 1: the first column is \"0\", expected \"time\""),
        ("time,,u\n0,1,2", "line 1: column 2 has no name"),
        ("time,u,v,u\n0,1,2,3", "line 1: the columns 2 and 4 are both called \"u\""),
        ("time\n0\n", "line 1: there is no column but the time"),
        ("time,u\n", "there is no row after the header"),
        ("time,u\n0,1\n1\n", "line 3: expected 2 entries as in the header, found 1"),
        ("time,u\n0,1\n1,2,3\n", "line 3: expected 2 entries as in the header, found 3"),
        ("time,u\n0,1,\n", "line 2: expected 2 entries as in the header, found 3"),
        ("time,u\n\n\n0,x\n", "line 4, column \"u\": expected a finite number, found \"x\""),
        ("time,u\n0,\n", "line 2, column \"u\": expected a finite number, found \"\""),
        ("time,u\n0,NaN\n", "line 2, column \"u\": expected a finite number, found \"NaN\""),
        (
            "time,u\n-inf,1\n",
            "line 2, column \"time\": expected a finite number or a date of ISO 8601, found \"-inf\"",
        ),
        (
            "time,u\n0,2001-09-09\n",
            "line 2, column \"u\": expected a finite number, found \"2001-09-09\"",
        ),
        ("time,u\n0,1e999\n", "line 2, column \"u\": expected a finite number, found \"1e999\""),
        ("time,u\n0,1 2\n", "line 2, column \"u\": expected a finite number, found \"1 2\""),
        (
            "time,u\n0,1\n2,1\n1,1\n",
            "line 4: the time 1 s comes after 2 s, expected ascending times",
        ),
    ] {
        assert_eq!(refused(text), expected, "{text:?}");
    }
    let actual = parse(b"time,u\n0,1\n1,\xff\n").unwrap_err().to_string();
    assert_eq!(actual, "line 3: expected UTF-8 text, found other bytes");
}

#[test]
fn a_quotation_that_does_not_end_gives_a_short_message() {
    let text = format!("time,u\n0,\"{}", "1,2\n".repeat(100_000));
    let actual = refused(&text);
    assert!(actual.starts_with("line 2, column \"u\": expected a finite number"), "{actual}");
    assert!(actual.len() < 150, "{actual}");
}

#[test]
fn a_missing_file_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let actual = read(&folder.path().join("none.csv")).unwrap_err();
    assert!(matches!(actual, TableError::Unreadable(_)), "{actual}");
}

proptest! {
    #[test]
    fn any_text_is_a_whole_table_or_refused(
        text in "(time|\"time\"|t),u(,\"v,w\")?\n([-0-9.eE+, \"\n\r]|nan|inf|1,2\n|0,0,0\n){0,60}"
    ) {
        whole_or_refused(text.as_bytes());
    }

    #[test]
    fn any_bytes_are_a_whole_table_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        whole_or_refused(&bytes);
    }
}

fn whole_or_refused(bytes: &[u8]) {
    match parse(bytes) {
        Ok(table) => {
            assert_eq!(table.names.len(), table.columns.len());
            assert!(table.columns.iter().all(|column| column.len() == table.times.len()));
            assert!(table.columns.iter().all(|column| column.iter().all(|v| v.is_finite())));
            assert!(table.times.is_sorted() && !table.times.is_empty());
        }
        Err(error) => assert!(error.to_string().len() < 400, "{error}"),
    }
}
