//! The variables of FMI 3.0, derived from the variables of FMI 2.0: value references that are unique over all types,
//! arrays, and event indicators as variables.

mod arrays;
mod describe;

use crate::model::Failure;
use fmu_description::{DependencyKind, ModelStructure, NativeType, Unknown};

pub(crate) use describe::describe;

/// Bit that marks the place of an event indicator.
pub(crate) const INDICATOR: u32 = 1 << 31;

/// Bit that marks the place of an `Int64`, to distinguish it from the place of an enumeration.
pub(crate) const INT64: u32 = 1 << 31;

/// A variable of FMI 3.0: a scalar or an array.
#[derive(Clone, Debug)]
pub(crate) struct Entry {
    pub(crate) name: String,
    pub(crate) kind: NativeType,
    /// The place ([`Table`]) of the first element; the places of further elements follow.
    first: u32,
    /// Number of elements of the variable.
    count: u32,
    /// Whether the variable must not be set: its value is that of another variable, and it has no start value.
    is_calculated: bool,
}

/// The variables by value reference of FMI 3.0, and their dependencies.
///
/// Each scalar has a place: its value reference of FMI 2.0, with a mark for an `Int64`, or the number of an event
/// indicator, with a mark.
pub(crate) struct Table {
    entries: Vec<Entry>,
    /// `ModelStructure` of FMI 2.0, in which each element of an array is a variable.
    scalars: ModelStructure,
    /// Value reference and element (from 1; 0 for a scalar) of each variable of FMI 2.0, in the order of these
    /// variables.
    elements: Vec<(u32, usize)>,
    /// 1-based indices in FMI 2.0 of the parameters, on which outputs and derivatives may depend.
    parameters: Vec<u32>,
    /// 1-based indices in FMI 2.0 of the continuous states and of their aliases, which depend on no
    /// parameter.
    states: Vec<u32>,
    /// 1-based indices in FMI 2.0 of the knowns in initialization mode and after initialization mode.
    knowns: [Vec<u32>; 2],
}

/// The dependency of an element of an unknown on an element of a known. Elements count from 1; 0 is a scalar.
pub(crate) struct Dependency {
    pub(crate) element: usize,
    /// Value reference of the known.
    pub(crate) known: u32,
    pub(crate) element_of_known: usize,
    pub(crate) kind: DependencyKind,
}

impl Table {
    /// Returns the variable with a value reference; an error if there is none.
    fn entry(&self, reference: u32, function_type: &str) -> Result<&Entry, Failure> {
        self.entries.get(reference as usize).ok_or_else(|| {
            Failure::Error(format!(
                "no {function_type} variable has the value reference {reference}"
            ))
        })
    }

    /// Whether the variables have the same names and types as the variables of `other`, in the same order.
    pub(crate) fn has_variables_of(&self, other: &Self) -> bool {
        let variables = |table: &Self| -> Vec<(String, NativeType)> {
            table.entries.iter().map(|entry| (entry.name.clone(), entry.kind)).collect()
        };
        variables(self) == variables(other)
    }

    /// Checks that no variable is calculated, that is, repeats the value of another one. Ignores unknown references.
    /// The error names the first such variable.
    pub(crate) fn check_settable(&self, references: &[u32]) -> Result<(), Failure> {
        let entries =
            || references.iter().filter_map(|reference| self.entries.get(*reference as usize));
        match entries().find(|entry| entry.is_calculated) {
            None => Ok(()),
            Some(Entry { name, .. }) => {
                Err(Failure::Error(format!("{name} must not be set: it has initial = calculated")))
            }
        }
    }

    /// Replaces the content of `places` by the places of all elements of the variables, in row-major order. An error
    /// for an unknown value reference, a variable of another type, and if the number of elements is not `count`
    /// (section 2.2.7.1).
    pub(crate) fn locate(
        &self,
        kind: NativeType,
        references: &[u32],
        count: usize,
        places: &mut Vec<u32>,
    ) -> Result<(), Failure> {
        places.clear();
        for &reference in references {
            match self.entries.get(reference as usize) {
                Some(entry) if entry.kind == kind => {
                    if entry.count == 1 {
                        places.push(entry.first);
                    } else {
                        places.extend(entry.first..entry.first + entry.count);
                    }
                }
                _ => return Err(self.wrong_type(reference, kind.name())),
            }
        }
        if places.len() != count {
            return Err(self.wrong_count(references, places.len(), count));
        }
        Ok(())
    }

    /// Writes the places of scalars of one type. Returns false if a reference is no such scalar, or if
    /// there are not as many references as places; `places` then has no meaning.
    pub(crate) fn locate_scalars(
        &self,
        kind: NativeType,
        references: &[u32],
        places: &mut [u32],
    ) -> bool {
        references.len() == places.len()
            && references.iter().zip(places).all(|(&reference, place)| {
                match self.entries.get(reference as usize) {
                    Some(entry) if entry.kind == kind && entry.count == 1 => {
                        *place = entry.first;
                        true
                    }
                    _ => false,
                }
            })
    }

    /// Returns the error for a function that does not access the variable's type, or for an unknown reference.
    #[cold]
    pub(crate) fn wrong_type(&self, reference: u32, function_type: &str) -> Failure {
        match self.entry(reference, function_type) {
            Ok(Entry { name, kind, .. }) => Failure::Error(format!(
                "value reference {reference} is {name} of type {}, expected a {function_type}",
                kind.name()
            )),
            Err(failure) => failure,
        }
    }

    /// Returns the error for a number of values that is not the number of elements.
    #[cold]
    fn wrong_count(&self, references: &[u32], expected: usize, actual: usize) -> Failure {
        let names = references.iter().filter_map(|&reference| self.entries.get(reference as usize));
        let names: Vec<_> = names.take(5).map(|entry| entry.name.as_str()).collect();
        let more = if references.len() > names.len() { ", ..." } else { "" };
        Failure::Error(format!(
            "nValues is {actual}, expected {expected} for the elements of {}{more}",
            names.join(", ")
        ))
    }

    /// Returns the number of elements of each variable; 0 for an unknown value reference.
    pub(crate) fn sizes(&self, references: &[u32]) -> impl Iterator<Item = u32> {
        references
            .iter()
            .map(|&reference| self.entries.get(reference as usize).map_or(0, |entry| entry.count))
    }

    /// Returns the dependencies of a variable, or of its initial value if `initial`. There are none for a variable that
    /// is no unknown. An output or a derivative that is neither a state nor an alias of a state also depends on all
    /// parameters. An event indicator depends on all knowns; its initial value is no unknown. An error for an unknown
    /// value reference.
    pub(crate) fn dependencies(
        &self,
        reference: u32,
        initial: bool,
    ) -> Result<Vec<Dependency>, Failure> {
        let entry = self.entry(reference, "exported")?;
        if entry.kind == NativeType::Float64 && entry.first & INDICATOR != 0 && !initial {
            let [_, all] = &self.knowns;
            return Ok(dependent(all).map(|(k, kind)| self.dependency(0, k, kind)).collect());
        }
        let scalars = &self.scalars;
        let later = || scalars.outputs.iter().chain(&scalars.derivatives);
        let rows: Vec<_> =
            if initial { scalars.initial_unknowns.iter().collect() } else { later().collect() };
        let mut dependencies = Vec::new();
        let mut rows_read = Vec::new();
        for row in rows {
            let (owner, element) = self.elements[row.index as usize - 1];
            if owner != reference || rows_read.contains(&row.index) {
                continue;
            }
            rows_read.push(row.index);
            let all = &self.knowns[usize::from(!initial)];
            for (known, kind) in pairs(row).unwrap_or_else(|| dependent(all).collect()) {
                dependencies.push(self.dependency(element, known, kind));
            }
            if !initial && row.dependencies.is_some() && !self.states.contains(&row.index) {
                let parameters = dependent(&self.parameters);
                dependencies.extend(parameters.map(|(k, kind)| self.dependency(element, k, kind)));
            }
        }
        Ok(dependencies)
    }

    /// Returns the dependency on the known with this 1-based index in FMI 2.0.
    fn dependency(&self, element: usize, index: u32, kind: DependencyKind) -> Dependency {
        let (known, element_of_known) = self.elements[index as usize - 1];
        Dependency { element, known, element_of_known, kind }
    }
}

/// Returns the dependencies of a row with their kinds; `None` if the row lists none.
fn pairs(row: &Unknown) -> Option<Vec<(u32, DependencyKind)>> {
    let known = row.dependencies.as_ref()?;
    Some(match &row.kinds {
        Some(kinds) => known.iter().copied().zip(kinds.iter().copied()).collect(),
        None => dependent(known).collect(),
    })
}

/// Returns the knowns with the kind [`DependencyKind::Dependent`].
fn dependent(knowns: &[u32]) -> impl Iterator<Item = (u32, DependencyKind)> {
    knowns.iter().map(|&known| (known, DependencyKind::Dependent))
}
