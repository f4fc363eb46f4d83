//! Values that the user sets before the run: kept here, handed to the FMUs when they are initialised.

use fmu_description::{Causality, Initial, Variability};

use super::{Port, System};
use crate::error::SystemError;
use slave::Value;

/// A value for a variable.
#[derive(Clone, Debug)]
pub(crate) struct Setting {
    pub(crate) port: Port,
    pub(crate) value: Value,
    /// The value as the user wrote it.
    text: String,
}

impl System {
    /// Sets the variable called `name` to the value that `text` spells. The FMU gets it when the
    /// simulation is initialised; a later setting of the same variable replaces it.
    ///
    /// # Errors
    ///
    /// Where the variable does not exist or the text is no value of its type.
    pub fn set(&mut self, name: &str, text: &str) -> Result<(), SystemError> {
        let port = self.port(name)?;
        self.set_port(port, text)
    }

    /// As [`System::set`], the variable by its place.
    ///
    /// # Errors
    ///
    /// Where the text is no value of the variable's type.
    pub fn set_port(&mut self, port: Port, text: &str) -> Result<(), SystemError> {
        let setting = Setting { port, value: self.value(port, text)?, text: text.to_owned() };
        match self.settings.iter_mut().find(|known| known.port == port) {
            Some(known) => *known = setting,
            None => self.settings.push(setting),
        }
        Ok(())
    }

    /// After `fmi2SetupExperiment`: gives every FMU its settings.
    pub(crate) fn apply_settings(&mut self) -> Result<(), SystemError> {
        for setting in self.settings.clone() {
            self.set_value(setting.port, &setting.value).map_err(|source| {
                let (name, value) = (self.name(setting.port), setting.text);
                SystemError::Setting { name, value, source }
            })?;
        }
        Ok(())
    }

    /// In initialization mode: gives the settings again that the standard allows there (FMI 2.0.5,
    /// table 4.2.4), as some FMUs reset them on the way. What an FMU refuses here it has got
    /// before; [`System::confirm_settings`] finds what is lost.
    pub(crate) fn repeat_settings(&mut self) {
        for setting in self.settings.clone() {
            let variable = self.variable(setting.port);
            let settable = variable.causality == Causality::Input
                || variable.variability != Variability::Constant
                    && variable.initial_in_force() == Some(Initial::Exact);
            if settable && let Err(error) = self.set_value(setting.port, &setting.value) {
                tracing::debug!("{}: {error}", self.name(setting.port));
            }
        }
    }

    /// After the initialization: reads the settings back, but for those of variables in `replaced`,
    /// which have got another value since.
    ///
    /// # Errors
    ///
    /// Where a parameter or an input does not have its value.
    pub(crate) fn confirm_settings(&mut self, replaced: &[Port]) -> Result<(), SystemError> {
        for setting in self.settings.clone() {
            if replaced.contains(&setting.port) {
                continue;
            }
            let name = self.name(setting.port);
            let found = match self.get_value(setting.port) {
                Ok(found) => found,
                Err(error) => {
                    tracing::warn!(
                        "{name}: cannot be read, so it is not known whether {:?} is kept: {error}",
                        setting.text
                    );
                    continue;
                }
            };
            if setting.value.is_near(&found) {
                continue;
            }
            let (value, found) = (setting.text, found.to_string());
            let error = SystemError::LostSetting { name, value, found };
            let causality = self.variable(setting.port).causality;
            if matches!(causality, Causality::Parameter | Causality::Input) {
                return Err(error);
            }
            // Outputs and local variables may change while the initialization ends.
            tracing::warn!("{error}");
        }
        Ok(())
    }

    /// After the initialization: names parameters and inputs, apart from those set and `replaced`,
    /// that do not have the start value of the description.
    pub(crate) fn confirm_start_values(&mut self, replaced: &[Port]) {
        let set: Vec<Port> = self.settings.iter().map(|setting| setting.port).collect();
        for slave in 0..self.slaves.len() {
            let ports = (0..self.slaves[slave].1.description().variables.len())
                .map(|variable| Port { slave, variable })
                .filter(|port| !set.contains(port) && !replaced.contains(port));
            let mut lost = Vec::new();
            for port in ports.collect::<Vec<_>>() {
                let Some(start) = self.start_value(port) else { continue };
                if let Ok(found) = self.get_value(port)
                    && !start.is_near(&found)
                {
                    lost.push(format!("{} is {found}, not {start}", self.variable(port).name));
                }
            }
            if let Some(first) = lost.first() {
                tracing::warn!(
                    "{}: {} of its start values are not those of the model description, for \
                     example {first}",
                    self.slaves[slave].0,
                    lost.len()
                );
            }
        }
    }

    /// The start value of a parameter or an input that is a number or a Boolean.
    fn start_value(&self, port: Port) -> Option<Value> {
        let variable = self.variable(port);
        let causality = variable.causality;
        if !matches!(causality, Causality::Parameter | Causality::Input) {
            return None;
        }
        Value::start(&variable.kind)
    }
}
