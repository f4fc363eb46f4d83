//! Linearises an FMU and prints matrices, operating point and method as TOML.
//!
//! Usage: linearise FMU [preload=LIBRARY] [inputs=A,B] [faults=..] [outputs=..] [states=..]
//! [step=SECONDS] [at.NAME=VALUE ...] [typical.NAME=SIZE ...]
#![forbid(unsafe_code)]
#![expect(clippy::print_stdout, reason = "the result")]

use std::error::Error;
use std::process::ExitCode;

use fmu_import::{Fmu, preload};
use linearise::{Linearise, Signal, linearise};

fn list(text: &str) -> Vec<String> {
    text.split(',').filter(|name| !name.is_empty()).map(str::to_owned).collect()
}

fn print(key: &str, signals: &[Signal]) {
    for signal in signals {
        println!("{key}.{:?} = {:?}", signal.name, signal.value);
    }
}

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
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or("the first argument is the FMU")?;
    let mut request = Linearise::default();
    for argument in arguments {
        let (key, value) = argument.split_once('=').ok_or("expected key=value")?;
        match key.split_once('.').unwrap_or((key, "")) {
            ("preload", _) => preload(value.as_ref())?,
            ("inputs", _) => request.inputs = list(value),
            ("faults", _) => request.faults = list(value),
            ("outputs", _) => request.outputs = list(value),
            ("states", _) => request.states = list(value),
            ("step", _) => request.step = Some(value.parse()?),
            ("at", name) => request.at.push((name.to_owned(), value.to_owned())),
            ("typical", name) => request.typical.push((name.to_owned(), value.parse()?)),
            _ => return Err(format!("{key:?} is no key").into()),
        }
    }
    let linearised = linearise(&Fmu::open_any(path.as_ref())?, &request)?;
    let system = &linearised.matrices;
    let matrices = [
        ("A", &system.a),
        ("B", &system.b),
        ("F", &system.f),
        ("C", &system.c),
        ("D", &system.d),
        ("G", &system.g),
    ];
    for (name, matrix) in matrices {
        let rows: Vec<Vec<f64>> =
            matrix.row_iter().map(|row| row.iter().copied().collect()).collect();
        println!("{name} = {rows:?}");
    }
    println!("rates = {:?}", linearised.rates);
    println!("residual = {:?}", linearised.residual);
    println!("method = {:?}", linearised.method.to_string());
    if let Some(error) = linearised.relative_error() {
        println!("relative_error = {error:?}");
    }
    print("x_0", &linearised.states);
    print("u_0", &linearised.inputs);
    print("f_0", &linearised.faults);
    print("y_0", &linearised.outputs);
    Ok(())
}
