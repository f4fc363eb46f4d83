//! The elements of arrays as scalar variables.
//!
//! A master knows scalars only. [`ElementView`] replaces each array by its elements: names `A[1,2]` in
//! row-major order with indices from 1, and value references that no variable of the FMU has. Scalars keep
//! their value references. An array whose elements the FMU lists as scalars, too, is left out.

use std::collections::{HashMap, HashSet};

use fmu_description::{
    Causality, Dimension, Elements, Kind, ModelDescription, ModelStructure, NativeType,
    ScalarVariable, Unknown, Variability,
};

/// Largest number of elements of all arrays together.
const MOST_ELEMENTS: usize = 1 << 24;
/// Largest number of dependencies between elements of all unknowns together; beyond this number the dependencies of an
/// unknown are not stated.
const MOST_DEPENDENCIES: usize = 1 << 22;

/// A variable of the FMU: a scalar or an array.
#[derive(Clone, Debug)]
pub(super) struct Variable {
    pub(super) reference: u32,
    pub(super) kind: NativeType,
    pub(super) causality: Causality,
    /// Number of elements; 1 for a scalar.
    pub(super) size: usize,
    /// Whether the variable may change in Event Mode only, once the FMU is initialised (FMI 3.0.2,
    /// section 4.2.1): all but continuous inputs without clocks.
    pub(super) event: bool,
    /// Whether the FMU requests this input within a step: an input of type `Float64` with `intermediateUpdate`.
    pub(super) intermediate: bool,
    /// Value references of the clocks of the variable.
    pub(super) clocks: Vec<u32>,
    /// Position of the first element among the elements of all variables with `event`; unused without `event`.
    pub(super) shadow: usize,
}

/// The scalar variables of an FMU, with the positions of their values in the arrays of the FMU.
#[derive(Clone, Debug)]
pub(crate) struct ElementView {
    /// The description with a scalar variable for each element.
    pub(crate) description: ModelDescription,
    pub(super) variables: Vec<Variable>,
    by_reference: HashMap<u32, usize>,
    /// The value reference of the first array element.
    base: u32,
    /// For each value reference from `base` on, the position of its variable and its position in the array.
    cells: Vec<(usize, usize)>,
    /// Whether all floating-point variables are scalars of type `Float64` without clocks.
    pub(super) plain: bool,
    /// Number of elements of all variables with `event`.
    pub(super) shadows: usize,
}

impl ElementView {
    /// Creates the view of an FMU whose structural parameters have the values `sizes`, by value reference; missing
    /// ones have their start values. On failure returns the reason.
    pub(crate) fn new(
        description: &ModelDescription,
        sizes: &HashMap<u32, u64>,
    ) -> Result<Self, String> {
        let starts: HashMap<u32, u64> = description
            .variables
            .iter()
            .filter_map(|variable| {
                let start = variable.kind.as_integer()?.start?;
                Some((variable.value_reference, u64::try_from(start).ok()?))
            })
            .collect();
        let mut builder = Builder {
            view: Self {
                description: ModelDescription {
                    variables: Vec::new(),
                    co_simulation: description.stepped(),
                    // Kept only if the FMU has no co-simulation, so that it runs in scheduled execution.
                    scheduled_execution: description
                        .scheduled_execution
                        .clone()
                        .filter(|_| description.co_simulation.is_none()),
                    ..description.clone()
                },
                variables: Vec::new(),
                by_reference: HashMap::new(),
                base: 0,
                cells: Vec::new(),
                plain: true,
                shadows: 0,
            },
            first_cell: HashMap::new(),
            ranges: Vec::new(),
        };
        let extents: Vec<Vec<u64>> = description
            .variables
            .iter()
            .map(|variable| extents(variable, &starts, sizes))
            .collect::<Result<_, _>>()?;
        let counts: Vec<usize> = extents.iter().map(|extents| count(extents)).collect();
        let total = counts.iter().fold(0_usize, |sum, count| sum.saturating_add(*count));
        if total > MOST_ELEMENTS.max(2 * description.variables.len()) {
            return Err(format!(
                "its arrays have {total} elements, expected at most {MOST_ELEMENTS}"
            ));
        }
        builder.view.base = free_references(description, total);
        let scalars =
            description.variables.iter().filter(|variable| variable.dimensions.is_empty());
        let scalars: HashSet<&str> = scalars.map(|variable| variable.name.as_str()).collect();
        for (variable, extents) in description.variables.iter().zip(&extents) {
            if elements_are_scalars(variable, extents, &scalars) {
                builder.ranges.push((builder.view.description.variables.len(), 0));
                continue;
            }
            let resized = variable.dimensions.iter().any(
                |dimension| matches!(dimension, Dimension::Variable(by) if sizes.contains_key(by)),
            );
            builder.add(description, variable, extents, resized)?;
        }
        builder.finish(description)
    }

    /// Returns the positions of variable and element of a value reference of [`ElementView::description`]; `None` if no
    /// variable has the reference.
    pub(super) fn locate(&self, reference: u32) -> Option<(usize, usize)> {
        let virtual_position = reference.wrapping_sub(self.base) as usize;
        match self.cells.get(virtual_position) {
            Some(cell) => Some(*cell),
            None => self.by_reference.get(&reference).map(|variable| (*variable, 0)),
        }
    }

    /// Returns the name of the variable with a value reference of [`ElementView::description`], for messages.
    pub(super) fn name(&self, reference: u32) -> String {
        let variables = &self.description.variables;
        let known = variables.iter().find(|variable| variable.value_reference == reference);
        known.map_or_else(|| format!("the variable {reference}"), |variable| variable.name.clone())
    }
}

/// Returns the extents of a variable; none for a scalar. `sizes` take precedence over the start values `starts`.
fn extents(
    variable: &ScalarVariable,
    starts: &HashMap<u32, u64>,
    sizes: &HashMap<u32, u64>,
) -> Result<Vec<u64>, String> {
    let extent = |dimension: &Dimension| match dimension {
        Dimension::Fixed(extent) => Ok(*extent),
        Dimension::Variable(by) => {
            sizes.get(by).or_else(|| starts.get(by)).copied().ok_or_else(|| {
                format!(
                    "the dimension of {} is the variable with value reference {by}, expected a \
                     constant or structural parameter with a start value",
                    variable.name
                )
            })
        }
    };
    variable.dimensions.iter().map(extent).collect()
}

/// Returns the number of elements.
fn count(extents: &[u64]) -> usize {
    let product = extents.iter().fold(1_u64, |product, extent| product.saturating_mul(*extent));
    usize::try_from(product).unwrap_or(usize::MAX)
}

/// Returns whether each element of an array is listed as a scalar, too, as in FMU containers. `scalars` are the names of
/// all scalars.
fn elements_are_scalars(
    variable: &ScalarVariable,
    extents: &[u64],
    scalars: &HashSet<&str>,
) -> bool {
    let name = |element| format!("{}{}", variable.name, indices(element, extents));
    let mut elements = 0..count(extents);
    !extents.is_empty()
        && !elements.is_empty()
        && elements.all(|element| scalars.contains(name(element).as_str()))
}

/// Returns the first of `count` consecutive value references that no variable has.
fn free_references(description: &ModelDescription, count: usize) -> u32 {
    let mut used: Vec<u32> =
        description.variables.iter().map(|variable| variable.value_reference).collect();
    used.sort_unstable();
    used.dedup();
    let count = u32::try_from(count).unwrap_or(u32::MAX);
    // References above the largest one, else the first gap that is wide enough, else those below the smallest one.
    let largest = used.last().copied().unwrap_or(0);
    if largest < u32::MAX - count {
        return largest + 1;
    }
    let gap = used.windows(2).find(|pair| pair[1] - pair[0] > count);
    gap.map_or(0, |pair| pair[0] + 1)
}

/// Returns the indices of element number `position`, from 0, as text: `[1,2]`.
fn indices(mut position: usize, extents: &[u64]) -> String {
    let mut text = vec![String::new(); extents.len()];
    for (index, extent) in text.iter_mut().zip(extents).rev() {
        let extent = usize::try_from(*extent).unwrap_or(usize::MAX).max(1);
        *index = (position % extent + 1).to_string();
        position /= extent;
    }
    format!("[{}]", text.join(","))
}

/// Returns `kind` with the start value number `position`, or without a start value if there is none.
fn with_start(kind: &Kind, values: Option<&Elements>, position: usize) -> Kind {
    macro_rules! start {
        ($variant:ident, $copy:ident) => {
            match values {
                Some(Elements::$variant(values)) => values.get(position).$copy(),
                _ => None,
            }
        };
    }
    let mut kind = kind.clone();
    match &mut kind {
        Kind::Boolean(start) => *start = start!(Boolean, copied),
        Kind::String(start) => *start = start!(String, cloned),
        Kind::Binary(attributes) => attributes.start = start!(Binary, cloned),
        Kind::Clock(_) => {}
        number => {
            if let Some(attributes) = number.as_real_mut() {
                attributes.start = start!(Real, copied);
            } else if let Some(attributes) = number.as_integer_mut() {
                attributes.start = start!(Integer, copied);
            }
        }
    }
    kind
}

struct Builder {
    view: ElementView,
    /// Position in `cells` of the first element of each array, by value reference.
    first_cell: HashMap<u32, usize>,
    /// For each variable of the FMU, the position of its first element in the new description and its number of
    /// elements.
    ranges: Vec<(usize, usize)>,
}

impl Builder {
    /// Adds the elements of a variable. On failure returns the reason: an array has the value reference of a scalar or of
    /// an array with another number of elements.
    fn add(
        &mut self,
        description: &ModelDescription,
        variable: &ScalarVariable,
        extents: &[u64],
        resized: bool,
    ) -> Result<(), String> {
        let size = count(extents);
        self.add_native(description, variable, size);
        self.ranges.push((self.view.description.variables.len(), size));
        if variable.dimensions.is_empty() {
            self.view.description.variables.push(variable.clone());
            return Ok(());
        }
        let ScalarVariable { name, value_reference, .. } = variable;
        let native = &self.view.variables[self.view.by_reference[value_reference]];
        let first = self.first_cell.get(value_reference).filter(|_| native.size == size);
        let first = *first.ok_or_else(|| {
            format!(
                "the array {name} has {size} elements and the value reference {value_reference} of a \
                 variable that is no array of as many"
            )
        })?;
        let starts = if resized { None } else { variable.start_values(description, MOST_ELEMENTS) };
        for element in 0..size {
            let indices = indices(element, extents);
            let reference = u32::try_from(first + element).unwrap_or(u32::MAX);
            self.view.description.variables.push(ScalarVariable {
                name: format!("{}{indices}", variable.name),
                value_reference: self.view.base.wrapping_add(reference),
                kind: with_start(&variable.kind, starts.as_ref(), element),
                dimensions: Vec::new(),
                start_elements: None,
                alias_of: variable.alias_of.as_ref().map(|name| format!("{name}{indices}")),
                ..variable.clone()
            });
        }
        Ok(())
    }

    /// Adds a variable of the FMU unless it is an alias of a known variable.
    fn add_native(
        &mut self,
        description: &ModelDescription,
        variable: &ScalarVariable,
        size: usize,
    ) {
        let view = &mut self.view;
        if view.by_reference.contains_key(&variable.value_reference) {
            return;
        }
        let number = view.variables.len();
        view.by_reference.insert(variable.value_reference, number);
        let is_array = !variable.dimensions.is_empty();
        if is_array {
            self.first_cell.insert(variable.value_reference, view.cells.len());
            view.cells.extend((0..size).map(|element| (number, element)));
        }
        let kind = variable.kind.native_type();
        let is_plain = !is_array && variable.clocks.is_empty();
        view.plain &= kind != NativeType::Float32 && (kind != NativeType::Float64 || is_plain);
        let is_continuous = variable.causality == Causality::Input
            && variable.variability == Variability::Continuous
            && variable.clocks.is_empty();
        let event = !is_continuous;
        let clocks = variable.clocks.iter().filter_map(|index| {
            description
                .variables
                .get((*index as usize).checked_sub(1)?)
                .map(|clock| clock.value_reference)
        });
        view.variables.push(Variable {
            reference: variable.value_reference,
            kind,
            causality: variable.causality,
            size,
            event,
            intermediate: !event
                && kind == NativeType::Float64
                && variable.intermediate_update
                && description
                    .co_simulation
                    .as_ref()
                    .is_some_and(|flags| flags.provides_intermediate_update),
            clocks: clocks.collect(),
            shadow: view.shadows,
        });
        if event {
            view.shadows += size;
        }
    }

    /// Converts the indices by which variables refer to each other. Fails if two variables have one name.
    fn finish(mut self, description: &ModelDescription) -> Result<ElementView, String> {
        let mut names = HashSet::new();
        let variables = &self.view.description.variables;
        if let Some(twice) = variables.iter().find(|variable| !names.insert(&variable.name)) {
            return Err(format!("the element {} has the name of another variable", twice.name));
        }
        for (position, &(start, size)) in self.ranges.iter().enumerate() {
            for element in 0..size {
                let variable = &self.view.description.variables[start + element];
                let moved = |index: u32| self.moved(index, element);
                let mut kind = variable.kind.clone();
                if let Kind::Real(real) | Kind::Float32(real) = &mut kind {
                    real.derivative = real.derivative.and_then(moved);
                }
                let previous = variable.previous.and_then(moved);
                let clocks = description.variables[position].clocks.iter();
                let clocks = clocks.filter_map(|index| self.moved(*index, 0)).collect();
                let variable = &mut self.view.description.variables[start + element];
                (variable.kind, variable.previous, variable.clocks) = (kind, previous, clocks);
            }
        }
        if let Some(flags) = &mut self.view.description.co_simulation {
            // Intermediate update replaces the input derivatives of FMI 2.0.
            flags.can_interpolate_inputs =
                self.view.variables.iter().any(|variable| variable.intermediate);
        }
        let structure = &description.structure;
        let rows = |rows: &[Unknown]| self.rows(rows);
        self.view.description.structure = ModelStructure {
            outputs: rows(&structure.outputs),
            derivatives: rows(&structure.derivatives),
            initial_unknowns: rows(&structure.initial_unknowns),
            clocked_states: rows(&structure.clocked_states),
            event_indicators: rows(&structure.event_indicators),
        };
        Ok(self.view)
    }

    /// Returns the position of the first element and the number of elements, in the new description, of the variable
    /// with the 1-based index `index`.
    fn range(&self, index: u32) -> Option<(usize, usize)> {
        self.ranges.get((index as usize).checked_sub(1)?).copied()
    }

    /// Returns the 1-based index, in the new description, of an element of the variable with the 1-based index `index`;
    /// `None` if the variable does not exist or has no elements.
    fn moved(&self, index: u32, element: usize) -> Option<u32> {
        let (start, size) = self.range(index)?;
        if size == 0 {
            return None;
        }
        // If the other variable is a scalar, every element refers to it.
        u32::try_from(start + element.min(size - 1) + 1).ok()
    }

    /// Expands the rows to all elements. Each element depends on all elements of the dependencies; beyond
    /// [`MOST_DEPENDENCIES`] the dependencies of an element are not stated.
    fn rows(&self, rows: &[Unknown]) -> Vec<Unknown> {
        let mut all = Vec::new();
        let mut left = MOST_DEPENDENCIES;
        for row in rows {
            let Some((start, size)) = self.range(row.index) else { continue };
            let (mut dependencies, mut kinds) = (row.dependencies.clone(), row.kinds.clone());
            if let Some(list) = &row.dependencies {
                let ranges = list.iter().filter_map(|index| self.range(*index));
                let total = ranges.map(|(_, count)| count).sum::<usize>().saturating_mul(size);
                if total > left {
                    (dependencies, kinds) = (None, None);
                } else {
                    left -= total;
                    let mut of_all = Vec::new();
                    let mut kinds_of_all = Vec::new();
                    for (k, index) in list.iter().enumerate() {
                        let Some((start, count)) = self.range(*index) else { continue };
                        for element in start..start + count {
                            of_all.extend(u32::try_from(element + 1).ok());
                            kinds_of_all.extend(row.kinds.as_ref().and_then(|kinds| kinds.get(k)));
                        }
                    }
                    dependencies = Some(of_all);
                    kinds = row.kinds.as_ref().map(|_| kinds_of_all);
                }
            }
            for element in start..start + size {
                all.extend(u32::try_from(element + 1).ok().map(|index| Unknown {
                    index,
                    dependencies: dependencies.clone(),
                    kinds: kinds.clone(),
                }));
            }
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DESCRIPTION: &str = r#"<fmiModelDescription fmiVersion="3.0"
 modelName="M" instantiationToken="t">
<CoSimulation modelIdentifier="M" hasEventMode="true"/>
<ModelVariables>
<Float64 name="time" valueReference="0" causality="independent"/>
<Clock name="c" valueReference="1" causality="input" intervalVariability="triggered"/>
<Float64 name="a" valueReference="2" causality="input" start="0" clocks="1"/>
<Float64 name="b" valueReference="3" causality="input" start="0" clocks="1"/>
<Float64 name="v" valueReference="4" causality="input" start="0"><Dimension start="2"/></Float64>
</ModelVariables>
<ModelStructure/></fmiModelDescription>"#;

    fn view() -> ElementView {
        let (description, _) = ModelDescription::read(DESCRIPTION).unwrap();
        ElementView::new(&description, &HashMap::new()).unwrap()
    }

    #[test]
    fn clocked_inputs_of_default_variability_have_different_shadows() {
        let view = view();
        let shadows: Vec<usize> = view.variables[2..4].iter().map(|input| input.shadow).collect();
        assert_eq!(shadows, [2, 3]);
    }

    #[test]
    fn an_array_with_the_value_reference_of_another_variable_has_as_many_elements() {
        let of_view = |extent: &str, number: &str| {
            let variables = format!(
                r#"<Float64 name="w" valueReference="{number}" causality="output">
<Dimension start="{extent}"/></Float64></ModelVariables>"#
            );
            let text = DESCRIPTION.replace("</ModelVariables>", &variables);
            let (description, _) = ModelDescription::read(text).unwrap();
            ElementView::new(&description, &HashMap::new()).map(|view| view.description)
        };
        let reference = |description: &ModelDescription, name: &str| {
            description.variable(name).unwrap().value_reference
        };
        let same = of_view("2", "4").unwrap();
        assert_eq!(reference(&same, "w[2]"), reference(&same, "v[2]"));
        // The value reference 2 belongs to a scalar.
        for (extent, number) in [("3", "4"), ("1", "2")] {
            let reason = of_view(extent, number).unwrap_err();
            assert!(
                reason.contains(&format!("the array w has {extent}"))
                    && reason.contains(&format!("reference {number} ")),
                "{reason}"
            );
        }
    }

    #[test]
    fn an_array_whose_elements_are_scalars_is_left_out() {
        let of_view = |scalars: &str| {
            let text =
                DESCRIPTION.replace("</ModelVariables>", &format!("{scalars}</ModelVariables>"));
            let (description, _) = ModelDescription::read(text).unwrap();
            ElementView::new(&description, &HashMap::new()).map(|view| view.description)
        };
        let first = r#"<Float64 name="v[1]" valueReference="11"/>"#;
        let both =
            of_view(&format!(r#"{first}<Float64 name="v[2]" valueReference="12"/>"#)).unwrap();
        assert_eq!(both.variables.len(), 6);
        assert_eq!(both.variable("v[2]").unwrap().value_reference, 12);
        let reason = of_view(first).unwrap_err();
        assert_eq!(reason, "the element v[1] has the name of another variable");
    }

    #[test]
    fn an_element_has_its_name_in_messages() {
        let view = view();
        let element = view.description.variables.last().unwrap();
        assert_eq!(view.name(element.value_reference), "v[2]");
        assert_eq!(view.name(2), "a");
    }
}
