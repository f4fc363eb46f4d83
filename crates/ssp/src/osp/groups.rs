//! Reads variable groups from `NAME_OspModelDescription.xml`, where NAME is the model name of the
//! FMU.

use fmu_description::xml;

use crate::error::SspError;
use crate::xml::Node;

/// A named group of variables and nested groups.
#[derive(Debug)]
pub(super) struct Group {
    name: String,
    pub(super) variables: Vec<String>,
    pub(super) groups: Vec<Group>,
}

/// Reads the groups of a model description.
pub(super) fn read(bytes: &[u8]) -> Result<(Vec<Group>, Vec<String>), SspError> {
    let root = Node::from(xml::read(bytes)?);
    let lists = root.any_children("VariableGroups");
    Ok((lists.flat_map(|list| &list.children).map(group).collect(), Vec::new()))
}

/// Reads a group from an element of any name (force, velocity, port, ...).
fn group(node: &Node) -> Group {
    let groups = node.children.iter().filter(|child| child.name != "Variable");
    Group {
        name: node.text("name").unwrap_or_default(),
        variables: node.any_children("Variable").filter_map(|child| child.text("ref")).collect(),
        groups: groups.map(group).collect(),
    }
}

/// Returns the group called `name`: searches the groups of the model first, then nested groups.
pub(super) fn find<'a>(groups: &'a [Group], name: &str) -> Option<&'a Group> {
    let group = groups.iter().find(|group| group.name == name);
    group.or_else(|| groups.iter().find_map(|group| find(&group.groups, name)))
}

impl Group {
    /// Pairs the variables of two groups in order: the variables directly in the groups, then the variables of nested
    /// groups. Returns an error sentence if the groups differ in shape.
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
        let variables = self.variables.iter().zip(&other.variables);
        let mut pairs: Vec<_> =
            variables.map(|(here, there)| [here.as_str(), there.as_str()]).collect();
        for (here, there) in self.groups.iter().zip(&other.groups) {
            pairs.extend(here.pairs(there)?);
        }
        Ok(pairs)
    }
}
