//! Settings: values of variables that the user states before the run. The FMUs receive them during
//! initialisation.

use std::collections::HashSet;
use std::collections::hash_map::Entry;

use fmu_description::{Causality, Initial, Kind};

use super::{Port, System};
use crate::error::SystemError;
use slave::{CallError, Value};

/// A value for a variable.
#[derive(Clone, Debug)]
pub(crate) struct Setting {
    pub(crate) port: Port,
    /// The value in the variable's type.
    pub(crate) value: Value,
    /// The value as the user wrote it.
    text: String,
}

impl System {
    /// As [`System::set`], for the variable at `port`.
    ///
    /// # Errors
    ///
    /// Returns an error if `text` is not a value of the variable's type, if the standard allows nobody to
    /// set the variable, or if a structural parameter is neither an integer nor a Boolean or the FMU refuses
    /// its value.
    pub fn set_port(&mut self, port: Port, text: &str) -> Result<(), SystemError> {
        let value = self.value(port, text)?;
        self.set_port_value(port, value, text)
    }

    /// As [`System::set_port`], with the value that `text` states, for a caller that parses numbers itself.
    ///
    /// # Errors
    ///
    /// Returns an error if the standard allows nobody to set the variable, or if a structural parameter is
    /// neither an integer nor a Boolean or the FMU refuses its value.
    pub fn set_port_value(
        &mut self,
        port: Port,
        value: Value,
        text: &str,
    ) -> Result<(), SystemError> {
        if let Some(what) = self.variable(port).never_set() {
            let (name, value) = (self.name(port), text.to_owned());
            return Err(SystemError::NotSettable { name, value, what });
        }
        if self.variable(port).causality == Causality::StructuralParameter {
            return self.configure(port, &value, text);
        }
        let value = value.held_by(&self.variable(port).kind);
        let setting = Setting { port, value, text: text.to_owned() };
        match self.setting_positions.entry(self.holder(port)) {
            Entry::Occupied(known) => self.settings[*known.get()] = setting,
            Entry::Vacant(position) => {
                position.insert(self.settings.len());
                self.settings.push(setting);
            }
        }
        Ok(())
    }

    /// Returns the value that the user has set for the variable at `port` or for an alias of it, if any.
    pub(crate) fn setting(&self, port: Port) -> Option<&Value> {
        let position = self.setting_positions.get(&self.holder(port))?;
        Some(&self.settings[*position].value)
    }

    /// Sets all settings; call it after `fmi2SetupExperiment`.
    pub(crate) fn apply_settings(&mut self) -> Result<(), SystemError> {
        for setting in self.settings.clone() {
            self.set_value(setting.port, &setting.value).map_err(|source| {
                let (name, value) = (self.name(setting.port), setting.text);
                SystemError::Setting { name, value, source }
            })?;
        }
        Ok(())
    }

    /// Repeats settings in initialization mode, where the standard allows it (FMI 2.0.5, table 4.2.4), because some
    /// FMUs reset them when they enter this mode. Sets inputs always, because some FMUs cannot read them, other
    /// variables if they have another value. Returns an error, with `time` in s, if an FMU cannot be used any more.
    pub(crate) fn repeat_settings(&mut self, time: f64) -> Result<(), SystemError> {
        for setting in self.settings.clone() {
            let variable = self.variable(setting.port);
            let exact = variable.initial_in_force() == Some(Initial::Exact);
            let repeated = if variable.causality == Causality::Input {
                self.set_value(setting.port, &setting.value)
            } else {
                match self.get_value(setting.port) {
                    Ok(value) if exact && value != setting.value => {
                        self.set_value(setting.port, &setting.value)
                    }
                    read => read.map(|_| ()),
                }
            };
            if let Err(error) = repeated {
                self.go_on_after(setting.port, time, error)?;
            }
        }
        Ok(())
    }

    /// Returns an error if the FMU cannot be used any more after `error` of a call for a variable (FMI 2.0.5,
    /// section 2.1.3).
    fn go_on_after(&self, port: Port, time: f64, error: CallError) -> Result<(), SystemError> {
        let name: Box<str> = self.name(port).into();
        if error.ends_the_instance() {
            let slave = self.slaves[port.slave].0.as_str().into();
            return Err(SystemError::Variable { slave, name, time, source: error });
        }
        tracing::debug!("{name}: {error}");
        Ok(())
    }

    /// Reads the settings back after the initialization, except inputs and the variables whose holders are in
    /// `replaced`, which have received another value. Returns an error if a parameter differs from the value set or,
    /// with `time` in s, if an FMU cannot be used any more.
    pub(crate) fn confirm_settings(
        &mut self,
        replaced: &HashSet<Port>,
        time: f64,
    ) -> Result<(), SystemError> {
        for setting in self.settings.clone() {
            let causality = self.variable(setting.port).causality;
            if causality == Causality::Input || replaced.contains(&self.holder(setting.port)) {
                continue;
            }
            let name = self.name(setting.port);
            let value = match self.get_value(setting.port) {
                Ok(value) => value,
                Err(error) => {
                    tracing::warn!(
                        "{name}: cannot be read, so it is not known whether {:?} is kept: {error}",
                        setting.text
                    );
                    self.go_on_after(setting.port, time, error)?;
                    continue;
                }
            };
            if setting.value.is_near(&value) {
                continue;
            }
            let (value, actual) = (setting.text, value.to_string());
            let error = SystemError::LostSetting { name, value, actual };
            if causality == Causality::Parameter {
                return Err(error);
            }
            // Outputs and local variables may change at the end of the initialization.
            tracing::warn!("{error}");
        }
        Ok(())
    }

    /// Returns the value that was set last for an input without a connection, otherwise its start value; `None` for a
    /// connected input, another variable or a text. The FMU is not asked, because some FMUs cannot read their inputs.
    pub(crate) fn known_input(&self, port: Port) -> Option<Value> {
        let port = self.holder(port);
        let variable = self.variable(port);
        let free = variable.causality == Causality::Input
            && variable.clocks.is_empty()
            && !matches!(variable.kind, Kind::Clock(_))
            && self.source(port).is_none();
        if !free {
            return None;
        }
        let set = self.input_values.get(&port).or_else(|| self.setting(port)).cloned();
        match set.or_else(|| Value::start(&variable.kind))? {
            Value::String(_) | Value::Binary(_) => None,
            number => Some(number.held_by(&variable.kind)),
        }
    }
}
