//! A plant that is an FMU.

use std::fs;
use std::path::{Path, PathBuf};

use fmu_description::{Causality, Kind, ModelDescription, Variability};
use fmu_import::Fmu;
use linearise::{Linearise, LineariseError, linearise};

use crate::Error;
use crate::init::draft::{Draft, Identification, Model};
use crate::plant::linear::direct_terms;
use plant_file::signals::Signal;

/// Reads the continuous inputs and outputs of the FMU; `out` is the plant file that will name it.
///
/// An output that a command enters directly is no measurement, unless this holds for all outputs.
pub(super) fn draft(path: &Path, out: &Path) -> Result<Draft, Error> {
    let invalid = |reason: String| Error::Invalid(format!("{}: {reason}", path.display()));
    let fmu = Fmu::open_any(path).map_err(|error| invalid(files::sentence(&error)))?;
    let description = fmu.elements().map_err(|error| invalid(files::sentence(&error)))?;
    let inputs = continuous(&description, Causality::Input);
    let outputs = continuous(&description, Causality::Output);
    for (count, what) in [(inputs.len(), "input"), (outputs.len(), "output")] {
        if count == 0 {
            return Err(invalid(format!(
                "it has no continuous {what}, and so is no plant for a controller"
            )));
        }
    }
    let request =
        Linearise { inputs: inputs.clone(), outputs: outputs.clone(), ..Linearise::default() };
    let linear = linearise(&fmu, &request).map_err(|error| {
        let entry = match &error {
            LineariseError::NoStep { .. } => "linearisation_step",
            LineariseError::StatesNotNamed { .. } => "states",
            _ => return invalid(files::sentence(&error)),
        };
        invalid(format!(
            "{error} (--init cannot: `{entry}` of a plant file states it, beside `plant`, `actuators` \
             and `measurements`)"
        ))
    })?;
    let named = |signal: &linearise::Signal| {
        let variable = description.variable(&signal.name);
        let text = variable.and_then(|variable| variable.description.clone());
        Signal { description: text.unwrap_or_default(), ..Signal::named(signal.name.clone()) }
    };
    // A sensor rarely measures an output that a command enters directly, such as a force.
    let [d, _] = direct_terms(&linear);
    let contains = |at: &usize| d.row(*at).amax() > 0.0;
    let (with_command, free): (Vec<_>, Vec<_>) = (0..linear.outputs.len()).partition(contains);
    let (measured, left_out) =
        if free.is_empty() { (with_command, free) } else { (free, with_command) };
    let operating = linear.inputs.iter().map(|signal| (signal.name.clone(), signal.value));
    Ok(Draft {
        origin: format!("the FMU {}", description.model_name),
        model: Model::Fmu { path: relative(path, out)?, inputs: operating.collect() },
        actuators: linear.inputs.iter().map(named).collect(),
        has_feedthrough: measured.iter().any(contains),
        measurements: measured.iter().map(|&at| named(&linear.outputs[at])).collect(),
        left_out: left_out.iter().map(|&at| linear.outputs[at].name.clone()).collect(),
        identification: Identification::default(),
    })
}

fn continuous(description: &ModelDescription, causality: Causality) -> Vec<String> {
    let chosen = description.variables.iter().filter(|variable| {
        variable.causality == causality
            && variable.variability == Variability::Continuous
            && matches!(variable.kind, Kind::Real(_))
    });
    chosen.map(|variable| variable.name.clone()).collect()
}

/// Returns the path of the FMU as the plant file at `out` states it: relative to the folder of `out` if the FMU is in
/// it or below, otherwise absolute.
fn relative(path: &Path, out: &Path) -> Result<String, Error> {
    let whole = |path: &Path| fs::canonicalize(path).map_err(Error::file("read", path));
    let folder = match out.parent() {
        Some(folder) if folder != Path::new("") => folder.to_owned(),
        _ => PathBuf::from("."),
    };
    let path = whole(path)?;
    let folder = if folder.is_dir() { whole(&folder)? } else { folder };
    let stated = path.strip_prefix(&folder).unwrap_or(&path);
    Ok(stated.to_string_lossy().into_owned())
}
