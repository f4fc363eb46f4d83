//! `aso-ftc pack --ssp`: the plant and the controller, connected, as one SSP.

use std::path::{Path, PathBuf};

use anyhow::Context;
use master::Transformation;

use ssp::{Assembly, Element, Link, Terminal};

use super::PackedFmu;

/// Names of the elements, in the order of the models of the workspace.
const NAMES: [&str; 2] = ["plant", "controller"];
/// The connections: element and output, element and input.
const LINKS: [[&str; 4]; 3] = [
    ["plant", "x_p", "controller", "x_p"],
    ["plant", "theta", "controller", "theta"],
    ["controller", "u", "plant", "u"],
];
/// Stop time of the paper's experiment in s.
const STOP_TIME: f64 = 100.0;
/// Sample time of the command in s; both FMUs propose it as communication step.
const STEP: f64 = 1e-3;

/// Writes `InvertedPendulum.ssp`, with the plant and the controller in `fmus`, into the folder `out`; returns its path.
pub(super) fn write(fmus: &[PackedFmu], out: &Path) -> anyhow::Result<PathBuf> {
    let elements = NAMES.iter().zip(fmus).map(|(name, packed)| Element {
        name: (*name).to_owned(),
        fmu: packed.path.clone(),
        ..Element::default()
    });
    let end = |element: &str, variable: &str| Terminal {
        element: element.to_owned(),
        variable: variable.to_owned(),
    };
    let links = LINKS.map(|[source, output, target, input]| Link {
        from: end(source, output),
        to: end(target, input),
        transformation: Transformation::Identity,
        units_settled: false,
    });
    let assembly = Assembly {
        name: Some("InvertedPendulum".to_owned()),
        elements: elements.collect(),
        links: links.into(),
        functions: Vec::new(),
        start_time: Some(0.0),
        stop_time: Some(STOP_TIME),
    };
    let target = out.join("InvertedPendulum.ssp");
    ssp::write(&assembly, Some(STEP), &target)
        .with_context(|| format!("cannot write {}", target.display()))?;
    Ok(target)
}
