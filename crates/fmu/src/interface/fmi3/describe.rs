//! The description of FMI 3.0, made from the description of FMI 2.0.

use std::collections::HashMap;

use super::super::structure;
use super::arrays::{Block, blocks, starts, without_start};
use super::{Entry, INDICATOR, INT64, Table, dependent, pairs};
use fmu_description::{
    Causality, CoSimulation, DependencyKind, Dimension, Initial, Kind, ModelDescription,
    ModelExchange, ModelStructure, NativeType, RealType, ScalarVariable, Unknown, Variability,
};

/// The variables of FMI 3.0 (new), and which of them has each variable of FMI 2.0 (old).
#[derive(Default)]
struct Builder {
    variables: Vec<ScalarVariable>,
    entries: Vec<Entry>,
    /// For each old variable: 1-based index of the new variable and the element in it (from 1; 0 for a scalar).
    places: Vec<(u32, usize)>,
}

/// Returns table and description of FMI 3.0 for a description of FMI 2.0 and a number of event
/// indicators.
///
/// * Scalars named `A[1,1]`, `A[1,2]`, ... are one array if their attributes agree.
/// * An alias with the same attributes becomes an `Alias`; another one becomes a variable.
/// * The parameters are knowns of outputs and derivatives (section 2.4.8): each output and derivative
///   depends on all parameters, unless it is a state.
/// * The event indicators are local variables.
pub(crate) fn describe(old: &ModelDescription, indicators: usize) -> (Table, ModelDescription) {
    let mut builder = Builder::default();
    builder.add_variables(&old.variables);
    let structure = builder.structure(old);
    builder.set_indices();
    let mut table = builder.table(old);
    let mut variables = builder.variables;
    let event_indicators = add_indicators(&mut table, &mut variables, indicators);
    let description = ModelDescription {
        fmi_version: "3.0".to_owned(),
        guid: String::new(),
        number_of_event_indicators: None,
        model_exchange: old.model_exchange.as_ref().map(exchange),
        co_simulation: old.co_simulation.as_ref().map(|flags| simulation(flags, old)),
        variables,
        structure: ModelStructure { event_indicators, ..structure },
        ..old.clone()
    };
    (table, description)
}

/// Returns the flags of model exchange in FMI 3.0.
fn exchange(flags: &ModelExchange) -> ModelExchange {
    ModelExchange {
        can_not_use_memory_management_functions: false,
        provides_adjoint_derivatives: flags.provides_directional_derivative,
        provides_per_element_dependencies: true,
        ..flags.clone()
    }
}

/// Returns the flags of co-simulation in FMI 3.0.
fn simulation(flags: &CoSimulation, old: &ModelDescription) -> CoSimulation {
    CoSimulation {
        can_not_use_memory_management_functions: false,
        can_interpolate_inputs: false,
        has_event_mode: old.model_exchange.is_some(),
        might_return_early_from_do_step: true,
        provides_adjoint_derivatives: flags.provides_directional_derivative,
        provides_per_element_dependencies: true,
        ..flags.clone()
    }
}

/// Returns the key that variables with the same value share: whether the variable is time, its base type and its value
/// reference of FMI 2.0.
fn value_key(variable: &ScalarVariable) -> (bool, &'static str, u32) {
    let is_time = variable.causality == Causality::Independent;
    (is_time, variable.kind.base(), variable.value_reference)
}

/// Whether the variable precedes the others: time, and the structural parameters, because fmusim 0.0.39 crashes
/// if an array precedes the parameter that is its extent. The standard states no order.
fn is_early(variable: &ScalarVariable) -> bool {
    matches!(variable.causality, Causality::Independent | Causality::StructuralParameter)
}

fn same_attributes(alias: &ScalarVariable, of: &ScalarVariable) -> bool {
    alias.causality == of.causality
        && alias.variability == of.variability
        && without_start(&alias.kind) == without_start(&of.kind)
}

/// Returns the place of a variable: its value reference of FMI 2.0, with a mark for an `Int64`.
fn place(variable: &ScalarVariable) -> u32 {
    match variable.kind {
        Kind::Int64(_) => INT64 | variable.value_reference,
        _ => variable.value_reference,
    }
}

impl Builder {
    fn add_variables(&mut self, old: &[ScalarVariable]) {
        let mut same: HashMap<_, Vec<usize>> = HashMap::new();
        for (position, variable) in old.iter().enumerate() {
            same.entry(value_key(variable)).or_default().push(position);
        }
        let group = |variable: &ScalarVariable| {
            same.get(&value_key(variable)).map_or(&[][..], Vec::as_slice)
        };
        // The variable that an alias repeats is the one with a start value, otherwise the first one.
        let main = |variable: &ScalarVariable| {
            let with_start = group(variable).iter().copied().find(|&other| old[other].has_start());
            with_start.unwrap_or_else(|| group(variable)[0])
        };
        let is_alias = |position: usize| {
            let main = main(&old[position]);
            main != position && same_attributes(&old[position], &old[main])
        };
        self.places = vec![(0, 0); old.len()];
        let mut blocks = blocks(old, |variable| group(variable).len() > 1);
        blocks.sort_by_key(|block| !is_early(&old[block.start]));
        for block in blocks {
            if block.count == 1 && block.extents.is_empty() && is_alias(block.start) {
                continue;
            }
            let elements = &old[block.start..block.start + block.count];
            let aliases = group(&elements[0]).iter().copied();
            let aliases: Vec<_> = aliases
                .filter(|&other| is_alias(other) && main(&old[other]) == block.start)
                .collect();
            let is_calculated = main(&elements[0]) != block.start && !elements[0].has_start();
            self.add_block(&block, elements, is_calculated);
            for position in aliases {
                self.add_alias(&old[position], position, &block.name);
            }
        }
    }

    fn add_block(&mut self, block: &Block, elements: &[ScalarVariable], is_calculated: bool) {
        let reference = u32::try_from(self.entries.len()).unwrap_or(u32::MAX);
        let first = &elements[0];
        let index = self.next_index();
        let is_array = !block.extents.is_empty();
        for element in 0..block.count {
            self.places[block.start + element] = (index, if is_array { element + 1 } else { 0 });
        }
        self.entries.push(Entry {
            name: block.name.clone(),
            kind: first.kind.native_type(),
            first: place(first),
            count: u32::try_from(block.count).unwrap_or(u32::MAX),
            is_calculated,
        });
        let start_elements = starts(elements).filter(|_| block.count > 1);
        let mut kind = first.kind.clone();
        if start_elements.is_some() {
            match &mut kind {
                // An array of states keeps `reinit`.
                Kind::Real(real) => real.start = None,
                other => other.clear_start(),
            }
        }
        self.variables.push(ScalarVariable {
            name: block.name.clone(),
            value_reference: reference,
            dimensions: block.extents.iter().map(|&extent| Dimension::Fixed(extent)).collect(),
            start_elements,
            kind,
            ..first.clone()
        });
    }

    fn add_alias(&mut self, alias: &ScalarVariable, position: usize, of: &str) {
        self.places[position] = (self.next_index(), 0);
        let target = self
            .variables
            .iter()
            .rfind(|variable| variable.name == of)
            .cloned()
            .unwrap_or_default();
        self.variables.push(ScalarVariable {
            name: alias.name.clone(),
            description: alias.description.clone(),
            alias_of: Some(of.to_owned()),
            initial: alias.initial,
            kind: alias.kind.clone(),
            ..target
        });
    }

    /// Returns the 1-based index of the next new variable.
    fn next_index(&self) -> u32 {
        u32::try_from(self.variables.len() + 1).unwrap_or(u32::MAX)
    }

    /// Returns the new index of the variable with the old index `old`.
    fn index(&self, old: u32) -> u32 {
        self.places[old as usize - 1].0
    }

    /// Replaces the old indices of states in derivatives, and of clocks, by new indices.
    fn set_indices(&mut self) {
        for variable in &mut self.variables {
            for clock in &mut variable.clocks {
                *clock = self.places[*clock as usize - 1].0;
            }
            if let Kind::Real(RealType { derivative: Some(state), .. }) = &mut variable.kind {
                *state = self.places[*state as usize - 1].0;
            }
        }
    }

    /// Returns `ModelStructure` of the new variables, without event indicators.
    fn structure(&self, old: &ModelDescription) -> ModelStructure {
        let structure = &old.structure;
        let parameters: Vec<_> =
            parameters(old).into_iter().map(|parameter| self.index(parameter)).collect();
        let states = states(old);
        let with_parameters = |rows: &[Unknown]| {
            self.rows(rows, |row| if states.contains(&row) { &[] } else { parameters.as_slice() })
        };
        ModelStructure {
            outputs: with_parameters(&structure.outputs),
            derivatives: with_parameters(&structure.derivatives),
            initial_unknowns: self.rows(&structure.initial_unknowns, |_| &[]),
            ..ModelStructure::default()
        }
    }

    /// Returns the rows of the new variables: the row of an array has the dependencies of all its
    /// elements. To each old row the knowns that `more` returns for its index are added.
    fn rows<'a>(&self, old: &[Unknown], more: impl Fn(u32) -> &'a [u32]) -> Vec<Unknown> {
        let mut rows: Vec<Unknown> = Vec::new();
        let mut by_reference: HashMap<u32, (usize, u32)> = HashMap::new();
        for row in old {
            let index = self.index(row.index);
            let reference = self.variables[index as usize - 1].value_reference;
            let new = self.row(row, index, more(row.index));
            match by_reference.get(&reference) {
                None => {
                    by_reference.insert(reference, (rows.len(), index));
                    rows.push(new);
                }
                // Another element of an array. The row of an alias that became a variable is left out.
                Some(&(position, same)) if same == index => merge(&mut rows[position], &new),
                Some(_) => {}
            }
        }
        rows
    }

    fn row(&self, old: &Unknown, index: u32, more: &[u32]) -> Unknown {
        let Some(listed) = pairs(old) else {
            return Unknown { index, dependencies: None, kinds: None };
        };
        let listed = listed.into_iter().map(|(known, kind)| (self.index(known), kind));
        from_pairs(index, listed.chain(dependent(more)).collect())
    }

    fn table(&self, old: &ModelDescription) -> Table {
        let reference = |&(index, element): &(u32, usize)| {
            (self.variables[index as usize - 1].value_reference, element)
        };
        let initial = |variable: &ScalarVariable| match variable.causality {
            Causality::Input | Causality::Independent => true,
            _ => {
                variable.initial_in_force() == Some(Initial::Exact)
                    && variable.variability != Variability::Constant
            }
        };
        let mut later = indices(old, &|variable| {
            matches!(
                variable.causality,
                Causality::Input | Causality::Independent | Causality::Parameter
            )
        });
        later.extend(derivative_states(old));
        later.sort_unstable();
        Table {
            elements: self.places.iter().map(reference).collect(),
            entries: self.entries.clone(),
            scalars: old.structure.clone(),
            parameters: parameters(old),
            states: states(old),
            knowns: [indices(old, &initial), later],
        }
    }
}

/// Returns the 1-based indices of the variables that `accepts` accepts.
fn indices(old: &ModelDescription, accepts: &dyn Fn(&ScalarVariable) -> bool) -> Vec<u32> {
    let all = (1..).zip(&old.variables);
    all.filter(|(_, variable)| accepts(variable)).map(|(index, _)| index).collect()
}

/// Returns the 1-based indices of the parameters.
fn parameters(old: &ModelDescription) -> Vec<u32> {
    indices(old, &|variable| variable.causality == Causality::Parameter)
}

/// Returns the 1-based indices of the continuous states, by their derivatives in `ModelStructure`.
fn derivative_states(old: &ModelDescription) -> Vec<u32> {
    let rows = old.structure.derivatives.iter();
    let derivatives = rows.map(|row| &old.variables[row.index as usize - 1]);
    derivatives
        .filter_map(|variable| variable.kind.as_real().and_then(|real| real.derivative))
        .collect()
}

/// Returns the 1-based indices of the continuous states and of the other variables with their values.
fn states(old: &ModelDescription) -> Vec<u32> {
    let values: Vec<_> = derivative_states(old)
        .into_iter()
        .map(|index| value_key(&old.variables[index as usize - 1]))
        .collect();
    indices(old, &|variable| values.contains(&value_key(variable)))
}

/// Returns the row with these dependencies. A known that occurs twice with different kinds is
/// [`DependencyKind::Dependent`].
fn from_pairs(index: u32, mut pairs: Vec<(u32, DependencyKind)>) -> Unknown {
    pairs.sort_by_key(|(known, _)| *known);
    let mut merged: Vec<(u32, DependencyKind)> = Vec::new();
    for (known, kind) in pairs {
        match merged.last_mut().filter(|last| last.0 == known) {
            Some(last) if last.1 == kind => {}
            Some(last) => last.1 = DependencyKind::Dependent,
            None => merged.push((known, kind)),
        }
    }
    structure::row(index, merged)
}

/// Adds the dependencies of `other` to `row`. The result has no list of dependencies if one of the rows has none.
fn merge(row: &mut Unknown, other: &Unknown) {
    *row = match (pairs(row), pairs(other)) {
        (Some(mut one), Some(two)) => {
            one.extend(two);
            from_pairs(row.index, one)
        }
        _ => Unknown { index: row.index, dependencies: None, kinds: None },
    };
}

/// Adds the event indicators as local variables. Returns their rows.
fn add_indicators(
    table: &mut Table,
    variables: &mut Vec<ScalarVariable>,
    count: usize,
) -> Vec<Unknown> {
    let mut rows = Vec::new();
    for k in 0..count {
        let name = format!("event_indicator[{}]", k + 1);
        let place = INDICATOR | u32::try_from(k).unwrap_or(u32::MAX);
        let reference = u32::try_from(table.entries.len()).unwrap_or(u32::MAX);
        table.entries.push(Entry {
            name: name.clone(),
            kind: NativeType::Float64,
            first: place,
            count: 1,
            is_calculated: false,
        });
        variables.push(ScalarVariable {
            name,
            value_reference: reference,
            description: Some("A state event occurs where it changes its sign".to_owned()),
            causality: Causality::Local,
            variability: Variability::Continuous,
            initial: Some(Initial::Calculated),
            ..ScalarVariable::default()
        });
        let index = u32::try_from(variables.len()).unwrap_or(u32::MAX);
        rows.push(Unknown { index, dependencies: None, kinds: None });
    }
    rows
}
