//! Designs of controllers.

use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex, PoisonError};

use control::Domain;
use control::robustness::Point;
use design::{LogOptions, TimeLimits, new_plant_file};
use nalgebra::DMatrix;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rayon::ThreadPoolBuilder;

use crate::error;
use crate::guard::guarded;
use crate::node::Node;

/// A designed controller.
#[pyclass(frozen, module = "aso_ftc._core")]
pub(crate) struct Designed {
    design: Mutex<design::Design>,
}

/// The process that has the threads of rayon's global pool.
static POOL: LazyLock<u32> = LazyLock::new(std::process::id);

/// Calls `work` with the interpreter released; raises an error of `work` as a `DesignError`.
fn detached<T: Send>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, design::Error> + Send,
) -> PyResult<T> {
    let result = guarded(py, || {
        if *POOL != std::process::id() {
            // A forked process would wait for ever for the threads of its parent. A pool that consists of this thread
            // serves all later calls of this thread, too; to build it again is an error.
            let _ = ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
        }
        work()
    });
    result?.map_err(|error| error::design(&error).raise(py))
}

/// Designs the controller of the plant file at `path`.
#[pyfunction]
pub(crate) fn design_file(py: Python<'_>, path: PathBuf) -> PyResult<Designed> {
    let design = detached(py, || design::design(&path))?;
    Ok(Designed { design: Mutex::new(design) })
}

/// Designs the controller of a plant given as the text of a plant file or as nested dicts. `path`
/// appears in errors; relative paths start in its folder.
#[pyfunction]
pub(crate) fn design_plant(plant: &Bound<'_, PyAny>, path: PathBuf) -> PyResult<Designed> {
    let py = plant.py();
    let text = Node::text(plant)?;
    let design = detached(py, || design::design_text(&path, text))?;
    Ok(Designed { design: Mutex::new(design) })
}

/// The result of an identification: the text of a plant file, the reason if the plant has no controller, and warnings.
type Identification = (String, Option<String>, Vec<String>);

/// Identifies a plant from the logs at `paths`.
#[pyfunction]
pub(crate) fn identify(
    py: Python<'_>,
    paths: Vec<PathBuf>,
    inputs: Vec<String>,
    outputs: Vec<String>,
    order: Option<usize>,
) -> PyResult<Identification> {
    let options = LogOptions { inputs, outputs, order };
    let limits = TimeLimits::default();
    let path = Path::new("plant.toml");
    let new = detached(py, || new_plant_file(&paths, &options, path, &limits, &|_| {}))?;
    Ok((new.text, new.refusal, new.warnings))
}

/// The rows of a matrix.
type Rows = Vec<Vec<f64>>;

/// Paths and contents of files, and warnings.
type SourceFiles = (Vec<(PathBuf, String)>, Vec<String>);

impl Designed {
    /// Calls `work` with the design, locked against other threads.
    fn with<T>(&self, work: impl FnOnce(&mut design::Design) -> T) -> T {
        work(&mut self.design.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

#[pymethods]
impl Designed {
    /// The content of the controller's `design.toml`.
    #[getter]
    fn file(&self) -> String {
        self.with(|design| design.file.clone())
    }

    /// The text of the plant file.
    #[getter]
    fn plant(&self) -> String {
        self.with(|design| design.plant.clone())
    }

    /// Whether all checks hold.
    #[getter]
    fn holds(&self) -> bool {
        self.with(|design| design.holds())
    }

    /// The numbers of the report as JSON.
    fn report(&self) -> PyResult<String> {
        let text = self.with(|design| serde_json::to_string(&design.report));
        text.map_err(|error| PyValueError::new_err(error.to_string()))
    }

    /// The matrices A, B, C, D of the system `name` of the loop, and its sample time in s, `None` in continuous time.
    /// Raises `ValueError` for an unknown name.
    fn system(&self, name: &str) -> PyResult<([Rows; 4], Option<f64>)> {
        let system = self.with(|design| {
            let whole = &design.closed_loop;
            Some(match name {
                "plant" => whole.plant().clone(),
                "controller" => whole.controller().clone(),
                "closed loop" => whole.system(),
                "S at the commands" => whole.sensitivity(Point::Input),
                "S at the measurements" => whole.sensitivity(Point::Output),
                "T at the commands" => whole.complementary(Point::Input),
                "T at the measurements" => whole.complementary(Point::Output),
                _ => return None,
            })
        });
        let system = system.ok_or_else(|| PyValueError::new_err(name.to_owned()))?;
        let matrices = [&system.a, &system.b, &system.c, &system.d];
        let rows = |matrix: &DMatrix<f64>| {
            matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
        };
        let period = match system.domain {
            Domain::Continuous => None,
            Domain::Sampled { period } => Some(period),
        };
        Ok((matrices.map(rows), period))
    }

    /// The report as an HTML page.
    fn page(&self, py: Python<'_>) -> PyResult<String> {
        guarded(py, || self.with(|design| design.page()))
    }

    /// The controller as source code: paths and contents of the files, and warnings. The code is C, or a crate if
    /// `rust`, in double precision, or in single precision if `single`.
    fn code(&self, py: Python<'_>, rust: bool, single: bool) -> PyResult<SourceFiles> {
        let language = if rust { design::Language::Rust } else { design::Language::C };
        let precision = if single { design::Precision::Single } else { design::Precision::Double };
        let code = detached(py, || self.with(|design| design.code(language, precision)))?;
        Ok((code.files, code.warnings))
    }

    /// Writes the Kalman filter with the plant's FMU to `path`, from the packed filter at `base`. Returns the warning of
    /// the noise that the filter assumes, if there is one.
    fn kalman_fmu(&self, py: Python<'_>, base: PathBuf, path: PathBuf) -> PyResult<Option<String>> {
        detached(py, || {
            self.with(|design| {
                design.kalman_fmu(&base)?.write(&path, &design.page())?;
                Ok(design.kalman_warning())
            })
        })
    }

    /// Writes the controller that uses the estimates of `kalman_fmu` to `path`, from the packed controller at `base`.
    fn feedback_fmu(&self, py: Python<'_>, base: PathBuf, path: PathBuf) -> PyResult<()> {
        detached(py, || {
            self.with(|design| design.feedback_fmu(&base)?.write(&path, &design.page()))
        })
    }

    /// Writes the controller FMU to `path`, from the packed controller at `base`.
    fn fmu(&self, py: Python<'_>, base: PathBuf, path: PathBuf) -> PyResult<()> {
        detached(py, || self.with(|design| design.fmu(&base)?.write(&path, &design.page())))
    }
}
