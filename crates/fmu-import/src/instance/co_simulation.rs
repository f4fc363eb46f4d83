//! Instances for co-simulation and scheduled execution.

use fmu_description::Version;
use fmu_description::location::file_uri;

use super::{Inner, Instance};
use crate::fmu::{CoSimulation, Fmu, FmuError, resource_path, stepped, with_tool_hint};
use crate::library::Interface;

impl Fmu {
    /// Creates an instance called `name` for co-simulation or, if the FMU does not offer it, for scheduled
    /// execution.
    ///
    /// # Errors
    ///
    /// [`FmuError::NoInterface`] if the FMU offers neither; [`FmuError::OnlyOnce`] for a forbidden second instance;
    /// [`Instantiate`](crate::LoadError::Instantiate) with the FMU's messages if the FMU does not instantiate, in
    /// [`FmuError::NeedsTool`] if it declares to need a tool.
    pub fn instantiate(&self, name: &str) -> Result<Instance, FmuError> {
        let flags = self.description().stepped();
        let once = flags.is_some_and(|flags| flags.can_be_instantiated_only_once_per_process);
        let only = once.then(|| self.occupy(name)).transpose()?;
        let inner = self.instantiate_version(name)?;
        Ok(Instance::new(inner, only, self.clone()))
    }

    /// Creates an instance with the C interface of the FMU's version.
    fn instantiate_version(&self, name: &str) -> Result<Inner, FmuError> {
        let (unpacked, description) = (&self.content.unpacked, self.description());
        let hint = |error| with_tool_hint(description, error);
        match &self.content.library {
            Some(CoSimulation::V1(library)) => {
                let location = file_uri(unpacked.folder())?;
                let (guid, names) = (&description.guid, self.names());
                let interface = Interface::CoSimulation;
                let component = library.instantiate(interface, name, guid, &location, names);
                let component = component.map_err(hint)?;
                Ok(Inner::V1(Box::new(crate::v1::Instance::new(component, description, interface))))
            }
            Some(CoSimulation::V3(library)) => {
                let resources = resource_path(&unpacked.resources());
                let (interface, resources) = (stepped(description), resources.as_deref());
                let created =
                    crate::v3::Instance::new(library, description, interface, name, resources);
                Ok(Inner::V3(Box::new(created.map_err(hint)?)))
            }
            Some(CoSimulation::V2(_)) => {
                let component = self.component(Interface::CoSimulation, name)?;
                Ok(Inner::V2(crate::v2::Instance::new(component)))
            }
            None if description.version() == Version::V3 => {
                Err(self.no_interface("CoSimulation or ScheduledExecution"))
            }
            None => Err(self.no_interface("CoSimulation")),
        }
    }
}

#[cfg(test)]
mod tests {
    use fmu_description::package::{Package, TemporaryFolder};

    use super::*;

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
}
