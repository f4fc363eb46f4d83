//! `aso-ftc design`: from a plant file to the design file of the controller FMU.
#![expect(clippy::print_stdout, reason = "the result of the command")]

mod page;
mod report;

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::{Context, bail};
use control::aso::{FaultyPlant, design as design_controller};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use crate::whole_file;

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The plant file: A, B, C, F_a, signals and wanted eigenvalues
    plant: PathBuf,
    /// The design file to write
    #[arg(long, value_name = "FILE", default_value = "design.toml")]
    out: PathBuf,
}

/// The plant file; what is serialised passes into the design file as it is.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct PlantFile {
    description: String,
    t_on: f64,
    #[serde(default)]
    monitor: bool,
    #[serde(rename = "A", skip_serializing)]
    a: Vec<Vec<f64>>,
    #[serde(rename = "B", skip_serializing)]
    b: Vec<Vec<f64>>,
    #[serde(rename = "C", skip_serializing)]
    c: Vec<Vec<f64>>,
    #[serde(rename = "F_a", skip_serializing)]
    f_a: Vec<Vec<f64>>,
    /// Wanted eigenvalues of A + B K_x, n of them.
    #[serde(skip_serializing)]
    controller_eigenvalues: Vec<f64>,
    /// Wanted eigenvalues of A_0 - L C_0, n + q of them.
    #[serde(skip_serializing)]
    observer_eigenvalues: Vec<f64>,
    experiment: toml::Table,
    states: Vec<toml::Table>,
    actuators: Vec<toml::Table>,
    measurements: Vec<toml::Table>,
    faults: Vec<toml::Table>,
}

/// Designs the controller and writes the design file.
pub(crate) fn design(options: &Options) -> anyhow::Result<bool> {
    let path = options.plant.display();
    let text =
        std::fs::read_to_string(&options.plant).with_context(|| format!("cannot read {path}"))?;
    let file: PlantFile = toml::from_str(&text).with_context(|| format!("{path}"))?;
    let plant = FaultyPlant {
        a: matrix("A", &file.a)?,
        b: matrix("B", &file.b)?,
        c: matrix("C", &file.c)?,
        f_a: matrix("F_a", &file.f_a)?,
    };
    let (controller, observer) = (&file.controller_eigenvalues, &file.observer_eigenvalues);
    let designed = design_controller(&plant, controller, observer, None)
        .with_context(|| format!("no controller for {path}"))?;
    let gains = &designed.gains;
    let matrices = [
        ("A", &plant.a),
        ("B", &plant.b),
        ("C", &plant.c),
        ("F_a", &plant.f_a),
        ("K_x", &gains.k_x),
        ("K_f", &gains.k_f),
        ("L_x", &gains.l_x),
        ("L_f", &gains.l_f),
    ];
    whole_file::write(&options.out, render(&file, &matrices)?.as_bytes())
        .with_context(|| format!("cannot write {}", options.out.display()))?;
    println!("K_x: condition {:.3e}", designed.controller.condition);
    println!("L: condition {:.3e}", designed.observer.condition);
    println!("{}", options.out.display());
    Ok(true)
}

fn matrix(name: &str, rows: &[Vec<f64>]) -> anyhow::Result<DMatrix<f64>> {
    let columns = rows.first().map_or(0, Vec::len);
    if let Some(row) = rows.iter().position(|row| row.len() != columns) {
        let found = rows[row].len();
        bail!("{name}: row {} has {found} entries, row 1 has {columns}", row + 1);
    }
    Ok(DMatrix::from_row_iterator(rows.len(), columns, rows.iter().flatten().copied()))
}

/// The design file: scalars, matrices with a row on each line, tables.
fn render(file: &PlantFile, matrices: &[(&str, &DMatrix<f64>)]) -> anyhow::Result<String> {
    let all = toml::Table::try_from(file)?;
    let (tables, scalars): (toml::Table, toml::Table) =
        all.into_iter().partition(|(_, value)| value.is_table() || value.is_array());
    let mut text = "# Written by aso-ftc design.\n\n".to_owned();
    text += &toml::to_string(&scalars)?;
    for (name, matrix) in matrices {
        write!(text, "\n{name} = [\n")?;
        for row in matrix.row_iter() {
            let entries: Vec<_> = row.iter().map(|entry| format!("{:?}", entry + 0.0)).collect();
            writeln!(text, "    [{}],", entries.join(", "))?;
        }
        text += "]\n";
    }
    text += "\n";
    text += &toml::to_string(&tables)?;
    Ok(text)
}
