//! Writes a table of difficult values with a sink, to test other readers.
//!
//!     cargo run --release --package cosim-results --example write_results -- results.parquet numbers.csv
//!
//! The extension of each file selects its format. Every Real is generated from its bits, so that a
//! reader in another language can compute the same values. With `--interrupt` as the first argument
//! the process aborts after a flush and one more row, to simulate a crash; `--numbers` omits strings.
#![forbid(unsafe_code)]

use std::path::Path;
use std::process::ExitCode;

use results::{Column, ColumnKind, ResultsError, Row, Sink, create};

/// Number of rows of a file, more than in a row group of Parquet.
const ROWS: u32 = 70_000;

fn columns(numbers: bool) -> Vec<Column> {
    let column = |name: &str, kind, unit: Option<&str>| Column {
        name: name.to_owned(),
        kind,
        unit: unit.map(str::to_owned),
        clocked: false,
    };
    let mut columns = vec![
        column("plant.x_p", ColumnKind::Real, Some("m")),
        column("plant.mode", ColumnKind::Integer, None),
        column("ctrl.x_hat[1]", ColumnKind::Real, Some("rad/s")),
        column("ctrl.on", ColumnKind::Boolean, None),
    ];
    if !numbers {
        columns.push(column("ctrl.text", ColumnKind::String, None));
    }
    columns
}

/// Returns the bits of the next Real, by a linear congruential generator (Knuth's MMIX).
fn next(bits: u64) -> u64 {
    bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407)
}

/// Writes row `k` with Reals of the generator and a text that CSV must escape.
fn give(sink: &mut dyn Sink, k: u32, bits: &mut u64, numbers: bool) -> Result<(), ResultsError> {
    let mut real = || {
        *bits = next(*bits);
        f64::from_bits(*bits)
    };
    let reals = [real(), real()];
    let texts = [format!("row {k}, \"\u{e4}\"{}", if k.is_multiple_of(3) { "\n" } else { "" })];
    let strings: &[String] = if numbers { &[] } else { &texts };
    let integer = i32::from_ne_bytes(k.wrapping_mul(2_654_435_761).to_ne_bytes()).into();
    let row = Row {
        reals: &reals,
        integers: &[integer],
        booleans: &[i32::from(k % 2 == 1)],
        strings,
        ..Row::default()
    };
    sink.row(f64::from(k) * 1e-3, &row)
}

fn write(path: &Path, numbers: bool, interrupt: bool) -> Result<(), ResultsError> {
    let mut sink = create(path, &columns(numbers))?;
    let mut bits = 1;
    for k in 0..ROWS {
        give(sink.as_mut(), k, &mut bits, numbers)?;
    }
    if interrupt {
        sink.flush()?;
        give(sink.as_mut(), ROWS, &mut bits, numbers)?;
        std::process::abort();
    }
    sink.finish()
}

fn main() -> ExitCode {
    let mut paths: Vec<String> = std::env::args().skip(1).collect();
    let mut flag = |name: &str| {
        let is_flag = paths.first().is_some_and(|first| first == name);
        if is_flag {
            paths.remove(0);
        }
        is_flag
    };
    let (interrupt, numbers) = (flag("--interrupt"), flag("--numbers"));
    for path in &paths {
        if let Err(error) = write(Path::new(path), numbers, interrupt) {
            eprintln!("error: {error}");
            return ExitCode::from(2);
        }
    }
    ExitCode::SUCCESS
}
