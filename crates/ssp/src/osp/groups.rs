//! Variable groups, which `NAME_OspModelDescription.xml` states for the FMU with that model name.

use fmu_description::xml::{self, Element};

use super::document::{attribute, local};
use crate::error::SspError;

/// Variables and groups that are connected together.
#[derive(Debug)]
pub(super) struct Group {
    name: String,
    pub(super) variables: Vec<String>,
    pub(super) groups: Vec<Group>,
}

/// The groups of a model description.
pub(super) fn read(bytes: &[u8]) -> Result<(Vec<Group>, Vec<String>), SspError> {
    let root = xml::read(bytes)?;
    let lists = root.children.iter().filter(|child| local(child) == "VariableGroups");
    Ok((lists.flat_map(|list| &list.children).map(group).collect(), Vec::new()))
}

/// Whatever an element is called, it is a group: of a force, a velocity, a port.
fn group(element: &Element) -> Group {
    let (variables, groups): (Vec<&Element>, Vec<&Element>) =
        element.children.iter().partition(|child| local(child) == "Variable");
    let reference = |variable: &&Element| attribute(variable, "ref").map(str::to_owned);
    Group {
        name: attribute(element, "name").unwrap_or_default().to_owned(),
        variables: variables.iter().filter_map(reference).collect(),
        groups: groups.into_iter().map(group).collect(),
    }
}

/// The group of that name: those of the model first, then those within them.
pub(super) fn find<'a>(groups: &'a [Group], name: &str) -> Option<&'a Group> {
    let own = groups.iter().find(|group| group.name == name);
    own.or_else(|| groups.iter().find_map(|group| find(&group.groups, name)))
}

impl Group {
    /// The variables of two groups in pairs: their own, then those of the groups within them, in
    /// their order. A sentence where the groups have different shapes.
    pub(super) fn pairs<'a>(&'a self, other: &'a Group) -> Result<Vec<[&'a str; 2]>, String> {
        let sizes = [
            (self.variables.len(), other.variables.len(), "variables"),
            (self.groups.len(), other.groups.len(), "groups"),
        ];
        if let Some((here, there, what)) = sizes.into_iter().find(|(here, there, _)| here != there)
        {
            return Err(format!(
                "the group {:?} has {here} {what} and {:?} has {there}, expected as many",
                self.name, other.name
            ));
        }
        let own = self.variables.iter().zip(&other.variables);
        let mut pairs: Vec<_> = own.map(|(here, there)| [here.as_str(), there.as_str()]).collect();
        for (here, there) in self.groups.iter().zip(&other.groups) {
            pairs.extend(here.pairs(there)?);
        }
        Ok(pairs)
    }
}
