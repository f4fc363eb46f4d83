//! Converts parameter bindings to settings of FMUs (SSP 1.0.1, sections 5.2.3, 6 and 7).

mod value;

use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, BTreeSet, HashMap};

use fmu_description::{Causality, Initial, ScalarVariable};

use super::error::{SspError, semantic_error};
use super::flatten::Flow;
use super::structure::{ConnectorKind, MappingEntry, Parameter, ParameterSet};
use super::tree::{Binding, Content, Tree, Vertex};
use crate::assembly::Setting;
use value::Value;

/// Maximum number of names in a warning about unmatched names.
const NAMED: usize = 5;

/// Settings of each FMU, by the index of its node.
pub(super) type Settings = BTreeMap<usize, Vec<Setting>>;

/// Applies all bindings, inner elements first, so that outer bindings override inner ones.
pub(super) fn settings(
    tree: &Tree,
    flow: &Flow,
    warnings: &mut Vec<String>,
) -> Result<Settings, SspError> {
    let mut targets: HashMap<&Vertex, Vec<&Vertex>> = HashMap::new();
    for edge in &flow.edges {
        targets.entry(&edge.from).or_default().push(&edge.to);
    }
    let mut binder = Binder {
        tree,
        targets,
        flow,
        settings: Settings::new(),
        positions: HashMap::new(),
        warnings,
    };
    // Nodes by decreasing depth; nodes of the same depth keep the order of the tree.
    let mut order: Vec<usize> = (0..tree.nodes.len()).collect();
    order.sort_by_cached_key(|node| std::cmp::Reverse(depth(tree, *node)));
    for node in order {
        for binding in &tree.nodes[node].bindings {
            binder.bind(node, binding).map_err(|error| error.in_file(&binding.file.shown))?;
        }
    }
    Ok(binder.settings)
}

/// Joins `names` by commas; states the number of the names beyond the first [`NAMED`].
pub(super) fn listed(names: &[&str]) -> String {
    let rest = names.len().saturating_sub(NAMED);
    let more = if rest > 0 { format!(" and {rest} more") } else { String::new() };
    names[..names.len() - rest].join(", ") + &more
}

fn depth(tree: &Tree, node: usize) -> usize {
    std::iter::successors(Some(node), |node| tree.nodes[*node].parent).count()
}

/// The state while the bindings are applied one after another.
struct Binder<'a> {
    tree: &'a Tree,
    flow: &'a Flow,
    /// The targets of all connections, by source.
    targets: HashMap<&'a Vertex, Vec<&'a Vertex>>,
    settings: Settings,
    /// For the vertex of each setting, the position of the setting in the list of its node.
    positions: HashMap<Vertex, usize>,
    warnings: &'a mut Vec<String>,
}

impl Binder<'_> {
    fn bind(&mut self, node: usize, binding: &Binding) -> Result<(), SspError> {
        let (mut unmatched, mut missing) = (Vec::new(), Vec::new());
        let values = &binding.values;
        self.warn_repeated(values);
        let name = |parameter: &Parameter| format!("{}{}", binding.prefix, parameter.name);
        let parameters = values.parameters.iter().map(|parameter| (name(parameter), parameter));
        match &binding.mapping {
            None => {
                for (target, parameter) in parameters {
                    let entry = MappingEntry { target, ..MappingEntry::default() };
                    self.apply(node, binding, parameter, &entry, &mut unmatched)?;
                }
            }
            Some(mapping) => {
                let sources: HashMap<String, &Parameter> = parameters.collect();
                for entry in &mapping.entries {
                    match sources.get(&entry.source) {
                        Some(parameter) => {
                            self.apply(node, binding, parameter, entry, &mut unmatched)?;
                        }
                        None => missing.push(entry.source.clone()),
                    }
                }
            }
        }
        let tree = self.tree;
        let owner = match tree.nodes[node].path.as_str() {
            "" => "the system",
            path => path,
        };
        self.warn_unmatched(values, owner, &unmatched);
        let set = match binding.prefix.as_str() {
            "" => "it".to_owned(),
            prefix => format!("with the prefix {prefix:?}, it"),
        };
        self.warn_unmatched(values, &set, &missing);
        Ok(())
    }

    /// Warns about names that occur twice with different values; the last value counts.
    fn warn_repeated(&mut self, values: &ParameterSet) {
        let mut known: HashMap<&str, &Parameter> = HashMap::new();
        let mut repeated = BTreeSet::new();
        for parameter in &values.parameters {
            let earlier = known.insert(&parameter.name, parameter);
            if earlier.is_some_and(|earlier| earlier.value != parameter.value) {
                repeated.insert(parameter.name.as_str());
            }
        }
        if let Some(first) = repeated.first() {
            let rest = repeated.len() - 1;
            let more = if rest > 0 { format!(" and {rest} more") } else { String::new() };
            let set = &values.name;
            self.warnings.push(format!(
                "parameter set {set:?} has different values for {first}{more}: the last one counts"
            ));
        }
    }

    /// Warns about `names` that do not exist in `owner`: the name of an element, or "it" for the parameter set itself.
    fn warn_unmatched(&mut self, values: &ParameterSet, owner: &str, names: &[String]) {
        let (names, nameless): (Vec<&str>, Vec<&str>) =
            names.iter().map(String::as_str).partition(|name| !name.is_empty());
        let set = &values.name;
        if !nameless.is_empty() {
            let count = nameless.len();
            let text = format!("parameter set {set:?}: {count} names are empty: ignored");
            self.warnings.push(text);
        }
        if names.is_empty() {
            return;
        }
        let names = listed(&names);
        self.warnings.push(format!("parameter set {set:?}: {owner} has no {names}: ignored"));
    }

    /// Applies one parameter to every variable and connector with the target name of `entry`; if there is none, adds
    /// the name to `unmatched`.
    fn apply(
        &mut self,
        node: usize,
        binding: &Binding,
        parameter: &Parameter,
        entry: &MappingEntry,
        unmatched: &mut Vec<String>,
    ) -> Result<(), SspError> {
        let mut targets = Vec::new();
        find(self.tree, node, &entry.target, &mut targets);
        if targets.is_empty() {
            unmatched.push(entry.target.clone());
        }
        for target in targets {
            let wrong = |sentence| {
                let name = self.tree.name(&target);
                semantic_error(
                    binding.at,
                    format!("parameter {} for {name}: {sentence}", parameter.name),
                )
            };
            let measure = self.tree.measure(&target);
            let scopes = [&binding.values.definitions, &binding.file.definitions];
            let value = Value::of(parameter, &scopes);
            let (value, warnings) = value.convert(&entry.conversion, measure).map_err(wrong)?;
            let name = self.tree.name(&target);
            self.warnings.extend(warnings.iter().map(|text| format!("setting of {name}: {text}")));
            self.set(&target, &value).map_err(wrong)?;
        }
        Ok(())
    }

    /// Sets a variable of an FMU, or the variables connected to a system's connector.
    fn set(&mut self, target: &Vertex, value: &Value) -> Result<(), String> {
        if matches!(self.tree.nodes[target.node].content, Content::Fmu(_)) {
            return self.set_variable(target, value);
        }
        let kind =
            self.tree.connector(target.node, &target.connector).map(|connector| connector.kind);
        match kind {
            Some(
                ConnectorKind::Input
                | ConnectorKind::Parameter
                | ConnectorKind::StructuralParameter,
            ) => self.set_downstream(target, value),
            _ => self.set_upstream(target, value),
        }
    }

    /// Sets all variables that the connector drives.
    fn set_downstream(&mut self, target: &Vertex, value: &Value) -> Result<(), String> {
        let mut stack = vec![target];
        let mut steps = self.flow.edges.len();
        let mut ends = Vec::new();
        while let Some(vertex) = stack.pop() {
            for next in self.targets.get(vertex).into_iter().flatten() {
                steps = steps.checked_sub(1).ok_or("a ring of connections")?;
                match self.tree.nodes[next.node].content {
                    Content::Fmu(_) => ends.push((*next).clone()),
                    _ => stack.push(next),
                }
            }
        }
        ends.sort_unstable();
        for end in ends {
            let path = self.flow.upstream(self.tree, &end).map_err(|error| error.to_string())?;
            // Only the part of the path behind the connector that is set.
            let start = path.iter().position(|edge| edge.from == *target).unwrap_or(0);
            let measure = self.tree.measure(target).or(value.measure.clone());
            let chain = Flow::convert_along(self.tree, &path[start..], measure);
            let chain = chain.map_err(|error| error.to_string())?;
            let number = value.number.transformed(&chain.transformation)?;
            self.set_variable(&end, &Value::new(number, chain.measure))?;
        }
        Ok(())
    }

    /// Sets the start value of the output that drives the connector `target` so that `target` gets `value`. Does
    /// nothing if no FMU drives the connector.
    fn set_upstream(&mut self, target: &Vertex, value: &Value) -> Result<(), String> {
        let path = self.flow.upstream(self.tree, target).map_err(|error| error.to_string())?;
        let is_fmu =
            |vertex: &Vertex| matches!(self.tree.nodes[vertex.node].content, Content::Fmu(_));
        let Some(first) = path.first().filter(|first| is_fmu(&first.from)) else { return Ok(()) };
        let measure = self.tree.measure(&first.from);
        let chain = Flow::convert_along(self.tree, &path, measure.clone())
            .map_err(|error| error.to_string())?;
        let number = value.number.inverted(&chain.transformation)?;
        self.set_variable(&first.from.clone(), &Value::new(number, measure))
    }

    /// Adds the setting of a variable of an FMU, or replaces an earlier one; warns if the variable cannot be set.
    fn set_variable(&mut self, target: &Vertex, value: &Value) -> Result<(), String> {
        let (tree, name) = (self.tree, self.tree.name(target));
        let Some(variable) = tree.variable(target) else {
            return Err(format!("the FMU has no variable {name}"));
        };
        if !settable(variable) {
            let (causality, variability) =
                (variable.causality.as_str(), variable.variability.as_str());
            let what = variable.never_set().map_or_else(
                || format!("{causality} and {variability} without a start value"),
                str::to_owned,
            );
            self.warnings.push(format!("{name} is {what}: its setting is ignored"));
            return Ok(());
        }
        let items = tree.measure(target).items;
        let text = value.number.text(&variable.kind, items.as_deref())?;
        let setting = Setting { variable: variable.name.clone(), value: text };
        let settings = self.settings.entry(target.node).or_default();
        match self.positions.entry(target.clone()) {
            Entry::Occupied(known) => settings[*known.get()] = setting,
            Entry::Vacant(position) => {
                position.insert(settings.len());
                settings.push(setting);
            }
        }
        Ok(())
    }
}

/// Adds all variables and connectors below `node` with the hierarchical name `name` to `vertices`. There may be
/// several, because names of elements may contain dots.
fn find(tree: &Tree, node: usize, name: &str, vertices: &mut Vec<Vertex>) {
    let element = &tree.nodes[node];
    match element.content {
        Content::Fmu(_) => {
            let vertex = Vertex { node, connector: name.to_owned() };
            if tree.variable(&vertex).is_some() {
                vertices.push(vertex);
            }
        }
        Content::System => {
            if tree.connector(node, name).is_some() {
                vertices.push(Vertex { node, connector: name.to_owned() });
            }
            for (position, _) in name.match_indices('.') {
                if let Some(child) = element.children.get(&name[..position]) {
                    find(tree, *child, &name[position + 1..], vertices);
                }
            }
        }
        Content::Dictionary | Content::Reference(_) => {}
    }
}

/// Returns whether a variable may be set before the initialization: an input, or a variable with a
/// start value or with `initial` exact or approx, unless [`ScalarVariable::never_set`] excludes it.
fn settable(variable: &ScalarVariable) -> bool {
    let initial = variable.initial_in_force();
    variable.never_set().is_none()
        && (variable.causality == Causality::Input
            || variable.has_start()
            || matches!(initial, Some(Initial::Exact | Initial::Approx)))
}
