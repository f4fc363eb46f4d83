//! Measures the time to write a row, compared with C's `fprintf("%.17g")`.
//!
//!     cargo bench --package cosim-results --bench results
//!
//! `printf.c` writes the table in C, in its own process. The writers take turns in each sample and
//! report their processor time, including the writing to the file. The last lines of the output are
//! the table of `docs/reference/results.md`. Needs a C compiler; Unix only.
#![forbid(unsafe_code)]
#![expect(clippy::print_stdout, reason = "the result")]
#![expect(clippy::cast_precision_loss, reason = "figures for a table")]
#![expect(clippy::unwrap_used, reason = "a benchmark that cannot run has to stop")]

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Duration;

use criterion::Criterion;
use results::{Column, ColumnKind, Row, create};
use rustix::time::{ClockId, clock_gettime};

/// Numbers of columns of the tables.
const WIDTHS: [usize; 3] = [4, 40, 400];
/// Rows after which the tables repeat.
const PERIOD: u64 = 1024;

/// A writer of tables to be measured.
struct Subject {
    name: &'static str,
    path: PathBuf,
    /// Returns the processor time to write a number of rows.
    time: Box<dyn FnMut(u64) -> Duration>,
}

/// Returns a value of a smooth signal, as of a model: most values need 17 digits.
fn value(row: u64, column: usize) -> f64 {
    (0.001 * row as f64 * (column as f64 + 1.0)).sin()
}

/// Returns the processor time of this thread.
fn processor_time() -> Duration {
    let now = clock_gettime(ClockId::ThreadCPUTime);
    Duration::new(now.tv_sec.cast_unsigned(), u32::try_from(now.tv_nsec).unwrap())
}

/// Returns the sink for the extension of `path`.
fn ours(name: &'static str, path: PathBuf, width: usize) -> Subject {
    let column =
        |k| Column { name: format!("x{k}"), kind: ColumnKind::Real, unit: None, clocked: false };
    let columns: Vec<Column> = (0..width).map(column).collect();
    let table: Vec<Vec<f64>> =
        (0..PERIOD).map(|row| (0..width).map(|column| value(row, column)).collect()).collect();
    let written = path.clone();
    let time = Box::new(move |rows: u64| {
        let start = processor_time();
        let mut sink = create(&written, &columns).unwrap();
        for (k, reals) in (0..rows).zip(table.iter().cycle()) {
            sink.row(1e-3 * k as f64, &Row { reals, ..Row::default() }).unwrap();
        }
        sink.finish().unwrap();
        processor_time().checked_sub(start).unwrap()
    });
    Subject { name, path, time }
}

/// The process of `printf.c`, which ends at the end of its input.
struct Printf {
    child: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
}

impl Printf {
    fn time(&mut self, rows: u64) -> Duration {
        writeln!(self.input.as_ref().unwrap(), "{rows}").unwrap();
        let mut line = String::new();
        self.output.read_line(&mut line).unwrap();
        Duration::from_nanos(line.trim().parse().expect("printf.c ended, see above"))
    }
}

impl Drop for Printf {
    fn drop(&mut self) {
        self.input = None;
        self.child.wait().unwrap();
    }
}

fn theirs(program: &Path, path: PathBuf, width: usize) -> Subject {
    let mut child = Command::new(program)
        .arg(&path)
        .args([width.to_string(), PERIOD.to_string()])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let (input, output) = (child.stdin.take(), BufReader::new(child.stdout.take().unwrap()));
    let mut printf = Printf { child, input, output };
    Subject { name: "C, fprintf", path, time: Box::new(move |rows| printf.time(rows)) }
}

fn compiled(folder: &Path) -> PathBuf {
    let program = folder.join("printf");
    let compiler = std::env::var_os("CC").unwrap_or_else(|| "cc".into());
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/printf.c");
    let status =
        Command::new(compiler).args(["-O2", "-o"]).args([&program, &source]).arg("-lm").status();
    assert!(status.is_ok_and(|status| status.success()), "printf.c cannot be compiled");
    program
}

/// Returns the median time per row in s and the bytes per row of each of the `subjects`. Criterion
/// reports the first, with a period of the table as one iteration.
fn measure(criterion: &mut Criterion, id: &str, subjects: &mut [Subject]) -> Vec<(f64, f64)> {
    let mut figures = vec![Vec::new(); subjects.len()];
    criterion.bench_function(id, |bencher| {
        bencher.iter_custom(|periods| {
            let rows = periods * PERIOD;
            let mut first = None;
            for (figures, subject) in figures.iter_mut().zip(subjects.iter_mut()) {
                let time = (subject.time)(rows);
                let bytes = fs::metadata(&subject.path).unwrap().len();
                figures.push((time.as_secs_f64() / rows as f64, bytes as f64 / rows as f64));
                first.get_or_insert(time);
            }
            first.unwrap_or_default()
        });
    });
    let median = |mut figures: Vec<(f64, f64)>| {
        figures.sort_by(|a, b| a.0.total_cmp(&b.0));
        figures.get(figures.len() / 2).copied()
    };
    figures.into_iter().filter_map(median).collect()
}

fn main() {
    let folder = tempfile::tempdir().unwrap();
    let program = compiled(folder.path());
    let mut criterion = Criterion::default()
        .sample_size(20)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_secs(2))
        .configure_from_args();
    let mut lines = vec![
        "\n| columns | written by | us per row | ns per value | rows/s | MB/s | bytes per row | times C's speed |"
            .to_owned(),
        "|---|---|---|---|---|---|---|---|".to_owned(),
    ];
    for width in WIDTHS {
        let path = |name: &str| folder.path().join(name);
        let mut subjects = [
            ours("CSV", path("a.csv"), width),
            ours("Parquet", path("a.parquet"), width),
            theirs(&program, path("c.csv"), width),
        ];
        let figures = measure(&mut criterion, &format!("results/{width}"), &mut subjects);
        let Some(&(c, _)) = figures.last() else { continue };
        for ((time, bytes), subject) in figures.iter().zip(&subjects) {
            lines.push(format!(
                "| {width} | {} | {:.2} | {:.1} | {:.0} | {:.0} | {bytes:.0} | {:.1} |",
                subject.name,
                time * 1e6,
                time * 1e9 / (width as f64 + 1.0),
                1.0 / time,
                bytes / time / 1e6,
                c / time,
            ));
        }
    }
    criterion.final_summary();
    println!("{}", lines.join("\n"));
}
