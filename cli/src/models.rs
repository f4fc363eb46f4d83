//! Finds the FMUs of the paper, in a clone of this project or beside the command, and their crates.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};

/// The FMUs of the paper: the name of the instance, and the file.
pub(crate) const FMUS: [(&str, &str); 2] =
    [("plant", "FrictionPendulum.fmu"), ("controller", "AsoController.fmu")];

/// The FMU from which Kalman filters are made, of the crate `fmu-kalman`.
pub(crate) const FILTER: &str = "KalmanFilter.fmu";

/// The folder into which FMUs are packed by default.
const DIST: &str = "dist";

/// Folders, relative to the folder of the command, in which FMUs are searched: in a release, below the prefix of an
/// installation, in the Python package.
const BESIDE: [&str; 3] = ["fmus", "../share/aso-ftc/fmus", "../fmus"];

/// The crates of [`FMUS`], in the same order.
pub(crate) const CRATES: [&str; 2] = ["fmu-plant", "fmu-controller"];

/// Returns the path of the FMU `name`: the first that exists in `dist`, in the folder of [`beside`], or in `dist` of
/// the clone that the command was built in. Without one, returns an error that says how to pack it.
pub(crate) fn default_fmu(name: &str) -> anyhow::Result<PathBuf> {
    let packed = Path::new(DIST).join(name);
    let others = [beside(), built_in().map(|root| root.join(DIST))].into_iter().flatten();
    let others = others.map(|folder| folder.join(name));
    let mut paths = std::iter::once(packed.clone()).chain(others);
    paths.find(|path| path.is_file()).with_context(|| missing(&packed))
}

/// Returns the error message for an FMU that is not packed. Only for a Kalman filter, no option names another file.
fn missing(packed: &Path) -> String {
    let advice = if packed.ends_with(FILTER) {
        "write it by `aso-ftc pack fmu-kalman` in a clone"
    } else {
        "name another FMU, or write this one by `aso-ftc pack`"
    };
    format!("there is no {}: {advice}", packed.display())
}

/// Returns the clone of this project that contains the current folder; otherwise prints and returns the clone in which
/// the command was built. Returns an error if neither exists.
pub(crate) fn clone() -> anyhow::Result<PathBuf> {
    if let Some(root) = clone_upwards()? {
        return Ok(root);
    }
    if let Some(root) = built_in() {
        eprintln!("packing the models of {}", root.display());
        return Ok(root);
    }
    let here = std::env::current_dir()?;
    bail!(
        "{} is not inside a clone of this project (a folder with {}): change to a clone; `run` and \
         `reproduce` also use the FMUs of a release in a folder fmus beside the command",
        here.display(),
        CRATES.join(" and ")
    )
}

/// Returns the clone that the command was built in, if it still exists.
fn built_in() -> Option<PathBuf> {
    option_env!("ASO_FTC_CLONE").map(PathBuf::from).filter(|folder| is_clone(folder))
}

/// Returns the clone of this project that the current folder is in; `None` outside of a clone.
pub(crate) fn clone_upwards() -> anyhow::Result<Option<PathBuf>> {
    let here = std::env::current_dir().context("the current folder")?;
    Ok(here.ancestors().find(|folder| is_clone(folder)).map(Path::to_path_buf))
}

fn is_clone(folder: &Path) -> bool {
    CRATES.iter().all(|model| folder.join(model).join("Cargo.toml").is_file())
}

/// Returns the first of the folders [`BESIDE`] that has both FMUs of the paper; `None` if none has.
pub(crate) fn beside() -> Option<PathBuf> {
    let command = std::env::current_exe().ok()?;
    let command = command.canonicalize().ok()?;
    let parent = command.parent()?;
    let has_fmus = |folder: &PathBuf| FMUS.iter().all(|(_, name)| folder.join(name).is_file());
    BESIDE.map(|folder| parent.join(folder)).into_iter().find(has_fmus)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_fmu_is_proposed_only_where_an_option_names_it() {
        let of = |name: &str| missing(&Path::new(DIST).join(name));
        assert!(of(FMUS[0].1).contains("name another FMU, or write this one by `aso-ftc pack`"));
        assert!(of(FILTER).ends_with(": write it by `aso-ftc pack fmu-kalman` in a clone"));
    }
}
