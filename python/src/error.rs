//! Errors of the libraries as exceptions of `aso_ftc`.

use master::SystemError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use slave::{CallError, Failure};

/// Name of the module with the exceptions.
const MODULE: &str = "aso_ftc._errors";

/// An exception before it is raised: class, kind, sentence and fields.
pub(crate) struct Exception {
    class: &'static str,
    kind: &'static str,
    sentence: String,
    fields: Vec<(&'static str, Field)>,
}

/// The value of a field of an exception.
#[derive(IntoPyObject)]
enum Field {
    Text(String),
    Texts(Vec<String>),
    Number(f64),
    Count(usize),
}

impl Exception {
    pub(crate) fn new(
        class: &'static str,
        kind: &'static str,
        sentence: impl Into<String>,
    ) -> Self {
        Self { class, kind, sentence: sentence.into(), fields: Vec::new() }
    }

    fn text(mut self, name: &'static str, value: impl Into<String>) -> Self {
        self.fields.push((name, Field::Text(value.into())));
        self
    }

    pub(crate) fn number(mut self, name: &'static str, value: f64) -> Self {
        self.fields.push((name, Field::Number(value)));
        self
    }

    /// Adds the time reached in s, unless the exception states a time already.
    pub(crate) fn with_time(self, time: f64) -> Self {
        if self.fields.iter().any(|(name, _)| *name == "time") {
            self
        } else {
            self.number("time", time)
        }
    }

    /// Returns the exception as an error of Python, or the error that occurs while it is created.
    pub(crate) fn raise(self, py: Python<'_>) -> PyErr {
        self.object(py).map_or_else(|error| error, PyErr::from_value)
    }

    fn object(self, py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
        let fields = PyDict::new(py);
        for (name, value) in self.fields {
            fields.set_item(name, value)?;
        }
        py.import(MODULE)?.getattr(self.class)?.call1((self.sentence, self.kind, fields))
    }
}

const CONFIGURATION: &str = "ConfigurationError";
const FMU: &str = "FmuError";
const RUN: &str = "RunError";
const RESULTS: &str = "ResultsError";
const DESIGN: &str = "DesignError";

pub(crate) fn study(error: &study::Error) -> Exception {
    use study::Error as E;
    let sentence = error.sentence();
    match error {
        E::Entry(place) => entry(CONFIGURATION, place, sentence),
        E::System(system) => Exception { sentence, ..self::system(system) },
        E::Structure(_) => Exception::new(CONFIGURATION, "Structure", sentence),
        E::Fmu(source) => Exception::new(FMU, fmu_kind(source), sentence),
        E::Isolated(_) => Exception::new(FMU, "Isolated", sentence),
        E::Library(_) => Exception::new(FMU, "Library", sentence),
        E::Compile(_) => Exception::new(FMU, "Compile", sentence),
        E::Results(_) => Exception::new(RESULTS, "Results", sentence),
        E::Outputs(_) => Exception::new(CONFIGURATION, "Outputs", sentence),
        E::File { action, path, .. } => Exception::new(CONFIGURATION, "File", sentence)
            .text("action", *action)
            .text("path", path.display().to_string()),
        E::Scenario(_) => Exception::new(CONFIGURATION, "Scenario", sentence),
        E::Selection(_) => Exception::new(CONFIGURATION, "Selection", sentence),
        E::Within { what, source } => Exception { sentence, ..study(source) }.text("within", what),
        E::Invalid(_) => Exception::new(CONFIGURATION, "Invalid", sentence),
        _ => Exception::new("Error", "Other", sentence),
    }
}

fn entry(class: &'static str, place: &files::PlaceError, sentence: String) -> Exception {
    let mut error = Exception::new(class, "Entry", sentence)
        .text("path", place.path().display().to_string())
        .text("message", place.message());
    error.fields.push(("line", Field::Count(place.line())));
    error.fields.push(("column", Field::Count(place.column())));
    error
}

fn fmu_kind(error: &fmu_import::FmuError) -> &'static str {
    use fmu_import::FmuError as E;
    match error {
        E::Package(_) => "Package",
        E::Location(_) => "Location",
        E::Load(_) => "Load",
        E::NoCoSimulation { .. } => "NoCoSimulation",
        E::OnlyOnce { .. } => "OnlyOnce",
        E::NoInterface { .. } => "NoInterface",
        E::NeedsTool { .. } => "NeedsTool",
        _ => "Other",
    }
}

/// Returns the exception of an error of the master.
pub(crate) fn system(error: &SystemError) -> Exception {
    use SystemError as E;
    let refused = |kind| Exception::new(CONFIGURATION, kind, error.to_string());
    let named = |kind, name: &str| refused(kind).text("name", name);
    let failed = |kind| Exception::new(RUN, kind, error.to_string());
    match error {
        E::Syntax { text, .. } => named("Syntax", text),
        E::SameName { name } => named("SameName", name),
        E::UnknownSlave { name, slave, known } => {
            named("UnknownSlave", name).text("fmu", slave).text("known", known)
        }
        E::UnknownVariable { name, model, variable, .. } => {
            named("UnknownVariable", name).text("model", model).text("variable", variable)
        }
        E::Role { name, actual, expected } => {
            named("Role", name).text("found", actual).text("expected", expected)
        }
        E::Twice { input, first, second } => {
            named("Twice", input).text("first", first).text("second", second)
        }
        E::Unit { from, from_unit, to, to_unit } => {
            let exception = named("Unit", to).text("unit", to_unit);
            exception.text("source", from).text("source_unit", from_unit)
        }
        E::Relative { relative, relative_unit, absolute, absolute_unit } => {
            let exception = named("Relative", relative).text("unit", relative_unit);
            exception.text("absolute", absolute).text("absolute_unit", absolute_unit)
        }
        E::Size { from, from_size, to, to_size, element } => {
            let exception = named("Size", to).text("size", to_size).text("element", &**element);
            exception.text("source", from).text("source_size", from_size)
        }
        E::Terminals { from, to, .. } => named("Terminals", to).text("source", from),
        E::Resized { name } => named("Resized", name),
        E::Value { name, value, expected } => {
            named("Value", name).text("value", value).text("expected", expected)
        }
        E::Setting { name, value, source } => {
            with_call(named("Setting", name).text("value", value), source)
        }
        E::NotSettable { name, value, .. } => named("NotSettable", name).text("value", value),
        E::LostSetting { name, value, actual } => {
            named("LostSetting", name).text("value", value).text("found", actual)
        }
        E::Capability { slave, lacks, required_by } => {
            let exception = refused("Capability").text("fmu", slave);
            exception.text("lacks", *lacks).text("required_by", required_by)
        }
        E::Algorithm { .. } => refused("Algorithm"),
        E::Time { what, value, .. } => refused("Time").text("what", *what).number("value", *value),
        E::Resume { name, saved, requested } => {
            named("Resume", name).text("taken", saved).text("given", requested)
        }
        E::Call { slave, time, source } => {
            with_call(failed("Call").text("fmu", slave).number("time", *time), source)
        }
        E::Unreadable { slave, name, time, source } | E::Variable { slave, name, time, source } => {
            let kind = if matches!(error, E::Variable { .. }) { "Call" } else { "Unreadable" };
            let exception = failed(kind).text("fmu", &**slave).text("name", &**name);
            with_call(exception.number("time", *time), source)
        }
        E::Unsettled { names, time, .. } => {
            failed("Unsettled").text("names", names).number("time", *time)
        }
        E::NotFinite { name, value, time } => {
            failed("NotFinite").text("name", name).number("value", *value).number("time", *time)
        }
        E::Loop { names, time, .. } => failed("Loop").text("names", names).number("time", *time),
        E::Coupling { time, size, .. } => {
            failed("Coupling").number("time", *time).number("size", *size)
        }
        E::Stuck { time, size, error } => {
            failed("Stuck").number("time", *time).number("size", *size).number("error", *error)
        }
        E::TooManySteps { time, .. } => failed("TooManySteps").number("time", *time),
        _ => failed("Other"),
    }
}

/// Adds function, status and messages of a failed call.
fn with_call(error: Exception, call: &CallError) -> Exception {
    let status = match &call.failure {
        Failure::Status(status) => status.name(),
        Failure::UnknownStatus(_) => "unknown status",
        Failure::Missing => "missing",
        Failure::Panicked(_) => "panicked",
        Failure::Killed(..) => "killed",
        Failure::Exited(_) => "exited",
        Failure::TimedOut(_) => "timed out",
        Failure::OutOfMemory(_) => "out of memory",
        _ => "invalid answer",
    };
    let mut error = error.text("function", call.function).text("status", status);
    error.fields.push(("messages", Field::Texts(call.messages.clone())));
    error
}

/// Returns the Python exception for an error of a controller design.
pub(crate) fn design(error: &design::Error) -> Exception {
    let sentence = files::sentence(error);
    match error {
        design::Error::Entry(place) => entry(DESIGN, place, sentence),
        design::Error::Control(_) => Exception::new(DESIGN, "Control", sentence),
        design::Error::Within { source, .. } => Exception { sentence, ..design(source) },
        design::Error::File { path, .. } => {
            Exception::new(DESIGN, "File", sentence).text("path", path.display().to_string())
        }
        design::Error::Invalid(_) => Exception::new(DESIGN, "Invalid", sentence),
        _ => Exception::new(DESIGN, "Other", sentence),
    }
}

/// Returns the Python exception for an error of a results file.
pub(crate) fn results(error: &results::ResultsError) -> Exception {
    Exception::new(RESULTS, "Results", files::sentence(error))
}

/// Returns the exception of an FMU that cannot be read.
pub(crate) fn package(error: &fmu_description::package::PackageError) -> Exception {
    Exception::new(FMU, "Package", files::sentence(error))
}
