//! Prints a column of a CSV file as a signal: for each time on standard input, one line with value,
//! right-hand slope and time of the next break.
//!
//! Usage: signal FILE COLUMN line|hold < TIMES
#![forbid(unsafe_code)]
#![expect(clippy::print_stdout, reason = "the result")]

use std::error::Error;
use std::process::ExitCode;

use master::signal::{Cursor, Interpolation, Signal, Track};
use study::table;

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let [file, column, between] = &arguments[..] else {
        return Err("expected FILE COLUMN line|hold".into());
    };
    let between = match between.as_str() {
        "line" => Interpolation::Line,
        "hold" => Interpolation::Hold,
        other => return Err(format!("expected line or hold, found {other:?}").into()),
    };
    let table = table::read(file.as_ref())?;
    let values = table.column(column).ok_or("there is no such column")?;
    let signal = Signal::Track(Track::new(table.times.clone(), values.clone(), between)?);
    let mut cursor = Cursor::default();
    for line in std::io::stdin().lines() {
        let time: f64 = line?.trim().parse()?;
        let sample = signal.at(time, &mut cursor);
        let next = signal.next_break(time).unwrap_or(f64::INFINITY);
        println!("{:?} {:?} {next:?}", sample.value, sample.slope);
    }
    Ok(())
}
