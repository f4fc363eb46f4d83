//! The clocks of clocked variables.

use std::collections::HashMap;

use crate::model::Failure;
use crate::variable::Declaration;
use fmu_description::{Kind, ModelDescription};

/// The clocked variables of a model, by name, with the names of their clocks.
pub(crate) struct Clocks(Vec<(String, Vec<String>)>);

impl Clocks {
    pub(super) fn of(variables: &[Declaration]) -> Self {
        let clocked = variables.iter().filter(|variable| !variable.clocks.is_empty());
        Self(clocked.map(|variable| (variable.name.clone(), variable.clocks.clone())).collect())
    }

    /// Whether any variable is clocked.
    pub(crate) fn any(&self) -> bool {
        !self.0.is_empty()
    }

    /// Sets `clocks` of the variables of a description. An error for a name that is not the name of a clock.
    pub(super) fn enter(&self, description: &mut ModelDescription) -> Result<(), Failure> {
        // A map, because a search for each of the many elements of a clocked array would be slow.
        let indices: HashMap<String, u32> = (1..)
            .zip(&description.variables)
            .map(|(index, variable)| (variable.name.clone(), index))
            .collect();
        for (name, clocks) in &self.0 {
            let index = |clock: &String| {
                let index = indices.get(clock).copied();
                let is_clock = |index: &u32| {
                    matches!(description.variables[*index as usize - 1].kind, Kind::Clock(_))
                };
                index
                    .filter(is_clock)
                    .ok_or_else(|| Failure::Error(format!("variable {name}: {clock} is no clock")))
            };
            let clocks = clocks.iter().map(index).collect::<Result<Vec<_>, _>>()?;
            if let Some(&index) = indices.get(name) {
                description.variables[index as usize - 1].clocks = clocks;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use fmu_description::Dimension;
    use serde::{Deserialize, Serialize};

    use super::*;
    use crate::{About, Model, ModelExchange, Variable, describe, describe_3, problems};

    /// A gain with a clock, on which the output depends, and whose alias comes first.
    #[derive(Clone, Serialize, Deserialize)]
    struct Gain {
        tick: bool,
        u: f64,
        y: f64,
    }

    impl Model for Gain {
        const IDENTIFIER: &'static str = "Gain";

        fn about(&self) -> About {
            About::default()
        }

        fn new(_: &Path) -> Result<Self, Failure> {
            Ok(Self { tick: false, u: 0.0, y: 0.0 })
        }

        fn variables(&self) -> Vec<Variable<Self>> {
            vec![
                Variable::alias("beat", "", "tick"),
                Variable::triggered_clock("tick", "", |gain: &mut Self| &mut gain.tick).input(),
                Variable::real("u", "", |gain: &mut Self| &mut gain.u).input(),
                Variable::real("y", "", |gain: &mut Self| &mut gain.y).output(&["tick", "u"]),
            ]
        }
    }

    /// Two clocks, two inputs with derivatives, and two outputs of the second clock.
    #[derive(Clone, Serialize, Deserialize)]
    struct Vector {
        ticks: [bool; 2],
        u: [f64; 2],
        slopes: [f64; 2],
        y: [f64; 2],
    }

    impl Model for Vector {
        const IDENTIFIER: &'static str = "Vector";

        fn about(&self) -> About {
            About::default()
        }

        fn new(_: &Path) -> Result<Self, Failure> {
            Ok(Self { ticks: [false; 2], u: [0.0; 2], slopes: [0.0; 2], y: [0.0; 2] })
        }

        fn variables(&self) -> Vec<Variable<Self>> {
            let clock = |k: usize| {
                let name = format!("tick[{}]", k + 1);
                Variable::triggered_clock(name, "", move |all: &mut Self| &mut all.ticks[k]).input()
            };
            let u = Variable::real_array("u", "", &[2], |all: &mut Self| &mut all.u[..]);
            let u = u.enumerate().map(|(k, element)| {
                element.input().derivative(move |all: &mut Self| &mut all.slopes[k])
            });
            let y = Variable::real_array("y", "", &[2], |all: &mut Self| &mut all.y[..]);
            let y = y.map(|element| element.output(&[]).discrete().clocked_by(&["tick[2]"]));
            (0..2).map(clock).chain(u).chain(y).collect()
        }

        fn model_exchange(&self) -> Option<ModelExchange> {
            Some(ModelExchange::default())
        }
    }

    #[test]
    fn an_array_has_the_clocks_and_the_intermediate_update_of_its_elements() {
        assert_eq!(problems::<Vector>(Path::new("")), Ok(vec![]));
        let description = describe_3::<Vector>(Path::new("")).unwrap();
        let (u, y) = (description.variable("u").unwrap(), description.variable("y").unwrap());
        assert!(u.intermediate_update && u.dimensions == [Dimension::Fixed(2)], "{u:?}");
        assert_eq!(y.dimensions, [Dimension::Fixed(2)]);
        let clocks: Vec<_> = y.clocks.iter().map(|&clock| description.at(clock).unwrap()).collect();
        assert_eq!(clocks, [description.variable("tick[2]").unwrap()]);
    }

    #[test]
    fn a_clocked_output_depends_on_its_input_clock() {
        let description = describe_3::<Vector>(Path::new("")).unwrap();
        let rows = description.structure.outputs.iter();
        let knowns: Vec<_> = rows.map(|row| row.dependencies.clone().unwrap()).collect();
        let clock = description.variable("tick[2]").unwrap();
        assert_eq!(knowns.len(), 1);
        let knowns: Vec<_> =
            knowns[0].iter().map(|&known| description.at(known).unwrap()).collect();
        assert_eq!(knowns, [clock]);
    }

    #[test]
    fn a_description_of_fmi_2_has_neither_clocks_nor_their_aliases() {
        let description = describe::<Gain>(Path::new("")).unwrap();
        let names = description.variables.iter().map(|variable| variable.name.as_str());
        assert_eq!(names.collect::<Vec<_>>(), ["time", "u", "y"]);
        let rows = description.structure.outputs.iter();
        let rows: Vec<_> = rows.map(|row| (row.index, row.dependencies.as_deref())).collect();
        assert_eq!(rows, [(3, Some(&[2][..]))]);
        assert!(description.problems().is_empty(), "{:?}", description.problems());
    }
}
