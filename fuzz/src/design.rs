//! The controller's `resources/design.toml` with arbitrary content.

use std::ffi::{CString, c_char, c_int, c_void};
use std::path::{Path, PathBuf};
use std::ptr::null_mut;

use controller as _;
use fmu_description::abi::{DescribeSink, fmi2CallbackFunctions, fmi2Component, fmi2String};
use fmu_description::{Causality, Kind, ModelDescription};

unsafe extern "C" {
    fn fmuDescribe(resources: *const c_char, context: *mut c_void, sink: DescribeSink) -> c_int;
    fn fmi2Instantiate(
        name: fmi2String,
        kind: c_int,
        guid: fmi2String,
        resources: fmi2String,
        functions: *const fmi2CallbackFunctions,
        visible: c_int,
        logging_on: c_int,
    ) -> fmi2Component;
    fn fmi2FreeInstance(component: fmi2Component);
    fn fmi2SetupExperiment(c: fmi2Component, _: c_int, _: f64, _: f64, _: c_int, _: f64) -> c_int;
    fn fmi2EnterInitializationMode(component: fmi2Component) -> c_int;
    fn fmi2ExitInitializationMode(component: fmi2Component) -> c_int;
    fn fmi2SetReal(c: fmi2Component, vr: *const u32, n: usize, values: *const f64) -> c_int;
    fn fmi2GetReal(c: fmi2Component, vr: *const u32, n: usize, values: *mut f64) -> c_int;
    fn fmi2DoStep(component: fmi2Component, start: f64, size: f64, _: c_int) -> c_int;
}

const ERROR: c_int = 3;

/// A folder in memory for this process.
fn folder() -> PathBuf {
    let base =
        if Path::new("/dev/shm").is_dir() { "/dev/shm".into() } else { std::env::temp_dir() };
    let folder = base.join(format!("design-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

fn describe(folder: &Path) -> Result<String, String> {
    unsafe extern "C" fn sink(context: *mut c_void, text: *const c_char, length: usize) {
        // SAFETY: the context is the vector below, the text has this length.
        unsafe {
            let bytes = std::slice::from_raw_parts(text.cast::<u8>(), length);
            (*context.cast::<Vec<u8>>()).extend_from_slice(bytes);
        }
    }
    let mut text = Vec::new();
    let path = CString::new(folder.to_str().expect("a text")).expect("no NUL");
    // SAFETY: the path is a C string, the sink fits its context.
    let status = unsafe { fmuDescribe(path.as_ptr(), (&raw mut text).cast(), sink) };
    let text = String::from_utf8(text).expect("UTF-8");
    if status == 0 { Ok(text) } else { Err(text) }
}

/// A design file is either refused with a message, or gives a valid description and a controller
/// that runs with statuses of the standard only, without a panic or a crash.
pub(crate) fn design_file(data: &[u8]) {
    let folder = folder();
    std::fs::write(folder.join("design.toml"), data).expect("a file");
    match describe(&folder) {
        Err(message) => {
            assert!(!message.is_empty() && !message.contains("panicked"), "{message}");
        }
        Ok(xml) => {
            let description = ModelDescription::parse(xml).expect("a description");
            assert_eq!(description.problems(), []);
            live(&description, &folder);
        }
    }
}

/// Instantiates, initialises and steps the controller.
fn live(description: &ModelDescription, folder: &Path) {
    let uri = fmu_description::location::file_uri(folder).expect("a URI");
    let [uri, guid] =
        [&uri, &description.guid].map(|text| CString::new(text.as_str()).expect("no NUL"));
    let callbacks = fmi2CallbackFunctions {
        logger: None,
        allocate_memory: None,
        free_memory: None,
        step_finished: None,
        component_environment: null_mut(),
    };
    let references = |causality| -> Vec<u32> {
        let reals =
            description.variables.iter().filter(|variable| matches!(variable.kind, Kind::Real(_)));
        reals
            .filter(|variable| variable.causality == causality)
            .map(|variable| variable.value_reference)
            .collect()
    };
    let (inputs, outputs) = (references(Causality::Input), references(Causality::Output));
    let (values, mut results) = (vec![0.5; inputs.len()], vec![0.0; outputs.len()]);
    // SAFETY: strings and arrays are those above and outlive the calls.
    unsafe {
        let c = fmi2Instantiate(c"one".as_ptr(), 1, guid.as_ptr(), uri.as_ptr(), &callbacks, 0, 0);
        assert!(!c.is_null());
        let mut statuses = vec![
            fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0),
            fmi2EnterInitializationMode(c),
            fmi2ExitInitializationMode(c),
        ];
        let size =
            description.default_experiment.as_ref().and_then(|experiment| experiment.step_size);
        let size = size.unwrap_or(0.1).clamp(1e-6, 1.0);
        for k in 0..3 {
            statuses.push(fmi2SetReal(c, inputs.as_ptr(), inputs.len(), values.as_ptr()));
            statuses.push(fmi2DoStep(c, f64::from(k) * size, size, 1));
            statuses.push(fmi2GetReal(c, outputs.as_ptr(), outputs.len(), results.as_mut_ptr()));
        }
        fmi2FreeInstance(c);
        assert!(statuses.iter().all(|status| (0..=ERROR).contains(status)), "{statuses:?}");
    }
}
