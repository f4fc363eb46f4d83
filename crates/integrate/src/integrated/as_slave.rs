//! [`Integrated`] as a [`Slave`].

use fmu_description::{Experiment, ModelDescription};
use slave::{CallError, CallSink, Events, Slave, StepResult};

use super::step::rounding;
use super::{Integrated, Mode, TOLERANCE, failed};

/// Largest accepted difference between the start of a step and the end of the last one, relative to the step. A
/// larger difference is accepted if it is rounding: an event may be later than the end of a step by rounding.
const GAP: f64 = 1e-6;

impl Integrated {
    /// Whether a variable that is no continuous input would get a new value; true if the present one is unknown.
    fn changes_discrete(&mut self, references: &[u32], values: &[f64]) -> bool {
        self.reals.resize(references.len(), 0.0);
        if self.instance.get_real(references, &mut self.reals).is_err() {
            return true;
        }
        let mut all = references.iter().zip(values).zip(&self.reals);
        all.any(|((&reference, value), known)| {
            value.to_bits() != known.to_bits() && !self.inputs.contain(&[reference])
        })
    }

    /// Sets the continuous inputs among `references`.
    fn set_continuous(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError> {
        for (&reference, &value) in references.iter().zip(values) {
            if self.inputs.contain(&[reference]) {
                self.inputs.record(self.point.time, &[reference], &[value]);
                self.instance.set_real(&[reference], &[value])?;
                self.point.input_changed = true;
            }
        }
        Ok(())
    }
}

/// Defines functions that call the function of the same name of the instance.
macro_rules! forward {
    ($($name:ident($($argument:ident: $kind:ty),*);)*) => {
        $(fn $name(&mut self, $($argument: $kind),*) -> Result<(), CallError> {
            self.instance.$name($($argument),*)
        })*
    };
}

impl Slave for Integrated {
    fn description(&self) -> &ModelDescription {
        &self.description
    }

    forward! {
        set_debug_logging(on: bool);
        enter_initialization_mode();
        terminate();
        free();
        get_real(references: &[u32], values: &mut [f64]);
        get_integer(references: &[u32], values: &mut [i64]);
        get_boolean(references: &[u32], values: &mut [i32]);
        get_string(references: &[u32], values: &mut [String]);
        get_binary(references: &[u32], values: &mut [Vec<u8>]);
        directional_derivative(unknowns: &[u32], knowns: &[u32], seed: &[f64], changes: &mut [f64]);
    }

    fn configure(&mut self, references: &[u32], values: &[i64]) -> Result<(), CallError> {
        self.instance.configure(references, values)?;
        self.describe();
        Ok(())
    }

    fn setup_experiment(&mut self, experiment: &Experiment) -> Result<(), CallError> {
        self.point.time = experiment.start_time;
        let usable = |tolerance: &f64| *tolerance > 0.0 && tolerance.is_finite();
        self.tolerance = experiment.tolerance.filter(usable).unwrap_or(TOLERANCE);
        self.instance.setup_experiment(experiment)
    }

    /// Also enters continuous-time mode after the first event, unless the master handles the events.
    fn exit_initialization_mode(&mut self) -> Result<(), CallError> {
        self.instance.exit_initialization_mode()?;
        self.point.mode = Mode::Event;
        self.allocate()?;
        self.inputs.read(self.instance.as_mut(), self.point.time)?;
        if self.hands_over { Ok(()) } else { self.settle() }
    }

    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError> {
        if self.point.mode == Mode::Setup {
            return self.instance.set_real(references, values);
        }
        if self.point.mode == Mode::Continuous && !self.inputs.contain(references) {
            if !self.changes_discrete(references, values) {
                return self.set_continuous(references, values);
            }
            self.enter_event()?;
        }
        self.inputs.record(self.point.time, references, values);
        self.point.input_changed = true;
        self.instance.set_real(references, values)
    }

    fn set_integer(&mut self, references: &[u32], values: &[i64]) -> Result<(), CallError> {
        if self.point.mode != Mode::Setup {
            self.integers.resize(references.len(), 0);
            let known = self.instance.get_integer(references, &mut self.integers);
            if known.is_ok() && self.integers == values {
                return Ok(());
            }
            self.enter_event()?;
        }
        self.instance.set_integer(references, values)
    }

    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        if self.point.mode != Mode::Setup {
            self.booleans.resize(references.len(), 0);
            let known = self.instance.get_boolean(references, &mut self.booleans).is_ok();
            let mut all = references.iter().zip(values).zip(&self.booleans);
            let changes = all.any(|((reference, value), known)| {
                // A clock that has ticked may tick again.
                let before = *known != 0 && !self.clocks.contains(reference);
                (*value != 0) != before
            });
            if known && !changes {
                return Ok(());
            }
            self.enter_event()?;
        }
        self.instance.set_boolean(references, values)
    }

    fn set_string(&mut self, references: &[u32], values: &[String]) -> Result<(), CallError> {
        if self.point.mode != Mode::Setup {
            let mut known = vec![String::new(); references.len()];
            if self.instance.get_string(references, &mut known).is_ok() && known == values {
                return Ok(());
            }
            self.enter_event()?;
        }
        self.instance.set_string(references, values)
    }

    fn set_binary(&mut self, references: &[u32], values: &[Vec<u8>]) -> Result<(), CallError> {
        if self.point.mode != Mode::Setup {
            let mut known = vec![Vec::new(); references.len()];
            if self.instance.get_binary(references, &mut known).is_ok() && known == values {
                return Ok(());
            }
            self.enter_event()?;
        }
        self.instance.set_binary(references, values)
    }

    fn set_input_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), CallError> {
        self.inputs.derive(self.point.time, references, orders, values)
    }

    fn do_step(&mut self, time: f64, size: f64, never_back: bool) -> Result<StepResult, CallError> {
        let last = self.point.time;
        let gap = (GAP * size).max(2.0 * rounding(last, size));
        if !(size >= 0.0 && (time - last).abs() <= gap) {
            return Err(failed(format!(
                "cannot step from {time} s over {size} s: the last step ended at {last} s"
            )));
        }
        self.instance.begin_communication_step();
        self.integrate(time + size, never_back)
    }

    fn save_state(&mut self, slot: usize) -> Result<(), CallError> {
        self.instance.save_state(slot)?;
        self.save_integration(slot);
        Ok(())
    }

    fn restore_state(&mut self, slot: usize) -> Result<(), CallError> {
        self.instance.restore_state(slot)?;
        self.restore_integration(slot);
        Ok(())
    }

    fn serialize_state(&mut self) -> Result<Vec<u8>, CallError> {
        self.serialize()
    }

    fn deserialize_state(&mut self, bytes: &[u8]) -> Result<(), CallError> {
        self.deserialize(bytes)
    }

    fn hand_over_events(&mut self, stop: bool) -> Result<bool, CallError> {
        self.instance.hand_over_events(stop)?;
        (self.hands_over, self.stops) = (true, stop);
        Ok(true)
    }

    fn events(&mut self) -> Option<&mut dyn Events> {
        Some(self)
    }

    fn log_calls(&mut self, sink: CallSink) -> bool {
        self.instance.log_calls(sink)
    }

    fn take_warning(&mut self) -> bool {
        self.instance.take_warning()
    }
}
