//! The log of FMI calls: one line per call with instance, function, arguments, status and results.

mod events;
mod model_exchange;

use std::fmt::{Arguments, Debug};
use std::fs::File;
use std::io::{self, Write as _};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use fmu_description::Experiment;
use fmu_description::{ModelDescription, Version};

use slave::{CallError, Events, ModelExchange, Slave, StepResult};

/// A log file of FMI calls.
///
/// Each call is written before its execution, the status of the call afterwards, both unbuffered: after a crash the
/// last line names the function that crashed.
#[derive(Clone, Debug)]
pub struct CallLog {
    output: Arc<Mutex<Output>>,
}

#[derive(Debug)]
struct Output {
    file: File,
    /// Whether the file still has the content of an earlier run.
    holds_earlier_run: bool,
    /// The first write error; nothing is written until [`CallLog::check`] returns it.
    failed: Option<io::Error>,
}

impl CallLog {
    /// Opens or creates the file at `path`. The first logged call replaces the content of an existing file: a run
    /// without calls keeps the log of an earlier run.
    ///
    /// # Errors
    ///
    /// [`io::Error`] if the file cannot be created.
    pub fn create(path: &Path) -> io::Result<Self> {
        let file = File::options().write(true).create(true).truncate(false).open(path)?;
        let output = Output { holds_earlier_run: file.metadata()?.len() > 0, file, failed: None };
        Ok(Self { output: Arc::new(Mutex::new(output)) })
    }

    /// Wraps `slave` so that its calls are logged under the name `instance`.
    #[must_use]
    pub fn listen(&self, instance: &str, slave: Box<dyn Slave>) -> LoggedSlave {
        let logged = self.wrap(instance, slave);
        let function_3 = match logged.description().scheduled_execution {
            Some(_) => "fmi3InstantiateScheduledExecution",
            None => "fmi3InstantiateCoSimulation",
        };
        logged.log_creation([
            ("fmiInstantiateSlave", ""),
            ("fmi2Instantiate", "fmi2CoSimulation, "),
            (function_3, ""),
        ]);
        logged
    }

    /// Wraps a model-exchange instance so that its calls are logged under the name `instance`.
    #[must_use]
    pub fn listen_to_equations(
        &self,
        instance: &str,
        slave: Box<dyn ModelExchange>,
    ) -> LoggedSlave<dyn ModelExchange> {
        let logged = self.wrap(instance, slave);
        logged.log_creation([
            ("fmiInstantiateModel", ""),
            ("fmi2Instantiate", "fmi2ModelExchange, "),
            ("fmi3InstantiateModelExchange", ""),
        ]);
        logged
    }

    /// Wraps an instance and guards its arrays. The instance logs its C calls itself if it can.
    fn wrap<S: Slave + ?Sized>(&self, instance: &str, mut slave: Box<S>) -> LoggedSlave<S> {
        let (log, name, mut starts_line) = (self.clone(), instance.to_owned(), true);
        let logs_itself = slave.log_calls(Box::new(move |text| {
            if starts_line {
                log.write(&format!("{name} "));
            }
            starts_line = text.ends_with('\n');
            log.write(text);
        }));
        slave.guard_arrays();
        let version = slave.description().version();
        let (log, instance) = (self.clone(), instance.to_owned());
        LoggedSlave { log, instance, slave, logs_itself, version }
    }

    /// Appends `text`. A write error stops the log, but not the run; [`CallLog::check`] returns it.
    fn write(&self, text: &str) {
        let mut output = self.output.lock().unwrap_or_else(PoisonError::into_inner);
        if output.failed.is_none() {
            let holds_earlier_run = std::mem::take(&mut output.holds_earlier_run);
            let emptied = if holds_earlier_run { output.file.set_len(0) } else { Ok(()) };
            output.failed = emptied.and_then(|()| output.file.write_all(text.as_bytes())).err();
        }
    }

    /// Checks that all calls since the last check are in the file.
    ///
    /// # Errors
    ///
    /// The first [`io::Error`] since the last check. The calls from that error to this check are missing from the
    /// file; later calls are logged.
    pub fn check(&self) -> io::Result<()> {
        let mut output = self.output.lock().unwrap_or_else(PoisonError::into_inner);
        output.failed.take().map_or(Ok(()), Err)
    }
}

/// A slave whose calls are written to a [`CallLog`].
pub struct LoggedSlave<S: Slave + ?Sized = dyn Slave> {
    log: CallLog,
    instance: String,
    slave: Box<S>,
    /// Whether the slave logs its C calls itself, so that this wrapper need not.
    logs_itself: bool,
    version: Version,
}

/// Functions of FMI 2.0, 3.0 and 1.0 whose names differ in more than the prefix. A function that FMI 1.0 lacks keeps
/// its name of FMI 2.0.
const NAMES: &[(&str, &str, &str)] = &[
    ("fmi2GetReal", "fmi3GetFloat64", "fmiGetReal"),
    ("fmi2SetReal", "fmi3SetFloat64", "fmiSetReal"),
    ("fmi2GetInteger", "fmi3GetInt64", "fmiGetInteger"),
    ("fmi2SetInteger", "fmi3SetInt64", "fmiSetInteger"),
    ("fmi2GetFMUstate", "fmi3GetFMUState", "fmi2GetFMUstate"),
    ("fmi2SetFMUstate", "fmi3SetFMUState", "fmi2SetFMUstate"),
    ("fmi2SerializeFMUstate", "fmi3SerializeFMUState", "fmi2SerializeFMUstate"),
    ("fmi2DeSerializeFMUstate", "fmi3DeserializeFMUState", "fmi2DeSerializeFMUstate"),
    ("fmi2NewDiscreteStates", "fmi3UpdateDiscreteStates", "fmiEventUpdate"),
    ("fmi2Terminate", "fmi3Terminate", "fmiTerminateSlave"),
    ("fmi2FreeInstance", "fmi3FreeInstance", "fmiFreeSlaveInstance"),
    ("fmi2SetRealInputDerivatives", "fmi2SetRealInputDerivatives", "fmiSetRealInputDerivatives"),
    ("fmi2GetRealOutputDerivatives", "fmi3GetOutputDerivatives", "fmiGetRealOutputDerivatives"),
    (
        "fmi2GetDirectionalDerivative",
        "fmi3GetDirectionalDerivative",
        "fmi2GetDirectionalDerivative",
    ),
    ("fmi2GetDerivatives", "fmi3GetContinuousStateDerivatives", "fmiGetDerivatives"),
    ("fmi2EnterInitializationMode", "fmi3EnterInitializationMode", "fmiInitializeSlave"),
];

/// Functions of FMI 2.0, each with its name in FMI 1.0 for model exchange if this name differs from [`NAMES`].
const MODEL_EXCHANGE_NAMES: &[(&str, &str)] = &[
    ("fmi2Terminate", "fmiTerminate"),
    ("fmi2FreeInstance", "fmiFreeModelInstance"),
    ("fmi2EnterInitializationMode", "fmiInitialize"),
    ("fmi2GetNominalsOfContinuousStates", "fmiGetNominalContinuousStates"),
];

impl<S: Slave + ?Sized> LoggedSlave<S> {
    /// Logs the creation of the instance. `functions` has a pair for FMI 1.0, 2.0 and 3.0: the C function, and its
    /// argument that selects the interface (empty if it has none).
    fn log_creation(&self, functions: [(&str, &str); 3]) {
        let (function, kind) = self.of_version(functions);
        let (instance, guid) = (&self.instance, &self.slave.description().guid);
        let prefix = self.prefix();
        self.log
            .write(&format!("{instance} {function}({instance:?}, {kind}{guid:?}) -> {prefix}OK\n"));
    }

    /// Returns the element for the version of the FMU; the elements are for FMI 1.0, 2.0 and 3.0.
    fn of_version<T>(&self, [v1, v2, v3]: [T; 3]) -> T {
        match self.version {
            Version::V1 => v1,
            Version::V2 => v2,
            Version::V3 => v3,
        }
    }

    /// Returns the prefix of functions and statuses in the version of the FMU.
    fn prefix(&self) -> &'static str {
        self.of_version(["fmi", "fmi2", "fmi3"])
    }

    /// Translates the name of a function of FMI 2.0 to the version of the FMU.
    fn name(&self, function: &str) -> String {
        if self.version == Version::V1 && self.slave.description().model_exchange.is_some() {
            let known = MODEL_EXCHANGE_NAMES.iter().find(|(name, _)| *name == function);
            if let Some((_, name)) = known {
                return (*name).to_owned();
            }
        }
        let known = NAMES.iter().find(|(name, ..)| *name == function);
        match (self.version, known) {
            (Version::V3, Some((_, name, _))) | (Version::V1, Some((_, _, name))) => {
                (*name).to_owned()
            }
            _ => function.replacen("fmi2", self.prefix(), 1),
        }
    }

    /// Appends `text` unless the slave logs its calls itself.
    fn write(&self, text: &str) {
        if !self.logs_itself {
            self.log.write(text);
        }
    }

    /// Writes `function(arguments)`, performs the call, and writes its status and results.
    fn call<T>(
        &mut self,
        function: &str,
        arguments: Arguments<'_>,
        call: impl FnOnce(&mut S) -> Result<T, CallError>,
        results: impl FnOnce(&T) -> String,
    ) -> Result<T, CallError> {
        self.begin(function, arguments);
        let done = call(self.slave.as_mut());
        let results = done.as_ref().map(results).unwrap_or_default();
        self.end(&done, &results);
        done
    }

    /// Writes the start of a line: instance, function and arguments. `function` is a name of FMI 2.0.
    fn begin(&self, function: &str, arguments: Arguments<'_>) {
        let function = self.name(function);
        self.write(&format!("{} {function}({arguments})", self.instance));
    }

    /// Writes the end of a line: status and results.
    fn end<T>(&mut self, done: &Result<T, CallError>, results: &str) {
        let warned = self.slave.take_warning();
        let status = match done {
            Ok(_) if warned => format!("{}Warning", self.prefix()),
            Ok(_) => format!("{}OK", self.prefix()),
            Err(error) => error.failure_text().replace("returned ", ""),
        };
        self.write(&format!(" -> {status}{results}\n"));
    }

    /// Logs a call that fills `values`.
    fn read<T: Debug>(
        &mut self,
        function: &str,
        arguments: Arguments<'_>,
        values: &mut [T],
        get: impl FnOnce(&mut S, &mut [T]) -> Result<(), CallError>,
    ) -> Result<(), CallError> {
        let call = |slave: &mut S| get(slave, values).map(|()| format!(" {values:?}"));
        self.call(function, arguments, call, String::clone).map(|_| ())
    }

    /// Logs a call without results.
    fn plain(
        &mut self,
        function: &str,
        arguments: Arguments<'_>,
        call: impl FnOnce(&mut S) -> Result<(), CallError>,
    ) -> Result<(), CallError> {
        self.call(function, arguments, call, |()| String::new())
    }

    /// Logs a call that only changes the mode. FMI 1.0 has no such functions.
    fn change_mode(
        &mut self,
        function: &str,
        call: impl FnOnce(&mut S) -> Result<(), CallError>,
    ) -> Result<(), CallError> {
        match self.version {
            Version::V1 => call(self.slave.as_mut()),
            Version::V2 | Version::V3 => self.plain(function, format_args!(""), call),
        }
    }
}

impl<S: Slave + ?Sized> Drop for LoggedSlave<S> {
    fn drop(&mut self) {
        // Logged here, because the instance is freed next, when the field `slave` is dropped.
        let function = self.name("fmi2FreeInstance");
        self.log.write(&format!("{} {function}()\n", self.instance));
    }
}

/// Defines methods without results. A row has the signature, the function of FMI 2.0 (of FMI 3.0 if FMI 2.0 lacks it)
/// that is logged, and its arguments as text.
macro_rules! calls {
    ($(fn $method:ident($($argument:ident: $type:ty),*) = $function:literal, $($text:expr),+;)*) => {
        $(fn $method(&mut self, $($argument: $type),*) -> Result<(), CallError> {
            self.plain($function, format_args!($($text),+), |slave| slave.$method($($argument),*))
        })*
    };
}
use calls;

/// Like `calls`, for methods that fill a list of `$value`.
macro_rules! reads {
    ($(fn $method:ident($($argument:ident: $type:ty),*; $value:ty) = $function:literal, $text:literal;)*) => {
        $(fn $method(
            &mut self,
            $($argument: $type,)*
            values: &mut [$value],
        ) -> Result<(), CallError> {
            self.read($function, format_args!($text), values, |slave, values| {
                slave.$method($($argument,)* values)
            })
        })*
    };
}
use reads;

impl<S: Slave + ?Sized> Slave for LoggedSlave<S> {
    fn description(&self) -> &ModelDescription {
        self.slave.description()
    }

    calls! {
        fn set_debug_logging(on: bool) = "fmi2SetDebugLogging", "{on}";
        fn configure(references: &[u32], values: &[i64]) =
            "fmi3EnterConfigurationMode", "{references:?}, {values:?}";
        fn set_real(references: &[u32], values: &[f64]) = "fmi2SetReal", "{references:?}, {values:?}";
        fn set_integer(references: &[u32], values: &[i64]) =
            "fmi2SetInteger", "{references:?}, {values:?}";
        fn set_boolean(references: &[u32], values: &[i32]) =
            "fmi2SetBoolean", "{references:?}, {values:?}";
        fn set_string(references: &[u32], values: &[String]) =
            "fmi2SetString", "{references:?}, {values:?}";
        fn set_binary(references: &[u32], values: &[Vec<u8>]) =
            "fmi3SetBinary", "{references:?}, {values:?}";
        fn save_state(slot: usize) = "fmi2GetFMUstate", "state {slot}";
        fn restore_state(slot: usize) = "fmi2SetFMUstate", "state {slot}";
        fn deserialize_state(bytes: &[u8]) = "fmi2DeSerializeFMUstate", "{} bytes", bytes.len();
    }

    reads! {
        fn get_real(references: &[u32]; f64) = "fmi2GetReal", "{references:?}";
        fn get_integer(references: &[u32]; i64) = "fmi2GetInteger", "{references:?}";
        fn get_boolean(references: &[u32]; i32) = "fmi2GetBoolean", "{references:?}";
        fn get_string(references: &[u32]; String) = "fmi2GetString", "{references:?}";
        fn get_binary(references: &[u32]; Vec<u8>) = "fmi3GetBinary", "{references:?}";
        fn get_output_derivatives(references: &[u32], orders: &[i32]; f64) =
            "fmi2GetRealOutputDerivatives", "{references:?}, orders {orders:?}";
        fn directional_derivative(unknowns: &[u32], knowns: &[u32], seed: &[f64]; f64) =
            "fmi2GetDirectionalDerivative", "{unknowns:?}, {knowns:?}, {seed:?}";
    }

    fn setup_experiment(&mut self, experiment: &Experiment) -> Result<(), CallError> {
        if self.version != Version::V2 {
            // FMI 1.0 and 3.0 pass the experiment with the initialization: there is no C call to log.
            return self.slave.setup_experiment(experiment);
        }
        let Experiment { start_time, stop_time, tolerance } = experiment;
        let stated = |what: &str, value: &Option<f64>| match value {
            Some(value) => format!("{what} {value:?}"),
            None => format!("no {what}"),
        };
        let (tolerance, stop) = (stated("tolerance", tolerance), stated("stop time", stop_time));
        let call = |slave: &mut S| slave.setup_experiment(experiment);
        let arguments = format_args!("{tolerance}, start time {start_time:?}, {stop}");
        self.plain("fmi2SetupExperiment", arguments, call)
    }

    fn enter_initialization_mode(&mut self) -> Result<(), CallError> {
        let call = |slave: &mut S| slave.enter_initialization_mode();
        self.plain("fmi2EnterInitializationMode", format_args!(""), call)
    }

    fn exit_initialization_mode(&mut self) -> Result<(), CallError> {
        let call = |slave: &mut S| slave.exit_initialization_mode();
        self.change_mode("fmi2ExitInitializationMode", call)
    }

    fn terminate(&mut self) -> Result<(), CallError> {
        self.plain("fmi2Terminate", format_args!(""), S::terminate)
    }

    fn free(&mut self) -> Result<(), CallError> {
        self.slave.free()
    }

    fn set_input_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), CallError> {
        if self.version == Version::V3 {
            // FMI 3.0 has no such function: the FMU asks for its inputs within the step.
            return self.slave.set_input_derivatives(references, orders, values);
        }
        let arguments = format_args!("{references:?}, orders {orders:?}, {values:?}");
        self.plain("fmi2SetRealInputDerivatives", arguments, |slave| {
            slave.set_input_derivatives(references, orders, values)
        })
    }

    fn do_step(&mut self, time: f64, size: f64, never_back: bool) -> Result<StepResult, CallError> {
        // The last argument of FMI 1.0 is `newStep`, which is always true.
        let flag = never_back || self.version == Version::V1;
        self.begin("fmi2DoStep", format_args!("{time:?}, {size:?}, {flag}"));
        let done = self.slave.do_step(time, size, never_back);
        match (&done, self.version) {
            (Ok(StepResult::Part { reached, .. }), Version::V1) => {
                self.write(&format!(" -> fmiDiscard fmiLastSuccessfulTime {reached:?}\n"));
            }
            (Ok(StepResult::Part { reached, terminated }), Version::V2) => self.write(&format!(
                " -> fmi2Discard fmi2LastSuccessfulTime {reached:?}, fmi2Terminated {terminated}\n"
            )),
            (Ok(StepResult::Part { reached, terminated }), Version::V3) => {
                let results =
                    format!(" terminateSimulation {terminated}, lastSuccessfulTime {reached:?}");
                self.end(&done, &results);
            }
            (Ok(StepResult::Event { reached }), _) => {
                self.end(&done, &format!(" event at {reached:?}"));
            }
            _ => self.end(&done, ""),
        }
        done
    }

    fn serialize_state(&mut self) -> Result<Vec<u8>, CallError> {
        let call = |slave: &mut S| slave.serialize_state();
        let results = |bytes: &Vec<u8>| format!(" {} bytes", bytes.len());
        self.call("fmi2SerializeFMUstate", format_args!(""), call, results)
    }

    fn guard_arrays(&mut self) {
        self.slave.guard_arrays();
    }

    fn hand_over_events(&mut self, stop: bool) -> Result<bool, CallError> {
        self.slave.hand_over_events(stop)
    }

    fn events(&mut self) -> Option<&mut dyn Events> {
        self.slave.events()?;
        Some(self)
    }
}

#[cfg(test)]
mod tests {
    use fmu_description::package::TemporaryFolder;

    use super::*;

    /// Accepts the calls; its steps end after 0.5 s.
    struct Stub(ModelDescription);

    impl Slave for Stub {
        fn description(&self) -> &ModelDescription {
            &self.0
        }

        fn get_real(&mut self, _: &[u32], _: &mut [f64]) -> Result<(), CallError> {
            Ok(())
        }

        fn set_real(&mut self, _: &[u32], _: &[f64]) -> Result<(), CallError> {
            Ok(())
        }

        fn set_input_derivatives(
            &mut self,
            _: &[u32],
            _: &[i32],
            _: &[f64],
        ) -> Result<(), CallError> {
            Ok(())
        }

        fn do_step(&mut self, time: f64, _: f64, _: bool) -> Result<StepResult, CallError> {
            Ok(StepResult::Part { reached: time + 0.5, terminated: true })
        }

        fn serialize_state(&mut self) -> Result<Vec<u8>, CallError> {
            Ok(vec![0; 3])
        }

        fn deserialize_state(&mut self, _: &[u8]) -> Result<(), CallError> {
            Ok(())
        }
    }

    fn log_of(fmi_version: &str) -> String {
        let folder = TemporaryFolder::new().unwrap();
        let path = folder.path().join("calls.txt");
        let fmi_version = fmi_version.to_owned();
        let description = ModelDescription { fmi_version, ..ModelDescription::default() };
        let log = CallLog::create(&path).unwrap();
        let mut slave = log.listen("a", Box::new(Stub(description)));
        slave.exit_initialization_mode().unwrap();
        slave.set_input_derivatives(&[1], &[1], &[2.0]).unwrap();
        slave.do_step(0.0, 1.0, false).unwrap();
        let bytes = slave.serialize_state().unwrap();
        slave.deserialize_state(&bytes).unwrap();
        drop(slave);
        log.check().unwrap();
        std::fs::read_to_string(&path).unwrap()
    }

    #[test]
    fn functions_and_results_of_fmi_3_have_their_names() {
        let expected = r#"a fmi3InstantiateCoSimulation("a", "") -> fmi3OK
a fmi3ExitInitializationMode() -> fmi3OK
a fmi3DoStep(0.0, 1.0, false) -> fmi3OK terminateSimulation true, lastSuccessfulTime 0.5
a fmi3SerializeFMUState() -> fmi3OK 3 bytes
a fmi3DeserializeFMUState(3 bytes) -> fmi3OK
a fmi3FreeInstance()
"#;
        assert_eq!(log_of("3.0"), expected);
    }

    #[test]
    fn a_partial_step_has_the_names_of_its_version() {
        let log = log_of("1.0");
        let step = "a fmiDoStep(0.0, 1.0, true) -> fmiDiscard fmiLastSuccessfulTime 0.5\n";
        assert!(log.contains(step) && log.ends_with("a fmiFreeSlaveInstance()\n"), "{log}");
        assert!(!log.contains("ExitInitializationMode"), "{log}");
        let log = log_of("2.0");
        let step = "-> fmi2Discard fmi2LastSuccessfulTime 0.5, fmi2Terminated true\n";
        assert!(log.contains(step), "{log}");
    }
}
