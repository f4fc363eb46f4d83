//! Writes rows until the process is killed, to test what a kill leaves in the file.
//!
//!     cargo run --release --package cosim-results --example write_until_killed -- results.parquet 400 0.001
//!
//! The arguments are the file, its number of Real columns, and the pause between two rows in s. Row k
//! has the time k and the values k + column/1024. Standard output gets the time of each row that was
//! passed to the sink, in s since the start, as eight bytes in the native order.
#![forbid(unsafe_code)]

use std::io::{self, Write as _};
use std::path::Path;
use std::time::{Duration, Instant};

use results::{Column, ColumnKind, Row, create};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [path, count, pause] = arguments.as_slice() else {
        return Err("expected a file, a number of columns and a pause".into());
    };
    let (count, pause) = (count.parse::<u16>()?, Duration::from_secs_f64(pause.parse()?));
    let column = |number: u16| Column {
        name: format!("x[{number}]"),
        kind: ColumnKind::Real,
        unit: None,
        clocked: false,
    };
    let columns: Vec<Column> = (0..count).map(column).collect();
    let offsets: Vec<f64> = (0..count).map(|number| f64::from(number) / 1024.0).collect();
    let mut reals = vec![0.0; columns.len()];
    let (start, mut out) = (Instant::now(), io::stdout());
    let mut sink = create(Path::new(path), &columns)?;
    for row in 0.. {
        let time = f64::from(row);
        for (value, offset) in reals.iter_mut().zip(&offsets) {
            *value = time + offset;
        }
        sink.row(time, &Row { reals: &reals, ..Row::default() })?;
        out.write_all(&start.elapsed().as_secs_f64().to_ne_bytes())?;
        out.flush()?;
        if !pause.is_zero() {
            std::thread::sleep(pause);
        }
    }
    Ok(())
}
