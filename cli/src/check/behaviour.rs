//! Checks of the behaviour: runs the library with the calls of an importer.

use std::collections::BTreeSet;

use fmu_description::number::seconds;
use fmu_description::{
    Causality, DefaultExperiment, Experiment, ModelDescription, ScalarVariable, Version,
};
use master::{CallError, Failure, Slave, StepResult, ValueType};

use super::answer::TrialResult;
use super::finding::Severity::{Error, Note, Warning};
use super::finding::{Finding, Findings, Part, Tool};
use super::messages::MessageRecorder;
use super::values::{Value, distance, get, outputs, start, start_variables, unknown_reference};

/// Number of communication steps of a trial, unless the check is thorough.
const STEPS: u32 = 10;
/// Largest number of outputs, of inputs and of start values that a trial uses.
const VARIABLES: usize = 1000;
/// Largest relative difference of the outputs after a state is restored that is only a warning: a solver that restarts
/// causes such differences.
const ROUNDING: f64 = 1e-6;

/// Number of messages of all instances of a trial above which the trial gives a finding.
const FLOOD: u64 = 10_000;

/// A function that creates an instance with the given name. If a former instance is given, the function frees it and
/// uses the same process where possible.
pub(super) type MakeInstance<'a, S> = dyn FnMut(&str, Option<S>) -> anyhow::Result<S> + 'a;

/// The outputs at each communication point of a trial, including the start.
type Trajectory = Vec<Vec<Value>>;

/// Runs the FMU of `description` with instances created by `make`: the first two for ten steps or, if `thorough`, for
/// the time of its default experiment. Returns the result and the findings.
pub(super) fn check<S: Slave>(
    description: &ModelDescription,
    thorough: bool,
    make: &mut MakeInstance<'_, S>,
) -> (TrialResult, Vec<Finding>) {
    let result = TrialResult::No { reason: String::new() };
    let (changes, findings) = (BTreeSet::new(), Findings::about(Part::Behaviour));
    let mut trial = Trial { description, count: STEPS, make, result, changes, findings };
    if thorough {
        trial.count = trial.steps_of_experiment();
    }
    let ((), summary) = MessageRecorder::during(|| trial.run());
    trial.check_categories(&summary.categories);
    if summary.messages > FLOOD {
        let what = format!("sends {} messages in this trial, with logging off", summary.messages);
        let why = "They slow every run down and bury what others say.";
        trial.findings.add(Warning, "logger", what, why, "2.1.5");
    }
    (trial.result, trial.findings.all)
}

struct Trial<'a, S> {
    description: &'a ModelDescription,
    /// Number of steps that the first two instances make, to compare their outputs.
    count: u32,
    make: &'a mut MakeInstance<'a, S>,
    /// Result of the first instance.
    result: TrialResult,
    /// The process-wide settings that the FMU has changed, as texts of findings.
    changes: BTreeSet<String>,
    findings: Findings,
}

/// Whether the process of the FMU ended or can no longer be used.
fn gone(error: &CallError) -> bool {
    use Failure::{Exited, InvalidAnswer, Killed, TimedOut};
    matches!(error.failure, Killed(..) | Exited(_) | TimedOut(_) | InvalidAnswer(_))
}

const ENDS_IT: &str =
    "An importer that calls it in its own process ends with it, and loses its results.";

/// Describes the effect of the end of the process, or of a call that does not return, on an importer; `None` for other
/// failures.
fn harm(failure: &Failure) -> Option<&'static str> {
    match failure {
        Failure::Killed(..) | Failure::Exited(_) => Some(ENDS_IT),
        Failure::TimedOut(_) => Some("An importer waits for it, perhaps for ever."),
        _ => None,
    }
}

impl<S: Slave> Trial<'_, S> {
    fn run(&mut self) {
        let Some((first, slave)) = self.trajectory("first", None) else {
            return self.record_failure();
        };
        self.record_success(&first);
        if let Some((second, mut slave)) = self.trajectory("second", Some(slave)) {
            if second != first {
                self.report_difference(&first, &second);
            }
            if let Err(error) = slave.free() {
                self.report(&error, "after fmi2Terminate", "4.2.4");
            }
        }
        self.check_unknown_reference();
        self.set_inputs();
        self.step_past_stop_time();
        self.check_states();
    }

    /// Records the steps of the first instance; if there are fewer steps than planned, the last note is the reason.
    fn record_success(&mut self, trajectory: &Trajectory) {
        let steps = u32::try_from(trajectory.len().saturating_sub(1)).unwrap_or(u32::MAX);
        let is_step =
            |finding: &&Finding| finding.severity == Note && finding.place == "fmi2DoStep";
        let note = self.findings.all.iter().rfind(is_step);
        self.result = TrialResult::Yes {
            steps,
            step: self.step_size(),
            start: self.start_time(),
            tolerance: self.experiment().tolerance,
            but: note.filter(|_| steps < self.count).map(|finding| finding.what.clone()),
        };
    }

    /// Records that the first instance failed; the last error is the reason. If the FMU ended its process, this error
    /// stops importers that call the FMU in their own process.
    fn record_failure(&mut self) {
        let mut errors = self.findings.all.iter_mut().filter(|finding| finding.severity == Error);
        let Some(error) = errors.next_back() else { return };
        self.result = TrialResult::No { reason: format!("{}: {}", error.place, error.what) };
        if error.why.as_ref().is_some_and(|why| why.starts_with(ENDS_IT)) {
            error.stops.push(Tool::InProcess);
        }
    }

    /// Returns the names of the outputs that differ in two trajectories, three at most, as the end of a sentence.
    fn differing(&self, first: &Trajectory, second: &Trajectory) -> String {
        let differs =
            |at: usize| first.iter().zip(second).any(|(one, other)| one.get(at) != other.get(at));
        let names = outputs(self.description).enumerate().filter(|(at, _)| differs(*at));
        let names: Vec<&str> = names.map(|(_, output)| output.name.as_str()).collect();
        match names.len() {
            0 => String::new(),
            1..=3 => format!(": {}", names.join(", ")),
            count => format!(": {} and {} more", names[..3].join(", "), count - 3),
        }
    }

    /// Adds a finding for two trajectories that differ, with the first step at which the outputs differ.
    fn report_difference(&mut self, first: &Trajectory, second: &Trajectory) {
        let step = first.iter().zip(second).position(|(one, other)| one != other);
        // If all common steps are equal, one of the trajectories is shorter.
        let step = step.unwrap_or(first.len().min(second.len()));
        let outputs = self.differing(first, second);
        let what = format!("a second instance has other outputs, from step {step}{outputs}");
        let why = "A run cannot be repeated: statics, uninitialised memory or the clock are used.";
        self.findings.add(Warning, "fmi2DoStep", what, why, "2.1");
    }

    /// Creates an instance, in place of the `former` one, and initializes the new one. On failure adds a finding and
    /// returns `None`.
    fn initialize(&mut self, name: &str, stop_time: Option<f64>, former: Option<S>) -> Option<S> {
        let mut slave = match (self.make)(name, former) {
            Ok(slave) => slave,
            Err(error) => {
                self.report_refusal(&error);
                return None;
            }
        };
        let (start_time, tolerance) = (self.start_time(), self.experiment().tolerance);
        let experiment = Experiment { start_time, stop_time, tolerance };
        let done = slave
            .setup_experiment(&experiment)
            .and_then(|()| slave.enter_initialization_mode())
            .and_then(|()| slave.exit_initialization_mode());
        self.check_process(&mut slave, "up to the end of the initialization");
        match done {
            Ok(()) => Some(slave),
            Err(error) => {
                self.report(&error, "with the start values of the FMU itself", "4.2.4");
                None
            }
        }
    }

    /// Adds a finding for an instance that could not be created, or whose former instance could not be freed.
    fn report_refusal(&mut self, error: &anyhow::Error) {
        match error.downcast_ref::<CallError>() {
            // The functions that free the former instance and its states.
            Some(error) if error.function.contains("Free") => {
                self.report(error, "after fmi2Terminate", "4.2.4");
            }
            Some(error) => self.report(error, "when an instance is made", "2.1.5"),
            None => {
                let why = "Here it cannot be instantiated. It may need something that is missing \
                           here, such as a Python package or a licence.";
                let what = format!("{error:#}");
                let unresolved = what.contains("undefined symbol");
                self.findings.add(Error, "fmi2Instantiate", what, why, "2.1.5");
                if unresolved {
                    self.findings.stopping(&[Tool::Fmpy]);
                }
            }
        }
    }

    /// Adds a finding for a failed call, and a warning if the FMU sent no message about the failure.
    fn report(&mut self, error: &CallError, when: &str, section: &'static str) {
        let what = format!("{} {when}", error.failure);
        let messages = error.messages.join("; ");
        let why = match harm(&error.failure) {
            Some(harm) if messages.is_empty() => harm.to_owned(),
            Some(harm) => format!("{harm} Its last messages: {messages}"),
            None => messages,
        };
        self.findings.add(Error, error.function, what, &why, section);
        let is_silent = error.messages.is_empty() && self.explains_errors();
        if is_silent && matches!(error.failure, Failure::Status(_)) {
            let why = "Nobody learns what was wrong.";
            self.findings.add(Warning, error.function, "fails without a message", why, "2.1.3");
        }
    }

    /// Whether the FMU should explain its errors by messages although logging is off. In FMI 3.0 it should only if it
    /// has a category for errors, as the importer switches on the categories of statuses (FMI 3.0.2, section 2.3.1).
    fn explains_errors(&self) -> bool {
        let mut categories = self.description.log_categories.iter();
        self.description.version() != Version::V3
            || categories.any(|category| category.name == "logStatusError")
    }

    fn experiment(&self) -> DefaultExperiment {
        self.description.default_experiment.unwrap_or_default()
    }

    fn start_time(&self) -> f64 {
        self.experiment().start_time.unwrap_or(0.0)
    }

    fn step_size(&self) -> f64 {
        let experiment = self.experiment();
        let span = experiment.stop_time.map(|stop| (stop - self.start_time()) / 1000.0);
        experiment.step_size.or(span).filter(|size| *size > 0.0).unwrap_or(0.001)
    }

    /// Returns the time of communication point `k`.
    fn time(&self, k: u32) -> f64 {
        self.start_time() + f64::from(k) * self.step_size()
    }

    /// Runs the instance `name` from the start to `fmi2Terminate`; returns its outputs and the instance, `None` after a
    /// failure. A failure of `fmi2Terminate`, or of the reading after it, counts only if the process is then unusable.
    /// Also checks the start values and the outputs of the instance `first`.
    fn trajectory(&mut self, name: &str, former: Option<S>) -> Option<(Trajectory, S)> {
        let mut slave = self.initialize(name, None, former)?;
        if name == "first" {
            self.check_start_values(&mut slave)?;
        }
        let trajectory = self.steps(&mut slave, 0, self.count, true);
        self.check_process(&mut slave, "in its steps");
        let trajectory = trajectory?;
        if name == "first" {
            self.check_finite(&trajectory);
        }
        if let Err(error) = slave.terminate() {
            self.report(&error, "after the last step", "4.2.4");
            return (!gone(&error)).then_some((trajectory, slave));
        }
        match outputs(self.description).next().map(|output| get(&mut slave, output)) {
            Some(Err(error)) if gone(&error) => {
                self.report(&error, "after fmi2Terminate", "4.2.4");
                return None;
            }
            Some(Err(error)) if name == "first" => {
                let what = format!("{} after fmi2Terminate", error.failure);
                let why = "Final values cannot be read, as the table of calls allows.";
                self.findings.add(Warning, error.function, what, why, "4.2.4");
            }
            _ => {}
        }
        Some((trajectory, slave))
    }

    /// Returns the number of steps from the start to the stop time of the default experiment, at least 1; [`STEPS`]
    /// without a stop time.
    fn steps_of_experiment(&self) -> u32 {
        let stop = self.experiment().stop_time;
        let count = stop.map(|stop| ((stop - self.start_time()) / self.step_size()).round());
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "it saturates")]
        count.map_or(STEPS, |count| (count as u32).max(1))
    }

    /// Adds one finding for each process-wide setting that the FMU has changed.
    fn check_process(&mut self, slave: &mut S, when: &str) {
        for change in slave.process_changes().unwrap_or_default() {
            if self.changes.insert(change.clone()) {
                let why = "In the process of an importer it changes this for all others.";
                let what = format!("changes {change} {when}");
                self.findings.add(Warning, "process", what, why, "");
            }
        }
    }

    /// Returns the outputs now and after each of `count` steps from communication point `from`; `never_back` is whether
    /// no earlier state is restored afterwards. A partial step ends the steps with a note; after a failure, returns
    /// `None`.
    fn steps(
        &mut self,
        slave: &mut S,
        from: u32,
        count: u32,
        never_back: bool,
    ) -> Option<Trajectory> {
        let mut trajectory = vec![self.read_outputs(slave)?];
        for k in from..from + count {
            match slave.do_step(self.time(k), self.step_size(), never_back) {
                Ok(StepResult::Whole | StepResult::Event { .. }) => {
                    trajectory.push(self.read_outputs(slave)?);
                }
                Ok(StepResult::Part { reached, .. }) => {
                    let what = format!(
                        "a step of {} s is done to {} s only",
                        seconds(self.step_size()),
                        seconds(reached)
                    );
                    let why = "FMPy and others end the run there.";
                    self.findings.add(Note, "fmi2DoStep", what, why, "4.2.2");
                    break;
                }
                Err(error) => {
                    self.report(&error, &format!("at t = {} s", seconds(self.time(k))), "4.2.2");
                    return None;
                }
            }
        }
        Some(trajectory)
    }

    /// Reads the outputs; adds a finding if that fails.
    fn read_outputs(&mut self, slave: &mut S) -> Option<Vec<Value>> {
        let mut values = Vec::new();
        for variable in outputs(self.description).take(VARIABLES) {
            match get(slave, variable) {
                Ok(value) => values.push(value),
                Err(error) => {
                    self.report(&error, &format!("for the output {}", variable.name), "2.1.7");
                    return None;
                }
            }
        }
        Some(values)
    }

    /// Compares the start values with the description; `None` if the process of the FMU ended.
    fn check_start_values(&mut self, slave: &mut S) -> Option<()> {
        for variable in start_variables(self.description).take(VARIABLES) {
            let Some(stated) = start(variable) else { continue };
            let difference = match get(slave, variable) {
                Ok(value) if value.agrees(&stated) => continue,
                Err(error) if gone(&error) => {
                    self.report(&error, &format!("when {} is read", variable.name), "2.1.7");
                    return None;
                }
                Ok(value) => format!("the library starts with {value}, the XML says {stated}"),
                Err(error) => format!("{error}"),
            };
            let place = format!("variable {}", variable.name);
            let why =
                "Importers that do not set start values simulate another model than they show.";
            self.findings.add(Error, place, difference, why, "2.2.7");
        }
        Some(())
    }

    /// Adds a finding for each output with a value that is not finite, or that the importer cannot represent.
    fn check_finite(&mut self, trajectory: &Trajectory) {
        for (index, variable) in outputs(self.description).take(VARIABLES).enumerate() {
            let position = |is_such: fn(&Value) -> bool| {
                trajectory.iter().position(|row| row.get(index).is_some_and(is_such))
            };
            let place = format!("variable {}", variable.name);
            if let Some(step) = position(Value::is_beyond) {
                let what =
                    format!("is above 2^63 - 1 after {step} steps, which `run` cannot record");
                self.findings.add(Note, place, what, "", "");
            } else if let Some(step) = position(|value| !value.is_finite()) {
                let what = format!("is no finite number after {step} steps");
                let why = "Most masters carry it on to the end of the run.";
                self.findings.add(Warning, place, what, why, "2.2.7");
            }
        }
    }

    /// Checks that the FMU refuses an unknown value reference. Skips FMI 3.0, where our importer refuses the reference
    /// before the call.
    fn check_unknown_reference(&mut self) {
        if self.description.version() == Version::V3 {
            return;
        }
        let Some(mut slave) = self.initialize("unknown", None, None) else { return };
        match slave.get_real(&[unknown_reference(self.description)], &mut [0.0]) {
            Ok(()) => {
                let what = "accepts a value reference that no variable has, expected fmi2Error";
                let why = "A wrong connection goes unnoticed.";
                self.findings.add(Error, "fmi2GetReal", what, why, "2.1.2");
            }
            Err(error) if gone(&error) => {
                self.report(&error, "for a value reference that no variable has", "2.1.2");
            }
            Err(error) if error.messages.is_empty() => {
                let what = "refuses an unknown value reference without a message";
                let why = "Nobody learns what was wrong.";
                self.findings.add(Warning, "fmi2GetReal", what, why, "2.1.3");
            }
            Err(_) => {}
        }
    }

    /// Sets real inputs to their present values. An FMU may refuse to set them, but must not end or block the process.
    fn set_inputs(&mut self) {
        let inputs = |variable: &&ScalarVariable| variable.causality == Causality::Input;
        let is_real = |variable: &&ScalarVariable| ValueType::of(&variable.kind) == ValueType::Real;
        let inputs = self.description.variables.iter().filter(inputs).filter(is_real);
        let references: Vec<u32> =
            inputs.take(VARIABLES).map(|variable| variable.value_reference).collect();
        if references.is_empty() {
            return;
        }
        let Some(mut slave) = self.initialize("inputs", None, None) else { return };
        let mut values = vec![0.0; references.len()];
        let read = slave.get_real(&references, &mut values);
        let done = read.and_then(|()| slave.set_real(&references, &values));
        if let Err(error) = done
            && gone(&error)
        {
            self.report(&error, "for inputs at their present values", "2.1.7");
        }
    }

    /// Checks that a step beyond a defined stop time is an error.
    fn step_past_stop_time(&mut self) {
        let (start, size) = (self.start_time(), self.step_size());
        let Some(mut slave) = self.initialize("end", Some(start + 0.5 * size), None) else {
            return;
        };
        match slave.do_step(start, size, true) {
            Ok(StepResult::Whole) => {
                let what = "steps past a stopTime that was defined, expected fmi2Error";
                let why = "What an FMU computes beyond the end of its data goes unnoticed.";
                self.findings.add(Warning, "fmi2DoStep", what, why, "2.1.6");
            }
            Err(error) if gone(&error) => {
                self.report(&error, "for a step past a stopTime that was defined", "2.1.6");
            }
            _ => {}
        }
    }

    /// Checks that an FMU that can save states repeats its outputs after a state is restored, directly or from bytes.
    fn check_states(&mut self) {
        let Some(flags) = &self.description.co_simulation else { return };
        if !flags.can_get_and_set_fmu_state {
            return;
        }
        let serialize = flags.can_serialize_fmu_state;
        let Some(mut slave) = self.initialize("states", None, None) else { return };
        let before = self.steps(&mut slave, 0, STEPS, false);
        if before.is_none_or(|trajectory| trajectory.len() <= STEPS as usize) {
            return;
        }
        if let Err(error) = slave.save_state(0) {
            return self.report(&error, "though canGetAndSetFMUstate is true", "2.1.8");
        }
        let bytes = match serialize.then(|| slave.serialize_state()).transpose() {
            Ok(bytes) => bytes,
            Err(error) => {
                return self.report(&error, "though canSerializeFMUstate is true", "2.1.8");
            }
        };
        let Some(first) = self.steps(&mut slave, STEPS, STEPS, false) else { return };
        if let Err(error) = slave.restore_state(0) {
            return self.report(&error, "for a state of the same instance", "2.1.8");
        }
        let is_usable = self.repeat_steps(&mut slave, &first, "fmi2SetFMUstate");
        if let Some(bytes) = bytes.filter(|_| is_usable) {
            if let Err(error) = slave.deserialize_state(&bytes) {
                return self.report(&error, "for bytes of the same instance", "2.1.8");
            }
            self.repeat_steps(&mut slave, &first, "fmi2DeSerializeFMUstate");
        }
    }

    /// Repeats the steps after the saved state and compares the outputs with the `first` ones; returns false if a step
    /// failed.
    fn repeat_steps(&mut self, slave: &mut S, first: &Trajectory, function: &str) -> bool {
        let second = self.steps(slave, STEPS, STEPS, false);
        let gap = second.as_ref().map_or(0.0, |second| distance(first, second));
        if gap > 0.0 {
            let outputs = second.as_ref().map(|second| self.differing(first, second));
            let outputs = outputs.unwrap_or_default();
            let what = format!(
                "the outputs after the state was restored differ from those before, by {gap:.1e} \
                 of their size{outputs}"
            );
            let severity = if gap > ROUNDING { Error } else { Warning };
            let why = "Masters that repeat a step, and optimisers, get wrong results.";
            self.findings.add(severity, function, what, why, "2.1.8");
        }
        second.is_some()
    }

    /// Adds a finding for each category of messages that the description does not list.
    fn check_categories(&mut self, used: &BTreeSet<String>) {
        // Descriptions of FMI 1.0 do not list categories.
        if self.description.version() == Version::V1 {
            return;
        }
        for category in used.iter().filter(|category| !category.is_empty()) {
            let declared =
                self.description.log_categories.iter().any(|known| known.name == *category);
            if !declared {
                let what =
                    format!("uses the category {category:?}, which LogCategories does not list");
                let why = "Users cannot switch it on or off.";
                self.findings.add(Error, "logger", what, why, "2.2.4");
            }
        }
    }
}
