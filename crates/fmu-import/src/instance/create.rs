//! Creates instances of FMUs.

use std::path::Path;

use fmu_description::location::file_uri;
use slave::ModelExchange;

use super::{Inner, Instance};
use crate::fmu::{AnyLibrary, Fmu, FmuError, interface_of_3, with_tool_hint};
use crate::library::Interface;
use crate::{v1, v2, v3};

impl Fmu {
    /// Creates an instance called `name` for co-simulation or, if the FMU does not offer co-simulation, for scheduled
    /// execution.
    ///
    /// # Errors
    ///
    /// [`FmuError::NoInterface`] if the FMU offers neither; [`FmuError::OnlyOnce`] for a forbidden second instance;
    /// [`Instantiate`](crate::LoadError::Instantiate) with the FMU's messages if the FMU does not instantiate, in
    /// [`FmuError::NeedsTool`] if the FMU declares to need a tool; [`FmuError::Location`] if the path of the unpacked
    /// FMU cannot be written as a URI (FMI 1.0 and 2.0).
    pub fn instantiate(&self, name: &str) -> Result<Instance, FmuError> {
        let flags = self.description().stepped();
        let once = flags.is_some_and(|flags| flags.can_be_instantiated_only_once_per_process);
        self.create(Interface::CoSimulation, once, name)
    }

    /// Creates a model-exchange instance called `name`.
    ///
    /// # Errors
    ///
    /// Same as [`Fmu::instantiate`], with [`FmuError::NoInterface`] for an FMU without model exchange; and
    /// [`FmuError::Package`] without a library for this platform, [`FmuError::Load`] if the library does not load.
    pub fn instantiate_equations(&self, name: &str) -> Result<Box<dyn ModelExchange>, FmuError> {
        let flags = self.description().model_exchange.as_ref();
        let once = flags.is_some_and(|flags| flags.can_be_instantiated_only_once_per_process);
        Ok(Box::new(self.create(Interface::ModelExchange, once, name)?))
    }

    /// Creates an instance with the C interface of the FMU's version; `once`: the FMU allows one instance only.
    fn create(&self, interface: Interface, once: bool, name: &str) -> Result<Instance, FmuError> {
        let only = once.then(|| self.occupy(name)).transpose()?;
        let (unpacked, description) = (&self.content.unpacked, self.description());
        let hint = |error| with_tool_hint(description, error);
        let (guid, names) = (&description.guid, self.names());
        let inner = match self.library(interface)? {
            AnyLibrary::V1(library) => {
                let location = file_uri(unpacked.folder())?;
                let component = library.instantiate(interface, name, guid, &location, names);
                let component = component.map_err(hint)?;
                Inner::V1(Box::new(v1::Instance::new(component, description, interface)))
            }
            AnyLibrary::V2(library) => {
                let resources = file_uri(&unpacked.resources())?;
                let component = library.instantiate(interface, name, guid, &resources, names);
                Inner::V2(v2::Instance::new(component.map_err(hint)?))
            }
            AnyLibrary::V3(library) => {
                let resources = resource_path(&unpacked.resources());
                let (interface, resources) =
                    (interface_of_3(description, interface), resources.as_deref());
                let instance = v3::Instance::new(&library, description, interface, name, resources);
                Inner::V3(Box::new(instance.map_err(hint)?))
            }
        };
        Ok(Instance { inner, _only: only, fmu: self.clone() })
    }
}

/// Returns the `resourcePath` of FMI 3.0: absolute, with a trailing separator (section 2.3.1); `None` if
/// the FMU has no resources.
fn resource_path(folder: &Path) -> Option<String> {
    let folder = std::path::absolute(folder).ok().filter(|folder| folder.is_dir())?;
    Some(format!("{}{}", folder.display(), std::path::MAIN_SEPARATOR))
}

#[cfg(test)]
mod tests {
    use fmu_description::package::{Package, TemporaryFolder};
    use fmu_description::{ModelDescription, Version};

    use super::*;
    use crate::LoadError;

    #[test]
    fn an_fmu_that_offers_model_exchange_only_lacks_the_interface() {
        let folder = TemporaryFolder::new().unwrap();
        let description = r#"<fmiModelDescription fmiVersion="3.0"
 modelName="M" instantiationToken="t">
<ModelExchange modelIdentifier="M"/>
<ModelVariables><Float64 name="time" valueReference="0" causality="independent"/></ModelVariables>
<ModelStructure/></fmiModelDescription>"#;
        let mut package = Package::new(description.to_owned()).for_version(Version::V3);
        package.add("binaries/x86_64-linux/M.so", "");
        let file = folder.path().join("M.fmu");
        package.write(&file).unwrap();
        let error = Fmu::open_quietly(&file).unwrap().instantiate("m").err().unwrap();
        assert!(matches!(error, FmuError::NoInterface { .. }), "{error}");
        let expected = "M.fmu: the FMU lacks an interface, expected the element CoSimulation or ScheduledExecution";
        assert_eq!(error.to_string(), expected);
    }

    /// The flag is an attribute of `ScheduledExecution`, too (FMI 3.0.2, section 5.4).
    #[test]
    fn an_error_of_scheduled_execution_names_the_tool_that_it_needs() {
        for (flag, expected) in [("true", Some("Bench 4")), ("false", None)] {
            let description = ModelDescription::parse(format!(
                r#"<fmiModelDescription fmiVersion="3.0"
 modelName="M" instantiationToken="t" generationTool="Bench 4">
<ScheduledExecution modelIdentifier="M" needsExecutionTool="{flag}"/>
<ModelVariables><Float64 name="time" valueReference="0" causality="independent"/></ModelVariables>
<ModelStructure/></fmiModelDescription>"#
            ));
            let (model, reason) = ("M".to_owned(), "no reason".to_owned());
            let error = LoadError::Unsupported { model, reason };
            let actual = match with_tool_hint(&description.unwrap(), error) {
                FmuError::NeedsTool { tool, .. } => Some(tool),
                _ => None,
            };
            assert_eq!(actual.as_deref(), expected);
        }
    }
}
