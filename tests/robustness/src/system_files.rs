//! The fuzz targets of the readers of SSP files and tables. Each panics if a claim does not hold.

use std::fmt::Debug;

use master::signal::{Cursor, Interpolation, Signal, Track};
use ssp::{self, SspError};
use study::table::{self, Table, TableError};

/// What a reader of SSP files returns: the content, and warnings.
type Reading<T> = Result<(T, Vec<String>), SspError>;

/// Content that was read is written and reads back the same; an error states what was expected, and
/// where.
fn both_ways<T: Debug + PartialEq>(
    data: &[u8],
    read: fn(&[u8]) -> Reading<T>,
    render: fn(&T) -> String,
) {
    match read(data) {
        Ok((content, _)) => {
            let xml = render(&content);
            let (again, _) = read(xml.as_bytes()).unwrap_or_else(|error| panic!("{error}: {xml}"));
            assert_eq!(again, content, "{xml}");
            assert_eq!(render(&again), xml);
        }
        Err(error) => {
            if let SspError::Content { at, .. } | SspError::Meaning { at, .. } = &error {
                assert!((1..=lines(data)).contains(&(at.line as usize)), "{error}");
            }
            assert!(error.to_string().contains("expected"), "{error}");
        }
    }
}

fn lines(data: &[u8]) -> usize {
    data.split(|byte| *byte == b'\n').count()
}

/// An SSD file.
pub fn system_structure(data: &[u8]) {
    both_ways(data, ssp::read_ssd, ssp::render_ssd);
}

/// An SSV file.
pub fn parameter_values(data: &[u8]) {
    both_ways(data, ssp::read_ssv, ssp::render_ssv);
}

/// An SSM file.
pub fn parameter_mapping(data: &[u8]) {
    both_ways(data, ssp::read_ssm, ssp::render_ssm);
}

/// An SSB file.
pub fn signal_dictionary(data: &[u8]) {
    both_ways(data, ssp::read_ssb, ssp::render_ssb);
}

/// A CSV file with signals: a file that was read is an ordered table and reads back the same after
/// writing; an error names a line. Columns that are signals have finite values everywhere.
pub fn signal_table(data: &[u8]) {
    let table = match table::parse(data) {
        Ok(table) => table,
        Err(error) => return refused(data, &error),
    };
    assert_eq!(table.names.len(), table.columns.len());
    assert!(!table.names.is_empty() && !table.times.is_empty());
    assert!(table.times.is_sorted());
    for column in table.columns.iter().chain([&table.times]) {
        assert_eq!(column.len(), table.times.len());
        assert!(column.iter().all(|number| number.is_finite()));
    }
    let text = written(&table);
    let again = table::parse(text.as_bytes()).unwrap_or_else(|error| panic!("{error}: {text}"));
    assert_eq!(again, table, "{text}");
    for column in &table.columns {
        for between in [Interpolation::Line, Interpolation::Hold] {
            // The time may exceed the range of a signal.
            if let Ok(track) = Track::new(table.times.clone(), column.clone(), between) {
                follow(&table, column, &Signal::Track(track));
            }
        }
    }
}

/// Checks that an error has a reason, and that its line, if it states one, exists.
fn refused(data: &[u8], error: &TableError) {
    let message = error.to_string();
    assert!(message.len() > 20, "{message:?}");
    let line = message.strip_prefix("line ").map(|rest| {
        let digits = rest.split(|letter: char| !letter.is_ascii_digit()).next();
        digits.and_then(|digits| digits.parse().ok()).unwrap_or(0)
    });
    assert!(line.is_none_or(|line| (1..=lines(data)).contains(&line)), "{message}");
}

/// Writes the table as a CSV file, every name in quotes.
fn written(table: &Table) -> String {
    let quoted = |name: &String| format!(",\"{}\"", name.replace('"', "\"\""));
    let mut lines = vec![format!("time{}\n", table.names.iter().map(quoted).collect::<String>())];
    for (row, time) in table.times.iter().enumerate() {
        let rest = table.columns.iter().map(|column| format!(",{:?}", column[row]));
        lines.push(format!("{time:?}{}\n", rest.collect::<String>()));
    }
    lines.concat()
}

/// The values of a signal at and between its points are between the values of the points.
fn follow(table: &Table, column: &[f64], signal: &Signal) {
    let (least, most) =
        column.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
    // Allows for the two roundings of a weighted mean.
    let slack = 4.0 * f64::EPSILON * least.abs().max(most.abs());
    let mut cursor = Cursor::default();
    for pair in table.times.windows(2).chain([&table.times[table.times.len() - 1..]]) {
        for time in [pair[0], 0.5 * (pair[0] + pair[pair.len() - 1])] {
            let sample = signal.at(time, &mut cursor);
            assert!((least - slack..=most + slack).contains(&sample.value), "{time}: {sample:?}");
            assert!(sample.slope.is_finite(), "{time}: {sample:?}");
        }
    }
    assert!(signal.next_break(table.times[0]).is_none_or(|time| time > table.times[0]));
}
