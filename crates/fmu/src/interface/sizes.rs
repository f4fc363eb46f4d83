//! Structural parameters as extents of arrays.

use std::collections::HashMap;

use crate::model::Failure;
use crate::variable::{Declaration, element_name};
use fmu_description::{Causality, Dimension, Kind, ModelDescription, ScalarVariable};

/// The structural parameters of a model.
#[derive(Default)]
pub(super) struct Sizes {
    /// For the name of each array element, the structural parameters that are the extents of the array.
    by_element: HashMap<String, Vec<String>>,
}

impl Sizes {
    pub(super) fn of(variables: &[Declaration]) -> Self {
        let sized = variables.iter().filter(|variable| !variable.sized_by.is_empty());
        let by_element =
            sized.map(|variable| (variable.name.clone(), variable.sized_by.clone())).collect();
        Self { by_element }
    }

    /// Replaces the extents in a description of FMI 3.0 by references to the structural parameters. An error if an
    /// extent is not the value of its structural parameter, or if elements that state structural parameters do not form
    /// arrays whose elements all state the same, one for each dimension.
    pub(super) fn enter(&self, description: &mut ModelDescription) -> Result<(), Failure> {
        if self.by_element.is_empty() {
            return Ok(());
        }
        let parameters: HashMap<String, (u32, i128)> =
            description.variables.iter().filter_map(parameter).collect();
        let mut used = 0;
        for variable in &mut description.variables {
            let extents: Vec<u64> = variable.dimensions.iter().map(extent).collect();
            let first = element_name(&variable.name, &vec![1; extents.len()], 0);
            let Some(names) = self.by_element.get(&first) else { continue };
            let lengths: Vec<usize> =
                extents.iter().filter_map(|&extent| usize::try_from(extent).ok()).collect();
            let count: usize = lengths.iter().product();
            let mut elements = (0..count).map(|at| element_name(&variable.name, &lengths, at));
            if elements.all(|element| self.by_element.get(&element) == Some(names)) {
                variable.dimensions = references(&variable.name, &extents, names, &parameters)?;
                used += count;
            }
        }
        if used == self.by_element.len() {
            return Ok(());
        }
        let arrays = "every element of an array states the same structural parameters, and its elements \
                      follow one another in row-major order with the same attributes";
        Err(Failure::Error(format!(
            "{} elements of arrays state structural parameters, {used} of them belong to an array of \
             FMI 3.0: {arrays} (FMI 3.0.2, section 2.2.6.1)",
            self.by_element.len()
        )))
    }
}

/// Returns name, value reference and value of a structural parameter; `None` for other variables.
fn parameter(variable: &ScalarVariable) -> Option<(String, (u32, i128))> {
    match &variable.kind {
        Kind::UInt64(kind) if variable.causality == Causality::StructuralParameter => Some((
            variable.name.clone(),
            (variable.value_reference, kind.start.unwrap_or_default()),
        )),
        _ => None,
    }
}

/// Returns the extent of a dimension; 0 for a reference to a structural parameter.
fn extent(dimension: &Dimension) -> u64 {
    match dimension {
        Dimension::Fixed(extent) => *extent,
        Dimension::Variable(_) => 0,
    }
}

/// Returns the dimensions of an array whose extents are the values of the structural parameters `names`.
fn references(
    array: &str,
    extents: &[u64],
    names: &[String],
    parameters: &HashMap<String, (u32, i128)>,
) -> Result<Vec<Dimension>, Failure> {
    let wrong = |reason: String| Failure::Error(format!("array {array}: {reason}"));
    if extents.len() != names.len() {
        let (actual, expected) = (extents.len(), names.len());
        return Err(wrong(format!(
            "it has {actual} dimensions and {expected} structural parameters"
        )));
    }
    let reference = |(&extent, name): (&u64, &String)| match parameters.get(name) {
        Some(&(reference, value)) if value == i128::from(extent) => {
            Ok(Dimension::Variable(reference))
        }
        Some((_, value)) => {
            Err(wrong(format!("the extent is {extent}, expected {name} = {value}")))
        }
        None => Err(wrong(format!("{name} is no structural parameter"))),
    };
    extents.iter().zip(names).map(reference).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use serde::{Deserialize, Serialize};

    use super::*;
    use crate::{About, Model, Variable, describe, describe_3, problems};

    /// A vector of `LENGTH` elements whose extent is said to be n = 2; the last element states `OTHER`.
    #[derive(Clone, Serialize, Deserialize)]
    struct Vector<const LENGTH: usize, const OTHER: bool> {
        n: u64,
        v: Vec<f64>,
    }

    impl<const LENGTH: usize, const OTHER: bool> Model for Vector<LENGTH, OTHER> {
        const IDENTIFIER: &'static str = "Vector";

        fn about(&self) -> About {
            About::default()
        }

        fn new(_: &Path) -> Result<Self, Failure> {
            Ok(Self { n: 2, v: vec![0.0; LENGTH] })
        }

        fn variables(&self) -> Vec<Variable<Self>> {
            let v = Variable::real_array("v", "", &[LENGTH], |slave: &mut Self| &mut slave.v[..]);
            let by = |k| if OTHER && k + 1 == LENGTH { "m" } else { "n" };
            let v = v.enumerate().map(|(k, element)| element.parameter().sized_by(&[by(k)]));
            let n = Variable::structural("n", "", |slave: &mut Self| &mut slave.n);
            std::iter::once(n).chain(v).collect()
        }
    }

    /// The initial value of y depends on n.
    #[derive(Clone, Serialize, Deserialize)]
    struct Count {
        n: u64,
        y: f64,
    }

    impl Model for Count {
        const IDENTIFIER: &'static str = "Count";

        fn about(&self) -> About {
            About::default()
        }

        fn new(_: &Path) -> Result<Self, Failure> {
            Ok(Self { n: 2, y: 0.0 })
        }

        fn variables(&self) -> Vec<Variable<Self>> {
            let y = Variable::real("y", "", |count: &mut Self| &mut count.y);
            let n = Variable::structural("n", "", |count: &mut Self| &mut count.n);
            vec![n, y.output(&[]).initially(["n"])]
        }
    }

    #[test]
    fn a_description_of_fmi_2_states_no_dependency_on_a_structural_parameter() {
        assert_eq!(problems::<Count>(Path::new("")), Ok(vec![]));
        let description = describe::<Count>(Path::new("")).unwrap();
        assert!(description.problems().is_empty(), "{:?}", description.problems());
        assert_eq!(description.structure.initial_unknowns[0].dependencies, Some(vec![]));
    }

    fn refusal<M: Model>() -> String {
        let problem = problems::<M>(Path::new("")).unwrap_err().to_string();
        assert_eq!(describe_3::<M>(Path::new("")).unwrap_err().to_string(), problem);
        problem
    }

    #[test]
    fn an_array_has_the_extents_of_its_structural_parameters() {
        let description = describe_3::<Vector<2, false>>(Path::new("")).unwrap();
        let n = description.variable("n").unwrap().value_reference;
        assert_eq!(description.variable("v").unwrap().dimensions, [Dimension::Variable(n)]);
        assert_eq!(problems::<Vector<2, false>>(Path::new("")), Ok(vec![]));
    }

    #[test]
    fn an_extent_that_is_not_the_value_of_its_parameter_is_refused_by_name() {
        let refusal = refusal::<Vector<3, false>>();
        assert!(refusal.contains("array v") && refusal.contains("n = 2"), "{refusal}");
    }

    #[test]
    fn a_name_that_is_no_structural_parameter_is_refused() {
        let refusal = refusal::<Vector<1, true>>();
        assert!(refusal.contains("m is no structural parameter"), "{refusal}");
    }

    #[test]
    fn elements_of_an_array_with_different_structural_parameters_are_refused() {
        let refusal = refusal::<Vector<2, true>>();
        assert!(refusal.contains("states the same structural parameters"), "{refusal}");
    }
}
